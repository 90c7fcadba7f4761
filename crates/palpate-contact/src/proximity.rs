//! From two close surface elements to a record: closest points, weights and normal.

use palpate_geometry::{Point, edge_edge, point_triangle, vec3};

use crate::frame::Frame;
use crate::left_out::ElementPair;
use crate::local_minimum::{falls_away, falls_away_from_closest, is_first};
use crate::options::ProximityOptions;
use crate::pairs::{PairKind, ProximityPair};

/// Distances below this fraction of the elements' size are too small to give a direction.
const DIRECTION_THRESHOLD: f64 = 1e-12;

/// Which pairs of features are wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// Those closer than this [m].
    pub(crate) distance: f64,
    pub(crate) options: ProximityOptions,
}

/// Node `node` of body `body_a` against triangle `triangle` of body `body_b`; `None` when they share
/// the node or are otherwise not wanted.
pub(crate) fn vertex_triangle(
    frame: &Frame,
    [body_a, body_b]: [u32; 2],
    [node, triangle]: [u32; 2],
    limit: Limit,
) -> Option<ProximityPair> {
    let [a, b] = [body_a, body_b].map(|body| &frame.bodies[body as usize]);
    let corners = b.mesh.triangles()[triangle as usize];
    if body_a == body_b && corners.contains(&node) {
        return None;
    }
    let point = a.positions[node as usize];
    let points = b.triangle(triangle);
    let found = point_triangle(point, &points);
    let gap = found.distance_squared.sqrt();
    if gap >= limit.distance {
        return None;
    }
    let local = limit.options.local_minima;
    if local && !is_first(b, triangle, found.weights) {
        return None;
    }
    let [wa, wb, wc] = found.weights;
    let weights = [1.0, -wa, -wb, -wc];
    let offset = combine(weights, [point, points[0], points[1], points[2]]);
    let normal = direction(offset, gap, size(&points))
        .or_else(|| unit(triangle_normal(&points)))
        .unwrap_or_else(|| any_normal(vec3::sub(points[1], points[0])));
    if local && gap > 0.0 && !falls_away_from_closest(b, triangle, found.weights, normal) {
        return None;
    }
    if frame.leaves_out([body_a, body_b], ElementPair::NodeAndTriangle([node, triangle])) {
        return None;
    }
    if !limit.options.close_at_rest {
        let at_rest = corners.map(|node| b.mesh.nodes()[node as usize]);
        let found = point_triangle(a.mesh.nodes()[node as usize], &at_rest);
        if found.distance_squared.sqrt() < limit.distance {
            return None;
        }
    }
    Some(ProximityPair {
        kind: PairKind::VertexTriangle,
        bodies: [body_a, body_b],
        elements: [node, triangle],
        nodes: [node, corners[0], corners[1], corners[2]],
        weights,
        normal,
        distance: gap,
    })
}

