//! Steps that fail: the state is that before them, bit for bit, and smaller ones help.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use glam::DQuat;
use palpate::mechanics::{Cause, State};
use palpate::model::{Body, Law, Material, RigidMotion};
use palpate::{Mesh, MeshData, Model, Simulation, SimulationError, SimulationOptions, Substeps};
use palpate_testing::rectangle;

const TOOL: usize = 1;

fn plate(z: f64) -> Body {
    let (nodes, triangles) = rectangle([-0.1; 2], [0.2; 2], z);
    let data = MeshData { nodes, triangles, ..MeshData::default() };
    let mut plate = Body::new("plate", Arc::new(Mesh::new(data).expect("a plate is a mesh")));
    plate.rigid = Some(RigidMotion::default());
    plate
}

/// A cube of 10 cm that lies on a rigid plate, which a user may move.
fn lying(law: Law, cells: usize) -> Model {
    let data = box_data([cells; 3], 0.1 / cells as f64, [0.0, 0.0, 0.001]);
    let mesh = Mesh::repaired(data).expect("a box is a mesh").0;
    let material = Material { law, young: 5e3, damping: 0.02, ..Material::default() };
    let mut cube = Body { material, ..Body::new("cube", Arc::new(mesh)) };
    cube.contact.friction = 0.3;
    Model::from_bodies(vec![cube, plate(0.0)])
}

fn start(model: Model, substeps: Substeps, threads: usize) -> Simulation {
    let options = SimulationOptions { substeps, threads, ..SimulationOptions::default() };
    Simulation::new(model, options).expect("it starts")
}

/// The state, in bits that tell the sign of zeros as well.
fn bits(simulation: &Simulation) -> (State, Vec<u64>, String) {
    let bodies = 0..simulation.model().bodies.len();
    let numbers = bodies.flat_map(|body| {
        let arrays = [
            simulation.positions(body),
            simulation.velocities(body),
            simulation.contact_force(body),
        ];
        arrays.into_iter().flatten().flatten().map(|x| x.to_bits()).collect::<Vec<_>>()
    });
    let contacts = format!("{:?}", simulation.contacts());
    (simulation.snapshot().state().clone(), numbers.collect(), contacts)
}

