//! Do two triangles meet? The narrow phase of contact detection.
//!
//! Guigue and Devillers 2003, "Fast and robust triangle-triangle overlap test using orientation
//! predicates": only signs of `orient3d`, so exact signs make it exact. At most eight of them decide
//! a pair in general position; coplanar and degenerate triangles take a planar path.

use super::{planar, segment_triangle};
use crate::{
    Point,
    predicates::{Plane, orient3d},
};

/// Exactly whether two closed triangles (convex hulls of three points) share a point.
///
/// Touching and coplanar overlap count. A degenerate triangle is the segment or point that its
/// corners span. The order of the triangles and of their corners does not matter. Coordinates are
/// finite, of any magnitude.
pub fn triangles_intersect(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let b_plane = Plane::new(b);
    let a_sides = a.map(|point| b_plane.side(point));
    if is_apart(a_sides) {
        return false;
    }
    let a_plane = Plane::new(a);
    let b_sides = b.map(|point| a_plane.side(point));
    if is_apart(b_sides) {
        return false;
    }
    if a_sides == [0; 3] || b_sides == [0; 3] {
        return in_plane(a, b);
    }
    // Both have an area and their planes cross in a line. Each triangle cuts an interval from it.
    // Corners are renamed so that p is above the other's plane, q and r below (one of the sides
    // strictly); p then sees its interval between the edges pq and pr. Turning a triangle over
    // exchanges above and below for the other, which is what the second exchange is for.
    let (mut a_corners, a_turned) = lone_corner_first(a, a_sides);
    let (mut b_corners, b_turned) = lone_corner_first(b, b_sides);
    if a_turned {
        b_corners.swap(1, 2);
    }
    if b_turned {
        a_corners.swap(1, 2);
    }
    let ([p_a, q_a, r_a], [p_b, q_b, r_b]) = (a_corners, b_corners);
    orient3d(p_a, q_a, p_b, q_b) <= 0 && orient3d(p_a, r_a, p_b, r_b) >= 0
}

fn is_apart(sides: [i8; 3]) -> bool {
    sides[0] != 0 && sides[0] == sides[1] && sides[1] == sides[2]
}

/// Rotates the corners so that the first has the other two strictly on one side of its own value;
/// true where they are above it. Not all `sides` are equal.
fn lone_corner_first(corners: &[Point; 3], sides: [i8; 3]) -> ([Point; 3], bool) {
    for first in 0..3 {
        let (second, third) = ((first + 1) % 3, (first + 2) % 3);
        let highest = sides[second].max(sides[third]);
        let lowest = sides[second].min(sides[third]);
        if sides[first] > highest || sides[first] < lowest {
            let rotated = [corners[first], corners[second], corners[third]];
            return (rotated, sides[first] < lowest);
        }
    }
    unreachable!("three signs that are not all equal have one that differs from both others")
}

/// Triangles in one plane, or with a corner order that spans no area.
#[cold]
#[inline(never)]
fn in_plane(a: &[Point; 3], b: &[Point; 3]) -> bool {
    match (planar::projection_axis(a), planar::projection_axis(b)) {
        (Some(axis), Some(_)) => {
            planar::triangles_intersect(&planar::project(a, axis), &planar::project(b, axis))
        }
        (None, _) => segment_triangle::segment_triangle_intersect(&planar::span(a), b),
        (_, None) => segment_triangle::segment_triangle_intersect(&planar::span(b), a),
    }
}
