//! The wide layout: the surface triangles of a body in blocks of eight, in the order of a bounding tree's
//! leaves, and above them an implicit eight-ary hierarchy of boxes in level order.
//!
//! Boxes are `f32`, relative to an origin near the bodies, and rounded outwards, so that no pair is
//! missed. What never changes is precomputed: which triangles share a node, and which features of
//! those that do are still pairs.

#![allow(clippy::inline_always, reason = "kernels must be inlined: see `simd`")]

mod adjacency;
mod boxes;
mod features;
mod order;
mod separation;
#[cfg(test)]
mod tests;
mod traverse;

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::Mesh;
use palpate_model::mesh::NONE;

use crate::simd::Isa;
pub(crate) use adjacency::{Adjacency, bits, owned_pairs};
use boxes::Block;
pub(crate) use features::{EdgePairs, VertexPairs};
pub(crate) use separation::{Reach, SeparateTriangles};
pub(crate) use traverse::{Sides, Traversal};

/// Triangles of a block, and children of a block of the hierarchy.
pub(crate) const WIDTH: usize = 8;

/// One body in the wide layout.
#[derive(Debug)]
pub(crate) struct WideBody {
    mesh: Arc<Mesh>,
    /// Surface nodes, in the order in which the triangles meet them, as nodes of the mesh.
    surface_nodes: Vec<u32>,
    /// Positions of the surface nodes less the frame's origin; the fourth number is padding.
    nodes: Vec<[f32; 4]>,
    /// Per slot: three indices into `nodes`, and the triangle of the mesh ([`NONE`] in a pad).
    slots: Vec<[u32; 4]>,
    /// Per slot: bit i set when the triangle owns its node i, bit 3 + i its edge i (ab, bc, ca).
    owned: Vec<u8>,
    /// `levels[0]`: boxes of the triangles; `levels[k]`: boxes of the blocks of level k - 1. The last
    /// has one block.
    levels: Vec<Vec<Block>>,
    /// A level above the last: the whole body in lane 0.
    above: Block,
    adjacency: Adjacency,
}

impl WideBody {
    /// Packs the surface of `mesh`.
    pub(crate) fn pack(mesh: &Arc<Mesh>) -> Self {
        let order = order::block_order(mesh);
        let mut local = vec![NONE; mesh.nodes().len()];
        let mut surface_nodes = Vec::with_capacity(mesh.surface_nodes().len());
        let owned_by_triangle = owned_features(mesh);
        let (mut slots, mut owned) = (Vec::new(), Vec::new());
        for &triangle in &order {
            let [a, b, c] = mesh.triangles()[triangle as usize].map(|node| {
                let index = &mut local[node as usize];
                if *index == NONE {
                    *index = surface_nodes.len() as u32;
                    surface_nodes.push(node);
                }
                *index
            });
            slots.push([a, b, c, triangle]);
            owned.push(owned_by_triangle[triangle as usize]);
        }
        slots.resize(order.len().next_multiple_of(WIDTH), [0, 0, 0, NONE]);
        owned.resize(slots.len(), 0);
        let adjacency = Adjacency::new(&slots, &owned, surface_nodes.len());
        Self {
            mesh: Arc::clone(mesh),
            nodes: vec![[0.0; 4]; surface_nodes.len()],
            surface_nodes,
            levels: boxes::empty_levels(slots.len() / WIDTH),
            above: Block::EMPTY,
            slots,
            owned,
            adjacency,
        }
    }

    /// Whether this is `mesh`, packed.
    pub(crate) fn is_of(&self, mesh: &Arc<Mesh>) -> bool {
        Arc::ptr_eq(&self.mesh, mesh)
    }

    pub(crate) fn adjacency(&self) -> &Adjacency {
        &self.adjacency
    }

    /// The mesh's node of an index into `nodes`.
    pub(crate) fn mesh_node(&self, node: u32) -> u32 {
        self.surface_nodes[node as usize]
    }

    pub(crate) fn slots(&self) -> &[[u32; 4]] {
        &self.slots
    }

    /// The mesh's triangle in a slot.
    pub(crate) fn triangle(&self, slot: u32) -> u32 {
        self.slots[slot as usize][3]
    }

    pub(crate) fn owned(&self, slot: u32) -> u8 {
        self.owned[slot as usize]
    }

    /// Number of levels; zero without triangles.
    pub(crate) fn depth(&self) -> usize {
        self.levels.len()
    }

    /// Blocks of level `k`, of any k.
    pub(crate) fn level(&self, k: usize) -> &[Block] {
        self.levels.get(k).map_or(std::slice::from_ref(&self.above), Vec::as_slice)
    }

    /// At least the largest coordinate of the body relative to the origin; infinite where `f32` ends.
    pub(crate) fn largest_coordinate(&self) -> f32 {
        let [min, max] = [self.above.min, self.above.max].map(|side| side.map(|axis| axis[0]));
        min.iter().chain(&max).fold(0.0, |largest, value| largest.max(value.abs()))
    }

    /// Moves the body: all boxes anew, one pass per level.
    pub(crate) fn refit(&mut self, isa: Isa, positions: &[Point], origin: Point) {
        boxes::narrow(&mut self.nodes, &self.surface_nodes, positions, origin);
        boxes::refit(isa, &self.nodes, &self.slots, &mut self.levels, &mut self.above);
    }
}

/// Per triangle the features that it owns: those that no triangle before it has.
fn owned_features(mesh: &Mesh) -> Vec<u8> {
    let mut node_seen = vec![false; mesh.nodes().len()];
    let mut edge_seen = vec![false; mesh.surface_edges().len()];
    let triangles = mesh.triangles().iter().zip(mesh.triangle_edges());
    let owned = triangles.map(|(nodes, edges)| {
        let mut bits = 0;
        for i in 0..3 {
            let new_node = !std::mem::replace(&mut node_seen[nodes[i] as usize], true);
            let new_edge = !std::mem::replace(&mut edge_seen[edges[i] as usize], true);
            bits |= u8::from(new_node) << i | u8::from(new_edge) << (3 + i);
        }
        bits
    });
    owned.collect()
}
