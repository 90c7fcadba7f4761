//! A deformable body: linear elasticity in its own rotating frame, one implicit Euler step at a time.
//!
//! In the frame R, with u = R^T (x - c) - X, the elastic energy is u^T K u / 2. The step solves
//!
//! `A d = f(x*) `, `A = (1/dt² + alpha/dt) M + (1 + beta/dt) K`, `x = x* + R d`, `v = v* + R d / dt`
//!
//! for the correction d of an inertial prediction (x*, v*). A is constant, so its factor is made once.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;
use palpate_model::Body;
use palpate_solver::{
    BlockMatrix, BlockPattern, Cholesky, FactorError, FactorStats, Precision, SolveWorkspace,
};

use super::element::{lame_parameters, shape_gradients, stiffness_block};
use super::frame::best_rotation;
use super::inertia::{Inertia, RunningInertia};
use super::turning::Turning;
use crate::error::MechanicsError;

const FIXED: u32 = u32::MAX;

pub(crate) struct ElasticBody {
    /// Rest positions relative to their centre of mass [m].
    rest: Vec<DVec3>,
    masses: Vec<f64>,
    stiffness: BlockMatrix,
    factor: Cholesky,
    /// Nodes that are not fixed, and where each node is among them.
    free_nodes: Vec<u32>,
    free_index: Vec<u32>,
    damping: f64,
    mass_damping: f64,
    gravity: DVec3,
    time_step: f64,
    step: Step,
}

/// What a step computes; kept between its two halves.
struct Step {
    start: Inertia,
    frame: DMat3,
    /// Predicted positions and velocities.
    positions: Vec<DVec3>,
    velocities: Vec<DVec3>,
    /// Velocity of the deformation in the frame, without the body's rotation.
    deformation: Vec<DVec3>,
    strain: Vec<[f64; 3]>,
    force: Vec<[f64; 3]>,
    /// Correction of the free nodes in the frame [m].
    correction: Vec<[f64; 3]>,
    /// Response of the free nodes to contact forces in the frame [m].
    response: Vec<[f64; 3]>,
    columns: Vec<[f64; 9]>,
    /// How contact forces turn the body in this step, once it is known.
    turning: Turning,
    turning_known: bool,
    workspace: SolveWorkspace,
}

impl ElasticBody {
    pub(super) fn new(
        index: usize,
        body: &Body,
        gravity: Point,
        time_step: f64,
    ) -> Result<Self, MechanicsError> {
        check_material(index, body)?;
        let mesh = &body.mesh;
        let (nodes, tetrahedra) = (mesh.nodes(), mesh.tetrahedra());
        let name = || body.name.clone();
        if tetrahedra.is_empty() {
            return Err(MechanicsError::NoTetrahedra { body: index, name: name() });
        }
        let count = nodes.len();
        let material = &body.material;
        let lame = lame_parameters(material);
        let mut masses = vec![0.0; count];
        let pattern = Arc::new(BlockPattern::from_cliques(count, tetrahedra));
        let mut stiffness = BlockMatrix::zeros(Arc::clone(&pattern));
        for corners in tetrahedra {
            let (volume, gradients) =
                shape_gradients(corners.map(|node| DVec3::from_array(nodes[node as usize])));
            for (&row, gi) in corners.iter().zip(gradients) {
                masses[row as usize] += 0.25 * material.density * volume;
                for (&col, gj) in corners.iter().zip(gradients) {
                    if col <= row {
                        stiffness.add(row, col, &stiffness_block(volume, lame, gi, gj));
                    }
                }
            }
        }
        if let Some(node) = masses.iter().position(|&mass| mass <= 0.0) {
            return Err(MechanicsError::LooseNode { body: index, name: name(), node });
        }
        let mut free_index = vec![0; count];
        for &node in &body.fixed_nodes {
            free_index[node as usize] = FIXED;
        }
        let free_nodes: Vec<u32> =
            (0..count as u32).filter(|&node| free_index[node as usize] != FIXED).collect();
        for (place, &node) in free_nodes.iter().enumerate() {
            free_index[node as usize] = place as u32;
        }
        let system = system_matrix(&stiffness, &masses, &free_index, body, time_step);
        let factor = Cholesky::with_precision(&system, Precision::Single).map_err(|source| {
            let source = in_body_numbering(source, &free_nodes);
            MechanicsError::Factor { body: index, name: name(), source }
        })?;
        let start = Inertia::new(&masses, nodes, &vec![[0.0; 3]; count]);
        let rest = nodes.iter().map(|&node| DVec3::from_array(node) - start.center).collect();
        let step = Step {
            start,
            frame: DMat3::IDENTITY,
            positions: vec![DVec3::ZERO; count],
            velocities: vec![DVec3::ZERO; count],
            deformation: vec![DVec3::ZERO; count],
            strain: vec![[0.0; 3]; count],
            force: vec![[0.0; 3]; count],
            correction: vec![[0.0; 3]; free_nodes.len()],
            response: vec![[0.0; 3]; free_nodes.len()],
            columns: vec![[0.0; 9]; free_nodes.len()],
            turning: Turning::default(),
            turning_known: false,
            workspace: factor.workspace(),
        };
        Ok(Self {
            rest,
            masses,
            stiffness,
            factor,
            free_nodes,
            free_index,
            damping: material.damping,
            mass_damping: material.mass_damping,
            gravity: DVec3::from_array(gravity),
            time_step,
            step,
        })
    }

