//! Surface nodes inside other bodies, and inside their own after folding, with their way out.
//!
//! Two bodies that cross bound the volume that they share by two patches, one of each surface: the
//! triangles that cross or are inside. A node of one patch leaves through the other, where that faces
//! it. So the exits of a patch do not flip to the far side of a thin body, which the closest point of the
//! whole surface does, and no direction is guessed from where edges happen to cross, as in Heidelberger
//! et al. 2004 (Consistent penetration depth estimation), whose aim this shares: edges of a flat surface
//! pressed against a plate only cross the plate's rim, and their normals point sideways.

mod exit;
mod inside;

use std::time::Instant;

use palpate_geometry::Aabb;

use crate::frame::Frame;
use crate::leaf_pairs::{Cost, for_each};
use crate::method::Detector;
use crate::nearest::Surfaces;
use crate::options::IntersectionOptions;
use crate::pairs::{PenetratingNode, TrianglePair};
use crate::results::{DetectionStats, Intersections, Penetration};
use exit::Exits;
use inside::Inside;

/// Asked for (body, `into_body`), a body with itself included.
pub(crate) type Include<'a> = &'a (dyn Fn(usize, usize) -> bool + Sync);

/// Buffers of the search.
#[derive(Debug, Default)]
pub(crate) struct PenetrationSearch {
    pairs: Vec<(u32, u32)>,
    /// Per body, whether it crosses itself.
    folded: Vec<bool>,
    crossing: Intersections,
    workers: Vec<Worker>,
}

/// Buffers of one pair of bodies; of all when there is one thread.
#[derive(Debug, Default)]
struct Worker {
    pairs: [usize; 2],
    inside: [Inside; 2],
    exits: Exits,
    found: Vec<PenetratingNode>,
    cost: Cost,
}

impl PenetrationSearch {
    pub(crate) fn run(
        &mut self,
        frame: &Frame,
        detector: &mut dyn Detector,
        include: Include,
        found: &mut Penetration,
    ) {
        let start = Instant::now();
        let Self { pairs, folded, crossing, workers } = self;
        pairs.clear();
        let visited = frame.upper.pairs(pairs);
        let closed = |body: u32| frame.bodies[body as usize].surface.closed;
        let wanted = |a: u32, b: u32| {
            !frame.left_out.has_bodies(a, b) && closed(b) && include(a as usize, b as usize)
        };
        pairs.retain(|&(a, b)| wanted(a, b) || wanted(b, a));
        let between = pairs.len();
        for body in 0..frame.bodies.len() as u32 {
            let solid = !frame.bodies[body as usize].mesh.tetrahedra().is_empty();
            if solid && wanted(body, body) {
                pairs.push((body, body));
            }
        }
        let self_contact = pairs.len() > between;
        crossing.pairs.clear();
        crossing.stats = DetectionStats::default();
        if !pairs.is_empty() {
            let mut options =
                IntersectionOptions { self_contact, same_leaf: true, shared_nodes: false };
            detector.intersections(frame, options, crossing);
            // Triangles that share nodes cost much more, and only matter in a body where others cross.
            folded.clear();
            folded.resize(frame.bodies.len(), false);
            for pair in crossing.pairs.iter().filter(|pair| pair.body_a == pair.body_b) {
                folded[pair.body_a as usize] = true;
            }
            if folded.contains(&true) {
                crossing.pairs.clear();
                options.shared_nodes = true;
                detector.intersections(frame, options, crossing);
                let matters = |pair: &TrianglePair| {
                    pair.body_a != pair.body_b || folded[pair.body_a as usize]
                };
                crossing.pairs.retain(matters);
            }
        }
        found.stats = crossing.stats;
        found.stats.nodes_visited += visited;
        found.stats.all_pairs = frame.all_pairs(self_contact);
        found.stats.object_time += start.elapsed().saturating_sub(crossing.stats.total_time());

        let start = Instant::now();
        // By triangles too: what is found of two bodies does not depend on those beside them.
        crossing
            .pairs
            .sort_unstable_by_key(|pair| (bodies_of(pair), pair.triangle_a, pair.triangle_b));
        let threaded = frame.pool.is_some();
        let count = if threaded { pairs.len() } else { 1 };
        workers.resize_with(workers.len().max(count), Worker::default);
        for (index, worker) in workers[..count].iter_mut().enumerate() {
            let one = [index, index + 1];
            worker.pairs = if threaded { one } else { [0, pairs.len()] };
        }
        let surfaces = Surfaces { bodies: frame.bodies, detector };
        let search = Search { surfaces, bounds: frame.upper.bounds(), include };
        for_each(frame.pool, &mut workers[..count], |worker| {
            worker.found.clear();
            worker.cost = Cost::default();
            for &pair in &pairs[worker.pairs[0]..worker.pairs[1]] {
                let start = crossing.pairs.partition_point(|crossing| bodies_of(crossing) < pair);
                let end = crossing.pairs.partition_point(|crossing| bodies_of(crossing) <= pair);
                worker.pair(&search, pair, &crossing.pairs[start..end]);
            }
        });
        for worker in &workers[..count] {
            found.nodes.extend_from_slice(&worker.found);
            worker.cost.add_to(&mut found.stats);
        }
        found.nodes.sort_unstable_by_key(|node| (node.body, node.node, node.into_body));
        found.stats.polygon_time += start.elapsed();
    }
}

