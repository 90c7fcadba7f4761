//! parry3d: one refitted bounding volume hierarchy per body, all pairs of leaves whose boxes overlap.

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace};

use crate::scene::{Frame, Pair, Scene};

pub struct Parry {
    trees: Vec<Bvh>,
    workspace: BvhWorkspace,
}

impl Parry {
    pub fn new(scene: &Scene) -> Self {
        let tree = |body: usize| {
            let boxes: Vec<Aabb> = (0..scene.triangles[body].len() as u32)
                .map(|triangle| bounds(scene, &scene.frames[0], body as u32, triangle, 0.0))
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        };
        let trees = (0..scene.triangles.len()).map(tree).collect();
        Self { trees, workspace: BvhWorkspace::default() }
    }

    pub fn update(&mut self, scene: &Scene, frame: &Frame, margin: f64) {
        for (body, tree) in self.trees.iter_mut().enumerate() {
            for triangle in 0..scene.triangles[body].len() as u32 {
                let aabb = bounds(scene, frame, body as u32, triangle, margin);
                tree.insert_or_update_partially(aabb, triangle, 0.0);
            }
            tree.refit(&mut self.workspace);
        }
    }

    pub fn candidates(&mut self, mut visit: impl FnMut(Pair)) {
        let Self { trees, workspace } = self;
        for (a, tree) in trees.iter().enumerate() {
            let body_a = a as u32;
            tree.traverse_bvtt_single_tree::<false>(workspace, &mut |i, j| {
                visit([body_a, i.min(j), body_a, i.max(j)]);
            });
            for (b, other) in trees.iter().enumerate().skip(a + 1) {
                if tree.root_aabb().intersects(&other.root_aabb()) {
                    let pairs = tree.leaf_pairs(other, BvhNode::intersects);
                    pairs.for_each(|(i, j)| visit([body_a, i, b as u32, j]));
                }
            }
        }
    }
}

fn bounds(scene: &Scene, frame: &Frame, body: u32, triangle: u32, margin: f64) -> Aabb {
    let [min, max] = scene.bounds(frame, body, triangle);
    let grow = Vector::splat(margin);
    Aabb::new(Vector::from(min) - grow, Vector::from(max) + grow)
}
