//! Contact detection: the bounding tree over a body's tetrahedra, its refit and traversal, and the
//! exact and metric tests on the surface elements it finds.
//!
//! [`Scene`] holds the bodies; each step [`Scene::update`] takes their positions, and
//! [`Scene::intersections`], [`Scene::proximity`] and [`Scene::penetration`] answer what touches.

pub mod bounding_tree;
mod leaf_pairs;
mod method;
pub mod pairs;
mod penetration;
mod proximity;
pub mod scene;
mod surface;
mod upper_tree;

pub use bounding_tree::{BoundingTree, Split, TreeDefect, TreeStats};
pub use pairs::{PairKind, PenetratingNode, ProximityPair, TrianglePair};
pub use scene::{
    ClosestPoint, DetectionStats, IntersectionOptions, Intersections, Method, Penetration,
    Proximity, Scene, SceneError, SceneOptions, UpdateStats,
};
