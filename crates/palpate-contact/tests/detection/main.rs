//! Detection against its slow, obvious twins.

mod intersections;
mod left_out;
mod organs;
mod parry;
mod penetration;
mod proximity;
mod scene;
mod scenes;
mod tree;
