//! Element stiffness: the tangent of each element, made positive semi-definite, into a block matrix.

use palpate_solver::BlockPattern;
use palpate_solver::block_matrix::Block;
use pulp::Simd;

use super::corners::NodeCorners;
use super::group::{Group, Layout, PADDING};
use super::kernel::{Elements, Task};
use super::law::ElementLaw;
use super::matrix::{self, Matrix};
use super::principal::{PrincipalTangent, axes};
use super::real::Real;
use super::wide::{Eight, LANES, Wide};

/// Pairs of corners (row, column) of the blocks of an element: its lower triangle.
pub(super) const PAIRS: [[usize; 2]; 10] =
    [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1], [2, 2], [3, 0], [3, 1], [3, 2], [3, 3]];

/// Where the block of a pair is stored, and whether it is stored transposed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) index: u32,
    pub(super) transposed: bool,
}

/// The places of the blocks of a group; lanes that fill the group have volume 0.
pub(super) type Places = [[Place; LANES]; 10];

/// Where the blocks of every group are in the pattern of the tetrahedra.
pub(super) fn places(
    pattern: &BlockPattern,
    layout: &Layout,
    corners: &NodeCorners,
) -> Vec<Places> {
    let mut places = vec![[[Place::default(); LANES]; 10]; layout.groups.len()];
    let mut blocks = vec![0; pattern.node_count()];
    for col in 0..pattern.node_count() {
        for (block, &row) in pattern.range(col).zip(pattern.column(col)) {
            blocks[row as usize] = block as u32;
        }
        for &place in corners.of(col) {
            let [group, corner, lane] = NodeCorners::corner_at(place);
            let nodes = layout.groups[group].corners.map(|nodes| nodes[lane]);
            for (other, row) in nodes.into_iter().enumerate().filter(|&(_, r)| r as usize >= col) {
                let pair = inner_pair(corner.max(other), corner.min(other));
                let index = blocks[row as usize];
                places[group][pair][lane] = Place { index, transposed: other < corner };
            }
        }
    }
    for (places, members) in places.iter_mut().zip(&layout.members) {
        for lane in (0..LANES).filter(|&lane| members[lane] == PADDING) {
            for lanes in places.iter_mut() {
                lanes[lane] = lanes[0];
            }
        }
    }
    places
}

/// Adds the stiffness of each element to `blocks`.
pub(super) struct Stiffness<'a> {
    pub(super) lambda: f64,
    pub(super) places: &'a [Places],
    /// Nodes between which it is added; empty: all.
    pub(super) is_wanted: &'a [bool],
    pub(super) blocks: &'a mut [Block],
    pub(super) values: [[[Eight; 3]; 3]; 10],
    pub(super) group: usize,
}

impl Task for Stiffness<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        let blocks = inner_blocks(law, elements, self.lambda);
        // The first corner's from the others': moving all corners together costs nothing.
        let mut beside_first = [blocks[0]; 3];
        for row in 0..3 {
            let mut sum = blocks[inner_pair(row, row)];
            for col in 0..3 {
                if col != row {
                    sum = matrix::add(&sum, &between(&blocks, row, col));
                }
            }
            beside_first[row] = matrix::scale(elements.volume.splat(-1.0), &sum);
        }
        let [b, c, d] = beside_first;
        let sum = matrix::add(&matrix::add(&b, &c), &d);
        let first = matrix::scale(elements.volume.splat(-1.0), &sum);
        let [bb, cb, cc, db, dc, dd] = blocks;
        for (values, block) in self.values.iter_mut().zip([first, b, bb, c, cb, cc, d, db, dc, dd])
        {
            for row in 0..3 {
                for col in 0..3 {
                    block[row][col].store(&mut values[row][col], elements.part);
                }
            }
        }
        self.group = elements.index;
    }

    /// Adds the blocks tetrahedron by tetrahedron: the same sums to the last bit whatever else is in
    /// the group.
    fn finish_group(&mut self, group: &Group) {
        for lane in 0..LANES {
            let wanted = group
                .corners
                .map(|nodes| self.is_wanted.is_empty() || self.is_wanted[nodes[lane] as usize]);
            for (pair, [row, col]) in PAIRS.into_iter().enumerate() {
                if !(wanted[row] && wanted[col]) {
                    continue;
                }
                let (values, place) = (&self.values[pair], &self.places[self.group][pair][lane]);
                let block = &mut self.blocks[place.index as usize];
                for a in 0..3 {
                    for b in 0..3 {
                        // Diagonal blocks are symmetric to the last bit.
                        let turned = if row == col { b < a } else { place.transposed };
                        let value = if turned { values[b][a] } else { values[a][b] };
                        block[a][b] += value[lane];
                    }
                }
            }
        }
    }
}

