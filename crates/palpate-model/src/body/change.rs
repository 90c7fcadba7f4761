//! A model after a cut or a removal.

use std::sync::Arc;

use super::{AttachedNode, Attachment, Body, Model, Structure};
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

impl Model {
    /// The model in which every piece of a deformable body is a body of its own, and for each of its
    /// bodies the body before and what became of that one's mesh; `None` when nothing has come apart.
    ///
    /// The largest piece keeps index and name, the others come after all bodies, named `kidney/2` and so on, by
    /// their size. Settings and attachments go with the pieces.
    ///
    /// # Panics
    /// Never: what is left of a mesh is a mesh.
    pub fn separated(&self) -> Option<(Self, Vec<(usize, MeshChange)>)> {
        let identity = |(index, body): (usize, &Body)| (index, MeshChange::identity(&body.mesh));
        let mut parts: Vec<_> = self.bodies.iter().enumerate().map(identity).collect();
        let mut model = self.clone();
        for (index, body) in self.bodies.iter().enumerate().filter(|(_, b)| b.rigid.is_none()) {
            let mut pieces = body.mesh.pieces();
            if pieces.len() < 2 {
                continue;
            }
            pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
            let whole = body.mesh.tetrahedra().len() as u32;
            let mut changes = pieces.iter().map(|piece| {
                let others: Vec<u32> =
                    (0..whole).filter(|each| piece.binary_search(each).is_err()).collect();
                body.mesh.remove(&others).expect("a piece has tetrahedra")
            });
            let first = changes.next().expect("two or more");
            model.bodies[index] = body.changed(&first);
            parts[index].1 = first;
            for change in changes {
                let mut piece = body.changed(&change);
                piece.name = free_name(&model, &body.name);
                model.structure = with_neighbour(&model.structure, index, model.bodies.len());
                model.bodies.push(piece);
                parts.push((index, change));
            }
        }
        if model.bodies.len() == self.bodies.len() {
            return None;
        }
        model.document = None;
        model.attachments =
            self.attachments.iter().flat_map(|each| among_parts(each, self, &parts)).collect();
        Some((model, parts))
    }
}

/// The first of NAME/2, NAME/3, ... that no body has.
fn free_name(model: &Model, name: &str) -> String {
    let taken = |name: &String| model.bodies.iter().any(|body| body.name == *name);
    let names = (2..).map(|number: u32| format!("{name}/{number}"));
    names.into_iter().find(|name| !taken(name)).expect("there is always another number")
}

/// The structure with a body beside another one.
fn with_neighbour(structure: &Structure, body: usize, neighbour: usize) -> Structure {
    let join = |left, right| Structure::Join(Box::new(left), Box::new(right));
    match structure {
        Structure::Body(here) if *here == body => {
            join(Structure::Body(body), Structure::Body(neighbour))
        }
        Structure::Body(here) => Structure::Body(*here),
        Structure::Join(left, right) => {
            join(with_neighbour(left, body, neighbour), with_neighbour(right, body, neighbour))
        }
    }
}

/// What of an attachment holds between each two parts of its bodies.
fn among_parts(
    attachment: &Attachment,
    model: &Model,
    parts: &[(usize, MeshChange)],
) -> Vec<Attachment> {
    let parts_of = |body: usize| {
        let count = model.bodies[body].mesh.nodes().len();
        let of_body = parts.iter().enumerate().filter(move |(_, (old, _))| *old == body);
        of_body.map(move |(new, (_, change))| (new, Copies::new(count, change)))
    };
    let mut found = Vec::new();
    for (first, of_first) in parts_of(attachment.bodies[0]) {
        for (second, of_second) in parts_of(attachment.bodies[1]) {
            let here = attachment.ties.iter().flat_map(|tie| of_first.of_node(tie));
            let ties: Vec<_> = here.filter_map(|tie| of_second.of_corners(&tie)).collect();
            if !ties.is_empty() {
                found.push(Attachment { bodies: [first, second], ties, ..attachment.clone() });
            }
        }
    }
    found
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
