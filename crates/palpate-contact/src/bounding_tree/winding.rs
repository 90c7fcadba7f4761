//! Inside or outside, exactly: how often the surface winds around a point.

use palpate_geometry::{Point, predicates, triangles_intersect};

use super::{BoundingTree, corner_points};

/// Where a point is with respect to a closed surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Inside,
    Outside,
    /// Exactly on a triangle.
    OnSurface,
}

impl BoundingTree {
    /// The side of the closed surface that `point` is on: inside where the winding number is not zero.
    ///
    /// Counts signed crossings of the ray along +x with exact predicates. Where the ray meets an edge
    /// or a node, the point is moved by an infinitesimal (first in z, then in y), so that each crossing
    /// counts once. Right for every closed surface, also one that a deformation made overlap itself.
    pub(crate) fn side(&self, positions: &[Point], point: &Point) -> Side {
        let mut winding = 0;
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let bounds = &node.bounds;
            let met = bounds.max[0] >= point[0]
                && (1..3).all(|a| bounds.min[a] <= point[a] && point[a] <= bounds.max[a]);
            if !met {
                index = node.skip as usize;
                continue;
            }
            index += 1;
            if node.skip as usize != index {
                continue;
            }
            for position in node.triangles[0]..node.triangles[1] {
                let triangle = corner_points(positions, self.corners(position));
                let near = self.triangle_bounds(position).contains(point);
                if near && triangles_intersect(&[*point; 3], &triangle) {
                    return Side::OnSurface;
                }
                winding += crossing(&triangle, point);
            }
        }
        if winding == 0 { Side::Outside } else { Side::Inside }
    }
}

/// Crossing of the ray from `point` along +x with a triangle that does not hold the point: +1 where the
/// ray leaves through its front, -1 where it enters, 0 where it misses.
fn crossing(triangle: &[Point; 3], point: &Point) -> i32 {
    let above = triangle.map(|corner| corner[2] > point[2]);
    // Turning number of the projected triangle around the point: each edge that passes the line
    // z = point z at larger y counts, upwards positive.
    let mut turns = 0;
    for side in 0..3 {
        let (from, to) = (side, (side + 1) % 3);
        if above[from] == above[to] {
            continue;
        }
        // The same two nodes in the same order, whichever triangle the edge is seen from.
        let (lower, upper, sign) = if above[to] { (from, to, 1) } else { (to, from, -1) };
        if passes_at_larger_y(&triangle[lower], &triangle[upper], point) {
            turns += sign;
        }
    }
    if turns == 0 {
        return 0;
    }
    let [a, b, c] = *triangle;
    // Seen along +x the triangle comes after the point when the point is behind a front that faces +x,
    // or before a front that faces -x.
    let behind = predicates::orient3d(a, b, c, *point) < 0;
    if behind == (turns > 0) { turns } else { 0 }
}

/// Whether the edge from `lower` to `upper` (by z) passes the point's height at a larger y.
fn passes_at_larger_y(lower: &Point, upper: &Point, point: &Point) -> bool {
    let [lower, upper, point] = [lower, upper, point].map(|corner| [corner[1], corner[2]]);
    predicates::orient2d(lower, upper, point) > 0
}
