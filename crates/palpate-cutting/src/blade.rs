//! The blade: an oriented triangle surface, as a scalpel sweeps it or a plane or a loop spans it.

mod file;
mod sheet;
mod sheets;
mod triangulate;

use palpate_geometry::{Aabb, Point, vec3};
use serde::{Deserialize, Serialize};

pub use file::{BladeFileError, BladeFileErrorCause, Stroke, When, parse_strokes, read_strokes};
pub(crate) use sheet::{Sheet, Side};

/// A surface that cuts what it passes through.
///
/// It may be open or closed, bent, in several parts, and branch; its two sides must be distinct.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "Shape", into = "Shape")]
pub struct Blade(Shape);

#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
enum Shape {
    /// Points, and the triangles of each sheet, coherently oriented.
    Surface { points: Vec<Point>, sheets: Vec<Vec<[u32; 3]>> },
    /// All of the plane through `point`; `normal` is a unit vector.
    Plane { point: Point, normal: Point },
}

impl From<Blade> for Shape {
    fn from(blade: Blade) -> Self {
        blade.0
    }
}

impl TryFrom<Shape> for Blade {
    type Error = BladeError;

    /// The very shape that was written; it may have been damaged since.
    fn try_from(shape: Shape) -> Result<Self, BladeError> {
        match &shape {
            Shape::Surface { points, sheets } => {
                for sheet in sheets {
                    Self::new(points, sheet)?;
                }
            }
            Shape::Plane { point, normal } => {
                Self::plane(*point, *normal, None)?;
            }
        }
        Ok(Self(shape))
    }
}

/// Why arrays do not make a blade.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BladeError {
    /// A coordinate that is infinite or not a number.
    #[error("point {point} of the blade, {position:?}, is not finite; give coordinates in metres")]
    NonFinitePoint {
        /// Index of the point; of a stroke, `2 * edge + end`.
        point: usize,
        /// Its coordinates.
        position: Point,
    },
    /// Fewer points than a surface needs.
    #[error("{found} {what} are too few for a blade: give at least {least}")]
    TooFew {
        /// `edges of the stroke`, `points of the loop` or `triangles`.
        what: &'static str,
        /// How many came.
        found: usize,
        /// How many are needed.
        least: usize,
    },
    /// A triangle names a point that does not exist.
    #[error(
        "triangle {triangle} of the blade: point index {point} is out of range (there are \
         {point_count} points, counted from 0)"
    )]
    PointOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The index that it names.
        point: u32,
        /// How many points there are.
        point_count: usize,
    },
    /// A triangle without an area.
    #[error(
        "triangle {triangle} of the blade has no area: its corners lie on a line; leave it out"
    )]
    FlatTriangle {
        /// Index of the triangle.
        triangle: usize,
    },
    /// A stroke that does not leave its line, or a loop without an area.
    #[error("the {what} of the blade span no area: move the edge sideways or give more points")]
    NoArea {
        /// `edges of the stroke` or `points of the loop`.
        what: &'static str,
    },
    /// A plane's normal of length zero.
    #[error(
        "the normal {normal:?} of the plane has no direction; give a vector of any length but 0"
    )]
    NoNormal {
        /// The normal that came.
        normal: Point,
    },
    /// A plane of no size.
    #[error(
        "the size {size} of the plane is not positive; give its edge length [m], or none for all of it"
    )]
    NoSize {
        /// The size that came.
        size: f64,
    },
    /// A surface with one side only, as a Möbius strip.
    #[error(
        "the blade has only one side: it comes back to triangle {triangle} turned over; cut it open"
    )]
    OneSided {
        /// A triangle where the sides meet.
        triangle: usize,
    },
    /// A loop that crosses itself, seen along its mean normal.
    #[error(
        "the loop crosses itself near point {point}, seen along its mean normal; give its points in order"
    )]
    CrossedLoop {
        /// A point where no triangle can be cut off.
        point: usize,
    },
}

