//! A bounding tree that is refitted when somebody asks for it.

use std::sync::{Mutex, OnceLock, PoisonError};

use palpate_geometry::Point;

use crate::bounding_tree::BoundingTree;

/// A tree that is current, or waits to be refitted. One of the two is always there.
#[derive(Debug)]
pub(super) struct LazyTree {
    current: OnceLock<BoundingTree>,
    waiting: Mutex<Option<BoundingTree>>,
}

impl LazyTree {
    pub(super) fn new(tree: BoundingTree) -> Self {
        Self { current: OnceLock::from(tree), waiting: Mutex::new(None) }
    }

    /// A tree that must be refitted.
    pub(super) fn waiting(tree: BoundingTree) -> Self {
        Self { current: OnceLock::new(), waiting: Mutex::new(Some(tree)) }
    }

    /// The tree at `positions`, the same since the last call of `set_moved`.
    #[inline]
    pub(super) fn get(&self, positions: &[Point]) -> &BoundingTree {
        self.current.get_or_init(|| {
            let waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner).take();
            let mut tree = waiting.expect("a tree that is not current waits");
            tree.refit(positions);
            tree
        })
    }

    /// A copy of the tree, whatever positions it is at.
    pub(super) fn copy(&self) -> BoundingTree {
        let waiting = || self.waiting.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let tree = self.current.get().cloned().or_else(waiting);
        tree.expect("a tree that is not current waits")
    }

    pub(super) fn set_moved(&mut self) {
        if let Some(tree) = self.current.take() {
            *self.waiting.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(tree);
        }
    }
}
