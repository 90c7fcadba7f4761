//! The two halves of a step: where the body goes under the contact forces of the last one, and how it
//! responds when they change.

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_solver::{BlockMatrix, SolveWorkspace};

use super::{ElasticBody, Elasticity, FIXED};
use crate::body::inertia::{Inertia, RunningInertia};
use crate::body::turning::{Levers, Rotations, Turning, largest_change};
use crate::state::BodyState;

/// Part of the body's radius by which its shape may change before its response is computed again.
const SHAPE_TOLERANCE: f64 = 1e-3;

/// What a step computes; kept between its two halves.
pub(super) struct Step {
    pub(super) start: Inertia,
    /// Centre of mass and frame of the predicted positions.
    center: DVec3,
    pub(super) frame: DMat3,
    /// Predicted positions and velocities.
    pub(super) positions: Vec<DVec3>,
    pub(super) velocities: Vec<DVec3>,
    /// Velocity of the deformation in the frame, without the body's rotation.
    deformation: Vec<DVec3>,
    pub(super) strain: Vec<[f64; 3]>,
    pub(super) force: Vec<[f64; 3]>,
    /// Correction of the free nodes in the frame [m].
    pub(super) correction: Vec<[f64; 3]>,
    /// Response of the free nodes in the frame to the contact forces that are expected [m]; with nonlinear laws
    /// only that of the body as a whole.
    pub(super) expected: Vec<[f64; 3]>,
    /// Response to the change of contact forces [m].
    pub(super) response: Vec<[f64; 3]>,
    /// Rotations of the predicted positions of an unattached body.
    pub(super) rotations: Rotations,
    pub(super) levers: Levers,
    /// Whether contact forces turn the body by these rotations alone, as the compliance between contacts
    /// has it, whatever the law: what differs from that takes contacts for kept that are not.
    pub(super) turns: bool,
    /// How contact forces turn the body: known once it has been touched in about this shape.
    pub(super) turning: Turning,
    pub(super) turning_known: bool,
    before: TurningBefore,
    /// Whether contact forces act in this step.
    touched: bool,
    pub(super) workspace: SolveWorkspace,
    /// Where the nodes of half solutions are among the free ones.
    pub(super) places: Vec<u32>,
}

/// What was known of the turning before the step, should it fail.
#[derive(Default)]
struct TurningBefore {
    was_known: bool,
    /// Whether the step has made it anew; it is here then.
    was_made: bool,
    turning: Turning,
}

impl Step {
    pub(super) fn new(
        start: Inertia,
        node_count: usize,
        free_count: usize,
        workspace: SolveWorkspace,
    ) -> Self {
        Self {
            start,
            center: DVec3::ZERO,
            frame: DMat3::IDENTITY,
            positions: vec![DVec3::ZERO; node_count],
            velocities: vec![DVec3::ZERO; node_count],
            deformation: vec![DVec3::ZERO; node_count],
            strain: vec![[0.0; 3]; node_count],
            force: vec![[0.0; 3]; node_count],
            correction: vec![[0.0; 3]; free_count],
            expected: vec![[0.0; 3]; free_count],
            response: vec![[0.0; 3]; free_count],
            rotations: Rotations::default(),
            levers: Levers::default(),
            turns: false,
            turning: Turning::default(),
            turning_known: false,
            before: TurningBefore::default(),
            touched: false,
            workspace,
            places: Vec::new(),
        }
    }
}

impl Step {
    pub(super) fn center(&self) -> DVec3 {
        self.center
    }

    /// Begins with a correction that takes the deformation of the last `less` seconds back.
    pub(super) fn begin_correction(&mut self, less: f64, free_nodes: &[u32]) {
        self.correction.fill([0.0; 3]);
        if less > 0.0 {
            for (d, &node) in self.correction.iter_mut().zip(free_nodes) {
                *d = (-less * self.deformation[node as usize]).to_array();
            }
        }
    }