impl Blade {
    /// The surface of triangles with corners in `points` [m].
    ///
    /// Points at the same place are one. Triangles are turned to agree with their neighbours, so
    /// their order of corners does not matter. Where more than two share an edge, or neighbours are
    /// folded back sharply, the surface is taken apart into sheets that cut one after the other.
    ///
    /// # Errors
    /// If there is no triangle, one has no area or an index out of range, a point is not finite, or
    /// the surface has one side only.
    pub fn new(points: &[Point], triangles: &[[u32; 3]]) -> Result<Self, BladeError> {
        check_finite(points)?;
        if triangles.is_empty() {
            return Err(BladeError::TooFew { what: "triangles", found: 0, least: 1 });
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|&&point| point as usize >= points.len()) {
                return Err(BladeError::PointOutOfRange {
                    triangle,
                    point,
                    point_count: points.len(),
                });
            }
            if triangulate::is_flat(&corners.map(|point| points[point as usize])) {
                return Err(BladeError::FlatTriangle { triangle });
            }
        }
        Self::from_triangles(points, triangles)
    }

    /// The strip that an edge sweeps from each of its places to the next: a scalpel. `edges` [m]
    /// has at least two of them; places where it stood still or moved along itself sweep nothing. A
    /// strip that comes back to its first edge is a closed tube.
    ///
    /// # Errors
    /// If there are fewer than two edges, one is not finite, or nothing is swept.
    pub fn stroke(edges: &[[Point; 2]]) -> Result<Self, BladeError> {
        const WHAT: &str = "edges of the stroke";
        check_finite(edges.as_flattened())?;
        if edges.len() < 2 {
            return Err(BladeError::TooFew { what: WHAT, found: edges.len(), least: 2 });
        }
        let mut triangles = Vec::with_capacity(2 * edges.len());
        for (place, pair) in edges.windows(2).enumerate() {
            let [[heel, tip], [next_heel, next_tip]] = [pair[0], pair[1]];
            let first = 2 * place as u32;
            // The shorter diagonal bends a twisted quadrilateral less.
            let along_heel =
                vec3::distance_squared(heel, next_tip) <= vec3::distance_squared(tip, next_heel);
            triangles.extend(if along_heel {
                [[first, first + 1, first + 3], [first, first + 3, first + 2]]
            } else {
                [[first, first + 1, first + 2], [first + 1, first + 3, first + 2]]
            });
        }
        let points = edges.as_flattened();
        triangles
            .retain(|corners| !triangulate::is_flat(&corners.map(|point| points[point as usize])));
        if triangles.is_empty() {
            return Err(BladeError::NoArea { what: WHAT });
        }
        Self::from_triangles(points, &triangles)
    }

    /// The square of edge length `size` [m] around `point` [m], orthogonal to `normal` (of any
    /// length); without a size, the whole plane.
    ///
    /// # Errors
    /// If something is not finite, the normal is zero, or the size is not positive.
    pub fn plane(point: Point, normal: Point, size: Option<f64>) -> Result<Self, BladeError> {
        check_finite(&[point, normal])?;
        let largest = vec3::max_abs(normal);
        let unit = normal.map(|value| value / largest);
        let unit = vec3::normalized(unit).ok_or(BladeError::NoNormal { normal })?;
        let Some(size) = size else {
            return Ok(Self(Shape::Plane { point, normal: unit }));
        };
        if !(size > 0.0 && size.is_finite()) {
            return Err(BladeError::NoSize { size });
        }
        let [u, v] = tangents(unit);
        let corner = |s: f64, t: f64| {
            vec3::add_scaled(vec3::add_scaled(point, u, 0.5 * s * size), v, 0.5 * t * size)
        };
        let points = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Self::new(&points, &[[0, 1, 2], [0, 2, 3]])
    }

    /// The surface that a closed line spans, flat or not: `points` [m] in order, the last joined to
    /// the first.
    ///
    /// # Errors
    /// If there are fewer than three different points, one is not finite, they span no area, or the
    /// line crosses itself, seen along its mean normal.
    pub fn closed_loop(points: &[Point]) -> Result<Self, BladeError> {
        const WHAT: &str = "points of the loop";
        check_finite(points)?;
        let mut corners: Vec<u32> = (0..points.len() as u32).collect();
        corners.dedup_by_key(|point| points[*point as usize]);
        if corners.len() > 1 && points[0] == points[corners[corners.len() - 1] as usize] {
            corners.pop();
        }
        if corners.len() < 3 {
            return Err(BladeError::TooFew { what: WHAT, found: corners.len(), least: 3 });
        }
        let triangles = triangulate::polygon(points, corners, WHAT)?;
        Self::from_triangles(points, &triangles)
    }

    /// Several blades as one, cutting in this order. Surfaces that share points along their
    /// borders, as a tube and its cap, become one sheet; whole planes stay apart and must be cut on
    /// their own.
    ///
    /// # Errors
    /// If there is none, or one is a whole plane, or the sum has one side only.
    pub fn joined(blades: &[Self]) -> Result<Self, BladeError> {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for blade in blades {
            let first = points.len() as u32;
            points.extend_from_slice(blade.points());
            triangles.extend(blade.triangles().map(|corners| corners.map(|point| first + point)));
        }
        if triangles.is_empty() {
            return Err(BladeError::TooFew { what: "triangles", found: 0, least: 1 });
        }
        Self::from_triangles(&points, &triangles)
    }

    /// `triangles` all have an area and points in range.
    fn from_triangles(points: &[Point], triangles: &[[u32; 3]]) -> Result<Self, BladeError> {
        let (points, triangles) = sheets::merged(points, triangles);
        let sheets = sheets::oriented(&points, &triangles)?;
        Ok(Self(Shape::Surface { points, sheets }))
    }

    /// The points [m], each once; none for a whole plane.
    pub fn points(&self) -> &[Point] {
        match &self.0 {
            Shape::Surface { points, .. } => points,
            Shape::Plane { .. } => &[],
        }
    }

    /// The triangles, by sheet, coherently oriented within each; none for a whole plane.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        let sheets = match &self.0 {
            Shape::Surface { sheets, .. } => sheets.as_slice(),
            Shape::Plane { .. } => &[],
        };
        sheets.iter().flatten().copied()
    }

    /// The parts that cut one after the other, each as a blade: separate, branching or folded back
    /// sheets.
    pub fn parts(&self) -> Vec<Self> {
        match &self.0 {
            Shape::Surface { points, sheets } => {
                let part = |sheet: &Vec<[u32; 3]>| {
                    Self(Shape::Surface { points: points.clone(), sheets: vec![sheet.clone()] })
                };
                sheets.iter().map(part).collect()
            }
            Shape::Plane { .. } => vec![self.clone()],
        }
    }

    /// The box around the surface; all of space for a whole plane.
    pub fn bounds(&self) -> Aabb {
        match &self.0 {
            Shape::Surface { points, .. } => Aabb::from_points(points),
            Shape::Plane { .. } => Aabb { min: [f64::NEG_INFINITY; 3], max: [f64::INFINITY; 3] },
        }
    }

    /// The blade turned and moved: each point `p` to `map(p)`, which must keep lengths.
    ///
    /// # Errors
    /// If a point is no longer finite or a triangle has lost its area.
    pub fn mapped(&self, map: impl Fn(Point) -> Point) -> Result<Self, BladeError> {
        match &self.0 {
            Shape::Surface { points, .. } => {
                let points: Vec<Point> = points.iter().map(|&point| map(point)).collect();
                Self::new(&points, &self.triangles().collect::<Vec<_>>())
            }
            Shape::Plane { point, normal } => {
                let moved = map(*point);
                Self::plane(moved, vec3::sub(map(vec3::add(*point, *normal)), moved), None)
            }
        }
    }

    /// The sheets, as far as they matter to a body inside `bounds`.
    pub(crate) fn sheets(&self, bounds: &Aabb) -> Vec<Sheet> {
        match &self.0 {
            Shape::Surface { points, sheets } => {
                let corners = |sheet: &Vec<[u32; 3]>| {
                    sheet
                        .iter()
                        .map(|corners| corners.map(|point| points[point as usize]))
                        .collect()
                };
                sheets.iter().map(|sheet| Sheet::new(corners(sheet))).collect()
            }
            Shape::Plane { point, normal } => {
                vec![Sheet::new(vec![triangle_around(*point, *normal, bounds)])]
            }
        }
    }
}

