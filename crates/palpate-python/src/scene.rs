//! `palpate._core.Scene`: contact detection on the caller's positions.

mod points;
mod queries;

use std::time::Duration;

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use palpate::contact::{IntersectionOptions, Method, ProximityOptions, Split};
use palpate::geometry::{Aabb, Point};
use palpate::{Scene, SceneCuts, SceneError, SceneOptions};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{matrix, points, rows, vector};
use crate::cutting::{self, ChangeColumns, Options, PyBlade, change_columns, report_row};
use crate::errors::raise;
use crate::held::{Held, Threaded};
use crate::mesh::PyMesh;
use crate::model::structure_from_python;

use points::{PenetrationArrays, SurfacePointArrays, penetration_arrays, surface_point_arrays};
use queries::{IntersectionColumns, ProximityColumns, stats_row};
pub(crate) use queries::{StatsRow, intersection_rows};

/// Body, what became of its mesh, what the cut did.
type CutRow<'py> = (usize, ChangeColumns<'py>, Bound<'py, PyDict>);

/// Bodies and their bounding trees. The lock lets two Python threads use one scene in turn.
#[pyclass(frozen, name = "Scene", module = "palpate._core")]
pub(crate) struct PyScene {
    inside: Held<Inside>,
}

/// What the lock guards.
pub(crate) struct Inside {
    scene: Scene,
    cuts: SceneCuts,
    update_time: Duration,
    /// Memory for copies of positions.
    given: Vec<Vec<Point>>,
}

impl Inside {
    /// Another thread may have removed bodies since Python checked the index.
    fn check(&self, body: usize) -> Result<(), SceneError> {
        let count = self.scene.body_count();
        if body < count { Ok(()) } else { Err(SceneError::BodyOutOfRange { body, count }) }
    }
}

impl Threaded for Inside {
    fn restart_threads(&mut self) -> bool {
        self.scene.restart_threads().is_ok()
    }
}

#[pymethods]
impl PyScene {
    #[new]
    fn new(
        py: Python<'_>,
        meshes: Vec<PyRef<'_, PyMesh>>,
        structure: Option<&Bound<'_, PyAny>>,
        leaf_size: Option<usize>,
        split: &str,
        method: &str,
        threads: usize,
    ) -> PyResult<Self> {
        let structure = structure.map(structure_from_python).transpose()?;
        let options = scene_options(leaf_size, split, method, threads)?;
        let meshes = meshes.iter().map(|mesh| mesh.mesh.clone()).collect();
        let scene = raise(py, py.detach(|| Scene::new(meshes, structure.as_ref(), options)))?;
        Ok(Self {
            inside: Held::new(Inside {
                scene,
                cuts: SceneCuts::default(),
                update_time: Duration::ZERO,
                given: Vec::new(),
            }),
        })
    }

    fn add(&self, py: Python<'_>, mesh: &PyMesh) -> usize {
        let mesh = mesh.mesh.clone();
        py.detach(|| self.inside.lock().scene.add(mesh))
    }

    fn remove(&self, py: Python<'_>, body: usize) -> PyResult<()> {
        raise(py, py.detach(|| self.inside.lock().scene.remove(body)))?;
        Ok(())
    }

    fn replace(&self, py: Python<'_>, body: usize, mesh: &PyMesh) -> PyResult<()> {
        let mesh = mesh.mesh.clone();
        raise(py, py.detach(|| self.inside.lock().scene.replace(body, mesh)))?;
        Ok(())
    }

