//! Where the entries of a front are.

use std::ops::Range;

use super::packed::ROWS as PANEL;
use super::tiles::{Column, GROUP, ROWS, Triangle};

/// A front: its columns to be eliminated, as the tiles of their square, then those of the rows below; and
/// what they leave for the rows below, a triangle of its own.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Columns to be eliminated.
    pub(super) width: usize,
    /// Rows below their square.
    pub(super) below: usize,
}

impl Shape {
    pub(super) fn top(self) -> Triangle {
        Triangle { size: self.width }
    }

    pub(super) fn contribution(self) -> Triangle {
        Triangle { size: self.below }
    }

    pub(super) fn bottom_tile_count(self) -> usize {
        self.below.div_ceil(ROWS)
    }

    /// Columns of each tile of the rows below.
    pub(super) fn bottom_width(self) -> usize {
        self.width.next_multiple_of(GROUP)
    }

    /// Where the columns of a tile of the rows below are.
    pub(super) fn bottom_tile(self, tile: usize) -> Range<usize> {
        let start = self.top().column_count() + tile * self.bottom_width();
        start..start + self.bottom_width()
    }

    /// Columns of all panels of the factor.
    pub(super) fn panel_count(self) -> usize {
        let firsts = (0..self.width + self.below).step_by(PANEL);
        firsts.map(|first| self.width.min(first + PANEL)).sum()
    }

    /// Columns of all tiles, without those of the contribution.
    pub(super) fn column_count(self) -> usize {
        self.bottom_tile(self.bottom_tile_count()).start
    }
}

/// Where a row of a front is: its tile among the columns, and in the contribution if it is a row below.
#[derive(Clone, Copy)]
pub(super) struct RowPlace {
    pub(super) columns: usize,
    pub(super) contribution: usize,
    /// Row of the tile.
    pub(super) row: usize,
}

impl RowPlace {
    pub(super) fn new(shape: Shape, row: usize) -> Self {
        if row < shape.width {
            let columns = shape.top().tile(row / ROWS).start;
            Self { columns, contribution: 0, row: row % ROWS }
        } else {
            let below = row - shape.width;
            let tile = below / ROWS;
            Self {
                columns: shape.bottom_tile(tile).start,
                contribution: shape.contribution().tile(tile).start,
                row: below % ROWS,
            }
        }
    }
}

/// A front with its memory.
pub(super) struct Front<'a> {
    pub(super) shape: Shape,
    pub(super) columns: &'a mut [Column],
    pub(super) contribution: &'a mut [Column],
}
