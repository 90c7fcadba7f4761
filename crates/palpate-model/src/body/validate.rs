//! Whether a body that did not come from a model file keeps the rules of one.

use super::Body;

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
    #[error("law {0:?} is not known; it must be \"linear\"")]
    UnknownLaw(String),
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

        let material = &self.material;
        positive("young", material.young)?;
        let poisson = material.poisson;
        let valid = -1.0 < poisson && poisson < 0.5;
        check("poisson", poisson, valid, "greater than -1 and less than 0.5")?;
        positive("density", material.density)?;
        not_negative("damping", material.damping)?;
        not_negative("mass_damping", material.mass_damping)?;

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
}
