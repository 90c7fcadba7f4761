//! Calls of a simulation, interleaved: a refused call changes nothing, a state can be saved and goes on
//! with the same bits, and what touches is what the double loop finds.

use std::path::Path;
use std::sync::Arc;

use glam::DQuat;
use palpate::contact::{IntersectionOptions, Method};
use palpate::cutting::{Blade, CutOptions};
use palpate::geometry::Point;
use palpate::mechanics::State;
use palpate::model::{Body, Law, RigidMotion};
use palpate::{Mesh, Model, Scene, SceneOptions, Simulation, SimulationOptions, Snapshot};

use super::scene::moved;
use super::shapes::{box_of, plate};
use super::{Target, ensure};
use crate::choices::Choices;

/// Calls of [`Simulation`].
pub(crate) struct SimulationCalls;

/// More tetrahedra than this in a model are not cut again.
const LARGE: usize = 800;

impl Target for SimulationCalls {
    fn name(&self) -> &'static str {
        "simulation"
    }

    fn seeds(&self) -> Vec<Vec<u8>> {
        let mut random = palpate_testing::Random(1);
        (0..20).map(|_| (0..200).map(|_| random.bits() as u8).collect()).collect()
    }

    fn warranted_memory(&self, _input: usize) -> usize {
        256 * 1024 * 1024
    }

    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String> {
        let mut choices = Choices::new(input);
        let model = model(&mut choices);
        let time_step = if choices.below(16) == 0 { choices.number() } else { 1.0 / 60.0 };
        let threads = if choices.below(16) == 0 { 2 } else { 1 };
        let options = SimulationOptions { time_step, threads, ..SimulationOptions::default() };
        let mut simulation = match Simulation::new(model, options) {
            Ok(simulation) => simulation,
            Err(error) => return Ok(error.to_string()),
        };
        let mut kept = simulation.snapshot();
        let mut outcome = String::from("started");
        for _ in 0..16 {
            if choices.is_empty() {
                break;
            }
            outcome += &call(&mut simulation, &mut kept, &mut choices, scratch)?;
            check(&mut simulation)?;
        }
        Ok(outcome)
    }
}

/// One to three soft bodies above a plate, with all sorts of settings.
pub(crate) fn model(choices: &mut Choices) -> Model {
    let mut bodies: Vec<Body> = (0..=choices.below(3))
        .map(|index| {
            let cells = [[1, 1, 1], [2, 1, 1], [2, 2, 1], [1, 2, 2]][choices.below(4)];
            let mut origin = choices.small_point().map(|x| 0.02 * x);
            origin[2] += 0.05 * index as f64 + 0.02;
            let mesh = Arc::new(box_of(cells, 0.04, origin));
            let mut body = Body::new(format!("soft {index}"), mesh);
            body.material.law = Law::ALL[choices.below(Law::ALL.len())];
            if choices.below(8) == 0 {
                body.material.young = choices.number() * 1e4;
            }
            if choices.below(8) == 0 {
                body.material.poisson = choices.number();
            }
            if choices.below(8) == 0 {
                body.material.density = choices.number() * 1e3;
            }
            if choices.below(4) == 0 {
                body.material.damping = choices.number();
            }
            body.material.fibres[0] = Some([0.0, 0.0, 1.0]).filter(|_| choices.flag());
            body.contact.friction = if choices.flag() { 0.4 } else { 0.0 };
            if choices.below(8) == 0 {
                body.contact.distance = Some(choices.number() * 0.01);
                body.contact.stiffness = Some(choices.number() * 1e6);
            }
            if choices.below(4) == 0 {
                body.fixed_nodes = vec![0, 1, 3];
            }
            if choices.below(8) == 0 {
                body.initial_velocity = choices.point();
            }
            body
        })
        .collect();
    let mut floor = Body::new("floor", Arc::new(plate(1.0, 0.0)));
    floor.rigid = Some(RigidMotion::default());
    bodies.push(floor);
    let mut model = Model::from_bodies(bodies);
    if choices.below(16) == 0 {
        model.gravity = choices.point();
    }
    model
}

