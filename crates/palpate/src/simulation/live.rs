//! Cuts that are prepared beside the steps and open some steps later.
//!
//! A cut costs several steps. What takes its time, the new meshes, matrices and responses to contact, depends
//! on where the bodies were when the blade passed and on nothing that a step changes, so that a thread of
//! its own makes it while steps go on. When it opens is decided by the step, never by how fast the thread
//! was: a step that comes too early waits.

use std::borrow::Cow;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Instant;

use palpate_contact::{ChangedSurface, SceneError, SurfaceBasis};
use palpate_cutting::{Blade, CutOptions};
use palpate_geometry::{Aabb, Point};
use palpate_mechanics::{BodyBasis, ChangedBody};
use palpate_model::{MeshChange, Model};
use serde::{Deserialize, Serialize};

use super::{BodyChange, ChangeReport, ChangeTimes, PendingFaces, Simulation, SimulationError};
use crate::scene_cuts::{BodyToCut, cut_bodies};

/// Steps before a cut opens from which on the bodies that it may reach wait for the matrices that it brings.
const AWAITED: u64 = 8;

/// What live cuts need from one step to the next, threads apart.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub(crate) struct LiveCuts {
    /// Strokes since what has begun began.
    waiting: Vec<Arc<LiveStroke>>,
    begun: Option<Begun>,
}

/// A stroke, and where the bodies were.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct LiveStroke {
    blade: Blade,
    options: CutOptions,
    delay: u32,
    /// Of each body; none of rigid ones, nor of those that the blade passes by.
    positions: Vec<Vec<Point>>,
}

/// Strokes that open together.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct Begun {
    strokes: Vec<Arc<LiveStroke>>,
    /// For each body that a stroke reaches the shape that its next matrix is made of: steps may take another
    /// meanwhile.
    shapes: Vec<Vec<Point>>,
    /// They open before the step after so many.
    due: u64,
}

/// The work on what has begun, and a report that no step has given yet.
#[derive(Default)]
pub(super) struct LiveWork {
    /// `None` where no thread does it: it is done when it is due.
    thread: Option<JoinHandle<Result<Opening, SimulationError>>>,
    opened: Option<ChangeReport>,
    /// Bodies that changed before the step that begins; `None` where nothing was to open.
    changed: Option<Vec<usize>>,
}

/// Everything that the preparation of a cut depends on.
struct Preparation {
    model: Arc<Model>,
    time_step: f64,
    strokes: Vec<Arc<LiveStroke>>,
    pending: PendingFaces,
    /// Of each body.
    bases: Vec<Basis>,
}

/// What a body after the cut is made from.
struct Basis {
    /// Shortest edge [m] of the parts where a stroke does not say.
    min_edge: f64,
    /// For mechanics and detection; `None` where no stroke reaches the body.
    made_from: Option<(BodyBasis, SurfaceBasis)>,
}

/// A cut that is ready to open.
struct Opening {
    bodies: Vec<OpenedBody>,
    pending: PendingFaces,
    times: ChangeTimes,
}

struct OpenedBody {
    change: BodyChange,
    made: ChangedBody,
    surface: ChangedSurface,
    /// After this change and those before it.
    model: Arc<Model>,
}

impl Simulation {
    /// Cuts as [`Self::cut`], beside the steps: the cut begins with the next step, and opens `delay` steps
    /// later; the report of that step holds what it did. Strokes that come while one is on its way
    /// open together, as many steps after that one. They cut what the blade passed through when they came,
    /// wherever that has moved meanwhile.
    ///
    /// What the bodies become is made in a thread of its own, and a step waits for it where `delay` is too
    /// short, so that results do not depend on how fast it is. Where a cut fails, the step in which it should
    /// open gives the error, and the next one goes on without it. After another change of the bodies what is
    /// on its way begins anew on what they are then.
    ///
    /// # Errors
    /// If an option is out of range.
    pub fn cut_live(
        &mut self,
        blade: &Blade,
        options: &CutOptions,
        delay: u32,
    ) -> Result<(), SimulationError> {
        options.check().map_err(|source| SimulationError::Cut { body: 0, source })?;
        let bounds = blade.bounds();
        let bodies = self.model.bodies.iter().enumerate();
        let positions = bodies.map(|(body, description)| {
            let positions = self.positions(body);
            let reached =
                description.rigid.is_none() && Aabb::from_points(positions).intersects(&bounds);
            if reached { positions.to_vec() } else { Vec::new() }
        });
        let stroke = LiveStroke {
            blade: blade.clone(),
            options: *options,
            delay,
            positions: positions.collect(),
        };
        self.live.waiting.push(Arc::new(stroke));
        Ok(())
    }

