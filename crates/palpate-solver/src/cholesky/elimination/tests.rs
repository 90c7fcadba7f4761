//! Fronts eliminated entry by entry, and on a vector unit without vectors.

use std::ops::Range;

use proptest::prelude::*;
use pulp::WithSimd;

use super::{Elimination, eliminate};
use crate::cholesky::finish::{Finish, Piece, Task};
use crate::cholesky::front::{Front, RowPlace, Shape};
use crate::cholesky::packed::{Panel, ROWS as PANEL};
use crate::cholesky::real::Real;
use crate::cholesky::tiles::{Block, Column};

/// Columns of a piece.
const PIECE: usize = 72;

/// The columns of a positive definite front, column after column, and zeros.
fn front(shape: Shape, seed: u64) -> Vec<f64> {
    let height = shape.width + shape.below;
    let mut state = seed | 1;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut entries = vec![0.0; height * height];
    for column in 0..shape.width {
        for row in column..height {
            entries[column * height + row] = draw();
        }
        entries[column * height + column] = height as f64;
    }
    entries
}

/// A front in tiles, and what becomes of it.
#[derive(Clone)]
struct Tiled {
    shape: Shape,
    columns: Vec<Column>,
    contribution: Vec<Column>,
    inverses: Vec<Block>,
}

impl Tiled {
    fn new(shape: Shape, entries: &[f64]) -> Self {
        let mut nowhere = Column::ZERO;
        nowhere.rows_mut().fill(f64::NAN);
        let mut result = Self {
            shape,
            columns: vec![Column::ZERO; shape.column_count()],
            contribution: vec![nowhere; shape.contribution().column_count()],
            inverses: Vec::new(),
        };
        let height = shape.width + shape.below;
        for (column, entries) in entries.chunks_exact(height).enumerate().take(shape.width) {
            for (row, &entry) in entries.iter().enumerate().skip(column) {
                *result.entry(row, column) = entry;
            }
        }
        result
    }

    /// An entry of the lower triangle.
    fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        let place = RowPlace::new(self.shape, row);
        let column = match column.checked_sub(self.shape.width) {
            None => &mut self.columns[place.columns + column],
            Some(column) => &mut self.contribution[place.contribution + column],
        };
        &mut column.rows_mut()[place.row]
    }

    fn front(&mut self) -> Front<'_> {
        let Self { shape, columns, contribution, .. } = self;
        Front { shape: *shape, columns, contribution }
    }

    fn lower(&mut self) -> Vec<f64> {
        let height = self.shape.width + self.shape.below;
        let entries = (0..height).flat_map(|column| (column..height).map(move |row| (row, column)));
        entries.map(|(row, column)| *self.entry(row, column)).collect()
    }
}

/// The factor's columns with what they leave.
fn eliminate_plainly(shape: Shape, mut entries: Vec<f64>) -> Vec<f64> {
    let Shape { width, below } = shape;
    let height = width + below;
    for k in 0..width {
        let root = entries[k * height + k].sqrt();
        for row in k..height {
            entries[k * height + row] /= root;
        }
        for col in k + 1..height {
            for row in col..height {
                entries[col * height + row] -=
                    entries[k * height + row] * entries[k * height + col];
            }
        }
    }
    entries
}

/// The rows of X from X T = [1; B] for some columns.
fn finish_plainly(height: usize, factor: &[f64], columns: Range<usize>) -> Vec<f64> {
    let first = columns.start;
    let mut finished = vec![0.0; (height - first) * columns.len()];
    let entry = |row: usize, col: usize| (col - first) * (height - first) + row - first;
    for row in first..height {
        for col in columns.clone().rev() {
            let right = if row < columns.end {
                f64::from(u8::from(row == col))
            } else {
                factor[col * height + row]
            };
            let known: f64 = (col + 1..columns.end)
                .map(|k| finished[entry(row, k)] * factor[col * height + k])
                .sum();
            finished[entry(row, col)] = (right - known) / factor[col * height + col];
        }
    }
    finished
}

