//! Elimination of the columns of a front, tile by tile: nearly all the work is products.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use pulp::{Simd, WithSimd};

use super::front::Front;
use super::tiles::{
    Block, Column, Effect, GROUP, ROWS, multiply_by_transposed_triangle, multiply_transposed,
};

#[cfg(test)]
mod tests;

/// Eliminates the columns of a front, which become those of the factor (some entries above the diagonal
/// are overwritten), and writes what they take from the rows below and the inverses of the factors of the
/// diagonal blocks.
///
/// # Errors
/// With the column whose pivot is not positive.
pub(super) fn eliminate(front: Front, inverses: &mut Vec<Block>) -> Result<(), usize> {
    pulp::Arch::new().dispatch(Elimination { front, inverses })
}

struct Elimination<'a> {
    front: Front<'a>,
    inverses: &'a mut Vec<Block>,
}

impl WithSimd for Elimination<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<(), usize> {
        let Self { front: Front { shape, columns, contribution }, inverses } = self;
        let triangle = shape.top();
        inverses.clear();
        inverses.resize(triangle.tile_count(), [Column::ZERO; ROWS]);
        let (top, bottom) = columns.split_at_mut(triangle.column_count());
        for tile in 0..triangle.tile_count() {
            let (above, rows) = top.split_at_mut(triangle.tile(tile).start);
            let rows = &mut rows[..triangle.tile(tile).len()];
            let size = ROWS.min(shape.width - ROWS * tile);
            for (block, inverse) in inverses[..tile].iter().enumerate() {
                solve(simd, rows, size, &above[triangle.tile(block)], inverse, block);
            }
            let (done, diagonal) = rows.split_at_mut(ROWS * tile);
            for (group, target) in diagonal.chunks_exact_mut(GROUP).enumerate() {
                let lower = GROUP * group..size;
                multiply_transposed(simd, done, done, group, lower, Effect::Subtract, target);
            }
            factor_block(simd, diagonal, &mut inverses[tile], size)
                .map_err(|column| ROWS * tile + column)?;
        }
        let width = shape.bottom_width();
        let contributions = shape.contribution();
        for tile in 0..shape.bottom_tile_count() {
            let (above, rows) = bottom.split_at_mut(tile * width);
            let rows = &mut rows[..width];
            let size = ROWS.min(shape.below - ROWS * tile);
            for (block, inverse) in inverses.iter().enumerate() {
                solve(simd, rows, size, &top[triangle.tile(block)], inverse, block);
            }
            let left = &rows[..shape.width];
            let target = &mut contribution[contributions.tile(tile)];
            for (block, target) in target.chunks_mut(ROWS).enumerate() {
                let right =
                    if block < tile { &above[block * width..][..shape.width] } else { left };
                for (group, target) in target.chunks_exact_mut(GROUP).enumerate() {
                    let first = if block < tile { 0 } else { GROUP * group };
                    let effect = Effect::ReplaceByNegative;
                    multiply_transposed(simd, left, right, group, first..size, effect, target);
                }
            }
        }
        Ok(())
    }
}

/// Turns a block of columns of a tile into that of the factor in the first `size` rows, the blocks before
/// it being done; `above` is the tile with that block on the diagonal.
#[inline(always)]
pub(super) fn solve<S: Simd>(
    simd: S,
    tile: &mut [Column],
    size: usize,
    above: &[Column],
    inverse: &Block,
    block: usize,
) {
    let (done, columns) = tile.split_at_mut(ROWS * block);
    let count = columns.len().min(ROWS);
    let columns = &mut columns[..count];
    let above = &above[..ROWS * block];
    for (group, target) in columns.chunks_exact_mut(GROUP).enumerate() {
        multiply_transposed(simd, done, above, group, 0..size, Effect::Subtract, target);
    }
    multiply_by_transposed_triangle(simd, columns, inverse, size);
}

/// Cholesky factor of a block in its lower triangle, and the inverse of that: what is done to the rows of
/// the block is done to those of the identity.
#[inline(always)]
fn factor_block<S: Simd>(
    simd: S,
    columns: &mut [Column],
    inverse: &mut Block,
    size: usize,
) -> Result<(), usize> {
    let mut rows = [Column::ZERO; ROWS];
    // Whole vectors: what they change above the diagonal of the block is not read.
    let lanes = S::F64_LANES;
    let end = size.next_multiple_of(lanes);
    for k in 0..size {
        rows[k].rows_mut()[k] = 1.0;
        let pivot = columns[k].rows()[k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(k);
        }
        let root = pivot.sqrt();
        let factor = 1.0 / root;
        let (mut column, mut row) = (columns[k], rows[k]);
        let done = (k + 1).next_multiple_of(lanes);
        scale(simd, &mut column.rows_mut()[k / lanes * lanes..end], factor);
        scale(simd, &mut row.rows_mut()[..done], factor);
        column.rows_mut()[k] = root;
        for j in k + 1..size {
            let (from, factor) = (j / lanes * lanes, column.rows()[j]);
            subtract(
                simd,
                &mut columns[j].rows_mut()[from..end],
                &column.rows()[from..end],
                factor,
            );
            subtract(simd, &mut rows[j].rows_mut()[..done], &row.rows()[..done], factor);
        }
        (columns[k], rows[k]) = (column, row);
    }
    for (k, row) in rows.iter().enumerate() {
        for (column, &value) in inverse.iter_mut().zip(&row.rows()[..=k]) {
            column.rows_mut()[k] = value;
        }
    }
    Ok(())
}

#[inline(always)]
fn scale<S: Simd>(simd: S, values: &mut [f64], factor: f64) {
    let factor = simd.splat_f64s(factor);
    for value in S::as_mut_simd_f64s(values).0 {
        *value = simd.mul_f64s(*value, factor);
    }
}

#[inline(always)]
fn subtract<S: Simd>(simd: S, from: &mut [f64], values: &[f64], factor: f64) {
    let factor = simd.splat_f64s(-factor);
    for (from, value) in S::as_mut_simd_f64s(from).0.iter_mut().zip(S::as_simd_f64s(values).0) {
        *from = simd.mul_add_f64s(*value, factor, *from);
    }
}
