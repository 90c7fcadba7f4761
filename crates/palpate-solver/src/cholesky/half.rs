//! Half solutions: the forward pass alone, for unit forces on a few nodes.
//!
//! With `A = L Lᵀ` and `Y_i = L⁻¹ E_i` for the three unit forces on node i, the displacement of node i
//! under forces on node j is `Y_iᵀ Y_j`. `Y_i` is zero except along the path of the elimination tree
//! from the node to the root, so that it is short and costs a part of the forward pass; a column of A⁻¹
//! needs a whole backward pass on top. Two paths are the same from where they meet to the root.
//!
//! A half solution is stored from the root on, every supernode's part filled up with zeros to whole
//! vectors, so that what two have in common is the beginning of both.

use pulp::Simd;

use super::packed::{PackedFactor, Panel, ROWS};
use super::real::Real;
use super::stored::Stored;
use super::supernodes::Supernodes;

/// Right-hand sides that go through the tree together: a whole number of vectors of any machine, and a
/// whole number of nodes.
const SIDES: usize = 48;
pub(super) const NODES: usize = SIDES / 3;
/// Whole vectors of f32 of any machine.
const LANES: usize = 16;
const NONE: u32 = u32::MAX;

/// L⁻¹ times the three unit forces on a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HalfSolution {
    /// Axis after axis.
    values: Vec<f32>,
}

impl HalfSolution {
    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.values)
    }

    fn axis(&self, axis: usize) -> &[f32] {
        let length = self.values.len() / 3;
        &self.values[axis * length..][..length]
    }
}

/// Displacements of node `moved` under unit forces on node `loaded`, for each pair of their half
/// solutions and what they have in common ([`super::Cholesky::common_lengths`]): entry `3 * axis + k`
/// is along k under the force along axis. The bits are those of the transpose for the pair turned
/// round.
///
/// # Panics
/// If half solutions are shorter than what they have in common.
pub fn half_products<'a>(
    pairs: impl Iterator<Item = ([&'a HalfSolution; 2], u32)>,
    store: impl FnMut([f32; 9]),
) {
    pulp::Arch::new().dispatch(Products { pairs, store });
}

struct Products<I, F> {
    pairs: I,
    store: F,
}

impl<'a, I, F> pulp::WithSimd for Products<I, F>
where
    I: Iterator<Item = ([&'a HalfSolution; 2], u32)>,
    F: FnMut([f32; 9]),
{
    type Output = ();

    #[allow(clippy::inline_always)] // compiled for the vector unit that `dispatch` found
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for ([moved, loaded], common) in self.pairs {
            let mut sums = [simd.splat_f32s(0.0); 9];
            add_products(simd, [moved, loaded], 0..common as usize, &mut sums);
            let mut result = [0.0; 9];
            for (value, sum) in result.iter_mut().zip(sums) {
                *value = simd.reduce_sum_f32s(sum);
            }
            (self.store)(result);
        }
    }
}

/// Loaded and moved half solutions whose products are made together, and entries of each that caches hold
/// meanwhile.
const TILE: [usize; 2] = [8, 4];
const PART: usize = 16 * LANES;

/// [`half_products`] of all `moved` with all `loaded`, to the last bit, when they are many: each is read once for
/// a few of the others. `common(moved, loaded)` is what two of them have in common, by their places, and `store`
/// takes their places and the product.
///
/// # Panics
/// As [`half_products`].
pub fn half_products_between(
    moved: &[&HalfSolution],
    loaded: &[&HalfSolution],
    common: impl Fn(usize, usize) -> u32,
    store: impl FnMut(usize, usize, [f32; 9]),
) {
    pulp::Arch::new().dispatch(ProductsBetween { moved, loaded, common, store });
}

struct ProductsBetween<'a, C, F> {
    moved: &'a [&'a HalfSolution],
    loaded: &'a [&'a HalfSolution],
    common: C,
    store: F,
}

