//! Bottom-up refit: new boxes, same tree.

use palpate_geometry::{Aabb, Point};

use super::{BoundingTree, corner_points};

impl BoundingTree {
    /// Recomputes every box from the current node positions, keeping the tree's shape.
    ///
    /// `positions` \[m\], one entry per mesh node. Only surface nodes are read: inner nodes can touch
    /// nothing (paper, "Update"). O(P) for P tree nodes, no allocation.
    ///
    /// # Panics
    /// If `positions` is shorter than the mesh's nodes.
    pub fn refit(&mut self, positions: &[Point]) {
        for (bounds, &corners) in self.triangle_bounds.iter_mut().zip(&self.corners) {
            *bounds = triangle_bounds(&corner_points(positions, corners));
        }
        // Children stand after their parent: backwards, both are ready when the parent is reached.
        for index in (0..self.nodes.len()).rev() {
            let right = self.nodes.get(index + 1).map_or(0, |left| left.skip as usize);
            let bounds = if self.is_leaf(index) {
                self.leaf_bounds(index)
            } else {
                self.nodes[index + 1].bounds.union(&self.nodes[right].bounds)
            };
            self.nodes[index].bounds = bounds;
        }
    }

    pub(super) fn leaf_bounds(&self, leaf: usize) -> Aabb {
        let [start, end] = self.nodes[leaf].triangles;
        self.triangle_bounds[start as usize..end as usize]
            .iter()
            .fold(Aabb::EMPTY, |bounds, triangle| bounds.union(triangle))
    }
}

/// Box of one triangle, without the branches of the empty box.
#[inline]
pub(super) fn triangle_bounds([a, b, c]: &[Point; 3]) -> Aabb {
    Aabb {
        min: std::array::from_fn(|axis| a[axis].min(b[axis]).min(c[axis])),
        max: std::array::from_fn(|axis| a[axis].max(b[axis]).max(c[axis])),
    }
}
