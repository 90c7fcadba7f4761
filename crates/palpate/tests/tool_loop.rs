//! A tool that feels tissue between steps.

#[path = "support/boxes.rs"]
mod boxes;

use std::sync::Arc;

use boxes::box_data;
use glam::{DQuat, DVec3};
use palpate::model::{Body, Law, Material, RigidMotion};
use palpate::{Mesh, MeshData, Model, Simulation, SimulationOptions, ToolForce, ToolLoop};

const TOP: f64 = 0.04;
const TOOL: usize = 1;
/// Height of the tools' origin at the start, above the tissue.
const START: f64 = 0.06;

/// An octahedron whose lowest corner is its origin.
fn probe(size: f64) -> Body {
    let corners = [[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [0, 0, 0], [0, 0, 2]];
    let mut data = MeshData {
        nodes: (corners.iter().map(|c| c.map(|x: i32| size * f64::from(x))))
            .map(|[x, y, z]| [x, y, z + START])
            .collect(),
        ..MeshData::default()
    };
    for k in 0..4 {
        data.triangles.push([k, (k + 1) % 4, 5]);
        data.triangles.push([(k + 1) % 4, k, 4]);
    }
    let mut body = Body::new("probe", Arc::new(Mesh::new(data).expect("an octahedron")));
    body.rigid = Some(RigidMotion { pivot: [0.0, 0.0, START], ..RigidMotion::default() });
    body
}

/// A slab of 8 x 8 x 4 cm that stands on its fixed lower side, and a probe.
fn slab(law: Law, friction: f64, mut tool: Body) -> Model {
    let mesh = Mesh::repaired(box_data([8, 8, 4], 0.01, [0.0; 3])).expect("a box").0;
    let fixed = (0..mesh.nodes().len() as u32).filter(|&n| mesh.nodes()[n as usize][2] < 1e-6);
    let fixed_nodes = fixed.collect();
    let material = Material { law, young: 8e3, poisson: 0.4, damping: 0.05, ..Material::default() };
    let mut tissue = Body { material, fixed_nodes, ..Body::new("tissue", Arc::new(mesh)) };
    tissue.contact.friction = friction;
    tool.contact.friction = friction;
    Model { gravity: [0.0; 3], ..Model::from_bodies(vec![tissue, tool]) }
}

fn start(law: Law, friction: f64) -> (Simulation, ToolLoop) {
    start_with(slab(law, friction, probe(0.015)))
}

fn start_with(model: Model) -> (Simulation, ToolLoop) {
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    let tool = simulation.tool_loop(TOOL, None).unwrap();
    (simulation, tool)
}

/// Just off the middle of a cell's side, so far below the surface.
fn at(depth: f64) -> [f64; 3] {
    [0.0437, 0.0421, TOP - depth]
}

fn feel(tool: &mut ToolLoop, place: [f64; 3]) -> ToolForce {
    tool.tick(DQuat::IDENTITY, place).unwrap()
}

/// Steps with sixteen ticks each, along a path; the last tick.
fn follow(
    simulation: &mut Simulation,
    tool: &mut ToolLoop,
    steps: usize,
    path: impl Fn(f64) -> [f64; 3],
) -> ToolForce {
    let mut last = ToolForce::default();
    for step in 0..steps {
        for tick in 0..16 {
            last = feel(tool, path((step as f64 + f64::from(tick) / 16.0) / steps as f64));
        }
        simulation.step().unwrap();
    }
    last
}

fn length(v: [f64; 3]) -> f64 {
    DVec3::from_array(v).length()
}

fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    DVec3::from_array(a).distance(DVec3::from_array(b))
}

