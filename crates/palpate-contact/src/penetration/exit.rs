//! The way out of a node that is inside.

use palpate_geometry::{Point, PointTriangle, vec3};

use super::Search;
use super::inside::Inside;
use crate::pairs::PenetratingNode;
use crate::points::{Closest, ClosestSearch, Ray, RaySearch};
use crate::proximity::{any_normal, direction, size, triangle_normal, unit};

/// Cosine from which two directions count as one and the same way: a little more than at right angles.
const FACING: f64 = 0.1;

/// Finds exits. Keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Exits {
    /// Normals of the triangles around a node.
    normals: Vec<Point>,
}

/// A node on its way out.
#[derive(Clone, Copy)]
struct Node<'a> {
    search: &'a Search<'a>,
    body: u32,
    into: u32,
    index: u32,
    point: Point,
}

impl Exits {
    /// Appends the records of the nodes of `body` that are `inside` the body `into`. `patch`: what of the
    /// surface of `into` is inside `body`, if that has an inside.
    pub(super) fn run(
        &mut self,
        search: &Search,
        [body, into]: [u32; 2],
        inside: &Inside,
        patch: Option<&Inside>,
        found: &mut Vec<PenetratingNode>,
    ) {
        let positions = &search.surfaces.bodies[body as usize].positions;
        let node =
            |index: u32| Node { search, body, into, index, point: positions[index as usize] };
        for &inner in &inside.nodes {
            let node = node(inner);
            let exit = match patch {
                Some(patch) => self.through_patch(&node, patch),
                None => node.closest(f64::INFINITY, |_, _, _| true),
            };
            found.extend(exit.and_then(|exit| node.record(&exit)));
        }
        for component in inside.swallowed.chunk_by(|a, b| a.0 == b.0) {
            swallowed(component.iter().map(|&(_, inner)| node(inner)), found);
        }
    }

    /// The closest point of the patch in front of the node: of a triangle with the node behind it that
    /// faces one around the node. Where there is none, of a patch that faces elsewhere, and at last of
    /// the whole surface.
    fn through_patch(&mut self, node: &Node, patch: &Inside) -> Option<Closest> {
        let body = &node.search.surfaces.bodies[node.body as usize];
        self.normals.clear();
        for &triangle in body.surface.triangles_of_nodes.of(node.index) {
            self.normals.extend(unit(triangle_normal(&body.triangle(triangle))));
        }
        let opposite = |triangle: u32, corners: &[Point; 3], found: &PointTriangle, faces: bool| {
            if !patch.is_in_patch(triangle) {
                return false;
            }
            let Some(normal) = unit(triangle_normal(corners)) else {
                return false;
            };
            let out = offset(corners, found.weights, node.point);
            let faced = |own: &Point| vec3::dot(*own, normal) < -FACING;
            vec3::dot(out, normal) > FACING * vec3::norm(out)
                && (!faces || self.normals.iter().any(faced))
        };
        node.closest(f64::INFINITY, |t, corners, found| opposite(t, corners, found, true))
            .or_else(|| {
                node.closest(f64::INFINITY, |t, corners, found| opposite(t, corners, found, false))
            })
            .or_else(|| node.closest(f64::INFINITY, |_, _, _| true))
    }
}

/// A component without any crossing leaves as a whole: in the direction of the node that is nearest to
/// the surface.
fn swallowed<'a>(nodes: impl Iterator<Item = Node<'a>> + Clone, found: &mut Vec<PenetratingNode>) {
    let mut nearest: Option<(PenetratingNode, f64)> = None;
    for node in nodes.clone() {
        let within = nearest.map_or(f64::INFINITY, |(_, distance_squared)| distance_squared.sqrt());
        if let Some(exit) = node.closest_elsewhere(within)
            && nearest.is_none_or(|(_, distance)| exit.distance_squared < distance)
            && let Some(record) = node.record(&exit)
        {
            nearest = Some((record, exit.distance_squared));
        }
    }
    let Some((nearest, _)) = nearest else {
        return;
    };
    for node in nodes {
        if node.index == nearest.node {
            found.push(nearest);
        } else if let Some(record) = node.along(nearest.direction) {
            found.push(record);
        } else {
            let exit = node.closest_elsewhere(f64::INFINITY);
            found.extend(exit.and_then(|exit| node.record(&exit)));
        }
    }
}

impl Node<'_> {
    /// The closest point within a distance \[m\], of triangles that do not have the node and for which
    /// `keep` holds.
    fn closest(
        &self,
        within: f64,
        keep: impl Fn(u32, &[Point; 3], &PointTriangle) -> bool,
    ) -> Option<Closest> {
        let surfaces = &self.search.surfaces;
        let triangles = surfaces.bodies[self.into as usize].mesh.triangles();
        let own = |triangle: u32| {
            self.body == self.into && triangles[triangle as usize].contains(&self.index)
        };
        let mut search = ClosestSearch::new(self.point, within, &self.search.bounds);
        search.body(surfaces, self.into, |triangle, corners, found| {
            !own(triangle) && keep(triangle, corners, found)
        });
        search.best
    }

    /// Whether a triangle of `into` belongs to another component than the node.
    fn is_elsewhere(&self, triangle: u32) -> bool {
        let into = &self.search.surfaces.bodies[self.into as usize];
        let components = &into.surface.components;
        let [node, ..] = into.mesh.triangles()[triangle as usize];
        self.body != self.into || components[node as usize] != components[self.index as usize]
    }

    fn closest_elsewhere(&self, within: f64) -> Option<Closest> {
        self.closest(within, |triangle, _, _| self.is_elsewhere(triangle))
    }

    /// The record of an exit; `None` when the exit is where the node is, or its distance overflows.
    fn record(&self, exit: &Closest) -> Option<PenetratingNode> {
        let depth = exit.distance_squared.sqrt();
        if depth == 0.0 || !depth.is_finite() {
            return None;
        }
        let Closest { triangle, weights, .. } = *exit;
        let corners = self.search.surfaces.bodies[self.into as usize].triangle(triangle);
        let direction = direction(offset(&corners, weights, self.point), depth, size(&corners))
            .or_else(|| unit(triangle_normal(&corners)))
            .unwrap_or_else(|| any_normal(vec3::sub(corners[1], corners[0])));
        Some(self.leaving(triangle, weights, direction, depth))
    }

    /// The record of leaving in a given direction.
    fn along(&self, direction: Point) -> Option<PenetratingNode> {
        let ray = Ray::new(self.point, direction)?;
        let mut search = RaySearch::new(ray, f64::INFINITY, &self.search.bounds);
        search.body(&self.search.surfaces, self.into, |triangle| self.is_elsewhere(triangle));
        let hit = search.best.filter(|hit| hit.distance > 0.0)?;
        Some(self.leaving(hit.triangle, hit.weights, direction, hit.distance))
    }

    fn leaving(
        &self,
        triangle: u32,
        weights: [f64; 3],
        direction: Point,
        depth: f64,
    ) -> PenetratingNode {
        let Self { body, index: node, into: into_body, .. } = *self;
        PenetratingNode { body, node, into_body, triangle, weights, direction, depth }
    }
}

/// From `point` to the point of a triangle with the given weights.
fn offset(corners: &[Point; 3], weights: [f64; 3], point: Point) -> Point {
    let mut offset = [0.0; 3];
    for (weight, &corner) in weights.into_iter().zip(corners) {
        offset = vec3::add_scaled(offset, vec3::sub(corner, point), weight);
    }
    offset
}
