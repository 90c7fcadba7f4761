//! Matrices in tiles of rows, and their products on one vector unit.
//!
//! A tile's columns lie one after the other, so that the innermost loop reads a factor from end to end
//! where it stands: nothing is copied first. Each entry is summed in the order of the columns by fused
//! operations: the same bits on any vector unit.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use std::ops::Range;

use pulp::Simd;

/// Rows of a tile: whole nodes, and three vectors of the longest vector unit.
pub(super) const ROWS: usize = 24;
/// Columns of a product that are summed together, and vectors of each: their sums fill the registers.
pub(super) const GROUP: usize = 4;
const VECTORS: usize = 3;

/// The part of a column in a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Column([[f64; GROUP]; ROWS / GROUP]);

/// A square tile.
pub(super) type Block = [Column; ROWS];

impl Column {
    pub(super) const ZERO: Self = Self([[0.0; GROUP]; ROWS / GROUP]);

    pub(super) fn rows(&self) -> &[f64; ROWS] {
        self.0.as_flattened().try_into().expect("the rows of a tile")
    }

    pub(super) fn rows_mut(&mut self) -> &mut [f64; ROWS] {
        self.0.as_flattened_mut().try_into().expect("the rows of a tile")
    }
}

/// The lower triangle of a square matrix: tiles of its rows, each up to its square tile on the diagonal.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    /// Rows and columns.
    pub(super) size: usize,
}

impl Triangle {
    pub(super) fn tile_count(self) -> usize {
        self.size.div_ceil(ROWS)
    }

    /// Where the columns of a tile are.
    pub(super) fn tile(self, tile: usize) -> Range<usize> {
        let start = ROWS * tile * (tile + 1) / 2;
        start..start + (ROWS * (tile + 1)).min(self.size.next_multiple_of(GROUP))
    }

    /// Columns of all tiles.
    pub(super) fn column_count(self) -> usize {
        self.tile_count().checked_sub(1).map_or(0, |last| self.tile(last).end)
    }
}

/// What a product does to the target.
#[derive(Clone, Copy)]
pub(super) enum Effect {
    Subtract,
    ReplaceByNegative,
}

/// The product of `left` with the transpose of rows `GROUP * group..` of `right`, in some rows of four
/// columns, and as many after them as fill vectors.
#[inline(always)]
pub(super) fn multiply_transposed<S: Simd>(
    simd: S,
    left: &[Column],
    right: &[Column],
    group: usize,
    rows: Range<usize>,
    effect: Effect,
    target: &mut [Column],
) {
    let mut vector = rows.start / S::F64_LANES;
    let end = rows.end.div_ceil(S::F64_LANES);
    while vector < end {
        vector += match end - vector {
            1 => multiply_vectors::<S, 1>(simd, left, right, group, vector, effect, target),
            2 => multiply_vectors::<S, 2>(simd, left, right, group, vector, effect, target),
            _ => multiply_vectors::<S, VECTORS>(simd, left, right, group, vector, effect, target),
        };
    }
}

/// The same for `V` vectors of each column; how many they are.
#[inline(always)]
fn multiply_vectors<S: Simd, const V: usize>(
    simd: S,
    left: &[Column],
    right: &[Column],
    group: usize,
    vector: usize,
    effect: Effect,
    target: &mut [Column],
) -> usize {
    let sums = products::<S, V>(simd, left, right, group, vector);
    for (target, sums) in target.iter_mut().zip(sums) {
        let target = &mut vectors_mut::<S>(target)[vector..][..V];
        for (target, sum) in target.iter_mut().zip(sums) {
            *target = match effect {
                Effect::Subtract => simd.sub_f64s(*target, sum),
                Effect::ReplaceByNegative => simd.neg_f64s(sum),
            };
        }
    }
    V
}

/// Multiplies some rows of a tile, and as many after them as fill vectors, by the transpose of a lower
/// triangle.
#[inline(always)]
pub(super) fn multiply_by_transposed_triangle<S: Simd>(
    simd: S,
    tile: &mut [Column],
    triangle: &Block,
    rows: usize,
) {
    let end = rows.div_ceil(S::F64_LANES);
    let mut vector = 0;
    while vector < end {
        vector += match end - vector {
            1 => triangle_vectors::<S, 1>(simd, tile, triangle, vector),
            2 => triangle_vectors::<S, 2>(simd, tile, triangle, vector),
            _ => triangle_vectors::<S, VECTORS>(simd, tile, triangle, vector),
        };
    }
}

/// The same for `V` vectors of each column; how many they are.
#[inline(always)]
fn triangle_vectors<S: Simd, const V: usize>(
    simd: S,
    tile: &mut [Column],
    triangle: &Block,
    vector: usize,
) -> usize {
    // From the last columns on: the product needs none after them.
    for group in (0..tile.len() / GROUP).rev() {
        let tile = &mut tile[..GROUP * (group + 1)];
        let sums = products::<S, V>(simd, tile, triangle, group, vector);
        for (target, sums) in tile[GROUP * group..].iter_mut().zip(sums) {
            vectors_mut::<S>(target)[vector..][..V].copy_from_slice(&sums);
        }
    }
    V
}

/// Products of vectors of the columns of `left` with rows `GROUP * group..` of the same columns of `right`.
#[inline(always)]
fn products<S: Simd, const V: usize>(
    simd: S,
    left: &[Column],
    right: &[Column],
    group: usize,
    vector: usize,
) -> [[S::f64s; V]; GROUP] {
    let mut sums = [[simd.splat_f64s(0.0); V]; GROUP];
    for (left, right) in left.iter().zip(right) {
        let left = &vectors::<S>(left)[vector..][..V];
        for (sums, &factor) in sums.iter_mut().zip(&right.0[group]) {
            let factor = simd.splat_f64s(factor);
            for (sum, &value) in sums.iter_mut().zip(left) {
                *sum = simd.mul_add_f64s(value, factor, *sum);
            }
        }
    }
    sums
}

#[inline(always)]
fn vectors<S: Simd>(column: &Column) -> &[S::f64s] {
    S::as_simd_f64s(column.0.as_flattened()).0
}

#[inline(always)]
fn vectors_mut<S: Simd>(column: &mut Column) -> &mut [S::f64s] {
    S::as_mut_simd_f64s(column.0.as_flattened_mut()).0
}
