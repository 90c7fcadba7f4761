//! Springs that pull nodes, and tools that push.

use glam::{DQuat, DVec3};
use palpate_mechanics::{Dynamics, MechanicsError, State};
use palpate_model::{Body, Law, Model};

use crate::world::{
    World, box_mesh, difference, largest_distance, length, model, rigid, soft, sum,
};

/// A block that stands on its fixed lower face.
fn standing_block(law: Law) -> Body {
    let mesh = box_mesh([3, 3, 4], [0.06, 0.06, 0.08], |x| x);
    let low = |node: &u32| mesh.nodes()[*node as usize][2] == 0.0;
    let fixed_nodes = (0..mesh.nodes().len() as u32).filter(low).collect();
    let mut body = Body { fixed_nodes, ..soft("block", &mesh, 5e3, 0.05) };
    body.material.law = law;
    body
}

/// The node at a corner of the upper face of the block.
fn upper_corner(model: &Model) -> usize {
    model.bodies[0].mesh.nodes().len() - 1
}

#[test]
fn a_spring_at_rest_pulls_like_the_same_force() {
    for law in [Law::Linear, Law::NeoHookean] {
        let model = model(vec![standing_block(law)], 0.0);
        let node = upper_corner(&model);
        for stiffness in [0.5, 20.0, 1e6] {
            let mut pulled = World::new(&model, 1.0 / 60.0, 1);
            let target = [0.075, 0.06, 0.09];
            let id = pulled.dynamics.pull(0, node, target, stiffness).unwrap();
            pulled.run(400);
            let pull = pulled.dynamics.pulls()[0];
            assert_eq!(pull.id, id);
            let place = pulled.dynamics.positions(0)[node];
            let stretch = difference(target, place);
            let error = length(difference(pull.force, stretch.map(|x| stiffness * x)));
            // The stiffest spring is as stiff as single precision bears: see the floor of softness.
            if stiffness < 1e3 {
                assert!(error < 1e-3 * length(pull.force), "{law:?} {stiffness}: {error} N");
            } else {
                assert!(length(stretch) < 2e-5, "{law:?}: {} m off", length(stretch));
            }

            let mut pushed = World::new(&model, 1.0 / 60.0, 1);
            let mut forces = vec![[0.0; 3]; node + 1];
            forces[node] = pull.force;
            pushed.dynamics.set_forces(0, &forces).unwrap();
            pushed.run(400);
            let apart =
                largest_distance(pushed.dynamics.positions(0), pulled.dynamics.positions(0));
            let moved = length(difference(place, model.bodies[0].mesh.nodes()[node]));
            assert!(apart < 2e-3 * moved, "{law:?} {stiffness}: {apart} m apart of {moved}");
        }
    }
}

#[test]
fn a_spring_gives_a_free_body_its_impulse() {
    let mesh = box_mesh([3, 3, 3], [0.05; 3], |x| x);
    let model = model(vec![soft("cube", &mesh, 5e3, 0.01)], 0.0);
    let mut world = World::new(&model, 1.0 / 60.0, 1);
    let id = world.dynamics.pull(0, 0, [-0.1, -0.02, 0.05], 5.0).unwrap();
    let mut impulse = DVec3::ZERO;
    for step in 0..90 {
        world.dynamics.set_pull_target(id, [-0.1 - 0.01 * f64::from(step), 0.0, 0.1]).unwrap();
        world.step();
        impulse += DVec3::from_array(world.dynamics.pulls()[0].force) / 60.0;
        let momentum = DVec3::from_array(world.dynamics.momentum().linear);
        assert!((momentum - impulse).length() < 1e-9 * impulse.length().max(1e-6));
    }
    world.dynamics.release(id).unwrap();
    assert_eq!(world.dynamics.release(id), Err(MechanicsError::Released));
    assert_eq!(world.dynamics.set_pull_target(id, [0.0; 3]), Err(MechanicsError::Released));
    world.run(10);
    let momentum = DVec3::from_array(world.dynamics.momentum().linear);
    assert!((momentum - impulse).length() < 1e-9 * impulse.length());
}

/// A block between a floor that it is fixed to and a rigid plate above it.
fn press() -> Model {
    let block = standing_block(Law::NeoHookean);
    let plate = box_mesh([2, 2, 1], [0.1, 0.1, 0.01], |[x, y, z]| [x - 0.02, y - 0.02, z + 0.085]);
    model(vec![block, rigid("plate", &plate)], 0.0)
}

