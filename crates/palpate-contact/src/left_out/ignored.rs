//! Pairs of bodies that are not tested against each other.

use super::{Filter, holds};
use crate::error::SceneError;
use crate::scene::Scene;

/// Pairs of bodies that were chosen.
#[derive(Clone, Debug, Default)]
pub(crate) struct IgnoredPairs {
    /// Each with a <= b, sorted.
    pairs: Vec<[u32; 2]>,
}

impl IgnoredPairs {
    fn set(&mut self, a: u32, b: u32, ignored: bool) {
        let pair = [a.min(b), a.max(b)];
        match (self.pairs.binary_search(&pair), ignored) {
            (Err(index), true) => self.pairs.insert(index, pair),
            (Ok(index), false) => drop(self.pairs.remove(index)),
            _ => {}
        }
    }
}

impl Filter for IgnoredPairs {
    fn bodies(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    fn forget(&mut self, body: u32) {
        self.pairs.retain(|pair| !pair.contains(&body));
    }

    fn remove(&mut self, removed: u32) {
        self.forget(removed);
        for body in self.pairs.as_flattened_mut() {
            *body -= u32::from(*body > removed);
        }
    }
}

impl Scene {
    /// Leaves two bodies, in any order, out of every search, or takes them in again; the same body twice
    /// is its self-contact.
    ///
    /// # Errors
    /// If there is no such body.
    pub fn ignore(&mut self, a: usize, b: usize, ignored: bool) -> Result<(), SceneError> {
        self.check_body(a)?;
        self.check_body(b)?;
        self.left_out.ignored.set(a as u32, b as u32, ignored);
        Ok(())
    }

    /// Whether two bodies, in any order, are ignored.
    pub fn is_ignored(&self, a: usize, b: usize) -> bool {
        holds(self.left_out.ignored.bodies(), a as u32, b as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_pairs_have_no_order_and_follow_the_bodies() {
        let mut ignored = IgnoredPairs::default();
        for (a, b) in [(3, 1), (2, 2), (0, 4), (1, 3)] {
            ignored.set(a, b, true);
        }
        assert_eq!(ignored.bodies(), [[0, 4], [1, 3], [2, 2]]);
        let holds = |a, b| holds(ignored.bodies(), a, b);
        assert!(holds(3, 1) && holds(1, 3) && !holds(1, 1));
        ignored.remove(1);
        assert_eq!(ignored.bodies(), [[0, 3], [1, 1]]);
        ignored.set(3, 0, false);
        ignored.set(0, 1, false);
        assert_eq!(ignored.bodies(), [[1, 1]]);
    }
}
