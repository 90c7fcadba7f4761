//! The boxes of one level: how closely the tree bounds the surface after so many splits.

use palpate_geometry::Aabb;

use super::BoundingTree;

impl BoundingTree {
    /// Boxes of the nodes at depth `level` and of the leaves above it, in preorder.
    ///
    /// The root's level is 0. Together they hold the whole surface; nodes without any of it are left out.
    pub fn level_bounds(&self, level: usize) -> Vec<Aabb> {
        let mut boxes = Vec::new();
        // Where the subtrees that are open end: as many as the node is deep.
        let mut open: Vec<usize> = Vec::new();
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            while open.last().is_some_and(|&end| end <= index) {
                open.pop();
            }
            if open.len() < level && !self.is_leaf(index) {
                open.push(node.skip as usize);
                index += 1;
                continue;
            }
            if !node.bounds.is_empty() {
                boxes.push(node.bounds);
            }
            index = node.skip as usize;
        }
        boxes
    }
}
