//! Two soft boxes, one on the other, and how tests step and compare them.

use std::sync::Arc;

use palpate::cutting::Blade;
use palpate::model::{Body, Law, RigidMotion};
use palpate::{Mesh, MeshData, Model, Simulation, SimulationOptions};
use palpate_testing::rectangle;

use super::boxes::box_data;

/// A box whose layers of cells along x are regions 1 and 0 by turns.
pub(crate) fn soft_box(cells: [usize; 3], h: f64, origin: [f64; 3]) -> Arc<Mesh> {
    let [_, ny, nz] = cells;
    let mut data = box_data(cells, h, origin);
    let layer = |tetrahedron: usize| tetrahedron / (6 * ny * nz);
    data.regions = (0..data.tetrahedra.len()).map(|t| i32::from(layer(t) % 2 == 0)).collect();
    data.node_sets.insert("low".into(), (0..data.nodes.len() as u32).step_by(nz + 1).collect());
    Arc::new(Mesh::repaired(data).expect("a box is a mesh").0)
}

/// Two soft boxes, one on the other, on a plate.
pub(crate) fn model(law: Law) -> Model {
    let (nodes, triangles) = rectangle([-1.0; 2], [1.0; 2], 0.0);
    let plate = MeshData { nodes, triangles, ..MeshData::default() };
    let mut plate = Body::new("plate", Arc::new(Mesh::new(plate).expect("a plate is a mesh")));
    plate.rigid = Some(RigidMotion::default());
    let mut lower = Body::new("lower", soft_box([4, 3, 2], 0.02, [0.0, 0.0, 0.003]));
    let mut upper = Body::new("upper", soft_box([2, 2, 3], 0.02, [0.02, 0.01, 0.046]));
    for body in [&mut lower, &mut upper] {
        body.material.law = law;
        body.material.young = 2e4;
        body.material.damping = 0.02;
        body.regions = vec![(1, body.material)];
        body.regions[0].1.density = 1100.0;
        body.processor = Some(3);
    }
    Model::from_bodies(vec![lower, upper, plate])
}

pub(crate) fn start(law: Law) -> Simulation {
    let mut simulation = Simulation::new(model(law), SimulationOptions::default()).unwrap();
    run(&mut simulation, 25);
    simulation
}

pub(crate) fn run(simulation: &mut Simulation, steps: usize) -> Vec<u64> {
    for _ in 0..steps {
        simulation.step().expect("the step succeeds");
    }
    bits(simulation)
}

pub(crate) fn bits(simulation: &Simulation) -> Vec<u64> {
    (0..simulation.model().bodies.len())
        .flat_map(|body| simulation.positions(body).as_flattened().to_vec())
        .map(f64::to_bits)
        .collect()
}

/// Through both boxes, at x = `x`, up to y = `depth`.
pub(crate) fn blade(x: f64, depth: f64) -> Blade {
    let edge = |y: f64| [[x, y, -0.1], [x + 0.003, y, 0.3]];
    Blade::stroke(&[edge(-0.1), edge(depth)]).unwrap()
}
