//! The compliance between the contact nodes of one body, gathered from its columns.

use super::compliance::ComplianceCache;

const NONE: u32 = u32::MAX;
/// Vectors of f32 that any machine has divide this.
pub(super) const LANES: usize = 16;

/// Slots beyond those that are used, as a part of these, before they are given up.
const SPARE: f64 = 0.5;

/// Displacements of contact nodes under unit forces on contact nodes, in the body's frame. Nodes keep
/// their slots from step to step, so that only new ones are gathered.
#[derive(Debug, Default)]
pub(super) struct NodeCompliance {
    /// That of the columns that were gathered.
    version: u64,
    slot_of: Vec<u32>,
    /// Slot -> node; [`NONE`] where there is none.
    nodes: Vec<u32>,
    is_used: Vec<bool>,
    stride: usize,
    /// Slot k: nine stretches of `stride` entries; entry l of stretch `3 * axis + i` is the
    /// displacement along i of the node in slot l under a unit force along axis on that in slot k.
    values: Vec<f32>,
}

impl NodeCompliance {
    /// Makes room for `nodes`, whose columns are prepared in `cache`.
    pub(super) fn gather(&mut self, cache: &ComplianceCache, node_count: usize, nodes: &[u32]) {
        self.slot_of.resize(node_count, NONE);
        let limit = nodes.len() + (SPARE * nodes.len() as f64) as usize;
        let outdated = self.version != cache.version();
        self.version = cache.version();
        if outdated || nodes.len() > self.stride || self.stride > limit.next_multiple_of(LANES) {
            self.resize(nodes.len());
        }
        self.is_used.clear();
        self.is_used.resize(self.nodes.len(), false);
        for &node in nodes {
            if let Some(used) = self.is_used.get_mut(self.slot_of[node as usize] as usize) {
                *used = true;
            }
        }
        let mut next = 0;
        for &node in nodes {
            if self.slot_of[node as usize] == NONE {
                while self.is_used.get(next) == Some(&true) {
                    next += 1;
                }
                self.insert(cache, node, next);
                next += 1;
            }
        }
    }

    /// Gives up all slots and makes room for `count` and a few more.
    fn resize(&mut self, count: usize) {
        for &node in self.nodes.iter().filter(|&&node| node != NONE) {
            self.slot_of[node as usize] = NONE;
        }
        self.nodes.clear();
        self.stride = (count + count / 8).next_multiple_of(LANES);
        self.values.clear();
        self.values.resize(9 * self.stride * self.stride, 0.0);
    }

    /// Gives a slot that is not used, or the first one beyond them, to a node.
    ///
    /// The column of the smaller node serves both directions.
    fn insert(&mut self, cache: &ComplianceCache, node: u32, slot: usize) {
        if slot == self.nodes.len() {
            self.nodes.push(node);
            self.is_used.push(true);
        } else {
            let old = std::mem::replace(&mut self.nodes[slot], node);
            if old != NONE {
                self.slot_of[old as usize] = NONE;
            }
            self.is_used[slot] = true;
        }
        self.slot_of[node as usize] = slot as u32;
        let stride = self.stride;
        for other_slot in 0..self.nodes.len() {
            let other = self.nodes[other_slot];
            if other == NONE {
                continue;
            }
            let Some(entries) = cache.entry(node.min(other), node.max(other)) else {
                // The other is not used, and its column was given up since.
                self.slot_of[other as usize] = NONE;
                self.nodes[other_slot] = NONE;
                continue;
            };
            let entries = if node <= other { *entries } else { transposed(entries) };
            let turned = transposed(&entries);
            for e in 0..9 {
                self.values[(other_slot * 9 + e) * stride + slot] = turned[e];
                self.values[(slot * 9 + e) * stride + other_slot] = entries[e];
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
        let is_used = vec![true; count];
        Self { version: 0, slot_of: nodes.clone(), nodes, is_used, stride, values }
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::sync::Arc;

    use palpate_model::{Body, Mesh, MeshData};

    use super::*;
    use crate::body::MovingBody;

    /// Tetrahedra around a common edge.
    fn wheel(count: u32) -> MovingBody {
        let mut data = MeshData { nodes: vec![[0.0; 3], [0.0, 0.0, 0.02]], ..MeshData::default() };
        for rim in 0..count {
            let angle = TAU * f64::from(rim) / f64::from(count);
            data.nodes.push([0.03 * angle.cos(), 0.03 * angle.sin(), 0.01]);
            data.tetrahedra.push([0, 2 + rim, 2 + (rim + 1) % count, 1]);
        }
        let body = Body::new("wheel", Arc::new(Mesh::new(data).unwrap()));
        MovingBody::new(0, &body, [0.0; 3], 0.01).unwrap()
    }

    /// Gathers nodes that change from step to step and compares all entries with the columns of a
    /// cache that knows all of them.
    fn assert_gathered(limit: usize) {
        let all: Vec<u32> = (0..42).collect();
        let mut known = wheel(40);
        known.prepare_compliance(&all, 0);
        let mut body = wheel(40);
        body.compliance.set_limit(limit);
        let mut kept = NodeCompliance::default();
        for step in 0..60_u32 {
            // Between 4 and 42 nodes, some of them new in every step.
            let (period, wanted) = (1 + step % 7, 1 + step / 20);
            let is_wanted = |node: &u32| (node + step / 3) % period < wanted;
            let nodes: Vec<u32> = all.iter().copied().filter(is_wanted).collect();
            body.prepare_compliance(&nodes, u64::from(step));
            kept.gather(&body.compliance, 42, &nodes);
            for &loaded in &nodes {
                for &moved in &nodes {
                    let (first, second) = (loaded.min(moved), loaded.max(moved));
                    let exact = *known.compliance.entry(first, second).unwrap();
                    let exact = if loaded <= moved { exact } else { transposed(&exact) };
                    let entry = kept.entry(kept.slot(moved), kept.slot(loaded));
                    assert_eq!(entry, exact, "step {step}: {moved} by {loaded}");
                }
            }
            assert!(kept.stride() <= 2 * nodes.len().next_multiple_of(LANES));
        }
    }

    #[test]
    fn slots_that_stay_and_change_hands_hold_the_right_entries() {
        assert_gathered(usize::MAX);
    }

    #[test]
    fn columns_that_are_given_up_and_come_back_leave_the_right_entries() {
        assert_gathered(10_000);
    }
}
