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
/// Ericson 2005, "Real-time collision detection", 5.1.9, but the free parameter comes from the part
/// of `v` orthogonal to `u` (Gram-Schmidt) instead of the determinant `uu vv - uv²`, which is
/// rounding noise for nearly parallel edges.
#[inline]
fn closest(u: Point, v: Point, w: Point, uu: f64, vv: f64) -> EdgeEdge {
    let mut t = 0.0;
    if uu > 0.0 {
        let across = vec3::add_scaled(v, u, -(vec3::dot(u, v) / uu));
        let across_squared = vec3::norm_squared(across);
        if across_squared > 0.0 {
            t = (vec3::dot(w, across) / across_squared).clamp(0.0, 1.0);
        }
    }
    let s_free = if uu > 0.0 {
        vec3::dot(vec3::add_scaled(vec3::scale(w, -1.0), v, t), u) / uu
    } else {
        0.0
    };
    let s = s_free.clamp(0.0, 1.0);
    if s != s_free || uu <= 0.0 {
        t = closest_parameter(vec3::add_scaled(w, u, s), v, vv);
    }
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
