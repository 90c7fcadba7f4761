//! Boxes of tetrahedra, and all that must hold after a cut.

use std::collections::BTreeMap;

use palpate_cutting::{Blade, Cut, CutOptions, cut, cut_on};
use palpate_geometry::{Point, tetrahedron, vec3};
use palpate_model::{Mesh, MeshData, NodeOrigin};
use palpate_testing::{Fastest, Random, box_of_cells};

/// A box of `cells` unit cells of six tetrahedra, one corner at the origin, inner nodes moved by up
/// to `jitter` of a cell; every tetrahedron is a region and has a fibre of its own.
pub(crate) fn box_mesh(cells: [usize; 3], jitter: f64, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::First, |at| {
        std::array::from_fn(|axis| {
            let offset = jitter * random.between(-1.0, 1.0);
            let is_inner = 0.0 < at[axis] && at[axis] < cells[axis] as f64;
            at[axis] + if is_inner { offset } else { 0.0 }
        })
    });
    let count = tetrahedra.len();
    let on_floor = |point: &Point| point[2] == 0.0;
    let floor = (0..).zip(&nodes).filter(|(_, point)| on_floor(point)).map(|(node, _)| node);
    Mesh::new(MeshData {
        node_sets: BTreeMap::from([("floor".into(), floor.collect())]),
        nodes,
        tetrahedra,
        regions: (0..count as i32).collect(),
        fibres: [(0..count).map(|k| [1.0, k as f64, 0.0]).collect(), Vec::new()],
        ..MeshData::default()
    })
    .expect("a box")
}

/// Cuts, and checks everything that must hold whatever the blade. The parts of a blade are checked
/// one after the other as well: the later ones may split a lip that an earlier one left, so that
/// what they leave together has lips that are no images of each other.
pub(crate) fn checked_cut(
    old: &Mesh,
    positions: &[Point],
    blade: &Blade,
    options: &CutOptions,
) -> Option<Cut> {
    let done = cut(old, positions, blade, options).unwrap()?;
    check_origins(old, positions, &done);
    check_parts(old, &done, options);
    check_report(old, &done);
    let parts = blade.parts();
    if parts.len() == 1 {
        check_conformity(old, &done);
    } else {
        let (mut mesh, mut positions) = (old.clone(), positions.to_vec());
        for part in parts {
            if let Some(done) = checked_cut(&mesh, &positions, &part, options) {
                (mesh, positions) = ((*done.change.mesh).clone(), done.positions);
            }
        }
    }
    Some(done)
}

/// The same for a cut that goes on with what an earlier one left pending.
pub(crate) fn checked_cut_on(
    old: &Mesh,
    positions: &[Point],
    blade: &Blade,
    pending: &[[u32; 3]],
    options: &CutOptions,
) -> Option<Cut> {
    assert_eq!(blade.parts().len(), 1);
    let done = cut_on(old, positions, blade, pending, options).unwrap()?;
    check_origins(old, positions, &done);
    check_parts(old, &done, options);
    check_report(old, &done);
    check_conformity(old, &done);
    let mut uses: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for corners in done.change.mesh.tetrahedra() {
        for face in palpate_model::TETRAHEDRON_FACES {
            let mut key = face.map(|corner| corners[corner]);
            key.sort_unstable();
            *uses.entry(key).or_default() += 1;
        }
    }
    assert!(done.pending.iter().all(|face| uses.get(face) == Some(&2)));
    check_ends(&done, blade, options);
    Some(done)
}

/// The same blade at the same place has soon nothing left to cut.
fn check_ends(done: &Cut, blade: &Blade, options: &CutOptions) {
    let mut last = done.clone();
    for _ in 0..8 {
        let mesh = &last.change.mesh;
        match cut_on(mesh, &last.positions, blade, &last.pending, options).unwrap() {
            Some(next) => last = next,
            None => return,
        }
    }
    panic!("it goes on cutting at the same place");
}

fn check_report(old: &Mesh, cut: &Cut) {
    let new = &cut.change.mesh;
    let report = &cut.report;
    assert_eq!(report.new_nodes, new.nodes().len() - old.nodes().len());
    assert_eq!(report.new_tetrahedra, new.tetrahedra().len() - old.tetrahedra().len());
    assert_eq!(report.pieces, new.pieces().len());
    assert!(report.volume_change.abs() < 1e-12, "{report:?}");
    assert!(report.pieces >= report.pieces_before, "{report:?}");
    assert!(report.cut_area > 0.0 || !cut.pending.is_empty(), "{report:?}");
}

