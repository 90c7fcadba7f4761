//! Spatial hashing after Teschner, Heidelberger, Müller, Pomeranets, Gross: *Optimized Spatial Hashing
//! for Collision Detection of Deformable Objects*, VMV 2003. Here triangle against triangle.

use std::time::Instant;

use palpate_geometry::{Aabb, triangles_intersect, vec3};

use super::paper::Paper;
use super::{Detector, LimitOf};
use crate::frame::{Frame, SceneBody};
use crate::leaf_pairs::share_a_node;
use crate::left_out::ElementPair;
use crate::neighbours::neighbours_meet;
use crate::options::IntersectionOptions;
use crate::pairs::TrianglePair;
use crate::results::{Intersections, Proximity};

/// A triangle over more cells is not rasterised but tested against all others: one long sliver must not
/// fill the memory.
const MOST_CELLS: u64 = 1 << 12;

/// Cells that a triangle is in on average at most: where surfaces have grown since they were measured, cells
/// grow until it is so. Else every bucket would become a long list.
const MEAN_CELLS: u64 = 32;

/// Cells along the scene's longest side at most, so that cell numbers stay exact.
const MOST_CELLS_ALONG: f64 = (1 << 30) as f64;

const END: u32 = u32::MAX;

/// Hash table of cells and its buffers.
#[derive(Debug, Default)]
pub(super) struct Hash {
    /// Mean edge length of all surfaces \[m\]: the cell size that the paper recommends.
    mean_edge: f64,
    /// Raised each step: a bucket with an older stamp is empty, so that nothing has to be cleared.
    stamp: u32,
    buckets: Vec<Bucket>,
    entries: Vec<Entry>,
    triangles: Vec<Triangle>,
    large: Vec<u32>,
    /// Pairs of `triangles` whose boxes meet.
    candidates: Vec<[u32; 2]>,
    tree: Paper,
}

#[derive(Clone, Copy, Debug, Default)]
struct Bucket {
    stamp: u32,
    first: u32,
}

/// A triangle in a cell; entries of a bucket form a list.
#[derive(Clone, Copy, Debug)]
struct Entry {
    cell: [i64; 3],
    triangle: u32,
    next: u32,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    body: u32,
    index: u32,
    bounds: Aabb,
    first_cell: [i64; 3],
}

impl Detector for Hash {
    fn bodies_changed(&mut self, bodies: &[SceneBody]) {
        let (mut sum, mut count) = (0.0, 0.0);
        for body in bodies {
            for edge in body.mesh.surface_edges() {
                let [a, b] = edge.map(|node| body.positions[node as usize]);
                sum += vec3::norm(vec3::sub(b, a));
                count += 1.0;
            }
        }
        self.mean_edge = if count > 0.0 { sum / count } else { 0.0 };
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
        self.prepare(frame);
        let mut grid = Grid::new(&frame.upper.bounds(), self.mean_edge);
        while self.cells(&grid) > MEAN_CELLS * self.triangles.len() as u64 {
            grid.cell_size *= 2.0;
        }
        for index in 0..self.triangles.len() as u32 {
            stats.box_tests += self.insert(&grid, index, options.self_contact);
        }
        stats.box_tests += self.pair_large(options.self_contact);
        stats.cell_entries = self.entries.len() as u64;
        stats.traversal_time = start.elapsed();

        let testing = Instant::now();
        for pair in &self.candidates {
            let pair = pair.map(|index| self.triangles[index as usize]);
            found.pairs.extend(meeting(
                frame,
                pair,
                options.shared_nodes,
                &mut stats.polygon_tests,
            ));
        }
        found.pairs.sort_unstable();
        stats.polygon_time = testing.elapsed();
    }

    fn proximity(&mut self, frame: &Frame, limit_of: LimitOf, found: &mut Proximity) {
        self.tree.proximity(frame, limit_of, found);
    }
}

impl Hash {
    /// Lists the triangles and empties the table.
    fn prepare(&mut self, frame: &Frame) {
        self.triangles.clear();
        for (body, scene_body) in frame.bodies.iter().enumerate() {
            for index in 0..scene_body.mesh.triangles().len() as u32 {
                let bounds = Aabb::from_points(&scene_body.triangle(index));
                self.triangles.push(Triangle {
                    body: body as u32,
                    index,
                    bounds,
                    first_cell: [0; 3],
                });
            }
        }
        let bucket_count = (4 * self.triangles.len()).next_power_of_two();
        if self.buckets.len() < bucket_count {
            self.buckets.resize(bucket_count, Bucket::default());
        }
        if self.stamp == u32::MAX {
            self.buckets.fill(Bucket::default());
            self.stamp = 0;
        }
        self.stamp += 1;
        self.entries.clear();
        self.large.clear();
        self.candidates.clear();
    }

    /// In how many cells the triangles are altogether.
    fn cells(&self, grid: &Grid) -> u64 {
        let counts = self.triangles.iter().map(|triangle| grid.count(&triangle.bounds));
        counts.filter(|&count| count <= MOST_CELLS).sum()
    }

