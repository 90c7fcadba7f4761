//! Contact detection: the bounding tree over a body's tetrahedra, its refit and traversal, and the
//! exact and metric tests on the surface elements it finds.
//!
//! [`Scene`] holds the bodies; each step [`Scene::update`] takes their positions, and
//! [`Scene::intersections`], [`Scene::proximity`] and [`Scene::penetration`] answer what touches.
//!
//! ```
//! use std::sync::Arc;
//! use palpate_contact::{IntersectionOptions, Scene, SceneOptions};
//! use palpate_model::{Mesh, MeshData};
//!
//! let tetrahedron = Arc::new(Mesh::new(MeshData {
//!     nodes: vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]],
//!     tetrahedra: vec![[0, 1, 2, 3]],
//!     ..MeshData::default()
//! })?);
//! let meshes = vec![tetrahedron.clone(), tetrahedron.clone()];
//! let mut scene = Scene::new(meshes, None, SceneOptions::default())?;
//!
//! let above: Vec<[f64; 3]> = tetrahedron.nodes().iter().map(|&[x, y, z]| [x, y, z + 1.25]).collect();
//! scene.update(&[tetrahedron.nodes(), &above])?;
//! assert!(scene.intersections(&IntersectionOptions::default()).pairs.is_empty());
//! let close = scene.proximity(&|_, _| Some(0.3));
//! assert!(close.pairs.iter().all(|pair| pair.distance == 0.25));
//! # assert!(!close.pairs.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bounding_tree;
mod error;
mod frame;
mod leaf_pairs;
mod left_out;
mod local_minimum;
mod memory;
mod method;
mod nearest;
mod neighbours;
mod options;
mod pairs;
mod penetration;
mod points;
mod proximity;
mod results;
mod scene;
mod simd;
mod surface;
mod threads;
mod upper_tree;
mod wide;

pub use bounding_tree::{BoundingTree, Split, TreeDefect, TreeNode, TreeStats};
pub use error::SceneError;
pub use memory::DetectionMemory;
pub use method::Method;
pub use options::{IntersectionOptions, LOCAL_MINIMUM_SLACK, ProximityOptions};
pub use pairs::{PairKind, PenetratingNode, ProximityPair, TrianglePair};
pub use points::SurfacePoint;
pub use results::{
    ContactNodes, DetectionStats, Intersections, Penetration, Proximity, UpdateStats,
};
pub use scene::{ChangedSurface, Scene, SceneOptions, SurfaceBasis};
pub use threads::Threads;
