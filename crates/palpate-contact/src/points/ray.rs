//! Where a ray first meets the surface.
//!
//! Watertight after Woop, Benthin and Wald 2013 (Watertight Ray/Triangle Intersection): nodes are
//! sheared so that the ray becomes an axis; each node's image depends on the node and the ray alone, and
//! the signs of the edges, seen along the axis, are exact. So no ray slips through between triangles.

use palpate_geometry::{Aabb, Point, predicates, triangles_intersect, vec3};

use crate::nearest::{Entry, Measure, Surfaces, rounding_at};
use crate::proximity::unit;

/// A ray, prepared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    origin: Point,
    /// Unit vector.
    direction: Point,
    /// The axis along which the direction is longest, last.
    axes: [usize; 3],
    /// What is taken off the first two coordinates, per metre along the last.
    shear: [f64; 2],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RayTriangle {
    pub(crate) weights: [f64; 3],
    /// Distance \[m\] from the origin, not negative.
    pub(crate) distance: f64,
}

/// The nearest hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    pub(crate) body: u32,
    pub(crate) triangle: u32,
    pub(crate) weights: [f64; 3],
    pub(crate) distance: f64,
}

impl Ray {
    /// `None` when the direction is zero.
    pub(crate) fn new(origin: Point, direction: Point) -> Option<Self> {
        let direction = unit(direction)?;
        let [x, y, z] = direction.map(f64::abs);
        let last = if x >= y && x >= z { 0 } else { 1 + usize::from(z > y) };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let shear = [direction[axes[0]] / direction[last], direction[axes[1]] / direction[last]];
        Some(Self { origin, direction, axes, shear })
    }

    /// Where the ray meets a closed triangle; of one seen edge-on, the nearest point.
    pub(crate) fn triangle(&self, triangle: &[Point; 3]) -> Option<RayTriangle> {
        let [first, second, last] = self.axes;
        let from_origin = triangle.map(|corner| vec3::sub(corner, self.origin));
        let along = from_origin.map(|corner| corner[last]);
        let seen = from_origin.map(|corner| {
            let [by_first, by_second] = self.shear.map(|shear| shear * corner[last]);
            [corner[first] - by_first, corner[second] - by_second]
        });
        let turn = |side: usize| predicates::orient2d(seen[side], seen[(side + 1) % 3], [0.0; 2]);
        let turns = [turn(0), turn(1), turn(2)];
        if turns.contains(&1) && turns.contains(&-1) {
            return None;
        }
        let weights =
            if turns == [0; 3] { self.edge_on(&seen, &along)? } else { face_weights(&seen, turns) };
        let depth: f64 = weights.iter().zip(along).map(|(weight, depth)| weight * depth).sum();
        let distance = depth / self.direction[last];
        let size = along.iter().fold(0.0_f64, |size, depth| size.max(depth.abs()));
        if distance.abs() <= 16.0 * f64::EPSILON * size
            && triangles_intersect(&[self.origin; 3], triangle)
        {
            return Some(RayTriangle { weights, distance: 0.0 });
        }
        (distance >= 0.0).then_some(RayTriangle { weights, distance })
    }

    /// Weights of the nearest point, not behind the origin, of a triangle that is seen as a segment.
    fn edge_on(&self, seen: &[[f64; 2]; 3], along: &[f64; 3]) -> Option<[f64; 3]> {
        let ahead = self.direction[self.axes[2]].signum();
        let mut best: Option<(f64, [f64; 3])> = None;
        for from in 0..3 {
            let to = (from + 1) % 3;
            let (a, b) = (seen[from], seen[to]);
            let axis = usize::from((b[1] - a[1]).abs() > (b[0] - a[0]).abs());
            let part = if a == b {
                // Along the ray: its nearer end that is ahead, or the origin between the two.
                if a != [0.0; 2] {
                    continue;
                }
                let (start, end) = (ahead * along[from], ahead * along[to]);
                if start.min(end) < 0.0 && start.max(end) >= 0.0 {
                    start / (start - end)
                } else {
                    f64::from(u8::from(end < start))
                }
            } else if a[axis].min(b[axis]) <= 0.0 && a[axis].max(b[axis]) >= 0.0 {
                (a[axis] / (a[axis] - b[axis])).clamp(0.0, 1.0)
            } else {
                continue;
            };
            let depth = ahead * (along[from] * (1.0 - part) + along[to] * part);
            if depth >= 0.0 && best.is_none_or(|(nearest, _)| depth < nearest) {
                let mut weights = [0.0; 3];
                weights[from] = 1.0 - part;
                weights[to] = part;
                best = Some((depth, weights));
            }
        }
        best.map(|(_, weights)| weights)
    }
}

/// Weights of the origin in a triangle that holds it, by the areas opposite to the corners.
fn face_weights(seen: &[[f64; 2]; 3], turns: [i8; 3]) -> [f64; 3] {
    let size = seen.as_flattened().iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    let scaled = seen.map(|corner| corner.map(|value| value / size));
    let area = |side: usize| {
        let ([ax, ay], [bx, by]) = (scaled[side], scaled[(side + 1) % 3]);
        // What is not zero exactly has a sign, which rounding may hide.
        let smallest = if turns[side] == 0 { 0.0 } else { f64::MIN_POSITIVE };
        f64::from(turns[side]).abs() * (ax * by - ay * bx).abs().max(smallest)
    };
    let areas = [area(1), area(2), area(0)];
    let sum: f64 = areas.iter().sum();
    areas.map(|area| area / sum)
}

/// The search for the nearest hit, among bodies one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RaySearch {
    ray: Ray,
    entry: Entry,
    rounding: f64,
    limit: f64,
    pub(crate) best: Option<Hit>,
}

impl RaySearch {
    /// Looks no further than `within` \[m\], or hardly; `bounds` holds the bodies.
    pub(crate) fn new(ray: Ray, within: f64, bounds: &Aabb) -> Self {
        let rounding = rounding_at(bounds, &ray.origin);
        let entry = Entry::new(ray.origin, ray.direction, rounding);
        Self { ray, entry, rounding, limit: within * (1.0 + 1e-9) + rounding, best: None }
    }

    /// Distance \[m\] to a box; infinite where the ray misses it.
    pub(crate) fn key(&self, bounds: &Aabb) -> f64 {
        self.entry.of_box(bounds)
    }

    pub(crate) fn limit(&self) -> f64 {
        self.limit
    }

    /// Searches the triangles of a body for which `keep` holds. Of equals, the smallest
    /// (body, triangle) stays.
    pub(crate) fn body(&mut self, surfaces: &Surfaces, body: u32, keep: impl Fn(u32) -> bool) {
        let scene_body = &surfaces.bodies[body as usize];
        surfaces.search(body, &self.entry, self.limit, |triangle| {
            if keep(triangle)
                && let Some(found) = self.ray.triangle(&scene_body.triangle(triangle))
            {
                let better = self.best.as_ref().is_none_or(|best| {
                    let best = (best.distance, best.body, best.triangle);
                    (found.distance, body, triangle) < best
                });
                if better {
                    let RayTriangle { weights, distance } = found;
                    self.best = Some(Hit { body, triangle, weights, distance });
                    self.limit = self.limit.min(distance * (1.0 + 1e-9) + self.rounding);
                }
            }
            self.limit
        });
    }
}
