//! What the wide layout costs beside the paper's method and parry, by stage: real organs where
//! `PALPATE_DATA` names their folder, bent bars otherwise.
//!
//! `cargo run --release -p palpate-contact --example wide_cost [-- name ...]`

#[path = "../tests/detection/scenes.rs"]
#[expect(dead_code, reason = "the tests use the rest")]
mod scenes;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_contact::{DetectionStats, IntersectionOptions, Method, Scene, SceneOptions};
use palpate_geometry::{Aabb, triangles_intersect, vec3};
use palpate_model::{Mesh, MeshData, ReadOptions, read_mesh};
use parry3d_f64::bounding_volume::Aabb as ParryAabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace};
use rayon::prelude::*;
use scenes::{Point, Positions, as_slices, horseshoe, positions};

const FRAMES: usize = 20;

type Failure = Box<dyn std::error::Error>;

fn bodies(set: &str) -> Result<Vec<Arc<Mesh>>, Failure> {
    let Some(folder) = std::env::var_os("PALPATE_DATA") else {
        if let Some(coarse) = set.strip_suffix("/16") {
            return Ok(bodies(&format!("{coarse}/4"))?.iter().map(subdivided).collect());
        } else if let Some(coarse) = set.strip_suffix("/4") {
            return Ok(bodies(coarse)?.iter().map(subdivided).collect());
        }
        let size = if set == "paper" { 30 } else { 60 };
        return Ok((0..4).map(|i| horseshoe(size, 8, [5.0 * f64::from(i), 0.0, 0.0])).collect());
    };
    let four = |kind| ["aorta", "kidney_l", "kidney_r", "vena_cava"].map(|o| format!("{o}_{kind}"));
    let names = match set {
        "paper" | "n2500" | "n6250" => four(set).to_vec(),
        "paper/4" => return Ok(bodies("paper")?.iter().map(subdivided).collect()),
        "paper/16" => return Ok(bodies("paper/4")?.iter().map(subdivided).collect()),
        name => vec![name.to_owned()],
    };
    let path = |name| PathBuf::from(&folder).join("organs").join(name).with_extension("vtk");
    let read = |name| Ok(Arc::new(read_mesh(&path(name), &ReadOptions::default())?.mesh));
    names.into_iter().map(read).collect()
}

/// The surface alone, each triangle cut into four.
fn subdivided(mesh: &Arc<Mesh>) -> Arc<Mesh> {
    let mut nodes = mesh.nodes().to_vec();
    let middles = nodes.len() as u32;
    for &[a, b] in mesh.surface_edges() {
        nodes.push(vec3::lerp(nodes[a as usize], nodes[b as usize], 0.5));
    }
    let mut triangles = Vec::new();
    for (&[a, b, c], edges) in mesh.triangles().iter().zip(mesh.triangle_edges()) {
        let [ab, bc, ca] = edges.map(|edge| middles + edge);
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    // Inner nodes belong to no triangle.
    let mut new = vec![u32::MAX; nodes.len()];
    let mut data = MeshData::default();
    for corner in triangles.as_flattened_mut() {
        let index = &mut new[*corner as usize];
        if *index == u32::MAX {
            *index = data.nodes.len() as u32;
            data.nodes.push(nodes[*corner as usize]);
        }
        *corner = *index;
    }
    data.triangles = triangles;
    Arc::new(Mesh::new(data).expect("a subdivided surface is a mesh"))
}

fn mean_edge(meshes: &[Arc<Mesh>]) -> f64 {
    let length = |mesh: &Mesh, [a, b]: [u32; 2]| {
        let [a, b] = [a, b].map(|node| mesh.nodes()[node as usize]);
        vec3::norm(vec3::sub(a, b))
    };
    let edges = meshes
        .iter()
        .flat_map(|mesh| mesh.surface_edges().iter().map(move |&edge| length(mesh, edge)));
    let (sum, count) = edges.fold((0.0, 0), |(sum, count), edge| (sum + edge, count + 1));
    sum / f64::from(count)
}

/// Smooth waves through the rest positions, `height` edges high; the first frame is at rest.
fn frames(rest: &Positions, edge: f64, height: f64) -> Vec<Positions> {
    let wave = |p: Point, time: f64| -> Point {
        std::array::from_fn(|axis| {
            let along = p[(axis + 1) % 3] / (12.0 * edge);
            p[axis] + height * edge * (along + time + axis as f64).sin()
        })
    };
    (0..FRAMES).map(|frame| scenes::mapped(rest, |p| wave(p, 0.1 * frame as f64))).collect()
}

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e3
}

