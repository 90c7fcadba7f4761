//! Elements in blocks.

use palpate_geometry::Point;

use super::WIDTH;
use super::boxes::Levels;
use super::order::block_order;
use crate::simd::Isa;

/// Elements of N nodes (triangles, edges or nodes) with an implicit eight-ary hierarchy of boxes.
#[derive(Debug)]
pub(crate) struct Hierarchy<const N: usize> {
    /// Per slot: indices into the body's nodes. The last block is filled up with pads.
    pub(super) corners: Vec<[u32; N]>,
    /// Per slot but the pads: the element; empty where elements are their slots.
    elements: Vec<u32>,
    /// Number of slots without the pads.
    pub(super) count: usize,
    pub(crate) boxes: Levels,
}

impl<const N: usize> Hierarchy<N> {
    /// Elements by their nodes, ordered by `positions` of the nodes.
    pub(super) fn new(elements: &[[u32; N]], positions: &[Point]) -> Self {
        let share = |node: u32| positions[node as usize].map(|value| value / N as f64);
        let centers: Vec<Point> = elements
            .iter()
            .map(|corners| {
                let shares = corners.map(share);
                std::array::from_fn(|axis| shares.iter().map(|share| share[axis]).sum())
            })
            .collect();
        let order = block_order(&centers);
        let corners = order.iter().map(|&element| elements[element as usize]).collect();
        Self { elements: order, ..Self::in_order(corners) }
    }

    /// Elements by their nodes, which stand in a good order.
    pub(super) fn in_order(mut corners: Vec<[u32; N]>) -> Self {
        let count = corners.len();
        corners.resize(count.next_multiple_of(WIDTH), [0; N]);
        let boxes = Levels::empty(corners.len() / WIDTH);
        Self { corners, elements: Vec::new(), count, boxes }
    }

    /// The element in a slot, which is not a pad.
    pub(crate) fn element(&self, slot: u32) -> u32 {
        self.elements.get(slot as usize).copied().unwrap_or(slot)
    }

    /// The element in each slot but the pads.
    pub(super) fn slots(&self) -> impl Iterator<Item = u32> {
        (0..self.count as u32).map(|slot| self.element(slot))
    }

    /// Which lanes of a block hold elements.
    pub(super) fn lanes(&self, block: usize) -> u8 {
        let count = self.count - block * WIDTH;
        if count >= WIDTH { u8::MAX } else { (1 << count) - 1 }
    }

    /// Bytes of the slots.
    pub(super) fn slot_bytes(&self) -> usize {
        size_of_val(self.corners.as_slice()) + size_of_val(self.elements.as_slice())
    }

    pub(super) fn refit(&mut self, isa: Isa, nodes: &[[f32; 4]]) {
        self.boxes.refit(isa, nodes, &self.corners, self.count);
    }
}
