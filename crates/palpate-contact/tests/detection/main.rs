//! Detection against its slow, obvious twins.

mod change;
mod intersections;
mod left_out;
mod organs;
mod parry;
mod penetration;
mod points;
mod proximity;
mod scene;
mod scenes;
mod slits;
mod tree;
