//! From what the text says to bodies in their places.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::diagnostic::{Diagnostic, ModelError, Span};
use super::document::{
    AppearanceEntries, AttachmentEntries, Block, ContactEntries, Document, Fixed, FixedRegion,
    PathKey, RegionEntries, Settings, Tree,
};
use super::near::near_miss;
use crate::body::{
    Attachment, AttachmentError, Body, BodyError, Material, MaterialEntries, Model, Pose, RigidKey,
    RigidMotion, Structure,
};
use crate::files::{FileError, ReadMesh, ReadOptions, read_mesh};
use crate::mesh::{Mesh, MeshError};
use crate::number::Triple;

/// Reads the object data that NE names.
pub trait MeshLoader {
    /// Reads one mesh file; `path` is resolved against the model file.
    ///
    /// # Errors
    /// What to show at the NE; the model's other errors are still found.
    fn load(&self, path: &Path) -> Result<ReadMesh, LoadError>;
}

/// Reads the formats that this crate knows, `.seg` and `.vtk`.
impl MeshLoader for ReadOptions {
    fn load(&self, path: &Path) -> Result<ReadMesh, LoadError> {
        Ok(read_mesh(path, self)?)
    }
}

/// Why a loader gave no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct LoadError {
    /// What is wrong, with the file's name.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
}

impl LoadError {
    /// An error without a hint.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None }
    }
}

impl From<FileError> for LoadError {
    fn from(error: FileError) -> Self {
        Self::new(error.to_string())
    }
}

/// Reads a model file and every mesh that it names, and places the bodies.
///
/// # Errors
/// Everything that is wrong with the file or, when the text is sound, with its meshes.
pub fn load_model(path: &Path, loader: &dyn MeshLoader) -> Result<Model, ModelError> {
    let bytes = fs::read(path).map_err(|error| ModelError::unreadable(path, error.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|_| {
        ModelError::unreadable(path, "this is no text file: it is not UTF-8".into())
    })?;
    Document::parse(&text, path)?.load(loader)
}

impl Document {
    /// Reads every mesh that the document names and places the bodies. A file that several TREEs
    /// name is read once.
    ///
    /// # Errors
    /// Everything that is wrong with the meshes, at the NE that names them.
    pub fn load(&self, loader: &dyn MeshLoader) -> Result<Model, ModelError> {
        let mut names = HashSet::new();
        collect_names(&self.root, &mut names);
        let mut build = Build {
            document: self,
            loader,
            meshes: HashMap::new(),
            names,
            stems: HashMap::new(),
            bodies: Vec::new(),
            notes: Vec::new(),
            errors: Vec::new(),
        };
        let structure = build.block(&self.root, &Inherited::default());
        // Where a mesh is wrong bodies are missing, and that error is enough.
        let attachments =
            if build.errors.is_empty() { build.attachments(&self.root) } else { Vec::new() };
        let Build { bodies, notes, errors, .. } = build;
        match structure {
            Some(structure) if errors.is_empty() => Ok(Model {
                bodies,
                structure,
                attachments,
                gravity: self.gravity,
                notes,
                document: Some(self.clone()),
            }),
            _ => Err(ModelError::new(Arc::clone(&self.source), errors)),
        }
    }
}

fn collect_names(block: &Block, names: &mut HashSet<String>) {
    match block {
        Block::Branch(branch) => {
            branch.children.iter().for_each(|child| collect_names(child, names));
        }
        Block::Tree(tree) => names.extend(tree.name.clone()),
    }
}

/// What the blocks around a block say.
#[derive(Clone)]
struct Inherited {
    pose: Pose,
    material: MaterialEntries,
    regions: Vec<RegionEntries>,
    contact: ContactEntries,
    appearance: AppearanceEntries,
}

impl Default for Inherited {
    fn default() -> Self {
        Self {
            pose: Pose::IDENTITY,
            material: MaterialEntries::default(),
            regions: Vec::new(),
            contact: ContactEntries::default(),
            appearance: AppearanceEntries::default(),
        }
    }
}

impl Inherited {
    fn with(&self, settings: &Settings) -> Self {
        Self {
            pose: settings.transform.map_or(self.pose, |inner| self.pose.after(&inner.pose())),
            material: settings.material.over(&self.material),
            regions: RegionEntries::merged(&settings.regions, &self.regions),
            contact: settings.contact.over(&self.contact),
            appearance: settings.appearance.over(&self.appearance),
        }
    }
}

struct Build<'a> {
    document: &'a Document,
    loader: &'a dyn MeshLoader,
    /// Meshes as in their files; `None` for those that could not be read.
    meshes: HashMap<PathBuf, Option<Arc<Mesh>>>,
    /// Names that are taken: those that the text gives, then those made.
    names: HashSet<String>,
    /// How many names were made from each stem.
    stems: HashMap<String, usize>,
    bodies: Vec<Body>,
    notes: Vec<String>,
    errors: Vec<Diagnostic>,
}

