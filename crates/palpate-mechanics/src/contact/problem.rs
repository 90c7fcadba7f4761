//! The contact problem of a step in the space of contact forces.
//!
//! With implicit penalty the step minimises `|x - x_free|²_A / 2 + sum of penalty energies`. Its
//! dual has one unknown force per contact and direction: `(D + W) lambda = s` over the contacts that
//! push, with `W = J P J^T` from half solutions. It is small and well conditioned however stiff
//! the penalty is, and forces J^T lambda are equal and opposite exactly, converged or not.
//!
//! W is never put together: contacts couple through the bodies that they share, each in its frame.

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3, Mat3, Vec3};
use palpate_geometry::Point;
use rayon::prelude::*;

use super::coupling::{Corners, Coupling};
use super::filter::Candidate;
use super::node_compliance::NodeCompliance;
use super::side;
use crate::body::{ElasticBody, MovingBody};

/// Contacts whose equations are worth a task of their own.
const CONTACTS_PER_TASK: usize = 64;

/// One of the deformable bodies that a contact is on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    body: u32,
    /// Which of the body's contacts this is.
    contact: u32,
    /// Axes of the contact in the frame of the body.
    axes: Mat3,
}

/// The equations of one candidate: along its normal and, with friction, along two tangents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// Normal and two tangents, along which the contact's own response is uncoupled.
    pub(crate) axes: DMat3,
    /// Relative displacement of the step along the axes under the expected contact forces [m].
    pub(crate) free: DVec3,
    /// Response of the contact to its own force, along the axes [m/N].
    pub(super) own: DMat3,
    places: [Place; 2],
    place_count: u32,
}

impl Block {
    /// A block that belongs to no problem.
    pub(super) fn alone(axes: DMat3, free: DVec3, own: DMat3) -> Self {
        Self { axes, free, own, places: [Place::default(); 2], place_count: 0 }
    }

    /// Writes the equations of a candidate whose places are known.
    fn fill<'a>(
        &mut self,
        candidate: &Candidate,
        bodies: &[BodyPart],
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        let mut own = DMat3::ZERO;
        for place in self.places() {
            let coupling = &bodies[place.body as usize].coupling;
            let frame = frame(body(place.body as usize));
            own += frame * coupling.own(place.contact) * frame.transpose();
        }
        self.axes = principal_axes(candidate.normal, own);
        self.own = self.axes.transpose() * own * self.axes;
        self.free = self.axes.transpose() * expected_displacement(candidate, &body);
        for place in &mut self.places[..self.place_count as usize] {
            let axes = frame(body(place.body as usize)).transpose() * self.axes;
            place.axes = axes.as_mat3();
        }
    }

    fn places(&self) -> &[Place] {
        &self.places[..self.place_count as usize]
    }
}

/// Part of the problem that belongs to one body.
#[derive(Debug, Default)]
struct BodyPart {
    /// Nodes that contacts of this step or of the last one can move, ascending.
    nodes: Vec<u32>,
    is_contact: Vec<bool>,
    coupling: Coupling,
    to_frame: DMat3,
    /// Where the displacements of its contacts begin.
    first: usize,
}

/// Equations and compliance of the contact problem. Keeps its memory.
#[derive(Debug, Default)]
pub(crate) struct Problem {
    bodies: Vec<BodyPart>,
    blocks: Vec<Block>,
    moved_len: usize,
}

