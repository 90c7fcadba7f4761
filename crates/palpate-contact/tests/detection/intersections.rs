//! Complete sorted pair lists of every method against the double loop.

use std::sync::Arc;

use palpate_contact::{IntersectionOptions, Method, Scene, SceneOptions, Split, TrianglePair};
use palpate_geometry::{
    triangles_intersect, triangles_intersect_beyond_edge, triangles_intersect_beyond_node,
};
use palpate_model::Mesh;
use proptest::prelude::*;

use crate::scenes::{
    Case, Point, Positions, Random, as_slices, block, cases, deforming, horseshoe, jittered,
    rounded, sheet, soup,
};

pub(crate) fn scene(meshes: &[Arc<Mesh>], options: SceneOptions) -> Scene {
    Scene::new(meshes.to_vec(), None, options).expect("the meshes make a scene")
}

pub(crate) fn validate(scene: &Scene) {
    for body in 0..scene.body_count() {
        let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
        assert_eq!(valid, Ok(()), "body {body}");
    }
}

/// Every pair of triangles that meet, by the exact tests alone; those that share nodes as well.
pub(crate) fn brute_force(meshes: &[Arc<Mesh>], positions: &Positions) -> Vec<TrianglePair> {
    let mut all = Vec::new();
    for (body, mesh) in meshes.iter().enumerate() {
        for (triangle, nodes) in mesh.triangles().iter().enumerate() {
            let points = nodes.map(|node| positions[body][node as usize]);
            all.push((body as u32, triangle as u32, *nodes, points));
        }
    }
    let mut pairs = Vec::new();
    for (i, a) in all.iter().enumerate() {
        for b in &all[i + 1..] {
            let of_a = |node: &&u32| !b.2.contains(node) || a.0 != b.0;
            let of_b = |node: &&u32| !a.2.contains(node) || a.0 != b.0;
            let at = |node: &u32| positions[a.0 as usize][*node as usize];
            let only_a: Vec<Point> = a.2.iter().filter(of_a).map(at).collect();
            let only_b: Vec<Point> =
                b.2.iter().filter(of_b).map(|n| positions[b.0 as usize][*n as usize]).collect();
            let shared: Vec<Point> = a.2.iter().filter(|node| !of_a(node)).map(at).collect();
            let meet = match (&shared[..], &only_a[..], &only_b[..]) {
                ([], ..) => triangles_intersect(&a.3, &b.3),
                (&[v], &[a1, a2], &[b1, b2]) => {
                    triangles_intersect_beyond_node(&[v, a1, a2], &[v, b1, b2])
                }
                (&[v, w], &[a], &[b]) => triangles_intersect_beyond_edge(&[v, w], a, b),
                _ => true,
            };
            if meet {
                pairs.push(TrianglePair {
                    body_a: a.0,
                    triangle_a: a.1,
                    body_b: b.0,
                    triangle_b: b.1,
                });
            }
        }
    }
    pairs
}

pub(crate) fn share_nodes(meshes: &[Arc<Mesh>], pair: &TrianglePair) -> bool {
    let [a, b] = [(pair.body_a, pair.triangle_a), (pair.body_b, pair.triangle_b)]
        .map(|(body, triangle)| meshes[body as usize].triangles()[triangle as usize]);
    pair.body_a == pair.body_b && a.iter().any(|node| b.contains(node))
}

fn without_same_leaf(scene: &Scene, pairs: &[TrianglePair]) -> Vec<TrianglePair> {
    let leaves: Vec<Vec<u32>> =
        (0..scene.body_count()).map(|body| scene.tree(body).leaf_of_triangles()).collect();
    let leaf = |body: u32, triangle: u32| (body, leaves[body as usize][triangle as usize]);
    let different = |pair: &&TrianglePair| {
        leaf(pair.body_a, pair.triangle_a) != leaf(pair.body_b, pair.triangle_b)
    };
    pairs.iter().filter(different).copied().collect()
}