impl<C, F> pulp::WithSimd for ProductsBetween<'_, C, F>
where
    C: Fn(usize, usize) -> u32,
    F: FnMut(usize, usize, [f32; 9]),
{
    type Output = ();

    #[allow(clippy::inline_always)] // as above
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for (first_loaded, loaded) in (0..).step_by(TILE[0]).zip(self.loaded.chunks(TILE[0])) {
            for (first_moved, moved) in (0..).step_by(TILE[1]).zip(self.moved.chunks(TILE[1])) {
                let mut ends = [[0; TILE[1]]; TILE[0]];
                let mut longest = 0;
                for (l, ends) in ends.iter_mut().take(loaded.len()).enumerate() {
                    for (m, end) in ends.iter_mut().take(moved.len()).enumerate() {
                        *end = (self.common)(first_moved + m, first_loaded + l) as usize;
                        longest = longest.max(*end);
                    }
                }
                let mut sums = [[[simd.splat_f32s(0.0); 9]; TILE[1]]; TILE[0]];
                for begin in (0..longest).step_by(PART) {
                    for ((l, sums), ends) in loaded.iter().zip(&mut sums).zip(&ends) {
                        for ((m, sums), &end) in moved.iter().zip(sums).zip(ends) {
                            let end = end.min(begin + PART);
                            if begin < end {
                                add_products(simd, [m, l], begin..end, sums);
                            }
                        }
                    }
                }
                for (l, sums) in sums.iter().take(loaded.len()).enumerate() {
                    for (m, sums) in sums.iter().take(moved.len()).enumerate() {
                        let mut result = [0.0; 9];
                        for (value, &sum) in result.iter_mut().zip(sums) {
                            *value = simd.reduce_sum_f32s(sum);
                        }
                        (self.store)(first_moved + m, first_loaded + l, result);
                    }
                }
            }
        }
    }
}

/// Adds the products of some entries of two half solutions.
#[allow(clippy::inline_always)] // as above
#[inline(always)]
fn add_products<S: Simd>(
    simd: S,
    [moved, loaded]: [&HalfSolution; 2],
    entries: std::ops::Range<usize>,
    sums: &mut [S::f32s; 9],
) {
    let moved = [0, 1, 2].map(|k| S::as_simd_f32s(&moved.axis(k)[entries.clone()]).0);
    let loaded = [0, 1, 2].map(|k| S::as_simd_f32s(&loaded.axis(k)[entries.clone()]).0);
    let mut own = *sums;
    let vectors = (moved[0].iter().zip(moved[1]).zip(moved[2]))
        .zip(loaded[0].iter().zip(loaded[1]).zip(loaded[2]));
    for (((&ax, &ay), &az), ((&bx, &by), &bz)) in vectors {
        let (a, b) = ([ax, ay, az], [bx, by, bz]);
        for axis in 0..3 {
            for k in 0..3 {
                own[3 * axis + k] = simd.mul_add_f32s(a[k], b[axis], own[3 * axis + k]);
            }
        }
    }
    *sums = own;
}

/// Where the parts of half solutions stand: the tree of the pieces of supernodes.
#[derive(Debug, Default)]
pub(super) struct Paths {
    parents: Vec<u32>,
    /// Begin and end of each piece's part.
    parts: Vec<(u32, u32)>,
    /// Piece of each node, in the order of elimination.
    of_node: Vec<u32>,
}

impl Paths {
    pub(super) fn new(supernodes: &Supernodes, node_count: usize) -> Self {
        let of_node: Vec<u32> =
            (0..node_count).map(|node| supernodes.piece_of_node(node) as u32).collect();
        let (mut parents, mut widths) = (Vec::new(), Vec::new());
        for s in 0..supernodes.count() {
            let end = supernodes.nodes(s).end;
            for nodes in supernodes.piece_nodes(s) {
                let below = supernodes.rows(s).first().map(|&row| row as usize);
                let above = if nodes.end < end { Some(nodes.end) } else { below };
                parents.push(above.map_or(NONE, |node| of_node[node]));
                widths.push((3 * nodes.len()).next_multiple_of(LANES) as u32);
            }
        }
        let mut parts: Vec<(u32, u32)> = vec![(0, 0); parents.len()];
        for (piece, &parent) in parents.iter().enumerate().rev() {
            let begin = if parent == NONE { 0 } else { parts[parent as usize].1 };
            parts[piece] = (begin, begin + widths[piece]);
        }
        Self { parents, parts, of_node }
    }

