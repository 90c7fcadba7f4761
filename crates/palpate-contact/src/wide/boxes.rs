//! The boxes of the wide layout and their refit.

use palpate_geometry::Point;

use super::WIDTH;
use crate::simd::{EightBoxes, Isa, Kernel, Lanes};

/// Eight boxes: three cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Block {
    pub(crate) min: [[f32; WIDTH]; 3],
    pub(crate) max: [[f32; WIDTH]; 3],
}

const _: () = assert!(size_of::<Block>() == 192);

impl Block {
    /// Boxes that meet nothing.
    pub(crate) const EMPTY: Self =
        Self { min: [[f32::INFINITY; WIDTH]; 3], max: [[f32::NEG_INFINITY; WIDTH]; 3] };

    /// The least and the largest corners.
    #[inline(always)]
    pub(super) fn sides(&self) -> EightBoxes<'_> {
        [&self.min, &self.max]
    }
}

/// Outward rounding: a value of `f32` that stands for a real number x is at most this part of x, or
/// [`f32::MIN_POSITIVE`], away. Twice what a conversion from `f64` needs.
const ROUNDING: f32 = f32::EPSILON;

/// Boxes of boxes, eight by eight.
#[derive(Debug)]
pub(crate) struct Levels {
    /// `levels[0]`: boxes of the elements; `levels[k]`: boxes of the blocks of level k - 1. The last
    /// has one block.
    levels: Vec<Vec<Block>>,
    /// A level above the last: everything in lane 0.
    above: Block,
}

impl Levels {
    /// All levels over `block_count` blocks, their boxes empty.
    pub(super) fn empty(block_count: usize) -> Self {
        let mut levels = Vec::new();
        let mut count = block_count;
        while count > 0 {
            levels.push(vec![Block::EMPTY; count]);
            count = if count == 1 { 0 } else { count.div_ceil(WIDTH) };
        }
        Self { levels, above: Block::EMPTY }
    }

    /// Number of levels; zero without elements.
    pub(crate) fn depth(&self) -> usize {
        self.levels.len()
    }

    /// Blocks of level `k`, of any k.
    pub(super) fn level(&self, k: usize) -> &[Block] {
        self.levels.get(k).map_or(std::slice::from_ref(&self.above), Vec::as_slice)
    }

    /// Number of blocks of all levels.
    pub(crate) fn block_count(&self) -> u64 {
        self.levels.iter().map(|level| level.len() as u64).sum()
    }

    pub(super) fn bytes(&self) -> usize {
        let levels = self.levels.iter().map(|level| size_of_val(level.as_slice()));
        levels.sum::<usize>() + size_of::<Block>()
    }

    /// Lower and upper corner of a box around everything; `None` where that exceeds `f32`, or nothing is
    /// there.
    pub(crate) fn bounds(&self) -> Option<[[f32; 3]; 2]> {
        let bounds = [self.above.min, self.above.max].map(|side| side.map(|axis| axis[0]));
        bounds.as_flattened().iter().all(|value| value.abs() < f32::MAX).then_some(bounds)
    }

    /// At least the largest coordinate; infinite where `f32` ends.
    pub(super) fn largest_coordinate(&self) -> f32 {
        let largest = |bounds: [[f32; 3]; 2]| {
            bounds.as_flattened().iter().fold(0.0, |largest: f32, value| largest.max(value.abs()))
        };
        self.bounds().map_or(f32::INFINITY, largest)
    }

    /// Recomputes the boxes of `count` elements, whose nodes the `corners` name, pads included, and all
    /// above.
    pub(super) fn refit<const N: usize>(
        &mut self,
        isa: Isa,
        nodes: &[[f32; 4]],
        corners: &[[u32; N]],
        count: usize,
    ) {
        let Some((blocks, mut parents)) = self.levels.split_first_mut() else {
            return;
        };
        isa.run(RefitElements { nodes, corners, blocks });
        empty_pads(count, blocks);
        let mut children: &[Block] = blocks;
        while let Some((level, rest)) = parents.split_first_mut() {
            isa.run(RefitParents { children, parents: level });
            children = level;
            parents = rest;
        }
        isa.run(RefitParents { children, parents: std::slice::from_mut(&mut self.above) });
    }
}

