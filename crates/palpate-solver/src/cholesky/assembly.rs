//! Fronts put together: columns of the matrix, and what the children of a supernode have left.

#![allow(clippy::inline_always)] // compiled for the vector unit of the caller

use super::front::{Front, RowPlace, Shape};
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
    to: RowPlace,
}

impl Assembly {
    /// Begins a front: zeros and the columns of the matrix.
    pub(super) fn begin(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        s: usize,
        front: &mut Front,
    ) {
        let (nodes, rows) = (supernodes.nodes(s), supernodes.rows(s));
        self.places.resize(matrix.pattern().node_count(), 0);
        let own = nodes.clone().map(|node| node as u32).chain(rows.iter().copied());
        self.row_places.clear();
        for (place, node) in own.enumerate() {
            self.places[node as usize] = place as u32;
            self.row_places.push(RowPlace::new(front.shape, 3 * place));
        }
        front.columns.fill(Column::ZERO);
        front.contribution.fill(Column::ZERO);
        for node in nodes.clone() {
            let first = 3 * (node - nodes.start);
            for (row, block) in supernodes.column(matrix, node) {
                let to = &self.row_places[self.places[row as usize] as usize];
                for (column, entries) in front.columns[to.columns + first..].iter_mut().zip(&block)
                {
                    column.rows_mut()[to.row..][..3].copy_from_slice(entries);
                }
            }
        }
    }

    /// Adds what a child has left.
    pub(super) fn add(
        &mut self,
        supernodes: &Supernodes,
        child: usize,
        contribution: &[Column],
        front: &mut Front,
    ) {
        let rows = supernodes.rows(child);
        let Self { places, row_places, columns, runs } = self;
        let places = rows.iter().map(|&row| places[row as usize]);
        columns.clear();
        columns.extend(places.flat_map(|place| [0, 1, 2].map(|k| 3 * place + k)));
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || add(columns, row_places, contribution, front, runs),
        );
    }
}

#[inline(always)]
fn add(
    columns: &[u32],
    row_places: &[RowPlace],
    contribution: &[Column],
    front: &mut Front,
    runs: &mut Vec<Run>,
) {
    let Shape { width, .. } = front.shape;
    // Those before stand among the columns of the front, the others in its contribution.
    let split = columns.partition_point(|&column| (column as usize) < width);
    let triangle = Triangle { size: columns.len() };
    for tile in 0..triangle.tile_count() {
        let first = ROWS * tile;
        let source = &contribution[triangle.tile(tile)];
        runs.clear();
        for (node, rows) in columns[first..].chunks_exact(3).take(ROWS / 3).enumerate() {
            let to = row_places[rows[0] as usize / 3];
            match runs.last_mut() {
                Some(run) if run.to.columns == to.columns && run.to.row + run.count == to.row => {
                    run.count += 3;
                }
                _ => runs.push(Run { from: 3 * node, count: 3, to }),
            }
        }
        // Blocks of columns, so that a block is read from the nearest cache for every run.
        for begin in (0..first).step_by(ROWS) {
            let middle = split.clamp(begin, begin + ROWS);
            for run in &*runs {
                let target = &mut front.columns[run.to.columns..];
                run.add(&source[begin..middle], &columns[begin..middle], target);
                if middle < begin + ROWS {
                    let target = &mut front.contribution[run.to.contribution..];
                    let columns = &columns[middle..begin + ROWS];
                    run.add_below(&source[middle..begin + ROWS], columns, width, target);
                }
            }
        }
        // On the diagonal, the rows from the diagonal block on.
        for (node, columns) in columns[first..].chunks_exact(3).take(ROWS / 3).enumerate() {
            let source = &source[first + 3 * node..][..3];
            for run in &*runs {
                let skip = (3 * node).saturating_sub(run.from);
                if skip >= run.count {
                    continue;
                }
                let (from, to, count) = (run.from + skip, run.to.row + skip, run.count - skip);
                let target = if (columns[0] as usize) < width {
                    &mut front.columns[run.to.columns + columns[0] as usize..][..3]
                } else {
                    &mut front.contribution[run.to.contribution + columns[0] as usize - width..]
                        [..3]
                };
                for (target, source) in target.iter_mut().zip(source) {
                    let target = target.rows_mut()[to..][..count].as_chunks_mut::<3>().0;
                    let source = source.rows()[from..][..count].as_chunks::<3>().0;
                    for (target, source) in target.iter_mut().zip(source) {
                        for k in 0..3 {
                            target[k] += source[k];
                        }
                    }
                }
            }
        }
    }
}

impl Run {
    #[inline(always)]
    fn add(&self, source: &[Column], columns: &[u32], target: &mut [Column]) {
        self.add_below(source, columns, 0, target);
    }

    #[inline(always)]
    fn add_below(&self, source: &[Column], columns: &[u32], width: usize, target: &mut [Column]) {
        match self.count {
            3 => self.add_rows::<3>(source, columns, width, target),
            6 => self.add_rows::<6>(source, columns, width, target),
            9 => self.add_rows::<9>(source, columns, width, target),
            12 => self.add_rows::<12>(source, columns, width, target),
            15 => self.add_rows::<15>(source, columns, width, target),
            18 => self.add_rows::<18>(source, columns, width, target),
            21 => self.add_rows::<21>(source, columns, width, target),
            _ => self.add_rows::<24>(source, columns, width, target),
        }
    }

    #[inline(always)]
    fn add_rows<const N: usize>(
        &self,
        source: &[Column],
        columns: &[u32],
        width: usize,
        target: &mut [Column],
    ) {
        for (source, &column) in source.iter().zip(columns) {
            let source: &[f64; N] = source.rows()[self.from..].first_chunk().expect("a run");
            let target = target[column as usize - width].rows_mut();
            let target: &mut [f64; N] = target[self.to.row..].first_chunk_mut().expect("a run");
            for (sum, value) in target.iter_mut().zip(source) {
                *sum += value;
            }
        }
    }
}
