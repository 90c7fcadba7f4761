//! The contact stage of a step: candidates, forces, and the contacts that are reported.

use glam::DVec3;
use palpate_contact::{PairKind, ProximityPair};

use super::Contact;
use super::filter::{BodyView, Candidate, Detected, Filter};
use super::gauss_seidel::{Effort, GaussSeidel, SolveCost};
use super::last_forces::LastForces;
use super::node_compliance::NodeCompliance;
use super::problem::{Problem, expected_displacement, step_displacement};
use super::side;
use crate::body::MovingBody;
use crate::state::ContactForce;

/// A pair counts when the expected motion brings it closer than this, in contact distances.
const CLOSE: f64 = 1.5;
/// A pair that did not count was missed when it ends up closer than this, in contact distances.
const MISSED: f64 = 0.75;
/// Part by which the force of a contact differs from the last one where nothing has changed it, and the
/// difference of weights, in edges, up to which it then goes on acting where it did.
const SAME_FORCE: f64 = 1e-9;
const SAME_PLACE: f64 = 1e-5;

/// Contact detection to contact forces. Keeps its memory.
#[derive(Default)]
pub(crate) struct Response {
    filter: Filter,
    candidates: Vec<Candidate>,
    /// Pairs that the expected motion does not bring close enough to count.
    spare: Vec<Candidate>,
    problem: Problem,
    solver: GaussSeidel,
    contacts: Vec<Contact>,
    /// Those of the last step, while another one is under way.
    contacts_before: Vec<Contact>,
    /// Forces on all that the step has: contacts, and the ties, which come first among the candidates.
    forces: Vec<ContactForce>,
    ties: usize,
    last: LastForces,
    /// Forces found so far in this step, where the solve begins.
    guess: LastForces,
}

impl Response {
    /// With nodes (body, node, other body) that do not push the body that they are attached to.
    pub(crate) fn new(attached: Vec<(u32, u32, u32)>) -> Self {
        Self { filter: Filter::new(attached), ..Self::default() }
    }

    /// Begins a step with the ties that `add` writes.
    pub(crate) fn begin(&mut self, add: impl FnOnce(&mut Vec<Candidate>)) {
        self.candidates.clear();
        add(&mut self.candidates);
        self.ties = self.candidates.len();
    }