fn all_options() -> Vec<SceneOptions> {
    let mut all = Vec::new();
    for leaf_size in [1, 2, 5, 50] {
        for split in [Split::Middle, Split::Count] {
            all.push(SceneOptions { leaf_size, split, method: Method::Paper, threads: 1 });
        }
    }
    all.push(SceneOptions { method: Method::Hash, ..SceneOptions::default() });
    all.push(SceneOptions { method: Method::Wide, ..SceneOptions::default() });
    all.push(SceneOptions { method: Method::AllPairs, ..SceneOptions::default() });
    all
}

/// Compares all methods and options on all frames; returns the pairs of each frame.
fn check(case: &Case) -> Vec<usize> {
    let expected: Vec<Vec<TrianglePair>> =
        case.frames.iter().map(|frame| brute_force(&case.meshes, frame)).collect();
    for options in all_options() {
        let mut scene = scene(&case.meshes, options);
        validate(&scene);
        for (frame, expected) in case.frames.iter().zip(&expected) {
            scene.update(&as_slices(frame)).expect("finite positions");
            validate(&scene);
            for bits in 0..8 {
                let [self_contact, same_leaf, shared_nodes] = [0, 1, 2].map(|i| bits >> i & 1 == 1);
                let has_leaves = options.method == Method::Paper;
                let mut expected = expected.clone();
                if has_leaves && !same_leaf {
                    expected = without_same_leaf(&scene, &expected);
                }
                expected.retain(|pair| self_contact || pair.body_a != pair.body_b);
                expected.retain(|pair| shared_nodes || !share_nodes(&case.meshes, pair));
                let wanted = IntersectionOptions { self_contact, same_leaf, shared_nodes };
                let found = scene.intersections(&wanted);
                assert_eq!(found.pairs, expected, "{}: {options:?}, {wanted:?}", case.name);
                let stats = &found.stats;
                assert!(stats.polygon_tests >= expected.len() as u64);
                assert!(stats.polygon_tests <= stats.all_pairs);
            }
        }
    }
    let apart = |pairs: &Vec<TrianglePair>| {
        pairs.iter().filter(|pair| !share_nodes(&case.meshes, pair)).count()
    };
    expected.iter().map(apart).collect()
}

#[test]
fn every_method_finds_the_pairs_of_the_double_loop() {
    for case in cases() {
        let counts = check(&case);
        let empty = ["single tetrahedron", "nested apart"].contains(&case.name);
        assert_eq!(counts.iter().sum::<usize>() == 0, empty, "{}: {counts:?}", case.name);
    }
}

#[test]
fn a_fold_is_found_where_nodes_are_shared() {
    // A sheet of 2 x 2 cells, two triangles each.
    let flat = sheet(2, 2, |p| p);
    let shared = IntersectionOptions { shared_nodes: true, ..IntersectionOptions::default() };
    for method in Method::ALL {
        let mut scene =
            scene(std::slice::from_ref(&flat), SceneOptions { method, ..Default::default() });
        assert_eq!(scene.intersections(&shared).pairs, []);
        let mut fold = |map: fn(Point) -> Point| {
            let folded: Vec<Point> = flat.nodes().iter().map(|&point| map(point)).collect();
            scene.update(&[&folded]).expect("finite positions");
            let apart = scene.intersections(&IntersectionOptions::default()).pairs.len();
            [apart, scene.intersections(&shared).pairs.len()]
        };
        // At right angles along the middle line nothing meets; slightly less than flat neither.
        assert_eq!(fold(|p| if p[0] > 1.0 { [1.0, p[1], p[0] - 1.0] } else { p }), [0, 0]);
        assert_eq!(fold(|p| if p[0] > 1.0 { [0.5, p[1], 1e-9] } else { p }), [0, 0]);
        // Flat: all 4 x 4 pairs of the halves but three, which touch in a node of the middle line only.
        let [apart, all] = fold(|p| if p[0] > 1.0 { [2.0 - p[0], p[1], p[2]] } else { p });
        assert_eq!([apart, all], [5, 13]);
    }
}

