//! What a step costs: a body of about 2,500 nodes alone, resting on a floor, and sliding on it.
//!
//! `cargo run --release -p palpate-mechanics --example step_cost [MESH ...]`; without a mesh file the
//! body is a block.

#![allow(clippy::print_stdout)] // it is what the example is for

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_contact::{Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_mechanics::{Dynamics, DynamicsOptions, StepStats};
use palpate_model::{Body, Material, Mesh, MeshData, Model, ReadOptions, RigidMotion, read_mesh};
use palpate_testing::{Fastest, box_of_cells};

const STEPS: usize = 200;

fn block() -> Result<Mesh, Box<dyn Error>> {
    let place = |at: [f64; 3]| at.map(|index| 0.006 * index);
    let (nodes, tetrahedra) = box_of_cells([16, 11, 11], Fastest::First, place);
    Ok(Mesh::new(MeshData { nodes, tetrahedra, ..MeshData::default() })?)
}

fn floor(bounds: palpate_geometry::Aabb) -> Result<Mesh, Box<dyn Error>> {
    let (low, high) = (bounds.min, bounds.max);
    let reach = 2.0 * bounds.extent()[0].max(bounds.extent()[1]);
    let z = low[2] - 1e-4;
    let (x0, x1, y0, y1) = (low[0] - reach, high[0] + reach, low[1] - reach, high[1] + reach);
    let nodes = vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    Ok(Mesh::new(MeshData { nodes, triangles, ..MeshData::default() })?)
}

fn measure(name: &str, bodies: Vec<Body>, steps: usize) -> Result<(), Box<dyn Error>> {
    let meshes = bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let model = Model::from_bodies(bodies);
    let start = Instant::now();
    let mut dynamics = Dynamics::new(&model, DynamicsOptions::default())?;
    let build = start.elapsed();
    let mut scene = Scene::new(meshes, None, SceneOptions::default())?;
    let mut stats = StepStats::default();
    let mut stages = [Duration::ZERO; 5];
    let (mut detection, mut worst) = (Duration::ZERO, Duration::ZERO);
    for step in 0..steps {
        let positions: Vec<&[Point]> =
            (0..dynamics.body_count()).map(|body| dynamics.positions(body)).collect();
        let start = Instant::now();
        scene.update(&positions)?;
        dynamics.begin_step();
        let include = |a: usize, b: usize| a != b && dynamics.search_distance(a, b).is_some();
        let penetration = scene.penetration(&include).nodes.clone();
        let pairs = scene.proximity(&|a, b| dynamics.search_distance(a, b)).pairs.clone();
        let found = start.elapsed();
        stats = dynamics.finish_step(&pairs, &penetration)?;
        let t = stats.times;
        let parts = [t.predict, t.filter, t.compliance, t.solve, t.advance];
        worst = worst.max(parts.iter().sum());
        if step >= steps / 2 {
            detection += found.saturating_sub(t.predict);
            for (sum, part) in stages.iter_mut().zip(parts) {
                *sum += part;
            }
        }
    }
    let mean = |time: Duration| time.as_secs_f64() * 1e3 / (steps - steps / 2) as f64;
    println!(
        "{name:28} build {:6.1} ms | candidates {:4} contacts {:4} systems {:4} | predict {:.3} \
         filter {:.3} compliance {:.3} solve {:.3} advance {:.3} = {:.3} ms, worst {:.1} ms | \
         detection {:.2} ms",
        build.as_secs_f64() * 1e3,
        stats.candidates,
        stats.contacts,
        stats.iterations,
        mean(stages[0]),
        mean(stages[1]),
        mean(stages[2]),
        mean(stages[3]),
        mean(stages[4]),
        stages.iter().map(|&stage| mean(stage)).sum::<f64>(),
        worst.as_secs_f64() * 1e3,
        mean(detection),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut meshes = Vec::new();
    for path in std::env::args().skip(1) {
        meshes.push((path.clone(), read_mesh(Path::new(&path), &ReadOptions::default())?.mesh));
    }
    if meshes.is_empty() {
        meshes.push(("block".to_owned(), block()?));
    }
    for (name, mesh) in meshes {
        let mesh = Arc::new(mesh);
        println!("{name}: {} nodes, {} tetrahedra", mesh.nodes().len(), mesh.tetrahedra().len());
        let floor = Arc::new(floor(mesh.bounds())?);
        let organ = |friction: f64| {
            let mut body = Body::new("organ", Arc::clone(&mesh));
            body.material = Material::default();
            body.contact.friction = friction;
            body
        };
        let ground = |friction: f64| {
            let mut body = Body::new("floor", Arc::clone(&floor));
            body.rigid = Some(RigidMotion::default());
            body.contact.friction = friction;
            body
        };
        measure("alone", vec![organ(0.0)], STEPS)?;
        measure("resting, no friction", vec![organ(0.0), ground(0.0)], STEPS)?;
        measure("resting, friction 0.3", vec![organ(0.3), ground(0.3)], STEPS)?;
    }
    Ok(())
}
