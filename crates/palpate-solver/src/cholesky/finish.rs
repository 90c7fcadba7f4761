//! What a solve needs of a piece of the columns of a front that are eliminated: P = [T⁻¹; B T⁻¹] for the
//! factor T of their square and the rows B below it, in panels.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::elimination::solve;
use super::front::Shape;
use super::packed::{Panel, ROWS as PANEL};
use super::real::Real;
use super::tiles::{Block, Column, ROWS};

/// Columns of a product that are summed together, and vectors of each: their sums fill the registers.
const COLUMNS: usize = 6;
const VECTORS: usize = 2;

/// Some of the columns of a front that are solved together, from a tile's first one on.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    first: usize,
    /// Of these columns from their square on.
    pub(super) shape: Shape,
}

impl Piece {
    pub(super) fn new(front: Shape, first: usize, width: usize) -> Self {
        let below = front.width + front.below - first - width;
        Self { first, shape: Shape { width, below } }
    }
}

/// Memory for finishing.
#[derive(Default)]
pub(super) struct Finish<T> {
    /// The transpose of T⁻¹ in tiles of its rows; those before the diagonal are not used.
    inverse: Vec<Column>,
    /// T⁻¹, for some columns at a time row after row, from their first one on.
    right: Vec<[T; COLUMNS]>,
}

impl<T: Real> Finish<T> {
    /// Fills the panels of a piece of a front that has been eliminated.
    pub(super) fn finish(
        &mut self,
        front: Shape,
        piece: Piece,
        columns: &[Column],
        inverses: &[Block],
        panels: &mut [Panel<T>],
    ) {
        pulp::Arch::new().dispatch(Task { front, piece, columns, inverses, panels, memory: self });
    }
}

pub(super) struct Task<'a, T> {
    pub(super) front: Shape,
    pub(super) piece: Piece,
    pub(super) columns: &'a [Column],
    pub(super) inverses: &'a [Block],
    pub(super) panels: &'a mut [Panel<T>],
    pub(super) memory: &'a mut Finish<T>,
}

impl<T: Real> WithSimd for Task<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { front, piece, columns, inverses, panels, memory } = self;
        let Piece { first: begin, shape } = piece;
        let (width, first) = (shape.width, shape.width / PANEL);
        memory.invert(simd, front, piece, columns, inverses);
        // The rows of the square in the first panel with others are those of the identity times T⁻¹.
        let start = panel_start(width, first);
        let whole = if shape.below == 0 { width } else { first * PANEL };
        memory.copy_inverse(shape, whole, panels);
        if shape.below == 0 {
            return;
        }
        let (last, mixed) = (panels.len() - width, start..start + width);
        for panel in &mut panels[mixed.clone()] {
            panel.0 = [T::ZERO; PANEL];
        }
        for panel in &mut panels[last..] {
            panel.0 = [T::ZERO; PANEL];
        }
        for (row, panel) in panels[mixed].iter_mut().enumerate().skip(first * PANEL) {
            panel.0[row % PANEL] = T::from_f64(1.0);
        }
        let mut row = width;
        let mut copy = |tile: Range<usize>, count: usize| {
            let columns = &columns[tile][begin..begin + width];
            copy_rows(columns, row..row + count, width, panels);
            row += count;
        };
        let triangle = front.top();
        for tile in (begin + width).div_ceil(ROWS)..triangle.tile_count() {
            copy(triangle.tile(tile), ROWS.min(front.width - ROWS * tile));
        }
        for tile in 0..front.bottom_tile_count() {
            copy(front.bottom_tile(tile), ROWS.min(front.below - ROWS * tile));
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

/// Copies the rows of a tile below the square, which are `rows` of P.
#[inline(always)]
fn copy_rows<T: Real>(
    columns: &[Column],
    rows: Range<usize>,
    width: usize,
    panels: &mut [Panel<T>],
) {
    let (mut row, mut from) = (rows.start, 0);
    while row < rows.end {
        let count = (PANEL - row % PANEL).min(rows.end - row);
        let panels = &mut panels[panel_start(width, row / PANEL)..];
        for (panel, column) in panels.iter_mut().zip(columns) {
            let target = &mut panel.0[row % PANEL..][..count];
            for (target, &value) in target.iter_mut().zip(&column.rows()[from..][..count]) {
                *target = T::from_f64(value);
            }
        }
        (row, from) = (row + count, from + count);
    }
}

impl<T: Real> Finish<T> {
    /// T⁻¹: what is done to the rows below the square is done to those of the identity.
    #[inline(always)]
    fn invert<S: Simd>(
        &mut self,
        simd: S,
        front: Shape,
        piece: Piece,
        columns: &[Column],
        inverses: &[Block],
    ) {
        let (triangle, width) = (front.top(), piece.shape.bottom_width());
        let tiles = piece.first / ROWS..(piece.first + piece.shape.width).div_ceil(ROWS);
        let size = tiles.len() * width;
        self.inverse.resize(size.max(self.inverse.len()), Column::ZERO);
        for (tile, rows) in tiles.clone().zip(self.inverse.chunks_exact_mut(width)) {
            let rows = &mut rows[ROWS * tile - piece.first..];
            rows.fill(Column::ZERO);
            for (k, column) in rows.iter_mut().take(ROWS).enumerate() {
                for (value, from) in column.rows_mut()[..=k].iter_mut().zip(&inverses[tile]) {
                    *value = from.rows()[k];
                }
            }
            for other in tile + 1..tiles.end {
                let above = &columns[triangle.tile(other)][ROWS * tile..];
                let size = ROWS.min(piece.shape.width + piece.first - ROWS * tile);
                solve(simd, rows, size, above, &inverses[other], other - tile);
            }
        }
    }

    /// Copies the first rows of T⁻¹, with zeros above its diagonal.
    #[inline(always)]
    fn copy_inverse(&self, shape: Shape, rows: usize, panels: &mut [Panel<T>]) {
        let mut panels = panels.iter_mut();
        for first in (0..rows).step_by(PANEL) {
            for (column, panel) in (0..shape.width.min(first + PANEL)).zip(&mut panels) {
                let inverse = &self.inverse[column / ROWS * shape.bottom_width()..];
                panel.0 = [T::ZERO; PANEL];
                let begin = first.max(column);
                let values = &inverse[begin..rows.min(first + PANEL)];
                for (entry, values) in panel.0[begin - first..].iter_mut().zip(values) {
                    *entry = T::from_f64(values.rows()[column % ROWS]);
                }
            }
        }
    }

    #[inline(always)]
    fn take_right(&mut self, shape: Shape) {
        self.right.clear();
        for first in (0..shape.width).step_by(COLUMNS) {
            let tile = &self.inverse[first / ROWS * shape.bottom_width()..];
            let rows = tile[first..shape.width].iter().map(|column| {
                let values = column.rows()[first % ROWS..].first_chunk::<COLUMNS>();
                values.expect("columns of one tile").map(T::from_f64)
            });
            self.right.extend(rows);
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
