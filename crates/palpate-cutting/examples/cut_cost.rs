//! What cuts of a mesh cost and how good they are: `cargo run --release --example cut_cost --
//! models/kidney.seg`.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use palpate_cutting::{Blade, Cut, CutOptions, cut, cut_on};
use palpate_geometry::{Point, vec3};
use palpate_model::{Mesh, ReadOptions, read_mesh};
use palpate_testing::Random;

/// Blades of each kind.
const BLADES: usize = 60;

#[allow(clippy::print_stdout)]
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "models/kidney.seg".into());
    let mesh = read_mesh(Path::new(&path), &ReadOptions::default())?.mesh;
    let quality = mesh.quality().ok_or("a mesh without tetrahedra")?;
    let (nodes, tetrahedra) = (mesh.nodes().len(), mesh.tetrahedra().len());
    println!(
        "{path}: {nodes} nodes, {tetrahedra} tetrahedra, smallest quality {:.3}",
        quality.worst
    );
    println!(
        "snap  bound | blade   ms: median worst | split snapped  area   | quality: median least | deviation / edge: median worst"
    );
    for (snap, min_quality) in [
        (0.0, 0.0),
        (0.05, 0.05),
        (0.05, 0.1),
        (0.1, 0.1),
        (0.15, 0.1),
        (0.2, 0.1),
        (0.25, 0.15),
        (0.3, 0.2),
    ] {
        let options = CutOptions { snap, min_quality, ..CutOptions::default() };
        for (kind, blades) in [("plane ", planes(&mesh)?), ("stroke", strokes(&mesh)?)] {
            let mut times = Vec::new();
            let mut cuts: Vec<Cut> = Vec::new();
            for blade in &blades {
                let start = Instant::now();
                let done = cut(&mesh, mesh.nodes(), blade, &options)?;
                times.push(start.elapsed().as_secs_f64() * 1e3);
                cuts.extend(done);
            }
            let edge = mesh.mean_surface_edge();
            let mean =
                |value: fn(&Cut) -> f64| cuts.iter().map(value).sum::<f64>() / cuts.len() as f64;
            let [time, slowest] = median_and_most(times);
            let qualities = cuts.iter().filter_map(|cut| cut.report.smallest_quality);
            let [quality, least] = median_and_most(qualities.map(|value| -value).collect());
            let deviations = cuts.iter().map(|cut| cut.report.deviation / edge);
            let [deviation, furthest] = median_and_most(deviations.collect());
            println!(
                "{snap:4.2}  {min_quality:4.2}  | {kind}      {time:6.2} {slowest:6.2} | {:5.0} {:6.0} {:7.1e} |         {:6.3} {:6.3} |                {deviation:6.3} {furthest:6.3}",
                mean(|cut| cut.report.split_tetrahedra as f64),
                mean(|cut| cut.report.snapped_nodes as f64),
                mean(|cut| cut.report.cut_area),
                -quality,
                -least,
            );
        }
    }
    step_by_step(&mesh)
}

/// A stroke of many steps, each a blade of its own, as a tool moves: most do nothing, as the
/// tetrahedra they reach are cut already.
#[allow(clippy::print_stdout)]
fn step_by_step(mesh: &Mesh) -> Result<(), Box<dyn Error>> {
    let (center, extent) = (mesh.bounds().center(), mesh.bounds().extent());
    let edge = |k: i32| {
        let s = f64::from(k) / 100.0;
        let x = center[0] + 1.2 * extent[0] * (s - 0.5);
        let y = center[1] + 0.1 * extent[1] * (9.0 * s).sin();
        [[x, y, center[2] + extent[2]], [x, y, center[2]]]
    };
    let options = CutOptions::default();
    let (mut now, mut positions, mut pending) = (mesh.clone(), mesh.nodes().to_vec(), Vec::new());
    let (mut opened, mut idle, mut area) = (Vec::new(), Vec::new(), 0.0);
    for k in 0..100 {
        let blade = Blade::stroke(&[edge(k), edge(k + 1)])?;
        let start = Instant::now();
        let done = cut_on(&now, &positions, &blade, &pending, &options)?;
        let time = start.elapsed().as_secs_f64() * 1e3;
        match done {
            Some(done) => {
                opened.push(time);
                area += done.report.cut_area;
                (now, positions) = ((*done.change.mesh).clone(), done.positions);
                pending = done.pending;
            }
            None => idle.push(time),
        }
    }
    println!(
        "step by step: {} of 100 steps opened {area:.2e} m2, ms {:.2?}; the others, ms {:.2?}; {} tetrahedra, quality {:.3?}",
        opened.len(),
        median_and_most(opened.clone()),
        median_and_most(idle),
        now.tetrahedra().len(),
        now.quality().map(|quality| quality.worst),
    );
    Ok(())
}

fn median_and_most(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_unstable_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() - 1]]
}

/// Whole planes through the middle half of the mesh, in all directions.
fn planes(mesh: &Mesh) -> Result<Vec<Blade>, Box<dyn Error>> {
    let mut random = Random(1);
    (0..BLADES)
        .map(|_| Ok(Blade::plane(inside(mesh, &mut random), random.vector(1.0), None)?))
        .collect()
}

/// Strokes along bent lines: 40 steps, 30 % of the body's size deep and 60 % long.
fn strokes(mesh: &Mesh) -> Result<Vec<Blade>, Box<dyn Error>> {
    let mut random = Random(2);
    let size = vec3::norm(mesh.bounds().extent());
    let stroke = |_| {
        let middle = inside(mesh, &mut random);
        let [along, depth] = [random.vector(1.0), random.vector(1.0)]
            .map(|v| vec3::normalized(v).unwrap_or([1.0, 0.0, 0.0]));
        let side = vec3::cross(along, depth);
        let edge = |k: i32| {
            let s = f64::from(k) / 40.0 - 0.5;
            let heel = vec3::add_scaled(middle, along, 0.6 * size * s);
            let heel = vec3::add_scaled(heel, side, 0.05 * size * (6.0 * s).sin());
            [heel, vec3::add_scaled(heel, depth, 0.3 * size)]
        };
        Ok(Blade::stroke(&(0..=40).map(edge).collect::<Vec<_>>())?)
    };
    (0..BLADES).map(stroke).collect()
}

fn inside(mesh: &Mesh, random: &mut Random) -> Point {
    let (center, extent) = (mesh.bounds().center(), mesh.bounds().extent());
    std::array::from_fn(|axis| center[axis] + extent[axis] * random.between(-0.25, 0.25))
}
