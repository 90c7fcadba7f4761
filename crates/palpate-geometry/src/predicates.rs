//! On which side? Exact signs for every finite `f64`.
//!
//! Each predicate runs up to three stages and returns at the first that is certain:
//!
//! 1. the plain determinant against a bound of its rounding error, widened for underflow; where
//!    something overflows the bound is infinite and decides nothing, so it is valid for any input;
//! 2. `robust` (Shewchuk 1997, "Adaptive precision floating-point arithmetic"), where every
//!    coordinate is zero or of magnitude in [2⁻²⁵⁰, 2²⁵⁰]: a coordinate is then a multiple of
//!    2⁻³⁰², a product of three of 2⁻⁹⁰⁶, and nothing under- or overflows;
//! 3. integers of any length, for the rest.

mod exact;

use robust::{Coord, Coord3D};

use crate::{Point, vec3};

/// Bounds the relative rounding error of a filter: Shewchuk proves 7u + 56u² (3-D) and 3u + 16u²
/// (2-D) with u = ε/2; ours may sum in another order, so both are rounded up to 10u.
const FILTER: f64 = 5.0 * f64::EPSILON;

/// What underflow adds to the scale of errors. It takes at most 2⁻¹⁰⁷⁴ from a component of a normal,
/// which is far below `FILTER * UNDERFLOW`.
const UNDERFLOW: f64 = f64::MIN_POSITIVE / FILTER;

/// 2²⁵⁰ and its inverse: the magnitudes where expansions neither overflow nor underflow.
const EXPANSION_MAX: f64 = f64::from_bits((1023 + 250) << 52);
const EXPANSION_MIN: f64 = f64::from_bits((1023 - 250) << 52);

/// The sign of the volume of the tetrahedron (`a`, `b`, `c`, `d`), that is of
/// `(b - a) × (c - a) · (d - a)`: +1, 0 (exactly coplanar) or -1.
#[inline]
pub fn orient3d(a: Point, b: Point, c: Point, d: Point) -> i8 {
    Plane::new(&[a, b, c]).side(d)
}

/// [`orient3d`] of a triangle with each of several points, computing what they have in common once.
#[inline]
pub fn orient3d_each<const N: usize>(triangle: &[Point; 3], points: &[Point; N]) -> [i8; N] {
    let plane = Plane::new(triangle);
    let mut sides = [0; N];
    // PERF: `map` on arrays is not unrolled.
    for (side, &point) in sides.iter_mut().zip(points) {
        *side = plane.side(point);
    }
    sides
}

/// The sign of the area of the triangle (`a`, `b`, `c`): +1 counter-clockwise, 0 exactly
/// collinear, -1 clockwise.
#[inline]
pub fn orient2d(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> i8 {
    let [ux, uy] = [b[0] - a[0], b[1] - a[1]];
    let [vx, vy] = [c[0] - a[0], c[1] - a[1]];
    let (left, right) = (ux * vy, uy * vx);
    let bound = FILTER * (left.abs() + right.abs()) + f64::MIN_POSITIVE;
    let area = left - right;
    // PERF: no branch on the sign, which is as good as random for overlapping triangles.
    if area.abs() > bound { sign(area) } else { orient2d_exact(a, b, c) }
}

/// The plane through a triangle: what the sides of several points have in common.
pub(crate) struct Plane<'a> {
    triangle: &'a [Point; 3],
    normal: Point,
    /// The normal with each product taken positive: the scale of its error.
    magnitude: Point,
}

impl<'a> Plane<'a> {
    #[inline]
    pub(crate) fn new(triangle: &'a [Point; 3]) -> Self {
        let u = vec3::sub(triangle[1], triangle[0]);
        let v = vec3::sub(triangle[2], triangle[0]);
        let mut normal = [0.0; 3];
        let mut magnitude = [0.0; 3];
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let (left, right) = (u[j] * v[k], u[k] * v[j]);
            normal[axis] = left - right;
            magnitude[axis] = left.abs() + right.abs() + UNDERFLOW;
        }
        Self { triangle, normal, magnitude }
    }

    /// Whether the normals of two planes are more than a right angle apart, where that is certain.
    #[inline]
    pub(crate) fn is_certainly_opposed(&self, other: &Plane) -> bool {
        // Each normal is off by 4u of its magnitude, and their product adds 3u: 11u, here 20u.
        let bound = 2.0 * FILTER * vec3::dot(self.magnitude, other.magnitude) + f64::MIN_POSITIVE;
        certain_sign(vec3::dot(self.normal, other.normal), bound) == Some(-1)
    }

    /// `orient3d` of the triangle and `point`.
    #[inline]
    pub(crate) fn side(&self, point: Point) -> i8 {
        let offset = vec3::sub(point, self.triangle[0]);
        let distance = offset.map(f64::abs);
        let determinant = vec3::dot(self.normal, offset);
        let bound = FILTER * vec3::dot(self.magnitude, distance) + f64::MIN_POSITIVE;
        certain_sign(determinant, bound).unwrap_or_else(|| {
            let &[a, b, c] = self.triangle;
            orient3d_exact(a, b, c, point)
        })
    }
}

