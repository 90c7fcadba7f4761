//! Nodes inside other bodies, and their own, against loops over all tetrahedra and all triangles.

use std::sync::Arc;

use palpate_contact::{Method, PenetratingNode, Scene, SceneOptions};
use palpate_geometry::{Point, point_triangle, predicates, triangles_intersect, vec3};
use palpate_model::Mesh;
use proptest::prelude::*;

use crate::intersections::{brute_force as brute_force_pairs, scene, share_nodes};
use crate::scenes::{
    Case, Random, as_slices, block, block_data, cases, deforming, jittered, rounded, sheet, soup,
};

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

fn unit(vector: Point) -> Option<Point> {
    let largest = vec3::max_abs(vector);
    largest.is_normal().then(|| vec3::normalized(vector.map(|value| value / largest)))?
}

fn normal([a, b, c]: [Point; 3]) -> Option<Point> {
    unit(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))
}

fn offset(corners: &[Point; 3], weights: [f64; 3], point: Point) -> Point {
    weights.into_iter().zip(corners).fold([0.0; 3], |sum, (weight, &corner)| {
        vec3::add_scaled(sum, vec3::sub(corner, point), weight)
    })
}

/// The closest triangle of those that `keep` wants, its weights and squared distance.
fn closest(
    scene: &Scene,
    body: usize,
    point: Point,
    keep: impl Fn(usize, &[Point; 3], [f64; 3]) -> bool,
) -> Option<(u32, [f64; 3], f64)> {
    let mut best: Option<(u32, [f64; 3], f64)> = None;
    for (triangle, corners) in surface(scene, body).enumerate() {
        let found = point_triangle(point, &corners);
        if best.is_none_or(|best| found.distance_squared < best.2)
            && keep(triangle, &corners, found.weights)
        {
            best = Some((triangle as u32, found.weights, found.distance_squared));
        }
    }
    best
}

/// Whether every tetrahedron is positive.
pub(crate) fn is_solid(scene: &Scene, body: usize) -> bool {
    !scene.mesh(body).tetrahedra().is_empty()
        && tetrahedra(scene, body).all(|corners| is_positive(&corners))
}

/// Whether a node is strictly inside a body; in its own, inside others than its tetrahedra.
fn is_inside(scene: &Scene, [body, into]: [usize; 2], node: u32) -> bool {
    let point = scene.positions(body)[node as usize];
    let own = |nodes: &[u32]| body == into && nodes.contains(&node);
    let mesh = scene.mesh(into);
    let mut triangles = mesh.triangles().iter().zip(surface(scene, into));
    if triangles.any(|(nodes, corners)| !own(nodes) && triangles_intersect(&[point; 3], &corners)) {
        return false;
    }
    if body == into || is_solid(scene, into) {
        let mut all = mesh.tetrahedra().iter().zip(tetrahedra(scene, into));
        all.any(|(nodes, corners)| !own(nodes) && holds(&corners, point))
    } else {
        winding(scene, into, point).round() != 0.0
    }
}

/// Per triangle of `body`, whether it meets one of `other`.
fn crossing(scene: &Scene, body: usize, other: usize) -> Vec<bool> {
    if body == other {
        return crossing_itself(scene, body);
    }
    let one = |corners| surface(scene, other).any(|others| triangles_intersect(&corners, &others));
    surface(scene, body).map(one).collect()
}

/// Per triangle of `body`, whether it meets another of it; none does unless two without a common node meet.
fn crossing_itself(scene: &Scene, body: usize) -> Vec<bool> {
    let meshes = [Arc::clone(scene.mesh(body))];
    let pairs = brute_force_pairs(&meshes, &vec![scene.positions(body).to_vec()]);
    let mut crosses = vec![false; meshes[0].triangles().len()];
    if !pairs.iter().all(|pair| share_nodes(&meshes, pair)) {
        for pair in pairs {
            crosses[pair.triangle_a as usize] = true;
            crosses[pair.triangle_b as usize] = true;
        }
    }
    crosses
}

/// Per node, the smallest node that triangles connect it with.
fn components(scene: &Scene, body: usize) -> Vec<u32> {
    let mut labels: Vec<u32> = (0..scene.positions(body).len() as u32).collect();
    loop {
        let before = labels.clone();
        for nodes in scene.mesh(body).triangles() {
            let least = nodes.map(|node| labels[node as usize]).into_iter().min().expect("three");
            for &node in nodes {
                labels[node as usize] = least;
            }
        }
        if labels == before {
            return labels;
        }
    }
}

