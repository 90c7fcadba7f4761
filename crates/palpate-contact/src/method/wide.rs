//! The wide layout's method: blocks of eight triangles against each other, level by level.

use std::time::Instant;

use palpate_geometry::{Point, triangles_intersect};

use super::{Detector, DistanceOf};
use crate::leaf_pairs::{BodyPair, Cost, for_each};
use crate::pairs::{ProximityPair, TrianglePair};
use crate::proximity::{edge_pair, sort, vertex_triangle};
use crate::scene::{Frame, IntersectionOptions, Intersections, Proximity, SceneBody};
use crate::simd::Isa;
use crate::wide::{
    EdgePairs, Reach, SeparateTriangles, Sides, Traversal, VertexPairs, WideBody, bits, owned_pairs,
};

/// Block pairs, and pairs of neighbouring blocks, that one thread takes at a time.
const PAIRS_PER_TASK: usize = 64;

/// The bodies in the wide layout, and buffers.
#[derive(Debug)]
pub(super) struct Wide {
    isa: Isa,
    bodies: Vec<WideBody>,
    objects: Vec<(u32, u32)>,
    body_pairs: Vec<BodyPair>,
    splitting: Traversal,
    seeds: Vec<[u32; 2]>,
    tasks: Vec<Task>,
    meeting: Vec<Worker<TrianglePair>>,
    close: Vec<Worker<ProximityPair>>,
}

/// Part of the search for one body pair.
#[derive(Clone, Copy, Debug)]
struct Task {
    body_pair: u32,
    part: Part,
}

#[derive(Clone, Copy, Debug)]
enum Part {
    /// Block pairs of a level, a range of the seeds.
    Blocks { level: usize, seeds: [usize; 2] },
    /// A range of the pairs of neighbouring blocks.
    Adjacent([usize; 2]),
}

/// Buffers of some of the tasks; of all when there is one thread.
#[derive(Debug)]
struct Worker<T> {
    tasks: [usize; 2],
    traversal: Traversal,
    /// Slot pairs whose boxes meet.
    candidates: Vec<[u32; 2]>,
    groups: Vec<Group>,
    kept: Vec<[u32; 2]>,
    features: Features,
    found: Vec<T>,
    cost: Cost,
}

impl<T> Default for Worker<T> {
    fn default() -> Self {
        Self {
            tasks: [0; 2],
            traversal: Traversal::default(),
            candidates: Vec::new(),
            groups: Vec::new(),
            kept: Vec::new(),
            features: Features::default(),
            found: Vec::new(),
            cost: Cost::default(),
        }
    }
}

/// The candidates of one task.
#[derive(Clone, Copy, Debug)]
struct Group {
    task: Task,
    end: usize,
}

/// Candidate pairs of features: nodes of a against triangles of b, of b against a, and edges.
#[derive(Debug, Default)]
struct Features {
    nodes_of_a: Vec<[u32; 2]>,
    nodes_of_b: Vec<[u32; 2]>,
    edges: Vec<[u32; 2]>,
}

impl Default for Wide {
    fn default() -> Self {
        Self::new(Isa::detect())
    }
}

impl Wide {
    pub(super) fn new(isa: Isa) -> Self {
        Self {
            isa,
            bodies: Vec::new(),
            objects: Vec::new(),
            body_pairs: Vec::new(),
            splitting: Traversal::default(),
            seeds: Vec::new(),
            tasks: Vec::new(),
            meeting: Vec::new(),
            close: Vec::new(),
        }
    }

    /// Cuts the work for all body pairs into tasks: whole body pairs without threads, else about
    /// [`PAIRS_PER_TASK`] block pairs each.
    fn split(&mut self, threads: bool, cost: &mut Cost) {
        self.seeds.clear();
        self.tasks.clear();
        let chunk = if threads { PAIRS_PER_TASK } else { usize::MAX };
        for (index, pair) in self.body_pairs.iter().enumerate() {
            let sides = sides(self.isa, &self.bodies, pair);
            if sides.a.depth() == 0 || sides.b.depth() == 0 {
                continue;
            }
            let body_pair = index as u32;
            let mut level = sides.top();
            if !sides.is_self || level > 0 {
                let traversal = &mut self.splitting;
                traversal.pairs.clear();
                traversal.pairs.push([0, 0]);
                while threads && level > 1 && traversal.pairs.len() < PAIRS_PER_TASK {
                    traversal.descend(&sides, level, cost);
                    level -= 1;
                }
                let first = self.seeds.len();
                self.seeds.extend_from_slice(&traversal.pairs);
                for start in (first..self.seeds.len()).step_by(chunk.min(self.seeds.len().max(1))) {
                    let seeds = [start, self.seeds.len().min(start.saturating_add(chunk))];
                    self.tasks.push(Task { body_pair, part: Part::Blocks { level, seeds } });
                }
            }
            if sides.is_self {
                let count = sides.a.adjacency().pairs.len();
                for start in (0..count).step_by(chunk.min(count.max(1))) {
                    let end = count.min(start.saturating_add(chunk));
                    self.tasks.push(Task { body_pair, part: Part::Adjacent([start, end]) });
                }
            }
        }
    }
}

