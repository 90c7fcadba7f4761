//! Elements in blocks, and the boxes above them.

use palpate_geometry::Point;
use palpate_model::mesh::NONE;

use super::WIDTH;
use super::boxes::{self, Block};
use super::order::block_order;
use crate::simd::Isa;

/// Elements of one kind (triangles, edges or nodes) with an implicit eight-ary hierarchy of boxes.
#[derive(Debug)]
pub(crate) struct Hierarchy {
    /// Per slot: three indices into the body's nodes, the last repeated where the element has fewer,
    /// and the element ([`NONE`] in a pad).
    pub(super) slots: Vec<[u32; 4]>,
    /// `levels[0]`: boxes of the elements; `levels[k]`: boxes of the blocks of level k - 1. The last
    /// has one block.
    levels: Vec<Vec<Block>>,
    /// A level above the last: everything in lane 0.
    above: Block,
}

impl Hierarchy {
    /// Elements by their nodes, ordered by `positions` of the nodes.
    pub(super) fn new(elements: &[[u32; 3]], positions: &[Point]) -> Self {
        let third = |node: u32| positions[node as usize].map(|value| value / 3.0);
        let centers: Vec<Point> = elements
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(third);
                std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
            })
            .collect();
        Self::from_order(elements, block_order(&centers).into_iter())
    }

    /// Elements by their nodes, which stand in a good order.
    pub(super) fn in_order(elements: &[[u32; 3]]) -> Self {
        Self::from_order(elements, 0..elements.len() as u32)
    }

    fn from_order(elements: &[[u32; 3]], order: impl Iterator<Item = u32>) -> Self {
        let slot = |element: u32| {
            let [a, b, c] = elements[element as usize];
            [a, b, c, element]
        };
        let mut slots: Vec<[u32; 4]> = order.map(slot).collect();
        slots.resize(slots.len().next_multiple_of(WIDTH), [0, 0, 0, NONE]);
        let levels = boxes::empty_levels(slots.len() / WIDTH);
        Self { slots, levels, above: Block::EMPTY }
    }

    /// The element in a slot.
    pub(crate) fn element(&self, slot: u32) -> u32 {
        self.slots[slot as usize][3]
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

    pub(super) fn refit(&mut self, isa: Isa, nodes: &[[f32; 4]]) {
        boxes::refit(isa, nodes, &self.slots, &mut self.levels, &mut self.above);
    }
}