fn check_origins(old: &Mesh, positions: &[Point], cut: &Cut) {
    let change = &cut.change;
    assert_eq!(change.positions(old.nodes()), change.mesh.nodes(), "rest positions");
    assert_eq!(change.positions(positions), cut.positions, "present positions");
    for (corners, &parent) in change.mesh.tetrahedra().iter().zip(&change.tetrahedra) {
        let parent = old.tetrahedra()[parent as usize];
        for &node in corners {
            let origin = &change.nodes[node as usize];
            assert!((origin.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(origin.weights.iter().all(|weight| (0.0..=1.0).contains(weight)));
            assert!(origin.parts().all(|(node, _)| parent.contains(&node)), "{origin:?}");
        }
    }
    // Old nodes keep their numbers.
    for node in 0..old.nodes().len() as u32 {
        assert_eq!(change.nodes[node as usize].kept_node(), Some(node));
    }
    let Some(was) = old.node_sets().get("floor") else {
        return;
    };
    let fixed = |set: &[u32], node: u32| set.binary_search(&node).is_ok();
    let is = &change.mesh.node_sets()["floor"];
    for (node, origin) in (0..).zip(&change.nodes) {
        assert_eq!(fixed(is, node), origin.parts().all(|(old, _)| fixed(was, old)));
    }
}

fn check_parts(old: &Mesh, cut: &Cut, options: &CutOptions) {
    let change = &cut.change;
    let mut volumes = vec![0.0; old.tetrahedra().len()];
    let mut smallest = f64::INFINITY;
    for (part, &parent) in change.tetrahedra.iter().enumerate() {
        let corners = change.mesh.tetrahedron_corners(part);
        assert_eq!(tetrahedron::orientation(&corners), 1);
        volumes[parent as usize] += tetrahedron::signed_volume(&corners);
        assert_eq!(change.mesh.regions().get(part), old.regions().get(parent as usize));
        assert_eq!(change.mesh.fibres()[0].get(part), old.fibres()[0].get(parent as usize));
        let whole = old.tetrahedron_corners(parent as usize);
        if corners != whole {
            let found = tetrahedron::radius_ratio(&corners);
            smallest = found.min(smallest);
            let bound = options.min_quality.min(tetrahedron::radius_ratio(&whole));
            assert!(found >= 0.999_999 * bound, "tetrahedron {part}: {found} below {bound}");
        }
    }
    assert_eq!(cut.report.smallest_quality.unwrap_or(f64::INFINITY), smallest);
    for (parent, volume) in volumes.into_iter().enumerate() {
        let whole = tetrahedron::signed_volume(&old.tetrahedron_corners(parent));
        assert!((volume - whole).abs() < 1e-12 * whole.abs(), "tetrahedron {parent}");
    }
}

/// The surface is the old one, and lips that are each other's image: a node that hangs on a
/// neighbour's edge or face would leave surface without an image.
fn check_conformity(old: &Mesh, cut: &Cut) {
    let change = &cut.change;
    let new = &change.mesh;
    assert_no_face_is_shared_by_three(new);
    // Looking only at what has changed finds the surface that all tetrahedra have.
    assert_eq!(**new, Mesh::new((**new).clone().into_data()).unwrap());
    let mut old_of: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for (triangle, &owner) in old.triangles().iter().zip(old.triangle_owners()) {
        old_of.entry(owner).or_default().push(*triangle);
    }
    let mut outside = 0.0;
    let mut lips: BTreeMap<Vec<String>, usize> = BTreeMap::new();
    for (triangle, &owner) in new.triangles().iter().zip(new.triangle_owners()) {
        let origins = triangle.map(|node| change.nodes[node as usize]);
        let is_in = |face: &[u32; 3]| {
            origins.iter().all(|origin| origin.parts().all(|(node, _)| face.contains(&node)))
        };
        let of_parent = old_of.get(&change.tetrahedra[owner as usize]);
        if of_parent.is_some_and(|faces| faces.iter().any(is_in)) {
            outside += area(new, triangle);
        } else {
            let mut key: Vec<_> = origins.iter().map(origin_key).collect();
            key.sort_unstable();
            *lips.entry(key).or_default() += 1;
        }
    }
    assert!(lips.values().all(|&count| count == 2), "a lip without an image");
    let before: f64 = old.triangles().iter().map(|triangle| area(old, triangle)).sum();
    assert!((outside - before).abs() < 1e-10 * before, "{outside} of {before}");
}

/// The same for the copies of a node, however their shares are ordered.
fn origin_key(origin: &NodeOrigin) -> String {
    let mut parts: Vec<_> = origin.parts().collect();
    parts.sort_unstable_by_key(|&(node, _)| node);
    format!("{parts:?}")
}

fn area(mesh: &Mesh, triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|node| mesh.nodes()[node as usize]);
    0.5 * vec3::norm(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))
}

fn assert_no_face_is_shared_by_three(mesh: &Mesh) {
    let mut uses: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    for corners in mesh.tetrahedra() {
        for face in palpate_model::TETRAHEDRON_FACES {
            let mut key = face.map(|corner| corners[corner]);
            key.sort_unstable();
            *uses.entry(key).or_default() += 1;
        }
    }
    assert!(uses.values().all(|&count| count <= 2));
}
