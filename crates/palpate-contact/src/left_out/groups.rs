//! Surface elements of a common group.

use palpate_model::{Lists, Mesh, MeshChange};

use super::{ElementPair, Filter};
use crate::error::SceneError;
use crate::scene::Scene;

/// The groups of each body's elements.
#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    /// Of the bodies up to the last one with groups; `None` where no triangle has one.
    bodies: Vec<Option<OfBody>>,
}

impl Groups {
    fn of(&self, body: u32) -> Option<&OfBody> {
        self.bodies.get(body as usize)?.as_ref()
    }

    fn set(&mut self, body: u32, groups: Option<OfBody>) {
        let index = body as usize;
        if groups.is_some() && self.bodies.len() <= index {
            self.bodies.resize(index + 1, None);
        }
        if let Some(of_body) = self.bodies.get_mut(index) {
            *of_body = groups;
        }
    }
}

impl Filter for Groups {
    #[inline]
    fn concerns(&self, [a, b]: [u32; 2]) -> bool {
        self.of(a).is_some() && self.of(b).is_some()
    }

    #[inline]
    fn has(&self, [a, b]: [u32; 2], pair: ElementPair) -> bool {
        let (Some(a), Some(b)) = (self.of(a), self.of(b)) else { return false };
        let [of_a, of_b] = match pair {
            ElementPair::Triangles([i, j]) => [a.of_triangle(i), b.of_triangle(j)],
            ElementPair::NodeAndTriangle([i, j]) => [a.nodes.of(i), b.of_triangle(j)],
            ElementPair::Edges([i, j]) => [a.edges.of(i), b.edges.of(j)],
        };
        of_a.iter().any(|group| of_b.contains(group))
    }

    fn forget(&mut self, body: u32) {
        self.set(body, None);
    }

    fn remove(&mut self, body: u32) {
        if (body as usize) < self.bodies.len() {
            self.bodies.remove(body as usize);
        }
    }

    fn replace(&mut self, body: u32) {
        self.forget(body);
    }

    fn change(&mut self, body: u32, before: &Mesh, change: &MeshChange) {
        let groups = self.of(body).and_then(|groups| {
            OfBody::new(&change.mesh, groups_after(before, &groups.triangles, change))
        });
        self.set(body, groups);
    }
}

impl Scene {
    /// Puts the surface triangles of a body into groups, 0 being none: elements of a common group,
    /// whatever their bodies, are no pair in [`Self::intersections`], [`Self::contact_nodes`] and
    /// [`Self::proximity`]. A node or edge is in the groups of all triangles around it.
    ///
    /// # Errors
    /// If there is no such body, or there is not one group for each of its surface triangles.
    pub fn set_groups(&mut self, body: usize, groups: &[u32]) -> Result<(), SceneError> {
        self.check_body(body)?;
        let (given, expected) = (groups.len(), self.mesh(body).triangles().len());
        if given != expected {
            return Err(SceneError::GroupCount { body, given, expected });
        }
        let groups = OfBody::new(self.mesh(body), groups.to_vec());
        self.left_out.groups.set(body as u32, groups);
        Ok(())
    }
}

/// Groups of a body's surface triangles, 0 being none, and with them of the nodes and edges that they
/// lie around.
#[derive(Clone, Debug)]
struct OfBody {
    triangles: Vec<u32>,
    nodes: Lists<u32>,
    edges: Lists<u32>,
}

impl OfBody {
    /// `None` where no triangle has a group.
    fn new(mesh: &Mesh, triangles: Vec<u32>) -> Option<Self> {
        if triangles.iter().all(|&group| group == 0) {
            return None;
        }
        let around = |corners: &[[u32; 3]], count: usize| {
            let in_group = corners.iter().zip(&triangles).filter(|(_, group)| **group != 0);
            let pairs = in_group.flat_map(|(corners, &group)| corners.map(|index| (index, group)));
            let mut pairs: Vec<(u32, u32)> = pairs.collect();
            pairs.sort_unstable();
            pairs.dedup();
            Lists::new(count, pairs.into_iter())
        };
        let nodes = around(mesh.triangles(), mesh.nodes().len());
        let edges = around(mesh.triangle_edges(), mesh.surface_edges().len());
        Some(Self { triangles, nodes, edges })
    }

    fn of_triangle(&self, triangle: u32) -> &[u32] {
        let group = &self.triangles[triangle as usize];
        if *group == 0 { &[] } else { std::slice::from_ref(group) }
    }
}

/// The groups of the triangles after a change.
fn groups_after(old: &Mesh, groups: &[u32], change: &MeshChange) -> Vec<u32> {
    let (mesh, owners) = (&change.mesh, old.triangle_owners());
    let comes_from = |nodes: &[u32; 3], triangle: usize| {
        nodes.iter().all(|&node| {
            let mut parts = change.nodes[node as usize].parts();
            parts.all(|(node, _)| old.triangles()[triangle].contains(&node))
        })
    };
    let group = |(nodes, &owner): (&[u32; 3], &u32)| {
        let parent = change.tetrahedra[owner as usize];
        // Triangles stand in the order of their owners.
        let first = owners.partition_point(|&owner| owner < parent);
        let of_parent = (first..owners.len()).take_while(|&triangle| owners[triangle] == parent);
        let mut same = of_parent.filter(|&triangle| comes_from(nodes, triangle));
        same.next().map_or(0, |triangle| groups[triangle])
    };
    mesh.triangles().iter().zip(mesh.triangle_owners()).map(group).collect()
}
