//! The exact test of two surface triangles of one body that share nodes.

use palpate_geometry::{
    Point, triangles_intersect, triangles_intersect_beyond_edge, triangles_intersect_beyond_node,
};

use crate::frame::SceneBody;

/// Corners of a triangle, those in a set (bits 0 to 2) first.
const FIRST: [[usize; 3]; 8] =
    [[0, 1, 2], [0, 1, 2], [1, 2, 0], [0, 1, 2], [2, 0, 1], [2, 0, 1], [1, 2, 0], [0, 1, 2]];

/// Whether two triangles of one body meet outside the nodes and the edge that they share. Those with
/// the same three nodes always do.
pub(crate) fn neighbours_meet(body: &SceneBody, [a, b]: [u32; 2]) -> bool {
    let (nodes_a, nodes_b) = (body.mesh.triangles()[a as usize], body.mesh.triangles()[b as usize]);
    let shared = shared_corners(nodes_a, nodes_b);
    let a = shared_first(body, nodes_a, shared);
    let b = shared_first(body, nodes_b, shared_corners(nodes_b, nodes_a));
    match shared.count_ones() {
        0 => triangles_intersect(&a, &b),
        1 => triangles_intersect_beyond_node(&a, &b),
        2 => triangles_intersect_beyond_edge(&[a[0], a[1]], a[2], b[2]),
        _ => true,
    }
}

/// The corners of a triangle that are also another's: bits 0 to 2.
fn shared_corners(nodes: [u32; 3], other: [u32; 3]) -> u32 {
    let is_shared = |corner: usize| u32::from(other.contains(&nodes[corner])) << corner;
    is_shared(0) | is_shared(1) | is_shared(2)
}

fn shared_first(body: &SceneBody, nodes: [u32; 3], shared: u32) -> [Point; 3] {
    let [first, second, third] = FIRST[shared as usize];
    let at = |corner: usize| body.positions[nodes[corner] as usize];
    [at(first), at(second), at(third)]
}
