//! The wide layout's method: blocks of eight triangles against each other, level by level.

use std::ops::Range;
use std::time::{Duration, Instant};

use palpate_geometry::{Aabb, Point, triangles_intersect};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::{Detector, LimitOf};
use crate::frame::{Frame, SceneBody};
use crate::leaf_pairs::{BodyPair, Cost, for_each};
use crate::left_out::ElementPair;
use crate::memory::DetectionMemory;
use crate::neighbours::neighbours_meet;
use crate::options::IntersectionOptions;
use crate::pairs::{ProximityPair, TrianglePair};
use crate::proximity::{edge_pair, sort, vertex_triangle};
use crate::results::{DetectionStats, Intersections, Proximity};
use crate::simd::Isa;
use crate::wide::{
    CrossTriangles, EdgePairs, Reach, SeparateTriangles, Sides, Traversal, VertexPairs, WideBody,
    WideSurface, bytes,
};

/// Block pairs of the upper levels in a task.
const SEEDS_PER_TASK: usize = 64;

/// Pairs of neighbouring blocks in a task.
const NEIGHBOURS_PER_TASK: usize = 256;

/// Workers, each with its own buffers, per thread: several, since their work is not equal.
const WORKERS_PER_THREAD: usize = 8;

/// The bodies in the wide layout, and buffers.
#[derive(Debug)]
pub(super) struct Wide {
    isa: Isa,
    /// What the boxes are relative to \[m\].
    origin: Point,
    bodies: Vec<WideBody>,
    objects: Vec<(u32, u32)>,
    searches: Vec<ElementSearch>,
    splitting: Traversal,
    seeds: Vec<[u32; 2]>,
    tasks: Vec<Task>,
    meeting: Vec<Worker<TrianglePair>>,
    close: Vec<Worker<ProximityPair>>,
}

/// A body pair, and which of their elements.
#[derive(Clone, Copy, Debug)]
struct ElementSearch {
    pair: BodyPair,
    elements: Elements,
}

#[derive(Clone, Copy, Debug)]
enum Elements {
    Triangles,
    /// Triangles of one body that share nodes.
    Neighbours,
    Edges,
    /// Nodes of a and triangles of b.
    NodesOfA,
    /// Nodes of b and triangles of a.
    NodesOfB,
}

impl ElementSearch {
    /// The bodies in the order of the elements.
    fn bodies(&self) -> [u32; 2] {
        match self.elements {
            Elements::NodesOfB => [self.pair.b, self.pair.a],
            _ => [self.pair.a, self.pair.b],
        }
    }

    fn sides<'a>(&self, bodies: &'a [WideBody]) -> Sides<'a> {
        let [a, b] = self.bodies().map(|body| &bodies[body as usize]);
        match self.elements {
            Elements::Triangles | Elements::Neighbours => {
                a.triangles_and_triangles(b, self.pair.margin)
            }
            Elements::Edges => a.edges_and_edges(b, self.pair.margin),
            _ => a.points_and_triangles(b, self.pair.margin),
        }
    }
}

/// Part of a search.
#[derive(Clone, Copy, Debug)]
struct Task {
    search: u32,
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
    /// Of those, what a filter passed on.
    kept: Vec<[u32; 2]>,
    /// Of those, what certainly meets, and what is to be tested.
    crossing: Vec<[u32; 2]>,
    open: Vec<[u32; 2]>,
    found: Vec<T>,
    cost: Cost,
    /// Spent until the end of the traversal, and of all.
    times: [Duration; 2],
}

impl<T> Default for Worker<T> {
    fn default() -> Self {
        Self {
            tasks: [0; 2],
            traversal: Traversal::default(),
            candidates: Vec::new(),
            groups: Vec::new(),
            kept: Vec::new(),
            crossing: Vec::new(),
            open: Vec::new(),
            found: Vec::new(),
            cost: Cost::default(),
            times: [Duration::ZERO; 2],
        }
    }
}

impl<T> Worker<T> {
    fn bytes(&self) -> usize {
        let Self { traversal, candidates, groups, kept, crossing, open, found, .. } = self;
        let lists = bytes(candidates) + bytes(kept) + bytes(crossing) + bytes(open);
        traversal.bytes() + bytes(groups) + lists + bytes(found)
    }
}

