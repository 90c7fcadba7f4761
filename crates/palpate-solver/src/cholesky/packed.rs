//! The factor packed for solving.
//!
//! Each piece of a supernode, called a supernode here, stores P = [T^-1; B T^-1] for its diagonal block T and the block B below it, so
//! that both passes of a solve are one dense product per supernode:
//!
//! forward, ascending: `u = P x_top`, `x_top = u_top`, `x[pattern] -= u_below`;
//! backward, descending: `x_top = P^T [x_top; -x[pattern]]`.
//!
//! P lies in panels of [`ROWS`] rows, column after column, without the columns that are zero in the
//! whole panel. A solve is bound by reading it once per pass, so that single precision halves its time.

use std::sync::Arc;

use pulp::Simd;

use super::memory::Spare;
use super::real::Real;
use super::stored::Stored;

/// Rows of a panel: one to eight vectors of any machine and precision.
pub(super) const ROWS: usize = 32;
/// Running sums per column in the backward pass: the longest vector.
pub(super) const LANES: usize = 16;

/// A column of a panel as numbers.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Panel<T>(pub(super) [T; ROWS]);

#[derive(Debug)]
pub(super) struct Supernode<P> {
    start: u32,
    width: u32,
    pattern_start: u32,
    pattern_end: u32,
    /// Those of a supernode that a change has left alone are the same in both factors.
    pub(super) panels: Arc<Vec<P>>,
}

impl<P> Supernode<P> {
    pub(super) fn columns(&self) -> std::ops::Range<usize> {
        self.start as usize..(self.start + self.width) as usize
    }

    pub(super) fn pattern(&self) -> std::ops::Range<usize> {
        self.pattern_start as usize..self.pattern_end as usize
    }

    pub(super) fn row_count(&self) -> usize {
        (self.width + self.pattern_end - self.pattern_start) as usize
    }
}

/// The packed factor of one matrix.
#[derive(Debug)]
pub(super) struct PackedFactor<P> {
    pub(super) supernodes: Vec<Supernode<P>>,
    pub(super) pattern: Vec<u32>,
    /// Rows and columns.
    pub(super) size: usize,
    pub(super) widest: usize,
    /// Rows of the longest supernode, whole panels.
    pub(super) longest: usize,
}

impl<P> Default for PackedFactor<P> {
    fn default() -> Self {
        Self { supernodes: Vec::new(), pattern: Vec::new(), size: 0, widest: 0, longest: 0 }
    }
}

/// Memory for solves with one packed factor, for one thread.
#[derive(Debug, Default)]
pub(super) struct PackedWorkspace<T> {
    x: Vec<T>,
    top: Vec<T>,
    rows: Vec<T>,
    sums: Vec<[T; LANES]>,
}

impl<P: Stored> PackedFactor<P> {
    /// A factor of `size` columns without any supernode.
    pub(super) fn new(size: usize) -> Self {
        Self { size, ..Self::default() }
    }

    /// Leaves its panels as memory.
    pub(super) fn clear(&mut self, spare: &mut Spare<P>) {
        std::mem::take(self).supernodes.into_iter().for_each(|s| spare.give(s.panels));
    }

    /// Adds a supernode of `width` columns from `start` on: the rows of B, and the panels of P.
    pub(super) fn push(
        &mut self,
        start: u32,
        width: usize,
        rows: impl Iterator<Item = u32>,
        panels: Arc<Vec<P>>,
    ) {
        let pattern_start = self.pattern.len() as u32;
        self.pattern.extend(rows);
        let supernode = Supernode {
            start,
            width: width as u32,
            pattern_start,
            pattern_end: self.pattern.len() as u32,
            panels,
        };
        self.widest = self.widest.max(width);
        self.longest = self.longest.max(supernode.row_count().next_multiple_of(ROWS));
        self.supernodes.push(supernode);
    }

    pub(super) fn bytes(&self) -> usize {
        let panels = self.supernodes.iter().map(|supernode| size_of_val(&**supernode.panels));
        panels.sum::<usize>() + size_of_val(&*self.pattern) + size_of_val(&*self.supernodes)
    }

    /// Makes the memory large enough; it is so after the first time.
    pub(super) fn fit(&self, work: &mut PackedWorkspace<P::Real>) {
        work.x.resize(3 * self.size, P::Real::ZERO);
        work.top.resize(3 * self.widest, P::Real::ZERO);
        work.rows.resize(3 * self.longest, P::Real::ZERO);
        work.sums.resize(3 * self.widest, [P::Real::ZERO; LANES]);
    }

    pub(super) fn solve_in_place(
        &self,
        order: &[u32],
        rhs: &mut [[f64; 3]],
        work: &mut PackedWorkspace<P::Real>,
    ) {
        assert_eq!(rhs.len(), order.len(), "one entry per node");
        self.fit(work);
        for (x, &node) in work.x.as_chunks_mut::<3>().0.iter_mut().zip(order) {
            *x = rhs[node as usize].map(P::Real::from_f64);
        }
        pulp::Arch::new().dispatch(Passes::<P, 1> { factor: self, work });
        for (x, &node) in work.x.as_chunks::<3>().0.iter().zip(order) {
            rhs[node as usize] = x.map(P::Real::to_f64);
        }
    }

