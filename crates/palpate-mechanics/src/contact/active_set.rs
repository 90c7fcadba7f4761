//! Which contacts push, and how hard; which stick and which slide.
//!
//! Newton's method on a piecewise linear problem: guess which contacts push, solve the linear system
//! of those, correct the guess from the gaps, until the guess is right.

use palpate_solver::{DenseCholesky, FactorError};

use super::filter::Candidate;
use super::problem::Problem;

/// Rounds of the Newton iteration before the fallback.
const MAX_ROUNDS: usize = 30;
/// Sweeps of the fallback (projected Gauss-Seidel, which always converges).
const MAX_SWEEPS: usize = 2_000;
/// Rounds of the friction iteration, and the round after which sliding is final.
const MAX_FRICTION_ROUNDS: usize = 40;
const SLIDING_IS_FINAL: usize = 12;
/// A contact that is limited in its recovery is this many times stiffer than the penalty.
const RECOVERY_STIFFNESS: f64 = 100.0;
/// Smallest softness of an equation relative to its own compliance: keeps the matrix regular.
const SOFTNESS_FLOOR: f64 = 1e-6;
/// Sliding forces have converged when they change by less than this part.
const FRICTION_TOLERANCE: f64 = 1e-6;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Off,
    /// Penalty force by the overlap.
    Elastic,
    /// As hard as it takes to reach the recovery gap, which is less than the penalty.
    Recovering,
    /// Held along this tangent.
    Stick,
    /// Pushed along this tangent by a given force.
    Slide,
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveCost {
    /// Linear systems solved, sweeps of the fallback included.
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
                cost.systems += self.sweep_normals(problem, candidates);
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

    /// Solves for normal forces and friction: after the normals stand two tangents for each candidate
    /// in `rubbing`, in that order.
    ///
    /// Sliding contacts feel the friction of the round before (lagged), opposite to their motion.
    pub(crate) fn solve_friction(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        rubbing: &[u32],
    ) -> Result<SolveCost, FactorError> {
        let normals = candidates.len();
        self.forces.resize(problem.rows().len(), 0.0);
        self.modes.resize(normals, Mode::Off);
        self.modes.resize(problem.rows().len(), Mode::Stick);
        self.moved.resize(problem.rows().len(), 0.0);
        let mut cost = SolveCost::default();
        let mut settled = false;
        while !settled && cost.rounds < MAX_FRICTION_ROUNDS {
            cost.residual = self.solve_active(problem, candidates)?;
            cost.rounds += 1;
            cost.systems += 1;
            settled = true;
            for row in 0..normals {
                let (mode, _) = normal_law(problem, candidates, row, self.moved[row]);
                settled &= mode == self.modes[row];
                self.modes[row] = mode;
            }
            for (place, &candidate) in rubbing.iter().enumerate() {
                let rows = [normals + 2 * place, normals + 2 * place + 1];
                let slide = cost.rounds <= SLIDING_IS_FINAL;
                settled &= self.update_tangents(problem, candidates, candidate, rows, slide);
            }
        }
        for (place, &candidate) in rubbing.iter().enumerate() {
            let rows = [normals + 2 * place, normals + 2 * place + 1];
            let limit = friction_limit(candidates, &self.forces, candidate);
            let length = self.forces[rows[0]].hypot(self.forces[rows[1]]);
            if length > limit {
                for row in rows {
                    self.forces[row] *= limit / length;
                }
            }
        }
        self.update_moved(problem);
        Ok(cost)
    }

    /// Mode and force of a rubbing contact for the next round; true when both stay.
    fn update_tangents(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        candidate: u32,
        rows: [usize; 2],
        may_stick: bool,
    ) -> bool {
        let limit = friction_limit(candidates, &self.forces, candidate);
        let force = rows.map(|row| self.forces[row]);
        let length = force[0].hypot(force[1]);
        let old = self.modes[rows[0]];
        let (mode, force) = if limit <= 0.0 {
            (Mode::Off, [0.0; 2])
        } else if old == Mode::Stick && length > limit {
            (Mode::Slide, force.map(|f| f * limit / length))
        } else if old == Mode::Slide {
            let slip = rows.map(|row| problem.rows()[row].free + self.moved[row]);
            let speed = slip[0].hypot(slip[1]);
            let forward = slip[0] * force[0] + slip[1] * force[1];
            if forward < 0.0 {
                (Mode::Slide, slip.map(|s| -s * limit / speed))
            } else if may_stick {
                (Mode::Stick, force)
            } else {
                (Mode::Slide, force.map(|f| f * (limit / length).min(1.0)))
            }
        } else {
            (Mode::Stick, force)
        };
        let mut same = mode == old;
        for (row, force) in rows.into_iter().zip(force) {
            same &= (force - self.forces[row]).abs() <= FRICTION_TOLERANCE * limit;
            self.modes[row] = mode;
            self.forces[row] = force;
        }
        same
    }

    fn reset(&mut self, count: usize) {
        self.modes.clear();
        self.forces.clear();
        self.forces.resize(count, 0.0);
        self.moved.clear();
        self.moved.resize(count, 0.0);
    }

    /// Solves the equations of the active rows, leaves the sliding forces, and clears all others.
    fn solve_active(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
    ) -> Result<f64, FactorError> {
        self.active.clear();
        for (row, mode) in self.modes.iter().enumerate() {
            match mode {
                Mode::Elastic | Mode::Recovering | Mode::Stick => self.active.push(row as u32),
                Mode::Off => self.forces[row] = 0.0,
                Mode::Slide => {}
            }
        }
        let size = self.active.len();
        if size > 0 {
            self.matrix.clear();
            self.rhs.clear();
            for &row in &self.active {
                let row = row as usize;
                let compliance = problem.compliance_row(row);
                let (softness, target) = equation(problem, candidates, row, self.modes[row]);
                let place = self.matrix.len() / size;
                self.matrix.extend(self.active.iter().map(|&col| compliance[col as usize]));
                self.matrix[place * size + place] += softness;
                let pushed = compliance.iter().zip(&self.forces).zip(&self.modes);
                let by_sliding: f64 = pushed
                    .map(|((w, f), &mode)| if mode == Mode::Slide { w * f } else { 0.0 })
                    .sum();
                self.rhs.push(target - by_sliding);
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

    /// Projected Gauss-Seidel on the normals, for the rare case that the guesses cycle.
    fn sweep_normals(&mut self, problem: &Problem, candidates: &[Candidate]) -> usize {
        let count = candidates.len();
        for sweep in 1..=MAX_SWEEPS {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for row in 0..count {
                let compliance = problem.compliance_row(row);
                let all: f64 = compliance.iter().zip(&self.forces).map(|(w, f)| w * f).sum();
                let others = all - compliance[row] * self.forces[row];
                let force_in = |mode| {
                    let (softness, target) = equation(problem, candidates, row, mode);
                    (target - others) / (softness + compliance[row])
                };
                let force = force_in(Mode::Elastic).min(force_in(Mode::Recovering)).max(0.0);
                change = change.max((force - self.forces[row]).abs());
                largest = largest.max(force);
                self.forces[row] = force;
            }
            if change <= 1e-9 * largest {
                self.update_moved(problem);
                for row in 0..count {
                    self.modes[row] = normal_law(problem, candidates, row, self.moved[row]).0;
                }
                return sweep;
            }
        }
        self.update_moved(problem);
        MAX_SWEEPS
    }
}

/// Softness D [m/N] and target s [m] of a row's equation `D f + (W f) = s`.
fn equation(problem: &Problem, candidates: &[Candidate], row: usize, mode: Mode) -> (f64, f64) {
    let floor = SOFTNESS_FLOOR * problem.compliance_row(row)[row];
    let equation = &problem.rows()[row];
    if mode == Mode::Stick {
        return (floor, -equation.free);
    }
    let candidate = &candidates[equation.candidate as usize];
    let (stiffness, goal) = if mode == Mode::Recovering {
        (RECOVERY_STIFFNESS * candidate.stiffness, candidate.recovery)
    } else {
        (candidate.stiffness, candidate.distance)
    };
    (stiffness.recip().max(floor), goal - (candidate.gap + equation.free))
}

/// Mode and force of a normal row that all forces have moved by `moved`.
fn normal_law(problem: &Problem, candidates: &[Candidate], row: usize, moved: f64) -> (Mode, f64) {
    let force_in = |mode| {
        let (softness, target) = equation(problem, candidates, row, mode);
        (target - moved) / softness
    };
    let (elastic, recovering) = (force_in(Mode::Elastic), force_in(Mode::Recovering));
    if elastic.min(recovering) <= 0.0 {
        (Mode::Off, 0.0)
    } else if elastic <= recovering {
        (Mode::Elastic, elastic)
    } else {
        (Mode::Recovering, recovering)
    }
}

fn friction_limit(candidates: &[Candidate], forces: &[f64], candidate: u32) -> f64 {
    candidates[candidate as usize].friction * forces[candidate as usize].max(0.0)
}
