//! The spin of an unattached body: carried on exactly, changed by external torques only.

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;

use super::ElasticBody;
use super::step::Step;
use crate::body::inertia::{Inertia, RunningInertia};

/// Part of the energy of its spin that a touched body may gain when its spin is put right.
const ENERGY_SLACK: f64 = 1e-4;
/// What a body gains at rest is at most this part of the speed that its weight gives it in a step.
const RESTING: f64 = 1e-3;

impl ElasticBody {
    /// Rotates the body exactly about its centre and carries the rest of the velocity along, so that a
    /// fast tumble neither inflates the body nor changes its momenta.
    pub(super) fn predict_rigidly(&mut self, x: &[Point], v: &[Point]) {
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

    /// Turns the correction so that only external torques have changed the angular momentum.
    pub(super) fn remove_torque(&mut self, target: DVec3) {
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

    /// Angular momentum about the centre after the step: only external torques change it.
    pub(super) fn next_spin(&self, x: &[Point], forces: &[Point], contact: &[Point]) -> DVec3 {
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
    /// or surfaces would overlap, and the velocities are put right. Not where
    /// that makes a body faster which rests under its weight and which contact turns back in every step: it would
    /// keep a velocity that moves nothing.
    pub(super) fn correct_spin(&self, target: DVec3, touched: bool, x: &[Point], v: &mut [Point]) {
        let now = Inertia::new(&self.masses, x, v);
        let inverse = now.tensor.inverse();
        let omega = inverse * (target - now.spin);
        let energy = |spin: DVec3| spin.dot(inverse * spin);
        let gains_energy = energy(target) > (1.0 + ENERGY_SLACK) * energy(now.spin);
        let rests = || {
            let arms = x.iter().map(|&x| DVec3::from_array(x) - now.center);
            let squares = arms.map(|r| omega.cross(r).length_squared());
            let fastest = squares.fold(0.0, f64::max).sqrt();
            fastest <= RESTING * self.gravity.length() * self.time_step
        };
        if !omega.is_finite() || (touched && gains_energy && rests()) {
            return;
        }
        for (v, &x) in v.iter_mut().zip(x) {
            let r = DVec3::from_array(x) - now.center;
            *v = (DVec3::from_array(*v) + omega.cross(r)).to_array();
        }
    }
}