    fn up(&self, from: u32) -> impl Iterator<Item = u32> + '_ {
        let next = |&s: &u32| Some(self.parents[s as usize]).filter(|&parent| parent != NONE);
        std::iter::successors(Some(from), next)
    }

    /// Writes, by the branch of the other node, what half solutions have in common with that at `place`.
    pub(super) fn common_lengths(&self, place: usize, lengths: &mut Vec<u32>) {
        lengths.clear();
        lengths.resize(self.parents.len(), 0);
        let mut root = 0;
        for s in self.up(self.of_node[place]) {
            lengths[s as usize] = self.parts[s as usize].1;
            root = s as usize;
        }
        // Parents come after their children: from the root down.
        for s in (0..root).rev() {
            let parent = self.parents[s];
            if lengths[s] == 0 && parent != NONE {
                lengths[s] = lengths[parent as usize];
            }
        }
    }

    pub(super) fn half_bytes(&self, place: usize) -> usize {
        3 * self.parts[self.of_node[place] as usize].1 as usize * size_of::<f32>()
    }

    /// Branch of the tree that the node at `place` is on.
    pub(super) fn branch(&self, place: usize) -> usize {
        self.of_node[place] as usize
    }
}

/// Memory for half solutions with one packed factor.
#[derive(Debug, Default)]
pub(super) struct HalfWorkspace<T> {
    /// Right-hand sides of each column.
    x: Vec<[T; SIDES]>,
    rows: Vec<[T; SIDES]>,
    /// A panel as numbers.
    panel: Vec<Panel<T>>,
    /// Supernodes on the paths of the nodes, ascending.
    path: Vec<u32>,
    is_on_path: Vec<bool>,
}

impl<P: Stored> PackedFactor<P> {
    /// Half solutions of the nodes at `places`, at most [`NODES`]: neighbours in the order of elimination
    /// share most of their paths.
    pub(super) fn half_solve(
        &self,
        paths: &Paths,
        places: &[u32],
        halves: &mut [HalfSolution],
        work: &mut HalfWorkspace<P::Real>,
    ) {
        let (columns, longest) = (self.size, self.longest);
        work.x.resize(columns.max(work.x.len()), [P::Real::ZERO; SIDES]);
        work.rows.resize(longest.max(work.rows.len()), [P::Real::ZERO; SIDES]);
        let panel = P::memory_columns(self.widest);
        work.panel.resize(panel.max(work.panel.len()), Panel::<P::Real>::ZERO);
        work.is_on_path.resize(self.supernodes.len().max(work.is_on_path.len()), false);
        work.path.clear();
        for &place in places {
            for s in paths.up(paths.of_node[place as usize]) {
                if std::mem::replace(&mut work.is_on_path[s as usize], true) {
                    break;
                }
                work.path.push(s);
            }
        }
        work.path.sort_unstable();
        for &s in &work.path {
            work.is_on_path[s as usize] = false;
            work.x[self.supernodes[s as usize].columns()].fill([P::Real::ZERO; SIDES]);
        }
        for (index, &place) in places.iter().enumerate() {
            for axis in 0..3 {
                work.x[3 * place as usize + axis][3 * index + axis] = P::Real::from_f64(1.0);
            }
        }
        pulp::Arch::new().dispatch(HalfPass { factor: self, work, sides: 3 * places.len() });
        for (index, (&place, half)) in places.iter().zip(halves).enumerate() {
            let last = paths.of_node[place as usize];
            let length = paths.parts[last as usize].1 as usize;
            half.values.clear();
            // There are many of them: none takes more than it needs.
            half.values.reserve_exact(3 * length);
            half.values.resize(3 * length, 0.0);
            for s in paths.up(last) {
                let begin = paths.parts[s as usize].0 as usize;
                let x = &work.x[self.supernodes[s as usize].columns()];
                for axis in 0..3 {
                    let part = &mut half.values[axis * length + begin..];
                    for (value, sides) in part.iter_mut().zip(x) {
                        *value = sides[3 * index + axis].to_f64() as f32;
                    }
                }
            }
        }
    }
}