fn sides<'a>(isa: Isa, bodies: &'a [WideBody], pair: &BodyPair) -> Sides<'a> {
    let (a, b) = (&bodies[pair.a as usize], &bodies[pair.b as usize]);
    Sides { isa, a, b, is_self: pair.is_self(), margin: pair.margin }
}

impl Detector for Wide {
    fn bodies_changed(&mut self, bodies: &[SceneBody]) {
        let mut former = std::mem::take(&mut self.bodies);
        for body in bodies {
            let same = former.iter().position(|packed| packed.is_of(&body.mesh));
            self.bodies.push(match same {
                Some(index) => former.swap_remove(index),
                None => WideBody::pack(&body.mesh),
            });
        }
    }

    fn bodies_moved(&mut self, frame: &Frame) {
        // Any point near the bodies: `f32` is fine there.
        let first = frame.bodies.first().and_then(|body| body.positions.first());
        let origin: Point = first.copied().unwrap_or_default();
        let isa = self.isa;
        let refit =
            |body: &mut WideBody, moved: &SceneBody| body.refit(isa, &moved.positions, origin);
        if let Some(pool) = frame.pool {
            use rayon::prelude::*;
            let bodies = self.bodies.par_iter_mut().zip(frame.bodies);
            pool.install(|| bodies.for_each(|(body, moved)| refit(body, moved)));
        } else {
            for (body, moved) in self.bodies.iter_mut().zip(frame.bodies) {
                refit(body, moved);
            }
        }
    }

    fn intersections(
        &mut self,
        frame: &Frame,
        options: IntersectionOptions,
        found: &mut Intersections,
    ) {
        let start = Instant::now();
        let stats = &mut found.stats;
        stats.all_pairs = frame.all_pairs(options.self_contact);
        self.objects.clear();
        stats.nodes_visited += frame.upper.pairs(&mut self.objects);
        self.body_pairs.clear();
        self.body_pairs.extend(self.objects.iter().map(|&(a, b)| BodyPair::meeting(a, b)));
        if options.self_contact {
            let bodies = 0..frame.bodies.len() as u32;
            self.body_pairs.extend(bodies.map(|body| BodyPair::meeting(body, body)));
        }
        stats.object_pairs += self.body_pairs.len() as u64;
        stats.object_time = start.elapsed();
        let start = Instant::now();
        let mut cost = Cost::default();
        self.split(frame.pool.is_some(), &mut cost);
        let Self { isa, bodies, body_pairs, seeds, tasks, meeting, .. } = self;
        let search = Search { isa: *isa, frame, bodies, body_pairs, seeds, tasks };
        let workers = search.workers(meeting);
        for_each(frame.pool, workers, |worker| search.traverse(worker));
        let traversed = Instant::now();
        for_each(frame.pool, workers, |worker| search.meeting(worker));
        for worker in workers.iter() {
            found.pairs.extend_from_slice(&worker.found);
            worker.cost.add_to(stats);
        }
        cost.add_to(stats);
        found.pairs.sort_unstable();
        stats.traversal_time += traversed - start;
        stats.polygon_time += traversed.elapsed();
    }

