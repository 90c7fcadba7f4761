//! The obvious way: one tetrahedron after the other, in matrices, without lanes and buffers.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_model::Material;
use proptest::prelude::*;

use pulp::WithSimd;

use super::super::kernel::{Forces, Pass};
use super::super::law::{self, Directions, Lame, Law, Name, with_law};
use super::super::wide::LANES;
use super::super::{ELEMENT_RATIO, STIFF_RATIO, VolumeAveraging};
use super::support::{TestBody, laws, mooney_factors, moved};

fn trace(a: DMat3) -> f64 {
    a.x_axis.x + a.y_axis.y + a.z_axis.z
}

/// Polar factor by Newton's iteration (Higham), for elements that are not inverted.
fn polar_factor(f: DMat3) -> DMat3 {
    let mut r = f;
    for _ in 0..60 {
        r = 0.5 * (r + r.inverse().transpose());
    }
    r
}

fn stress(law: Law, f: DMat3, directions: &Directions<f64>) -> DMat3 {
    let Lame { mu, lambda } = law.lame();
    let c = f.transpose() * f;
    let volume = f.determinant();
    let volume_slope = volume * f.inverse().transpose();
    match law.material.law {
        Name::Corotated => {
            let r = polar_factor(f);
            2.0 * mu * (f - r) + lambda * (trace(r.transpose() * f) - 3.0) * r
        }
        Name::SaintVenantKirchhoff => {
            let strain = 0.5 * (c - DMat3::IDENTITY);
            f * (lambda * trace(strain) * DMat3::IDENTITY + 2.0 * mu * strain)
        }
        Name::NeoHookean => {
            let (m, l) = (4.0 / 3.0 * mu, lambda + 5.0 / 6.0 * mu);
            m * (1.0 - 1.0 / (trace(c) + 1.0)) * f
                + l * (volume - 1.0 - 0.75 * m / l) * volume_slope
        }
        Name::MooneyRivlin => {
            let [c10, c01] = mooney_factors(law);
            let l = lambda + 2.0 * c10;
            2.0 * c10 * f
                + 2.0 * c01 * (trace(c) * f - f * c)
                + (l * (volume - 1.0) - 2.0 * c10 - 4.0 * c01) * volume_slope
        }
        Name::HolzapfelGasserOgden => {
            let fibres = law.material;
            let matrix = Material { law: Name::NeoHookean, ..fibres };
            let mut sum = stress(Law::new(&matrix, 1).with_lambda(lambda), f, directions);
            for direction in &directions[..law.families()] {
                let a = DVec3::from_array(*direction);
                let structure = fibres.kappa * DMat3::IDENTITY
                    + (1.0 - 3.0 * fibres.kappa) * DMat3::from_cols(a.x * a, a.y * a, a.z * a);
                let strain = trace(c * structure) - 1.0;
                if strain > 0.0 {
                    let slope = 2.0 * fibres.k1 * strain * (fibres.k2 * strain * strain).exp();
                    sum += slope * f * structure;
                }
            }
            sum
        }
        other => panic!("{other}"),
    }
}

