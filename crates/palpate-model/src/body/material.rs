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

/// Range of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Whether a finite value is in it.
    pub holds: fn(f64) -> bool,
    /// How an error says it: the value must be ...
    pub words: &'static str,
}

const POSITIVE: Range = Range { holds: |value| value > 0.0, words: "greater than 0" };
const NOT_NEGATIVE: Range = Range { holds: |value| value >= 0.0, words: "0 or more" };

/// A parameter of materials, by which the model language, Python and the checks know it.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its name in the language.
    pub name: &'static str,
    /// What it may be.
    pub range: Range,
}

/// The parameters from lines of a name, what it is where nothing is said, and its range.
macro_rules! parameters {
    ($($(#[$about:meta])* $name:ident = $default:expr, $range:expr;)*) => {
        /// Material of a body or of a region. The defaults are a generic soft organ.
        #[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
        pub struct Material {
            /// Constitutive law.
            pub law: Law,
            $($(#[$about])* pub $name: f64,)*
            /// Directions of the families of fibres, the same everywhere, of any length but zero; `None`:
            /// those of the mesh.
            pub fibres: [Option<Point>; FIBRE_FAMILIES],
        }

        impl Default for Material {
            fn default() -> Self {
                Self { law: Law::default(), $($name: $default,)* fibres: [None; FIBRE_FAMILIES] }
            }
        }

        impl Material {
            /// All parameters, in the order of the fields.
            pub const PARAMETERS: [Parameter; [$(stringify!($name)),*].len()] =
                [$(Parameter { name: stringify!($name), range: $range }),*];

            /// The values of [`Self::PARAMETERS`].
            pub fn values(&self) -> [f64; Self::PARAMETERS.len()] {
                [$(self.$name),*]
            }

            /// The same with other values of [`Self::PARAMETERS`].
            #[must_use]
            pub fn with_values(self, [$($name),*]: [f64; Self::PARAMETERS.len()]) -> Self {
                Self { $($name,)* ..self }
            }
        }

        /// An MT block: what it says and what it leaves open. Units as in [`Material`].
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct MaterialEntries {
            /// `law`.
            pub law: Option<Law>,
            $($(#[$about])* pub $name: Option<f64>,)*
            /// `fibre` and `fibre_2`, in the coordinates of the mesh file, of any length but zero.
            pub fibres: [Option<Point>; FIBRE_FAMILIES],
        }

        impl MaterialEntries {
            /// The values of [`Material::PARAMETERS`].
            pub(crate) fn values(&self) -> [Option<f64>; Material::PARAMETERS.len()] {
                [$(self.$name),*]
            }

            /// Where the values of [`Material::PARAMETERS`] stand.
            pub(crate) fn values_mut(&mut self) -> [&mut Option<f64>; Material::PARAMETERS.len()] {
                [$(&mut self.$name),*]
            }
        }
    };
}

// Checkpoints and Python keep this order.
parameters! {
    /// Young's modulus at small strain [Pa]; of the matrix where there are fibres.
    young = 5_000.0, POSITIVE;
    /// Poisson's ratio at small strain, -1 < nu < 0.5.
    poisson = 0.45, Range {
        holds: |value| -1.0 < value && value < 0.5,
        words: "greater than -1 and less than 0.5",
    };
    /// Mass density [kg/m³].
    density = 1_000.0, POSITIVE;
    /// Rayleigh damping proportional to stiffness [s]; for nonlinear laws the time of the
    /// Kelvin-Voigt viscosity.
    damping = 0.01, NOT_NEGATIVE;
    /// Rayleigh damping proportional to mass [1/s].
    mass_damping = 0.0, NOT_NEGATIVE;
    /// Mooney-Rivlin: share of the second invariant, `c01 / (c10 + c01)`, 0 to 1. With Young's modulus
    /// and Poisson's ratio, `c10 + c01 = E / (4 (1 + nu))`.
    mooney = 0.2, Range { holds: |value| (0.0..=1.0).contains(&value), words: "from 0 to 1" };
    /// Stiffness of the fibres at small stretch [Pa], >= 0. The defaults of the fibres are those of
    /// the media of a rabbit's carotid artery (Holzapfel, Gasser, Ogden 2000).
    k1 = 2_363.2, NOT_NEGATIVE;
    /// How fast the fibres stiffen, > 0.
    k2 = 0.8393, POSITIVE;
    /// Dispersion of the fibres, 0 (parallel) to 1/3 (isotropic).
    kappa = 0.0, Range {
        holds: |value| (0.0..=1.0 / 3.0).contains(&value),
        words: "from 0 to 1/3",
    };
}
