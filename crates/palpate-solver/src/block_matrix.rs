//! Symmetric matrices of 3x3 blocks over a node graph.

use std::sync::Arc;

/// A 3x3 block, row by row.
pub type Block = [[f64; 3]; 3];

/// Where a symmetric block matrix has blocks: the lower triangle, column by column, with every
/// diagonal block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockPattern {
    column_starts: Vec<u32>,
    rows: Vec<u32>,
}

impl BlockPattern {
    /// The pattern in which all nodes of one clique (element) are joined with each other.
    ///
    /// Every node below `node_count` has a diagonal block, also if no clique holds it.
    ///
    /// # Panics
    /// If a clique names a node that is not below `node_count`.
    pub fn from_cliques<const N: usize>(node_count: usize, cliques: &[[u32; N]]) -> Self {
        let mut starts = vec![0_u32; node_count + 1];
        for &node in cliques.as_flattened() {
            assert!((node as usize) < node_count, "node {node} of {node_count}");
            starts[node as usize + 1] += 1;
        }
        for node in 0..node_count {
            starts[node + 1] += starts[node];
        }
        let mut cliques_of = vec![0; N * cliques.len()];
        let mut next = starts.clone();
        for (index, clique) in cliques.iter().enumerate() {
            for &node in clique {
                cliques_of[next[node as usize] as usize] = index as u32;
                next[node as usize] += 1;
            }
        }
        let mut column_starts = Vec::with_capacity(node_count + 1);
        column_starts.push(0);
        let mut rows = Vec::new();
        // The column that each node was found in last.
        let mut found_in: Vec<u32> = (0..node_count as u32).collect();
        for col in 0..node_count as u32 {
            let first = rows.len();
            rows.push(col);
            let range = starts[col as usize] as usize..starts[col as usize + 1] as usize;
            for &clique in &cliques_of[range] {
                for &row in &cliques[clique as usize] {
                    if row > col && found_in[row as usize] != col {
                        found_in[row as usize] = col;
                        rows.push(row);
                    }
                }
            }
            rows[first..].sort_unstable();
            column_starts.push(rows.len() as u32);
        }
        rows.shrink_to_fit();
        Self { column_starts, rows }
    }

    /// The pattern of the nodes that `places` gives a place, which must be ascending, and for each of its
    /// blocks the one here; others have [`u32::MAX`].
    ///
    /// # Panics
    /// If there is not one place per node.
    pub fn restricted(&self, places: &[u32]) -> (Self, Vec<u32>) {
        assert_eq!(places.len(), self.node_count(), "one place per node");
        let (mut column_starts, mut rows, mut sources) = (vec![0], Vec::new(), Vec::new());
        for col in (0..self.node_count()).filter(|&col| places[col] != u32::MAX) {
            for (index, &row) in self.range(col).zip(self.column(col)) {
                if places[row as usize] != u32::MAX {
                    rows.push(places[row as usize]);
                    sources.push(index as u32);
                }
            }
            column_starts.push(rows.len() as u32);
        }
        (Self { column_starts, rows }, sources)
    }

    /// Number of nodes; the matrix has three times as many rows.
    pub fn node_count(&self) -> usize {
        self.column_starts.len() - 1
    }

    /// Number of stored blocks: the lower triangle with the diagonal.
    pub fn block_count(&self) -> usize {
        self.rows.len()
    }

    /// Rows of the stored blocks of column `col`, ascending; the first is `col` itself.
    pub fn column(&self, col: usize) -> &[u32] {
        &self.rows[self.range(col)]
    }

    /// Storage index of block (`row`, `col`) with `row >= col`, `None` outside the pattern.
    pub fn find(&self, row: u32, col: u32) -> Option<usize> {
        // Columns are short.
        let range = self.range(col as usize);
        self.rows[range.clone()].iter().position(|&other| other == row).map(|i| range.start + i)
    }

    /// Storage indices of the blocks of column `col`.
    pub fn range(&self, col: usize) -> std::ops::Range<usize> {
        self.column_starts[col] as usize..self.column_starts[col + 1] as usize
    }
}

/// A symmetric matrix of 3x3 blocks; the lower triangle is stored.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    pattern: Arc<BlockPattern>,
    blocks: Vec<Block>,
}

impl BlockMatrix {
    /// The zero matrix on `pattern`.
    pub fn zeros(pattern: Arc<BlockPattern>) -> Self {
        let blocks = vec![[[0.0; 3]; 3]; pattern.block_count()];
        Self { pattern, blocks }
    }

    /// Where the blocks are.
    pub fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
    }

    /// The stored blocks, in the order of the pattern.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The stored blocks, in the order of the pattern. Diagonal blocks must stay symmetric.
    pub fn blocks_mut(&mut self) -> &mut [Block] {
        &mut self.blocks
    }

    /// Adds `block` at (`row`, `col`), `row >= col`.
    ///
    /// # Panics
    /// If the block is outside the pattern.
    pub fn add(&mut self, row: u32, col: u32, block: &Block) {
        let index = self.pattern.find(row, col).expect("block inside the pattern");
        for (sum, addend) in self.blocks[index].iter_mut().zip(block) {
            for (sum, addend) in sum.iter_mut().zip(addend) {
                *sum += addend;
            }
        }
    }

    /// `product = self * vector`, both with x, y, z of each node in turn.
    ///
    /// # Panics
    /// If the lengths differ from the number of nodes.
    pub fn multiply(&self, vector: &[[f64; 3]], product: &mut [[f64; 3]]) {
        let count = self.pattern.node_count();
        assert_eq!((vector.len(), product.len()), (count, count), "vector lengths");
        product.fill([0.0; 3]);
        for col in 0..count {
            let range = self.pattern.range(col);
            let (rows, blocks) = (&self.pattern.rows[range.clone()], &self.blocks[range]);
            let x = vector[col];
            let mut sum = multiply_block(&blocks[0], x);
            for (&row, b) in rows[1..].iter().zip(&blocks[1..]) {
                let below = multiply_block(b, x);
                let y = &mut product[row as usize];
                let above = vector[row as usize];
                for k in 0..3 {
                    y[k] += below[k];
                    sum[k] += b[0][k] * above[0] + b[1][k] * above[1] + b[2][k] * above[2];
                }
            }
            for k in 0..3 {
                product[col][k] += sum[k];
            }
        }
    }
}

#[inline]
fn multiply_block(b: &Block, x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| b[k][0] * x[0] + b[k][1] * x[1] + b[k][2] * x[2])
}
