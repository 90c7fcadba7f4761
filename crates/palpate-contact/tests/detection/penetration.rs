//! Nodes inside other bodies against loops over all tetrahedra and all triangles.

use palpate_contact::{Scene, SceneOptions};
use palpate_geometry::{Point, point_triangle, predicates, triangles_intersect, vec3};
use proptest::prelude::*;

use crate::intersections::scene;
use crate::scenes::{Case, Random, as_slices, block, cases, deforming, jittered, sheet, soup};

fn surface(scene: &Scene, body: usize) -> impl Iterator<Item = [Point; 3]> + '_ {
    let positions = scene.positions(body);
    let triangles = scene.mesh(body).triangles().iter();
    triangles.map(|nodes| nodes.map(|node| positions[node as usize]))
}

fn tetrahedra(scene: &Scene, body: usize) -> impl Iterator<Item = [Point; 4]> + '_ {
    let positions = scene.positions(body);
    let tetrahedra = scene.mesh(body).tetrahedra().iter();
    tetrahedra.map(|nodes| nodes.map(|node| positions[node as usize]))
}

fn is_positive(&[a, b, c, d]: &[Point; 4]) -> bool {
    predicates::orient3d(a, b, c, d) > 0
}

/// Whether a positive tetrahedron, closed, holds the point.
fn holds(&[a, b, c, d]: &[Point; 4], p: Point) -> bool {
    let faces = [[a, c, b], [a, b, d], [a, d, c], [b, c, d]];
    faces.iter().all(|&[a, b, c]| predicates::orient3d(a, b, c, p) <= 0)
}

