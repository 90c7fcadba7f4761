//! The constitutive laws of tissue: what a law is, and the list of them.

mod corotated;
mod fibres;
mod mooney_rivlin;
mod neo_hookean;
mod saint_venant_kirchhoff;
pub(super) mod viscosity;

use super::matrix::Matrix;
use super::principal::PrincipalTangent;
use super::real::Real;

pub(super) use corotated::Corotated;
pub(super) use fibres::HolzapfelGasserOgden;
pub(super) use mooney_rivlin::MooneyRivlin;
pub(super) use neo_hookean::NeoHookean;
pub(super) use saint_venant_kirchhoff::SaintVenantKirchhoff;

/// Most fibre directions per tetrahedron.
pub(crate) const MAX_FAMILIES: usize = 2;

/// Unit fibre directions of a tetrahedron in rest space; laws with fewer read the first ones.
pub(super) type Directions<R> = [[R; 3]; MAX_FAMILIES];

/// A law with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Law {
    /// Linear in each element's own rotating frame.
    Corotated(Lame),
    /// Linear between Green's strain and the second Piola-Kirchhoff stress. It gives way when it is
    /// compressed to less than about 58 % (1/√3) of its length: for stretch only.
    SaintVenantKirchhoff(Lame),
    /// Stable neo-Hookean.
    NeoHookean(Lame),
    /// Mooney-Rivlin with a stable volumetric term: `c10 + c01` is half of the shear modulus [Pa].
    MooneyRivlin {
        /// Factor of the first invariant [Pa].
        c10: f64,
        /// Factor of the second invariant [Pa].
        c01: f64,
        /// Lamé's first parameter [Pa].
        lambda: f64,
    },
    /// Stable neo-Hookean matrix with exponential fibres.
    HolzapfelGasserOgden {
        /// Elasticity of the matrix between the fibres.
        matrix: Lame,
        /// The fibres.
        fibres: FibreParameters,
    },
}

impl Law {
    /// Lamé parameters at small strain; of the matrix alone where there are fibres.
    pub(crate) fn lame(&self) -> Lame {
        match *self {
            Self::Corotated(lame)
            | Self::SaintVenantKirchhoff(lame)
            | Self::NeoHookean(lame)
            | Self::HolzapfelGasserOgden { matrix: lame, .. } => lame,
            Self::MooneyRivlin { c10, c01, lambda } => Lame { mu: 2.0 * (c10 + c01), lambda },
        }
    }

    /// The same law with another resistance to change of volume.
    pub(super) fn with_lambda(self, lambda: f64) -> Self {
        let replace = |lame: Lame| Lame { lambda, ..lame };
        match self {
            Self::Corotated(lame) => Self::Corotated(replace(lame)),
            Self::SaintVenantKirchhoff(lame) => Self::SaintVenantKirchhoff(replace(lame)),
            Self::NeoHookean(lame) => Self::NeoHookean(replace(lame)),
            Self::MooneyRivlin { c10, c01, .. } => Self::MooneyRivlin { c10, c01, lambda },
            Self::HolzapfelGasserOgden { matrix, fibres } => {
                Self::HolzapfelGasserOgden { matrix: replace(matrix), fibres }
            }
        }
    }

    /// Fibre directions that the law reads.
    pub(crate) fn families(&self) -> usize {
        match self {
            Self::HolzapfelGasserOgden { fibres, .. } => fibres.families,
            _ => 0,
        }
    }
}

/// Lamé's parameters [Pa].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lame {
    /// Shear modulus.
    pub(crate) mu: f64,
    /// First parameter.
    pub(crate) lambda: f64,
}

impl Lame {
    /// From Young's modulus [Pa] and Poisson's ratio, -1 < nu < 0.5.
    pub(crate) fn new(young: f64, poisson: f64) -> Self {
        Self {
            mu: young / (2.0 * (1.0 + poisson)),
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        }
    }
}

/// Parameters of the fibres of [`Law::HolzapfelGasserOgden`], the same for each family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FibreParameters {
    /// Stiffness at small stretch [Pa].
    pub(crate) k1: f64,
    /// How fast they stiffen, greater than 0.
    pub(crate) k2: f64,
    /// Dispersion: 0 (parallel) to 1/3 (isotropic).
    pub(crate) kappa: f64,
    /// Directions per tetrahedron, 1 or 2.
    pub(crate) families: usize,
}

/// A law as the kernel evaluates it.
pub(super) trait ElementLaw: Copy {
    /// Fibre directions that it reads.
    const FAMILIES: usize;

    /// Energy density [J/m³] at the deformation gradient `f`.
    fn energy<R: Real>(&self, f: &Matrix<R>, directions: &Directions<R>) -> R;

    /// First Piola-Kirchhoff stress [Pa]: the derivative of the energy.
    fn stress<R: Real>(&self, f: &Matrix<R>, directions: &Directions<R>) -> Matrix<R>;

    /// Derivative of the stress, without fibres, at principal stretches.
    fn principal_tangent<R: Real>(&self, stretches: &[R; 3]) -> PrincipalTangent<R>;

    /// What a family of fibres adds to the derivative of the stress.
    fn fibre_tangent<R: Real>(&self, _f: &Matrix<R>, _direction: &[R; 3]) -> FibreTangent<R> {
        unreachable!("a law without fibres")
    }
}

/// Derivative of the stress of fibres `dW = c e', e' = 2 M : F'`, `M = kappa F + (1 - 3 kappa) F a aᵀ`:
/// positive semi-definite, because the energy is convex in F.
pub(super) struct FibreTangent<R> {
    /// `c kappa` and `c (1 - 3 kappa)`.
    pub(super) dispersed: R,
    pub(super) aligned: R,
    /// M
    pub(super) normal: Matrix<R>,
    /// `2 dc/de`
    pub(super) steepness: R,
}

/// Runs `$body` with `$law` bound to the concrete law.
macro_rules! with_law {
    ($choice:expr, $law:ident => $body:expr) => {
        match $choice {
            Law::Corotated(lame) => {
                let $law = law::Corotated::new(lame);
                $body
            }
            Law::SaintVenantKirchhoff(lame) => {
                let $law = law::SaintVenantKirchhoff::new(lame);
                $body
            }
            Law::NeoHookean(lame) => {
                let $law = law::NeoHookean::new(lame);
                $body
            }
            Law::MooneyRivlin { c10, c01, lambda } => {
                let $law = law::MooneyRivlin::new(c10, c01, lambda);
                $body
            }
            Law::HolzapfelGasserOgden { matrix, fibres } if fibres.families == 1 => {
                let $law = law::HolzapfelGasserOgden::<1>::new(matrix, fibres);
                $body
            }
            Law::HolzapfelGasserOgden { matrix, fibres } => {
                let $law = law::HolzapfelGasserOgden::<2>::new(matrix, fibres);
                $body
            }
        }
    };
}
pub(super) use with_law;
