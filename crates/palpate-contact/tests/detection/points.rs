//! Closest points, inside or outside, and rays, against loops over all triangles.

use palpate_contact::{Method, Scene, SceneError, SceneOptions, SurfacePoint};
use palpate_geometry::{Point, point_triangle, vec3};
use proptest::prelude::*;

use crate::intersections::scene;
use crate::scenes::{Random, as_slices, block, cases, deforming, jittered, rounded, sheet, soup};

fn corners(scene: &Scene, body: usize, triangle: usize) -> [Point; 3] {
    scene.mesh(body).triangles()[triangle].map(|node| scene.positions(body)[node as usize])
}

/// Points on nodes, edges and faces, near them, and far away.
fn awkward_points(scene: &Scene, random: &mut Random) -> Vec<Point> {
    let mut points = Vec::new();
    for body in 0..scene.body_count() {
        let count = scene.mesh(body).triangles().len();
        for _ in 0..12 {
            let triangle = (random.bits() as usize) % count;
            let [a, b, c] = corners(scene, body, triangle);
            let middle = vec3::lerp(a, b, 0.5);
            let inner = vec3::lerp(middle, c, random.between(0.0, 1.0));
            let size = vec3::distance_squared(a, b).sqrt();
            points.extend([a, middle, inner]);
            points.push(vec3::add_scaled(inner, random.vector(size), 1.0));
            points.push(vec3::add_scaled(inner, random.vector(1.0), 1e-9 * size));
        }
    }
    points.extend([[1e9, -1e9, 1e9], [1e30, 0.0, 0.0], [0.0; 3]]);
    points
}

fn brute_closest(scene: &Scene, bodies: &[usize], point: Point) -> Option<(u32, u32, f64)> {
    let mut best: Option<(u32, u32, f64)> = None;
    for &body in bodies {
        for triangle in 0..scene.mesh(body).triangles().len() {
            let squared = point_triangle(point, &corners(scene, body, triangle)).distance_squared;
            if best.is_none_or(|best| squared < best.2) {
                best = Some((body as u32, triangle as u32, squared));
            }
        }
    }
    best.map(|(body, triangle, squared)| (body, triangle, squared.sqrt()))
}

fn every_way() -> impl Iterator<Item = SceneOptions> {
    let ways = [(Method::Wide, 10, 1), (Method::Wide, 10, 3), (Method::Paper, 1, 1)];
    let all = ways.into_iter().chain([(Method::Paper, 50, 2), (Method::Hash, 4, 1)]);
    all.map(|(method, leaf_size, threads)| SceneOptions {
        method,
        leaf_size,
        threads,
        ..SceneOptions::default()
    })
}

#[test]
fn closest_points_are_those_of_the_loop() {
    let mut random = Random(31);
    for case in cases() {
        for frame in &case.frames {
            let mut points = None;
            let mut first: Option<Vec<Option<SurfacePoint>>> = None;
            for options in every_way() {
                let mut scene = scene(&case.meshes, options);
                scene.update(&as_slices(frame)).expect("finite positions");
                let points = points.get_or_insert_with(|| awkward_points(&scene, &mut random));
                let found = scene.closest(points, None, f64::INFINITY).expect("finite").to_vec();
                assert_eq!(first.get_or_insert_with(|| found.clone()), &found, "{}", case.name);
                if options.method != Method::Wide || options.threads > 1 {
                    continue;
                }
                let bodies: Vec<usize> = (0..scene.body_count()).collect();
                for (&point, found) in points.iter().zip(&found) {
                    let found = found.expect("there are surfaces");
                    let expected = brute_closest(&scene, &bodies, point).expect("surfaces");
                    assert_eq!((found.body, found.triangle, found.distance), expected);
                    let body = found.body as usize;
                    let [a, b, c] = corners(&scene, body, found.triangle as usize);
                    let [wa, wb, wc] = found.weights;
                    let on = vec3::add_scaled(vec3::add_scaled(vec3::scale(a, wa), b, wb), c, wc);
                    assert_eq!(found.position, on);
                    let mut of =
                        |body, within| scene.closest(&[point], body, within).expect("finite")[0];
                    assert_eq!(of(Some(body), f64::INFINITY), Some(found));
                    assert_eq!(of(None, found.distance), Some(found));
                    if found.distance > 0.0 {
                        assert_eq!(of(None, found.distance.next_down()), None);
                    }
                }
            }
        }
    }
}

