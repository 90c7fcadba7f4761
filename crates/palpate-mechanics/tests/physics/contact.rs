//! Bodies that touch.

use palpate_model::Law;

use crate::world::{GRAVITY, World, box_mesh, difference, floor, length, model, rigid, soft, sum};

const DT: f64 = 1.0 / 60.0;

#[test]
fn colliding_bodies_keep_their_momentum() {
    for law in [Law::Linear, Law::Corotated, Law::NeoHookean] {
        collide(law);
    }
}

fn collide(law: Law) {
    let left = box_mesh([3, 3, 3], [0.1; 3], |x| x);
    let right = box_mesh([4, 3, 2], [0.1; 3], |[x, y, z]| [x + 0.12, y + 0.031, z + 0.023]);
    let mut bodies = vec![soft("left", &left, 2e4, 0.002), soft("right", &right, 1e4, 0.002)];
    for body in &mut bodies {
        body.material.law = law;
    }
    bodies[0].initial_velocity = [1.0, 0.0, 0.0];
    let mut world = World::new(&model(bodies, 0.0), DT, 1);
    let start = world.dynamics.momentum();
    let energy = world.dynamics.energy().total();
    let mut touched = false;
    for _ in 0..60 {
        let stats = world.step();
        touched |= stats.contacts > 0;
        let now = world.dynamics.momentum();
        let linear = length(difference(now.linear, start.linear)) / length(start.linear);
        let angular = length(difference(now.angular, start.angular)) / length(start.angular);
        assert!(linear < 1e-12 && angular < 1e-11, "{law}: {linear:e} {angular:e}");
        assert!(world.dynamics.energy().total() < 1.001 * energy);
        let sum = [0, 1].map(|body| world.contact_sum(body));
        assert!(
            length(std::array::from_fn(|k| sum[0][k] + sum[1][k])) < 1e-12 * (1.0 + length(sum[0]))
        );
    }
    assert!(touched);
    // The right body was pushed and flies ahead.
    let speed = |body: usize| {
        let v = world.dynamics.velocities(body);
        v.iter().map(|v| v[0]).sum::<f64>() / v.len() as f64
    };
    assert!(speed(1) > 0.4 && speed(1) > speed(0), "{} {}", speed(0), speed(1));
}

fn resting(mut base: palpate_model::Body) -> World {
    base.contact.friction = 0.3;
    let mesh = box_mesh([4, 4, 3], [0.1, 0.1, 0.06], |[x, y, z]| [x - 0.05, y - 0.05, z + 0.004]);
    let mut block = soft("block", &mesh, 1e4, 0.02);
    block.contact.friction = 0.3;
    World::new(&model(vec![base, block], GRAVITY), DT, 1)
}

#[test]
fn a_deformed_body_at_rest_has_no_velocity() {
    // A leaning soft block: it rests deformed and lopsided, where the rotations of the rest shape
    // and those of the deformed one differ most.
    let lean = |[x, y, z]: [f64; 3]| [x + 0.4 * z, y, z + 0.001];
    let mesh = box_mesh([5, 4, 6], [0.06, 0.05, 0.09], lean);
    let mut bodies = vec![rigid("floor", &floor(0.3, 0.0, |x| x)), soft("block", &mesh, 5e3, 0.03)];
    for body in &mut bodies {
        body.contact.friction = 0.4;
    }
    let mut world = World::new(&model(bodies, GRAVITY), DT, 1);
    world.run(240);
    let velocities = world.dynamics.velocities(1);
    let fastest = velocities.iter().map(|&v| length(v)).fold(0.0, f64::max);
    assert!(fastest < 1e-5, "{fastest} m/s");
}

