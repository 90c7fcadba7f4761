//! The bounding tree: a binary tree of boxes over a body's tetrahedra, made once, refitted each step.

mod build;
mod change;
mod level;
mod refit;
mod traverse;
mod validate;

use palpate_geometry::{Aabb, Point};
use palpate_model::Mesh;

pub use validate::TreeDefect;

/// Where a box that holds too many tetrahedra is split, along its longest axis.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Deserialize, serde::Serialize,
)]
pub enum Split {
    /// At the middle of the box, by centroid; by count where one side would be empty.
    #[default]
    Middle,
    /// At the median centroid: halves by count.
    Count,
}

/// One node of the tree: a cache line.
///
/// Nodes stand in preorder, so that a node's left child follows it, and everything below it ends
/// where `skip` points.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct TreeNode {
    /// Box around the surface triangles below this node; empty when there are none.
    pub bounds: Aabb,
    /// Index of the first node after this subtree.
    pub skip: u32,
    /// First element below this node, as a position in [`BoundingTree::element_order`].
    pub first_element: u32,
    /// Surface triangles below this node, as a range of [`BoundingTree::triangle_order`].
    pub triangles: [u32; 2],
}

const _: () = assert!(size_of::<TreeNode>() == 64);

/// Binary tree of boxes over all tetrahedra of one mesh (over its triangles when it has no others).
///
/// The shape is fixed by the positions at construction; [`BoundingTree::refit`] moves the boxes, and a
/// cut changes which elements the leaves hold, never the leaves.
/// Source: Sakamoto, Nagasaka and Ogata, A Fast Collision Detection for Deformable Objects: the tree in two steps.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundingTree {
    nodes: Vec<TreeNode>,
    leaves: Vec<u32>,
    element_order: Vec<u32>,
    triangle_order: Vec<u32>,
    /// Corner nodes of the triangles, in `triangle_order`: contiguous for refit and tests.
    corners: Vec<[u32; 3]>,
    /// Boxes of the triangles, in `triangle_order`.
    triangle_bounds: Vec<Aabb>,
    leaf_size: usize,
    /// Whether the mesh has changed since: leaves may hold any number of elements.
    changed: bool,
}

/// Figures of a tree's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeStats {
    /// Elements (tetrahedra, or triangles of a surface-only mesh): the paper's S.
    pub element_count: usize,
    /// Surface triangles: the paper's N.
    pub triangle_count: usize,
    /// Tree nodes: the paper's P.
    pub node_count: usize,
    /// Leaves.
    pub leaf_count: usize,
    /// The paper's estimate of P, 2 S / K - 1.
    pub expected_node_count: f64,
    /// Largest depth of a leaf; the root has depth 0.
    pub depth_max: usize,
    /// Mean depth of the leaves.
    pub depth_mean: f64,
    /// `leaf_fill[n]`: leaves that hold n elements, n = 0..=K, or more where the mesh was cut.
    pub leaf_fill: Vec<usize>,
}

impl BoundingTree {
    /// Builds the tree from the mesh's own positions until a leaf holds at most `leaf_size` elements.
    ///
    /// # Panics
    /// If `leaf_size` is zero.
    pub fn new(mesh: &Mesh, leaf_size: usize, split: Split) -> Self {
        assert!(leaf_size > 0, "leaf_size must be at least 1");
        let mut tree = build::build(mesh, leaf_size, split);
        tree.refit(mesh.nodes());
        tree
    }

    /// All nodes in preorder; the root is the first.
    pub fn nodes(&self) -> &[TreeNode] {
        &self.nodes
    }

    /// Indices of the leaves in `nodes`, ascending.
    pub fn leaves(&self) -> &[u32] {
        &self.leaves
    }

    /// Box around the whole surface.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds)
    }

    /// Most elements in a leaf at construction: K.
    pub fn leaf_size(&self) -> usize {
        self.leaf_size
    }

    /// Whether a node is a leaf.
    #[inline]
    pub fn is_leaf(&self, node: usize) -> bool {
        self.nodes[node].skip as usize == node + 1
    }

    /// The two children of an inner node, `None` for a leaf.
    pub fn children(&self, node: usize) -> Option<[usize; 2]> {
        (!self.is_leaf(node)).then(|| [node + 1, self.nodes[node + 1].skip as usize])
    }

    /// Elements in leaf order: those of one node are contiguous.
    pub fn element_order(&self) -> &[u32] {
        &self.element_order
    }

    /// Surface triangles in leaf order: those of one node are contiguous.
    pub fn triangle_order(&self) -> &[u32] {
        &self.triangle_order
    }

    /// Elements below a node.
    pub fn elements(&self, node: usize) -> &[u32] {
        let first = self.nodes[node].first_element as usize;
        &self.element_order[first..self.element_end(node)]
    }

    /// Surface triangles below a node.
    pub fn triangles(&self, node: usize) -> &[u32] {
        let [start, end] = self.nodes[node].triangles;
        &self.triangle_order[start as usize..end as usize]
    }

    /// Box of the triangle at `position` of the triangle order.
    #[inline]
    pub(crate) fn triangle_bounds(&self, position: u32) -> &Aabb {
        &self.triangle_bounds[position as usize]
    }

    /// Corner nodes of the triangle at `position` of the triangle order.
    #[inline]
    pub(crate) fn corners(&self, position: u32) -> [u32; 3] {
        self.corners[position as usize]
    }

    /// The leaf that holds each surface triangle, as an index in `nodes`, by triangle.
    pub fn leaf_of_triangles(&self) -> Vec<u32> {
        let mut result = vec![0; self.triangle_order.len()];
        for &leaf in &self.leaves {
            for &triangle in self.triangles(leaf as usize) {
                result[triangle as usize] = leaf;
            }
        }
        result
    }

    /// Figures of the tree's shape.
    pub fn stats(&self) -> TreeStats {
        let mut leaf_fill = vec![0; self.leaf_size.min(self.element_order.len()) + 1];
        for &leaf in &self.leaves {
            let fill = self.elements(leaf as usize).len();
            leaf_fill.resize(leaf_fill.len().max(fill + 1), 0);
            leaf_fill[fill] += 1;
        }
        let depths = self.leaf_depths();
        TreeStats {
            element_count: self.element_order.len(),
            triangle_count: self.triangle_order.len(),
            node_count: self.nodes.len(),
            leaf_count: self.leaves.len(),
            expected_node_count: 2.0 * self.element_order.len() as f64 / self.leaf_size as f64
                - 1.0,
            depth_max: depths.iter().copied().max().unwrap_or(0),
            depth_mean: depths.iter().sum::<usize>() as f64 / depths.len().max(1) as f64,
            leaf_fill,
        }
    }

    fn leaf_depths(&self) -> Vec<usize> {
        let mut open: Vec<u32> = Vec::new();
        let mut depths = Vec::with_capacity(self.leaves.len());
        for (index, node) in self.nodes.iter().enumerate() {
            while open.last().is_some_and(|&end| end as usize <= index) {
                open.pop();
            }
            if self.is_leaf(index) {
                depths.push(open.len());
            } else {
                open.push(node.skip);
            }
        }
        depths
    }

    fn element_end(&self, node: usize) -> usize {
        match self.nodes.get(self.nodes[node].skip as usize) {
            Some(next) => next.first_element as usize,
            None => self.element_order.len(),
        }
    }
}

/// Corner positions \[m\] of a triangle.
#[inline]
pub(crate) fn corner_points(positions: &[Point], corners: [u32; 3]) -> [Point; 3] {
    corners.map(|node| positions[node as usize])
}
