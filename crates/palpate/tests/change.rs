//! Cuts, removal and separation while a simulation runs.

#[path = "support/boxes.rs"]
mod boxes;
#[path = "support/stack.rs"]
mod stack;

use std::sync::Arc;

use palpate::cutting::{Blade, CutOptions};
use palpate::model::{Law, write_model};
use palpate::{Model, ReadOptions, Simulation, SimulationError, SimulationOptions, load_model};
use stack::{bits, blade, model, run, start};

fn cut(simulation: &mut Simulation, blade: &Blade) -> usize {
    simulation.cut(blade, &CutOptions::default()).unwrap().bodies.len()
}

#[test]
fn a_cut_in_contact_goes_on_quietly_and_its_lips_open() {
    for law in [Law::Linear, Law::NeoHookean] {
        let mut simulation = start(law);
        let volume: f64 = simulation.model().bodies[..2].iter().map(|b| b.mesh.volume()).sum();
        let before: Vec<_> = (0..2).map(|body| simulation.positions(body).to_vec()).collect();
        assert_eq!(cut(&mut simulation, &blade(0.041, 0.03)), 2);
        let after: f64 = simulation.model().bodies[..2].iter().map(|b| b.mesh.volume()).sum();
        assert!((after - volume).abs() < 1e-12 * volume);
        let body = &simulation.model().bodies[0];
        assert_eq!(body.mesh.regions().len(), body.mesh.tetrahedra().len());
        assert!(body.mesh.node_sets()["low"].len() > 12);
        // Old nodes keep their numbers and have not moved; in a step they move by millimetres at most.
        for _ in 0..3 {
            simulation.step().unwrap();
        }
        for (body, before) in before.iter().enumerate() {
            for (old, new) in before.iter().zip(simulation.positions(body)) {
                let moved = (0..3).map(|k| (new[k] - old[k]).powi(2)).sum::<f64>().sqrt();
                assert!(moved < 0.004, "{law:?}: {moved} m");
            }
        }
        let scene = simulation.scene().unwrap();
        for body in 0..3 {
            assert_eq!(scene.tree(body).validate(scene.mesh(body), scene.positions(body)), Ok(()));
        }
        run(&mut simulation, 100);
        assert!(simulation.velocities(0).as_flattened().iter().all(|v| v.abs() < 0.5));
    }
}

#[test]
fn snapshots_and_checkpoints_hold_the_cuts() {
    let folder = tempfile::tempdir().unwrap();
    for law in [Law::Linear, Law::NeoHookean] {
        let mut simulation = start(law);
        let whole = simulation.snapshot();
        assert_eq!(cut(&mut simulation, &blade(0.03, 0.025)), 2);
        run(&mut simulation, 4);
        simulation.remove(1, &[5, 6]).unwrap();
        run(&mut simulation, 2);
        let snapshot = simulation.snapshot();
        let path = folder.path().join("cut.palpate");
        simulation.save(&path).unwrap();
        let expected = run(&mut simulation, 12);

        let mut loaded = Simulation::load(&path, 2).unwrap();
        assert_eq!(run(&mut loaded, 12), expected, "{law:?}: from the file");
        simulation.restore(&snapshot).unwrap();
        assert_eq!(run(&mut simulation, 12), expected, "{law:?}: from the snapshot");

        // Back before the cut, and cut again: the same.
        simulation.restore(&whole).unwrap();
        let nodes = simulation.positions(0).len();
        assert_eq!(nodes, model(law).bodies[0].mesh.nodes().len());
        assert_eq!(cut(&mut simulation, &blade(0.03, 0.025)), 2);
        run(&mut simulation, 4);
        simulation.remove(1, &[5, 6]).unwrap();
        run(&mut simulation, 2);
        assert_eq!(run(&mut simulation, 12), expected, "{law:?}: once more");

        loaded.reset().unwrap();
        let fresh = Simulation::new(model(law), SimulationOptions::default()).unwrap();
        assert_eq!(bits(&loaded), bits(&fresh));
        assert_eq!(run(&mut loaded, 25), {
            let mut fresh = fresh;
            run(&mut fresh, 25)
        });
    }
}

