//! Do two closed shapes share a point? Decided exactly, from orientation signs alone.

mod neighbours;
mod planar;
mod segment_triangle;
mod triangle_triangle;

pub use neighbours::{triangles_intersect_beyond_edge, triangles_intersect_beyond_node};
pub use segment_triangle::segment_triangle_intersect;
pub use triangle_triangle::triangles_intersect;
