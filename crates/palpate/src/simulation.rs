//! The step loop: detect, respond, move.

mod change;
mod drive;
mod hands;
mod live;
mod loops;
mod substeps;

use std::ops::AddAssign;
use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_contact::{PenetratingNode, ProximityOptions, Scene, SceneError, SceneOptions};
use palpate_cutting::CutError;
use palpate_geometry::Point;
use palpate_mechanics::{
    Contact, Dynamics, DynamicsOptions, Energy, Failure, MechanicsError, State, StepStats,
};
use palpate_model::{MeshError, Model};

pub(crate) use change::PendingFaces;
pub use change::{BodyChange, ChangeReport, ChangeTimes, Snapshot};
pub(crate) use live::LiveCuts;
use live::LiveWork;
use loops::Link;
use substeps::Finer;
pub use substeps::Substeps;

/// How a simulation runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulationOptions {
    /// Length of a step [s].
    pub time_step: f64,
    /// Contact detection: leaf size, split rule, method. Its thread count is taken from `threads`.
    pub scene: SceneOptions,
    /// Worker threads for detection and mechanics; results are the same bits at any count.
    pub threads: usize,
    /// What to do about a step that fails.
    pub substeps: Substeps,
}

impl Default for SimulationOptions {
    fn default() -> Self {
        Self {
            time_step: 1.0 / 60.0,
            scene: SceneOptions::default(),
            threads: 1,
            substeps: Substeps::default(),
        }
    }
}

/// Why a simulation could not start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// The bodies' surfaces or positions were refused by the detection.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A body cannot be simulated, or what was given does not fit.
    #[error(transparent)]
    Mechanics(#[from] MechanicsError),
    /// A step failed; the state is that before it.
    #[error(
        "the step from t = {time:.6} s failed{}: body {} '{name}', {failure}",
        in_parts(*.substeps), failure.body
    )]
    Step {
        /// Simulated time before it [s].
        time: f64,
        /// Into how many smaller ones it was divided at last; 1 if it was not.
        substeps: u32,
        /// Name of the body.
        name: String,
        /// Where and why.
        failure: Failure,
    },
    /// A body that could not be cut; nothing has changed.
    #[error("body {body} cannot be cut: {source}")]
    Cut {
        /// Index of the body.
        body: usize,
        /// Why not.
        source: CutError,
    },
    /// Tetrahedra that cannot be removed; nothing has changed.
    #[error("body {body}: {source}")]
    Removal {
        /// Index of the body.
        body: usize,
        /// Why not.
        source: MeshError,
    },
    /// A rigid body has no tissue to remove.
    #[error("body {body} is rigid: only deformable bodies can be cut")]
    RigidBody {
        /// Index of the body.
        body: usize,
    },
    /// A snapshot of another simulation.
    #[error("the snapshot is of a simulation of another model")]
    OtherModel,
    /// A margin that is not positive.
    #[error("the margin is {0} m; expected a positive number")]
    Margin(f64),
    /// A body index that does not exist.
    #[error("body {index} does not exist: the simulation has {count} bodies")]
    NoSuchBody {
        /// The index that was asked for.
        index: usize,
        /// Number of bodies.
        count: usize,
    },
}

fn in_parts(substeps: u32) -> String {
    if substeps > 1 { format!(", also in {substeps} smaller ones") } else { String::new() }
}

/// Wall-clock time of each stage of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTimes {
    /// Live cuts that open: what is left to do then, and waiting where they are late.
    pub change: Duration,
    /// Refit of the bounding trees.
    pub update: Duration,
    /// Search for close surface elements.
    pub proximity: Duration,
    /// Search for nodes inside other bodies.
    pub penetration: Duration,
    /// Prediction, contact response and elastic solve.
    pub mechanics: Duration,
    /// The whole step.
    pub total: Duration,
}

