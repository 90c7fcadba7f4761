//! One body: its rest state, its matrices and how it moves when nothing touches it.

mod change;
mod elastic;
mod element;
mod frame;
mod inertia;
mod rigid;
pub(crate) mod turning;

use glam::DVec3;
use palpate_geometry::Point;
use palpate_model::{Body, Pose};
use palpate_solver::OrderingMethod;

use crate::contact::compliance::ComplianceCache;
use crate::error::MechanicsError;
use crate::state::BodyState;
pub use change::BodyBasis;
use elastic::MatrixBefore;
pub(crate) use elastic::{ElasticBody, Known, check_fixed_nodes};
pub(crate) use rigid::RigidBody;

/// A body in motion. All arrays have one entry per node.
pub(crate) struct MovingBody {
    pub(crate) index: usize,
    pub(crate) kind: BodyKind,
    pub(crate) positions: Vec<Point>,
    pub(crate) velocities: Vec<Point>,
    pub(crate) forces: Vec<Point>,
    /// Contact forces [N] of the last finished step.
    pub(crate) contact_forces: Vec<Point>,
    /// Positions [m] at the end of this step if contact forces stay as they were in the last one.
    pub(crate) expected_positions: Vec<Point>,
    /// Those forces [N], and the nodes that they act on.
    expected_forces: Vec<Point>,
    expected_nodes: Vec<u32>,
    /// Contact forces less the expected ones [N].
    change: Vec<Point>,
    pub(crate) next_positions: Vec<Point>,
    pub(crate) next_velocities: Vec<Point>,
    pub(crate) motion: Motion,
    pub(crate) compliance: ComplianceCache,
    /// Nodes whose half solutions were made in this step.
    pub(crate) new_columns: usize,
    /// Whether contact forces act in this step.
    pub(crate) touched: bool,
    /// Whether the last step ended with a new matrix.
    pub(crate) refactored: bool,
    /// Whether a step that took many iterations leaves the matrix as it is: another one is being made.
    pub(crate) waits_for_matrix: bool,
}

/// How far the surface moves in the step that has begun.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    /// Mean displacement [m].
    pub(crate) mean: DVec3,
    /// Largest deviation of a displacement from the mean [m].
    pub(crate) spread: f64,
    /// How much closer two nodes come to each other by the deformation, at most [m].
    pub(crate) deformation: f64,
}

pub(crate) enum BodyKind {
    Elastic(Box<ElasticBody>),
    Rigid(Box<RigidBody>),
}

impl MovingBody {
    pub(crate) fn new(
        index: usize,
        body: &Body,
        gravity: Point,
        time_step: f64,
        known: Known,
    ) -> Result<Self, MechanicsError> {
        let nodes = body.mesh.nodes();
        let (kind, compliance) = if let Some(motion) = &body.rigid {
            let rigid = RigidBody::new(nodes, motion);
            (BodyKind::Rigid(Box::new(rigid)), ComplianceCache::default())
        } else {
            let elastic = ElasticBody::new(index, body, gravity, time_step, known)?;
            let compliance = ComplianceCache::new(&body.mesh, &elastic);
            (BodyKind::Elastic(Box::new(elastic)), compliance)
        };
        let zero = vec![[0.0; 3]; nodes.len()];
        let mut result = Self {
            index,
            positions: nodes.to_vec(),
            velocities: zero.clone(),
            forces: zero.clone(),
            contact_forces: zero.clone(),
            expected_positions: nodes.to_vec(),
            expected_forces: zero.clone(),
            expected_nodes: Vec::with_capacity(body.mesh.surface_nodes().len()),
            change: zero.clone(),
            next_positions: nodes.to_vec(),
            next_velocities: zero,
            motion: Motion::default(),
            compliance,
            new_columns: 0,
            touched: false,
            refactored: false,
            waits_for_matrix: false,
            kind,
        };
        match &result.kind {
            BodyKind::Elastic(elastic) => {
                for (node, velocity) in result.velocities.iter_mut().enumerate() {
                    *velocity =
                        if elastic.is_free(node) { body.initial_velocity } else { [0.0; 3] };
                }
            }
            BodyKind::Rigid(rigid) => rigid.place(0.0, &mut result.positions),
        }
        Ok(result)
    }

    pub(crate) fn elastic(&self) -> Option<&ElasticBody> {
        match &self.kind {
            BodyKind::Elastic(elastic) => Some(elastic),
            BodyKind::Rigid(_) => None,
        }
    }

