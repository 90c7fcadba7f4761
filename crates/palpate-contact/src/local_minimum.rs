//! Where the distance between two surfaces has a local minimum, told by the features around the closest points.

use palpate_geometry::{Point, vec3};

use crate::frame::SceneBody;
use crate::options::LOCAL_MINIMUM_SLACK;

/// What of a triangle is closest to a node, by the weights of the closest point.
enum Closest {
    Inside,
    /// Edge i joins corners i and i + 1.
    Edge(usize),
    Corner(usize),
}

impl Closest {
    fn of(weights: [f64; 3]) -> Self {
        let mut on = (0..3).filter(|&corner| weights[corner] != 0.0);
        match (on.next(), on.next(), on.next()) {
            (Some(corner), None, _) => Self::Corner(corner),
            (Some(first), Some(second), None) => {
                Self::Edge(if second == first + 1 { first } else { second })
            }
            _ => Self::Inside,
        }
    }
}

/// Whether a triangle is the first of those that share what of it is closest.
pub(crate) fn is_first(body: &SceneBody, triangle: u32, weights: [f64; 3]) -> bool {
    match Closest::of(weights) {
        Closest::Inside => true,
        Closest::Edge(place) => {
            let edge = body.mesh.triangle_edges()[triangle as usize][place];
            body.surface.edge_owners[edge as usize] == triangle
        }
        Closest::Corner(place) => {
            let node = body.mesh.triangles()[triangle as usize][place];
            body.surface.triangles_of_nodes.of(node)[0] == triangle
        }
    }
}

/// Whether the surface around what of a triangle is closest does not lead in direction `normal`, which goes
/// from there to a node.
pub(crate) fn falls_away_from_closest(
    body: &SceneBody,
    triangle: u32,
    weights: [f64; 3],
    normal: Point,
) -> bool {
    let corners = body.mesh.triangles()[triangle as usize];
    match Closest::of(weights) {
        Closest::Inside => true,
        Closest::Edge(place) => {
            falls_away(body, [place, (place + 1) % 3].map(|k| corners[k]), normal)
        }
        Closest::Corner(place) => falls_away(body, [corners[place]; 2], normal),
    }
}

/// Whether no triangle that has both ends of an edge, or a node given twice, leads from there in direction
/// `normal`. Either end is as good to measure from: `normal` is at right angles to the edge.
pub(crate) fn falls_away(body: &SceneBody, [start, end]: [u32; 2], normal: Point) -> bool {
    let [from, to] = [start, end].map(|node| body.positions[node as usize]);
    let leads_closer = |other: u32| {
        let at = body.positions[other as usize];
        let longest = vec3::distance_squared(at, from).max(vec3::distance_squared(at, to)).sqrt();
        vec3::dot(vec3::sub(at, from), normal) > LOCAL_MINIMUM_SLACK * longest
    };
    let around = body.surface.triangles_of_nodes.of(start).iter();
    let mut around = around.map(|&triangle| body.mesh.triangles()[triangle as usize]);
    !around.any(|corners| {
        let mut others = corners.into_iter().filter(|&other| other != start && other != end);
        corners.contains(&end) && others.any(leads_closer)
    })
}
