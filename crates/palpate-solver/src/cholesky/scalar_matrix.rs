//! The permuted matrix, scalar by scalar, as faer reads it.

use faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};

use crate::{BlockMatrix, BlockPattern};

/// Lower triangle, column by column, in the order of elimination.
#[derive(Debug)]
pub(super) struct ScalarMatrix {
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
    /// Per permuted node column: permuted row, stored block, whether it is used transposed.
    blocks: Vec<(u32, u32, bool)>,
    block_starts: Vec<u32>,
}

fn places(order: &[u32]) -> Vec<u32> {
    let mut place = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        place[old as usize] = new as u32;
    }
    place
}

impl ScalarMatrix {
    pub(super) fn new(pattern: &BlockPattern, order: &[u32]) -> Self {
        let place = places(order);
        let mut entries: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(pattern.block_count());
        for col in 0..pattern.node_count() {
            for (index, &row) in pattern.range(col).zip(pattern.column(col)) {
                let (p, q) = (place[row as usize], place[col]);
                entries.push((p.min(q), p.max(q), index as u32, p < q));
            }
        }
        entries.sort_unstable();
        let count = order.len();
        let mut block_starts = vec![0_u32; count + 1];
        for &(col, ..) in &entries {
            block_starts[col as usize + 1] += 1;
        }
        for col in 0..count {
            block_starts[col + 1] += block_starts[col];
        }
        let blocks: Vec<_> = entries.iter().map(|&(_, row, index, t)| (row, index, t)).collect();
        let mut starts = vec![0];
        let mut rows = Vec::with_capacity(9 * blocks.len());
        for col in 0..count {
            let column = &blocks[block_starts[col] as usize..block_starts[col + 1] as usize];
            for k in 0..3 {
                for &(row, ..) in column {
                    let first = if row as usize == col { k } else { 0 };
                    rows.extend((first..3).map(|i| 3 * row + i));
                }
                starts.push(rows.len() as u32);
            }
        }
        let values = vec![0.0; rows.len()];
        Self { starts, rows, values, blocks, block_starts }
    }

    pub(super) fn set_values(&mut self, matrix: &BlockMatrix, order: &[u32]) {
        let mut next = 0;
        for col in 0..order.len() {
            let range = self.block_starts[col] as usize..self.block_starts[col + 1] as usize;
            for k in 0..3 {
                for &(row, index, transposed) in &self.blocks[range.clone()] {
                    let block = &matrix.blocks()[index as usize];
                    let first = if row as usize == col { k } else { 0 };
                    self.values[next..next + 3 - first].copy_from_slice(
                        &std::array::from_fn::<_, 3, _>(|i| {
                            if transposed { block[k][i] } else { block[i][k] }
                        })[first..],
                    );
                    next += 3 - first;
                }
            }
        }
    }

    pub(super) fn lower(&self) -> SparseColMatRef<'_, u32, f64> {
        let size = self.starts.len() - 1;
        let pattern =
            SymbolicSparseColMatRef::new_checked(size, size, &self.starts, None, &self.rows);
        SparseColMatRef::new(pattern, &self.values)
    }

    pub(super) fn upper_pattern(
        &self,
        pattern: &BlockPattern,
        order: &[u32],
    ) -> SymbolicSparseColMat<u32> {
        let place = places(order);
        let mut entries: Vec<(u32, u32)> = Vec::with_capacity(pattern.block_count());
        for col in 0..pattern.node_count() {
            for &row in pattern.column(col) {
                let (p, q) = (place[row as usize], place[col]);
                entries.push((p.max(q), p.min(q)));
            }
        }
        entries.sort_unstable();
        let mut starts = vec![0_u32];
        let mut rows = Vec::with_capacity(self.rows.len());
        for column in entries.chunk_by(|a, b| a.0 == b.0) {
            for k in 0..3 {
                for &(col, row) in column {
                    let last = if row == col { k } else { 2 };
                    rows.extend((0..=last).map(|i| 3 * row + i));
                }
                starts.push(rows.len() as u32);
            }
        }
        let size = starts.len() - 1;
        SymbolicSparseColMat::new_checked(size, size, starts, None, rows)
    }
}