/// One bounding tree of parry per body, refitted, all leaf pairs, our exact test on its candidates.
struct Parry {
    trees: Vec<Bvh>,
    workspace: BvhWorkspace,
}

impl Parry {
    fn new(meshes: &[Arc<Mesh>]) -> Self {
        let tree = |mesh: &Arc<Mesh>| {
            let boxes: Vec<ParryAabb> = (0..mesh.triangles().len())
                .map(|t| parry_box(mesh, mesh.nodes(), t, 0.0))
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        };
        Self { trees: meshes.iter().map(tree).collect(), workspace: BvhWorkspace::default() }
    }

    fn refit(&mut self, meshes: &[Arc<Mesh>], frame: &Positions, margin: f64) {
        for ((tree, mesh), positions) in self.trees.iter_mut().zip(meshes).zip(frame) {
            for triangle in 0..mesh.triangles().len() {
                let aabb = parry_box(mesh, positions, triangle, margin);
                tree.insert_or_update_partially(aabb, triangle as u32, 0.0);
            }
            tree.refit(&mut self.workspace);
        }
    }

    /// Candidates of self and inter contact that share no node.
    fn candidates(&mut self, meshes: &[Arc<Mesh>], found: &mut Vec<[u32; 4]>) {
        found.clear();
        let Self { trees, workspace } = self;
        for (a, (tree, mesh)) in trees.iter().zip(meshes).enumerate() {
            let triangles = mesh.triangles();
            tree.traverse_bvtt_single_tree::<false>(workspace, &mut |i, j| {
                let [p, q] = [triangles[i as usize], triangles[j as usize]];
                if !p.iter().any(|node| q.contains(node)) {
                    found.push([a as u32, i, a as u32, j]);
                }
            });
            for (b, other) in trees.iter().enumerate().skip(a + 1) {
                for (i, j) in tree.leaf_pairs(other, BvhNode::intersects) {
                    found.push([a as u32, i, b as u32, j]);
                }
            }
        }
    }
}

fn parry_box(mesh: &Mesh, positions: &[Point], triangle: usize, margin: f64) -> ParryAabb {
    let corners = mesh.triangles()[triangle].map(|node| &positions[node as usize]);
    let Aabb { min, max } = Aabb::from_points(corners);
    let grow = Vector::splat(margin);
    ParryAabb::new(Vector::from(min) - grow, Vector::from(max) + grow)
}

fn main() -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let sets: Vec<String> = std::env::args().skip(1).collect();
    let sets = if sets.is_empty() {
        ["paper", "paper/4", "paper/16", "n6250", "ileum_f_n6000", "liver_f_n5000"]
            .map(str::to_owned)
            .to_vec()
    } else {
        sets
    };
    for set in &sets {
        let meshes = bodies(set)?;
        let triangles: usize = meshes.iter().map(|mesh| mesh.triangles().len()).sum();
        let gain = parallel_gain()?;
        writeln!(out, "\ntwo threads gain {gain:.2} x on work that shares nothing")?;
        let edge = mean_edge(&meshes);
        let rest = positions(&meshes);
        let diagonal = vec3::norm(Aabb::from_points(rest.iter().flatten()).extent());
        writeln!(
            out,
            "\n{set}: {triangles} surface triangles, 1e-3 diagonal {:.3} edges",
            1e-3 * diagonal / edge
        )?;
        for height in [0.0, 1.0, 4.0] {
            let frames = frames(&rest, edge, height);
            writeln!(out, " waves of {height} edges")?;
            for (method, threads) in [(Method::Paper, 1), (Method::Wide, 1), (Method::Wide, 2)] {
                measure(&mut out, &meshes, &frames, 1e-3 * diagonal, method, threads)?;
            }
            measure_parry(&mut out, &meshes, &frames)?;
        }
    }
    Ok(())
}

