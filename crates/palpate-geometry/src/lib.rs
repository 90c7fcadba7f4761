//! Geometry of contact: vectors, boxes, exact predicates, distances. No I/O, no threads.
//!
//! Points are `[f64; 3]` everywhere in public signatures; lengths are metres. Coordinates are
//! finite: callers reject NaN and infinity on entry, and here the answer to them is unspecified
//! (it is never a panic).

pub mod aabb;
pub mod distance;
pub mod intersection;
pub mod predicates;
pub mod tetrahedron;
pub mod vec3;

pub use aabb::Aabb;
pub use distance::{EdgeEdge, PointTriangle, TriangleFeature, edge_edge, point_triangle};
pub use intersection::{
    triangles_intersect, triangles_intersect_beyond_edge, triangles_intersect_beyond_node,
};

/// A position or vector in space, metres.
pub type Point = [f64; 3];