    pub(crate) fn is_free(&self, node: usize) -> bool {
        self.free_index[node] != FIXED
    }

    fn is_unattached(&self) -> bool {
        self.free_nodes.len() == self.masses.len()
    }

    pub(crate) fn masses(&self) -> &[f64] {
        &self.masses
    }

    pub(crate) fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// The frame of the step that has begun.
    pub(crate) fn frame(&self) -> DMat3 {
        self.step.frame
    }

    pub(crate) fn factor_stats(&self) -> FactorStats {
        self.factor.stats()
    }

    /// Prediction, then the correction by every force but contact.
    pub(super) fn predict(&mut self, x: &[Point], v: &[Point], forces: &[Point]) {
        let dt = self.time_step;
        self.step.turning_known = false;
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
        }
        let frame = self.fit_frame();
        self.step.frame = frame;
        self.internal_forces();
        let to_frame = frame.transpose();
        for (place, &node) in self.free_nodes.iter().enumerate() {
            let node = node as usize;
            let mass = self.masses[node];
            let external = DVec3::from_array(forces[node])
                + mass * (self.gravity - self.mass_damping * self.step.velocities[node]);
            let force = DVec3::from_array(self.step.force[node]) + to_frame * external;
            self.step.correction[place] = force.to_array();
        }
        let mut correction = std::mem::take(&mut self.step.correction);
        self.solve(&mut correction);
        self.step.correction = correction;
        if self.is_unattached() {
            self.remove_torque(self.next_spin(x, forces, &[]));
        }
    }

    /// Rotates the body exactly about its centre and carries the rest of the velocity along, so that a
    /// fast tumble neither inflates the body nor changes its momenta.
    fn predict_rigidly(&mut self, x: &[Point], v: &[Point]) {
        let dt = self.time_step;
        let Inertia { center, velocity, spin, tensor } = self.step.start;
        let inverse = tensor.inverse();
        let omega = inverse * spin;
        // Angular velocity at the middle of the step, for the conserved angular momentum.
        let mut middle = omega;
        for _ in 0..4 {
            let half = DMat3::from_quat(DQuat::from_scaled_axis(0.5 * dt * middle));
            middle = half * (inverse * (half.transpose() * spin));
        }
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(dt * middle));
        let turned_omega = turn * (inverse * (turn.transpose() * spin));
        for node in 0..x.len() {
            let r = DVec3::from_array(x[node]) - center;
            let rest = turn * (DVec3::from_array(v[node]) - velocity - omega.cross(r));
            let turned = turn * r;
            self.step.positions[node] = center + dt * velocity + turned + dt * rest;
            self.step.velocities[node] = velocity + turned_omega.cross(turned) + rest;
        }
    }

    /// Frame of the predicted positions.
    fn fit_frame(&mut self) -> DMat3 {
        let center = self.predicted_center();
        let mut fit = DMat3::ZERO;
        for ((&m, &x), &rest) in self.masses.iter().zip(&self.step.positions).zip(&self.rest) {
            let r = m * (x - center);
            fit += DMat3::from_cols(rest.x * r, rest.y * r, rest.z * r);
        }
        best_rotation(fit)
    }

    fn predicted_center(&self) -> DVec3 {
        let mut center = DVec3::ZERO;
        let mut total = 0.0;
        for (&m, &x) in self.masses.iter().zip(&self.step.positions) {
            center += m * x;
            total += m;
        }
        center / total
    }

    /// Elastic and damping forces in the frame at the predicted state.
    ///
    /// The frame turns with the body, so the gradient of the energy has one more term; it is what
    /// makes the torque of the internal forces vanish. Taken explicitly it is unstable when a body
    /// folds, so it is left out here, and [`ElasticBody::remove_torque`] does its work on the result.
    /// Where nodes are fixed, they take that torque: it is of second order in the strain.
    fn internal_forces(&mut self) {
        let to_frame = self.step.frame.transpose();
        // Rotation of the predicted body, to be left out of the damping.
        let mut sum = RunningInertia::default();
        for (node, &m) in self.masses.iter().enumerate() {
            sum.add(m, self.step.positions[node], self.step.velocities[node]);
        }
        let now = sum.finish();
        let omega = now.tensor.inverse() * now.spin;
        for node in 0..self.masses.len() {
            let r = self.step.positions[node] - now.center;
            let v = to_frame * (self.step.velocities[node] - now.velocity - omega.cross(r));
            let r = to_frame * r;
            self.step.deformation[node] = v;
            self.step.strain[node] = (r - self.rest[node] + self.damping * v).to_array();
        }
        self.stiffness.multiply(&self.step.strain, &mut self.step.force);
        for force in &mut self.step.force {
            *force = force.map(|f| -f);
        }
    }

    /// Turns the correction so that only external torques have changed the angular momentum.
    fn remove_torque(&mut self, target: DVec3) {
        let dt = self.time_step;
        let frame = self.step.frame;
        let moved = |step: &Step, node: usize| {
            let d = frame * DVec3::from_array(step.correction[node]);
            (step.positions[node] + d, step.velocities[node] + d / dt)
        };
        let mut sum = RunningInertia::default();
        for (node, &m) in self.masses.iter().enumerate() {
            let (x, v) = moved(&self.step, node);
            sum.add(m, x, v);
        }
        let now = sum.finish();
        let omega = now.tensor.inverse() * (target - now.spin);
        if !omega.is_finite() {
            return;
        }
        for node in 0..self.masses.len() {
            let (x, _) = moved(&self.step, node);
            let turned = frame.transpose() * (dt * omega.cross(x - now.center));
            for (d, more) in self.step.correction[node].iter_mut().zip(turned.to_array()) {
                *d += more;
            }
        }
    }

    /// Positions at the end of the step if nothing touches.
    pub(super) fn free_positions(&self, positions: &mut [Point]) {
        for (position, predicted) in positions.iter_mut().zip(&self.step.positions) {
            *position = predicted.to_array();
        }
        for (&node, &d) in self.free_nodes.iter().zip(&self.step.correction) {
            let moved = self.step.positions[node as usize] + self.step.frame * DVec3::from_array(d);
            positions[node as usize] = moved.to_array();
        }
    }

    /// Speed of the deformation at a node [m/s].
    pub(super) fn deformation_speed(&self, node: u32) -> f64 {
        self.step.deformation[node as usize].length()
    }

    /// Finds out how contact forces turn the body in this step; nothing if it is attached.
    pub(super) fn prepare_turning(&mut self) {
        if !self.is_unattached() || self.step.turning_known {
            return;
        }
        let (center, to_frame) = (self.predicted_center(), self.step.frame.transpose());
        let gain = self.gain();
        let step = &mut self.step;
        let arms = step.positions.iter().map(|&x| to_frame * (x - center));
        if step.turning.begin(&self.masses, arms, gain) {
            self.factor.solve_three_in_place(&mut step.turning.loaded, &mut step.workspace);
            step.turning.finish(&self.masses);
            step.turning_known = true;
        }
    }

    /// How contact forces turn the body in this step; `None` if it is attached.
    pub(crate) fn turning(&self) -> Option<&Turning> {
        self.step.turning_known.then_some(&self.step.turning)
    }

    /// Solves for the three unit forces on `node`, which must be free; read the result with
    /// [`ElasticBody::compliance`].
    pub(crate) fn solve_compliance(&mut self, node: u32) {
        let place = self.free_index[node as usize] as usize;
        self.factor.solve_node(place, &mut self.step.columns, &mut self.step.workspace);
    }

    /// Displacement in the frame of every free node under the three unit forces: entry
    /// `3 * axis + k` is along k under the force along axis [m/N].
    pub(crate) fn compliance(&self) -> &[[f64; 9]] {
        &self.step.columns
    }

    /// Where a node is among the free ones; `None` when it is fixed.
    pub(crate) fn free_place(&self, node: u32) -> Option<usize> {
        let place = self.free_index[node as usize];
        (place != FIXED).then_some(place as usize)
    }

    /// Whether contact forces act in this step.
    fn touched(&self) -> bool {
        self.step.response.iter().any(|&d| d != [0.0; 3])
    }

    /// Solves for the response to contact forces [N]; without any it is zero.
    pub(super) fn respond(&mut self, forces: Option<&[Point]>) {
        let Some(forces) = forces else {
            self.step.response.fill([0.0; 3]);
            return;
        };
        let to_frame = self.step.frame.transpose();
        for (load, &node) in self.step.response.iter_mut().zip(&self.free_nodes) {
            *load = (to_frame * DVec3::from_array(forces[node as usize])).to_array();
        }
        let mut response = std::mem::take(&mut self.step.response);
        let balance = |turning: &Turning| turning.balance(&self.masses, &mut response);
        let torque = self.turning().map(balance);
        self.solve(&mut response);
        if let (Some(turning), Some(torque)) = (self.turning(), torque) {
            turning.turn(&self.masses, torque, &mut response);
        }
        self.step.response = response;
    }

    /// Turns loads on the free nodes into displacements, A^-1. An unattached body is moved as a whole
    /// by what its mass says, in double precision, and only the rest is solved for.
    fn solve(&mut self, values: &mut [[f64; 3]]) {
        if !self.is_unattached() {
            self.factor.solve_in_place(values, &mut self.step.workspace);
            return;
        }
        let total: f64 = self.masses.iter().sum();
        let load: DVec3 = values.iter().map(|&value| DVec3::from_array(value)).sum();
        let acceleration = load / total;
        for (&m, value) in self.masses.iter().zip(&mut *values) {
            *value = (DVec3::from_array(*value) - m * acceleration).to_array();
        }
        self.factor.solve_in_place(values, &mut self.step.workspace);
        let moments = self.masses.iter().zip(&*values);
        let moment: DVec3 = moments.map(|(&m, &value)| m * DVec3::from_array(value)).sum();
        let shift = self.gain() * acceleration - moment / total;
        for value in values {
            *value = (DVec3::from_array(*value) + shift).to_array();
        }
    }

    /// Displacement [m] of a step under unit force per unit mass.
    fn gain(&self) -> f64 {
        self.time_step * self.time_step / (1.0 + self.mass_damping * self.time_step)
    }

    /// Positions at the end of the step with the response to contact forces.
    pub(super) fn end_positions(&self, x: &[Point], positions: &mut [Point]) {
        positions.copy_from_slice(x);
        let corrections = self.step.correction.iter().zip(&self.step.response);
        for (&node, (&d, &response)) in self.free_nodes.iter().zip(corrections) {
            let node = node as usize;
            let d = self.step.frame * (DVec3::from_array(d) + DVec3::from_array(response));
            positions[node] = (self.step.positions[node] + d).to_array();
        }
    }

    /// The state after the step.
    pub(super) fn advance(
        &self,
        x: &[Point],
        forces: &[Point],
        contact_forces: &[Point],
        next_x: &mut [Point],
        next_v: &mut [Point],
    ) {
        next_v.fill([0.0; 3]);
        self.end_positions(x, next_x);
        let corrections = self.step.correction.iter().zip(&self.step.response);
        for (&node, (&d, &response)) in self.free_nodes.iter().zip(corrections) {
            let node = node as usize;
            let d = self.step.frame * (DVec3::from_array(d) + DVec3::from_array(response));
            next_v[node] = (self.step.velocities[node] + d / self.time_step).to_array();
        }
        if self.is_unattached() {
            let target = self.next_spin(x, forces, contact_forces);
            self.correct_spin(target, next_x, next_v);
        }
    }

    /// Angular momentum about the centre after the step: only external torques change it.
    fn next_spin(&self, x: &[Point], forces: &[Point], contact: &[Point]) -> DVec3 {
        let start = &self.step.start;
        let torque_of = |forces: &[Point]| -> DVec3 {
            let pairs = x.iter().zip(forces);
            pairs
                .map(|(&x, &f)| (DVec3::from_array(x) - start.center).cross(DVec3::from_array(f)))
                .sum()
        };
        let torque = torque_of(forces) + torque_of(contact);
        (start.spin + self.time_step * torque) / (1.0 + self.mass_damping * self.time_step)
    }

    /// The response to contact turns the body by an amount of second order too much; positions stay,
    /// or surfaces would overlap, and the velocities are put right where that slows the body. Where it
    /// would not, the positions' own spin stays: a body at rest under its weight, which contact turns
    /// back in every step, would otherwise keep a velocity that moves nothing.
    fn correct_spin(&self, target: DVec3, x: &[Point], v: &mut [Point]) {
        let now = Inertia::new(&self.masses, x, v);
        let inverse = now.tensor.inverse();
        let omega = inverse * (target - now.spin);
        let gains_energy = target.dot(inverse * target) > now.spin.dot(inverse * now.spin);
        if !omega.is_finite() || (self.touched() && gains_energy) {
            return;
        }
        for (v, &x) in v.iter_mut().zip(x) {
            let r = DVec3::from_array(x) - now.center;
            *v = (DVec3::from_array(*v) + omega.cross(r)).to_array();
        }
    }

    /// Elastic energy [J] at positions `x`.
    pub(crate) fn elastic_energy(&self, x: &[Point]) -> f64 {
        let total: f64 = self.masses.iter().sum();
        let weighted = self.masses.iter().zip(x).map(|(&m, &x)| m * DVec3::from_array(x));
        let center = weighted.sum::<DVec3>() / total;
        let mut fit = DMat3::ZERO;
        for ((&m, &x), rest) in self.masses.iter().zip(x).zip(&self.rest) {
            let r = m * (DVec3::from_array(x) - center);
            fit += DMat3::from_cols(rest.x * r, rest.y * r, rest.z * r);
        }
        let to_frame = best_rotation(fit).transpose();
        let strain: Vec<[f64; 3]> = x
            .iter()
            .zip(&self.rest)
            .map(|(&x, &rest)| (to_frame * (DVec3::from_array(x) - center) - rest).to_array())
            .collect();
        let mut product = vec![[0.0; 3]; strain.len()];
        self.stiffness.multiply(&strain, &mut product);
        let pairs = strain.as_flattened().iter().zip(product.as_flattened());
        0.5 * pairs.map(|(u, f)| u * f).sum::<f64>()
    }
}

