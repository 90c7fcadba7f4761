//! The mesh of one body: nodes, tetrahedra and the surface triangles found from them.

mod adjacency;
mod change;
mod check;
mod defects;
mod error;
mod measure;
mod pieces;
mod removal;
#[cfg(test)]
mod row;
mod surface;

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_geometry::{Aabb, Point};
use serde::{Deserialize, Serialize, Serializer};

pub use change::{MeshChange, NodeOrigin};
pub use check::RepairReport;
pub use defects::{Defect, DefectKind};
pub use error::{ElementKind, Indices, MeshError};
pub use measure::QualitySummary;
pub use surface::TETRAHEDRON_FACES;

pub(crate) use check::drop_unused_nodes;
pub(crate) use error::{Place, counted};

/// Marks "no tetrahedron" or "no triangle" in index arrays.
pub const NONE: u32 = u32::MAX;

/// Most fibre directions of a tetrahedron.
pub const FIBRE_FAMILIES: usize = 2;

/// What a file or a user gives: plain arrays, nothing checked.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
pub struct MeshData {
    /// Node positions [m], shape (n, 3).
    pub nodes: Vec<Point>,
    /// Node indices of each tetrahedron, shape (m, 4); positive volume as (b-a)x(c-a).(d-a) > 0.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Triangles of a surface-only mesh, shape (t, 3). Must be empty when there are tetrahedra:
    /// their surface is extracted.
    pub triangles: Vec<[u32; 3]>,
    /// Named node sets: sorted node indices without repetition ([`Mesh::new`] sorts them).
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Region number of each tetrahedron, shape (m,), or empty.
    pub regions: Vec<i32>,
    /// Fibre directions of each tetrahedron, of any length: up to two families, each shape (m, 3) or
    /// empty. A zero vector: no fibre there.
    pub fibres: [Vec<Point>; FIBRE_FAMILIES],
}

/// A checked mesh: finite nodes, indices in range, every tetrahedron positively oriented, no element
/// twice.
///
/// With tetrahedra, the surface is every face that belongs to exactly one of them, outward; without,
/// the given triangles are the surface (membrane, cloth, rigid tool).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "MeshData")]
pub struct Mesh {
    data: MeshData,
    triangle_owners: Vec<u32>,
    surface_nodes: Vec<u32>,
    surface_edges: Vec<[u32; 2]>,
    triangle_edges: Vec<[u32; 3]>,
}

impl TryFrom<MeshData> for Mesh {
    type Error = MeshError;

    fn try_from(data: MeshData) -> Result<Self, MeshError> {
        Self::new(data)
    }
}

impl Serialize for Mesh {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.clone().into_data().serialize(serializer)
    }
}

impl Mesh {
    /// Checks `data` and extracts the surface.
    ///
    /// # Errors
    /// If the arrays do not describe a mesh; the error names the index and the fix. Inverted, flat
    /// and repeated elements are refused: [`Mesh::repaired`] mends them.
    pub fn new(mut data: MeshData) -> Result<Self, MeshError> {
        check::check_arrays(&mut data)?;
        check::check_orientations(&data.nodes, &data.tetrahedra)?;
        check::check_duplicates(&data)?;
        Ok(Self::from_checked(data))
    }

    /// Like [`Mesh::new`], but re-orients inverted tetrahedra and drops flat tetrahedra, repeated
    /// elements and unused nodes; node sets and regions follow.
    ///
    /// # Errors
    /// If the arrays have a fault that cannot be mended without guessing.
    pub fn repaired(mut data: MeshData) -> Result<(Self, RepairReport), MeshError> {
        check::check_arrays(&mut data)?;
        let report = check::repair(&mut data)?;
        Ok((Self::from_checked(data), report))
    }

    /// The mesh that `data` makes, where all tetrahedra but the changed ones are those of this mesh,
    /// with the same numbers, rest positions and neighbours: the same as [`Mesh::new`], looking only
    /// at what has changed.
    fn after_change(&self, mut data: MeshData, is_changed: &[bool]) -> Result<Self, MeshError> {
        check::check_arrays(&mut data)?;
        check::check_changed(&data, is_changed)?;
        let before = (self.triangles(), self.triangle_owners());
        let (triangles, triangle_owners) =
            surface::boundary_faces_after(before, &data.tetrahedra, is_changed, data.nodes.len());
        data.triangles = triangles;
        Ok(Self::with_surface(data, triangle_owners))
    }

