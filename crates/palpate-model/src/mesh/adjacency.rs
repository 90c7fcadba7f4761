//! Which elements are neighbours.

use super::surface::for_each_face;
use super::{Mesh, NONE};
use crate::lists::Lists;

impl Mesh {
    /// The surface triangles around each node, in rising order; none around an inner one. O(n + t).
    pub fn node_triangles(&self) -> Lists<u32> {
        let corners = self.triangles().as_flattened().iter().enumerate();
        let entries = corners.map(|(corner, &node)| (node, corner as u32 / 3));
        Lists::new(self.nodes().len(), entries)
    }

    /// The tetrahedra around each node, in rising order. O(n + m).
    pub fn node_tetrahedra(&self) -> Lists<u32> {
        let corners = self.tetrahedra().as_flattened().iter().enumerate();
        let entries = corners.map(|(corner, &node)| (node, corner as u32 / 4));
        Lists::new(self.nodes().len(), entries)
    }

    /// For each tetrahedron its neighbours, shape (m, 4): entry `k` across the face opposite to its
    /// node `k`, [`NONE`] on the surface and where more than two tetrahedra share the face.
    pub fn tetrahedron_neighbors(&self) -> Vec<[u32; 4]> {
        let mut neighbors = vec![[NONE; 4]; self.tetrahedra().len()];
        for_each_face(self.tetrahedra(), self.nodes().len(), |occurrences| {
            if let &[left, right] = occurrences {
                neighbors[left as usize / 4][3 - left as usize % 4] = right / 4;
                neighbors[right as usize / 4][3 - right as usize % 4] = left / 4;
            }
        });
        neighbors
    }
}