/// Two surface edges; `None` when they share a node or are otherwise not wanted.
pub(crate) fn edge_pair(
    frame: &Frame,
    [body_a, body_b]: [u32; 2],
    [edge_a, edge_b]: [u32; 2],
    limit: Limit,
) -> Option<ProximityPair> {
    let [a, b] = [body_a, body_b].map(|body| &frame.bodies[body as usize]);
    let nodes_a = a.mesh.surface_edges()[edge_a as usize];
    let nodes_b = b.mesh.surface_edges()[edge_b as usize];
    if body_a == body_b && nodes_a.iter().any(|node| nodes_b.contains(node)) {
        return None;
    }
    let points_a = nodes_a.map(|node| a.positions[node as usize]);
    let points_b = nodes_b.map(|node| b.positions[node as usize]);
    let found = edge_edge(&points_a, &points_b);
    let gap = found.distance_squared.sqrt();
    let (s, t) = (found.s, found.t);
    let weights = [1.0 - s, s, t - 1.0, -t];
    let local = limit.options.local_minima;
    if gap >= limit.distance || (local && weights.contains(&0.0)) {
        return None;
    }
    let points = [points_a[0], points_a[1], points_b[0], points_b[1]];
    let along_a = vec3::sub(points_a[1], points_a[0]);
    let along_b = vec3::sub(points_b[1], points_b[0]);
    let crossing = || {
        let normal = unit(vec3::cross(along_a, along_b))?;
        // Of the two, the one out of body b and into body a, by the triangles that own the edges.
        let out_of_a = triangle_normal(&a.triangle(a.surface.edge_owners[edge_a as usize]));
        let out_of_b = triangle_normal(&b.triangle(b.surface.edge_owners[edge_b as usize]));
        let outwards = vec3::dot(normal, vec3::sub(out_of_b, out_of_a)) >= 0.0;
        Some(if outwards { normal } else { vec3::scale(normal, -1.0) })
    };
    let longest = vec3::norm(along_a).max(vec3::norm(along_b));
    let normal = direction(combine(weights, points), gap, longest)
        .or_else(crossing)
        .unwrap_or_else(|| any_normal(along_a));
    if local && gap > 0.0 {
        let back = vec3::scale(normal, -1.0);
        if !falls_away(a, nodes_a, back) || !falls_away(b, nodes_b, normal) {
            return None;
        }
    }
    if frame.leaves_out([body_a, body_b], ElementPair::Edges([edge_a, edge_b])) {
        return None;
    }
    if !limit.options.close_at_rest {
        let at_rest_a = nodes_a.map(|node| a.mesh.nodes()[node as usize]);
        let at_rest_b = nodes_b.map(|node| b.mesh.nodes()[node as usize]);
        if edge_edge(&at_rest_a, &at_rest_b).distance_squared.sqrt() < limit.distance {
            return None;
        }
    }
    Some(ProximityPair {
        kind: PairKind::EdgeEdge,
        bodies: [body_a, body_b],
        elements: [edge_a, edge_b],
        nodes: [nodes_a[0], nodes_a[1], nodes_b[0], nodes_b[1]],
        weights,
        normal,
        distance: gap,
    })
}

/// The order of results: unique, so that sorting is the same everywhere.
pub(crate) fn sort(pairs: &mut [ProximityPair]) {
    pairs.sort_unstable_by_key(|pair| (pair.kind, pair.bodies, pair.elements));
}

/// The unit vector along `offset`, when it is long enough beside the elements' `size` to have one.
pub(crate) fn direction(offset: Point, length: f64, size: f64) -> Option<Point> {
    if length > DIRECTION_THRESHOLD * size { unit(offset) } else { None }
}

/// Longest edge of a triangle \[m\].
pub(crate) fn size([a, b, c]: &[Point; 3]) -> f64 {
    let longest = vec3::distance_squared(*a, *b)
        .max(vec3::distance_squared(*b, *c))
        .max(vec3::distance_squared(*c, *a));
    longest.sqrt()
}

/// Outward normal, twice as long as the triangle's area.
pub(crate) fn triangle_normal([a, b, c]: &[Point; 3]) -> Point {
    vec3::cross(vec3::sub(*b, *a), vec3::sub(*c, *a))
}

/// The unit vector along `vector`, of any scale; `None` for zero.
pub(crate) fn unit(vector: Point) -> Option<Point> {
    let largest = vec3::max_abs(vector);
    if largest.is_normal() { vec3::normalized(vector.map(|value| value / largest)) } else { None }
}

/// A unit vector at right angles to `edge`, which may be zero.
pub(crate) fn any_normal(edge: Point) -> Point {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let longest = vec3::max_abs(edge);
    let axis = (0..3).find(|&axis| edge[axis].abs() < longest).unwrap_or(2);
    unit(vec3::cross(edge, axes[axis])).unwrap_or(axes[2])
}

fn combine(weights: [f64; 4], points: [Point; 4]) -> Point {
    let mut sum = [0.0; 3];
    // Relative to the first point: the weights sum to zero, and far from the origin digits are kept.
    for (weight, point) in weights.into_iter().zip(points) {
        sum = vec3::add_scaled(sum, vec3::sub(point, points[0]), weight);
    }
    sum
}
