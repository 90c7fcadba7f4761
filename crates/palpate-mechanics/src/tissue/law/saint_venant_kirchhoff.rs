//! St. Venant-Kirchhoff: `W = lambda/2 tr(E)² + mu E:E`, `E = (FᵀF - I)/2`.
//!
//! Source: Bonet, Wood, "Nonlinear Continuum Mechanics for Finite Element Analysis", 2008, section
//! 6.3. Known limit: under compression along one direction the force falls again below a stretch of
//! 1/√3 and is zero for a flat element, so that it collapses and inverts. Use it in tension.

use super::super::matrix::{self, Matrix};
use super::super::principal::{OTHERS, PrincipalTangent};
use super::super::real::Real;
use super::{Directions, ElementLaw, Lame, Law};

#[derive(Clone, Copy)]
pub(in super::super) struct SaintVenantKirchhoff {
    lame: Lame,
}

impl SaintVenantKirchhoff {
    pub(in super::super) fn new(law: &Law) -> Self {
        Self { lame: law.lame }
    }
}

/// Green's strain.
#[inline(always)]
pub(super) fn green_strain<R: Real>(f: &Matrix<R>) -> Matrix<R> {
    let half = f[0][0].splat(0.5);
    let c = matrix::scale(half, &matrix::transpose_multiply(f, f));
    matrix::add_diagonal(&c, -half)
}

impl ElementLaw for SaintVenantKirchhoff {
    const FAMILIES: usize = 0;

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> R {
        let like = f[0][0];
        let strain = green_strain(f);
        let trace = matrix::trace(&strain);
        like.splat(self.lame.mu) * matrix::dot(&strain, &strain)
            + like.splat(0.5 * self.lame.lambda) * trace * trace
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> Matrix<R> {
        let like = f[0][0];
        let strain = green_strain(f);
        let pressure = like.splat(self.lame.lambda) * matrix::trace(&strain);
        let stress = matrix::scale(like.splat(2.0 * self.lame.mu), &strain);
        matrix::multiply(f, &matrix::add_diagonal(&stress, pressure))
    }

    #[inline(always)]
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R> {
        let [a, b, c] = *stretches;
        let (mu, lambda) = (a.splat(self.lame.mu), a.splat(self.lame.lambda));
        let trace = a.splat(0.5) * (a * a + b * b + c * c - a.splat(3.0));
        let rest = lambda * trace - mu;
        let mut result =
            PrincipalTangent { stretching: matrix::zero(mu), twist: [rest; 3], flip: [rest; 3] };
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            let (square, product) = (stretches[k] * stretches[k], stretches[i] * stretches[j]);
            let squares = stretches[i] * stretches[i] + stretches[j] * stretches[j];
            result.stretching[k][k] = rest + (mu + mu + mu + lambda) * square;
            result.stretching[i][j] = lambda * product;
            result.stretching[j][i] = result.stretching[i][j];
            result.twist[k] = rest + mu * (squares - product);
            result.flip[k] = rest + mu * (squares + product);
        }
        result
    }
}
