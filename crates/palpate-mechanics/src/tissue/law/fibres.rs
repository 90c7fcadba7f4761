//! Holzapfel-Gasser-Ogden: a stable neo-Hookean matrix and families of fibres, each with
//! `W = k1/(2 k2) (exp(k2 ⟨e⟩²) - 1)`, `e = kappa (I₁ - 3) + (1 - 3 kappa)(I₄ - 1)`, `I₄ = |F a|²`.
//!
//! Sources: Holzapfel, Gasser, Ogden, J. Elasticity 61 (2000); dispersion kappa: Gasser, Ogden,
//! Holzapfel, J. R. Soc. Interface 3 (2006). Fibres bear no compression: only the positive part ⟨e⟩
//! counts, so the stress is continuous and its slope jumps at e = 0. The invariants are the full ones,
//! not the isochoric ones, as Nolan et al., J. Mech. Behav. Biomed. Mater. 39 (2014) find right for
//! compressible tissue. Above an exponent of [`LARGEST_EXPONENT`] the exponential goes on along its
//! tangent: forces stay finite and the energy convex in e.

use palpate_model::Material;

use super::super::dual::Dual;
use super::super::matrix::{self, Matrix};
use super::super::principal::PrincipalTangent;
use super::super::real::{Real, positive_part};
use super::neo_hookean::NeoHookean;
use super::{Directions, ElementLaw, FibreTangent, Law};

/// e^40 = 2e17: far beyond what any fibre survives.
pub(in super::super) const LARGEST_EXPONENT: f64 = 40.0;

#[derive(Clone, Copy)]
pub(in super::super) struct HolzapfelGasserOgden<const FAMILIES: usize> {
    matrix: NeoHookean,
    k1: f64,
    k2: f64,
    kappa: f64,
}

impl<const FAMILIES: usize> HolzapfelGasserOgden<FAMILIES> {
    pub(in super::super) fn new(law: &Law) -> Self {
        let Material { k1, k2, kappa, .. } = law.material;
        Self { matrix: NeoHookean::new(law), k1, k2, kappa }
    }

    /// The positive part of e, and `F a`.
    #[inline(always)]
    fn strain<R: Real>(&self, f: &Matrix<R>, direction: &[R; 3]) -> (R, [R; 3]) {
        let like = f[0][0];
        let kappa = self.kappa;
        let turned = matrix::apply(f, direction);
        let fourth = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2];
        let strain = like.splat(kappa) * (matrix::dot(f, f) - like.splat(3.0))
            + like.splat(1.0 - 3.0 * kappa) * (fourth - like.splat(1.0));
        (positive_part(strain), turned)
    }

    /// The exponent `k2 e²` without what is above the limit, and that rest.
    #[inline(always)]
    fn exponent<R: Real>(&self, strain: R) -> (R, R) {
        let exponent = strain.splat(self.k2) * strain * strain;
        let rest = positive_part(exponent - strain.splat(LARGEST_EXPONENT));
        (exponent - rest, rest)
    }
}

impl<const COUNT: usize> ElementLaw for HolzapfelGasserOgden<COUNT> {
    const FAMILIES: usize = COUNT;

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Matrix<R>, directions: &Directions<R>) -> R {
        let mut sum = self.matrix.energy(f, directions);
        for direction in &directions[..COUNT] {
            let (strain, _) = self.strain(f, direction);
            let (exponent, rest) = self.exponent(strain);
            let density = exponent.exp_minus_one() + exponent.exp() * rest;
            sum = sum + strain.splat(0.5 * self.k1 / self.k2) * density;
        }
        sum
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Matrix<R>, directions: &Directions<R>) -> Matrix<R> {
        let kappa = self.kappa;
        let mut sum = self.matrix.stress(f, directions);
        for direction in &directions[..COUNT] {
            let (strain, turned) = self.strain(f, direction);
            let (exponent, _) = self.exponent(strain);
            let slope = strain.splat(2.0 * self.k1) * strain * exponent.exp();
            let (along_f, along_fibre) =
                (slope * strain.splat(kappa), slope * strain.splat(1.0 - 3.0 * kappa));
            for row in 0..3 {
                for col in 0..3 {
                    sum[row][col] = sum[row][col]
                        + along_f * f[row][col]
                        + along_fibre * turned[row] * direction[col];
                }
            }
        }
        sum
    }

    #[inline(always)]
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R> {
        self.matrix.principal_tangent(stretches)
    }

    #[inline(always)]
    fn fibre_tangent<R: Real>(&self, f: &Matrix<R>, direction: &[R; 3]) -> FibreTangent<R> {
        let kappa = self.kappa;
        let (strain, turned) = self.strain(f, direction);
        let strain = Dual { value: strain, slope: strain.splat(1.0) };
        let (exponent, _) = self.exponent(strain);
        let slope = strain.splat(2.0 * self.k1) * strain * exponent.exp();
        let zero = strain.value.splat(0.0);
        let steepness = strain.value.if_greater(zero, slope.slope + slope.slope, zero);
        let (dispersed, aligned) = (zero.splat(kappa), zero.splat(1.0 - 3.0 * kappa));
        let mut normal = matrix::scale(dispersed, f);
        for row in 0..3 {
            for col in 0..3 {
                normal[row][col] = normal[row][col] + aligned * turned[row] * direction[col];
            }
        }
        FibreTangent {
            dispersed: slope.value * dispersed,
            aligned: slope.value * aligned,
            normal,
            steepness,
        }
    }
}
