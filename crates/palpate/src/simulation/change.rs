//! Cuts, removal and separation while the simulation runs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_contact::{Scene, SceneOptions};
use palpate_cutting::{Blade, CutOptions, CutReport};
use palpate_mechanics::{Dynamics, DynamicsOptions, State};
use palpate_model::{MeshChange, Model};

use super::live::{LiveCuts, with_change};
use super::{Simulation, SimulationError, SimulationOptions};
use crate::scene_cuts::{BodyToCut, cut_bodies};

/// What a cut or a removal did to one body.
#[derive(Clone, Debug)]
pub struct BodyChange {
    /// Index of the body.
    pub body: usize,
    /// Its mesh now, and what in it was what before.
    pub change: MeshChange,
    /// What a cut did; `None` of a removal.
    pub report: Option<CutReport>,
    /// Springs that were released because their node has gone.
    pub released: Vec<u64>,
}

/// Wall-clock time of the stages of a change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChangeTimes {
    /// Geometry and topology: the new meshes.
    pub cutting: Duration,
    /// Trees and surfaces for detection.
    pub detection: Duration,
    /// Matrices and state.
    pub mechanics: Duration,
    /// All of it.
    pub total: Duration,
}

/// What a change of topology did and what it cost.
#[derive(Clone, Debug, Default)]
pub struct ChangeReport {
    /// The bodies that changed; none when the blade passed everything by.
    pub bodies: Vec<BodyChange>,
    /// Where the time went.
    pub times: ChangeTimes,
}

/// A state to come back to, with the model that it belongs to: cuts change both.
#[derive(Clone, Debug)]
pub struct Snapshot {
    pub(crate) model: Arc<Model>,
    pub(crate) state: State,
    pub(crate) pending: PendingFaces,
    pub(crate) live: LiveCuts,
}

/// For each body the faces that a cut has reached and not opened; the next one goes on with them. Bodies
/// at the end may be missing: they have none.
pub(crate) type PendingFaces = Vec<Vec<[u32; 3]>>;

impl Snapshot {
    /// The model, with the cuts that had been made.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// What the next step depends on.
    pub fn state(&self) -> &State {
        &self.state
    }
}

impl Simulation {
    /// Cuts all deformable bodies along `blade`, which is in the space where they are now. The next
    /// step goes on with the new surfaces; both lips of the cut touch each other from then on.
    ///
    /// A blade may come in steps as short as one likes: faces that it reaches without opening them are
    /// remembered, until the body is changed otherwise. Without `min_edge`, the shortest edge is that
    /// part of the mean edge that the body had at the start, however often it is cut.
    ///
    /// # Errors
    /// If a body could not be cut or not be simulated afterwards; nothing has changed then.
    pub fn cut(
        &mut self,
        blade: &Blade,
        options: &CutOptions,
    ) -> Result<ChangeReport, SimulationError> {
        let start = Instant::now();
        let mut pending = self.pending.clone();
        pending.resize(self.model.bodies.len(), Vec::new());
        let deformable = |body: &usize| self.model.bodies[*body].rigid.is_none();
        let bodies = (0..self.model.bodies.len()).filter(deformable).map(|body| BodyToCut {
            body,
            mesh: &self.model.bodies[body].mesh,
            positions: self.dynamics.positions(body),
            pending: &pending[body],
            min_edge: self.min_edge(body, options),
        });
        let cuts = cut_bodies(bodies, blade, options)
            .map_err(|(body, source)| SimulationError::Cut { body, source })?;
        let mut changes = Vec::new();
        for (body, found) in cuts {
            pending[body] = found.pending;
            let (change, report) = (found.change, Some(found.report));
            changes.push(BodyChange { body, change, report, released: Vec::new() });
        }
        let report = self.apply(changes, start)?;
        self.pending = pending;
        self.begin_live_cuts_anew();
        Ok(report)
    }

    /// Shortest edge [m] of the parts of a body's tetrahedra.
    pub(super) fn min_edge(&self, body: usize, options: &CutOptions) -> f64 {
        options.min_edge.unwrap_or_else(|| {
            let first = self.initial.model.bodies.get(body);
            let mesh = &first.unwrap_or(&self.model.bodies[body]).mesh;
            CutOptions::EDGE * mesh.mean_surface_edge()
        })
    }

