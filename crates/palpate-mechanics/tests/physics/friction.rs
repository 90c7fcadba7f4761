//! Coulomb friction on an incline.

use glam::{DQuat, DVec3};

use crate::world::{GRAVITY, World, box_mesh, difference, floor, model, rigid, soft};

/// Downhill way [m] of a box in one second on a slope with tan(angle) = `slope`.
fn slide(slope: f64, friction: f64) -> f64 {
    let turn = DQuat::from_rotation_y(slope.atan());
    let place = |x: [f64; 3]| (turn * DVec3::from_array(x)).to_array();
    let mesh = box_mesh([3, 3, 2], [0.1, 0.1, 0.05], |[x, y, z]| place([x, y, z + 0.0031]));
    let mut bodies = vec![rigid("slope", &floor(3.0, 0.0, place)), soft("box", &mesh, 1e5, 0.01)];
    for body in &mut bodies {
        body.contact.friction = friction;
    }
    let mut world = World::new(&model(bodies, GRAVITY), 1.0 / 60.0, 1);
    world.run(30);
    let start = world.center(1);
    world.run(60);
    let downhill = turn * DVec3::X;
    DVec3::from_array(difference(world.center(1), start)).dot(downhill)
}

#[test]
fn a_box_sticks_below_the_friction_angle_and_slides_above() {
    let slope = 0.4_f64;
    assert!(slide(slope, 0.45) < 1e-4, "crept {}", slide(slope, 0.45));
    let angle = slope.atan();
    for friction in [0.0, 0.2, 0.35] {
        // From the speed at the start of the measured second on: way = v t + a t² / 2.
        let a = GRAVITY * (angle.sin() - friction * angle.cos());
        let expected = a * 0.5 + 0.5 * a;
        let way = slide(slope, friction);
        assert!((way / expected - 1.0).abs() < 0.08, "mu {friction}: {way} m, theory {expected} m");
    }
}
