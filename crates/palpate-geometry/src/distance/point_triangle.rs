//! How far is a point from a triangle?

use super::{MAX_SQUARE, MIN_SQUARE, closest_parameter, from_unit_scale, to_unit_scale};
use crate::{Point, vec3};

/// Below this square of (doubled area / longest edge²) a triangle is a sliver: the signs of its
/// weights may say too little about which edges can be closest (or overflow), and all are tried.
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
    closest(offsets, edges, squares, longest)
}

#[inline]
fn closest(
    offsets: [Point; 3],
    edges: [Point; 3],
    squares: [f64; 3],
    longest: f64,
) -> PointTriangle {
    let (weights, area_squared) = foot_on_plane(offsets, edges, squares);
    let is_inside = weights.iter().all(|&weight| weight > 0.0);
    let is_sliver = area_squared <= SLIVER * longest * longest;
    if is_inside && !is_sliver {
        return on_face(offsets, edges, weights);
    }
    let mut best = PointTriangle {
        distance_squared: f64::INFINITY,
        weights: [1.0, 0.0, 0.0],
        feature: TriangleFeature::Vertex(0),
    };
    // The closest point lies on an edge that has the point on its outer side.
    for edge in 0..3 {
        if is_sliver || weights[(edge + 2) % 3] <= 0.0 {
            best = closer(best, on_edge(edge, offsets, edges, squares));
        }
    }
    if is_inside { closer(best, on_face(offsets, edges, weights)) } else { best }
}

/// Weights of the point's foot on the triangle's plane, and the square of twice its area.
///
/// Least squares by modified Gram-Schmidt: along the first edge, then along what is orthogonal to
/// it. The errors amount to moving the corners by ulps of the size, even where a thin triangle
/// makes the weights themselves uncertain; the quotients of normals do not have that property.
#[inline]
fn foot_on_plane(offsets: [Point; 3], edges: [Point; 3], squares: [f64; 3]) -> ([f64; 3], f64) {
    // Subnormal squares, beside a size of one, have no useful inverse: the edge is a point.
    if squares[0] < f64::MIN_POSITIVE {
        return ([0.0; 3], 0.0);
    }
    let inverse = 1.0 / squares[0];
    let apex_along = -vec3::dot(edges[2], edges[0]) * inverse;
    let apex_across = vec3::add_scaled(vec3::scale(edges[2], -1.0), edges[0], -apex_along);
    let along = vec3::dot(offsets[0], edges[0]) * inverse;
    let across = vec3::add_scaled(offsets[0], edges[0], -along);
    let across_squared = vec3::norm_squared(apex_across);
    if across_squared < f64::MIN_POSITIVE {
        return ([0.0; 3], 0.0);
    }
    let c = vec3::dot(across, apex_across) / across_squared;
    let b = along - c * apex_along;
    ([1.0 - b - c, b, c], squares[0] * across_squared)
}

/// Edge `i` from corner `i` to corner `(i + 1) % 3`.
#[inline]
fn edges(triangle: &[Point; 3]) -> [Point; 3] {
    let [a, b, c] = *triangle;
    [vec3::sub(b, a), vec3::sub(c, b), vec3::sub(a, c)]
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
    let squares = edges.map(vec3::norm_squared);
    // A triangle that is small beside its distance may have no normal squares even now: as a
    // sliver, all of its features are tried.
    let found = closest(offsets, edges, squares, 1.0);
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