/// All that must not change when a call is refused. As bytes: NaN is not equal to itself.
fn everything(simulation: &Simulation) -> Result<Vec<u8>, String> {
    postcard::to_stdvec(simulation.snapshot().state()).map_err(|error| error.to_string())
}

fn call(
    simulation: &mut Simulation,
    kept: &mut Snapshot,
    choices: &mut Choices,
    scratch: &Path,
) -> Result<String, String> {
    let before = everything(simulation)?;
    let model = Arc::clone(simulation.model());
    let body = choices.below(model.bodies.len() + 1);
    let nodes = model.bodies.get(body).map_or(3, |body| body.mesh.nodes().len());
    let points = |choices: &mut Choices, scale: f64| -> Vec<Point> {
        let count = if choices.below(32) == 0 { nodes - 1 } else { nodes };
        (0..count).map(|_| choices.point().map(|x| scale * x)).collect()
    };
    let done = match choices.below(14) {
        0..=2 => {
            let mut done = Ok(());
            for _ in 0..=choices.below(6) {
                let start = everything(simulation)?;
                // A live cut that has opened stays open when the step fails.
                let opens = simulation.has_live_cuts();
                done = simulation.step().map(drop);
                if done.is_err() && !opens {
                    unchanged(simulation, &start, "step")?;
                    break;
                }
            }
            return Ok(outcome("step", done));
        }
        3 => {
            let mut positions = points(choices, 0.1);
            if body < model.bodies.len() && choices.below(4) > 0 {
                positions = moved(simulation.positions(body), choices);
            }
            ("positions", simulation.set_positions(body, &positions))
        }
        4 => ("velocities", simulation.set_velocities(body, &points(choices, 1.0))),
        5 => ("forces", simulation.set_forces(body, &points(choices, 0.1))),
        6 => {
            let (node, target) = (choices.below(nodes + 1), choices.point().map(|x| 0.1 * x));
            let stiffness = choices.number() * 100.0;
            ("pull", simulation.pull(body, node, target, stiffness).map(drop))
        }
        7 => {
            let Some(pull) = simulation.pulls().first().map(|pull| pull.id) else {
                return Ok(String::new());
            };
            if choices.flag() {
                ("target", simulation.set_pull_target(pull, choices.point()))
            } else {
                ("release", simulation.release(pull))
            }
        }
        8 => {
            let nodes: Vec<u32> = (0..choices.below(4)).map(|_| choices.below(12) as u32).collect();
            ("drive", simulation.drive(body, &nodes).map(drop))
        }
        9 => {
            let first = simulation.drives().first().map(|drive| (drive.id, drive.nodes.len()));
            let Some((drive, count)) = first else { return Ok(String::new()) };
            if choices.flag() {
                let targets: Vec<Point> =
                    (0..count).map(|_| choices.point().map(|x| 0.1 * x)).collect();
                ("drive to", simulation.set_drive_targets(drive, &targets))
            } else {
                ("undrive", simulation.release_drive(drive))
            }
        }
        10 => {
            let [x, y, z] = choices.point();
            let rotation = DQuat::from_xyzw(x, y, z, choices.number());
            ("pose", simulation.set_pose(body, rotation, choices.point()))
        }
        11 => match cut(simulation, choices)? {
            Some(done) => ("cut", done),
            None => return Ok(String::new()),
        },
        12 => match choices.below(3) {
            0 => {
                let some: Vec<u32> =
                    (0..choices.below(5)).map(|_| choices.below(30) as u32).collect();
                ("remove", simulation.remove(body, &some).map(drop))
            }
            1 => ("separate", simulation.separate().map(drop)),
            _ if choices.flag() => {
                *kept = simulation.snapshot();
                return Ok(" snapshot".into());
            }
            _ => ("restore", simulation.restore(kept)),
        },
        _ => {
            save_and_load(simulation, scratch)?;
            return Ok(" saved".into());
        }
    };
    if done.1.is_err() {
        unchanged(simulation, &before, done.0)?;
        ensure(Arc::ptr_eq(&model, simulation.model()), || {
            format!("{} is refused and changes the model", done.0)
        })?;
    }
    Ok(outcome(done.0, done.1))
}

