//! A rigid tool and one deformable body between two steps: contact with the body's own compliance, the
//! tool's pose being given.
//!
//! The body is as the last step left it and moves by what the change of the tool's forces does, after
//! [`Patch`]; the laws of the contacts, and what becomes one, are those of the step. Each call begins
//! with the forces, and with the surface, of the last one.

use glam::{DMat3, DVec3};
use palpate_contact::{PairKind, PenetratingNode, ProximityPair};
use palpate_geometry::Point;
use palpate_model::Model;

use super::filter::{BodyView, Candidate, Detected, Filter};
use super::law::Law;
use super::problem::{Block, principal_axes};
use super::{Contact, ContactParameters, Patch, Surface, side};
use crate::error::MechanicsError;
use crate::state::ContactForce;

/// Pairs closer than this count, in contact distances.
const CLOSE: f64 = 1.5;
/// Sweeps over all contacts, and changes of a force, at most: they bound the time.
const SWEEPS: usize = 12;
const CHANGES: usize = 1500;
/// Sweeps end when no contact is farther than this from its laws, in contact distances.
const TOLERANCE: f64 = 1e-4;

/// A contact of the last call.
#[derive(Clone, Copy, Debug)]
struct Remembered {
    key: Key,
    /// On side a [N].
    force: DVec3,
    /// Slip that a contact which sticks has not undone yet [m].
    slip: DVec3,
}

/// Kind, bodies and nodes tell contacts apart.
type Key = (bool, [u32; 2], [u32; 4]);

/// The nodes of the deformable body that a contact holds.
#[derive(Clone, Copy, Debug, Default)]
struct Corners {
    slots: [(u32, f64); 4],
    count: usize,
}

impl Corners {
    fn get(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.slots[..self.count].iter().map(|&(slot, weight)| (slot as usize, weight))
    }
}

/// The contacts of a tool with one body. Keeps its memory.
pub struct Touch {
    bodies: [usize; 2],
    /// Which of the two is the tool.
    tool: usize,
    surfaces: [Surface; 2],
    parameters: [ContactParameters; 2],
    time_step: f64,
    filter: Filter,
    candidates: Vec<Candidate>,
    corners: Vec<Corners>,
    blocks: Vec<Block>,
    laws: Vec<Law>,
    forces: Vec<DVec3>,
    last: Vec<Remembered>,
    /// Displacements of the patch by the tool's forces: of the step, of the last call, of this one.
    published: Vec<f32>,
    before: Vec<f32>,
    moved: Vec<f32>,
}

impl Touch {
    /// For body `organ` and rigid body `tool` of a model that is stepped by `time_step` [s].
    ///
    /// # Errors
    /// If a contact parameter is out of range.
    ///
    /// # Panics
    /// If there are no such bodies.
    pub fn new(
        model: &Model,
        tool: usize,
        organ: usize,
        time_step: f64,
    ) -> Result<Self, MechanicsError> {
        let bodies = [tool.min(organ), tool.max(organ)];
        let [first, second] = bodies.map(|body| &model.bodies[body]);
        Ok(Self {
            bodies,
            tool: usize::from(tool > organ),
            surfaces: [Surface::new(&first.mesh), Surface::new(&second.mesh)],
            parameters: [
                ContactParameters::new(bodies[0], first)?,
                ContactParameters::new(bodies[1], second)?,
            ],
            time_step,
            filter: Filter::default(),
            candidates: Vec::new(),
            corners: Vec::new(),
            blocks: Vec::new(),
            laws: Vec::new(),
            forces: Vec::new(),
            last: Vec::new(),
            published: Vec::new(),
            before: Vec::new(),
            moved: Vec::new(),
        })
    }

    /// The two bodies by their number in the model, ascending: they are bodies 0 and 1 here.
    pub fn bodies(&self) -> [usize; 2] {
        self.bodies
    }

    /// Which of them is the tool.
    pub fn tool(&self) -> usize {
        self.tool
    }

    /// Pairs within this distance are asked for [m].
    pub fn search_distance(&self) -> f64 {
        CLOSE * self.parameters[0].distance(&self.parameters[1])
    }

    /// Mean edge of the deformable body's surface [m].
    pub fn mean_edge(&self) -> f64 {
        self.parameters[1 - self.tool].mean_edge
    }