    /// Puts a triangle into the cells of its box and pairs it with those already there; returns the
    /// number of box tests.
    fn insert(&mut self, grid: &Grid, index: u32, self_contact: bool) -> u64 {
        let own = &mut self.triangles[index as usize];
        let (first, last) = (grid.cell(own.bounds.min), grid.cell(own.bounds.max));
        own.first_cell = first;
        if grid.count(&own.bounds) > MOST_CELLS {
            self.large.push(index);
            return 0;
        }
        let mut box_tests = 0;
        for x in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                for z in first[2]..=last[2] {
                    box_tests += self.insert_in_cell(index, [x, y, z], self_contact);
                }
            }
        }
        box_tests
    }

    fn insert_in_cell(&mut self, index: u32, cell: [i64; 3], self_contact: bool) -> u64 {
        let slot = hash(cell) as usize & (self.buckets.len() - 1);
        let bucket = self.buckets[slot];
        let head = if bucket.stamp == self.stamp { bucket.first } else { END };
        let own = &self.triangles[index as usize];
        let mut box_tests = 0;
        let mut at = head;
        while at != END {
            let entry = self.entries[at as usize];
            at = entry.next;
            // Other cells fall into the same bucket; and a pair with several cells in common counts in
            // the first of them only.
            let other = &self.triangles[entry.triangle as usize];
            let first_common: [i64; 3] =
                std::array::from_fn(|axis| own.first_cell[axis].max(other.first_cell[axis]));
            let wanted = self_contact || own.body != other.body;
            if wanted && entry.cell == cell && first_common == cell {
                box_tests += 1;
                if own.bounds.intersects(&other.bounds) {
                    self.candidates.push([entry.triangle, index]);
                }
            }
        }
        self.buckets[slot] = Bucket { stamp: self.stamp, first: self.entries.len() as u32 };
        self.entries.push(Entry { cell, triangle: index, next: head });
        box_tests
    }

    /// Pairs the triangles that were too large for the cells with all others.
    fn pair_large(&mut self, self_contact: bool) -> u64 {
        let mut box_tests = 0;
        for &large in &self.large {
            let own = &self.triangles[large as usize];
            for (index, other) in self.triangles.iter().enumerate() {
                let index = index as u32;
                // Two large ones once; `large` is ascending.
                let counted = index <= large && self.large.binary_search(&index).is_ok();
                if counted || (!self_contact && own.body == other.body) {
                    continue;
                }
                box_tests += 1;
                if own.bounds.intersects(&other.bounds) {
                    self.candidates.push([large.min(index), large.max(index)]);
                }
            }
        }
        box_tests
    }
}

/// The exact test of two triangles, the first before the second, if they are wanted.
fn meeting(
    frame: &Frame,
    [a, b]: [Triangle; 2],
    shared_nodes: bool,
    polygon_tests: &mut u64,
) -> Option<TrianglePair> {
    let (body_a, body_b) = (&frame.bodies[a.body as usize], &frame.bodies[b.body as usize]);
    let corners_a = body_a.mesh.triangles()[a.index as usize];
    let corners_b = body_b.mesh.triangles()[b.index as usize];
    let neighbours = a.body == b.body && share_a_node(corners_a, corners_b);
    let triangles = [a.index, b.index];
    if neighbours && !shared_nodes
        || frame.left_out.has_bodies(a.body, b.body)
        || frame.leaves_out([a.body, b.body], ElementPair::Triangles(triangles))
    {
        return None;
    }
    *polygon_tests += 1;
    let meet = if neighbours {
        neighbours_meet(body_a, triangles)
    } else {
        triangles_intersect(&body_a.triangle(a.index), &body_b.triangle(b.index))
    };
    meet.then_some(TrianglePair {
        body_a: a.body,
        triangle_a: a.index,
        body_b: b.body,
        triangle_b: b.index,
    })
}

/// Cells of one size over the scene.
struct Grid {
    origin: [f64; 3],
    cell_size: f64,
}

impl Grid {
    fn new(bounds: &Aabb, mean_edge: f64) -> Self {
        let longest = bounds.extent().into_iter().fold(0.0, f64::max);
        let cell_size = mean_edge.max(longest / MOST_CELLS_ALONG);
        Self { origin: bounds.min, cell_size: if cell_size > 0.0 { cell_size } else { 1.0 } }
    }

    /// How many cells a box touches.
    fn count(&self, bounds: &Aabb) -> u64 {
        let (first, last) = (self.cell(bounds.min), self.cell(bounds.max));
        let along = |axis: usize| (last[axis] - first[axis] + 1) as u64;
        along(0).saturating_mul(along(1)).saturating_mul(along(2))
    }

    /// The cell of a point; monotone on each axis also in floating point, so that boxes which meet
    /// have a cell in common.
    fn cell(&self, point: [f64; 3]) -> [i64; 3] {
        std::array::from_fn(|axis| ((point[axis] - self.origin[axis]) / self.cell_size) as i64)
    }
}

/// The hash function of the 2003 paper.
fn hash([x, y, z]: [i64; 3]) -> u64 {
    x.wrapping_mul(73_856_093) as u64
        ^ y.wrapping_mul(19_349_663) as u64
        ^ z.wrapping_mul(83_492_791) as u64
}
