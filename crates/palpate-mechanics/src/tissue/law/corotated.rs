//! Corotated linear elasticity: `W = mu |F - R|² + lambda/2 tr(RᵀF - I)²`, R the rotation in F.
//!
//! Source: Müller, Gross, "Interactive virtual materials", Graphics Interface 2004; as an energy in
//! Chao et al., "A simple geometric model for elastic deformations", SIGGRAPH 2010. With R taken among
//! the proper rotations an inverted element is pushed back through its thinnest direction. The
//! resistance to change of volume is that of small strain: it does not grow as the volume goes to 0.

use super::super::matrix::{self, Matrix};
use super::super::principal::{OTHERS, PrincipalTangent};
use super::super::real::Real;
use super::{Directions, ElementLaw, Lame, Law};

#[derive(Clone, Copy)]
pub(in super::super) struct Corotated {
    lame: Lame,
}

impl Corotated {
    pub(in super::super) fn new(law: &Law) -> Self {
        Self { lame: law.lame }
    }
}

impl ElementLaw for Corotated {
    const FAMILIES: usize = 0;

    #[inline(always)]
    fn energy<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> R {
        let like = f[0][0];
        let rotation = R::rotation(f);
        let strain = matrix::add(f, &matrix::scale(like.splat(-1.0), &rotation));
        let trace = matrix::dot(&rotation, f) - like.splat(3.0);
        like.splat(self.lame.mu) * matrix::dot(&strain, &strain)
            + like.splat(0.5 * self.lame.lambda) * trace * trace
    }

    #[inline(always)]
    fn stress<R: Real>(&self, f: &Matrix<R>, _: &Directions<R>) -> Matrix<R> {
        let like = f[0][0];
        let two_mu = like.splat(2.0 * self.lame.mu);
        let rotation = R::rotation(f);
        let trace = matrix::dot(&rotation, f) - like.splat(3.0);
        let along_rotation = like.splat(self.lame.lambda) * trace - two_mu;
        matrix::add(&matrix::scale(two_mu, f), &matrix::scale(along_rotation, &rotation))
    }

    #[inline(always)]
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R> {
        let like = stretches[0];
        let (two, floor) = (like.splat(2.0), like.splat(1e-9));
        let (two_mu, lambda) = (like.splat(2.0 * self.lame.mu), like.splat(self.lame.lambda));
        let strain = stretches[0] + stretches[1] + stretches[2] - like.splat(3.0);
        let mut result = PrincipalTangent {
            stretching: matrix::add_diagonal(&[[lambda; 3]; 3], two_mu),
            twist: [two_mu; 3],
            flip: [two_mu; 3],
        };
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            let sum = stretches[i] + stretches[j];
            let stress = two_mu * (sum - two) + two * lambda * strain;
            result.twist[k] = stress / sum.if_greater(floor, sum, floor);
        }
        result
    }
}