    /// Whether live cuts have not opened yet.
    pub fn has_live_cuts(&self) -> bool {
        !self.live.waiting.is_empty() || self.live.begun.is_some()
    }

    /// Opens what is due before the next step, and begins what waits.
    pub(super) fn open_and_begin(&mut self) -> Result<(), SimulationError> {
        self.live_work.changed = None;
        self.open_due()?;
        if self.live.begun.is_none() && !self.live.waiting.is_empty() {
            let strokes = std::mem::take(&mut self.live.waiting);
            let delay = strokes.iter().map(|stroke| stroke.delay).max().unwrap_or(0);
            let due = self.dynamics.step_count().saturating_add(u64::from(delay));
            let shapes = self.shapes(&strokes);
            self.live.begun = Some(Begun { strokes, shapes, due });
            if delay > 0 {
                self.start_work();
            }
            self.open_due()?;
        }
        self.await_matrices();
        Ok(())
    }

    /// Has bodies that will soon be cut keep their matrices until then: one that a step makes would serve
    /// for as few steps. Those that the last strokes passed by after all make theirs in between.
    fn await_matrices(&mut self) {
        let step = self.dynamics.step_count();
        let begun =
            self.live.begun.as_ref().filter(|begun| begun.due.saturating_sub(step) <= AWAITED);
        let changed = &self.live_work.changed;
        for body in 0..self.model.bodies.len() {
            let reached = begun.is_some_and(|begun| reach(&begun.strokes, body));
            let passed_by = changed.as_ref().is_some_and(|changed| !changed.contains(&body));
            self.dynamics.await_matrix(body, reached && !passed_by);
        }
    }

    /// What opened before the step that has just been taken.
    pub(super) fn take_opened(&mut self) -> Option<ChangeReport> {
        self.live_work.opened.take()
    }

    /// Goes on with what was on its way.
    ///
    /// # Errors
    /// If it is of other bodies; nothing has changed then.
    pub(crate) fn set_live_cuts(&mut self, live: &LiveCuts) -> Result<(), SimulationError> {
        if !live.fits(&self.model) {
            return Err(SimulationError::OtherModel);
        }
        self.live = live.clone();
        self.live_work = LiveWork::default();
        self.start_work();
        Ok(())
    }

    /// Begins what is on its way anew, on the bodies that there are now.
    pub(super) fn begin_live_cuts_anew(&mut self) {
        if let Some(mut begun) = self.live.begun.take() {
            begun.shapes = self.shapes(&begun.strokes);
            self.live.begun = Some(begun);
            self.start_work();
        }
    }

    /// The thread that worked is not there: the process was forked.
    pub(super) fn lose_work(&mut self) {
        // It cannot be waited for, and what it holds is not to be touched.
        std::mem::forget(self.live_work.thread.take());
    }

    fn shapes(&self, strokes: &[Arc<LiveStroke>]) -> Vec<Vec<Point>> {
        let shape = |body| {
            if reach(strokes, body) { self.dynamics.next_stiff_shape(body) } else { Vec::new() }
        };
        (0..self.model.bodies.len()).map(shape).collect()
    }

    /// Starts a thread for what has begun; where the system gives none, the work is done when it is due.
    fn start_work(&mut self) {
        self.live_work.thread = self.preparation().and_then(|preparation| {
            thread::Builder::new().name("cut".into()).spawn(|| preparation.run()).ok()
        });
    }

    fn preparation(&self) -> Option<Preparation> {
        let begun = self.live.begun.as_ref()?;
        let bodies = self.model.bodies.len();
        let mut pending = self.pending.clone();
        pending.resize(bodies, Vec::new());
        let options = CutOptions::default();
        let basis = |(body, shape): (usize, &Vec<Point>)| {
            let made_from = reach(&begun.strokes, body).then(|| {
                let surface = self.scene.surface_basis(body).expect("a body of the model");
                (self.dynamics.basis(body).with_shape(shape.clone()), surface)
            });
            Basis { min_edge: self.min_edge(body, &options), made_from }
        };
        Some(Preparation {
            model: Arc::clone(&self.model),
            time_step: self.options.time_step,
            strokes: begun.strokes.clone(),
            pending,
            bases: (0..).zip(&begun.shapes).map(basis).collect(),
        })
    }

