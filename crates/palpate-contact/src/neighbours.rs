//! The exact test of two surface triangles of one body that share nodes.

use palpate_geometry::{
    Point, triangles_intersect, triangles_intersect_beyond_edge, triangles_intersect_beyond_node,
};

use crate::scene::SceneBody;

/// Whether two triangles of one body meet outside the nodes and the edge that they share. Those with
/// the same three nodes always do.
pub(crate) fn neighbours_meet(body: &SceneBody, triangles: [u32; 2]) -> bool {
    let corners = triangles.map(|triangle| body.mesh.triangles()[triangle as usize]);
    let at = |node: u32| -> Point { body.positions[node as usize] };
    let [a, b] = corners;
    // Of each: the shared nodes first.
    let [a, b] = [shared_first(a, b), shared_first(b, a)];
    let edge = || [at(a.nodes[0]), at(a.nodes[1])];
    match a.shared {
        0 => triangles_intersect(&a.nodes.map(at), &b.nodes.map(at)),
        1 => triangles_intersect_beyond_node(&a.nodes.map(at), &b.nodes.map(at)),
        2 => triangles_intersect_beyond_edge(&edge(), at(a.nodes[2]), at(b.nodes[2])),
        _ => true,
    }
}

struct SharedFirst {
    nodes: [u32; 3],
    shared: usize,
}

fn shared_first(mut nodes: [u32; 3], other: [u32; 3]) -> SharedFirst {
    nodes.sort_unstable_by_key(|node| (!other.contains(node), *node));
    SharedFirst { nodes, shared: nodes.iter().filter(|node| other.contains(node)).count() }
}
