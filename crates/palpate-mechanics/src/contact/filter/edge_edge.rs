//! Edges against edges.

use glam::DVec3;
use palpate_contact::{LOCAL_MINIMUM_SLACK, ProximityPair};

use super::own::{REST_NEIGHBOUR, rest_distance};
use super::{ANGLE_SLACK, BodyView, Meeting, leads_away};

/// Edge pairs count only where both edges are sharper than this (sine of the angle between the
/// faces): on smooth surfaces nodes against triangles do, up to a small part of the contact distance.
const SHARP_EDGE: f64 = 0.25;
/// The same for a pair that carried a force in the last step: where pushing and letting go flatten and
/// sharpen an edge across the limit, a pair would come and go for ever and the bodies never rest.
const LOADED_SHARP_EDGE: f64 = 0.05;
/// Slack in the tests of direction of such a pair.
const LOADED_SLACK: f64 = 0.05;
const _: () =
    assert!(LOADED_SLACK < LOCAL_MINIMUM_SLACK, "what detection leaves out is no contact");

/// Gap and normal of an edge against an edge, if the pair is a contact.
pub(super) fn edge_edge(
    pair: &ProximityPair,
    [own, other]: [BodyView<'_>; 2],
    is_loaded: bool,
) -> Option<Meeting> {
    let (slack, sharp_edge) =
        if is_loaded { (LOADED_SLACK, LOADED_SHARP_EDGE) } else { (ANGLE_SLACK, SHARP_EDGE) };
    if pair.weights.contains(&0.0) {
        return None;
    }
    let normal = DVec3::from_array(pair.normal);
    let inside_cone = |body: &BodyView<'_>, edge: u32, from: u32, direction: DVec3| {
        let triangles = body.surface.edge_triangles(edge);
        let from = body.at(from);
        let away = |&(_, node): &(u32, u32)| leads_away(body.at(node) - from, direction, slack);
        let convex = match triangles {
            [(first, _), (second, _)] => {
                let first = body.surface.triangle_normal(*first, body.positions);
                let second = body.surface.triangle_normal(*second, body.positions);
                let sharp = first.cross(second).length() > sharp_edge || first.dot(second) < 0.0;
                // Behind the edge of a closed surface is the inside of the body.
                sharp && (!body.surface.is_closed() || (first + second).dot(direction) > 0.0)
            }
            _ => true,
        };
        convex && triangles.iter().all(away)
    };
    let kept = inside_cone(&own, pair.elements[0], pair.nodes[0], -normal)
        && inside_cone(&other, pair.elements[1], pair.nodes[2], normal);
    let neighbours = pair.bodies[0] == pair.bodies[1]
        && rest_distance(pair, [own, other])
            < REST_NEIGHBOUR * own.parameters.distance(own.parameters);
    (kept && !neighbours).then_some(Meeting { gap: pair.distance, normal, offset: 0.0 })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use palpate_contact::PairKind;
    use palpate_geometry::Point;
    use palpate_geometry::tetrahedron::orientation;
    use palpate_model::{Body, Mesh, MeshData};

    use super::super::super::{ContactParameters, Surface};
    use super::super::{Detected, Filter};
    use super::*;

    /// A tetrahedron with an edge from `a` to `b` whose faces fall off to `c` and `d`.
    fn roof(nodes: [Point; 4]) -> Body {
        let mut data = MeshData { nodes: nodes.to_vec(), ..MeshData::default() };
        let upright = orientation(&nodes) > 0;
        data.tetrahedra.push(if upright { [0, 1, 2, 3] } else { [0, 1, 3, 2] });
        Body::new("roof", Arc::new(Mesh::new(data).unwrap()))
    }

    /// Whether two roofs with a slope of `slope` touch with their edges, crosswise.
    fn edges_touch(slope: f64, is_loaded: bool) -> bool {
        let below =
            roof([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, -slope], [1.0, 0.0, -slope]]);
        let above = roof([
            [-1.0, 0.0, 0.01],
            [1.0, 0.0, 0.01],
            [0.0, -1.0, 0.01 + slope],
            [0.0, 1.0, 0.01 + slope],
        ]);
        let bodies = [above, below];
        let surfaces = bodies.each_ref().map(|body| Surface::new(&body.mesh));
        let parameters = bodies.each_ref().map(|body| ContactParameters::new(0, body).unwrap());
        let edge = |body: usize| {
            let edges = bodies[body].mesh.surface_edges();
            edges.iter().position(|edge| edge.contains(&0) && edge.contains(&1)).unwrap() as u32
        };
        let pair = ProximityPair {
            kind: PairKind::EdgeEdge,
            bodies: [0, 1],
            elements: [edge(0), edge(1)],
            nodes: [0, 1, 0, 1],
            weights: [0.5, 0.5, -0.5, -0.5],
            normal: [0.0, 0.0, 1.0],
            distance: 0.01,
        };
        let view = |body: u32| BodyView {
            surface: &surfaces[body as usize],
            parameters: &parameters[body as usize],
            positions: bodies[body as usize].mesh.nodes(),
        };
        let mut candidates = Vec::new();
        Filter::default().run(
            Detected { proximity: &[pair], penetration: &[] },
            view,
            |_| is_loaded,
            0.01,
            None,
            &mut candidates,
        );
        !candidates.is_empty()
    }

    #[test]
    fn a_pair_that_bears_a_force_is_not_dropped_at_the_limit_where_it_began() {
        assert!(edges_touch(0.2, false) && edges_touch(0.2, true));
        assert!(!edges_touch(0.1, false) && edges_touch(0.1, true));
        assert!(!edges_touch(0.02, false) && !edges_touch(0.02, true));
    }
}
