//! `palpate._core.Mesh` and the files the core reads itself.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use palpate::model::{ReadOptions, read_mesh, write_mesh};
use palpate::{Mesh, MeshData};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, index_matrix, index_vector, matrix, vector};
use crate::errors::{ToPython, raise};

/// A checked, immutable mesh.
#[pyclass(frozen, name = "Mesh", module = "palpate._core")]
pub(crate) struct PyMesh {
    pub(crate) mesh: Arc<Mesh>,
}

impl From<Mesh> for PyMesh {
    fn from(mesh: Mesh) -> Self {
        Self { mesh: Arc::new(mesh) }
    }
}

#[pymethods]
impl PyMesh {
    /// Builds a mesh and says what repair did.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "called by `palpate.Mesh` only, by position")]
    fn build(
        py: Python<'_>,
        nodes: PyReadonlyArray2<'_, f64>,
        tetrahedra: Option<PyReadonlyArray2<'_, i64>>,
        triangles: Option<PyReadonlyArray2<'_, i64>>,
        node_sets: BTreeMap<String, PyReadonlyArray1<'_, i64>>,
        regions: Option<PyReadonlyArray1<'_, i64>>,
        fibres: Vec<PyReadonlyArray2<'_, f64>>,
        repair: bool,
    ) -> PyResult<(Self, Vec<String>)> {
        let mut data =
            MeshData { nodes: arrays::points(&nodes, "nodes")?.to_vec(), ..MeshData::default() };
        if let Some(array) = &tetrahedra {
            let rows = arrays::rows::<i64, 4>(array, "tetrahedra")?;
            data.tetrahedra = arrays::indices(rows, "tetrahedra")?;
        }
        if let Some(array) = &triangles {
            let rows = arrays::rows::<i64, 3>(array, "triangles")?;
            data.triangles = arrays::indices(rows, "triangles")?;
        }
        for (name, members) in &node_sets {
            let label = format!("node_sets[{name:?}]");
            let mut set = members
                .as_slice()?
                .iter()
                .enumerate()
                .map(|(row, &entry)| arrays::index(entry, &label, row))
                .collect::<PyResult<Vec<u32>>>()?;
            set.sort_unstable();
            set.dedup();
            data.node_sets.insert(name.clone(), set);
        }
        if let Some(array) = &regions {
            data.regions = array
                .as_slice()?
                .iter()
                .enumerate()
                .map(|(row, &entry)| {
                    i32::try_from(entry).map_err(|_| {
                        pyo3::exceptions::PyValueError::new_err(format!(
                            "regions: row {row} holds {entry}, expected a 32-bit integer"
                        ))
                    })
                })
                .collect::<PyResult<_>>()?;
        }
        for (family, array) in fibres.iter().enumerate() {
            data.fibres[family] = arrays::points(array, "fibres")?.to_vec();
        }
        let built = py.detach(|| {
            if repair {
                Mesh::repaired(data).map(|(mesh, report)| (mesh, report.lines()))
            } else {
                Mesh::new(data).map(|mesh| (mesh, Vec::new()))
            }
        });
        let (mesh, notes) = raise(py, built)?;
        Ok((mesh.into(), notes))
    }

    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.mesh.nodes().to_vec())
    }

    #[getter]
    fn tetrahedra<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        index_matrix(py, self.mesh.tetrahedra())
    }

    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        index_matrix(py, self.mesh.triangles())
    }

    #[getter]
    fn triangle_owners<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        index_vector(py, self.mesh.triangle_owners())
    }

    #[getter]
    fn surface_nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        index_vector(py, self.mesh.surface_nodes())
    }

    #[getter]
    fn surface_edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        index_matrix(py, self.mesh.surface_edges())
    }

    #[getter]
    fn node_sets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sets = PyDict::new(py);
        for (name, members) in self.mesh.node_sets() {
            sets.set_item(name, index_vector(py, members))?;
        }
        Ok(sets)
    }

    #[getter]
    fn regions<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<i32>>> {
        let regions = self.mesh.regions();
        (!regions.is_empty()).then(|| vector(py, regions.to_vec()))
    }

    /// Fibre directions, one array for each family; empty arrays for none.
    #[getter]
    fn fibres<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        self.mesh.fibres().iter().map(|fibres| matrix(py, fibres.clone())).collect()
    }

    #[getter]
    fn volume(&self) -> f64 {
        self.mesh.volume()
    }

    /// Defects as (kind, count, first indices, message).
    fn validate(&self, py: Python<'_>) -> Vec<(String, usize, Vec<u32>, String)> {
        let mesh = &self.mesh;
        py.detach(|| mesh.validate())
            .into_iter()
            .map(|defect| {
                let message = defect.to_string();
                let kind = snake_case(&format!("{:?}", defect.kind));
                (kind, defect.indices.count, defect.indices.first, message)
            })
            .collect()
    }

    fn with_nodes(&self, py: Python<'_>, nodes: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let nodes = arrays::points(&nodes, "nodes")?.to_vec();
        Ok(raise(py, self.mesh.with_nodes(nodes))?.into())
    }

    fn same_as(&self, other: &Self) -> bool {
        self.mesh == other.mesh
    }
}

/// `UnusedNodes` as Python writes names: `unused_nodes`.
fn snake_case(name: &str) -> String {
    let mut result = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !result.is_empty() {
            result.push('_');
        }
        result.extend(letter.to_lowercase());
    }
    result
}

/// Reads `.seg` or `.vtk`; also what was left out or mended.
#[pyfunction]
pub(crate) fn read_mesh_file(
    py: Python<'_>,
    path: PathBuf,
    repair: bool,
) -> PyResult<(PyMesh, Vec<String>)> {
    match py.detach(|| read_mesh(&path, &ReadOptions { repair })) {
        Ok(read) => Ok((read.mesh.into(), read.notes)),
        Err(error) => Err(error.to_python(py)),
    }
}

/// Writes `.seg` or `.vtk`; the file is complete or absent.
#[pyfunction]
pub(crate) fn write_mesh_file(py: Python<'_>, path: PathBuf, mesh: &PyMesh) -> PyResult<()> {
    let mesh = &mesh.mesh;
    raise(py, py.detach(|| write_mesh(&path, mesh)))
}
