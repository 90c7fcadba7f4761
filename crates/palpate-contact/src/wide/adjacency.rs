//! What the connectivity of a surface decides once and for all: which pairs of elements share a node.

use std::ops::Range;

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

/// In [`Adjacency::seconds`]: the first pair of a block of a.
const NEW_ROW: u32 = 1 << 31;

/// After so many pairs the rows so far are written down.
const STRIDE: usize = 64;

/// Pairs of blocks of one body that have a node in common: of one kind of elements with itself, or of
/// two kinds.
///
/// The pairs stand in the order of a, and every block of a occurs; of one kind with itself a <= b, each
/// block with itself included.
#[derive(Debug, Default)]
pub(crate) struct Adjacency {
    /// Per pair: the second block, and [`NEW_ROW`].
    seconds: Vec<u32>,
    /// Blocks of a that occur before every [`STRIDE`] pairs.
    rows: Vec<u32>,
    /// Per pair: the lane pairs that share no node; within one block those with i < j.
    pub(super) apart: Vec<u64>,
    /// Rows of the two below, by block of level 1.
    parent_rows: Vec<u32>,
    /// Per pair of blocks of level 1: the second, and the child pairs that are neighbours.
    parents: Vec<u32>,
    child_pairs: Vec<u64>,
}

impl Adjacency {
    /// `same`: whether a and b are one and the same.
    pub(super) fn new<const A: usize, const B: usize>(
        (a, of_a): (&Hierarchy<A>, &Incidence),
        (b, of_b): (&Hierarchy<B>, &Incidence),
        same: bool,
    ) -> Self {
        let mut adjacency = Self::default();
        // About what surfaces need.
        let expected = 6 * a.boxes.level(0).len();
        adjacency.seconds.reserve(expected);
        adjacency.apart.reserve(expected);
        let mut row = Row::new(b.boxes.level(0).len());
        let mut parents = Row::new(b.boxes.level(1).len());
        // The last block that a node was seen in, plus one.
        let mut seen = vec![0; of_a.rows.len()];
        let (blocks, _) = a.corners.as_chunks::<WIDTH>();
        for (first, corners) in blocks.iter().enumerate() {
            for &node in corners.as_flattened() {
                let last = std::mem::replace(&mut seen[node as usize], first as u32 + 1);
                if last == first as u32 + 1 {
                    continue;
                }
                let lanes_a = of_a.lanes(node, first as u32);
                for &(second, lanes_b) in of_b.blocks(node) {
                    if !same || second >= first as u32 {
                        row.add(second, products(lanes_a, lanes_b));
                    }
                }
            }
            for (i, &(second, sharing)) in row.entries().iter().enumerate() {
                let mut apart = products(a.lanes(first), b.lanes(second as usize)) & !sharing;
                if same && second as usize == first {
                    apart &= UPPER;
                }
                if adjacency.seconds.len().is_multiple_of(STRIDE) {
                    adjacency.rows.push(first as u32 + u32::from(i > 0));
                }
                adjacency.seconds.push(second | if i == 0 { NEW_ROW } else { 0 });
                adjacency.apart.push(apart);
                let bit = first % WIDTH * WIDTH + second as usize % WIDTH;
                parents.add(second / WIDTH as u32, 1 << bit);
            }
            row.count = 0;
            if first % WIDTH == WIDTH - 1 || first + 1 == blocks.len() {
                adjacency.push_parents(&mut parents);
            }
        }
        adjacency.parent_rows.push(adjacency.parents.len() as u32);
        adjacency.seconds.shrink_to_fit();
        adjacency.apart.shrink_to_fit();
        adjacency
    }

    fn push_parents(&mut self, row: &mut Row) {
        self.parent_rows.push(self.parents.len() as u32);
        self.parents.extend(row.entries().iter().map(|entry| entry.0));
        self.child_pairs.extend(row.entries().iter().map(|entry| entry.1));
        row.count = 0;
    }

    /// Number of pairs.
    pub(super) fn len(&self) -> usize {
        self.seconds.len()
    }

    /// Some of the pairs.
    pub(super) fn pairs(&self, range: Range<usize>) -> impl Iterator<Item = [u32; 2]> {
        let Seconds { mut rows, seconds } = self.seconds(range);
        seconds.iter().map(move |&second| {
            rows += second >> 31;
            [rows - 1, second & !NEW_ROW]
        })
    }