/// The winding number as a sum of solid angles, and whether the point is on or too near to tell.
fn winding(scene: &Scene, body: usize, point: Point) -> Option<bool> {
    let count = scene.mesh(body).triangles().len();
    let mut sum = 0.0;
    for triangle in 0..count {
        let triangle = corners(scene, body, triangle);
        let size = vec3::max_abs(vec3::sub(triangle[0], triangle[1]));
        if point_triangle(point, &triangle).distance_squared.sqrt() < 1e-6 * size {
            return None;
        }
        let [a, b, c] = triangle.map(|corner| vec3::sub(corner, point));
        let [la, lb, lc] = [a, b, c].map(vec3::norm);
        let cosine =
            la * lb * lc + vec3::dot(a, b) * lc + vec3::dot(b, c) * la + vec3::dot(c, a) * lb;
        sum += 2.0 * vec3::dot(a, vec3::cross(b, c)).atan2(cosine);
    }
    Some((sum / (4.0 * std::f64::consts::PI)).round() != 0.0)
}

#[test]
fn inside_is_where_the_surface_winds_around() {
    let mut random = Random(32);
    let (mut told, mut inner) = (0, 0);
    for case in cases() {
        for frame in &case.frames {
            let mut points = None;
            let mut first: Option<Vec<bool>> = None;
            for options in every_way() {
                let mut scene = scene(&case.meshes, options);
                scene.update(&as_slices(frame)).expect("finite positions");
                let points = points.get_or_insert_with(|| awkward_points(&scene, &mut random));
                let found = scene.contains(points, None).expect("finite").to_vec();
                assert_eq!(first.get_or_insert_with(|| found.clone()), &found, "{}", case.name);
                let width = scene.body_count();
                for body in 0..width {
                    let of_body = scene.contains(points, Some(body)).expect("finite").to_vec();
                    let column: Vec<bool> =
                        found.iter().skip(body).step_by(width).copied().collect();
                    assert_eq!(of_body, column);
                    let open = case.name == "triangles only" && body != 1;
                    for (&point, &inside) in points.iter().zip(&column) {
                        if open {
                            assert!(!inside);
                        } else if vec3::max_abs(point) < 1e20
                            && let Some(expected) = winding(&scene, body, point)
                        {
                            assert_eq!(inside, expected, "{}: {point:?}", case.name);
                            told += 1;
                            inner += usize::from(inside);
                        }
                    }
                }
            }
        }
    }
    assert!(told > 1000 && inner > 100, "{inner} of {told}");
}

#[test]
fn what_is_too_far_to_be_measured_is_not_found() {
    let meshes = [block([1, 1, 1], |p| p), block([2, 1, 1], |p| p.map(|x| x + 3.0))];
    let points = [[1e200, 0.0, 0.0], [0.0, -1e155, 0.0], [1e153, 0.0, 0.0]];
    for options in every_way() {
        let mut scene = scene(&meshes, options);
        let found = scene.closest(&points, None, f64::INFINITY).expect("finite points");
        let distances: Vec<_> = found.iter().map(|found| found.map(|it| it.distance)).collect();
        assert_eq!(distances, [None, None, Some(1e153)], "{options:?}");
    }
}

/// Distance along a ray to a triangle that it does not graze, by Cramer's rule.
fn plain_hit(origin: Point, direction: Point, [a, b, c]: [Point; 3]) -> Option<f64> {
    let (u, v, w) = (vec3::sub(b, a), vec3::sub(c, a), vec3::sub(origin, a));
    let normal = vec3::cross(direction, v);
    let determinant = vec3::dot(u, normal);
    let beta = vec3::dot(w, normal) / determinant;
    let across = vec3::cross(w, u);
    let gamma = vec3::dot(direction, across) / determinant;
    let distance = vec3::dot(v, across) / determinant;
    (beta >= 0.0 && gamma >= 0.0 && beta + gamma <= 1.0 && distance >= 0.0).then_some(distance)
}

