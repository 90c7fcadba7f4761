//! The mesh under the knife.

use std::cell::OnceCell;

use palpate_geometry::Point;
use palpate_model::{Mesh, NodeOrigin};

use crate::wounds::Wounds;

/// A mesh that is being cut: tetrahedra and nodes as they are now, and what they were.
#[derive(Clone)]
pub(crate) struct Draft<'a> {
    old: &'a Mesh,
    old_positions: &'a [Point],
    /// Found when first asked for: most blades pass most bodies by.
    wounds: OnceCell<Wounds>,
    /// Sorted nodes of the faces that are cut but still hang together by all three nodes, sorted.
    pub(crate) pending: Vec<[u32; 3]>,
    /// Node indices of each tetrahedron; the first part of an old one keeps its place.
    pub(crate) tetrahedra: Vec<[u32; 4]>,
    /// The old tetrahedron that each is, or is a part of.
    pub(crate) parents: Vec<u32>,
    /// What each node was.
    pub(crate) origins: Vec<NodeOrigin>,
    /// Rest positions [m].
    pub(crate) rest: Vec<Point>,
    /// Present positions [m], where the blade is.
    pub(crate) positions: Vec<Point>,
}

impl<'a> Draft<'a> {
    /// `mesh` as it is, at `positions`, with cut faces that are still to be opened.
    pub(crate) fn new(mesh: &'a Mesh, positions: &'a [Point], pending: &[[u32; 3]]) -> Self {
        let is_known =
            |face: &&[u32; 3]| face.iter().all(|&node| (node as usize) < positions.len());
        let mut pending: Vec<[u32; 3]> = pending.iter().filter(is_known).copied().collect();
        for face in &mut pending {
            face.sort_unstable();
        }
        pending.sort_unstable();
        Self {
            old: mesh,
            old_positions: positions,
            wounds: OnceCell::new(),
            pending,
            tetrahedra: mesh.tetrahedra().to_vec(),
            parents: (0..mesh.tetrahedra().len() as u32).collect(),
            origins: (0..mesh.nodes().len() as u32).map(NodeOrigin::kept).collect(),
            rest: mesh.nodes().to_vec(),
            positions: positions.to_vec(),
        }
    }

    /// Present positions of the corners of a tetrahedron.
    pub(crate) fn corners(&self, tetrahedron: u32) -> [Point; 4] {
        self.tetrahedra[tetrahedron as usize].map(|node| self.positions[node as usize])
    }

    /// The origin of the point of the edge `nodes` of a part of the old tetrahedron `parent`, at
    /// the parameter `t` from the first.
    pub(crate) fn between(&self, nodes: [u32; 2], t: f64, parent: u32) -> NodeOrigin {
        let [a, b] = nodes.map(|node| &self.origins[node as usize]);
        if let (Some(a), Some(b)) = (a.kept_node(), b.kept_node()) {
            return NodeOrigin { nodes: [a, b, a, a], weights: [1.0 - t, t, 0.0, 0.0] };
        }
        let corners = self.old.tetrahedra()[parent as usize];
        let mut weights = [0.0; 4];
        for (origin, factor) in [(a, 1.0 - t), (b, t)] {
            for (node, weight) in origin.parts() {
                let corner = corners.iter().position(|&corner| corner == node);
                weights[corner.expect("a part has its nodes in its parent")] += factor * weight;
            }
        }
        NodeOrigin { nodes: corners, weights }
    }

    /// The lips of cuts before this one.
    pub(crate) fn wounds(&self) -> &Wounds {
        self.wounds.get_or_init(|| Wounds::find(self.old, self.old_positions, &self.pending))
    }

    /// Rest position of a node of this origin.
    pub(crate) fn rest_of(&self, origin: &NodeOrigin) -> Point {
        origin.value(self.old.nodes())
    }

    /// Adds a node; returns its index.
    pub(crate) fn add_node(&mut self, origin: NodeOrigin) -> u32 {
        self.rest.push(origin.value(self.old.nodes()));
        self.positions.push(origin.value(self.old_positions));
        self.origins.push(origin);
        self.origins.len() as u32 - 1
    }
}
