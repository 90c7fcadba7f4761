//! Cuts that are prepared beside the steps.

#[path = "support/boxes.rs"]
mod boxes;
#[path = "support/stack.rs"]
mod stack;

use std::sync::Arc;

use palpate::cutting::{Blade, CutOptions, cut_on};
use palpate::model::{Body, Law, RigidMotion};
use palpate::{ChangeReport, Mesh, MeshData, Model, Simulation, SimulationOptions};
use palpate_testing::{Fastest, box_of_cells};
use stack::{bits, blade, model, run, soft_box, start};

fn cut_live(simulation: &mut Simulation, blade: &Blade, delay: u32) {
    simulation.cut_live(blade, &CutOptions::default(), delay).unwrap();
}

/// Steps; what opened in each of them.
fn opened(simulation: &mut Simulation, steps: usize) -> Vec<Option<ChangeReport>> {
    (0..steps).map(|_| simulation.step().unwrap().opened).collect()
}

/// A box that nothing touches or pulls.
fn flying(law: Law, velocity: [f64; 3]) -> Simulation {
    let mut body = Body::new("box", soft_box([4, 3, 3], 0.02, [0.0; 3]));
    body.material.law = law;
    body.initial_velocity = velocity;
    let mut model = Model::from_bodies(vec![body]);
    model.gravity = [0.0; 3];
    Simulation::new(model, SimulationOptions::default()).unwrap()
}

#[test]
fn where_nothing_moves_it_is_the_cut_that_is_made_when_it_opens() {
    for law in [Law::Linear, Law::NeoHookean] {
        let mut live = flying(law, [0.0; 3]);
        let mut at_once = flying(law, [0.0; 3]);
        let stroke = blade(0.041, 0.03);
        cut_live(&mut live, &stroke, 3);
        let reports = opened(&mut live, 4);
        assert_eq!(
            reports.iter().map(Option::is_some).collect::<Vec<_>>(),
            [false, false, false, true]
        );
        assert!(!live.has_live_cuts());
        run(&mut at_once, 3);
        let cut = at_once.cut(&stroke, &CutOptions::default()).unwrap();
        run(&mut at_once, 1);
        let report = reports[3].as_ref().unwrap();
        assert_eq!(report.bodies.len(), 1);
        assert_eq!(report.bodies[0].change, cut.bodies[0].change);
        assert_eq!(report.bodies[0].report, cut.bodies[0].report);
        for simulation in [&mut live, &mut at_once] {
            let force = vec![[0.02, 0.0, 0.01]; simulation.positions(0).len()];
            simulation.set_forces(0, &force).unwrap();
        }
        assert_eq!(run(&mut live, 10), run(&mut at_once, 10), "{law:?}");
    }
}

#[test]
fn what_moves_is_cut_where_it_was_when_the_stroke_came() {
    for law in [Law::Linear, Law::NeoHookean] {
        let velocity = [0.4, -0.2, 0.1];
        let mut simulation = flying(law, velocity);
        run(&mut simulation, 3);
        let stroke = blade(0.061, 0.03);
        let mesh = Arc::clone(&simulation.model().bodies[0].mesh);
        let min_edge = Some(CutOptions::EDGE * mesh.mean_surface_edge());
        let options = CutOptions { min_edge, ..CutOptions::default() };
        let expected = cut_on(&mesh, simulation.positions(0), &stroke, &[], &options);
        let expected = expected.unwrap().unwrap().change;
        cut_live(&mut simulation, &stroke, 2);
        run(&mut simulation, 2);
        let before = simulation.positions(0).to_vec();
        let momentum = simulation.dynamics().momentum();
        let report = simulation.step().unwrap().opened.expect("it opens now");
        assert_eq!(report.bodies[0].change, expected);
        for (old, new) in expected.positions(&before).iter().zip(simulation.positions(0)) {
            for k in 0..3 {
                assert!((new[k] - old[k] - velocity[k] / 60.0).abs() < 1e-9, "{law:?}");
            }
        }
        let after = simulation.dynamics().momentum();
        for (after, before) in after.linear.iter().zip(momentum.linear) {
            assert!((after - before).abs() < 1e-12 * before.abs(), "{law:?}: {after} {before}");
        }
    }
}

