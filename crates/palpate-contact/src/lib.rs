//! Contact detection: the bounding tree over a body's tetrahedra, its refit and traversal, and the
//! exact and metric tests on the surface elements it finds.

pub mod pairs;

pub use pairs::{PairKind, PenetratingNode, ProximityPair, TrianglePair};
