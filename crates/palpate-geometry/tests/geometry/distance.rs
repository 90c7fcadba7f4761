//! Distances against an enumeration of all features in exact fractions.

use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive};
use palpate_geometry::{Point, TriangleFeature, edge_edge, point_triangle};
use proptest::prelude::*;

use crate::{
    integers::{Vector, cross, dot, integer_points, sub},
    strategies::{floats, for_all, grid, perturbed_grid, scaled_grid},
};

/// Allowed error of a distance, relative to the largest difference of coordinates.
const TOLERANCE: f64 = 32.0 * f64::EPSILON;

/// A fraction with a positive denominator.
#[derive(Clone)]
struct Fraction(BigInt, BigInt);

impl Fraction {
    fn min(self, other: Self) -> Self {
        if &other.0 * &self.1 < &self.0 * &other.1 { other } else { self }
    }

    /// The square root times 2^`exponent`, rounded.
    fn root(&self, exponent: i32) -> f64 {
        if self.0 == BigInt::ZERO {
            return 0.0;
        }
        // About 120 bits of the quotient, an even number of bits shifted in.
        let shift = (120 + self.1.bits() as i64 - self.0.bits() as i64).div_euclid(2) * 2;
        let quotient =
            if shift >= 0 { (&self.0 << shift) / &self.1 } else { &self.0 / (&self.1 << -shift) };
        let root = quotient.to_f64().expect("120 bits").sqrt();
        let exponent = i64::from(exponent) - shift / 2;
        let half = (exponent / 2) as i32;
        root * 2.0_f64.powi(half) * 2.0_f64.powi((exponent - exponent / 2) as i32)
    }
}

fn point_point(a: &Vector<BigInt>, b: &Vector<BigInt>) -> Fraction {
    let difference = sub(a, b);
    Fraction(dot(&difference, &difference), BigInt::from(1))
}

/// Squared distance to the inside of an edge, where the foot lies there.
fn point_edge(p: &Vector<BigInt>, a: &Vector<BigInt>, b: &Vector<BigInt>) -> Option<Fraction> {
    let (edge, offset) = (sub(b, a), sub(p, a));
    let (along, length) = (dot(&edge, &offset), dot(&edge, &edge));
    let normal = cross(&edge, &offset);
    (along.is_positive() && along < length).then(|| Fraction(dot(&normal, &normal), length))
}

fn point_face(p: &Vector<BigInt>, triangle: &[Vector<BigInt>]) -> Option<Fraction> {
    let [a, b, c] = triangle else { unreachable!("three corners") };
    let normal = cross(&sub(b, a), &sub(c, a));
    let is_inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(from, to)| dot(&normal, &cross(&sub(to, from), &sub(p, from))).is_positive());
    let height = dot(&normal, &sub(p, a));
    is_inside.then(|| Fraction(&height * &height, dot(&normal, &normal)))
}

/// Squared distance between the insides of two edges, where the feet lie there.
fn lines(a: [&Vector<BigInt>; 2], b: [&Vector<BigInt>; 2]) -> Option<Fraction> {
    let (u, v, w) = (sub(a[1], a[0]), sub(b[1], b[0]), sub(b[0], a[0]));
    let normal = cross(&u, &v);
    let square = dot(&normal, &normal);
    let (s, t) = (dot(&cross(&w, &v), &normal), dot(&cross(&w, &u), &normal));
    let is_inside = [s, t].iter().all(|value| value.is_positive() && value < &square);
    let height = dot(&normal, &w);
    is_inside.then(|| Fraction(&height * &height, square))
}

/// The point is the first of `points`, the triangle the rest.
fn point_triangle_twin(points: &[Vector<BigInt>]) -> Fraction {
    let (p, triangle) = (&points[0], &points[1..]);
    let vertices = triangle.iter().map(|vertex| point_point(p, vertex));
    let edges = (0..3).filter_map(|i| point_edge(p, &triangle[i], &triangle[(i + 1) % 3]));
    vertices.chain(edges).chain(point_face(p, triangle)).reduce(Fraction::min).expect("7 cases")
}

fn edge_edge_twin(points: &[Vector<BigInt>]) -> Fraction {
    let [a0, a1, b0, b1] = points else { unreachable!("four ends") };
    let ends = [(a0, b0), (a0, b1), (a1, b0), (a1, b1)];
    let ends = ends.iter().map(|(a, b)| point_point(a, b));
    let feet = [(a0, b0, b1), (a1, b0, b1), (b0, a0, a1), (b1, a0, a1)];
    let feet = feet.iter().filter_map(|(p, a, b)| point_edge(p, a, b));
    ends.chain(feet).chain(lines([a0, a1], [b0, b1])).reduce(Fraction::min).expect("9 cases")
}

