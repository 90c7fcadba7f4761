//! How far is an edge from an edge?

use super::{MAX_SQUARE, MIN_SQUARE, closest_parameter, from_unit_scale, to_unit_scale};
use crate::{Point, vec3};

/// The closest points of two edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeEdge {
    /// Squared distance [m²].
    pub distance_squared: f64,
    /// The point of the first edge is `a0 + s (a1 - a0)`; exactly 0 or 1 at its ends.
    pub s: f64,
    /// The point of the second edge is `b0 + t (b1 - b0)`; exactly 0 or 1 at its ends.
    pub t: f64,
}

/// The closest points of the closed segments `a` and `b`, which may be parallel or points.
///
/// Of equally close pairs (parallel edges) one is returned, always the same. A point edge has
/// parameter 0.
pub fn edge_edge(a: &[Point; 2], b: &[Point; 2]) -> EdgeEdge {
    let (u, v, w) = (vec3::sub(a[1], a[0]), vec3::sub(b[1], b[0]), vec3::sub(a[0], b[0]));
    let [uu, vv, ww] = [u, v, w].map(vec3::norm_squared);
    let range = MIN_SQUARE..=MAX_SQUARE;
    if range.contains(&uu) && range.contains(&vv) && ww <= MAX_SQUARE {
        closest(u, v, w, uu, vv)
    } else {
        rescaled(a, b)
    }
}

/// The closest points of `w + s u` and `t v`.
///
/// Clamping as in Ericson 2005, "Real-time collision detection", 5.1.9, but the free parameter is a
/// least-squares solution by modified Gram-Schmidt instead of a quotient with the determinant
/// `u² v² - (u v)²`, which is rounding noise for nearly parallel edges.
#[inline]
fn closest(u: Point, v: Point, w: Point, uu: f64, vv: f64) -> EdgeEdge {
    // Subnormal squares, beside a size of one, have no useful inverse: the edge is a point.
    if uu < f64::MIN_POSITIVE {
        let t = closest_parameter(w, v, vv);
        return with_gap(u, v, w, 0.0, t);
    }
    let inverse = 1.0 / uu;
    let (v_along, w_along) = (vec3::dot(v, u) * inverse, vec3::dot(w, u) * inverse);
    let v_across = vec3::add_scaled(v, u, -v_along);
    let w_across = vec3::add_scaled(w, u, -w_along);
    let across_squared = vec3::norm_squared(v_across);
    let mut t = 0.0;
    if across_squared >= f64::MIN_POSITIVE {
        t = (vec3::dot(w_across, v_across) / across_squared).clamp(0.0, 1.0);
    }
    let free = t * v_along - w_along;
    let s = free.clamp(0.0, 1.0);
    if s != free {
        t = closest_parameter(vec3::add_scaled(w, u, s), v, vv);
    }
    with_gap(u, v, w, s, t)
}

#[inline]
fn with_gap(u: Point, v: Point, w: Point, s: f64, t: f64) -> EdgeEdge {
    let gap = vec3::add_scaled(vec3::add_scaled(w, u, s), v, -t);
    EdgeEdge { distance_squared: vec3::norm_squared(gap), s, t }
}

/// Degenerate edges and extreme scales.
#[cold]
#[inline(never)]
fn rescaled(a: &[Point; 2], b: &[Point; 2]) -> EdgeEdge {
    let ([b0, b1, a0, a1], exponent) = to_unit_scale([b[0], b[1], a[0], a[1]]);
    let (u, v) = (vec3::sub(a1, a0), vec3::sub(b1, b0));
    let found = closest(u, v, vec3::sub(a0, b0), vec3::norm_squared(u), vec3::norm_squared(v));
    EdgeEdge { distance_squared: from_unit_scale(found.distance_squared, exponent), ..found }
}
