//! Detection against its slow, obvious twins.

mod intersections;
mod scenes;