/// Forces of `body` at `x`, in a step of `time_step` that began at `start`.
fn forces(body: &TestBody, start: &[Point], time_step: f64, x: &[Point]) -> Vec<DVec3> {
    let edges = |positions: &[Point], corners: [u32; 4]| {
        let [a, b, c, d] = corners.map(|node| DVec3::from_array(positions[node as usize]));
        DMat3::from_cols(b - a, c - a, d - a)
    };
    let averages = |region: usize| {
        let Lame { mu, lambda } = body.laws[region].lame();
        lambda > STIFF_RATIO * mu
    };
    // Rest and current volume of each node in each region.
    let mut volumes: BTreeMap<(u32, usize), (f64, f64)> = BTreeMap::new();
    for (&corners, &region) in body.tetrahedra.iter().zip(&body.regions) {
        for node in corners {
            let (rest, now) = volumes.entry((node, region as usize)).or_default();
            *rest += edges(&body.rest, corners).determinant() / 24.0;
            *now += edges(x, corners).determinant() / 24.0;
        }
    }
    let mut sum = vec![DVec3::ZERO; x.len()];
    for (index, &corners) in body.tetrahedra.iter().enumerate() {
        let region = body.regions[index] as usize;
        let inverse = edges(&body.rest, corners).inverse();
        let volume = edges(&body.rest, corners).determinant() / 6.0;
        let f = edges(x, corners) * inverse;
        let law = body.laws[region];
        let mut lame = law.lame();
        let mut pressure = 0.0;
        if averages(region) {
            let averaged = lame.lambda - ELEMENT_RATIO * lame.mu;
            lame.lambda = ELEMENT_RATIO * lame.mu;
            for node in corners {
                let (rest, now) = volumes[&(node, region)];
                pressure += 0.25 * averaged * (now / rest - 1.0);
            }
        }
        let mut total = stress(law.with_lambda(lame.lambda), f, &body.fibres[index]);
        total += pressure * f.determinant() * f.inverse().transpose();
        let before = edges(start, corners) * inverse;
        let rate = (0.5 / time_step) * (f.transpose() * f - before.transpose() * before);
        total += body.viscosity
            * f
            * (lame.lambda * trace(rate) * DMat3::IDENTITY + 2.0 * lame.mu * rate);
        let per_edge = -volume * total * inverse.transpose();
        for k in 0..3 {
            sum[corners[k + 1] as usize] += per_edge.col(k);
            sum[corners[0] as usize] -= per_edge.col(k);
        }
    }
    sum
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn forces_are_those_of_the_twin(
        shift in prop::collection::vec(-0.15..0.15_f64, 20),
        displacement in prop::collection::vec(prop::array::uniform3(-0.015..0.015_f64), 18),
        velocity in prop::collection::vec(prop::array::uniform3(-0.01..0.01_f64), 18),
        first in 0..6_usize,
        second in 0..6_usize,
        stiff in any::<bool>(),
        viscosity in prop::sample::select(vec![0.0, 0.02]),
    ) {
        let mut pair = [laws()[first], laws()[second]];
        if stiff {
            pair[0] = pair[0].with_lambda(60.0 * pair[0].lame().mu);
        }
        let body = TestBody::new(&pair, viscosity, &shift);
        let start = moved(&body.rest, 1.0, &displacement);
        let x = moved(&start, 1.0, &velocity);
        let mut tissue = body.tissue(VolumeAveraging::Automatic);
        tissue.begin_step(&start, 0.01);
        let mut found = vec![[0.0; 3]; x.len()];
        tissue.forces(&x, &mut found);
        let exact = forces(&body, &start, 0.01, &x);
        let scale = exact.iter().map(|f| f.length()).fold(0.0, f64::max);
        for (found, exact) in found.iter().zip(exact) {
            let error = (DVec3::from_array(*found) - exact).length();
            prop_assert!(error <= 1e-10 * scale, "{found:?} instead of {exact}");
        }
    }
}

#[test]
fn the_vector_unit_does_not_change_the_bits() {
    let shift = [0.1, -0.07, 0.13, 0.02, -0.11];
    let motion: Vec<Point> = (0..18)
        .map(|node| [0.02, -0.013, 0.007].map(|size| size * f64::sin(3.0 * f64::from(node) + size)))
        .collect();
    for law in laws() {
        let body = TestBody::new(&[law; 2], 0.02, &shift);
        let mut tissue = body.tissue(VolumeAveraging::Automatic);
        tissue.begin_step(&body.rest, 0.01);
        let x = moved(&body.rest, 1.0, &motion);
        let mut forces = vec![[0.0; 3]; x.len()];
        tissue.forces(&x, &mut forces);
        let wide = tissue.corner_forces.clone();
        let narrow = &mut tissue.corner_forces;
        narrow.fill([[[0.0; LANES]; 3]; 4]);
        for batch in &tissue.elements.batches {
            let input = tissue.elements.batch_input(batch, &x, &[]);
            let task = &mut Forces { forces: &mut narrow[batch.groups.clone()] };
            with_law!(batch.law, law => Pass { law, input, task }.with_simd(pulp::Scalar));
        }
        assert!(wide == *narrow, "{law:?}");
    }
}
