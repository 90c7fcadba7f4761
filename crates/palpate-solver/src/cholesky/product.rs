//! Products of dense matrices, whose entries lie column after column, on one vector unit.
//!
//! Both factors are copied first, so that the innermost loop reads them from end to end (Goto and van de
//! Geijn 2008). Each entry is summed in the order of the columns by fused operations: the same
//! bits on any vector unit.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use std::ops::Range;

use pulp::Simd;

use super::real::Real;

/// Vectors of a tile's column, and columns of a tile: their sums fill the registers.
const VECTORS: usize = 3;
const COLUMNS: usize = 4;
/// Entries of a tile's column on the longest vectors.
const LONGEST: usize = 16 * VECTORS;

/// Part of a matrix.
pub(super) struct Part {
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
}

/// What a product does to the target.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Effect {
    Replace,
    Add,
    /// Adds to the entries on and below the diagonal; to some of those above as well.
    AddBelowDiagonal,
}

/// Memory for the factors of a product.
#[derive(Default)]
pub(super) struct Product<T> {
    /// The left one: tiles of rows, column after column, with zeros below the last row.
    left: Vec<T>,
    /// The right one: tiles of columns of the result, with zeros after the last one.
    right: Vec<[T; COLUMNS]>,
    row_count: usize,
    column_count: usize,
    depth: usize,
}

impl<T: Real> Product<T> {
    /// Takes part of a matrix, or its negative, as the left factor.
    #[inline(always)]
    pub(super) fn take_left<S: Simd, const NEGATIVE: bool>(
        &mut self,
        matrix: &[T],
        height: usize,
        part: &Part,
    ) {
        let tile = VECTORS * T::lanes::<S>();
        self.row_count = part.rows.len();
        self.depth = part.columns.len();
        let size = self.row_count.next_multiple_of(tile) * self.depth;
        if self.left.len() < size {
            self.left.resize(size, T::ZERO);
        }
        let mut left = &mut self.left[..size];
        for first in part.rows.clone().step_by(tile) {
            let count = tile.min(part.rows.end - first);
            for column in part.columns.clone() {
                let (target, rest) = left.split_at_mut(tile);
                left = rest;
                let source = &matrix[column * height + first..][..count];
                let (target, padding) = target.split_at_mut(count);
                for (target, &value) in target.iter_mut().zip(source) {
                    *target = if NEGATIVE { T::ZERO - value } else { value };
                }
                for value in padding {
                    *value = T::ZERO;
                }
            }
        }
    }

    /// Takes the transpose of part of a matrix as the right factor.
    #[inline(always)]
    pub(super) fn take_right_transposed(&mut self, matrix: &[T], height: usize, part: &Part) {
        self.resize_right(part.rows.len(), part.columns.len());
        for (tile, first) in part.rows.clone().step_by(COLUMNS).enumerate() {
            let target = &mut self.right[tile * self.depth..][..self.depth];
            let columns = target.iter_mut().zip(part.columns.clone());
            let sources =
                columns.map(|(target, column)| (target, &matrix[column * height + first..]));
            if first + COLUMNS <= part.rows.end {
                for (target, source) in sources {
                    *target = *source.first_chunk().expect("a whole tile");
                }
            } else {
                let count = part.rows.end - first;
                for (target, source) in sources {
                    *target = std::array::from_fn(|k| if k < count { source[k] } else { T::ZERO });
                }
            }
        }
    }

    /// Takes part of a matrix as the right factor.
    #[inline(always)]
    pub(super) fn take_right(&mut self, matrix: &[T], height: usize, part: &Part) {
        self.resize_right(part.columns.len(), part.rows.len());
        for (place, column) in part.columns.clone().enumerate() {
            let source = &matrix[column * height..][part.rows.clone()];
            let target = &mut self.right[place / COLUMNS * self.depth..][..self.depth];
            for (target, &value) in target.iter_mut().zip(source) {
                target[place % COLUMNS] = value;
            }
        }
        let filled = self.column_count % COLUMNS;
        if filled > 0 {
            for entries in &mut self.right[self.column_count / COLUMNS * self.depth..][..self.depth]
            {
                entries[filled..].fill(T::ZERO);
            }
        }
    }

    #[inline(always)]
    fn resize_right(&mut self, column_count: usize, depth: usize) {
        assert_eq!(depth, self.depth, "as many rows as the left factor has columns");
        self.column_count = column_count;
        let size = column_count.div_ceil(COLUMNS) * depth;
        if self.right.len() < size {
            self.right.resize(size, [T::ZERO; COLUMNS]);
        }
    }

    /// The product of the factors that were taken last, in `target`, which begins at its first entry.
    #[inline(always)]
    pub(super) fn apply<S: Simd>(
        &self,
        simd: S,
        target: &mut [T],
        target_height: usize,
        effect: Effect,
    ) {
        if self.depth == 0 || self.column_count == 0 {
            return;
        }
        let tile = VECTORS * T::lanes::<S>();
        let width = self.column_count.div_ceil(COLUMNS);
        let tiles = self.row_count.div_ceil(tile);
        for (row, left) in self.left.chunks_exact(tile * self.depth).take(tiles).enumerate() {
            let rows = row * tile..self.row_count.min((row + 1) * tile);
            for (column, right) in self.right.chunks_exact(self.depth).take(width).enumerate() {
                let columns = column * COLUMNS..self.column_count.min((column + 1) * COLUMNS);
                if effect == Effect::AddBelowDiagonal && rows.end <= columns.start {
                    break;
                }
                let mut sums = [[T::splat(simd, T::ZERO); VECTORS]; COLUMNS];
                if effect != Effect::Replace {
                    for (sums, column) in sums.iter_mut().zip(columns.clone()) {
                        *sums = load::<S, T>(&target[column * target_height..][rows.clone()]);
                    }
                }
                let left = T::vectors::<S>(left).as_chunks::<VECTORS>().0;
                for (left, right) in left.iter().zip(right) {
                    for (sums, &factor) in sums.iter_mut().zip(right) {
                        let factor = T::splat(simd, factor);
                        for (sum, &value) in sums.iter_mut().zip(left) {
                            *sum = T::mul_add(simd, value, factor, *sum);
                        }
                    }
                }
                for (sums, column) in sums.iter().zip(columns) {
                    store::<S, T>(sums, &mut target[column * target_height..][rows.clone()]);
                }
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd, T: Real>(column: &[T]) -> [T::Vector<S>; VECTORS] {
    let vectors = |entries: &[T]| *T::vectors::<S>(entries).first_chunk().expect("a tile's column");
    if column.len() == VECTORS * T::lanes::<S>() {
        vectors(column)
    } else {
        let mut whole = [T::ZERO; LONGEST];
        whole[..column.len()].copy_from_slice(column);
        vectors(&whole)
    }
}

#[inline(always)]
fn store<S: Simd, T: Real>(sums: &[T::Vector<S>; VECTORS], column: &mut [T]) {
    if column.len() == VECTORS * T::lanes::<S>() {
        T::vectors_mut::<S>(column).copy_from_slice(sums);
    } else {
        let mut whole = [T::ZERO; LONGEST];
        T::vectors_mut::<S>(&mut whole)[..VECTORS].copy_from_slice(sums);
        column.copy_from_slice(&whole[..column.len()]);
    }
}
