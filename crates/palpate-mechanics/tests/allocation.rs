//! At steady state a step allocates nothing: counted by the allocator of this test binary.

#[path = "physics/world.rs"]
#[expect(dead_code, reason = "the other tests use the rest")]
mod world;

use palpate_testing::{Counting, allocations};

use world::{GRAVITY, World, box_mesh, floor, model, rigid, soft};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Two blocks, one on the other, on an open floor, and one that is fixed and touches nothing.
fn stack(friction: f64) -> World {
    let lower = box_mesh([4, 4, 3], [0.1, 0.1, 0.06], |[x, y, z]| [x, y, z + 0.003]);
    let upper =
        box_mesh([3, 3, 2], [0.06, 0.06, 0.04], |[x, y, z]| [x + 0.02, y + 0.02, z + 0.067]);
    let apart = box_mesh([2, 2, 2], [0.05; 3], |[x, y, z]| [x + 0.2, y, z]);
    let mut bodies = vec![
        rigid("floor", &floor(0.4, 0.0, |x| x)),
        soft("lower", &lower, 2e4, 0.02),
        soft("upper", &upper, 1e4, 0.02),
        soft("apart", &apart, 1e4, 0.02),
    ];
    bodies[3].fixed_nodes = (18..27).collect();
    for body in &mut bodies {
        body.contact.friction = friction;
    }
    World::new(&model(bodies, GRAVITY), 1.0 / 60.0, 1)
}

#[test]
fn a_step_at_rest_allocates_nothing() {
    for friction in [0.0, 0.4] {
        let mut world = stack(friction);
        world.run(200);
        for _ in 0..30 {
            let before = allocations();
            world.dynamics.begin_step();
            let begun = allocations() - before;
            let (proximity, penetration) = world.detect();
            let before = allocations();
            let stats = world.dynamics.finish_step(&proximity, &penetration).expect("finite");
            let count = allocations() - before;
            assert!(stats.contacts > 20, "{} contacts", stats.contacts);
            assert_eq!((begun, count), (0, 0), "friction {friction}, {stats:?}");
        }
    }
}
