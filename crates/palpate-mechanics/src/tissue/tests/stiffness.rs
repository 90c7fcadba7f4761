//! The stiffness of an element from its principal stretches, against the derivative of its stress by
//! dual numbers, whose negative part is taken out numerically.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_solver::BlockMatrix;
use proptest::prelude::*;

use super::super::law::{self, Directions, ElementLaw, Law, Name, with_law};
use super::super::projection::without_negative;
use super::super::real::Real;
use super::super::{ELEMENT_RATIO, Tissue, TissueInput, VolumeAveraging, dual};
use super::support::{DIRECTIONS, YOUNG, dot, law_named, laws, matrices, matrix, rotations, rows};

/// Its gradients are the axes, so that its blocks are the tangent itself, times its volume.
const REST: [Point; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

type Tangent = [[f64; 9]; 9];

/// Jacobi sweeps that leave nothing beside the diagonal of any tangent.
const TO_ROUND_OFF: usize = 15;

fn tissue(law: Law, viscosity: f64) -> Tissue {
    Tissue::new(&TissueInput {
        rest: &REST,
        tetrahedra: &[[0, 1, 2, 3]],
        laws: &[law],
        regions: &[],
        fibres: &[DIRECTIONS],
        viscosity,
        averaging: VolumeAveraging::Automatic,
    })
}

/// Blocks of all pairs of corners at deformation gradient `f`, where a step begins.
fn stiffness(law: Law, viscosity: f64, f: DMat3) -> [[DMat3; 4]; 4] {
    let mut tissue = tissue(law, viscosity);
    let x = REST.map(|x| (f * DVec3::from_array(x)).to_array());
    tissue.begin_step(&x, 0.01);
    let mut matrix = BlockMatrix::zeros(Arc::clone(tissue.pattern()));
    tissue.add_stiffness(&x, &mut matrix);
    let block = |row: usize, col: usize| {
        let place = matrix.pattern().find(row.max(col) as u32, row.min(col) as u32).unwrap();
        let block = DMat3::from_cols_array_2d(&matrix.blocks()[place]);
        if row >= col { block.transpose() } else { block }
    };
    std::array::from_fn(|row| std::array::from_fn(|col| block(row, col)))
}

fn tangent_of(blocks: &[[DMat3; 4]; 4]) -> Tangent {
    let entry =
        |row: usize, col: usize| 6.0 * blocks[row % 3 + 1][col % 3 + 1].row(row / 3)[col / 3];
    std::array::from_fn(|row| std::array::from_fn(|col| entry(row, col)))
}

/// Derivative of `stress`, which takes the deformation gradient along a direction.
fn derivative(stress: impl Fn(DMat3) -> DMat3) -> Tangent {
    let mut result = [[0.0; 9]; 9];
    for col in 0..9 {
        let mut along = [0.0; 9];
        along[col] = 1.0;
        let change = stress(DMat3::from_cols_array(&along).transpose()).transpose();
        for (row, value) in change.to_cols_array().into_iter().enumerate() {
            result[row][col] = value;
        }
    }
    result
}

fn law_tangent(law: Law, f: DMat3) -> Tangent {
    derivative(|along| {
        let f = dual::join(&rows(f), &rows(along));
        let directions: Directions<_> = DIRECTIONS.map(|d| d.map(|value| f[0][0].splat(value)));
        with_law!(law, law => matrix(&dual::split(&law.stress(&f, &directions)).1))
    })
}

fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

/// Derivative of `(pressure + slope (J - J(f))) cof F`.
fn volume_tangent(pressure: f64, slope: f64, f: DMat3) -> Tangent {
    derivative(|along| {
        let curvature = (cofactor(f + along) - cofactor(f - along)) * 0.5;
        slope * dot(cofactor(f), along) * cofactor(f) + pressure * curvature
    })
}

fn combined(a: &Tangent, factor: f64, b: &Tangent) -> Tangent {
    std::array::from_fn(|row| std::array::from_fn(|col| a[row][col] + factor * b[row][col]))
}

fn largest(tangent: &Tangent) -> f64 {
    tangent.as_flattened().iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Whether two stretches of an inverted element nearly cancel, where its rotation is about to jump and
/// is found less exactly.
fn is_about_to_jump(f: DMat3) -> bool {
    let (_, stretches, _) = super::super::principal::axes(&rows(f));
    let [a, b, c] = stretches.map(f64::abs);
    let apart = (a - b).abs().min((b - c).abs()).min((c - a).abs());
    f.determinant() <= 0.1 && apart <= 0.2
}

fn without_fibres(law: Law) -> Law {
    match law.material.law {
        Name::HolzapfelGasserOgden => law_named(Name::NeoHookean).with_lambda(law.lame().lambda),
        _ => law,
    }
}

proptest! {
    #[test]
    fn the_stiffness_is_the_projected_derivative_of_the_stress(
        f in matrices(1.5),
        upright in any::<bool>(),
        stiff in any::<bool>(),
    ) {
        let f = if upright { f + DMat3::IDENTITY } else { f };
        prop_assume!(!is_about_to_jump(f));
        for law in laws() {
            // A corotated element jumps where two stretches cancel.
            prop_assume!(law.material.law != Name::Corotated || f.determinant() > 0.02);
            let mu = law.lame().mu;
            let law = if stiff { law.with_lambda(60.0 * mu) } else { law };
            let (element, pressure, slope) = if stiff {
                let averaged = (60.0 - ELEMENT_RATIO) * mu;
                let element = law.with_lambda(ELEMENT_RATIO * mu);
                (element, averaged * (f.determinant() - 1.0), averaged)
            } else {
                (law, 0.0, 0.0)
            };
            let isotropic = law_tangent(without_fibres(element), f);
            let fibres = combined(&law_tangent(element, f), -1.0, &isotropic);
            let isotropic = combined(&isotropic, 1.0, &volume_tangent(pressure, slope, f));
            let exact = combined(&without_negative(&isotropic, TO_ROUND_OFF), 1.0, &fibres);
            let blocks = stiffness(law, 0.0, f);
            let error = largest(&combined(&tangent_of(&blocks), -1.0, &exact));
            let size = largest(&exact) + largest(&isotropic);
            // Six digits are plenty for a matrix whose errors the iterations put right.
            prop_assert!(error <= 2e-6 * size, "{law:?}: {error} of {size}");
            // Moving all corners together costs nothing.
            for row in 0..4 {
                let sum: DMat3 = blocks[row].iter().sum();
                prop_assert!(largest(&derivative(|_| sum)) <= 1e-12 * size);
            }
        }
    }

    #[test]
    fn viscous_stiffness_is_the_derivative_where_the_step_begins(f in matrices(0.8), r in rotations()) {
        let law = laws()[2];
        let f = r * (f + DMat3::IDENTITY);
        let viscous = tangent_of(&stiffness(law, 0.03, f));
        let found = combined(&viscous, -1.0, &tangent_of(&stiffness(law, 0.0, f)));
        let (mu, lambda) = (3.0 * law.lame().mu, 3.0 * law.lame().lambda);
        let exact = derivative(|along| {
            let rate = 0.5 * (f.transpose() * along + along.transpose() * f);
            let trace = rate.x_axis.x + rate.y_axis.y + rate.z_axis.z;
            f * (lambda * trace * DMat3::IDENTITY + 2.0 * mu * rate)
        });
        let error = largest(&combined(&found, -1.0, &exact));
        prop_assert!(error <= 1e-10 * (largest(&viscous) + YOUNG), "{error}");
    }

    #[test]
    fn axes_and_stretches_make_the_deformation(f in matrices(2.0)) {
        let (u, stretches, v) = super::super::principal::axes(&rows(f));
        let (u, v) = (matrix(&u), matrix(&v));
        let rest = u * DMat3::from_diagonal(DVec3::from_array(stretches)) * v.transpose() - f;
        prop_assume!(!is_about_to_jump(f));
        let tolerance = if f.determinant() > 0.1 { 1e-9 } else { 1e-3 };
        prop_assert!(dot(rest, rest).sqrt() < tolerance, "{rest}");
        for turn in [u, v] {
            prop_assert!((turn.determinant() - 1.0).abs() < 1e-12);
            prop_assert!((turn * turn.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
        }
    }
}
