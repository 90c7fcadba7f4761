//! Bodies that are tied to each other.

use palpate_model::{Attachment, Body, Law, Model};

use crate::world::{
    GRAVITY, World, box_mesh, difference, floor, largest_distance, length, model, rigid, soft, sum,
};

fn attach(mut model: Model, bodies: [usize; 2], stiffness: Option<f64>) -> Model {
    let found = Attachment::find(&model.bodies, bodies, Some(1e-3), stiffness).unwrap();
    model.attachments.push(found);
    model
}

#[test]
fn two_halves_that_are_tied_are_one_block() {
    let place = |lift: f64| move |[x, y, z]: [f64; 3]| [x, y, z + lift];
    let (cells, size) = ([3, 3, 2], [0.06, 0.06, 0.04]);
    let (low, high) = (box_mesh(cells, size, place(0.0)), box_mesh(cells, size, place(0.04)));
    let whole = box_mesh([3, 3, 4], [0.06, 0.06, 0.08], place(0.0));
    for law in [Law::Linear, Law::NeoHookean] {
        let block = |name, mesh| {
            let mut body = soft(name, mesh, 5e3, 0.05);
            body.material.law = law;
            let base = |node: &u32| mesh.nodes()[*node as usize][2] == 0.0;
            let fixed_nodes = (0..mesh.nodes().len() as u32).filter(base).collect();
            Body { fixed_nodes, ..body }
        };
        let tied = model(vec![block("low", &low), block("high", &high)], GRAVITY);
        let mut tied = World::new(&attach(tied, [1, 0], Some(1e9)), 1.0 / 60.0, 1);
        let mut one = World::new(&model(vec![block("whole", &whole)], GRAVITY), 1.0 / 60.0, 1);
        let top = whole.nodes().len() - 1;
        one.dynamics.pull(0, top, [0.08, 0.06, 0.08], 10.0).unwrap();
        tied.dynamics.pull(1, high.nodes().len() - 1, [0.08, 0.06, 0.08], 10.0).unwrap();
        one.run(300);
        tied.run(300);
        let moved = length(difference(one.dynamics.positions(0)[top], whole.nodes()[top]));
        let layers = 2 * 16;
        let below = &one.dynamics.positions(0)[..low.nodes().len()];
        let above = &one.dynamics.positions(0)[layers..];
        let error = largest_distance(tied.dynamics.positions(0), below)
            .max(largest_distance(tied.dynamics.positions(1), above));
        // A turning linear block is two frames here and one there.
        let limit = if law == Law::Linear { 0.05 } else { 2e-3 };
        assert!(error < limit * moved, "{law:?}: {error} m apart, {moved} m moved");
    }
}

#[test]
fn a_body_hangs_from_a_rigid_one_by_its_weight() {
    let mesh = box_mesh([3, 3, 3], [0.05; 3], |[x, y, z]| [x, y, z - 0.0504]);
    let bodies = vec![soft("weight", &mesh, 2e4, 0.02), rigid("ceiling", &floor(0.2, 0.0, |x| x))];
    let model = attach(model(bodies, GRAVITY), [1, 0], None);
    assert_eq!(model.attachments[0].bodies, [0, 1], "the one that can move is tied");
    let mut world = World::new(&model, 1.0 / 60.0, 1);
    world.run(240);
    assert_eq!(world.dynamics.contacts().len(), 0, "what is tied does not push");
    let force = sum(world.dynamics.contact_force(0));
    let weight = world.mass(0) * GRAVITY;
    assert!(length(difference(force, [0.0, 0.0, weight])) < 1e-6 * weight, "{force:?} N");
    let [pull, _] = world.dynamics.tool_force(1).unwrap();
    assert!(length(sum(&[pull, force])) < 1e-12 * weight, "{pull:?} N");
}
