//! The surface of a tetrahedral mesh: faces of exactly one tetrahedron, and their edges.

/// Faces of the tetrahedron (a, b, c, d), outward when its volume is positive: face `k` is opposite
/// to node `3 - k`.
pub const TETRAHEDRON_FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// Calls `visit` once for every distinct face, with all its occurrences as `4 * tetrahedron + face`
/// in rising order.
///
/// Faces are bucketed by their smallest node, so that millions of tetrahedra need one 4-byte entry
/// per face beside their own array. O(m) for bounded node degree.
pub(super) fn for_each_face(
    tetrahedra: &[[u32; 4]],
    node_count: usize,
    mut visit: impl FnMut(&[u32]),
) {
    let (offsets, faces) = bucket_by_smallest_node(tetrahedra, node_count);
    // One number each sorts fastest: middle node, largest node, face.
    let mut keyed: Vec<u128> = Vec::new();
    let mut same: Vec<u32> = Vec::new();
    for bucket in offsets.windows(2) {
        keyed.clear();
        keyed.extend(faces[bucket[0] as usize..bucket[1] as usize].iter().map(|&face| {
            let [_, middle, largest] = sorted_face(tetrahedra, face);
            u128::from(middle) << 64 | u128::from(largest) << 32 | u128::from(face)
        }));
        keyed.sort_unstable();
        for run in keyed.chunk_by(|left, right| left >> 32 == right >> 32) {
            same.clear();
            same.extend(run.iter().map(|&key| key as u32));
            visit(&same);
        }
    }
}

/// Counting sort of all faces by their smallest node.
fn bucket_by_smallest_node(tetrahedra: &[[u32; 4]], node_count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0_u32; node_count + 1];
    let all_faces = || 0..4 * tetrahedra.len() as u32;
    for face in all_faces() {
        offsets[sorted_face(tetrahedra, face)[0] as usize] += 1;
    }
    let mut total = 0;
    for offset in &mut offsets {
        total += *offset;
        *offset = total;
    }
    let mut faces = vec![0; 4 * tetrahedra.len()];
    for face in all_faces().rev() {
        let slot = &mut offsets[sorted_face(tetrahedra, face)[0] as usize];
        *slot -= 1;
        faces[*slot as usize] = face;
    }
    (offsets, faces)
}

fn sorted_face(tetrahedra: &[[u32; 4]], face: u32) -> [u32; 3] {
    let mut key = face_nodes(tetrahedra, face);
    key.sort_unstable();
    key
}

fn face_nodes(tetrahedra: &[[u32; 4]], face: u32) -> [u32; 3] {
    TETRAHEDRON_FACES[face as usize % 4].map(|corner| tetrahedra[face as usize / 4][corner])
}

/// Faces that belong to exactly one tetrahedron, outward, with their owners, in tetrahedron order.
pub(super) fn boundary_faces(
    tetrahedra: &[[u32; 4]],
    node_count: usize,
) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut boundary: Vec<u32> = Vec::new();
    for_each_face(tetrahedra, node_count, |occurrences| {
        if let [face] = occurrences {
            boundary.push(*face);
        }
    });
    boundary.sort_unstable();
    let triangles = boundary.iter().map(|&face| face_nodes(tetrahedra, face)).collect();
    (triangles, boundary.iter().map(|&face| face / 4).collect())
}

