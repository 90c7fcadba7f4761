//! What a search sees: the bodies where they are now, and what is left out.

mod lazy_tree;

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::{Mesh, MeshChange};
use rayon::ThreadPool;

use crate::bounding_tree::{BoundingTree, Split, corner_points};
use crate::left_out::{ElementPair, LeftOut};
use crate::surface::Surface;
use crate::threads::Threads;
use crate::upper_tree::UpperTree;
use lazy_tree::LazyTree;

/// One body: its mesh and what follows from it, and where its nodes are now.
#[derive(Debug)]
pub(crate) struct SceneBody {
    pub(crate) mesh: Arc<Mesh>,
    pub(crate) positions: Vec<Point>,
    tree: LazyTree,
    pub(crate) surface: Surface,
}

impl SceneBody {
    pub(crate) fn new(mesh: Arc<Mesh>, leaf_size: usize, split: Split) -> Self {
        let tree = BoundingTree::new(&mesh, leaf_size, split);
        let surface = Surface::new(&mesh, tree.triangle_order());
        let positions = mesh.nodes().to_vec();
        Self { mesh, positions, tree: LazyTree::new(tree), surface }
    }

    /// The bounding tree, refitted to the positions.
    #[inline]
    pub(crate) fn tree(&self) -> &BoundingTree {
        self.tree.get(&self.positions)
    }

    /// A copy of the tree, whatever positions it is at.
    pub(crate) fn copy_tree(&self) -> BoundingTree {
        self.tree.copy()
    }

    pub(crate) fn move_to(&mut self, positions: &[Point]) {
        self.positions.copy_from_slice(positions);
        self.tree.set_moved();
    }

    /// Takes the mesh after a change, its nodes where those are that they come from.
    pub(crate) fn change(&mut self, change: &MeshChange, tree: BoundingTree, surface: Surface) {
        self.positions = change.positions(&self.positions);
        self.mesh = Arc::clone(&change.mesh);
        self.tree = LazyTree::waiting(tree);
        self.surface = surface;
    }

    pub(crate) fn triangle(&self, triangle: u32) -> [Point; 3] {
        corner_points(&self.positions, self.mesh.triangles()[triangle as usize])
    }
}

/// What a search sees of the scene.
#[derive(Clone, Copy)]
pub(crate) struct Frame<'a> {
    pub(crate) bodies: &'a [SceneBody],
    pub(crate) upper: &'a UpperTree,
    pub(crate) left_out: &'a LeftOut,
    /// Whether only bodies are left out, no elements of theirs.
    pub(crate) all_elements: bool,
    pub(crate) pool: Option<&'a ThreadPool>,
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        bodies: &'a [SceneBody],
        upper: &'a UpperTree,
        left_out: &'a LeftOut,
        threads: &'a Threads,
    ) -> Self {
        Self { bodies, upper, left_out, all_elements: false, pool: threads.pool() }
    }

    /// Leaves out bodies, but no elements.
    pub(crate) fn with_all_elements(self) -> Self {
        Self { all_elements: true, ..self }
    }

    /// Whether elements of two bodies may be left out.
    pub(crate) fn may_leave_out(&self, bodies: [u32; 2]) -> bool {
        !self.all_elements && self.left_out.concerns(bodies)
    }

    /// Whether two elements are no pair.
    #[inline]
    pub(crate) fn leaves_out(&self, bodies: [u32; 2], pair: ElementPair) -> bool {
        !self.all_elements && self.left_out.has(bodies, pair)
    }

    /// Collects the body pairs (a <= b) whose triangles can meet; returns the upper tree's nodes visited.
    pub(crate) fn object_pairs(&self, self_contact: bool, found: &mut Vec<(u32, u32)>) -> u64 {
        found.clear();
        let visited = self.upper.pairs(found);
        if self_contact {
            found.extend((0..self.bodies.len() as u32).map(|body| (body, body)));
        }
        found.retain(|&(a, b)| !self.left_out.has_bodies(a, b));
        visited
    }

    /// Pairs of triangles that the double loop would test.
    pub(crate) fn all_pairs(&self, self_contact: bool) -> u64 {
        let count = |body: u32| self.bodies[body as usize].mesh.triangles().len() as u64;
        let of_one =
            |count: u64| if self_contact { count * count.saturating_sub(1) / 2 } else { 0 };
        let (mut pairs, mut before) = (0, 0);
        for count in (0..self.bodies.len() as u32).map(count) {
            pairs += before * count + of_one(count);
            before += count;
        }
        self.left_out.for_each_pair(|a, b| {
            pairs -= if a == b { of_one(count(a)) } else { count(a) * count(b) };
        });
        pairs
    }
}
