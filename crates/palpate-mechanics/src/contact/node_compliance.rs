//! The compliance between the contact nodes of one body, the products of their half solutions.

use palpate_solver::half_products_between;

use super::compliance::ComplianceCache;
use crate::body::ElasticBody;

const NONE: u32 = u32::MAX;
/// Vectors of f32 that any machine has divide this.
pub(super) const LANES: usize = 16;

/// Slots beyond those that are used, as a part of these, before they are given up.
const SPARE: f64 = 0.5;
/// New nodes whose products with all others are made together: their half solutions stay in the cache.
const TOGETHER: usize = 8;

/// Displacements of contact nodes under unit forces on contact nodes, in the body's frame. Nodes keep
/// their slots from step to step, so that only products with new ones are made.
#[derive(Debug, Default)]
pub(crate) struct NodeCompliance {
    /// That of the half solutions that were multiplied; `None` before there were any.
    version: Option<u64>,
    slot_of: Vec<u32>,
    /// Slot -> node; [`NONE`] where there is none.
    nodes: Vec<u32>,
    is_used: Vec<bool>,
    stride: usize,
    /// Slot k: nine stretches of `stride` entries; entry l of stretch `3 * axis + i` is the
    /// displacement along i of the node in slot l under a unit force along axis on that in slot k.
    values: Vec<f32>,
    /// Slots of new nodes, and which of them a slot is; others are old.
    new: Vec<u32>,
    rank: Vec<u32>,
    /// For some new nodes: what they have in common with others.
    lengths: [Vec<u32>; TOGETHER],
    /// Slots whose nodes are multiplied with these, and their branches.
    others: Vec<(u32, u32)>,
}

impl NodeCompliance {
    /// Takes in `nodes`, whose half solutions are prepared in `cache`.
    pub(crate) fn gather(&mut self, body: &ElasticBody, cache: &ComplianceCache, nodes: &[u32]) {
        self.slot_of.resize(body.masses().len(), NONE);
        let limit = nodes.len() + (SPARE * nodes.len() as f64) as usize;
        let outdated = self.version != Some(cache.version());
        self.version = Some(cache.version());
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
        self.new.clear();
        let mut next = 0;
        for &node in nodes {
            if self.slot_of[node as usize] == NONE {
                while self.is_used.get(next) == Some(&true) {
                    next += 1;
                }
                self.insert(node, next);
                next += 1;
            }
        }
        if !self.new.is_empty() {
            self.forget_unknown(cache);
            self.multiply(body, cache);
        }
    }

