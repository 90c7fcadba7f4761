//! What each step of a model costs: contacts, solver effort, speeds and the time of every stage.
//!
//! `cargo run --release -p palpate-mechanics --example scene_cost MODEL [STEPS [EVERY [FRICTION [AHEAD
//! [THREADS]]]]]`

#![allow(clippy::print_stdout)] // it is what the example is for

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use palpate_contact::{ProximityOptions, Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_mechanics::{Dynamics, DynamicsOptions};
use palpate_model::{ReadOptions, load_model};

/// The value that half of `values` stay below, the one that nine tenths do, and the largest.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[9 * values.len() / 10], values[values.len() - 1]]
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give the path of a model")?;
    let mut number = |default: f64| arguments.next().map_or(Ok(default), |text| text.parse());
    let (steps, every, friction) = (number(240.0)? as usize, number(20.0)? as usize, number(-1.0)?);
    let (ahead, threads) = (number(0.0)?, number(1.0)? as usize);
    let mut model = load_model(Path::new(&path), &ReadOptions::default())?;
    if friction >= 0.0 {
        for body in &mut model.bodies {
            body.contact.friction = friction;
        }
    }
    let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let options = DynamicsOptions { threads, ..DynamicsOptions::default() };
    let mut dynamics = Dynamics::new(&model, options)?;
    if ahead > 0.0 {
        let start = Instant::now();
        let columns = dynamics.prepare_contact(usize::MAX);
        println!("{columns} responses solved ahead in {:.2} s", start.elapsed().as_secs_f64());
    }
    let options = SceneOptions { threads, ..SceneOptions::default() };
    let mut scene = Scene::new(meshes, Some(&model.structure), options)?;
    println!(
        "step contacts candidates newton refactored changes  residual  max m/s | detect predict \
         filter compliance solve advance refactor = mechanics [ms]"
    );
    let mut times: Vec<[f64; 8]> = Vec::new();
    for step in 1..=steps {
        let positions: Vec<&[Point]> =
            (0..dynamics.body_count()).map(|body| dynamics.positions(body)).collect();
        let start = Instant::now();
        scene.update(&positions)?;
        let mut detect = start.elapsed();
        dynamics.begin_step();
        let start = Instant::now();
        let local = ProximityOptions { local_minima: true, ..ProximityOptions::default() };
        let include = |a: usize, b: usize| a != b && dynamics.search_distance(a, b).is_some();
        let penetration = scene.penetration(&include).nodes.clone();
        let pairs =
            scene.proximity_with(&|a, b| dynamics.search_distance(a, b), &local).pairs.clone();
        detect += start.elapsed();
        let stats = dynamics.finish_step(&pairs, &penetration)?;
        let t = stats.times;
        let milliseconds = [t.predict, t.filter, t.compliance, t.solve, t.advance, t.refactor]
            .map(|time| time.as_secs_f64() * 1e3);
        let sum: f64 = milliseconds.iter().sum();
        let detect = detect.as_secs_f64() * 1e3;
        let [predict, filter, compliance, solve, advance, refactor] = milliseconds;
        let step_times =
            [detect, predict, filter, compliance, solve, advance, refactor, detect + sum];
        times.push(step_times);
        if step % every == 0 {
            let bodies = 0..dynamics.body_count();
            let fastest = bodies
                .flat_map(|body| dynamics.velocities(body))
                .map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt())
                .fold(0.0, f64::max);
            println!(
                "{step:4} {:8} {:10} {:6} {:10} {:6} {:9.1e} {fastest:8.5} | {detect:6.2} {predict:7.2} \
                 {filter:6.2} {compliance:10.2} {solve:5.2} {advance:7.2} {refactor:7.2} = {sum:9.2}",
                stats.contacts,
                stats.candidates,
                stats.newton_iterations,
                stats.refactored,
                stats.iterations,
                stats.residual,
            );
        }
    }
    let stages =
        ["detect", "predict", "filter", "compliance", "solve", "advance", "refactor", "step"];
    for (name, range) in [("first half", 0..steps / 2), ("second half", steps / 2..steps)] {
        println!("{name}: median, 90th percentile, worst [ms]");
        for (stage, label) in stages.iter().enumerate() {
            let [median, high, worst] = spread(times[range.clone()].iter().map(|t| t[stage]));
            println!("  {label:10} {median:7.2} {high:7.2} {worst:7.2}");
        }
    }
    Ok(())
}
