//! Runs of consecutive nodes in the order of elimination that are eliminated together.

use crate::NodeOrder;
use crate::ordering::NONE;
use crate::{BlockMatrix, BlockPattern};

/// Merge supernodes of up to so many columns while so small a part of the merged one is zero.
const RELAXATION: [(u64, f64); 4] = [(12, 1.0), (32, 0.5), (64, 0.2), (u64::MAX, 0.05)];

/// Nodes of a piece: whole tiles of a front.
const PIECE: usize = 32;

/// The supernodes of a pattern in an order, children before parents; nodes by their place in the order.
#[derive(Debug, Default)]
pub(super) struct Supernodes {
    /// First node of each, and the number of nodes.
    begins: Vec<u32>,
    /// First piece of each, and the number of pieces: a supernode is eliminated as a whole, but wide ones
    /// are solved in pieces, as the inverse of a triangle costs the cube of its width.
    piece_starts: Vec<u32>,
    /// Where the rows of each begin.
    row_starts: Vec<u32>,
    /// Nodes below the diagonal block that its columns have entries in, ascending.
    rows: Vec<u32>,
    /// Children of each, ascending.
    child_starts: Vec<u32>,
    children: Vec<u32>,
    /// Supernode of each node, and the one above each supernode; [`NONE`] at a root.
    of_node: Vec<u32>,
    parents: Vec<u32>,
    /// Supernodes above each.
    generations: Vec<u32>,
    /// Blocks of the matrix by their column, rows ascending: row, stored block, whether it is used
    /// transposed.
    block_starts: Vec<u32>,
    blocks: Vec<(u32, u32, bool)>,
}

/// A supernode that may yet be merged with its parent.
#[derive(Clone, Copy)]
struct Run {
    begin: u32,
    end: u32,
    /// Rows below, and zeros among the entries; of scalars.
    below: u64,
    zeros: u64,
}

impl Run {
    fn width(self) -> u64 {
        3 * u64::from(self.end - self.begin)
    }

    /// With the parent that follows it, if not too much of that is zero.
    fn merged(self, parent: Self) -> Option<Self> {
        let width = self.width() + parent.width();
        let new_zeros = (parent.width() + parent.below - self.below) * self.width();
        let zeros = self.zeros + parent.zeros + new_zeros;
        let entries = width * (width + 1) / 2 + parent.below * width;
        let is_good =
            |&(most, part): &(u64, f64)| width <= most && zeros as f64 <= part * entries as f64;
        let merged = Self { begin: self.begin, zeros, ..parent };
        (new_zeros == 0 || RELAXATION.iter().any(is_good)).then_some(merged)
    }
}

impl Supernodes {
    pub(super) fn new(pattern: &BlockPattern, order: &NodeOrder, places: &[u32]) -> Self {
        let mut result = Self { begins: runs(order), ..Self::default() };
        let mut pieces = 0;
        result.piece_starts.push(0);
        for s in 0..result.count() {
            pieces += result.nodes(s).len().div_ceil(PIECE) as u32;
            result.piece_starts.push(pieces);
        }
        result.take_blocks(pattern, places);
        result.find_rows();
        result
    }

    /// Sorts the blocks of the pattern by their column in the order.
    fn take_blocks(&mut self, pattern: &BlockPattern, places: &[u32]) {
        let count = pattern.node_count();
        self.block_starts = vec![0; count + 1];
        for col in 0..count {
            for &row in pattern.column(col) {
                self.block_starts[places[row as usize].min(places[col]) as usize + 1] += 1;
            }
        }
        for col in 0..count {
            self.block_starts[col + 1] += self.block_starts[col];
        }
        let mut next = self.block_starts.clone();
        self.blocks = vec![(0, 0, false); pattern.block_count()];
        for col in 0..count {
            for (index, &row) in pattern.range(col).zip(pattern.column(col)) {
                let (p, q) = (places[row as usize], places[col]);
                let place = &mut next[p.min(q) as usize];
                self.blocks[*place as usize] = (p.max(q), index as u32, p < q);
                *place += 1;
            }
        }
        for range in self.block_starts.windows(2) {
            self.blocks[range[0] as usize..range[1] as usize].sort_unstable();
        }
    }

    /// Finds rows and children: the rows of a supernode are those of its matrix columns and of its
    /// children.
    fn find_rows(&mut self) {
        let (count, supernodes) = (self.block_starts.len() - 1, self.count());
        self.of_node = vec![0; count];
        for s in 0..supernodes {
            let nodes = self.nodes(s);
            self.of_node[nodes].fill(s as u32);
        }
        self.parents = vec![NONE; supernodes];
        // Lists of children, the last one first.
        let (mut last_child, mut earlier) = (vec![NONE; supernodes], vec![NONE; supernodes]);
        let mut seen_by = vec![NONE; count];
        self.row_starts.push(0);
        self.child_starts.push(0);
        for s in 0..supernodes {
            let nodes = self.nodes(s);
            let first = self.rows.len();
            let mut add = |rows: &mut Vec<u32>, row: u32| {
                if row as usize >= nodes.end && seen_by[row as usize] != s as u32 {
                    seen_by[row as usize] = s as u32;
                    rows.push(row);
                }
            };
            for node in nodes.clone() {
                let blocks = self.block_starts[node] as usize..self.block_starts[node + 1] as usize;
                for &(row, ..) in &self.blocks[blocks] {
                    add(&mut self.rows, row);
                }
            }
            let first_child = self.children.len();
            let mut child = last_child[s];
            while child != NONE {
                self.children.push(child);
                for place in self.row_range(child as usize) {
                    let row = self.rows[place];
                    add(&mut self.rows, row);
                }
                child = earlier[child as usize];
            }
            self.children[first_child..].reverse();
            self.child_starts.push(self.children.len() as u32);
            self.rows[first..].sort_unstable();
            if let Some(&row) = self.rows.get(first) {
                let parent = self.of_node[row as usize];
                self.parents[s] = parent;
                earlier[s] = std::mem::replace(&mut last_child[parent as usize], s as u32);
            }
            self.row_starts.push(self.rows.len() as u32);
        }
        self.generations = vec![0; supernodes];
        for s in (0..supernodes).rev() {
            if let Some(parent) = self.parent(s) {
                self.generations[s] = self.generations[parent] + 1;
            }
        }
    }

