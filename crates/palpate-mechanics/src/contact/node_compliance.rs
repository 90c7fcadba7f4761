//! The compliance between the contact nodes of one body, gathered from its columns.

use super::compliance::ComplianceCache;

const NONE: u32 = u32::MAX;
/// Vectors of f32 that any machine has divide this.
pub(super) const LANES: usize = 16;

/// Displacements of contact nodes under unit forces on contact nodes, in the body's frame. Nodes keep
/// their slots from step to step, so that only new ones are gathered.
#[derive(Debug, Default)]
pub(super) struct NodeCompliance {
    slot_of: Vec<u32>,
    /// Slot -> node.
    nodes: Vec<u32>,
    stride: usize,
    /// Slot k: nine stretches of `stride` entries; entry l of stretch `3 * axis + i` is the
    /// displacement along i of the node in slot l under a unit force along axis on that in slot k.
    values: Vec<f32>,
}

impl NodeCompliance {
    /// Makes room for `nodes`, whose columns are prepared in `cache`.
    pub(super) fn gather(&mut self, cache: &ComplianceCache, node_count: usize, nodes: &[u32]) {
        self.slot_of.resize(node_count, NONE);
        let new = nodes.iter().filter(|&&node| self.slot_of[node as usize] == NONE).count();
        if new == 0 {
            return;
        }
        let known = self.nodes.iter().all(|&node| cache.column(node).is_some());
        if self.nodes.len() + new > self.stride || !known {
            for &node in &self.nodes {
                self.slot_of[node as usize] = NONE;
            }
            self.nodes.clear();
            if nodes.len() > self.stride {
                self.stride = (nodes.len() + nodes.len() / 2).next_multiple_of(LANES);
                self.values.resize(9 * self.stride * self.stride, 0.0);
            }
        }
        for &node in nodes {
            if self.slot_of[node as usize] == NONE {
                self.insert(cache, node);
            }
        }
    }

    /// The column of the smaller node serves both directions: what was gathered first makes no
    /// difference then.
    fn insert(&mut self, cache: &ComplianceCache, node: u32) {
        let (slot, stride) = (self.nodes.len(), self.stride);
        self.slot_of[node as usize] = slot as u32;
        self.nodes.push(node);
        let own = cache.column(node).expect("prepared column");
        for (other_slot, &other) in self.nodes.iter().enumerate() {
            let entries = if node <= other {
                own[cache.place(other) as usize]
            } else {
                transposed(&cache.column(other).expect("known column")[cache.place(node) as usize])
            };
            let turned = transposed(&entries);
            for e in 0..9 {
                self.values[(slot * 9 + e) * stride + other_slot] = entries[e];
                self.values[(other_slot * 9 + e) * stride + slot] = turned[e];
            }
        }
    }

    /// Nodes 0, 1, ... with given responses to each other: `entry(moved, loaded)`.
    #[cfg(test)]
    pub(super) fn with_entries(count: usize, entry: impl Fn(usize, usize) -> [f32; 9]) -> Self {
        let stride = count.next_multiple_of(LANES);
        let nodes: Vec<u32> = (0..count as u32).collect();
        let mut values = vec![0.0; 9 * stride * count];
        for loaded in 0..count {
            for moved in 0..count {
                for (e, value) in entry(moved, loaded).into_iter().enumerate() {
                    values[(loaded * 9 + e) * stride + moved] = value;
                }
            }
        }
        Self { slot_of: nodes.clone(), nodes, stride, values }
    }

    /// Slot of a node that was gathered.
    pub(super) fn slot(&self, node: u32) -> usize {
        self.slot_of[node as usize] as usize
    }

    /// Displacements of all slots under unit forces on the node in `slot`: nine stretches.
    pub(super) fn column(&self, slot: usize) -> &[f32] {
        &self.values[slot * 9 * self.stride..][..9 * self.stride]
    }

    /// Response of the node in one slot to unit forces on that in another, axis after axis.
    pub(super) fn entry(&self, moved: usize, loaded: usize) -> [f32; 9] {
        let column = self.column(loaded);
        std::array::from_fn(|e| column[e * self.stride + moved])
    }

    /// Length of a stretch.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }
}

fn transposed(entries: &[f32; 9]) -> [f32; 9] {
    std::array::from_fn(|e| entries[3 * (e % 3) + e / 3])
}
