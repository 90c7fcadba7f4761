//! What is refused, and how it is named.

use palpate_mechanics::{Cause, ContactForce, Drive, Dynamics, DynamicsOptions, MechanicsError};
use palpate_model::Body;

use crate::world::{GRAVITY, World, box_mesh, floor, model, soft};

fn refuse(body: Body) -> MechanicsError {
    match Dynamics::new(&model(vec![body], 9.81), DynamicsOptions::default()) {
        Err(error) => error,
        Ok(_) => panic!("accepted"),
    }
}

#[test]
fn bodies_that_cannot_be_simulated_are_named() {
    let sheet = Body::new("sheet", floor(1.0, 0.0, |x| x));
    let error = refuse(sheet);
    assert!(matches!(error, MechanicsError::NoTetrahedra { body: 0, .. }));
    assert!(error.to_string().contains("'sheet'"), "{error}");

    let mesh = box_mesh([1, 1, 1], [0.1; 3], |x| x);
    for change in [
        |body: &mut Body| body.material.young = -1.0,
        |body: &mut Body| body.material.poisson = 0.5,
        |body: &mut Body| body.material.density = f64::NAN,
        |body: &mut Body| body.material.damping = -0.1,
        |body: &mut Body| body.contact.friction = f64::INFINITY,
        |body: &mut Body| body.contact.distance = Some(0.0),
        |body: &mut Body| body.contact.stiffness = Some(f64::NAN),
        |body: &mut Body| body.initial_velocity[1] = f64::NAN,
    ] {
        let mut body = soft("organ", &mesh, 5e3, 0.01);
        change(&mut body);
        let error = refuse(body);
        assert!(matches!(error, MechanicsError::BadParameter { body: 0, .. }), "{error}");
        assert!(error.to_string().contains("organ"), "{error}");
    }
}

#[test]
fn fixed_nodes_exist_and_ascend() {
    let body = |fixed_nodes: &[u32]| Body {
        fixed_nodes: fixed_nodes.to_vec(),
        ..soft("cube", &box_mesh([1, 1, 1], [1.0; 3], |x| x), 1e4, 0.0)
    };
    let state = Dynamics::new(&model(vec![body(&[])], GRAVITY), DynamicsOptions::default());
    let state = state.unwrap().state();
    for (fixed, expected) in [
        (&[1, 8][..], MechanicsError::NoSuchNode { body: 0, node: 8, nodes: 8 }),
        (&[3, 2], MechanicsError::FixedOrder { body: 0, node: 2, before: 3 }),
        (&[0, 5, 5], MechanicsError::FixedOrder { body: 0, node: 5, before: 5 }),
        (&[7; 20], MechanicsError::FixedOrder { body: 0, node: 7, before: 7 }),
    ] {
        let model = model(vec![body(fixed)], GRAVITY);
        let error = |result: Result<Dynamics, MechanicsError>| result.err().expect("refused");
        let options = DynamicsOptions::default();
        assert_eq!(error(Dynamics::new(&model, options)), expected);
        assert_eq!(error(Dynamics::with_state(&model, options, &state)), expected);
    }
}

