//! The constitutive laws of tissue: what a law is, and the list of them in [`with_law`].

pub(super) mod corotated;
pub(super) mod fibres;
pub(super) mod mooney_rivlin;
pub(super) mod neo_hookean;
pub(super) mod saint_venant_kirchhoff;
pub(super) mod viscosity;

pub(super) use palpate_model::Law as Name;
use palpate_model::Material;

use super::matrix::Matrix;
use super::principal::PrincipalTangent;
use super::real::Real;

/// Most fibre directions per tetrahedron.
pub(crate) const MAX_FAMILIES: usize = 2;

/// Unit fibre directions of a tetrahedron in rest space; laws with fewer read the first ones.
pub(super) type Directions<R> = [[R; 3]; MAX_FAMILIES];

/// A law as a material asks for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Law {
    /// Its name, and the parameters that are its own.
    pub(super) material: Material,
    /// Elasticity at small strain, of which a part may be taken elsewhere; of the matrix alone where there
    /// are fibres.
    lame: Lame,
    /// Directions per tetrahedron where there are fibres, 1 or 2.
    families: usize,
}

impl Law {
    /// # Panics
    /// For the linear law, which is none of single elements.
    pub(crate) fn new(material: &Material, families: usize) -> Self {
        assert!(material.law != Name::Linear, "{} is no law of single elements", material.law);
        let lame = Lame::new(material.young, material.poisson);
        Self { material: *material, lame, families }
    }

    /// Lamé parameters at small strain; of the matrix alone where there are fibres.
    pub(crate) fn lame(&self) -> Lame {
        self.lame
    }

    /// The same law with another resistance to change of volume.
    pub(super) fn with_lambda(mut self, lambda: f64) -> Self {
        self.lame.lambda = lambda;
        self
    }

    /// Fibre directions that the law reads.
    pub(crate) fn families(&self) -> usize {
        match self.material.law {
            Name::HolzapfelGasserOgden => self.families,
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

/// Runs `$body` with `$law` bound to the concrete law. A law is a file and its line here.
macro_rules! with_law {
    (@ $kind:ty, $from:ident, $law:ident => $body:expr) => {{
        let $law = <$kind>::new($from);
        $body
    }};
    ($choice:expr, $law:ident => $body:expr) => {{
        use law::Name;

        let choice = &$choice;
        match choice.material.law {
            Name::Corotated => with_law!(@ law::corotated::Corotated, choice, $law => $body),
            Name::SaintVenantKirchhoff => with_law!(@ law::saint_venant_kirchhoff::SaintVenantKirchhoff, choice, $law => $body),
            Name::NeoHookean => with_law!(@ law::neo_hookean::NeoHookean, choice, $law => $body),
            Name::MooneyRivlin => with_law!(@ law::mooney_rivlin::MooneyRivlin, choice, $law => $body),
            Name::HolzapfelGasserOgden if choice.families() == 1 => with_law!(@ law::fibres::HolzapfelGasserOgden<1>, choice, $law => $body),
            Name::HolzapfelGasserOgden => with_law!(@ law::fibres::HolzapfelGasserOgden<2>, choice, $law => $body),
            other => unreachable!("{other} is no law of single elements"),
        }
    }};
}
pub(super) use with_law;