/// A over the free nodes.
fn system_matrix(
    stiffness: &BlockMatrix,
    masses: &[f64],
    free_index: &[u32],
    body: &Body,
    time_step: f64,
) -> BlockMatrix {
    let factor = 1.0 + body.material.damping / time_step;
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let pattern = stiffness.pattern();
    let mut kept = Vec::new();
    for col in 0..masses.len() as u32 {
        let first = free_index[col as usize];
        for &row in pattern.column(col as usize) {
            let second = free_index[row as usize];
            if first != FIXED && second != FIXED {
                edges.push([first, second]);
                kept.push((row, col));
            }
        }
    }
    let free_count = free_index.iter().filter(|&&place| place != FIXED).count();
    let mut system = BlockMatrix::zeros(Arc::new(BlockPattern::from_cliques(free_count, &edges)));
    let inertia = 1.0 / (time_step * time_step) + body.material.mass_damping / time_step;
    for ([col, row], (full_row, full_col)) in edges.into_iter().zip(kept) {
        let index = pattern.find(full_row, full_col).expect("taken from the pattern");
        let mut block = stiffness.blocks()[index].map(|line| line.map(|value| factor * value));
        if row == col {
            for (k, line) in block.iter_mut().enumerate() {
                line[k] += inertia * masses[full_row as usize];
            }
        }
        system.add(row, col, &block);
    }
    system
}

