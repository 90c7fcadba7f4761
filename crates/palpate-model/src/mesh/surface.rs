//! The surface of a tetrahedral mesh: faces of exactly one tetrahedron, and their edges.

/// Faces of the tetrahedron (a, b, c, d), outward when its volume is positive.
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// Faces that belong to exactly one tetrahedron, outward, with their owners, in tetrahedron order.
pub(super) fn boundary_faces(tetrahedra: &[[u32; 4]]) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut faces: Vec<([u32; 3], u32)> = Vec::with_capacity(4 * tetrahedra.len());
    for (tetrahedron, nodes) in tetrahedra.iter().enumerate() {
        for (side, corners) in FACES.iter().enumerate() {
            let mut key = corners.map(|corner| nodes[corner]);
            key.sort_unstable();
            faces.push((key, (4 * tetrahedron + side) as u32));
        }
    }
    faces.sort_unstable();
    let mut boundary: Vec<u32> = Vec::new();
    for run in faces.chunk_by(|left, right| left.0 == right.0) {
        if let [(_, face)] = run {
            boundary.push(*face);
        }
    }
    boundary.sort_unstable();
    let triangles = boundary
        .iter()
        .map(|&face| FACES[face as usize % 4].map(|corner| tetrahedra[face as usize / 4][corner]))
        .collect();
    (triangles, boundary.iter().map(|&face| face / 4).collect())
}

/// Sorted indices of the nodes that some triangle uses.
pub(super) fn used_nodes(triangles: &[[u32; 3]], node_count: usize) -> Vec<u32> {
    let mut used = vec![false; node_count];
    for &node in triangles.as_flattened() {
        used[node as usize] = true;
    }
    (0..node_count as u32).filter(|&node| used[node as usize]).collect()
}

/// Unique edges (smaller node first, sorted), and for each triangle its edges ab, bc, ca.
pub(super) fn edges(triangles: &[[u32; 3]]) -> (Vec<[u32; 2]>, Vec<[u32; 3]>) {
    let edge_of = |triangle: &[u32; 3], side: usize| {
        let (first, second) = (triangle[side], triangle[(side + 1) % 3]);
        [first.min(second), first.max(second)]
    };
    let mut unique: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|triangle| (0..3).map(move |side| edge_of(triangle, side)))
        .collect();
    unique.sort_unstable();
    unique.dedup();
    let index =
        |edge: [u32; 2]| unique.binary_search(&edge).expect("every edge was collected") as u32;
    let of_triangle = triangles
        .iter()
        .map(|triangle| std::array::from_fn(|side| index(edge_of(triangle, side))))
        .collect();
    (unique, of_triangle)
}