    /// Farthest that the response moves a node, together with what the expected forces turn the body [m].
    pub(super) fn farthest_response(&self, masses: &[f64]) -> f64 {
        let mean = if self.turns {
            let moments = masses.iter().zip(&self.expected).map(|(&m, &e)| m * DVec3::from(e));
            moments.sum::<DVec3>() / masses.iter().sum::<f64>()
        } else {
            DVec3::ZERO
        };
        let both = self.response.iter().zip(&self.expected);
        let squares =
            both.map(|(&r, &e)| (DVec3::from(r) + DVec3::from(e) - mean).length_squared());
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Makes the response a part of the correction, expected forces and change together.
    pub(super) fn take_response(&mut self) {
        let responses = self.expected.iter_mut().zip(&mut self.response);
        for (d, (e, r)) in self.correction.iter_mut().zip(responses) {
            *d = std::array::from_fn(|k| d[k] + e[k] + r[k]);
            (*e, *r) = ([0.0; 3], [0.0; 3]);
        }
    }

    /// Largest velocity of the deformation at a node [m/s].
    pub(super) fn fastest_deformation(&self) -> f64 {
        let squares = self.deformation.iter().map(|v| v.length_squared());
        squares.fold(0.0, f64::max).sqrt()
    }

    /// Velocity of the deformation at a node, in the frame [m/s].
    pub(super) fn deformation(&self, node: usize) -> DVec3 {
        self.deformation[node]
    }
}

impl ElasticBody {
    /// Predicts the motion and corrects it by all forces, `contact` being those of the last step; driven
    /// nodes go a `part` of their way.
    pub(in crate::body) fn predict(
        &mut self,
        x: &[Point],
        v: &[Point],
        forces: &[Point],
        contact: Option<&[Point]>,
        part: f64,
    ) {
        let dt = self.time_step;
        self.step.before.was_known = self.step.turning_known;
        self.step.before.was_made = false;
        self.step.start = Inertia::new(&self.masses, x, v);
        if self.is_unattached() {
            self.predict_rigidly(x, v);
        } else {
            for (node, predicted) in self.step.positions.iter_mut().enumerate() {
                let (x, v) = (DVec3::from_array(x[node]), DVec3::from_array(v[node]));
                let free = self.free_index[node] != FIXED;
                *predicted = if free { x + dt * v } else { x };
                self.step.velocities[node] = if free { v } else { DVec3::ZERO };
            }
            self.predict_driven(x, part);
        }
        (self.step.center, self.step.frame) = self.place_of(self.step.positions.iter().copied());
        self.find_rotations(x);
        let mut elasticity = std::mem::take(&mut self.elasticity);
        self.find_deformation();
        self.step.touched = contact.is_some();
        self.step.response.fill([0.0; 3]);
        if contact.is_some() {
            self.prepare_turning();
        }
        match &mut elasticity {
            Elasticity::Linear(stiffness) => self.correct_linear(stiffness, x, forces, contact),
            Elasticity::Nonlinear(method) => self.correct(method, x, forces, contact),
            Elasticity::None => {}
        }
        self.elasticity = elasticity;
    }

    /// Finds the correction with the linear law, and the response to the expected contact forces.
    fn correct_linear(
        &mut self,
        stiffness: &BlockMatrix,
        x: &[Point],
        forces: &[Point],
        contact: Option<&[Point]>,
    ) {
        self.load_elastic(stiffness, forces);
        let mut correction = std::mem::take(&mut self.step.correction);
        let mut expected = std::mem::take(&mut self.step.expected);
        if let Some(contact) = contact {
            self.load(&mut expected, contact);
            let torque = self.balance(&mut expected);
            self.solve(&mut correction, Some(&mut expected));
            self.turn(torque, &mut expected);
        } else {
            expected.fill([0.0; 3]);
            self.solve(&mut correction, None);
        }
        (self.step.correction, self.step.expected) = (correction, expected);
        if self.is_unattached() {
            self.remove_torque(self.next_spin(x, forces, &[]));
        }
    }

    /// Writes all forces but contact on the free nodes, in the frame, to `correction`: elastic and
    /// damping forces at the predicted state, and external ones.
    ///
    /// The frame turns with the body, so the gradient of the energy has one more term; it is what
    /// makes the torque of the internal forces vanish. Taken explicitly it is unstable when a body
    /// folds, so it is left out here, and [`ElasticBody::remove_torque`] does its work on the result.
    /// Where nodes are fixed, they take that torque: it is of second order in the strain.
    fn load_elastic(&mut self, stiffness: &BlockMatrix, forces: &[Point]) {
        let (center, to_frame) = (self.step.center, self.step.frame.transpose());
        for node in 0..self.masses.len() {
            let r = to_frame * (self.step.positions[node] - center);
            let strain = r - self.rest[node] + self.damping * self.step.deformation[node];
            self.step.strain[node] = strain.to_array();
        }
        stiffness.multiply(&self.step.strain, &mut self.step.force);
        for (place, &node) in self.free_nodes.iter().enumerate() {
            let node = node as usize;
            let internal = DVec3::from_array(self.step.force[node]);
            let load = to_frame * self.external(forces, node) - internal;
            self.step.correction[place] = load.to_array();
        }
    }

