//! Element stiffness: the tangent of each element, made positive semi-definite, into a block matrix.

use palpate_solver::block_matrix::Block;
use pulp::Simd;

use super::group::Group;
use super::kernel::{Elements, Task};
use super::law::ElementLaw;
use super::matrix;
use super::projection::{SIZE, Tangent, is_semidefinite, without_negative};
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

/// Adds the stiffness of each element to `blocks`.
pub(super) struct Stiffness<'a> {
    pub(super) lambda: f64,
    pub(super) places: &'a [Places],
    pub(super) blocks: &'a mut [Block],
    pub(super) values: [[[Eight; 3]; 3]; 10],
    pub(super) group: usize,
}

impl Task for Stiffness<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        let tangent = tangent(law, elements, self.lambda);
        let gradients = gradients(elements);
        for pair in 0..10 {
            let [row, col] = PAIRS[pair];
            for a in 0..3 {
                // Stress along a on this corner's gradient, per entry of the deformation gradient.
                let mut stress = [elements.volume; SIZE];
                for entry in 0..SIZE {
                    stress[entry] = elements.volume
                        * (gradients[row][0] * tangent[3 * a][entry]
                            + gradients[row][1] * tangent[3 * a + 1][entry]
                            + gradients[row][2] * tangent[3 * a + 2][entry]);
                }
                for b in 0..3 {
                    let value = gradients[col][0] * stress[3 * b]
                        + gradients[col][1] * stress[3 * b + 1]
                        + gradients[col][2] * stress[3 * b + 2];
                    value.store(&mut self.values[pair][a][b], elements.part);
                }
            }
        }
        self.group = elements.index;
    }

    fn finish_group(&mut self, _: &Group) {
        for (pair, [row, col]) in PAIRS.into_iter().enumerate() {
            let values = &self.values[pair];
            for (lane, place) in self.places[self.group][pair].iter().enumerate() {
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

/// Derivative of the stress by the deformation gradient, entry `3 a + k` for row a, column k; where it
/// is not positive semi-definite, the nearest matrix that is.
#[inline(always)]
fn tangent<S: Simd, L: ElementLaw>(
    law: &L,
    elements: &Elements<S>,
    lambda: f64,
) -> Tangent<Wide<S>> {
    let (zero, one) = (elements.volume.splat(0.0), elements.volume.splat(1.0));
    let mut raw = [[zero; SIZE]; SIZE];
    for entry in 0..SIZE {
        let mut slope = matrix::zero(zero);
        slope[entry / 3][entry % 3] = one;
        let change = elements.stress_slope(law, &slope, lambda, zero);
        for row in 0..SIZE {
            raw[row][entry] = change[row / 3][row % 3];
        }
    }
    let half = one.splat(0.5);
    let mut symmetric = raw;
    for row in 0..SIZE {
        for col in 0..SIZE {
            symmetric[row][col] = half * (raw[row][col] + raw[col][row]);
        }
    }
    let keep = is_semidefinite(&symmetric);
    let mut lanes = [1.0; LANES];
    keep.store(&mut lanes, 0);
    if lanes.iter().all(|&keep| keep == 1.0) {
        return symmetric;
    }
    let projected = without_negative(&symmetric);
    for row in 0..SIZE {
        for col in 0..SIZE {
            symmetric[row][col] = keep.if_greater(half, symmetric[row][col], projected[row][col]);
        }
    }
    symmetric
}

/// Shape gradients of the four corners [1/m].
#[inline(always)]
fn gradients<S: Simd>(elements: &Elements<S>) -> [[Wide<S>; 3]; 4] {
    let [b, c, d] = elements.inverse;
    let mut first = b;
    for axis in 0..3 {
        first[axis] = -(b[axis] + c[axis] + d[axis]);
    }
    [first, b, c, d]
}