    /// Begins with the state that a step has left: `contacts` are all that it found.
    pub fn begin(&mut self, patch: &Patch, contacts: &[Contact]) {
        self.last.clear();
        self.published.clear();
        self.published.resize(patch.moved_len(), 0.0);
        let to_frame = patch.frame().transpose();
        let bodies = self.bodies.map(|body| body as u32);
        for contact in contacts {
            let Some(sides) = local(contact.bodies, bodies) else { continue };
            let force = DVec3::from_array(contact.force());
            let key = (contact.kind == PairKind::EdgeEdge, sides, contact.nodes);
            self.last.push(Remembered { key, force, slip: DVec3::ZERO });
            for corner in 0..4 {
                let here = sides[side(contact.kind, corner)] as usize != self.tool;
                let slot = if here { patch.slot(contact.nodes[corner]) } else { None };
                if let Some(slot) = slot {
                    let load = contact.weights[corner] * (to_frame * force);
                    patch.add_forces(&[(slot, load)], &mut self.published);
                }
            }
        }
        self.last.sort_unstable_by_key(|contact| contact.key);
        self.before.clone_from(&self.published);
        self.moved.clone_from(&self.published);
    }

    /// Finds the contact forces now that the tool is elsewhere.
    ///
    /// `positions` are those of both bodies, the deformable one's as [`Touch::deform`] has left them,
    /// `tool_before` the tool's in the last call, or in the step; `proximity` holds every pair, or local minimum, within
    /// [`Touch::search_distance`] at the present positions, `penetration` every surface node inside the other
    /// body.
    ///
    /// # Panics
    /// If a pair names a body or node that does not exist.
    pub fn respond(
        &mut self,
        patch: &Patch,
        positions: [&[Point]; 2],
        tool_before: &[Point],
        proximity: &[ProximityPair],
        penetration: &[PenetratingNode],
    ) {
        self.find(positions, proximity, penetration);
        self.assemble(patch, positions[self.tool], tool_before);
        self.solve(patch);
        self.remember(patch);
    }

    fn find(
        &mut self,
        positions: [&[Point]; 2],
        proximity: &[ProximityPair],
        penetration: &[PenetratingNode],
    ) {
        let Self { filter, surfaces, parameters, candidates, last, .. } = self;
        let view = |body: u32| BodyView {
            surface: &surfaces[body as usize],
            parameters: &parameters[body as usize],
            positions: positions[body as usize],
        };
        let is_loaded = |pair: &ProximityPair| {
            let key = (pair.kind == PairKind::EdgeEdge, pair.bodies, pair.nodes);
            last.binary_search_by_key(&key, |contact| contact.key).is_ok()
        };
        candidates.clear();
        filter.run(
            Detected { proximity, penetration },
            view,
            is_loaded,
            self.time_step,
            None,
            candidates,
        );
        let reach = self.search_distance();
        self.candidates.retain(|candidate| candidate.gap < reach);
    }

    fn assemble(&mut self, patch: &Patch, tool: &[Point], tool_before: &[Point]) {
        let frame = patch.frame();
        self.corners.clear();
        self.blocks.clear();
        self.laws.clear();
        self.forces.clear();
        for candidate in &self.candidates {
            let mut corners = Corners::default();
            let mut slip = DVec3::ZERO;
            for corner in 0..4 {
                let (node, weight) = (candidate.nodes[corner], candidate.weights[corner]);
                if candidate.bodies[side(candidate.kind, corner)] as usize == self.tool {
                    let [now, before] = [tool, tool_before].map(|x| x[node as usize]);
                    slip += weight * (DVec3::from_array(now) - DVec3::from_array(before));
                } else if let Some(slot) = patch.slot(node).filter(|_| weight != 0.0) {
                    corners.slots[corners.count] = (slot as u32, weight);
                    corners.count += 1;
                }
            }
            let mut own = DMat3::ZERO;
            let mut before = DVec3::ZERO;
            for (slot, weight) in corners.get() {
                before += weight * patch.moved(slot, &self.before).as_dvec3();
                for (other, other_weight) in corners.get() {
                    own += weight * other_weight * patch.entry(slot, other);
                }
            }
            let own = frame * own * frame.transpose();
            let axes = principal_axes(candidate.normal, own);
            let known = find(&self.last, candidate);
            // The gap is that of where the surface was after the last call; along it the tool has slipped.
            slip += known.map_or(DVec3::ZERO, |known| known.slip);
            slip -= candidate.normal * candidate.normal.dot(slip);
            let free = axes.transpose() * (slip - frame * before);
            let block = Block::alone(axes, free, axes.transpose() * own * axes);
            let law = Law::new(candidate, &block);
            let guess = known.map_or(DVec3::ZERO, |known| axes.transpose() * known.force);
            self.forces.push(law.admissible(guess));
            self.corners.push(corners);
            self.blocks.push(block);
            self.laws.push(law);
        }
    }

    fn solve(&mut self, patch: &Patch) {
        let count = self.candidates.len();
        self.moved.fill(0.0);
        for contact in 0..count {
            self.load(patch, contact, self.forces[contact]);
        }
        let sweeps = SWEEPS.min(CHANGES / count.max(1)).max(1);
        for _ in 0..sweeps {
            let mut worst = 0.0_f64;
            for contact in 0..count {
                let force = self.forces[contact];
                let moved = self.displacement(patch, contact);
                let violation = self.laws[contact].violation(force, moved);
                worst = worst.max(violation);
                if violation > 0.5 * TOLERANCE {
                    let answer = self.laws[contact].answer(force, moved);
                    if answer != force {
                        self.load(patch, contact, answer - force);
                        self.forces[contact] = answer;
                    }
                }
            }
            if worst <= TOLERANCE {
                break;
            }
        }
    }

