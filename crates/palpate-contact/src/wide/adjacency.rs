//! What the connectivity of a surface decides once and for all: which pairs of triangles share a node, and
//! which features of such a pair do not.

use palpate_model::mesh::NONE;

use super::WIDTH;

/// Lane pairs (i, j), bit 8 i + j, with i < j.
pub(crate) const UPPER: u64 = {
    let (mut mask, mut i) = (0, 0);
    while i < 8 {
        mask |= (0xff_u64 << (i + 1) & 0xff) << (8 * i);
        i += 1;
    }
    mask
};

/// Pairs of blocks of one body that have a node in common, a block with itself included.
#[derive(Debug, Default)]
pub(crate) struct Adjacency {
    /// The pairs (a <= b), sorted.
    pub(crate) pairs: Vec<[u32; 2]>,
    /// Per pair: the lane pairs that share no node; within one block those with i < j.
    pub(crate) apart: Vec<u64>,
    /// Per pair: the lane pairs that share a node, each unordered pair once.
    pub(crate) sharing: Vec<u64>,
    /// Per pair: where its lane pairs that share a node start in `features`.
    pub(crate) first_feature: Vec<u32>,
    /// Per lane pair that shares a node, in the order of the bits: the pairs of owned features that
    /// share none. Bit i: node i of the first against the second; bit 3 + i: node i of the second
    /// against the first; bit 6 + 3 i + j: edge i of the first and edge j of the second.
    pub(crate) features: Vec<u16>,
    /// Rows of `parents`, by block of level 1.
    parent_rows: Vec<u32>,
    /// Pairs of blocks of level 1 as (second block, child pairs that are in `pairs`).
    parents: Vec<(u32, u64)>,
}

impl Adjacency {
    pub(super) fn new(slots: &[[u32; 4]], owned: &[u8], node_count: usize) -> Self {
        let (node_rows, node_slots) = slots_of_nodes(slots, node_count);
        let (blocks, _) = slots.as_chunks::<WIDTH>();
        let mut adjacency = Self::default();
        let mut row: Vec<(u32, u64)> = Vec::new();
        for (a, block) in blocks.iter().enumerate() {
            row.clear();
            row.push((a as u32, 0));
            for (i, slot) in block.iter().enumerate().filter(|(_, slot)| slot[3] != NONE) {
                for &node in &slot[..3] {
                    let [start, end] = [node_rows[node as usize], node_rows[node as usize + 1]];
                    for &other in &node_slots[start as usize..end as usize] {
                        let (b, j) = (other / WIDTH as u32, other as usize % WIDTH);
                        if b as usize >= a {
                            set(&mut row, b, i * WIDTH + j);
                        }
                    }
                }
            }
            row.sort_unstable();
            for &(b, mut sharing) in &row {
                let mut all = valid_lanes(block, &blocks[b as usize]);
                if b as usize == a {
                    all &= UPPER;
                    sharing &= UPPER;
                }
                adjacency.pairs.push([a as u32, b]);
                adjacency.apart.push(all & !sharing);
                adjacency.sharing.push(sharing);
                adjacency.first_feature.push(adjacency.features.len() as u32);
                for bit in bits(sharing) {
                    let pair = [a * WIDTH + bit / WIDTH, b as usize * WIDTH + bit % WIDTH];
                    adjacency.features.push(free_features(
                        pair.map(|slot| slots[slot]),
                        pair.map(|slot| owned[slot]),
                    ));
                }
            }
        }
        adjacency.collect_parents(blocks.len());
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

/// The pairs of owned features of two triangles, one of each, that have no node in common.
fn free_features([a, b]: [[u32; 4]; 2], [owned_a, owned_b]: [u8; 2]) -> u16 {
    let mut free = owned_pairs(owned_a, owned_b);
    let (a, b) = (&a[..3], &b[..3]);
    for i in 0..3 {
        if b.contains(&a[i]) {
            free &= !(1 << i);
        }
        if a.contains(&b[i]) {
            free &= !(8 << i);
        }
        for j in 0..3 {
            let edge = [b[j], b[(j + 1) % 3]];
            if edge.contains(&a[i]) || edge.contains(&a[(i + 1) % 3]) {
                free &= !(1 << (6 + 3 * i + j));
            }
        }
    }
    free
}

/// All pairs of owned features of two triangles, as bits of [`Adjacency::features`].
#[inline]
pub(crate) fn owned_pairs(owned_a: u8, owned_b: u8) -> u16 {
    let (a, b) = (u16::from(owned_a), u16::from(owned_b));
    let rows = [3, 4, 5].map(|bit| (a >> bit & 1) * (b >> 3));
    let edges = rows[0] | rows[1] << 3 | rows[2] << 6;
    a & 7 | (b & 7) << 3 | edges << 6
}
