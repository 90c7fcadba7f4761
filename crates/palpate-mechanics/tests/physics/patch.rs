//! The compliance that a loop between steps works with is that of the step.

use palpate_mechanics::{Patch, PatchMemory};
use palpate_model::Law;

use crate::world::{World, box_mesh, model, soft};

/// How a step moves node `moved` under a force of `force` [N] along `axis` on node `loaded`, by two steps
/// from the same state.
fn stepped(world: &mut World, moved: usize, loaded: usize, axis: usize, force: f64) -> [f64; 3] {
    let state = world.dynamics.state();
    let count = world.dynamics.positions(0).len();
    let mut ends = [[0.0; 3]; 2];
    for (end, size) in ends.iter_mut().zip([0.0, force]) {
        let mut forces = vec![[0.0; 3]; count];
        forces[loaded][axis] = size;
        world.dynamics.set_forces(0, &forces).unwrap();
        world.run(1);
        *end = world.dynamics.positions(0)[moved];
        world.dynamics.set_state(&state).unwrap();
    }
    std::array::from_fn(|k| (ends[1][k] - ends[0][k]) / force)
}

#[test]
fn a_patch_holds_the_inverse_of_the_matrix() {
    for (law, is_held) in [(Law::Linear, true), (Law::Linear, false), (Law::NeoHookean, true)] {
        let mesh = box_mesh([3, 2, 2], [0.06, 0.04, 0.05], |[x, y, z]| [x, 0.1 - z, y]);
        let mut body = soft("block", &mesh, 2e4, 0.01);
        body.material.law = law;
        if is_held {
            body.fixed_nodes = vec![0, 4, 8, 12];
        }
        let mut world = World::new(&model(vec![body], 0.0), 1.0 / 60.0, 1);
        world.run(2);
        let (mut memory, mut patch) = (PatchMemory::default(), Patch::default());
        // Nodes that come and go keep their entries right.
        for nodes in [vec![1, 5, 23], vec![0, 1, 2, 7, 20, 23, 35], vec![2, 3, 20, 33]] {
            world.dynamics.write_patch(0, &nodes, &mut memory, &mut patch);
            let free: Vec<u32> =
                nodes.iter().copied().filter(|&node| !is_held || node != 0).collect();
            assert_eq!(patch.nodes(), free);
            assert!(patch.compliance(free[0], 11).is_none());
            let mut largest = 0.0_f64;
            let mut error = 0.0_f64;
            for &moved in &free {
                for &loaded in &free {
                    let own = patch.compliance(moved, loaded).unwrap();
                    for axis in 0..3 {
                        // Small enough for the nonlinear law.
                        let (m, l) = (moved as usize, loaded as usize);
                        let twin = stepped(&mut world, m, l, axis, 1e-4);
                        for (k, twin) in twin.into_iter().enumerate() {
                            largest = largest.max(twin.abs());
                            error = error.max((own.col(axis)[k] - twin).abs());
                        }
                    }
                }
            }
            assert!(error < 2e-3 * largest, "{law:?}, held: {is_held}: {error:e} of {largest:e}");
        }
    }
}
