//! The wide layout against the double loop on very many very small scenes, awkward ones first of all.

#[path = "detection/scenes.rs"]
#[expect(dead_code, reason = "the other tests use the rest")]
mod scenes;

use std::io::Write;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_contact::{IntersectionOptions, Method, ProximityOptions, Scene, SceneOptions};
use palpate_geometry::vec3;
use palpate_model::{Mesh, MeshData};

use scenes::{Point, Positions, Random, as_slices, deforming, horseshoe, jittered, soup};

/// Frames in total: each a scene of 2 to 30 triangles of its own.
const SCENES: usize = 100_000;
/// Frames that one set of meshes goes through.
const FRAMES: usize = 50;

fn below(random: &mut Random, end: u64) -> u64 {
    (random.bits() >> 11) % end
}

/// A strip, fan or loose set of triangles.
fn patch(triangle_count: u64, random: &mut Random) -> Arc<Mesh> {
    let mut data = MeshData::default();
    let kind = below(random, 3);
    for i in 0..triangle_count as u32 {
        data.triangles.push(match kind {
            0 => [i, i + 1, i + 2],
            1 => [0, i + 1, i + 2],
            _ => [3 * i, 3 * i + 1, 3 * i + 2],
        });
    }
    let nodes = data.triangles.iter().flatten().max().map_or(0, |last| last + 1);
    data.nodes = (0..nodes).map(|_| random.vector(1.0)).collect();
    Arc::new(Mesh::new(data).expect("different corners"))
}

/// Positions that a filter might get wrong.
fn place(meshes: &[Arc<Mesh>], random: &mut Random) -> Positions {
    let kind = below(random, 9);
    let flat = below(random, 5) == 0;
    let offset = random.vector(1.0);
    // Neighbours in f32 around one, whatever it is.
    let scale = 10_f64.powi(below(random, 60) as i32 - 30);
    let mut point = |_: &Point| -> Point {
        let p = random.vector(1.0);
        let moved: Point = std::array::from_fn(|axis| match kind {
            0 | 1 => p[axis],
            // Few values: coplanar, touching, degenerate.
            2 | 3 => (4.0 * p[axis]).round(),
            4 => 1.0 + (3.0 * p[axis]).round() * f64::from(f32::EPSILON) / 2.0,
            5 => 1e8 * offset[axis] + p[axis],
            6 => scale * p[axis],
            7 => 1.0 + (3.0 * p[axis]).round() * f64::EPSILON,
            _ => 1e39 * (2.0 * p[axis]).round() + p[axis],
        });
        if flat { [moved[0], moved[1], moved[0] + moved[1]] } else { moved }
    };
    meshes.iter().map(|mesh| mesh.nodes().iter().map(&mut point).collect()).collect()
}

/// With `PALPATE_SOAK`, see `tests/soak.rs`, ten times as many, of a fresh seed that is printed.
#[test]
fn very_many_small_scenes_have_the_pairs_of_the_double_loop() {
    if std::env::var_os("PALPATE_SOAK").is_none() {
        compare_small_scenes(2008, SCENES);
        return;
    }
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    let seed = since_epoch.as_nanos() as u64;
    writeln!(std::io::stderr(), "small scenes of seed {seed}").expect("an open stderr");
    compare_small_scenes(seed, 10 * SCENES);
}

fn compare_small_scenes(seed: u64, scenes: usize) {
    let mut random = Random(seed);
    let (mut meeting, mut close, mut minima) = (0, 0, 0);
    for _ in 0..scenes / FRAMES {
        let first = 1 + below(&mut random, 15);
        let meshes = [patch(first, &mut random), patch(1 + below(&mut random, 15), &mut random)];
        let of = |method| {
            let options = SceneOptions { method, ..SceneOptions::default() };
            Scene::new(meshes.to_vec(), None, options).expect("two meshes")
        };
        let (mut wide, mut slow) = (of(Method::Wide), of(Method::AllPairs));
        for frame in 0..FRAMES {
            let positions = place(&meshes, &mut random);
            wide.update(&as_slices(&positions)).expect("finite positions");
            slow.update(&as_slices(&positions)).expect("finite positions");
            let options =
                IntersectionOptions { shared_nodes: frame % 2 == 0, ..Default::default() };
            let expected = &slow.intersections(&options).pairs;
            let found = &wide.intersections(&options).pairs;
            assert_eq!(found, expected, "{positions:?}");
            meeting += expected.len();
            if frame % 5 == 0 {
                let size =
                    positions.iter().flatten().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
                let limit = size * 10_f64.powi(-(below(&mut random, 18) as i32));
                let expected = &slow.proximity(&|_, _| Some(limit)).pairs;
                let found = &wide.proximity(&|_, _| Some(limit)).pairs;
                assert_eq!(found, expected, "{limit}: {positions:?}");
                close += expected.len();
                let local = ProximityOptions { local_minima: true, ..Default::default() };
                let expected = &slow.proximity_with(&|_, _| Some(limit), &local).pairs;
                let found = &wide.proximity_with(&|_, _| Some(limit), &local).pairs;
                assert_eq!(found, expected, "local minima, {limit}: {positions:?}");
                minima += expected.len();
            }
        }
    }
    assert!(meeting > scenes && close > scenes, "{meeting} {close}");
    assert!(minima > scenes / 10 && minima < close / 2, "{minima} of {close}");
}

