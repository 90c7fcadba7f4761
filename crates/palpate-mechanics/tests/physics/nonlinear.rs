//! Bodies of nonlinear laws: the step that solves for them, in large deformation.

use palpate_model::{Body, Law};

use crate::world::{GRAVITY, World, box_mesh, floor, largest_distance, length, model, rigid, soft};

const DT: f64 = 1.0 / 60.0;
const LAWS: [Law; 4] =
    [Law::Corotated, Law::SaintVenantKirchhoff, Law::NeoHookean, Law::MooneyRivlin];

fn of_law(law: Law, mut body: Body) -> Body {
    body.material.law = law;
    body
}

#[test]
fn constant_large_strain_is_exact_on_a_distorted_mesh() {
    let bump = |[x, y, z]: [f64; 3]| {
        let inside = |v: f64| (std::f64::consts::PI * v).sin();
        let size = 0.08 * inside(x) * inside(y) * inside(z);
        [x + size * (9.0 * y).sin(), y + size * (7.0 * z).cos(), z - size * (5.0 * x).sin()]
    };
    let mesh = box_mesh([3, 3, 3], [1.0; 3], bump);
    let on_boundary = |x: &[f64; 3]| x.iter().any(|&v| v.abs() < 1e-12 || (v - 1.0).abs() < 1e-12);
    // Stretched by a half, sheared and turned.
    let gradient = [[0.4, -0.9, 0.1], [1.3, 0.3, 0.2], [-0.1, 0.1, 0.9]];
    let affine = |x: &[f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|j| gradient[i][j] * x[j]).sum::<f64>())
    };
    let expected: Vec<_> = mesh.nodes().iter().map(affine).collect();
    for law in LAWS {
        let mut body = of_law(law, soft("block", &mesh, 5_000.0, 0.01));
        body.fixed_nodes = (0..mesh.nodes().len() as u32)
            .filter(|&node| on_boundary(&mesh.nodes()[node as usize]))
            .collect();
        let start: Vec<_> = mesh
            .nodes()
            .iter()
            .zip(&expected)
            .map(|(rest, &moved)| {
                let inside = if on_boundary(rest) { 0.0 } else { 0.02 };
                std::array::from_fn(|k| moved[k] + inside * (9.0 * rest[k]).sin())
            })
            .collect();
        let mut world = World::new(&model(vec![body], 0.0), 10.0, 1);
        world.dynamics.set_positions(0, &start).unwrap();
        world.run(400);
        let error = largest_distance(world.dynamics.positions(0), &expected);
        assert!(error < 1e-10, "{law}: {error:e}");
    }
}

/// A soft bar held at one end that hangs down under its weight: ends bent by more than 60 degrees.
fn hanging_bar(law: Law) -> World {
    let mesh = box_mesh([16, 3, 3], [0.2, 0.02, 0.02], |x| x);
    let mut body = of_law(law, soft("bar", &mesh, 8_000.0, 0.15));
    body.fixed_nodes =
        (0..mesh.nodes().len() as u32).filter(|&n| mesh.nodes()[n as usize][0] < 1e-9).collect();
    World::new(&model(vec![body], GRAVITY), DT, 1)
}

#[test]
fn a_soft_bar_bends_without_growing() {
    for law in [Law::Corotated, Law::NeoHookean, Law::MooneyRivlin] {
        let mut world = hanging_bar(law);
        let mut most = 0;
        for _ in 0..720 {
            most = most.max(world.step().newton_iterations);
        }
        let x = world.dynamics.positions(0);
        let fastest = world.dynamics.velocities(0).iter().map(|&v| length(v)).fold(0.0, f64::max);
        let lowest = x.iter().map(|x| x[2]).fold(f64::INFINITY, f64::min);
        let farthest = x.iter().map(|x| x[0]).fold(0.0, f64::max);
        assert!(lowest < -0.12 && farthest < 0.15, "{law}: {lowest} {farthest}");
        assert!(fastest < 2e-3, "{law}: {fastest}");
        assert!(most >= 2, "{law}");
        // Along the bar: the distance of neighbours on an edge that is bent, not stretched.
        let bar_length: f64 =
            (0..16).map(|i| length(std::array::from_fn(|k| x[i + 1][k] - x[i][k]))).sum();
        assert!((bar_length / 0.2 - 1.0).abs() < 0.08, "{law}: {bar_length}");
    }
}