fn measure(
    out: &mut impl Write,
    meshes: &[Arc<Mesh>],
    frames: &[Positions],
    distance: f64,
    method: Method,
    threads: usize,
) -> Result<(), Failure> {
    let options = SceneOptions { method, threads, ..SceneOptions::default() };
    let mut scene = Scene::new(meshes.to_vec(), None, options)?;
    let mut times: [Vec<Duration>; 6] = std::array::from_fn(|_| Vec::new());
    let (mut last, mut near) = (DetectionStats::default(), DetectionStats::default());
    let (mut pairs, mut close) = (0, 0);
    for frame in frames {
        times[0].push(scene.update(&as_slices(frame))?.time);
        let found = scene.intersections(&IntersectionOptions::default());
        last = found.stats;
        pairs = found.pairs.len();
        times[1].push(last.traversal_time + last.object_time);
        times[2].push(last.polygon_time);
        let found = scene.proximity(&|_, _| Some(distance));
        near = found.stats;
        close = found.pairs.len();
        times[3].push(near.traversal_time + near.object_time);
        times[4].push(near.polygon_time);
        times[5].push(last.total_time() + near.total_time());
    }
    let [update, traverse, polygons, traverse_near, distances, _] = times.map(median);
    writeln!(
        out,
        "  {:9} x{threads} ms: update {update:.3} | meet {:.3} = {traverse:.3} + {polygons:.3} \
         ({} block/leaf pairs, {} exact, {pairs} found) | close {:.3} = {traverse_near:.3} + \
         {distances:.3} ({} distances, {close} found)",
        format!("{method:?}"),
        traverse + polygons,
        last.leaf_pairs,
        last.polygon_tests,
        traverse_near + distances,
        near.polygon_tests,
    )?;
    Ok(())
}

/// What two threads gain on work that shares nothing: the machine's own limit at this moment.
fn parallel_gain() -> Result<f64, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let work =
        |seed: &u64| (0..200_000).fold(*seed as f64, |sum, step| (sum + f64::from(step)).sqrt());
    let seeds: Vec<u64> = (0..16).collect();
    let time = |run: &dyn Fn() -> f64| {
        let once = |_| {
            let start = Instant::now();
            std::hint::black_box(run());
            start.elapsed()
        };
        median((0..9).map(once).collect())
    };
    let one = time(&|| seeds.iter().map(work).sum());
    let two = time(&|| pool.install(|| seeds.par_iter().map(work).sum()));
    Ok(one / two)
}

fn measure_parry(
    out: &mut impl Write,
    meshes: &[Arc<Mesh>],
    frames: &[Positions],
) -> Result<(), Failure> {
    let mut parry = Parry::new(meshes);
    let mut candidates = Vec::new();
    let mut times: [Vec<Duration>; 3] = std::array::from_fn(|_| Vec::new());
    let mut pairs = 0;
    for frame in frames {
        let start = Instant::now();
        parry.refit(meshes, frame, 0.0);
        times[0].push(start.elapsed());
        let start = Instant::now();
        parry.candidates(meshes, &mut candidates);
        times[1].push(start.elapsed());
        let start = Instant::now();
        let points = |body: u32, triangle: u32| {
            let corners = meshes[body as usize].triangles()[triangle as usize];
            corners.map(|node| frame[body as usize][node as usize])
        };
        let meet = |c: &&[u32; 4]| triangles_intersect(&points(c[0], c[1]), &points(c[2], c[3]));
        pairs = candidates.iter().filter(meet).count();
        times[2].push(start.elapsed());
    }
    let [refit, traverse, polygons] = times.map(median);
    writeln!(
        out,
        "  parry     x1 ms: refit {refit:.3} | meet {:.3} = {traverse:.3} + {polygons:.3} \
         ({} candidates, {pairs} found)",
        traverse + polygons,
        candidates.len(),
    )?;
    Ok(())
}