type Injection = (&'static str, fn(&mut Simulation), fn(&Cause) -> bool);

/// What makes the next step fail: how, and what is to blame.
const INJECTIONS: [Injection; 5] = [
    (
        "force",
        |simulation| {
            let nodes = simulation.positions(0).len();
            let mut forces = vec![[0.0; 3]; nodes];
            forces[7] = [1e308, 0.0, -1e308];
            simulation.set_forces(0, &forces).unwrap();
        },
        |cause| matches!(cause, Cause::Force(_)),
    ),
    (
        "speed",
        |simulation| {
            let mut velocities = simulation.velocities(0).to_vec();
            velocities[5] = [0.0, 1e307, 1e308];
            simulation.set_velocities(0, &velocities).unwrap();
        },
        |cause| matches!(cause, Cause::Speed(_)),
    ),
    (
        "drive",
        |simulation| {
            let drive = simulation.drives()[0].clone();
            let targets = vec![[1e300, -1e300, 0.0]; drive.nodes.len()];
            simulation.set_drive_targets(drive.id, &targets).unwrap();
        },
        |cause| matches!(cause, Cause::Driven(_)),
    ),
    (
        "spring",
        |simulation| {
            let id = simulation.pulls()[0].id;
            simulation.set_pull_target(id, [1e305, 0.0, 1e305]).unwrap();
        },
        |cause| matches!(cause, Cause::Pulled(_)),
    ),
    (
        "tool",
        |simulation| simulation.set_pose(TOOL, DQuat::IDENTITY, [0.0, 0.0, 1.7e308]).unwrap(),
        |cause| matches!(cause, Cause::Tool(_)),
    ),
];

#[test]
fn a_step_that_fails_changes_nothing_and_says_what_is_to_blame() {
    for law in [Law::Linear, Law::NeoHookean] {
        for (what, inject, blames) in INJECTIONS {
            for substeps in [Substeps::One, Substeps::Auto] {
                let mut simulation = start(lying(law, 3), substeps, 1);
                simulation.pull(0, 60, [0.05, 0.05, 0.12], 3.0).unwrap();
                if what == "drive" {
                    simulation.drive(0, &[63, 62]).unwrap();
                }
                for _ in 0..12 {
                    simulation.step().unwrap();
                }
                assert!(!simulation.contacts().is_empty());
                let mut twin = start(lying(law, 3), substeps, 1);
                inject(&mut simulation);
                let before = bits(&simulation);
                let Err(error) = simulation.step() else { panic!("{what}: the step succeeded") };
                assert!(bits(&simulation) == before, "{law:?} {what}: {error}");
                let SimulationError::Step { name, failure, substeps: tried, .. } = &error else {
                    panic!("{what}: {error}");
                };
                assert_eq!(*tried, if substeps == Substeps::Auto { 64 } else { 1 });
                assert!(blames(&failure.cause), "{law:?} {what}: {error}");
                let text = error.to_string();
                let is_tool = what == "tool";
                assert_eq!(name, if is_tool { "plate" } else { "cube" }, "{text}");
                assert_eq!(failure.tetrahedron.is_none(), is_tool, "{text}");
                assert!(text.contains(&format!("node {}", failure.node)), "{text}");
                if let Some(tetrahedron) = failure.tetrahedron {
                    let mesh = &simulation.model().bodies[0].mesh;
                    assert!(mesh.tetrahedra()[tetrahedron].contains(&(failure.node as u32)));
                }
                // It goes on as one to which nothing has happened.
                if what == "force" {
                    simulation.set_forces(0, &vec![[0.0; 3]; 64]).unwrap();
                    twin.pull(0, 60, [0.05, 0.05, 0.12], 3.0).unwrap();
                    for _ in 0..12 {
                        twin.step().unwrap();
                    }
                    for _ in 0..5 {
                        simulation.step().unwrap();
                        twin.step().unwrap();
                    }
                    assert!(bits(&simulation) == bits(&twin), "{law:?}");
                }
            }
        }
    }
}

/// Ends of a cube that its user moves by more than half its height in one step.
fn squeezed(substeps: Substeps, threads: usize) -> (Simulation, u64) {
    let mut model = lying(Law::NeoHookean, 6);
    model.bodies.pop();
    model = Model { gravity: [0.0; 3], ..Model::from_bodies(model.bodies) };
    let rest = model.bodies[0].mesh.nodes().to_vec();
    let top = |node: &u32| rest[*node as usize][2] > 0.1005;
    let bottom = |node: &u32| rest[*node as usize][2] < 0.0015;
    let nodes = |side: &dyn Fn(&u32) -> bool| (0..rest.len() as u32).filter(side).collect();
    let (upper, lower): (Vec<u32>, Vec<u32>) = (nodes(&top), nodes(&bottom));
    model.bodies[0].fixed_nodes = lower;
    let mut simulation = start(model, substeps, threads);
    let drive = simulation.drive(0, &upper).unwrap();
    let targets: Vec<_> =
        upper.iter().map(|&node| rest[node as usize]).map(|[x, y, z]| [x, y, z - 0.085]).collect();
    simulation.set_drive_targets(drive, &targets).unwrap();
    (simulation, drive)
}

#[test]
fn smaller_steps_are_tried_and_reported() {
    let (mut once, _) = squeezed(Substeps::One, 1);
    once.step().unwrap();
    let (mut simulation, _) = squeezed(Substeps::Auto, 1);
    let report = simulation.step().unwrap();
    assert!(report.substeps > 1, "one step was enough");
    assert_eq!((report.step, simulation.dynamics().step_count()), (1, 1));
    assert_eq!(report.time, 1.0 / 60.0);
    assert_eq!(simulation.time(), 1.0 / 60.0);
    let drive = &simulation.drives()[0];
    for (&node, target) in drive.nodes.iter().zip(&drive.targets) {
        assert_eq!(simulation.positions(0)[node as usize], *target);
    }
    let (worst, worst_once) = (worst_volume(&simulation), worst_volume(&once));
    assert!(worst_once < -1.0 && worst > -1.0, "{worst_once} in one step, {worst} in smaller ones");
    // At rest one step is enough again.
    let last = (0..20).map(|_| simulation.step().unwrap().substeps).last();
    assert_eq!(last, Some(1));
}

/// The smallest volume of a tetrahedron, in parts of that at rest.
fn worst_volume(simulation: &Simulation) -> f64 {
    let mesh = &simulation.model().bodies[0].mesh;
    let volumes = mesh.tetrahedra().iter().map(|corners| {
        let volume = |nodes: &[[f64; 3]]| {
            let [a, b, c, d] = corners.map(|n| glam::DVec3::from_array(nodes[n as usize]));
            glam::DMat3::from_cols(b - a, c - a, d - a).determinant()
        };
        volume(simulation.positions(0)) / volume(mesh.nodes())
    });
    volumes.fold(f64::INFINITY, f64::min)
}

#[test]
fn smaller_steps_are_the_same_bits_at_any_thread_count_and_after_a_checkpoint() {
    let play = |simulation: &mut Simulation| {
        let counts: Vec<u32> = (0..6).map(|_| simulation.step().unwrap().substeps).collect();
        (counts, bits(simulation))
    };
    let (mut first, _) = squeezed(Substeps::Auto, 1);
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("state.palpate");
    first.save(&path).unwrap();
    let expected = play(&mut first);
    assert!(expected.0[0] > 1, "one step was enough");
    for threads in [2, 3] {
        assert!(play(&mut squeezed(Substeps::Auto, threads).0) == expected, "{threads} threads");
    }
    let mut loaded = Simulation::load(&path, 2).unwrap();
    assert_eq!(loaded.options().substeps, Substeps::Auto);
    assert!(play(&mut loaded) == expected, "after a checkpoint");
    // What was made for smaller steps is used again.
    first.reset().unwrap();
    let targets = loaded.drives()[0].targets.clone();
    let drive = first.drive(0, &loaded.drives()[0].nodes.clone()).unwrap();
    first.set_drive_targets(drive, &targets).unwrap();
    assert_eq!(play(&mut first).1.1, expected.1.1, "a second time");
}

#[test]
fn steps_that_succeed_are_those_without_substeps() {
    let run = |substeps| {
        let mut simulation = start(lying(Law::NeoHookean, 3), substeps, 1);
        for _ in 0..30 {
            assert_eq!(simulation.step().unwrap().substeps, 1);
        }
        bits(&simulation)
    };
    assert!(run(Substeps::One) == run(Substeps::Auto));
}
