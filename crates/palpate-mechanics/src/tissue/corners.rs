//! Which corners of the tetrahedra in their groups are a node.

use palpate_model::Lists;

use super::group::{Layout, PADDING};
use super::wide::LANES;

/// The corners of each node, in the order of the groups, as places in the buffer of corner forces: the x
/// force stands there, y and z follow at [`LANES`].
#[derive(Debug)]
pub(super) struct NodeCorners(Lists<u32>);

impl NodeCorners {
    pub(super) fn new(layout: &Layout, node_count: usize) -> Self {
        let groups = layout.groups.iter().zip(&layout.members).enumerate();
        let corners = groups.flat_map(|(index, (group, members))| {
            group.corners.iter().enumerate().flat_map(move |(corner, nodes)| {
                let lanes = nodes.iter().zip(members).enumerate();
                let filled = lanes.filter(|(_, (_, member))| **member != PADDING);
                filled.map(move |(lane, (&node, _))| {
                    (node, (((4 * index + corner) * 3) * LANES + lane) as u32)
                })
            })
        });
        Self(Lists::new(node_count, corners))
    }

    pub(super) fn of(&self, node: usize) -> &[u32] {
        self.0.of(node as u32)
    }

    /// Group, corner and lane of a place.
    pub(super) fn corner_at(place: u32) -> [usize; 3] {
        let place = place as usize;
        [place / (12 * LANES), place / (3 * LANES) % 4, place % LANES]
    }
}
