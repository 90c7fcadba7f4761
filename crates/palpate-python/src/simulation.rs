//! `palpate._core.Simulation`: the step loop, its state and its checkpoints.

use std::path::PathBuf;
use std::sync::Mutex;

use glam::DQuat;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use palpate::contact::{IntersectionOptions, PairKind};
use palpate::geometry::Point;
use palpate::mechanics::Pull;
use palpate::{
    ChangeReport, Simulation, SimulationOptions, Snapshot, StepReport, StepTimes, Substeps,
};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyTuple};

use crate::arrays::{index, index_matrix, index_vector, matrix, points, rows, vector};
use crate::cutting::{self, ChangeColumns, Options, PyBlade, change_columns, report_row};
use crate::errors::raise;
use crate::held::{Held, Threaded};
use crate::model::PyModel;
use crate::scene::{StatsRow, intersection_rows, level_boxes, scene_options};
use crate::tool_loop::PyToolLoop;

/// A state to come back to.
#[pyclass(frozen, name = "Snapshot", module = "palpate._core")]
pub(crate) struct PySnapshot {
    snapshot: Snapshot,
}

#[pymethods]
impl PySnapshot {
    #[getter]
    fn time(&self) -> f64 {
        self.snapshot.state().time
    }
}

/// Bodies in motion. The lock lets two Python threads use one simulation in turn.
#[pyclass(frozen, name = "Simulation", module = "palpate._core")]
pub(crate) struct PySimulation {
    simulation: Held<Simulation>,
}

impl Threaded for Simulation {
    fn restart_threads(&mut self) -> bool {
        Simulation::restart_threads(self).is_ok()
    }
}

impl PySimulation {
    fn per_body<'py>(
        &self,
        py: Python<'py>,
        values: impl Fn(&Simulation, usize) -> Vec<Point>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let guard = self.simulation.lock_attached(py);
        let arrays = (0..guard.model().bodies.len())
            .map(|body| matrix(py, values(&guard, body)))
            .collect::<PyResult<Vec<_>>>()?;
        PyTuple::new(py, arrays)
    }
}

/// Von Mises stress of rows xx, yy, zz, xy, yz, xz.
#[pyfunction]
pub(crate) fn von_mises<'py>(
    py: Python<'py>,
    stress: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let stress = rows::<f64, 6>(&stress, "stress")?;
    Ok(vector(py, stress.iter().map(palpate::mechanics::von_mises).collect()))
}

type Vec3 = (f64, f64, f64);
type DriveRow<'py> =
    (u32, Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Body, what became of its mesh, what the cut did, springs that were released.
type BodyChangeRow<'py> = (usize, ChangeColumns<'py>, Option<Bound<'py, PyDict>>, Vec<u64>);

/// What a change did to each body, and the seconds of its stages.
type ChangeRows<'py> = (Vec<BodyChangeRow<'py>>, Bound<'py, PyDict>);

fn change_rows<'py>(py: Python<'py>, report: &ChangeReport) -> PyResult<ChangeRows<'py>> {
    let rows = report.bodies.iter().map(|each| {
        let cut = each.report.as_ref().map(|report| report_row(py, report)).transpose()?;
        Ok((each.body, change_columns(py, &each.change)?, cut, each.released.clone()))
    });
    let times = report.times;
    let seconds = PyDict::new(py);
    for (stage, time) in [
        ("cutting", times.cutting),
        ("detection", times.detection),
        ("mechanics", times.mechanics),
        ("total", times.total),
    ] {
        seconds.set_item(stage, time.as_secs_f64())?;
    }
    Ok((rows.collect::<PyResult<_>>()?, seconds))
}

/// The columns of `palpate.Contacts`.
type ContactColumns<'py> = (
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

#[pymethods]
impl PySimulation {
    #[new]
    fn new(
        model: PyRef<'_, PyModel>,
        time_step: f64,
        threads: usize,
        leaf_size: Option<usize>,
        split: &str,
        method: &str,
        auto_substeps: bool,
    ) -> PyResult<Self> {
        let scene = scene_options(leaf_size, split, method, threads)?;
        let substeps = if auto_substeps { Substeps::Auto } else { Substeps::One };
        let options = SimulationOptions { time_step, scene, threads, substeps };
        let (py, model) = (model.py(), model.model.clone());
        let simulation = raise(py, py.detach(|| Simulation::new(model, options)))?;
        Ok(Self { simulation: Held::new(simulation) })
    }

