//! A hundred cuts through the organs of case 2 while they move: after every one the trees are whole, and what
//! detection finds is what the double loop finds.

use std::path::Path;
use std::sync::Arc;

use palpate::contact::{IntersectionOptions, Method, Scene, SceneOptions};
use palpate::cutting::{Blade, CutOptions};
use palpate::{CoreLoader, Simulation, SimulationOptions, load_model};

/// [m]
const CLOSE: f64 = 0.0005;

/// Cuts after each of which the lists of two bodies are compared; `PALPATE_CUTS=1` for every one.
fn compared_every() -> usize {
    std::env::var("PALPATE_CUTS").map_or(25, |text| text.parse().expect("a number"))
}

struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| size * (2.0 * self.below(1 << 20) as f64 / f64::from(1 << 20) - 1.0))
    }
}

/// A square of some centimetres, or a stroke that goes on from one place to the next.
fn blade(at: [f64; 3], random: &mut Random) -> Blade {
    let down = random.vector(0.03);
    if random.below(2) == 0 {
        return Blade::plane(at, down, Some(0.02 + 0.01 * random.below(4) as f64)).unwrap();
    }
    let along = random.vector(0.008);
    let edge = |step: f64| {
        let heel = [0, 1, 2].map(|k| at[k] + step * along[k] - down[k]);
        [heel, [0, 1, 2].map(|k| heel[k] + 2.0 * down[k])]
    };
    Blade::stroke(&[edge(-1.0), edge(0.0), edge(1.0)]).unwrap()
}

/// Compares two of the bodies with a new scene of them, searched by the double loop; how many pairs met,
/// were close, and how many nodes were inside.
fn compare(simulation: &mut Simulation, bodies: [usize; 2], name: &str) -> [usize; 3] {
    const EVERY: IntersectionOptions =
        IntersectionOptions { self_contact: true, same_leaf: true, shared_nodes: false };
    let options = SceneOptions { method: Method::AllPairs, threads: 2, ..SceneOptions::default() };
    let meshes = bodies.map(|body| Arc::clone(&simulation.model().bodies[body].mesh)).to_vec();
    let mut slow = Scene::new(meshes, None, options).unwrap();
    slow.update(&bodies.map(|body| simulation.positions(body))).unwrap();
    let place = |body: u32| bodies.iter().position(|&each| each == body as usize);
    let both = |a: usize, b: usize| bodies.contains(&a) && bodies.contains(&b);
    let scene = simulation.scene().unwrap();

    let mut met = scene.intersections(&EVERY).pairs.clone();
    met.retain_mut(|pair| {
        let places = [place(pair.body_a), place(pair.body_b)];
        if let [Some(a), Some(b)] = places {
            (pair.body_a, pair.body_b) = (a as u32, b as u32);
        }
        !places.contains(&None)
    });
    assert!(slow.intersections(&EVERY).pairs == met, "{name}: pairs that meet");
    let mut close = scene.proximity(&|a, b| both(a, b).then_some(CLOSE)).pairs.clone();
    for pair in &mut close {
        for body in &mut pair.bodies {
            *body = place(*body).expect("one of the two") as u32;
        }
    }
    assert!(slow.proximity(&|_, _| Some(CLOSE)).pairs == close, "{name}: close pairs");
    let mut inside = scene.penetration(&|a, b| a != b && both(a, b)).nodes.clone();
    for node in &mut inside {
        for body in [&mut node.body, &mut node.into_body] {
            *body = place(*body).expect("one of the two") as u32;
        }
    }
    assert!(slow.penetration(&|a, b| a != b).nodes == inside, "{name}: nodes inside");
    [met.len(), close.len(), inside.len()]
}

#[test]
fn after_a_hundred_cuts_of_case_2_the_pairs_are_those_of_the_double_loop() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/case2.bml");
    let model = load_model(&path, &CoreLoader).unwrap();
    let options = SimulationOptions { threads: 2, ..SimulationOptions::default() };
    let mut simulation = Simulation::new(model, options).unwrap();
    for _ in 0..90 {
        simulation.step().unwrap();
    }
    let soft: Vec<usize> =
        (0..5).filter(|&body| simulation.model().bodies[body].rigid.is_none()).collect();
    let (mut random, mut changed, mut found) = (Random(4), 0, [0; 3]);
    let every = compared_every();
    for cut in 0..100 {
        let body = soft[random.below(soft.len())];
        let at = simulation.positions(body)[random.below(simulation.positions(body).len())];
        let blade = blade(at, &mut random);
        changed += simulation.cut(&blade, &CutOptions::default()).unwrap().bodies.len();
        if cut % 5 == 4 {
            simulation.step().unwrap();
        }
        let scene = simulation.scene().unwrap();
        for &body in &soft {
            let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
            assert_eq!(valid, Ok(()), "body {body} after cut {cut}");
        }
        if cut % every == every - 1 {
            let others: Vec<usize> = soft.iter().copied().filter(|&each| each != body).collect();
            let other = others[random.below(others.len())];
            let both = [body.min(other), body.max(other)];
            let here = compare(&mut simulation, both, &format!("cut {cut}"));
            found = [0, 1, 2].map(|k| found[k] + here[k]);
        }
    }
    assert!(changed > 80, "{changed}");
    assert!(found[1] > 100, "{found:?}");
}
