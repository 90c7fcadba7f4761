//! The contact forces of the last step: where the next solve begins and what motion to expect.

use palpate_contact::{PairKind, ProximityPair};

use super::filter::Candidate;
use crate::state::ContactForce;

/// Contact forces by what touches. Keeps its memory.
#[derive(Debug, Default)]
pub(crate) struct LastForces {
    forces: Vec<ContactForce>,
    /// Places in `forces`, sorted by what touches.
    order: Vec<u32>,
}

/// What tells contacts apart.
fn key(force: &ContactForce) -> (bool, [u32; 2], [u32; 4]) {
    (force.edges, force.bodies, force.nodes)
}

impl Clone for LastForces {
    fn clone(&self) -> Self {
        Self { forces: self.forces.clone(), order: self.order.clone() }
    }

    fn clone_from(&mut self, other: &Self) {
        self.forces.clone_from(&other.forces);
        self.order.clone_from(&other.order);
    }
}

impl LastForces {
    pub(crate) fn restore(&mut self, forces: &[ContactForce]) {
        self.forces.clear();
        self.forces.extend_from_slice(forces);
        self.sort();
    }

    fn sort(&mut self) {
        self.order.clear();
        self.order.extend(0..self.forces.len() as u32);
        let forces = &self.forces;
        self.order.sort_unstable_by_key(|&place| (key(&forces[place as usize]), place));
    }

    /// In the order of the contacts.
    pub(crate) fn forces(&self) -> &[ContactForce] {
        &self.forces
    }

    /// The force of a candidate, if it touched.
    pub(crate) fn of(&self, candidate: &Candidate) -> Option<&ContactForce> {
        let place = self.find(candidate.kind, candidate.bodies, candidate.nodes);
        place.map(|place| &self.forces[place])
    }

    /// Whether a pair touched.
    pub(crate) fn holds(&self, pair: &ProximityPair) -> bool {
        self.find(pair.kind, pair.bodies, pair.nodes).is_some()
    }

    fn find(&self, kind: PairKind, bodies: [u32; 2], nodes: [u32; 4]) -> Option<usize> {
        let wanted = (kind == PairKind::EdgeEdge, bodies, nodes);
        let place =
            self.order.binary_search_by_key(&wanted, |&place| key(&self.forces[place as usize]));
        place.ok().map(|place| self.order[place] as usize)
    }
}