    /// Finds the contact candidates of the step that has begun, and the nodes that it moves.
    pub(crate) fn find<'a>(
        &mut self,
        detected: Detected<'_>,
        body_count: usize,
        time_step: f64,
        pool: Option<&rayon::ThreadPool>,
        body: impl Fn(usize) -> &'a MovingBody,
        view: impl Fn(usize) -> BodyView<'a> + Sync,
    ) {
        let view = |body: u32| view(body as usize);
        let (last, candidates) = (&self.last, &mut self.candidates);
        let is_loaded = |pair: &ProximityPair| last.holds(pair);
        self.filter.run(detected, view, is_loaded, time_step, pool, candidates);
        self.spare.clear();
        let spare = &mut self.spare;
        self.candidates.retain(|candidate| {
            if candidate.tied.is_some() {
                return true;
            }
            let moved = candidate.normal.dot(expected_displacement(candidate, &body));
            // Between lips that fit without pushing only those that are about to overlap: they are many.
            let reach = if candidate.offset > 0.0 { 1.0 } else { CLOSE };
            let close = candidate.gap.min(candidate.gap + moved) < reach * candidate.distance;
            if !close {
                spare.push(*candidate);
            }
            close
        });
        self.guess.clone_from(&self.last);
        self.problem.collect(&self.candidates, body_count, &body);
        std::mem::swap(&mut self.contacts, &mut self.contacts_before);
        self.contacts.clear();
    }

    /// Takes in the pairs that the step brought together although it was not expected; true if
    /// there are any, so that the forces must be solved again.
    pub(crate) fn take_missed<'a>(&mut self, body: impl Fn(usize) -> &'a MovingBody) -> bool {
        let known = self.candidates.len();
        let candidates = &mut self.candidates;
        self.spare.retain(|candidate| {
            let moved = candidate.normal.dot(step_displacement(candidate, &body));
            let missed = candidate.gap + moved < MISSED * candidate.distance;
            if missed {
                candidates.push(*candidate);
            }
            !missed
        });
        self.candidates.len() > known
    }

    /// Prepares another solve, that begins with the forces of the last one.
    pub(crate) fn begin_again<'a>(
        &mut self,
        body_count: usize,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        self.guess.restore(&self.forces);
        self.problem.collect(&self.candidates, body_count, &body);
        self.contacts.clear();
    }

    /// Possible contacts.
    pub(crate) fn candidate_count(&self) -> usize {
        self.candidates.len() - self.ties
    }

    /// Forces of contacts and ties that the step has found.
    pub(crate) fn forces(&self) -> &[ContactForce] {
        &self.forces
    }

    /// Force [N] of each tie on its side a, in the order in which they were added.
    pub(crate) fn tie_forces(&self) -> impl Iterator<Item = DVec3> {
        self.forces[..self.ties].iter().map(|tie| DVec3::from_array(tie.force))
    }

    pub(crate) fn problem(&self) -> &Problem {
        &self.problem
    }

    pub(crate) fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// Solves for the forces of the candidates; every compliance column must be prepared.
    pub(crate) fn solve<'a>(
        &mut self,
        effort: Effort,
        pool: Option<&rayon::ThreadPool>,
        body: impl Fn(usize) -> &'a MovingBody + Sync,
    ) -> SolveCost {
        if self.candidates.is_empty() {
            self.forces.clear();
            return SolveCost::default();
        }
        self.problem.assemble(&self.candidates, pool, &body);
        let (problem, candidates, known) = (&self.problem, &self.candidates, &self.guess);
        let guess = |index: usize| {
            let force = known.of(&candidates[index]).map_or([0.0; 3], |known| known.force);
            problem.blocks()[index].axes.transpose() * DVec3::from_array(force)
        };
        let cost = self.solver.solve(problem, candidates, effort, guess);
        self.report(body);
        cost
    }

    fn report<'a>(&mut self, body: impl Fn(usize) -> &'a MovingBody) {
        let blocks = self.problem.blocks();
        self.forces.clear();
        for (index, (candidate, block)) in self.candidates.iter().zip(blocks).enumerate() {
            let force = self.solver.force(index);
            let found = ContactForce {
                edges: candidate.kind == PairKind::EdgeEdge,
                bodies: candidate.bodies,
                nodes: candidate.nodes,
                weights: candidate.weights,
                force: (block.axes * force).to_array(),
            };
            // What nothing has changed stays the same bits: bodies at rest need not be solved for.
            let known = self.guess.of(candidate).filter(|known| is_same(known, &found));
            let found = *known.unwrap_or(&found);
            if candidate.tied.is_some() {
                self.forces.push(found);
                continue;
            }
            if force.x <= 0.0 {
                continue;
            }
            let mut point = DVec3::ZERO;
            for corner in 0..4 {
                let moving = body(candidate.bodies[side(candidate.kind, corner)] as usize);
                let position = moving.positions[candidate.nodes[corner] as usize];
                point += 0.5 * candidate.weights[corner].abs() * DVec3::from_array(position);
            }
            let total = DVec3::from_array(found.force);
            let normal_force = candidate.normal.dot(total);
            let friction = total - normal_force * candidate.normal;
            let contact = Contact {
                kind: candidate.kind,
                bodies: candidate.bodies,
                nodes: candidate.nodes,
                weights: found.weights,
                normal: candidate.normal.to_array(),
                point: point.to_array(),
                gap: candidate.gap - candidate.offset
                    + block.free.x
                    + self.solver.moved(&self.problem, block).x,
                normal_force,
                friction_force: friction.to_array(),
            };
            self.forces.push(found);
            self.contacts.push(contact);
        }
    }

    /// Keeps the forces of the step that ends for the next one.
    pub(crate) fn remember(&mut self) {
        self.last.restore(&self.forces);
    }

    /// Goes back to the contacts of the last step: this one has failed.
    pub(crate) fn undo(&mut self) {
        std::mem::swap(&mut self.contacts, &mut self.contacts_before);
    }

    /// Takes the contacts of another simulation of the same bodies for those of the last step.
    pub(crate) fn take_contacts(&mut self, contacts: &[Contact]) {
        self.contacts.clear();
        self.contacts.extend_from_slice(contacts);
    }

    /// Forces of the last step.
    pub(crate) fn last(&self) -> &LastForces {
        &self.last
    }

    /// Other nodes that are attached, as in [`Response::new`].
    pub(crate) fn set_attached(&mut self, attached: Vec<(u32, u32, u32)>) {
        self.filter = Filter::new(attached);
    }

    /// Goes on with another body: see [`Problem::change_body`].
    pub(crate) fn change_body(&mut self, body: usize, compliance: NodeCompliance, nodes: Vec<u32>) {
        self.problem.change_body(body, compliance, nodes);
        self.spare.clear();
    }

    /// Goes back to the forces of another step; no contacts are reported until the next one ends.
    pub(crate) fn restore(&mut self, forces: &[ContactForce]) {
        self.contacts.clear();
        self.last.restore(forces);
    }
}

/// Whether a contact has the force that it had, in the same place.
fn is_same(known: &ContactForce, found: &ContactForce) -> bool {
    let (a, b) = (DVec3::from_array(known.force), DVec3::from_array(found.force));
    let weights = known.weights.iter().zip(&found.weights);
    (a - b).length_squared() <= SAME_FORCE * SAME_FORCE * b.length_squared()
        && weights.map(|(a, b)| (a - b).abs()).all(|difference| difference <= SAME_PLACE)
}