    fn open_due(&mut self) -> Result<(), SimulationError> {
        let step = self.dynamics.step_count();
        if self.live.begun.as_ref().is_none_or(|begun| begun.due > step) {
            return Ok(());
        }
        let made = match self.live_work.thread.take() {
            Some(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            None => self.preparation().expect("something has begun").run(),
        };
        self.live.begun = None;
        self.open(made?)
    }

    fn open(&mut self, opening: Opening) -> Result<(), SimulationError> {
        let Opening { bodies, pending, mut times } = opening;
        let mut report = ChangeReport::default();
        self.live_work.changed = Some(bodies.iter().map(|body| body.change.body).collect());
        for OpenedBody { mut change, made, surface, model } in bodies {
            let begin = Instant::now();
            change.released = self.dynamics.go_on_with(made, &model, &change.change);
            times.mechanics += begin.elapsed();
            let begin = Instant::now();
            self.scene.go_on_with(change.body, surface, &change.change)?;
            times.detection += begin.elapsed();
            self.live.follow(&with_change(model.bodies.len(), &change));
            self.set_model(model);
            report.bodies.push(change);
        }
        self.pending = pending;
        times.total = times.cutting + times.detection + times.mechanics;
        report.times = times;
        if let Some(before) = self.live_work.opened.take() {
            // Of a step that failed afterwards.
            report.bodies.splice(0..0, before.bodies);
        }
        self.live_work.opened = Some(report);
        Ok(())
    }
}

/// Whether one of the strokes may cut a body.
fn reach(strokes: &[Arc<LiveStroke>], body: usize) -> bool {
    strokes.iter().any(|stroke| stroke.reaches(body))
}

/// All bodies, one of which has changed: for [`LiveCuts::follow`].
pub(super) fn with_change(count: usize, change: &BodyChange) -> Vec<(usize, Option<&MeshChange>)> {
    (0..count).map(|body| (body, (body == change.body).then_some(&change.change))).collect()
}

impl LiveCuts {
    /// Bodies have become others: for each of those now comes the one that it was, and how its mesh was
    /// changed.
    pub(super) fn follow(&mut self, parts: &[(usize, Option<&MeshChange>)]) {
        let begun = self.begun.iter_mut().flat_map(|begun| &mut begun.strokes);
        for stroke in self.waiting.iter_mut().chain(begun) {
            let stroke = Arc::make_mut(stroke);
            let before = std::mem::take(&mut stroke.positions);
            let now = parts.iter().map(|&(body, change)| match change {
                Some(change) if !before[body].is_empty() => change.positions(&before[body]),
                _ => before[body].clone(),
            });
            stroke.positions = now.collect();
        }
    }

    /// Whether it is of the bodies of a model.
    fn fits(&self, model: &Model) -> bool {
        let counts = |positions: &Vec<Vec<Point>>| {
            positions.len() == model.bodies.len()
                && positions.iter().zip(&model.bodies).all(|(positions, body)| {
                    positions.is_empty()
                        || body.rigid.is_none() && positions.len() == body.mesh.nodes().len()
                })
        };
        let begun = self.begun.iter().flat_map(|begun| &begun.strokes);
        self.waiting.iter().chain(begun).all(|stroke| counts(&stroke.positions))
            && self.begun.iter().all(|begun| counts(&begun.shapes))
    }
}

impl Preparation {
    /// Cuts with one stroke after the other, and makes what the bodies become.
    fn run(self) -> Result<Opening, SimulationError> {
        let Self { model, time_step, strokes, mut pending, mut bases } = self;
        let start = Instant::now();
        let mut changes: Vec<Option<BodyChange>> = model.bodies.iter().map(|_| None).collect();
        for stroke in &strokes {
            stroke.cut(&model, &mut changes, &mut pending, &bases)?;
        }
        let mut times = ChangeTimes { cutting: start.elapsed(), ..ChangeTimes::default() };
        let mut bodies = Vec::new();
        let mut model = model;
        for change in changes.into_iter().flatten() {
            let body = change.body;
            model = Arc::new(model.changed(body, &change.change));
            let made_from = bases[body].made_from.take();
            let (basis, surface) = made_from.expect("what is cut is reached");
            let begin = Instant::now();
            let made = ChangedBody::new(&model, body, &change.change, &basis, time_step)?
                .prepared(&basis, &change.change);
            times.mechanics += begin.elapsed();
            let begin = Instant::now();
            let last = strokes.iter().rfind(|stroke| stroke.reaches(body)).expect("reached");
            let near = change.change.positions(&last.positions[body]);
            let surface = ChangedSurface::new(surface, &change.change, &near)
                .map_err(|reason| SceneError::OtherMesh { body, reason })?;
            times.detection += begin.elapsed();
            bodies.push(OpenedBody { change, made, surface, model: Arc::clone(&model) });
        }
        Ok(Opening { bodies, pending, times })
    }
}

impl LiveStroke {
    /// Whether the blade may cut a body.
    fn reaches(&self, body: usize) -> bool {
        !self.positions[body].is_empty()
    }

