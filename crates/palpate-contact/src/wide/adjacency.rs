//! What the connectivity of a surface decides once and for all: which pairs of elements share a node.

use palpate_model::mesh::NONE;

use super::{Hierarchy, WIDTH};

/// Lane pairs (i, j), bit 8 i + j, with i < j.
pub(crate) const UPPER: u64 = {
    let (mut mask, mut i) = (0, 0);
    while i < 8 {
        mask |= (0xff_u64 << (i + 1) & 0xff) << (8 * i);
        i += 1;
    }
    mask
};

/// Pairs of blocks of one body that have a node in common: of one kind of elements with itself, or of
/// two kinds.
#[derive(Debug, Default)]
pub(crate) struct Adjacency {
    /// The pairs, sorted; of one kind with itself a <= b, each block with itself included.
    pub(crate) pairs: Vec<[u32; 2]>,
    /// Per pair: the lane pairs that share no node; within one block those with i < j.
    pub(crate) apart: Vec<u64>,
    /// Rows of `parents`, by block of level 1.
    parent_rows: Vec<u32>,
    /// Pairs of blocks of level 1 as (second block, child pairs that are in `pairs`).
    pub(super) parents: Vec<(u32, u64)>,
}

impl Adjacency {
    /// `same`: whether a and b are one and the same.
    pub(super) fn new(a: &Hierarchy, b: &Hierarchy, same: bool, node_count: usize) -> Self {
        let (node_rows, node_slots) = slots_of_nodes(&b.slots, node_count);
        let (blocks_a, _) = a.slots.as_chunks::<WIDTH>();
        let (blocks_b, _) = b.slots.as_chunks::<WIDTH>();
        let mut adjacency = Self::default();
        let mut row: Vec<(u32, u64)> = Vec::new();
        for (a, block) in blocks_a.iter().enumerate() {
            row.clear();
            for (i, slot) in block.iter().enumerate().filter(|(_, slot)| slot[3] != NONE) {
                for &node in &slot[..3] {
                    let [start, end] = [node_rows[node as usize], node_rows[node as usize + 1]];
                    for &other in &node_slots[start as usize..end as usize] {
                        let (b, j) = (other / WIDTH as u32, other as usize % WIDTH);
                        if !same || b as usize >= a {
                            set(&mut row, b, i * WIDTH + j);
                        }
                    }
                }
            }
            row.sort_unstable();
            for &(b, sharing) in &row {
                let mut apart = valid_lanes(block, &blocks_b[b as usize]) & !sharing;
                if same && b as usize == a {
                    apart &= UPPER;
                }
                adjacency.pairs.push([a as u32, b]);
                adjacency.apart.push(apart);
            }
        }
        adjacency.collect_parents(blocks_a.len());
        adjacency
    }

    fn collect_parents(&mut self, block_count: usize) {
        let mut row: Vec<(u32, u64)> = Vec::new();
        let mut next = 0;
        for parent in 0..block_count.div_ceil(WIDTH) {
            self.parent_rows.push(self.parents.len() as u32);
            row.clear();
            while let Some(&[a, b]) = self.pairs.get(next)
                && a as usize / WIDTH == parent
            {
                set(&mut row, b / WIDTH as u32, a as usize % WIDTH * WIDTH + b as usize % WIDTH);
                next += 1;
            }
            row.sort_unstable();
            self.parents.extend_from_slice(&row);
        }
        self.parent_rows.push(self.parents.len() as u32);
    }

    /// The child pairs of two blocks of level 1 that are in `pairs`.
    #[inline]
    pub(super) fn child_pairs(&self, [a, b]: [u32; 2]) -> u64 {
        let [start, end] = [self.parent_rows[a as usize], self.parent_rows[a as usize + 1]];
        let row = &self.parents[start as usize..end as usize];
        row.iter().find(|entry| entry.0 == b).map_or(0, |entry| entry.1)
    }
}

/// The set bits, ascending.
pub(crate) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

fn set(row: &mut Vec<(u32, u64)>, block: u32, bit: usize) {
    match row.iter_mut().find(|entry| entry.0 == block) {
        Some(entry) => entry.1 |= 1 << bit,
        None => row.push((block, 1 << bit)),
    }
}

fn valid_lanes(a: &[[u32; 4]; WIDTH], b: &[[u32; 4]; WIDTH]) -> u64 {
    let lanes = |block: &[[u32; 4]; WIDTH]| {
        (0..WIDTH).filter(|&i| block[i][3] != NONE).fold(0_u64, |lanes, i| lanes | 1 << i)
    };
    (0..WIDTH).filter(|i| lanes(a) >> i & 1 == 1).fold(0, |mask, i| mask | lanes(b) << (8 * i))
}

/// The slots that each node is a corner of, as rows of one array.
fn slots_of_nodes(slots: &[[u32; 4]], node_count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut rows = vec![0; node_count + 1];
    let real = || slots.iter().enumerate().filter(|(_, slot)| slot[3] != NONE);
    for (_, slot) in real() {
        for &node in &slot[..3] {
            rows[node as usize + 1] += 1;
        }
    }
    for node in 0..node_count {
        rows[node + 1] += rows[node];
    }
    let mut next = rows.clone();
    let mut result = vec![0; rows[node_count] as usize];
    for (index, slot) in real() {
        for &node in &slot[..3] {
            result[next[node as usize] as usize] = index as u32;
            next[node as usize] += 1;
        }
    }
    (rows, result)
}
