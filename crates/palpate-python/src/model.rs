//! `palpate._core.Body` and `Model`, and reading them from the model language.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use numpy::{PyArray1, PyReadonlyArray1};
use palpate::Model;
use palpate::model::{
    Appearance, Attachment, Body, BodyError, ContactSettings, Document, LoadError, Material,
    MeshLoader, ReadMesh, RigidKey, RigidMotion, Structure, load_model as load,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{self, index_vector};
use crate::errors::{ToPython, io_error, raise};
use crate::mesh::PyMesh;

type Vec3 = (f64, f64, f64);
type Quaternion = (f64, f64, f64, f64);
/// Law, parameters in their order, fibres.
type MaterialRow = (String, [f64; Material::PARAMETERS.len()], Option<Vec3>, Option<Vec3>);
type ContactRow = (f64, Option<f64>, Option<f64>, bool);
type KeyRow = (f64, Vec3, Quaternion);
type AttachmentRow = (usize, usize, Option<f64>, Option<f64>);
type AttachedRow<'py> = (usize, usize, Option<f64>, Bound<'py, PyArray1<i32>>);

/// A body of a model.
#[pyclass(frozen, name = "Body", module = "palpate._core")]
pub(crate) struct PyBody {
    body: Body,
}

#[pymethods]
impl PyBody {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "called by `palpate.Body` only, by position")]
    fn new(
        name: String,
        mesh: &PyMesh,
        material: MaterialRow,
        regions: BTreeMap<i32, MaterialRow>,
        fixed_nodes: PyReadonlyArray1<'_, i64>,
        rigid: Option<Vec<KeyRow>>,
        contact: ContactRow,
        processor: Option<u32>,
        initial_velocity: Vec3,
        color: Option<Vec3>,
        opacity: f64,
    ) -> PyResult<Self> {
        let mut body = Body::new(name, Arc::clone(&mesh.mesh));
        body.material = material_from_row(material).map_err(|error| invalid(&body, &error))?;
        let regions =
            regions.into_iter().map(|(region, row)| Ok((region, material_from_row(row)?)));
        body.regions =
            regions.collect::<Result<_, BodyError>>().map_err(|error| invalid(&body, &error))?;
        let (friction, distance, stiffness, self_contact) = contact;
        body.contact = ContactSettings { friction, distance, stiffness, self_contact };
        let label = format!("body {:?}: fixed_nodes", body.name);
        let entries = fixed_nodes.as_slice()?.iter().enumerate();
        body.fixed_nodes = entries
            .map(|(row, &entry)| arrays::index(entry, &label, row))
            .collect::<PyResult<_>>()?;
        body.fixed_nodes.sort_unstable();
        body.fixed_nodes.dedup();
        body.rigid = rigid.map(|keys| RigidMotion {
            keys: keys.into_iter().map(rigid_key).collect(),
            pivot: [0.0; 3],
        });
        body.processor = processor;
        body.initial_velocity = initial_velocity.into();
        body.appearance = Appearance { color: color.map(Into::into), opacity };
        body.validate().map_err(|error| invalid(&body, &error))?;
        Ok(Self { body })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.body.name
    }

    #[getter]
    fn mesh(&self) -> PyMesh {
        PyMesh { mesh: Arc::clone(&self.body.mesh) }
    }

    #[getter]
    fn source(&self) -> Option<String> {
        let source = &self.body.source;
        (!source.as_os_str().is_empty()).then(|| source.display().to_string())
    }

    /// Translation, rotation axis, angle in degrees, scale, and whether the placement shears.
    #[getter]
    fn placement(&self) -> (Vec3, Vec3, f64, Vec3, bool) {
        let parts = self.body.placement.describe();
        let row = |v: [f64; 3]| (v[0], v[1], v[2]);
        (
            row(parts.translation),
            row(parts.axis),
            parts.angle_degrees,
            row(parts.scale),
            parts.sheared,
        )
    }

    #[getter]
    fn processor(&self) -> Option<u32> {
        self.body.processor
    }

    #[getter]
    fn material(&self) -> MaterialRow {
        material_row(&self.body.material)
    }

    #[getter]
    fn regions(&self) -> BTreeMap<i32, MaterialRow> {
        let regions = self.body.regions.iter();
        regions.map(|(region, material)| (*region, material_row(material))).collect()
    }

    #[getter]
    fn fixed_nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        index_vector(py, &self.body.fixed_nodes)
    }

    #[getter]
    fn rigid(&self) -> Option<Vec<KeyRow>> {
        let keys = &self.body.rigid.as_ref()?.keys;
        Some(
            keys.iter()
                .map(|key| {
                    let q = key.rotation;
                    (key.time, key.translation.into(), (q.w, q.x, q.y, q.z))
                })
                .collect(),
        )
    }

    #[getter]
    fn contact(&self) -> ContactRow {
        let c = &self.body.contact;
        (c.friction, c.distance, c.stiffness, c.self_contact)
    }

    #[getter]
    fn initial_velocity(&self) -> Vec3 {
        self.body.initial_velocity.into()
    }

    #[getter]
    fn color(&self) -> Option<Vec3> {
        self.body.appearance.color.map(Into::into)
    }

    #[getter]
    fn opacity(&self) -> f64 {
        self.body.appearance.opacity
    }
}