/// Parts of a surface, by label, that do not leave as a whole: some of their triangles cross, or not all of
/// their nodes are inside.
fn not_swallowed(
    labels: &[u32],
    triangles: &[[u32; 3]],
    crosses: &[bool],
    inner: &[u32],
) -> Vec<u32> {
    let stays = |nodes: &[u32; 3]| nodes.iter().any(|node| !inner.contains(node));
    let crossed =
        triangles.iter().zip(crosses).filter(|&(nodes, &crosses)| crosses || stays(nodes));
    crossed.map(|(nodes, _)| labels[nodes[0] as usize]).collect()
}

/// A record, or for a node of a component that is swallowed the direction it must have.
#[derive(Clone, Debug)]
enum Exit {
    Closest {
        triangle: u32,
        weights: [f64; 3],
        depth: f64,
    },
    /// With where a ray leaves, and whether it only grazes a triangle there: it may miss that by round-off.
    Along {
        direction: Point,
        hits: Vec<(f64, bool)>,
    },
}

const FACING: f64 = 0.1;

/// What the twin finds: (body, node, into, exit).
fn brute_force(
    scene: &Scene,
    is_closed: &[bool],
    include: impl Fn(usize, usize) -> bool,
) -> Vec<(u32, u32, u32, Exit)> {
    let count = scene.body_count();
    let mut found = Vec::new();
    for [body, into] in (0..count).flat_map(|body| (0..count).map(move |into| [body, into])) {
        if !include(body, into) || !is_closed[into] {
            continue;
        }
        let of = |[body, into]: [usize; 2]| -> Vec<u32> {
            let nodes = scene.mesh(body).surface_nodes().iter().copied();
            nodes.filter(|&node| is_inside(scene, [body, into], node)).collect()
        };
        let inner = of([body, into]);
        let crosses = crossing(scene, body, into);
        let labels = components(scene, body);
        let surface_nodes = scene.mesh(body).surface_nodes();
        let is_connected =
            surface_nodes.iter().all(|&node| labels[node as usize] == surface_nodes[0]);
        if inner.is_empty() || (body == into && is_connected && !crosses.contains(&true)) {
            continue;
        }
        let mut patch = crossing(scene, into, body);
        if is_closed[body] {
            let behind = of([into, body]);
            for (triangle, nodes) in scene.mesh(into).triangles().iter().enumerate() {
                patch[triangle] |= nodes.iter().any(|node| behind.contains(node));
            }
        }
        let triangles = scene.mesh(body).triangles();
        let crossed = not_swallowed(&labels, triangles, &crosses, &inner);
        let is_elsewhere = |triangle: usize, label: u32| {
            body != into || labels[scene.mesh(into).triangles()[triangle][0] as usize] != label
        };
        for &node in &inner {
            let point = scene.positions(body)[node as usize];
            let label = labels[node as usize];
            let exit = if crossed.contains(&label) {
                let own: Vec<Point> = triangles
                    .iter()
                    .zip(surface(scene, body))
                    .filter(|(nodes, _)| nodes.contains(&node))
                    .filter_map(|(_, corners)| normal(corners))
                    .collect();
                let other = |triangle: usize| {
                    body != into || !scene.mesh(into).triangles()[triangle].contains(&node)
                };
                let opposite = |triangle: usize, corners: &[Point; 3], weights, faces: bool| {
                    let out = offset(corners, weights, point);
                    other(triangle)
                        && patch[triangle]
                        && normal(*corners).is_some_and(|normal| {
                            vec3::dot(out, normal) > FACING * vec3::norm(out)
                                && (!faces
                                    || own.iter().any(|&own| vec3::dot(own, normal) < -FACING))
                        })
                };
                let whole = || closest(scene, into, point, |t, _, _| other(t));
                let patched =
                    |faces| closest(scene, into, point, |t, c, w| opposite(t, c, w, faces));
                if is_closed[body] {
                    patched(true).or_else(|| patched(false)).or_else(whole)
                } else {
                    whole()
                }
            } else {
                let nearest = |node: u32| {
                    let point = scene.positions(body)[node as usize];
                    closest(scene, into, point, |t, _, _| is_elsewhere(t, label))
                };
                let first = inner
                    .iter()
                    .copied()
                    .filter(|&other| labels[other as usize] == label)
                    .filter_map(|other| Some((nearest(other)?, other)))
                    .min_by(|(a, _), (b, _)| a.2.total_cmp(&b.2));
                let Some((first, seed)) = first else {
                    continue;
                };
                if seed != node {
                    let seed = scene.positions(body)[seed as usize];
                    let corners = surface(scene, into).nth(first.0 as usize).expect("a triangle");
                    let direction = unit(offset(&corners, first.1, seed)).expect("it is inside");
                    let hits = surface(scene, into)
                        .enumerate()
                        .filter(|&(triangle, _)| is_elsewhere(triangle, label))
                        .filter_map(|(_, corners)| along(point, direction, corners))
                        .collect();
                    found.push((body as u32, node, into as u32, Exit::Along { direction, hits }));
                    continue;
                }
                Some(first)
            };
            if let Some((triangle, weights, squared)) = exit.filter(|exit| exit.2 > 0.0) {
                let exit = Exit::Closest { triangle, weights, depth: squared.sqrt() };
                found.push((body as u32, node, into as u32, exit));
            }
        }
    }
    found.sort_by_key(|&(body, node, into, _)| (body, node, into));
    found
}

