//! Which elements are neighbours.

use super::surface::for_each_face;
use super::{Mesh, NONE};
use crate::lists::Lists;

/// How many triangles run through a surface edge from its smaller to its larger node, and back.
#[derive(Clone, Default)]
pub(super) struct EdgeUse {
    pub(super) forward: u32,
    pub(super) backward: u32,
}

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

    /// Whether the surface is one with two sides: there is one, and triangles run through each of its
    /// edges as often forwards as backwards.
    pub fn is_closed(&self) -> bool {
        let edges = self.edge_uses();
        !edges.is_empty() && edges.iter().all(|edge| edge.forward == edge.backward)
    }

    /// By surface edge.
    pub(super) fn edge_uses(&self) -> Vec<EdgeUse> {
        let mut uses = vec![EdgeUse::default(); self.surface_edges().len()];
        for (triangle, edges) in self.triangles().iter().zip(self.triangle_edges()) {
            for (side, &edge) in edges.iter().enumerate() {
                let forward = triangle[side] < triangle[(side + 1) % 3];
                let count = &mut uses[edge as usize];
                *(if forward { &mut count.forward } else { &mut count.backward }) += 1;
            }
        }
        uses
    }
}
