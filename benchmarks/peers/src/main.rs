//! Libraries that are measured beside palpate. Reads scene and motion from a file, then obeys commands
//! on standard input, one per line, each answered by one line of JSON:
//!
//! - `pass QUERY CONTENDER`: one pass over the motion, the seconds of each frame by stage
//! - `found QUERY CONTENDER`: what is found in each frame, untimed
//!
//! A query is `intersections` (body, triangle, body, triangle) or `proximity` (kind, four stacked nodes).
//!
//! Usage: `palpate-peers SCENE DISTANCE [EMBREE_LIBRARY]`

mod embree;
mod narrow;
mod parry;
mod scene;

use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use narrow::{Close, Features, Test};
use scene::{Frame, Pair, Scene};

/// A library's bounding trees.
enum Trees {
    Parry(parry::Parry),
    Embree(embree::Embree),
}

impl Trees {
    /// Brings the trees to new positions, every box grown by a margin.
    fn update(&mut self, scene: &Scene, frame: &Frame, margin: f64) {
        match self {
            Self::Parry(parry) => parry.update(scene, frame, margin),
            Self::Embree(embree) => embree.update(scene, frame, margin),
        }
    }

    /// Visits every unordered pair of triangles whose boxes overlap, once.
    fn candidates<F: FnMut(Pair)>(&mut self, visit: F) {
        match self {
            Self::Parry(parry) => parry.candidates(visit),
            Self::Embree(embree) => embree.candidates(visit),
        }
    }
}

#[derive(Clone, Copy)]
enum Query {
    Intersections(Test),
    Proximity,
}

struct Session {
    scene: Scene,
    distance: f64,
    features: Features,
    candidates: Vec<Pair>,
    meeting: Vec<Pair>,
    close: Vec<Close>,
}

impl Session {
    fn update(&self, trees: &mut Trees, query: Query, frame: &Frame) {
        let margin = match query {
            Query::Intersections(_) => 0.0,
            // Half for each of the two boxes, and a little for rounding.
            Query::Proximity => 0.5 * self.distance * (1.0 + 1e-9),
        };
        trees.update(&self.scene, frame, margin);
    }

    fn find(&mut self, trees: &mut Trees, query: Query, frame: &Frame) {
        let Self { scene, distance, features, candidates, meeting, close } = self;
        candidates.clear();
        match query {
            Query::Intersections(test) => {
                meeting.clear();
                trees.candidates(|pair| {
                    if !scene.are_neighbours(pair) {
                        candidates.push(pair);
                    }
                });
                meeting.extend(candidates.iter().filter(|&&pair| test.meet(scene, frame, pair)));
            }
            Query::Proximity => {
                close.clear();
                trees.candidates(|pair| candidates.push(pair));
                for &pair in candidates.iter() {
                    features.close(scene, frame, pair, *distance, close);
                }
            }
        }
    }

    fn pass(&mut self, trees: &mut Trees, query: Query) -> String {
        let [mut updated, mut wall] = [Vec::new(), Vec::new()];
        for index in 0..self.scene.frames.len() {
            let frame = std::mem::take(&mut self.scene.frames[index]);
            let start = Instant::now();
            self.update(trees, query, &frame);
            updated.push(start.elapsed().as_secs_f64());
            self.find(trees, query, &frame);
            wall.push(start.elapsed().as_secs_f64());
            self.scene.frames[index] = frame;
        }
        format!("{{\"update\": {updated:?}, \"wall\": {wall:?}}}")
    }

    fn found(&mut self, trees: &mut Trees, query: Query) -> String {
        let mut frames = Vec::new();
        for index in 0..self.scene.frames.len() {
            let frame = std::mem::take(&mut self.scene.frames[index]);
            self.update(trees, query, &frame);
            self.find(trees, query, &frame);
            self.scene.frames[index] = frame;
            frames.push(match query {
                Query::Intersections(_) => format!("{:?}", self.meeting),
                Query::Proximity => format!("{:?}", self.close),
            });
        }
        format!("[{}]", frames.join(", "))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, distance, rest @ ..] = arguments.as_slice() else {
        return Err("usage: palpate-peers SCENE DISTANCE [EMBREE_LIBRARY]".into());
    };
    let scene = Scene::read(path)?;
    let mut trees = vec![("parry", Trees::Parry(parry::Parry::new(&scene)))];
    if let Some(library) = rest.first() {
        trees.push(("embree", Trees::Embree(embree::Embree::new(&scene, library)?)));
    }
    let mut session = Session {
        distance: distance.parse()?,
        features: Features::new(&scene),
        scene,
        candidates: Vec::new(),
        meeting: Vec::new(),
        close: Vec::new(),
    };
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split(' ').collect();
        let &[command, query, name] = words.as_slice() else {
            return Err("expected: pass|found QUERY CONTENDER".into());
        };
        let query = match query {
            "intersections" => Query::Intersections(Test::Exact),
            "intersections-gjk" => Query::Intersections(Test::Gjk),
            "proximity" => Query::Proximity,
            _ => return Err(format!("no query {query}").into()),
        };
        let (_, trees) = trees
            .iter_mut()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| format!("no contender {name}"))?;
        let answer = match command {
            "pass" => session.pass(trees, query),
            "found" => session.found(trees, query),
            _ => return Err(format!("no command {command}").into()),
        };
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}
