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

/// How far a triangle may lead towards what is close to it where [`ProximityOptions::local_minima`] still
/// count, as a part of how far the node that does is from the farther end of the closest feature.
pub const LOCAL_MINIMUM_SLACK: f64 = 0.06;

/// Which close pairs count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProximityOptions {
    /// Also pairs that are closer than the distance in the positions of their meshes, at rest.
    pub close_at_rest: bool,
    /// Only where the distance between the surfaces has a local minimum, each pair of closest features once:
    /// edges where both closest points lie between their ends, a node against an edge or node of a surface
    /// with the first of the triangles that share it; and where the triangles around these features
    /// do not lead closer, by more than [`LOCAL_MINIMUM_SLACK`]. Of a node, the surface around it does not
    /// count. Contact is made of these; at a distance of a few edges nearly all pairs are others.
    pub local_minima: bool,
}

impl Default for ProximityOptions {
    fn default() -> Self {
        Self { close_at_rest: true, local_minima: false }
    }
}
