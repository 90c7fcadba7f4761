//! Closest surface point: branch and bound down the tree, nearer child first.

use palpate_geometry::{Point, point_triangle};

use super::{BoundingTree, corner_points};

/// The surface point found closest, before it is dressed for the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SurfacePoint {
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    pub(crate) distance_squared: f64,
}

struct Search<'a> {
    tree: &'a BoundingTree,
    positions: &'a [Point],
    point: Point,
    /// Absolute rounding error of a distance here \[m\].
    rounding: f64,
    best: SurfacePoint,
    /// No box further than this can hold a better point \[m²\].
    limit_squared: f64,
}

impl BoundingTree {
    /// The surface point closest to `point`, if one is at most `within` \[m\] away.
    ///
    /// Of triangles at equal distance the one with the smallest index.
    pub(crate) fn closest_point(
        &self,
        positions: &[Point],
        point: Point,
        within: f64,
    ) -> Option<SurfacePoint> {
        let none =
            SurfacePoint { triangle: u32::MAX, weights: [0.0; 3], distance_squared: f64::INFINITY };
        let mut search = Search {
            tree: self,
            positions,
            point,
            rounding: rounding_at(self, &point),
            best: none,
            limit_squared: f64::INFINITY,
        };
        search.limit_squared = search.limit(within);
        search.visit(0);
        let found = search.best;
        (found.triangle != u32::MAX && found.distance_squared.sqrt() <= within).then_some(found)
    }
}

/// Bound on the rounding error \[m\] of coordinate differences near the tree and `point`.
fn rounding_at(tree: &BoundingTree, point: &Point) -> f64 {
    let bounds = tree.bounds();
    let coordinates = bounds.min.iter().chain(&bounds.max).chain(point);
    let largest = coordinates.fold(0.0_f64, |largest, value| largest.max(value.abs()));
    if largest.is_finite() { 16.0 * f64::EPSILON * largest } else { 0.0 }
}

impl Search<'_> {
    /// A hair beyond `distance`, so that rounding never culls an equal.
    fn limit(&self, distance: f64) -> f64 {
        let limit = distance * (1.0 + 1e-9) + self.rounding;
        limit * limit
    }

    fn visit(&mut self, node: usize) {
        let Some([left, right]) = self.tree.children(node) else {
            return self.visit_leaf(node);
        };
        let left_distance = self.tree.nodes[left].bounds.distance_squared(&self.point);
        let right_distance = self.tree.nodes[right].bounds.distance_squared(&self.point);
        let (near, far, far_distance) = if left_distance <= right_distance {
            (left, right, right_distance)
        } else {
            (right, left, left_distance)
        };
        if left_distance.min(right_distance) <= self.limit_squared {
            self.visit(near);
        }
        if far_distance <= self.limit_squared {
            self.visit(far);
        }
    }

    fn visit_leaf(&mut self, leaf: usize) {
        let [start, end] = self.tree.nodes[leaf].triangles;
        for position in start..end {
            let bounds = self.tree.triangle_bounds(position);
            if bounds.distance_squared(&self.point) > self.limit_squared {
                continue;
            }
            let corners = corner_points(self.positions, self.tree.corners(position));
            let found = point_triangle(self.point, &corners);
            let triangle = self.tree.triangle_order[position as usize];
            let best = (self.best.distance_squared, self.best.triangle);
            if (found.distance_squared, triangle) < best {
                self.best = SurfacePoint {
                    triangle,
                    weights: found.weights,
                    distance_squared: found.distance_squared,
                };
                let limit = self.limit(found.distance_squared.sqrt());
                self.limit_squared = self.limit_squared.min(limit);
            }
        }
    }
}
