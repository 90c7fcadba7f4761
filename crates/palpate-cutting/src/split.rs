//! Splits tetrahedra at points of their edges, so that neighbours agree.
//!
//! A tetrahedron is halved at one edge after the other, the edges in an order that is the same for
//! the whole mesh. On a face that two tetrahedra share, both then do the same, so the parts fit
//! together, and no order or pattern needs points inside (sequences of bisections always exist).
//! When all edges between two sides are split, each part lies on one side: a halving replaces one
//! end by a point on the sheet and makes no new edge between the sides.

use crate::crossing::Sides;
use crate::draft::Draft;
use crate::snap::Plan;

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

/// Splits all edges of `plan`; parts are touched where the whole was, and the points of edges lie
/// on the sheet.
pub(crate) fn apply(draft: &mut Draft, plan: &Plan, is_touched: &mut Vec<bool>, sides: &mut Sides) {
    let first_point = draft.origins.len() as u32;
    for split in &plan.splits {
        let parent = draft.parents[split.edge.tetrahedron as usize];
        draft.add_node(draft.between(split.edge.nodes, split.edge.t, parent));
        sides.push_on();
    }
    for (tetrahedron, edges) in &plan.tetrahedra {
        split_tetrahedron(draft, is_touched, plan, *tetrahedron, edges, first_point);
    }
    split_pending(draft, plan, first_point);
}

/// Splits one tetrahedron; its first part takes its place.
fn split_tetrahedron(
    draft: &mut Draft,
    is_touched: &mut Vec<bool>,
    plan: &Plan,
    tetrahedron: u32,
    edges: &[u32],
    first_point: u32,
) {
    let corners = draft.tetrahedra[tetrahedron as usize];
    let corner =
        |node: u32| corners.iter().position(|&other| other == node).expect("an edge of it") as u8;
    let mut splits = [EdgeSplit { corners: [0; 2], point: 0 }; 6];
    for (place, &edge) in edges.iter().enumerate() {
        let nodes = plan.splits[edge as usize].edge.nodes;
        splits[place] = EdgeSplit { corners: nodes.map(corner), point: 4 + place as u8 };
    }
    let node = |number: u8| match number {
        0..4 => corners[number as usize],
        _ => first_point + edges[number as usize - 4],
    };
    let parts = Parts::new(&splits[..edges.len()]);
    let (first, others) = parts.as_slice().split_first().expect("at least the whole");
    draft.tetrahedra[tetrahedron as usize] = first.map(node);
    for part in others {
        draft.tetrahedra.push(part.map(node));
        draft.parents.push(draft.parents[tetrahedron as usize]);
        is_touched.push(is_touched[tetrahedron as usize]);
    }
}

/// Splits pending faces as their tetrahedra were.
fn split_pending(draft: &mut Draft, plan: &Plan, first_point: u32) {
    if draft.pending.is_empty() || plan.splits.is_empty() {
        return;
    }
    let mut by_nodes: Vec<([u32; 2], u32)> =
        plan.splits.iter().zip(0..).map(|(split, index)| (split.edge.nodes, index)).collect();
    by_nodes.sort_unstable();
    let mut pending = Vec::with_capacity(draft.pending.len());
    for &face in &draft.pending {
        let [a, b, c] = face;
        let mut splits: Vec<u32> = [[a, b], [a, c], [b, c]]
            .iter()
            .filter_map(|edge| by_nodes.binary_search_by_key(edge, |(nodes, _)| *nodes).ok())
            .map(|place| by_nodes[place].1)
            .collect();
        splits.sort_unstable();
        let splits: Vec<_> = (splits.iter())
            .map(|&index| (plan.splits[index as usize].edge.nodes, first_point + index))
            .collect();
        pending.extend(split_face(face, &splits));
    }
    for face in &mut pending {
        face.sort_unstable();
    }
    pending.sort_unstable();
    draft.pending = pending;
}

/// The parts of a triangle, `splits` of its edges (ends and point) made one after the other.
fn split_face(face: [u32; 3], splits: &[([u32; 2], u32)]) -> Vec<[u32; 3]> {
    let mut parts = vec![face];
    for &([a, b], point) in splits {
        for place in 0..parts.len() {
            let part = parts[place];
            if part.contains(&a) && part.contains(&b) {
                let with = |end| part.map(|corner| if corner == end { point } else { corner });
                parts[place] = with(b);
                parts.push(with(a));
            }
        }
    }
    parts
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