    /// Some of the pairs as they are stored.
    pub(super) fn seconds(&self, range: Range<usize>) -> Seconds<'_> {
        let stride = range.start / STRIDE;
        let written = self.rows.get(stride).copied().unwrap_or_default();
        let since = &self.seconds[stride * STRIDE..range.start];
        let rows = since.iter().fold(written, |rows, second| rows + (second >> 31));
        Seconds { rows, seconds: &self.seconds[range] }
    }

    /// The child pairs of two blocks of level 1 that are in `pairs`.
    #[inline]
    pub(super) fn child_pairs(&self, [a, b]: [u32; 2]) -> u64 {
        let [start, end] = [self.parent_rows[a as usize], self.parent_rows[a as usize + 1]];
        let range = start as usize..end as usize;
        let found = self.parents[range].iter().position(|&parent| parent == b);
        found.map_or(0, |index| self.child_pairs[start as usize + index])
    }

    /// Memory in bytes.
    pub(super) fn bytes(&self) -> usize {
        let Self { seconds, rows, apart, parent_rows, parents, child_pairs } = self;
        let indices = [seconds, rows, parent_rows, parents].map(|v| size_of_val(v.as_slice()));
        let masks = [apart, child_pairs].map(|v| size_of_val(v.as_slice()));
        indices.iter().chain(&masks).sum()
    }
}

/// Pairs of blocks, as [`Adjacency`] stores them.
#[derive(Clone, Copy)]
pub(super) struct Seconds<'a> {
    /// Blocks of a that occur before.
    rows: u32,
    seconds: &'a [u32],
}

impl Seconds<'_> {
    pub(super) fn len(&self) -> usize {
        self.seconds.len()
    }

    /// The pair at `index`, and where the next is to begin: for plain loops from zero on.
    #[inline(always)]
    pub(super) fn next(&self, index: usize, rows: &mut u32) -> [u32; 2] {
        let second = self.seconds[index];
        *rows += second >> 31;
        [*rows - 1, second & !NEW_ROW]
    }

    pub(super) fn rows(&self) -> u32 {
        self.rows
    }
}

/// The blocks that each node is a corner in.
#[derive(Debug)]
pub(super) struct Incidence {
    /// Where a node's blocks begin, room for as many as it has elements, and where they end.
    rows: Vec<[u32; 2]>,
    /// The block, and in which lanes the node is.
    blocks: Vec<(u32, u8)>,
}

impl Incidence {
    pub(super) fn new<const N: usize>(elements: &Hierarchy<N>, node_count: usize) -> Self {
        let corners = &elements.corners[..elements.count];
        let mut rows = vec![[0; 2]; node_count];
        for &node in corners.as_flattened() {
            rows[node as usize][1] += 1;
        }
        // From one on: before a node's first block stands one that is none of its.
        let mut total = 1;
        for row in &mut rows {
            let count = row[1];
            *row = [total; 2];
            total += count;
        }
        let mut blocks = vec![(u32::MAX, 0); total as usize];
        for (slot, corners) in corners.iter().enumerate() {
            let (block, lane) = ((slot / WIDTH) as u32, slot % WIDTH);
            for &node in corners {
                let [start, end] = &mut rows[node as usize];
                let (last, lanes) = blocks[*end as usize - 1];
                // Without branches: whether a block is new cannot be foreseen.
                let new = last != block || start == end;
                *end += u32::from(new);
                blocks[*end as usize - 1] = (block, if new { 0 } else { lanes } | 1 << lane);
            }
        }
        Self { rows, blocks }
    }

    fn blocks(&self, node: u32) -> &[(u32, u8)] {
        let [start, end] = self.rows[node as usize];
        &self.blocks[start as usize..end as usize]
    }

    fn lanes(&self, node: u32, block: u32) -> u8 {
        let found = self.blocks(node).iter().find(|entry| entry.0 == block);
        found.map_or(0, |entry| entry.1)
    }
}

/// Masks by block, of few of all blocks.
struct Row {
    /// Room for one of each block and one more.
    entries: Vec<(u32, u64)>,
    count: usize,
    /// Per block where its entry is, if that one is its.
    places: Vec<u32>,
}

impl Row {
    fn new(block_count: usize) -> Self {
        Self { entries: vec![(0, 0); block_count + 1], count: 0, places: vec![0; block_count] }
    }

    /// Without branches: whether a block is known cannot be foreseen.
    fn add(&mut self, block: u32, mask: u64) {
        let place = self.places[block as usize];
        let (other, former) = self.entries[place as usize];
        let known = other == block && (place as usize) < self.count;
        let place = if known { place } else { self.count as u32 };
        self.places[block as usize] = place;
        self.entries[place as usize] = (block, if known { former } else { 0 } | mask);
        self.count += usize::from(!known);
    }

    fn entries(&self) -> &[(u32, u64)] {
        &self.entries[..self.count]
    }
}

/// Lane pairs (i, j) of lanes i and lanes j.
fn products(lanes_a: u8, lanes_b: u8) -> u64 {
    SPREAD[lanes_a as usize] * u64::from(lanes_b)
}

/// Bit i of the index at 8 i.
static SPREAD: [u64; 256] = {
    let mut spread = [0; 256];
    let mut lanes = 0;
    while lanes < 256 {
        let mut lane = 0;
        while lane < 8 {
            spread[lanes] |= (lanes as u64 >> lane & 1) << (8 * lane);
            lane += 1;
        }
        lanes += 1;
    }
    spread
};

/// The set bits, ascending.
pub(crate) fn bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}
