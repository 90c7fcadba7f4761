//! How far is a point from a triangle?

use super::{MAX_SQUARE, MIN_SQUARE, closest_parameter, from_unit_scale, to_unit_scale};
use crate::{Point, vec3};

/// Below this square of (area / longest edge²) a triangle is a sliver: barycentric coordinates from
/// the normal lose more than about five digits there.
const SLIVER: f64 = 1e-8;

/// The part of a triangle that holds the closest point in its relative interior.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TriangleFeature {
    /// The inside of the triangle.
    Face,
    /// The inside of the edge that joins corner `i` and `(i + 1) % 3`.
    Edge(u8),
    /// Corner `i`.
    Vertex(u8),
}

/// The point of a triangle closest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointTriangle {
    /// Squared distance [m²].
    pub distance_squared: f64,
    /// Barycentric weights of the closest point, in [0, 1]: exactly zero off the feature, sum 1
    /// within rounding.
    pub weights: [f64; 3],
    /// Where the closest point lies.
    pub feature: TriangleFeature,
}

/// The point of a closed triangle closest to `point`.
///
/// A degenerate triangle is the segment or point that its corners span.
pub fn point_triangle(point: Point, triangle: &[Point; 3]) -> PointTriangle {
    let offsets = triangle.map(|corner| vec3::sub(point, corner));
    let edges = edges(triangle);
    let squares = edges.map(vec3::norm_squared);
    let longest = squares[0].max(squares[1]).max(squares[2]);
    if !((MIN_SQUARE..=MAX_SQUARE).contains(&longest)
        && vec3::norm_squared(offsets[0]) <= MAX_SQUARE)
    {
        return rescaled(point, triangle);
    }
    let normal = vec3::cross(edges[0], edges[1]);
    if vec3::norm_squared(normal) < SLIVER * longest * longest {
        return closest_in_sliver(offsets, edges, squares);
    }
    // Twice the signed area opposite to each corner, times the length of the normal.
    let areas = [1, 2, 0].map(|i| vec3::dot(normal, vec3::cross(edges[i], offsets[i])));
    if areas.iter().all(|&area| area > 0.0) {
        let inverse = 1.0 / (areas[0] + areas[1] + areas[2]);
        return on_face(offsets, edges, areas.map(|area| area * inverse));
    }
    // The closest point lies on an edge that has the point on its outer side.
    let mut best = PointTriangle {
        distance_squared: f64::INFINITY,
        weights: [1.0, 0.0, 0.0],
        feature: TriangleFeature::Vertex(0),
    };
    for edge in 0..3 {
        if areas[(edge + 2) % 3] <= 0.0 {
            best = closer(best, on_edge(edge, offsets, edges, squares));
        }
    }
    best
}

/// Edge `i` from corner `i` to corner `(i + 1) % 3`.
#[inline]
fn edges(triangle: &[Point; 3]) -> [Point; 3] {
    let [a, b, c] = *triangle;
    [vec3::sub(b, a), vec3::sub(c, b), vec3::sub(a, c)]
}

/// All candidates: the three edges, and the face in coordinates along and across the longest edge
/// (Gram-Schmidt), whose errors move the closest point by ulps even where the weights are poor.
#[cold]
#[inline(never)]
fn closest_in_sliver(offsets: [Point; 3], edges: [Point; 3], squares: [f64; 3]) -> PointTriangle {
    let mut best = on_edge(0, offsets, edges, squares);
    for edge in 1..3 {
        best = closer(best, on_edge(edge, offsets, edges, squares));
    }
    let longest = (0..3).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let [i, j, k] = [longest, (longest + 1) % 3, (longest + 2) % 3];
    if squares[i] > 0.0 {
        let apex = vec3::scale(edges[k], -1.0);
        let along = vec3::dot(apex, edges[i]) / squares[i];
        let across = vec3::add_scaled(apex, edges[i], -along);
        let across_squared = vec3::norm_squared(across);
        if across_squared > 0.0 {
            let height = vec3::dot(offsets[i], across) / across_squared;
            let foot = vec3::dot(offsets[i], edges[i]) / squares[i] - height * along;
            let mut weights = [0.0; 3];
            (weights[i], weights[j], weights[k]) = (1.0 - foot - height, foot, height);
            if weights.iter().all(|&weight| weight > 0.0) {
                best = closer(best, on_face(offsets, edges, weights));
            }
        }
    }
    best
}

/// Degenerate triangles and extreme scales.
#[cold]
#[inline(never)]
fn rescaled(point: Point, triangle: &[Point; 3]) -> PointTriangle {
    let [a, b, c] = *triangle;
    let ([a, b, c, point], exponent) = to_unit_scale([a, b, c, point]);
    let triangle = [a, b, c];
    let offsets = triangle.map(|corner| vec3::sub(point, corner));
    let edges = edges(&triangle);
    let found = closest_in_sliver(offsets, edges, edges.map(vec3::norm_squared));
    PointTriangle { distance_squared: from_unit_scale(found.distance_squared, exponent), ..found }
}

#[inline]
fn on_face(offsets: [Point; 3], edges: [Point; 3], weights: [f64; 3]) -> PointTriangle {
    // point - (a + weights[1] (b - a) + weights[2] (c - a))
    let gap = vec3::add_scaled(offsets[0], edges[0], -weights[1]);
    let gap = vec3::add_scaled(gap, edges[2], weights[2]);
    PointTriangle {
        distance_squared: vec3::norm_squared(gap),
        weights,
        feature: TriangleFeature::Face,
    }
}

#[inline]
fn on_edge(
    edge: usize,
    offsets: [Point; 3],
    edges: [Point; 3],
    squares: [f64; 3],
) -> PointTriangle {
    let end = (edge + 1) % 3;
    let t = closest_parameter(offsets[edge], edges[edge], squares[edge]);
    let mut weights = [0.0; 3];
    weights[edge] = 1.0 - t;
    weights[end] = t;
    let (feature, gap) = if t <= 0.0 {
        (TriangleFeature::Vertex(edge as u8), offsets[edge])
    } else if t >= 1.0 {
        (TriangleFeature::Vertex(end as u8), offsets[end])
    } else {
        let gap = vec3::add_scaled(offsets[edge], edges[edge], -t);
        (TriangleFeature::Edge(edge as u8), gap)
    };
    PointTriangle { distance_squared: vec3::norm_squared(gap), weights, feature }
}

/// The closer of two; the first of equals.
#[inline]
fn closer(first: PointTriangle, second: PointTriangle) -> PointTriangle {
    if second.distance_squared < first.distance_squared { second } else { first }
}