/// The candidates of one task.
#[derive(Clone, Copy, Debug)]
struct Group {
    task: Task,
    end: usize,
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
            origin: [0.0; 3],
            bodies: Vec::new(),
            objects: Vec::new(),
            searches: Vec::new(),
            splitting: Traversal::default(),
            seeds: Vec::new(),
            tasks: Vec::new(),
            meeting: Vec::new(),
            close: Vec::new(),
        }
    }

    /// Cuts all searches into tasks: without threads one or two each, else of about
    /// [`SEEDS_PER_TASK`] or [`NEIGHBOURS_PER_TASK`] block pairs.
    fn split(&mut self, threads: bool, cost: &mut Cost) {
        self.seeds.clear();
        self.tasks.clear();
        let chunk = |size| if threads { size } else { usize::MAX };
        for (index, search) in self.searches.iter().enumerate() {
            let sides = search.sides(&self.bodies);
            let neighbours = matches!(search.elements, Elements::Neighbours);
            let search = index as u32;
            if !neighbours && let Some(mut level) = sides.top() {
                let traversal = &mut self.splitting;
                traversal.pairs.clear();
                traversal.pairs.push([0, 0]);
                while threads && level > 1 && traversal.pairs.len() < SEEDS_PER_TASK {
                    traversal.descend(self.isa, &sides, level, cost);
                    level -= 1;
                }
                let first = self.seeds.len();
                self.seeds.extend_from_slice(&traversal.pairs);
                for seeds in chunks(first..self.seeds.len(), chunk(SEEDS_PER_TASK)) {
                    self.tasks.push(Task { search, part: Part::Blocks { level, seeds } });
                }
            }
            for range in chunks(0..sides.adjacent_count(), chunk(NEIGHBOURS_PER_TASK)) {
                self.tasks.push(Task { search, part: Part::Adjacent(range) });
            }
        }
    }
}

fn chunks(range: Range<usize>, size: usize) -> impl Iterator<Item = [usize; 2]> {
    let count = range.len().div_ceil(size);
    let end = move |i: usize| range.end.min(range.start.saturating_add(i.saturating_mul(size)));
    (0..count).map(move |i| [end(i), end(i + 1)])
}

impl Detector for Wide {
    fn bodies_changed(&mut self, bodies: &[SceneBody]) {
        let mut former = std::mem::take(&mut self.bodies);
        for body in bodies {
            let same = former.iter().position(|packed| packed.is_of(&body.mesh));
            self.bodies.push(match same {
                Some(index) => former.swap_remove(index),
                None => WideBody::pack(&body.mesh, &body.positions),
            });
        }
    }

    fn is_packed(&self) -> bool {
        true
    }

    fn take_packed(&mut self, body: WideBody) {
        self.bodies.push(body);
    }

    fn uses_trees(&self) -> bool {
        false
    }

    fn bodies_moved(&mut self, bodies: &[SceneBody], pool: Option<&ThreadPool>) -> u64 {
        // Any point near the bodies: `f32` is fine there.
        let first = bodies.first().and_then(|body| body.positions.first());
        self.origin = first.copied().unwrap_or_default();
        let (isa, origin) = (self.isa, self.origin);
        let refit = |(packed, body): (&mut WideBody, &SceneBody)| {
            packed.refit(isa, &body.positions, origin);
        };
        if let Some(pool) = pool {
            pool.install(|| self.bodies.par_iter_mut().zip(bodies).for_each(refit));
        } else {
            self.bodies.iter_mut().zip(bodies).for_each(refit);
        }
        self.bodies.iter().map(|body| body.triangles.boxes.block_count()).sum()
    }

    fn memory(&self) -> DetectionMemory {
        let mut sum = DetectionMemory::default();
        self.bodies.iter().for_each(|body| body.add_memory(&mut sum));
        sum.buffers = bytes(&self.objects)
            + bytes(&self.searches)
            + self.splitting.bytes()
            + bytes(&self.seeds)
            + bytes(&self.tasks)
            + self.meeting.iter().map(Worker::bytes).sum::<usize>()
            + self.close.iter().map(Worker::bytes).sum::<usize>();
        sum
    }

    fn bounds(&self, body: usize) -> Option<Aabb> {
        let [min, max] = self.bodies[body].triangles.boxes.bounds()?;
        let shifted = |value: f32, axis: usize| f64::from(value) + self.origin[axis];
        // One step further out: the sum is rounded.
        Some(Aabb {
            min: std::array::from_fn(|axis| shifted(min[axis], axis).next_down()),
            max: std::array::from_fn(|axis| shifted(max[axis], axis).next_up()),
        })
    }

