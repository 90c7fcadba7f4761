//! Surface nodes inside other bodies.
//!
//! Only crossing triangles change the side: a part of body a's surface that does not meet body b's is
//! wholly inside or wholly outside. So the crossing triangles are found first, the rest falls into
//! connected parts, and one node of each is located. Bodies that do not touch cost one point each.

use std::time::Instant;

use palpate_geometry::{Point, vec3};

use crate::bounding_tree::Side;
use crate::bounding_tree::corner_points;
use crate::leaf_pairs::{BodyPair, Cost, LeafPairSearch, for_each};
use crate::method::meeting_triangles;
use crate::pairs::{PenetratingNode, TrianglePair};
use crate::proximity::{any_normal, direction, size, triangle_normal, unit};
use crate::scene::{Frame, Penetration, SceneBody};
use crate::surface::join_nodes;

/// Not yet located.
const UNKNOWN: u8 = 0;
const INSIDE: u8 = 1;
const OUTSIDE: u8 = 2;

/// Buffers of the search.
#[derive(Debug, Default)]
pub(crate) struct PenetrationSearch {
    objects: Vec<(u32, u32)>,
    crossing: LeafPairSearch<TrianglePair>,
    crossing_pairs: Vec<TrianglePair>,
    directed: Vec<[u32; 2]>,
    workers: Vec<Worker>,
}

/// Buffers of one ordered body pair; of all when there is one thread.
#[derive(Debug, Default)]
struct Worker {
    directed: [u32; 2],
    crosses: Vec<bool>,
    parts: Vec<u32>,
    side_of_part: Vec<u8>,
    found: Vec<PenetratingNode>,
    cost: Cost,
}

impl PenetrationSearch {
    pub(crate) fn run(
        &mut self,
        frame: &Frame,
        include: &(dyn Fn(usize, usize) -> bool + Sync),
        found: &mut Penetration,
    ) {
        let start = Instant::now();
        found.stats.all_pairs = frame.all_pairs(false);
        self.objects.clear();
        self.directed.clear();
        self.crossing.body_pairs.clear();
        found.stats.nodes_visited += frame.upper.pairs(&mut self.objects);
        for &(a, b) in &self.objects {
            let before = self.directed.len();
            for [body, into] in [[a, b], [b, a]] {
                let closed = frame.bodies[into as usize].surface.closed;
                if closed && include(body as usize, into as usize) {
                    self.directed.push([body, into]);
                }
            }
            if self.directed.len() > before {
                self.crossing.body_pairs.push(BodyPair::meeting(a, b));
            }
        }
        found.stats.object_time = start.elapsed();

        self.crossing_pairs.clear();
        self.crossing.run(
            frame,
            false,
            &mut self.crossing_pairs,
            &mut found.stats,
            |pair, triangles, found, cost| {
                found.extend(meeting_triangles(frame, pair, triangles, false, cost));
            },
        );

        let locating = Instant::now();
        self.crossing_pairs.sort_unstable_by_key(|pair| (pair.body_a, pair.body_b));
        self.locate_all(frame, found);
        found.nodes.sort_unstable_by_key(|node| (node.body, node.node, node.into_body));
        found.stats.polygon_time += locating.elapsed();
    }

    fn locate_all(&mut self, frame: &Frame, found: &mut Penetration) {
        let Self { crossing_pairs, directed, workers, .. } = self;
        let threaded = frame.pool.is_some();
        let worker_count = if threaded { directed.len() } else { 1 };
        workers.resize_with(workers.len().max(worker_count), Worker::default);
        let workers = &mut workers[..worker_count];
        for (index, worker) in workers.iter_mut().enumerate() {
            let one = [index as u32, index as u32 + 1];
            worker.directed = if threaded { one } else { [0, directed.len() as u32] };
        }
        for_each(frame.pool, workers, |worker| {
            worker.found.clear();
            worker.cost = Cost::default();
            let [first, last] = worker.directed;
            for &[body, into] in &directed[first as usize..last as usize] {
                let key = (body.min(into), body.max(into));
                let of_pair = |pair: &TrianglePair| (pair.body_a, pair.body_b);
                let start = crossing_pairs.partition_point(|pair| of_pair(pair) < key);
                let end = crossing_pairs.partition_point(|pair| of_pair(pair) <= key);
                worker.locate(frame.bodies, [body, into], &crossing_pairs[start..end]);
            }
        });
        for worker in workers.iter() {
            found.nodes.extend_from_slice(&worker.found);
            worker.cost.add_to(&mut found.stats);
        }
    }
}

impl Worker {
    /// Finds the nodes of `body` inside `into`, given the pairs of triangles where the two cross.
    fn locate(&mut self, bodies: &[SceneBody], [body, into]: [u32; 2], crossing: &[TrianglePair]) {
        let (a, b) = (&bodies[body as usize], &bodies[into as usize]);
        let parts = if crossing.is_empty() {
            &a.surface.components
        } else {
            self.crosses.clear();
            self.crosses.resize(a.mesh.triangles().len(), false);
            for pair in crossing {
                let triangle = if pair.body_a == body { pair.triangle_a } else { pair.triangle_b };
                self.crosses[triangle as usize] = true;
            }
            join_nodes(&a.mesh, &mut self.parts, |triangle| !self.crosses[triangle as usize]);
            &self.parts
        };
        self.side_of_part.clear();
        self.side_of_part.resize(a.mesh.nodes().len(), UNKNOWN);
        for &node in a.mesh.surface_nodes() {
            let point = a.positions[node as usize];
            let side = &mut self.side_of_part[parts[node as usize] as usize];
            if *side == UNKNOWN {
                self.cost.polygon_tests += 1;
                *side = if b.is_inside(&point) { INSIDE } else { OUTSIDE };
            }
            if *side == INSIDE {
                self.found.extend(way_out(b, [body, into], node, point));
            }
        }
    }
}

impl SceneBody {
    /// Whether `point` is strictly inside; never for an open surface.
    pub(crate) fn is_inside(&self, point: &Point) -> bool {
        self.surface.closed && self.tree().side(&self.positions, point) == Side::Inside
    }
}

/// The record of a node inside body `b`; `None` when the exit is where the node is.
fn way_out(
    b: &SceneBody,
    [body, into_body]: [u32; 2],
    node: u32,
    point: Point,
) -> Option<PenetratingNode> {
    let exit = b.tree().closest_point(&b.positions, point, f64::INFINITY)?;
    let depth = exit.distance_squared.sqrt();
    if depth == 0.0 {
        return None;
    }
    let corners = corner_points(&b.positions, b.mesh.triangles()[exit.triangle as usize]);
    let mut offset = [0.0; 3];
    for (weight, corner) in exit.weights.into_iter().zip(corners) {
        offset = vec3::add_scaled(offset, vec3::sub(corner, point), weight);
    }
    Some(PenetratingNode {
        body,
        node,
        into_body,
        triangle: exit.triangle,
        weights: exit.weights,
        direction: direction(offset, depth, size(&corners))
            .or_else(|| unit(triangle_normal(&corners)))
            .unwrap_or_else(|| any_normal(vec3::sub(corners[1], corners[0]))),
        depth,
    })
}
