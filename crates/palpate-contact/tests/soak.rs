//! The wide layout against the double loop on whole bodies: crumpled, flattened and cut. One round of it
//! here; `make soak` goes on with fresh seeds for as many minutes as `PALPATE_SOAK` says, on real organs
//! where `PALPATE_DATA` names their folder.

#[path = "detection/scenes.rs"]
#[expect(dead_code, reason = "the other tests use the rest")]
mod scenes;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use palpate_contact::{IntersectionOptions, Method, Scene, SceneOptions};
use palpate_model::{Mesh, MeshData, ReadOptions, read_mesh};

use scenes::{Point, Positions, Random, as_slices, horseshoe, jittered, positions, soup};

/// The round that runs with all other tests.
const SEED: u64 = 2008;

const ORGANS: [&str; 5] =
    ["aorta_paper", "kidney_l_paper", "kidney_r_paper", "vena_cava_paper", "ileum_f_n6000"];

#[test]
fn whole_bodies_have_the_pairs_of_the_double_loop() {
    let minutes = std::env::var("PALPATE_SOAK")
        .map(|text| text.parse::<f64>().expect("PALPATE_SOAK: a number of minutes"));
    let Ok(minutes) = minutes else {
        round(SEED, true);
        return;
    };
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    let first = since_epoch.as_nanos() as u64;
    let (start, limit) = (Instant::now(), Duration::from_secs_f64(60.0 * minutes));
    let mut out = std::io::stderr();
    let mut found = [0; 2];
    for seed in first.. {
        if start.elapsed() >= limit {
            break;
        }
        writeln!(out, "seed {seed}, so far {found:?} pairs met and close").expect("an open stderr");
        let new = round(seed, false);
        found = [found[0] + new[0], found[1] + new[1]];
    }
    assert!(found.iter().all(|&count| count > 0), "{found:?}");
}

/// Compares all results on the scene of a seed, and counts the pairs that meet or are close.
fn round(seed: u64, small: bool) -> [usize; 2] {
    let mut random = Random(seed);
    let mut meshes = bodies(small, &mut random);
    if random.between(0.0, 1.0) < 0.5 {
        let last = meshes.pop().expect("two bodies");
        meshes.push(cut(&last, &mut random));
    }
    let of = |method, threads| {
        let options = SceneOptions { method, threads, ..SceneOptions::default() };
        Scene::new(meshes.clone(), None, options).expect("two bodies")
    };
    let (mut wide, mut slow) = (of(Method::Wide, 1), of(Method::AllPairs, 1));
    let mut threaded = of(Method::Wide, 3);
    let rest = positions(&meshes);
    let size = size(&rest);
    let mut counts = [0; 2];
    for frame in 0..3 {
        let moved = crumpled(&rest, size, &mut random);
        let text = || format!("seed {seed}, frame {frame}");
        for scene in [&mut wide, &mut slow, &mut threaded] {
            scene.update(&as_slices(&moved)).expect("finite positions");
        }
        for shared_nodes in [false, true] {
            let options = IntersectionOptions { shared_nodes, ..IntersectionOptions::default() };
            let expected = &slow.intersections(&options).pairs;
            assert!(&wide.intersections(&options).pairs == expected, "{}", text());
            assert!(&threaded.intersections(&options).pairs == expected, "{}", text());
            counts[0] += expected.len();
        }
        let distance = size * 10_f64.powf(random.between(-5.0, -2.5));
        let expected = &slow.proximity(&|_, _| Some(distance)).pairs;
        assert!(&wide.proximity(&|_, _| Some(distance)).pairs == expected, "{}", text());
        assert!(&threaded.proximity(&|_, _| Some(distance)).pairs == expected, "{}", text());
        counts[1] += expected.len();
    }
    counts
}

