//! A body's triangles from near to far: the search that every point query is made of.
//!
//! What near means is up to a [`Measure`]. The search goes through the boxes of the scene's method, the
//! wide layout's or the bounding tree's, and only leaves out what cannot matter: a query that takes the
//! least of (key, triangle) gets the same from both.

mod measures;

use palpate_geometry::{Aabb, Point};

use crate::bounding_tree::BoundingTree;
use crate::frame::SceneBody;
use crate::method::Detector;
use crate::wide::BlockMeasure;

pub(crate) use measures::{Distance, Entry, HalfLine, rounding_at};

/// A lower bound of what a query looks for, of boxes in `f64` and of the wide layout's.
pub(crate) trait Measure {
    /// The measure of the wide layout's boxes.
    type OfBlocks: BlockMeasure;

    /// At most the key of every triangle in the box; infinite where none can matter.
    fn of_box(&self, bounds: &Aabb) -> f64;

    /// The measure for boxes relative to `origin` whose coordinates are at most `largest`; `None` where
    /// `f32` cannot hold it.
    fn of_blocks(&self, origin: Point, largest: f32) -> Option<Self::OfBlocks>;
}

/// The bodies' surfaces with the boxes around them.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    pub(crate) bodies: &'a [SceneBody],
    pub(crate) detector: &'a dyn Detector,
}

impl Surfaces<'_> {
    /// Calls `visit` with every triangle of a body whose key may be at most the limit, and with others,
    /// roughly from near to far. `visit` returns the limit from then on.
    #[inline]
    pub(crate) fn search<M: Measure>(
        &self,
        body: u32,
        measure: &M,
        limit: f64,
        visit: impl FnMut(u32) -> f64,
    ) {
        match self.detector.wide_surface(body as usize) {
            Some(surface) => surface.search(measure, limit, visit),
            None => self.bodies[body as usize].tree().search(measure, limit, visit),
        }
    }
}

struct TreeSearch<'a, M, V> {
    tree: &'a BoundingTree,
    measure: &'a M,
    limit: f64,
    visit: V,
}

impl BoundingTree {
    fn search<M: Measure>(&self, measure: &M, limit: f64, visit: impl FnMut(u32) -> f64) {
        if !self.nodes().is_empty() {
            TreeSearch { tree: self, measure, limit, visit }.descend(0);
        }
    }
}

impl<M: Measure, V: FnMut(u32) -> f64> TreeSearch<'_, M, V> {
    fn descend(&mut self, node: usize) {
        let Some([left, right]) = self.tree.children(node) else {
            return self.visit_leaf(node);
        };
        let key = |child: usize| self.measure.of_box(&self.tree.nodes()[child].bounds);
        let (left_key, right_key) = (key(left), key(right));
        let mut ways = [(left_key, left), (right_key, right)];
        if right_key < left_key {
            ways.swap(0, 1);
        }
        for (key, child) in ways {
            if key <= self.limit && key < f64::INFINITY {
                self.descend(child);
            }
        }
    }

    fn visit_leaf(&mut self, leaf: usize) {
        let [start, end] = self.tree.nodes()[leaf].triangles;
        for position in start..end {
            let key = self.measure.of_box(self.tree.triangle_bounds(position));
            if key <= self.limit && key < f64::INFINITY {
                self.limit = (self.visit)(self.tree.triangle_order()[position as usize]);
            }
        }
    }
}
