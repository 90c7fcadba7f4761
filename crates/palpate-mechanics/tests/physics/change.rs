//! Bodies whose topology changes while they move.

use palpate_mechanics::{Dynamics, DynamicsOptions, MechanicsError};
use palpate_model::{Body, Law, Mesh, MeshChange, Model, NodeOrigin};

use crate::world::{
    World, box_mesh, difference, floor, largest_distance, length, model, rigid, soft, sum,
};

const STEP: f64 = 1.0 / 60.0;

/// A block above a floor, thrown.
fn thrown(law: Law) -> Model {
    let mesh = box_mesh([4, 3, 3], [0.08, 0.06, 0.06], |[x, y, z]| [x, y, z + 0.01]);
    let mut block = soft("block", &mesh, 2e4, 0.02);
    block.material.law = law;
    block.initial_velocity = [0.2, 0.1, -0.3];
    model(vec![block, rigid("floor", &floor(1.0, 0.0, |x| x))], 9.81)
}

/// The block opened along x = 0.04 down to half of its height: nodes on the plane above it are copied
/// for the tetrahedra behind.
fn opened(mesh: &Mesh) -> MeshChange {
    let mut nodes: Vec<NodeOrigin> = (0..mesh.nodes().len() as u32).map(NodeOrigin::kept).collect();
    let mut corners = mesh.tetrahedra().to_vec();
    for node in 0..mesh.nodes().len() as u32 {
        let [x, _, z] = mesh.nodes()[node as usize];
        if (x - 0.04).abs() > 1e-9 || z < 0.04 {
            continue;
        }
        let copy = nodes.len() as u32;
        nodes.push(NodeOrigin::kept(node));
        for (index, corners) in corners.iter_mut().enumerate() {
            let center: f64 = mesh.tetrahedron_corners(index).iter().map(|p| 0.25 * p[0]).sum();
            if let Some(corner) = corners.iter_mut().find(|c| **c == node)
                && center > 0.04
            {
                *corner = copy;
            }
        }
    }
    let positions = nodes.iter().map(|origin| origin.value(mesh.nodes())).collect();
    let parents = (0..corners.len() as u32).collect();
    MeshChange::new(mesh, positions, corners, nodes, parents).unwrap()
}

/// Every tetrahedron cut in two at the middle of its longest edge, as long as that is the longest of all
/// around it.
fn refined(mesh: &Mesh) -> MeshChange {
    let mut nodes: Vec<NodeOrigin> = (0..mesh.nodes().len() as u32).map(NodeOrigin::kept).collect();
    let mut corners = mesh.tetrahedra().to_vec();
    let mut parents: Vec<u32> = (0..corners.len() as u32).collect();
    let edge = mesh.tetrahedra()[7][..2].to_vec();
    let middle = nodes.len() as u32;
    nodes.push(NodeOrigin {
        nodes: [edge[0], edge[1], edge[0], edge[0]],
        weights: [0.5, 0.5, 0.0, 0.0],
    });
    for index in 0..mesh.tetrahedra().len() {
        if edge.iter().all(|node| corners[index].contains(node)) {
            let mut second = corners[index];
            *corners[index].iter_mut().find(|c| **c == edge[0]).unwrap() = middle;
            *second.iter_mut().find(|c| **c == edge[1]).unwrap() = middle;
            corners.push(second);
            parents.push(index as u32);
        }
    }
    assert!(corners.len() > mesh.tetrahedra().len());
    let positions = nodes.iter().map(|origin| origin.value(mesh.nodes())).collect();
    MeshChange::new(mesh, positions, corners, nodes, parents).unwrap()
}

#[test]
fn a_change_of_nothing_changes_nothing() {
    let model = thrown(Law::Linear);
    let mut left = World::new(&model, STEP, 1);
    let mut changed = World::new(&model, STEP, 1);
    for world in [&mut left, &mut changed] {
        world.run(20);
        assert!(length(world.contact_sum(0)) > 0.1);
    }
    changed.change(&model, 0, &MeshChange::identity(&model.bodies[0].mesh));
    for world in [&mut left, &mut changed] {
        world.run(20);
    }
    // How contacts turn the body is computed anew, in a slightly other shape.
    let apart = largest_distance(left.dynamics.positions(0), changed.dynamics.positions(0));
    assert!(apart < 1e-8, "{apart}");
}

