//! Checks, repair, surface, defects and measures of meshes.

#[path = "support/grid.rs"]
mod grid;

use grid::box_data;
use insta::assert_snapshot;
use palpate_model::{Mesh, MeshData, MeshError, NONE};
use proptest::prelude::*;

const CORNER: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn corner() -> MeshData {
    MeshData { nodes: CORNER.to_vec(), tetrahedra: vec![[0, 1, 2, 3]], ..MeshData::default() }
}

fn surface(nodes: &[[f64; 3]], triangles: &[[u32; 3]]) -> MeshData {
    MeshData { nodes: nodes.to_vec(), triangles: triangles.to_vec(), ..MeshData::default() }
}

fn refusal(data: MeshData) -> String {
    Mesh::new(data).unwrap_err().to_string()
}

#[test]
fn one_tetrahedron_has_four_outward_triangles_and_six_edges() {
    let mesh = Mesh::new(corner()).unwrap();
    assert_eq!(mesh.triangles(), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    assert_eq!(mesh.triangle_owners(), [0; 4]);
    assert_eq!(mesh.surface_edges().len(), 6);
    assert_eq!(mesh.surface_nodes(), [0, 1, 2, 3]);
    assert_eq!(mesh.volume(), 1.0 / 6.0);
    assert_eq!(mesh.tetrahedron_neighbors(), [[NONE; 4]]);
    assert_eq!(mesh.node_triangles().of(3), [1, 2, 3]);
    assert!(mesh.validate().is_empty());
}

#[test]
fn the_surface_of_a_box_is_closed_outward_and_encloses_its_volume() {
    let data = box_data([4, 3, 2], [0.4, 0.3, 0.2]);
    let mesh = Mesh::new(data).unwrap();
    assert!((mesh.volume() - 0.024).abs() < 1e-15);
    let shell = surface(mesh.nodes(), mesh.triangles());
    let shell = Mesh::repaired(shell).unwrap().0;
    assert!((shell.volume() - 0.024).abs() < 1e-15);
    assert!(shell.validate().is_empty(), "{:?}", shell.validate());
    assert!(shell.triangle_owners().is_empty() && shell.is_surface_only());
    assert!(mesh.validate().is_empty(), "{:?}", mesh.validate());
    assert_eq!(mesh.triangles().len(), 2 * 2 * (4 * 3 + 3 * 2 + 4 * 2));
}

#[test]
fn neighbors_are_mutual_and_share_the_face_opposite_to_the_node() {
    let mesh = Mesh::new(box_data([3, 2, 2], [1.0; 3])).unwrap();
    let neighbors = mesh.tetrahedron_neighbors();
    let mut open = 0;
    for (index, row) in neighbors.iter().enumerate() {
        for (corner, &other) in row.iter().enumerate() {
            if other == NONE {
                open += 1;
                continue;
            }
            assert!(neighbors[other as usize].contains(&(index as u32)));
            let nodes = mesh.tetrahedra()[index];
            let shared = (0..4).filter(|&k| k != corner).map(|k| nodes[k]);
            let theirs = mesh.tetrahedra()[other as usize];
            assert!(shared.into_iter().all(|node| theirs.contains(&node)));
            assert!(!theirs.contains(&nodes[corner]));
        }
    }
    assert_eq!(open, mesh.triangles().len());
}

#[test]
fn what_no_repair_can_mend_is_refused_by_both() {
    let mut cases: Vec<(&str, MeshData)> = vec![("empty", MeshData::default())];
    let mut add = |name, change: &dyn Fn(&mut MeshData)| {
        let mut data = corner();
        change(&mut data);
        cases.push((name, data));
    };
    add("not finite", &|data| data.nodes[2][1] = f64::NAN);
    add("out of range", &|data| data.tetrahedra.push([0, 1, 2, 99]));
    add("one too far", &|data| data.tetrahedra[0][3] = 4);
    add("repeated node", &|data| data.tetrahedra.push([3, 1, 2, 1]));
    add("set out of range", &|data| {
        data.node_sets.insert("hilum".into(), vec![7, 2]);
    });
    add("regions", &|data| data.regions = vec![1, 2]);
    add("fibres", &|data| data.fibres[1] = vec![[1.0; 3]; 3]);
    add("odd fibre", &|data| data.fibres[0] = vec![[0.0, f64::INFINITY, 0.0]]);
    add("both kinds", &|data| data.triangles = vec![[0, 1, 2]]);
    let text: Vec<String> = cases
        .into_iter()
        .map(|(name, data)| {
            let repaired = Mesh::repaired(data.clone()).unwrap_err();
            assert_eq!(format!("{repaired:?}"), format!("{:?}", Mesh::new(data).unwrap_err()));
            format!("{name}: {repaired}")
        })
        .collect();
    assert_snapshot!(text.join("\n"), @r"
    empty: the mesh has neither tetrahedra nor triangles; give one of them
    not finite: node 2: position (0, NaN, 0) is not finite; give coordinates in metres
    out of range: tetrahedron 1: node index 99 is out of range (the mesh has 4 nodes)
    one too far: tetrahedron 0: node index 4 is out of range (the mesh has 4 nodes, counted from 0)
    repeated node: tetrahedron 1: node 1 is named twice; name different nodes
    set out of range: set `hilum`: node index 7 is out of range (the mesh has 4 nodes)
    regions: 2 region numbers for 1 tetrahedra; give one for each, or none
    fibres: 3 fibre directions for 1 tetrahedra; give one for each, or none
    odd fibre: the fibre direction of tetrahedron 0 is not finite; 0,0,0 is for none
    both kinds: the mesh has both tetrahedra and triangles; leave the triangles out, the surface of the tetrahedra is found from them
    ");
}

#[test]
fn inverted_flat_and_repeated_tetrahedra_are_refused_and_repaired() {
    let mut data = box_data([2, 1, 1], [1.0; 3]);
    let sound = data.clone();
    data.regions = (0..data.tetrahedra.len() as i32).collect();
    data.tetrahedra[3].swap(0, 1);
    assert_snapshot!(refusal(data.clone()), @"1 tetrahedron is inverted (negative volume): 3; repair re-orients them");

    let flat = data.nodes.len() as u32;
    data.nodes.extend([[9.0; 3], [0.25, 0.25, 0.0]]);
    // The bottom face of the box holds nodes 0, 1 and 3 and the new one.
    data.tetrahedra.insert(0, [0, 1, 3, flat + 1]);
    data.regions.insert(0, -1);
    data.fibres[0] = data.regions.iter().map(|&region| [f64::from(region), 1.0, 0.0]).collect();
    data.tetrahedra.push([
        data.tetrahedra[2][1],
        data.tetrahedra[2][0],
        data.tetrahedra[2][3],
        data.tetrahedra[2][2],
    ]);
    data.regions.push(-2);
    data.fibres[0].push([0.0; 3]);
    data.node_sets.insert("some".into(), vec![flat + 1, flat, 2, 1, 1]);

    let (mesh, report) = Mesh::repaired(data).unwrap();
    assert_snapshot!(report.to_string(), @"re-oriented 1 inverted tetrahedron: 4; dropped 1 flat tetrahedron: 0; dropped 1 repeated element: 13; dropped 2 unused nodes: 12, 13");
    assert_eq!(mesh.nodes(), sound.nodes);
    assert_eq!(mesh.tetrahedra().len(), sound.tetrahedra.len());
    assert_eq!(mesh.regions(), (0..sound.tetrahedra.len() as i32).collect::<Vec<_>>());
    let followed = |(fibre, &region): (&[f64; 3], &i32)| fibre[0] == f64::from(region);
    assert!(mesh.fibres()[0].iter().zip(mesh.regions()).all(followed));
    assert_eq!(mesh.node_sets()["some"], [1, 2]);
    assert!((mesh.volume() - 1.0).abs() < 1e-15);
    let again = Mesh::repaired(mesh.clone().into_data()).unwrap();
    assert!(again.0 == mesh && again.1.is_empty());
}

#[test]
fn strict_refusals_name_the_first_few_and_the_count() {
    let mut data = box_data([5, 1, 1], [1.0; 3]);
    data.tetrahedra.iter_mut().for_each(|tetrahedron| tetrahedron.swap(1, 2));
    assert_snapshot!(refusal(data), @"30 tetrahedra are inverted (negative volume): 0, 1, 2, 3, 4, 5, 6, 7, ...; repair re-orients them");
    let mut data = corner();
    data.nodes[3] = [0.5, 0.5, 0.0];
    assert_snapshot!(refusal(data.clone()), @"1 tetrahedron is flat (zero volume): 0; repair drops them");
    assert_snapshot!(Mesh::repaired(data).unwrap_err(), @"no tetrahedron is left after repair: all 1 were flat or repeated");
    let mut data = corner();
    data.tetrahedra.push([1, 2, 0, 3]);
    assert_snapshot!(refusal(data), @"1 tetrahedron has the same four nodes as an earlier one: 1; repair drops them");
    assert_snapshot!(refusal(surface(&CORNER, &[[0, 1, 2], [0, 1, 3], [2, 1, 0]])), @"1 triangle has the same three nodes as an earlier one: 2; repair drops them");
}

#[test]
fn a_tetrahedron_thinner_than_rounding_is_judged_exactly() {
    let mut data = corner();
    // (a, b, c, d) with d above the plane of a, b, c by less than the rounding of the determinant.
    data.nodes = vec![[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.1, 0.3, 0.1], [0.2, 0.2, 0.1]];
    assert!(matches!(Mesh::new(data.clone()), Err(MeshError::Degenerate(_))));
    data.nodes[3][2] = 0.1_f64.next_up();
    assert!(Mesh::new(data.clone()).is_ok());
    data.nodes[3][2] = 0.1_f64.next_down();
    assert!(matches!(Mesh::new(data), Err(MeshError::Inverted(_))));
}

#[test]
fn suspicious_meshes_are_described() {
    let mut text = Vec::new();
    let mut describe = |name: &str, data: MeshData| {
        let mesh = Mesh::new(data).unwrap();
        for defect in mesh.validate() {
            text.push(format!("{name}: {defect}"));
        }
    };
    let mut unused = corner();
    unused.nodes.push([3.0; 3]);
    unused.nodes.push([0.0, -0.0, 0.0]);
    describe("unused", unused);

    let mut by_edge = corner();
    by_edge.nodes.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
    by_edge.tetrahedra.push([0, 4, 5, 3]);
    describe("by an edge", by_edge);

    let mut by_point = corner();
    by_point.nodes.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
    by_point.tetrahedra.push([0, 5, 4, 6]);
    describe("by a point", by_point);

    let mut apart = corner();
    apart.nodes.extend(CORNER.map(|[x, y, z]| [x + 5.0, y, z]));
    apart.tetrahedra.push([4, 5, 6, 7]);
    describe("apart", apart);

    let mut crowded = corner();
    crowded.nodes.extend([[0.1, 0.1, 2.0], [0.0, 0.0, -1.0]]);
    crowded.tetrahedra.extend([[0, 1, 2, 4], [0, 2, 1, 5]]);
    describe("crowded", crowded);

    let mut sliver = corner();
    sliver.nodes[3] = [0.6, 0.6, 1e-3];
    describe("sliver", sliver);

    describe("open", surface(&CORNER, &[[0, 1, 2]]));
    describe("opposite", surface(&CORNER, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 3, 2]]));
    describe("line", surface(&[[0.0; 3], [1.0; 3], [2.0; 3]], &[[0, 1, 2]]));
    assert_snapshot!(text.join("\n"), @r"
    unused: 2 nodes of no element (4, 5); repair drops them
    unused: 1 node lies on another one (5); merge them if the parts are meant to hang together
    by an edge: 1 edge of more than two surface triangles (surface edges: 2); parts hang together by an edge only: separate or fill them
    by a point: 1 node where surfaces meet in a point (0); parts hang together by a point only: separate or fill them
    apart: the mesh falls into 2 parts (first nodes: 0, 4); make each a body of its own if they should move on their own
    crowded: 3 tetrahedra share a face with two others (0, 1, 2); tetrahedra overlap there: mesh it anew
    crowded: 3 edges of more than two surface triangles (surface edges: 0, 1, 5); parts hang together by an edge only: separate or fill them
    sliver: 1 nearly flat tetrahedron (0); they stiffen the body and slow the solver: improve the mesh
    open: 1 node of no element (3); repair drops them
    open: 3 open edges (surface edges: 0, 1, 2); a membrane may have them; a body with an inside must be closed
    opposite: 3 edges between triangles that face opposite ways (surface edges: 3, 4, 5); orient the surface: its outside is where triangles are seen counter-clockwise
    line: 1 surface triangle without area (0); they have no normal: collapse them
    line: 3 open edges (surface edges: 0, 1, 2); a membrane may have them; a body with an inside must be closed
    ");
}

#[test]
fn moved_and_mirrored_meshes_stay_positive() {
    let mesh = Mesh::new(box_data([2, 2, 2], [1.0; 3])).unwrap();
    let moved = mesh.mapped(|[x, y, z]| [x + 1.0, 2.0 * y, z], false).unwrap();
    assert!((moved.volume() - 2.0).abs() < 1e-14);
    assert_eq!(moved.triangles(), mesh.triangles());
    let mirrored = mesh.mapped(|[x, y, z]| [-x, y, z], true).unwrap();
    assert!((mirrored.volume() - 1.0).abs() < 1e-14);
    assert!(mirrored.validate().is_empty());
    let shell = Mesh::repaired(surface(mesh.nodes(), mesh.triangles())).unwrap().0;
    assert!((shell.mapped(|[x, y, z]| [x, y, -z], true).unwrap().volume() - 1.0).abs() < 1e-14);
    assert!(matches!(
        mesh.mapped(|[x, y, z]| [-x, y, z], false),
        Err(MeshError::Inverted(indices)) if indices.count == mesh.tetrahedra().len()
    ));
    assert!(matches!(
        mesh.with_nodes(vec![[0.0; 3]]),
        Err(MeshError::NodeCount { found: 1, expected: 27 })
    ));
}

#[test]
fn quality_knows_the_regular_tetrahedron() {
    let mut data = corner();
    data.nodes = vec![[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
    let quality = Mesh::new(data).unwrap().quality().unwrap();
    assert!((quality.worst - 1.0).abs() < 1e-12 && (quality.mean - 1.0).abs() < 1e-12);
    assert!((quality.min_dihedral - 70.528_779).abs() < 1e-6);
    assert_eq!(quality.poor_count, 0);
    assert_eq!(Mesh::new(surface(&CORNER, &[[0, 1, 2]])).unwrap().quality(), None);
}

proptest! {
    /// Whatever arrays come, the outcome is an error or a mesh that keeps every promise.
    #[test]
    fn repaired_arrays_keep_every_promise(
        nodes in proptest::collection::vec(proptest::array::uniform3(-2..3_i32), 0..9),
        tetrahedra in proptest::collection::vec(proptest::array::uniform4(0..9_u32), 0..12),
    ) {
        let nodes: Vec<[f64; 3]> = nodes.iter().map(|point| point.map(f64::from)).collect();
        let regions = (0..tetrahedra.len() as i32).collect();
        let data = MeshData { nodes, tetrahedra, regions, ..MeshData::default() };
        let strict = Mesh::new(data.clone());
        let Ok((mesh, report)) = Mesh::repaired(data.clone()) else {
            prop_assert!(strict.is_err());
            return Ok(());
        };
        let only_unused = report.lines().len() == usize::from(!report.unused_nodes.is_empty());
        prop_assert_eq!(strict.is_ok(), only_unused);
        prop_assert!(Mesh::new(mesh.clone().into_data()).as_ref() == Ok(&mesh));
        for (index, nodes) in mesh.tetrahedra().iter().enumerate() {
            let original = data.tetrahedra[mesh.regions()[index] as usize];
            let position = |node: u32| mesh.nodes()[node as usize];
            let mut before: Vec<_> = original.iter().map(|&n| data.nodes[n as usize].map(f64::to_bits)).collect();
            let mut after: Vec<_> = nodes.iter().map(|&n| position(n).map(f64::to_bits)).collect();
            before.sort_unstable();
            after.sort_unstable();
            prop_assert_eq!(before, after);
        }
        let dropped = report.degenerate.count + report.duplicates.count;
        prop_assert_eq!(mesh.tetrahedra().len() + dropped, data.tetrahedra.len());
        prop_assert_eq!(mesh.nodes().len() + report.unused_nodes.count, data.nodes.len());
    }
}

#[test]
fn a_surface_is_closed_until_a_triangle_is_missing_or_turned() {
    let (mesh, _) = Mesh::repaired(box_data([2, 1, 1], [1.0; 3])).unwrap();
    assert!(mesh.is_closed());
    let surface = |triangles: Vec<[u32; 3]>| {
        Mesh::new(MeshData { nodes: mesh.nodes().to_vec(), triangles, ..MeshData::default() })
    };
    let mut triangles = mesh.triangles().to_vec();
    assert!(surface(triangles.clone()).unwrap().is_closed());
    triangles[3].swap(0, 1);
    assert!(!surface(triangles.clone()).unwrap().is_closed());
    triangles.remove(3);
    assert!(!surface(triangles).unwrap().is_closed());
}
