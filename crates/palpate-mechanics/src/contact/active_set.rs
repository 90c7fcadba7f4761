//! Which contacts push, and how hard; how much they rub.
//!
//! Without friction: Newton's method on a piecewise linear problem: guess which contacts push, solve the linear system
//! of those, correct the guess from the gaps, until the guess is right.

use palpate_solver::{DenseCholesky, FactorError};

use super::filter::Candidate;
use super::problem::Problem;

/// Rounds of the Newton iteration before the fallback.
const MAX_ROUNDS: usize = 12;
/// Sweeps of Gauss-Seidel.
const MAX_SWEEPS: usize = 1_000;
/// Part of the contact distance in which the penalty is soft. Below it, and where the recovery is
/// limited, a contact is [`HARDENING`] times stiffer: surfaces must not pass through each other even
/// where all the load is on a few nodes, since an open surface would then push the wrong way.
const SOFT_PART: f64 = 0.5;
const HARDENING: f64 = 100.0;
/// Smallest softness of an equation relative to its own compliance: keeps the matrix regular.
const SOFTNESS_FLOOR: f64 = 1e-6;
/// Sweeps end when no force changes by more than this part of the largest one.
const SWEEP_TOLERANCE: f64 = 1e-7;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Off,
    /// Penalty force by the overlap.
    Elastic,
    /// The steeper penalty of a deep overlap.
    Hard,
    /// As hard as it takes to reach the recovery gap, which is less than the penalty.
    Recovering,
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveCost {
    /// Linear systems solved and Gauss-Seidel sweeps done.
    pub(crate) systems: usize,
    /// Rounds of guessing.
    pub(crate) rounds: usize,
    /// Residual of the last linear system relative to its right-hand side.
    pub(crate) residual: f64,
}

/// Solver of contact problems. Keeps its memory.
#[derive(Default)]
pub(crate) struct ActiveSet {
    modes: Vec<Mode>,
    next_modes: Vec<Mode>,
    /// Force of each row [N].
    forces: Vec<f64>,
    /// Displacement of each row by all forces [m].
    moved: Vec<f64>,
    active: Vec<u32>,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    dense: DenseCholesky,
}

impl ActiveSet {
    /// Forces of the rows [N].
    pub(crate) fn forces(&self) -> &[f64] {
        &self.forces
    }

    /// Displacement of a row by all contact forces [m].
    pub(crate) fn moved(&self, row: usize) -> f64 {
        self.moved[row]
    }

    /// Solves for normal forces: row i is the normal of candidate i.
    pub(crate) fn solve_normals(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
    ) -> Result<SolveCost, FactorError> {
        let count = candidates.len();
        self.reset(count);
        let mut cost = SolveCost::default();
        self.next_modes.clear();
        for row in 0..count {
            let (mode, _) = normal_law(problem, candidates, row, 0.0);
            self.next_modes.push(mode);
        }
        while self.modes != self.next_modes {
            if cost.rounds == MAX_ROUNDS {
                let (sweeps, residual) = self.sweep(problem, candidates, &[]);
                cost.systems += sweeps;
                cost.residual = residual;
                return Ok(cost);
            }
            self.modes.clone_from(&self.next_modes);
            cost.residual = self.solve_active(problem, candidates)?;
            cost.rounds += 1;
            cost.systems += usize::from(!self.active.is_empty());
            for row in 0..count {
                self.next_modes[row] = normal_law(problem, candidates, row, self.moved[row]).0;
            }
        }
        Ok(cost)
    }

    /// Solves for normal forces and friction, from the normal forces on: after the normals stand two
    /// tangents for each candidate in `rubbing`, in that order.
    ///
    /// Block Gauss-Seidel (nonsmooth contact dynamics, Jean 1999): contact after contact gets the
    /// force that its own law asks for, given all others. Slower than guessing sets, but Coulomb's
    /// law is no minimisation, and sets of sticking and sliding contacts cycle.
    pub(crate) fn solve_friction(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        rubbing: &[u32],
    ) -> SolveCost {
        self.forces.resize(problem.rows().len(), 0.0);
        self.moved.resize(problem.rows().len(), 0.0);
        self.update_moved(problem);
        let (sweeps, residual) = self.sweep(problem, candidates, rubbing);
        SolveCost { systems: sweeps, rounds: 1, residual }
    }

    fn reset(&mut self, count: usize) {
        self.modes.clear();
        self.forces.clear();
        self.forces.resize(count, 0.0);
        self.moved.clear();
        self.moved.resize(count, 0.0);
    }

    /// Solves the equations of the active rows and clears the other forces.
    fn solve_active(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
    ) -> Result<f64, FactorError> {
        self.active.clear();
        for (row, mode) in self.modes.iter().enumerate() {
            match mode {
                Mode::Elastic | Mode::Hard | Mode::Recovering => self.active.push(row as u32),
                Mode::Off => self.forces[row] = 0.0,
            }
        }
        let size = self.active.len();
        if size > 0 {
            self.matrix.clear();
            self.rhs.clear();
            for (place, &row) in self.active.iter().enumerate() {
                let row = row as usize;
                let compliance = problem.compliance_row(row);
                let (softness, target) = equation(problem, candidates, row, self.modes[row]);
                self.matrix.extend(self.active.iter().map(|&col| compliance[col as usize]));
                self.matrix[place * size + place] += softness;
                self.rhs.push(target);
            }
            self.dense.solve_in_place(&mut self.matrix, &mut self.rhs)?;
            for (&row, &force) in self.active.iter().zip(&self.rhs) {
                self.forces[row as usize] = force;
            }
        }
        self.update_moved(problem);
        Ok(self.residual(problem, candidates))
    }