#[test]
fn strokes_that_come_meanwhile_open_together_as_if_made_one_after_the_other() {
    let law = Law::NeoHookean;
    let (mut live, mut at_once) = (flying(law, [0.0; 3]), flying(law, [0.0; 3]));
    let strokes = [blade(0.021, 0.03), blade(0.041, 0.05), blade(0.059, 0.02)];
    let mut reports = Vec::new();
    for stroke in &strokes {
        cut_live(&mut live, stroke, 2);
        reports.extend(opened(&mut live, 1));
    }
    reports.extend(opened(&mut live, 2));
    let reports: Vec<bool> = reports.iter().map(Option::is_some).collect();
    assert_eq!(reports, [false, false, true, false, true]);
    for stroke in &strokes {
        at_once.cut(stroke, &CutOptions::default()).unwrap();
    }
    assert_eq!(live.model().bodies[0].mesh, at_once.model().bodies[0].mesh);
}

/// Steps with live strokes that follow each other closely, and what `between` does before each step.
fn stroked(threads: usize, between: impl Fn(Simulation, usize) -> Simulation) -> Vec<u64> {
    let options = SimulationOptions { threads, ..SimulationOptions::default() };
    let mut simulation = Simulation::new(model(Law::NeoHookean), options).unwrap();
    run(&mut simulation, 10);
    let edge = |y: f64| [[0.041, y, -0.1], [0.045, y, 0.3]];
    for step in 0..9 {
        if step < 6 {
            let y = -0.01 + 0.008 * step as f64;
            let stroke = Blade::stroke(&[edge(y), edge(y + 0.008)]).unwrap();
            cut_live(&mut simulation, &stroke, 2);
        }
        simulation = between(simulation, step);
        simulation.step().unwrap();
    }
    assert!(!simulation.has_live_cuts());
    assert!(simulation.model().bodies[0].mesh.nodes().len() > 5 * 4 * 3);
    run(&mut simulation, 10)
}

#[test]
fn what_is_on_its_way_has_the_same_bits_at_any_number_of_threads_and_after_coming_back() {
    let expected = stroked(1, |simulation, _| simulation);
    for threads in [2, 3] {
        assert_eq!(stroked(threads, |simulation, _| simulation), expected, "{threads} threads");
    }
    for at in 0..9 {
        let restored = stroked(1, |mut simulation, step| {
            if step == at {
                let snapshot = simulation.snapshot();
                run(&mut simulation, 5);
                simulation.restore(&snapshot).unwrap();
            }
            simulation
        });
        assert_eq!(restored, expected, "restored at {at}");
        let folder = tempfile::tempdir().unwrap();
        let loaded = stroked(1, |simulation, step| {
            if step != at {
                return simulation;
            }
            let path = folder.path().join("cut.palpate");
            simulation.save(&path).unwrap();
            Simulation::load(&path, 2).unwrap()
        });
        assert_eq!(loaded, expected, "loaded at {at}");
    }
    let forked = stroked(2, |mut simulation, _| {
        simulation.restart_threads().unwrap();
        simulation
    });
    assert_eq!(forked, expected, "without the threads that had begun");
}

#[test]
fn a_reset_gives_up_what_is_on_its_way() {
    let mut simulation = start(Law::Linear);
    cut_live(&mut simulation, &blade(0.041, 0.03), 2);
    run(&mut simulation, 1);
    cut_live(&mut simulation, &blade(0.021, 0.03), 2);
    simulation.reset().unwrap();
    assert!(!simulation.has_live_cuts());
    assert!(opened(&mut simulation, 6).iter().all(Option::is_none));
}

/// A change of the bodies between the start of a live cut and its opening.
fn with_change(change: impl Fn(&mut Simulation)) -> (Simulation, ChangeReport) {
    let mut simulation = start(Law::NeoHookean);
    cut_live(&mut simulation, &blade(0.041, 0.03), 3);
    run(&mut simulation, 1);
    cut_live(&mut simulation, &blade(0.021, 0.03), 1);
    change(&mut simulation);
    let mut reports = opened(&mut simulation, 4);
    assert!(reports[0].is_none() && reports[1].is_none() && reports[3].is_some());
    let first = reports.swap_remove(2).expect("after three steps");
    for body in 0..simulation.model().bodies.len() {
        let scene = simulation.scene().unwrap();
        assert_eq!(scene.tree(body).validate(scene.mesh(body), scene.positions(body)), Ok(()));
    }
    run(&mut simulation, 30);
    (simulation, first)
}