/// P of panels, column after column.
fn unpacked<T: Real>(shape: Shape, panels: &[Panel<T>]) -> Vec<f64> {
    let Shape { width, below } = shape;
    let height = width + below;
    let mut result = vec![0.0; height * width];
    let mut panels = panels.iter();
    for first in (0..height).step_by(PANEL) {
        for column in 0..width.min(first + PANEL) {
            let panel = panels.next().unwrap();
            for row in first..height.min(first + PANEL) {
                result[column * height + row] = panel.0[row - first].to_f64();
            }
            assert!(panel.0[PANEL.min(height - first)..].iter().all(|&x| x == T::ZERO));
        }
    }
    assert!(panels.next().is_none());
    result
}

fn check<T: Real>(tiled: &Tiled, factor: &[f64], tolerance: f64) {
    let Tiled { shape: front, columns, inverses, .. } = tiled;
    let height = front.width + front.below;
    for first in (0..front.width).step_by(PIECE) {
        let end = front.width.min(first + PIECE);
        let piece = Piece::new(*front, first, end - first);
        let panels = || vec![Panel([T::from_f64(f64::NAN); PANEL]); piece.shape.panel_count()];
        let (mut found, mut scalar) = (panels(), panels());
        Finish::default().finish(*front, piece, columns, inverses, &mut found);
        let (panels, memory) = (&mut scalar[..], &mut Finish::default());
        let task = Task { front: *front, piece, columns, inverses, panels, memory };
        task.with_simd(pulp::Scalar::new());
        let (found, scalar) = (unpacked(piece.shape, &found), unpacked(piece.shape, &scalar));
        for (found, exact) in found.iter().zip(finish_plainly(height, factor, first..end)) {
            assert!((found - exact).abs() < tolerance, "{found} for {exact}");
        }
        assert!(found.iter().map(|x| x.to_bits()).eq(scalar.iter().map(|x| x.to_bits())));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn a_front_is_eliminated_as_entry_by_entry(
        width in 1_usize..150,
        below in 0_usize..90,
        seed in any::<u64>(),
    ) {
        let shape = Shape { width, below };
        let entries = front(shape, seed);
        let given = Tiled::new(shape, &entries);
        let mut tiled = given.clone();
        let mut inverses = Vec::new();
        eliminate(tiled.front(), &mut inverses).unwrap();
        tiled.inverses = inverses;
        let plain = eliminate_plainly(shape, entries);
        let height = width + below;
        let lower = (0..height).flat_map(|column| column * height + column..(column + 1) * height);
        for (found, entry) in tiled.lower().iter().zip(lower) {
            prop_assert!((found - plain[entry]).abs() < 1e-12);
        }
        check::<f64>(&tiled, &plain, 1e-12);
        check::<f32>(&tiled, &plain, 1e-5);

        let (mut scalar, mut inverses) = (given, Vec::new());
        let task = Elimination { front: scalar.front(), inverses: &mut inverses };
        task.with_simd(pulp::Scalar::new()).unwrap();
        prop_assert!(inverses == tiled.inverses);
        let (one, other) = (tiled.lower(), scalar.lower());
        prop_assert!(one.iter().map(|x| x.to_bits()).eq(other.iter().map(|x| x.to_bits())));
    }

    #[test]
    fn a_pivot_that_is_not_positive_is_named(width in 1_usize..80, pivot in 0_usize..80, kind in 0..3) {
        let pivot = pivot % width;
        let shape = Shape { width, below: 5 };
        let mut tiled = Tiled::new(shape, &front(shape, 7));
        *tiled.entry(pivot, pivot) = [-1.0, f64::NAN, f64::INFINITY][kind as usize];
        let found = eliminate(tiled.front(), &mut Vec::new());
        prop_assert_eq!(found, Err(pivot));
    }
}