    /// Displacement of a contact along its axes by all forces [m].
    fn displacement(&self, patch: &Patch, contact: usize) -> DVec3 {
        let corners = self.corners[contact].get();
        let sum: DVec3 =
            corners.map(|(slot, w)| w * patch.moved(slot, &self.moved).as_dvec3()).sum();
        self.blocks[contact].axes.transpose() * (patch.frame() * sum)
    }

    /// Adds to the displacements what a force along the axes of a contact does.
    fn load(&mut self, patch: &Patch, contact: usize, force: DVec3) {
        if force == DVec3::ZERO {
            return;
        }
        let force = patch.frame().transpose() * (self.blocks[contact].axes * force);
        let mut loads = [(0, DVec3::ZERO); 4];
        let corners = &self.corners[contact];
        for (load, (slot, weight)) in loads.iter_mut().zip(corners.get()) {
            *load = (slot, weight * force);
        }
        patch.add_forces(&loads[..corners.count], &mut self.moved);
    }

    fn remember(&mut self, patch: &Patch) {
        self.last.clear();
        for (contact, candidate) in self.candidates.iter().enumerate() {
            let (force, axes) = (self.forces[contact], self.blocks[contact].axes);
            if force.x <= 0.0 {
                continue;
            }
            let sticks = force.y.hypot(force.z) < candidate.friction * force.x * (1.0 - 1e-9);
            let mut slip = DVec3::ZERO;
            if sticks {
                let left = self.blocks[contact].free + self.displacement(patch, contact);
                slip = axes * DVec3::new(0.0, left.y, left.z);
            }
            self.last.push(Remembered { key: key(candidate), force: axes * force, slip });
        }
        self.last.sort_unstable_by_key(|contact| contact.key);
        self.before.clone_from(&self.moved);
    }

    /// Contacts that carry a force.
    pub fn contact_count(&self) -> usize {
        self.last.len()
    }

    /// The contact forces of the last call or, before the first one, of the step.
    pub fn contacts(&self) -> impl Iterator<Item = ContactForce> {
        let loaded = self.candidates.iter().zip(&self.forces).zip(&self.blocks);
        loaded.filter(|((_, force), _)| force.x > 0.0).map(|((candidate, force), block)| {
            ContactForce {
                edges: candidate.kind == PairKind::EdgeEdge,
                bodies: candidate.bodies,
                nodes: candidate.nodes,
                weights: candidate.weights,
                force: (block.axes * *force).to_array(),
            }
        })
    }

    /// Force on the tool [N], and its torque about `origin` [N m], the tool's nodes being at `tool`.
    pub fn tool_force(&self, tool: &[Point], origin: DVec3) -> [DVec3; 2] {
        let (mut sum, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        for contact in self.contacts() {
            for corner in 0..4 {
                if contact.body_of(corner) == self.tool {
                    let at = DVec3::from_array(tool[contact.nodes[corner] as usize]);
                    let force = contact.weights[corner] * DVec3::from_array(contact.force);
                    sum += force;
                    torque += (at - origin).cross(force);
                }
            }
        }
        [sum, torque]
    }

    /// Moves the nodes of the patch from where the step left them, `published`, to where the forces of
    /// the last call have them.
    pub fn deform(&self, patch: &Patch, published: &[Point], positions: &mut [Point]) {
        for (slot, &node) in patch.nodes().iter().enumerate() {
            let moved = patch.moved(slot, &self.moved) - patch.moved(slot, &self.published);
            let moved = patch.frame() * moved.as_dvec3();
            let x = DVec3::from_array(published[node as usize]) + moved;
            positions[node as usize] = x.to_array();
        }
    }
}

/// Bodies of a contact as 0 and 1; `None` if it is one of others.
fn local(contact: [u32; 2], bodies: [u32; 2]) -> Option<[u32; 2]> {
    let place = |body: u32| bodies.iter().position(|&other| other == body).map(|at| at as u32);
    let sides = [place(contact[0])?, place(contact[1])?];
    (sides[0] != sides[1]).then_some(sides)
}

fn key(candidate: &Candidate) -> Key {
    (candidate.kind == PairKind::EdgeEdge, candidate.bodies, candidate.nodes)
}

fn find<'a>(last: &'a [Remembered], candidate: &Candidate) -> Option<&'a Remembered> {
    let place = last.binary_search_by_key(&key(candidate), |contact| contact.key).ok()?;
    Some(&last[place])
}
