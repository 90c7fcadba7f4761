//! Opens the faces that lie on the sheet between its two sides, by copying nodes.

use palpate_geometry::{tetrahedron, vec3};
use palpate_model::{DisjointSets, TETRAHEDRON_FACES};

use crate::crossing::Sides;
use crate::draft::Draft;

/// What was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Opened {
    /// Area [m²] of one lip, at present positions.
    pub(crate) area: f64,
    /// Largest distance [m] of a node of the lips from the blade's surface, continued beyond its
    /// border.
    pub(crate) deviation: f64,
}

/// A face that is opened.
#[derive(Clone, Copy)]
struct CutFace {
    /// Sorted.
    nodes: [u32; 3],
    /// The tetrahedra that it joined.
    tetrahedra: [u32; 2],
    /// Cut before, but not yet opened.
    is_pending: bool,
}

/// What is left of the sides of a cut face.
enum Outcome {
    /// They came apart: the nodes of neither are all those of the other.
    Open,
    /// They hang together by these nodes, sorted.
    Joined([u32; 3]),
}

/// The mesh with every face opened that lies on the sheet, has tetrahedra of both sides, and of
/// which at least one is touched or the sheet covers the face; `None` when nothing comes apart.
///
/// Around each node of such faces, tetrahedra that are still joined by other faces keep one copy of
/// the node: at the end of a partial cut all of them are, and it stays closed. Pieces of less
/// volume at rest than `min_volume` [m³] are left where they were.
pub(crate) fn open<'a>(
    draft: &Draft<'a>,
    is_touched: &[bool],
    covered: &[[u32; 3]],
    sides: &mut Sides,
    min_volume: f64,
    keeps_pending: bool,
) -> Option<(Draft<'a>, Opened)> {
    let mut cut = faces_to_open(draft, is_touched, covered, sides);
    let mut opened = Opened::default();
    loop {
        let mut is_marked = vec![false; draft.positions.len()];
        for &node in cut.iter().flat_map(|face| &face.nodes) {
            is_marked[node as usize] = true;
        }
        let mut next = draft.clone();
        let copies = copy_nodes(&mut next, &cut, &is_marked);
        if cut.iter().all(|face| face.is_pending) || (copies == 0 && !keeps_pending) {
            return None;
        }
        let flakes = flakes(&next, &cut, min_volume);
        let before = cut.len();
        cut.retain(|face| {
            let flake = face.tetrahedra.iter().find(|side| flakes.binary_search(side).is_ok());
            for &node in flake.iter().flat_map(|&&side| &draft.tetrahedra[side as usize]) {
                let height = sides.of(node, &draft.positions).height;
                opened.deviation = opened.deviation.max(height.abs());
            }
            flake.is_none()
        });
        if cut.len() == before {
            next.pending = settle(draft, &next, &cut, sides, &mut opened);
            return Some((next, opened));
        }
    }
}

/// Measures the faces that came apart; returns the others, sorted.
fn settle(
    draft: &Draft,
    next: &Draft,
    cut: &[CutFace],
    sides: &mut Sides,
    opened: &mut Opened,
) -> Vec<[u32; 3]> {
    let mut pending = Vec::new();
    for face in cut {
        match outcome(draft, next, face) {
            Outcome::Joined(nodes) => pending.push(nodes),
            Outcome::Open => {
                let [a, b, c] = face.nodes.map(|node| draft.positions[node as usize]);
                opened.area += 0.5 * vec3::norm(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)));
                for node in face.nodes {
                    let height = sides.of(node, &draft.positions).height;
                    opened.deviation = opened.deviation.max(height.abs());
                }
            }
        }
    }
    pending.sort_unstable();
    pending
}

fn outcome(draft: &Draft, next: &Draft, face: &CutFace) -> Outcome {
    let [left, right] = face.tetrahedra.map(|tetrahedron| {
        let nodes = &draft.tetrahedra[tetrahedron as usize];
        face.nodes.map(|node| {
            let corner = nodes.iter().position(|&other| other == node);
            next.tetrahedra[tetrahedron as usize][corner.expect("a node of its face")]
        })
    });
    if left == right { Outcome::Joined(sorted(left)) } else { Outcome::Open }
}

/// The tetrahedra at the cut that are part of too small a piece, sorted.
fn flakes(draft: &Draft, cut: &[CutFace], min_volume: f64) -> Vec<u32> {
    let mut groups = DisjointSets::new(draft.positions.len());
    for &[a, b, c, d] in &draft.tetrahedra {
        groups.join(a, b);
        groups.join(a, c);
        groups.join(a, d);
    }
    let mut volumes = vec![0.0; draft.positions.len()];
    for nodes in &draft.tetrahedra {
        let corners = nodes.map(|node| draft.rest[node as usize]);
        volumes[groups.root(nodes[0]) as usize] += tetrahedron::signed_volume(&corners);
    }
    let mut small: Vec<u32> = (cut.iter().flat_map(|face| face.tetrahedra))
        .filter(|&side| {
            let piece = groups.root(draft.tetrahedra[side as usize][0]);
            volumes[piece as usize] < min_volume
        })
        .collect();
    small.sort_unstable();
    small
}

