//! A model after a cut or a removal.

use std::sync::Arc;

use super::{AttachedNode, Attachment, Body, Model};
use crate::mesh::MeshChange;

impl Model {
    /// The model with the mesh that `change` has made of a body's: settings follow, and the model has
    /// no text any more.
    ///
    /// Attachments stay between the nodes that are left: all copies of a node are attached where it
    /// was, at the copies of the triangle's corners that are still in one triangle, else at the first ones.
    ///
    /// # Panics
    /// If the body does not exist, or `change` is not one of its mesh.
    #[must_use]
    pub fn changed(&self, body: usize, change: &MeshChange) -> Self {
        let mut changed = self.clone();
        changed.bodies[body] = self.bodies[body].changed(change);
        changed.document = None;
        let of_body = |attachment: &&mut Attachment| attachment.bodies.contains(&body);
        if changed.attachments.iter_mut().any(|attachment| of_body(&attachment)) {
            let copies = Copies::new(self.bodies[body].mesh.nodes().len(), change);
            for attachment in changed.attachments.iter_mut().filter(of_body) {
                let first = attachment.bodies[0] == body;
                attachment.ties = if first {
                    attachment.ties.iter().flat_map(|tie| copies.of_node(tie)).collect()
                } else {
                    attachment.ties.iter().filter_map(|tie| copies.of_corners(tie)).collect()
                };
            }
            changed.attachments.retain(|attachment| !attachment.ties.is_empty());
        }
        changed
    }
}

impl Body {
    /// The body with the mesh that `change` has made of its own: fixed nodes are those made of nothing
    /// but fixed nodes, regions that are no longer there lose their material.
    ///
    /// # Panics
    /// If `change` is not one of the body's mesh.
    #[must_use]
    pub fn changed(&self, change: &MeshChange) -> Self {
        let mut changed = self.clone();
        changed.mesh = Arc::clone(&change.mesh);
        changed.fixed_nodes = change.node_set(&self.fixed_nodes);
        changed.regions.retain(|(region, _)| change.mesh.regions().contains(region));
        changed
    }
}

/// The nodes now that are or copy each node before.
struct Copies<'a> {
    change: &'a MeshChange,
    copies: Vec<Vec<u32>>,
}

impl<'a> Copies<'a> {
    fn new(count: usize, change: &'a MeshChange) -> Self {
        let mut copies = vec![Vec::new(); count];
        for (node, origin) in (0..).zip(&change.nodes) {
            if let Some(old) = origin.kept_node() {
                copies[old as usize].push(node);
            }
        }
        Self { change, copies }
    }

    fn of_node(&self, tie: &AttachedNode) -> impl Iterator<Item = AttachedNode> {
        self.copies[tie.node as usize].iter().map(|&node| AttachedNode { node, ..*tie })
    }

    fn of_corners(&self, tie: &AttachedNode) -> Option<AttachedNode> {
        let copies = tie.corners.map(|corner| &self.copies[corner as usize]);
        let is_copies = |triangle: &&[u32; 3]| {
            copies.iter().all(|copies| triangle.iter().any(|node| copies.contains(node)))
        };
        let whole = self.change.mesh.triangles().iter().find(is_copies);
        let corner = |copies: &Vec<u32>| match whole {
            Some(triangle) => copies.iter().copied().find(|copy| triangle.contains(copy)),
            None => copies.first().copied(),
        };
        let [a, b, c] = copies.map(corner);
        Some(AttachedNode { corners: [a?, b?, c?], ..*tie })
    }
}