/// What the contact forces were solved for is what happens, whatever the law: a body pressed off its centre
/// turns, and where its response left that out surfaces passed each other although every gap was kept.
/// Throws a leaning block of so many cells on the floor; returns it, and the contacts that there were.
fn assert_gaps(law: Law, cells: [usize; 3], steps: usize) -> (World, usize) {
    let lean = |[x, y, z]: [f64; 3]| [x + 0.5 * z, y + 0.2 * x, z + 0.002 + 0.3 * x];
    let mesh = box_mesh(cells, [0.06, 0.05, 0.09], lean);
    let mut bodies = vec![rigid("floor", &floor(0.3, 0.0, |x| x)), soft("block", &mesh, 2e4, 0.01)];
    bodies[1].material.law = law;
    bodies[1].initial_velocity = [0.3, 0.0, -1.0];
    let mut world = World::new(&model(bodies, GRAVITY), DT, 1);
    let mut seen = 0;
    for step in 0..steps {
        world.step();
        for contact in world.dynamics.contacts() {
            let mut gap = 0.0;
            for corner in 0..4 {
                let body = contact.body_of(corner);
                let x = world.dynamics.positions(body)[contact.nodes[corner] as usize];
                let height: f64 = x.iter().zip(contact.normal).map(|(x, n)| x * n).sum();
                gap += contact.weights[corner] * height;
            }
            let error = (gap - contact.gap).abs();
            assert!(error < 1e-6, "{law}, step {step}: {gap} instead of {}", contact.gap);
            seen += 1;
        }
    }
    (world, seen)
}

#[test]
fn contacts_end_with_the_gaps_that_their_forces_were_solved_for() {
    for law in [Law::Linear, Law::Corotated, Law::NeoHookean] {
        let (_, seen) = assert_gaps(law, [4, 3, 5], 90);
        assert!(seen > 200, "{seen}");
    }
}

#[test]
fn a_large_factor_of_few_bits_leaves_the_same_gaps() {
    let (world, seen) = assert_gaps(Law::NeoHookean, [12, 12, 18], 8);
    assert!(seen > 200, "{seen}");
    let factor = world.dynamics.factor_stats(1).unwrap();
    assert!(factor.bytes as u64 <= 3 * factor.entries, "sixteen bits: {factor:?}");
    let (world, _) = assert_gaps(Law::NeoHookean, [4, 3, 5], 1);
    let factor = world.dynamics.factor_stats(1).unwrap();
    assert!(factor.bytes as u64 >= 4 * factor.entries, "thirty-two bits: {factor:?}");
}

fn assert_supported(world: &mut World) {
    world.run(240);
    let weight = world.mass(1) * GRAVITY;
    let [x, y, z] = world.contact_sum(1);
    assert!((z / weight - 1.0).abs() < 0.01, "{z} N carry {weight} N");
    assert!(x.abs() < 0.01 * weight && y.abs() < 0.01 * weight);
    let speed = world.dynamics.velocities(1).iter().map(|&v| length(v)).fold(0.0, f64::max);
    assert!(speed < 1e-3, "still moving at {speed} m/s");
    for contact in world.dynamics.contacts() {
        assert!(contact.normal_force > 0.0);
        assert!(contact.gap > -1e-3, "gap {}", contact.gap);
    }
}

#[test]
fn a_rigid_floor_carries_the_weight() {
    let mut world = resting(rigid("floor", &floor(0.3, 0.0, |x| x)));
    assert_supported(&mut world);
}

#[test]
fn a_closed_rigid_table_carries_the_weight() {
    let table = box_mesh([1, 1, 1], [0.4, 0.4, 0.05], |[x, y, z]| [x - 0.2, y - 0.2, z - 0.05]);
    let mut world = resting(rigid("table", &table));
    assert_supported(&mut world);
}

#[test]
fn a_soft_body_fixed_at_its_bottom_carries_the_weight() {
    let mesh = box_mesh([5, 5, 2], [0.2, 0.2, 0.05], |[x, y, z]| [x - 0.1, y - 0.1, z - 0.05]);
    let mut base = soft("base", &mesh, 2e4, 0.02);
    base.fixed_nodes = (0..36).collect();
    let mut world = resting(base);
    assert_supported(&mut world);
    let down = world.contact_sum(0)[2];
    assert!((down + world.mass(1) * GRAVITY).abs() < 0.01 * world.mass(1) * GRAVITY);
}

#[test]
fn overlapping_bodies_separate_gently() {
    for overlap in [0.002, 0.01, 0.03] {
        let left = box_mesh([4, 4, 4], [0.1; 3], |x| x);
        let right =
            box_mesh([3, 3, 3], [0.08; 3], |[x, y, z]| [x + 0.1 - overlap, y + 0.013, z + 0.007]);
        let bodies = vec![soft("left", &left, 1e4, 0.01), soft("right", &right, 1e4, 0.01)];
        let mut world = World::new(&model(bodies, 0.0), DT, 1);
        let mut fastest = 0.0_f64;
        for _ in 0..240 {
            world.step();
            for body in 0..2 {
                let velocities = world.dynamics.velocities(body);
                fastest = fastest.max(length(sum(velocities)) / velocities.len() as f64);
            }
        }
        let right_of_left =
            world.dynamics.positions(0).iter().map(|x| x[0]).fold(f64::MIN, f64::max);
        let left_of_right =
            world.dynamics.positions(1).iter().map(|x| x[0]).fold(f64::MAX, f64::min);
        assert!(
            left_of_right > right_of_left,
            "overlap {overlap}: {left_of_right} {right_of_left}"
        );
        assert!(fastest < 0.2, "overlap {overlap}: {fastest} m/s");
    }
}

