//! Which elements are neighbours.

use super::surface::for_each_face;
use super::{Mesh, NONE};

/// The surface triangles around each node, in compressed rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeTriangles {
    offsets: Vec<u32>,
    triangles: Vec<u32>,
}

impl NodeTriangles {
    /// The triangles that use `node`, in rising order; none for an inner node.
    ///
    /// # Panics
    /// If `node` is not a node of the mesh.
    pub fn around(&self, node: u32) -> &[u32] {
        let range = self.offsets[node as usize] as usize..self.offsets[node as usize + 1] as usize;
        &self.triangles[range]
    }
}

impl Mesh {
    /// The surface triangles around each node. O(n + t).
    pub fn node_triangles(&self) -> NodeTriangles {
        let mut offsets = vec![0_u32; self.nodes().len() + 1];
        for &node in self.triangles().as_flattened() {
            offsets[node as usize + 1] += 1;
        }
        for node in 0..self.nodes().len() {
            offsets[node + 1] += offsets[node];
        }
        let mut next = offsets.clone();
        let mut triangles = vec![0; 3 * self.triangles().len()];
        for (corner, &node) in self.triangles().as_flattened().iter().enumerate() {
            let slot = &mut next[node as usize];
            triangles[*slot as usize] = corner as u32 / 3;
            *slot += 1;
        }
        NodeTriangles { offsets, triangles }
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
