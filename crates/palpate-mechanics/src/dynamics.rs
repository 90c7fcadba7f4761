//! The bodies in motion: two calls per step, with contact detection by the caller between them.

mod change;
mod drive;
mod failure;
mod hands;
mod patch;
mod states;
mod substeps;
mod tasks;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use palpate_contact::{PenetratingNode, ProximityPair, Threads};
use palpate_geometry::Point;
use palpate_model::Model;
use palpate_solver::FactorStats;
use rayon::prelude::*;

use crate::body::{BodyKind, Known, MovingBody, first_not_finite};
use crate::contact::filter::{BodyView, Candidate, Detected};
use crate::contact::gauss_seidel::Effort;
use crate::contact::response::Response;
use crate::contact::{Contact, ContactParameters, Surface};
use crate::energy::{Energy, Momentum};
use crate::error::MechanicsError;
use crate::state::{ContactForce, State};
use crate::ties::Ties;
pub use change::ChangedBody;
pub use drive::Drive;
use drive::Drives;
pub use failure::{Cause, Failure};
use states::check_orders;
use tasks::{assign_tasks, cost};

/// Motion margin of a search, in mean edges of the finer deformable surface: contacts farther
/// ahead are found in a later step, or as penetrations.
const MARGIN_LIMIT: f64 = 3.0;
/// The same within one body. The bound on its deformation is loose (the two nodes that differ most, wherever
/// they are), and the pairs found grow with the square of the distance: at 3 edges they cost more than
/// the whole step, at 1.5 a quarter of that.
const SELF_MARGIN_LIMIT: f64 = 1.5;

/// Passes of a step: a contact that only the forces of others bring about is found by the next one, and
/// a body of a nonlinear law answers otherwise than its matrix says.
const MAX_PASSES: usize = 8;

/// How the bodies are stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicsOptions {
    /// Length of a step [s].
    pub time_step: f64,
    /// Worker threads; results are the same bits at any count.
    pub threads: usize,
}

impl Default for DynamicsOptions {
    fn default() -> Self {
        Self { time_step: 1.0 / 60.0, threads: 1 }
    }
}

/// Wall-clock time of the stages of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Prediction and the solve without contact.
    pub predict: Duration,
    /// Which pairs are contacts.
    pub filter: Duration,
    /// Compliance of nodes for which it was not known yet.
    pub compliance: Duration,
    /// The contact forces.
    pub solve: Duration,
    /// Response to the contact forces and the new state.
    pub advance: Duration,
    /// New matrices of bodies whose shape has changed.
    pub refactor: Duration,
}

/// What a step did and what it cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepStats {
    /// Possible contacts that the solver was given.
    pub candidates: usize,
    /// Contacts that carry a force.
    pub contacts: usize,
    /// Those of them within one body.
    pub self_contacts: usize,
    /// Changes of a contact force until all contacts obeyed their laws.
    pub iterations: usize,
    /// Solves for the contact forces: more than one when they brought about contacts that were not
    /// expected.
    pub contact_solves: usize,
    /// Quasi-Newton iterations of the body that took most; 0 without nonlinear laws.
    pub newton_iterations: usize,
    /// Bodies whose matrix was made anew, because the iterations became many.
    pub refactored: usize,
    /// Largest error of a gap or slip that the last solve left, in contact distances.
    pub residual: f64,
    /// Nodes whose compliance had to be solved for.
    pub new_columns: usize,
    /// Where the time went.
    pub times: StageTimes,
}

