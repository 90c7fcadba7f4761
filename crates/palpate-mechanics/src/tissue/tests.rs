//! What the laws and their forces must keep.

mod bending;
mod body;
mod closed_forms;
mod laws;
mod rotation;
mod stiffness;
mod support;
mod twin;
