//! Materials: the constitutive laws by name, and their parameters.

use std::fmt;
use std::str::FromStr;

use palpate_geometry::Point;
use serde::{Deserialize, Serialize};

use super::BodyError;
use crate::mesh::FIBRE_FAMILIES;

/// The laws from lines of a name here and a name in the language.
macro_rules! laws {
    ($($(#[$about:meta])* $name:ident = $word:literal,)*) => {
        /// Constitutive law of a material.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
        #[non_exhaustive]
        pub enum Law {
            $($(#[$about])* $name,)*
        }

        impl Law {
            /// All laws.
            pub const ALL: [Self; [$($word),*].len()] = [$(Self::$name),*];
            /// Their names in the language, in the same order.
            pub const NAMES: [&'static str; Self::ALL.len()] = [$($word),*];
        }
    };
}

// Checkpoints keep the place in this list: a new one comes last.
laws! {
    /// Linear elasticity in the body's own rotating frame.
    #[default]
    Linear = "linear",
    /// Linear elasticity in each element's rotating frame.
    Corotated = "corotated",
    /// St. Venant-Kirchhoff.
    SaintVenantKirchhoff = "stvk",
    /// Stable neo-Hookean.
    NeoHookean = "neo-hookean",
    /// Mooney-Rivlin.
    MooneyRivlin = "mooney-rivlin",
    /// Holzapfel-Gasser-Ogden: neo-Hookean with fibres.
    HolzapfelGasserOgden = "hgo",
}

impl fmt::Display for Law {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(Self::NAMES[*self as usize])
    }
}

impl FromStr for Law {
    type Err = BodyError;

    fn from_str(name: &str) -> Result<Self, BodyError> {
        let found = Self::NAMES.iter().position(|known| *known == name);
        found.map(|index| Self::ALL[index]).ok_or_else(|| BodyError::UnknownLaw(name.to_owned()))
    }
}

/// Material of a body or of a region. The defaults are a generic soft organ.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Material {
    /// Constitutive law.
    pub law: Law,
    /// Young's modulus at small strain [Pa]; of the matrix where there are fibres.
    pub young: f64,
    /// Poisson's ratio at small strain, -1 < nu < 0.5.
    pub poisson: f64,
    /// Mass density [kg/m³].
    pub density: f64,
    /// Rayleigh damping proportional to stiffness [s]; for nonlinear laws the time of the
    /// Kelvin-Voigt viscosity.
    pub damping: f64,
    /// Rayleigh damping proportional to mass [1/s].
    pub mass_damping: f64,
    /// Mooney-Rivlin: share of the second invariant, `c01 / (c10 + c01)`, 0 to 1. With Young's modulus
    /// and Poisson's ratio, `c10 + c01 = E / (4 (1 + nu))`.
    pub mooney: f64,
    /// Stiffness of the fibres at small stretch [Pa], >= 0. The defaults of the fibres are those of
    /// the media of a rabbit's carotid artery (Holzapfel, Gasser, Ogden 2000).
    pub k1: f64,
    /// How fast the fibres stiffen, > 0.
    pub k2: f64,
    /// Dispersion of the fibres, 0 (parallel) to 1/3 (isotropic).
    pub kappa: f64,
    /// Directions of the families of fibres, the same everywhere, of any length but zero; `None`:
    /// those of the mesh.
    pub fibres: [Option<Point>; FIBRE_FAMILIES],
}

impl Default for Material {
    fn default() -> Self {
        Self {
            law: Law::Linear,
            young: 5_000.0,
            poisson: 0.45,
            density: 1_000.0,
            damping: 0.01,
            mass_damping: 0.0,
            mooney: 0.2,
            k1: 2_363.2,
            k2: 0.8393,
            kappa: 0.0,
            fibres: [None; FIBRE_FAMILIES],
        }
    }
}
