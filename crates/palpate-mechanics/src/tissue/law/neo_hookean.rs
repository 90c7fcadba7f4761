//! Stable neo-Hookean:
//! `W = m/2 (I₁ - 3) - m/2 ln((I₁ + 1)/4) - 3m/4 (J - 1) + l/2 (J - 1)²`, `I₁ = tr FᵀF`, `J = det F`,
//!
//! with `m = 4/3 mu` and `l = lambda + 5/6 mu`, so that small strains agree with Lamé's parameters.
//!
//! Source: Smith, de Goes, Kim, "Stable neo-Hookean flesh simulation", ACM Trans. Graph. 37 (2018),
//! equation 14 with the re-parametrisation of section 3.4; `(J - α)²` is expanded, so that the energy
//! is zero at rest and lambda may be zero. Finite for every F; an inverted element is pushed back.

use super::super::matrix::{self, Matrix};
use super::super::principal::PrincipalTangent;
use super::super::real::Real;
use super::{Directions, ElementLaw, Lame, Law};

#[derive(Clone, Copy)]
pub(in super::super) struct NeoHookean {
    shear: f64,
    bulk: f64,
}

impl NeoHookean {
    pub(in super::super) fn new(law: &Law) -> Self {
        Self::from_lame(law.lame)
    }

    pub(in super::super) fn from_lame(lame: Lame) -> Self {
        Self { shear: 4.0 / 3.0 * lame.mu, bulk: lame.lambda + 5.0 / 6.0 * lame.mu }
    }
}

impl ElementLaw for NeoHookean {
    const FAMILIES: usize = 0;

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> R {
        let like = f[0][0];
        let (one, shear) = (like.splat(1.0), like.splat(0.5 * self.shear));
        let square = matrix::dot(f, f);
        let change = matrix::determinant(f, &matrix::cofactor(f)) - one;
        let logarithm = ((square + one) * like.splat(0.25)).ln();
        shear * (square - like.splat(3.0) - logarithm)
            + change * (like.splat(0.5 * self.bulk) * change - like.splat(0.75 * self.shear))
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> Matrix<R> {
        let like = f[0][0];
        let (one, shear) = (like.splat(1.0), like.splat(self.shear));
        let cofactor = matrix::cofactor(f);
        let change = matrix::determinant(f, &cofactor) - one;
        let along_f = shear - shear / (matrix::dot(f, f) + one);
        let along_cofactor = like.splat(self.bulk) * change - like.splat(0.75 * self.shear);
        matrix::add(&matrix::scale(along_f, f), &matrix::scale(along_cofactor, &cofactor))
    }

    #[inline(always)]
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R> {
        let [a, b, c] = *stretches;
        let (one, shear) = (a.splat(1.0), a.splat(self.shear));
        let bulk = a.splat(self.bulk);
        let inverse = one / (a * a + b * b + c * c + one);
        let slope = bulk * (a * b * c - one) - a.splat(0.75 * self.shear);
        let along_f = shear - shear * inverse;
        let curvature = (shear + shear) * inverse * inverse;
        let mut result = PrincipalTangent::of_volume(stretches, slope, bulk);
        for k in 0..3 {
            result.twist[k] = result.twist[k] + along_f;
            result.flip[k] = result.flip[k] + along_f;
            for i in 0..3 {
                result.stretching[k][i] =
                    result.stretching[k][i] + curvature * stretches[k] * stretches[i];
            }
            result.stretching[k][k] = result.stretching[k][k] + along_f;
        }
        result
    }
}