#[test]
fn rays_hit_what_the_loop_hits() {
    let mut random = Random(33);
    let meshes = [
        jittered([3, 3, 3], [0.0; 3], 0.15, &mut random),
        soup(20, 3.0, &mut random),
        sheet(5, 5, |p| [p[0] - 1.0, p[1] - 1.0, 0.4 * (p[0] + p[1]).sin()]),
    ];
    let origins: Vec<Point> = (0..400).map(|_| random.vector(6.0)).collect();
    let aims = origins.iter().map(|&origin| vec3::sub(random.vector(3.0), origin));
    let directions: Vec<Point> =
        aims.zip(-200..).map(|(aim, power)| vec3::scale(aim, 10_f64.powi(power))).collect();
    let mut first: Option<Vec<Option<SurfacePoint>>> = None;
    for options in every_way() {
        let mut scene = scene(&meshes, options);
        let found = scene.cast(&origins, &directions, None, f64::INFINITY).expect("rays").to_vec();
        assert_eq!(first.get_or_insert_with(|| found.clone()), &found);
    }
    let mut scene = scene(&meshes, SceneOptions::default());
    let found = first.expect("at least one way");
    let mut hits = 0;
    for ((&origin, &direction), found) in origins.iter().zip(&directions).zip(&found) {
        let largest = vec3::max_abs(direction);
        let direction = vec3::normalized(direction.map(|value| value / largest)).expect("length");
        let all = (0..3).flat_map(|body| {
            (0..meshes[body].triangles().len()).map(move |triangle| (body, triangle))
        });
        let nearest = all
            .filter_map(|(body, triangle)| {
                let hit = plain_hit(origin, direction, corners(&scene, body, triangle))?;
                Some((hit, body as u32, triangle as u32))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(found.is_some(), nearest.is_some());
        if let (Some(found), Some((distance, body, triangle))) = (found, nearest) {
            assert_eq!((found.body, found.triangle), (body, triangle));
            assert!((found.distance - distance).abs() < 1e-9);
            let end = vec3::add_scaled(origin, direction, found.distance);
            assert!(vec3::distance_squared(end, found.position).sqrt() < 1e-9);
            let mut of =
                |body, within| scene.cast(&[origin], &[direction], body, within).expect("a ray")[0];
            let near = |hit: Option<SurfacePoint>| {
                hit.is_some_and(|hit| (hit.distance - found.distance).abs() < 1e-12)
            };
            assert!(near(of(Some(body as usize), f64::INFINITY)));
            assert!(near(of(None, distance * (1.0 + 1e-9))));
            assert_eq!(of(None, distance * (1.0 - 1e-9)), None);
            hits += 1;
        }
    }
    assert!(hits > 100, "{hits}");
}

/// A closed surface with the origin inside is hit by every ray from there, whatever it aims at.
fn is_watertight(scene: &mut Scene, from: Point, random: &mut Random) {
    let mut targets: Vec<Point> = scene.positions(0).to_vec();
    for triangle in 0..scene.mesh(0).triangles().len() {
        let [a, b, c] = corners(scene, 0, triangle);
        for [a, b] in [[a, b], [b, c], [c, a]] {
            targets.extend([0.5, random.between(0.0, 1.0)].map(|part| vec3::lerp(a, b, part)));
        }
    }
    let towards = |target: &Point| vec3::sub(*target, from);
    let directions: Vec<Point> =
        targets.iter().map(towards).filter(|d| vec3::max_abs(*d) > 0.0).collect();
    let origins = vec![from; directions.len()];
    let found = scene.cast(&origins, &directions, Some(0), f64::INFINITY).expect("rays");
    for (hit, direction) in found.iter().zip(&directions) {
        let hit = hit.unwrap_or_else(|| panic!("{direction:?} slips through"));
        assert!(hit.weights.iter().all(|weight| (0.0..=1.0).contains(weight)));
        assert!((hit.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn no_ray_slips_through_edges_and_nodes() {
    let mut random = Random(34);
    for method in [Method::Wide, Method::Paper] {
        for scale in [1e-9, 1.0, 1e9] {
            for (jitter, at) in [(0.0, 0.0), (0.15, 0.0), (0.1, 1e6)] {
                let mesh = jittered([3, 3, 3], [at; 3], jitter, &mut random);
                let mesh = mesh.mapped(|p| vec3::scale(p, scale), false).expect("a mesh");
                let options = SceneOptions { method, ..SceneOptions::default() };
                let mut scene = scene(&[mesh.into()], options);
                for offset in [[1.5; 3], [1.0, 1.5, 1.75], [1.3, 1.7, 1.1]] {
                    let from = offset.map(|value| scale * (value + at));
                    is_watertight(&mut scene, from, &mut random);
                }
            }
        }
    }
}

#[test]
fn rays_that_begin_on_the_surface_or_graze_it_hit() {
    let cube = block([1, 1, 1], |p| p);
    let flat = sheet(2, 2, |p| p);
    let mut scene = scene(&[cube, flat], SceneOptions::default());
    let mut cast = |origin: Point, direction: Point, body| {
        let hit = scene.cast(&[origin], &[direction], Some(body), f64::INFINITY).expect("a ray")[0];
        hit.map(|hit| hit.distance)
    };
    for direction in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.3, -2.0, 1.0]] {
        for origin in [[0.25, 0.5, 1.0], [0.0, 0.5, 1.0], [1.0; 3], [0.0; 3]] {
            assert_eq!(cast(origin, direction, 0), Some(0.0), "{origin:?} {direction:?}");
        }
    }
    // In the plane of an open sheet, along an edge, and past it.
    assert_eq!(cast([-1.0, 0.5, 0.0], [2.0, 0.0, 0.0], 1), Some(1.0));
    assert_eq!(cast([-1.0, 1.0, 0.0], [0.5, 0.0, 0.0], 1), Some(1.0));
    assert_eq!(cast([3.0, 1.0, 0.0], [1.0, 0.0, 0.0], 1), None);
    assert_eq!(cast([0.5, 0.5, 0.0], [1.0, 0.0, 0.0], 1), Some(0.0));
    assert_eq!(cast([-1.0, 2.5, 0.0], [1.0, 0.0, 0.0], 1), None);
    assert_eq!(cast([0.5, 0.5, -2.0], [0.0, 0.0, -1.0], 0), None);
}

#[test]
fn bad_input_is_refused_by_row() {
    let mut scene = scene(&[block([1, 1, 1], |p| p)], SceneOptions::default());
    let bad = [[0.0; 3], [0.0, f64::NAN, 0.0]];
    let good = [[0.0; 3], [1.0; 3]];
    let error = scene.closest(&bad, None, 1.0).expect_err("NaN");
    assert!(matches!(error, SceneError::RowNotFinite { array: "points", row: 1, .. }));
    assert!(scene.contains(&bad, None).is_err());
    let error = scene.cast(&good, &bad, None, 1.0).expect_err("NaN");
    assert!(matches!(error, SceneError::RowNotFinite { array: "directions", row: 1, .. }));
    let error = scene.cast(&good, &good, None, 1.0).expect_err("zero");
    assert_eq!(error, SceneError::ZeroDirection { row: 0 });
    let error = scene.cast(&good, &good[1..], None, 1.0).expect_err("one is missing");
    assert_eq!(error, SceneError::DirectionCount { given: 1, expected: 2 });
    for distance in [-1.0, f64::NAN] {
        let error = scene.closest(&good, None, distance).expect_err("no distance");
        assert!(matches!(error, SceneError::MaxDistance { .. }));
    }
    let error = scene.contains(&good, Some(1)).expect_err("one body");
    assert_eq!(error, SceneError::BodyOutOfRange { body: 1, count: 1 });
    assert_eq!(scene.closest(&[], None, 1.0).expect("nothing asked").len(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_scenes_look_the_same_through_every_method(seed: u64, digits in 0_i32..6) {
        let mut random = Random(seed);
        let at = random.vector(1.5);
        let meshes = vec![soup(8, 1.0, &mut random), jittered([2, 2, 2], at, 0.2, &mut random)];
        let case = deforming(meshes, 1, &mut random).and(rounded(digits));
        for frame in &case.frames {
            let mut first = None;
            for options in every_way() {
                let mut scene = scene(&case.meshes, options);
                scene.update(&as_slices(frame)).expect("finite positions");
                let points = awkward_points(&scene, &mut Random(seed ^ 1));
                let mut other = Random(seed ^ 2);
                let towards: Vec<Point> = points
                    .iter()
                    .map(|_| frame[1][other.bits() as usize % frame[1].len()])
                    .zip(&points)
                    .map(|(to, from)| if to == *from { [1.0; 3] } else { vec3::sub(to, *from) })
                    .collect();
                let answers = (
                    scene.closest(&points, None, f64::INFINITY).expect("finite").to_vec(),
                    scene.contains(&points, None).expect("finite").to_vec(),
                    scene.cast(&points, &towards, None, f64::INFINITY).expect("finite").to_vec(),
                );
                for (point, found) in points.iter().zip(&answers.0) {
                    let found = found.expect("surfaces");
                    let twin = brute_closest(&scene, &[0, 1], *point);
                    prop_assert_eq!(Some((found.body, found.triangle, found.distance)), twin);
                }
                prop_assert_eq!(first.get_or_insert_with(|| answers.clone()), &answers);
            }
        }
    }
}
