//! What a body's nodes answer to forces, as half solutions of its matrix.
//!
//! The displacement of one node under forces on another is the product of their half solutions, which
//! cost a part of the forward pass of a solve each and serve every later step, until the body's matrix is
//! made anew. They are single precision: they shape the contact forces, whose response is solved in
//! full.

use palpate_model::Mesh;
use palpate_solver::HalfSolution;

use crate::body::ElasticBody;

/// Bytes per body beyond which half solutions of nodes without contact are given up.
const MEMORY_LIMIT: usize = 128 << 20;

const NONE: u32 = u32::MAX;

/// Half solutions of one body.
#[derive(Debug, Default)]
pub(crate) struct ComplianceCache {
    surface_nodes: Vec<u32>,
    /// Node -> slot.
    slot_of: Vec<u32>,
    slots: Vec<Slot>,
    halves: Vec<HalfSolution>,
    /// Memory of half solutions that were given up.
    spare: Vec<HalfSolution>,
    /// Nodes that are to be solved for.
    wanted: Vec<u32>,
    /// Bytes of all half solutions, and beyond which those of nodes without contact are given up.
    size: usize,
    limit: usize,
    /// Surface nodes before this one have been solved ahead.
    ahead: usize,
    version: u64,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    node: u32,
    last_used: u64,
}

impl ComplianceCache {
    pub(crate) fn new(mesh: &Mesh, body: &ElasticBody) -> Self {
        let slot_of = vec![NONE; mesh.nodes().len()];
        let mut surface_nodes = mesh.surface_nodes().to_vec();
        surface_nodes.sort_by_key(|&node| body.elimination_place(node));
        Self { surface_nodes, slot_of, limit: MEMORY_LIMIT, ..Self::default() }
    }

    /// Uses the memory of another body's half solutions.
    pub(crate) fn take_memory(&mut self, mut other: Self) {
        self.spare.append(&mut other.halves);
        self.spare.append(&mut other.spare);
    }

    /// With another limit than the usual one.
    #[cfg(test)]
    pub(super) fn set_limit(&mut self, bytes: usize) {
        self.limit = bytes;
    }

    /// Gives up everything: the matrix has changed.
    pub(crate) fn clear(&mut self) {
        self.slot_of.fill(NONE);
        self.slots.clear();
        self.spare.append(&mut self.halves);
        (self.size, self.ahead) = (0, 0);
        self.version += 1;
    }

    /// Counts how often everything was given up.
    pub(crate) fn version(&self) -> u64 {
        self.version
    }

    /// Makes the half solutions of `nodes` available; returns how many had to be solved.
    pub(crate) fn prepare(&mut self, body: &mut ElasticBody, nodes: &[u32], step: u64) -> usize {
        self.wanted.clear();
        for &node in nodes {
            if let Some(slot) = self.slots.get_mut(self.slot_of[node as usize] as usize) {
                slot.last_used = step;
            } else if body.free_place(node).is_some() {
                self.wanted.push(node);
            }
        }
        self.solve_wanted(body, step)
    }

    /// Solves for up to `count` surface nodes that no step has asked for yet; returns how many that
    /// were, fewer only when the memory is full or every surface node is known.
    pub(crate) fn prepare_ahead(&mut self, body: &mut ElasticBody, count: usize) -> usize {
        self.wanted.clear();
        let mut size = self.size;
        while self.wanted.len() < count && self.ahead < self.surface_nodes.len() {
            let node = self.surface_nodes[self.ahead];
            if self.slot_of[node as usize] == NONE && body.free_place(node).is_some() {
                size += body.half_bytes(node);
                if size > self.limit {
                    break;
                }
                self.wanted.push(node);
            }
            self.ahead += 1;
        }
        self.solve_wanted(body, 0)
    }

    fn solve_wanted(&mut self, body: &mut ElasticBody, step: u64) -> usize {
        let mut wanted = std::mem::take(&mut self.wanted);
        // What is next to each other in the order of elimination is solved together.
        wanted.sort_unstable_by_key(|&node| body.elimination_place(node));
        wanted.dedup();
        let size = wanted.iter().map(|&node| body.half_bytes(node)).sum();
        self.make_room(body, size, step);
        self.size += size;
        for &node in &wanted {
            self.slot_of[node as usize] = self.slots.len() as u32;
            self.slots.push(Slot { node, last_used: step });
            self.halves.push(self.spare.pop().unwrap_or_default());
        }
        let first = self.halves.len() - wanted.len();
        body.half_solve(&wanted, &mut self.halves[first..]);
        self.wanted = wanted;
        self.wanted.len()
    }

    /// Gives up half solutions, those unused for longest first, until one of `size` bytes has room or
    /// all that are left are used in this step.
    fn make_room(&mut self, body: &ElasticBody, size: usize, step: u64) {
        while self.size + size > self.limit {
            let slots = self.slots.iter().enumerate();
            let oldest = slots.min_by_key(|(_, slot)| (slot.last_used, slot.node));
            let Some((place, _)) = oldest.filter(|(_, slot)| slot.last_used != step) else {
                return;
            };
            let given_up = self.slots.swap_remove(place);
            self.spare.push(self.halves.swap_remove(place));
            self.size -= body.half_bytes(given_up.node);
            self.slot_of[given_up.node as usize] = NONE;
            if let Some(moved) = self.slots.get(place) {
                self.slot_of[moved.node as usize] = place as u32;
            }
        }
    }

    /// The half solution of a node, if it is known.
    pub(crate) fn half(&self, node: u32) -> Option<&HalfSolution> {
        self.halves.get(self.slot_of[node as usize] as usize)
    }
}
