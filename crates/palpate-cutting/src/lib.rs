//! Cuts a tetrahedral mesh along a blade: geometry and topology only, no mechanics.
//!
//! The way of a cut: a [`Blade`] is one or more oriented sheets; each sheet finds the tetrahedra it
//! passes through and the side of their nodes (`crossing`); nodes too close to it are taken to lie
//! on it (`snap`); the edges that are left crossed are split (`split`); the faces between the two
//! sides are opened by copying nodes (`separate`).

mod blade;
mod crossing;
mod cut;
mod draft;
mod report;
mod separate;
mod snap;
mod split;
mod wounds;

pub use blade::{
    Blade, BladeError, BladeFileError, BladeFileErrorCause, Stroke, When, parse_strokes,
    read_strokes,
};
pub use cut::{Cut, CutError, CutOptions, cut, cut_on};
pub use report::CutReport;
