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
    // exchanges above and below for the other.
    let (a_order, b_order) = (lone_corner_first(a_sides), lone_corner_first(b_sides));
    let [p_a, q_a, r_a] = rename(a, a_order, b_order.is_below);
    let [p_b, q_b, r_b] = rename(b, b_order, a_order.is_below);
    orient3d(*p_a, *q_a, *p_b, *q_b) <= 0 && orient3d(*p_a, *r_a, *p_b, *r_b) >= 0
}

fn is_apart(sides: [i8; 3]) -> bool {
    sides[0] != 0 && sides[0] == sides[1] && sides[1] == sides[2]
}

/// Which corner lies by itself.
#[derive(Clone, Copy)]
struct Order {
    lone: u8,
    /// True where the other two are above it, false where they are below.
    is_below: bool,
}

/// The first corner whose side differs from both others in the same direction. Of three signs that
/// are not all equal there is one.
///
/// PERF: a table, since the branches would be as good as random.
#[inline]
fn lone_corner_first([i, j, k]: [i8; 3]) -> Order {
    const ORDERS: [Order; 27] = orders();
    ORDERS[(9 * i + 3 * j + k + 13) as usize]
}

const fn orders() -> [Order; 27] {
    let mut result = [Order { lone: 0, is_below: false }; 27];
    let mut index = 0;
    while index < 27 {
        let sides = [index / 9, index / 3 % 3, index % 3];
        let mut lone = 3;
        while lone > 0 {
            lone -= 1;
            let (side, next, last) = (sides[lone], sides[(lone + 1) % 3], sides[(lone + 2) % 3]);
            if (side > next && side > last) || (side < next && side < last) {
                result[index] = Order { lone: lone as u8, is_below: side < next };
            }
        }
        index += 1;
    }
    result
}

/// The corners from the lone one on; in reverse where the other triangle is to see this one turned.
#[inline]
fn rename(corners: &[Point; 3], order: Order, turned: bool) -> [&Point; 3] {
    let at = |step: u8| &corners[usize::from((order.lone + step) % 3)];
    [at(0), at(1 + u8::from(turned)), at(2 - u8::from(turned))]
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
