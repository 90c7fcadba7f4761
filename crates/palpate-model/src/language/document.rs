//! What a model file says: its blocks and elements, checked but without meshes.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;

use super::diagnostic::{Source, Span};
use crate::body::{Appearance, ContactSettings, Material, MaterialEntries, Pose};

/// A model file, parsed. Comments are not kept. Documents compare by what they say, not by spelling.
#[derive(Clone, Debug)]
pub struct Document {
    /// Unit of every length in the file and in its meshes.
    pub unit: Unit,
    /// Acceleration of gravity [m/s²], whatever the unit.
    pub gravity: Point,
    /// The outermost block.
    pub root: Block,
    pub(super) source: Arc<Source>,
}

impl PartialEq for Document {
    fn eq(&self, other: &Self) -> bool {
        (self.unit, self.gravity, &self.root) == (other.unit, other.gravity, &other.root)
    }
}

impl Document {
    /// Gravity where the file says nothing [m/s²].
    pub const GRAVITY: Point = [0.0, 0.0, -9.81];

    /// A document that was not read from a text.
    pub fn new(root: Block) -> Self {
        Self { unit: Unit::default(), gravity: Self::GRAVITY, root, source: Arc::default() }
    }
}

/// Unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    /// Metre.
    #[default]
    Metre,
    /// Decimetre.
    Decimetre,
    /// Centimetre.
    Centimetre,
    /// Millimetre.
    Millimetre,
    /// Micrometre.
    Micrometre,
}

impl Unit {
    pub(super) const NAMES: [&'static str; 5] = ["m", "dm", "cm", "mm", "um"];
    const ALL: [Self; 5] =
        [Self::Metre, Self::Decimetre, Self::Centimetre, Self::Millimetre, Self::Micrometre];

    /// The unit of this name (`m`, `dm`, `cm`, `mm`, `um`).
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().position(|known| *known == name).map(|index| Self::ALL[index])
    }

    /// The name in the language.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Its length [m].
    pub fn metres(self) -> f64 {
        [1.0, 0.1, 0.01, 0.001, 1e-6][self as usize]
    }
}

/// BRANCH or TREE.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// Groups subtrees.
    Branch(Box<Branch>),
    /// Holds one organ.
    Tree(Box<Tree>),
}

/// A BRANCH block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Branch {
    /// What applies to everything below.
    pub settings: Settings,
    /// The blocks in it; at least one.
    pub children: Vec<Block>,
    /// AT, in the order of the text.
    pub attachments: Vec<AttachmentEntries>,
}

/// An AT element: two bodies that are tied together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttachmentEntries {
    /// `join`: names of the bodies, anywhere in the model.
    pub bodies: [String; 2],
    /// `within` [unit].
    pub within: Option<f64>,
    /// `stiffness` [Pa/m].
    pub stiffness: Option<f64>,
    /// Where AT stands.
    pub span: Span,
}

/// A TREE block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Name after TREE; without line ends.
    pub name: Option<String>,
    /// ME, MT, CN and VE.
    pub settings: Settings,
    /// PE.
    pub processor: Option<u32>,
    /// NE: the mesh file as written, relative to the model file; not empty, without line ends.
    pub file: String,
    /// FX, in the order of the text.
    pub fixed: Vec<Fixed>,
    /// RG: `None` for a deformable body, no keys for a fixed one.
    pub rigid: Option<Vec<PathKey>>,
    /// IV: initial velocity [unit/s].
    pub initial_velocity: Option<Point>,
    /// Where TREE stands.
    pub span: Span,
    /// Where the file name stands.
    pub file_span: Span,
}

/// What may stand in a BRANCH as well as in a TREE; inner entries win one by one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// ME.
    pub transform: Option<Transform>,
    /// MT.
    pub material: MaterialEntries,
    /// MT of single regions, each region once, in the order of the text.
    pub regions: Vec<RegionEntries>,
    /// CN.
    pub contact: ContactEntries,
    /// VE.
    pub appearance: AppearanceEntries,
}

/// An ME block: scale first, then rotation, then translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// `trans` [unit].
    pub translation: Point,
    /// `rot`.
    pub rotation: Rotation,
    /// `scale`, no factor zero.
    pub scale: Point,
}

impl Default for Transform {
    fn default() -> Self {
        Self { translation: [0.0; 3], rotation: Rotation::default(), scale: [1.0; 3] }
    }
}

impl Transform {
    /// The affine map of this element, in the file's unit.
    pub fn pose(&self) -> Pose {
        Pose {
            linear: DMat3::from_quat(self.rotation.quaternion())
                * DMat3::from_diagonal(DVec3::from_array(self.scale)),
            translation: DVec3::from_array(self.translation),
        }
    }
}

/// A rotation as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotation {
    /// `rot w,x,y,z`: a quaternion of length 1 within a thousandth, real part first.
    Quaternion([f64; 4]),
    /// `rot axis x,y,z angle DEG`.
    AxisAngle {
        /// Direction of the axis, of any length but zero.
        axis: Point,
        /// Angle [degrees], counter-clockwise seen against the axis.
        degrees: f64,
    },
}

impl Default for Rotation {
    fn default() -> Self {
        Self::Quaternion([1.0, 0.0, 0.0, 0.0])
    }
}