/// A checkpoint makes every matrix from nothing, a cut takes over what it leaves of one.
#[test]
fn matrices_after_cuts_have_the_bits_of_those_made_from_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.palpate");
    let mut bent = 0;
    for (law, poisson) in [
        (Law::Linear, 0.4),
        (Law::Corotated, 0.4),
        (Law::NeoHookean, 0.45),
        (Law::NeoHookean, 0.49),
        (Law::HolzapfelGasserOgden, 0.4),
    ] {
        let mut model = model(law);
        for body in &mut model.bodies[..2] {
            for material in std::iter::once(&mut body.material)
                .chain(body.regions.iter_mut().map(|(_, material)| material))
            {
                (material.young, material.poisson) = (4e3, poisson);
                (material.k1, material.k2) = (5e3, 2.0);
                material.fibres[0] = Some([0.6, 0.0, 0.8]);
            }
        }
        let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
        run(&mut simulation, 40);
        for step in 0..6 {
            cut_slowly(&mut simulation, 2 * step..2 * step + 2);
            bent += usize::from(!simulation.snapshot().state().bodies[0].stiff_shape.is_empty());
            simulation.save(&path).unwrap();
            let mut loaded = Simulation::load(&path, 2).unwrap();
            let expected = run(&mut simulation, 3);
            assert_eq!(run(&mut loaded, 3), expected, "{law:?} {poisson}, step {step}");
        }
    }
    assert!(bent >= 6, "some matrices are of other shapes than that at rest: {bent}");
}

#[test]
fn pieces_become_bodies_of_their_own() {
    let mut simulation = start(Law::NeoHookean);
    let pull = simulation.pull(0, 0, [0.0, 0.0, 0.0], 5.0).unwrap();
    assert!(simulation.separate().unwrap().is_empty());
    cut(&mut simulation, &blade(0.021, 0.5));
    let mass = |simulation: &Simulation| -> f64 {
        let bodies = 0..simulation.model().bodies.len();
        let masses = bodies.filter_map(|body| simulation.dynamics().masses(body));
        masses.flatten().sum()
    };
    let before = (mass(&simulation), simulation.dynamics().momentum());
    let parts = simulation.separate().unwrap();
    let names: Vec<_> = simulation.model().bodies.iter().map(|body| &*body.name).collect();
    assert_eq!(names[..4], ["lower", "upper", "plate", "lower/2"]);
    assert_eq!(parts.len(), names.len());
    assert_eq!(parts[3].0, 0);
    assert!(parts[0].1.tetrahedra.len() > parts[3].1.tetrahedra.len());
    for (body, (old, _)) in simulation.model().bodies.iter().zip(&parts) {
        assert_eq!(body.processor, model(Law::NeoHookean).bodies[*old].processor);
        assert_eq!(body.mesh.pieces().len().max(1), 1);
    }
    assert!((mass(&simulation) - before.0).abs() < 1e-12 * before.0);
    let momentum = simulation.dynamics().momentum().linear;
    let lost = momentum.iter().zip(before.1.linear).map(|(now, was)| (now - was).abs());
    assert!(lost.fold(0.0, f64::max) < 1e-12);
    // Node 0 is in the small piece.
    assert_eq!((simulation.pulls()[0].id, simulation.pulls()[0].body), (pull, 3));
    let snapshot = simulation.snapshot();
    let expected = run(&mut simulation, 20);
    simulation.restore(&snapshot).unwrap();
    assert_eq!(run(&mut simulation, 20), expected);
    simulation.reset().unwrap();
    assert_eq!(simulation.model().bodies.len(), 3);
}

/// Steps of 2 mm through boxes of 2 cm cells, a time step after each; from the first to before the last.
fn cut_slowly(simulation: &mut Simulation, steps: std::ops::Range<i32>) {
    let edge = |step: i32| {
        let y = -0.005 + 0.002 * f64::from(step);
        [[0.031, y, -0.1], [0.034, y, 0.3]]
    };
    for step in steps {
        let blade = Blade::stroke(&[edge(step), edge(step + 1)]).unwrap();
        simulation.cut(&blade, &CutOptions::default()).unwrap();
        simulation.step().unwrap();
    }
}

#[test]
fn a_scalpel_in_steps_shorter_than_an_edge_leaves_no_bridges() {
    let folder = tempfile::tempdir().unwrap();
    // Without weight, or what is cut off sinks away from the blade.
    let mut model = model(Law::NeoHookean);
    model.gravity = [0.0; 3];
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    run(&mut simulation, 3);
    let whole = simulation.snapshot();
    cut_slowly(&mut simulation, 0..17);
    let half = simulation.snapshot();
    let path = folder.path().join("half.palpate");
    simulation.save(&path).unwrap();
    cut_slowly(&mut simulation, 17..40);
    let pieces =
        |simulation: &Simulation| [0, 1].map(|b| simulation.model().bodies[b].mesh.pieces().len());
    assert_eq!(pieces(&simulation), [2, 2]);
    let expected = bits(&simulation);

    // The faces that wait are part of snapshots and checkpoints.
    let mut loaded = Simulation::load(&path, 1).unwrap();
    cut_slowly(&mut loaded, 17..40);
    assert_eq!(bits(&loaded), expected, "from the file");
    simulation.restore(&half).unwrap();
    cut_slowly(&mut simulation, 17..40);
    assert_eq!(bits(&simulation), expected, "from the snapshot");
    simulation.restore(&whole).unwrap();
    cut_slowly(&mut simulation, 0..40);
    assert_eq!(bits(&simulation), expected, "from the start");
}

