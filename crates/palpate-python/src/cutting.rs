//! `palpate._core.Blade`, and what a cut did.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use palpate::cutting::{
    Blade, BladeError, BladeFileErrorCause, CutOptions, CutReport, When, read_strokes,
};
use palpate::model::MeshChange;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{index_matrix, index_vector, indices, matrix, points, rows};
use crate::errors::{ToPython, io_error, raise};
use crate::mesh::PyMesh;

type Vec3 = (f64, f64, f64);

/// A surface that cuts what it passes through.
#[pyclass(frozen, name = "Blade", module = "palpate._core")]
pub(crate) struct PyBlade {
    pub(crate) blade: Blade,
}

impl ToPython for BladeError {
    fn to_python(self, _py: Python<'_>) -> PyErr {
        PyValueError::new_err(self.to_string())
    }
}

#[pymethods]
impl PyBlade {
    #[new]
    fn new(
        py: Python<'_>,
        points_: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, i64>,
    ) -> PyResult<Self> {
        let triangles = indices(rows::<i64, 3>(&triangles, "triangles")?, "triangles")?;
        let blade = raise(py, Blade::new(points(&points_, "points")?, &triangles))?;
        Ok(Self { blade })
    }

    #[staticmethod]
    fn stroke(py: Python<'_>, edges: PyReadonlyArray3<'_, f64>) -> PyResult<Self> {
        let [_, 2, 3] = edges.shape() else {
            let message = format!("edges: expected shape (n, 2, 3), got {:?}", edges.shape());
            return Err(PyValueError::new_err(message));
        };
        let flat = edges.as_slice()?.as_chunks::<3>().0.as_chunks::<2>().0;
        Ok(Self { blade: raise(py, Blade::stroke(flat))? })
    }

    #[staticmethod]
    fn plane(py: Python<'_>, point: Vec3, normal: Vec3, size: Option<f64>) -> PyResult<Self> {
        Ok(Self { blade: raise(py, Blade::plane(point.into(), normal.into(), size))? })
    }

    #[staticmethod]
    fn closed_loop(py: Python<'_>, line: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        Ok(Self { blade: raise(py, Blade::closed_loop(points(&line, "points")?))? })
    }

    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.blade.points().to_vec())
    }

    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        index_matrix(py, &self.blade.triangles().collect::<Vec<_>>())
    }
}

/// Time [s] or step, blade, line.
type StrokeRow = (Option<f64>, Option<u64>, PyBlade, usize);

/// The strokes of a file: the time [s] at which or the step before which each happens, its blade, its
/// line.
#[pyfunction]
pub(crate) fn read_blades(py: Python<'_>, path: PathBuf) -> PyResult<Vec<StrokeRow>> {
    match py.detach(|| read_strokes(&path)) {
        Ok(strokes) => Ok(strokes
            .into_iter()
            .map(|stroke| {
                let (time, step) = match stroke.when {
                    When::Time(time) => (Some(time), None),
                    When::Step(step) => (None, Some(step)),
                };
                (time, step, PyBlade { blade: stroke.blade }, stroke.line)
            })
            .collect()),
        Err(error) => match error.cause() {
            BladeFileErrorCause::Io(source) => Err(io_error(source, &path)),
            _ => Err(PyValueError::new_err(error.to_string())),
        },
    }
}

/// Options that are given, over the usual ones.
pub(crate) fn options((snap, min_quality, min_edge, min_piece): Options) -> CutOptions {
    let usual = CutOptions::default();
    CutOptions {
        snap: snap.unwrap_or(usual.snap),
        min_quality: min_quality.unwrap_or(usual.min_quality),
        min_edge: min_edge.or(usual.min_edge),
        min_piece: min_piece.unwrap_or(usual.min_piece),
    }
}

/// `snap`, `min_quality`, `min_edge` and `min_piece`, `None` for the usual one.
pub(crate) type Options = (Option<f64>, Option<f64>, Option<f64>, Option<f64>);

/// Mesh, nodes and weights of the origins, parents of the tetrahedra.
pub(crate) type ChangeColumns<'py> =
    (PyMesh, Bound<'py, PyArray2<i32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i32>>);

pub(crate) fn change_columns<'py>(
    py: Python<'py>,
    change: &MeshChange,
) -> PyResult<ChangeColumns<'py>> {
    let nodes: Vec<[u32; 4]> = change.nodes.iter().map(|origin| origin.nodes).collect();
    let weights: Vec<[f64; 4]> = change.nodes.iter().map(|origin| origin.weights).collect();
    Ok((
        PyMesh { mesh: change.mesh.clone() },
        index_matrix(py, &nodes)?,
        matrix(py, weights)?,
        index_vector(py, &change.tetrahedra),
    ))
}

/// What `palpate.BodyCut` says of the cut itself.
pub(crate) fn report_row<'py>(py: Python<'py>, report: &CutReport) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("new_nodes", report.new_nodes)?;
    row.set_item("new_tetrahedra", report.new_tetrahedra)?;
    row.set_item("split_tetrahedra", report.split_tetrahedra)?;
    row.set_item("snapped_nodes", report.snapped_nodes)?;
    row.set_item("pieces_before", report.pieces_before)?;
    row.set_item("pieces", report.pieces)?;
    row.set_item("smallest_quality", report.smallest_quality)?;
    row.set_item("volume_change", report.volume_change)?;
    row.set_item("cut_area", report.cut_area)?;
    row.set_item("deviation", report.deviation)?;
    Ok(row)
}
