//! The contact stage of a step: candidates, forces, and the contacts that are reported.

use glam::DVec3;
use palpate_contact::{PenetratingNode, ProximityPair};
use palpate_solver::FactorError;

use super::Contact;
use super::active_set::{ActiveSet, SolveCost};
use super::filter::{BodyView, Candidate, Filter};
use super::problem::{Problem, free_displacement, step_displacement};
use super::side;
use crate::body::MovingBody;

/// A pair counts when free motion brings it closer than this, in contact distances.
const CLOSE: f64 = 1.5;
/// A pair that did not count was missed when it ends up closer than this, in contact distances.
const MISSED: f64 = 0.75;

/// Contact detection to contact forces. Keeps its memory.
#[derive(Default)]
pub(crate) struct Response {
    filter: Filter,
    candidates: Vec<Candidate>,
    /// Pairs that free motion does not bring close enough to count.
    spare: Vec<Candidate>,
    problem: Problem,
    active_set: ActiveSet,
    /// Candidates with friction that push.
    rubbing: Vec<u32>,
    contacts: Vec<Contact>,
}

impl Response {
    /// Finds this step's candidates and the nodes they touch.
    pub(crate) fn find<'a>(
        &mut self,
        proximity: &[ProximityPair],
        penetration: &[PenetratingNode],
        body_count: usize,
        time_step: f64,
        body: impl Fn(usize) -> &'a MovingBody,
        view: impl Fn(usize) -> BodyView<'a>,
    ) {
        let view = |body: u32| view(body as usize);
        self.filter.run(proximity, penetration, view, time_step, &mut self.candidates);
        self.spare.clear();
        let spare = &mut self.spare;
        self.candidates.retain(|candidate| {
            let moved = candidate.normal.dot(free_displacement(candidate, &body));
            let close = candidate.gap.min(candidate.gap + moved) < CLOSE * candidate.distance;
            if !close {
                spare.push(*candidate);
            }
            close
        });
        self.problem.collect(&self.candidates, body_count, &body);
        self.contacts.clear();
    }

    /// Takes in the pairs that the step brought together although free motion did not; true if
    /// there are any, so that the forces must be solved again.
    pub(crate) fn take_missed<'a>(
        &mut self,
        body_count: usize,
        body: impl Fn(usize) -> &'a MovingBody,
    ) -> bool {
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
        if self.candidates.len() == known {
            return false;
        }
        self.problem.collect(&self.candidates, body_count, &body);
        self.contacts.clear();
        true
    }

    pub(crate) fn candidate_count(&self) -> usize {
        self.candidates.len()
    }

    pub(crate) fn problem(&self) -> &Problem {
        &self.problem
    }

    pub(crate) fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    pub(crate) fn clear_contacts(&mut self) {
        self.contacts.clear();
    }

    /// Solves for the forces of the candidates; every compliance column must be prepared.
    pub(crate) fn solve<'a>(
        &mut self,
        body: impl Fn(usize) -> &'a MovingBody,
    ) -> Result<SolveCost, FactorError> {
        if self.candidates.is_empty() {
            return Ok(SolveCost::default());
        }
        self.problem.clear_rows();
        for (index, candidate) in self.candidates.iter().enumerate() {
            self.problem.push_row(index, candidate, candidate.normal, &body);
        }
        self.problem.assemble(&self.candidates, &body);
        let mut cost = self.active_set.solve_normals(&self.problem, &self.candidates)?;
        self.rubbing.clear();
        for (index, candidate) in self.candidates.iter().enumerate() {
            if candidate.friction > 0.0 && self.active_set.forces()[index] > 0.0 {
                self.rubbing.push(index as u32);
            }
        }
        if !self.rubbing.is_empty() {
            for &index in &self.rubbing {
                let candidate = &self.candidates[index as usize];
                let (first, second) = candidate.normal.any_orthonormal_pair();
                self.problem.push_row(index as usize, candidate, first, &body);
                self.problem.push_row(index as usize, candidate, second, &body);
            }
            self.problem.assemble(&self.candidates, &body);
            let more =
                self.active_set.solve_friction(&self.problem, &self.candidates, &self.rubbing);
            cost = SolveCost {
                systems: cost.systems + more.systems,
                rounds: cost.rounds + more.rounds,
                residual: more.residual,
            };
        }
        self.report(body);
        Ok(cost)
    }

    fn report<'a>(&mut self, body: impl Fn(usize) -> &'a MovingBody) {
        let forces = self.active_set.forces();
        let normals = self.candidates.len();
        let mut rubbing = self.rubbing.iter().enumerate().peekable();
        for (index, candidate) in self.candidates.iter().enumerate() {
            let mut friction = DVec3::ZERO;
            if let Some((place, _)) = rubbing.next_if(|&(_, &other)| other as usize == index) {
                let first = normals + 2 * place;
                friction = forces[first] * self.problem.rows()[first].direction
                    + forces[first + 1] * self.problem.rows()[first + 1].direction;
            }
            if forces[index] <= 0.0 {
                continue;
            }
            let mut point = DVec3::ZERO;
            for corner in 0..4 {
                let moving = body(candidate.bodies[side(candidate.kind, corner)] as usize);
                let position = moving.positions[candidate.nodes[corner] as usize];
                point += 0.5 * candidate.weights[corner].abs() * DVec3::from_array(position);
            }
            let moved = self.problem.rows()[index].free + self.active_set.moved(index);
            self.contacts.push(Contact {
                kind: candidate.kind,
                bodies: candidate.bodies,
                nodes: candidate.nodes,
                weights: candidate.weights,
                normal: candidate.normal.to_array(),
                point: point.to_array(),
                gap: candidate.gap + moved,
                normal_force: forces[index],
                friction_force: friction.to_array(),
            });
        }
    }
}
