//! Stage 2 of the paper: leaves of one body against the subtree of another, or of its own, then the
//! triangles of the leaf pairs found. In two passes over kept buffers, so that each has its own time.

use std::time::Instant;

use palpate_geometry::Aabb;
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::frame::Frame;
use crate::options::ProximityOptions;
use crate::proximity::Limit;
use crate::results::DetectionStats;

/// Leaves that one thread takes at a time.
const LEAVES_PER_TASK: usize = 256;

/// Two bodies to be searched, `a <= b`; the same body twice is self-contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyPair {
    pub(crate) a: u32,
    pub(crate) b: u32,
    /// Which elements are wanted; of no use where they must meet.
    pub(crate) limit: Limit,
    /// The limit's distance \[m\] widened by rounding: boxes further apart hold nothing wanted.
    pub(crate) margin: f64,
}

impl BodyPair {
    pub(crate) fn meeting(a: u32, b: u32) -> Self {
        Self {
            a,
            b,
            limit: Limit { distance: 0.0, options: ProximityOptions::default() },
            margin: 0.0,
        }
    }

    pub(crate) fn within(a: u32, b: u32, limit: Limit, scene_bounds: &Aabb) -> Self {
        let corners = scene_bounds.min.iter().chain(&scene_bounds.max);
        let largest = corners.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let rounding = if largest.is_finite() { 64.0 * f64::EPSILON * largest } else { 0.0 };
        // A finite cap keeps the empty box empty when it is widened.
        let margin = (limit.distance * (1.0 + 1e-9) + rounding).min(1e300);
        Self { a, b, limit, margin }
    }

    pub(crate) fn is_self(&self) -> bool {
        self.a == self.b
    }
}

/// Counts of the work done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cost {
    pub(crate) nodes_visited: u64,
    pub(crate) leaf_pairs: u64,
    pub(crate) box_tests: u64,
    pub(crate) polygon_tests: u64,
}

impl Cost {
    pub(crate) fn add_to(&self, stats: &mut DetectionStats) {
        stats.nodes_visited += self.nodes_visited;
        stats.leaf_pairs += self.leaf_pairs;
        stats.box_tests += self.box_tests;
        stats.polygon_tests += self.polygon_tests;
    }
}

/// Leaves of one body pair: a range of `LeafPairSearch::leaves`.
#[derive(Clone, Copy, Debug)]
struct Task {
    body_pair: u32,
    leaves: [u32; 2],
}

#[derive(Clone, Copy, Debug)]
struct LeafPair {
    body_pair: u32,
    leaf_a: u32,
    leaf_b: u32,
}

/// Buffers of one task; of all tasks when there is one thread.
#[derive(Debug)]
struct Worker<T> {
    tasks: [u32; 2],
    leaf_pairs: Vec<LeafPair>,
    found: Vec<T>,
    cost: Cost,
}

impl<T> Default for Worker<T> {
    fn default() -> Self {
        Self { tasks: [0; 2], leaf_pairs: Vec::new(), found: Vec::new(), cost: Cost::default() }
    }
}

/// The search for records of type T in the leaf pairs of the given body pairs.
#[derive(Debug)]
pub(crate) struct LeafPairSearch<T> {
    /// To be filled before `run`.
    pub(crate) body_pairs: Vec<BodyPair>,
    leaves: Vec<u32>,
    tasks: Vec<Task>,
    workers: Vec<Worker<T>>,
}

impl<T> Default for LeafPairSearch<T> {
    fn default() -> Self {
        let (body_pairs, leaves, tasks, workers) = Default::default();
        Self { body_pairs, leaves, tasks, workers }
    }
}

impl<T: Copy + Send> LeafPairSearch<T> {
    /// Traverses, calls `test` with the tree-order positions of each pair of triangles whose boxes come
    /// within the margin, and appends what it found to `found`, in an order that does not depend on the
    /// threads. With `same_leaf` also pairs of triangles of one leaf.
    pub(crate) fn run<F>(
        &mut self,
        frame: &Frame,
        same_leaf: bool,
        found: &mut Vec<T>,
        stats: &mut DetectionStats,
        test: F,
    ) where
        F: Fn(&BodyPair, [u32; 2], &mut Vec<T>, &mut Cost) + Sync,
    {
        let start = Instant::now();
        let Self { body_pairs, leaves, tasks, workers } = self;
        let mut cost = Cost::default();
        collect_tasks(frame, body_pairs, leaves, tasks, &mut cost);
        let worker_count = if frame.pool.is_some() { tasks.len() } else { 1 };
        workers.resize_with(workers.len().max(worker_count), Worker::default);
        let workers = &mut workers[..worker_count];
        for (index, worker) in workers.iter_mut().enumerate() {
            let one = [index as u32, index as u32 + 1];
            worker.tasks = if frame.pool.is_some() { one } else { [0, tasks.len() as u32] };
        }
        for_each(frame.pool, workers, |worker| {
            worker.leaf_pairs.clear();
            worker.cost = Cost::default();
            let [first, last] = worker.tasks;
            for task in &tasks[first as usize..last as usize] {
                let body_pair = &body_pairs[task.body_pair as usize];
                let [start, end] = task.leaves;
                for &leaf in &leaves[start as usize..end as usize] {
                    worker.traverse(frame, task.body_pair, body_pair, leaf, same_leaf);
                }
            }
            worker.cost.leaf_pairs = worker.leaf_pairs.len() as u64;
        });
        let traversed = Instant::now();
        for_each(frame.pool, workers, |worker| {
            worker.found.clear();
            let Worker { leaf_pairs, found, cost, .. } = worker;
            for leaf_pair in leaf_pairs.iter() {
                let body_pair = &body_pairs[leaf_pair.body_pair as usize];
                triangle_pairs(frame, body_pair, leaf_pair, cost, |triangles, cost| {
                    test(body_pair, triangles, found, cost);
                });
            }
        });
        for worker in workers.iter() {
            found.extend_from_slice(&worker.found);
            worker.cost.add_to(stats);
        }
        cost.add_to(stats);
        stats.object_pairs += body_pairs.len() as u64;
        stats.traversal_time += traversed - start;
        stats.polygon_time += traversed.elapsed();
    }
}