/// Positions relative to `origin` in `f32`, of either sign at most [`f32::MAX`].
pub(super) fn narrow(
    nodes: &mut [[f32; 4]],
    surface_nodes: &[u32],
    positions: &[Point],
    origin: Point,
) {
    for (narrowed, &node) in nodes.iter_mut().zip(surface_nodes) {
        let position = &positions[node as usize];
        for axis in 0..3 {
            let value = (position[axis] - origin[axis]) as f32;
            narrowed[axis] = value.clamp(-f32::MAX, f32::MAX);
        }
    }
}

fn empty_pads(count: usize, blocks: &mut [Block]) {
    if let Some(block) = blocks.get_mut(count / WIDTH) {
        for axis in 0..3 {
            block.min[axis][count % WIDTH..].fill(f32::INFINITY);
            block.max[axis][count % WIDTH..].fill(f32::NEG_INFINITY);
        }
    }
}

struct RefitElements<'a, const N: usize> {
    nodes: &'a [[f32; 4]],
    corners: &'a [[u32; N]],
    blocks: &'a mut [Block],
}

impl<const N: usize> Kernel for RefitElements<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (slots, _) = self.corners.as_chunks::<WIDTH>();
        for (slots, block) in slots.iter().zip(self.blocks) {
            let mut min: [L; 3] = gather(self.nodes, slots, 0);
            let mut max = min;
            for corner in 1..N {
                let node: [L; 3] = gather(self.nodes, slots, corner);
                for axis in 0..3 {
                    min[axis] = min[axis].min(node[axis]);
                    max[axis] = max[axis].max(node[axis]);
                }
            }
            for axis in 0..3 {
                let (min, max) = (min[axis], max[axis]);
                at_least_lowest(min.sub(rounding(min))).store(&mut block.min[axis]);
                at_most_largest(max.add(rounding(max))).store(&mut block.max[axis]);
            }
        }
    }
}

/// The corners a, b, c of eight slots, each as x, y, z.
#[inline(always)]
pub(super) fn corners<L: Lanes>(nodes: &[[f32; 4]], slots: &[[u32; 3]; WIDTH]) -> [[L; 3]; 3] {
    [gather(nodes, slots, 0), gather(nodes, slots, 1), gather(nodes, slots, 2)]
}

/// One corner of eight slots.
#[inline(always)]
pub(super) fn gather<L: Lanes, const N: usize>(
    nodes: &[[f32; 4]],
    slots: &[[u32; N]; WIDTH],
    corner: usize,
) -> [L; 3] {
    let [a, b, c, d, e, f, g, h] = slots;
    L::gather([
        &nodes[a[corner] as usize],
        &nodes[b[corner] as usize],
        &nodes[c[corner] as usize],
        &nodes[d[corner] as usize],
        &nodes[e[corner] as usize],
        &nodes[f[corner] as usize],
        &nodes[g[corner] as usize],
        &nodes[h[corner] as usize],
    ])
}

/// How far to round a value outwards. Not less than its last digit, so that the sum or difference,
/// which is rounded itself, reaches at least the next number.
#[inline(always)]
pub(super) fn rounding<L: Lanes>(value: L) -> L {
    value.abs().mul(L::splat(ROUNDING)).add(L::splat(f32::MIN_POSITIVE))
}

/// Boxes end at ± [`f32::MAX`], as all positions do: an infinite box would meet empty ones. NaN stays.
#[inline(always)]
pub(super) fn at_least_lowest<L: Lanes>(value: L) -> L {
    L::splat(-f32::MAX).max(value)
}

#[inline(always)]
pub(super) fn at_most_largest<L: Lanes>(value: L) -> L {
    L::splat(f32::MAX).min(value)
}

struct RefitParents<'a> {
    children: &'a [Block],
    parents: &'a mut [Block],
}

impl Kernel for RefitParents<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let empty = Block::EMPTY;
        for (children, parent) in self.children.chunks(WIDTH).zip(self.parents) {
            let child = |i: usize| children.get(i).unwrap_or(&empty);
            let group: [&Block; WIDTH] = std::array::from_fn(child);
            for axis in 0..3 {
                let mut min = [L::splat(f32::INFINITY); WIDTH];
                let mut max = [L::splat(f32::NEG_INFINITY); WIDTH];
                for i in 0..WIDTH {
                    min[i] = L::load(&group[i].min[axis]);
                    max[i] = L::load(&group[i].max[axis]);
                }
                L::min_of_each(min).store(&mut parent.min[axis]);
                L::max_of_each(max).store(&mut parent.max[axis]);
            }
        }
    }
}