    pub(super) fn solve_two_in_place(
        &self,
        order: &[u32],
        first: &mut [[f64; 3]],
        second: &mut [[f64; 3]],
        work: &mut PackedWorkspace<P::Real>,
    ) {
        assert!(first.len() == order.len() && second.len() == order.len(), "one entry per node");
        self.fit(work);
        for (x, &node) in work.x.as_chunks_mut::<6>().0.iter_mut().zip(order) {
            let sides = [&first[node as usize], &second[node as usize]];
            *x = std::array::from_fn(|entry| P::Real::from_f64(sides[entry % 2][entry / 2]));
        }
        pulp::Arch::new().dispatch(Passes::<P, 2> { factor: self, work });
        for (x, &node) in work.x.as_chunks::<6>().0.iter().zip(order) {
            first[node as usize] = std::array::from_fn(|axis| x[2 * axis].to_f64());
            second[node as usize] = std::array::from_fn(|axis| x[2 * axis + 1].to_f64());
        }
    }

    pub(super) fn solve_three_in_place(
        &self,
        order: &[u32],
        sides: &mut [[f64; 9]],
        work: &mut PackedWorkspace<P::Real>,
    ) {
        assert_eq!(sides.len(), order.len(), "one entry per node");
        self.fit(work);
        for (x, &node) in work.x.as_chunks_mut::<9>().0.iter_mut().zip(order) {
            let side = &sides[node as usize];
            *x = std::array::from_fn(|entry| P::Real::from_f64(side[3 * (entry % 3) + entry / 3]));
        }
        pulp::Arch::new().dispatch(Passes::<P, 3> { factor: self, work });
        for (x, &node) in work.x.as_chunks::<9>().0.iter().zip(order) {
            let value = |entry: usize| x[3 * (entry % 3) + entry / 3].to_f64();
            sides[node as usize] = std::array::from_fn(value);
        }
    }

    #[allow(clippy::inline_always)] // compiled for the vector unit that `dispatch` found
    #[inline(always)]
    fn forward<S: Simd, const K: usize>(&self, simd: S, work: &mut PackedWorkspace<P::Real>) {
        let x = work.x.as_chunks_mut::<K>().0;
        for supernode in &self.supernodes {
            let width = supernode.width as usize;
            let top = &mut work.top.as_chunks_mut::<K>().0[..width];
            top.copy_from_slice(&x[supernode.columns()]);
            if top.as_flattened().iter().all(|&value| value == P::Real::ZERO) {
                continue;
            }
            let rows = work.rows.as_chunks_mut::<K>().0;
            let mut panels = &supernode.panels[..];
            for first in (0..supernode.row_count()).step_by(ROWS) {
                let (panel, rest) = panels.split_at(width.min(first + ROWS));
                panels = rest;
                let sums = P::product::<S, K>(simd, panel, top);
                for (lane, row) in rows[first..first + ROWS].iter_mut().enumerate() {
                    for k in 0..K {
                        row[k] = sums[k][lane];
                    }
                }
            }
            let (rows_top, rows_below) = rows.split_at(width);
            x[supernode.columns()].copy_from_slice(rows_top);
            for (&row, value) in self.pattern[supernode.pattern()].iter().zip(rows_below) {
                for k in 0..K {
                    let x = &mut x[row as usize][k];
                    *x -= value[k];
                }
            }
        }
    }

    #[allow(clippy::inline_always)] // as `forward`
    #[inline(always)]
    fn backward<S: Simd, const K: usize>(&self, simd: S, work: &mut PackedWorkspace<P::Real>) {
        let x = work.x.as_chunks_mut::<K>().0;
        for supernode in self.supernodes.iter().rev() {
            let width = supernode.width as usize;
            let rows = work.rows.as_chunks_mut::<K>().0;
            rows[..width].copy_from_slice(&x[supernode.columns()]);
            let pattern = &self.pattern[supernode.pattern()];
            let row_count = supernode.row_count();
            for (value, &row) in rows[width..row_count].iter_mut().zip(pattern) {
                for k in 0..K {
                    value[k] = P::Real::ZERO - x[row as usize][k];
                }
            }
            rows[row_count..row_count.next_multiple_of(ROWS)].fill([P::Real::ZERO; K]);
            let sums = &mut work.sums[..K * width];
            sums.fill([P::Real::ZERO; LANES]);
            let mut panels = &supernode.panels[..];
            for first in (0..row_count).step_by(ROWS) {
                let (panel, rest) = panels.split_at(width.min(first + ROWS));
                panels = rest;
                let mut values = [[P::Real::ZERO; ROWS]; K];
                for (lane, row) in rows[first..first + ROWS].iter().enumerate() {
                    for k in 0..K {
                        values[k][lane] = row[k];
                    }
                }
                let sums = sums.as_chunks_mut::<K>().0;
                P::add_transposed_product::<S, K>(simd, panel, &values, sums);
            }
            for (value, sums) in x[supernode.columns()].iter_mut().zip(sums.as_chunks::<K>().0) {
                for k in 0..K {
                    value[k] = sums[k].iter().fold(P::Real::ZERO, |sum, &part| sum + part);
                }
            }
        }
    }
}

/// Both passes of a solve, for the vector unit that the machine has.
struct Passes<'a, P: Stored, const K: usize> {
    factor: &'a PackedFactor<P>,
    work: &'a mut PackedWorkspace<P::Real>,
}

impl<P: Stored, const K: usize> pulp::WithSimd for Passes<'_, P, K> {
    type Output = ();

    #[allow(clippy::inline_always)] // as `forward`
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.factor.forward::<S, K>(simd, self.work);
        self.factor.backward::<S, K>(simd, self.work);
    }
}