#[test]
fn a_tool_feels_what_it_presses() {
    let mut world = World::new(&press(), 1.0 / 60.0, 1);
    for step in 0..300 {
        let depth = 0.015 * (f64::from(step) / 100.0).min(1.0);
        world.dynamics.set_pose(1, DQuat::IDENTITY, [0.0, 0.0, -depth]).unwrap();
        world.step();
    }
    let [force, torque] = world.dynamics.tool_force(1).unwrap();
    // 1 cm of 8 cm, clamped below and free to slide above: between E eps A and a stiffer bound.
    let plain = 5e3 * (0.0098 / 0.08) * 0.06 * 0.06;
    assert!(force[2] > plain && force[2] < 1.4 * plain, "{force:?} N, E eps A is {plain} N");
    assert!(force[0].abs() < 0.05 * plain && force[1].abs() < 0.05 * plain, "{force:?}");
    // The block's middle is at (0.03, 0.03): the torque is about the origin of the plate's file.
    let arm = [torque[1] / -force[2], torque[0] / force[2]];
    assert!((arm[0] - 0.03).abs() < 2e-3 && (arm[1] - 0.03).abs() < 2e-3, "{arm:?}");
    let opposite = sum(world.dynamics.contact_force(0));
    assert!(length(sum(&[force, opposite])) <= 1e-12 * length(force));

    // Turned about its origin by a pose, and lifted off.
    let turn = DQuat::from_rotation_z(0.5);
    world.dynamics.set_pose(1, turn, [0.0, 0.0, 0.05]).unwrap();
    world.step();
    let plate = &press().bodies[1].mesh;
    let expected = turn * DVec3::from_array(plate.nodes()[3]) + DVec3::new(0.0, 0.0, 0.05);
    assert!(length(difference(world.dynamics.positions(1)[3], expected.to_array())) < 1e-15);
    world.step();
    assert_eq!(world.dynamics.tool_force(1).unwrap(), [[0.0; 3]; 2]);
}

#[test]
fn springs_and_poses_are_part_of_the_state() {
    let model = press();
    let play = |world: &mut World, steps: std::ops::Range<u32>| {
        for step in steps {
            let height = -0.0002 * f64::from(step);
            world.dynamics.set_pose(1, DQuat::from_rotation_x(0.1), [0.0, 0.01, height]).unwrap();
            world.step();
        }
    };
    let mut first = World::new(&model, 1.0 / 60.0, 1);
    let id = first.dynamics.pull(0, upper_corner(&model), [0.1, 0.06, 0.07], 30.0).unwrap();
    play(&mut first, 0..20);
    first.dynamics.set_pull_target(id, [0.09, 0.05, 0.07]).unwrap();
    let state: State = first.dynamics.state();
    play(&mut first, 20..40);
    for threads in [1, 3] {
        let mut second = World::new(&model, 1.0 / 60.0, threads);
        second.dynamics.set_state(&state).unwrap();
        play(&mut second, 20..40);
        let (first, second) = (first.dynamics.state(), second.dynamics.state());
        assert!(first == second, "{threads} threads continue otherwise");
    }
    let mut third = World::new(&model, 1.0 / 60.0, 1);
    third.dynamics.set_state(&state).unwrap();
    let more = third.dynamics.pull(0, 30, [0.0; 3], 1.0).unwrap();
    assert!(more > id, "an identity is never given again");
}

#[test]
fn what_cannot_be_pulled_or_put_is_refused() {
    let model = press();
    let mut dynamics =
        Dynamics::new(&model, palpate_mechanics::DynamicsOptions::default()).unwrap();
    let before = dynamics.state();
    let nodes = model.bodies[0].mesh.nodes().len();
    let nan = [0.0, f64::NAN, 0.0];
    let pulls = [
        (dynamics.pull(2, 0, [0.0; 3], 1.0), "body 2 does not exist: there are 2 bodies"),
        (dynamics.pull(0, nodes, [0.0; 3], 1.0), "node 80 does not exist: body 0 has 80 nodes"),
        (dynamics.pull(0, 0, [0.0; 3], 1.0), "node 0 of body 0 is fixed or rigid"),
        (dynamics.pull(1, 0, [0.0; 3], 1.0), "node 0 of body 1 is fixed or rigid"),
        (dynamics.pull(0, nodes - 1, nan, 1.0), "must be finite"),
        (dynamics.pull(0, nodes - 1, [0.0; 3], 0.0), "the stiffness is 0 N/m"),
        (dynamics.pull(0, nodes - 1, [0.0; 3], f64::NAN), "the stiffness is NaN N/m"),
    ];
    for (result, message) in pulls {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let poses = [
        (dynamics.set_pose(0, DQuat::IDENTITY, [0.0; 3]), "body 0 is not rigid"),
        (dynamics.set_pose(7, DQuat::IDENTITY, [0.0; 3]), "body 7 does not exist"),
        (
            dynamics.set_pose(1, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), [0.0; 3]),
            "a rotation must be",
        ),
        (dynamics.set_pose(1, DQuat::IDENTITY, nan), "must be finite"),
    ];
    for (result, message) in poses {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    assert!(dynamics.tool_force(0).is_err());
    assert!(dynamics.state() == before, "an error changes nothing");
}
