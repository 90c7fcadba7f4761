//! The scene's answers about points and rays.

use palpate_geometry::Point;

use super::Scene;
use crate::error::SceneError;
use crate::nearest::Surfaces;
use crate::points::{Among, Ray, SurfacePoint, for_each_point};

impl Scene {
    /// The surface point closest to each of `points` \[m\], of one body or of all; `None` where none is
    /// at most `max_distance` \[m\] away, or all are so far that the square of the distance overflows. Of
    /// equals, that of the smallest (body, triangle).
    ///
    /// # Errors
    /// If a coordinate is not finite, `max_distance` is negative or NaN, or there is no such body.
    pub fn closest(
        &mut self,
        points: &[Point],
        body: Option<usize>,
        max_distance: f64,
    ) -> Result<&[Option<SurfacePoint>], SceneError> {
        check_finite("points", points)?;
        check_distance(max_distance)?;
        let mut found = std::mem::take(&mut self.surface_points);
        let among = self.among(body)?;
        found.clear();
        found.resize(points.len(), None);
        for_each_point(self.threads.pool(), &mut found, 1, |index, found| {
            found[0] = among.closest(points[index], max_distance);
        });
        self.surface_points = found;
        Ok(&self.surface_points)
    }

    /// Whether each of `points` \[m\] is strictly inside each body: a row per point, with one entry per
    /// body, or one for the body that is asked about.
    ///
    /// Inside is where the surface's winding number is not zero, decided exactly. Nothing is inside a
    /// body with an open surface.
    ///
    /// # Errors
    /// If a coordinate is not finite, or there is no such body.
    pub fn contains(
        &mut self,
        points: &[Point],
        body: Option<usize>,
    ) -> Result<&[bool], SceneError> {
        check_finite("points", points)?;
        let mut inside = std::mem::take(&mut self.inside);
        let among = self.among(body)?;
        let width = if body.is_some() { 1 } else { self.bodies.len() };
        inside.clear();
        inside.resize(points.len() * width, false);
        for_each_point(self.threads.pool(), &mut inside, width, |index, inside| {
            among.contains(points[index], inside);
        });
        self.inside = inside;
        Ok(&self.inside)
    }

    /// Where each ray first meets the surface of one body or of any, at most `max_distance` \[m\] away;
    /// `None` where it does not. Directions may have any length but zero.
    ///
    /// Surfaces are hit from both sides, at their edges and nodes too, and where a ray begins on them.
    /// No ray slips through between two triangles. Of hits at the same distance, that of the smallest
    /// (body, triangle).
    ///
    /// # Errors
    /// If counts differ, a number is not finite, a direction is zero, `max_distance` is negative or NaN,
    /// or there is no such body.
    pub fn cast(
        &mut self,
        origins: &[Point],
        directions: &[Point],
        body: Option<usize>,
        max_distance: f64,
    ) -> Result<&[Option<SurfacePoint>], SceneError> {
        let (given, expected) = (directions.len(), origins.len());
        if given != expected {
            return Err(SceneError::DirectionCount { given, expected });
        }
        check_finite("origins", origins)?;
        check_finite("directions", directions)?;
        check_distance(max_distance)?;
        let zero = |direction: &Point| Ray::new([0.0; 3], *direction).is_none();
        if let Some(row) = directions.iter().position(zero) {
            return Err(SceneError::ZeroDirection { row });
        }
        let mut found = std::mem::take(&mut self.surface_points);
        let among = self.among(body)?;
        found.clear();
        found.resize(origins.len(), None);
        for_each_point(self.threads.pool(), &mut found, 1, |index, found| {
            let ray = Ray::new(origins[index], directions[index]);
            found[0] = ray.and_then(|ray| among.cast(ray, max_distance));
        });
        self.surface_points = found;
        Ok(&self.surface_points)
    }

    fn among(&self, body: Option<usize>) -> Result<Among<'_>, SceneError> {
        if let Some(body) = body {
            self.check_body(body)?;
        }
        Ok(Among {
            surfaces: Surfaces { bodies: &self.bodies, detector: &*self.detector },
            upper: &self.upper,
            body: body.map(|body| body as u32),
        })
    }
}

fn check_finite(array: &'static str, points: &[Point]) -> Result<(), SceneError> {
    let finite = |point: &Point| point.iter().all(|value| value.is_finite());
    match points.iter().position(|point| !finite(point)) {
        Some(row) => Err(SceneError::RowNotFinite { array, row, values: points[row] }),
        None => Ok(()),
    }
}

fn check_distance(distance: f64) -> Result<(), SceneError> {
    if distance >= 0.0 { Ok(()) } else { Err(SceneError::MaxDistance { distance }) }
}