/// The same after some tetrahedra have changed, from the faces `before` of those that have not, in
/// tetrahedron order.
///
/// Tetrahedra that share a face with a changed one must have kept it or have changed as well.
pub(super) fn boundary_faces_after(
    before: (&[[u32; 3]], &[u32]),
    tetrahedra: &[[u32; 4]],
    is_changed: &[bool],
    node_count: usize,
) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut is_near = vec![false; node_count];
    for (nodes, _) in tetrahedra.iter().zip(is_changed).filter(|(_, changed)| **changed) {
        for &node in nodes {
            is_near[node as usize] = true;
        }
    }
    // A face and its number in one, which sorts fastest.
    let mut keyed: Vec<u128> = Vec::new();
    for (tetrahedron, nodes) in (0..).zip(tetrahedra) {
        if nodes.iter().filter(|&&node| is_near[node as usize]).count() < 3 {
            continue;
        }
        for face in 4 * tetrahedron..4 * tetrahedron + 4 {
            let [smallest, middle, largest] = sorted_face(tetrahedra, face);
            if [smallest, middle, largest].iter().all(|&node| is_near[node as usize]) {
                let nodes = u128::from(smallest) << 64 | u128::from(middle) << 32;
                keyed.push((nodes | u128::from(largest)) << 32 | u128::from(face));
            }
        }
    }
    keyed.sort_unstable();
    let mut found: Vec<u32> = keyed
        .chunk_by(|left, right| left >> 32 == right >> 32)
        .filter(|same| same.len() == 1)
        .map(|same| same[0] as u32)
        .filter(|&face| is_changed[face as usize / 4])
        .collect();
    found.sort_unstable();

    let (triangles, owners) = before;
    let mut kept = (triangles.iter().zip(owners))
        .filter(|&(_, &owner)| !is_changed[owner as usize])
        .map(|(&triangle, &owner)| (triangle, owner))
        .peekable();
    let mut merged = (Vec::new(), Vec::new());
    let mut push = |(triangle, owner): ([u32; 3], u32)| {
        merged.0.push(triangle);
        merged.1.push(owner);
    };
    for face in found {
        while let Some(earlier) = kept.next_if(|&(_, owner)| owner < face / 4) {
            push(earlier);
        }
        push((face_nodes(tetrahedra, face), face / 4));
    }
    kept.for_each(push);
    merged
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
    // Both nodes in one number, which sorts as the pair does.
    let key_of = |triangle: &[u32; 3], side: usize| {
        let (first, second) = (triangle[side], triangle[(side + 1) % 3]);
        u64::from(first.min(second)) << 32 | u64::from(first.max(second))
    };
    let mut unique: Vec<u64> = triangles
        .iter()
        .flat_map(|triangle| (0..3).map(move |side| key_of(triangle, side)))
        .collect();
    unique.sort_unstable();
    unique.dedup();
    let index = |key: u64| unique.binary_search(&key).expect("every edge was collected") as u32;
    let of_triangle = triangles
        .iter()
        .map(|triangle| std::array::from_fn(|side| index(key_of(triangle, side))))
        .collect();
    (unique.iter().map(|&key| [(key >> 32) as u32, key as u32]).collect(), of_triangle)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    /// The obvious extraction: every face against every other.
    fn boundary_by_map(tetrahedra: &[[u32; 4]]) -> (Vec<[u32; 3]>, Vec<u32>) {
        let mut occurrences: BTreeMap<[u32; 3], usize> = BTreeMap::new();
        let faces = || {
            tetrahedra.iter().enumerate().flat_map(|(owner, nodes)| {
                TETRAHEDRON_FACES.map(|corners| (corners.map(|corner| nodes[corner]), owner))
            })
        };
        let key = |face: [u32; 3]| {
            let mut sorted = face;
            sorted.sort_unstable();
            sorted
        };
        for (face, _) in faces() {
            *occurrences.entry(key(face)).or_default() += 1;
        }
        faces()
            .filter(|(face, _)| occurrences[&key(*face)] == 1)
            .map(|(face, owner)| (face, owner as u32))
            .unzip()
    }

    proptest! {
        #[test]
        fn bucketed_extraction_agrees_with_a_map_of_all_faces(
            tetrahedra in proptest::collection::vec(
                proptest::sample::subsequence((0_u32..12).collect::<Vec<_>>(), 4).prop_shuffle(),
                0..60,
            ),
        ) {
            let tetrahedra: Vec<[u32; 4]> =
                tetrahedra.iter().map(|nodes| nodes.as_slice().try_into().unwrap()).collect();
            prop_assert_eq!(boundary_faces(&tetrahedra, 12), boundary_by_map(&tetrahedra));
        }
    }
}
