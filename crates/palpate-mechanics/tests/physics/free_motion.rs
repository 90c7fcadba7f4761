//! Bodies that touch nothing.

use crate::world::{World, box_mesh, difference, length, model, soft, volume};

const DT: f64 = 1.0 / 60.0;

#[test]
fn free_fall_is_that_of_implicit_euler() {
    let mesh = box_mesh([2, 2, 2], [0.1; 3], |x| x);
    let mut body = soft("falling", &mesh, 5e3, 0.01);
    body.initial_velocity = [0.3, 0.0, 1.0];
    let mut world = World::new(&model(vec![body], 9.81), DT, 1);
    world.run(60);
    let n = 60.0;
    // v_k = v - k g dt; x moves with the new velocity.
    let fall = n * DT * 1.0 - 9.81 * DT * DT * n * (n + 1.0) / 2.0;
    for (rest, now) in mesh.nodes().iter().zip(world.dynamics.positions(0)) {
        let moved = difference(*now, *rest);
        assert!(length(difference(moved, [0.3, 0.0, fall])) < 1e-11, "{moved:?} {fall}");
    }
    assert!((world.dynamics.time() - 1.0).abs() < 1e-12);
}

fn tumbling(young: f64, damping: f64, speed: f64) -> World {
    let mesh = box_mesh([4, 3, 2], [0.12, 0.08, 0.05], |x| x);
    let mut world = World::new(&model(vec![soft("brick", &mesh, young, damping)], 0.0), DT, 1);
    let omega = glam::DVec3::new(1.0, 0.9, 0.2).normalize() * speed;
    let center = glam::DVec3::from_array(world.center(0));
    let velocities: Vec<_> = mesh
        .nodes()
        .iter()
        .map(|&x| omega.cross(glam::DVec3::from_array(x) - center).to_array())
        .collect();
    world.dynamics.set_velocities(0, &velocities).unwrap();
    world
}

#[test]
fn a_tumbling_body_keeps_volume_and_momentum() {
    let mesh = box_mesh([4, 3, 2], [0.12, 0.08, 0.05], |x| x);
    let rest = volume(&mesh, mesh.nodes());
    for (young, damping, speed) in [(5e4, 0.01, 8.0), (5e4, 0.0, 8.0), (1e6, 0.001, 25.0)] {
        let mut world = tumbling(young, damping, speed);
        let start = world.dynamics.momentum();
        let energy = world.dynamics.energy().total();
        for step in 0..300 {
            world.step();
            let change = volume(&mesh, world.dynamics.positions(0)) / rest - 1.0;
            assert!(change.abs() < 1e-3, "volume {change:e} in step {step} at E = {young}");
            let now = world.dynamics.momentum();
            let drift = length(difference(now.angular, start.angular)) / length(start.angular);
            assert!(drift < 1e-12, "angular momentum {drift:e}");
            assert!(length(difference(now.linear, start.linear)) < 1e-13);
            assert!(world.dynamics.energy().total() < 1.003 * energy, "energy grows");
        }
        // A rigid body would keep its energy; damping may only take what deformation costs.
        assert!(world.dynamics.energy().kinetic > 0.5 * energy);
    }
}

#[test]
fn a_stiff_tumbling_body_turns_like_a_rigid_one() {
    // Euler's equations by small Runge-Kutta steps as the slow twin.
    let mut world = tumbling(1e8, 0.0, 5.0);
    let masses = world.dynamics.masses(0).unwrap().to_vec();
    let nodes: Vec<_> =
        world.dynamics.positions(0).iter().map(|&x| glam::DVec3::from_array(x)).collect();
    let center = glam::DVec3::from_array(world.center(0));
    let mut second = glam::DMat3::ZERO;
    for (&m, &x) in masses.iter().zip(&nodes) {
        let r = x - center;
        second += glam::DMat3::from_cols(m * r.x * r, m * r.y * r, m * r.z * r);
    }
    let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
    let inertia = glam::DMat3::from_diagonal(glam::DVec3::splat(trace)) - second;
    let spin = glam::DVec3::from_array(world.dynamics.momentum().angular);
    let mut turn = glam::DQuat::IDENTITY;
    let small = DT / 1000.0;
    let rate = |turn: glam::DQuat| {
        let r = glam::DMat3::from_quat(turn);
        r * (inertia.inverse() * (r.transpose() * spin))
    };
    for _ in 0..30 {
        world.step();
        for _ in 0..1000 {
            let middle = glam::DQuat::from_scaled_axis(0.5 * small * rate(turn)) * turn;
            turn = (glam::DQuat::from_scaled_axis(small * rate(middle)) * turn).normalize();
        }
    }
    let size = 0.08;
    for (&rest, &now) in nodes.iter().zip(world.dynamics.positions(0)) {
        let expected = center + turn * (rest - center);
        let error = (glam::DVec3::from_array(now) - expected).length();
        assert!(error < 0.01 * size, "error {error} m after half a second");
    }
}