/// The forward pass along some paths for many right-hand sides.
struct HalfPass<'a, P: Stored> {
    factor: &'a PackedFactor<P>,
    work: &'a mut HalfWorkspace<P::Real>,
    sides: usize,
}

impl<P: Stored> pulp::WithSimd for HalfPass<'_, P> {
    type Output = ();

    #[allow(clippy::inline_always)] // as above
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let HalfPass { factor, work, sides } = self;
        let vectors = sides.div_ceil(P::Real::lanes::<S>());
        let padded = vectors * P::Real::lanes::<S>();
        for &s in &work.path {
            let supernode = &factor.supernodes[s as usize];
            let row_count = supernode.row_count();
            let mut panels = factor.panels_of(s as usize..s as usize + 1);
            let top = &work.x[supernode.columns()];
            for first in (0..row_count).step_by(ROWS) {
                let (panel, rest) = panels.split_at(top.len().min(first + ROWS));
                panels = rest;
                let panel = P::panel(panel, &mut work.panel);
                let top = &top[..panel.len()];
                for row in (0..ROWS.min(row_count - first)).step_by(8) {
                    let rows = &mut work.rows[first + row..][..8];
                    let mut vector = 0;
                    while vector + 3 <= vectors {
                        eight_rows::<S, P::Real, 3>(simd, panel, top, row, vector, rows);
                        vector += 3;
                    }
                    match vectors - vector {
                        0 => {}
                        1 => product::<S, P::Real, 8, 1>(simd, panel, top, row, vector, rows),
                        _ => eight_rows::<S, P::Real, 2>(simd, panel, top, row, vector, rows),
                    }
                }
            }
            let (rows_top, rows_below) = work.rows.split_at(supernode.columns().len());
            work.x[supernode.columns()].copy_from_slice(rows_top);
            let x_nodes = work.x.as_chunks_mut::<3>().0;
            let nodes = &factor.nodes_below[supernode.nodes_below()];
            for (&node, values) in nodes.iter().zip(rows_below.as_chunks::<3>().0) {
                for (x, values) in x_nodes[node as usize].iter_mut().zip(values) {
                    for (x, &value) in x[..padded].iter_mut().zip(values) {
                        *x -= value;
                    }
                }
            }
        }
    }
}

/// Eight rows of a panel times `G` vectors, four at a time: more sums than that have no registers.
#[allow(clippy::inline_always)] // as above
#[inline(always)]
fn eight_rows<S: Simd, T: Real, const G: usize>(
    simd: S,
    panel: &[Panel<T>],
    top: &[[T; SIDES]],
    row: usize,
    vector: usize,
    rows: &mut [[T; SIDES]],
) {
    let (upper, lower) = rows.split_at_mut(4);
    product::<S, T, 4, G>(simd, panel, top, row, vector, upper);
    product::<S, T, 4, G>(simd, panel, top, row + 4, vector, lower);
}

/// `R` rows of a panel from `row` on times `G` vectors of right-hand sides from `vector` on.
#[allow(clippy::inline_always)] // as above
#[inline(always)]
fn product<S: Simd, T: Real, const R: usize, const G: usize>(
    simd: S,
    panel: &[Panel<T>],
    top: &[[T; SIDES]],
    row: usize,
    vector: usize,
    rows: &mut [[T; SIDES]],
) {
    let mut sums = [[T::splat(simd, T::ZERO); G]; R];
    for (column, sides) in panel.iter().zip(top) {
        let sides = &T::vectors::<S>(sides)[vector..][..G];
        for (sums, &entry) in sums.iter_mut().zip(&column.0[row..][..R]) {
            let entry = T::splat(simd, entry);
            for g in 0..G {
                sums[g] = T::mul_add(simd, entry, sides[g], sums[g]);
            }
        }
    }
    for (row, sums) in rows.iter_mut().zip(sums) {
        T::vectors_mut::<S>(row)[vector..][..G].copy_from_slice(&sums);
    }
}
