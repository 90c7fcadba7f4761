//! The wide layout: the surface triangles of a body in blocks of eight, in the order of a bounding tree's
//! leaves, and above them an implicit eight-ary hierarchy of boxes in level order.
//!
//! Boxes are `f32`, relative to an origin near the bodies, and rounded outwards, so that no pair is
//! missed. What never changes is precomputed: which triangles share a node, and which features of
//! those that do are still pairs.

#![allow(clippy::inline_always, reason = "kernels must be inlined: see `simd`")]

mod adjacency;
mod boxes;
mod crossing;
mod features;
mod hierarchy;
mod nearest;
mod order;
mod regions;
mod separation;
#[cfg(test)]
mod tests;
mod traverse;

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::Mesh;
use palpate_model::mesh::NONE;

use crate::memory::DetectionMemory;
use crate::simd::Isa;
use crate::surface::owned_features;
use adjacency::{Adjacency, Incidence};
pub(crate) use boxes::Block;
pub(crate) use crossing::CrossTriangles;
pub(crate) use features::{EdgePairs, VertexPairs};
pub(crate) use hierarchy::Hierarchy;
pub(crate) use nearest::{BlockMeasure, WideSurface};
pub(crate) use separation::{Reach, SeparateTriangles};
pub(crate) use traverse::{Sides, Traversal, bytes};

/// Elements of a block, and children of a block of the hierarchy.
pub(crate) const WIDTH: usize = 8;

/// One body in the wide layout.
///
/// Intersections are found among the triangles, close pairs among the edges and between nodes and
/// triangles: each pair of features is met once.
#[derive(Debug)]
pub(crate) struct WideBody {
    mesh: Arc<Mesh>,
    /// Surface nodes in the order of `points`, as nodes of the mesh.
    surface_nodes: Vec<u32>,
    /// Positions of the surface nodes less the frame's origin; the fourth number is padding.
    nodes: Vec<[f32; 4]>,
    pub(crate) triangles: Hierarchy<3>,
    pub(crate) edges: Hierarchy<2>,
    pub(crate) points: Hierarchy<1>,
    /// Per slot of `triangles`: which of its features it owns, see [`owned_features`].
    owned: Vec<u8>,
    triangles_of_triangles: Adjacency,
    edges_of_edges: Adjacency,
    triangles_of_points: Adjacency,
    /// Whether `edges` and `points` are where `nodes` are.
    features_refitted: bool,
}

impl WideBody {
    /// Packs the surface of `mesh`, elements that are close to each other at `positions` together: the
    /// two sides of a cut coincide at rest.
    pub(crate) fn pack(mesh: &Arc<Mesh>, positions: &[Point]) -> Self {
        let at = |node: u32| positions[node as usize];
        let node_positions: Vec<Point> = mesh.surface_nodes().iter().map(|&n| at(n)).collect();
        let order = order::block_order(&node_positions);
        let surface_nodes: Vec<u32> =
            order.iter().map(|&index| mesh.surface_nodes()[index as usize]).collect();
        let mut local = vec![NONE; mesh.nodes().len()];
        for (index, &node) in surface_nodes.iter().enumerate() {
            local[node as usize] = index as u32;
        }
        let local = |node: u32| local[node as usize];
        let triangles: Vec<_> = mesh.triangles().iter().map(|nodes| nodes.map(local)).collect();
        let edges: Vec<_> = mesh.surface_edges().iter().map(|nodes| nodes.map(local)).collect();
        let positions: Vec<Point> = surface_nodes.iter().map(|&node| at(node)).collect();
        let (triangles, edges) =
            (Hierarchy::new(&triangles, &positions), Hierarchy::new(&edges, &positions));
        let owned = owned_features(mesh);
        let owned = triangles.slots().map(|triangle| owned[triangle as usize]).collect();
        let node_count = surface_nodes.len();
        let points = Hierarchy::in_order((0..node_count as u32).map(|node| [node]).collect());
        let of_triangles = (&triangles, &Incidence::new(&triangles, node_count));
        let of_edges = (&edges, &Incidence::new(&edges, node_count));
        let of_points = (&points, &Incidence::new(&points, node_count));
        Self {
            mesh: Arc::clone(mesh),
            nodes: vec![[0.0; 4]; node_count],
            surface_nodes,
            triangles_of_triangles: Adjacency::new(of_triangles, of_triangles, true),
            edges_of_edges: Adjacency::new(of_edges, of_edges, true),
            triangles_of_points: Adjacency::new(of_points, of_triangles, false),
            triangles,
            edges,
            points,
            owned,
            features_refitted: false,
        }
    }

    /// Whether this is `mesh`, packed.
    pub(crate) fn is_of(&self, mesh: &Arc<Mesh>) -> bool {
        Arc::ptr_eq(&self.mesh, mesh)
    }

    /// The mesh's node in a slot of `points`.
    pub(crate) fn mesh_node(&self, slot: u32) -> u32 {
        self.surface_nodes[slot as usize]
    }

    /// Moves the body: the boxes of its triangles anew, one pass per level.
    pub(crate) fn refit(&mut self, isa: Isa, positions: &[Point], origin: Point) {
        boxes::narrow(&mut self.nodes, &self.surface_nodes, positions, origin);
        self.triangles.refit(isa, &self.nodes);
        self.features_refitted = false;
    }

    /// The boxes of edges and points anew, unless the body has not moved since.
    pub(crate) fn refit_features(&mut self, isa: Isa) {
        if !std::mem::replace(&mut self.features_refitted, true) {
            self.edges.refit(isa, &self.nodes);
            self.points.refit(isa, &self.nodes);
        }
    }

    /// Adds what this keeps in memory.
    pub(crate) fn add_memory(&self, sum: &mut DetectionMemory) {
        let Self { surface_nodes, nodes, triangles, edges, points, owned, .. } = self;
        sum.nodes += size_of_val(surface_nodes.as_slice()) + size_of_val(nodes.as_slice());
        sum.elements += triangles.slot_bytes() + edges.slot_bytes() + points.slot_bytes();
        sum.elements += owned.len();
        sum.triangle_boxes += triangles.boxes.bytes();
        sum.feature_boxes += edges.boxes.bytes() + points.boxes.bytes();
        sum.triangle_masks += self.triangles_of_triangles.bytes();
        sum.feature_masks += self.edges_of_edges.bytes() + self.triangles_of_points.bytes();
    }

    /// Triangles of two bodies, which may be the same, further apart than `margin` being of no use;
    /// likewise edges, and the nodes of a against the triangles of b.
    pub(crate) fn triangles_and_triangles<'a>(&'a self, b: &'a Self, margin: f64) -> Sides<'a> {
        let own = std::ptr::eq(self, b).then_some(&self.triangles_of_triangles);
        Sides::new([&self.triangles.boxes, &b.triangles.boxes], own, own.is_some(), margin)
    }

    pub(crate) fn edges_and_edges<'a>(&'a self, b: &'a Self, margin: f64) -> Sides<'a> {
        let own = std::ptr::eq(self, b).then_some(&self.edges_of_edges);
        Sides::new([&self.edges.boxes, &b.edges.boxes], own, own.is_some(), margin)
    }

    pub(crate) fn points_and_triangles<'a>(&'a self, b: &'a Self, margin: f64) -> Sides<'a> {
        let own = std::ptr::eq(self, b).then_some(&self.triangles_of_points);
        Sides::new([&self.points.boxes, &b.triangles.boxes], own, false, margin)
    }
}
