//! Libraries that are measured beside palpate. Reads scene and motion from a file, then obeys commands
//! on standard input, one per line, each answered by one line of JSON:
//!
//! - `pass CONTENDER`: one pass over the motion, the seconds of each frame by stage
//! - `pairs CONTENDER`: the triangle pairs found in each frame, untimed
//!
//! Usage: `palpate-peers SCENE [EMBREE_LIBRARY]`

mod embree;
mod parry;
mod scene;

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::io::{BufRead, Write};
use std::time::Instant;

use scene::{Frame, Pair, Scene};

/// A library with a way to use it.
trait Contender {
    /// Brings the structure to new positions.
    fn update(&mut self, scene: &Scene, frame: &Frame);
    /// Appends the triangle pairs that meet and share no node; in any order.
    fn intersections(&mut self, scene: &Scene, frame: &Frame, found: &mut Vec<Pair>);
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or("usage: palpate-peers SCENE [EMBREE_LIBRARY]")?;
    let scene = Scene::read(path)?;
    let mut contenders: BTreeMap<&str, Box<dyn Contender>> = BTreeMap::new();
    contenders.insert("parry", Box::new(parry::Parry::new(&scene, parry::Test::Exact)));
    contenders.insert("parry-gjk", Box::new(parry::Parry::new(&scene, parry::Test::Gjk)));
    if let Some(library) = arguments.get(1) {
        for (name, update) in
            [("embree-refit", embree::Update::Refit), ("embree-rebuild", embree::Update::Rebuild)]
        {
            contenders.insert(name, Box::new(embree::Embree::new(&scene, library, update)?));
        }
    }
    let mut out = std::io::stdout().lock();
    let mut found = Vec::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (command, name) = line.split_once(' ').ok_or("expected: pass|pairs CONTENDER")?;
        let contender = contenders.get_mut(name).ok_or_else(|| format!("no contender {name}"))?;
        let answer = match command {
            "pass" => pass(contender.as_mut(), &scene, &mut found),
            "pairs" => pairs(contender.as_mut(), &scene, &mut found),
            _ => return Err(format!("no command {command}").into()),
        };
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

fn pass(contender: &mut dyn Contender, scene: &Scene, found: &mut Vec<Pair>) -> String {
    let [mut update, mut wall] = [Vec::new(), Vec::new()];
    for frame in &scene.frames {
        found.clear();
        let start = Instant::now();
        contender.update(scene, frame);
        update.push(start.elapsed().as_secs_f64());
        contender.intersections(scene, frame, found);
        wall.push(start.elapsed().as_secs_f64());
    }
    format!("{{\"update\": {update:?}, \"wall\": {wall:?}}}")
}

fn pairs(contender: &mut dyn Contender, scene: &Scene, found: &mut Vec<Pair>) -> String {
    let mut answer = String::from("[");
    for (index, frame) in scene.frames.iter().enumerate() {
        found.clear();
        contender.update(scene, frame);
        contender.intersections(scene, frame, found);
        let separator = if index == 0 { "" } else { ", " };
        write!(answer, "{separator}{found:?}").expect("a String takes everything");
    }
    answer.push(']');
    answer
}