    pub(crate) fn rigid(&self) -> Option<&RigidBody> {
        match &self.kind {
            BodyKind::Elastic(_) => None,
            BodyKind::Rigid(rigid) => Some(rigid),
        }
    }

    /// The expected contact forces [N] by the nodes that they act on.
    pub(crate) fn expected_forces(&self) -> impl Iterator<Item = (u32, DVec3)> {
        let force = |&node: &u32| (node, DVec3::from_array(self.expected_forces[node as usize]));
        self.expected_nodes.iter().map(force)
    }

    /// Moves the body as if contact forces stayed as they are; `surface` are its surface nodes, `end`
    /// the time after the step [s]. What is told where to go goes a `part` of its way.
    pub(crate) fn predict(&mut self, surface: &[u32], end: f64, time_step: f64, part: f64) {
        self.expected_nodes.clear();
        match &mut self.kind {
            BodyKind::Elastic(elastic) => {
                expect(
                    &self.contact_forces,
                    surface,
                    &mut self.expected_forces,
                    &mut self.expected_nodes,
                );
                let contact = self.touched.then_some(&*self.contact_forces);
                elastic.predict(&self.positions, &self.velocities, &self.forces, contact, part);
                elastic.end_positions(&self.positions, &mut self.expected_positions);
            }
            BodyKind::Rigid(rigid) => {
                rigid.place(end, &mut self.expected_positions);
                if part < 1.0 && rigid.pose.is_some() {
                    for (end, x) in self.expected_positions.iter_mut().zip(&self.positions) {
                        *end = std::array::from_fn(|k| x[k] + part * (end[k] - x[k]));
                    }
                }
            }
        }
        self.motion = self.expected_motion(surface, time_step);
    }

    /// How far the surface moves if contact forces stay as they are: without them a body at rest would
    /// look for contacts much too far away.
    fn expected_motion(&self, surface: &[u32], time_step: f64) -> Motion {
        let displacement = |&node: &u32| {
            DVec3::from_array(self.expected_positions[node as usize])
                - DVec3::from_array(self.positions[node as usize])
        };
        let mean = surface.iter().map(displacement).sum::<DVec3>() / surface.len().max(1) as f64;
        let spread = surface.iter().map(|node| (displacement(node) - mean).length());
        let deformation = self.elastic().map_or(0.0, |elastic| {
            let (mut fastest, mut low, mut high) = (0.0_f64, DVec3::MAX, DVec3::MIN);
            for velocity in surface.iter().map(|&node| elastic.deformation(node)) {
                fastest = fastest.max(velocity.length());
                (low, high) = (low.min(velocity), high.max(velocity));
            }
            // Where one patch moves and the rest does not, the box of the velocities is the tighter bound.
            time_step * (2.0 * fastest).min((high - low).length())
        });
        Motion { mean, spread: spread.fold(0.0, f64::max), deformation }
    }

    /// Makes the compliance of `nodes` available, and of those that forces are expected on.
    pub(crate) fn prepare_compliance(&mut self, nodes: &[u32], step: u64) {
        self.new_columns = match &mut self.kind {
            BodyKind::Elastic(elastic) => {
                if !nodes.is_empty() {
                    elastic.prepare_turning();
                }
                self.compliance.prepare(elastic, nodes, step)
                    + self.compliance.prepare(elastic, &self.expected_nodes, step)
            }
            BodyKind::Rigid(_) => 0,
        };
    }

    /// Solves for the compliance of up to `count` nodes before it is asked for; returns how many.
    pub(crate) fn prepare_ahead(&mut self, count: usize) -> usize {
        match &mut self.kind {
            BodyKind::Elastic(elastic) => self.compliance.prepare_ahead(elastic, count),
            BodyKind::Rigid(_) => 0,
        }
    }

    /// Computes the state after the step under `contact_forces`.
    pub(crate) fn advance(&mut self, time_step: f64) {
        match &mut self.kind {
            BodyKind::Elastic(elastic) => {
                let touched = self.touched || !self.expected_nodes.is_empty();
                for ((change, now), expected) in
                    self.change.iter_mut().zip(&self.contact_forces).zip(&self.expected_forces)
                {
                    *change = std::array::from_fn(|k| now[k] - expected[k]);
                }
                elastic.respond(touched.then_some(&self.change));
                elastic.advance(
                    &self.positions,
                    &self.forces,
                    &self.contact_forces,
                    &mut self.next_positions,
                    &mut self.next_velocities,
                );
            }
            BodyKind::Rigid(_) => {
                self.next_positions.copy_from_slice(&self.expected_positions);
                for ((velocity, new), old) in self
                    .next_velocities
                    .iter_mut()
                    .zip(&self.expected_positions)
                    .zip(&self.positions)
                {
                    *velocity = std::array::from_fn(|k| (new[k] - old[k]) / time_step);
                }
            }
        }
    }