/// The sign of `axis · (point - origin)` where rounding cannot change it.
#[inline]
pub(crate) fn certain_side(axis: Point, origin: Point, point: Point) -> Option<i8> {
    let offset = vec3::sub(point, origin);
    let terms = [axis[0] * offset[0], axis[1] * offset[1], axis[2] * offset[2]];
    // A difference, a product and two sums: 4u.
    let bound = FILTER * (terms[0].abs() + terms[1].abs() + terms[2].abs()) + f64::MIN_POSITIVE;
    certain_sign(terms[0] + terms[1] + terms[2], bound)
}

/// The sign of `value`, where an error of `bound` cannot change it.
#[inline]
fn certain_sign(value: f64, bound: f64) -> Option<i8> {
    if value > bound {
        Some(1)
    } else if -value > bound {
        Some(-1)
    } else {
        None
    }
}

#[cold]
#[inline(never)]
fn orient3d_exact(a: Point, b: Point, c: Point, d: Point) -> i8 {
    // The two frequent ways to be exactly coplanar: a common corner, an axis-aligned plane.
    let flat = |axis: usize| a[axis] == b[axis] && a[axis] == c[axis] && a[axis] == d[axis];
    if d == a || d == b || d == c || flat(0) || flat(1) || flat(2) {
        return 0;
    }
    if [a, b, c, d].as_flattened().iter().all(|&value| fits_expansion(value)) {
        let [a, b, c, d] = [a, b, c, d].map(|[x, y, z]| Coord3D { x, y, z });
        // `robust` is positive where `d` lies below the counter-clockwise plane.
        return -sign(robust::orient3d(a, b, c, d));
    }
    exact::orient3d([a, b, c, d])
}

#[cold]
#[inline(never)]
fn orient2d_exact(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> i8 {
    let flat = |axis: usize| a[axis] == b[axis] && a[axis] == c[axis];
    if a == b || b == c || c == a || flat(0) || flat(1) {
        return 0;
    }
    if [a, b, c].as_flattened().iter().all(|&value| fits_expansion(value)) {
        let [a, b, c] = [a, b, c].map(|[x, y]| Coord { x, y });
        return sign(robust::orient2d(a, b, c));
    }
    exact::orient2d([a, b, c])
}

fn fits_expansion(value: f64) -> bool {
    value == 0.0 || (EXPANSION_MIN..=EXPANSION_MAX).contains(&value.abs())
}

fn sign(value: f64) -> i8 {
    i8::from(value > 0.0) - i8::from(value < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Point; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn the_positive_tetrahedron_is_positive_at_every_scale() {
        for exponent in [-1074, -1000, -500, -251, -250, -1, 0, 1, 250, 251, 500, 1000, 1023] {
            let factor = 2.0_f64.powi(exponent.max(-1022)) * 2.0_f64.powi((exponent + 1022).min(0));
            let [a, b, c, d] = CORNERS.map(|corner| vec3::scale(corner, factor));
            assert_eq!(orient3d(a, b, c, d), 1, "2^{exponent}");
            assert_eq!(orient3d(b, a, c, d), -1, "2^{exponent}");
            assert_eq!(orient3d_each(&[b, a, c], &[a, d]), [0, -1], "2^{exponent}");
            assert_eq!(orient2d([0.0, 0.0], [factor, 0.0], [0.0, factor]), 1, "2^{exponent}");
        }
    }

    #[test]
    fn coordinates_that_no_single_exponent_holds() {
        let (huge, tiny) = (f64::MAX, f64::from_bits(1));
        let [a, b, c] = [[-huge, -huge, 0.0], [huge, -huge, 0.0], [0.0, huge, 0.0]];
        assert_eq!(orient3d(a, b, c, [0.0, 0.0, tiny]), 1);
        assert_eq!(orient3d(a, b, c, [0.0, 0.0, -tiny]), -1);
        assert_eq!(orient3d(a, b, c, [1.0, tiny, 0.0]), 0);
        assert_eq!(orient2d([-huge, -huge], [huge, huge], [tiny, 0.0]), -1);
        assert_eq!(orient2d([-huge, -huge], [huge, huge], [1.0, 1.0]), 0);
    }

    #[test]
    fn what_is_not_finite_does_not_panic() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let [a, b, c, mut d] = CORNERS;
            d[1] = value;
            let _unspecified = orient3d(a, b, c, d);
            let _unspecified = orient2d([0.0, 1.0], [value, 0.0], [0.5, 0.5]);
        }
    }
}
