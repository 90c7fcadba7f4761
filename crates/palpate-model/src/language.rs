//! The bio-model description language of the paper (section 2), and our extensions to it.
//!
//! Text -> tokens -> [`Document`] (what the text says, checked) -> [`crate::Model`] (meshes loaded
//! and placed). The language is described by example in docs/language.md.

mod brackets;
mod diagnostic;
mod document;
mod elements;
mod lexer;
mod load;
mod motion;
mod near;
mod parser;
mod text;
mod values;

pub use crate::body::MaterialEntries;
pub use diagnostic::{Diagnostic, ModelError, Span};
pub use document::{
    AppearanceEntries, AttachmentEntries, Block, Branch, ContactEntries, Document, Fixed,
    FixedRegion, PathKey, RegionEntries, Rotation, Settings, Transform, Tree, Unit,
};
pub use load::{LoadError, MeshLoader, load_model};
