//! Checks every invariant of a tree.

use palpate_geometry::{Aabb, Point};
use palpate_model::Mesh;

use super::build::Elements;
use super::refit::triangle_bounds;
use super::{BoundingTree, corner_points};

/// An invariant that a bounding tree breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeDefect {
    /// The preorder is broken, or a child's range is not part of its parent's.
    #[error("tree node {node} does not continue the preorder")]
    Order {
        /// The tree node.
        node: usize,
    },
    /// A leaf with no or too many elements, the mesh not having been changed.
    #[error("leaf {node} holds {count} elements, expected 1 to {leaf_size}")]
    LeafFill {
        /// The tree node.
        node: usize,
        /// Its elements.
        count: usize,
        /// Most elements allowed.
        leaf_size: usize,
    },
    /// An element that is not in exactly one leaf.
    #[error("element {element} is in {count} leaves, expected 1")]
    Element {
        /// The element.
        element: usize,
        /// Leaves that hold it.
        count: usize,
    },
    /// A surface triangle that is not exactly once in the leaf of its owner.
    #[error("surface triangle {triangle} is {count} times in the leaf of its owner, expected 1")]
    Triangle {
        /// The triangle.
        triangle: usize,
        /// Times that it was found in its owner's leaf.
        count: usize,
    },
    /// A box that is not exactly the union of what it encloses.
    #[error("the box of tree node {node} is not the union of what it encloses")]
    Bounds {
        /// The tree node.
        node: usize,
    },
}

impl BoundingTree {
    /// Checks the order, that every element and surface triangle is in exactly one leaf, and that every
    /// box is exactly the union of the current surface triangles below it.
    ///
    /// # Errors
    /// The first invariant that does not hold.
    pub fn validate(&self, mesh: &Mesh, positions: &[Point]) -> Result<(), TreeDefect> {
        self.validate_order()?;
        self.validate_members(mesh)?;
        for (index, node) in self.nodes.iter().enumerate() {
            let expected = self
                .triangles(index)
                .iter()
                .map(|&t| triangle_bounds(&corner_points(positions, mesh.triangles()[t as usize])))
                .fold(Aabb::EMPTY, |bounds, triangle| bounds.union(&triangle));
            if node.bounds != expected {
                return Err(TreeDefect::Bounds { node: index });
            }
        }
        Ok(())
    }

    fn validate_order(&self) -> Result<(), TreeDefect> {
        let count = self.nodes.len();
        let end_of_triangles = self.triangle_order.len() as u32;
        let whole = count == 0 || self.nodes[0].triangles == [0, end_of_triangles];
        if !whole || self.nodes.first().is_some_and(|root| root.skip as usize != count) {
            return Err(TreeDefect::Order { node: 0 });
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let defect = Err(TreeDefect::Order { node: index });
            if node.skip as usize <= index || node.skip as usize > count {
                return defect;
            }
            let Some([left, right]) = self.children(index) else {
                let fill = self.elements(index).len();
                if !self.changed && (fill == 0 || fill > self.leaf_size) {
                    let leaf_size = self.leaf_size;
                    return Err(TreeDefect::LeafFill { node: index, count: fill, leaf_size });
                }
                continue;
            };
            if right >= count || self.nodes[right].skip != node.skip {
                return defect;
            }
            let (left, right) = (&self.nodes[left], &self.nodes[right]);
            if left.first_element != node.first_element
                || left.triangles[0] != node.triangles[0]
                || left.triangles[1] != right.triangles[0]
                || right.triangles[1] != node.triangles[1]
            {
                return defect;
            }
        }
        let leaves = (0..count as u32).filter(|&node| self.is_leaf(node as usize));
        if leaves.eq(self.leaves.iter().copied()) {
            Ok(())
        } else {
            Err(TreeDefect::Order { node: count })
        }
    }

    fn validate_members(&self, mesh: &Mesh) -> Result<(), TreeDefect> {
        let elements = Elements::new(mesh);
        let mut element_count = vec![0; elements.len()];
        let mut leaf_of_element = vec![0; elements.len()];
        for &leaf in &self.leaves {
            for &element in self.elements(leaf as usize) {
                element_count[element as usize] += 1;
                leaf_of_element[element as usize] = leaf;
            }
        }
        if let Some(element) = element_count.iter().position(|&count| count != 1) {
            return Err(TreeDefect::Element { element, count: element_count[element] });
        }
        let mut triangle_count = vec![0; mesh.triangles().len()];
        for &leaf in &self.leaves {
            let [start, end] = self.nodes[leaf as usize].triangles;
            for position in start as usize..end as usize {
                let triangle = self.triangle_order[position] as usize;
                let owned = leaf_of_element[elements.owner(triangle) as usize] == leaf;
                let same_corners = self.corners[position] == mesh.triangles()[triangle];
                triangle_count[triangle] += usize::from(owned && same_corners);
            }
        }
        match triangle_count.iter().position(|&count| count != 1) {
            Some(triangle) => {
                Err(TreeDefect::Triangle { triangle, count: triangle_count[triangle] })
            }
            None => Ok(()),
        }
    }
}