#[test]
fn momentum_is_kept_by_copies_and_by_nodes_in_between() {
    for law in [Law::Linear, Law::NeoHookean] {
        let model = thrown(law);
        for make in [opened, refined] {
            let mut world = World::new(&model, STEP, 1);
            world.run(9);
            let (mass, before) = (world.mass(0), world.dynamics.momentum());
            world.change(&model, 0, &make(&model.bodies[0].mesh));
            assert!((world.mass(0) - mass).abs() < 1e-14 * mass);
            let after = world.dynamics.momentum();
            let lost = length(difference(after.linear, before.linear));
            assert!(lost < 1e-13 * length(before.linear), "{law:?}: {lost}");
            let turned = length(difference(after.angular, before.angular));
            assert!(turned < 1e-4 * length(before.angular), "{law:?}: {turned}");
        }
    }
}

#[test]
fn a_prepared_change_is_the_change_and_its_step_is_settled_by_one_pass() {
    let mut model = thrown(Law::NeoHookean);
    model.bodies[0].initial_velocity = [0.2, 0.1, -1.5];
    let change = opened(&model.bodies[0].mesh);
    let mut fewer = 0;
    for step in 0..14 {
        let mut at_once = World::new(&model, STEP, 1);
        at_once.run(step);
        let mut prepared = World::new(&model, STEP, 1);
        prepared.run(step);
        at_once.change(&model, 0, &change);
        prepared.change_prepared(&model, 0, &change);
        assert_eq!(prepared.dynamics.positions(0), at_once.dynamics.positions(0));
        assert_eq!(prepared.dynamics.velocities(0), at_once.dynamics.velocities(0));
        let solves = [&mut at_once, &mut prepared].map(|world| world.step().contact_solves);
        assert!(solves[1] <= solves[0]);
        let same = prepared.dynamics.positions(0) == at_once.dynamics.positions(0);
        assert_eq!(same, solves[0] == solves[1], "{step}: {solves:?}");
        fewer += usize::from(solves[1] < solves[0]);
        let apart = largest_distance(at_once.dynamics.positions(0), prepared.dynamics.positions(0));
        assert!(apart < 0.1 * 0.02, "less than a tenth of an edge: {apart}");
    }
    assert!(fewer > 0, "what comes to the floor takes two passes");
}

#[test]
fn it_goes_on_like_a_body_made_of_the_new_mesh() {
    for law in [Law::Linear, Law::NeoHookean] {
        let model = thrown(law);
        let mut world = World::new(&model, STEP, 1);
        world.run(25);
        let mut now = model.clone();
        for make in [opened, |mesh: &Mesh| mesh.remove(&[3, 50, 51]).unwrap(), refined] {
            let change = make(&now.bodies[0].mesh);
            now = world.change(&now, 0, &change);
            let mut fresh = World::new(&now, STEP, 1);
            fresh.dynamics.set_positions(0, world.dynamics.positions(0)).unwrap();
            fresh.dynamics.set_velocities(0, world.dynamics.velocities(0)).unwrap();
            let start = world.dynamics.positions(0).to_vec();
            world.run(10);
            fresh.run(10);
            let moved = largest_distance(&start, world.dynamics.positions(0));
            let apart = largest_distance(fresh.dynamics.positions(0), world.dynamics.positions(0));
            assert!(apart < 2e-2 * moved, "{law:?}: {apart} m of {moved}");
        }
    }
}

#[test]
fn a_state_after_cuts_goes_on_with_the_same_bits() {
    for law in [Law::Linear, Law::NeoHookean] {
        let model = thrown(law);
        let mut world = World::new(&model, STEP, 1);
        world.run(20);
        let change = opened(&model.bodies[0].mesh);
        let now = world.change(&model, 0, &change);
        let change = now.bodies[0].mesh.remove(&[1, 60]).unwrap();
        let now = world.change(&now, 0, &change);
        for steps in [0, 7] {
            world.run(steps);
            let state = world.dynamics.state();
            let mut other = World::in_state(&now, STEP, &state);
            assert_eq!(other.dynamics.state(), state);
            let mut same = World::in_state(&now, STEP, &state);
            world.run(15);
            other.run(15);
            assert_eq!(world.dynamics.state(), other.dynamics.state(), "{law:?}");
            same.dynamics.set_state(&other.dynamics.state()).unwrap();
            assert_eq!(world.dynamics.state(), same.dynamics.state());
        }
        let fresh = DynamicsOptions { time_step: STEP, threads: 1 };
        let mut fresh = Dynamics::new(&now, fresh).unwrap();
        assert_eq!(
            fresh.set_state(&world.dynamics.state()),
            Err(MechanicsError::OtherOrder { body: 0 })
        );
    }
}