    fn proximity(&mut self, frame: &Frame, distance: DistanceOf, found: &mut Proximity) {
        let start = Instant::now();
        let stats = &mut found.stats;
        stats.all_pairs = frame.all_pairs(true);
        let scene_bounds = frame.upper.bounds();
        self.body_pairs.clear();
        for a in 0..frame.bodies.len() {
            for b in a..frame.bodies.len() {
                if let Some(distance) = distance(a, b).filter(|&distance| distance > 0.0) {
                    let pair = BodyPair::within(a as u32, b as u32, distance, &scene_bounds);
                    self.body_pairs.push(pair);
                }
            }
        }
        stats.object_pairs += self.body_pairs.len() as u64;
        stats.object_time = start.elapsed();
        let start = Instant::now();
        let mut cost = Cost::default();
        self.split(frame.pool.is_some(), &mut cost);
        let Self { isa, bodies, body_pairs, seeds, tasks, close, .. } = self;
        let search = Search { isa: *isa, frame, bodies, body_pairs, seeds, tasks };
        let workers = search.workers(close);
        for_each(frame.pool, workers, |worker| search.traverse(worker));
        let traversed = Instant::now();
        for_each(frame.pool, workers, |worker| search.close(worker));
        for worker in workers.iter() {
            found.pairs.extend_from_slice(&worker.found);
            worker.cost.add_to(stats);
        }
        cost.add_to(stats);
        sort(&mut found.pairs);
        stats.traversal_time += traversed - start;
        stats.polygon_time += traversed.elapsed();
    }
}

/// What the workers read.
struct Search<'a> {
    isa: Isa,
    frame: &'a Frame<'a>,
    bodies: &'a [WideBody],
    body_pairs: &'a [BodyPair],
    seeds: &'a [[u32; 2]],
    tasks: &'a [Task],
}

impl Search<'_> {
    /// One worker per task when there are threads, else one for all.
    fn workers<'w, T>(&self, workers: &'w mut Vec<Worker<T>>) -> &'w mut [Worker<T>] {
        let threads = self.frame.pool.is_some();
        let count = if threads { self.tasks.len() } else { 1 };
        workers.resize_with(workers.len().max(count), Worker::default);
        let workers = &mut workers[..count];
        for (index, worker) in workers.iter_mut().enumerate() {
            worker.tasks = if threads { [index, index + 1] } else { [0, self.tasks.len()] };
        }
        workers
    }

    /// Collects the slot pairs whose boxes meet.
    fn traverse<T>(&self, worker: &mut Worker<T>) {
        let Worker { tasks, traversal, candidates, groups, cost, .. } = worker;
        candidates.clear();
        groups.clear();
        *cost = Cost::default();
        for &task in &self.tasks[tasks[0]..tasks[1]] {
            let sides = sides(self.isa, self.bodies, &self.body_pairs[task.body_pair as usize]);
            match task.part {
                Part::Blocks { level, seeds } => {
                    traversal.pairs.clear();
                    traversal.pairs.extend_from_slice(&self.seeds[seeds[0]..seeds[1]]);
                    for level in (1..=level).rev() {
                        traversal.descend(&sides, level, cost);
                    }
                    traversal.collect(&sides, candidates, cost);
                }
                Part::Adjacent([start, end]) => {
                    traversal.collect_adjacent(&sides, start..end, candidates, cost);
                }
            }
            groups.push(Group { task, end: candidates.len() });
        }
    }

    /// Tests the candidates for intersection.
    fn meeting(&self, worker: &mut Worker<TrianglePair>) {
        let Worker { candidates, groups, kept, found, cost, .. } = worker;
        found.clear();
        let mut start = 0;
        for group in groups.iter() {
            let pair = &self.body_pairs[group.task.body_pair as usize];
            let (a, b) = (&self.bodies[pair.a as usize], &self.bodies[pair.b as usize]);
            let reach = Reach::new(a, b, 0.0);
            kept.clear();
            let candidates = &candidates[start..group.end];
            self.isa.run(SeparateTriangles { a, b, reach, candidates, kept });
            start = group.end;
            cost.polygon_tests += kept.len() as u64;
            let (body_a, body_b) =
                (&self.frame.bodies[pair.a as usize], &self.frame.bodies[pair.b as usize]);
            for &[slot_a, slot_b] in kept.iter() {
                let (mut triangle_a, mut triangle_b) = (a.triangle(slot_a), b.triangle(slot_b));
                let points = (body_a.triangle(triangle_a), body_b.triangle(triangle_b));
                if triangles_intersect(&points.0, &points.1) {
                    if pair.is_self() && triangle_b < triangle_a {
                        std::mem::swap(&mut triangle_a, &mut triangle_b);
                    }
                    let (body_a, body_b) = (pair.a, pair.b);
                    found.push(TrianglePair { body_a, triangle_a, body_b, triangle_b });
                }
            }
        }
    }

    /// Measures the features of the candidates, and of neighbours.
    fn close(&self, worker: &mut Worker<ProximityPair>) {
        let Worker { candidates, groups, kept, features, found, cost, .. } = worker;
        found.clear();
        let mut start = 0;
        for group in groups.iter() {
            let pair = &self.body_pairs[group.task.body_pair as usize];
            let (a, b) = (&self.bodies[pair.a as usize], &self.bodies[pair.b as usize]);
            let reach = Reach::new(a, b, pair.margin);
            kept.clear();
            let candidates = &candidates[start..group.end];
            self.isa.run(SeparateTriangles { a, b, reach, candidates, kept });
            start = group.end;
            features.clear();
            for &slots in kept.iter() {
                let [owned_a, owned_b] = [a.owned(slots[0]), b.owned(slots[1])];
                features.add(a, b, slots, owned_pairs(owned_a, owned_b));
            }
            if let Part::Adjacent([start, end]) = group.task.part {
                features.add_neighbours(a, start..end);
            }
            self.measure(pair, reach, features, kept, found, cost);
        }
    }

    fn measure(
        &self,
        pair: &BodyPair,
        reach: Reach,
        features: &Features,
        kept: &mut Vec<[u32; 2]>,
        found: &mut Vec<ProximityPair>,
        cost: &mut Cost,
    ) {
        let scene = self.frame.bodies;
        let (a, b) = (&self.bodies[pair.a as usize], &self.bodies[pair.b as usize]);
        let directions = [
            (&features.nodes_of_a, a, b, [pair.a, pair.b]),
            (&features.nodes_of_b, b, a, [pair.b, pair.a]),
        ];
        for (candidates, from, to, bodies) in directions {
            kept.clear();
            self.isa.run(VertexPairs { from, to, reach, candidates, kept });
            cost.polygon_tests += kept.len() as u64;
            for &[node, slot] in kept.iter() {
                let elements = [from.mesh_node(node), to.triangle(slot)];
                found.extend(vertex_triangle(scene, bodies, elements, pair.distance));
            }
        }
        kept.clear();
        let candidates = &features.edges;
        self.isa.run(EdgePairs { a, b, reach, candidates, kept });
        cost.polygon_tests += kept.len() as u64;
        for &[edge_a, edge_b] in kept.iter() {
            let edge = |body: &WideBody, scene: &SceneBody, edge: u32| {
                let triangle = body.triangle(edge / 4);
                scene.mesh.triangle_edges()[triangle as usize][edge as usize % 4]
            };
            let edge_a = edge(a, &scene[pair.a as usize], edge_a);
            let edge_b = edge(b, &scene[pair.b as usize], edge_b);
            let swapped = pair.is_self() && edge_b < edge_a;
            let edges = if swapped { [edge_b, edge_a] } else { [edge_a, edge_b] };
            found.extend(edge_pair(scene, [pair.a, pair.b], edges, pair.distance));
        }
    }
}

