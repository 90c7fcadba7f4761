//! Inside or outside, exactly: how often the surface winds around a point.

use palpate_geometry::tetrahedron::orientation;
use palpate_geometry::{Aabb, Point, predicates, triangles_intersect};

use crate::frame::SceneBody;
use crate::nearest::{HalfLine, Surfaces};

/// Where a point is with respect to a closed surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Inside,
    Outside,
    /// Exactly on a triangle.
    OnSurface,
}

/// Below all keys: ends a search.
const NOTHING: f64 = -1.0;

impl Surfaces<'_> {
    /// Whether `point` is strictly inside a body; never for an open surface.
    pub(crate) fn is_inside(&self, body: u32, point: &Point) -> bool {
        self.bodies[body as usize].surface.closed && self.side(body, point) == Side::Inside
    }

    /// The side of the closed surface that `point` is on: inside where the winding number is not zero.
    ///
    /// Counts signed crossings of the ray along +x with exact predicates. Where the ray meets an edge
    /// or a node, the point is moved by an infinitesimal (first in z, then in y), so that each crossing
    /// counts once. Right for every closed surface, also one that a deformation made overlap itself.
    pub(crate) fn side(&self, body: u32, point: &Point) -> Side {
        match self.winding(body, point, |_| true) {
            None => Side::OnSurface,
            Some(0) => Side::Outside,
            Some(_) => Side::Inside,
        }
    }

    /// Whether the tetrahedra that do not have a surface node cover the place where it is: whether the
    /// body, folded, is inside itself there. Not where the node is exactly on another triangle.
    ///
    /// Counts them with their orientation: what the surface winds around the node, less what the
    /// tetrahedra around the node themselves contribute. Both are rays along +x, moved alike. `None` when
    /// one of those around the node is flat or turned over: the node has then been pushed through its
    /// neighbours, which says nothing of the rest of the body.
    pub(crate) fn is_covered(&self, body: u32, node: u32) -> Option<bool> {
        let SceneBody { mesh, positions, surface, .. } = &self.bodies[body as usize];
        let point = &positions[node as usize];
        let is_other = |triangle: u32| !mesh.triangles()[triangle as usize].contains(&node);
        let Some(mut covering) = self.winding(body, point, is_other) else {
            return Some(false);
        };
        for &tetrahedron in surface.tetrahedra_of_nodes(mesh).of(node) {
            let nodes = mesh.tetrahedra()[tetrahedron as usize];
            let [a, b, c, d] = nodes.map(|node| positions[node as usize]);
            if orientation(&[a, b, c, d]) <= 0 {
                return None;
            }
            let opposite = match nodes.iter().position(|&corner| corner == node) {
                Some(0) => [b, c, d],
                Some(1) => [a, d, c],
                Some(2) => [a, b, d],
                _ => [a, c, b],
            };
            covering -= crossing(&opposite, point);
        }
        Some(covering > 0)
    }

    /// Signed crossings of the half line from `point` along +x with the triangles of `of`; `None` when
    /// the point is on one of them.
    fn winding(&self, body: u32, point: &Point, of: impl Fn(u32) -> bool) -> Option<i32> {
        let mut winding = Some(0);
        self.search(body, &HalfLine(*point), 0.0, |triangle| {
            if !of(triangle) {
                return 0.0;
            }
            let corners = self.bodies[body as usize].triangle(triangle);
            let near = Aabb::from_points(&corners).contains(point);
            if near && triangles_intersect(&[*point; 3], &corners) {
                winding = None;
                return NOTHING;
            }
            winding = winding.map(|winding| winding + crossing(&corners, point));
            0.0
        });
        winding
    }
}

/// Crossing of the ray from `point` along +x with a triangle that does not hold the point: +1 where the
/// ray leaves through its front, -1 where it enters, 0 where it misses. Where the box of the triangle tells
/// that, coordinates are only compared: so the answer is that of a search by boxes, whatever overflows.
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
    if triangle.iter().all(|corner| corner[0] < point[0]) {
        return 0;
    }
    if triangle.iter().all(|corner| corner[0] > point[0]) {
        return turns;
    }
    let [a, b, c] = *triangle;
    // Seen along +x the triangle comes after the point when the point is behind a front that faces +x,
    // or before a front that faces -x.
    let behind = predicates::orient3d(a, b, c, *point) < 0;
    if behind == (turns > 0) { turns } else { 0 }
}

/// Whether the edge from `lower` to `upper` (by z) passes the point's height at a larger y.
fn passes_at_larger_y(lower: &Point, upper: &Point, point: &Point) -> bool {
    if lower[1] > point[1] && upper[1] > point[1] {
        return true;
    }
    if lower[1] < point[1] && upper[1] < point[1] {
        return false;
    }
    let [lower, upper, point] = [lower, upper, point].map(|corner| [corner[1], corner[2]]);
    predicates::orient2d(lower, upper, point) > 0
}