    /// Cuts the bodies along a blade; body, what became of its mesh, what the cut did.
    fn cut<'py>(
        &self,
        py: Python<'py>,
        blade: &PyBlade,
        bodies: Vec<usize>,
        options: Options,
    ) -> PyResult<Vec<CutRow<'py>>> {
        let options = cutting::options(options);
        let cuts = py.detach(|| {
            let mut guard = self.inside.lock();
            let Inside { scene, cuts, .. } = &mut *guard;
            cuts.cut(scene, &bodies, &blade.blade, &options)
        });
        let rows = cuts.map_err(|error| PyValueError::new_err(error.to_string()))?;
        rows.iter()
            .map(|(body, found)| {
                Ok((*body, change_columns(py, &found.change)?, report_row(py, &found.report)?))
            })
            .collect()
    }

    fn remove_tetrahedra<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        tetrahedra: Vec<u32>,
    ) -> PyResult<ChangeColumns<'py>> {
        let guard = self.inside.lock_attached(py);
        raise(py, guard.check(body))?;
        let mesh = guard.scene.mesh(body).clone();
        drop(guard);
        let change = raise(py, py.detach(|| mesh.remove(&tetrahedra)))?;
        raise(py, py.detach(|| self.inside.lock().scene.change_body(body, &change)))?;
        change_columns(py, &change)
    }

    fn update(&self, py: Python<'_>, positions: Vec<PyReadonlyArray2<'_, f64>>) -> PyResult<()> {
        // Copied: while Python's lock is let go its arrays may change.
        let mut given = std::mem::take(&mut self.inside.lock_attached(py).given);
        given.resize_with(positions.len(), Vec::new);
        for (copy, array) in given.iter_mut().zip(&positions) {
            copy.clear();
            copy.extend_from_slice(points(array, "positions")?);
        }
        let updated = py.detach(|| {
            let mut guard = self.inside.lock();
            let slices: Vec<&[Point]> = given.iter().map(Vec::as_slice).collect();
            let updated = guard.scene.update(&slices);
            guard.given = given;
            updated
        });
        self.inside.lock_attached(py).update_time = raise(py, updated)?.time;
        Ok(())
    }

    #[getter]
    fn update_time(&self, py: Python<'_>) -> f64 {
        self.inside.lock_attached(py).update_time.as_secs_f64()
    }

    fn positions<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let guard = self.inside.lock_attached(py);
        raise(py, guard.check(body))?;
        let copy = guard.scene.positions(body).to_vec();
        drop(guard);
        matrix(py, copy)
    }

    fn intersections<'py>(
        &self,
        py: Python<'py>,
        self_contact: bool,
        same_leaf: bool,
        shared_nodes: bool,
    ) -> PyResult<IntersectionColumns<'py>> {
        let options = IntersectionOptions { self_contact, same_leaf, shared_nodes };
        self.find_intersections(py, options)
    }

    fn proximity<'py>(
        &self,
        py: Python<'py>,
        distance: f64,
        self_contact: bool,
        close_at_rest: bool,
    ) -> PyResult<ProximityColumns<'py>> {
        self.find_proximity(
            py,
            distance,
            self_contact,
            ProximityOptions { close_at_rest, ..ProximityOptions::default() },
        )
    }

    fn contact_nodes<'py>(
        &self,
        py: Python<'py>,
        self_contact: bool,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let options = IntersectionOptions { self_contact, ..IntersectionOptions::default() };
        self.find_contact_nodes(py, options)
    }

    fn ignore(&self, py: Python<'_>, body_a: usize, body_b: usize, ignored: bool) -> PyResult<()> {
        raise(py, self.inside.lock_attached(py).scene.ignore(body_a, body_b, ignored))
    }

    fn set_groups(
        &self,
        py: Python<'_>,
        body: usize,
        groups: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<()> {
        let group = |(triangle, group): (usize, &i64)| {
            u32::try_from(*group).map_err(|_| {
                let most = u32::MAX;
                let text = format!("groups[{triangle}]: got {group}, expected 0 to {most}");
                PyValueError::new_err(text)
            })
        };
        let groups: Vec<u32> =
            groups.as_array().iter().enumerate().map(group).collect::<PyResult<_>>()?;
        raise(py, self.inside.lock_attached(py).scene.set_groups(body, &groups))
    }

    fn penetration<'py>(
        &self,
        py: Python<'py>,
        self_contact: bool,
    ) -> PyResult<(PenetrationArrays<'py>, StatsRow)> {
        let (nodes, stats) = py.detach(|| {
            let mut guard = self.inside.lock();
            let found = guard.scene.penetration(&|a, b| self_contact || a != b);
            (found.nodes.clone(), stats_row(&found.stats))
        });
        Ok((penetration_arrays(py, &nodes)?, stats))
    }

    // The three below are not detached: their arrays belong to Python, which could change them meanwhile.

    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        body: Option<usize>,
        max_distance: f64,
    ) -> PyResult<SurfacePointArrays<'py>> {
        let points = rows(&points, "points")?.to_vec();
        let found = py.detach(|| {
            let mut guard = self.inside.lock();
            guard.scene.closest(&points, body, max_distance).map(<[_]>::to_vec)
        });
        surface_point_arrays(py, &raise(py, found)?)
    }

    fn contains<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        body: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let points = rows(&points, "points")?.to_vec();
        let found =
            py.detach(|| self.inside.lock().scene.contains(&points, body).map(<[_]>::to_vec));
        Ok(vector(py, raise(py, found)?))
    }

    fn cast<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArray2<'py, f64>,
        directions: PyReadonlyArray2<'py, f64>,
        body: Option<usize>,
        max_distance: f64,
    ) -> PyResult<SurfacePointArrays<'py>> {
        let origins = rows(&origins, "origins")?.to_vec();
        let directions = rows(&directions, "directions")?.to_vec();
        let found = py.detach(|| {
            let mut guard = self.inside.lock();
            guard.scene.cast(&origins, &directions, body, max_distance).map(<[_]>::to_vec)
        });
        surface_point_arrays(py, &raise(py, found)?)
    }

    fn memory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let memory = self.inside.lock_attached(py).scene.memory();
        let row = PyDict::new(py);
        row.set_item("nodes", memory.nodes)?;
        row.set_item("elements", memory.elements)?;
        row.set_item("triangle_boxes", memory.triangle_boxes)?;
        row.set_item("feature_boxes", memory.feature_boxes)?;
        row.set_item("triangle_masks", memory.triangle_masks)?;
        row.set_item("feature_masks", memory.feature_masks)?;
        row.set_item("layout", memory.layout())?;
        row.set_item("layout_per_triangle", memory.layout_per_triangle())?;
        row.set_item("buffers", memory.buffers)?;
        Ok(row)
    }

    fn boxes<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        level: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let boxes = py.detach(|| {
            let guard = self.inside.lock();
            guard.check(body).map(|()| level_boxes(&guard.scene, body, level))
        });
        let boxes = raise(py, boxes)?;
        matrix(py, boxes)
    }

    fn tree_stats<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyDict>> {
        let guard = self.inside.lock_attached(py);
        raise(py, guard.check(body))?;
        let tree = guard.scene.tree(body);
        let stats = tree.stats();
        let row = PyDict::new(py);
        row.set_item("elements", stats.element_count)?;
        row.set_item("triangles", stats.triangle_count)?;
        row.set_item("expected_nodes", stats.expected_node_count)?;
        row.set_item("nodes", stats.node_count)?;
        row.set_item("leaves", stats.leaf_count)?;
        row.set_item("depth_max", stats.depth_max)?;
        row.set_item("depth_mean", stats.depth_mean)?;
        row.set_item("leaf_size", tree.leaf_size())?;
        row.set_item("leaf_fill", stats.leaf_fill.clone())?;
        Ok(row)
    }
}

/// Low and high corner of each box at a level of a body's bounding tree.
pub(crate) fn level_boxes(scene: &Scene, body: usize, level: usize) -> Vec<[f64; 6]> {
    let boxes = scene.tree(body).level_bounds(level);
    let row = |Aabb { min: [a, b, c], max: [d, e, f] }: &Aabb| [*a, *b, *c, *d, *e, *f];
    boxes.iter().map(row).collect()
}

/// Options from the words that Python uses; the words were checked there already.
pub(crate) fn scene_options(
    leaf_size: Option<usize>,
    split: &str,
    method: &str,
    threads: usize,
) -> PyResult<SceneOptions> {
    let defaults = SceneOptions::default();
    let split = match split {
        "middle" => Split::Middle,
        "count" => Split::Count,
        other => return Err(PyValueError::new_err(format!("split: unknown {other:?}"))),
    };
    let known = Method::NAMES.iter().position(|name| *name == method);
    let method = known
        .map(|index| Method::ALL[index])
        .ok_or_else(|| PyValueError::new_err(format!("method: unknown {method:?}")))?;
    Ok(SceneOptions { leaf_size: leaf_size.unwrap_or(defaults.leaf_size), split, method, threads })
}