#[test]
fn a_stack_stands() {
    let mut bodies = vec![rigid("floor", &floor(0.4, 0.0, |x| x))];
    for level in 0..3 {
        let z0 = 0.002 + 0.063 * f64::from(level);
        let shift = 0.007 * f64::from(level);
        let mesh =
            box_mesh([3, 3, 2], [0.1, 0.1, 0.06], |[x, y, z]| [x + shift, y - shift, z + z0]);
        bodies.push(soft(&format!("block {level}"), &mesh, 3e4, 0.02));
        bodies.last_mut().unwrap().contact.friction = 0.5;
    }
    let mut world = World::new(&model(bodies, GRAVITY), DT, 1);
    world.run(240);
    let weight = world.mass(1) * GRAVITY;
    for level in 1..=3 {
        let net = world.contact_sum(level)[2];
        assert!((net / weight - 1.0).abs() < 0.02, "block {level}: {net} N of {weight} N");
    }
    let floor_load = -world.contact_sum(0)[2];
    assert!((floor_load / (3.0 * weight) - 1.0).abs() < 0.01);
}

#[test]
fn a_bent_strip_touches_itself_and_is_held_apart() {
    // A hairpin whose two arms are pressed together by forces.
    let bend = |[x, y, z]: [f64; 3]| {
        let radius = 0.02;
        let arm = 0.15;
        let (s, r) = (x, radius + z);
        if s < arm {
            [arm - s, y, -r]
        } else if s < arm + std::f64::consts::PI * radius {
            let angle = (s - arm) / radius;
            [-r * angle.sin(), y, -r * angle.cos()]
        } else {
            [s - arm - std::f64::consts::PI * radius, y, r]
        }
    };
    let total = 0.3 + std::f64::consts::PI * 0.02;
    let mesh = box_mesh([40, 3, 2], [total, 0.03, 0.01], bend);
    let mut body = soft("hairpin", &mesh, 2e4, 0.02);
    body.contact.friction = 0.5;
    let mut world = World::new(&model(vec![body], 0.0), DT, 1);
    let forces: Vec<[f64; 3]> = mesh
        .nodes()
        .iter()
        .map(|x| if x[0] > 0.1 { [0.0, 0.0, -4e-5 * x[2].signum()] } else { [0.0; 3] })
        .collect();
    world.dynamics.set_forces(0, &forces).unwrap();
    let mut most = 0;
    for _ in 0..120 {
        let stats = world.step();
        most = most.max(stats.self_contacts);
        assert_eq!(stats.contacts, stats.self_contacts);
    }
    assert!(most > 5, "{most} self-contacts");
    assert!(length(world.contact_sum(0)) < 1e-12);
    assert_eq!(world.intersections(), 0, "the arms have passed through each other");
}

#[test]
fn a_node_that_slipped_through_an_open_floor_comes_back() {
    let dented = |[x, y, z]: [f64; 3]| {
        let sag = if (x - 0.05).abs() < 1e-9 && (y - 0.05).abs() < 1e-9 && z == 0.0 {
            0.006
        } else {
            0.0
        };
        [x, y, z + 0.002 - sag]
    };
    let mesh = box_mesh([4, 4, 3], [0.1, 0.1, 0.06], dented);
    let bodies = vec![rigid("floor", &floor(0.3, 0.0, |x| x)), soft("block", &mesh, 1e4, 0.02)];
    let mut world = World::new(&model(bodies, GRAVITY), DT, 1);
    world.run(90);
    let lowest = world.dynamics.positions(1).iter().map(|x| x[2]).fold(f64::MAX, f64::min);
    assert!(lowest > 0.0, "a node hangs at {lowest}");
    let weight = world.mass(1) * GRAVITY;
    assert!((world.contact_sum(1)[2] / weight - 1.0).abs() < 0.02);
}
