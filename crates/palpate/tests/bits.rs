//! The same bits at any number of threads, on the scalar and the vector paths, in every build.
//!
//! Detection and cutting use the IEEE operations alone: their hashes are committed and hold on any machine. The mechanics also
//! use fused multiplication in vectors as wide as the processor has, and the exponential, logarithm and
//! arc tangent of the system: their hashes are compared within a run, and with those in the file that
//! `PALPATE_BITS` names when there is one (`make bits`: the same in a debug build).

#[path = "support/boxes.rs"]
mod boxes;

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use boxes::box_data;
use palpate::contact::{IntersectionOptions, Method};
use palpate::cutting::{Blade, CutOptions, cut};
use palpate::geometry::Point;
use palpate::model::{Body, Law, RigidMotion};
use palpate::{Mesh, MeshData, Model, Scene, SceneOptions, Simulation, SimulationOptions};
use palpate_testing::rectangle;

const THREADS: [usize; 5] = [1, 2, 3, 8, 16];

/// FNV-1a (Fowler, Noll and Vo 1991), 64 bits.
struct Hash(u64);

impl Hash {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn number(&mut self, number: u64) {
        for byte in number.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn points(&mut self, points: &[Point]) {
        points.as_flattened().iter().for_each(|x| self.number(x.to_bits()));
    }