    /// Improves the step of a body that contact forces act on, unless it has settled, in a step that
    /// `is_changing` bodies more or less; true if they must be solved for again.
    pub(crate) fn improve(&mut self, surface: &[u32], is_changing: bool) -> bool {
        let is_changing = is_changing || self.waits_for_matrix;
        let Self { kind, positions, forces, contact_forces, .. } = self;
        let BodyKind::Elastic(elastic) = kind else { return false };
        let touched = self.touched || !self.expected_nodes.is_empty();
        if !touched || !elastic.improve(positions, forces, contact_forces, is_changing) {
            return false;
        }
        expect(&self.contact_forces, surface, &mut self.expected_forces, &mut self.expected_nodes);
        elastic.end_positions(&self.positions, &mut self.expected_positions);
        true
    }

    /// Forgets what a step that failed has found out; contact forces are set by the caller.
    pub(crate) fn undo(&mut self) {
        if let BodyKind::Elastic(elastic) = &mut self.kind {
            elastic.undo();
        }
    }

    /// The first node whose next state is not finite.
    pub(crate) fn first_broken_node(&self) -> Option<usize> {
        first_not_finite(&self.next_positions).or_else(|| first_not_finite(&self.next_velocities))
    }

    /// The shape for which the response is known, for [`MovingBody::set_shape`]; may be empty.
    pub(crate) fn shape(&self) -> Vec<Point> {
        self.elastic().map_or_else(Vec::new, ElasticBody::shape)
    }

    /// Quasi-Newton iterations of the step.
    pub(crate) fn newton_iterations(&self) -> u32 {
        self.elastic().map_or(0, ElasticBody::newton_iterations)
    }

    /// The shape whose stiffness is in use, in its frame; empty for the rest shape.
    pub(crate) fn stiff_shape(&self) -> &[Point] {
        self.elastic().map_or(&[], ElasticBody::stiff_shape)
    }

    /// The order of elimination that the body was given; empty if it found its own.
    pub(crate) fn order(&self) -> &[u32] {
        let given =
            |elastic: &&ElasticBody| elastic.factor_stats().ordering == OrderingMethod::Given;
        self.elastic().filter(given).map_or(&[], ElasticBody::order)
    }

    pub(crate) fn set_pose(&mut self, pose: Option<Pose>) {
        if let BodyKind::Rigid(rigid) = &mut self.kind {
            rigid.pose = pose;
        }
    }

    /// Goes back to what the response was computed for.
    pub(crate) fn set_shape(&mut self, saved: &BodyState) {
        if let BodyKind::Elastic(elastic) = &mut self.kind
            && elastic.set_shape(saved)
        {
            self.compliance.clear();
        }
    }

    /// Takes over the state after the step; only then is it known what moved the driven nodes.
    pub(crate) fn commit(&mut self) {
        if let BodyKind::Elastic(elastic) = &mut self.kind {
            elastic.find_driven_forces(
                &self.velocities,
                &self.forces,
                &self.contact_forces,
                &self.next_positions,
                &self.next_velocities,
            );
        }
        std::mem::swap(&mut self.positions, &mut self.next_positions);
        std::mem::swap(&mut self.velocities, &mut self.next_velocities);
        self.refactored = match &mut self.kind {
            BodyKind::Elastic(elastic) => {
                elastic.refresh_if_slow(&self.positions, self.waits_for_matrix)
            }
            BodyKind::Rigid(_) => false,
        };
        if self.refactored {
            self.compliance.clear();
        }
    }
}

/// Takes contact forces as those that are expected, and the surface nodes that they act on.
fn expect(contact: &[Point], surface: &[u32], forces: &mut [Point], nodes: &mut Vec<u32>) {
    forces.copy_from_slice(contact);
    nodes.clear();
    nodes.extend(surface.iter().filter(|&&node| contact[node as usize] != [0.0; 3]));
}

/// Index of the first vector with an infinite or undefined component.
pub(crate) fn first_not_finite(vectors: &[Point]) -> Option<usize> {
    vectors.iter().position(|vector| !vector.iter().all(|x| x.is_finite()))
}
