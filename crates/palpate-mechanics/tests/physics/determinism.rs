//! The same bits at any thread count and after a restart.

use palpate_mechanics::State;

use crate::world::{World, box_mesh, floor, model, rigid, soft};

fn pile(threads: usize) -> World {
    let mut bodies = vec![rigid("floor", &floor(1.0, 0.0, |x| x))];
    for (index, (x, z)) in [(0.0, 0.03), (0.05, 0.12), (0.02, 0.21), (0.3, 0.02)].iter().enumerate()
    {
        let mesh = box_mesh([3, 3, 2], [0.1, 0.1, 0.06], |p| [p[0] + x, p[1], p[2] + z]);
        let mut body = soft(&format!("block {index}"), &mesh, 2e4, 0.01);
        body.contact.friction = 0.3;
        body.processor = [Some(7), None, Some(3), None][index];
        bodies.push(body);
    }
    World::new(&model(bodies, 9.81), 1.0 / 60.0, threads)
}

fn bits(state: &State) -> Vec<u64> {
    let bodies = state.bodies.iter();
    let arrays = bodies.flat_map(|b| b.positions.iter().chain(&b.velocities).chain(&b.forces));
    arrays.flatten().map(|x| x.to_bits()).collect()
}

#[test]
fn results_do_not_depend_on_threads() {
    let run = |threads| {
        let mut world = pile(threads);
        let contacts = (0..60).map(|_| world.step().contacts).max();
        (bits(&world.dynamics.state()), contacts)
    };
    let one = run(1);
    assert!(one.1.unwrap() > 20);
    assert!(one == run(2), "2 threads");
    assert!(one == run(8), "8 threads");
}

#[test]
fn a_restored_state_continues_bit_for_bit() {
    let mut world = pile(1);
    world.run(40);
    let saved = world.dynamics.state();
    world.run(20);
    let expected = world.dynamics.state();
    world.dynamics.set_state(&saved).unwrap();
    world.run(20);
    assert!(bits(&world.dynamics.state()) == bits(&expected));
    assert_eq!(world.dynamics.state(), expected);
    // Also in a fresh one, whose compliance columns are not those of the first.
    let mut fresh = pile(2);
    fresh.dynamics.set_state(&saved).unwrap();
    fresh.run(20);
    assert_eq!(fresh.dynamics.state(), expected);
}

#[test]
fn responses_solved_ahead_change_no_bit() {
    let run = |columns: usize, threads: usize| {
        let mut world = pile(threads);
        let solve = || Some(world.dynamics.prepare_contact(columns)).filter(|&solved| solved > 0);
        let ahead: usize = std::iter::from_fn(solve).sum();
        let solved: usize = (0..60).map(|_| world.step().new_columns).sum();
        (bits(&world.dynamics.state()), ahead, solved)
    };
    let (lazy, _, needed) = run(0, 1);
    assert!(needed > 20);
    for (columns, threads) in [(usize::MAX, 2), (5, 1)] {
        let (state, ahead, solved) = run(columns, threads);
        assert!(state == lazy, "{columns} at a time");
        // Every surface node of the four blocks.
        assert_eq!((ahead, solved), (4 * 44, 0));
    }
}