#[test]
fn at_rest_a_tick_gives_the_force_of_the_step() {
    for (law, friction) in
        [(Law::Linear, 0.0), (Law::Linear, 0.4), (Law::NeoHookean, 0.0), (Law::NeoHookean, 0.4)]
    {
        let (mut simulation, mut tool) = start(law, friction);
        // Down, then a little sideways, and at rest there.
        follow(&mut simulation, &mut tool, 30, |s| at(4e-3 * s - 1e-3));
        let aside = |s: f64| {
            let [x, y, z] = at(3e-3);
            [x + 8e-4 * s, y, z]
        };
        follow(&mut simulation, &mut tool, 5, aside);
        let felt = follow(&mut simulation, &mut tool, 80, |_| aside(1.0));
        let [force, torque] = simulation.tool_force(TOOL).unwrap();
        assert!(force[2] > 0.02, "{law:?}: {force:?} N");
        let across = force[0].hypot(force[1]);
        assert!(friction == 0.0 || across > 0.05 * force[2], "{law:?}: {force:?} N");
        let error = apart(felt.force, force) / length(force);
        assert!(error < 0.01, "{law:?}, friction {friction}: {:?}, {force:?}", felt.force);
        assert!(apart(felt.torque, torque) < 0.02 * 0.015 * length(force), "{:?}", felt.torque);
        // And keeps on giving it without news.
        let mut later = felt;
        for _ in 0..500 {
            later = feel(&mut tool, aside(1.0));
        }
        assert!(apart(later.force, force) < 0.01 * length(force), "{:?} drifts", later.force);
        // The newest pose has moved the tool.
        assert!(apart(simulation.tool_pose(TOOL).unwrap().1.to_array(), aside(1.0)) < 1e-12);
    }
}

/// A box of 12 x 12 x 1 cm whose lower side is over the whole slab.
fn press() -> Body {
    let corner = |bits: u32| {
        let at = [0, 1, 2].map(|axis| f64::from(bits >> axis & 1));
        [0.12 * at[0] - 0.02, 0.12 * at[1] - 0.02, 0.01 * at[2] + START]
    };
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let data = MeshData {
        nodes: (0..8).map(corner).collect(),
        triangles: sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..MeshData::default()
    };
    let mut body = Body::new("press", Arc::new(Mesh::new(data).expect("a box")));
    body.rigid = Some(RigidMotion { pivot: [0.0, 0.0, START], ..RigidMotion::default() });
    body
}

#[test]
fn twice_as_deep_is_twice_the_force_and_nothing_is_nothing() {
    let (mut simulation, mut tool) = start_with(slab(Law::Linear, 0.0, press()));
    let down = |depth: f64| [0.0, 0.0, TOP - depth];
    for height in [1e-1, 2e-3] {
        let away = feel(&mut tool, down(-height));
        assert_eq!((away.force, away.torque, away.contacts), ([0.0; 3], [0.0; 3], 0));
        simulation.step().unwrap();
    }
    // At rest, from where it begins to push in earnest; and between two steps.
    let depths = [0.0, 1e-3, 2e-3];
    let mut place = -2e-3;
    let at_rest = depths.map(|depth| {
        let from = std::mem::replace(&mut place, depth);
        follow(&mut simulation, &mut tool, 60, |s| down(from + s * (depth - from)));
        follow(&mut simulation, &mut tool, 120, |_| down(depth)).force[2]
    });
    let between = depths.map(|depth| {
        let ticks = (0..=100).map(|tick| 2e-3 + depth * (f64::from(tick) / 50.0).min(1.0));
        ticks.map(|depth| feel(&mut tool, down(depth)).force[2]).last().unwrap()
    });
    for [first, second, third] in [at_rest, between] {
        let ratio = (third - first) / (second - first);
        assert!(first >= 0.0 && (ratio - 2.0).abs() < 0.12, "{first}, {second}, {third} N");
    }
    // Inertia holds against what is sudden.
    assert!(between[1] - between[0] > at_rest[1] - at_rest[0], "{between:?}, {at_rest:?} N");
    let back = (1..=60).map(|tick| feel(&mut tool, down(2e-3 - 1e-4 * f64::from(tick)))).last();
    assert_eq!(back.unwrap().force, [0.0; 3]);
}

