//! The paper's method: bodies by the upper tree, leaves by the bounding trees, then the polygons.

use std::time::Instant;

use palpate_geometry::{Aabb, triangles_intersect};

use super::{Detector, LimitOf};
use crate::bounding_tree::corner_points;
use crate::frame::{Frame, SceneBody};
use crate::leaf_pairs::{BodyPair, Cost, LeafPairSearch, meets, share_a_node, widened};
use crate::left_out::ElementPair;
use crate::neighbours::neighbours_meet;
use crate::options::IntersectionOptions;
use crate::pairs::{ProximityPair, TrianglePair};
use crate::proximity::{edge_pair, sort, vertex_triangle};
use crate::results::{Intersections, Proximity};

/// Buffers of the paper's method.
#[derive(Debug, Default)]
pub(super) struct Paper {
    objects: Vec<(u32, u32)>,
    meeting: LeafPairSearch<TrianglePair>,
    close: LeafPairSearch<ProximityPair>,
}

impl Detector for Paper {
    fn intersections(
        &mut self,
        frame: &Frame,
        options: IntersectionOptions,
        found: &mut Intersections,
    ) {
        let start = Instant::now();
        let stats = &mut found.stats;
        stats.all_pairs = frame.all_pairs(options.self_contact);
        stats.nodes_visited += frame.object_pairs(options.self_contact, &mut self.objects);
        let body_pairs = &mut self.meeting.body_pairs;
        body_pairs.clear();
        body_pairs.extend(self.objects.iter().map(|&(a, b)| BodyPair::meeting(a, b)));
        stats.object_time = start.elapsed();
        self.meeting.run(
            frame,
            options.same_leaf,
            &mut found.pairs,
            stats,
            |pair, triangles, found, cost| {
                if !is_left_out(frame, pair, triangles) {
                    let shared_nodes = options.shared_nodes;
                    found.extend(meeting_triangles(frame, pair, triangles, shared_nodes, cost));
                }
            },
        );
        let sorting = Instant::now();
        found.pairs.sort_unstable();
        found.stats.polygon_time += sorting.elapsed();
    }

    fn proximity(&mut self, frame: &Frame, limit_of: LimitOf, found: &mut Proximity) {
        let start = Instant::now();
        let stats = &mut found.stats;
        stats.all_pairs = frame.all_pairs(true);
        let scene_bounds = frame.upper.bounds();
        let body_pairs = &mut self.close.body_pairs;
        body_pairs.clear();
        for (a, body_a) in frame.bodies.iter().enumerate() {
            for (b, body_b) in frame.bodies.iter().enumerate().skip(a) {
                let Some(limit) = limit_of(a, b) else {
                    continue;
                };
                let pair = BodyPair::within(a as u32, b as u32, limit, &scene_bounds);
                if widened(&body_a.tree().bounds(), pair.margin).intersects(&body_b.tree().bounds())
                {
                    body_pairs.push(pair);
                }
            }
        }
        stats.object_time = start.elapsed();
        self.close.run(frame, true, &mut found.pairs, stats, |pair, triangles, found, cost| {
            close_features(frame, pair, triangles, found, cost);
        });
        let sorting = Instant::now();
        sort(&mut found.pairs);
        found.stats.polygon_time += sorting.elapsed();
    }
}

/// Whether two triangles, given by their positions in the trees, are no pair.
#[inline]
fn is_left_out(frame: &Frame, pair: &BodyPair, [i, j]: [u32; 2]) -> bool {
    let bodies = [pair.a, pair.b];
    frame.may_leave_out(bodies) && {
        let triangle = |body: u32, position: u32| {
            frame.bodies[body as usize].tree().triangle_order()[position as usize]
        };
        let triangles = [triangle(pair.a, i), triangle(pair.b, j)];
        frame.leaves_out(bodies, ElementPair::Triangles(triangles))
    }
}

/// The exact test of two triangles, given by their positions in the trees; of triangles that share
/// nodes with `shared_nodes`.
fn meeting_triangles(
    frame: &Frame,
    pair: &BodyPair,
    [i, j]: [u32; 2],
    shared_nodes: bool,
    cost: &mut Cost,
) -> Option<TrianglePair> {
    let (a, b) = (&frame.bodies[pair.a as usize], &frame.bodies[pair.b as usize]);
    let (corners_a, corners_b) = (a.tree().corners(i), b.tree().corners(j));
    let neighbours = pair.is_self() && share_a_node(corners_a, corners_b);
    if neighbours && !shared_nodes {
        return None;
    }
    cost.polygon_tests += 1;
    let mut triangles =
        [a.tree().triangle_order()[i as usize], b.tree().triangle_order()[j as usize]];
    let meet = if neighbours {
        neighbours_meet(a, triangles)
    } else {
        let points_a = corner_points(&a.positions, corners_a);
        triangles_intersect(&points_a, &corner_points(&b.positions, corners_b))
    };
    if !meet {
        return None;
    }
    if pair.is_self() {
        triangles.sort_unstable();
    }
    let [triangle_a, triangle_b] = triangles;
    Some(TrianglePair { body_a: pair.a, triangle_a, body_b: pair.b, triangle_b })
}