    fn from_checked(mut data: MeshData) -> Self {
        let mut triangle_owners = Vec::new();
        if !data.tetrahedra.is_empty() {
            (data.triangles, triangle_owners) =
                surface::boundary_faces(&data.tetrahedra, data.nodes.len());
        }
        Self::with_surface(data, triangle_owners)
    }

    fn with_surface(data: MeshData, triangle_owners: Vec<u32>) -> Self {
        let surface_nodes = surface::used_nodes(&data.triangles, data.nodes.len());
        let (surface_edges, triangle_edges) = surface::edges(&data.triangles);
        Self { data, triangle_owners, surface_nodes, surface_edges, triangle_edges }
    }

    /// The same elements with other node positions [m], shape (n, 3).
    ///
    /// # Errors
    /// If the number of positions is wrong, or one is not finite, or a tetrahedron is no longer
    /// positive.
    pub fn with_nodes(&self, nodes: Vec<Point>) -> Result<Self, MeshError> {
        if nodes.len() != self.data.nodes.len() {
            return Err(MeshError::NodeCount {
                found: nodes.len(),
                expected: self.data.nodes.len(),
            });
        }
        check::check_finite(&nodes)?;
        check::check_orientations(&nodes, &self.data.tetrahedra)?;
        let mut moved = self.clone();
        moved.data.nodes = nodes;
        Ok(moved)
    }

    /// The image under `map`, which must be affine; `mirrored` says that it turns the inside out
    /// (negative determinant), so that two nodes of each element are swapped.
    ///
    /// # Errors
    /// As [`Mesh::with_nodes`]: a map that is nearly singular flattens tetrahedra.
    pub fn mapped(&self, map: impl Fn(Point) -> Point, mirrored: bool) -> Result<Self, MeshError> {
        let nodes: Vec<Point> = self.data.nodes.iter().map(|&point| map(point)).collect();
        let fibres = self.mapped_fibres(&map);
        if !mirrored {
            let mut moved = self.with_nodes(nodes)?;
            moved.data.fibres = fibres;
            return Ok(moved);
        }
        let mut data = self.clone().into_data();
        data.nodes = nodes;
        data.fibres = fibres;
        data.tetrahedra.iter_mut().for_each(|tetrahedron| tetrahedron.swap(2, 3));
        data.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        check::check_finite(&data.nodes)?;
        check::check_orientations(&data.nodes, &data.tetrahedra)?;
        Ok(Self::from_checked(data))
    }

    /// Fibres as lines in the material, of length 1.
    fn mapped_fibres(&self, map: &impl Fn(Point) -> Point) -> [Vec<Point>; FIBRE_FAMILIES] {
        let origin = DVec3::from_array(map([0.0; 3]));
        let turned = |&fibre: &Point| {
            let length = DVec3::from_array(fibre).length();
            let image = DVec3::from_array(map(fibre.map(|x| x / length.max(f64::MIN_POSITIVE))));
            (image - origin).normalize_or_zero().to_array()
        };
        [0, 1].map(|family| self.data.fibres[family].iter().map(turned).collect())
    }

    /// The arrays that make this mesh; the triangles of a tetrahedral mesh are left out.
    pub fn into_data(mut self) -> MeshData {
        if !self.data.tetrahedra.is_empty() {
            self.data.triangles = Vec::new();
        }
        self.data
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

    /// True when the mesh has triangles only.
    pub fn is_surface_only(&self) -> bool {
        self.data.tetrahedra.is_empty()
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

    /// Fibre directions of each tetrahedron, of any length, zero where there is none: two families,
    /// each shape (m, 3) or empty.
    pub fn fibres(&self) -> &[Vec<Point>; FIBRE_FAMILIES] {
        &self.data.fibres
    }

    /// Box around all nodes.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(&self.data.nodes)
    }
}
