//! The step loop as a whole: bits, state and checkpoints.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use palpate::model::{Body, RigidMotion};
use palpate::{CheckpointError, Mesh, MeshData, Model, Simulation, SimulationOptions};
use palpate_testing::rectangle;

fn soft_box(cells: [usize; 3], h: f64, origin: [f64; 3]) -> Mesh {
    Mesh::repaired(box_data(cells, h, origin)).expect("a box is a mesh").0
}

fn falling_boxes() -> Model {
    let (nodes, triangles) = rectangle([-1.0; 2], [1.0; 2], 0.0);
    let plate = MeshData { nodes, triangles, ..MeshData::default() };
    let mut plate = Body::new("plate", Arc::new(Mesh::new(plate).expect("a plate is a mesh")));
    plate.rigid = Some(RigidMotion::default());
    let lower = soft_box([3, 3, 2], 0.03, [0.0, 0.0, 0.01]);
    let upper = soft_box([2, 2, 3], 0.03, [0.02, 0.01, 0.09]);
    Model::from_bodies(vec![
        Body::new("lower", Arc::new(lower)),
        Body::new("upper", Arc::new(upper)),
        plate,
    ])
}

fn run(simulation: &mut Simulation, steps: usize) -> Vec<u64> {
    for _ in 0..steps {
        simulation.step().expect("the step succeeds");
    }
    let bodies = simulation.model().bodies.len();
    (0..bodies)
        .flat_map(|body| simulation.positions(body).as_flattened().to_vec())
        .map(f64::to_bits)
        .collect()
}

#[test]
fn the_same_bits_at_any_thread_count() {
    let bits: Vec<_> = [1, 2, 3, 8]
        .into_iter()
        .map(|threads| {
            let options = SimulationOptions { threads, ..SimulationOptions::default() };
            run(&mut Simulation::new(falling_boxes(), options).expect("it starts"), 60)
        })
        .collect();
    assert!(bits.iter().all(|each| *each == bits[0]));
}

#[test]
fn bodies_that_touch_have_contacts_and_stay_apart() {
    let mut simulation =
        Simulation::new(falling_boxes(), SimulationOptions::default()).expect("it starts");
    let mut contacts = 0;
    for _ in 0..90 {
        let report = simulation.step().expect("the step succeeds");
        contacts += report.mechanics.contacts;
        assert_eq!(report.penetrating_nodes, 0, "step {}", report.step);
    }
    assert!(contacts > 0);
    let scene = simulation.scene().expect("positions are finite");
    assert!(
        scene.intersections(&palpate::contact::IntersectionOptions::default()).pairs.is_empty()
    );
}

#[test]
fn a_checkpoint_continues_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.palpate");
    let mut simulation =
        Simulation::new(falling_boxes(), SimulationOptions::default()).expect("it starts");
    run(&mut simulation, 25);
    simulation.save(&path).expect("it is written");
    let expected = run(&mut simulation, 20);
    let mut loaded = Simulation::load(&path, 2).expect("it is read");
    assert_eq!(run(&mut loaded, 20), expected);
    simulation.reset().expect("the start is its own state");
    loaded.reset().expect("the start is its own state");
    assert_eq!(run(&mut loaded, 5), run(&mut simulation, 5));
}

#[test]
fn every_damaged_byte_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.palpate");
    let simulation =
        Simulation::new(falling_boxes(), SimulationOptions::default()).expect("it starts");
    simulation.save(&path).expect("it is written");
    let whole = std::fs::read(&path).expect("it is there");
    let mut positions: Vec<usize> = (0..64).collect();
    positions.extend((64..whole.len()).step_by(997));
    for position in positions {
        let mut damaged = whole.clone();
        damaged[position] ^= 0x10;
        std::fs::write(&path, &damaged).expect("it is written");
        let refused = Simulation::load(&path, 1);
        assert!(matches!(refused, Err(CheckpointError::Unreadable { .. })), "byte {position}");
    }
    for length in [0, 5, 23, 24, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).expect("it is written");
        assert!(matches!(Simulation::load(&path, 1), Err(CheckpointError::Unreadable { .. })));
    }
}

#[test]
fn a_checkpoint_of_a_moving_path_continues_bit_for_bit() {
    use palpate::model::{Pose, RigidKey};
    let mut model = falling_boxes();
    let key = |time: f64, height: f64| RigidKey {
        time,
        translation: glam::DVec3::new(0.0, 0.0, height),
        rotation: glam::DQuat::from_rotation_z(height * 7.0),
    };
    let motion = RigidMotion { keys: vec![key(0.1, 0.0), key(1.0, 0.03)], pivot: [0.0; 3] };
    assert_ne!(motion.pose(0.5), Pose::IDENTITY);
    model.bodies[2].rigid = Some(motion);
    let options = SimulationOptions { time_step: 0.01, ..SimulationOptions::default() };
    let mut simulation = Simulation::new(model, options).expect("it starts");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.palpate");
    run(&mut simulation, 29);
    simulation.save(&path).expect("it is written");
    let expected = run(&mut simulation, 8);
    let mut loaded = Simulation::load(&path, 1).expect("it is read");
    assert_eq!(run(&mut loaded, 8), expected);
    assert_eq!(loaded.time().to_bits(), simulation.time().to_bits());
}
