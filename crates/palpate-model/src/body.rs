//! The model: bodies placed in space, how the text joins them, and what acts on all of them.

mod attachment;
mod change;
mod material;
mod pose;
mod structure;
mod validate;

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_geometry::Point;
use serde::{Deserialize, Serialize};

use crate::language::Document;
use crate::mesh::Mesh;

pub use attachment::{AttachedNode, Attachment, AttachmentError, triangle_axes};
pub use material::{Law, Material, MaterialEntries, Parameter, Range};
pub use pose::{Pose, PoseParts};
pub use structure::Structure;
pub use validate::BodyError;

/// Everything a model file describes, loaded and placed.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Model {
    /// The bodies, in the order of their TREE blocks in the text.
    pub bodies: Vec<Body>,
    /// How BRANCH blocks join the bodies: the upper part of the paper's binary tree (CE and NE).
    pub structure: Structure,
    /// Bodies that are tied to each other.
    pub attachments: Vec<Attachment>,
    /// Acceleration of gravity [m/s²].
    pub gravity: Point,
    /// What the readers of the mesh files had to say, one sentence each.
    pub notes: Vec<String>,
    /// The text that the model came from; `None` for bodies that came from arrays.
    #[serde(skip)]
    pub document: Option<Document>,
}

impl Model {
    /// Bodies without a text: a chain of joins in their order, gravity down the z axis.
    ///
    /// # Panics
    /// If there is no body.
    pub fn from_bodies(bodies: Vec<Body>) -> Self {
        let structure = Structure::chain((0..bodies.len()).map(Structure::Body));
        Self {
            structure: structure.expect("a model has at least one body"),
            bodies,
            attachments: Vec::new(),
            gravity: Document::GRAVITY,
            notes: Vec::new(),
            document: None,
        }
    }

    /// The model in canonical text; `None` when it came from arrays.
    pub fn to_text(&self) -> Option<String> {
        self.document.as_ref().map(Document::to_text)
    }
}

/// One object of the model: a mesh in its place, and how it behaves.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Body {
    /// Unique name: given after TREE, otherwise the mesh file's stem.
    pub name: String,
    /// The mesh after every ME above it and the model's unit, metres.
    pub mesh: Arc<Mesh>,
    /// The mesh file, as resolved; empty for a body that came from arrays.
    pub source: PathBuf,
    /// Where the mesh file's origin, axes and unit lengths went: `x -> linear * x + translation`.
    pub placement: Pose,
    /// Processor (PE) that the body is assigned to; `None` when the model leaves it to us.
    pub processor: Option<u32>,
    /// Material of the tissue.
    pub material: Material,
    /// Regions of the mesh with a material of their own, by region number, ascending. The body's
    /// `damping` and `mass_damping` count for all regions.
    pub regions: Vec<(i32, Material)>,
    /// Sorted indices of nodes held fixed.
    pub fixed_nodes: Vec<u32>,
    /// Motion of a rigid body; `None` for a deformable one.
    pub rigid: Option<RigidMotion>,
    /// Contact parameters.
    pub contact: ContactSettings,
    /// Colour and opacity.
    pub appearance: Appearance,
    /// Velocity of all nodes at the start [m/s].
    pub initial_velocity: Point,
}

impl Body {
    /// The material of a region of the mesh.
    pub fn material_of(&self, region: i32) -> &Material {
        let found = self.regions.binary_search_by_key(&region, |(number, _)| *number);
        found.map_or(&self.material, |index| &self.regions[index].1)
    }

    /// The material of each tetrahedron.
    pub fn materials(&self) -> impl Iterator<Item = &Material> {
        let regions = self.mesh.regions();
        (0..self.mesh.tetrahedra().len()).map(move |index| {
            regions.get(index).map_or(&self.material, |&region| self.material_of(region))
        })
    }

    /// A deformable body with every setting at its default.
    pub fn new(name: impl Into<String>, mesh: Arc<Mesh>) -> Self {
        Self {
            name: name.into(),
            mesh,
            source: PathBuf::new(),
            placement: Pose::IDENTITY,
            processor: None,
            material: Material::default(),
            regions: Vec::new(),
            fixed_nodes: Vec::new(),
            rigid: None,
            contact: ContactSettings::default(),
            appearance: Appearance::default(),
            initial_velocity: [0.0; 3],
        }
    }
}

/// Contact parameters of a body. Between two bodies the mean of the distances, the harmonic mean of
/// the stiffnesses and the geometric mean of the frictions count.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct ContactSettings {
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Surfaces closer than this push each other apart [m]; `None`: a tenth of the mean surface edge.
    pub distance: Option<f64>,
    /// Penalty pressure per overlap [Pa/m]; `None`: derived from the material and the mesh.
    pub stiffness: Option<f64>,
    /// Whether the body's own surface parts push each other apart.
    pub self_contact: bool,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self { friction: 0.0, distance: None, stiffness: None, self_contact: true }
    }
}

/// How a body is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Appearance {
    /// Red, green, blue in 0..=1; `None`: chosen by the picture from the body's index.
    pub color: Option<[f64; 3]>,
    /// 0 (invisible) ..= 1 (opaque).
    pub opacity: f64,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { color: None, opacity: 1.0 }
    }
}

/// Prescribed motion of a rigid body: key poses, interpolated; before the first and after the last
/// the body rests there. No keys: the body is fixed.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct RigidMotion {
    /// Keys with strictly increasing times.
    pub keys: Vec<RigidKey>,
    /// Fixed point of the rotations [m]: where the mesh file's origin was placed.
    pub pivot: Point,
}

/// A rigid body's pose at a time, relative to where the model placed it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct RigidKey {
    /// Time [s].
    pub time: f64,
    /// Displacement of the pivot [m].
    pub translation: DVec3,
    /// Rotation about the pivot.
    pub rotation: DQuat,
}

impl RigidMotion {
    /// The pose at `time` [s], as a map from placed to current positions.
    pub fn pose(&self, time: f64) -> Pose {
        let (translation, rotation) = self.interpolate(time);
        let pivot = DVec3::from_array(self.pivot);
        Pose::from_rotation_translation(rotation, translation + pivot - rotation * pivot)
    }

    fn interpolate(&self, time: f64) -> (DVec3, DQuat) {
        let next = self.keys.partition_point(|key| key.time <= time);
        match (next.checked_sub(1).map(|i| self.keys[i]), self.keys.get(next)) {
            (Some(before), Some(after)) => {
                let s = (time - before.time) / (after.time - before.time);
                let rotation = before.rotation.slerp(after.rotation, s);
                (before.translation.lerp(after.translation, s), rotation)
            }
            (Some(last), None) => (last.translation, last.rotation),
            (None, Some(first)) => (first.translation, first.rotation),
            (None, None) => (DVec3::ZERO, DQuat::IDENTITY),
        }
    }
}