/// Two bodies.
fn bodies(small: bool, random: &mut Random) -> Vec<Arc<Mesh>> {
    let mut choose = |end: u64| (random.bits() >> 11) % end;
    if !small && let Some(folder) = std::env::var_os("PALPATE_DATA") {
        let first = choose(ORGANS.len() as u64);
        let others = [first, first + 1 + choose(ORGANS.len() as u64 - 1)];
        let path = |index: u64| {
            let name = ORGANS[index as usize % ORGANS.len()];
            PathBuf::from(&folder).join("organs").join(name).with_extension("vtk")
        };
        let read = |index| read_mesh(&path(index), &ReadOptions::default()).expect("an organ").mesh;
        return others.map(|index| Arc::new(read(index))).to_vec();
    }
    let scale = if small { 1 } else { 1 + choose(3) as usize };
    let [width, length] = [2 + choose(3) as usize, 12 + choose(30) as usize];
    let first = horseshoe(scale * length, width, [0.0; 3]);
    let second = match choose(3) {
        0 => jittered([6 * scale; 3], [0.0, 3.0, 3.0], 0.3, random),
        1 => soup(150 * scale, 6.0, random),
        _ => horseshoe(length, width * scale, [1.5, 0.5, 0.5]),
    };
    vec![first, second]
}

/// A body without the tetrahedra about a plane through one of its nodes.
fn cut(mesh: &Mesh, random: &mut Random) -> Arc<Mesh> {
    let nodes = mesh.nodes();
    let through = nodes[(random.bits() >> 11) as usize % nodes.len()];
    let normal = random.vector(1.0);
    let side = |node: u32| {
        let p = nodes[node as usize];
        (0..3).map(|axis| normal[axis] * (p[axis] - through[axis])).sum::<f64>() > 0.0
    };
    let whole = |corners: &&[u32; 4]| {
        let sides = corners.map(side);
        sides.iter().all(|&of| of == sides[0])
    };
    let kept: Vec<[u32; 4]> = mesh.tetrahedra().iter().filter(whole).copied().collect();
    let mut new = vec![u32::MAX; nodes.len()];
    let mut data = MeshData { tetrahedra: kept, ..MeshData::default() };
    for corner in data.tetrahedra.as_flattened_mut() {
        let index = &mut new[*corner as usize];
        if *index == u32::MAX {
            *index = data.nodes.len() as u32;
            data.nodes.push(nodes[*corner as usize]);
        }
        *corner = *index;
    }
    // Loose triangles have no tetrahedra, and a small body may be cut as a whole.
    Arc::new(Mesh::new(data).unwrap_or_else(|_| mesh.clone()))
}

fn size(positions: &Positions) -> f64 {
    let largest = |axis: usize| {
        let values = || positions.iter().flatten().map(|p| p[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    (0..3).map(largest).fold(0.0, f64::max)
}

/// Waves of any length, at times noise, flattening or few values, and any place in space.
fn crumpled(rest: &Positions, size: f64, random: &mut Random) -> Positions {
    let kind = random.bits() >> 11;
    let waves: Vec<(Point, Point, f64)> = (0..3)
        .map(|_| {
            let frequency = 10_f64.powf(random.between(0.0, 1.7)) / size;
            let height = random.between(0.0, 1.5) / frequency;
            (random.vector(frequency), random.vector(height), random.between(0.0, 6.3))
        })
        .collect();
    let offset = if kind.is_multiple_of(5) { random.vector(1e6 * size) } else { [0.0; 3] };
    let thickness = if kind % 7 < 2 { 10_f64.powf(random.between(-12.0, -1.0)) } else { 1.0 };
    let noise = if kind.is_multiple_of(3) { 0.02 * size } else { 0.0 };
    let grid = if kind % 11 < 2 { size / 64.0 } else { 0.0 };
    scenes::mapped(rest, |p| {
        let mut moved = p;
        for (along, height, phase) in &waves {
            let dot: f64 = (0..3).map(|axis| along[axis] * p[axis]).sum();
            for axis in 0..3 {
                moved[axis] += height[axis] * (dot + phase).sin();
            }
        }
        moved[2] *= thickness;
        let hash = Random(p.iter().fold(kind, |hash, value| hash.rotate_left(9) ^ value.to_bits()))
            .vector(noise);
        std::array::from_fn(|axis| {
            let value = moved[axis] + hash[axis];
            let value = if grid > 0.0 { (value / grid).round() * grid } else { value };
            value + offset[axis]
        })
    })
}