    /// Goes on with that of another body, in the same memory where it is not known yet.
    pub(super) fn change_body(&mut self, other: Self) {
        if other.version.is_some() {
            *self = other;
        } else {
            self.version = None;
            self.slot_of.clear();
            self.nodes.clear();
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
    fn insert(&mut self, node: u32, slot: usize) {
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
        self.new.push(slot as u32);
    }

    /// Empties slots that are not used and whose half solution was given up since.
    fn forget_unknown(&mut self, cache: &ComplianceCache) {
        for node in self.nodes.iter_mut().filter(|node| **node != NONE) {
            if cache.half(*node).is_none() {
                self.slot_of[*node as usize] = NONE;
                *node = NONE;
            }
        }
    }

    /// Fills in what new nodes do to all and all do to them.
    fn multiply(&mut self, body: &ElasticBody, cache: &ComplianceCache) {
        self.rank.clear();
        self.rank.resize(self.nodes.len(), 0);
        for (rank, &slot) in self.new.iter().enumerate() {
            self.rank[slot as usize] = rank as u32;
        }
        for (first, tile) in self.new.chunks(TOGETHER).enumerate() {
            let first = (first * TOGETHER) as u32;
            for (lengths, &slot) in self.lengths.iter_mut().zip(tile) {
                body.common_lengths(self.nodes[slot as usize], lengths);
            }
            self.others.clear();
            for (other, &node) in self.nodes.iter().enumerate().filter(|&(_, &node)| node != NONE) {
                // Those that are new later have their turn with this one then.
                if self.rank[other] < first + tile.len() as u32 {
                    self.others.push((other as u32, body.branch(node) as u32));
                }
            }
            let half = |slot: u32| cache.half(self.nodes[slot as usize]).expect("prepared");
            let mut loaded = [half(tile[0]); TOGETHER];
            for (loaded, &slot) in loaded.iter_mut().zip(tile) {
                *loaded = half(slot);
            }
            let (values, stride, lengths) = (&mut self.values, self.stride, &self.lengths);
            for others in self.others.chunks(TOGETHER) {
                let mut moved = loaded;
                for (moved, &(slot, _)) in moved.iter_mut().zip(others) {
                    *moved = half(slot);
                }
                let common =
                    |moved: usize, loaded: usize| lengths[loaded][others[moved].1 as usize];
                half_products_between(
                    &moved[..others.len()],
                    &loaded[..tile.len()],
                    common,
                    |moved, loaded, entries| {
                        let (moved, loaded) = (others[moved].0 as usize, tile[loaded] as usize);
                        for axis in 0..3 {
                            for k in 0..3 {
                                let entry = entries[3 * axis + k];
                                values[(loaded * 9 + 3 * axis + k) * stride + moved] = entry;
                                values[(moved * 9 + 3 * k + axis) * stride + loaded] = entry;
                            }
                        }
                    },
                );
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
        Self { slot_of: nodes.clone(), nodes, is_used, stride, values, ..Self::default() }
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

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::sync::Arc;

    use palpate_model::{Body, Mesh, MeshData};

    use super::*;
    use crate::body::{BodyKind, Known, MovingBody};

    /// Tetrahedra around a common edge.
    fn wheel(count: u32) -> MovingBody {
        let mut data = MeshData { nodes: vec![[0.0; 3], [0.0, 0.0, 0.02]], ..MeshData::default() };
        for rim in 0..count {
            let angle = TAU * f64::from(rim) / f64::from(count);
            data.nodes.push([0.03 * angle.cos(), 0.03 * angle.sin(), 0.01]);
            data.tetrahedra.push([0, 2 + rim, 2 + (rim + 1) % count, 1]);
        }
        let body = Body::new("wheel", Arc::new(Mesh::new(data).unwrap()));
        MovingBody::new(0, &body, [0.0; 3], 0.01, Known::default()).unwrap()
    }

    /// Gathers nodes that change from step to step and compares all entries with the columns of A⁻¹.
    fn assert_gathered(limit: usize) {
        let all: Vec<u32> = (0..42).collect();
        let mut body = wheel(40);
        body.compliance.set_limit(limit);
        let mut columns = Vec::new();
        let BodyKind::Elastic(elastic) = &mut body.kind else { unreachable!("not rigid") };
        for &node in &all {
            columns.push([0, 1, 2].map(|axis| elastic.column(node, axis)));
        }
        let size =
            columns.iter().flatten().flatten().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
        let mut kept = NodeCompliance::default();
        for step in 0..60_u32 {
            // Between 4 and 42 nodes, some of them new in every step.
            let (period, wanted) = (1 + step % 7, 1 + step / 20);
            let is_wanted = |node: &u32| (node + step / 3) % period < wanted;
            let nodes: Vec<u32> = all.iter().copied().filter(is_wanted).collect();
            body.prepare_compliance(&nodes, u64::from(step));
            kept.gather(body.elastic().unwrap(), &body.compliance, &nodes);
            for &loaded in &nodes {
                for &moved in &nodes {
                    let entry = kept.entry(kept.slot(moved), kept.slot(loaded));
                    let turned = kept.entry(kept.slot(loaded), kept.slot(moved));
                    for e in 0..9 {
                        let exact = columns[loaded as usize][e / 3][moved as usize][e % 3];
                        let error = (f64::from(entry[e]) - exact).abs();
                        assert!(error < 1e-5 * size, "step {step}: {moved} by {loaded}: {error}");
                        assert_eq!(entry[e], turned[3 * (e % 3) + e / 3]);
                    }
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
    fn half_solutions_that_are_given_up_and_come_back_leave_the_right_entries() {
        assert_gathered(20_000);
    }
}
