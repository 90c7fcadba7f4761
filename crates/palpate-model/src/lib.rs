//! Object data (tetrahedral meshes and their files), the model language and the model it describes.

pub mod body;
mod disjoint_sets;
pub mod files;
pub mod language;
mod lists;
pub mod mesh;
mod number;

pub use body::{
    Appearance, AttachedNode, Attachment, AttachmentError, Body, BodyError, ContactSettings, Law,
    Material, Model, Parameter, Pose, PoseParts, Range, RigidKey, RigidMotion, Structure,
    triangle_axes,
};
pub use disjoint_sets::DisjointSets;
pub use files::{
    FileError, FileErrorCause, MESH_EXTENSIONS, ReadMesh, ReadOptions, read_mesh, write_mesh,
    write_model,
};
pub use language::{Diagnostic, Document, LoadError, MeshLoader, ModelError, load_model};
pub use lists::Lists;
pub use mesh::{
    Defect, DefectKind, ElementKind, FIBRE_FAMILIES, Indices, Mesh, MeshChange, MeshData,
    MeshError, NONE, NodeOrigin, QualitySummary, RepairReport, TETRAHEDRON_FACES,
};