impl Build<'_> {
    fn error(&mut self, span: Span, message: String, hint: Option<String>) {
        self.errors.push(self.document.source.diagnostic(span, message, hint));
    }

    fn block(&mut self, block: &Block, outer: &Inherited) -> Option<Structure> {
        match block {
            Block::Branch(branch) => {
                let inherited = outer.with(&branch.settings);
                // Every child is visited, so that all errors are found.
                let children: Vec<Option<Structure>> =
                    branch.children.iter().map(|child| self.block(child, &inherited)).collect();
                Structure::chain(children.into_iter().collect::<Option<Vec<_>>>()?)
            }
            Block::Tree(tree) => {
                let body = self.body(tree, &outer.with(&tree.settings))?;
                self.bodies.push(body);
                Some(Structure::Body(self.bodies.len() - 1))
            }
        }
    }

    fn body(&mut self, tree: &Tree, inherited: &Inherited) -> Option<Body> {
        let unit = self.document.unit;
        let folder = self.document.source.path.parent().unwrap_or(Path::new(""));
        let path = folder.join(&tree.file);
        let name = tree.name.clone().unwrap_or_else(|| self.unique_name(&path));
        let mesh = self.mesh(&path, tree.file_span)?;
        let fixed_nodes = self.fixed_nodes(&mesh, &tree.fixed);
        let to_metres = DMat3::from_diagonal(DVec3::splat(unit.metres()));
        let placement = Pose { linear: to_metres, translation: DVec3::ZERO }.after(&inherited.pose);
        let placed = self.placed(&mesh, &placement, tree)?;
        let rigid = tree.rigid.as_ref().map(|keys| RigidMotion {
            keys: keys.iter().map(|key| rigid_key(key, unit.metres())).collect(),
            pivot: placement.translation.to_array(),
        });
        let velocity = tree.initial_velocity.unwrap_or_default();
        let regions = self.regions(&mesh, tree, inherited, &placement)?;
        let body = Body {
            name,
            mesh: placed,
            source: path,
            placement,
            processor: tree.processor,
            material: inherited.material.material(&placement),
            regions,
            fixed_nodes: fixed_nodes?,
            rigid,
            contact: inherited.contact.settings(unit),
            appearance: inherited.appearance.appearance(),
            initial_velocity: velocity.map(|component| component * unit.metres()),
        };
        // Values were checked where they stand; this is about how they fit together.
        if let Err(error) = body.validate() {
            self.error(tree.span, error.to_string(), None);
            return None;
        }
        Some(body)
    }

    /// Materials of the regions that the mesh has; `None` when the TREE names another one.
    fn regions(
        &mut self,
        mesh: &Mesh,
        tree: &Tree,
        inherited: &Inherited,
        placement: &Pose,
    ) -> Option<Vec<(i32, Material)>> {
        let known = mesh.region_numbers();
        let errors_before = self.errors.len();
        for block in &tree.settings.regions {
            if known.binary_search(&block.region).is_err() {
                let message =
                    BodyError::UnknownRegion { region: block.region, known: known.clone() };
                self.error(block.span, message.to_string(), None);
            }
        }
        let present = inherited.regions.iter().filter(|block| known.contains(&block.region));
        let regions = present.map(|block| {
            let entries = block.entries.over(&inherited.material);
            (block.region, entries.material(placement))
        });
        (self.errors.len() == errors_before).then(|| regions.collect())
    }

    /// Every AT below `block`, once all bodies are known.
    fn attachments(&mut self, block: &Block) -> Vec<Attachment> {
        let Block::Branch(branch) = block else { return Vec::new() };
        let mut found = Vec::new();
        for child in &branch.children {
            found.extend(self.attachments(child));
        }
        for entries in &branch.attachments {
            found.extend(self.attachment(entries));
        }
        found
    }

    fn attachment(&mut self, entries: &AttachmentEntries) -> Option<Attachment> {
        let mut bodies = [0; 2];
        for (index, name) in bodies.iter_mut().zip(&entries.bodies) {
            let names: Vec<&str> = self.bodies.iter().map(|body| body.name.as_str()).collect();
            if let Some(place) = names.iter().position(|known| known == name) {
                *index = place;
                continue;
            }
            let hint = match near_miss(name, &names) {
                Some(meant) => format!("{name}: did you mean {meant}?"),
                None => format!("the model has {}", names.join(", ")),
            };
            self.error(entries.span, format!("no body is named `{name}`"), Some(hint));
            return None;
        }
        let within = entries.within.map(|within| within * self.document.unit.metres());
        match Attachment::find(&self.bodies, bodies, within, entries.stiffness) {
            Ok(attachment) => Some(attachment),
            Err(error) => {
                let hint = matches!(error, AttachmentError::OutOfReach { .. })
                    .then(|| "place the bodies closer, or say within how far".to_owned());
                self.error(entries.span, error.to_string(), hint);
                None
            }
        }
    }

    /// The file's stem, with _2, _3 where another body has that name.
    fn unique_name(&mut self, path: &Path) -> String {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let number = self.stems.entry(stem.clone()).or_insert(0);
        loop {
            *number += 1;
            let name = if *number == 1 { stem.clone() } else { format!("{stem}_{number}") };
            if self.names.insert(name.clone()) {
                return name;
            }
        }
    }

    fn mesh(&mut self, path: &Path, span: Span) -> Option<Arc<Mesh>> {
        if let Some(known) = self.meshes.get(path) {
            return known.clone();
        }
        let mesh = match self.loader.load(path) {
            Ok(read) => {
                let notes = read.notes.iter().map(|note| format!("{}: {note}", path.display()));
                self.notes.extend(notes);
                Some(Arc::new(read.mesh))
            }
            Err(error) => {
                let hint = error.hint.or_else(|| file_beside(path));
                self.error(span, error.message, hint);
                None
            }
        };
        self.meshes.insert(path.to_owned(), mesh.clone());
        mesh
    }

    fn placed(&mut self, mesh: &Arc<Mesh>, placement: &Pose, tree: &Tree) -> Option<Arc<Mesh>> {
        if *placement == Pose::IDENTITY {
            return Some(Arc::clone(mesh));
        }
        let mirrored = placement.linear.determinant() < 0.0;
        match mesh.mapped(|point| placement.apply(point), mirrored) {
            Ok(placed) => Some(Arc::new(placed)),
            Err(error) => {
                let trouble = match error {
                    MeshError::Degenerate(indices) | MeshError::Inverted(indices) => {
                        format!("{} of its tetrahedra lose their volume", indices.count)
                    }
                    other => other.to_string(),
                };
                let message = format!("{} cannot be placed: {trouble}", tree.file);
                let hint = "numbers of the ME blocks around it are too large or too small";
                self.error(tree.file_span, message, Some(hint.into()));
                None
            }
        }
    }

    /// Nodes held by any of the FX elements; `None` when one of them is wrong.
    fn fixed_nodes(&mut self, mesh: &Mesh, fixed: &[Fixed]) -> Option<Vec<u32>> {
        let mut nodes = Vec::new();
        let errors_before = self.errors.len();
        for element in fixed {
            let held = match &element.region {
                FixedRegion::Set(name) => {
                    let Some(set) = mesh.node_sets().get(name) else {
                        self.unknown_set(mesh, name, element.span);
                        continue;
                    };
                    set.clone()
                }
                FixedRegion::Box(a, b) => nodes_where(mesh, |point| {
                    (0..3).all(|axis| {
                        let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
                        (low..=high).contains(&point[axis])
                    })
                }),
                FixedRegion::Sphere { center, radius } => nodes_where(mesh, |point| {
                    DVec3::from_array(*point).distance(DVec3::from_array(*center)) <= *radius
                }),
            };
            if held.is_empty() {
                let bounds = mesh.bounds();
                let message = "this FX holds no node of the mesh".to_owned();
                let hint = format!(
                    "in its file the mesh lies between {} and {}",
                    Triple(bounds.min),
                    Triple(bounds.max)
                );
                self.error(element.span, message, Some(hint));
            }
            nodes.extend(held);
        }
        nodes.sort_unstable();
        nodes.dedup();
        (self.errors.len() == errors_before).then_some(nodes)
    }

    fn unknown_set(&mut self, mesh: &Mesh, name: &str, span: Span) {
        let known: Vec<&str> = mesh.node_sets().keys().map(String::as_str).collect();
        let hint = match near_miss(name, &known) {
            Some(meant) => format!("{name}: did you mean {meant}?"),
            None if known.is_empty() => "the mesh has no node sets".to_owned(),
            None => format!("the mesh has the sets {}", known.join(", ")),
        };
        self.error(span, format!("the mesh has no node set `{name}`"), Some(hint));
    }
}

fn nodes_where(mesh: &Mesh, held: impl Fn(&[f64; 3]) -> bool) -> Vec<u32> {
    let nodes = mesh.nodes().iter().enumerate();
    nodes.filter(|(_, point)| held(point)).map(|(index, _)| index as u32).collect()
}

fn rigid_key(key: &PathKey, metres: f64) -> RigidKey {
    RigidKey {
        time: key.time,
        translation: DVec3::from_array(key.translation) * metres,
        rotation: key.rotation.quaternion(),
    }
}

/// For a file that does not exist: a file beside it with nearly its name.
fn file_beside(path: &Path) -> Option<String> {
    if path.exists() {
        return None;
    }
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let entries = fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let mut names: Vec<String> =
        entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    names.sort_unstable();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let name = path.file_name()?.to_str()?;
    near_miss(name, &names).map(|meant| format!("{name}: did you mean {meant}?"))
}