#[test]
fn a_resting_tool_feels_static_friction_and_a_sliding_one_its_limit() {
    let friction = 0.3;
    let (mut simulation, mut tool) = start_with(slab(Law::NeoHookean, friction, press()));
    let to = |x: f64, depth: f64| [x, 0.0, TOP - depth];
    follow(&mut simulation, &mut tool, 40, |s| to(0.0, 4e-3 * s - 2e-3));
    follow(&mut simulation, &mut tool, 40, |_| to(0.0, 2e-3));
    let base = feel(&mut tool, to(0.0, 2e-3)).force;
    let limit = friction * base[2];
    assert!(limit > 0.1 && base[0].abs() < 0.02 * limit, "{base:?} N");
    // A little aside it sticks: the force stays, tick after tick, and is gone again back there.
    let mut forces = Vec::new();
    for _ in 0..300 {
        forces.push(feel(&mut tool, to(1e-4, 2e-3)).force);
    }
    let (early, last) = (forces[30], forces[299]);
    assert!(last[0] < -0.05 * limit && last[0] > -0.9 * limit, "{last:?} N, limit {limit} N");
    assert!(apart(early, last) < 2e-3 * last[0].abs(), "{early:?} {last:?} N");
    let back = (0..60).map(|_| feel(&mut tool, to(0.0, 2e-3)).force).last().unwrap();
    assert!(apart(back, base) < 0.02 * limit, "{base:?}, {back:?} N after going back");
    // With the steps of the simulation as well: they give way, and hold.
    let held = follow(&mut simulation, &mut tool, 60, |_| to(1e-4, 2e-3)).force;
    let force = simulation.tool_force(TOOL).unwrap()[0];
    assert!(held[0] < -0.01 * limit && apart(held, force) < 0.01 * length(force), "{held:?}");
    // Dragged on, it slides.
    let mut dragged = last;
    for tick in 0..300 {
        dragged = feel(&mut tool, to(1e-4 + 2e-5 * f64::from(tick), 2e-3)).force;
    }
    let ratio = dragged[0] / -dragged[2];
    assert!((ratio / friction - 1.0).abs() < 0.02, "{dragged:?} N");
}

#[test]
fn the_same_poses_and_publications_give_the_same_bits() {
    let run = || {
        let (mut simulation, mut tool) = start(Law::NeoHookean, 0.3);
        let mut forces = Vec::new();
        for step in 0..12 {
            for tick in 0..9 {
                let s = f64::from(9 * step + tick) / 108.0;
                let turn = DQuat::from_rotation_y(0.3 * s);
                let felt = tool.tick(turn, at(8e-3 * s - 1e-3)).unwrap();
                forces.extend(felt.force.into_iter().chain(felt.torque).map(f64::to_bits));
            }
            simulation.step().unwrap();
        }
        (forces, simulation.snapshot().state().clone())
    };
    assert!(run() == run());
}

#[test]
fn loops_that_are_gone_leave_the_simulation_alone() {
    let (mut simulation, mut tool) = start(Law::Linear, 0.0);
    feel(&mut tool, at(-0.01));
    simulation.step().unwrap();
    let place = simulation.tool_pose(TOOL).unwrap().1;
    feel(&mut tool, at(-0.02));
    drop(tool);
    simulation.step().unwrap();
    assert_eq!(simulation.tool_pose(TOOL).unwrap().1, place);
    assert!(simulation.tool_loop(0, None).is_err(), "tissue is no tool");
    assert!(simulation.tool_loop(TOOL, Some(0.0)).is_err());
    assert!(simulation.tool_loop(TOOL, Some(f64::NAN)).is_err());
    let mut tool = simulation.tool_loop(TOOL, Some(5e-3)).unwrap();
    assert!(tool.tick(DQuat::IDENTITY, [f64::NAN, 0.0, 0.0]).is_err());
    assert!(tool.tick(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), [0.0; 3]).is_err());
    simulation.step().unwrap();
    assert_eq!(simulation.tool_pose(TOOL).unwrap().1, place);
    // A cut gives it other meshes.
    simulation.remove(0, &[0, 1, 2]).unwrap();
    simulation.step().unwrap();
    follow(&mut simulation, &mut tool, 20, |s| at(4e-3 * s));
    assert!(simulation.tool_force(TOOL).unwrap()[0][2] > 0.0);
}