#[test]
fn after_another_change_it_begins_anew_and_opens_when_it_would_have() {
    let (_, plain) = with_change(|_| ());
    assert_eq!(plain.bodies.iter().map(|change| change.body).collect::<Vec<_>>(), [0, 1]);

    let (simulation, report) = with_change(|simulation| {
        simulation.remove(1, &[0, 1, 2]).unwrap();
    });
    assert_eq!(report.bodies.len(), 2);
    assert!(
        simulation.model().bodies[1].mesh.volume()
            < 0.99 * model(Law::NeoHookean).bodies[1].mesh.volume()
    );

    let (simulation, report) = with_change(|simulation| {
        simulation.cut(&blade(0.057, 1.0), &CutOptions::default()).unwrap();
    });
    assert_eq!(report.bodies.len(), 2);
    let volume = simulation.model().bodies[0].mesh.volume();
    let whole = model(Law::NeoHookean).bodies[0].mesh.volume();
    assert!((volume - whole).abs() < 1e-12 * whole);

    let (simulation, report) = with_change(|simulation| {
        simulation.cut(&blade(0.057, 1.0), &CutOptions::default()).unwrap();
        assert_eq!(simulation.separate().unwrap().len(), 5);
    });
    assert_eq!(simulation.model().bodies.len(), 5);
    assert!(report.bodies.len() >= 2);

    let (simulation, _) = with_change(|simulation| {
        let lowest: Vec<u32> = simulation.model().bodies[0].mesh.node_sets()["low"].clone();
        simulation.drive(0, &lowest).unwrap();
    });
    assert_eq!(simulation.drives().len(), 1);
    assert!(simulation.drives()[0].nodes.len() > 12, "copies of driven nodes are driven");
}

#[test]
fn what_cannot_be_is_refused() {
    let mut simulation = start(Law::Linear);
    let before = bits(&simulation);
    let options = CutOptions { snap: 0.7, ..CutOptions::default() };
    let error = simulation.cut_live(&blade(0.041, 0.03), &options, 2).unwrap_err().to_string();
    assert!(error.contains("snap is 0.7"), "{error}");
    assert!(!simulation.has_live_cuts());
    assert_eq!(bits(&simulation), before);
}

/// New matrices of a bar that is thrown onto a post while `stroke` gives strokes of a step.
fn matrices_of_a_thrown_bar(stroke: impl Fn(usize) -> Option<(Blade, u32)>) -> usize {
    let place = |[x, y, z]: [f64; 3]| [0.033 * x - 0.1, 0.01 * y, 0.01 * z + 0.025];
    let (nodes, tetrahedra) = box_of_cells([6, 2, 2], Fastest::First, place);
    let data = MeshData { nodes, tetrahedra, ..MeshData::default() };
    let mut bar = Body::new("bar", Arc::new(Mesh::new(data).unwrap()));
    bar.material.law = Law::NeoHookean;
    (bar.material.young, bar.material.poisson) = (1e5, 0.45);
    bar.initial_velocity = [0.0, 0.0, -1.0];
    let mut post = Body::new("post", soft_box([2, 2, 1], 0.02, [-0.02, -0.01, 0.0]));
    post.rigid = Some(RigidMotion::default());
    let model = Model::from_bodies(vec![post, bar]);
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    let mut made = 0;
    for step in 0..40 {
        if let Some((blade, delay)) = stroke(step) {
            cut_live(&mut simulation, &blade, delay);
        }
        made += simulation.step().unwrap().mechanics.refactored;
    }
    made
}

#[test]
fn a_body_that_may_be_cut_soon_makes_no_matrix_unless_strokes_pass_it_by() {
    // Round the bar at a distance: it may be cut until they open nothing.
    let edge = |x: f64, y: f64| [[x, y, -1.0], [x, y, 1.0]];
    let by = Blade::stroke(&[edge(-1.0, -0.2), edge(1.0, -0.2), edge(1.0, 0.5)]).unwrap();
    let own = matrices_of_a_thrown_bar(|_| None);
    let once = matrices_of_a_thrown_bar(|step| (step % 8 == 0).then(|| (by.clone(), 8)));
    let often = matrices_of_a_thrown_bar(|_| Some((by.clone(), 2)));
    let late = matrices_of_a_thrown_bar(|step| (step == 0).then(|| (by.clone(), 60)));
    assert!(own > once, "it waits: {own} {once}");
    assert!(0 < often && often <= own, "every other step it does not: {own} {often}");
    assert_eq!(late, own, "it does not wait for what is far away");
}
