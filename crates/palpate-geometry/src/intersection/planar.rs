//! Shapes that lie in one plane: drop an axis along which the plane is seen undistorted, then
//! decide with `orient2d`.

use crate::{Point, predicates::orient2d};

pub(super) type Point2 = [f64; 2];

/// `points` without their coordinate `axis`.
pub(super) fn project<const N: usize>(points: &[Point; N], axis: usize) -> [Point2; N] {
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    points.map(|point| [point[j], point[k]])
}

/// An axis along which the triangle's image keeps an area; `None` where the corners are collinear.
pub(super) fn projection_axis(triangle: &[Point; 3]) -> Option<usize> {
    (0..3).find(|&axis| {
        let [a, b, c] = project(triangle, axis);
        orient2d(a, b, c) != 0
    })
}

/// The ends of the segment that collinear points span: lexicographic order runs along the line.
pub(super) fn span<const D: usize, const N: usize>(points: &[[f64; D]; N]) -> [[f64; D]; 2] {
    let mut ends = [points[0]; 2];
    for &point in &points[1..] {
        if point < ends[0] {
            ends[0] = point;
        }
        if point > ends[1] {
            ends[1] = point;
        }
    }
    ends
}

/// Whether two segments of one line meet.
pub(super) fn collinear_segments_intersect<const D: usize>(
    a: &[[f64; D]; 2],
    b: &[[f64; D]; 2],
) -> bool {
    let ([a_min, a_max], [b_min, b_max]) = (span(a), span(b));
    a_min <= b_max && b_min <= a_max
}

/// Whether two closed segments of the plane meet; either may be a point.
pub(super) fn segments_intersect(a: &[Point2; 2], b: &[Point2; 2]) -> bool {
    let b_sides = [orient2d(a[0], a[1], b[0]), orient2d(a[0], a[1], b[1])];
    if b_sides[0] * b_sides[1] > 0 {
        return false;
    }
    let a_sides = [orient2d(b[0], b[1], a[0]), orient2d(b[0], b[1], a[1])];
    if a_sides[0] * a_sides[1] > 0 {
        return false;
    }
    if a_sides == [0, 0] && b_sides == [0, 0] {
        return collinear_segments_intersect(a, b);
    }
    true
}

/// Whether a closed triangle with an area and a closed segment of its plane meet.
pub(super) fn segment_triangle_intersect(segment: &[Point2; 2], triangle: &[Point2; 3]) -> bool {
    contains(triangle, segment[0])
        || (0..3).any(|i| segments_intersect(segment, &[triangle[i], triangle[(i + 1) % 3]]))
}

/// Whether two closed triangles of one plane meet, both with an area.
///
/// Their Minkowski difference is a polygon whose sides are parallel to theirs, so they are apart
/// exactly where a side of one has the whole other strictly outside.
pub(super) fn triangles_intersect(a: &[Point2; 3], b: &[Point2; 3]) -> bool {
    !has_separating_side(a, b) && !has_separating_side(b, a)
}

fn has_separating_side(triangle: &[Point2; 3], other: &[Point2; 3]) -> bool {
    let [a, b, c] = *triangle;
    let orientation = orient2d(a, b, c);
    [[a, b], [b, c], [c, a]]
        .iter()
        .any(|&[from, to]| other.iter().all(|&point| orient2d(from, to, point) == -orientation))
}

fn contains(triangle: &[Point2; 3], point: Point2) -> bool {
    let sides = [0, 1, 2].map(|i| orient2d(triangle[i], triangle[(i + 1) % 3], point));
    !(sides.contains(&1) && sides.contains(&-1))
}