    /// External forces on a node, damping of the predicted motion included [N].
    pub(super) fn external(&self, forces: &[Point], node: usize) -> DVec3 {
        let braking = self.mass_damping * self.step.velocities[node];
        DVec3::from_array(forces[node]) + self.masses[node] * (self.gravity - braking)
    }

    /// Velocity of the predicted body in the frame, without its rotation.
    fn find_deformation(&mut self) {
        let to_frame = self.step.frame.transpose();
        let mut sum = RunningInertia::default();
        for (node, &m) in self.masses.iter().enumerate() {
            sum.add(m, self.step.positions[node], self.step.velocities[node]);
        }
        let now = sum.finish();
        let omega = now.tensor.inverse() * now.spin;
        for node in 0..self.masses.len() {
            let r = self.step.positions[node] - now.center;
            let v = self.step.velocities[node] - now.velocity - omega.cross(r);
            self.step.deformation[node] = to_frame * v;
        }
    }

    /// Velocity of the deformation at a node, in the frame [m/s].
    pub(in crate::body) fn deformation(&self, node: u32) -> DVec3 {
        self.step.deformation[node as usize]
    }

    /// Finds out how contact forces turn the body, if it is not attached and that is not known.
    pub(in crate::body) fn prepare_turning(&mut self) {
        if !self.is_unattached() || self.step.turning_known {
            return;
        }
        if !self.step.before.was_made {
            std::mem::swap(&mut self.step.turning, &mut self.step.before.turning);
            self.step.before.was_made = true;
        }
        let rotations = std::mem::take(&mut self.step.rotations);
        self.turn_by(rotations.arms().iter().copied());
        self.step.rotations = rotations;
    }

    /// Forgets what a step that failed has found out.
    pub(in crate::body) fn undo(&mut self) {
        let Step { turning, turning_known, before, .. } = &mut self.step;
        if std::mem::take(&mut before.was_made) {
            std::mem::swap(turning, &mut before.turning);
        }
        *turning_known = before.was_known;
    }

    /// Finds out how contact forces turn the body in the shape that `arms` give.
    fn turn_by(&mut self, arms: impl Iterator<Item = DVec3>) {
        let gain = self.gain();
        let Self { step, masses, factor, .. } = self;
        step.turning_known = step.turning.begin(masses, arms, gain);
        if step.turning_known {
            factor.solve_three_in_place(&mut step.turning.loaded, &mut step.workspace);
            step.turning.finish(masses);
        }
    }

    /// Finds the rotations of an unattached body as predicted, and gives up what is known of its
    /// turning when it has deformed since.
    fn find_rotations(&mut self, x: &[Point]) {
        if !self.is_unattached() {
            return;
        }
        let (center, to_frame) = (self.step.center, self.step.frame.transpose());
        let gain = self.gain();
        let Self { step, masses, .. } = self;
        let arms = step.positions.iter().map(|&x| to_frame * (x - center));
        step.turns = step.rotations.set(masses, arms, gain);
        let start = step.start.center;
        step.levers.0.clear();
        step.levers.0.extend(x.iter().map(|&x| to_frame * (DVec3::from_array(x) - start)));
        let (arms, known) = (step.rotations.arms(), step.turning.rotations().arms());
        step.turning_known &= step.turns
            && largest_change(arms.iter().copied(), known.iter().copied()) <= SHAPE_TOLERANCE;
    }

    /// How contact forces turn the body; `None` if it is attached.
    pub(crate) fn turning(&self) -> Option<&Turning> {
        self.step.turning_known.then_some(&self.step.turning)
    }

    /// Where forces act on the body, in the step that has begun; nowhere if it is attached.
    pub(crate) fn levers(&self) -> &Levers {
        &self.step.levers
    }

    /// The shape for which the turning is known; empty if it is not.
    pub(in crate::body) fn shape(&self) -> Vec<Point> {
        let arms = self.turning().map_or(&[] as &[DVec3], |turning| turning.rotations().arms());
        arms.iter().map(DVec3::to_array).collect()
    }

