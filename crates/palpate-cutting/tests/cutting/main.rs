//! Cuts of boxes of tetrahedra: along planes, strokes and loops, whole and partial, many after
//! another.

mod errors;
mod organs;
mod planes;
mod properties;
mod strokes;
mod succession;
mod support;
