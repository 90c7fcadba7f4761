//! Cook's membrane: bending and shear of nearly incompressible tissue.

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::Material;
use palpate_solver::{BlockMatrix, Cholesky};

use super::super::law::{Law, Name};
use super::super::{Tissue, TissueInput, VolumeAveraging};
use super::support::{block, inner, material, moved};

/// Vertical displacement of the upper right corner for E = 1 and a load of 1 per thickness, plane
/// strain, small displacements, nu = 0.4999: quadratic-linear Taylor-Hood triangles, 8² to 128² cells
/// (19.210, 19.328, 19.380, 19.405, 19.417), extrapolated.
const EXACT: f64 = 19.43;

/// Of 1 per thickness.
const LOAD: f64 = 1e-6;

struct Membrane {
    rest: Vec<Point>,
    tetrahedra: Vec<[u32; 4]>,
    load: Vec<Point>,
    /// Components that may move.
    free: Vec<[bool; 3]>,
    corner: usize,
}

impl Membrane {
    fn new(cells: usize) -> Self {
        let thickness = 48.0 / cells as f64;
        let (mut rest, tetrahedra) = block([cells, cells, 1], 1.0 / cells as f64);
        let side = cells + 1;
        let mut load = vec![[0.0; 3]; rest.len()];
        let mut free = vec![[true, true, false]; rest.len()];
        for node in 0..rest.len() {
            let [s, t, z] = rest[node];
            rest[node] = [48.0 * s, 44.0 * s * (1.0 - t) + (44.0 + 16.0 * s) * t, 48.0 * z];
            if s == 0.0 {
                free[node] = [false; 3];
            }
            if s > 1.0 - 1e-9 {
                // Half of each edge of each of the two layers.
                let end = [0, cells].contains(&(node / side % side));
                load[node][1] = thickness / cells as f64 * if end { 0.25 } else { 0.5 };
            }
        }
        Self { rest, tetrahedra, load, free, corner: side * side - 1 }
    }

    /// Displacements under a load small enough for one Newton step.
    fn solve(&self, law: Law, averaging: VolumeAveraging) -> Vec<Point> {
        let mut tissue = Tissue::new(&TissueInput {
            rest: &self.rest,
            tetrahedra: &self.tetrahedra,
            laws: &[law],
            regions: &[],
            fibres: &[],
            viscosity: 0.0,
            averaging,
        });
        let mut load: Vec<Point> = self.load.iter().map(|f| f.map(|f| LOAD * f)).collect();
        self.constrain(&mut load);
        self.newton_step(&mut tissue, &load)
    }

    fn constrain(&self, vector: &mut [Point]) {
        for (value, free) in vector.iter_mut().zip(&self.free) {
            for axis in 0..3 {
                if !free[axis] {
                    value[axis] = 0.0;
                }
            }
        }
    }

    /// Conjugate gradients on the exact tangent, preconditioned by the factored element stiffness.
    fn newton_step(&self, tissue: &mut Tissue, rhs: &[Point]) -> Vec<Point> {
        let x = &self.rest;
        let mut matrix = BlockMatrix::zeros(Arc::clone(tissue.pattern()));
        tissue.add_stiffness(x, &mut matrix);
        for (node, free) in self.free.iter().enumerate() {
            let place = matrix.pattern().find(node as u32, node as u32).unwrap();
            for axis in 0..3 {
                if !free[axis] {
                    matrix.blocks_mut()[place][axis][axis] += 1e9;
                }
            }
        }
        let factor = Cholesky::new(&matrix).unwrap();
        let mut work = factor.workspace();
        let mut solution = vec![[0.0; 3]; x.len()];
        let mut residual = rhs.to_vec();
        let mut direction = vec![[0.0; 3]; x.len()];
        let mut product = vec![[0.0; 3]; x.len()];
        let (mut last, goal) = (f64::INFINITY, 1e-10 * inner(rhs, rhs));
        for _ in 0..3000 {
            let mut preconditioned = residual.clone();
            factor.solve_in_place(&mut preconditioned, &mut work);
            self.constrain(&mut preconditioned);
            let now = inner(&preconditioned, &residual);
            if inner(&residual, &residual) < goal {
                return solution;
            }
            direction = moved(&preconditioned, now / last, &direction);
            tissue.multiply(x, &direction, &mut product);
            self.constrain(&mut product);
            let length = now / inner(&direction, &product);
            assert!(length > 0.0, "the tangent is positive");
            solution = moved(&solution, length, &direction);
            residual = moved(&residual, -length, &product);
            last = now;
        }
        panic!("not converged");
    }
}

#[test]
fn membranes_of_nearly_incompressible_tissue_bend() {
    let law = Law::new(&Material { young: 1.0, poisson: 0.4999, ..material(Name::NeoHookean) }, 1);
    let deflection = |cells: usize, averaging: VolumeAveraging| {
        let membrane = Membrane::new(cells);
        membrane.solve(law, averaging)[membrane.corner][1] / LOAD / EXACT
    };
    let coarse = deflection(16, VolumeAveraging::Automatic);
    let fine = deflection(64, VolumeAveraging::Automatic);
    assert!((coarse - 1.0).abs() < 0.17, "16 cells: {coarse}");
    assert!((fine - 1.0).abs() < 0.03, "64 cells: {fine}");
    // Without the means the mesh locks.
    let locked = deflection(16, VolumeAveraging::Never);
    assert!(locked < 0.3, "16 cells, not averaged: {locked}");
}
