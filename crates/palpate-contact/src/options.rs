//! What counts in a search.

/// What counts as an intersection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntersectionOptions {
    /// Also pairs of triangles of one body.
    pub self_contact: bool,
    /// Also pairs of triangles of one leaf, which the paper exempts. Methods without leaves always
    /// test them.
    pub same_leaf: bool,
    /// Also pairs of triangles of one body that share nodes and meet elsewhere too, as where a surface
    /// folds: with one node in common, where they have another point in common; with two, where they
    /// have one beyond that edge (folded flat over it); with all three, always.
    pub shared_nodes: bool,
}

impl Default for IntersectionOptions {
    fn default() -> Self {
        Self { self_contact: true, same_leaf: true, shared_nodes: false }
    }
}

/// Which close pairs count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProximityOptions {
    /// Also pairs that are closer than the distance in the positions of their meshes, at rest.
    pub close_at_rest: bool,
    /// Each pair of closest features only once: edges only where both closest points lie between their
    /// ends, since nodes and triangles tell the rest, and a node against an edge or node of a surface
    /// only with the first of the triangles that share it. Contact is made of these; at a distance of a
    /// few edges most pairs are others.
    pub each_feature_once: bool,
}

impl Default for ProximityOptions {
    fn default() -> Self {
        Self { close_at_rest: true, each_feature_once: false }
    }
}
