//! Vector algebra on `[f64; 3]`.

use crate::Point;

/// `a + b`.
#[inline]
pub fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
#[inline]
pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `factor * a`.
#[inline]
pub fn scale(a: Point, factor: f64) -> Point {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// `a + factor * b`.
#[inline]
pub fn add_scaled(a: Point, b: Point, factor: f64) -> Point {
    [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]]
}

/// `(1 - t) * a + t * b`; exactly `a` at 0 and `b` at 1.
#[inline]
pub fn lerp(a: Point, b: Point, t: f64) -> Point {
    add(scale(a, 1.0 - t), scale(b, t))
}

/// Inner product.
#[inline]
pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product.
#[inline]
pub fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Squared length.
#[inline]
pub fn norm_squared(a: Point) -> f64 {
    dot(a, a)
}

/// Length. Known limits: the square must not overflow or underflow.
#[inline]
pub fn norm(a: Point) -> f64 {
    norm_squared(a).sqrt()
}

/// Squared distance between two points.
#[inline]
pub fn distance_squared(a: Point, b: Point) -> f64 {
    norm_squared(sub(a, b))
}

/// The unit vector along `a`; `None` where the length is zero, not finite, or its square underflows.
#[inline]
pub fn normalized(a: Point) -> Option<Point> {
    let squared = norm_squared(a);
    squared.is_normal().then(|| scale(a, 1.0 / squared.sqrt()))
}

/// The largest absolute coordinate.
#[inline]
pub fn max_abs(a: Point) -> f64 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_is_right_handed_and_orthogonal() {
        assert_eq!(cross([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
        let (a, b) = ([1.0, 2.0, 3.0], [-4.0, 0.5, 2.0]);
        assert_eq!(dot(cross(a, b), a), 0.0);
        assert_eq!(dot(cross(a, b), b), 0.0);
    }

    #[test]
    fn a_vector_without_direction_has_no_unit_vector() {
        assert_eq!(normalized([0.0; 3]), None);
        assert_eq!(normalized([1e-200, 0.0, 0.0]), None);
        assert_eq!(normalized([f64::NAN, 0.0, 0.0]), None);
        assert_eq!(normalized([0.0, -3.0, 4.0]), Some([0.0, -3.0 * 0.2, 4.0 * 0.2]));
    }

    #[test]
    fn lerp_is_exact_at_its_ends() {
        let (a, b) = ([0.1, 1e10, -3.0], [0.7, -1e-10, 1e5]);
        assert_eq!(lerp(a, b, 0.0), a);
        assert_eq!(lerp(a, b, 1.0), b);
    }
}
