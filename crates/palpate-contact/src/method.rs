//! The methods of finding what touches. A new one is a file below and its line in the list.

mod all_pairs;
mod hash;
mod paper;
mod wide;

use std::fmt::Debug;

use palpate_geometry::Aabb;
use rayon::ThreadPool;

use crate::frame::{Frame, SceneBody};
use crate::memory::DetectionMemory;
use crate::options::IntersectionOptions;
use crate::proximity::Limit;
use crate::results::{Intersections, Proximity};
use crate::wide::{WideBody, WideSurface};

/// The methods from lines of a name here, a name in words, and what works by it.
macro_rules! methods {
    ($($(#[$about:meta])* $name:ident = $word:literal => $detector:expr,)*) => {
        /// How touching surface elements are found. All give the same pairs.
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Deserialize, serde::Serialize,
        )]
        #[non_exhaustive]
        pub enum Method {
            $($(#[$about])* $name,)*
        }

        impl Method {
            /// All methods.
            pub const ALL: [Self; [$($word),*].len()] = [$(Self::$name),*];
            /// Their names, in the same order.
            pub const NAMES: [&'static str; Self::ALL.len()] = [$($word),*];

            pub(crate) fn detector(self) -> Box<dyn Detector> {
                match self {
                    $(Self::$name => Box::new($detector),)*
                }
            }
        }
    };
}

// Checkpoints keep the place in this list: a new one comes last.
methods! {
    /// The paper's bounding trees: bodies, then leaves against subtrees, then polygons.
    Paper = "paper" => paper::Paper::default(),
    /// Every pair of surface elements: slow and obvious.
    AllPairs = "all-pairs" => all_pairs::AllPairs,
    /// Spatial hashing after Teschner et al. 2003; proximity goes through the bounding trees.
    Hash = "hash" => hash::Hash::default(),
    /// The wide layout: triangles in blocks of eight, level by level.
    #[default]
    Wide = "wide" => wide::Wide::default(),
}

/// Which elements of two bodies are a pair; `None` leaves the bodies out.
pub(crate) type LimitOf<'a> = &'a (dyn Fn(usize, usize) -> Option<Limit> + Sync);

/// A method at work. It fills results that are handed over empty, and keeps its own buffers.
pub(crate) trait Detector: Debug + Send + Sync {
    /// Bodies were added, removed or replaced.
    fn bodies_changed(&mut self, _bodies: &[SceneBody]) {}

    /// Whether bodies are searched in the wide layout.
    fn is_packed(&self) -> bool {
        false
    }

    /// A body, packed, that the bodies hold when they have changed.
    fn take_packed(&mut self, _body: WideBody) {}

    /// Whether the bounding trees are needed in every frame; else they are refitted when asked for.
    fn uses_trees(&self) -> bool {
        true
    }

    /// The bodies are at other positions. Also called after `bodies_changed`. Returns the number of tree
    /// nodes or blocks that were refitted for it.
    fn bodies_moved(&mut self, _bodies: &[SceneBody], _pool: Option<&ThreadPool>) -> u64 {
        0
    }

    /// What it keeps in memory; the number of triangles is not its to say.
    fn memory(&self) -> DetectionMemory {
        DetectionMemory::default()
    }

    /// A box around a body at least as large as its own; `None` where its tree must say.
    fn bounds(&self, _body: usize) -> Option<Aabb> {
        None
    }

    /// The body in the wide layout; `None` where its tree must do.
    fn wide_surface(&self, _body: usize) -> Option<WideSurface<'_>> {
        None
    }

    fn intersections(
        &mut self,
        frame: &Frame,
        options: IntersectionOptions,
        found: &mut Intersections,
    );

    fn proximity(&mut self, frame: &Frame, limit_of: LimitOf, found: &mut Proximity);
}
