//! Close pairs of every method against the double loop over nodes, triangles and edges, and each record
//! against its own definition.

use palpate_contact::{Method, PairKind, ProximityOptions, ProximityPair, Scene, SceneOptions};
use palpate_geometry::vec3;
use proptest::prelude::*;

use crate::intersections::scene;
use crate::scenes::{
    Case, Point, Positions, Random, as_slices, block, cases, deforming, jittered, rounded, sheet,
    soup,
};

/// A length to measure distances with: the frame's longest side, in cells.
fn cell(frame: &Positions) -> f64 {
    let bounds = palpate_geometry::Aabb::from_points(frame.iter().flatten());
    let longest = bounds.extent().into_iter().fold(0.0, f64::max);
    if longest > 0.0 { longest / 6.0 } else { 1.0 }
}

/// What a record says must follow from the positions.
fn check_record(scene: &Scene, pair: &ProximityPair, limit: f64) {
    let [a, b] = pair.bodies.map(|body| body as usize);
    let (mesh_a, mesh_b) = (scene.mesh(a), scene.mesh(b));
    let [first, second] = pair.elements.map(|element| element as usize);
    let first_of_b = match pair.kind {
        PairKind::VertexTriangle => {
            let corners = mesh_b.triangles()[second];
            assert_eq!(pair.nodes, [first as u32, corners[0], corners[1], corners[2]]);
            assert_eq!(pair.weights[0], 1.0);
            1
        }
        PairKind::EdgeEdge => {
            let (edge_a, edge_b) = (mesh_a.surface_edges()[first], mesh_b.surface_edges()[second]);
            assert_eq!(pair.nodes, [edge_a[0], edge_a[1], edge_b[0], edge_b[1]]);
            assert!((a, first) < (b, second));
            2
        }
    };
    let (of_a, of_b) = pair.weights.split_at(first_of_b);
    assert!(of_a.iter().all(|&weight| weight >= 0.0) && of_b.iter().all(|&weight| weight <= 0.0));
    assert!((of_a.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{pair:?}");
    assert!((of_b.iter().sum::<f64>() + 1.0).abs() < 1e-12, "{pair:?}");
    assert!((vec3::norm(pair.normal) - 1.0).abs() < 1e-12, "{pair:?}");
    assert!(pair.distance >= 0.0 && pair.distance < limit);
    let position = |i: usize| -> Point {
        let body = if i < first_of_b { a } else { b };
        scene.positions(body)[pair.nodes[i] as usize]
    };
    let (mut offset, mut size) = ([0.0; 3], 0.0_f64);
    for i in 0..4 {
        let from_first = vec3::sub(position(i), position(0));
        offset = vec3::add_scaled(offset, from_first, pair.weights[i]);
        size = size.max(vec3::max_abs(position(i)));
    }
    let rounding = 1e-14 * size;
    assert!((vec3::norm(offset) - pair.distance).abs() <= 1e-9 * pair.distance + rounding);
    if pair.distance > 1e3 * rounding {
        let along = vec3::dot(offset, pair.normal);
        assert!((along - pair.distance).abs() <= 1e-5 * pair.distance, "{pair:?}");
    }
}

const LOCAL: ProximityOptions = ProximityOptions { close_at_rest: true, local_minima: true };

fn check(case: &Case, distances: &[f64]) -> usize {
    let mut count = 0;
    let of = |method, leaf_size| {
        scene(&case.meshes, SceneOptions { method, leaf_size, ..SceneOptions::default() })
    };
    let mut slow = of(Method::AllPairs, 2);
    let mut fast: Vec<Scene> = [1, 2, 5, 50].map(|leaf_size| of(Method::Paper, leaf_size)).into();
    fast.push(of(Method::Hash, 2));
    fast.push(of(Method::Wide, 2));
    for frame in &case.frames {
        for &cells in distances {
            let limit = cells * cell(frame);
            // Pairs of bodies differ, and one is left out.
            let distance = |a: usize, b: usize| {
                assert!(a <= b);
                (a + b != 3).then(|| limit * (1.0 + 0.25 * (a + 2 * b) as f64))
            };
            slow.update(&as_slices(frame)).expect("finite positions");
            let expected = slow.proximity(&distance).pairs.clone();
            for pair in &expected {
                let [a, b] = pair.bodies.map(|body| body as usize);
                let limit = distance(a.min(b), a.max(b)).expect("the pair was asked for");
                check_record(&slow, pair, limit);
            }
            let local = slow.proximity_with(&distance, &LOCAL).pairs.clone();
            assert!(local.iter().all(|pair| expected.contains(pair)));
            for scene in &mut fast {
                scene.update(&as_slices(frame)).expect("finite positions");
                let options = *scene.options();
                let found = &scene.proximity(&distance).pairs;
                assert_eq!(found, &expected, "{}: {options:?}, {cells} cells", case.name);
                let found = &scene.proximity_with(&distance, &LOCAL).pairs;
                assert_eq!(found, &local, "{}: {options:?}, {cells} cells", case.name);
            }
            count += expected.len();
        }
    }
    count
}

#[test]
fn every_method_finds_the_pairs_of_the_double_loop() {
    for case in cases() {
        let count = check(&case, &[1e-9, 0.05, 0.4]);
        assert!(count > 0 || case.name == "single tetrahedron", "{}", case.name);
    }
}

#[test]
fn a_node_above_a_sheet_and_crossing_bars() {
    // A tetrahedron's node 0.1 above the middle of a sheet's triangle.
    let tip = block([1, 1, 1], |p| [p[0] + 0.6, p[1] + 0.3, p[2] + 0.1]);
    let mut scene = scene(&[tip, sheet(2, 2, |p| p)], SceneOptions::default());
    let found = scene.proximity(&|a, b| (a != b).then_some(0.2)).pairs.clone();
    let node = found.iter().find(|pair| {
        pair.kind == PairKind::VertexTriangle && pair.bodies == [0, 1] && pair.elements[0] == 0
    });
    let node = node.expect("node 0 is 0.1 above the sheet");
    assert!((node.distance - 0.1).abs() < 1e-15);
    assert!(vec3::distance_squared(node.normal, [0.0, 0.0, 1.0]) < 1e-20);
    let elevated = found.iter().filter(|pair| pair.bodies == [0, 1]);
    assert!(elevated.clone().count() > 4);
    assert!(elevated.into_iter().all(|pair| pair.distance >= 0.1 - 1e-15));
}

#[test]
fn a_distance_is_strict_and_zero_or_nan_finds_nothing() {
    let cube = || block([1, 1, 1], |p| p);
    let shifted = block([1, 1, 1], |p| [p[0] + 1.5, p[1], p[2]]);
    for method in Method::ALL {
        let options = SceneOptions { method, ..SceneOptions::default() };
        let mut scene = scene(&[cube(), shifted.clone(), cube()], options);
        for nothing in [0.0, -1.0, f64::NAN] {
            assert!(scene.proximity(&|_, _| Some(nothing)).pairs.is_empty());
        }
        let between = |limit: f64| move |a: usize, b: usize| (a + b == 1).then_some(limit);
        assert!(scene.proximity(&between(0.5)).pairs.is_empty());
        assert!(!scene.proximity(&between(0.5_f64.next_up())).pairs.is_empty());
        let all = scene.proximity(&|_, _| Some(f64::INFINITY)).pairs.len();
        // Per body 8 nodes, 12 triangles, 18 edges; pairs that share a node are left out.
        let own = 8 * 12 - 12 * 3 + count_disjoint_edges(&scene);
        assert_eq!(all, 3 * own + 3 * (2 * 8 * 12 + 18 * 18));
    }
}

fn count_disjoint_edges(scene: &Scene) -> usize {
    let edges = scene.mesh(0).surface_edges();
    let disjoint = |a: &[u32; 2], b: &[u32; 2]| !a.iter().any(|node| b.contains(node));
    let pairs = edges.iter().enumerate();
    pairs.map(|(i, a)| edges[i + 1..].iter().filter(|b| disjoint(a, b)).count()).sum()
}

#[test]
fn results_are_the_same_at_any_number_of_threads() {
    let mut random = Random(5);
    let meshes = vec![
        jittered([9, 9, 9], [0.0; 3], 0.1, &mut random),
        jittered([9, 9, 9], [9.2, 1.0, 2.0], 0.1, &mut random),
        soup(200, 8.0, &mut random),
    ];
    let of = |threads| {
        let mut scene =
            scene(&meshes, SceneOptions { threads, method: Method::Paper, ..Default::default() });
        let pairs = scene.proximity(&|_, _| Some(0.3)).pairs.clone();
        let nodes = scene.penetration(&|_, _| true).nodes.clone();
        assert!(!pairs.is_empty() && !nodes.is_empty());
        (pairs, nodes)
    };
    let expected = of(1);
    for threads in [2, 3, 8] {
        assert!(of(threads) == expected, "{threads} threads");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn random_scenes(seed: u64, digits in 0_i32..6) {
        let mut random = Random(seed);
        let at = random.vector(2.0);
        let meshes = vec![soup(8, 1.2, &mut random), jittered([2, 2, 2], at, 0.2, &mut random)];
        let case = deforming(meshes, 1, &mut random).and(rounded(digits));
        check(&case, &[0.02, 0.3]);
    }
}
