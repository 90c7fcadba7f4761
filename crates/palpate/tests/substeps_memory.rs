//! What steps in smaller ones take in memory is given back when they are not needed any more.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use palpate::model::{Body, Law, Material};
use palpate::{Mesh, Model, Simulation, SimulationOptions, Substeps};
use palpate_testing::{Counting, bytes_in_use};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A cube of 10 cm that stands on its lower face and whose upper face is moved.
struct Press {
    simulation: Simulation,
    upper: Vec<u32>,
    drive: u64,
}

impl Press {
    fn new() -> Self {
        let mesh = Mesh::repaired(box_data([6; 3], 0.1 / 6.0, [0.0; 3])).expect("a box").0;
        let face = |side: &dyn Fn(f64) -> bool| {
            let nodes = (0..).zip(mesh.nodes()).filter(|(_, place)| side(place[2]));
            nodes.map(|(node, _)| node).collect::<Vec<u32>>()
        };
        let (fixed_nodes, upper) = (face(&|z| z < 0.001), face(&|z| z > 0.0999));
        let material =
            Material { law: Law::NeoHookean, young: 5e3, damping: 0.02, ..Material::default() };
        let mut cube = Body { material, fixed_nodes, ..Body::new("cube", Arc::new(mesh)) };
        cube.contact.self_contact = false;
        let model = Model { gravity: [0.0; 3], ..Model::from_bodies(vec![cube]) };
        let options =
            SimulationOptions { substeps: Substeps::Auto, ..SimulationOptions::default() };
        let mut simulation = Simulation::new(model, options).expect("it starts");
        let drive = simulation.drive(0, &upper).unwrap();
        Self { simulation, upper, drive }
    }

    /// The smaller steps of one in which the upper face goes so far below its place at rest.
    fn press(&mut self, depth: f64) -> u32 {
        let rest = self.simulation.model().bodies[0].mesh.nodes();
        let places = self.upper.iter().map(|&node| rest[node as usize]);
        let targets: Vec<_> = places.map(|[x, y, z]| [x, y, z - depth]).collect();
        self.simulation.set_drive_targets(self.drive, &targets).unwrap();
        self.simulation.step().unwrap().substeps
    }
}

#[test]
fn memory_for_smaller_steps_is_given_back() {
    let mut press = Press::new();
    for _ in 0..10 {
        press.press(0.0);
    }
    let whole = bytes_in_use();
    for round in 0..3 {
        assert!(press.press(0.085) > 1, "one step was enough");
        let most = bytes_in_use();
        assert!(most > whole + whole / 3, "round {round}: from {whole} to {most} bytes");
        for k in 1..=300 {
            assert_eq!(press.press(0.085 * (1.0 - f64::from(k) / 50.0).max(0.0)), 1);
        }
        let after = bytes_in_use();
        assert!(after < whole + whole / 20, "round {round}: from {whole} to {after} bytes");
    }
}
