//! What each frame of a long cut costs: the stages of the cut and of the step after it. With a delay the
//! cut is prepared beside the steps, and frames begin 1/60 s apart or later.
//!
//! `cargo run --release -p palpate --example cut_frames MODEL BODY [FRAMES [THREADS [SETTLE [DELAY]]]]`

#![allow(clippy::print_stdout)] // it is what the example is for

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use palpate::cutting::{Blade, CutOptions};
use palpate::{ChangeReport, ReadOptions, Simulation, SimulationOptions, load_model};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let model =
        load_model(Path::new(&arguments.next().ok_or("give a model")?), &ReadOptions::default())?;
    let name = arguments.next().ok_or("give the name of a body")?;
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (frames, threads, settle) = (number(100)?, number(1)?, number(240)?);
    let delay = number(0)? as u32;
    let body = model.bodies.iter().position(|body| body.name == name).ok_or("no such body")?;
    let options = SimulationOptions { threads, ..SimulationOptions::default() };
    let mut simulation = Simulation::new(model, options)?;
    for _ in 0..settle {
        simulation.step()?;
    }
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in simulation.positions(body) {
        for k in 0..3 {
            low[k] = low[k].min(point[k]);
            high[k] = high[k].max(point[k]);
        }
    }
    let size = [0, 1, 2].map(|k| high[k] - low[k]);
    let along = usize::from(size[0] <= size[1]);
    let edge = |frame: usize| {
        let s = -0.45 + 0.9 * frame as f64 / frames as f64;
        let mut place = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        place[along] += s * size[along];
        place[1 - along] += 0.06 * size[1 - along] * (5.0 * s).sin();
        [[place[0], place[1], high[2] + 0.2 * size[2]], place]
    };
    let mut rows: Vec<Vec<(&str, f64)>> = Vec::new();
    let mut opened = 0;
    let first = Instant::now();
    for frame in 0..frames {
        let blade = Blade::stroke(&[edge(frame), edge(frame + 1)])?;
        let options = CutOptions::default();
        let mut cut = ChangeReport::default();
        if delay > 0 {
            let due = first + Duration::from_secs_f64(frame as f64 / 60.0);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        let begin = Instant::now();
        if delay > 0 {
            simulation.cut_live(&blade, &options, delay)?;
        } else {
            cut = simulation.cut(&blade, &options)?;
        }
        let mut step = simulation.step()?;
        let all = begin.elapsed();
        cut = step.opened.take().unwrap_or(cut);
        opened += usize::from(!cut.bodies.is_empty());
        let ms = |time: std::time::Duration| 1e3 * time.as_secs_f64();
        let mut row = vec![
            ("cutting", ms(cut.times.cutting)),
            ("detection", ms(cut.times.detection)),
            ("mechanics", ms(cut.times.mechanics)),
        ];
        row.extend(step.stages().map(|(name, time)| (name, ms(time))));
        row.push(("step", ms(step.times.total)));
        row.push(("frame", ms(all)));
        row.push(("columns", step.mechanics.new_columns as f64));
        row.push(("newton", step.mechanics.newton_iterations as f64));
        row.push(("solves", step.mechanics.contact_solves as f64));
        row.push(("contacts", step.mechanics.contacts as f64));
        row.push(("candidates", step.mechanics.candidates as f64));
        row.push(("changes", step.mechanics.iterations as f64));
        rows.push(row);
    }
    println!("{opened} of {frames} frames open something");
    println!("{:>12} {:>8} {:>8} {:>8}", "", "median", "99 %", "worst");
    for column in 0..rows[0].len() {
        let mut values: Vec<f64> = rows.iter().map(|row| row[column].1).collect();
        values.sort_by(f64::total_cmp);
        let at = |part: f64| values[((values.len() - 1) as f64 * part) as usize];
        println!("{:>12} {:8.2} {:8.2} {:8.2}", rows[0][column].0, at(0.5), at(0.99), at(1.0));
    }
    let sum: f64 = simulation.positions(body).as_flattened().iter().sum();
    println!("sum of positions {sum:e}");
    Ok(())
}
