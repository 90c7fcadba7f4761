//! Queries about points and rays: the closest surface point, inside or outside, the first hit.

mod closest;
mod ray;
mod winding;

use palpate_geometry::{Aabb, Point, vec3};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::nearest::Surfaces;
use crate::upper_tree::UpperTree;

pub(crate) use closest::{Closest, ClosestSearch};
pub(crate) use ray::{Ray, RaySearch};

/// Points that a thread takes at a time.
const POINTS_PER_TASK: usize = 64;

/// A point of a body's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The body.
    pub body: u32,
    /// Surface triangle of the body.
    pub triangle: u32,
    /// Barycentric weights on the triangle.
    pub weights: [f64; 3],
    /// The point \[m\].
    pub position: Point,
    /// Distance \[m\] from where the query began.
    pub distance: f64,
}

/// The bodies that a query looks at.
#[derive(Clone, Copy)]
pub(crate) struct Among<'a> {
    pub(crate) surfaces: Surfaces<'a>,
    pub(crate) upper: &'a UpperTree,
    /// All when `None`.
    pub(crate) body: Option<u32>,
}

impl Among<'_> {
    /// The point closest to `point` that is at most `within` \[m\] away.
    pub(crate) fn closest(&self, point: Point, within: f64) -> Option<SurfacePoint> {
        let mut search = ClosestSearch::new(point, within, &self.upper.bounds());
        self.visit(&mut search, &ClosestSearch::key, &ClosestSearch::limit, &mut |search, body| {
            search.body(&self.surfaces, body, |_, _, _| true);
        });
        let Closest { body, triangle, weights, distance_squared } = search.best?;
        let distance = distance_squared.sqrt();
        // Where squares overflow, which triangle is closest cannot be told.
        (distance <= within && distance < f64::INFINITY)
            .then(|| self.point(body, triangle, weights, distance))
    }

    /// The first hit of a ray that is at most `within` \[m\] away.
    pub(crate) fn cast(&self, ray: Ray, within: f64) -> Option<SurfacePoint> {
        let mut search = RaySearch::new(ray, within, &self.upper.bounds());
        self.visit(&mut search, &RaySearch::key, &RaySearch::limit, &mut |search, body| {
            search.body(&self.surfaces, body, |_| true);
        });
        let hit = search.best.filter(|hit| hit.distance <= within)?;
        Some(self.point(hit.body, hit.triangle, hit.weights, hit.distance))
    }

    /// Whether `point` is strictly inside each body; `inside` has one entry for each that is asked about.
    pub(crate) fn contains(&self, point: Point, inside: &mut [bool]) {
        inside.fill(false);
        let mut inside = inside;
        let around = |_: &&mut [bool], bounds: &Aabb| {
            if bounds.contains(&point) { 0.0 } else { f64::INFINITY }
        };
        self.visit(&mut inside, &around, &|_| 0.0, &mut |inside, body| {
            let column = if self.body.is_some() { 0 } else { body as usize };
            inside[column] = self.surfaces.is_inside(body, &point);
        });
    }

    fn visit<S>(
        &self,
        state: &mut S,
        key: &impl Fn(&S, &Aabb) -> f64,
        limit: &impl Fn(&S) -> f64,
        visit: &mut impl FnMut(&mut S, u32),
    ) {
        match self.body {
            Some(body) => visit(state, body),
            None => self.upper.visit(state, key, limit, visit),
        }
    }

    fn point(&self, body: u32, triangle: u32, weights: [f64; 3], distance: f64) -> SurfacePoint {
        let [a, b, c] = self.surfaces.bodies[body as usize].triangle(triangle);
        let [wa, wb, wc] = weights;
        let position = vec3::add_scaled(vec3::add_scaled(vec3::scale(a, wa), b, wb), c, wc);
        SurfacePoint { body, triangle, weights, position, distance }
    }
}

/// Calls `answer` with the index of each point and its entries of `answers`, `width` for each.
pub(crate) fn for_each_point<T: Send>(
    pool: Option<&ThreadPool>,
    answers: &mut [T],
    width: usize,
    answer: impl Fn(usize, &mut [T]) + Sync,
) {
    let work = |(task, chunk): (usize, &mut [T])| {
        for (index, entries) in chunk.chunks_mut(width).enumerate() {
            answer(task * POINTS_PER_TASK + index, entries);
        }
    };
    let size = POINTS_PER_TASK * width;
    match pool {
        Some(pool) => {
            pool.install(|| answers.par_chunks_mut(size).enumerate().for_each(work));
        }
        None => answers.chunks_mut(size).enumerate().for_each(work),
    }
}