fn material_from_row(row: MaterialRow) -> Result<Material, BodyError> {
    let (law, values, a, b) = row;
    let (law, fibres) = (law.parse()?, [a, b].map(|fibre| fibre.map(Into::into)));
    Ok(Material { law, fibres, ..Material::default() }.with_values(values))
}

fn material_row(m: &Material) -> MaterialRow {
    let [a, b] = m.fibres.map(|fibre| fibre.map(Into::into));
    (m.law.to_string(), m.values(), a, b)
}

fn invalid(body: &Body, error: &dyn std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("body {:?}: {error}", body.name))
}

fn rigid_key((time, translation, (w, x, y, z)): KeyRow) -> RigidKey {
    RigidKey { time, translation: DVec3::from(translation), rotation: DQuat::from_xyzw(x, y, z, w) }
}

/// A loaded model.
#[pyclass(frozen, name = "Model", module = "palpate._core")]
pub(crate) struct PyModel {
    pub(crate) model: Arc<Model>,
}

#[pymethods]
impl PyModel {
    #[new]
    fn new(
        bodies: Vec<PyRef<'_, PyBody>>,
        gravity: Vec3,
        attachments: Vec<AttachmentRow>,
    ) -> PyResult<Self> {
        if bodies.is_empty() {
            return Err(PyValueError::new_err("bodies: expected at least one body, got none"));
        }
        let bodies = bodies.iter().map(|body| body.body.clone()).collect();
        let mut model = Model::from_bodies(bodies);
        model.gravity = gravity.into();
        for (row, (first, second, within, stiffness)) in attachments.into_iter().enumerate() {
            let found = Attachment::find(&model.bodies, [first, second], within, stiffness);
            let label = |error| PyValueError::new_err(format!("attachments[{row}]: {error}"));
            model.attachments.push(found.map_err(label)?);
        }
        Ok(Self { model: Arc::new(model) })
    }

    #[getter]
    fn bodies(&self) -> Vec<PyBody> {
        self.model.bodies.iter().map(|body| PyBody { body: body.clone() }).collect()
    }

    #[getter]
    fn gravity(&self) -> Vec3 {
        self.model.gravity.into()
    }

    /// Bodies, stiffness and tied nodes of each attachment.
    #[getter]
    fn attachments<'py>(&self, py: Python<'py>) -> Vec<AttachedRow<'py>> {
        let row = |attachment: &Attachment| {
            let nodes: Vec<u32> = attachment.ties.iter().map(|tie| tie.node).collect();
            let [first, second] = attachment.bodies;
            (first, second, attachment.stiffness, index_vector(py, &nodes))
        };
        self.model.attachments.iter().map(row).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.model.notes.clone()
    }

    /// The upper tree: a body's index, or a pair of subtrees.
    #[getter]
    fn structure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        structure_to_python(py, &self.model.structure)
    }

    fn to_text(&self) -> PyResult<String> {
        self.model.to_text().ok_or_else(|| {
            PyValueError::new_err("the model was made from arrays: it has no text to write")
        })
    }
}

fn structure_to_python<'py>(py: Python<'py>, structure: &Structure) -> PyResult<Bound<'py, PyAny>> {
    match structure {
        Structure::Body(index) => Ok(index.into_pyobject(py)?.into_any()),
        Structure::Join(left, right) => {
            let children = [structure_to_python(py, left)?, structure_to_python(py, right)?];
            Ok(PyTuple::new(py, children)?.into_any())
        }
    }
}

/// A structure from what [`PyModel::structure`] gives.
pub(crate) fn structure_from_python(value: &Bound<'_, PyAny>) -> PyResult<Structure> {
    if let Ok((left, right)) = value.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() {
        let left = structure_from_python(&left)?;
        let right = structure_from_python(&right)?;
        return Ok(Structure::Join(Box::new(left), Box::new(right)));
    }
    Ok(Structure::Body(value.extract()?))
}

/// Reads meshes by calling Python, which knows more formats than the core.
struct PythonLoader(Py<PyAny>);

impl MeshLoader for PythonLoader {
    fn load(&self, path: &Path) -> Result<ReadMesh, LoadError> {
        Python::attach(|py| {
            let called = self.0.call1(py, (path.display().to_string(),));
            let read = called.and_then(|value| {
                let (mesh, notes): (PyRef<'_, PyMesh>, Vec<String>) = value.extract(py)?;
                Ok(ReadMesh { mesh: mesh.mesh.as_ref().clone(), notes })
            });
            read.map_err(|error: PyErr| LoadError::new(error.value(py).to_string()))
        })
    }
}

/// Reads a model file; `loader(path) -> (Mesh, notes)` reads its meshes.
#[pyfunction]
pub(crate) fn load_model(py: Python<'_>, path: PathBuf, loader: Py<PyAny>) -> PyResult<PyModel> {
    std::fs::metadata(&path).map_err(|error| io_error(&error, &path))?;
    let loader = PythonLoader(loader);
    let model = raise(py, py.detach(|| load(&path, &loader)))?;
    Ok(PyModel { model: Arc::new(model) })
}

/// The canonical form of a model text; `path` is for messages.
#[pyfunction]
pub(crate) fn format_model(py: Python<'_>, text: &str, path: PathBuf) -> PyResult<String> {
    match Document::parse(text, &path) {
        Ok(document) => Ok(document.to_text()),
        Err(error) => Err(error.to_python(py)),
    }
}