/// Bodies that deform, move and touch.
///
/// ```
/// use palpate_mechanics::{Dynamics, DynamicsOptions};
/// # use std::sync::Arc;
/// # use palpate_model::{Body, Mesh, MeshData, Model};
/// # let nodes = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
/// # let data = MeshData { nodes, tetrahedra: vec![[0, 1, 2, 3]], ..MeshData::default() };
/// # let body = Body::new("falling", Arc::new(Mesh::new(data)?));
/// # let model = Model::from_bodies(vec![body]);
/// let mut dynamics = Dynamics::new(&model, DynamicsOptions::default())?;
/// dynamics.begin_step();
/// let (proximity, penetration) = (Vec::new(), Vec::new()); // from contact detection
/// dynamics.finish_step(&proximity, &penetration)?;
/// assert!(dynamics.velocities(0)[0][2] < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Dynamics {
    options: DynamicsOptions,
    threads: Threads,
    /// Bodies by the task that steps them, and where each body is.
    tasks: Vec<Vec<MovingBody>>,
    places: Vec<(u32, u32)>,
    surfaces: Vec<Surface>,
    parameters: Vec<ContactParameters>,
    response: Response,
    ties: Ties,
    drives: Drives,
    start_time: f64,
    start_step: u64,
    step: u64,
    predict_time: Duration,
    /// How much of the way to where it is told to go everything goes in this step.
    part: f64,
    /// Whether a step that blows tetrahedra up fails.
    strict: bool,
    /// Whether a prepared change takes place in this step.
    is_changing: bool,
}

impl Dynamics {
    /// Assembles and factors every body of `model`.
    ///
    /// # Errors
    /// If a body cannot be simulated: no tetrahedra and not rigid, a node in no tetrahedron, a
    /// parameter out of range, a matrix that cannot be factored. The error names the body.
    pub fn new(model: &Model, options: DynamicsOptions) -> Result<Self, MechanicsError> {
        Self::with_known(model, options, |_| Known::default())
    }

    /// [`Dynamics::new`] in a state of the same model, also one in which bodies were cut.
    ///
    /// # Errors
    /// As [`Dynamics::new`] and [`Dynamics::set_state`].
    pub fn with_state(
        model: &Model,
        options: DynamicsOptions,
        state: &State,
    ) -> Result<Self, MechanicsError> {
        check_orders(model, state)?;
        let known = |body: usize| {
            let saved = &state.bodies[body];
            Known { order: &saved.order, shape: &saved.stiff_shape, before: None }
        };
        let mut dynamics = Self::with_known(model, options, known)?;
        dynamics.set_state(state)?;
        Ok(dynamics)
    }

