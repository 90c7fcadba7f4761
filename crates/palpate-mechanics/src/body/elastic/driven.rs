//! Fixed nodes that are moved: where they go, and what it takes.

use glam::DVec3;
use palpate_geometry::Point;

use super::{ElasticBody, Elasticity};

/// A node that is moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driven {
    node: u32,
    /// Where it is to be [m], and where it is at the end of this step.
    target: DVec3,
    next: DVec3,
    /// What moved it in the last step [N].
    force: DVec3,
}

impl ElasticBody {
    /// Says which nodes are moved, and where they are at the end of the next step [m]. They must not be
    /// free.
    pub(crate) fn set_driven(&mut self, targets: impl Iterator<Item = (u32, Point)>) {
        self.driven.clear();
        self.driven.extend(targets.map(|(node, target)| Driven {
            node,
            target: DVec3::from_array(target),
            next: DVec3::from_array(target),
            force: DVec3::ZERO,
        }));
        self.driven.sort_unstable_by_key(|driven| driven.node);
    }

    /// Force that moved a node in the last step [N]; `None` when it is not driven.
    pub(crate) fn driven_force(&self, node: u32) -> Option<DVec3> {
        let place = self.driven.binary_search_by_key(&node, |driven| driven.node).ok()?;
        Some(self.driven[place].force)
    }

    /// Moves the driven nodes of the prediction by a `part` of their way to their targets.
    pub(super) fn predict_driven(&mut self, x: &[Point], part: f64) {
        for driven in &mut self.driven {
            let node = driven.node as usize;
            let x = DVec3::from_array(x[node]);
            driven.next = if part < 1.0 { x + part * (driven.target - x) } else { driven.target };
            self.step.positions[node] = driven.next;
            self.step.velocities[node] = (driven.next - x) / self.time_step;
        }
    }

    pub(super) fn place_driven(&self, positions: &mut [Point]) {
        for driven in &self.driven {
            positions[driven.node as usize] = driven.next.to_array();
        }
    }

    pub(super) fn move_driven(&self, velocities: &mut [Point]) {
        for driven in &self.driven {
            let node = driven.node as usize;
            velocities[node] = self.step.velocities[node].to_array();
        }
    }

    /// Finds out what it took to move the driven nodes in the step from velocities `v` to `next_x`,
    /// `next_v`: mass times acceleration less all other forces.
    pub(in crate::body) fn find_driven_forces(
        &mut self,
        v: &[Point],
        forces: &[Point],
        contact: &[Point],
        next_x: &[Point],
        next_v: &[Point],
    ) {
        if self.driven.is_empty() {
            return;
        }
        let mut elasticity = std::mem::take(&mut self.elasticity);
        match &mut elasticity {
            Elasticity::Nonlinear(method) => method.forces_at(next_x),
            Elasticity::Linear(stiffness) => {
                let more = 1.0 + self.damping / self.time_step;
                let (center, to_frame) = (self.step.center(), self.step.frame.transpose());
                let mut strain = std::mem::take(&mut self.step.strain);
                for (node, strain) in strain.iter_mut().enumerate() {
                    let arm = to_frame * (self.step.positions[node] - center);
                    let rate = self.damping * self.step.deformation(node);
                    *strain = (arm - self.rest[node] + rate).to_array();
                }
                for (node, d) in self.corrections() {
                    let d = DVec3::from_array(strain[node]) + more * (to_frame * d);
                    strain[node] = d.to_array();
                }
                stiffness.multiply(&strain, &mut self.step.force);
                self.step.strain = strain;
            }
            Elasticity::None => {}
        }
        for place in 0..self.driven.len() {
            let node = self.driven[place].node as usize;
            let internal = match &elasticity {
                Elasticity::Nonlinear(method) => method.force(node),
                _ => -(self.step.frame * DVec3::from_array(self.step.force[node])),
            };
            let faster = DVec3::from_array(next_v[node]) - DVec3::from_array(v[node]);
            let others = internal + self.external(forces, node) + DVec3::from_array(contact[node]);
            self.driven[place].force = self.masses[node] * faster / self.time_step - others;
        }
        self.elasticity = elasticity;
    }
}