    fn wide_surface(&self, body: usize) -> Option<WideSurface<'_>> {
        Some(WideSurface { isa: self.isa, origin: self.origin, body: &self.bodies[body] })
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
        stats.nodes_visited += frame.object_pairs(options.self_contact, &mut self.objects);
        stats.object_pairs += self.objects.len() as u64;
        self.searches.clear();
        for &(a, b) in &self.objects {
            let pair = BodyPair::meeting(a, b);
            self.searches.push(ElementSearch { pair, elements: Elements::Triangles });
            if options.shared_nodes && a == b {
                self.searches.push(ElementSearch { pair, elements: Elements::Neighbours });
            }
        }
        stats.object_time = start.elapsed();
        let start = Instant::now();
        let mut cost = Cost::default();
        self.split(frame.pool.is_some(), &mut cost);
        let Self { isa, bodies, searches, seeds, tasks, meeting, .. } = self;
        let search = Search { isa: *isa, frame, bodies, searches, seeds, tasks };
        search.run(meeting, Search::meeting, &mut found.pairs, stats, start);
        let sorting = Instant::now();
        found.pairs.sort_unstable();
        cost.add_to(stats);
        stats.polygon_time += sorting.elapsed();
    }

    fn proximity(&mut self, frame: &Frame, limit_of: LimitOf, found: &mut Proximity) {
        let start = Instant::now();
        let stats = &mut found.stats;
        stats.all_pairs = frame.all_pairs(true);
        let scene_bounds = frame.upper.bounds();
        self.searches.clear();
        for a in 0..frame.bodies.len() {
            for b in a..frame.bodies.len() {
                if let Some(limit) = limit_of(a, b) {
                    let pair = BodyPair::within(a as u32, b as u32, limit, &scene_bounds);
                    stats.object_pairs += 1;
                    for elements in [Elements::Edges, Elements::NodesOfA, Elements::NodesOfB] {
                        if a != b || !matches!(elements, Elements::NodesOfB) {
                            self.searches.push(ElementSearch { pair, elements });
                        }
                    }
                }
            }
        }
        stats.object_time = start.elapsed();
        let start = Instant::now();
        let isa = self.isa;
        for_each(frame.pool, &mut self.bodies, |body| body.refit_features(isa));
        let mut cost = Cost::default();
        self.split(frame.pool.is_some(), &mut cost);
        let Self { isa, bodies, searches, seeds, tasks, close, .. } = self;
        let search = Search { isa: *isa, frame, bodies, searches, seeds, tasks };
        search.run(close, Search::close, &mut found.pairs, stats, start);
        let sorting = Instant::now();
        sort(&mut found.pairs);
        cost.add_to(stats);
        stats.polygon_time += sorting.elapsed();
    }
}

/// What the workers read.
struct Search<'a> {
    isa: Isa,
    frame: &'a Frame<'a>,
    bodies: &'a [WideBody],
    searches: &'a [ElementSearch],
    seeds: &'a [[u32; 2]],
    tasks: &'a [Task],
}