    /// Removes tetrahedra of a deformable body, as cautery or resection does.
    ///
    /// # Errors
    /// If there is no such body or tetrahedron, one is named twice, none would be left, or the body
    /// cannot be simulated afterwards; nothing has changed then.
    pub fn remove(
        &mut self,
        body: usize,
        tetrahedra: &[u32],
    ) -> Result<ChangeReport, SimulationError> {
        let start = Instant::now();
        self.check_body(body)?;
        if self.model.bodies[body].rigid.is_some() {
            return Err(SimulationError::RigidBody { body });
        }
        let change = self.model.bodies[body]
            .mesh
            .remove(tetrahedra)
            .map_err(|source| SimulationError::Removal { body, source })?;
        let change = BodyChange { body, change, report: None, released: Vec::new() };
        let report = self.apply(vec![change], start)?;
        self.forget_pending(body);
        self.begin_live_cuts_anew();
        Ok(report)
    }

    fn forget_pending(&mut self, body: usize) {
        if let Some(faces) = self.pending.get_mut(body) {
            faces.clear();
        }
    }

    /// Makes every piece that has come apart a body of its own, in the same state; the largest piece
    /// keeps the body's index and name, the others come last. Returns for each body the one before and what
    /// became of its mesh; empty when nothing has come apart. Only bodies that were in pieces get new trees
    /// and matrices.
    ///
    /// # Errors
    /// If a piece cannot be simulated; nothing has changed then.
    pub fn separate(&mut self) -> Result<Vec<(usize, MeshChange)>, SimulationError> {
        let Some((model, parts)) = self.model.separated() else {
            return Ok(Vec::new());
        };
        let state = self.dynamics.state().of_parts(&parts);
        let mut pending = self.pending.clone();
        for (body, faces) in pending.iter_mut().enumerate() {
            if !Arc::ptr_eq(&model.bodies[body].mesh, &self.model.bodies[body].mesh) {
                faces.clear();
            }
        }
        let mut live = self.live.clone();
        live.follow(&parts.iter().map(|(old, change)| (*old, Some(change))).collect::<Vec<_>>());
        let snapshot =
            Snapshot { model: Arc::new(model), state, pending, live: LiveCuts::default() };
        self.go_on(&snapshot)?;
        self.live = live;
        self.begin_live_cuts_anew();
        Ok(parts)
    }

    fn apply(
        &mut self,
        mut changes: Vec<BodyChange>,
        start: Instant,
    ) -> Result<ChangeReport, SimulationError> {
        let mut times = ChangeTimes { cutting: start.elapsed(), ..ChangeTimes::default() };
        if changes.is_empty() {
            times.total = start.elapsed();
            return Ok(ChangeReport { bodies: changes, times });
        }
        let before = (changes.len() > 1).then(|| self.snapshot());
        let mut model = Arc::clone(&self.model);
        for (done, each) in changes.iter_mut().enumerate() {
            let begin = Instant::now();
            model = Arc::new(model.changed(each.body, &each.change));
            match self.dynamics.change_body(&model, each.body, &each.change) {
                Ok(released) => each.released = released,
                Err(error) => {
                    if let Some(before) = before.filter(|_| done > 0) {
                        self.go_on(&before)?;
                    }
                    return Err(error.into());
                }
            }
            times.mechanics += begin.elapsed();
        }
        let begin = Instant::now();
        for each in &changes {
            self.scene.change_body(each.body, &each.change)?;
        }
        times.detection = begin.elapsed();
        self.set_model(model);
        for each in &changes {
            self.live.follow(&with_change(self.model.bodies.len(), each));
        }
        times.total = start.elapsed();
        Ok(ChangeReport { bodies: changes, times })
    }

    /// Takes over another model and its state; bodies that are the same keep trees and matrices.
    pub(crate) fn go_on(&mut self, snapshot: &Snapshot) -> Result<(), SimulationError> {
        let model = &snapshot.model;
        self.dynamics.exchange(model, &snapshot.state)?;
        let meshes: Vec<_> = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
        self.scene.exchange(&meshes, &model.structure)?;
        self.set_model(Arc::clone(model));
        self.pending.clone_from(&snapshot.pending);
        self.set_live_cuts(&snapshot.live)
    }
}

/// Scene and dynamics of a model in a state.
pub(crate) fn parts(
    model: &Model,
    options: SimulationOptions,
    state: &State,
) -> Result<(Scene, Dynamics), SimulationError> {
    let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let SimulationOptions { time_step, threads, scene, .. } = options;
    let scene = Scene::new(meshes, Some(&model.structure), SceneOptions { threads, ..scene })?;
    let dynamics = Dynamics::with_state(model, DynamicsOptions { time_step, threads }, state)?;
    Ok((scene, dynamics))
}
