//! Do two triangles that share corners meet elsewhere too? A surface that folds over itself shows it
//! first between neighbours, whose common node or edge alone says nothing.

use super::{planar, segment_triangle_intersect};
use crate::{
    Point,
    predicates::{Plane, certain_side, orient2d},
    vec3,
};

/// Exactly whether two closed triangles with the same first corner share any other point.
///
/// Either may be degenerate. The order of the other two corners does not matter. Coordinates are
/// finite.
pub fn triangles_intersect_beyond_node(a: &[Point; 3], b: &[Point; 3]) -> bool {
    if cones_are_apart(a, b) {
        return false;
    }
    // A ray from the common corner through another common point leaves one of the triangles first,
    // through its far side, and is there still inside the other.
    far_side_meets(a, b) || far_side_meets(b, a)
}

/// Exactly whether two closed triangles, (`edge`, `a`) and (`edge`, `b`), share a point beyond that
/// edge: whether one is folded flat over the other.
///
/// Either may be degenerate, and the edge a point. Coordinates are finite.
pub fn triangles_intersect_beyond_edge(edge: &[Point; 2], a: Point, b: Point) -> bool {
    let [v, w] = *edge;
    // Most are on different sides of the edge.
    let (triangle_a, triangle_b) = ([v, w, a], [v, w, b]);
    let plane = Plane::new(&triangle_a);
    if plane.is_certainly_opposed(&Plane::new(&triangle_b)) || plane.side(b) != 0 {
        return false;
    }
    match (planar::projection_axis(&[v, w, a]), planar::projection_axis(&[v, w, b])) {
        (Some(axis), Some(_)) => {
            let [v, w, a, b] = planar::project(&[v, w, a, b], axis);
            orient2d(v, w, a) == orient2d(v, w, b)
        }
        (None, None) => segments_intersect_beyond(edge, a, b),
        // The one with an area has no more of the other's line than the edge.
        _ => false,
    }
}

/// Whether a plane through the common first corner shows that nothing else is common; most neighbours
/// pass.
#[inline]
fn cones_are_apart(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let v = a[0];
    // About from the one to the other: any axis is right, if they lie on different sides of it.
    let axis = vec3::sub(vec3::add(b[1], b[2]), vec3::add(a[1], a[2]));
    let is_on = |side: i8, point: Point| certain_side(axis, v, point) == Some(side);
    if is_on(-1, a[1]) & is_on(-1, a[2]) & is_on(1, b[1]) & is_on(1, b[2]) {
        return true;
    }
    // Or a triangle has no more than the corner in the other's plane.
    let only_corner = |triangle: &[Point; 3], [_, second, third]: &[Point; 3]| {
        let plane = Plane::new(triangle);
        let side = plane.side(*second);
        side != 0 && side == plane.side(*third)
    };
    only_corner(a, b) || only_corner(b, a)
}

/// Whether the side of `triangle` opposite its first corner meets `other`, which has the same one.
fn far_side_meets(triangle: &[Point; 3], other: &[Point; 3]) -> bool {
    let [first, second, third] = *triangle;
    if planar::projection_axis(triangle).is_some() {
        return segment_triangle_intersect(&[second, third], other);
    }
    // Two segments from the first corner, which may lie between the others or be one of them.
    let end_meets = |end: Point| end != first && segment_triangle_intersect(&[end; 2], other);
    end_meets(second) || end_meets(third)
}

/// Triangles without an area: whether their segments share more than the edge, which may be a point.
fn segments_intersect_beyond(edge: &[Point; 2], a: Point, b: Point) -> bool {
    let [v, w] = *edge;
    if v == w && planar::projection_axis(&[v, a, b]).is_some() {
        return false;
    }
    // All on one line, along which lexicographic order runs.
    let ([a_min, a_max], [b_min, b_max]) = (planar::span(&[v, w, a]), planar::span(&[v, w, b]));
    let first = if a_min < b_min { b_min } else { a_min };
    let last = if a_max < b_max { a_max } else { b_max };
    [first, last] != planar::span(edge)
}