fn in_body_numbering(error: FactorError, free_nodes: &[u32]) -> FactorError {
    match error {
        FactorError::NotPositiveDefinite { node, column } => {
            let node = free_nodes[node] as usize;
            FactorError::NotPositiveDefinite { node, column: 3 * node + column % 3 }
        }
        other => other,
    }
}

fn check_material(index: usize, body: &Body) -> Result<(), MechanicsError> {
    let m = &body.material;
    let finite = |value: f64, ok: bool| value.is_finite() && ok;
    let checks = [
        ("young", m.young, finite(m.young, m.young > 0.0), "a positive number of Pa"),
        ("poisson", m.poisson, m.poisson > -1.0 && m.poisson < 0.5, "-1 < poisson < 0.5"),
        ("density", m.density, finite(m.density, m.density > 0.0), "a positive number of kg/m³"),
        ("damping", m.damping, finite(m.damping, m.damping >= 0.0), "a number of s, not negative"),
        (
            "mass damping",
            m.mass_damping,
            finite(m.mass_damping, m.mass_damping >= 0.0),
            "a number of 1/s, not negative",
        ),
    ];
    for (what, value, ok, expected) in checks {
        if !ok {
            let name = body.name.clone();
            return Err(MechanicsError::BadParameter { body: index, name, what, value, expected });
        }
    }
    let velocity = body.initial_velocity.iter().copied().find(|value| !value.is_finite());
    if let Some(value) = velocity {
        let (name, what, expected) = (body.name.clone(), "initial velocity", "finite numbers");
        return Err(MechanicsError::BadParameter { body: index, name, what, value, expected });
    }
    Ok(())
}
