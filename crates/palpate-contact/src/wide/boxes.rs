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

/// All levels over `block_count` blocks, their boxes empty.
pub(super) fn empty_levels(block_count: usize) -> Vec<Vec<Block>> {
    let mut levels = Vec::new();
    let mut count = block_count;
    while count > 0 {
        levels.push(vec![Block::EMPTY; count]);
        count = if count == 1 { 0 } else { count.div_ceil(WIDTH) };
    }
    levels
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

/// Recomputes all levels.
pub(super) fn refit(
    isa: Isa,
    nodes: &[[f32; 4]],
    slots: &[[u32; 4]],
    levels: &mut [Vec<Block>],
    above: &mut Block,
) {
    let Some((blocks, mut parents)) = levels.split_first_mut() else {
        return;
    };
    isa.run(RefitTriangles { nodes, slots, blocks });
    empty_pads(slots, blocks);
    let mut children: &[Block] = blocks;
    while let Some((level, rest)) = parents.split_first_mut() {
        isa.run(RefitParents { children, parents: level });
        children = level;
        parents = rest;
    }
    isa.run(RefitParents { children, parents: std::slice::from_mut(above) });
}

fn empty_pads(slots: &[[u32; 4]], blocks: &mut [Block]) {
    let (Some(last), Some(block)) = (slots.last_chunk::<WIDTH>(), blocks.last_mut()) else {
        return;
    };
    for (lane, slot) in last.iter().enumerate() {
        if slot[3] == palpate_model::mesh::NONE {
            for axis in 0..3 {
                block.min[axis][lane] = f32::INFINITY;
                block.max[axis][lane] = f32::NEG_INFINITY;
            }
        }
    }
}

struct RefitTriangles<'a> {
    nodes: &'a [[f32; 4]],
    slots: &'a [[u32; 4]],
    blocks: &'a mut [Block],
}

impl Kernel for RefitTriangles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (slots, _) = self.slots.as_chunks::<WIDTH>();
        for (slots, block) in slots.iter().zip(self.blocks) {
            let [a, b, c] = corners::<L>(self.nodes, slots);
            for axis in 0..3 {
                let min = a[axis].min(b[axis]).min(c[axis]);
                let max = a[axis].max(b[axis]).max(c[axis]);
                at_least_lowest(min.sub(rounding(min))).store(&mut block.min[axis]);
                at_most_largest(max.add(rounding(max))).store(&mut block.max[axis]);
            }
        }
    }
}

/// The corners a, b, c of eight slots, each as x, y, z.
#[inline(always)]
pub(super) fn corners<L: Lanes>(nodes: &[[f32; 4]], slots: &[[u32; 4]; WIDTH]) -> [[L; 3]; 3] {
    [gather(nodes, slots, 0), gather(nodes, slots, 1), gather(nodes, slots, 2)]
}

#[inline(always)]
fn gather<L: Lanes>(nodes: &[[f32; 4]], slots: &[[u32; 4]; WIDTH], corner: usize) -> [L; 3] {
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
