//! What is done with a library's candidates: exact intersection, or distances of features.

use palpate_geometry::{edge_edge, point_triangle, triangles_intersect};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::intersection_test;
use parry3d_f64::shape;

use crate::scene::{Frame, Pair, Point, Scene};

/// Kind (0 vertex and triangle, 1 two edges) and stacked nodes; a triangle's, an edge's and the edges
/// themselves in rising order.
pub type Close = [u32; 5];

/// How a pair of triangles is decided.
#[derive(Clone, Copy)]
pub enum Test {
    /// Exactly, by the same test as palpate's.
    Exact,
    /// By parry's own test of two triangles.
    Gjk,
}

impl Test {
    pub fn meet(self, scene: &Scene, frame: &Frame, [body_a, a, body_b, b]: Pair) -> bool {
        let (p, q) = (scene.corners(frame, body_a, a), scene.corners(frame, body_b, b));
        match self {
            Self::Exact => triangles_intersect(&p, &q),
            Self::Gjk => {
                let [p, q] = [p, q].map(|corners| {
                    let [a, b, c] = corners.map(Vector::from);
                    shape::Triangle::new(a, b, c)
                });
                intersection_test(&Pose::IDENTITY, &p, &Pose::IDENTITY, &q)
                    .is_ok_and(|found| found.intersecting)
            }
        }
    }
}

/// Which corners and sides a triangle answers for, so that no pair of features is tested twice
/// (representative triangles, Curtis et al. 2008).
pub struct Features {
    /// By body and triangle: a bit for each corner, three for each side, the one from corner i to i + 1.
    owned: Vec<Vec<u8>>,
    first_node: Vec<u32>,
}

impl Features {
    pub fn new(scene: &Scene) -> Self {
        let owned = scene.triangles.iter().map(|triangles| {
            let mut nodes = std::collections::HashSet::new();
            let mut edges = std::collections::HashSet::new();
            let owned = |triangle: &[u32; 3]| {
                (0..3).fold(0, |bits, i| {
                    let [a, b] = [triangle[i], triangle[(i + 1) % 3]];
                    let node = u8::from(nodes.insert(a));
                    let edge = u8::from(edges.insert([a.min(b), a.max(b)]));
                    bits | node << i | edge << (i + 3)
                })
            };
            triangles.iter().map(owned).collect()
        });
        let owned = owned.collect();
        let mut next = 0;
        let first_node = scene.frames[0].iter().map(|nodes| {
            next += nodes.len() as u32;
            next - nodes.len() as u32
        });
        Self { owned, first_node: first_node.collect() }
    }

    /// Appends the features of two triangles that are closer than `distance` and share no node.
    pub fn close(
        &self,
        scene: &Scene,
        frame: &Frame,
        pair: Pair,
        distance: f64,
        found: &mut Vec<Close>,
    ) {
        let [a, b] = [&pair[..2], &pair[2..]].map(|side| self.side(scene, frame, side));
        for (nodes_of, triangle_of) in [(&a, &b), (&b, &a)] {
            if nodes_of.owned & 7 == 0 {
                continue;
            }
            let [lower, upper] = bounds(&triangle_of.corners);
            for i in (0..3).filter(|i| nodes_of.owned >> i & 1 == 1) {
                let (node, point) = (nodes_of.nodes[i], nodes_of.corners[i]);
                if !triangle_of.nodes.contains(&node)
                    && !apart(point, point, lower, upper, distance)
                    && point_triangle(point, &triangle_of.corners).distance_squared.sqrt()
                        < distance
                {
                    let mut nodes = triangle_of.nodes;
                    nodes.sort_unstable();
                    found.push([0, node, nodes[0], nodes[1], nodes[2]]);
                }
            }
        }
        if a.owned >> 3 == 0 || b.owned >> 3 == 0 {
            return;
        }
        let edges_b = b.edges();
        for edge_a in a.edges().iter().flatten() {
            let [lower_a, upper_a] = edge_a.bounds;
            for edge_b in edges_b.iter().flatten() {
                let [lower_b, upper_b] = edge_b.bounds;
                if !edge_a.nodes.iter().any(|node| edge_b.nodes.contains(node))
                    && !apart(lower_a, upper_a, lower_b, upper_b, distance)
                    && edge_edge(&edge_a.points, &edge_b.points).distance_squared.sqrt() < distance
                {
                    let [first, second] =
                        [edge_a.nodes.min(edge_b.nodes), edge_a.nodes.max(edge_b.nodes)];
                    found.push([1, first[0], first[1], second[0], second[1]]);
                }
            }
        }
    }

    fn side(&self, scene: &Scene, frame: &Frame, side: &[u32]) -> Side {
        let [body, triangle] = [side[0] as usize, side[1] as usize];
        Side {
            nodes: scene.triangles[body][triangle].map(|node| node + self.first_node[body]),
            corners: scene.corners(frame, side[0], side[1]),
            owned: self.owned[body][triangle],
        }
    }
}

/// One triangle of a pair; nodes are stacked.
struct Side {
    nodes: [u32; 3],
    corners: [Point; 3],
    owned: u8,
}

struct Edge {
    nodes: [u32; 2],
    points: [Point; 2],
    bounds: [Point; 2],
}

impl Side {
    /// The sides that this triangle answers for, each from its lower node.
    fn edges(&self) -> [Option<Edge>; 3] {
        std::array::from_fn(|i| {
            let j = (i + 1) % 3;
            let [first, second] = if self.nodes[i] < self.nodes[j] { [i, j] } else { [j, i] };
            let points = [self.corners[first], self.corners[second]];
            (self.owned >> (i + 3) & 1 == 1).then(|| Edge {
                nodes: [self.nodes[first], self.nodes[second]],
                points,
                bounds: bounds(&points),
            })
        })
    }
}

fn bounds(points: &[Point]) -> [Point; 2] {
    let each = |of: fn(f64, f64) -> f64, start: f64| {
        points.iter().fold([start; 3], |bound, point| {
            std::array::from_fn(|axis| of(bound[axis], point[axis]))
        })
    };
    [each(f64::min, f64::INFINITY), each(f64::max, f64::NEG_INFINITY)]
}

fn apart(lower_a: Point, upper_a: Point, lower_b: Point, upper_b: Point, distance: f64) -> bool {
    (0..3).any(|axis| {
        lower_a[axis] - upper_b[axis] > distance || lower_b[axis] - upper_a[axis] > distance
    })
}
