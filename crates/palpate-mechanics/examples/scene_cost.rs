//! What each step of a model costs: contacts, solver effort, speeds and the time of every stage.
//!
//! `cargo run --release -p palpate-mechanics --example scene_cost MODEL [STEPS [EVERY [FRICTION [AHEAD]]]]`

#![allow(clippy::print_stdout)] // it is what the example is for

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use palpate_contact::{ProximityOptions, Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_mechanics::{Dynamics, DynamicsOptions};
use palpate_model::{CoreLoader, load_model};

/// Largest value of `values`, and the one that half of them stay below.
fn spread(values: &mut [f64]) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() - 1]]
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("give the path of a model")?;
    let mut number = |default: f64| arguments.next().map_or(Ok(default), |text| text.parse());
    let (steps, every, friction) = (number(240.0)? as usize, number(20.0)? as usize, number(-1.0)?);
    let ahead = number(0.0)?;
    let mut model = load_model(Path::new(&path), &CoreLoader)?;
    if friction >= 0.0 {
        for body in &mut model.bodies {
            body.contact.friction = friction;
        }
    }
    let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let mut dynamics = Dynamics::new(&model, DynamicsOptions::default())?;
    if ahead > 0.0 {
        let start = Instant::now();
        let columns = dynamics.prepare_contact(usize::MAX);
        println!("{columns} responses solved ahead in {:.2} s", start.elapsed().as_secs_f64());
    }
    let mut scene = Scene::new(meshes, Some(&model.structure), SceneOptions::default())?;
    println!(
        "step contacts candidates newton refactored changes  residual  max m/s | detect predict \
         filter compliance solve advance refactor = mechanics [ms]"
    );
    let (mut mechanics, mut detection) = (Vec::new(), Vec::new());
    for step in 1..=steps {
        let positions: Vec<&[Point]> =
            (0..dynamics.body_count()).map(|body| dynamics.positions(body)).collect();
        let start = Instant::now();
        scene.update(&positions)?;
        let mut detect = start.elapsed();
        dynamics.begin_step();
        let start = Instant::now();
        let once = ProximityOptions { each_feature_once: true, ..ProximityOptions::default() };
        let include = |a: usize, b: usize| a != b && dynamics.search_distance(a, b).is_some();
        let penetration = scene.penetration(&include).nodes.clone();
        let pairs =
            scene.proximity_with(&|a, b| dynamics.search_distance(a, b), &once).pairs.clone();
        detect += start.elapsed();
        let stats = dynamics.finish_step(&pairs, &penetration)?;
        let t = stats.times;
        let milliseconds = [t.predict, t.filter, t.compliance, t.solve, t.advance, t.refactor]
            .map(|time| time.as_secs_f64() * 1e3);
        let sum: f64 = milliseconds.iter().sum();
        let detect = detect.as_secs_f64() * 1e3;
        mechanics.push(sum);
        detection.push(detect);
        if step % every == 0 {
            let bodies = 0..dynamics.body_count();
            let fastest = bodies
                .flat_map(|body| dynamics.velocities(body))
                .map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt())
                .fold(0.0, f64::max);
            let [predict, filter, compliance, solve, advance, refactor] = milliseconds;
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
    let rest = steps / 2;
    for (name, range) in [("first half", 0..rest), ("second half", rest..steps)] {
        let [mechanics, mechanics_worst] = spread(&mut mechanics[range.clone()]);
        let [detection, detection_worst] = spread(&mut detection[range]);
        println!(
            "{name}: mechanics median {mechanics:.2} worst {mechanics_worst:.2} ms, detection \
             median {detection:.2} worst {detection_worst:.2} ms"
        );
    }
    Ok(())
}