/// Triangles of one body and pairs of triangles of another, some as small beside the scene as `f32` can tell, close
/// to each other where another feature begins to be the closest: one that the second of the pair owns.
fn place_at_limits(count: usize, random: &mut Random) -> Positions {
    let mut positions = vec![Vec::new(), Vec::new()];
    let power = |least: f64, most: f64, random: &mut Random| {
        10_f64.powf(least + (most - least) * random.vector(1.0)[0].abs())
    };
    let shape = |center: Point, size: f64, random: &mut Random| {
        vec3::add_scaled(center, random.vector(1.0), size)
    };
    for _ in 0..count {
        let size = power(-7.5, 0.0, random);
        let a = random.vector(0.5);
        let b = shape(a, size, random);
        let t = random.vector(1.0)[0];
        let c = shape(vec3::lerp(a, b, t), size * power(-6.0, 0.0, random), random);
        let edge = vec3::sub(b, a);
        let apart = shape([0.0; 3], size, random);
        let above = |normal: Point| {
            let height = size / vec3::norm(normal).max(f64::MIN_POSITIVE);
            vec3::add_scaled(vec3::lerp(a, b, t), normal, height)
        };
        let (first, second) = match below(random, 3) {
            // In the plane across the end of an edge of the second alone.
            0 => {
                let own = vec3::sub(c, a);
                let part = vec3::dot(apart, own) / vec3::dot(own, own);
                let across = vec3::add_scaled(apart, own, -part);
                (vec3::add(a, across), shape(a, size, random))
            }
            // Above the edge of both.
            1 => (above(vec3::cross(edge, vec3::sub(c, a))), shape(a, size, random)),
            // The start of an edge that is closest there, nearly parallel or not.
            _ => {
                let other = vec3::add_scaled(edge, apart, power(-6.0, 0.0, random));
                let start = above(vec3::cross(edge, other));
                (start, vec3::add(start, other))
            }
        };
        let first = shape(first, power(-9.0, -6.3, random), random);
        positions[0].extend([first, second, shape(a, size, random)]);
        positions[1].extend([a, b, c, shape(a, size, random)]);
    }
    // What all is relative to, in `f32`.
    positions[0][0] = [-1.0; 3];
    positions
}

#[test]
fn local_minima_where_the_closest_feature_changes_are_those_of_the_double_loop() {
    let mut random = Random(41);
    let count = 12;
    let mesh = |each: u32, corners: &[[u32; 3]]| {
        let copies = (0..count as u32).flat_map(|i| corners.iter().map(move |c| (i, c)));
        let triangles = copies.map(|(i, corners)| corners.map(|node| each * i + node)).collect();
        let nodes = (0..each * count as u32).map(|i| [i, i % 2, i % 5].map(f64::from)).collect();
        let data = MeshData { nodes, triangles, ..MeshData::default() };
        Arc::new(Mesh::new(data).expect("different corners"))
    };
    let meshes = [mesh(3, &[[0, 1, 2]]), mesh(4, &[[0, 1, 3], [0, 1, 2]])];
    let of = |method| {
        let options = SceneOptions { method, ..SceneOptions::default() };
        Scene::new(meshes.to_vec(), None, options).expect("two meshes")
    };
    let (mut wide, mut slow) = (of(Method::Wide), of(Method::AllPairs));
    let local = ProximityOptions { local_minima: true, ..Default::default() };
    let mut minima = 0;
    for _ in 0..12_000 {
        let positions = place_at_limits(count, &mut random);
        wide.update(&as_slices(&positions)).expect("finite positions");
        slow.update(&as_slices(&positions)).expect("finite positions");
        let limit = 10_f64.powf(-7.0 * random.vector(1.0)[0].abs());
        let distance = |a: usize, b: usize| (a != b).then_some(limit);
        let expected = &slow.proximity_with(&distance, &local).pairs;
        assert_eq!(&wide.proximity_with(&distance, &local).pairs, expected, "{positions:?}");
        minima += expected.len();
    }
    assert!(minima > 100_000, "{minima}");
}