/// Along a plane, at once or live; `None` where there is none, or the model is large.
fn cut(
    simulation: &mut Simulation,
    choices: &mut Choices,
) -> Result<Option<Result<(), palpate::SimulationError>>, String> {
    let bodies = &simulation.model().bodies;
    if bodies.iter().map(|body| body.mesh.tetrahedra().len()).sum::<usize>() > LARGE {
        return Ok(None);
    }
    let point = choices.point().map(|x| 0.1 * x);
    let size = choices.flag().then(|| choices.number());
    let Ok(blade) = Blade::plane(point, choices.point(), size) else { return Ok(None) };
    let before = everything(simulation)?;
    if choices.flag() {
        let delay = choices.below(5) as u32;
        let done = simulation.cut_live(&blade, &CutOptions::default(), delay);
        unchanged(simulation, &before, "a cut that is prepared")?;
        return Ok(Some(done));
    }
    let done = simulation.cut(&blade, &CutOptions::default());
    if done.as_ref().is_ok_and(|report| report.bodies.is_empty()) {
        unchanged(simulation, &before, "a cut that missed")?;
    }
    Ok(Some(done.map(drop)))
}

fn outcome(what: &str, done: Result<(), palpate::SimulationError>) -> String {
    done.map_or_else(|error| format!(" {what}: {error}"), |()| format!(" {what}"))
}

fn unchanged(simulation: &Simulation, before: &[u8], what: &str) -> Result<(), String> {
    if everything(simulation)? == before {
        return Ok(());
    }
    let before: State = postcard::from_bytes(before).map_err(|error| error.to_string())?;
    let after = simulation.snapshot().state().clone();
    Err(format!("{what} is refused and changes the state from {before:?} to {after:?}"))
}

/// The state is finite, and the fast detection agrees with the double loop.
fn check(simulation: &mut Simulation) -> Result<(), String> {
    let count = simulation.model().bodies.len();
    for body in 0..count {
        for (what, values) in
            [("position", simulation.positions(body)), ("velocity", simulation.velocities(body))]
        {
            ensure(values.as_flattened().iter().all(|x| x.is_finite()), || {
                format!("a {what} of body {body} is not finite")
            })?;
        }
    }
    let energy = simulation.energy();
    ensure(!energy.kinetic.is_nan(), || "the kinetic energy is not a number".into())?;
    let meshes: Vec<Arc<Mesh>> =
        simulation.model().bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let options = SceneOptions { method: Method::AllPairs, ..SceneOptions::default() };
    let mut twin = Scene::new(meshes, None, options).map_err(|error| error.to_string())?;
    let positions: Vec<&[Point]> = (0..count).map(|body| simulation.positions(body)).collect();
    twin.update(&positions).map_err(|error| error.to_string())?;
    let options = IntersectionOptions::default();
    let expected = twin.intersections(&options).pairs.clone();
    let scene = simulation.scene().map_err(|error| error.to_string())?;
    let found = &scene.intersections(&options).pairs;
    ensure(*found == expected, || format!("{found:?} meet, by the double loop {expected:?}"))
}

/// A loaded checkpoint is the same, and goes on as the original does.
fn save_and_load(simulation: &mut Simulation, scratch: &Path) -> Result<(), String> {
    let file = scratch.join("state.palpate");
    simulation.save(&file).map_err(|error| format!("cannot be saved: {error}"))?;
    let mut loaded = Simulation::load(&file, 1)
        .map_err(|error| format!("a saved state cannot be loaded: {error}"))?;
    ensure(everything(&loaded)? == everything(simulation)?, || "a loaded state is another".into())?;
    for step in 1..=3 {
        let done = [simulation.step(), loaded.step()];
        let [here, there] =
            done.map(|done| done.map(|report| report.step).map_err(|error| error.to_string()));
        ensure(here == there, || format!("after loading: {there:?}, without: {here:?}"))?;
        ensure(everything(&loaded)? == everything(simulation)?, || {
            format!("{step} steps after loading the state is another")
        })?;
        if here.is_err() {
            break;
        }
    }
    Ok(())
}
