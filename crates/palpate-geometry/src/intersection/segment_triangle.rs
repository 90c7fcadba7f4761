//! Does a segment meet a triangle?

use super::planar;
use crate::{
    Point,
    predicates::{Plane, orient3d},
};

/// Exactly whether a closed segment and a closed triangle share a point.
///
/// Either may be degenerate: the segment a point, the triangle a segment or a point.
/// Coordinates are finite.
pub fn segment_triangle_intersect(segment: &[Point; 2], triangle: &[Point; 3]) -> bool {
    let plane = Plane::new(triangle);
    let sides = segment.map(|point| plane.side(point));
    if sides[0] * sides[1] > 0 {
        return false;
    }
    if sides != [0, 0] {
        return line_meets(segment, triangle);
    }
    in_plane(segment, triangle)
}

/// Whether the line through `segment`, which crosses the plane in one point, does so in the triangle.
fn line_meets(segment: &[Point; 2], triangle: &[Point; 3]) -> bool {
    let [from, to] = *segment;
    let turn = |i: usize| orient3d(from, to, triangle[i], triangle[(i + 1) % 3]);
    let first = turn(0);
    let second = turn(1);
    if first * second < 0 {
        return false;
    }
    let third = turn(2);
    first * third >= 0 && second * third >= 0
}

/// The case without a transversal plane: all lies in one plane, or the triangle has no area.
pub(super) fn in_plane(segment: &[Point; 2], triangle: &[Point; 3]) -> bool {
    match planar::projection_axis(triangle) {
        Some(axis) => planar::segment_triangle_intersect(
            &planar::project(segment, axis),
            &planar::project(triangle, axis),
        ),
        None => segments_intersect(segment, &planar::span(triangle)),
    }
}

/// Whether two closed segments of space meet; either may be a point.
fn segments_intersect(a: &[Point; 2], b: &[Point; 2]) -> bool {
    if orient3d(a[0], a[1], b[0], b[1]) != 0 {
        return false;
    }
    // Any three of the four points that are not collinear show the common plane.
    let triples = [[a[0], a[1], b[0]], [a[0], a[1], b[1]], [b[0], b[1], a[0]], [b[0], b[1], a[1]]];
    match triples.iter().find_map(planar::projection_axis) {
        Some(axis) => {
            planar::segments_intersect(&planar::project(a, axis), &planar::project(b, axis))
        }
        None => planar::collinear_segments_intersect(a, b),
    }
}
