//! The tree after a change of topology: the same nodes, other members.

use palpate_geometry::Aabb;
use palpate_model::{Lists, MeshChange};

use super::BoundingTree;
use super::build::Elements;

impl BoundingTree {
    /// Takes over a changed mesh of tetrahedra: those that are (parts of) old ones stand in the leaf of
    /// the old one, which may then hold more than K elements, or none. Nodes, splits and leaves are
    /// those made at construction; boxes are due a refit. O(S + N log N) for S elements
    /// and N surface triangles.
    ///
    /// # Panics
    /// If the tree is not that of the mesh before.
    pub(crate) fn change(&mut self, change: &MeshChange) {
        let count = self.element_order.len();
        let parents = change.tetrahedra.iter().copied();
        let children = Lists::new(count, parents.zip(0_u32..));
        let mut starts = Vec::with_capacity(count + 1);
        let mut order = Vec::with_capacity(change.tetrahedra.len());
        for &element in &self.element_order {
            starts.push(order.len() as u32);
            order.extend_from_slice(children.of(element));
        }
        starts.push(order.len() as u32);
        self.element_order = order;
        for node in &mut self.nodes {
            node.first_element = starts[node.first_element as usize];
        }
        self.place_triangles(&Elements::new(&change.mesh));
        self.changed = true;
    }

    /// Brings the surface triangles into the order of the leaves.
    pub(super) fn place_triangles(&mut self, elements: &Elements) {
        let mut position_of_element = vec![0; elements.len()];
        for (position, &element) in self.element_order.iter().enumerate() {
            position_of_element[element as usize] = position as u32;
        }
        let mesh = elements.mesh();
        let position =
            |triangle: u32| position_of_element[elements.owner(triangle as usize) as usize];
        let mut order: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
        order.sort_unstable_by_key(|&triangle| (position(triangle), triangle));
        let before = |end: u32| order.partition_point(|&triangle| position(triangle) < end) as u32;
        for node in 0..self.nodes.len() {
            let ends = [self.nodes[node].first_element, self.element_end(node) as u32];
            self.nodes[node].triangles = ends.map(before);
        }
        self.corners.clear();
        self.corners.extend(order.iter().map(|&t| mesh.triangles()[t as usize]));
        self.triangle_bounds.clear();
        self.triangle_bounds.resize(order.len(), Aabb::EMPTY);
        self.triangle_order = order;
    }
}
