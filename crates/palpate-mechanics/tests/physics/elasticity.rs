//! The elastic response against exact solutions and beam theory.

use palpate_model::Body;

use crate::world::{World, box_mesh, largest_distance, length, model, soft, sum};

/// Steps until nothing moves any more: implicit Euler with long steps finds the static solution.
fn settle(body: Body, gravity: f64, forces: &[[f64; 3]]) -> World {
    let mut world = World::new(&model(vec![body], gravity), 1e3, 1);
    world.dynamics.set_forces(0, forces).unwrap();
    world.run(20);
    world
}

fn jitter([x, y, z]: [f64; 3]) -> [f64; 3] {
    let inside = |v: f64| (std::f64::consts::PI * v).sin();
    let bump = 0.08 * inside(x) * inside(y) * inside(z);
    [x + bump * (9.0 * y).sin(), y + bump * (7.0 * z).cos(), z - bump * (5.0 * x).sin()]
}

#[test]
fn constant_strain_is_exact_on_a_distorted_mesh() {
    // Boundary nodes are held at an affine displacement: inner nodes must take it too.
    let mesh = box_mesh([4, 4, 4], [1.0; 3], jitter);
    let on_boundary = |x: &[f64; 3]| x.iter().any(|&v| v.abs() < 1e-12 || (v - 1.0).abs() < 1e-12);
    let mut body = soft("block", &mesh, 5_000.0, 0.01);
    body.fixed_nodes = (0..mesh.nodes().len() as u32)
        .filter(|&node| on_boundary(&mesh.nodes()[node as usize]))
        .collect();
    // Symmetric, so that the frame of the body does not turn.
    let strain = [[1e-3, 4e-4, -2e-4], [4e-4, -6e-4, 3e-4], [-2e-4, 3e-4, 5e-4]];
    let affine = |x: &[f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| x[i] + (0..3).map(|j| strain[i][j] * x[j]).sum::<f64>())
    };
    let expected: Vec<_> = mesh.nodes().iter().map(affine).collect();
    let start: Vec<_> = mesh
        .nodes()
        .iter()
        .zip(&expected)
        .map(|(&rest, &moved)| if on_boundary(&rest) { moved } else { rest })
        .collect();
    let mut world = World::new(&model(vec![body], 0.0), 1e3, 1);
    world.dynamics.set_positions(0, &start).unwrap();
    world.run(30);
    let error = largest_distance(world.dynamics.positions(0), &expected);
    assert!(error < 1e-10 * 1e-3, "error {error:e}");
}

/// Tip deflection of a beam held at x = 0 under a load at its end.
fn tip_deflection(refinement: usize) -> f64 {
    let (l, h, young, force) = (1.0, 0.25, 1e6, 0.5);
    let n = refinement;
    let mesh = box_mesh([4 * n, n, n], [l, h, h], |x| x);
    let mut body = soft("beam", &mesh, young, 0.0);
    let nodes = mesh.nodes();
    let at = |x: f64| (0..nodes.len()).filter(move |&node| (nodes[node][0] - x).abs() < 1e-9);
    body.fixed_nodes = at(0.0).map(|node| node as u32).collect();
    let tip: Vec<usize> = at(l).collect();
    let mut forces = vec![[0.0; 3]; mesh.nodes().len()];
    for &node in &tip {
        forces[node][2] = -force / tip.len() as f64;
    }
    let world = settle(body, 0.0, &forces);
    let sag = |&node: &usize| mesh.nodes()[node][2] - world.dynamics.positions(0)[node][2];
    tip.iter().map(sag).sum::<f64>() / tip.len() as f64
}

