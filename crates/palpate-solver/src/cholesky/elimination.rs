//! Elimination of the columns of a front, and what a solve needs of them. All matrices lie column after
//! column; columns are taken in blocks, so that nearly all the work is products.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use pulp::{Simd, WithSimd};

use super::product::{Effect, Part, Product};
use super::real::Real;

#[cfg(test)]
mod tests;

/// Columns that are eliminated together.
const BLOCK: usize = 32;
/// Columns of a front that contribute together: as many as keep a tile of them in the nearest cache.
const DEPTH: usize = 128;

/// Memory for eliminations.
#[derive(Default)]
pub(super) struct Elimination {
    product: Product<f64>,
    /// Inverses of the factors of the diagonal blocks, one after the other, row after row.
    inverses: Vec<f64>,
}

impl Elimination {
    /// Eliminates the columns of a front, which become those of the factor (some entries above the
    /// diagonal are overwritten), and takes what they leave from the lower triangle of `contribution`.
    ///
    /// # Errors
    /// With the column whose pivot is not positive.
    pub(super) fn eliminate(
        &mut self,
        columns: &mut [f64],
        width: usize,
        contribution: &mut [f64],
    ) -> Result<(), usize> {
        let height = columns.len() / width;
        let front = Front { columns, width, height, contribution, memory: self };
        pulp::Arch::new().dispatch(front)
    }

    /// Turns a copy of the columns that were eliminated last into what a solve needs, [T⁻¹; B T⁻¹] for
    /// the diagonal block's factor T and the block B below it.
    pub(super) fn finish<T: Real>(&self, columns: &mut [T], width: usize, memory: &mut Product<T>) {
        let height = columns.len() / width;
        let inverses = &self.inverses;
        pulp::Arch::new().dispatch(Finish { columns, width, height, inverses, product: memory });
    }
}

struct Front<'a> {
    columns: &'a mut [f64],
    width: usize,
    height: usize,
    contribution: &'a mut [f64],
    memory: &'a mut Elimination,
}

impl WithSimd for Front<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<(), usize> {
        let Self { columns, width, height, contribution, memory } = self;
        let Elimination { product, inverses } = memory;
        inverses.clear();
        for first in (0..width).step_by(BLOCK) {
            let last = width.min(first + BLOCK);
            let size = last - first;
            let begin = inverses.len();
            inverses.resize(begin + size * size, 0.0);
            let inverse = &mut inverses[begin..];
            factor_block(simd, &mut columns[first * height + first..], height, inverse, size)
                .map_err(|column| first + column)?;
            let below = Part { rows: last..height, columns: first..last };
            product.take_left::<S, false>(columns, height, &below);
            product.take_right(inverse, size, &Part { rows: 0..size, columns: 0..size });
            product.apply(simd, &mut columns[first * height + last..], height, Effect::Replace);
            if last < width {
                let beside = Part { rows: last..width, columns: first..last };
                product.take_left::<S, true>(columns, height, &below);
                product.take_right_transposed(columns, height, &beside);
                let rest = &mut columns[last * height + last..];
                product.apply(simd, rest, height, Effect::AddBelowDiagonal);
            }
        }
        for first in (0..width).step_by(DEPTH) {
            let part = Part { rows: width..height, columns: first..width.min(first + DEPTH) };
            product.take_left::<S, true>(columns, height, &part);
            product.take_right_transposed(columns, height, &part);
            product.apply(simd, contribution, height - width, Effect::AddBelowDiagonal);
        }
        Ok(())
    }
}

struct Finish<'a, T> {
    columns: &'a mut [T],
    width: usize,
    height: usize,
    inverses: &'a [f64],
    product: &'a mut Product<T>,
}

impl<T: Real> WithSimd for Finish<'_, T> {
    type Output = ();

    /// The rows of `X T = [1; B]`, from the last block of columns to the first.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { columns, width, height, inverses, product } = self;
        let mut inverse = [T::ZERO; BLOCK * BLOCK];
        let mut end = inverses.len();
        for first in (0..width).step_by(BLOCK).rev() {
            let last = width.min(first + BLOCK);
            let size = last - first;
            let inverse = &mut inverse[..size * size];
            for (target, &value) in inverse.iter_mut().zip(&inverses[end - size * size..end]) {
                *target = T::from_f64(value);
            }
            end -= size * size;
            let below = Part { rows: last..height, columns: first..last };
            product.take_left::<S, false>(columns, height, &below);
            product.take_right_transposed(inverse, size, &Part { rows: 0..size, columns: 0..size });
            product.apply(simd, &mut columns[first * height + last..], height, Effect::Replace);
            for column in 0..size {
                let target = &mut columns[(first + column) * height..][..last];
                target[..first].fill(T::ZERO);
                for (target, row) in target[first..].iter_mut().zip(inverse.chunks_exact(size)) {
                    *target = row[column];
                }
            }
            if first > 0 {
                let done = Part { rows: first..height, columns: first..last };
                product.take_left::<S, true>(columns, height, &done);
                let beside = Part { rows: first..last, columns: 0..first };
                product.take_right(columns, height, &beside);
                for column in columns.chunks_exact_mut(height).take(first) {
                    column[first..last].fill(T::ZERO);
                }
                product.apply(simd, &mut columns[first..], height, Effect::Add);
            }
        }
    }
}

/// Cholesky factor of a block in its lower triangle, and the inverse of that, row after row: what is done
/// to the rows of the block is done to those of the identity.
#[inline(always)]
fn factor_block<S: Simd>(
    simd: S,
    block: &mut [f64],
    height: usize,
    inverse: &mut [f64],
    size: usize,
) -> Result<(), usize> {
    let mut columns = [[0.0; BLOCK]; BLOCK];
    let mut rows = [[0.0; BLOCK]; BLOCK];
    for k in 0..size {
        columns[k][k..size].copy_from_slice(&block[k * height..][k..size]);
        rows[k][k] = 1.0;
    }
    // Whole vectors: what they change above the diagonal of the block is not read.
    let lanes = f64::lanes::<S>();
    let end = size.next_multiple_of(lanes);
    for k in 0..size {
        let pivot = columns[k][k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(k);
        }
        let root = pivot.sqrt();
        let inverse = 1.0 / root;
        let (mut column, mut row) = (columns[k], rows[k]);
        let done = (k + 1).next_multiple_of(lanes);
        scale(simd, &mut column[k / lanes * lanes..end], inverse);
        scale(simd, &mut row[..done], inverse);
        column[k] = root;
        for j in k + 1..size {
            let from = j / lanes * lanes;
            subtract(simd, &mut columns[j][from..end], &column[from..end], column[j]);
            subtract(simd, &mut rows[j][..done], &row[..done], column[j]);
        }
        (columns[k], rows[k]) = (column, row);
    }
    for k in 0..size {
        block[k * height..][k..size].copy_from_slice(&columns[k][k..size]);
        inverse[k * size..][..size].copy_from_slice(&rows[k][..size]);
    }
    Ok(())
}

#[inline(always)]
fn scale<S: Simd>(simd: S, values: &mut [f64], factor: f64) {
    let factor = f64::splat(simd, factor);
    for value in f64::vectors_mut::<S>(values) {
        *value = simd.mul_f64s(*value, factor);
    }
}

#[inline(always)]
fn subtract<S: Simd>(simd: S, from: &mut [f64], values: &[f64], factor: f64) {
    let factor = f64::splat(simd, -factor);
    for (from, value) in f64::vectors_mut::<S>(from).iter_mut().zip(f64::vectors::<S>(values)) {
        *from = simd.mul_add_f64s(*value, factor, *from);
    }
}
