//! How a scene is built.

use crate::bounding_tree::Split;
use crate::method::Method;

/// How a scene is built and searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub struct SceneOptions {
    /// Most tetrahedra in a leaf: the paper's K.
    pub leaf_size: usize,
    /// Where boxes are split.
    pub split: Split,
    /// How touching triangles are found.
    pub method: Method,
    /// Threads that detection may use; results are the same for any number.
    pub threads: usize,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { leaf_size: 10, split: Split::Middle, method: Method::Wide, threads: 1 }
    }
}