impl Features {
    fn clear(&mut self) {
        self.nodes_of_a.clear();
        self.nodes_of_b.clear();
        self.edges.clear();
    }

    /// The feature pairs of `mask` of two slots.
    #[inline]
    fn add(&mut self, a: &WideBody, b: &WideBody, [slot_a, slot_b]: [u32; 2], mask: u16) {
        for bit in bits(u64::from(mask)) {
            match bit {
                0..3 => self.nodes_of_a.push([a.slots()[slot_a as usize][bit], slot_b]),
                3..6 => self.nodes_of_b.push([b.slots()[slot_b as usize][bit - 3], slot_a]),
                _ => {
                    let (i, j) = ((bit - 6) / 3, (bit - 6) % 3);
                    self.edges.push([4 * slot_a + i as u32, 4 * slot_b + j as u32]);
                }
            }
        }
    }

    /// The feature pairs of triangles that share a node, of a range of neighbouring blocks.
    fn add_neighbours(&mut self, body: &WideBody, range: std::ops::Range<usize>) {
        let adjacency = body.adjacency();
        for index in range {
            let [a, b] = adjacency.pairs[index].map(|block| 8 * block);
            let masks = &adjacency.features[adjacency.first_feature[index] as usize..];
            for (bit, &mask) in bits(adjacency.sharing[index]).zip(masks) {
                self.add(body, body, [a + bit as u32 / 8, b + bit as u32 % 8], mask);
            }
        }
    }
}
