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

use std::marker::PhantomData;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use pulp::Simd;

use super::front::Shape;
use super::pages::Pages;
use super::real::Real;
use super::stored::Stored;
use super::supernodes::Supernodes;

/// Rows of a panel: one to eight vectors of any machine and precision.
pub(super) const ROWS: usize = 32;
/// Running sums per column in the backward pass: the longest vector.
pub(super) const LANES: usize = 16;

/// A column of a panel as numbers.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Panel<T>(pub(super) [T; ROWS]);

#[derive(Debug, PartialEq)]
pub(super) struct Supernode {
    start: u32,
    width: u32,
    /// Where the nodes of its rows below are among those of all.
    first_node: u32,
    end_node: u32,
    /// Where its panels are among the columns of all.
    first_panel: usize,
    end_panel: usize,
}

impl Supernode {
    pub(super) fn columns(&self) -> Range<usize> {
        self.start as usize..(self.start + self.width) as usize
    }

    pub(super) fn panels(&self) -> Range<usize> {
        self.first_panel..self.end_panel
    }

    pub(super) fn nodes_below(&self) -> Range<usize> {
        self.first_node as usize..self.end_node as usize
    }

    pub(super) fn row_count(&self) -> usize {
        self.width as usize + 3 * self.nodes_below().len()
    }
}

/// The packed factor of one matrix.
#[derive(Debug)]
pub(super) struct PackedFactor<P> {
    pub(super) supernodes: Vec<Supernode>,
    /// Nodes of the rows below each supernode, by their place in the order.
    pub(super) nodes_below: Vec<u32>,
    /// The panels of all supernodes.
    pages: Pages,
    panels: PhantomData<P>,
    /// Rows and columns.
    pub(super) size: usize,
    pub(super) widest: usize,
    /// Rows of the longest supernode, whole panels.
    pub(super) longest: usize,
}

impl<P> Default for PackedFactor<P> {
    fn default() -> Self {
        Self {
            supernodes: Vec::new(),
            nodes_below: Vec::new(),
            pages: Pages::default(),
            panels: PhantomData,
            size: 0,
            widest: 0,
            longest: 0,
        }
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
    /// The factor of some supernodes, without its numbers, in memory that may have been that of another one.
    pub(super) fn new(supernodes: &Supernodes, spare: Pages) -> Self {
        let mut factor = Self { size: 3 * supernodes.node_count(), ..Self::default() };
        for s in 0..supernodes.count() {
            for nodes in supernodes.piece_nodes(s) {
                let own = nodes.end as u32..supernodes.nodes(s).end as u32;
                factor.push(nodes, own.chain(supernodes.rows(s).iter().copied()));
            }
        }
        factor.pages = spare.fitting(factor.panel_count() * size_of::<P>());
        factor
    }

    /// Adds a supernode of some nodes, with those below it.
    fn push(&mut self, nodes: Range<usize>, below: impl Iterator<Item = u32>) {
        let (first_panel, first_node) = (self.panel_count(), self.nodes_below.len());
        self.nodes_below.extend(below);
        let width = 3 * nodes.len();
        let shape = Shape { width, below: 3 * (self.nodes_below.len() - first_node) };
        let supernode = Supernode {
            start: 3 * nodes.start as u32,
            width: width as u32,
            first_node: first_node as u32,
            end_node: self.nodes_below.len() as u32,
            first_panel,
            end_panel: first_panel + shape.panel_count(),
        };
        self.widest = self.widest.max(width);
        self.longest = self.longest.max(supernode.row_count().next_multiple_of(ROWS));
        self.supernodes.push(supernode);
    }

    /// Columns of all panels.
    fn panel_count(&self) -> usize {
        self.supernodes.last().map_or(0, |supernode| supernode.end_panel)
    }

    /// The panels of all supernodes, one after the other.
    fn panels(&self) -> &[P] {
        self.pages.values(self.panel_count())
    }

    /// The panels of some supernodes.
    pub(super) fn panels_of(&self, supernodes: Range<usize>) -> &[P] {
        &self.panels()[self.panel_range(supernodes)]
    }

    /// As [`PackedFactor::panels_of`].
    pub(super) fn panels_of_mut(&mut self, supernodes: Range<usize>) -> &mut [P] {
        let (count, range) = (self.panel_count(), self.panel_range(supernodes));
        &mut self.pages.values_mut(count)[range]
    }

    fn panel_range(&self, supernodes: Range<usize>) -> Range<usize> {
        let supernodes = &self.supernodes[supernodes];
        match (supernodes.first(), supernodes.last()) {
            (Some(first), Some(last)) => first.first_panel..last.end_panel,
            _ => 0..0,
        }
    }

    pub(super) fn into_pages(self) -> Pages {
        self.pages
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.panels())
            + size_of_val(&*self.nodes_below)
            + size_of_val(&*self.supernodes)
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
        let panels = self.panels();
        for supernode in &self.supernodes {
            let width = supernode.width as usize;
            let top = &mut work.top.as_chunks_mut::<K>().0[..width];
            top.copy_from_slice(&x[supernode.columns()]);
            if top.as_flattened().iter().all(|&value| value == P::Real::ZERO) {
                continue;
            }
            let rows = work.rows.as_chunks_mut::<K>().0;
            let mut panels = &panels[supernode.panels()];
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
            let x = x.as_chunks_mut::<3>().0;
            let nodes = &self.nodes_below[supernode.nodes_below()];
            for (&node, values) in nodes.iter().zip(rows_below.as_chunks::<3>().0) {
                let x = x[node as usize].as_flattened_mut();
                for (x, &value) in x.iter_mut().zip(values.as_flattened()) {
                    *x -= value;
                }
            }
        }
    }