/// Pairs of the last three corners.
const INNER_PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 0], [1, 1], [2, 0], [2, 1], [2, 2]];

/// Where the pair of corners `row >= col` is among them.
#[inline(always)]
const fn inner_pair(row: usize, col: usize) -> usize {
    row * (row + 1) / 2 + col
}

#[inline(always)]
fn between<R: Real>(blocks: &[Matrix<R>; 6], row: usize, col: usize) -> Matrix<R> {
    if row > col {
        blocks[inner_pair(row, col)]
    } else {
        matrix::transpose(&blocks[inner_pair(col, row)])
    }
}

/// Stiffness between the last three corners. The isotropic part of the tangent is made positive
/// semi-definite; fibres, and viscosity where a step begins, are so by themselves.
#[inline(always)]
fn inner_blocks<S: Simd, L: ElementLaw>(
    law: &L,
    elements: &Elements<S>,
    lambda: f64,
) -> [Matrix<Wide<S>>; 6] {
    let (zero, volume) = (elements.volume.splat(0.0), elements.volume);
    let f = &elements.f;
    let (u, stretches, v) = axes(f);
    let mut tangent = law.principal_tangent(&stretches);
    if let Some(pressure) = elements.pressure {
        let of_volume = PrincipalTangent::of_volume(&stretches, pressure, zero.splat(lambda));
        tangent = tangent.add(&of_volume);
    }
    let tangent = tangent.without_negative(|keep: Wide<S>| {
        let mut lanes = [1.0; LANES];
        keep.store(&mut lanes, 0);
        lanes.iter().all(|&keep| keep == 1.0)
    });
    let gradients = &elements.inverse;
    let along = matrix::multiply(gradients, &v);
    let mut blocks = [matrix::zero(zero); 6];
    for pair in 0..6 {
        let [row, col] = INNER_PAIRS[pair];
        let block = tangent.block(&along[row], &along[col]);
        let block = matrix::multiply(&matrix::multiply(&u, &block), &matrix::transpose(&u));
        blocks[pair] = matrix::scale(volume, &block);
    }
    if let Some((viscosity, _)) = &elements.viscosity {
        let square = matrix::multiply(f, &matrix::transpose(f));
        // Row by row F times a shape gradient.
        let turned = matrix::multiply(gradients, &matrix::transpose(f));
        for pair in 0..6 {
            let [row, col] = INNER_PAIRS[pair];
            let product = inner(&gradients[row], &gradients[col]);
            let block = viscosity.block(&turned[row], &turned[col], product, &square);
            blocks[pair] = matrix::add(&blocks[pair], &matrix::scale(volume, &block));
        }
    }
    for family in 0..L::FAMILIES {
        let direction = &elements.directions[family];
        let fibres = law.fibre_tangent(f, direction);
        let turned = matrix::multiply(gradients, &matrix::transpose(&fibres.normal));
        for pair in 0..6 {
            let [row, col] = INNER_PAIRS[pair];
            let aligned = inner(&gradients[row], direction) * inner(&gradients[col], direction);
            let product = inner(&gradients[row], &gradients[col]);
            let along = volume * (fibres.dispersed * product + fibres.aligned * aligned);
            let steepness = volume * fibres.steepness;
            for a in 0..3 {
                for b in 0..3 {
                    blocks[pair][a][b] =
                        blocks[pair][a][b] + steepness * turned[row][a] * turned[col][b];
                }
                blocks[pair][a][a] = blocks[pair][a][a] + along;
            }
        }
    }
    blocks
}

#[inline(always)]
fn inner<R: Real>(a: &[R; 3], b: &[R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
