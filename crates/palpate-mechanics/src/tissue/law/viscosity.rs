//! Kelvin-Voigt viscosity: the second Piola-Kirchhoff stress
//! `S = beta (lambda tr(Ė) I + 2 mu Ė)`, `Ė = (E(x) - E(start)) / dt`.
//!
//! Green's strain E makes it blind to rotation; its product with Ė is never negative, so it only takes
//! energy. Over a step it has the potential `dt beta (lambda/2 tr(Ė)² + mu Ė:Ė)` in x. Source: Bonet,
//! Wood, "Nonlinear Continuum Mechanics for Finite Element Analysis", 2008; in incremental form Kane
//! et al., Int. J. Numer. Meth. Eng. 49 (2000).

use super::super::matrix::{self, Matrix};
use super::super::real::Real;
use super::Lame;
use super::saint_venant_kirchhoff::green_strain;

/// Viscosity of one region during one step.
#[derive(Clone, Copy)]
pub(in super::super) struct Viscosity {
    /// `beta / dt` times Lamé's parameters [Pa].
    lame: Lame,
}

/// The entries of a symmetric matrix that are stored: xx, yy, zz, xy, yz, xz, as in VTK files.
pub(in super::super) const SYMMETRIC: [[usize; 2]; 6] =
    [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]];

/// Green's strain in the order of [`SYMMETRIC`].
#[inline(always)]
pub(in super::super) fn packed_strain<R: Real>(f: &Matrix<R>) -> [R; 6] {
    let strain = green_strain(f);
    let mut result = [strain[0][0]; 6];
    for entry in 0..6 {
        let [row, col] = SYMMETRIC[entry];
        result[entry] = strain[row][col];
    }
    result
}

impl Viscosity {
    /// `time` is beta [s], `step` dt [s].
    pub(in super::super) fn new(lame: Lame, time: f64, step: f64) -> Self {
        let factor = time / step;
        Self { lame: Lame { mu: factor * lame.mu, lambda: factor * lame.lambda } }
    }

    /// Potential of the step [J/m³]; `start` is the strain where the step begins.
    #[inline(always)]
    pub(in super::super) fn energy<R: Real>(&self, f: &Matrix<R>, start: &[R; 6]) -> R {
        let change = change_of_strain(f, start);
        let trace = change[0] + change[1] + change[2];
        let axial = change[0] * change[0] + change[1] * change[1] + change[2] * change[2];
        let shear = change[3] * change[3] + change[4] * change[4] + change[5] * change[5];
        trace.splat(0.5 * self.lame.lambda) * trace * trace
            + trace.splat(self.lame.mu) * (axial + shear + shear)
    }

    /// First Piola-Kirchhoff stress [Pa].
    #[inline(always)]
    pub(in super::super) fn stress<R: Real>(&self, f: &Matrix<R>, start: &[R; 6]) -> Matrix<R> {
        let change = change_of_strain(f, start);
        let two_mu = change[0].splat(2.0 * self.lame.mu);
        let pressure = two_mu.splat(self.lame.lambda) * (change[0] + change[1] + change[2]);
        let mut stress = matrix::zero(two_mu);
        for entry in 0..6 {
            let [row, col] = SYMMETRIC[entry];
            stress[row][col] = two_mu * change[entry];
            stress[col][row] = stress[row][col];
        }
        matrix::multiply(f, &matrix::add_diagonal(&stress, pressure))
    }

    /// Stiffness between two nodes, where the step begins, by what F makes of their shape gradients,
    /// the product of these, and `F Fᵀ`.
    #[inline(always)]
    pub(in super::super) fn block<R: Real>(
        &self,
        a: &[R; 3],
        b: &[R; 3],
        product: R,
        square: &Matrix<R>,
    ) -> Matrix<R> {
        let (mu, lambda) = (product.splat(self.lame.mu), product.splat(self.lame.lambda));
        let mut result = matrix::scale(mu * product, square);
        for row in 0..3 {
            for col in 0..3 {
                result[row][col] =
                    result[row][col] + lambda * a[row] * b[col] + mu * b[row] * a[col];
            }
        }
        result
    }
}

#[inline(always)]
fn change_of_strain<R: Real>(f: &Matrix<R>, start: &[R; 6]) -> [R; 6] {
    let mut change = packed_strain(f);
    for entry in 0..6 {
        change[entry] = change[entry] - start[entry];
    }
    change
}
