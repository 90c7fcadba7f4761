//! Whether a body that did not come from a model file keeps the rules of one.

use std::iter;

use super::{Body, Law, Material};

/// What is wrong with a body's settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// A number out of its range.
    #[error("{entry} must be {expected}, found {found}")]
    OutOfRange {
        /// Which number.
        entry: &'static str,
        /// Its range.
        expected: &'static str,
        /// What came.
        found: f64,
    },
    /// A fixed node that the mesh does not have.
    #[error("fixed_nodes: node index {node} is out of range (the mesh has {node_count} nodes)")]
    FixedNodeOutOfRange {
        /// The index.
        node: u32,
        /// How many nodes there are.
        node_count: usize,
    },
    /// Times of a path that do not increase.
    #[error(
        "rigid: times of a path must increase, key {key} does not come after the one before it"
    )]
    TimesNotIncreasing {
        /// Index of the later key.
        key: usize,
    },
    /// A constitutive law that does not exist.
    #[error("law {0:?} is not known; it must be one of {names}", names = Law::NAMES.join(", "))]
    UnknownLaw(String),
    /// Material of a region that the mesh does not have.
    #[error("regions: the mesh has no region {region}; it has {}", numbers(.known))]
    UnknownRegion {
        /// The region.
        region: i32,
        /// The regions of the mesh.
        known: Vec<i32>,
    },
    /// Regions that do not ascend.
    #[error("regions: region {region} comes twice or out of order")]
    RegionOrder {
        /// The later region.
        region: i32,
    },
    /// The linear law beside others in one body.
    #[error(
        "law linear holds for a whole body: give all of its regions law linear, or none (corotated \
         is its like)"
    )]
    MixedLaws,
    /// A tetrahedron of a law with fibres without a direction.
    #[error(
        "law hgo: tetrahedron {tetrahedron} has no fibre direction; give the material one, or the \
         mesh the cell data `fibres`"
    )]
    NoFibre {
        /// The first such tetrahedron.
        tetrahedron: usize,
    },
}

impl Body {
    /// Checks the ranges of all settings: those of the model language.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn validate(&self) -> Result<(), BodyError> {
        let check = |entry, found: f64, valid: bool, expected| {
            if valid && found.is_finite() {
                Ok(())
            } else {
                Err(BodyError::OutOfRange { entry, expected, found })
            }
        };
        let positive = |entry, value| check(entry, value, value > 0.0, "greater than 0");
        let not_negative = |entry, value| check(entry, value, value >= 0.0, "0 or more");
        let fraction =
            |entry, value| check(entry, value, (0.0..=1.0).contains(&value), "from 0 to 1");
        let finite = |entry, value| check(entry, value, true, "finite");

        for material in iter::once(&self.material).chain(self.regions.iter().map(|(_, m)| m)) {
            for (parameter, value) in Material::PARAMETERS.iter().zip(material.values()) {
                let range = parameter.range;
                check(parameter.name, value, (range.holds)(value), range.words)?;
            }
            for fibre in material.fibres.into_iter().flatten() {
                let length = fibre.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
                check("length of a fibre", length, length > 0.0, "greater than 0")?;
            }
        }
        self.validate_regions()?;

        not_negative("friction", self.contact.friction)?;
        self.contact.distance.map_or(Ok(()), |value| positive("distance", value))?;
        self.contact.stiffness.map_or(Ok(()), |value| positive("stiffness", value))?;
        fraction("opacity", self.appearance.opacity)?;
        for value in self.appearance.color.into_iter().flatten() {
            fraction("color", value)?;
        }
        for value in self.initial_velocity {
            finite("initial_velocity", value)?;
        }

        let node_count = self.mesh.nodes().len();
        if let Some(&node) = self.fixed_nodes.iter().find(|&&node| node as usize >= node_count) {
            return Err(BodyError::FixedNodeOutOfRange { node, node_count });
        }
        let keys = self.rigid.as_ref().map_or(&[][..], |motion| &motion.keys);
        for (index, key) in keys.iter().enumerate() {
            finite("time of a path", key.time)?;
            for value in key.translation.to_array() {
                finite("translation of a path", value)?;
            }
            let length = key.rotation.length();
            let valid = (length - 1.0).abs() <= 1e-3;
            check("length of a path's rotation", length, valid, "1")?;
            if index > 0 && keys[index - 1].time >= key.time {
                return Err(BodyError::TimesNotIncreasing { key: index });
            }
        }
        Ok(())
    }

    /// Whether the regions exist, and the laws of all tetrahedra fit together.
    fn validate_regions(&self) -> Result<(), BodyError> {
        let known = self.mesh.region_numbers();
        for (index, &(region, _)) in self.regions.iter().enumerate() {
            if known.binary_search(&region).is_err() {
                return Err(BodyError::UnknownRegion { region, known });
            }
            if index > 0 && self.regions[index - 1].0 >= region {
                return Err(BodyError::RegionOrder { region });
            }
        }
        let is_linear = |material: &Material| material.law == Law::Linear;
        if self.materials().any(is_linear) && !self.materials().all(is_linear) {
            return Err(BodyError::MixedLaws);
        }
        let fibres = &self.mesh.fibres()[0];
        let without = |(tetrahedron, material): (usize, &Material)| {
            material.law == Law::HolzapfelGasserOgden
                && material.fibres[0].is_none()
                && fibres.get(tetrahedron).is_none_or(|fibre| *fibre == [0.0; 3])
        };
        match self.materials().enumerate().position(without) {
            Some(tetrahedron) => Err(BodyError::NoFibre { tetrahedron }),
            None => Ok(()),
        }
    }
}

fn numbers(regions: &[i32]) -> String {
    const SHOWN: usize = 10;
    let names: Vec<String> = regions.iter().take(SHOWN).map(ToString::to_string).collect();
    match regions.len() {
        0 => "none".to_owned(),
        count if count > SHOWN => format!("{}, ...", names.join(", ")),
        _ => names.join(", "),
    }
}
