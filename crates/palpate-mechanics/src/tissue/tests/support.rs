//! Laws, deformations and bodies for the tests.

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;
use palpate_model::Material;
use palpate_testing::{Fastest, box_of_cells};
use proptest::prelude::*;

use super::super::law::{self, Directions, ElementLaw, Law, Name, with_law};
use super::super::matrix::Matrix;
use super::super::{Tissue, TissueInput, VolumeAveraging};

pub(super) const YOUNG: f64 = 3_000.0;
pub(super) const POISSON: f64 = 0.4;

/// Every law, with the same elasticity at small strain (the matrix alone where there are fibres).
pub(super) fn laws() -> Vec<Law> {
    let with = |name| Material { k1: 900.0, k2: 2.0, mooney: 0.3, ..material(name) };
    let names = Name::ALL.into_iter().filter(|&name| name != Name::Linear);
    let dispersed = Material { kappa: 0.2, ..with(Name::HolzapfelGasserOgden) };
    let once = names.map(|name| Law::new(&with(name), 1));
    once.chain([Law::new(&dispersed, 2)]).collect()
}

/// A law with the elasticity of [`laws`].
pub(super) fn law_named(name: Name) -> Law {
    Law::new(&material(name), 1)
}

pub(super) fn material(law: Name) -> Material {
    Material { law, young: YOUNG, poisson: POISSON, ..Material::default() }
}

/// Factors `c10`, `c01` [Pa] of the two invariants in Mooney-Rivlin.
pub(super) fn mooney_factors(law: Law) -> [f64; 2] {
    let half = 0.5 * law.lame().mu;
    [half * (1.0 - law.material.mooney), half * law.material.mooney]
}

/// Two unit directions that are neither parallel nor along an axis.
pub(super) const DIRECTIONS: Directions<f64> = [[0.48, 0.6, 0.64], [-0.6, 0.8, 0.0]];

pub(super) fn energy(law: Law, f: DMat3) -> f64 {
    with_law!(law, law => law.energy(&rows(f), &DIRECTIONS))
}

pub(super) fn stress(law: Law, f: DMat3) -> DMat3 {
    stress_along(law, f, &DIRECTIONS)
}

pub(super) fn stress_along(law: Law, f: DMat3, directions: &Directions<f64>) -> DMat3 {
    with_law!(law, law => matrix(&law.stress(&rows(f), directions)))
}

pub(super) fn rows(m: DMat3) -> Matrix<f64> {
    m.transpose().to_cols_array_2d()
}

pub(super) fn matrix(m: &Matrix<f64>) -> DMat3 {
    DMat3::from_cols_array_2d(m).transpose()
}

pub(super) fn dot(a: DMat3, b: DMat3) -> f64 {
    a.to_cols_array().iter().zip(b.to_cols_array()).map(|(a, b)| a * b).sum()
}

pub(super) fn norm(a: DMat3) -> f64 {
    dot(a, a).sqrt()
}

/// Entries within ±`size`.
pub(super) fn matrices(size: f64) -> impl Strategy<Value = DMat3> {
    prop::array::uniform9(-size..size).prop_map(|m| DMat3::from_cols_array(&m))
}

pub(super) fn rotations() -> impl Strategy<Value = DMat3> {
    prop::array::uniform3(-3.0..3.0)
        .prop_map(|w: [f64; 3]| DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from_array(w))))
}

/// A block of `cells` cells of size `edge` [m], six tetrahedra each.
pub(super) fn block(cells: [usize; 3], edge: f64) -> (Vec<Point>, Vec<[u32; 4]>) {
    box_of_cells(cells, Fastest::First, |at| at.map(|index| edge * index))
}

/// A body in two regions, the second one the tetrahedra with an odd index.
pub(super) struct TestBody {
    pub(super) rest: Vec<Point>,
    pub(super) tetrahedra: Vec<[u32; 4]>,
    pub(super) regions: Vec<u32>,
    pub(super) fibres: Vec<Directions<f64>>,
    pub(super) laws: [Law; 2],
    pub(super) viscosity: f64,
}

impl TestBody {
    /// `shift` moves the rest nodes, as fractions of a cell, again from the start when it ends.
    pub(super) fn new(laws: &[Law; 2], viscosity: f64, shift: &[f64]) -> Self {
        let (mut rest, tetrahedra) = block([2, 2, 1], 0.1);
        for (value, shift) in rest.as_flattened_mut().iter_mut().zip(shift.iter().cycle()) {
            *value += 0.1 * shift;
        }
        let regions = (0..tetrahedra.len() as u32).map(|index| index % 2).collect();
        let fibres = (0..tetrahedra.len())
            .map(|index| {
                let turn = DMat3::from_rotation_z(0.3 * index as f64);
                DIRECTIONS.map(|d| (turn * DVec3::from_array(d)).to_array())
            })
            .collect();
        Self { rest, tetrahedra, regions, fibres, laws: *laws, viscosity }
    }

    pub(super) fn tissue(&self, averaging: VolumeAveraging) -> Tissue {
        Tissue::new(&TissueInput {
            rest: &self.rest,
            tetrahedra: &self.tetrahedra,
            laws: &self.laws,
            regions: &self.regions,
            fibres: &self.fibres,
            viscosity: self.viscosity,
            averaging,
        })
    }
}

/// `x + factor d` for every node.
pub(super) fn moved(x: &[Point], factor: f64, d: &[Point]) -> Vec<Point> {
    let pairs = x.iter().zip(d);
    pairs.map(|(x, d)| std::array::from_fn(|axis| x[axis] + factor * d[axis])).collect()
}

pub(super) fn inner(a: &[Point], b: &[Point]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}