impl Problem {
    /// Collects the nodes of the candidates and of the expected forces, body by body.
    pub(crate) fn collect<'a>(
        &mut self,
        candidates: &[Candidate],
        body_count: usize,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        self.bodies.resize_with(body_count, BodyPart::default);
        for (index, part) in self.bodies.iter_mut().enumerate() {
            part.nodes.clear();
            part.is_contact.clear();
            part.is_contact.resize(body(index).positions.len(), false);
        }
        let mut add = |index: usize, node: u32, weight: f64| {
            let part = &mut self.bodies[index];
            if weight != 0.0 && !part.is_contact[node as usize] && gives_way(body(index), node) {
                part.is_contact[node as usize] = true;
                part.nodes.push(node);
            }
        };
        for c in candidates {
            for corner in 0..4 {
                let index = c.bodies[side(c.kind, corner)] as usize;
                add(index, c.nodes[corner], c.weights[corner]);
            }
        }
        for index in 0..body_count {
            for (node, _) in body(index).expected_forces() {
                add(index, node, 1.0);
            }
        }
        for part in &mut self.bodies {
            part.nodes.sort_unstable();
        }
    }

    /// Goes on with another body, between some nodes of which the compliance is known; contacts are likely to
    /// move `nodes`.
    pub(crate) fn change_body(&mut self, body: usize, compliance: NodeCompliance, nodes: Vec<u32>) {
        if let Some(part) = self.bodies.get_mut(body) {
            part.nodes = nodes;
            part.coupling.change_body(compliance);
        }
    }

    /// Nodes of a body that contacts of this step or the last one can move, ascending; none before the first.
    pub(crate) fn nodes(&self, body: usize) -> &[u32] {
        self.bodies.get(body).map_or(&[], |part| &part.nodes)
    }

    /// Writes the equations of the candidates. The compliance of all nodes must be prepared.
    pub(crate) fn assemble<'a>(
        &mut self,
        candidates: &[Candidate],
        pool: Option<&rayon::ThreadPool>,
        body: impl Fn(usize) -> &'a MovingBody + Sync,
    ) {
        self.place_contacts(candidates, &body);
        let fill = |(index, part): (usize, &mut BodyPart)| {
            if !part.nodes.is_empty() {
                part.assemble(body(index));
            }
        };
        match pool {
            Some(pool) => pool.install(|| self.bodies.par_iter_mut().enumerate().for_each(fill)),
            None => self.bodies.iter_mut().enumerate().for_each(fill),
        }
        self.moved_len = 0;
        for part in &mut self.bodies {
            part.first = self.moved_len;
            self.moved_len += part.coupling.moved_len();
        }
        let Self { bodies, blocks, .. } = self;
        let fill = |(block, candidate): (&mut Block, &Candidate)| {
            block.fill(candidate, bodies, &body);
        };
        match pool {
            Some(pool) => pool.install(|| {
                let each = blocks.par_iter_mut().zip(candidates).with_min_len(CONTACTS_PER_TASK);
                each.for_each(fill);
            }),
            None => blocks.iter_mut().zip(candidates).for_each(fill),
        }
    }

    /// Tells every body which contacts are on it.
    fn place_contacts<'a>(
        &mut self,
        candidates: &[Candidate],
        body: &impl Fn(usize) -> &'a MovingBody,
    ) {
        for part in &mut self.bodies {
            part.coupling.clear();
        }
        self.blocks.clear();
        for c in candidates {
            let mut block = Block {
                axes: DMat3::IDENTITY,
                free: DVec3::ZERO,
                own: DMat3::ZERO,
                places: [Place::default(); 2],
                place_count: 0,
            };
            let bodies = if c.bodies[0] == c.bodies[1] { &c.bodies[..1] } else { &c.bodies[..] };
            for &index in bodies {
                let mut corners = Corners::default();
                for corner in 0..4 {
                    let (node, weight) = (c.nodes[corner], c.weights[corner]);
                    let here = c.bodies[side(c.kind, corner)] == index;
                    if here && weight != 0.0 && gives_way(body(index as usize), node) {
                        corners.push(node, weight);
                    }
                }
                if !corners.is_empty() {
                    let contact = self.bodies[index as usize].coupling.push(corners);
                    block.places[block.place_count as usize] =
                        Place { body: index, contact, axes: Mat3::IDENTITY };
                    block.place_count += 1;
                }
            }
            self.blocks.push(block);
        }
    }

    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Displacement of a contact along its axes beyond the expected one [m].
    pub(super) fn moved(&self, block: &Block, moved: &[f32]) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for place in block.places() {
            let part = &self.bodies[place.body as usize];
            let own = part.coupling.moved(place.contact, &moved[part.first..]);
            sum += place.axes.transpose() * own;
        }
        sum
    }

    /// Writes the displacements that forces along the axes of all contacts bring about beyond those of the
    /// expected forces. `loads` is memory.
    pub(super) fn find_moved(
        &self,
        forces: &[DVec3],
        loads: &mut Vec<DVec3>,
        moved: &mut Vec<f32>,
    ) {
        moved.clear();
        moved.resize(self.moved_len, 0.0);
        loads.clear();
        loads.resize(self.moved_len / 3, DVec3::ZERO);
        let parts = || self.bodies.iter().filter(|part| !part.nodes.is_empty());
        for part in parts() {
            part.coupling.begin_loads(&mut loads[part.slots()]);
        }
        for (block, &force) in self.blocks.iter().zip(forces).filter(|(_, f)| **f != DVec3::ZERO) {
            for place in block.places() {
                let part = &self.bodies[place.body as usize];
                let force = part.to_frame * (block.axes * force);
                part.coupling.add_load(place.contact, force, &mut loads[part.slots()]);
            }
        }
        for part in parts() {
            let moved = &mut moved[part.first..][..part.coupling.moved_len()];
            part.coupling.add_loads(&part.nodes, &loads[part.slots()], moved);
        }
    }

    /// Adds to the displacements what a force along the axes of a contact does [N].
    pub(super) fn add_force(&self, block: &Block, force: Vec3, moved: &mut [f32]) {
        for place in block.places() {
            let part = &self.bodies[place.body as usize];
            let moved = &mut moved[part.first..][..part.coupling.moved_len()];
            part.coupling.add_force(place.contact, place.axes * force, moved);
        }
    }

    /// A problem of given W, three rows per contact, and free displacements along the axes.
    #[cfg(test)]
    pub(super) fn with_compliance(compliance: &[f64], free: &[DVec3]) -> Self {
        let rows = 3 * free.len();
        let nodes = NodeCompliance::with_entries(free.len(), |moved, loaded| {
            std::array::from_fn(|e| {
                compliance[(3 * moved + e % 3) * rows + 3 * loaded + e / 3] as f32
            })
        });
        let coupling = Coupling::with_nodes(nodes, free.len());
        let block = |(index, &free): (usize, &DVec3)| {
            let place = Place { body: 0, contact: index as u32, axes: Mat3::IDENTITY };
            Block {
                axes: DMat3::IDENTITY,
                free,
                own: coupling.own(index as u32),
                places: [place; 2],
                place_count: 1,
            }
        };
        let blocks = free.iter().enumerate().map(block).collect();
        let moved_len = coupling.moved_len();
        let to_frame = DMat3::IDENTITY;
        let nodes = (0..free.len() as u32).collect();
        let part = BodyPart { nodes, coupling, to_frame, ..BodyPart::default() };
        Self { blocks, bodies: vec![part], moved_len }
    }
}