    fn with_known<'a>(
        model: &Model,
        options: DynamicsOptions,
        known: impl Fn(usize) -> Known<'a>,
    ) -> Result<Self, MechanicsError> {
        let time_step = options.time_step;
        if !(time_step.is_finite() && time_step > 0.0) {
            return Err(MechanicsError::TimeStep(time_step));
        }
        let threads = Threads::new(options.threads.max(1));
        let threads = threads.map_err(|error| MechanicsError::Threads(error.to_string()))?;
        let make = |index: usize| {
            MovingBody::new(index, &model.bodies[index], model.gravity, time_step, known(index))
        };
        Self::with_bodies(model, options, threads, make)
    }

    /// Of bodies that `make` gives.
    fn with_bodies(
        model: &Model,
        options: DynamicsOptions,
        threads: Threads,
        mut make: impl FnMut(usize) -> Result<MovingBody, MechanicsError>,
    ) -> Result<Self, MechanicsError> {
        if !model.gravity.iter().all(|g| g.is_finite()) {
            return Err(MechanicsError::Gravity);
        }
        let mut bodies = Vec::with_capacity(model.bodies.len());
        let mut parameters = Vec::with_capacity(model.bodies.len());
        for (index, body) in model.bodies.iter().enumerate() {
            bodies.push(make(index)?);
            parameters.push(ContactParameters::new(index, body)?);
        }
        let mut places = Vec::with_capacity(bodies.len());
        let mut counts = vec![0; options.threads.max(1)];
        let costs =
            model.bodies.iter().zip(&bodies).map(|(body, moving)| (body.processor, cost(moving)));
        for task in assign_tasks(costs, options.threads.max(1)) {
            places.push((task as u32, counts[task]));
            counts[task] += 1;
        }
        let surfaces: Vec<Surface> =
            model.bodies.iter().map(|body| Surface::new(&body.mesh)).collect();
        let mut ties = Ties::default();
        attach(&mut ties, model, &parameters, &surfaces);
        let mut dynamics = Self {
            options,
            threads,
            tasks: Vec::new(),
            places,
            response: Response::new(ties.attached_nodes()),
            surfaces,
            parameters,
            ties,
            drives: Drives::default(),
            start_time: 0.0,
            start_step: 0,
            step: 0,
            predict_time: Duration::ZERO,
            part: 1.0,
            strict: false,
            is_changing: false,
        };
        dynamics.put_bodies(bodies);
        Ok(dynamics)
    }

    /// Gives all bodies, by their index, to the tasks that step them.
    fn put_bodies(&mut self, bodies: impl IntoIterator<Item = MovingBody>) {
        let count = self.places.iter().map(|place| place.0 as usize + 1).max().unwrap_or(0);
        self.tasks.clear();
        self.tasks.resize_with(count, Vec::new);
        for (body, place) in bodies.into_iter().zip(&self.places) {
            self.tasks[place.0 as usize].push(body);
        }
    }

    /// Takes all bodies, by their index, from their tasks.
    fn take_bodies(&mut self) -> Vec<MovingBody> {
        let mut bodies: Vec<MovingBody> =
            std::mem::take(&mut self.tasks).into_iter().flatten().collect();
        bodies.sort_unstable_by_key(|body| body.index);
        bodies
    }

    /// Works on these threads from now on; how bodies are divided among them stays as it is.
    pub fn share_threads(&mut self, threads: &Threads) {
        self.threads = threads.clone();
    }

    /// How the bodies are stepped.
    pub fn options(&self) -> DynamicsOptions {
        self.options
    }

    /// Number of bodies.
    pub fn body_count(&self) -> usize {
        self.places.len()
    }

    fn body(&self, body: usize) -> &MovingBody {
        let (task, place) = self.places[body];
        &self.tasks[task as usize][place as usize]
    }

    fn body_mut(&mut self, body: usize) -> &mut MovingBody {
        let (task, place) = self.places[body];
        &mut self.tasks[task as usize][place as usize]
    }

    /// Runs `work` for the bodies of every task.
    fn for_each_task(&mut self, work: impl Fn(&mut Vec<MovingBody>) + Sync) {
        match self.threads.pool() {
            Some(pool) => pool.install(|| self.tasks.par_iter_mut().for_each(&work)),
            None => self.tasks.iter_mut().for_each(&work),
        }
    }

    /// Runs `work(index, body)` for every body, the bodies of one task in turn.
    fn for_each_body(&mut self, work: impl Fn(usize, &mut MovingBody) + Sync) {
        self.for_each_task(|task| task.iter_mut().for_each(|body| work(body.index, body)));
    }

    /// The same, the last ones first: caches still hold what was read of those.
    fn for_each_body_back(&mut self, work: impl Fn(usize, &mut MovingBody) + Sync) {
        self.for_each_task(|task| task.iter_mut().rev().for_each(|body| work(body.index, body)));
    }

    /// Solves ahead for the response of each body to contact, up to `nodes` surface nodes per body;
    /// returns for how many it was. Zero means that there is nothing left to do, or no memory for it.
    ///
    /// The first contact of a node costs a solve otherwise: many at once make a slow step. The results
    /// are the same bits either way. Call it before the first step, or with a few nodes whenever
    /// there is time.
    pub fn prepare_contact(&mut self, nodes: usize) -> usize {
        let solved = AtomicUsize::new(0);
        self.for_each_body(|_, body| {
            solved.fetch_add(body.prepare_ahead(nodes), Ordering::Relaxed);
        });
        solved.into_inner()
    }

    /// Moves every body as if it were alone, which tells how far to look for contacts.
    pub fn begin_step(&mut self) {
        self.begin_part(1.0);
    }

    fn begin_part(&mut self, part: f64) {
        let start = Instant::now();
        self.part = part;
        let end = self.time_at(self.step + 1);
        let time_step = self.options.time_step;
        let surfaces = std::mem::take(&mut self.surfaces);
        self.for_each_body(|index, body| {
            body.predict(surfaces[index].mesh().surface_nodes(), end, time_step, part);
        });
        self.surfaces = surfaces;
        self.predict_time = start.elapsed();
    }

    /// Distance [m] within which surface elements of two bodies can come into contact in the step
    /// that has begun; `None` for pairs that need no test: two rigid bodies, or one body whose
    /// self-contact is off.
    ///
    /// # Panics
    /// If a body does not exist.
    pub fn search_distance(&self, body_a: usize, body_b: usize) -> Option<f64> {
        let (a, b) = (&self.parameters[body_a], &self.parameters[body_b]);
        if (a.rigid && b.rigid) || (body_a == body_b && !a.self_contact) {
            return None;
        }
        let (first, second) = (self.body(body_a).motion, self.body(body_b).motion);
        let (margin, limit) = if body_a == body_b {
            (first.deformation + self.ties.drawn(body_a), SELF_MARGIN_LIMIT)
        } else {
            let pulled = self.ties.moved(body_a) + self.ties.moved(body_b);
            let apart = (first.mean - second.mean).length();
            (apart + first.spread + second.spread + pulled, MARGIN_LIMIT)
        };
        Some(a.distance(b) + margin.min(limit * a.soft_edge().min(b.soft_edge())))
    }

    /// Solves for the contact forces and moves the bodies to the end of the step.
    ///
    /// `proximity` must hold every pair within [`Dynamics::search_distance`] at the current
    /// positions, or those that are local minima at least (`ProximityOptions::local_minima`), `penetration` every surface node inside another body.
    ///
    /// # Errors
    /// If the state would not be finite, or tetrahedra blown up in a strict step; the state is then that
    /// before [`Dynamics::begin_step`], bit for bit.
    ///
    /// # Panics
    /// If a pair names a body or node that does not exist.
    pub fn finish_step(
        &mut self,
        proximity: &[ProximityPair],
        penetration: &[PenetratingNode],
    ) -> Result<StepStats, MechanicsError> {
        let mut response = std::mem::take(&mut self.response);
        let result = self.finish_with(&mut response, proximity, penetration);
        self.response = response;
        self.is_changing = false;
        result
    }

    fn finish_with(
        &mut self,
        response: &mut Response,
        proximity: &[ProximityPair],
        penetration: &[PenetratingNode],
    ) -> Result<StepStats, MechanicsError> {
        let mut stats = StepStats::default();
        stats.times.predict = self.predict_time;
        let time_step = self.options.time_step;

        let start = Instant::now();
        response.begin(|candidates| self.add_ties(candidates));
        response.find(
            Detected { proximity, penetration },
            self.body_count(),
            time_step,
            self.threads.pool(),
            |body| self.body(body),
            |body| BodyView {
                surface: &self.surfaces[body],
                parameters: &self.parameters[body],
                positions: &self.body(body).positions,
            },
        );
        stats.times.filter = start.elapsed();

        for pass in 1..=MAX_PASSES {
            self.solve_contacts(response, &mut stats);
            let start = Instant::now();
            self.set_contact_forces(response.forces());
            self.for_each_body_back(|_, body| body.advance(time_step));
            let missed = response.take_missed(|body| self.body(body));
            let again = pass < MAX_PASSES && (self.improve() || missed);
            if again {
                response.begin_again(self.body_count(), |body| self.body(body));
            }
            stats.times.advance += start.elapsed();
            if !again {
                break;
            }
        }
        stats.candidates = response.candidate_count();
        stats.contacts = response.contacts().len();
        stats.self_contacts =
            response.contacts().iter().filter(|c| c.bodies[0] == c.bodies[1]).count();
        if let Some(failure) = self.find_failure() {
            self.undo(response);
            return Err(failure.into());
        }
        let iterations = (0..self.body_count()).map(|body| self.body(body).newton_iterations());
        stats.newton_iterations = iterations.max().unwrap_or(0) as usize;
        let start = Instant::now();
        self.for_each_body(|_, body| body.commit());
        stats.times.refactor = start.elapsed();
        let refactored = (0..self.body_count()).filter(|&body| self.body(body).refactored);
        stats.refactored = refactored.count();
        response.remember();
        self.ties.finish(response.tie_forces(), self.part);
        self.finish_drives();
        self.step += 1;
        Ok(stats)
    }

    /// Goes back to before the step that has begun.
    fn undo(&mut self, response: &mut Response) {
        response.undo();
        self.set_contact_forces(response.last().forces());
        self.for_each_body(|_, body| body.undo());
    }

    /// One iteration of the bodies that contact forces act on; true if the forces must be solved for
    /// again.
    fn improve(&mut self) -> bool {
        let surfaces = std::mem::take(&mut self.surfaces);
        let is_changing = self.is_changing;
        let changed = AtomicUsize::new(0);
        self.for_each_body(|index, body| {
            let again = body.improve(surfaces[index].mesh().surface_nodes(), is_changing);
            changed.fetch_add(usize::from(again), Ordering::Relaxed);
        });
        self.surfaces = surfaces;
        changed.into_inner() > 0
    }

    fn add_ties(&self, candidates: &mut Vec<Candidate>) {
        let place = |body: u32, node: u32| {
            let parameters = &self.parameters[body as usize];
            let position = self.body(body as usize).positions[node as usize];
            (position, parameters.distance(parameters))
        };
        self.ties.add_candidates(place, self.part, candidates);
    }

    /// One solve for the contact forces of the candidates.
    fn solve_contacts(&mut self, response: &mut Response, stats: &mut StepStats) {
        let start = Instant::now();
        let step = self.step;
        let problem = response.problem();
        self.for_each_body(|index, body| body.prepare_compliance(problem.nodes(index), step));
        stats.new_columns +=
            (0..self.body_count()).map(|body| self.body(body).new_columns).sum::<usize>();
        stats.times.compliance += start.elapsed();

        let start = Instant::now();
        let effort = if stats.contact_solves == 0 { Effort::FIRST } else { Effort::AGAIN };
        let cost = response.solve(effort, self.threads.pool(), |body| self.body(body));
        stats.iterations += cost.changes;
        stats.contact_solves += 1;
        stats.residual = cost.residual;
        stats.times.solve += start.elapsed();
    }

    fn clear_contact_forces(&mut self) {
        for index in 0..self.body_count() {
            let body = self.body_mut(index);
            if body.touched {
                body.contact_forces.fill([0.0; 3]);
            }
            body.touched = false;
        }
    }

    fn set_contact_forces(&mut self, contacts: &[ContactForce]) {
        self.clear_contact_forces();
        for contact in contacts {
            let bodies = std::array::from_fn(|corner| contact.body_of(corner));
            self.add_contact_force(bodies, contact.nodes, contact.weights, contact.force);
        }
    }

    fn add_contact_force(
        &mut self,
        bodies: [usize; 4],
        nodes: [u32; 4],
        weights: [f64; 4],
        force: Point,
    ) {
        for corner in 0..4 {
            let body = self.body_mut(bodies[corner]);
            body.touched = true;
            let sum = &mut body.contact_forces[nodes[corner] as usize];
            for k in 0..3 {
                sum[k] += weights[corner] * force[k];
            }
        }
    }

    fn time_at(&self, step: u64) -> f64 {
        self.start_time + (step - self.start_step) as f64 * self.options.time_step
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.time_at(self.step)
    }

    /// Steps taken.
    pub fn step_count(&self) -> u64 {
        self.step
    }

    /// Node positions [m] of a body.
    ///
    /// # Panics
    /// If the body does not exist, as every function here that takes a body.
    pub fn positions(&self, body: usize) -> &[Point] {
        &self.body(body).positions
    }

    /// Node velocities [m/s] of a body.
    pub fn velocities(&self, body: usize) -> &[Point] {
        &self.body(body).velocities
    }

    /// External nodal forces [N] of a body.
    pub fn forces(&self, body: usize) -> &[Point] {
        &self.body(body).forces
    }

    /// Force [N] of contacts and springs on each node of a body in the last step.
    pub fn contact_force(&self, body: usize) -> &[Point] {
        &self.body(body).contact_forces
    }

    /// Contacts that carried a force in the last step.
    pub fn contacts(&self) -> &[Contact] {
        self.response.contacts()
    }

    /// Moves the nodes of a body to `positions` [m]. Fixed nodes stay where they are put; a rigid
    /// body goes on to its prescribed pose in the next step.
    ///
    /// # Errors
    /// If there is not one finite position per node; nothing has changed then.
    pub fn set_positions(
        &mut self,
        body: usize,
        positions: &[Point],
    ) -> Result<(), MechanicsError> {
        check_array(body, self.positions(body).len(), positions, "the position")?;
        self.body_mut(body).positions.copy_from_slice(positions);
        Ok(())
    }

    /// Sets the node velocities [m/s] of a body; those of fixed nodes are ignored.
    ///
    /// # Errors
    /// If there is not one finite velocity per node; nothing has changed then.
    pub fn set_velocities(
        &mut self,
        body: usize,
        velocities: &[Point],
    ) -> Result<(), MechanicsError> {
        check_array(body, self.positions(body).len(), velocities, "the velocity")?;
        self.body_mut(body).velocities.copy_from_slice(velocities);
        Ok(())
    }

    /// Sets external forces [N] on the nodes of a body, which act until they are changed.
    ///
    /// # Errors
    /// If there is not one finite force per node; nothing has changed then.
    pub fn set_forces(&mut self, body: usize, forces: &[Point]) -> Result<(), MechanicsError> {
        check_array(body, self.positions(body).len(), forces, "the force")?;
        self.body_mut(body).forces.copy_from_slice(forces);
        Ok(())
    }

    /// Energy of the deformable bodies.
    pub fn energy(&mut self) -> Energy {
        let mut energy = Energy::default();
        for index in 0..self.body_count() {
            energy.add(self.body_mut(index));
        }
        energy
    }

    /// Momentum of all deformable bodies together.
    pub fn momentum(&self) -> Momentum {
        let mut momentum = Momentum::default();
        for index in 0..self.body_count() {
            momentum.add(self.body(index));
        }
        momentum
    }

    /// Cauchy stress [Pa] of each tetrahedron: xx, yy, zz, xy, yz, xz. `None` for rigid bodies and for
    /// the linear law, which has none that turns with the elements.
    pub fn cauchy_stress(&mut self, body: usize) -> Option<Vec<[f64; 6]>> {
        let body = self.body_mut(body);
        match &mut body.kind {
            BodyKind::Elastic(elastic) => elastic.cauchy_stress(&body.positions),
            BodyKind::Rigid(_) => None,
        }
    }

    /// Mass of each node of a body [kg]; `None` for a rigid one.
    pub fn masses(&self, body: usize) -> Option<&[f64]> {
        self.body(body).elastic().map(crate::body::ElasticBody::masses)
    }

    /// Size and cost of a body's factor; `None` for a rigid one.
    pub fn factor_stats(&self, body: usize) -> Option<FactorStats> {
        self.body(body).elastic().map(crate::body::ElasticBody::factor_stats)
    }
}

/// Ties what the model attaches.
fn attach(ties: &mut Ties, model: &Model, parameters: &[ContactParameters], surfaces: &[Surface]) {
    for attachment in &model.attachments {
        let [a, b] = attachment.bodies;
        let pressure =
            attachment.stiffness.unwrap_or_else(|| parameters[a].stiffness(&parameters[b]));
        ties.attach(attachment, |node| pressure * surfaces[a].node_area(node));
    }
}

fn check_array(
    body: usize,
    expected: usize,
    vectors: &[Point],
    what: &'static str,
) -> Result<(), MechanicsError> {
    if vectors.len() != expected {
        return Err(MechanicsError::WrongCount { body, expected, found: vectors.len() });
    }
    match first_not_finite(vectors) {
        Some(node) => Err(MechanicsError::NotFinite { body, node, what }),
        None => Ok(()),
    }
}
