//! parry3d: one refitted bounding volume hierarchy per body, all pairs of leaves whose boxes overlap.

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace};
use parry3d_f64::query::intersection_test;
use parry3d_f64::shape::Triangle;

use crate::Contender;
use crate::scene::{Frame, Pair, Scene};

/// How a candidate pair is decided.
#[derive(Clone, Copy, PartialEq)]
pub enum Test {
    /// Exactly, by the same test as palpate's.
    Exact,
    /// By parry's own test of two triangles, GJK.
    Gjk,
}

pub struct Parry {
    trees: Vec<Bvh>,
    workspace: BvhWorkspace,
    test: Test,
    candidates: Vec<Pair>,
}

impl Parry {
    pub fn new(scene: &Scene, test: Test) -> Self {
        let tree = |body: usize| {
            let boxes: Vec<Aabb> = (0..scene.triangles[body].len() as u32)
                .map(|triangle| bounds(scene, &scene.frames[0], body as u32, triangle))
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        };
        let trees = (0..scene.triangles.len()).map(tree).collect();
        Self { trees, workspace: BvhWorkspace::default(), test, candidates: Vec::new() }
    }
}

impl Contender for Parry {
    fn update(&mut self, scene: &Scene, frame: &Frame) {
        for (body, tree) in self.trees.iter_mut().enumerate() {
            for triangle in 0..scene.triangles[body].len() as u32 {
                let aabb = bounds(scene, frame, body as u32, triangle);
                tree.insert_or_update_partially(aabb, triangle, 0.0);
            }
            tree.refit(&mut self.workspace);
        }
    }

    fn intersections(&mut self, scene: &Scene, frame: &Frame, found: &mut Vec<Pair>) {
        let Self { trees, workspace, test, candidates } = self;
        candidates.clear();
        for (a, tree) in trees.iter().enumerate() {
            let body_a = a as u32;
            tree.traverse_bvtt_single_tree::<false>(workspace, &mut |i, j| {
                let pair = [body_a, i.min(j), body_a, i.max(j)];
                if !scene.are_neighbours(pair) {
                    candidates.push(pair);
                }
            });
            for (b, other) in trees.iter().enumerate().skip(a + 1) {
                if tree.root_aabb().intersects_box(&other.root_aabb()) {
                    let pairs = tree.leaf_pairs(other, BvhNode::intersects);
                    candidates.extend(pairs.map(|(i, j)| [body_a, i, b as u32, j]));
                }
            }
        }
        let test = *test;
        found.extend(candidates.iter().filter(|&&pair| match test {
            Test::Exact => scene.meet(frame, pair),
            Test::Gjk => gjk(scene, frame, pair),
        }));
    }
}

trait Boxes {
    fn intersects_box(&self, other: &Self) -> bool;
}

impl Boxes for Aabb {
    fn intersects_box(&self, other: &Self) -> bool {
        self.mins.cmple(other.maxs).all() && other.mins.cmple(self.maxs).all()
    }
}

fn bounds(scene: &Scene, frame: &Frame, body: u32, triangle: u32) -> Aabb {
    let [min, max] = scene.bounds(frame, body, triangle);
    Aabb::new(Vector::from(min), Vector::from(max))
}

fn gjk(scene: &Scene, frame: &Frame, [body_a, a, body_b, b]: Pair) -> bool {
    let shape = |body, triangle| {
        let [p, q, r] = scene.corners(frame, body, triangle).map(Vector::from);
        Triangle::new(p, q, r)
    };
    let still = Pose::IDENTITY;
    intersection_test(&still, &shape(body_a, a), &still, &shape(body_b, b))
        .is_ok_and(|found| found.intersecting)
}
