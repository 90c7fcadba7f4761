//! Which contacts push, and how hard; how much they rub.
//!
//! Block Gauss-Seidel (nonsmooth contact dynamics, Jean 1999) gives contact after contact the force
//! that its own laws ask for, given all others. To look at a contact is cheap and to change its force
//! is not, so every pass looks at all contacts and changes those that are far from their laws: that
//! takes several times fewer changes than full sweeps. Forces of the last step are a good start, and
//! what a bounded number of changes leaves, the next step corrects.

use glam::DVec3;

use super::filter::Candidate;
use super::law::Law;
use super::problem::{Block, Problem};

/// A pass changes the contacts whose violation is at least this part of the largest.
const WORTHWHILE: f64 = 0.5;
/// What it costs to look at a contact, relative to changing its force.
const LOOK: f64 = 0.05;
/// Passes at least: what rests must come to rest, however small the tolerance.
const MIN_PASSES: usize = 2;

/// How long to go on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Changes of a force per contact at most.
    pub(crate) changes: f64,
    /// Stop when no contact is farther than this from its laws, in contact distances.
    pub(crate) tolerance: f64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { changes: 16.0, tolerance: 1e-3 }
    }
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveCost {
    /// Passes over all contacts.
    pub(crate) passes: usize,
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
        self.update_moved(problem);
        let mut cost = SolveCost::default();
        let budget = effort.changes * candidates.len() as f64;
        let mut violation = self.violation(problem);
        while cost.passes < MIN_PASSES || violation > effort.tolerance {
            let spent = cost.changes as f64 + LOOK * (cost.passes * candidates.len()) as f64;
            if spent >= budget {
                break;
            }
            violation = self.pass(problem, WORTHWHILE * violation, &mut cost);
        }
        cost.residual = self.violation(problem);
        cost
    }

    fn update_moved(&mut self, problem: &Problem) {
        self.moved.clear();
        self.moved.resize(problem.moved_len(), 0.0);
        for (block, force) in problem.blocks().iter().zip(&self.forces) {
            if *force != DVec3::ZERO {
                problem.add_force(block, force.as_vec3(), &mut self.moved);
            }
        }
    }

    /// Gives every contact in turn that is at least `worthwhile` from its laws the force that they ask
    /// for; returns the largest violation met.
    fn pass(&mut self, problem: &Problem, worthwhile: f64, cost: &mut SolveCost) -> f64 {
        let mut largest = 0.0_f64;
        for ((block, law), force) in problem.blocks().iter().zip(&self.laws).zip(&mut self.forces) {
            let moved = problem.moved(block, &self.moved).as_dvec3();
            let violation = law.violation(*force, moved);
            largest = largest.max(violation);
            if violation < worthwhile {
                continue;
            }
            let answer = law.answer(*force, moved);
            if answer != *force {
                problem.add_force(block, (answer - *force).as_vec3(), &mut self.moved);
                *force = answer;
                cost.changes += 1;
            }
        }
        cost.passes += 1;
        largest
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