    fn indices<const N: usize>(&mut self, rows: &[[u32; N]]) {
        rows.as_flattened().iter().for_each(|&index| self.number(u64::from(index)));
    }
}

fn soft_box(cells: [usize; 3], h: f64, origin: Point) -> Arc<Mesh> {
    let mut data = box_data(cells, h, origin);
    data.regions = (0..data.tetrahedra.len()).map(|t| (t % 2) as i32).collect();
    Arc::new(Mesh::repaired(data).expect("a box is a mesh").0)
}

/// A cubic wave through the points, without a function of the system.
fn waved(points: &[Point], frame: usize) -> Vec<Point> {
    let t = frame as f64 * 0.37;
    let wave = |x: f64| {
        let s = x * 3.0 + t;
        let s = s - s.floor();
        s * (s - 0.5) * (s - 1.0)
    };
    points.iter().map(|&[x, y, z]| [x + wave(y), y + wave(z), z + wave(x) - 0.1 * t]).collect()
}

fn detection(method: Method, threads: usize) -> u64 {
    let meshes = vec![
        soft_box([9, 4, 3], 0.11, [0.0, 0.0, 0.0]),
        soft_box([4, 8, 4], 0.09, [0.31, -0.2, 0.27]),
        soft_box([1, 2, 8], 0.13, [0.53, 0.1, -0.45]),
    ];
    let options = SceneOptions { method, threads, ..SceneOptions::default() };
    let mut scene = Scene::new(meshes.clone(), None, options).unwrap();
    let mut hash = Hash::new();
    for frame in 0..4 {
        let positions: Vec<_> = meshes.iter().map(|mesh| waved(mesh.nodes(), frame)).collect();
        let slices: Vec<_> = positions.iter().map(Vec::as_slice).collect();
        scene.update(&slices).unwrap();
        for pair in &scene.intersections(&IntersectionOptions::default()).pairs {
            let row = [pair.body_a, pair.triangle_a, pair.body_b, pair.triangle_b];
            hash.indices(&[row]);
        }
        for pair in &scene.proximity(&|_, _| Some(0.02)).pairs {
            hash.indices(&[pair.nodes]);
            hash.points(&[pair.normal]);
            pair.weights.iter().for_each(|weight| hash.number(weight.to_bits()));
            hash.number(pair.distance.to_bits());
        }
        for node in &scene.penetration(&|_, _| true).nodes {
            hash.indices(&[[node.body, node.node, node.into_body, node.triangle]]);
            hash.points(&[node.weights, node.direction]);
            hash.number(node.depth.to_bits());
        }
        let points = waved(meshes[2].nodes(), 9);
        for found in scene.closest(&points, None, f64::INFINITY).unwrap().iter().flatten() {
            hash.points(&[found.position]);
        }
        for found in scene.cast(&points, &points, None, f64::INFINITY).unwrap().iter().flatten() {
            hash.number(found.distance.to_bits());
        }
    }
    hash.0
}

fn cuts() -> u64 {
    let mut mesh = soft_box([6, 5, 4], 0.1, [0.0; 3]);
    let mut hash = Hash::new();
    let edge = |x: f64, y: f64| [[x, y, -0.3], [x + 0.05, y + 0.02, 0.7]];
    let blades = [
        Blade::plane([0.31, 0.2, 0.1], [1.0, 0.3, -0.2], None),
        Blade::stroke(&[edge(0.1, -0.2), edge(0.15, 0.2), edge(0.12, 0.33)]),
        Blade::plane([0.3, 0.2, 0.22], [0.1, 0.0, 1.0], Some(0.35)),
    ];
    for blade in blades {
        let positions = waved(mesh.nodes(), 1);
        let done = cut(&mesh, &positions, &blade.unwrap(), &CutOptions::default());
        let done = done.unwrap().expect("it meets the box");
        mesh = done.change.mesh;
        hash.points(mesh.nodes());
        hash.points(&done.positions);
        hash.indices(mesh.tetrahedra());
        hash.indices(mesh.triangles());
    }
    hash.0
}

/// Boxes of one law on a plate, pulled, driven and cut.
fn simulation(law: Law, threads: usize) -> u64 {
    let (nodes, triangles) = rectangle([-1.0; 2], [1.0; 2], 0.0);
    let plate = MeshData { nodes, triangles, ..MeshData::default() };
    let mut plate = Body::new("plate", Arc::new(Mesh::new(plate).unwrap()));
    plate.rigid = Some(RigidMotion::default());
    let mut bodies = vec![
        Body::new("lower", soft_box([3, 3, 2], 0.02, [0.0, 0.0, 0.002])),
        Body::new("upper", soft_box([2, 2, 2], 0.02, [0.013, 0.01, 0.044])),
        plate,
    ];
    for body in &mut bodies {
        body.contact.friction = 0.4;
        body.material.law = law;
        body.material.damping = 0.02;
        if law == Law::HolzapfelGasserOgden {
            body.material.fibres[0] = Some([0.3, 0.1, 1.0]);
        }
    }
    let options = SimulationOptions { threads, ..SimulationOptions::default() };
    let mut simulation = Simulation::new(Model::from_bodies(bodies), options).unwrap();
    let pull = simulation.pull(1, 5, [0.1, 0.05, 0.1], 8.0).unwrap();
    let driven = [0, 3];
    let start: Vec<Point> = driven.map(|node| simulation.positions(0)[node]).to_vec();
    let drive = simulation.drive(0, &[0, 3]).unwrap();
    let mut hash = Hash::new();
    for step in 0..24 {
        let along = 0.0005 * f64::from(step);
        let targets: Vec<Point> = start.iter().map(|&[x, y, z]| [x - along, y, z]).collect();
        simulation.set_drive_targets(drive, &targets).unwrap();
        if step == 9 {
            let edge = |y: f64| [[0.031, y, -0.1], [0.034, y, 0.3]];
            let blade = Blade::stroke(&[edge(-0.1), edge(0.04)]).unwrap();
            let report = simulation.cut(&blade, &CutOptions::default()).unwrap();
            assert!(!report.bodies.is_empty());
        }
        if step == 15 {
            simulation.release(pull).unwrap();
        }
        let report = simulation.step().unwrap();
        hash.number(report.mechanics.contacts as u64);
        for body in 0..3 {
            hash.points(simulation.positions(body));
            hash.points(simulation.velocities(body));
            hash.points(simulation.contact_force(body));
        }
    }
    hash.0
}

const DETECTION: u64 = 0x4b71_fb88_6a72_ebea;
const CUTS: u64 = 0x8d83_c722_5f31_509a;

#[test]
fn detection_has_the_committed_bits_at_any_number_of_threads() {
    for method in Method::ALL {
        for threads in THREADS {
            let hash = detection(method, threads);
            assert_eq!(hash, DETECTION, "{method:?}, {threads} threads: {hash:#018x}");
        }
    }
}

#[test]
fn cuts_have_the_committed_bits() {
    assert_eq!(cuts(), CUTS, "{:#018x}", cuts());
}

#[test]
fn simulations_have_the_same_bits_at_any_number_of_threads() {
    for law in Law::ALL {
        let expected = simulation(law, 1);
        for threads in [2, 3, 8, 16] {
            assert_eq!(simulation(law, threads), expected, "{law:?}, {threads} threads");
        }
    }
}

/// All hashes, in a text.
fn told() -> String {
    let laws = Law::ALL.iter().map(|&law| format!("{law:?} {:#018x}\n", simulation(law, 1)));
    laws.chain([format!("detection {:#018x}\n", detection(Method::Wide, 1))]).collect()
}

/// What [`scalar_and_vector_paths_have_the_same_bits`] and `make bits` start.
#[test]
fn hashes_are_those_in_the_file() {
    let Some(file) = std::env::var_os("PALPATE_BITS") else { return };
    let (file, now) = (Path::new(&file), told());
    match std::fs::read_to_string(file) {
        Ok(before) => assert_eq!(now, before),
        Err(_) => std::fs::write(file, now).unwrap(),
    }
}

#[test]
fn scalar_and_vector_paths_have_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bits");
    for path in ["scalar", "avx2", "avx512"] {
        let done = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "hashes_are_those_in_the_file"])
            .env("PALPATE_SIMD", path)
            .env("PALPATE_BITS", &file)
            .output()
            .unwrap();
        assert!(done.status.success(), "{path}: {}", String::from_utf8_lossy(&done.stdout));
        assert!(file.exists());
    }
}
