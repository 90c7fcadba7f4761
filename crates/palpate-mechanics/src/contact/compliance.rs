//! Displacements of a body's surface under unit forces on its nodes, in the body's frame.
//!
//! The body's matrix never changes, so a column that was solved once serves every later step. Columns
//! are single precision: they shape the contact forces, whose response is solved in double precision.

use palpate_model::Mesh;

use crate::body::ElasticBody;

/// Columns of nodes without contact are given up beyond this many bytes per body.
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
    values: Vec<[f32; 9]>,
    capacity: usize,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    node: u32,
    last_used: u64,
}

impl ComplianceCache {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let surface_nodes = mesh.surface_nodes().to_vec();
        let mut surface_index = vec![NONE; mesh.nodes().len()];
        for (place, &node) in surface_nodes.iter().enumerate() {
            surface_index[node as usize] = place as u32;
        }
        let column = size_of::<[f32; 9]>() * surface_nodes.len().max(1);
        Self {
            slot_of: vec![NONE; surface_index.len()],
            surface_index,
            surface_nodes,
            capacity: (MEMORY_LIMIT / column).max(1),
            ..Self::default()
        }
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
            if self.slot_of[node as usize] != NONE || body.free_place(node).is_none() {
                continue;
            }
            let slot = self.vacant_slot(step);
            self.slots[slot] = Slot { node, last_used: step };
            self.slot_of[node as usize] = slot as u32;
            solved += 1;
            self.solve(body, node, slot);
        }
        solved
    }

    fn solve(&mut self, body: &mut ElasticBody, node: u32, slot: usize) {
        let count = self.surface_nodes.len();
        body.solve_compliance(node);
        let values = &mut self.values[slot * count..(slot + 1) * count];
        for (value, &other) in values.iter_mut().zip(&self.surface_nodes) {
            *value = body
                .free_place(other)
                .map_or([0.0; 9], |place| body.compliance()[place].map(|x| x as f32));
        }
    }

    /// A slot to fill: a new one while there is memory, else the one unused for longest.
    fn vacant_slot(&mut self, step: u64) -> usize {
        if self.slots.len() >= self.capacity {
            let oldest = self.slots.iter().enumerate().min_by_key(|(_, s)| (s.last_used, s.node));
            if let Some((slot, &Slot { node, last_used })) = oldest
                && last_used != step
            {
                self.slot_of[node as usize] = NONE;
                return slot;
            }
        }
        self.slots.push(Slot { node: NONE, last_used: 0 });
        self.values.resize(self.slots.len() * self.surface_nodes.len(), [0.0; 9]);
        self.slots.len() - 1
    }

    /// The prepared column of `node`, to be read at [`ComplianceCache::place`]; `None` when fixed.
    pub(crate) fn column(&self, node: u32) -> Option<&[[f32; 9]]> {
        let count = self.surface_nodes.len();
        let slot = self.slot_of[node as usize];
        (slot != NONE).then(|| &self.values[slot as usize * count..(slot as usize + 1) * count])
    }

    /// Where a surface node stands in a column.
    pub(crate) fn place(&self, node: u32) -> u32 {
        self.surface_index[node as usize]
    }
}