#[test]
fn the_static_shape_does_not_depend_on_the_way_there() {
    let mut slow = hanging_bar(Law::NeoHookean);
    slow.run(1500);
    let mesh = box_mesh([16, 3, 3], [0.2, 0.02, 0.02], |x| x);
    let mut body = of_law(Law::NeoHookean, soft("bar", &mesh, 8_000.0, 0.3));
    body.fixed_nodes =
        (0..mesh.nodes().len() as u32).filter(|&n| mesh.nodes()[n as usize][0] < 1e-9).collect();
    let mut fast = World::new(&model(vec![body], GRAVITY), 0.1, 1);
    fast.run(600);
    let difference = largest_distance(slow.dynamics.positions(0), fast.dynamics.positions(0));
    assert!(difference < 2e-6, "{difference:e}");
}

/// A long soft bar that falls onto a post and folds over it.
fn folding(threads: usize) -> World {
    let mesh = box_mesh([14, 2, 2], [0.2, 0.02, 0.02], |[x, y, z]| [x - 0.1, y - 0.01, z + 0.025]);
    let post = box_mesh([1, 1, 1], [0.04, 0.06, 0.02], |[x, y, z]| [x - 0.02, y - 0.03, z]);
    let bar = of_law(Law::NeoHookean, soft("bar", &mesh, 4_000.0, 0.01));
    let bodies = vec![rigid("floor", &floor(0.3, -0.1, |x| x)), rigid("post", &post), bar];
    World::new(&model(bodies, GRAVITY), DT, threads)
}

#[test]
fn while_another_matrix_is_made_only_a_change_of_shape_is_worth_one() {
    let mesh = box_mesh([6, 2, 2], [0.2, 0.02, 0.02], |[x, y, z]| [x - 0.1, y, z + 0.025]);
    let post = box_mesh([1, 1, 1], [0.04, 0.06, 0.02], |[x, y, z]| [x - 0.02, y - 0.02, z]);
    let mut bar = of_law(Law::NeoHookean, soft("bar", &mesh, 1e5, 0.01));
    bar.material.poisson = 0.45;
    bar.initial_velocity = [0.0, 0.0, -4.0];
    let bodies = vec![rigid("floor", &floor(0.3, -0.1, |x| x)), rigid("post", &post), bar];
    let model = model(bodies, GRAVITY);
    let mut world = World::new(&model, 1.0 / 60.0, 1);
    let (mut slow, mut changed) = (0, 0);
    for _ in 0..40 {
        let state = world.dynamics.state();
        let mut waiting = World::in_state(&model, 1.0 / 60.0, &state);
        waiting.dynamics.await_matrix(2, true);
        let made = [world.step().refactored, waiting.step().refactored];
        slow += usize::from(made == [1, 0]);
        changed += usize::from(made == [1, 1]);
    }
    assert!(slow > 0 && changed > 0, "some steps are slow, and it folds: {slow} {changed}");
}

#[test]
fn a_folding_bar_is_the_same_at_any_thread_count_and_after_a_restart() {
    let mut world = folding(1);
    let mut refactored = 0;
    for _ in 0..25 {
        refactored += world.step().refactored;
    }
    assert!(refactored > 0, "the bar folds, its matrix must follow");
    let middle = world.dynamics.state();
    world.run(25);
    let end = world.dynamics.state();
    for threads in [1, 2, 3] {
        let mut other = folding(threads);
        other.dynamics.set_state(&middle).unwrap();
        assert!(other.dynamics.state() == middle);
        other.run(25);
        assert!(other.dynamics.state() == end, "{threads} threads");
        // Back to the rest shape's matrix.
        let start = folding(1).dynamics.state();
        other.dynamics.set_state(&start).unwrap();
        other.run(50);
        assert!(other.dynamics.state() == end, "{threads} threads from the start");
    }
}