/// The faces to open, sorted by nodes.
fn faces_to_open(
    draft: &Draft,
    is_touched: &[bool],
    covered: &[[u32; 3]],
    sides: &mut Sides,
) -> Vec<CutFace> {
    let mut is_candidate: Vec<bool> =
        (0..draft.positions.len() as u32).map(|node| sides.is_on(node)).collect();
    for &node in draft.pending.as_flattened() {
        is_candidate[node as usize] = true;
    }
    let mut faces: Vec<u128> = Vec::new();
    for (tetrahedron, nodes) in draft.tetrahedra.iter().enumerate() {
        let on = nodes.map(|node| is_candidate[node as usize]);
        if on.iter().filter(|&&on| on).count() < 3 {
            continue;
        }
        for face in TETRAHEDRON_FACES.iter().filter(|face| face.iter().all(|&k| on[k])) {
            faces.push(packed(sorted(face.map(|corner| nodes[corner])), tetrahedron as u32));
        }
    }
    faces.sort_unstable();
    let mut cut = Vec::new();
    for same in faces.chunk_by(|left, right| left >> 32 == right >> 32) {
        let &[left, right] = same else {
            continue;
        };
        let (nodes, tetrahedra) = (face_of(left), [left as u32, right as u32]);
        let is_pending = draft.pending.binary_search(&nodes).is_ok();
        if is_pending || is_crossed(draft, &nodes, tetrahedra, is_touched, covered, sides) {
            cut.push(CutFace { nodes, tetrahedra, is_pending });
        }
    }
    cut
}

/// Whether a face lies on the sheet between its sides, where the sheet reaches.
fn is_crossed(
    draft: &Draft,
    nodes: &[u32; 3],
    [left, right]: [u32; 2],
    is_touched: &[bool],
    covered: &[[u32; 3]],
    sides: &mut Sides,
) -> bool {
    let is_reached = is_touched[left as usize]
        || is_touched[right as usize]
        || covered.binary_search(nodes).is_ok();
    is_reached
        && nodes.iter().all(|&node| sides.is_on(node))
        && is_above(draft, left, sides) != is_above(draft, right, sides)
}

/// The side of a tetrahedron with at least three nodes on the sheet.
fn is_above(draft: &Draft, tetrahedron: u32, sides: &mut Sides) -> bool {
    let nodes = draft.tetrahedra[tetrahedron as usize];
    let found = nodes.map(|node| sides.of(node, &draft.positions));
    match found.iter().find(|side| side.sign != 0) {
        Some(side) => side.sign > 0,
        // All were taken to lie on it: where the middle is.
        None => found.iter().map(|side| side.height).sum::<f64>() >= 0.0,
    }
}

/// Gives each group of tetrahedra around a marked node its own copy; returns how many were made.
fn copy_nodes(draft: &mut Draft, cut: &[CutFace], is_marked: &[bool]) -> usize {
    let has_marked = |nodes: &[u32]| nodes.iter().any(|&node| is_marked[node as usize]);
    let around: Vec<u32> = (0..draft.tetrahedra.len() as u32)
        .filter(|&tetrahedron| has_marked(&draft.tetrahedra[tetrahedron as usize]))
        .collect();
    let mut faces: Vec<u128> = Vec::with_capacity(4 * around.len());
    for (place, &tetrahedron) in around.iter().enumerate() {
        let nodes = draft.tetrahedra[tetrahedron as usize];
        for face in TETRAHEDRON_FACES {
            let face = sorted(face.map(|corner| nodes[corner]));
            if has_marked(&face) && cut.binary_search_by_key(&face, |cut| cut.nodes).is_err() {
                faces.push(packed(face, place as u32));
            }
        }
    }
    faces.sort_unstable();

    // A slot is a corner of a tetrahedron; those that a face joins use one copy.
    let mut slots = DisjointSets::new(4 * around.len());
    let slot = |place: u32, node: u32| {
        let nodes = draft.tetrahedra[around[place as usize] as usize];
        let corner = nodes.iter().position(|&other| other == node).expect("a node of its face");
        4 * place + corner as u32
    };
    for same in faces.chunk_by(|left, right| left >> 32 == right >> 32) {
        for pair in same.windows(2) {
            for node in face_of(pair[0]) {
                if is_marked[node as usize] {
                    slots.join(slot(pair[0] as u32, node), slot(pair[1] as u32, node));
                }
            }
        }
    }

    let mut is_taken = vec![false; is_marked.len()];
    let mut node_of_group = vec![u32::MAX; 4 * around.len()];
    let mut copies = 0;
    for (place, &tetrahedron) in around.iter().enumerate() {
        for corner in 0..4 {
            let node = draft.tetrahedra[tetrahedron as usize][corner];
            if !is_marked.get(node as usize).is_some_and(|&marked| marked) {
                continue;
            }
            let group = slots.root(4 * place as u32 + corner as u32) as usize;
            if node_of_group[group] == u32::MAX {
                // The first group keeps the node itself.
                let is_first = !std::mem::replace(&mut is_taken[node as usize], true);
                node_of_group[group] = if is_first {
                    node
                } else {
                    copies += 1;
                    draft.add_node(draft.origins[node as usize])
                };
            }
            draft.tetrahedra[tetrahedron as usize][corner] = node_of_group[group];
        }
    }
    copies
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// A face and one of its tetrahedra in one number, which sorts fastest.
fn packed([a, b, c]: [u32; 3], tetrahedron: u32) -> u128 {
    u128::from(a) << 96 | u128::from(b) << 64 | u128::from(c) << 32 | u128::from(tetrahedron)
}

/// The face of [`packed`]; the tetrahedron is the last 32 bits.
fn face_of(packed: u128) -> [u32; 3] {
    [96, 64, 32].map(|shift| (packed >> shift) as u32)
}
