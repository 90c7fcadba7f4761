//! Nodes that are moved along a path.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use palpate::{Simulation, SimulationOptions};
use palpate_geometry::Point;
use palpate_model::{Body, Law, Material, Mesh, Model};

/// Of 1 cm along x.
const CELLS: u32 = 8;
const YOUNG: f64 = 1e4;

/// The bar, held at x = 0, without gravity.
fn held_bar(law: Law, damping: f64) -> Model {
    let material = Material { law, young: YOUNG, poisson: 0.0, damping, ..Material::default() };
    let data = box_data([CELLS as usize, 1, 1], 0.01, [0.0; 3]);
    let mesh = Arc::new(Mesh::repaired(data).expect("a valid bar").0);
    let body = Body { material, fixed_nodes: vec![0, 1, 2, 3], ..Body::new("bar", mesh) };
    Model { gravity: [0.0; 3], ..Model::from_bodies(vec![body]) }
}

fn far_end() -> Vec<u32> {
    (4 * CELLS..4 * CELLS + 4).collect()
}

fn sum(forces: &[Point]) -> Point {
    forces.iter().fold([0.0; 3], |s, f| std::array::from_fn(|k| s[k] + f[k]))
}

#[test]
fn a_driven_end_stretches_the_bar_with_the_force_of_the_law() {
    for law in [Law::Linear, Law::Corotated] {
        let mut simulation =
            Simulation::new(held_bar(law, 0.05), SimulationOptions::default()).unwrap();
        let rest = simulation.positions(0).to_vec();
        let end = far_end();
        let id = simulation.drive(0, &[end[2], end[0], end[1], end[3], end[0]]).unwrap();
        for step in 1..=300 {
            let stretch = 1e-3 * (f64::from(step) / 50.0).min(1.0);
            let targets: Vec<Point> = end
                .iter()
                .map(|&n| rest[n as usize])
                .map(|[x, y, z]| [x + stretch, y, z])
                .collect();
            simulation.set_drive_targets(id, &targets).unwrap();
            simulation.step().unwrap();
            for (&node, target) in end.iter().zip(&targets) {
                assert_eq!(simulation.positions(0)[node as usize], *target);
            }
        }
        for (node, x) in simulation.positions(0).iter().enumerate() {
            let [x0, ..] = rest[node];
            assert!((x[0] - x0 * (1.0 + 1e-3 / 0.08)).abs() < 2e-7, "{law:?}: node {node}");
        }
        // nu = 0: E times strain times area, whatever the mesh.
        let force = sum(&simulation.drives()[0].forces);
        let expected = YOUNG * (1e-3 / 0.08) * 1e-4;
        assert!((force[0] / expected - 1.0).abs() < 1e-3, "{law:?}: {force:?} N, {expected} N");
        assert!(force[1].abs() + force[2].abs() < 1e-3 * expected, "{law:?}: {force:?} N");
    }
}

#[test]
fn what_moves_a_body_gives_it_its_momentum() {
    // Not held: all momentum comes through the driven nodes.
    for law in [Law::Linear, Law::NeoHookean] {
        let mut model = held_bar(law, 0.01);
        model.bodies[0].fixed_nodes.clear();
        let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
        let rest = simulation.positions(0).to_vec();
        let end = far_end();
        let id = simulation.drive(0, &end).unwrap();
        let mut impulse = [0.0; 3];
        for step in 1..=40 {
            let lift = 2e-5 * f64::from(step) * f64::from(step);
            let targets: Vec<Point> =
                end.iter().map(|&n| rest[n as usize]).map(|[x, y, z]| [x, y, z + lift]).collect();
            simulation.set_drive_targets(id, &targets).unwrap();
            simulation.step().unwrap();
            let force = sum(&simulation.drives()[0].forces);
            impulse = std::array::from_fn(|k| impulse[k] + force[k] / 60.0);
        }
        let momentum = simulation.dynamics().momentum().linear;
        for k in 0..3 {
            let error = (momentum[k] - impulse[k]).abs();
            assert!(error < 2e-3 * impulse[2].abs(), "{law:?}: {momentum:?}, {impulse:?}");
        }
    }
}