    #[getter]
    fn model(&self, py: Python<'_>) -> PyModel {
        PyModel { model: self.simulation.lock_attached(py).model().clone() }
    }

    #[getter]
    fn initial_model(&self, py: Python<'_>) -> PyModel {
        PyModel { model: self.simulation.lock_attached(py).initial_model().clone() }
    }

    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.simulation.lock_attached(py).time()
    }

    #[getter]
    fn time_step(&self, py: Python<'_>) -> f64 {
        self.simulation.lock_attached(py).options().time_step
    }

    #[getter]
    fn auto_substeps(&self, py: Python<'_>) -> bool {
        self.simulation.lock_attached(py).options().substeps == Substeps::Auto
    }

    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.per_body(py, |simulation, body| simulation.positions(body).to_vec())
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.per_body(py, |simulation, body| simulation.velocities(body).to_vec())
    }

    #[getter]
    fn contact_forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        self.per_body(py, |simulation, body| simulation.contact_force(body).to_vec())
    }

    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<ContactColumns<'py>> {
        let guard = self.simulation.lock_attached(py);
        let contacts = guard.contacts();
        let kinds = contacts.iter().map(|c| i32::from(c.kind == PairKind::EdgeEdge)).collect();
        let bodies: Vec<_> = contacts.iter().map(|c| c.bodies).collect();
        let nodes: Vec<_> = contacts.iter().map(|c| c.nodes).collect();
        Ok((
            vector(py, kinds),
            index_matrix(py, &bodies)?,
            index_matrix(py, &nodes)?,
            matrix(py, contacts.iter().map(|c| c.weights).collect())?,
            matrix(py, contacts.iter().map(|c| c.normal).collect())?,
            matrix(py, contacts.iter().map(|c| c.point).collect())?,
            vector(py, contacts.iter().map(|c| c.gap).collect()),
            matrix(py, contacts.iter().map(palpate::mechanics::Contact::force).collect())?,
        ))
    }

    /// Steps `count` times; what `palpate.StepReport` holds.
    fn step<'py>(&self, py: Python<'py>, count: usize) -> PyResult<Bound<'py, PyDict>> {
        let mut cuts = Vec::new();
        let (report, times, stages, iterations, newton, substeps) = {
            let mut summed = StepTimes::default();
            let mut stages = [0.0; 10];
            let (mut iterations, mut newton, mut substeps) = (0, 0, 0);
            let mut last: Option<StepReport> = None;
            for _ in 0..count {
                // One step at a time, so that Ctrl-C is answered between them.
                py.check_signals()?;
                let mut report = raise(py, py.detach(|| self.simulation.lock().step()))?;
                if let Some(opened) = report.opened.take() {
                    cuts.push(change_rows(py, &opened)?);
                }
                summed += report.times;
                for (sum, (_, time)) in stages.iter_mut().zip(report.stages()) {
                    *sum += time.as_secs_f64();
                }
                iterations += report.mechanics.iterations;
                newton += report.mechanics.newton_iterations;
                substeps = substeps.max(report.substeps);
                last = Some(report);
            }
            let last = last.expect("count is at least one");
            (last, summed, stages, iterations, newton, substeps)
        };
        let seconds = PyDict::new(py);
        for (stage, time) in times.named() {
            seconds.set_item(stage, time.as_secs_f64())?;
        }
        let row = PyDict::new(py);
        row.set_item("step", report.step)?;
        row.set_item("time", report.time)?;
        row.set_item("times", seconds)?;
        let names = report.stages().map(|(stage, _)| stage);
        row.set_item("stages", names.into_iter().zip(stages).into_py_dict(py)?)?;
        row.set_item("proximity_pairs", report.proximity_pairs)?;
        row.set_item("contacts", report.mechanics.contacts)?;
        row.set_item("self_contacts", report.mechanics.self_contacts)?;
        row.set_item("penetrating_nodes", report.penetrating_nodes)?;
        row.set_item("max_depth", report.max_depth)?;
        row.set_item("newton_iterations", newton)?;
        row.set_item("iterations", iterations)?;
        row.set_item("residual", report.mechanics.residual)?;
        row.set_item("substeps", substeps)?;
        row.set_item("cuts", cuts)?;
        Ok(row)
    }

    fn pull(
        &self,
        py: Python<'_>,
        body: usize,
        node: usize,
        target: Vec3,
        stiffness: f64,
    ) -> PyResult<u64> {
        raise(py, self.simulation.lock_attached(py).pull(body, node, target.into(), stiffness))
    }

    fn set_pull_target(&self, py: Python<'_>, pull: u64, target: Vec3) -> PyResult<()> {
        raise(py, self.simulation.lock_attached(py).set_pull_target(pull, target.into()))
    }

    fn release(&self, py: Python<'_>, pull: u64) -> PyResult<()> {
        raise(py, self.simulation.lock_attached(py).release(pull))
    }

    /// Body, node, target, stiffness and force of a spring; `None` if it is gone.
    fn pulled(&self, py: Python<'_>, pull: u64) -> Option<(u32, u32, Vec3, f64, Vec3)> {
        let guard = self.simulation.lock_attached(py);
        let found = guard.pulls().iter().find(|each| each.id == pull)?;
        let Pull { body, node, target, stiffness, force, .. } = *found;
        Some((body, node, target.into(), stiffness, force.into()))
    }

    fn drive(
        &self,
        py: Python<'_>,
        body: usize,
        nodes: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<u64> {
        let entries = nodes.as_slice()?.iter().enumerate();
        let nodes: Vec<u32> =
            entries.map(|(row, &node)| index(node, "nodes", row)).collect::<PyResult<_>>()?;
        raise(py, py.detach(|| self.simulation.lock().drive(body, &nodes)))
    }

    fn set_drive_targets(
        &self,
        py: Python<'_>,
        drive: u64,
        targets: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        raise(
            py,
            self.simulation.lock_attached(py).set_drive_targets(drive, points(&targets, "path")?),
        )
    }

    fn release_drive(&self, py: Python<'_>, drive: u64) -> PyResult<()> {
        raise(py, py.detach(|| self.simulation.lock().release_drive(drive)))
    }

    /// Body, nodes (ascending), targets and forces of a drive; `None` if it is gone.
    fn driven<'py>(&self, py: Python<'py>, drive: u64) -> PyResult<Option<DriveRow<'py>>> {
        let guard = self.simulation.lock_attached(py);
        let Some(found) = guard.drives().iter().find(|each| each.id == drive) else {
            return Ok(None);
        };
        let (targets, forces) = (found.targets.clone(), found.forces.clone());
        let nodes = index_vector(py, &found.nodes);
        Ok(Some((found.body, nodes, matrix(py, targets)?, matrix(py, forces)?)))
    }

    /// Puts a rigid body; `rotation` is a unit quaternion, real part first.
    fn set_pose(
        &self,
        py: Python<'_>,
        body: usize,
        rotation: (f64, f64, f64, f64),
        translation: Vec3,
    ) -> PyResult<()> {
        let (w, x, y, z) = rotation;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        raise(py, self.simulation.lock_attached(py).set_pose(body, rotation, translation.into()))
    }

    /// Columns of the rotation, and the translation.
    fn tool_pose(&self, py: Python<'_>, body: usize) -> PyResult<([[f64; 3]; 3], [f64; 3])> {
        let (rotation, translation) = raise(py, self.simulation.lock_attached(py).tool_pose(body))?;
        Ok((rotation.to_cols_array_2d(), translation.to_array()))
    }

    fn tool_force(&self, py: Python<'_>, body: usize) -> PyResult<(Vec3, Vec3)> {
        let [force, torque] = raise(py, self.simulation.lock_attached(py).tool_force(body))?;
        Ok((force.into(), torque.into()))
    }

    fn tool_loop(&self, py: Python<'_>, body: usize, margin: Option<f64>) -> PyResult<PyToolLoop> {
        let made = raise(py, py.detach(|| self.simulation.lock().tool_loop(body, margin)))?;
        Ok(PyToolLoop { tool_loop: Mutex::new(made) })
    }

    fn cut<'py>(
        &self,
        py: Python<'py>,
        blade: &PyBlade,
        options: Options,
    ) -> PyResult<ChangeRows<'py>> {
        let options = cutting::options(options);
        let report = raise(py, py.detach(|| self.simulation.lock().cut(&blade.blade, &options)))?;
        change_rows(py, &report)
    }

    fn cut_live(
        &self,
        py: Python<'_>,
        blade: &PyBlade,
        options: Options,
        delay: u32,
    ) -> PyResult<()> {
        let options = cutting::options(options);
        raise(py, self.simulation.lock_attached(py).cut_live(&blade.blade, &options, delay))
    }

    #[getter]
    fn has_live_cuts(&self, py: Python<'_>) -> bool {
        self.simulation.lock_attached(py).has_live_cuts()
    }

    fn remove<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        tetrahedra: Vec<u32>,
    ) -> PyResult<ChangeRows<'py>> {
        let report = raise(py, py.detach(|| self.simulation.lock().remove(body, &tetrahedra)))?;
        change_rows(py, &report)
    }

    /// For each body now the one before and what became of its mesh; empty when nothing came apart.
    fn separate<'py>(&self, py: Python<'py>) -> PyResult<Vec<(usize, ChangeColumns<'py>)>> {
        let parts = raise(py, py.detach(|| self.simulation.lock().separate()))?;
        parts.iter().map(|(old, change)| Ok((*old, change_columns(py, change)?))).collect()
    }

    /// Writes the model as it is now; returns the files.
    fn write_model(&self, py: Python<'_>, path: PathBuf) -> PyResult<Vec<PathBuf>> {
        let model = self.simulation.lock_attached(py).model().clone();
        raise(py, py.detach(|| palpate::model::write_model(&path, &model)))
    }

    fn set_positions(
        &self,
        py: Python<'_>,
        body: usize,
        positions: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        raise(
            py,
            self.simulation.lock_attached(py).set_positions(body, points(&positions, "positions")?),
        )
    }

    fn set_velocities(
        &self,
        py: Python<'_>,
        body: usize,
        velocities: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        raise(
            py,
            self.simulation
                .lock_attached(py)
                .set_velocities(body, points(&velocities, "velocities")?),
        )
    }

    fn set_forces(
        &self,
        py: Python<'_>,
        body: usize,
        forces: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        raise(py, self.simulation.lock_attached(py).set_forces(body, points(&forces, "forces")?))
    }

    fn intersections<'py>(
        &self,
        py: Python<'py>,
        self_contact: bool,
    ) -> PyResult<(Bound<'py, PyArray2<i32>>, StatsRow)> {
        let options = IntersectionOptions { self_contact, ..IntersectionOptions::default() };
        let found = py.detach(|| {
            let mut guard = self.simulation.lock();
            let scene = guard.scene()?;
            Ok::<_, palpate::SimulationError>(intersection_rows(scene.intersections(&options)))
        });
        let (rows, stats) = raise(py, found)?;
        Ok((index_matrix(py, &rows)?, stats))
    }

    /// Boxes at a level of a body's bounding tree: low and high corner.
    fn boxes<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        level: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let boxes = py.detach(|| {
            let mut guard = self.simulation.lock();
            Ok::<_, palpate::SimulationError>(level_boxes(guard.scene()?, body, level))
        });
        matrix(py, raise(py, boxes)?)
    }

    /// Cauchy stress of each tetrahedron; `None` where there is none.
    fn stress<'py>(
        &self,
        py: Python<'py>,
        body: usize,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let stress = py.detach(|| self.simulation.lock().cauchy_stress(body));
        stress.map(|rows| matrix(py, rows)).transpose()
    }

    /// Bytes of each body's factor as a solve reads it; 0 for a rigid one.
    fn factor_bytes(&self, py: Python<'_>) -> Vec<usize> {
        let guard = self.simulation.lock_attached(py);
        let bytes = |body| guard.dynamics().factor_stats(body).map_or(0, |stats| stats.bytes);
        (0..guard.model().bodies.len()).map(bytes).collect()
    }

    fn energy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let energy = py.detach(|| self.simulation.lock().energy());
        let row = PyDict::new(py);
        row.set_item("kinetic", energy.kinetic)?;
        row.set_item("elastic", energy.elastic)?;
        row.set_item("gravitational", energy.gravitational)?;
        Ok(row)
    }

    fn snapshot(&self, py: Python<'_>) -> PySnapshot {
        PySnapshot { snapshot: self.simulation.lock_attached(py).snapshot() }
    }

    fn restore(&self, py: Python<'_>, snapshot: &PySnapshot) -> PyResult<()> {
        raise(py, py.detach(|| self.simulation.lock().restore(&snapshot.snapshot)))
    }

    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        raise(py, py.detach(|| self.simulation.lock().reset()))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        raise(py, py.detach(|| self.simulation.lock().save(&path)))
    }

    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf, threads: usize) -> PyResult<Self> {
        let simulation = raise(py, py.detach(|| Simulation::load(&path, threads)))?;
        Ok(Self { simulation: Held::new(simulation) })
    }
}