    pub(super) fn count(&self) -> usize {
        self.begins.len() - 1
    }

    pub(super) fn nodes(&self, s: usize) -> std::ops::Range<usize> {
        self.begins[s] as usize..self.begins[s + 1] as usize
    }

    /// Pieces of a supernode.
    pub(super) fn pieces(&self, s: usize) -> std::ops::Range<usize> {
        self.piece_starts[s] as usize..self.piece_starts[s + 1] as usize
    }

    /// Nodes of the pieces of a supernode.
    pub(super) fn piece_nodes(&self, s: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let nodes = self.nodes(s);
        nodes.clone().step_by(PIECE).map(move |first| first..nodes.end.min(first + PIECE))
    }

    /// The piece that a node is in.
    pub(super) fn piece_of_node(&self, node: usize) -> usize {
        let s = self.of_node(node);
        self.pieces(s).start + (node - self.nodes(s).start) / PIECE
    }

    pub(super) fn node_count(&self) -> usize {
        self.of_node.len()
    }

    fn row_range(&self, s: usize) -> std::ops::Range<usize> {
        self.row_starts[s] as usize..self.row_starts[s + 1] as usize
    }

    pub(super) fn rows(&self, s: usize) -> &[u32] {
        &self.rows[self.row_range(s)]
    }

    pub(super) fn children(&self, s: usize) -> &[u32] {
        &self.children[self.child_starts[s] as usize..self.child_starts[s + 1] as usize]
    }

    /// The supernode above.
    pub(super) fn parent(&self, s: usize) -> Option<usize> {
        Some(self.parents[s]).filter(|&parent| parent != NONE).map(|parent| parent as usize)
    }

    /// The supernode of a node.
    pub(super) fn of_node(&self, node: usize) -> usize {
        self.of_node[node] as usize
    }

    /// Multiplications and additions of the elimination of a supernode.
    pub(super) fn flops(&self, s: usize) -> f64 {
        let (width, below) = (3 * self.nodes(s).len(), 3 * self.rows(s).len());
        (below + 1..=below + width).map(|rows| (rows * rows) as f64).sum()
    }

    /// How many supernodes are above.
    pub(super) fn generation(&self, s: usize) -> usize {
        self.generations[s] as usize
    }

    /// The blocks of a matrix of the pattern in the column of a node: the row, and the block column by
    /// column.
    pub(super) fn column<'a>(
        &'a self,
        matrix: &'a BlockMatrix,
        node: usize,
    ) -> impl Iterator<Item = (u32, [[f64; 3]; 3])> + 'a {
        self.entries(node).iter().map(|&(row, index, transposed)| {
            let block = &matrix.blocks()[index as usize];
            let entry = |i: usize, k: usize| if transposed { block[k][i] } else { block[i][k] };
            (row, std::array::from_fn(|k| std::array::from_fn(|i| entry(i, k))))
        })
    }

    /// Where the blocks of a column are in a matrix of the pattern: row, stored block, whether it is used
    /// transposed; rows ascending.
    pub(super) fn entries(&self, node: usize) -> &[(u32, u32, bool)] {
        &self.blocks[self.block_starts[node] as usize..self.block_starts[node + 1] as usize]
    }
}

/// First nodes of the supernodes, and the number of nodes.
fn runs(order: &NodeOrder) -> Vec<u32> {
    let (parents, counts) = (order.parents(), order.column_counts());
    let mut child_counts = vec![0_u32; parents.len()];
    for &parent in parents.iter().filter(|&&parent| parent != NONE) {
        child_counts[parent as usize] += 1;
    }
    let mut runs: Vec<Run> = Vec::new();
    for node in 0..parents.len() as u32 {
        let place = node as usize;
        let below = 3 * u64::from(counts[place] - 1);
        let continues = place > 0
            && parents[place - 1] == node
            && child_counts[place] == 1
            && counts[place - 1] == counts[place] + 1;
        if continues && let Some(last) = runs.last_mut() {
            (last.end, last.below) = (node + 1, below);
        } else {
            runs.push(Run { begin: node, end: node + 1, below, zeros: 0 });
        }
    }
    // A run is merged with the one after it when that is its parent.
    let mut merged: Vec<Run> = Vec::with_capacity(runs.len());
    for mut run in runs {
        while let Some(&child) = merged.last() {
            let parent = parents[child.end as usize - 1];
            let is_child = (run.begin..run.end).contains(&parent);
            let Some(both) = Some(child).filter(|_| is_child).and_then(|c| c.merged(run)) else {
                break;
            };
            merged.pop();
            run = both;
        }
        merged.push(run);
    }
    merged.iter().map(|run| run.begin).chain([parents.len() as u32]).collect()
}