impl StepTimes {
    /// Each stage by its name, in the order of the step.
    pub fn named(&self) -> [(&'static str, Duration); 6] {
        [
            ("change", self.change),
            ("update", self.update),
            ("penetration", self.penetration),
            ("proximity", self.proximity),
            ("mechanics", self.mechanics),
            ("total", self.total),
        ]
    }
}

impl AddAssign for StepTimes {
    fn add_assign(&mut self, other: Self) {
        self.change += other.change;
        self.update += other.update;
        self.proximity += other.proximity;
        self.penetration += other.penetration;
        self.mechanics += other.mechanics;
        self.total += other.total;
    }
}

/// What one step did and what it cost.
#[derive(Clone, Debug)]
pub struct StepReport {
    /// Number of the step, the first being 1.
    pub step: u64,
    /// Simulated time at the end of the step [s].
    pub time: f64,
    /// Where the time went.
    pub times: StepTimes,
    /// Close pairs found (before those that carry no force are left out).
    pub proximity_pairs: usize,
    /// Nodes found inside other bodies.
    pub penetrating_nodes: usize,
    /// Deepest penetration [m], zero when there is none.
    pub max_depth: f64,
    /// How many smaller steps it took: 1 unless the step failed and was tried again.
    pub substeps: u32,
    /// What live cuts did that opened before the step.
    pub opened: Option<ChangeReport>,
    /// The mechanics' own statistics.
    pub mechanics: StepStats,
}

/// What contacts are made of.
pub(crate) const CONTACT_PAIRS: ProximityOptions =
    ProximityOptions { close_at_rest: true, local_minima: true };

impl StepReport {
    /// The finest stages by name, in the order of the step; together nearly the whole of it.
    pub fn stages(&self) -> [(&'static str, Duration); 10] {
        let mechanics = &self.mechanics.times;
        [
            ("change", self.times.change),
            ("update", self.times.update),
            ("penetration", self.times.penetration),
            ("proximity", self.times.proximity),
            ("predict", mechanics.predict),
            ("filter", mechanics.filter),
            ("compliance", mechanics.compliance),
            ("forces", mechanics.solve),
            ("advance", mechanics.advance),
            ("factor", mechanics.refactor),
        ]
    }
}

/// Bodies of a model that fall, touch and deform.
pub struct Simulation {
    model: Arc<Model>,
    options: SimulationOptions,
    scene: Scene,
    dynamics: Dynamics,
    initial: Snapshot,
    pending: PendingFaces,
    live: LiveCuts,
    live_work: LiveWork,
    /// Copy of the last search: the scene's own list is gone when it searches for close pairs.
    penetration: Vec<PenetratingNode>,
    /// For steps that are tried again, once there was one.
    finer: Option<Box<Finer>>,
    loops: Vec<Link>,
}

impl Simulation {
    /// Builds trees and factors for `model`; nothing moves yet.
    ///
    /// # Errors
    /// If a body cannot be detected (empty mesh) or simulated (no tetrahedra and not rigid); the
    /// error names it.
    pub fn new(
        model: impl Into<Arc<Model>>,
        options: SimulationOptions,
    ) -> Result<Self, SimulationError> {
        let model = model.into();
        let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
        let scene_options = SceneOptions { threads: options.threads, ..options.scene };
        let scene = Scene::new(meshes, Some(&model.structure), scene_options)?;
        let SimulationOptions { time_step, threads, .. } = options;
        let dynamics = Dynamics::new(&model, DynamicsOptions { time_step, threads })?;
        let state = dynamics.state();
        Ok(Self::of_parts(model, options, (scene, dynamics), state, PendingFaces::new()))
    }

    /// Moves everything on by one time step.
    ///
    /// # Errors
    /// If the step fails, with [`Substeps::Auto`] also in smaller ones; the state is then that before the
    /// step, bit for bit.
    pub fn step(&mut self) -> Result<StepReport, SimulationError> {
        self.follow_loops()?;
        let begin = Instant::now();
        self.open_and_begin()?;
        let change = begin.elapsed();
        self.dynamics.set_strict(self.options.substeps == Substeps::Auto);
        let mut report = match self.advance(1) {
            Err(SimulationError::Mechanics(MechanicsError::Step(failure))) => {
                self.try_again(failure)
            }
            other => other,
        }?;
        self.give_up_unused();
        report.opened = self.take_opened();
        report.times.change = change;
        report.times.total += change;
        self.publish()?;
        Ok(report)
    }