impl Rotation {
    /// The rotation as a unit quaternion.
    pub fn quaternion(&self) -> DQuat {
        match *self {
            Self::Quaternion([w, x, y, z]) => DQuat::from_xyzw(x, y, z, w).normalize(),
            Self::AxisAngle { axis, degrees } => {
                // The largest component goes first: tiny and huge axes have a direction too.
                let axis = DVec3::from_array(axis);
                let axis = (axis / axis.abs().max_element()).normalize();
                DQuat::from_axis_angle(axis, degrees.to_radians())
            }
        }
    }
}

/// An MT block of one region of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionEntries {
    /// Number of the region.
    pub region: i32,
    /// What it says. `damping` and `mass_damping` are the body's.
    pub entries: MaterialEntries,
    /// Where MT stands.
    pub span: Span,
}

impl RegionEntries {
    /// The blocks of both, those of `inner` entry by entry over those of the same region of `outer`.
    pub(super) fn merged(inner: &[Self], outer: &[Self]) -> Vec<Self> {
        let mut merged = outer.to_vec();
        for block in inner {
            match merged.iter_mut().find(|other| other.region == block.region) {
                Some(other) => other.entries = block.entries.over(&other.entries),
                None => merged.push(*block),
            }
        }
        merged.sort_by_key(|block| block.region);
        merged
    }
}

impl MaterialEntries {
    /// These entries over those of an outer block.
    pub(super) fn over(&self, outer: &Self) -> Self {
        let mut both = *outer;
        both.law = self.law.or(outer.law);
        for (value, own) in both.values_mut().into_iter().zip(self.values()) {
            *value = own.or(*value);
        }
        both.fibres = [0, 1].map(|family| self.fibres[family].or(outer.fibres[family]));
        both
    }

    /// The material; `placement` turns the fibres with the mesh.
    pub(super) fn material(&self, placement: &Pose) -> Material {
        let default = Material::default();
        let mut values = default.values();
        for (value, said) in values.iter_mut().zip(self.values()) {
            *value = said.unwrap_or(*value);
        }
        Material {
            law: self.law.unwrap_or(default.law),
            fibres: self.fibres.map(|fibre| fibre.map(|fibre| turned(fibre, placement))),
            ..default
        }
        .with_values(values)
    }
}

/// A line of the mesh in its place, of length 1.
fn turned(fibre: Point, placement: &Pose) -> Point {
    // The largest component goes first: tiny and huge directions are directions too.
    let fibre = DVec3::from_array(fibre);
    let image = placement.linear * (fibre / fibre.abs().max_element()).normalize();
    (image / image.abs().max_element()).normalize().to_array()
}

/// A CN block: what it says and what it leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactEntries {
    /// `friction`.
    pub friction: Option<f64>,
    /// `distance` [unit].
    pub distance: Option<f64>,
    /// `stiffness` [Pa/m].
    pub stiffness: Option<f64>,
    /// `self`.
    pub self_contact: Option<bool>,
}

impl ContactEntries {
    /// These entries over those of an outer block.
    pub(super) fn over(&self, outer: &Self) -> Self {
        Self {
            friction: self.friction.or(outer.friction),
            distance: self.distance.or(outer.distance),
            stiffness: self.stiffness.or(outer.stiffness),
            self_contact: self.self_contact.or(outer.self_contact),
        }
    }

    pub(super) fn settings(&self, unit: Unit) -> ContactSettings {
        let default = ContactSettings::default();
        ContactSettings {
            friction: self.friction.unwrap_or(default.friction),
            distance: self.distance.map(|distance| distance * unit.metres()),
            stiffness: self.stiffness,
            self_contact: self.self_contact.unwrap_or(default.self_contact),
        }
    }
}

/// A VE block: what it says and what it leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AppearanceEntries {
    /// `color`: red, green, blue in 0..=1.
    pub color: Option<[f64; 3]>,
    /// `opacity` in 0..=1.
    pub opacity: Option<f64>,
}

impl AppearanceEntries {
    /// These entries over those of an outer block.
    pub(super) fn over(&self, outer: &Self) -> Self {
        Self { color: self.color.or(outer.color), opacity: self.opacity.or(outer.opacity) }
    }

    pub(super) fn appearance(&self) -> Appearance {
        let opacity = self.opacity.unwrap_or(Appearance::default().opacity);
        Appearance { color: self.color, opacity }
    }
}

/// An FX element.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    /// Which nodes it holds.
    pub region: FixedRegion,
    /// Where it stands.
    pub span: Span,
}

/// Which nodes are held, in the coordinates of the mesh file.
#[derive(Clone, Debug, PartialEq)]
pub enum FixedRegion {
    /// Nodes in the closed box with these opposite corners [unit].
    Box(Point, Point),
    /// Nodes in the closed ball [unit].
    Sphere {
        /// Its centre.
        center: Point,
        /// Its radius.
        radius: f64,
    },
    /// A node set of the mesh, by name.
    Set(String),
}

/// A key of a rigid body's path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathKey {
    /// `at` [s].
    pub time: f64,
    /// `trans` [unit], in the model's axes.
    pub translation: Point,
    /// `rot`, about the place of the mesh file's origin.
    pub rotation: Rotation,
}
