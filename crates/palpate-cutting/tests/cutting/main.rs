//! Cuts of boxes of tetrahedra: along planes, strokes and loops, whole and partial, many after another.

mod planes;
mod properties;
mod support;
