//! Fronts put together: columns of the matrix, and what the children of a supernode have left.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use std::ops::Range;

use super::front::{RowPlace, Shape};
use super::supernodes::Supernodes;
use super::tiles::{Column, ROWS, Triangle};
use crate::BlockMatrix;

/// Memory for putting fronts together.
#[derive(Default)]
pub(super) struct Assembly {
    /// Place of each node among those of the front.
    places: Vec<u32>,
    /// Where the rows of each node of the front are.
    row_places: Vec<RowPlace>,
    /// Where each column of a child is among those of the front.
    columns: Vec<u32>,
    runs: Vec<Run>,
}

/// Rows of a tile of a child that are next to each other in a tile of the front as well.
struct Run {
    from: usize,
    count: usize,
    /// Where the tile of the front begins.
    tile: usize,
    to: usize,
}

/// Part of a front.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Part {
    Columns,
    Contribution,
}

impl Assembly {
    /// Begins the columns of a front: zeros and those of the matrix.
    pub(super) fn begin(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        s: usize,
        shape: Shape,
        target: &mut [Column],
    ) {
        let (nodes, rows) = (supernodes.nodes(s), supernodes.rows(s));
        self.places.resize(matrix.pattern().node_count(), 0);
        let own = nodes.clone().map(|node| node as u32).chain(rows.iter().copied());
        self.row_places.clear();
        for (place, node) in own.enumerate() {
            self.places[node as usize] = place as u32;
            self.row_places.push(RowPlace::new(shape, 3 * place));
        }
        target.fill(Column::ZERO);
        for node in nodes.clone() {
            let first = 3 * (node - nodes.start);
            for (row, block) in supernodes.column(matrix, node) {
                let to = &self.row_places[self.places[row as usize] as usize];
                for (column, entries) in target[to.columns + first..].iter_mut().zip(&block) {
                    column.rows_mut()[to.row..][..3].copy_from_slice(entries);
                }
            }
        }
    }

    /// Adds to one part of a front what a child has left for it.
    pub(super) fn add(
        &mut self,
        rows: &[u32],
        contribution: &[Column],
        shape: Shape,
        part: Part,
        target: &mut [Column],
    ) {
        let Self { places, row_places, columns, runs } = self;
        let places = rows.iter().map(|&row| places[row as usize]);
        columns.clear();
        columns.extend(places.flat_map(|place| [0, 1, 2].map(|k| 3 * place + k)));
        let split = columns.partition_point(|&column| (column as usize) < shape.width);
        let range = match part {
            Part::Columns => 0..split,
            Part::Contribution => split..columns.len(),
        };
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                let first = if part == Part::Columns { 0 } else { shape.width };
                let sum = Sum { columns, row_places, contribution, range, part, first };
                sum.add(runs, target);
            },
        );
    }
}

/// The sum of a child's contribution and one part of a front.
struct Sum<'a> {
    columns: &'a [u32],
    row_places: &'a [RowPlace],
    contribution: &'a [Column],
    /// Columns of the child that belong to the part, and its first column in the front.
    range: Range<usize>,
    part: Part,
    first: usize,
}

impl Sum<'_> {
    #[inline(always)]
    fn add(&self, runs: &mut Vec<Run>, target: &mut [Column]) {
        let Self { columns, contribution, range, .. } = self;
        let triangle = Triangle { size: columns.len() };
        for tile in range.start / ROWS..triangle.tile_count() {
            let first = ROWS * tile;
            let source = &contribution[triangle.tile(tile)];
            self.find_runs(first, runs);
            // Blocks of columns, so that a block is read from the nearest cache for every run.
            for begin in (range.start / ROWS * ROWS..first.min(range.end)).step_by(ROWS) {
                let block = begin.max(range.start)..range.end.min(begin + ROWS);
                for run in &*runs {
                    let target = &mut target[run.tile..];
                    run.add(&source[block.clone()], &columns[block.clone()], self.first, target);
                }
            }
            // On the diagonal, the rows from the diagonal block on.
            for node in (range.start.max(first)..range.end.min(first + ROWS)).step_by(3) {
                let skipped = node - first;
                for run in runs.iter().filter(|run| skipped < run.from + run.count) {
                    let skip = skipped.saturating_sub(run.from);
                    let rest = Run {
                        from: run.from + skip,
                        to: run.to + skip,
                        count: run.count - skip,
                        ..*run
                    };
                    let target = &mut target[run.tile..];
                    rest.add(&source[node..node + 3], &columns[node..node + 3], self.first, target);
                }
            }
        }
    }

    /// Finds the runs among the rows of a tile.
    #[inline(always)]
    fn find_runs(&self, first: usize, runs: &mut Vec<Run>) {
        runs.clear();
        for (node, rows) in self.columns[first..].chunks_exact(3).take(ROWS / 3).enumerate() {
            let place = self.row_places[rows[0] as usize / 3];
            let tile = match self.part {
                Part::Columns => place.columns,
                Part::Contribution => place.contribution,
            };
            match runs.last_mut() {
                Some(run) if run.tile == tile && run.to + run.count == place.row => run.count += 3,
                _ => runs.push(Run { from: 3 * node, count: 3, tile, to: place.row }),
            }
        }
    }
}

impl Run {
    #[inline(always)]
    fn add(&self, source: &[Column], columns: &[u32], first: usize, target: &mut [Column]) {
        match self.count {
            3 => self.add_rows::<3>(source, columns, first, target),
            6 => self.add_rows::<6>(source, columns, first, target),
            9 => self.add_rows::<9>(source, columns, first, target),
            12 => self.add_rows::<12>(source, columns, first, target),
            15 => self.add_rows::<15>(source, columns, first, target),
            18 => self.add_rows::<18>(source, columns, first, target),
            21 => self.add_rows::<21>(source, columns, first, target),
            _ => self.add_rows::<24>(source, columns, first, target),
        }
    }

    #[inline(always)]
    fn add_rows<const N: usize>(
        &self,
        source: &[Column],
        columns: &[u32],
        first: usize,
        target: &mut [Column],
    ) {
        for (source, &column) in source.iter().zip(columns) {
            let source: &[f64; N] = source.rows()[self.from..].first_chunk().expect("a run");
            let target = target[column as usize - first].rows_mut();
            let target: &mut [f64; N] = target[self.to..].first_chunk_mut().expect("a run");
            for (sum, value) in target.iter_mut().zip(source) {
                *sum += value;
            }
        }
    }
}