    /// Goes back to what the response was computed for; true if A has changed.
    pub(in crate::body) fn set_shape(&mut self, saved: &BodyState) -> bool {
        let mut elasticity = std::mem::take(&mut self.elasticity);
        let changed = match &mut elasticity {
            Elasticity::Nonlinear(method) => self.take_stiffness(method, &saved.stiff_shape),
            _ => false,
        };
        self.elasticity = elasticity;
        self.step.turning_known = false;
        if !saved.shape.is_empty() {
            self.turn_by(saved.shape.iter().map(|&arm| DVec3::from_array(arm)));
        }
        changed
    }

    /// Computes the response to `change`, the contact forces less those that were expected [N]; `None`
    /// when no contact forces act nor did so before.
    pub(in crate::body) fn respond(&mut self, change: Option<&[Point]>) {
        self.step.touched = change.is_some();
        self.step.response.fill([0.0; 3]);
        let Some(change) = change.filter(|change| change.iter().any(|&f| f != [0.0; 3])) else {
            return;
        };
        let mut response = std::mem::take(&mut self.step.response);
        self.load(&mut response, change);
        let torque = self.balance(&mut response);
        self.solve(&mut response, None);
        self.turn(torque, &mut response);
        self.step.response = response;
    }

    /// Improves the step under contact forces that are not those that it was predicted with, unless it has
    /// settled, while it `is_changing` more or less; true if it has changed, so that contact must be solved again
    /// from the new [`Self::end_positions`].
    pub(in crate::body) fn improve(
        &mut self,
        x: &[Point],
        forces: &[Point],
        contact: &[Point],
        is_changing: bool,
    ) -> bool {
        let mut elasticity = std::mem::take(&mut self.elasticity);
        let changed = match &mut elasticity {
            Elasticity::Nonlinear(method) => self.iterate(method, x, forces, contact, is_changing),
            _ => false,
        };
        self.elasticity = elasticity;
        changed
    }

    fn balance(&self, loads: &mut [[f64; 3]]) -> DVec3 {
        let Step { rotations, levers, turns, .. } = &self.step;
        if *turns { rotations.balance(&self.masses, levers, loads) } else { DVec3::ZERO }
    }

    pub(super) fn turn(&self, torque: DVec3, response: &mut [[f64; 3]]) {
        if self.step.turns {
            self.step.rotations.turn(&self.masses, torque, response);
        }
    }

    /// Writes forces on the free nodes, turned into the frame, to `loads`.
    fn load(&self, loads: &mut [[f64; 3]], forces: &[Point]) {
        let to_frame = self.step.frame.transpose();
        for (load, &node) in loads.iter_mut().zip(&self.free_nodes) {
            *load = (to_frame * DVec3::from_array(forces[node as usize])).to_array();
        }
    }

    /// Displacement of the free nodes from the prediction.
    pub(super) fn corrections(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let step = &self.step;
        let parts = step.correction.iter().zip(&step.expected).zip(&step.response);
        self.free_nodes.iter().zip(parts).map(|(&node, ((&a, &b), &c))| {
            let sum = DVec3::from_array(a) + DVec3::from_array(b) + DVec3::from_array(c);
            (node as usize, step.frame * sum)
        })
    }

    /// Positions at the end of the step.
    pub(in crate::body) fn end_positions(&self, x: &[Point], positions: &mut [Point]) {
        if !self.is_unattached() {
            positions.copy_from_slice(x);
        }
        for (node, d) in self.corrections() {
            positions[node] = (self.step.positions[node] + d).to_array();
        }
        self.place_driven(positions);
    }

    /// The state after the step.
    pub(in crate::body) fn advance(
        &self,
        x: &[Point],
        forces: &[Point],
        contact_forces: &[Point],
        next_x: &mut [Point],
        next_v: &mut [Point],
    ) {
        if !self.is_unattached() {
            next_x.copy_from_slice(x);
            next_v.fill([0.0; 3]);
        }
        for (node, d) in self.corrections() {
            next_x[node] = (self.step.positions[node] + d).to_array();
            next_v[node] = (self.step.velocities[node] + d / self.time_step).to_array();
        }
        self.place_driven(next_x);
        self.move_driven(next_v);
        if self.is_unattached() {
            let target = self.next_spin(x, forces, contact_forces);
            self.correct_spin(target, self.step.touched, next_x, next_v);
        }
    }
}
