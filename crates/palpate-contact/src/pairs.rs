//! What detection finds: records of touching, close and penetrating surface elements.

use palpate_geometry::Point;

/// Two surface triangles that meet, with `(body_a, triangle_a) < (body_b, triangle_b)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(C)]
pub struct TrianglePair {
    /// Body of the first triangle.
    pub body_a: u32,
    /// First triangle, index into that body's surface triangles.
    pub triangle_a: u32,
    /// Body of the second triangle.
    pub body_b: u32,
    /// Second triangle, index into that body's surface triangles.
    pub triangle_b: u32,
}

/// Which surface elements a [`ProximityPair`] joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum PairKind {
    /// A node of body a and a triangle of body b.
    VertexTriangle,
    /// An edge of body a and an edge of body b.
    EdgeEdge,
}

/// Two surface elements without a common node, closer than the asked distance.
///
/// The gap is `sum(weights[i] * x[nodes[i]])` along `normal`: weights are positive on side a, negative
/// on side b and sum to zero, so they are the contact's Jacobian. The two first nodes of an edge pair
/// belong to body a; of a vertex pair only the first does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProximityPair {
    /// Kind of the two elements.
    pub kind: PairKind,
    /// Body of each side.
    pub bodies: [u32; 2],
    /// Vertex-triangle: the node and the triangle. Edge-edge: indices into `Mesh::surface_edges`.
    pub elements: [u32; 2],
    /// (vertex; triangle's three) or (edge a's two; edge b's two).
    pub nodes: [u32; 4],
    /// Signed weights of the closest points, sum zero; exactly zero where a closest point does not
    /// depend on a node.
    pub weights: [f64; 4],
    /// Unit vector from side b to side a; where the distance is zero, a normal of the elements.
    pub normal: Point,
    /// Distance \[m\], not negative.
    pub distance: f64,
}

/// A surface node that lies inside another body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PenetratingNode {
    /// Body of the node.
    pub body: u32,
    /// The node.
    pub node: u32,
    /// The body that it is inside of.
    pub into_body: u32,
    /// Surface triangle of `into_body` to leave through.
    pub triangle: u32,
    /// Barycentric weights of the exit point on that triangle.
    pub weights: [f64; 3],
    /// Unit vector from the node to the exit point: the way out.
    pub direction: Point,
    /// Distance to the exit point \[m\], positive.
    pub depth: f64,
}