#[test]
fn bad_options_and_arrays_are_refused_and_change_nothing() {
    let mesh = box_mesh([1, 1, 1], [0.1; 3], |x| x);
    let model = model(vec![soft("organ", &mesh, 5e3, 0.01)], 9.81);
    let options = DynamicsOptions { time_step: 0.0, threads: 1 };
    assert!(matches!(Dynamics::new(&model, options), Err(MechanicsError::TimeStep(_))));

    let mut world = World::new(&model, 1.0 / 60.0, 1);
    let before = world.dynamics.state();
    let wrong = vec![[0.0; 3]; 7];
    let expected = MechanicsError::WrongCount { body: 0, expected: 8, found: 7 };
    assert_eq!(world.dynamics.set_positions(0, &wrong), Err(expected));
    let mut broken = vec![[0.0; 3]; 8];
    broken[5][2] = f64::NAN;
    for result in [
        world.dynamics.set_positions(0, &broken),
        world.dynamics.set_velocities(0, &broken),
        world.dynamics.set_forces(0, &broken),
    ] {
        assert!(matches!(result, Err(MechanicsError::NotFinite { body: 0, node: 5, .. })));
    }
    let mut other = before.clone();
    other.bodies.clear();
    assert!(matches!(
        world.dynamics.set_state(&other),
        Err(MechanicsError::WrongBodyCount { expected: 1, found: 0 })
    ));
    let mut other = before.clone();
    other.contacts.push(ContactForce {
        edges: false,
        bodies: [0, 0],
        nodes: [0, 1, 2, 8],
        weights: [1.0, -0.5, -0.25, -0.25],
        force: [0.0; 3],
    });
    let found = world.dynamics.set_state(&other);
    assert_eq!(found, Err(MechanicsError::BadContact(0)));
    assert_eq!(world.dynamics.state(), before);
}

#[test]
fn drives_of_a_state_are_of_fixed_nodes_that_exist() {
    let mesh = box_mesh([1, 1, 1], [0.1; 3], |x| x);
    let mut body = soft("organ", &mesh, 5e3, 0.01);
    body.fixed_nodes = vec![0, 1, 2];
    let mut world = World::new(&model(vec![body], 9.81), 1.0 / 60.0, 1);
    world.dynamics.drive(0, &[0, 2], &[]).unwrap();
    let before = world.dynamics.state();
    let with = |change: &dyn Fn(&mut Drive)| {
        let mut state = before.clone();
        change(&mut state.drives[0]);
        state
    };
    let twice = {
        let mut state = before.clone();
        state.drives.push(Drive { id: u64::MAX, ..state.drives[0].clone() });
        state
    };
    let empty = |drive: &mut Drive| {
        // Found by fuzzing: no node asked whether there is such a body.
        *drive = Drive { body: 18, ..Drive::default() };
    };
    for (state, expected) in [
        (with(&empty), MechanicsError::NoSuchBody { index: 18, count: 1 }),
        (with(&|drive| *drive = Drive::default()), MechanicsError::NoNodes),
        (
            with(&|drive| drive.nodes[1] = 8),
            MechanicsError::NoSuchNode { body: 0, node: 8, nodes: 8 },
        ),
        (with(&|drive| drive.nodes[1] = 3), MechanicsError::NotFixed { body: 0, node: 3 }),
        (with(&|drive| drive.nodes[1] = 0), MechanicsError::DrivenTwice { body: 0, node: 0 }),
        (twice, MechanicsError::DrivenTwice { body: 0, node: 0 }),
    ] {
        assert_eq!(world.dynamics.set_state(&state), Err(expected));
        assert_eq!(world.dynamics.state(), before);
    }
    world.run(2);
}

#[test]
fn a_failed_step_leaves_the_state_before_it() {
    let mesh = box_mesh([1, 1, 1], [0.1; 3], |x| x);
    let mut world = World::new(&model(vec![soft("organ", &mesh, 5e3, 0.01)], 9.81), 1.0 / 60.0, 1);
    world.run(3);
    world.dynamics.set_forces(0, &[[1e308; 3]; 8]).unwrap();
    let mut before = world.dynamics.state();
    let error = loop {
        world.dynamics.begin_step();
        match world.dynamics.finish_step(&[], &[]) {
            Ok(_) => before = world.dynamics.state(),
            Err(error) => break error,
        }
    };
    let MechanicsError::Step(failure) = &error else { panic!("{error}") };
    assert!(matches!(failure.cause, Cause::Force(_) | Cause::Speed(_)), "{error}");
    assert_eq!(world.dynamics.state(), before);
    assert!(world.dynamics.positions(0)[0].iter().all(|x| x.is_finite()));
}