/// A triangle of a plane that holds all of the plane's section of a box.
fn triangle_around(point: Point, normal: Point, bounds: &Aabb) -> [Point; 3] {
    let [u, v] = tangents(normal);
    // The foot of the box's centre, so that the triangle is no larger than the box asks for.
    let center = bounds.center();
    let height = vec3::dot(vec3::sub(center, point), normal);
    let mut foot = vec3::add_scaled(center, normal, -height);
    // Along an axis of the plane the coordinate must stay what it was, to the bit.
    for axis in 0..3 {
        if normal[axis].abs() == 1.0 {
            foot[axis] = point[axis];
        }
    }
    let reach = vec3::norm(bounds.extent()).max(f64::MIN_POSITIVE);
    let corner =
        |s: f64, t: f64| vec3::add_scaled(vec3::add_scaled(foot, u, s * reach), v, t * reach);
    // The circle of radius `reach` around the foot fits into this triangle.
    [corner(-2.0, -1.0), corner(2.0, -1.0), corner(0.0, 3.0)]
}

/// Two unit vectors that are right-handed with `normal`; along axes where it is along one.
fn tangents(normal: Point) -> [Point; 2] {
    let smallest = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs()));
    let mut axis = [0.0; 3];
    axis[smallest.unwrap_or(0)] = 1.0;
    let u = vec3::cross(axis, normal);
    let u = vec3::normalized(u).expect("the smallest component of a unit vector is below 0.6");
    [u, vec3::cross(normal, u)]
}

fn check_finite(points: &[Point]) -> Result<(), BladeError> {
    match points.iter().position(|point| point.iter().any(|value| !value.is_finite())) {
        Some(point) => Err(BladeError::NonFinitePoint { point, position: points[point] }),
        None => Ok(()),
    }
}