    /// One step of the dynamics, `left` of which are left in which targets are reached.
    fn advance(&mut self, left: u32) -> Result<StepReport, SimulationError> {
        let threads = self.scene.threads().clone();
        threads.run(|| self.advance_here(left))
    }

    fn advance_here(&mut self, left: u32) -> Result<StepReport, SimulationError> {
        let start = Instant::now();
        let mut times = StepTimes::default();
        self.scene()?;
        times.update = start.elapsed();

        let begin = Instant::now();
        self.dynamics.begin_substep(left);
        times.mechanics = begin.elapsed();

        let begin = Instant::now();
        let dynamics = &self.dynamics;
        let deformable_pair =
            |a: usize, b: usize| a != b && dynamics.search_distance(a, b).is_some();
        let penetration = &mut self.penetration;
        penetration.clone_from(&self.scene.penetration(&deformable_pair).nodes);
        times.penetration = begin.elapsed();

        let begin = Instant::now();
        let proximity =
            self.scene.proximity_with(&|a, b| dynamics.search_distance(a, b), &CONTACT_PAIRS);
        times.proximity = begin.elapsed();

        let begin = Instant::now();
        let proximity_pairs = proximity.pairs.len();
        let mechanics = self.dynamics.finish_step(&proximity.pairs, penetration)?;
        times.mechanics += begin.elapsed();
        times.total = start.elapsed();
        Ok(StepReport {
            step: self.dynamics.step_count(),
            time: self.dynamics.time(),
            times,
            proximity_pairs,
            penetrating_nodes: penetration.len(),
            max_depth: penetration.iter().fold(0.0, |deepest, node| node.depth.max(deepest)),
            substeps: 1,
            opened: None,
            mechanics,
        })
    }

    /// The model that is simulated.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The model that [`Self::reset`] returns to, before cuts.
    pub fn initial_model(&self) -> &Arc<Model> {
        self.initial.model()
    }

    /// The options it was made with.
    pub fn options(&self) -> &SimulationOptions {
        &self.options
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.dynamics.time()
    }

    /// Node positions [m] of a body.
    ///
    /// # Panics
    /// If `body` is out of range, as in all getters here.
    pub fn positions(&self, body: usize) -> &[Point] {
        self.dynamics.positions(body)
    }

    /// Node velocities [m/s] of a body.
    pub fn velocities(&self, body: usize) -> &[Point] {
        self.dynamics.velocities(body)
    }

    /// Contacts that carried a force in the last step.
    pub fn contacts(&self) -> &[Contact] {
        self.dynamics.contacts()
    }

    /// Force [N] of contacts and springs on each node of a body in the last step.
    pub fn contact_force(&self, body: usize) -> &[Point] {
        self.dynamics.contact_force(body)
    }

    /// Puts the nodes of a body elsewhere.
    ///
    /// # Errors
    /// If the body does not exist, or the number of nodes or a value does not fit.
    pub fn set_positions(
        &mut self,
        body: usize,
        positions: &[Point],
    ) -> Result<(), SimulationError> {
        self.check_body(body)?;
        Ok(self.dynamics.set_positions(body, positions)?)
    }

    /// Sets the velocities [m/s] of a body's nodes.
    ///
    /// # Errors
    /// As [`Self::set_positions`].
    pub fn set_velocities(
        &mut self,
        body: usize,
        velocities: &[Point],
    ) -> Result<(), SimulationError> {
        self.check_body(body)?;
        Ok(self.dynamics.set_velocities(body, velocities)?)
    }

    /// Sets external forces [N] on a body's nodes; they act until set again.
    ///
    /// # Errors
    /// As [`Self::set_positions`].
    pub fn set_forces(&mut self, body: usize, forces: &[Point]) -> Result<(), SimulationError> {
        self.check_body(body)?;
        Ok(self.dynamics.set_forces(body, forces)?)
    }