/// Distance along a ray to a triangle, by Cramer's rule; edges count, and whether it is one.
fn along(point: Point, direction: Point, [a, b, c]: [Point; 3]) -> Option<(f64, bool)> {
    let (u, v, w) = (vec3::sub(b, a), vec3::sub(c, a), vec3::sub(point, a));
    let normal = vec3::cross(direction, v);
    let determinant = vec3::dot(u, normal);
    let beta = vec3::dot(w, normal) / determinant;
    let across = vec3::cross(w, u);
    let gamma = vec3::dot(direction, across) / determinant;
    let distance = vec3::dot(v, across) / determinant;
    let slack = 1e-9;
    let inside = beta.min(gamma).min(1.0 - beta - gamma);
    (inside >= -slack && distance > 0.0).then_some((distance, inside <= slack))
}

/// Every option of a scene that may change how it is searched.
fn every_way() -> impl Iterator<Item = SceneOptions> {
    let leaves = [1, 3, 50].map(|leaf_size| (Method::Paper, leaf_size, 1));
    let others = [(Method::Wide, 10, 1), (Method::Wide, 10, 3), (Method::Hash, 4, 1)];
    let all = leaves.into_iter().chain(others).chain([(Method::AllPairs, 2, 2)]);
    all.map(|(method, leaf_size, threads)| SceneOptions {
        method,
        leaf_size,
        threads,
        ..SceneOptions::default()
    })
}

/// Compares all methods with each other and with the twin, each body with itself too where its
/// tetrahedra are positive. Returns how many nodes are inside.
pub(crate) fn check(case: &Case, is_closed: &[bool]) -> usize {
    let mut count = 0;
    for frame in &case.frames {
        let mut first: Option<Vec<PenetratingNode>> = None;
        for options in every_way() {
            let mut scene = scene(&case.meshes, options);
            scene.update(&as_slices(frame)).expect("finite positions");
            let solid: Vec<bool> =
                (0..is_closed.len()).map(|body| is_solid(&scene, body)).collect();
            let include = |a: usize, b: usize| a != b || solid[a];
            let found = scene.penetration(&include).nodes.clone();
            if let Some(first) = &first {
                assert_eq!(first, &found, "{}, {options:?}", case.name);
                continue;
            }
            compare(&scene, &found, &brute_force(&scene, is_closed, include), case.name);
            count += found.len();
            first = Some(found);
        }
    }
    count
}

