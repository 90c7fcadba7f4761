//! The mesh of one body: nodes, tetrahedra and the surface triangles found from them.

mod surface;

use std::collections::BTreeMap;

use palpate_geometry::{Aabb, Point};

/// Marks "no tetrahedron" or "no triangle" in index arrays.
pub const NONE: u32 = u32::MAX;

/// What a file or a user gives: plain arrays, nothing checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshData {
    /// Node positions [m], shape (n, 3).
    pub nodes: Vec<Point>,
    /// Node indices of each tetrahedron, shape (m, 4); positive volume as (b-a)x(c-a).(d-a) > 0.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Triangles of a surface-only mesh, shape (t, 3). Must be empty when there are tetrahedra:
    /// their surface is extracted.
    pub triangles: Vec<[u32; 3]>,
    /// Named node sets: sorted node indices without repetition.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Region number of each tetrahedron, shape (m,), or empty.
    pub regions: Vec<i32>,
}

/// Why arrays do not make a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh without elements.
    #[error("the mesh has neither tetrahedra nor triangles")]
    Empty,
}

/// A checked mesh: finite nodes, indices in range, every tetrahedron positively oriented.
///
/// With tetrahedra, the surface is every face that belongs to exactly one of them, outward; without,
/// the given triangles are the surface (membrane, cloth, rigid tool).
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    data: MeshData,
    triangle_owners: Vec<u32>,
    surface_nodes: Vec<u32>,
    surface_edges: Vec<[u32; 2]>,
    triangle_edges: Vec<[u32; 3]>,
}

impl Mesh {
    /// Checks `data` and extracts the surface.
    ///
    /// # Errors
    /// If the arrays do not describe a mesh; the error names the index and the fix.
    pub fn new(data: MeshData) -> Result<Self, MeshError> {
        if data.tetrahedra.is_empty() && data.triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        Ok(Self::from_checked(data))
    }

    fn from_checked(mut data: MeshData) -> Self {
        let mut triangle_owners = Vec::new();
        if !data.tetrahedra.is_empty() {
            (data.triangles, triangle_owners) = surface::boundary_faces(&data.tetrahedra);
        }
        let surface_nodes = surface::used_nodes(&data.triangles, data.nodes.len());
        let (surface_edges, triangle_edges) = surface::edges(&data.triangles);
        Self { data, triangle_owners, surface_nodes, surface_edges, triangle_edges }
    }

    /// Node positions [m], shape (n, 3).
    pub fn nodes(&self) -> &[Point] {
        &self.data.nodes
    }

    /// Tetrahedra, shape (m, 4); empty for a surface-only mesh.
    pub fn tetrahedra(&self) -> &[[u32; 4]] {
        &self.data.tetrahedra
    }

    /// Surface triangles, shape (t, 3), outward (counter-clockwise seen from outside), in the order
    /// of the tetrahedra that own them.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.data.triangles
    }

    /// The tetrahedron that owns each surface triangle, shape (t,); empty for a surface-only mesh.
    pub fn triangle_owners(&self) -> &[u32] {
        &self.triangle_owners
    }

    /// Sorted indices of the nodes that some surface triangle uses.
    pub fn surface_nodes(&self) -> &[u32] {
        &self.surface_nodes
    }

    /// Edges of the surface, shape (e, 2), each once, smaller node first, sorted.
    pub fn surface_edges(&self) -> &[[u32; 2]] {
        &self.surface_edges
    }

    /// For each surface triangle (a, b, c) the indices of its edges ab, bc, ca in `surface_edges`.
    pub fn triangle_edges(&self) -> &[[u32; 3]] {
        &self.triangle_edges
    }

    /// Named node sets, each sorted and without repetition.
    pub fn node_sets(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.data.node_sets
    }

    /// Region number of each tetrahedron, shape (m,), or empty.
    pub fn regions(&self) -> &[i32] {
        &self.data.regions
    }

    /// Box around all nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(&self.data.nodes)
    }
}
