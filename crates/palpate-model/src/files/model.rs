//! Writes a model of any origin as a text and its meshes.

use std::io;
use std::path::{Path, PathBuf};

use super::{FileError, write_mesh, write_whole};
use crate::body::{Attachment, Body, Material, Model, Structure};
use crate::language::{
    AppearanceEntries, AttachmentEntries, Block, Branch, ContactEntries, Document, Fixed,
    FixedRegion, MaterialEntries, PathKey, RegionEntries, Rotation, Settings, Span, Transform,
    Tree,
};
use crate::mesh::{Mesh, MeshError};

/// Name of the node set that holds the fixed nodes.
const FIXED: &str = "fixed";

/// Writes a model as it is now, cuts included: `path`, a model file, and beside it one `.seg` for each
/// body, its nodes in metres where the model has them at rest. Returns all files, the model file last.
///
/// Bodies come in the order of the structure. What the text was that the model came from is not kept:
/// transforms are in the meshes. An attachment is written by its reach and found again when the model
/// is loaded.
///
/// # Errors
/// If a file cannot be written; those before it are complete.
///
/// # Panics
/// If the model's structure names a body that is not there.
pub fn write_model(path: &Path, model: &Model) -> Result<Vec<PathBuf>, FileError> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = Vec::new();
    for (index, body) in model.bodies.iter().enumerate() {
        let name: String =
            body.name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let mut file = format!("{stem}_{name}.seg");
        // Names that differ in what is replaced only.
        if files.iter().any(|other: &PathBuf| other.ends_with(&file)) {
            file = format!("{stem}_{name}_{index}.seg");
        }
        let file = path.with_file_name(file);
        let mesh = mesh_of(body).map_err(|error| FileError {
            path: file.clone(),
            line: None,
            cause: error.into(),
        })?;
        write_mesh(&file, &mesh)?;
        files.push(file);
    }
    let name =
        |body: usize| files[body].file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut root = block(&model.structure, model, &name);
    let attachments: Vec<_> =
        model.attachments.iter().map(|each| attachment(each, model)).collect();
    root = match root {
        Block::Branch(mut branch) => {
            branch.attachments = attachments;
            Block::Branch(branch)
        }
        tree @ Block::Tree(_) => tree,
    };
    let mut document = Document::new(root);
    document.gravity = model.gravity;
    let text = document.to_text();
    write_whole(path, |out| out.write_all(text.as_bytes())).map_err(|error: io::Error| {
        FileError { path: path.to_owned(), line: None, cause: error.into() }
    })?;
    files.push(path.to_owned());
    Ok(files)
}

/// Where the body's origin is: the fixed point of a rigid body's rotations.
fn origin(body: &Body) -> [f64; 3] {
    body.rigid.as_ref().map_or([0.0; 3], |motion| motion.pivot)
}

/// The mesh about its origin, with the fixed nodes as a set.
fn mesh_of(body: &Body) -> Result<Mesh, MeshError> {
    let origin = origin(body);
    let mut data = body.mesh.as_ref().clone().into_data();
    for node in &mut data.nodes {
        *node = std::array::from_fn(|axis| node[axis] - origin[axis]);
    }
    data.node_sets.remove(FIXED);
    if !body.fixed_nodes.is_empty() {
        data.node_sets.insert(FIXED.into(), body.fixed_nodes.clone());
    }
    Mesh::new(data)
}

fn block(structure: &Structure, model: &Model, file: &dyn Fn(usize) -> String) -> Block {
    match structure {
        Structure::Body(body) => Block::Tree(Box::new(tree(&model.bodies[*body], file(*body)))),
        // A chain of joins is one branch: nested ones would be deeper than a text may be.
        Structure::Join(..) => Block::Branch(Box::new(Branch {
            children: chained(structure).map(|part| block(part, model, file)).collect(),
            ..Branch::default()
        })),
    }
}

/// What [`Structure::chain`] made the structure of.
fn chained(mut structure: &Structure) -> impl Iterator<Item = &Structure> {
    let mut last = Vec::new();
    while let Structure::Join(left, right) = structure {
        last.push(right.as_ref());
        structure = left;
    }
    last.push(structure);
    last.into_iter().rev()
}

fn tree(body: &Body, file: String) -> Tree {
    let region = |(region, material): &(i32, Material)| RegionEntries {
        region: *region,
        entries: MaterialEntries { damping: None, mass_damping: None, ..entries(material) },
        ..RegionEntries::default()
    };
    let settings = Settings {
        transform: (origin(body) != [0.0; 3])
            .then(|| Transform { translation: origin(body), ..Transform::default() }),
        material: entries(&body.material),
        regions: body.regions.iter().map(region).collect(),
        contact: ContactEntries {
            friction: Some(body.contact.friction),
            distance: body.contact.distance,
            stiffness: body.contact.stiffness,
            self_contact: Some(body.contact.self_contact),
        },
        appearance: AppearanceEntries {
            color: body.appearance.color,
            opacity: Some(body.appearance.opacity),
        },
    };
    let key = |key: &crate::body::RigidKey| PathKey {
        time: key.time,
        translation: key.translation.to_array(),
        rotation: Rotation::Quaternion([
            key.rotation.w,
            key.rotation.x,
            key.rotation.y,
            key.rotation.z,
        ]),
    };
    let fixed = Fixed { region: FixedRegion::Set(FIXED.into()), span: Span::default() };
    Tree {
        name: Some(body.name.clone()),
        settings,
        processor: body.processor,
        file,
        fixed: if body.fixed_nodes.is_empty() { Vec::new() } else { vec![fixed] },
        rigid: body.rigid.as_ref().map(|motion| motion.keys.iter().map(key).collect()),
        initial_velocity: (body.initial_velocity != [0.0; 3]).then_some(body.initial_velocity),
        ..Tree::default()
    }
}

fn entries(material: &Material) -> MaterialEntries {
    let mut entries = MaterialEntries {
        law: Some(material.law),
        fibres: material.fibres,
        ..MaterialEntries::default()
    };
    for (entry, value) in entries.values_mut().into_iter().zip(material.values()) {
        *entry = Some(value);
    }
    entries
}

fn attachment(attachment: &Attachment, model: &Model) -> AttachmentEntries {
    let longest = (attachment.ties.iter())
        .map(|tie| tie.offset.iter().map(|x| x * x).sum::<f64>().sqrt())
        .fold(0.0, f64::max);
    AttachmentEntries {
        bodies: attachment.bodies.map(|body| model.bodies[body].name.clone()),
        within: (longest > 0.0).then_some(longest * (1.0 + 1e-9)),
        stiffness: attachment.stiffness,
        ..AttachmentEntries::default()
    }
}