    fn update_moved(&mut self, problem: &Problem) {
        for (row, moved) in self.moved.iter_mut().enumerate() {
            let pairs = problem.compliance_row(row).iter().zip(&self.forces);
            *moved = pairs.map(|(w, f)| w * f).sum();
        }
    }

    fn residual(&self, problem: &Problem, candidates: &[Candidate]) -> f64 {
        let (mut worst, mut scale) = (0.0_f64, 0.0_f64);
        for &row in &self.active {
            let row = row as usize;
            let (softness, target) = equation(problem, candidates, row, self.modes[row]);
            worst = worst.max((softness * self.forces[row] + self.moved[row] - target).abs());
            scale = scale.max(target.abs());
        }
        if scale > 0.0 { worst / scale } else { 0.0 }
    }

    /// Projected Gauss-Seidel until the forces stay; returns the number of sweeps and the last
    /// change relative to the largest force.
    fn sweep(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        rubbing: &[u32],
    ) -> (usize, f64) {
        let normals = candidates.len();
        let mut relative = 0.0;
        for sweep in 1..=MAX_SWEEPS {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            let mut rubbing = rubbing.iter().enumerate().peekable();
            for row in 0..normals {
                let own = problem.compliance_row(row)[row];
                let others = self.moved[row] - own * self.forces[row];
                let force_in = |mode| {
                    let (softness, target) = equation(problem, candidates, row, mode);
                    (target - others) / (softness + own)
                };
                let penalty = force_in(Mode::Elastic).max(force_in(Mode::Hard));
                let force = penalty.min(force_in(Mode::Recovering)).max(0.0);
                change = change.max(self.set_force(problem, row, force));
                largest = largest.max(force);
                if let Some((place, _)) = rubbing.next_if(|&(_, &other)| other as usize == row) {
                    let tangents = [normals + 2 * place, normals + 2 * place + 1];
                    let limit = candidates[row].friction * force;
                    change = change.max(self.rub(problem, tangents, limit));
                }
            }
            relative = if largest > 0.0 { change / largest } else { 0.0 };
            if relative <= SWEEP_TOLERANCE {
                return (sweep, relative);
            }
        }
        (MAX_SWEEPS, relative)
    }

    /// Projects a step against the slip onto the disc of the possible friction forces.
    fn rub(&mut self, problem: &Problem, tangents: [usize; 2], limit: f64) -> f64 {
        let [first, second] = tangents;
        let (a, b) = (problem.compliance_row(first)[first], problem.compliance_row(second)[second]);
        let c = problem.compliance_row(first)[second];
        // Largest eigenvalue of the contact's own 2x2 block.
        let stiffest = 0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt();
        if stiffest <= 0.0 {
            return 0.0;
        }
        let mut force = tangents
            .map(|row| self.forces[row] - (problem.rows()[row].free + self.moved[row]) / stiffest);
        let length = force[0].hypot(force[1]);
        if length > limit {
            force = force.map(|f| f * limit / length);
        }
        let changes = [0, 1].map(|axis| self.set_force(problem, tangents[axis], force[axis]));
        changes[0].max(changes[1])
    }

    /// Changes one force and what it moves; returns the size of the change.
    fn set_force(&mut self, problem: &Problem, row: usize, force: f64) -> f64 {
        let change = force - self.forces[row];
        if change != 0.0 {
            self.forces[row] = force;
            for (moved, w) in self.moved.iter_mut().zip(problem.compliance_row(row)) {
                *moved += change * w;
            }
        }
        change.abs()
    }
}

/// Softness D [m/N] and target s [m] of a row's equation `D f + (W f) = s`.
fn equation(problem: &Problem, candidates: &[Candidate], row: usize, mode: Mode) -> (f64, f64) {
    let floor = SOFTNESS_FLOOR * problem.compliance_row(row)[row];
    let equation = &problem.rows()[row];
    let candidate = &candidates[equation.candidate as usize];
    let hard = HARDENING * candidate.stiffness;
    let soft_part = SOFT_PART * candidate.distance;
    let (stiffness, goal) = match mode {
        Mode::Recovering => (hard, candidate.recovery),
        // Continues the soft law from the end of the soft part on.
        Mode::Hard => (hard, candidate.distance - soft_part + soft_part / HARDENING),
        Mode::Elastic | Mode::Off => (candidate.stiffness, candidate.distance),
    };
    (stiffness.recip().max(floor), goal - (candidate.gap + equation.free))
}

/// Mode and force of a normal row that all forces have moved by `moved`.
fn normal_law(problem: &Problem, candidates: &[Candidate], row: usize, moved: f64) -> (Mode, f64) {
    let force_in = |mode| {
        let (softness, target) = equation(problem, candidates, row, mode);
        (target - moved) / softness
    };
    let mut best = (Mode::Elastic, force_in(Mode::Elastic));
    let (hard, recovering) = (force_in(Mode::Hard), force_in(Mode::Recovering));
    if hard > best.1 {
        best = (Mode::Hard, hard);
    }
    if recovering < best.1 {
        best = (Mode::Recovering, recovering);
    }
    if best.1 > 0.0 { best } else { (Mode::Off, 0.0) }
}
