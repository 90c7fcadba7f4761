//! A tool that feels tissue a thousand times a second, while the simulation takes its steps in another
//! thread.
//!
//! After every step the simulation publishes where the bodies near the tool are and how their nodes there
//! answer forces (compliance from half solutions of their matrices). A tick finds what the tool touches
//! where it is now, and solves for the contact forces with that compliance: the contact problem of a
//! step, of one tool, between steps. See Saupin, Duriez and Cotin, Contact model for haptic medical
//! simulations, ISBMS 2008, for haptic rendering with the compliance of a slower simulation.

pub(crate) mod exchange;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_contact::{PenetratingNode, Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_mechanics::{MechanicsError, Touch};
use palpate_model::{Model, Pose};

use crate::simulation::{CONTACT_PAIRS, SimulationError};
use exchange::{Exchange, Publication};

/// What a tool feels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolForce {
    /// Force of all contacts on the tool [N].
    pub force: Point,
    /// Their torque about where the origin of its mesh file is [N m].
    pub torque: Point,
    /// Contacts that carry a force.
    pub contacts: usize,
    /// The step whose outcome the tick has worked on.
    pub step: u64,
}

/// The tool and one body that it can touch.
struct Pair {
    scene: Scene,
    touch: Touch,
    /// Nodes of the body, moved by what the tool does [m].
    positions: Vec<Point>,
    /// Copy of the search: the scene's own list is gone when it searches for close pairs.
    penetration: Vec<PenetratingNode>,
}

/// A loop around one tool, made by [`crate::Simulation::tool_loop`], for a thread of its own.
///
/// Ticks depend on nothing but the poses and what the simulation has published: the same sequence gives
/// the same bits. At steady state a tick allocates nothing.
pub struct ToolLoop {
    exchange: Arc<Exchange>,
    tool: usize,
    time_step: f64,
    model: Arc<Model>,
    pairs: Vec<Pair>,
    current: Option<Publication>,
    /// Nodes of the tool now and in the last tick [m].
    now: Vec<Point>,
    before: Vec<Point>,
}

impl ToolLoop {
    pub(crate) fn new(
        model: Arc<Model>,
        tool: usize,
        time_step: f64,
        exchange: Arc<Exchange>,
    ) -> Result<Self, SimulationError> {
        let pairs = pairs(&model, tool, time_step)?;
        let now = model.bodies[tool].mesh.nodes().to_vec();
        let before = now.clone();
        Ok(Self { exchange, tool, time_step, model, pairs, current: None, now, before })
    }

    /// Index of the tool's body.
    pub fn tool(&self) -> usize {
        self.tool
    }

    /// Moves the tool and returns what it feels there. `rotation` (made a unit) and `translation` [m] are as in
    /// [`crate::Simulation::set_pose`]; the simulation takes the newest pose when its next step begins.
    ///
    /// # Errors
    /// If a number is not finite or the rotation is zero; the tool has not moved then.
    pub fn tick(
        &mut self,
        rotation: DQuat,
        translation: Point,
    ) -> Result<ToolForce, SimulationError> {
        let unit = rotation.normalize();
        if !unit.is_finite() {
            return Err(MechanicsError::Rotation.into());
        }
        if !translation.iter().all(|x| x.is_finite()) {
            return Err(MechanicsError::Target.into());
        }
        let fresh = self.exchange.meet((unit, translation), &mut self.current);
        if fresh {
            self.take_over()?;
        }
        std::mem::swap(&mut self.now, &mut self.before);
        if fresh && let Some(publication) = &self.current {
            self.before.clone_from(&publication.tool);
        }
        self.place(unit, translation);
        self.feel(DVec3::from_array(translation))
    }

    /// Puts the nodes of the tool where a pose has them.
    fn place(&mut self, rotation: DQuat, translation: Point) {
        let body = &self.model.bodies[self.tool];
        let pivot = body.rigid.as_ref().map_or([0.0; 3], |motion| motion.pivot);
        let shift = DVec3::from_array(translation) - rotation * DVec3::from_array(pivot);
        let pose = Pose::from_rotation_translation(rotation, shift);
        for (node, &rest) in self.now.iter_mut().zip(body.mesh.nodes()) {
            *node = pose.apply(rest);
        }
    }

    /// Begins with what was published.
    fn take_over(&mut self) -> Result<(), SimulationError> {
        let Some(publication) = &self.current else { return Ok(()) };
        if let Some(model) = publication.model.as_ref().filter(|new| !Arc::ptr_eq(new, &self.model))
        {
            let same = model.bodies.len() == self.model.bodies.len()
                && (model.bodies.iter().zip(&self.model.bodies))
                    .all(|(new, old)| Arc::ptr_eq(&new.mesh, &old.mesh));
            if !same {
                self.pairs = pairs(model, self.tool, self.time_step)?;
            }
            self.model = Arc::clone(model);
        }
        for (pair, organ) in self.pairs.iter_mut().zip(&publication.organs) {
            if organ.is_near {
                pair.touch.begin(&organ.patch, &publication.contacts);
                pair.positions.clone_from(&organ.positions);
            }
        }
        Ok(())
    }

    fn feel(&mut self, origin: DVec3) -> Result<ToolForce, SimulationError> {
        let Some(publication) = &self.current else { return Ok(ToolForce::default()) };
        let (mut force, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        let mut contacts = 0;
        for (pair, organ) in self.pairs.iter_mut().zip(&publication.organs) {
            if !organ.is_near {
                continue;
            }
            pair.respond(organ, &self.now, &self.before)?;
            let [f, t] = pair.touch.tool_force(&self.now, origin);
            force += f;
            torque += t;
            contacts += pair.touch.contact_count();
        }
        let (force, torque) = (force.to_array(), torque.to_array());
        Ok(ToolForce { force, torque, contacts, step: publication.step })
    }
}

impl Pair {
    fn respond(
        &mut self,
        organ: &exchange::Organ,
        now: &[Point],
        before: &[Point],
    ) -> Result<(), SimulationError> {
        let Self { scene, touch, positions, penetration } = self;
        let tool = touch.tool();
        let at = |body: usize| if body == tool { now } else { positions.as_slice() };
        scene.update_from(at)?;
        penetration.clone_from(&scene.penetration(&|a, b| a != b).nodes);
        let distance = touch.search_distance();
        let close = |a: usize, b: usize| (a != b).then_some(distance);
        let proximity = scene.proximity_with(&close, &CONTACT_PAIRS);
        touch.respond(&organ.patch, [at(0), at(1)], before, &proximity.pairs, penetration);
        touch.deform(&organ.patch, &organ.positions, positions);
        Ok(())
    }
}

/// The tool with each deformable body, in the order of the model.
fn pairs(model: &Model, tool: usize, time_step: f64) -> Result<Vec<Pair>, SimulationError> {
    let organs = (0..model.bodies.len()).filter(|&body| model.bodies[body].rigid.is_none());
    organs
        .map(|organ| {
            let touch = Touch::new(model, tool, organ, time_step)?;
            let meshes = touch.bodies().map(|body| Arc::clone(&model.bodies[body].mesh)).to_vec();
            let scene = Scene::new(meshes, None, SceneOptions::default())?;
            let positions = model.bodies[organ].mesh.nodes().to_vec();
            Ok(Pair { scene, touch, positions, penetration: Vec::new() })
        })
        .collect()
}
