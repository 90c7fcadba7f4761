//! Mooney-Rivlin, compressible:
//! `W = c10 (I₁ - 3) + c01 (I₂ - 3) - (2 c10 + 4 c01)(J - 1) + l/2 (J - 1)²`, `I₂ = |cof F|²`,
//!
//! with `l = lambda + 2 c10`, so that small strains agree with `mu = 2 (c10 + c01)` and lambda.
//!
//! Source: Mooney, J. Appl. Phys. 11 (1940); Rivlin, Phil. Trans. A 241 (1948). The volumetric term is
//! that of Ciarlet, Geymonat (1982) with the barrier ln J replaced by its tangent, as Smith, de Goes,
//! Kim (2018) do for neo-Hookean: finite for every F, and polyconvex for c10, c01, l >= 0.

use super::super::matrix::{self, Matrix};
use super::super::principal::{OTHERS, PrincipalTangent};
use super::super::real::Real;
use super::{Directions, ElementLaw, Law};

#[derive(Clone, Copy)]
pub(in super::super) struct MooneyRivlin {
    c10: f64,
    c01: f64,
    bulk: f64,
}

impl MooneyRivlin {
    pub(in super::super) fn new(&Law { lame, material, .. }: &Law) -> Self {
        let c01 = 0.5 * lame.mu * material.mooney;
        let c10 = 0.5 * lame.mu - c01;
        Self { c10, c01, bulk: lame.lambda + 2.0 * c10 }
    }

    fn rest_pressure(&self) -> f64 {
        2.0 * self.c10 + 4.0 * self.c01
    }
}

impl ElementLaw for MooneyRivlin {
    const FAMILIES: usize = 0;

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> R {
        let like = f[0][0];
        let (one, three) = (like.splat(1.0), like.splat(3.0));
        let cofactor = matrix::cofactor(f);
        let change = matrix::determinant(f, &cofactor) - one;
        like.splat(self.c10) * (matrix::dot(f, f) - three)
            + like.splat(self.c01) * (matrix::dot(&cofactor, &cofactor) - three)
            + change * (like.splat(0.5 * self.bulk) * change - like.splat(self.rest_pressure()))
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> Matrix<R> {
        let like = f[0][0];
        let cofactor = matrix::cofactor(f);
        let change = matrix::determinant(f, &cofactor) - like.splat(1.0);
        // The derivative of |cof F|² is 2 (I₁ F - F FᵀF).
        let square = matrix::transpose_multiply(f, f);
        let two_c01 = like.splat(2.0 * self.c01);
        let along_f = like.splat(2.0 * self.c10) + two_c01 * matrix::trace(&square);
        let along_cofactor = like.splat(self.bulk) * change - like.splat(self.rest_pressure());
        let second = matrix::add_diagonal(&matrix::scale(-two_c01, &square), along_f);
        matrix::add(&matrix::multiply(f, &second), &matrix::scale(along_cofactor, &cofactor))
    }

    #[inline(always)]
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R> {
        let like = stretches[0];
        let (two_c10, two_c01) = (like.splat(2.0 * self.c10), like.splat(2.0 * self.c01));
        let bulk = like.splat(self.bulk);
        let volume = stretches[0] * stretches[1] * stretches[2];
        let slope = bulk * (volume - like.splat(1.0)) - like.splat(self.rest_pressure());
        let mut result = PrincipalTangent::of_volume(stretches, slope, bulk);
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            let product = stretches[i] * stretches[j];
            let squares = stretches[i] * stretches[i] + stretches[j] * stretches[j];
            let square = stretches[k] * stretches[k];
            let cross = two_c01 * (product + product);
            result.stretching[k][k] = result.stretching[k][k] + two_c10 + two_c01 * squares;
            result.stretching[i][j] = result.stretching[i][j] + cross;
            result.stretching[j][i] = result.stretching[j][i] + cross;
            result.twist[k] = result.twist[k] + two_c10 + two_c01 * (square + product);
            result.flip[k] = result.flip[k] + two_c10 + two_c01 * (square - product);
        }
        result
    }
}