    #[allow(clippy::inline_always)] // as `forward`
    #[inline(always)]
    fn backward<S: Simd, const K: usize>(&self, simd: S, work: &mut PackedWorkspace<P::Real>) {
        let x = work.x.as_chunks_mut::<K>().0;
        let panels = self.panels();
        for supernode in self.supernodes.iter().rev() {
            let width = supernode.width as usize;
            let rows = work.rows.as_chunks_mut::<K>().0;
            rows[..width].copy_from_slice(&x[supernode.columns()]);
            let nodes = &self.nodes_below[supernode.nodes_below()];
            let row_count = supernode.row_count();
            let rows_below = rows[width..row_count].as_chunks_mut::<3>().0;
            let x_nodes = x.as_chunks::<3>().0;
            for (values, &node) in rows_below.iter_mut().zip(nodes) {
                let x = x_nodes[node as usize].as_flattened();
                for (value, &x) in values.as_flattened_mut().iter_mut().zip(x) {
                    *value = P::Real::ZERO - x;
                }
            }
            rows[row_count..row_count.next_multiple_of(ROWS)].fill([P::Real::ZERO; K]);
            let sums = &mut work.sums[..K * width];
            sums.fill([P::Real::ZERO; LANES]);
            let mut panels = &panels[supernode.panels()];
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
                    value[k] = total(simd, &sums[k]);
                }
            }
        }
    }
}

/// The sum of all lanes: half of them and the other half are added until one is left.
#[allow(clippy::inline_always)] // compiled for the vector unit of the caller
#[inline(always)]
fn total<S: Simd, T: Real>(simd: S, lanes: &[T; LANES]) -> T {
    let vectors = T::vectors::<S>(lanes);
    let mut sums = [vectors[0]; LANES];
    sums[..vectors.len()].copy_from_slice(vectors);
    let mut half = vectors.len() / 2;
    while half > 0 {
        for i in 0..half {
            sums[i] = T::plus(simd, sums[i], sums[i + half]);
        }
        half /= 2;
    }
    T::total(simd, sums[0])
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

#[cfg(test)]
mod tests {
    use palpate_testing::Random;

    use super::*;

    struct Total<T>([T; LANES]);

    impl<T: Real> pulp::WithSimd for Total<T> {
        type Output = f64;

        fn with_simd<S: Simd>(self, simd: S) -> f64 {
            total(simd, &self.0).to_f64()
        }
    }

    /// On every vector unit that there is.
    fn totals<T: Real>(lanes: [T; LANES]) -> Vec<f64> {
        let mut totals = vec![
            pulp::WithSimd::with_simd(Total(lanes), pulp::Scalar::new()),
            pulp::Arch::new().dispatch(Total(lanes)),
        ];
        #[cfg(target_arch = "x86_64")]
        totals.extend(pulp::x86::V3::try_new().map(|simd| Simd::vectorize(simd, Total(lanes))));
        totals
    }

    #[test]
    fn totals_have_the_same_bits_on_every_vector_unit() {
        let mut random = Random(5);
        for _ in 0..1000 {
            // Of very different sizes, so that another order would be another sum.
            let lanes: [f64; LANES] =
                std::array::from_fn(|lane| random.between(-1.0, 1.0) * 7f64.powi(lane as i32 % 5));
            let halved = |mut sums: Vec<f64>, round: fn(f64) -> f64| {
                while sums.len() > 1 {
                    let (low, high) = sums.split_at(sums.len() / 2);
                    sums = low.iter().zip(high).map(|(a, b)| round(a + b)).collect();
                }
                sums[0].to_bits()
            };
            let double = halved(lanes.to_vec(), |sum| sum);
            assert!(totals(lanes).iter().all(|total| total.to_bits() == double));
            let narrow = lanes.map(|lane| lane as f32);
            let single = halved(narrow.map(f64::from).to_vec(), |sum| f64::from(sum as f32));
            assert!(totals(narrow).iter().all(|total| total.to_bits() == single));
        }
    }
}
