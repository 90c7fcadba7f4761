//! At steady state a tick of a tool's loop allocates nothing, and neither does telling it about a step.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use glam::DQuat;
use palpate::model::{Body, RigidMotion};
use palpate::{Mesh, MeshData, Model, Simulation, SimulationOptions};
use palpate_testing::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn ticks_and_steps_at_rest_allocate_nothing() {
    let mesh = Mesh::repaired(box_data([6, 6, 3], 0.01, [0.0; 3])).expect("a box").0;
    let fixed = (0..mesh.nodes().len() as u32).filter(|&n| mesh.nodes()[n as usize][2] < 1e-6);
    let fixed_nodes = fixed.collect();
    let mut tissue = Body { fixed_nodes, ..Body::new("tissue", Arc::new(mesh)) };
    tissue.contact.friction = 0.3;
    let corners = [[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [0, 0, 0], [0, 0, 2]];
    let mut data = MeshData {
        nodes: corners.iter().map(|c| c.map(|x: i32| 0.05 + 0.01 * f64::from(x))).collect(),
        ..MeshData::default()
    };
    for k in 0..4 {
        data.triangles.push([k, (k + 1) % 4, 5]);
        data.triangles.push([(k + 1) % 4, k, 4]);
    }
    let mut probe = Body::new("probe", Arc::new(Mesh::new(data).expect("an octahedron")));
    probe.rigid = Some(RigidMotion { pivot: [0.05; 3], ..RigidMotion::default() });
    let model = Model::from_bodies(vec![tissue, probe]);
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    let mut tool = simulation.tool_loop(1, None).unwrap();
    let place = |tick: u32| [0.032 + 1e-4 * f64::from(tick % 3), 0.031, 0.0275];
    let mut counted = 0;
    let mut contacts = 0;
    for step in 0..150 {
        for tick in 0..16 {
            let before = allocations();
            let felt = tool.tick(DQuat::IDENTITY, place(tick)).unwrap();
            if step >= 100 {
                counted += allocations() - before;
                contacts += felt.contacts;
            }
        }
        let before = allocations();
        simulation.step().unwrap();
        if step >= 100 {
            counted += allocations() - before;
        }
    }
    assert!(contacts >= 50 * 16, "{contacts} contacts");
    assert_eq!(counted, 0);
}
