//! What a factor has in common with an older one.
//!
//! A supernode is that of an older factor when its nodes, its rows, its columns of the matrix and all the
//! supernodes below it are the same bit by bit: then its columns of the factor and what it leaves for
//! those above it are the same as well. Its columns are taken over. What it leaves is needed where the
//! one above it is not the same; it is kept in the upper part of the tree, and computed again from a
//! small subtree elsewhere. So the bits are those of a factor made from nothing, whatever went before.

use std::sync::Arc;

use super::packed::PackedFactor;
use super::stored::Stored;
use super::supernodes::Supernodes;
use super::tiles::Column;
use crate::block_matrix::{Block, BlockMatrix};
use crate::ordering::NONE;

#[cfg(test)]
mod tests;

/// Contributions are kept of the children of supernodes with more than one of so many parts of the whole
/// work below and in them.
const PARTS: f64 = 64.0;

/// What a supernode leaves for its parent, which two factors may share.
pub(super) type Contribution = Arc<Vec<Column>>;

/// What the next change needs of a factor.
pub(super) struct Kept {
    pub(super) matrix: BlockMatrix,
    /// By supernode.
    pub(super) contributions: Vec<Option<Contribution>>,
}

impl Kept {
    pub(super) fn bytes(&self) -> usize {
        let contributions =
            self.contributions.iter().flatten().map(|values| size_of_val(&***values));
        size_of_val(self.matrix.blocks()) + contributions.sum::<usize>()
    }
}

/// An older factor that a matrix has something in common with.
pub(super) struct Older<'a> {
    pub(super) supernodes: &'a Supernodes,
    pub(super) kept: &'a Kept,
}

impl Older<'_> {
    /// The supernode of the older factor that each one of `matrix` is the same as; [`NONE`] where it is
    /// none. `before[place]` is the place of a node in the older order; [`NONE`] if it is new.
    pub(super) fn twins(
        &self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        before: &[u32],
    ) -> Vec<u32> {
        let mut twins: Vec<u32> = Vec::with_capacity(supernodes.count());
        for s in 0..supernodes.count() {
            let place = before[supernodes.nodes(s).start];
            let twin = Some(place)
                .filter(|&place| place != NONE)
                .map(|place| self.supernodes.of_node(place as usize))
                .filter(|&twin| {
                    self.has_same_nodes(twin, supernodes, s, before)
                        && self.has_same_children(twin, supernodes.children(s), &twins)
                        && self.has_same_columns(twin, supernodes, matrix, s, before)
                });
            twins.push(twin.map_or(NONE, |twin| twin as u32));
        }
        twins
    }

    fn has_same_nodes(
        &self,
        twin: usize,
        supernodes: &Supernodes,
        s: usize,
        before: &[u32],
    ) -> bool {
        let (nodes, rows) = (supernodes.nodes(s), supernodes.rows(s));
        let were = |&row: &u32| before[row as usize];
        self.supernodes.nodes(twin).map(|place| place as u32).eq(before[nodes].iter().copied())
            && self.supernodes.rows(twin).iter().copied().eq(rows.iter().map(were))
    }

    fn has_same_children(&self, twin: usize, children: &[u32], twins: &[u32]) -> bool {
        let were = children.iter().map(|&child| twins[child as usize]);
        self.supernodes.children(twin).iter().copied().eq(were)
    }

    fn has_same_columns(
        &self,
        twin: usize,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        s: usize,
        before: &[u32],
    ) -> bool {
        let (old_blocks, blocks) = (self.kept.matrix.blocks(), matrix.blocks());
        self.supernodes.nodes(twin).zip(supernodes.nodes(s)).all(|(old, new)| {
            let (old, new) = (self.supernodes.entries(old), supernodes.entries(new));
            old.len() == new.len()
                && old.iter().zip(new).all(
                    |(&(old_row, old, was_turned), &(row, new, is_turned))| {
                        let (old, new) = (&old_blocks[old as usize], &blocks[new as usize]);
                        old_row == before[row as usize]
                            && if was_turned == is_turned {
                                has_same_bits(old, new)
                            } else {
                                let turned = |i: usize| std::array::from_fn(|k| new[k][i]);
                                has_same_bits(old, &std::array::from_fn(turned))
                            }
                    },
                )
        })
    }
}

fn has_same_bits(a: &Block, b: &Block) -> bool {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.fold(0, |difference, (a, b)| difference | (a.to_bits() ^ b.to_bits())) == 0
}

/// What a factorisation takes over and what it keeps, by supernode.
pub(super) struct Plan<'a, P> {
    /// The panels of its pieces, if they are known.
    pub(super) known: Vec<Option<&'a [P]>>,
    pub(super) is_computed: Vec<bool>,
    pub(super) is_kept: Vec<bool>,
    /// Known to begin with, and those that are kept.
    pub(super) contributions: Vec<Option<Contribution>>,
}

impl<'a, P: Stored> Plan<'a, P> {
    /// Everything is computed and nothing is kept.
    pub(super) fn whole(supernodes: &Supernodes) -> Self {
        let count = supernodes.count();
        Self {
            known: vec![None; count],
            is_computed: vec![true; count],
            is_kept: vec![false; count],
            contributions: vec![None; count],
        }
    }

    /// Everything is computed, and what the next change needs is kept.
    pub(super) fn keeping(supernodes: &Supernodes) -> Self {
        Self { is_kept: kept(supernodes), ..Self::whole(supernodes) }
    }

    /// What `twins` does not name is computed.
    pub(super) fn changing(
        supernodes: &Supernodes,
        twins: &[u32],
        older: &Older,
        factor: &'a PackedFactor<P>,
    ) -> Self {
        let mut plan = Self::keeping(supernodes);
        for (s, &twin) in twins.iter().enumerate().filter(|&(_, &twin)| twin != NONE) {
            plan.known[s] = Some(factor.panels_of(older.supernodes.pieces(twin as usize)));
            plan.contributions[s].clone_from(&older.kept.contributions[twin as usize]);
        }
        for s in (0..supernodes.count()).rev() {
            let is_needed = supernodes.parent(s).is_some_and(|parent| plan.is_computed[parent]);
            plan.is_computed[s] =
                plan.known[s].is_none() || is_needed && plan.contributions[s].is_none();
        }
        plan
    }

    pub(super) fn computed_count(&self) -> usize {
        self.is_computed.iter().filter(|&&is_computed| is_computed).count()
    }

    /// The contributions that are kept for the next change.
    pub(super) fn into_kept(self) -> Vec<Option<Contribution>> {
        let contributions = self.contributions.into_iter().zip(self.is_kept);
        contributions.map(|(contribution, is_kept)| contribution.filter(|_| is_kept)).collect()
    }
}

/// The supernodes whose contributions are kept.
fn kept(supernodes: &Supernodes) -> Vec<bool> {
    let mut work: Vec<f64> = (0..supernodes.count()).map(|s| supernodes.flops(s)).collect();
    let total: f64 = work.iter().sum();
    for s in 0..work.len() {
        if let Some(parent) = supernodes.parent(s) {
            work[parent] += work[s];
        }
    }
    let is_upper = |parent: usize| PARTS * work[parent] > total;
    (0..work.len()).map(|s| supernodes.parent(s).is_some_and(is_upper)).collect()
}