/// The winding number as a sum of solid angles (Van Oosterom and Strackee 1983).
fn winding(scene: &Scene, body: usize, point: Point) -> f64 {
    let angles = surface(scene, body).map(|corners| {
        let [a, b, c] = corners.map(|corner| vec3::sub(corner, point));
        let [la, lb, lc] = [a, b, c].map(vec3::norm);
        let volume = vec3::dot(a, vec3::cross(b, c));
        let cosine =
            la * lb * lc + vec3::dot(a, b) * lc + vec3::dot(b, c) * la + vec3::dot(c, a) * lb;
        2.0 * volume.atan2(cosine)
    });
    angles.sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// The closest triangle, its weights and squared distance: the smallest index of equals.
fn closest(scene: &Scene, body: usize, point: Point) -> (u32, [f64; 3], f64) {
    let mut best = (u32::MAX, [0.0; 3], f64::INFINITY);
    for (triangle, corners) in surface(scene, body).enumerate() {
        let found = point_triangle(point, &corners);
        if found.distance_squared < best.2 {
            best = (triangle as u32, found.weights, found.distance_squared);
        }
    }
    best
}

/// What the twin finds: (body, node, into, triangle, weights, depth); `None` where it cannot tell.
fn brute_force(scene: &Scene, is_closed: &[bool]) -> Vec<(u32, u32, u32, u32, [f64; 3], f64)> {
    let count = scene.body_count();
    let mut found = Vec::new();
    for body in 0..count {
        for &node in scene.mesh(body).surface_nodes() {
            for into in (0..count).filter(|&into| into != body && is_closed[into]) {
                let point = scene.positions(body)[node as usize];
                let (triangle, weights, distance_squared) = closest(scene, into, point);
                let on_surface =
                    surface(scene, into).any(|corners| triangles_intersect(&[point; 3], &corners));
                if on_surface || distance_squared == 0.0 {
                    continue;
                }
                let solid = !scene.mesh(into).tetrahedra().is_empty()
                    && tetrahedra(scene, into).all(|corners| is_positive(&corners));
                let inside = if solid {
                    tetrahedra(scene, into).any(|corners| holds(&corners, point))
                } else {
                    winding(scene, into, point).round() != 0.0
                };
                if inside {
                    let depth = distance_squared.sqrt();
                    found.push((body as u32, node, into as u32, triangle, weights, depth));
                }
            }
        }
    }
    found
}

fn check(case: &Case, is_closed: &[bool]) -> usize {
    let mut count = 0;
    for leaf_size in [1, 3, 50] {
        let mut scene = scene(&case.meshes, SceneOptions { leaf_size, ..Default::default() });
        for frame in &case.frames {
            scene.update(&as_slices(frame)).expect("finite positions");
            let expected = brute_force(&scene, is_closed);
            let found = scene.penetration(&|a, b| a != b).nodes.clone();
            let records: Vec<_> = found
                .iter()
                .map(|n| (n.body, n.node, n.into_body, n.triangle, n.weights, n.depth))
                .collect();
            assert_eq!(records, expected, "{}, leaf size {leaf_size}", case.name);
            for node in &found {
                let point = scene.positions(node.body as usize)[node.node as usize];
                let exit = scene
                    .closest_point(node.into_body as usize, point, f64::INFINITY)
                    .expect("there is a surface");
                assert!(exit.inside && exit.distance == node.depth);
                assert!((vec3::norm(node.direction) - 1.0).abs() < 1e-12);
                let out = vec3::sub(exit.position, point);
                let rounding = 1e-14 * vec3::max_abs(point);
                let along = vec3::dot(out, node.direction);
                assert!((along - node.depth).abs() <= 1e-6 * node.depth + rounding, "{node:?}");
            }
            count += found.len();
        }
    }
    count
}

#[test]
fn the_nodes_of_the_double_loop_are_found() {
    let mut random = Random(11);
    let mut total = 0;
    for case in cases() {
        // Of the shared scenes only "triangles only" has open sheets, first and last.
        let is_closed: Vec<bool> =
            (0..case.meshes.len()).map(|body| case.name != "triangles only" || body == 1).collect();
        total += check(&case, &is_closed);
    }
    assert!(total > 100, "{total} nodes");
    let deep = Case::new(
        "deep",
        vec![
            jittered([4, 4, 4], [0.0; 3], 0.15, &mut random),
            jittered([2, 2, 6], [1.1, 0.9, -0.7], 0.15, &mut random),
            block([1, 1, 1], |p| p.map(|value| 2.0 + 0.3 * value)),
        ],
    );
    assert!(check(&deep, &[true; 3]) > 20);
}

#[test]
fn rays_through_edges_and_nodes_count_once() {
    // On a grid every ray along an axis from a node meets edges and nodes.
    let inner = block([2, 2, 2], |p| p.map(|value| value + 1.0));
    let outer = block([4, 4, 4], |p| p);
    assert_eq!(check(&Case::new("grid", vec![outer, inner]), &[true; 2]), 3 * 26);
}

#[test]
fn included_pairs_only_and_open_surfaces_have_no_inside() {
    let outer = block([3, 3, 3], |p| p);
    let inner = block([1, 1, 1], |p| p.map(|value| value + 1.0));
    let open = sheet(2, 2, |p| [p[0] + 0.5, p[1] + 0.5, 1.5]);
    let mut scene = scene(&[outer, inner, open], SceneOptions::default());
    assert_eq!(scene.penetration(&|_, _| false).nodes, []);
    let of = |nodes: &[palpate_contact::PenetratingNode]| -> Vec<(u32, u32)> {
        let mut pairs: Vec<_> = nodes.iter().map(|node| (node.body, node.into_body)).collect();
        pairs.dedup();
        pairs
    };
    assert_eq!(of(&scene.penetration(&|a, _| a == 1).nodes), [(1, 0)]);
    assert_eq!(of(&scene.penetration(&|_, b| b != 0).nodes), [(2, 1)]);
    assert_eq!(of(&scene.penetration(&|_, _| true).nodes), {
        let mut expected = vec![(1, 0); 8];
        expected.extend([(2, 0); 9]);
        expected.extend([(2, 1)]);
        expected.dedup();
        // The middle node of the sheet is inside both.
        vec![(1, 0), (2, 0), (2, 1), (2, 0)]
    });
    assert!(!scene.closest_point(2, [1.5; 3], 1.0).expect("on the sheet").inside);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_scenes(seed: u64, digits in 0_i32..6) {
        let mut random = Random(seed);
        let at = random.vector(1.5);
        let meshes = vec![soup(8, 1.0, &mut random), jittered([2, 2, 2], at, 0.2, &mut random)];
        let grid = 2.0_f64.powi(digits);
        let case = deforming(meshes, 2, &mut random)
            .and(|p| p.map(|value| (value * grid).round() / grid));
        check(&case, &[true; 2]);
    }
}
