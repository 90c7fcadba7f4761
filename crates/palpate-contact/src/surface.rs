//! What detection needs to know of a body's surface besides its tree: who owns which feature, whether
//! the surface is closed, and which parts hang together.

use std::sync::OnceLock;

use palpate_model::mesh::NONE;
use palpate_model::{DisjointSets, Lists, Mesh};

/// Fixed facts of a surface.
///
/// Each node and edge is owned by the first triangle that has it, in the mesh's order, so that a pair of
/// features is met in exactly one pair of triangles, and nothing depends on the tree.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    /// Per triangle, in tree order: see [`owned_features`].
    pub(crate) owned: Vec<u8>,
    /// Per surface edge, the triangle that owns it, as an index into the mesh's triangles.
    pub(crate) edge_owners: Vec<u32>,
    /// Whether the surface bounds a volume.
    pub(crate) closed: bool,
    /// Per node, the smallest node of its connected part of the surface; itself for an inner node.
    pub(crate) components: Vec<u32>,
    /// One node of each connected part: the smallest.
    pub(crate) component_nodes: Vec<u32>,
    /// The surface triangles around each node.
    pub(crate) triangles_of_nodes: Lists<u32>,
    tetrahedra_of_nodes: OnceLock<Lists<u32>>,
}

impl Surface {
    pub(crate) fn new(mesh: &Mesh, triangle_order: &[u32]) -> Self {
        let owned_by_triangle = owned_features(mesh);
        let mut edge_owners = vec![NONE; mesh.surface_edges().len()];
        for (triangle, edges) in mesh.triangle_edges().iter().enumerate() {
            for (i, &edge) in edges.iter().enumerate() {
                if owned_by_triangle[triangle] & 8 << i != 0 {
                    edge_owners[edge as usize] = triangle as u32;
                }
            }
        }
        let owned = triangle_order.iter().map(|&t| owned_by_triangle[t as usize]).collect();
        let components = join_nodes(mesh);
        let smallest = |&node: &u32| components[node as usize] == node;
        Self {
            owned,
            edge_owners,
            closed: mesh.is_closed(),
            component_nodes: mesh.surface_nodes().iter().copied().filter(smallest).collect(),
            components,
            triangles_of_nodes: mesh.node_triangles(),
            tetrahedra_of_nodes: OnceLock::new(),
        }
    }

    /// The tetrahedra around each node of `mesh`, the surface's own; made when first asked for.
    pub(crate) fn tetrahedra_of_nodes(&self, mesh: &Mesh) -> &Lists<u32> {
        self.tetrahedra_of_nodes.get_or_init(|| mesh.node_tetrahedra())
    }
}

/// Per triangle: bit i set when it owns its node i, bit 3 + i its edge i (ab, bc, ca).
pub(crate) fn owned_features(mesh: &Mesh) -> Vec<u8> {
    let mut node_seen = vec![false; mesh.nodes().len()];
    let mut edge_seen = vec![false; mesh.surface_edges().len()];
    let mut is_first = |nodes: &[u32; 3], edges: &[u32; 3]| {
        let mut bits = 0;
        for i in 0..3 {
            if !std::mem::replace(&mut node_seen[nodes[i] as usize], true) {
                bits |= 1 << i;
            }
            if !std::mem::replace(&mut edge_seen[edges[i] as usize], true) {
                bits |= 8 << i;
            }
        }
        bits
    };
    let triangles = mesh.triangles().iter().zip(mesh.triangle_edges());
    triangles.map(|(nodes, edges)| is_first(nodes, edges)).collect()
}

/// Labels each node with the smallest node that triangles connect it with.
fn join_nodes(mesh: &Mesh) -> Vec<u32> {
    let mut parts = DisjointSets::new(mesh.nodes().len());
    for &[a, b, c] in mesh.triangles() {
        parts.join(a, b);
        parts.join(b, c);
    }
    (0..mesh.nodes().len() as u32).map(|node| parts.root(node)).collect()
}