/// One triangle of a pair, as its features need it.
struct Side<'a> {
    body: u32,
    scene_body: &'a SceneBody,
    position: u32,
    corners: [u32; 3],
    /// Owned nodes (bits 0 to 2) and edges (bits 3 to 5).
    owned: u8,
    bounds: &'a Aabb,
}

/// An edge of a triangle: its number there, its nodes, its box.
#[derive(Clone, Copy)]
struct Edge {
    side: usize,
    nodes: [u32; 2],
    bounds: Aabb,
}

impl<'a> Side<'a> {
    #[inline]
    fn new(bodies: &'a [SceneBody], body: u32, position: u32) -> Self {
        let scene_body = &bodies[body as usize];
        Self {
            body,
            scene_body,
            position,
            corners: scene_body.tree().corners(position),
            owned: scene_body.surface.owned[position as usize],
            bounds: scene_body.tree().triangle_bounds(position),
        }
    }

    fn triangle(&self) -> u32 {
        self.scene_body.tree().triangle_order()[self.position as usize]
    }

    fn edge_index(&self, edge: &Edge) -> u32 {
        self.scene_body.mesh.triangle_edges()[self.triangle() as usize][edge.side]
    }

    /// Puts the owned edges that come within `margin` of `other` into `edges` and returns them.
    #[inline]
    fn owned_edges<'e>(&self, other: &Aabb, margin: f64, edges: &'e mut [Edge; 3]) -> &'e [Edge] {
        let near = widened(other, margin);
        let mut count = 0;
        for side in (0..3).filter(|side| self.owned >> (3 + side) & 1 == 1) {
            let nodes = [self.corners[side], self.corners[(side + 1) % 3]];
            let [a, b] = nodes.map(|node| self.scene_body.positions[node as usize]);
            let bounds = Aabb {
                min: std::array::from_fn(|axis| a[axis].min(b[axis])),
                max: std::array::from_fn(|axis| a[axis].max(b[axis])),
            };
            if meets(&bounds, &near) {
                edges[count] = Edge { side, nodes, bounds };
                count += 1;
            }
        }
        &edges[..count]
    }
}

/// The close features of two triangles, of those that each of them owns.
fn close_features(
    frame: &Frame,
    pair: &BodyPair,
    [i, j]: [u32; 2],
    found: &mut Vec<ProximityPair>,
    cost: &mut Cost,
) {
    let a = Side::new(frame.bodies, pair.a, i);
    let b = Side::new(frame.bodies, pair.b, j);
    let margin_squared = pair.margin * pair.margin * (1.0 + 1e-9);
    for (from, to) in [(&a, &b), (&b, &a)] {
        for corner in (0..3).filter(|corner| from.owned >> corner & 1 == 1) {
            let node = from.corners[corner];
            let point = &from.scene_body.positions[node as usize];
            if pair.is_self() && to.corners.contains(&node)
                || to.bounds.distance_squared(point) > margin_squared
            {
                continue;
            }
            cost.polygon_tests += 1;
            let elements = [node, to.triangle()];
            found.extend(vertex_triangle(frame, [from.body, to.body], elements, pair.limit));
        }
    }
    if a.owned >> 3 == 0 || b.owned >> 3 == 0 {
        return;
    }
    let none = Edge { side: 0, nodes: [0; 2], bounds: Aabb::EMPTY };
    let (mut edges_a, mut edges_b) = ([none; 3], [none; 3]);
    let edges_a = a.owned_edges(b.bounds, pair.margin, &mut edges_a);
    if edges_a.is_empty() {
        return;
    }
    let edges_b = b.owned_edges(a.bounds, pair.margin, &mut edges_b);
    for edge_a in edges_a {
        let near_a = widened(&edge_a.bounds, pair.margin);
        for edge_b in edges_b {
            let shared = pair.is_self() && edge_a.nodes.iter().any(|n| edge_b.nodes.contains(n));
            if shared || !meets(&near_a, &edge_b.bounds) {
                continue;
            }
            cost.polygon_tests += 1;
            let mut edges = [a.edge_index(edge_a), b.edge_index(edge_b)];
            if pair.is_self() {
                edges.sort_unstable();
            }
            found.extend(edge_pair(frame, [pair.a, pair.b], edges, pair.limit));
        }
    }
}