#[test]
fn a_drive_is_part_of_the_state_and_ends() {
    let model = Arc::new(held_bar(Law::NeoHookean, 0.02));
    let mut simulation = Simulation::new(Arc::clone(&model), SimulationOptions::default()).unwrap();
    let end = far_end();
    let nodes = [end[0], end[1], 2, 3];
    let id = simulation.drive(0, &nodes).unwrap();
    let play = |simulation: &mut Simulation, steps: std::ops::Range<u32>| {
        for step in steps {
            let drive = simulation.drives()[0].clone();
            let height = 5e-4 * f64::from(step % 7);
            let targets: Vec<Point> =
                drive.targets.iter().map(|&[x, y, _]| [x, y, height]).collect();
            simulation.set_drive_targets(drive.id, &targets).unwrap();
            simulation.step().unwrap();
        }
    };
    play(&mut simulation, 0..10);
    let snapshot = simulation.snapshot();
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("state.palpate");
    simulation.save(&path).unwrap();
    play(&mut simulation, 10..20);
    let expected = simulation.snapshot().state().clone();

    let mut loaded = Simulation::load(&path, 2).unwrap();
    play(&mut loaded, 10..20);
    assert!(*loaded.snapshot().state() == expected, "a checkpoint continues otherwise");
    simulation.restore(&snapshot).unwrap();
    play(&mut simulation, 10..20);
    assert!(*simulation.snapshot().state() == expected, "a snapshot continues otherwise");

    simulation.release_drive(id).unwrap();
    assert!(simulation.release_drive(id).is_err());
    assert_eq!(simulation.model().bodies[0].fixed_nodes, [0, 1, 2, 3], "held before, held again");
    let place = simulation.positions(0)[end[0] as usize];
    simulation.step().unwrap();
    assert_ne!(simulation.positions(0)[end[0] as usize], place, "it springs back");
    simulation.restore(&snapshot).unwrap();
    assert_eq!(simulation.drives().len(), 1);
    simulation.reset().unwrap();
    assert!(simulation.drives().is_empty());
    assert_eq!(simulation.positions(0), model.bodies[0].mesh.nodes());
}

#[test]
fn what_cannot_be_driven_is_refused_and_changes_nothing() {
    let mut simulation =
        Simulation::new(held_bar(Law::Linear, 0.01), SimulationOptions::default()).unwrap();
    simulation.drive(0, &[5, 6]).unwrap();
    let before = simulation.snapshot().state().clone();
    let cases = [
        (simulation.drive(0, &[]), "expected at least one node"),
        (simulation.drive(0, &[99]), "node 99 does not exist: body 0 has 36 nodes"),
        (simulation.drive(0, &[7, 6]), "node 6 of body 0 is driven already"),
        (simulation.drive(3, &[0]), "body 3 does not exist"),
    ];
    for (result, message) in cases {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let wrong = simulation.set_drive_targets(0, &[[0.0; 3]]).unwrap_err().to_string();
    assert!(wrong.contains("1 entries were given"), "{wrong}");
    let nan = simulation.set_drive_targets(0, &[[0.0; 3], [f64::NAN; 3]]).unwrap_err().to_string();
    assert!(nan.contains("the target of node 6 of body 0 is not finite"), "{nan}");
    assert!(*simulation.snapshot().state() == before, "an error changes nothing");
}

#[test]
fn a_state_with_a_spring_on_a_driven_node_can_be_loaded() {
    let mut simulation =
        Simulation::new(held_bar(Law::Linear, 0.05), SimulationOptions::default()).unwrap();
    let node = far_end()[1];
    let pull = simulation.pull(0, node as usize, [0.2, 0.0, 0.0], 5.0).unwrap();
    simulation.drive(0, &[node]).unwrap();
    simulation.step().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.palpate");
    simulation.save(&path).unwrap();
    let mut loaded = Simulation::load(&path, 1).unwrap();
    for simulation in [&mut simulation, &mut loaded] {
        let drive = simulation.drives()[0].id;
        simulation.release_drive(drive).unwrap();
        simulation.step().unwrap();
        assert_eq!(simulation.pulls()[0].id, pull);
    }
    assert_eq!(loaded.positions(0), simulation.positions(0));
}
