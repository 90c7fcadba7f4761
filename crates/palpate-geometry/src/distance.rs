//! Distances between features of triangles, with the closest points.
//!
//! Both are backward stable: the distance is that of the returned closest points, and within a few
//! ulps of the size of the input (the largest difference of two of its points) of the true one, for
//! slivers, nearly parallel edges and degenerate features too. Squares over- and underflow for
//! lengths beyond about 1e±154, and then `distance_squared` is infinite or zero; the weights stay
//! good.

mod edge_edge;
mod point_triangle;

pub use edge_edge::{EdgeEdge, edge_edge};
pub use point_triangle::{PointTriangle, TriangleFeature, point_triangle};

use crate::{Point, vec3};

/// Squares of lengths that the plain formulas take without loss: their own squares neither
/// overflow nor underflow.
const MIN_SQUARE: f64 = 1e-140;
const MAX_SQUARE: f64 = 1e140;

/// Parameter in [0, 1] of the point closest to `offset` on the segment from 0 to `edge`.
#[inline]
fn closest_parameter(offset: Point, edge: Point, edge_squared: f64) -> f64 {
    if edge_squared >= f64::MIN_POSITIVE {
        (vec3::dot(offset, edge) / edge_squared).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// The points relative to the first, times a power of two that brings the largest coordinate near
/// one, and the exponent of that power. Exact but for what is 1e-290 times smaller than the largest.
fn to_unit_scale<const N: usize>(points: [Point; N]) -> ([Point; N], i32) {
    // A difference of two coordinates may overflow; of their halves it does not.
    let largest = points.iter().map(|&point| vec3::max_abs(point)).fold(0.0, f64::max);
    let halved = largest > 1e300;
    let points = if halved { points.map(|point| vec3::scale(point, 0.5)) } else { points };
    let differences = points.map(|point| vec3::sub(point, points[0]));
    let size = differences.iter().map(|&point| vec3::max_abs(point)).fold(0.0, f64::max);
    let exponent = -exponent_of(size);
    let scaled = differences.map(|difference| {
        // Twice half the way: 2^-1074 cannot reach one by a single power of two.
        vec3::scale(vec3::scale(difference, power_of_two(exponent / 2)), {
            power_of_two(exponent - exponent / 2)
        })
    });
    (scaled, exponent - i32::from(halved))
}

/// The squared length that has `squared` at the scale 2^`exponent`.
fn from_unit_scale(squared: f64, exponent: i32) -> f64 {
    // Four factors, each a normal number, so that only the result itself may over- or underflow.
    let half = exponent / 2;
    let rest = exponent - half;
    squared * power_of_two(-half) * power_of_two(-rest) * power_of_two(-half) * power_of_two(-rest)
}

/// `e` with `2^e <= value < 2^(e+1)`; 0 for zero and for what is not finite.
fn exponent_of(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() {
        return 0;
    }
    if value.is_normal() {
        ((value.to_bits() >> 52) & 0x7ff) as i32 - 1023
    } else {
        63 - value.to_bits().leading_zeros() as i32 - 1074
    }
}

/// 2^`exponent` for a normal result.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}