#[test]
fn results_are_the_same_at_any_number_of_threads() {
    let mut random = Random(17);
    let meshes = vec![
        horseshoe(40, 3, [0.0; 3]),
        jittered([9, 9, 9], [0.0, 4.0, 4.0], 0.1, &mut random),
        soup(300, 8.0, &mut random),
        soup(1, 2.0, &mut random),
    ];
    let case = deforming(meshes, 2, &mut random);
    for frame in &case.frames {
        let mut previous = None;
        for threads in [1, 2, 3, 8] {
            let options = SceneOptions { method: Method::Wide, threads, ..Default::default() };
            let mut scene = Scene::new(case.meshes.clone(), None, options).expect("meshes");
            scene.update(&as_slices(frame)).expect("finite positions");
            let shared = IntersectionOptions { shared_nodes: true, ..Default::default() };
            let meeting = scene.intersections(&shared);
            let (pairs, tests) = (meeting.pairs.clone(), meeting.stats.polygon_tests);
            let close = scene.proximity(&|_, _| Some(0.05));
            let found = (pairs, tests, close.pairs.clone(), close.stats.polygon_tests);
            assert!(!found.0.is_empty() && !found.2.is_empty());
            assert!(*previous.get_or_insert_with(|| found.clone()) == found, "{threads} threads");
        }
    }
}

#[test]
fn bodies_come_and_go() {
    let mut random = Random(23);
    let meshes: Vec<_> = (0..4).map(|_| soup(20, 1.5, &mut random)).collect();
    let of = |method| {
        let options = SceneOptions { method, ..SceneOptions::default() };
        Scene::new(meshes[..3].to_vec(), None, options).expect("meshes")
    };
    let (mut wide, mut slow) = (of(Method::Wide), of(Method::AllPairs));
    for step in 0..4 {
        for scene in [&mut wide, &mut slow] {
            match step {
                0 => drop(scene.remove(1).expect("it is there")),
                1 => drop(scene.replace(0, Arc::clone(&meshes[3])).expect("it is there")),
                _ => drop(scene.add(Arc::clone(&meshes[0]))),
            }
        }
        let expected = &slow.intersections(&IntersectionOptions::default()).pairs;
        assert!(!expected.is_empty());
        assert_eq!(&wide.intersections(&IntersectionOptions::default()).pairs, expected);
    }
}

/// Bytes of the layout per surface triangle, the promised most.
const BYTES_PER_TRIANGLE: f64 = 160.0;

#[test]
fn the_layout_keeps_its_promise_of_memory() {
    let mut random = Random(31);
    // Loose triangles have twice the edges and six times the nodes, and no neighbours: no limit there.
    let sets = [
        vec![horseshoe(60, 8, [0.0; 3]), horseshoe(30, 8, [5.0, 0.0, 0.0])],
        vec![jittered([20, 20, 20], [0.0; 3], 0.2, &mut random)],
    ];
    for meshes in sets {
        let triangle_count = meshes.iter().map(|mesh| mesh.triangles().len()).sum();
        let mut scene = Scene::new(meshes, None, SceneOptions::default()).expect("meshes");
        let new = scene.memory();
        assert!(new.layout_per_triangle() <= BYTES_PER_TRIANGLE, "{new:?}");
        assert_eq!(new.triangle_count, triangle_count);
        let parts = [new.nodes, new.elements, new.triangle_boxes, new.feature_boxes];
        let masks = [new.triangle_masks, new.feature_masks];
        assert_eq!(parts.iter().chain(&masks).sum::<usize>(), new.layout());
        // A triangle's box alone is six numbers of four bytes.
        assert!(parts.iter().chain(&masks).all(|&part| part > 0));
        assert!(new.triangle_boxes >= 24 * triangle_count);
        // What is found changes the buffers only.
        scene.intersections(&IntersectionOptions::default());
        scene.proximity(&|_, _| Some(0.3));
        let used = scene.memory();
        assert!(used.buffers > new.buffers);
        assert_eq!(used.layout(), new.layout());
    }
}