    /// Cuts what the bodies of `model` have become by `changes`, and adds to these.
    fn cut(
        &self,
        model: &Model,
        changes: &mut [Option<BodyChange>],
        pending: &mut PendingFaces,
        bases: &[Basis],
    ) -> Result<(), SimulationError> {
        let reached = (0..changes.len()).filter(|&body| self.reaches(body));
        let positions: Vec<Cow<[Point]>> = (self.positions.iter().zip(&*changes))
            .map(|(positions, change)| match change {
                Some(change) if !positions.is_empty() => change.change.positions(positions).into(),
                _ => positions.into(),
            })
            .collect();
        let bodies = reached.map(|body| BodyToCut {
            body,
            mesh: match &changes[body] {
                Some(change) => &change.change.mesh,
                None => &model.bodies[body].mesh,
            },
            positions: &positions[body],
            pending: &pending[body],
            min_edge: self.options.min_edge.unwrap_or(bases[body].min_edge),
        });
        let cuts = cut_bodies(bodies, &self.blade, &self.options)
            .map_err(|(body, source)| SimulationError::Cut { body, source })?;
        for (body, found) in cuts {
            pending[body] = found.pending;
            let old = &model.bodies[body].mesh;
            let (change, report) = match changes[body].take() {
                Some(before) => (
                    before.change.then(&found.change, old),
                    before.report.map_or(found.report, |report| report.then(&found.report)),
                ),
                None => (found.change, found.report),
            };
            changes[body] =
                Some(BodyChange { body, change, report: Some(report), released: Vec::new() });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use palpate_model::{Body, Mesh, MeshData};
    use palpate_testing::{Fastest, box_of_cells};

    use super::*;
    use crate::SimulationOptions;

    fn simulation() -> Simulation {
        let place = |at: [f64; 3]| at.map(|x| 0.02 * x);
        let (nodes, tetrahedra) = box_of_cells([3, 2, 2], Fastest::Last, place);
        let data = MeshData { nodes, tetrahedra, ..MeshData::default() };
        let mesh = Mesh::repaired(data).expect("a box is a mesh").0;
        let model = Model::from_bodies(vec![Body::new("box", Arc::new(mesh))]);
        Simulation::new(model, SimulationOptions::default()).expect("a box can be simulated")
    }

    fn stroke() -> Blade {
        let edge = |y: f64| [[0.031, y, -0.1], [0.033, y, 0.3]];
        Blade::stroke(&[edge(-0.1), edge(0.02)]).expect("it spans an area")
    }

    #[test]
    fn a_cut_that_fails_is_told_when_it_should_open_and_steps_go_on_without_it() {
        for delay in [0, 2] {
            let (mut simulation, mut without) = (simulation(), simulation());
            simulation.cut_live(&stroke(), &CutOptions::default(), delay).unwrap();
            // What the step would have refused: no other way to a failure is short.
            Arc::make_mut(&mut simulation.live.waiting[0]).positions[0][3] = [f64::NAN; 3];
            for _ in 0..delay {
                simulation.step().unwrap();
                without.step().unwrap();
            }
            let error = simulation.step().unwrap_err().to_string();
            assert!(error.contains("body 0 cannot be cut") && error.contains("node 3"), "{error}");
            assert_eq!(simulation.positions(0), without.positions(0));
            for _ in 0..3 {
                assert!(simulation.step().unwrap().opened.is_none());
                without.step().unwrap();
            }
            assert_eq!(simulation.positions(0), without.positions(0));
        }
    }

    #[test]
    fn live_cuts_of_other_bodies_are_refused() {
        let mut simulation = simulation();
        simulation.cut_live(&stroke(), &CutOptions::default(), 2).unwrap();
        let mut snapshot = simulation.snapshot();
        Arc::make_mut(&mut snapshot.live.waiting[0]).positions[0].pop();
        assert!(matches!(simulation.restore(&snapshot), Err(SimulationError::OtherModel)));
        simulation.step().unwrap();
        let mut snapshot = simulation.snapshot();
        snapshot.live.begun.as_mut().expect("it has begun").shapes.pop();
        assert!(matches!(simulation.restore(&snapshot), Err(SimulationError::OtherModel)));
    }
}
