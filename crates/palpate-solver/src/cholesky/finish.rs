//! What a solve needs of the columns of a front that are eliminated: P = [T⁻¹; B T⁻¹] for the factor T of
//! their square and the rows B below it, in panels.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use pulp::{Simd, WithSimd};

use super::front::Shape;
use super::packed::{Panel, ROWS as PANEL};
use super::real::Real;
use super::tiles::{Block, Column, GROUP, ROWS, negative_products};

/// Columns of a product that are summed together, and vectors of each: their sums fill the registers.
const COLUMNS: usize = 6;
const VECTORS: usize = 2;

/// Memory for finishing.
#[derive(Default)]
pub(super) struct Finish<T> {
    /// T⁻¹, a triangle of tiles.
    inverse: Vec<Column>,
    /// The same, for some columns at a time row after row, from their first one on.
    right: Vec<[T; COLUMNS]>,
}

impl<T: Real> Finish<T> {
    /// Fills the panels of a front that has been eliminated.
    pub(super) fn finish(
        &mut self,
        shape: Shape,
        columns: &[Column],
        inverses: &[Block],
        panels: &mut [Panel<T>],
    ) {
        pulp::Arch::new().dispatch(Task { shape, columns, inverses, panels, memory: self });
    }
}

pub(super) struct Task<'a, T> {
    pub(super) shape: Shape,
    pub(super) columns: &'a [Column],
    pub(super) inverses: &'a [Block],
    pub(super) panels: &'a mut [Panel<T>],
    pub(super) memory: &'a mut Finish<T>,
}

impl<T: Real> WithSimd for Task<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { shape, columns, inverses, panels, memory } = self;
        let (triangle, width) = (shape.top(), shape.width);
        invert(simd, shape, columns, inverses, &mut memory.inverse);
        for panel in &mut *panels {
            panel.0 = [T::ZERO; PANEL];
        }
        for tile in 0..triangle.tile_count() {
            let rows = ROWS * tile..width.min(ROWS * (tile + 1));
            let columns = &memory.inverse[triangle.tile(tile)];
            let columns = &columns[..columns.len().min(width)];
            copy_rows(columns, rows, width, panels);
        }
        if shape.below == 0 {
            return;
        }
        // The rows of the square in the first panel with others are those of the identity times T⁻¹.
        let first = width / PANEL;
        let start = panel_start(width, first);
        for row in first * PANEL..width {
            for column in 0..width {
                let value = f64::from(u8::from(row == column));
                panels[start + column].0[row % PANEL] = T::from_f64(value);
            }
        }
        for tile in 0..shape.bottom_tile_count() {
            let begin = width + ROWS * tile;
            let rows = begin..(begin + ROWS).min(width + shape.below);
            copy_rows(&columns[shape.bottom_tile(tile)][..width], rows, width, panels);
        }
        memory.take_right(shape);
        for panel in panels[start..].chunks_exact_mut(width) {
            multiply(simd, panel, &memory.right);
        }
    }
}

/// Where the columns of a panel begin.
fn panel_start(width: usize, panel: usize) -> usize {
    // Those of the triangle grow by as many columns as a panel has rows.
    let growing = panel.min(width / PANEL);
    PANEL * growing * (growing + 1) / 2 + (panel - growing) * width
}

/// Copies the rows of a tile, which are `rows` of P.
#[inline(always)]
fn copy_rows<T: Real>(
    columns: &[Column],
    rows: std::ops::Range<usize>,
    width: usize,
    panels: &mut [Panel<T>],
) {
    let (mut row, mut from) = (rows.start, 0);
    while row < rows.end {
        let count = (PANEL - row % PANEL).min(rows.end - row);
        let start = panel_start(width, row / PANEL);
        let panels = &mut panels[start..][..width.min(row / PANEL * PANEL + PANEL)];
        for (panel, column) in panels.iter_mut().zip(columns) {
            let target = &mut panel.0[row % PANEL..][..count];
            for (target, &value) in target.iter_mut().zip(&column.rows()[from..][..count]) {
                *target = T::from_f64(value);
            }
        }
        (row, from) = (row + count, from + count);
    }
}

/// The inverse of a triangle from those of its diagonal blocks.
#[inline(always)]
fn invert<S: Simd>(
    simd: S,
    shape: Shape,
    columns: &[Column],
    inverses: &[Block],
    inverse: &mut Vec<Column>,
) {
    let triangle = shape.top();
    inverse.resize(triangle.column_count().max(inverse.len()), Column::ZERO);
    for (tile, block) in inverses.iter().enumerate() {
        let (above, rows) = inverse.split_at_mut(triangle.tile(tile).start);
        let left = &columns[triangle.tile(tile)];
        for column in (0..ROWS * tile).step_by(GROUP) {
            let first = column / ROWS;
            let right = (first..tile).map(|other| {
                above[triangle.tile(other).start + column..].first_chunk().expect("four columns")
            });
            let left = &left[ROWS * first..ROWS * tile];
            rows[column..][..GROUP].copy_from_slice(&negative_products(simd, block, left, &right));
        }
        let diagonal = &mut rows[ROWS * tile..triangle.tile(tile).len()];
        diagonal.copy_from_slice(&block[..diagonal.len()]);
    }
}

impl<T: Real> Finish<T> {
    #[inline(always)]
    fn take_right(&mut self, shape: Shape) {
        let (triangle, width) = (shape.top(), shape.width);
        self.right.clear();
        for first in (0..width).step_by(COLUMNS) {
            let count = COLUMNS.min(width - first);
            for tile in first / ROWS..triangle.tile_count() {
                let columns = &self.inverse[triangle.tile(tile)][first..first + count];
                let rows = first.max(ROWS * tile)..width.min(ROWS * (tile + 1));
                for row in rows {
                    let mut entries = [T::ZERO; COLUMNS];
                    for (entry, column) in entries.iter_mut().zip(columns) {
                        *entry = T::from_f64(column.rows()[row % ROWS]);
                    }
                    self.right.push(entries);
                }
            }
        }
    }
}

/// Multiplies a panel by T⁻¹ in place: from the first columns on, as the product needs none before them.
#[inline(always)]
fn multiply<S: Simd, T: Real>(simd: S, panel: &mut [Panel<T>], mut right: &[[T; COLUMNS]]) {
    for first in (0..panel.len()).step_by(COLUMNS) {
        let panel = &mut panel[first..];
        let (factors, rest) = right.split_at(panel.len());
        right = rest;
        for part in 0..PANEL / (VECTORS * T::lanes::<S>()) {
            let mut sums = [[T::splat(simd, T::ZERO); VECTORS]; COLUMNS];
            for (column, factors) in panel.iter().zip(factors) {
                let column = &T::vectors::<S>(&column.0)[part * VECTORS..][..VECTORS];
                for (sums, &factor) in sums.iter_mut().zip(factors) {
                    let factor = T::splat(simd, factor);
                    for (sum, &value) in sums.iter_mut().zip(column) {
                        *sum = T::mul_add(simd, value, factor, *sum);
                    }
                }
            }
            for (column, sums) in panel.iter_mut().zip(sums) {
                let column = &mut T::vectors_mut::<S>(&mut column.0)[part * VECTORS..][..VECTORS];
                column.copy_from_slice(&sums);
            }
        }
    }
}
