//! What point queries cost: real organs where `PALPATE_DATA` names their folder, bent bars otherwise.
//!
//! `cargo run --release -p palpate-contact --example point_cost`

#[path = "../tests/detection/scenes.rs"]
#[expect(dead_code, reason = "the tests use the rest")]
mod scenes;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use palpate_contact::{Method, Scene, SceneOptions};
use palpate_geometry::Aabb;
use palpate_model::{Mesh, ReadOptions, read_mesh};
use scenes::{Point, Random, horseshoe};

const POINTS: usize = 10_000;

fn bodies() -> Result<Vec<Arc<Mesh>>, Box<dyn std::error::Error>> {
    let Some(folder) = std::env::var_os("PALPATE_DATA") else {
        return Ok((0..4).map(|i| horseshoe(30, 8, [8.5 * f64::from(i), 0.0, 0.0])).collect());
    };
    let organs = ["aorta", "kidney_l", "kidney_r", "vena_cava"];
    let path = |organ| PathBuf::from(&folder).join(format!("organs/{organ}_n2500.vtk"));
    let read = |organ| Ok(Arc::new(read_mesh(&path(organ), &ReadOptions::default())?.mesh));
    organs.into_iter().map(read).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout().lock();
    let meshes = bodies()?;
    let bounds = meshes.iter().fold(Aabb::EMPTY, |all, mesh| all.union(&mesh.bounds()));
    let mut random = Random(1);
    let points: Vec<Point> = (0..POINTS)
        .map(|_| std::array::from_fn(|axis| random.between(bounds.min[axis], bounds.max[axis])))
        .collect();
    let near: Vec<Point> = (0..POINTS)
        .map(|_| {
            let mesh = &meshes[random.bits() as usize % meshes.len()];
            let nodes = mesh.surface_nodes();
            let node = mesh.nodes()[nodes[random.bits() as usize % nodes.len()] as usize];
            let offset = random.vector(0.005 * bounds.extent()[2]);
            std::array::from_fn(|axis| node[axis] + offset[axis])
        })
        .collect();
    let directions: Vec<Point> = (0..POINTS).map(|_| random.vector(1.0)).collect();
    let each = |start: Instant| start.elapsed().as_secs_f64() * 1e6 / POINTS as f64;
    writeln!(
        out,
        "microseconds per point; closest: anywhere in the scene's box, near the surface"
    )?;
    for method in [Method::Wide, Method::Paper] {
        let options = SceneOptions { method, ..SceneOptions::default() };
        let mut scene = Scene::new(meshes.clone(), None, options)?;
        let mut best = [f64::INFINITY; 4];
        for _ in 0..5 {
            let start = Instant::now();
            scene.closest(&points, None, f64::INFINITY)?;
            best[0] = best[0].min(each(start));
            let start = Instant::now();
            scene.closest(&near, None, f64::INFINITY)?;
            best[1] = best[1].min(each(start));
            let start = Instant::now();
            scene.contains(&near, None)?;
            best[2] = best[2].min(each(start));
            let start = Instant::now();
            scene.cast(&near, &directions, None, f64::INFINITY)?;
            best[3] = best[3].min(each(start));
        }
        let [anywhere, near, contains, cast] = best;
        writeln!(
            out,
            "{method:?}: closest {anywhere:.2} {near:.2}, contains {contains:.2}, cast {cast:.2}"
        )?;
    }
    Ok(())
}
