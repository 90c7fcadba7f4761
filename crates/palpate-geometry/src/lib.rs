//! Geometry of contact: vectors, boxes, exact predicates, distances. No I/O, no threads.
//!
//! Points are `[f64; 3]` everywhere in public signatures; lengths are metres.

pub mod aabb;

pub use aabb::Aabb;

/// A position or vector in space, metres.
pub type Point = [f64; 3];