    /// The scene at the current positions, for queries.
    ///
    /// # Errors
    /// If a position is not finite.
    pub fn scene(&mut self) -> Result<&mut Scene, SimulationError> {
        self.scene.update_from(|body| self.dynamics.positions(body))?;
        Ok(&mut self.scene)
    }

    /// Everything, to come back to with [`Self::restore`].
    pub fn snapshot(&self) -> Snapshot {
        let (model, state) = (Arc::clone(&self.model), self.dynamics.state());
        Snapshot { model, state, pending: self.pending.clone(), live: self.live.clone() }
    }

    /// Returns to a snapshot of this simulation; it continues with the same bits. Cuts made since are
    /// undone; bodies that they changed are made anew.
    ///
    /// # Errors
    /// If the state is of another model.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SimulationError> {
        if Arc::ptr_eq(&snapshot.model, &self.model) {
            self.dynamics.set_state(&snapshot.state)?;
            self.pending.clone_from(&snapshot.pending);
            return self.set_live_cuts(&snapshot.live);
        }
        // Cuts leave the bodies there, and only add to them.
        let mut names = snapshot.model.bodies.iter().map(|body| &body.name);
        if !self.initial.model.bodies.iter().all(|body| names.next() == Some(&body.name)) {
            return Err(SimulationError::OtherModel);
        }
        self.go_on(snapshot)
    }

    /// Returns to the start, before all cuts.
    ///
    /// # Errors
    /// Never for the simulation's own initial state; kept fallible like [`Self::restore`].
    pub fn reset(&mut self) -> Result<(), SimulationError> {
        self.restore(&self.initial.clone())
    }

    /// What [`Self::reset`] returns to.
    pub(crate) fn initial(&self) -> &Snapshot {
        &self.initial
    }

    /// Replaces what [`Self::reset`] returns to.
    pub(crate) fn set_initial(&mut self, initial: Snapshot) {
        self.initial = initial;
    }

    /// In a state of `model`, also one after cuts.
    pub(crate) fn in_state(
        model: Arc<Model>,
        options: SimulationOptions,
        state: State,
        pending: PendingFaces,
    ) -> Result<Self, SimulationError> {
        let parts = change::parts(&model, options, &state)?;
        Ok(Self::of_parts(model, options, parts, state, pending))
    }

    fn of_parts(
        model: Arc<Model>,
        options: SimulationOptions,
        (scene, mut dynamics): (Scene, Dynamics),
        state: State,
        pending: PendingFaces,
    ) -> Self {
        dynamics.share_threads(scene.threads());
        let (first, live) = (Arc::clone(&model), LiveCuts::default());
        let initial = Snapshot { model: first, state, pending: pending.clone(), live };
        Self {
            model,
            options,
            scene,
            dynamics,
            initial,
            pending,
            live: LiveCuts::default(),
            live_work: LiveWork::default(),
            penetration: Vec::new(),
            finer: None,
            loops: Vec::new(),
        }
    }

    /// Cauchy stress [Pa] of each tetrahedron: xx, yy, zz, xy, yz, xz. `None` for rigid bodies and for the
    /// linear law, which has none that turns with the elements.
    pub fn cauchy_stress(&mut self, body: usize) -> Option<Vec<[f64; 6]>> {
        self.dynamics.cauchy_stress(body)
    }

    /// Energy of the deformable bodies.
    pub fn energy(&mut self) -> Energy {
        self.dynamics.energy()
    }

    /// Starts the threads anew: a process that was forked has none of its parent's.
    ///
    /// # Errors
    /// If they could not be started.
    pub fn restart_threads(&mut self) -> Result<(), SimulationError> {
        self.scene.restart_threads()?;
        self.dynamics.share_threads(self.scene.threads());
        self.lose_work();
        Ok(())
    }

    /// The mechanics, for momenta and factors.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    fn check_body(&self, index: usize) -> Result<(), SimulationError> {
        let count = self.model.bodies.len();
        if index < count { Ok(()) } else { Err(SimulationError::NoSuchBody { index, count }) }
    }
}