impl BodyPart {
    /// Where the slots of its nodes are among all.
    fn slots(&self) -> Range<usize> {
        self.first / 3..(self.first + self.coupling.moved_len()) / 3
    }

    fn assemble(&mut self, body: &MovingBody) {
        let to_frame = frame(body).transpose();
        self.to_frame = to_frame;
        let is_contact = &self.is_contact;
        let forces = body.expected_forces().filter(|&(node, _)| is_contact[node as usize]);
        let forces = forces.map(|(node, force)| (node, to_frame * force));
        self.coupling.assemble(body, &self.nodes, forces);
    }
}

fn frame(body: &MovingBody) -> DMat3 {
    body.elastic().map_or(DMat3::IDENTITY, ElasticBody::frame)
}

/// Whether contact forces can move a node.
fn gives_way(body: &MovingBody, node: u32) -> bool {
    body.elastic().is_some_and(|elastic| elastic.is_free(node as usize))
}

/// The normal and the two tangents along which `own` is uncoupled.
pub(super) fn principal_axes(normal: DVec3, own: DMat3) -> DMat3 {
    let (first, second) = normal.any_orthonormal_pair();
    let (a, b, c) = (first.dot(own * first), second.dot(own * second), first.dot(own * second));
    // By the angle whose double has the direction (a - b, 2 c).
    let double = DVec2::new(a - b, 2.0 * c).normalize_or(DVec2::X);
    let cos = (0.5 * (1.0 + double.x.abs())).sqrt();
    let sin = 0.5 * double.y / cos;
    let (sin, cos) = if double.x >= 0.0 { (sin, cos) } else { (cos.copysign(sin), sin.abs()) };
    DMat3::from_cols(normal, cos * first + sin * second, cos * second - sin * first)
}

/// Relative displacement of the two sides in the step if contact forces stayed as they were [m].
pub(crate) fn expected_displacement<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
) -> DVec3 {
    displacement_to(candidate, body, |body| &body.expected_positions)
}

/// Relative displacement of the two sides in the step as it was computed last [m].
pub(crate) fn step_displacement<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
) -> DVec3 {
    displacement_to(candidate, body, |body| &body.next_positions)
}

fn displacement_to<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
    end: impl Fn(&'a MovingBody) -> &'a [Point],
) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for corner in 0..4 {
        let moving = body(candidate.bodies[side(candidate.kind, corner)] as usize);
        let node = candidate.nodes[corner] as usize;
        let moved =
            DVec3::from_array(end(moving)[node]) - DVec3::from_array(moving.positions[node]);
        sum += candidate.weights[corner] * moved;
    }
    sum
}
