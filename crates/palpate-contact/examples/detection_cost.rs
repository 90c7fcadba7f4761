//! What detection costs by stage and leaf size, on four bodies of about 2,500 nodes: real organs where
//! `PALPATE_DATA` names their folder, bent bars otherwise.
//!
//! `cargo run --release -p palpate-contact --example detection_cost`

#[path = "../tests/detection/scenes.rs"]
#[expect(dead_code, reason = "the tests use the rest")]
mod scenes;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use palpate_contact::{DetectionStats, IntersectionOptions, Method, Scene, SceneOptions, Split};
use palpate_model::{Mesh, ReadOptions, read_mesh};
use scenes::{Point, Positions, as_slices, horseshoe, positions};

const FRAMES: usize = 40;

fn bodies() -> Result<Vec<Arc<Mesh>>, Box<dyn std::error::Error>> {
    let Some(folder) = std::env::var_os("PALPATE_DATA") else {
        return Ok((0..4).map(|i| horseshoe(30, 8, [8.5 * f64::from(i), 0.0, 0.0])).collect());
    };
    let organs = ["aorta", "kidney_l", "kidney_r", "vena_cava"];
    let path = |organ| PathBuf::from(&folder).join(format!("organs/{organ}_n2500.vtk"));
    let read = |organ| Ok(Arc::new(read_mesh(&path(organ), &ReadOptions::default())?.mesh));
    organs.into_iter().map(read).collect()
}

fn mean_edge(meshes: &[Arc<Mesh>]) -> f64 {
    let length = |mesh: &Mesh, [a, b]: [u32; 2]| {
        let [a, b] = [a, b].map(|node| mesh.nodes()[node as usize]);
        palpate_geometry::vec3::norm(palpate_geometry::vec3::sub(a, b))
    };
    let edges = meshes
        .iter()
        .flat_map(|mesh| mesh.surface_edges().iter().map(move |&edge| length(mesh, edge)));
    let (sum, count) = edges.fold((0.0, 0), |(sum, count), edge| (sum + edge, count + 1));
    sum / f64::from(count)
}

/// Smooth waves through the rest positions, a few edges high.
fn frames(rest: &Positions, edge: f64) -> Vec<Positions> {
    let wave = |p: Point, time: f64| -> Point {
        std::array::from_fn(|axis| {
            let along = p[(axis + 1) % 3] / (12.0 * edge);
            p[axis] + edge * (along + time + axis as f64).sin()
        })
    };
    (0..FRAMES).map(|frame| scenes::mapped(rest, |p| wave(p, 0.1 * frame as f64))).collect()
}

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e3
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::stdout().lock();
    let meshes = bodies()?;
    let edge = mean_edge(&meshes);
    let frames = frames(&positions(&meshes), edge);
    for mesh in &meshes {
        let (nodes, elements) = (mesh.nodes().len(), mesh.tetrahedra().len());
        let triangles = mesh.triangles().len();
        writeln!(out, "{nodes} nodes, {elements} tetrahedra, {triangles} surface triangles")?;
    }
    writeln!(
        out,
        "\nmethod split  threads  K      P | ms: refit  traverse  polygons |   self  tests  fraction | \
         close 5 %   20 %  (pairs) | inside  (nodes)"
    )?;
    for (method, split, leaf_size, threads) in [
        (Method::Paper, Split::Middle, 1, 1),
        (Method::Paper, Split::Middle, 2, 1),
        (Method::Paper, Split::Middle, 3, 1),
        (Method::Paper, Split::Middle, 5, 1),
        (Method::Paper, Split::Middle, 10, 1),
        (Method::Paper, Split::Middle, 15, 1),
        (Method::Paper, Split::Middle, 20, 1),
        (Method::Paper, Split::Middle, 40, 1),
        (Method::Paper, Split::Middle, 10, 2),
        (Method::Paper, Split::Count, 1, 1),
        (Method::Paper, Split::Count, 2, 1),
        (Method::Paper, Split::Count, 5, 1),
        (Method::Paper, Split::Count, 10, 1),
        (Method::Hash, Split::Middle, 2, 1),
    ] {
        let options = SceneOptions { method, split, leaf_size, threads };
        let mut scene = Scene::new(meshes.clone(), None, options)?;
        let tree_nodes: usize = (0..4).map(|body| scene.tree(body).nodes().len()).sum();
        let mut times: [Vec<Duration>; 7] = std::array::from_fn(|_| Vec::new());
        let mut last = DetectionStats::default();
        let (mut pairs, mut inside) = (0, 0);
        for frame in &frames {
            times[0].push(scene.update(&as_slices(frame))?.time);
            last = scene.intersections(&IntersectionOptions::default()).stats;
            times[1].push(last.traversal_time + last.object_time);
            times[2].push(last.polygon_time);
            let others = IntersectionOptions { self_contact: false, ..Default::default() };
            let without = scene.intersections(&others).stats.total_time();
            times[3].push(last.total_time().saturating_sub(without));
            times[4].push(scene.proximity(&|_, _| Some(0.05 * edge)).stats.total_time());
            let wide = scene.proximity(&|_, _| Some(0.2 * edge));
            pairs = wide.pairs.len();
            times[5].push(wide.stats.total_time());
            let penetration = scene.penetration(&|_, _| true);
            inside = penetration.nodes.len();
            times[6].push(penetration.stats.total_time());
        }
        let [refit, traverse, polygons, own, near, wide, deep] = times.map(median);
        writeln!(
            out,
            "{:6} {:6} {threads:7} {leaf_size:4} {tree_nodes:6} |   {refit:7.3} {traverse:9.3} {polygons:9.3} | \
             {own:6.3} {:6} 1/{:<7.0} | {near:9.3} {wide:6.3} {pairs:8} | {deep:6.3} {inside:8}",
            format!("{method:?}"),
            format!("{split:?}"),
            last.polygon_tests,
            1.0 / last.tested_fraction(),
        )?;
    }
    Ok(())
}
