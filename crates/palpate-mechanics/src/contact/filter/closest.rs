//! What of a triangle is closest to a node.

use palpate_contact::ProximityPair;

use super::super::Surface;

/// What of the triangle of a pair is closest to the node.
#[derive(Clone, Copy)]
pub(super) enum Closest {
    /// A point of its inside.
    Inside,
    /// A point of an edge, which begins at the node `from`.
    Edge { edge: u32, from: u32 },
    /// A corner.
    Corner(u32),
}

impl Closest {
    /// Of a node against a triangle of `surface`.
    pub(super) fn of(pair: &ProximityPair, surface: &Surface) -> Self {
        let corners = &pair.nodes[1..];
        let counts = [1, 2, 3].map(|place| pair.weights[place] != 0.0);
        let only = |place: usize| Self::Corner(corners[place]);
        let without = |place: usize| {
            let next = (place + 1) % 3;
            let edges = surface.mesh().triangle_edges()[pair.elements[1] as usize];
            Self::Edge { edge: edges[next], from: corners[next] }
        };
        match counts {
            [true, true, true] => Self::Inside,
            [false, true, true] => without(0),
            [true, false, true] => without(1),
            [true, true, false] => without(2),
            [_, false, false] => only(0),
            [false, true, false] => only(1),
            [false, false, true] => only(2),
        }
    }
}
