//! Contacts of a body with itself: what lies close at rest, lips of a cut, tissue that is inside out.

use glam::DVec3;
use palpate_contact::{PairKind, ProximityPair};
use palpate_geometry::tetrahedron::signed_volume;

use super::super::side;
use super::BodyView;
use super::closest::Closest;

/// Elements of one body closer than this at rest, in contact distances, do not push each other.
pub(super) const REST_NEIGHBOUR: f64 = 2.0;
/// A node behind its own body's surface has passed through it when the two were this many times
/// farther apart at rest; otherwise there is only a thin wall between them.
pub(super) const PASSED_THROUGH: f64 = 4.0;
/// Lips of a cut: the normals of a node and a triangle at rest have at most this cosine, and the node is
/// behind the triangle by no more than this part of the mean edge. The nodes at the rim of a lip also have
/// a part of the skin around them.
const LIP_COSINE: f64 = -0.3;
const COINCIDENT: f64 = 1e-6;

/// Distance between the two contact points when the body is at rest [m].
pub(super) fn rest_distance(pair: &ProximityPair, bodies: [BodyView<'_>; 2]) -> f64 {
    let mut difference = DVec3::ZERO;
    for (corner, (&node, &weight)) in pair.nodes.iter().zip(&pair.weights).enumerate() {
        difference += weight * bodies[side(pair.kind, corner)].rest(node);
    }
    difference.length()
}

/// Whether a node and a triangle of one body face each other at rest, as the two lips of a cut do, where
/// they are closer than any contact distance. On the two sides of a thin wall each is behind the other.
/// Where the node is closest to an edge or a corner, one of the triangles around it is enough: around
/// the rim of a lip is skin as well.
pub(super) fn are_lips(pair: &ProximityPair, body: &BodyView<'_>) -> bool {
    let mesh = body.surface.mesh();
    let node = pair.nodes[0];
    let normal = body.surface.node_normal(node, mesh.nodes());
    let faces = |triangle: u32| {
        let facing = body.surface.triangle_normal(triangle, mesh.nodes());
        let corner = mesh.triangles()[triangle as usize][0];
        let height = (body.rest(node) - body.rest(corner)).dot(facing);
        height > -COINCIDENT * body.parameters.mean_edge && normal.dot(facing) < LIP_COSINE
    };
    match Closest::of(pair, body.surface) {
        Closest::Inside => faces(pair.elements[1]),
        Closest::Edge { edge, .. } => {
            body.surface.edge_triangles(edge).iter().any(|&(triangle, _)| faces(triangle))
        }
        Closest::Corner(corner) => body.surface.node_triangles(corner).iter().any(|&t| faces(t)),
    }
}

/// Whether the tissue at a pair of one body is turned inside out: there its surface lies folded over itself
/// on the wrong side, and contacts would hold it so.
pub(super) fn is_inside_out(pair: &ProximityPair, body: &BodyView<'_>) -> bool {
    let mesh = body.surface.mesh();
    let is_turned = |triangle: u32| {
        let Some(&owner) = mesh.triangle_owners().get(triangle as usize) else { return false };
        let corners = mesh.tetrahedra()[owner as usize];
        signed_volume(&corners.map(|node| body.positions[node as usize])) <= 0.0
    };
    let at_edge = |edge: u32| body.surface.edge_triangles(edge).iter().any(|&(t, _)| is_turned(t));
    let [a, b] = pair.elements;
    match pair.kind {
        PairKind::VertexTriangle => {
            is_turned(b) || body.surface.node_triangles(a).iter().any(|&t| is_turned(t))
        }
        PairKind::EdgeEdge => at_edge(a) || at_edge(b),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use palpate_model::{Body, Mesh, MeshData};

    use super::super::super::{ContactParameters, Surface};
    use super::super::{Detected, Filter};
    use super::*;

    /// How many contacts there are where the tip of one tetrahedron of a body is just above another one,
    /// its other nodes `height` above the tip.
    fn own_contacts(height: f64) -> usize {
        let below = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
        let above = |tip: f64| {
            let top = tip + height;
            [[0.0, 0.0, tip], [1.0, 0.0, top], [-1.0, 1.0, top], [-1.0, -1.0, top]]
        };
        let upright = [[0.0, 0.0, 9.0], [1.0, 0.0, 10.0], [-1.0, 1.0, 10.0], [-1.0, -1.0, 10.0]];
        let data = MeshData {
            nodes: [below, upright].concat(),
            tetrahedra: vec![[0, 1, 2, 3], [4, 5, 6, 7]],
            ..MeshData::default()
        };
        let body = Body::new("two", Arc::new(Mesh::new(data).unwrap()));
        let surface = Surface::new(&body.mesh);
        let parameters = ContactParameters::new(0, &body).unwrap();
        let positions = [below, above(0.01)].concat();
        let facing = |corners: &[u32; 3]| corners.iter().all(|corner| (1..4).contains(corner));
        let triangle = body.mesh.triangles().iter().position(facing).unwrap();
        let [a, b, c] = body.mesh.triangles()[triangle];
        // The tip is above the middle of the triangle's nodes 1, 2 and 3, at (0, 0, 0).
        let weight = |node: u32| if node == 1 { -0.5 } else { -0.25 };
        let pair = ProximityPair {
            kind: PairKind::VertexTriangle,
            bodies: [0, 0],
            elements: [4, triangle as u32],
            nodes: [4, a, b, c],
            weights: [1.0, weight(a), weight(b), weight(c)],
            normal: [0.0, 0.0, 1.0],
            distance: 0.01,
        };
        let view =
            |_| BodyView { surface: &surface, parameters: &parameters, positions: &positions };
        let detected = Detected { proximity: &[pair], penetration: &[] };
        let mut candidates = Vec::new();
        Filter::default().run(detected, view, |_| false, 0.01, None, &mut candidates);
        candidates.len()
    }

    #[test]
    fn a_body_does_not_push_itself_where_it_is_inside_out() {
        assert_eq!(own_contacts(1.0), 1);
        assert_eq!(own_contacts(0.0), 0);
        assert_eq!(own_contacts(-0.005), 0);
    }
}
