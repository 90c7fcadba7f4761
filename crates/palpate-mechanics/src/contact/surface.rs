//! Neighbourhood on a body's surface, and its rest areas.

use std::sync::Arc;

use glam::DVec3;
use palpate_geometry::Point;
use palpate_model::{Lists, Mesh};

/// The surface of one body.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    mesh: Arc<Mesh>,
    node_triangles: Lists<u32>,
    node_neighbours: Lists<u32>,
    /// Triangles at each edge, with the node opposite the edge.
    edge_triangles: Lists<(u32, u32)>,
    node_areas: Vec<f64>,
    edge_areas: Vec<f64>,
    closed: bool,
}

impl Surface {
    pub(crate) fn new(mesh: &Arc<Mesh>) -> Self {
        let (triangles, edges) = (mesh.triangles(), mesh.surface_edges());
        let count = mesh.nodes().len();
        let point = |node: u32| DVec3::from_array(mesh.nodes()[node as usize]);
        let mut edge_triangles = Vec::new();
        let mut node_areas = vec![0.0; count];
        let mut edge_areas = vec![0.0; edges.len()];
        let mut volume = 0.0;
        for (index, (&[a, b, c], sides)) in triangles.iter().zip(mesh.triangle_edges()).enumerate()
        {
            let area = 0.5 * (point(b) - point(a)).cross(point(c) - point(a)).length();
            volume += point(a).dot(point(b).cross(point(c))) / 6.0;
            for node in [a, b, c] {
                node_areas[node as usize] += area / 3.0;
            }
            for (&edge, opposite) in sides.iter().zip([c, a, b]) {
                edge_triangles.push((edge, (index as u32, opposite)));
                edge_areas[edge as usize] += area / 3.0;
            }
        }
        Self {
            mesh: Arc::clone(mesh),
            node_triangles: mesh.node_triangles(),
            node_neighbours: Lists::new(count, edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)])),
            edge_triangles: Lists::new(edges.len(), edge_triangles.into_iter()),
            node_areas,
            edge_areas,
            closed: volume > 0.0 && mesh.is_closed(),
        }
    }

    pub(crate) fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// True when the surface has an inside and an outside, the triangles facing outward.
    pub(crate) fn is_closed(&self) -> bool {
        self.closed
    }

    /// A third of the rest area of the triangles at a node [m²].
    pub(crate) fn node_area(&self, node: u32) -> f64 {
        self.node_areas[node as usize]
    }

    /// A third of the rest area of the triangles at an edge [m²].
    pub(crate) fn edge_area(&self, edge: u32) -> f64 {
        self.edge_areas[edge as usize]
    }

    /// Triangles at an edge, with the node opposite the edge, by triangle.
    pub(crate) fn edge_triangles(&self, edge: u32) -> &[(u32, u32)] {
        self.edge_triangles.of(edge)
    }

    /// Triangles at a node, ascending.
    pub(crate) fn node_triangles(&self, node: u32) -> &[u32] {
        self.node_triangles.of(node)
    }

    /// Nodes joined with a node by a surface edge.
    pub(crate) fn node_neighbours(&self, node: u32) -> &[u32] {
        self.node_neighbours.of(node)
    }

    /// Unit normal of a triangle at `positions`; zero for a degenerate one.
    pub(crate) fn triangle_normal(&self, triangle: u32, positions: &[Point]) -> DVec3 {
        let [a, b, c] = self.mesh.triangles()[triangle as usize]
            .map(|node| DVec3::from_array(positions[node as usize]));
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Sum of the unit normals at an edge.
    pub(crate) fn edge_normal(&self, edge: u32, positions: &[Point]) -> DVec3 {
        let triangles = self.edge_triangles(edge).iter();
        triangles.map(|&(triangle, _)| self.triangle_normal(triangle, positions)).sum()
    }

    /// Angle-weighted pseudonormal at a node, of unit length (Baerentzen and Aanaes 2005).
    pub(crate) fn node_normal(&self, node: u32, positions: &[Point]) -> DVec3 {
        let at = |node: u32| DVec3::from_array(positions[node as usize]);
        let mut sum = DVec3::ZERO;
        for &triangle in self.node_triangles(node) {
            let corners = self.mesh.triangles()[triangle as usize];
            let place = (0..3).find(|&k| corners[k] == node).expect("a triangle at the node");
            let along = at(corners[(place + 1) % 3]) - at(node);
            let back = at(corners[(place + 2) % 3]) - at(node);
            let normal = along.cross(back);
            let angle = normal.length().atan2(along.dot(back));
            sum += angle * normal.normalize_or_zero();
        }
        sum.normalize_or_zero()
    }
}