#[test]
fn a_spinning_body_keeps_its_momentum_and_gains_no_energy() {
    let mesh = box_mesh([6, 2, 2], [0.12, 0.04, 0.04], |x| x);
    for law in [Law::Corotated, Law::NeoHookean] {
        let body = of_law(law, soft("bar", &mesh, 2e4, 0.0));
        let mut world = World::new(&model(vec![body], 0.0), 1.0 / 240.0, 1);
        let spin: Vec<_> = mesh.nodes().iter().map(|x| [-30.0 * x[1], 30.0 * x[0], 0.4]).collect();
        world.dynamics.set_velocities(0, &spin).unwrap();
        let start = world.dynamics.momentum();
        let energy = world.dynamics.energy().total();
        for _ in 0..480 {
            world.step();
            let now = world.dynamics.momentum();
            for k in 0..3 {
                let size = length(start.angular);
                assert!((now.linear[k] - start.linear[k]).abs() < 1e-12 * length(start.linear));
                assert!((now.angular[k] - start.angular[k]).abs() < 1e-9 * size, "{law}");
            }
            assert!(world.dynamics.energy().total() < 1.005 * energy, "{law}");
        }
        assert!(world.dynamics.energy().kinetic > 0.5 * energy, "{law}");
    }
}

/// How many matrices are made anew when a box of nearly incompressible tissue, whose iterations are many, is
/// stretched and let go.
fn matrices_after_stretch(cells: usize, stretch: f64) -> usize {
    let mesh = box_mesh([cells; 3], [0.1; 3], |x| x);
    let mut body = of_law(Law::NeoHookean, soft("box", &mesh, 5_000.0, 0.01));
    body.material.poisson = 0.4999;
    let mut world = World::new(&model(vec![body], 0.0), DT, 1);
    let longer = mesh.nodes().iter().map(|&[x, y, z]| [stretch * x, y, z]).collect::<Vec<_>>();
    world.dynamics.set_positions(0, &longer).unwrap();
    world.step().refactored
}

#[test]
fn a_matrix_is_made_anew_only_for_another_shape() {
    let (small, large) = (4, 16);
    assert_eq!(matrices_after_stretch(small, 1.0 + 1e-5), 0);
    assert_eq!(matrices_after_stretch(small, 1.005), 1);
    assert_eq!(matrices_after_stretch(large, 1.005), 0);
    assert_eq!(matrices_after_stretch(large, 1.1), 1);
}

#[test]
fn a_pile_of_nearly_incompressible_tissue_rests_without_new_matrices() {
    let body = |name: &str, height: f64| {
        let mesh = box_mesh([5, 5, 3], [0.1, 0.1, 0.06], |[x, y, z]| [x, y, z + height]);
        let mut body = of_law(Law::NeoHookean, soft(name, &mesh, 5_000.0, 0.01));
        body.material.poisson = 0.49;
        body.contact.friction = 0.5;
        body
    };
    let mut floor = rigid("floor", &floor(0.3, 0.0, |x| x));
    floor.contact.friction = 0.5;
    let bodies = vec![floor, body("low", 0.01), body("high", 0.08)];
    let mut world = World::new(&model(bodies, GRAVITY), 1.0 / 60.0, 1);
    world.run(240);
    let made: usize = (0..60).map(|_| world.step().refactored).sum();
    let speeds = (1..3).flat_map(|body| world.dynamics.velocities(body));
    let fastest = speeds.map(|&v| length(v)).fold(0.0, f64::max);
    assert!(made == 0 && fastest < 1e-6, "{made} matrices, {fastest:e} m/s");
}

/// A matrix is made anew while somebody holds what it was made of: a cut that is on its way.
#[test]
fn a_large_matrix_keeps_its_bits_per_entry_while_a_cut_is_prepared() {
    let stretched = |is_held: bool| {
        let mesh = box_mesh([16, 16, 16], [0.1, 0.1, 0.1], |x| x);
        let body = of_law(Law::NeoHookean, soft("box", &mesh, 5_000.0, 0.01));
        let mut world = World::new(&model(vec![body], 0.0), DT, 1);
        let entries = world.dynamics.factor_stats(0).unwrap().entries;
        assert!(entries > 2_000_000, "a large one: {entries}");
        let held = is_held.then(|| world.dynamics.basis(0));
        let longer: Vec<[f64; 3]> = mesh.nodes().iter().map(|&[x, y, z]| [1.3 * x, y, z]).collect();
        world.dynamics.set_positions(0, &longer).unwrap();
        assert_eq!(world.step().refactored, 1);
        drop(held);
        let bytes = world.dynamics.factor_stats(0).unwrap().bytes;
        world.step();
        (bytes, world.dynamics.state())
    };
    let (alone, held) = (stretched(false), stretched(true));
    assert_eq!(alone.0, held.0);
    assert!(alone.1 == held.1);
}
