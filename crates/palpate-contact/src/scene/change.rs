//! Changes of topology: cuts and removal.

use std::sync::Arc;

use palpate_model::{Mesh, MeshChange, Structure};

use super::{Scene, SceneBody, SceneError};
use crate::left_out::Groups;
use crate::surface::Surface;
use crate::upper_tree::UpperTree;

impl Scene {
    /// Gives a body the mesh that a cut or a removal has made of its own, its nodes where the nodes that
    /// they come from are. Other bodies are not touched.
    ///
    /// The bounding tree is kept: tetrahedra stay in their leaves, parts of one in its leaf. What is
    /// derived from the surface (blocks, masks of neighbours, owners of features) is derived anew, by the same
    /// functions as at the start. Ignored pairs stay ignored; a surface triangle stays in its group
    /// when all of its nodes come from nodes of an old one of the same tetrahedron, and new surface is
    /// in none.
    ///
    /// # Errors
    /// If there is no such body, or `change` is not one of its mesh; the scene is then unchanged.
    pub fn change_body(&mut self, body: usize, change: &MeshChange) -> Result<(), SceneError> {
        self.check_body(body)?;
        check_change(&self.bodies[body].mesh, change)
            .map_err(|reason| SceneError::OtherMesh { body, reason })?;
        self.bodies[body].change(change);
        self.bodies_changed();
        Ok(())
    }

    /// Goes on with other bodies: those whose mesh is the very one (the same `Arc`) of the body with their
    /// index stay as they are, with their positions and groups; the others begin at their mesh's
    /// positions. Pairs of bodies that stay are ignored as before. `structure` as in [`Scene::new`].
    ///
    /// # Errors
    /// If there are no meshes, or the structure does not name each body once; the scene is then unchanged.
    pub fn exchange(
        &mut self,
        meshes: &[Arc<Mesh>],
        structure: &Structure,
    ) -> Result<(), SceneError> {
        if meshes.is_empty() {
            return Err(SceneError::NoMeshes);
        }
        self.upper = UpperTree::from_structure(structure, meshes.len())?;
        let mut before = std::mem::take(&mut self.bodies).into_iter();
        for (body, mesh) in meshes.iter().enumerate() {
            let same = before.next().filter(|before| Arc::ptr_eq(&before.mesh, mesh));
            if same.is_none() {
                self.ignored.forget(body as u32);
            }
            let new = || SceneBody::new(Arc::clone(mesh), &self.options);
            self.bodies.push(same.unwrap_or_else(new));
        }
        for gone in 0..before.len() {
            self.ignored.forget((meshes.len() + gone) as u32);
        }
        self.bodies_changed();
        Ok(())
    }
}

impl SceneBody {
    fn change(&mut self, change: &MeshChange) {
        self.positions = change.positions(&self.positions);
        let groups = self.groups.as_ref().map(|groups| {
            let of_triangles = groups_after(&self.mesh, groups.of_triangles(), change);
            Groups::new(&change.mesh, &of_triangles)
        });
        self.groups = groups.flatten();
        self.mesh = Arc::clone(&change.mesh);
        let tree = self.tree.get_mut();
        tree.change(change);
        self.surface = Surface::new(&self.mesh, tree.triangle_order());
    }
}

/// What does not fit in a change of `mesh`.
fn check_change(mesh: &Mesh, change: &MeshChange) -> Result<(), &'static str> {
    let (nodes, tetrahedra) = (mesh.nodes().len(), mesh.tetrahedra().len());
    let known = |node: &u32| (*node as usize) < nodes;
    if change.nodes.len() != change.mesh.nodes().len()
        || change.tetrahedra.len() != change.mesh.tetrahedra().len()
    {
        return Err("its origins are not one for each node and tetrahedron");
    }
    if !change.nodes.iter().all(|origin| origin.nodes.iter().all(known)) {
        return Err("a node comes from one that the mesh does not have");
    }
    if change.tetrahedra.is_empty() {
        return Err("it has no tetrahedra");
    }
    if !change.tetrahedra.iter().all(|&parent| (parent as usize) < tetrahedra) {
        return Err("a tetrahedron comes from one that the mesh does not have");
    }
    Ok(())
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