fn compare(
    scene: &Scene,
    found: &[PenetratingNode],
    expected: &[(u32, u32, u32, Exit)],
    name: &str,
) {
    let keys: Vec<_> = found.iter().map(|n| (n.body, n.node, n.into_body)).collect();
    let wanted: Vec<_> = expected.iter().map(|&(body, node, into, _)| (body, node, into)).collect();
    assert_eq!(keys, wanted, "{name}");
    for (node, (.., exit)) in found.iter().zip(expected) {
        let point = scene.positions(node.body as usize)[node.node as usize];
        let corners = surface(scene, node.into_body as usize).nth(node.triangle as usize);
        let out = offset(&corners.expect("a triangle"), node.weights, point);
        let rounding = 1e-14 * vec3::max_abs(point);
        match exit {
            Exit::Closest { triangle, weights, depth } => {
                let twin = (*triangle, *weights, *depth);
                assert_eq!((node.triangle, node.weights, node.depth), twin, "{name}");
            }
            Exit::Along { direction, hits } => {
                assert!(vec3::dot(*direction, node.direction) > 1.0 - 1e-9);
                let close = |depth: f64| (node.depth - depth).abs() <= 1e-9 * depth + rounding;
                assert!(hits.iter().any(|&(depth, _)| close(depth)), "{name}: {node:?}, {hits:?}");
                let certain = hits.iter().filter(|(_, grazes)| !grazes).map(|(depth, _)| *depth);
                let first = certain.fold(f64::INFINITY, f64::min);
                assert!(node.depth <= first || close(first), "{name}: {node:?}, {hits:?}");
            }
        }
        assert!((vec3::norm(node.direction) - 1.0).abs() < 1e-12);
        let along = vec3::dot(out, node.direction);
        assert!((along - node.depth).abs() <= 1e-6 * node.depth + rounding, "{node:?}");
    }
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
    assert_eq!(check(&Case::new("grid", vec![outer, inner]), &[true; 2]), 26);
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
    assert_eq!(scene.contains(&[[1.5; 3]], None).expect("finite"), [true, true, false]);
}

/// A bar rolled up by `turns`, each turn `pitch` [m] further out.
fn roll(cells: [usize; 3], radius: f64, turns: f64, pitch: f64, random: &mut Random) -> Case {
    let rest = jittered(cells, [0.0; 3], 0.05, random);
    let length = cells[2] as f64;
    let map = move |[x, y, z]: Point| {
        let angle = std::f64::consts::TAU * turns * z / length;
        let r = radius + y + pitch * turns * z / length;
        [x + 0.3 * z / length, r * angle.cos(), r * angle.sin()]
    };
    let mut case = Case::new("roll", vec![rest]).and(map);
    case.frames.remove(0);
    case
}

#[test]
fn nodes_inside_their_own_body_are_found() {
    let mut random = Random(12);
    for (cells, radius, turns, pitch) in [
        ([2, 2, 36], 5.0, 1.1, 1.3),
        ([2, 2, 36], 5.0, 1.1, 0.4),
        ([3, 1, 30], 4.0, 1.25, 0.3),
        ([2, 3, 60], 6.0, 1.4, 2.1),
    ] {
        let case = roll(cells, radius, turns, pitch, &mut random);
        let scene = scene(&case.meshes, SceneOptions::default());
        assert!(is_solid(&scene, 0));
        assert!(check(&case, &[true]) >= 6);
    }
    // Separate parts of one body, one inside the other, and one apart.
    let mut data = block_data([4, 4, 4], |p| p);
    for (shift, cells) in [(1.3, [1, 1, 1]), (9.0, [1, 1, 2])] {
        let first = data.nodes.len() as u32;
        let part = block_data(cells, |p| p.map(|value| value + shift));
        data.nodes.extend(part.nodes);
        data.tetrahedra.extend(part.tetrahedra.iter().map(|t| t.map(|node| first + node)));
    }
    let parts = Arc::new(Mesh::new(data).expect("three blocks"));
    assert_eq!(check(&Case::new("parts", vec![parts]), &[true]), 8);
}

#[test]
fn a_node_pushed_through_its_own_tetrahedra_does_not_swallow_the_body() {
    let mesh = block([6, 6, 6], |x| x);
    let top = (0..mesh.nodes().len()).find(|&n| mesh.nodes()[n] == [3.0, 3.0, 6.0]).unwrap();
    for depth in [1.2, 1.7, 2.3, 7.0] {
        let mut positions = mesh.nodes().to_vec();
        positions[top] = [3.1, 2.93, 6.0 - depth];
        let mut scene = Scene::new(vec![mesh.clone()], None, SceneOptions::default()).unwrap();
        scene.update(&[&positions]).unwrap();
        let found = scene.penetration(&|_, _| true);
        assert!(found.nodes.iter().all(|node| node.node as usize == top), "{depth}: {found:?}");
    }
}

/// The nodes of two bodies in each other.
fn depths(blocks: &[Arc<Mesh>; 2]) -> Vec<PenetratingNode> {
    let mut scene = scene(blocks, SceneOptions::default());
    scene.penetration(&|a, b| a != b).nodes.clone()
}