impl Search<'_> {
    /// Traverses and tests, and collects what was found. The wall time since `start` is shared out between
    /// the two stages as the workers spent it.
    fn run<T: Copy + Send>(
        &self,
        workers: &mut Vec<Worker<T>>,
        test: impl Fn(&Self, &mut Worker<T>) + Sync,
        found: &mut Vec<T>,
        stats: &mut DetectionStats,
        start: Instant,
    ) {
        let threads = self.frame.pool.map_or(1, ThreadPool::current_num_threads);
        let most = if threads > 1 { WORKERS_PER_THREAD * threads } else { 1 };
        let count = self.tasks.len().min(most);
        workers.resize_with(workers.len().max(count), Worker::default);
        let workers = &mut workers[..count];
        for (index, worker) in workers.iter_mut().enumerate() {
            worker.tasks = [index, index + 1].map(|end| end * self.tasks.len() / count);
        }
        for_each(self.frame.pool, workers, |worker| {
            let start = Instant::now();
            self.traverse(worker);
            worker.times[0] = start.elapsed();
            test(self, worker);
            worker.times[1] = start.elapsed();
        });
        let mut times = [Duration::ZERO; 2];
        for worker in workers.iter() {
            found.extend_from_slice(&worker.found);
            worker.cost.add_to(stats);
            times = [times[0] + worker.times[0], times[1] + worker.times[1]];
        }
        let wall = start.elapsed();
        let whole = times[1].as_secs_f64();
        let share = if whole > 0.0 { times[0].as_secs_f64() / whole } else { 1.0 };
        let traversal = wall.mul_f64(share.min(1.0));
        stats.traversal_time += traversal;
        stats.polygon_time += wall.saturating_sub(traversal);
    }

    /// Collects the slot pairs whose boxes meet.
    fn traverse<T>(&self, worker: &mut Worker<T>) {
        let Worker { tasks, traversal, candidates, groups, cost, .. } = worker;
        candidates.clear();
        groups.clear();
        *cost = Cost::default();
        for &task in &self.tasks[tasks[0]..tasks[1]] {
            let search = &self.searches[task.search as usize];
            let sides = search.sides(self.bodies);
            match task.part {
                Part::Blocks { level, seeds } => {
                    traversal.pairs.clear();
                    traversal.pairs.extend_from_slice(&self.seeds[seeds[0]..seeds[1]]);
                    for level in (1..=level).rev() {
                        traversal.descend(self.isa, &sides, level, cost);
                    }
                    traversal.collect(self.isa, &sides, candidates, cost);
                }
                Part::Adjacent([start, end]) => {
                    let sharing = matches!(search.elements, Elements::Neighbours);
                    let range = start..end;
                    traversal.collect_adjacent(self.isa, &sides, sharing, range, candidates, cost);
                }
            }
            groups.push(Group { task, end: candidates.len() });
        }
    }

    /// Tests the candidates for intersection.
    fn meeting(&self, worker: &mut Worker<TrianglePair>) {
        let Worker { candidates, groups, kept, crossing, open, found, cost, .. } = worker;
        found.clear();
        let mut start = 0;
        for group in groups.iter() {
            let search = &self.searches[group.task.search as usize];
            let pair = &search.pair;
            let (a, b) = (&self.bodies[pair.a as usize], &self.bodies[pair.b as usize]);
            let reach = Reach::new(a, b, 0.0);
            let candidates = &candidates[start..group.end];
            start = group.end;
            crossing.clear();
            open.clear();
            let neighbours = matches!(search.elements, Elements::Neighbours);
            if neighbours {
                open.extend_from_slice(candidates);
            } else {
                kept.clear();
                self.isa.run(SeparateTriangles { a, b, reach, candidates, kept });
                self.isa.run(CrossTriangles { a, b, reach, candidates: kept, crossing, open });
            }
            let (body_a, body_b) =
                (&self.frame.bodies[pair.a as usize], &self.frame.bodies[pair.b as usize]);
            let triangles = |&[slot_a, slot_b]: &[u32; 2]| {
                [a.triangles.element(slot_a), b.triangles.element(slot_b)]
            };
            let bodies = [pair.a, pair.b];
            if self.frame.may_leave_out(bodies) {
                let is_kept = |slots: &[u32; 2]| {
                    !self.frame.leaves_out(bodies, ElementPair::Triangles(triangles(slots)))
                };
                crossing.retain(is_kept);
                open.retain(is_kept);
            }
            cost.polygon_tests += (crossing.len() + open.len()) as u64;
            let meet = |slots: &&[u32; 2]| {
                let [triangle_a, triangle_b] = triangles(slots);
                if neighbours {
                    return neighbours_meet(body_a, [triangle_a, triangle_b]);
                }
                triangles_intersect(&body_a.triangle(triangle_a), &body_b.triangle(triangle_b))
            };
            found.extend(crossing.iter().chain(open.iter().filter(meet)).map(|slots| {
                let [mut triangle_a, mut triangle_b] = triangles(slots);
                if pair.is_self() && triangle_b < triangle_a {
                    std::mem::swap(&mut triangle_a, &mut triangle_b);
                }
                TrianglePair { body_a: pair.a, triangle_a, body_b: pair.b, triangle_b }
            }));
        }
    }

    /// Measures the distances of the candidates.
    fn close(&self, worker: &mut Worker<ProximityPair>) {
        let Worker { candidates, groups, kept, found, cost, .. } = worker;
        found.clear();
        let mut start = 0;
        for group in groups.iter() {
            let search = &self.searches[group.task.search as usize];
            let pair = &search.pair;
            let bodies = search.bodies();
            let [a, b] = bodies.map(|body| &self.bodies[body as usize]);
            let reach = Reach::new(a, b, pair.margin);
            let local = pair.limit.options.local_minima;
            let candidates = &candidates[start..group.end];
            start = group.end;
            kept.clear();
            if let Elements::Edges = search.elements {
                self.isa.run(EdgePairs { a, b, reach, local, candidates, kept });
                for &[slot_a, slot_b] in kept.iter() {
                    let (edge_a, edge_b) = (a.edges.element(slot_a), b.edges.element(slot_b));
                    let swapped = pair.is_self() && edge_b < edge_a;
                    let edges = if swapped { [edge_b, edge_a] } else { [edge_a, edge_b] };
                    found.extend(edge_pair(self.frame, bodies, edges, pair.limit));
                }
            } else {
                self.isa.run(VertexPairs { from: a, to: b, reach, local, candidates, kept });
                for &[point, slot] in kept.iter() {
                    let elements = [a.mesh_node(point), b.triangles.element(slot)];
                    found.extend(vertex_triangle(self.frame, bodies, elements, pair.limit));
                }
            }
            cost.polygon_tests += kept.len() as u64;
        }
    }
}
