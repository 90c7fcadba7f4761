//! Which contacts push, and how hard; how much they rub.
//!
//! Block Gauss-Seidel (nonsmooth contact dynamics, Jean 1999) gives contact after contact the force
//! that its own laws ask for, given all others. What is far from its laws is soon a small part of all
//! contacts, and each round dwells on it: that takes ten times fewer changes than full sweeps. Forces of
//! the last step are a good start, and what a bounded number of changes leaves, the next step corrects.

use glam::DVec3;

use super::filter::Candidate;
use super::law::Law;
use super::problem::{Block, Problem};

/// The first pass of a round changes contacts whose violation is at least this part of the largest.
const WORTHWHILE: f64 = 0.5;
/// The others dwell on those that had this part of it.
const NOTABLE: f64 = 0.25;
const MORE_PASSES: usize = 8;
/// What it costs to look at a contact, relative to changing its force.
const LOOK: f64 = 0.05;
/// Rounds at least: what rests must come to rest, however small the tolerance.
const MIN_ROUNDS: usize = 2;

/// How long to go on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Changes of a force per contact at most, looking at contacts counted by what it costs.
    pub(crate) changes: f64,
    /// Stop when no contact is farther than this from its laws, in contact distances.
    pub(crate) tolerance: f64,
}

impl Effort {
    /// For the first solve of a step: the only one of bodies at rest.
    pub(crate) const FIRST: Self = Self { changes: 8.0, tolerance: 1e-4 };
    /// For the others: tissue that needs them goes on by up to a contact distance after each.
    pub(crate) const AGAIN: Self = Self { tolerance: 3e-2, ..Self::FIRST };
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveCost {
    /// Rounds: passes over all contacts.
    pub(crate) rounds: usize,
    /// Contacts looked at.
    pub(crate) looks: usize,
    /// Forces changed.
    pub(crate) changes: usize,
    /// Largest violation of a contact's laws that is left, in contact distances.
    pub(crate) residual: f64,
}

/// Solver of contact problems. Keeps its memory.
#[derive(Default)]
pub(crate) struct GaussSeidel {
    laws: Vec<Law>,
    /// Force along the axes of each contact [N].
    forces: Vec<DVec3>,
    /// Displacements by all forces, as [`Problem`] has them [m].
    moved: Vec<f32>,
    /// Memory: forces on nodes.
    loads: Vec<DVec3>,
    /// Contacts that a round dwells on.
    notable: Vec<u32>,
}

impl GaussSeidel {
    /// Force of a contact along its axes [N].
    pub(crate) fn force(&self, contact: usize) -> DVec3 {
        self.forces[contact]
    }

    /// Displacement of a contact along its axes by all contact forces [m].
    pub(crate) fn moved(&self, problem: &Problem, block: &Block) -> DVec3 {
        problem.moved(block, &self.moved).as_dvec3()
    }

    /// Solves for the forces of all candidates, beginning with `guess` along their axes.
    pub(crate) fn solve(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        effort: Effort,
        guess: impl Fn(usize) -> DVec3,
    ) -> SolveCost {
        let blocks = problem.blocks();
        self.laws.clear();
        self.laws.extend(candidates.iter().zip(blocks).map(|(c, block)| Law::new(c, block)));
        self.forces.clear();
        let guesses = self.laws.iter().enumerate();
        self.forces.extend(guesses.map(|(index, law)| law.admissible(guess(index))));
        problem.find_moved(&self.forces, &mut self.loads, &mut self.moved);
        let mut cost = SolveCost::default();
        let budget = effort.changes * candidates.len() as f64;
        let mut violation = self.violation(problem);
        while cost.rounds < MIN_ROUNDS || violation > effort.tolerance {
            if cost.changes as f64 + LOOK * cost.looks as f64 >= budget {
                break;
            }
            violation = self.round(problem, violation, &mut cost);
        }
        cost.residual = self.violation(problem);
        cost
    }

    /// Looks at all contacts and dwells on those that are farthest from their laws; `last` is the
    /// largest violation of the round before. Returns that of this one.
    fn round(&mut self, problem: &Problem, last: f64, cost: &mut SolveCost) -> f64 {
        let mut largest = 0.0_f64;
        let mut notable = std::mem::take(&mut self.notable);
        notable.clear();
        for contact in 0..self.forces.len() {
            let violation = self.improve(problem, contact, WORTHWHILE * last, cost);
            largest = largest.max(violation);
            if violation >= NOTABLE * last {
                notable.push(contact as u32);
            }
        }
        for _ in 0..MORE_PASSES {
            for &contact in &notable {
                self.improve(problem, contact as usize, NOTABLE * last, cost);
            }
        }
        self.notable = notable;
        cost.rounds += 1;
        largest
    }

    /// Gives a contact the force that its laws ask for if it is at least `worthwhile` from them;
    /// returns how far it was.
    fn improve(
        &mut self,
        problem: &Problem,
        contact: usize,
        worthwhile: f64,
        cost: &mut SolveCost,
    ) -> f64 {
        let (block, law) = (&problem.blocks()[contact], &self.laws[contact]);
        let force = self.forces[contact];
        let moved = problem.moved(block, &self.moved).as_dvec3();
        let violation = law.violation(force, moved);
        cost.looks += 1;
        if violation >= worthwhile {
            let answer = law.answer(force, moved);
            if answer != force {
                problem.add_force(block, (answer - force).as_vec3(), &mut self.moved);
                self.forces[contact] = answer;
                cost.changes += 1;
            }
        }
        violation
    }

    /// Largest violation of a contact's laws, in contact distances.
    fn violation(&self, problem: &Problem) -> f64 {
        let contacts = problem.blocks().iter().zip(&self.laws).zip(&self.forces);
        contacts
            .map(|((block, law), &force)| {
                law.violation(force, problem.moved(block, &self.moved).as_dvec3())
            })
            .fold(0.0, f64::max)
    }
}