#[test]
fn ignored_pairs_are_left_out_and_groups_are_not() {
    let blocks = [block([2, 2, 2], |p| p), block([2, 2, 2], |p| p.map(|value| value + 0.8))];
    let mut scene = scene(&blocks, SceneOptions::default());
    let expected = scene.penetration(&|_, _| true).nodes.clone();
    assert!(!expected.is_empty());
    for body in [0, 1] {
        let groups = vec![1; scene.mesh(body).triangles().len()];
        scene.set_groups(body, &groups).expect("one for each triangle");
    }
    assert_eq!(scene.penetration(&|_, _| true).nodes, expected);
    scene.ignore(1, 0, true).expect("two bodies");
    assert_eq!(scene.penetration(&|_, _| true).nodes, []);
}

#[test]
fn a_way_out_whose_length_overflows_is_none() {
    // Found by fuzzing: such a distance was infinite, and which triangle had it depended on the method.
    let far = block([1, 1, 1], |p| p.map(|value| 2e307 * (value - 0.4)));
    for options in every_way() {
        let mut scene = scene(&[far.clone(), block([1, 1, 1], |p| p)], options);
        assert_eq!(scene.penetration(&|_, _| true).nodes, [], "{options:?}");
        assert_eq!(scene.contains(&[[0.5; 3]], Some(0)).expect("finite"), [true]);
    }
}

#[test]
fn a_box_leaves_the_way_it_came() {
    // Into the top of a box, 0.3 m and 3.7 m deep of 4 m, near its side: only the top is crossed.
    for depth in [0.3, 1.2, 3.7] {
        let under = block([4, 4, 4], |p| p);
        let upper = block([2, 2, 4], |[x, y, z]| [0.07 + 0.5 * x, 1.3 + 0.5 * y, z + 4.0 - depth]);
        let found = depths(&[under, upper]);
        let of_upper: Vec<_> = found.iter().filter(|node| node.body == 1).collect();
        assert!(of_upper.len() >= 9);
        for node in of_upper {
            let z = f64::from(node.node % 5);
            assert!((node.depth - (depth - z)).abs() < 1e-12, "{node:?}");
            assert!(vec3::distance_squared(node.direction, [0.0, 0.0, 1.0]).sqrt() < 1e-12);
        }
        for node in found.iter().filter(|node| node.body == 0 && depth < 1.0) {
            assert!((node.depth - depth).abs() < 1e-12, "{node:?}");
            assert!(vec3::distance_squared(node.direction, [0.0, 0.0, -1.0]).sqrt() < 1e-12);
        }
    }
}

#[test]
fn a_thin_plate_pushed_in_deep_does_not_flip() {
    for part in [0.1, 0.4, 0.6, 0.9] {
        let thick = 0.2;
        let plate = block([6, 6, 1], |[x, y, z]| [0.5 * x, 0.5 * y, thick * z]);
        let table = block([8, 8, 2], |[x, y, z]| {
            [0.7 * x - 1.0, 0.7 * y - 1.1, z - 1.0 + part * thick - 1.0]
        });
        let found = depths(&[plate, table]);
        let bodies = |body| found.iter().filter(move |node| node.body == body);
        assert!(bodies(0).count() == 49 && bodies(1).count() >= 9);
        for body in [0, 1] {
            for (node, other) in bodies(body).flat_map(|a| bodies(body).map(move |b| (a, b))) {
                assert!(vec3::dot(node.direction, other.direction) > 0.99);
            }
        }
        for node in &found {
            assert!((node.depth - part * thick).abs() < 1e-12, "{part} {node:?}");
            let up = if node.body == 0 { 1.0 } else { -1.0 };
            assert!(vec3::distance_squared(node.direction, [0.0, 0.0, up]).sqrt() < 1e-12);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_scenes(seed: u64, digits in 0_i32..6) {
        let mut random = Random(seed);
        let at = random.vector(1.5);
        let meshes = vec![soup(8, 1.0, &mut random), jittered([2, 2, 2], at, 0.2, &mut random)];
        let case = deforming(meshes, 2, &mut random).and(rounded(digits));
        check(&case, &[true; 2]);
    }

    #[test]
    fn random_rolls(
        seed: u64,
        width in 1_usize..4,
        height in 1_usize..3,
        turns in 1.02_f64..1.5,
        pitch in 0.1_f64..2.5,
    ) {
        let mut random = Random(seed);
        let case = roll([width, height, 30], 4.5, turns, pitch, &mut random);
        check(&case, &[true]);
    }
}