/// Cuts the leaves of body a that come near body b into tasks.
fn collect_tasks(
    frame: &Frame,
    body_pairs: &[BodyPair],
    leaves: &mut Vec<u32>,
    tasks: &mut Vec<Task>,
    cost: &mut Cost,
) {
    leaves.clear();
    tasks.clear();
    for (index, pair) in body_pairs.iter().enumerate() {
        let first = leaves.len();
        let tree_a = &frame.bodies[pair.a as usize].tree();
        let bounds_b = frame.bodies[pair.b as usize].tree().bounds();
        let near_b = widened(&bounds_b, pair.margin);
        cost.nodes_visited += tree_a.leaves_meeting(0, &near_b, |leaf| leaves.push(leaf));
        for start in (first..leaves.len()).step_by(LEAVES_PER_TASK) {
            let end = leaves.len().min(start + LEAVES_PER_TASK);
            let leaves = [start as u32, end as u32];
            tasks.push(Task { body_pair: index as u32, leaves });
        }
    }
}

impl<T> Worker<T> {
    /// Collects the leaves of body b that come near a leaf of body a; within one body those after it.
    fn traverse(
        &mut self,
        frame: &Frame,
        body_pair: u32,
        pair: &BodyPair,
        leaf_a: u32,
        same_leaf: bool,
    ) {
        let node = &frame.bodies[pair.a as usize].tree().nodes()[leaf_a as usize];
        let near_a = widened(&node.bounds, pair.margin);
        let start = if pair.is_self() { leaf_a + 1 } else { 0 };
        let [first, last] = node.triangles;
        if pair.is_self() && same_leaf && last - first > 1 {
            self.leaf_pairs.push(LeafPair { body_pair, leaf_a, leaf_b: leaf_a });
        }
        let tree_b = &frame.bodies[pair.b as usize].tree();
        let leaf_pairs = &mut self.leaf_pairs;
        self.cost.nodes_visited += tree_b.leaves_meeting(start, &near_a, |leaf_b| {
            leaf_pairs.push(LeafPair { body_pair, leaf_a, leaf_b });
        });
    }
}

/// Calls `found` with the pairs of triangles of two leaves whose boxes come within the margin; of one
/// leaf with itself, each unordered pair once.
#[inline]
fn triangle_pairs(
    frame: &Frame,
    pair: &BodyPair,
    leaves: &LeafPair,
    cost: &mut Cost,
    mut found: impl FnMut([u32; 2], &mut Cost),
) {
    let tree_a = &frame.bodies[pair.a as usize].tree();
    let tree_b = &frame.bodies[pair.b as usize].tree();
    let node_a = &tree_a.nodes()[leaves.leaf_a as usize];
    let node_b = &tree_b.nodes()[leaves.leaf_b as usize];
    let same_leaf = pair.is_self() && leaves.leaf_a == leaves.leaf_b;
    for i in node_a.triangles[0]..node_a.triangles[1] {
        let near = widened(tree_a.triangle_bounds(i), pair.margin);
        if !meets(&near, &node_b.bounds) {
            continue;
        }
        let first = if same_leaf { i + 1 } else { node_b.triangles[0] };
        for j in first..node_b.triangles[1] {
            cost.box_tests += 1;
            if meets(&near, tree_b.triangle_bounds(j)) {
                found([i, j], cost);
            }
        }
    }
}

/// `bounds` grown by `margin` on all sides. The margin of [`BodyPair::within`] is itself generous enough
/// for the rounding of this.
#[inline]
pub(crate) fn widened(bounds: &Aabb, margin: f64) -> Aabb {
    Aabb {
        min: bounds.min.map(|value| value - margin),
        max: bounds.max.map(|value| value + margin),
    }
}

/// [`Aabb::intersects`] without branches: in a traversal none of its comparisons can be predicted.
#[inline]
pub(crate) fn meets(a: &Aabb, b: &Aabb) -> bool {
    let mut meet = true;
    for axis in 0..3 {
        meet &= a.min[axis] <= b.max[axis];
        meet &= b.min[axis] <= a.max[axis];
    }
    meet
}

/// Runs `work` on each item, on the pool's threads if there is one.
pub(crate) fn for_each<T: Send>(
    pool: Option<&ThreadPool>,
    items: &mut [T],
    work: impl Fn(&mut T) + Sync,
) {
    match pool {
        Some(pool) => pool.install(|| items.par_iter_mut().for_each(&work)),
        None => items.iter_mut().for_each(work),
    }
}

/// Whether two triangles have a node in common; without branches, as [`meets`].
#[inline]
pub(crate) fn share_a_node(a: [u32; 3], b: [u32; 3]) -> bool {
    let mut shared = false;
    for node in a {
        for other in b {
            shared |= node == other;
        }
    }
    shared
}
