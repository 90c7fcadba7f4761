//! One box against a subtree: the step that every traversal is made of.

use palpate_geometry::Aabb;

use super::BoundingTree;
use crate::leaf_pairs::meets;

impl BoundingTree {
    /// Calls `found` with each leaf at or after node `start` whose box meets `bounds`, and returns the
    /// number of nodes visited.
    ///
    /// With `start` = 0 the whole tree is searched; with the node after a leaf, exactly the leaves
    /// that follow it, since nodes stand in preorder.
    #[inline]
    pub(crate) fn leaves_meeting(
        &self,
        start: u32,
        bounds: &Aabb,
        mut found: impl FnMut(u32),
    ) -> u64 {
        let mut visited = 0;
        let mut index = start;
        while let Some(node) = self.nodes.get(index as usize) {
            visited += 1;
            if !meets(&node.bounds, bounds) {
                index = node.skip;
                continue;
            }
            index += 1;
            if node.skip == index {
                found(index - 1);
            }
        }
        visited
    }
}
