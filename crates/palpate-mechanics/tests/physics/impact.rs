//! A fast body that hits one at rest: nothing passes through anything.

use glam::{DMat3, DVec3};
use palpate_model::{Body, Law};

use crate::world::{
    GRAVITY, World, box_mesh, difference, floor, length, model, rigid, soft, volume,
};

const SPEED: f64 = 2.0;

/// Drops a block at 2 m/s (more than half its height per step) onto one that lies on `base`, whose
/// top is at height 0.
fn hit(base: Body, friction: f64) {
    let resting =
        box_mesh([4, 4, 3], [0.1, 0.1, 0.06], |[x, y, z]| [x - 0.05, y - 0.05, z + 0.003]);
    let falling = box_mesh([3, 3, 3], [0.06; 3], |[x, y, z]| [x - 0.023, y - 0.037, z + 0.12]);
    let mut bodies =
        vec![base, soft("resting", &resting, 2e4, 0.01), soft("falling", &falling, 2e4, 0.01)];
    bodies[2].initial_velocity = [0.0, 0.0, -SPEED];
    for body in &mut bodies {
        body.contact.friction = friction;
    }
    let mut world = World::new(&model(bodies, GRAVITY), 1.0 / 60.0, 1);
    let meshes = [&resting, &falling];
    let mut most_contacts = 0;
    let mut flattest = 1.0_f64;
    for step in 0..120 {
        most_contacts = most_contacts.max(world.step().contacts);
        let lowest = [1, 2].map(|body| {
            let positions = world.dynamics.positions(body);
            assert!(positions.iter().flatten().all(|x| x.is_finite()), "step {step}");
            positions.iter().map(|x| x[2]).fold(f64::MAX, f64::min)
        });
        assert!(lowest[0] > 0.0, "step {step}: the resting body is at {} m", lowest[0]);
        assert!(lowest[1] > 0.0, "step {step}: the falling body is at {} m", lowest[1]);
        assert_eq!(world.intersections(), 0, "step {step}");
        let [x, y, above] = difference(world.center(2), world.center(1));
        // Far to the side it has slid off and lies on the ground.
        assert!(above > 0.02 || x.hypot(y) > 0.05, "step {step}: through to {above} m");
        for (body, mesh) in (1..).zip(meshes) {
            let part = volume(mesh, world.dynamics.positions(body)) / volume(mesh, mesh.nodes());
            flattest = flattest.min(part);
        }
    }
    assert!(most_contacts > 30, "{most_contacts} contacts");
    assert!(flattest > 0.3, "squeezed to {flattest} of the volume");
    let fastest = [1, 2].map(|body| {
        let velocities = world.dynamics.velocities(body);
        velocities.iter().map(|&v| length(v)).fold(0.0, f64::max)
    });
    assert!(fastest.iter().all(|&v| v < SPEED), "{fastest:?} m/s two seconds later");
}

#[test]
fn a_fast_body_does_not_pass_through_one_on_an_open_floor() {
    for friction in [0.0, 0.4] {
        hit(rigid("floor", &floor(1.0, 0.0, |x| x)), friction);
    }
}

#[test]
fn a_fast_body_does_not_pass_through_one_on_a_closed_table() {
    for friction in [0.0, 0.4] {
        let table = box_mesh([1, 1, 1], [2.0, 2.0, 0.05], |[x, y, z]| [x - 1.0, y - 1.0, z - 0.05]);
        hit(rigid("table", &table), friction);
    }
}

/// A coarse, nearly incompressible box that lands on a corner is squeezed, and stiffened, within a step by
/// far more than the matrix knows that its response is first computed with.
#[test]
fn a_box_thrown_at_a_corner_gains_no_energy() {
    let tilt = DMat3::from_axis_angle(DVec3::new(1.0, 0.4, -0.3).normalize(), 0.9);
    for law in [Law::Corotated, Law::NeoHookean, Law::MooneyRivlin] {
        for (cells, speed) in [([2, 2, 3], 0.6), ([2, 2, 3], 1.5), ([3, 4, 5], 3.0)] {
            let mesh = box_mesh(cells, cells.map(|n| 0.02 * n as f64), |x| {
                (tilt * DVec3::from_array(x) + DVec3::new(0.0, 0.0, 0.06)).to_array()
            });
            let mut thrown = soft("thrown", &mesh, 2e4, 0.0);
            thrown.material.law = law;
            thrown.material.poisson = 0.45;
            thrown.initial_velocity = [0.0, 0.0, -speed];
            let mut bodies = vec![thrown, rigid("floor", &floor(1.0, 0.0, |x| x))];
            for body in &mut bodies {
                body.contact.friction = 0.0;
            }
            let mut world = World::new(&model(bodies, GRAVITY), 1.0 / 60.0, 1);
            let start = world.dynamics.energy().total();
            for step in 0..90 {
                world.step();
                let now = world.dynamics.energy().total();
                assert!(now < 1.02 * start, "{law}, {speed} m/s, step {step}: {start} J, {now} J");
            }
        }
    }
}