fn bodies_of(pair: &TrianglePair) -> (u32, u32) {
    (pair.body_a, pair.body_b)
}

/// What the workers read.
struct Search<'a> {
    surfaces: Surfaces<'a>,
    /// Box around all bodies.
    bounds: Aabb,
    include: Include<'a>,
}

impl Worker {
    /// Finds the nodes of each body inside the other, or of one within itself, given the triangles
    /// where they cross.
    fn pair(&mut self, search: &Search, (a, b): (u32, u32), crossing: &[TrianglePair]) {
        let Self { inside: [inside_a, inside_b], exits, found, cost, .. } = self;
        let surfaces = &search.surfaces;
        let [body_a, body_b] = [a, b].map(|body| &surfaces.bodies[body as usize]);
        if a == b {
            if crossing.is_empty() && body_a.surface.component_nodes.len() == 1 {
                return;
            }
            let triangles = crossing.iter().flat_map(|pair| [pair.triangle_a, pair.triangle_b]);
            inside_a.locate_own(body_a, triangles, |node| {
                cost.polygon_tests += 1;
                surfaces.is_covered(a, node)
            });
            if inside_a.is_empty() {
                return;
            }
            inside_a.make_patch(body_a);
            exits.run(search, [a, a], inside_a, Some(inside_a), found);
            return;
        }
        let mut locate = |inside: &mut Inside, [body, into]: [u32; 2], of_a: bool| {
            let body = &surfaces.bodies[body as usize];
            let triangle =
                |pair: &TrianglePair| if of_a { pair.triangle_a } else { pair.triangle_b };
            inside.locate(body, crossing.iter().map(triangle), |node| {
                cost.polygon_tests += 1;
                surfaces.is_inside(into, &body.positions[node as usize])
            });
        };
        locate(inside_a, [a, b], true);
        locate(inside_b, [b, a], false);
        if inside_a.is_empty() && inside_b.is_empty() {
            return;
        }
        inside_a.make_patch(body_a);
        inside_b.make_patch(body_b);
        let ways = [([a, b], &*inside_a, &*inside_b, body_a), ([b, a], inside_b, inside_a, body_b)];
        for ([body, into], inside, other, of) in ways {
            if !inside.is_empty() && (search.include)(body as usize, into as usize) {
                let patch = of.surface.closed.then_some(other);
                exits.run(search, [body, into], inside, patch, found);
            }
        }
    }
}
