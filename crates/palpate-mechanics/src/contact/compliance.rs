//! Displacements of a body's surface under unit forces on its nodes, in the body's frame.
//!
//! A column that was solved once serves every later step, until the body's matrix is made anew. Columns
//! are single precision: they shape the contact forces, whose response is solved in double precision.
//! The matrix is symmetric: of each column only the part from the node itself on is kept.

use palpate_model::Mesh;

use crate::body::ElasticBody;

/// Bytes of columns per body beyond which those of nodes without contact are given up.
const MEMORY_LIMIT: usize = 128 << 20;

const NONE: u32 = u32::MAX;

/// Compliance columns of one body.
#[derive(Debug, Default)]
pub(crate) struct ComplianceCache {
    /// Node -> place among the surface nodes.
    surface_index: Vec<u32>,
    surface_nodes: Vec<u32>,
    /// Node -> slot.
    slot_of: Vec<u32>,
    slots: Vec<Slot>,
    /// Bytes of all columns, and beyond which those of nodes without contact are given up.
    size: usize,
    limit: usize,
    /// Surface nodes before this one have been solved ahead.
    ahead: usize,
    version: u64,
}

#[derive(Clone, Debug)]
struct Slot {
    node: u32,
    last_used: u64,
    /// Entries of the surface nodes from the column's own on.
    column: Vec<[f32; 9]>,
}

impl ComplianceCache {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let surface_nodes = mesh.surface_nodes().to_vec();
        let mut surface_index = vec![NONE; mesh.nodes().len()];
        for (place, &node) in surface_nodes.iter().enumerate() {
            surface_index[node as usize] = place as u32;
        }
        let slot_of = vec![NONE; surface_index.len()];
        let limit = MEMORY_LIMIT;
        Self { surface_index, surface_nodes, slot_of, limit, ..Self::default() }
    }

    /// With another limit than the usual one.
    #[cfg(test)]
    pub(super) fn set_limit(&mut self, bytes: usize) {
        self.limit = bytes;
    }

    /// Gives up all columns: the matrix has changed.
    pub(crate) fn clear(&mut self) {
        self.slot_of.fill(NONE);
        self.slots.clear();
        (self.size, self.ahead) = (0, 0);
        self.version += 1;
    }

    /// Counts how often the columns were given up.
    pub(crate) fn version(&self) -> u64 {
        self.version
    }

    /// Makes the columns of `nodes` available; returns how many had to be solved.
    pub(crate) fn prepare(&mut self, body: &mut ElasticBody, nodes: &[u32], step: u64) -> usize {
        for &node in nodes {
            if let Some(slot) = self.slots.get_mut(self.slot_of[node as usize] as usize) {
                slot.last_used = step;
            }
        }
        let mut solved = 0;
        for &node in nodes {
            if self.slot_of[node as usize] == NONE && body.free_place(node).is_some() {
                self.make_room(self.column_size(node), step);
                self.solve(body, node, step);
                solved += 1;
            }
        }
        solved
    }

    /// Solves up to `count` columns that no step has asked for yet; returns how many that were, fewer
    /// only when the memory is full or every column is known.
    pub(crate) fn prepare_ahead(&mut self, body: &mut ElasticBody, count: usize) -> usize {
        let mut solved = 0;
        while solved < count && self.ahead < self.surface_nodes.len() {
            let node = self.surface_nodes[self.ahead];
            if self.slot_of[node as usize] == NONE && body.free_place(node).is_some() {
                if self.size + self.column_size(node) > self.limit {
                    break;
                }
                self.solve(body, node, 0);
                solved += 1;
            }
            self.ahead += 1;
        }
        solved
    }

    fn column_size(&self, node: u32) -> usize {
        size_of::<[f32; 9]>()
            * (self.surface_nodes.len() - self.surface_index[node as usize] as usize)
    }

    fn solve(&mut self, body: &mut ElasticBody, node: u32, step: u64) {
        body.solve_compliance(node);
        let others = &self.surface_nodes[self.surface_index[node as usize] as usize..];
        let entries = others.iter().map(|&other| {
            let place = body.free_place(other);
            place.map_or([0.0; 9], |place| body.compliance()[place].map(|x| x as f32))
        });
        let slot = Slot { node, last_used: step, column: entries.collect() };
        self.size += size_of_val(&*slot.column);
        self.slot_of[node as usize] = self.slots.len() as u32;
        self.slots.push(slot);
    }

    /// Gives up columns, those unused for longest first, until one of `size` bytes has room or all
    /// that are left are used in this step.
    fn make_room(&mut self, size: usize, step: u64) {
        while self.size + size > self.limit {
            let slots = self.slots.iter().enumerate();
            let oldest = slots.min_by_key(|(_, slot)| (slot.last_used, slot.node));
            let Some((place, _)) = oldest.filter(|(_, slot)| slot.last_used != step) else {
                return;
            };
            let given_up = self.slots.swap_remove(place);
            self.size -= size_of_val(&*given_up.column);
            self.slot_of[given_up.node as usize] = NONE;
            if let Some(moved) = self.slots.get(place) {
                self.slot_of[moved.node as usize] = place as u32;
            }
        }
    }

    /// Displacement of node `second` under unit forces on `first`, which must not be the larger one:
    /// entry `3 * axis + k` is along k under the force along axis [m/N]. `None` if the column is not
    /// known.
    pub(crate) fn entry(&self, first: u32, second: u32) -> Option<&[f32; 9]> {
        let [own, other] = [first, second].map(|node| self.surface_index[node as usize]);
        let slot = self.slots.get(self.slot_of[first as usize] as usize)?;
        Some(&slot.column[(other - own) as usize])
    }
}