#[test]
fn bodies_that_a_separation_or_an_undo_does_not_change_go_on_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.palpate");
    let mut simulation = start(Law::NeoHookean);
    let whole = simulation.snapshot();
    // Only the lower box comes apart, and the upper one has an order of its own.
    simulation.remove(1, &[3]).unwrap();
    let edge = |y: f64| [[0.041, y, -0.1], [0.041, y, 0.044]];
    cut(&mut simulation, &Blade::stroke(&[edge(-0.1), edge(0.2)]).unwrap());
    run(&mut simulation, 3);
    let before = simulation.snapshot();
    assert_eq!(simulation.separate().unwrap().len(), 4);
    for (step, body) in [(0, 1), (5, 2)] {
        assert!(Arc::ptr_eq(
            &simulation.model().bodies[body].mesh,
            &before.model().bodies[body].mesh
        ));
        run(&mut simulation, step);
        // One that is made of nothing but the file is the slow twin.
        simulation.save(&path).unwrap();
        let mut fresh = Simulation::load(&path, 1).unwrap();
        assert_eq!(simulation.snapshot().state(), fresh.snapshot().state());
        let snapshot = simulation.snapshot();
        let expected = run(&mut fresh, 10);
        assert_eq!(run(&mut simulation, 10), expected);
        simulation.restore(&snapshot).unwrap();
    }
    for back in [&before, &whole] {
        simulation.restore(back).unwrap();
        simulation.save(&path).unwrap();
        let mut fresh = Simulation::load(&path, 1).unwrap();
        assert_eq!(run(&mut simulation, 10), run(&mut fresh, 10));
    }
    let scene = simulation.scene().unwrap();
    for body in 0..3 {
        assert_eq!(scene.tree(body).validate(scene.mesh(body), scene.positions(body)), Ok(()));
    }
}

#[test]
fn the_model_after_cuts_is_written_and_loaded_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = model(Law::NeoHookean);
    first.bodies[0].fixed_nodes = vec![0, 3, 6];
    let mut simulation = Simulation::new(first, SimulationOptions::default()).unwrap();
    run(&mut simulation, 3);
    cut(&mut simulation, &blade(0.021, 0.5));
    simulation.separate().unwrap();
    let path = folder.path().join("after.bml");
    let files = write_model(&path, simulation.model()).unwrap();
    assert_eq!(files.len(), simulation.model().bodies.len() + 1);
    let loaded = load_model(&path, &ReadOptions::default()).unwrap();
    assert_eq!(loaded.bodies.len(), simulation.model().bodies.len());
    for old in &simulation.model().bodies {
        // In the order of the structure.
        let new = loaded.bodies.iter().find(|new| new.name == old.name).expect("every name");
        assert_eq!(old.fixed_nodes, new.fixed_nodes);
        assert_eq!(old.mesh.nodes(), new.mesh.nodes());
        assert_eq!(old.mesh.tetrahedra(), new.mesh.tetrahedra());
        assert_eq!(old.mesh.regions(), new.mesh.regions());
        assert_eq!((old.material, &old.regions), (new.material, &new.regions));
        assert_eq!((old.contact, old.processor), (new.contact, new.processor));
        assert_eq!(old.rigid.is_some(), new.rigid.is_some());
    }
    let mut again = Simulation::new(loaded, SimulationOptions::default()).unwrap();
    run(&mut again, 5);
}

#[test]
fn what_cannot_be_done_is_refused_and_changes_nothing() {
    let mut simulation = start(Law::Linear);
    let before = simulation.snapshot();
    assert_eq!(cut(&mut simulation, &blade(5.0, 0.5)), 0);
    let error = |simulation: &mut Simulation, body, tetrahedra: &[u32]| {
        simulation.remove(body, tetrahedra).unwrap_err().to_string()
    };
    let message = error(&mut simulation, 0, &[100_000]);
    assert!(message.contains("tetrahedron 100000 cannot be removed"), "{message}");
    let message = error(&mut simulation, 2, &[0]);
    assert!(message.contains("body 2 is rigid"), "{message}");
    let message = error(&mut simulation, 7, &[0]);
    assert!(message.contains("body 7 does not exist"), "{message}");
    let all: Vec<u32> = (0..simulation.model().bodies[1].mesh.tetrahedra().len() as u32).collect();
    let message = error(&mut simulation, 1, &all);
    assert!(message.contains("would leave nothing"), "{message}");
    assert_eq!(simulation.snapshot().state(), before.state());
    assert!(Arc::ptr_eq(simulation.snapshot().model(), before.model()));
    let other = Model::from_bodies(vec![model(Law::Linear).bodies.remove(1)]);
    let mut other = Simulation::new(other, SimulationOptions::default()).unwrap();
    assert!(matches!(other.restore(&before), Err(SimulationError::OtherModel)));
}
