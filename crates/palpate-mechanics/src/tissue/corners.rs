//! Which corners of the tetrahedra in their groups are a node.

use super::group::{Layout, PADDING};
use super::wide::LANES;

/// The corners of each node, in the order of the groups, as places in the buffer of corner forces: the x
/// force stands there, y and z follow at [`LANES`].
#[derive(Debug)]
pub(super) struct NodeCorners {
    starts: Vec<u32>,
    places: Vec<u32>,
}

impl NodeCorners {
    pub(super) fn new(layout: &Layout, node_count: usize) -> Self {
        let corners = || {
            let groups = layout.groups.iter().zip(&layout.members).enumerate();
            groups.flat_map(|(index, (group, members))| {
                group.corners.iter().enumerate().flat_map(move |(corner, nodes)| {
                    let lanes = nodes.iter().zip(members).enumerate();
                    let filled = lanes.filter(|(_, (_, member))| **member != PADDING);
                    filled.map(move |(lane, (&node, _))| {
                        (node as usize, (((4 * index + corner) * 3) * LANES + lane) as u32)
                    })
                })
            })
        };
        let mut starts = vec![0; node_count + 1];
        for (node, _) in corners() {
            starts[node + 1] += 1;
        }
        for node in 0..node_count {
            starts[node + 1] += starts[node];
        }
        let mut places = vec![0; starts[node_count] as usize];
        let mut next = starts.clone();
        for (node, place) in corners() {
            places[next[node] as usize] = place;
            next[node] += 1;
        }
        Self { starts, places }
    }

    pub(super) fn of(&self, node: usize) -> &[u32] {
        &self.places[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// Group, corner and lane of a place.
    pub(super) fn corner_at(place: u32) -> [usize; 3] {
        let place = place as usize;
        [place / (12 * LANES), place / (3 * LANES) % 4, place % LANES]
    }
}
