//! Splits tetrahedra at points of their edges, so that neighbours agree.
//!
//! A tetrahedron is halved at one edge after the other, the edges in an order that is the same for the
//! whole mesh. On a face that two tetrahedra share, both then do the same, so the parts fit together, and
//! no order or pattern needs points inside (sequences of bisections always exist). When all edges between
//! two sides are split, each part lies on one side: a halving replaces one end by a point on the sheet and
//! makes no new edge between the sides.

/// An edge of one tetrahedron by its corners, and the number of the point that splits it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EdgeSplit {
    pub(crate) corners: [u8; 2],
    pub(crate) point: u8,
}

/// The parts of one tetrahedron: numbers below 4 are its corners, others points of edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    parts: [[u8; 4]; Parts::MOST],
    count: usize,
}

impl Parts {
    /// No more than all six edges make.
    const MOST: usize = 16;

    /// The parts of a tetrahedron whose edges are split in this order.
    pub(crate) fn new(splits: &[EdgeSplit]) -> Self {
        let mut parts = Self { parts: [[0, 1, 2, 3]; Self::MOST], count: 1 };
        for split in splits {
            let [a, b] = split.corners;
            for place in 0..parts.count {
                let part = parts.parts[place];
                if part.contains(&a) && part.contains(&b) {
                    let with =
                        |end| part.map(|corner| if corner == end { split.point } else { corner });
                    parts.parts[place] = with(b);
                    parts.parts[parts.count] = with(a);
                    parts.count += 1;
                }
            }
        }
        parts
    }

    /// The parts, oriented as the whole.
    pub(crate) fn as_slice(&self) -> &[[u8; 4]] {
        &self.parts[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use palpate_geometry::{Point, tetrahedron, vec3};
    use proptest::prelude::*;

    use super::*;

    const EDGES: [[u8; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    fn whole() -> [Point; 4] {
        [[0.0; 3], [1.0, 0.1, 0.0], [0.2, 1.1, 0.1], [0.1, 0.3, 0.9]]
    }

    proptest! {
        #[test]
        fn parts_are_positive_and_fill_the_whole(
            order in Just(EDGES.to_vec()).prop_shuffle(),
            count in 0_usize..=6,
            at in proptest::array::uniform6(0.1_f64..0.9),
        ) {
            let mut points = whole().to_vec();
            let mut splits = Vec::new();
            for (place, &corners) in order[..count].iter().enumerate() {
                let [a, b] = corners.map(|corner| points[corner as usize]);
                splits.push(EdgeSplit { corners, point: points.len() as u8 });
                points.push(vec3::lerp(a, b, at[place]));
            }
            let parts = Parts::new(&splits);
            let mut sum = 0.0;
            for part in parts.as_slice() {
                let volume = tetrahedron::signed_volume(&part.map(|corner| points[corner as usize]));
                prop_assert!(volume > 0.0);
                sum += volume;
            }
            prop_assert!((sum - tetrahedron::signed_volume(&whole())).abs() < 1e-14);
            // No split edge is left whole.
            for split in &splits {
                let [a, b] = split.corners;
                prop_assert!(parts.as_slice().iter().all(|p| !(p.contains(&a) && p.contains(&b))));
            }
        }
    }
}