/// The largest difference of coordinates.
fn size(points: &[Point]) -> f64 {
    let axes = (0..3).map(|axis| {
        let values = || points.iter().map(|point| point[axis]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    });
    axes.fold(0.0, f64::max)
}

/// The length of the weighted sum of differences to `origin`, at a scale where it has a square.
fn weighted_length(origin: Point, terms: &[(Point, f64)], size: f64) -> f64 {
    let unit = if size > 0.0 { size } else { 1.0 };
    let sum = |axis: usize| -> f64 {
        terms.iter().map(|(point, weight)| weight * ((point[axis] - origin[axis]) / unit)).sum()
    };
    [0, 1, 2].map(sum).iter().map(|value| value * value).sum::<f64>().sqrt() * unit
}

/// Compares both with `expected`, unless the square of the distance is no normal number.
fn check_distance(
    squared: f64,
    rebuilt: f64,
    expected: f64,
    size: f64,
) -> Result<(), TestCaseError> {
    // Subnormal distances are multiples of the smallest number, whatever the size.
    let allowed = TOLERANCE * size + 4.0 * f64::from_bits(1);
    prop_assert!((rebuilt - expected).abs() <= allowed, "rebuilt {rebuilt:e}, {expected:e}");
    if (1e-140..1e140).contains(&size) {
        let found = squared.sqrt();
        prop_assert!((found - expected).abs() <= allowed, "found {found:e}, expected {expected:e}");
    }
    Ok(())
}

fn check_point_triangle(points: [Point; 4]) -> Result<(), TestCaseError> {
    let [point, a, b, c] = points;
    let found = point_triangle(point, &[a, b, c]);
    let weights = found.weights;
    prop_assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)), "{found:?}");
    prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() <= 4.0 * f64::EPSILON, "{found:?}");
    let is_on = |i: usize| match found.feature {
        TriangleFeature::Face => true,
        TriangleFeature::Edge(edge) => i != (usize::from(edge) + 2) % 3,
        TriangleFeature::Vertex(vertex) => i == usize::from(vertex),
    };
    prop_assert!((0..3).all(|i| is_on(i) || weights[i] == 0.0), "{found:?}");
    let (integers, exponent) = integer_points(&points);
    let expected = point_triangle_twin(&integers).root(exponent);
    let terms = [(a, weights[0]), (b, weights[1]), (c, weights[2])];
    let size = size(&points);
    check_distance(found.distance_squared, weighted_length(point, &terms, size), expected, size)
}

fn check_edge_edge(points: [Point; 4]) -> Result<(), TestCaseError> {
    let [a0, a1, b0, b1] = points;
    let found = edge_edge(&[a0, a1], &[b0, b1]);
    let (s, t) = (found.s, found.t);
    prop_assert!((0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t), "{found:?}");
    let (integers, exponent) = integer_points(&points);
    let expected = edge_edge_twin(&integers).root(exponent);
    let terms = [(a0, 1.0 - s), (a1, s), (b0, t - 1.0), (b1, -t)];
    let size = size(&points);
    check_distance(found.distance_squared, weighted_length(a0, &terms, size), expected, size)
}

fn agree(
    check: fn([Point; 4]) -> Result<(), TestCaseError>,
    strategy: impl Strategy<Value = [Point; 4]>,
    cases: u32,
) {
    for_all(strategy, cases, check);
}

/// Thin triangles and nearly parallel edges: all points within `thickness` of a line.
fn needles() -> impl Strategy<Value = [Point; 4]> {
    (floats::<4>(), 0..17_i32).prop_map(|(points, digits)| {
        let thickness = 10.0_f64.powi(-digits);
        points.map(|[x, y, z]| {
            [x + 0.3 * thickness * y, 0.7 * x + thickness * y, thickness * z - 0.2 * x]
        })
    })
}

/// A triangle with one very short edge, almost along a long one, and a point anywhere.
fn short_edges() -> impl Strategy<Value = [Point; 4]> {
    (floats::<4>(), 0..17_i32, 0..17_i32, 0..3_usize).prop_map(
        |([point, a, b, c], shorter, thinner, first)| {
            let (length, width) = (10.0_f64.powi(-shorter), 10.0_f64.powi(-shorter - thinner));
            let near = [0, 1, 2].map(|k| b[k] + length * (b[k] - a[k]) + width * c[k]);
            let mut triangle = [a, b, near];
            triangle.rotate_left(first);
            [point, triangle[0], triangle[1], triangle[2]]
        },
    )
}

#[test]
fn point_to_triangle() {
    agree(check_point_triangle, grid(), 20_000);
    agree(check_point_triangle, floats(), 20_000);
    agree(check_point_triangle, needles(), 20_000);
    agree(check_point_triangle, short_edges(), 20_000);
}

#[test]
fn point_to_almost_degenerate_triangle() {
    agree(check_point_triangle, perturbed_grid(), 20_000);
}

#[test]
fn point_to_triangle_at_extreme_scales() {
    agree(check_point_triangle, scaled_grid(), 10_000);
}

#[test]
fn edge_to_edge() {
    agree(check_edge_edge, grid(), 20_000);
    agree(check_edge_edge, floats(), 20_000);
    agree(check_edge_edge, needles(), 20_000);
}

#[test]
fn edge_to_almost_parallel_edge() {
    agree(check_edge_edge, perturbed_grid(), 20_000);
}

#[test]
fn edge_to_edge_at_extreme_scales() {
    agree(check_edge_edge, scaled_grid(), 10_000);
}