#[test]
fn the_lips_of_a_cut_carry_each_other_and_open_freely() {
    // A block on its side: pressed together along x by forces on its ends, then pulled apart.
    for (press, opens) in [(0.25, false), (-0.3, true)] {
        let mesh = box_mesh([4, 3, 3], [0.08, 0.06, 0.06], |x| x);
        let low = |node: &u32| mesh.nodes()[*node as usize][2] == 0.0;
        let fixed_nodes = (0..mesh.nodes().len() as u32).filter(low).collect();
        let mut body = Body { fixed_nodes, ..soft("block", &mesh, 3e3, 0.05) };
        body.material.law = Law::NeoHookean;
        let model = model(vec![body], 0.0);
        let mut world = World::new(&model, STEP, 1);
        let push = |mesh: &Mesh| -> Vec<_> {
            let force = |&[x, _, z]: &[f64; 3]| match x {
                _ if z < 0.03 => [0.0; 3],
                0.0 => [press / 8.0, 0.0, 0.0],
                x if x > 0.079 => [-press / 8.0, 0.0, 0.0],
                _ => [0.0; 3],
            };
            mesh.nodes().iter().map(force).collect()
        };
        let now = world.change(&model, 0, &opened(&model.bodies[0].mesh));
        world.dynamics.set_forces(0, &push(&now.bodies[0].mesh)).unwrap();
        world.run(200);
        let mesh = &now.bodies[0].mesh;
        let first = model.bodies[0].mesh.nodes().len();
        let copies = mesh.nodes().len() - first;
        let positions = world.dynamics.positions(0);
        // Without the corners, which can slide off each other.
        let inner = |&copy: &usize| (0.01..0.05).contains(&mesh.nodes()[first + copy][1]);
        let gaps: Vec<f64> = (0..copies)
            .filter(inner)
            .map(|copy| {
                let copy = first + copy;
                let same = |old: &usize| mesh.nodes()[*old] == mesh.nodes()[copy];
                let old = (0..copy).find(same).expect("it is a copy");
                positions[copy][0] - positions[old][0]
            })
            .collect();
        let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let most = gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if opens {
            assert!(least > 1e-4 && world.dynamics.contacts().is_empty(), "{least}");
        } else {
            // Mean edge 2 cm, contact distance 2 mm.
            assert!(least > -5e-4 && most < 1e-3, "{least} {most}");
            assert!(!world.dynamics.contacts().is_empty());
            let total = sum(world.dynamics.contact_force(0));
            assert!(length(total) < 1e-12, "equal and opposite: {total:?}");
        }
    }
}

#[test]
fn springs_stay_at_their_node_or_let_go() {
    let model = thrown(Law::Linear);
    let mesh = &model.bodies[0].mesh;
    let mut world = World::new(&model, STEP, 1);
    let last = mesh.nodes().len() - 1;
    let kept = world.dynamics.pull(0, last, [0.1, 0.1, 0.1], 5.0).unwrap();
    let lost = world.dynamics.pull(0, 0, [0.1, 0.1, 0.1], 5.0).unwrap();
    world.run(3);
    let all_at_0: Vec<u32> = (0..)
        .zip(mesh.tetrahedra())
        .filter(|(_, corners)| corners.contains(&0))
        .map(|(index, _)| index)
        .collect();
    let change = mesh.remove(&all_at_0).unwrap();
    let after = model.changed(0, &change);
    assert_eq!(world.dynamics.change_body(&after, 0, &change), Ok(vec![lost]));
    let [pull] = world.dynamics.pulls() else { panic!("one is left") };
    assert_eq!((pull.id, pull.node as usize), (kept, last - 1));
}
