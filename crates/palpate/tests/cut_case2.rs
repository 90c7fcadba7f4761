//! A hundred cuts through the organs of case 2 while they move: after every one the trees are whole, and what
//! detection finds is what the double loop finds.

use std::path::Path;
use std::sync::Arc;

use palpate::contact::{IntersectionOptions, Method, Scene, SceneOptions};
use palpate::cutting::{Blade, CutOptions};
use palpate::{CoreLoader, Simulation, SimulationOptions, load_model};

/// Cuts after each of which all lists are compared; `PALPATE_CUTS=1` for every one.
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

/// Compares with a new scene of the same meshes, searched by the double loop; how many pairs there were.
fn compare(simulation: &mut Simulation, name: &str) -> [usize; 3] {
    const EVERY: IntersectionOptions =
        IntersectionOptions { self_contact: true, same_leaf: true, shared_nodes: false };
    let count = simulation.model().bodies.len();
    let options = SceneOptions { method: Method::AllPairs, threads: 2, ..SceneOptions::default() };
    let meshes = simulation.model().bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let mut slow = Scene::new(meshes, None, options).unwrap();
    let positions: Vec<_> = (0..count).map(|body| simulation.positions(body)).collect();
    slow.update(&positions).unwrap();
    let scene = simulation.scene().unwrap();
    let met = slow.intersections(&EVERY).pairs.clone();
    assert!(scene.intersections(&EVERY).pairs == met, "{name}: pairs that meet");
    let near = |_, _| Some(0.0005);
    let close = slow.proximity(&near).pairs.clone();
    assert!(scene.proximity(&near).pairs == close, "{name}: close pairs");
    let inside = slow.penetration(&|_, _| true).nodes.clone();
    assert!(scene.penetration(&|_, _| true).nodes == inside, "{name}: nodes inside");
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
        for body in 0..5 {
            let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
            assert_eq!(valid, Ok(()), "body {body} after cut {cut}");
        }
        if cut % every == every - 1 {
            let here = compare(&mut simulation, &format!("cut {cut}"));
            found = [0, 1, 2].map(|k| found[k] + here[k]);
        }
    }
    assert!(changed > 80, "{changed}");
    assert!(found[1] > 1000, "{found:?}");
}
