//! The closest surface point.

use palpate_geometry::{Aabb, Point, PointTriangle, point_triangle};

use crate::nearest::{Distance, Measure, Surfaces, rounding_at};

/// The surface point found closest, before it is dressed for the user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closest {
    pub(crate) body: u32,
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    pub(crate) distance_squared: f64,
}

/// The search for the surface point closest to a point, among bodies one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosestSearch {
    pub(crate) point: Point,
    /// Absolute rounding error of a distance here \[m\].
    rounding: f64,
    /// No box further than this can hold a better point \[m²\].
    limit_squared: f64,
    pub(crate) best: Option<Closest>,
}

impl ClosestSearch {
    /// Looks no further than `within` \[m\], or hardly; `bounds` holds the bodies.
    pub(crate) fn new(point: Point, within: f64, bounds: &Aabb) -> Self {
        let rounding = rounding_at(bounds, &point);
        let mut search = Self { point, rounding, limit_squared: f64::INFINITY, best: None };
        search.limit_squared = search.beyond(within);
        search
    }

    /// A hair beyond `distance`, so that rounding never culls an equal.
    fn beyond(&self, distance: f64) -> f64 {
        let limit = distance * (1.0 + 1e-9) + self.rounding;
        limit * limit
    }

    /// Squared distance \[m²\] of a box; infinite for an empty one.
    pub(crate) fn key(&self, bounds: &Aabb) -> f64 {
        Distance(self.point).of_box(bounds)
    }

    pub(crate) fn limit(&self) -> f64 {
        self.limit_squared
    }

    /// Searches the triangles of a body for which `keep` holds. Of equals, the smallest
    /// (body, triangle) stays.
    pub(crate) fn body(
        &mut self,
        surfaces: &Surfaces,
        body: u32,
        keep: impl Fn(u32, &[Point; 3], &PointTriangle) -> bool,
    ) {
        let scene_body = &surfaces.bodies[body as usize];
        surfaces.search(body, &Distance(self.point), self.limit_squared, |triangle| {
            let corners = scene_body.triangle(triangle);
            let found = point_triangle(self.point, &corners);
            let better = self.best.as_ref().is_none_or(|best| {
                let best = (best.distance_squared, best.body, best.triangle);
                (found.distance_squared, body, triangle) < best
            });
            if better && keep(triangle, &corners, &found) {
                let PointTriangle { distance_squared, weights, .. } = found;
                self.best = Some(Closest { body, triangle, weights, distance_squared });
                self.limit_squared = self.limit_squared.min(self.beyond(distance_squared.sqrt()));
            }
            self.limit_squared
        });
    }
}