#[test]
fn an_adversarial_scene_has_pairs_within_leaves() {
    // Otherwise the exemption of one leaf would not be tested.
    let case = cases().into_iter().find(|case| case.name == "deforming").expect("it is there");
    let mut scene = scene(&case.meshes, SceneOptions { leaf_size: 50, ..Default::default() });
    scene.update(&as_slices(&case.frames[3])).expect("finite positions");
    let all = scene.intersections(&IntersectionOptions::default()).pairs.clone();
    assert!(without_same_leaf(&scene, &all).len() < all.len());
}

#[test]
fn results_are_the_same_at_any_number_of_threads() {
    let mut random = Random(3);
    let meshes = vec![
        horseshoe(40, 3, [0.0; 3]),
        jittered([9, 9, 9], [0.0, 4.0, 4.0], 0.1, &mut random),
        soup(300, 8.0, &mut random),
    ];
    let case = deforming(meshes, 2, &mut random);
    for frame in &case.frames {
        let mut previous: Option<Vec<TrianglePair>> = None;
        for threads in [1, 2, 3, 8] {
            let options =
                SceneOptions { threads, leaf_size: 1, method: Method::Paper, ..Default::default() };
            let mut scene = scene(&case.meshes, options);
            scene.update(&as_slices(frame)).expect("finite positions");
            validate(&scene);
            let found = scene.intersections(&IntersectionOptions::default()).pairs.clone();
            assert!(!found.is_empty());
            if let Some(previous) = &previous {
                assert_eq!(&found, previous, "{threads} threads");
            }
            previous = Some(found);
        }
    }
}

#[test]
fn a_large_triangle_among_small_ones_does_not_break_the_hash() {
    let small = block([8, 8, 8], |p| p.map(|value| 0.01 * value));
    let large = block([1, 1, 1], |p| p.map(|value| 100.0 * (value - 0.5)));
    let cutting = block([1, 1, 1], |p| [100.0 * (p[0] - 0.3), 100.0 * (p[1] - 0.4), p[2] + 0.035]);
    let counts = check(&Case::new("large", vec![small, large, cutting]));
    assert!(counts[0] > 0);
}

/// Cells are as large as edges were when the mesh came; triangles that grow tenfold would be in a thousand each.
#[test]
fn triangles_that_grow_do_not_fill_the_cells_of_the_hash() {
    let mut random = Random(5);
    let meshes = vec![soup(150, 4.0, &mut random), block([4, 4, 4], |p| p)];
    let case = Case::new("grown", meshes)
        .and(|p| p.map(|value| 10.0 * value))
        .and(|[x, y, z]| [1e6 * x, y, z])
        .and(|p| p.map(|value| if value > 2.0 { 1e12 * value } else { value }));
    let counts = check(&case);
    assert!(counts.iter().all(|&count| count > 0));
    let mut scene =
        scene(&case.meshes, SceneOptions { method: Method::Hash, ..SceneOptions::default() });
    let triangles: usize = case.meshes.iter().map(|mesh| mesh.triangles().len()).sum();
    for frame in &case.frames {
        scene.update(&as_slices(frame)).expect("finite positions");
        let stats = &scene.intersections(&IntersectionOptions::default()).stats;
        assert!(stats.cell_entries <= 32 * triangles as u64, "{} entries", stats.cell_entries);
        assert!(stats.box_tests <= stats.all_pairs);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_scenes(seed: u64, digits in 0_i32..6, flat: bool) {
        let mut random = Random(seed);
        let at = random.vector(2.0);
        let meshes =
            vec![soup(12, 1.2, &mut random), jittered([2, 2, 3], at, 0.2, &mut random)];
        let round = rounded(digits);
        let case = deforming(meshes, 2, &mut random).and(|p| {
            let [x, y, z] = round(p);
            [x, y, if flat { x } else { z }]
        });
        check(&case);
    }
}
