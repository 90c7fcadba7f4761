//! Where the nodes of a changed mesh were before.

use glam::DVec3;
use palpate_geometry::Point;
use serde::{Deserialize, Serialize};

/// Where a node of a changed mesh was in the mesh before: the affine combination of nodes of one
/// tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct NodeOrigin {
    /// Nodes of the mesh before; one of weight 0 may be repeated.
    pub nodes: [u32; 4],
    /// Their weights, whose sum is 1.
    pub weights: [f64; 4],
}

impl NodeOrigin {
    /// A node that is, or is a copy of, a node of the mesh before.
    pub const fn kept(node: u32) -> Self {
        Self { nodes: [node; 4], weights: [1.0, 0.0, 0.0, 0.0] }
    }

    /// The node of the mesh before that this is, or is a copy of.
    pub fn kept_node(&self) -> Option<u32> {
        let mut parts = self.parts();
        let first = parts.next();
        if parts.next().is_none() { first.map(|(node, _)| node) } else { None }
    }

    /// The nodes of the mesh before that count, with their weights.
    pub fn parts(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes.into_iter().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }

    /// A value given at the nodes of the mesh before, here.
    ///
    /// # Panics
    /// If there are fewer values than nodes.
    pub fn value(&self, of_nodes: &[Point]) -> Point {
        if let Some(node) = self.kept_node() {
            return of_nodes[node as usize];
        }
        let sum = |sum: DVec3, (node, weight): (u32, f64)| {
            sum + weight * DVec3::from_array(of_nodes[node as usize])
        };
        self.parts().fold(DVec3::ZERO, sum).to_array()
    }
}
