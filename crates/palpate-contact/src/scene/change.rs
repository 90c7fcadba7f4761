//! Changes of topology: cuts and removal.

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::{Mesh, MeshChange, Structure};

use super::{Scene, new_body};
use crate::bounding_tree::BoundingTree;
use crate::error::SceneError;
use crate::surface::Surface;
use crate::upper_tree::UpperTree;
use crate::wide::WideBody;

/// What the surface of a body after a change of its mesh is made from: nothing that moves, so that bodies may
/// move meanwhile.
#[derive(Clone, Debug)]
pub struct SurfaceBasis {
    mesh: Arc<Mesh>,
    tree: BoundingTree,
    is_packed: bool,
}

/// The surface of a body after a change of its mesh, in the form in which it is searched.
#[derive(Debug)]
pub struct ChangedSurface {
    before: Arc<Mesh>,
    mesh: Arc<Mesh>,
    tree: BoundingTree,
    surface: Surface,
    packed: Option<WideBody>,
}

impl ChangedSurface {
    /// Makes what becomes of a body by `change`, its nodes somewhere near `positions` \[m\]: what is close
    /// to each other there is searched together. What is found does not depend on it.
    ///
    /// # Errors
    /// If `change` is not one of the body's mesh; the text says why.
    pub fn new(
        basis: SurfaceBasis,
        change: &MeshChange,
        positions: &[Point],
    ) -> Result<Self, &'static str> {
        let SurfaceBasis { mesh: before, mut tree, is_packed } = basis;
        check_change(&before, change)?;
        if positions.len() != change.nodes.len() {
            return Err("there is not one position for each of its nodes");
        }
        tree.change(change);
        let mesh = Arc::clone(&change.mesh);
        let surface = Surface::new(&mesh, tree.triangle_order());
        let packed = is_packed.then(|| WideBody::pack(&mesh, positions));
        Ok(Self { before, mesh, tree, surface, packed })
    }
}

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
        let basis = self.surface_basis(body)?;
        let other = |reason| SceneError::OtherMesh { body, reason };
        check_change(&basis.mesh, change).map_err(other)?;
        let positions = change.positions(&self.bodies[body].positions);
        let changed = ChangedSurface::new(basis, change, &positions).map_err(other)?;
        self.go_on_with(body, changed, change)
    }

    /// What the surface of a body after a change can be made from; see [`ChangedSurface::new`].
    ///
    /// # Errors
    /// If there is no such body.
    pub fn surface_basis(&self, body: usize) -> Result<SurfaceBasis, SceneError> {
        self.check_body(body)?;
        let body = &self.bodies[body];
        let is_packed = self.detector.is_packed();
        Ok(SurfaceBasis { mesh: Arc::clone(&body.mesh), tree: body.copy_tree(), is_packed })
    }

    /// Goes on with a body that was made for `change`, as [`Self::change_body`]: all but the time that packing
    /// takes.
    ///
    /// # Errors
    /// If there is no such body, or its mesh is not the one before the change, or the change another one; the
    /// scene is then unchanged.
    pub fn go_on_with(
        &mut self,
        body: usize,
        changed: ChangedSurface,
        change: &MeshChange,
    ) -> Result<(), SceneError> {
        self.check_body(body)?;
        let now = &self.bodies[body].mesh;
        if !Arc::ptr_eq(now, &changed.before) || !Arc::ptr_eq(&change.mesh, &changed.mesh) {
            return Err(SceneError::OtherMesh { body, reason: "it was made for another one" });
        }
        let ChangedSurface { tree, surface, packed, .. } = changed;
        self.left_out.change(body as u32, now, change);
        self.bodies[body].change(change, tree, surface);
        if let Some(packed) = packed {
            self.detector.take_packed(packed);
        }
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
                self.left_out.forget(body as u32);
            }
            let new = || new_body(Arc::clone(mesh), &self.options);
            self.bodies.push(same.unwrap_or_else(new));
        }
        for gone in 0..before.len() {
            self.left_out.forget((meshes.len() + gone) as u32);
        }
        self.bodies_changed();
        Ok(())
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