#[test]
fn a_cantilever_converges_to_timoshenko() {
    let (l, h, young, poisson, force) = (1.0_f64, 0.25_f64, 1e6, 0.3, 0.5);
    let second_moment = h.powi(4) / 12.0;
    let shear = young / (2.0 * (1.0 + poisson));
    let kappa = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    let expected =
        force * l.powi(3) / (3.0 * young * second_moment) + force * l / (kappa * shear * h * h);
    let found = [3, 6, 12].map(tip_deflection);
    // Linear tetrahedra are too stiff: from below, at a rate that the clamped corners hold under two.
    assert!(found[0] < found[1] && found[1] < found[2], "{found:?} {expected}");
    let (coarse, fine) = (found[1] - found[0], found[2] - found[1]);
    assert!((2.0..5.0).contains(&(coarse / fine)), "{found:?}");
    let limit = found[2] + fine * fine / (coarse - fine);
    let error = limit / expected - 1.0;
    assert!(error.abs() < 0.01, "{found:?} -> {limit}, theory {expected}");
}

#[test]
fn a_hanging_body_pulls_with_its_weight_and_stretches() {
    // Own weight on a bar held at its top: the bottom sinks by rho g L² / (2 E).
    let (length, young) = (0.4, 2e5);
    let mesh = box_mesh([2, 2, 8], [0.1, 0.1, length], |x| x);
    let mut body = soft("bar", &mesh, young, 0.0);
    body.material.poisson = 0.0;
    body.fixed_nodes = (0..mesh.nodes().len() as u32)
        .filter(|&node| (mesh.nodes()[node as usize][2] - length).abs() < 1e-9)
        .collect();
    let world = settle(body, 9.81, &vec![[0.0; 3]; mesh.nodes().len()]);
    let bottom: Vec<f64> = (0..9).map(|node| -world.dynamics.positions(0)[node][2]).collect();
    let mean = bottom.iter().sum::<f64>() / 9.0;
    let expected = 1_000.0 * 9.81 * length * length / (2.0 * young);
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
}

#[test]
fn a_turned_body_at_rest_stays_at_rest() {
    let mesh = box_mesh([3, 2, 2], [0.3, 0.2, 0.1], |x| x);
    let mut world = World::new(&model(vec![soft("block", &mesh, 5e3, 0.01)], 0.0), 1.0 / 60.0, 1);
    let turn = glam::DQuat::from_axis_angle(glam::DVec3::new(1.0, 2.0, 3.0).normalize(), 2.5);
    let turned: Vec<_> = mesh
        .nodes()
        .iter()
        .map(|&x| (turn * glam::DVec3::from_array(x) + glam::DVec3::splat(0.7)).to_array())
        .collect();
    world.dynamics.set_positions(0, &turned).unwrap();
    assert!(world.dynamics.energy().elastic < 1e-24);
    world.run(10);
    assert!(largest_distance(world.dynamics.positions(0), &turned) < 1e-13);
}

#[test]
fn force_and_extension_of_a_pulled_block_agree_with_hooke() {
    let mesh = box_mesh([4, 2, 2], [0.4, 0.1, 0.1], |x| x);
    let mut forces = vec![[0.0; 3]; mesh.nodes().len()];
    let end = |x: f64| (0..mesh.nodes().len()).filter(move |&i| (i % 5) as f64 * 0.1 == x);
    // Consistent nodal loads would need the face areas; equal and opposite ends suffice for the mean.
    for (x, sign) in [(0.0, -1.0), (0.4, 1.0)] {
        for node in end(x) {
            forces[node][0] = sign * 0.1 / 9.0;
        }
    }
    let mut world = World::new(&model(vec![soft("bar", &mesh, 1e5, 0.0)], 0.0), 0.5, 1);
    world.dynamics.set_forces(0, &forces).unwrap();
    world.run(60);
    assert!(length(sum(&forces)) < 1e-15);
    let mean = |x: f64| end(x).map(|i| world.dynamics.positions(0)[i][0]).sum::<f64>() / 9.0;
    let strain = (mean(0.4) - mean(0.0)) / 0.4 - 1.0;
    let expected = 0.1 / (0.01 * 1e5);
    assert!((strain / expected - 1.0).abs() < 0.1, "{strain} {expected}");
}
