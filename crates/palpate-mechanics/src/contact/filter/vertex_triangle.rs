//! Nodes against triangles.

use glam::DVec3;
use palpate_contact::ProximityPair;

use super::closest::Closest;
use super::own::{PASSED_THROUGH, REST_NEIGHBOUR, are_lips, rest_distance};
use super::{ANGLE_SLACK, BodyView, Meeting, leads_away};

/// A node whose own surface faces away from the other body by more than this does not touch it.
const FACING_LIMIT: f64 = 0.2;

/// Gap and normal of a node against a triangle, if the pair is a contact.
pub(super) fn vertex_triangle(
    pair: &ProximityPair,
    [own, other]: [BodyView<'_>; 2],
) -> Option<Meeting> {
    let mut normal = DVec3::from_array(pair.normal);
    let mut gap = pair.distance;
    let [node, triangle] = pair.elements;
    let leads_away =
        |from: u32, to: u32| leads_away(other.at(to) - other.at(from), normal, ANGLE_SLACK);
    // Of the triangles around an edge or a corner the first one stands for all.
    let outward = match Closest::of(pair, other.surface) {
        Closest::Inside => other.surface.triangle_normal(triangle, other.positions),
        Closest::Edge { edge, from } => {
            let triangles = other.surface.edge_triangles(edge);
            let away = |&(_, opposite): &(u32, u32)| leads_away(from, opposite);
            if triangles[0].0 != triangle || (gap > 0.0 && !triangles.iter().all(away)) {
                return None;
            }
            other.surface.edge_normal(edge, other.positions)
        }
        Closest::Corner(corner) => {
            let neighbours = other.surface.node_neighbours(corner);
            let away = |&neighbour: &u32| leads_away(corner, neighbour);
            if other.surface.node_triangles(corner)[0] != triangle
                || (gap > 0.0 && !neighbours.iter().all(away))
            {
                return None;
            }
            other.surface.node_normal(corner, other.positions)
        }
    };
    let own_surface = pair.bodies[0] == pair.bodies[1];
    let mut behind = other.surface.is_closed() && outward.dot(normal) < 0.0;
    let mut offset = 0.0;
    if own_surface {
        let h = own.parameters.distance(own.parameters);
        let apart = rest_distance(pair, [own, other]);
        let lips = apart < PASSED_THROUGH * h && are_lips(pair, &own);
        if apart < REST_NEIGHBOUR * h && !lips {
            return None;
        }
        if lips {
            offset = h - apart.min(h);
        }
        if behind && (lips || apart > PASSED_THROUGH * gap.max(h)) {
            // Through its own surface: pushed back the way it came.
            (gap, normal, behind) = (-gap, -normal, false);
        }
    }
    if behind {
        return None;
    }
    let faces_away = own.surface.is_closed()
        && own.surface.node_normal(node, own.positions).dot(normal) > FACING_LIMIT;
    if !faces_away {
        return Some(Meeting { gap, normal, offset });
    }
    // The node of a closed body has slipped through an open surface when an edge from it
    // crosses back: it is pulled out again. Otherwise it only sees that surface through its body.
    let through = !other.surface.is_closed()
        && own
            .surface
            .node_neighbours(node)
            .iter()
            .any(|&neighbour| (own.at(neighbour) - own.at(node)).dot(normal) < -gap);
    through.then_some(Meeting { gap: -gap, normal: -normal, offset: 0.0 })
}
