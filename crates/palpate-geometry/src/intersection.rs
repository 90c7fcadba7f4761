//! Do two closed shapes share a point? Decided exactly, from orientation signs alone.

mod planar;
mod segment_triangle;
mod triangle_triangle;

pub use segment_triangle::segment_triangle_intersect;
pub use triangle_triangle::triangles_intersect;
