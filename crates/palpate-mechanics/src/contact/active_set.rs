//! Which contacts push, and how hard; how much they rub.
//!
//! Block Gauss-Seidel (nonsmooth contact dynamics, Jean 1999) gives contact after contact the force
//! that its own law asks for, given all others. It soon finds which contacts push, stick and slide,
//! and takes long to share the load among them. That is a linear system, so conjugate gradients do
//! it between the sweeps (subspace minimisation, Silcowitz et al. 2010).

use glam::DVec3;
use palpate_solver::add_rows;

use super::filter::Candidate;
use super::problem::{Block, Problem};

/// Sweeps of Gauss-Seidel.
const MAX_SWEEPS: usize = 50;
/// Sweeps in a row after the conjugate gradients have led astray.
const RECOVERY_SWEEPS: usize = 4;
/// Steps of the conjugate gradients between two sweeps, and how far they reduce the residual.
const MAX_GRADIENT_STEPS: usize = 40;
const GRADIENT_REDUCTION: f64 = 1e-2;
/// Part of the contact distance in which the penalty is soft. Below it, and where the recovery is
/// limited, a contact is [`HARDENING`] times stiffer: surfaces must not pass through each other even
/// where all the load is on a few nodes, since an open surface would then push the wrong way.
pub(super) const SOFT_PART: f64 = 0.5;
pub(super) const HARDENING: f64 = 100.0;
/// Smallest softness of an equation relative to its own compliance: keeps the matrix regular.
pub(super) const SOFTNESS_FLOOR: f64 = 1e-6;
/// Sweeps end when no force changes by more than this part of the largest one.
pub(super) const SWEEP_TOLERANCE: f64 = 1e-4;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// Penalty force by the overlap.
    Elastic,
    /// The steeper penalty of a deep overlap.
    Hard,
    /// As hard as it takes to reach the recovery gap, which is less than the penalty.
    Recovering,
}

/// An equation that the conjugate gradients solve: row, softness and target of
/// `D f + (W f) = s` along a mix of two rows; the second part is zero where one row is meant.
#[derive(Clone, Copy, Debug)]
struct Equation {
    rows: [u32; 2],
    parts: [f64; 2],
    softness: f64,
    target: f64,
}

impl Equation {
    fn along_row(row: usize, softness: f64, target: f64) -> Self {
        Self { rows: [row as u32; 2], parts: [1.0, 0.0], softness, target }
    }

    fn along(&self, values: &[f64]) -> f64 {
        self.parts[0] * values[self.rows[0] as usize]
            + self.parts[1] * values[self.rows[1] as usize]
    }

    /// W along the mix.
    fn compliance(&self, problem: &Problem) -> f64 {
        let [first, second] = self.rows.map(|row| problem.compliance_row(row as usize));
        self.parts[0] * self.along(first) + self.parts[1] * self.along(second)
    }
}

/// What a solution took.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SolveCost {
    /// Gauss-Seidel sweeps and steps of the conjugate gradients.
    pub(crate) systems: usize,
    /// Gauss-Seidel sweeps.
    pub(crate) rounds: usize,
    /// Largest change of a force in the last sweep relative to the largest force.
    pub(crate) residual: f64,
}

/// Solver of contact problems. Keeps its memory.
#[derive(Default)]
pub(crate) struct ActiveSet {
    /// Force of each row [N].
    forces: Vec<f64>,
    /// Displacement of each row by all forces [m].
    moved: Vec<f64>,
    /// Forces and displacements before the conjugate gradients.
    kept: Vec<f64>,
    kept_moved: Vec<f64>,
    equations: Vec<Equation>,
    rows: Vec<u32>,
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    factors: Vec<f64>,
    product: Vec<f64>,
}

impl ActiveSet {
    /// Force of a candidate along its axes [N].
    pub(crate) fn force(&self, block: &Block) -> DVec3 {
        at(&self.forces, block)
    }

    /// Displacement of a candidate along its axes by all contact forces [m].
    pub(crate) fn moved(&self, block: &Block) -> DVec3 {
        at(&self.moved, block)
    }

    /// Solves for the forces of all candidates, beginning with `guess` along their axes.
    pub(crate) fn solve(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        guess: impl Fn(usize) -> DVec3,
    ) -> SolveCost {
        self.begin(problem, candidates, guess);
        let mut cost = SolveCost::default();
        let mut before = f64::INFINITY;
        let mut plain = 0;
        while cost.rounds < MAX_SWEEPS {
            cost.residual = self.sweep(problem, candidates);
            cost.rounds += 1;
            cost.systems += 1;
            if cost.residual <= SWEEP_TOLERANCE {
                break;
            }
            if plain > 0 {
                plain -= 1;
                before = f64::INFINITY;
                continue;
            }
            if cost.residual > before {
                // The gradients led astray: go back to where the last sweep ended.
                self.forces.clone_from(&self.kept);
                self.moved.clone_from(&self.kept_moved);
                plain = RECOVERY_SWEEPS;
                continue;
            }
            before = cost.residual;
            self.kept.clone_from(&self.forces);
            self.kept_moved.clone_from(&self.moved);
            cost.systems += self.improve(problem, candidates);
        }
        cost
    }

    fn begin(
        &mut self,
        problem: &Problem,
        candidates: &[Candidate],
        guess: impl Fn(usize) -> DVec3,
    ) {
        self.forces.clear();
        for (index, (block, candidate)) in problem.blocks().iter().zip(candidates).enumerate() {
            let mut force = guess(index);
            force.x = force.x.max(0.0);
            let [_, first, second] = force.to_array();
            let friction = within(candidate.friction * force.x, [first, second]);
            let force = [force.x, friction[0], friction[1]];
            self.forces.extend_from_slice(&force[..block.rows as usize]);
        }
        self.update_moved(problem);
    }

    fn update_moved(&mut self, problem: &Problem) {
        self.moved.clear();
        self.moved.resize(problem.row_count(), 0.0);
        self.rows.clear();
        self.direction.clear();
        for (row, &force) in self.forces.iter().enumerate() {
            if force != 0.0 {
                self.rows.push(row as u32);
                self.direction.push(force);
            }
        }
        add_rows(problem.compliance(), &self.rows, &self.direction, &mut self.moved);
    }

    /// Projected Gauss-Seidel over all contacts; returns the largest change of a force relative to
    /// the largest force.
    fn sweep(&mut self, problem: &Problem, candidates: &[Candidate]) -> f64 {
        let (mut change, mut largest) = (0.0_f64, 0.0_f64);
        for (block, candidate) in problem.blocks().iter().zip(candidates) {
            let row = block.first as usize;
            let own = problem.compliance_row(row)[row];
            let others = self.moved[row] - own * self.forces[row];
            let force = normal_force(candidate, block, own, others).0;
            change = change.max(self.set_force(problem, row, force));
            largest = largest.max(force);
            if block.rows == 3 {
                change = change.max(self.rub(problem, block, candidate.friction * force));
            }
        }
        if largest > 0.0 { change / largest } else { change }
    }

    /// Projects a step against the slip onto the disc of the possible friction forces.
    fn rub(&mut self, problem: &Problem, block: &Block, limit: f64) -> f64 {
        let rows = [block.first as usize + 1, block.first as usize + 2];
        if limit == 0.0 {
            let changes = rows.map(|row| self.set_force(problem, row, 0.0));
            return changes[0].max(changes[1]);
        }
        let stiffest = stiffest(problem, rows);
        if stiffest <= 0.0 {
            return 0.0;
        }
        let slip = [block.free.y + self.moved[rows[0]], block.free.z + self.moved[rows[1]]];
        let force = [0, 1].map(|axis| self.forces[rows[axis]] - slip[axis] / stiffest);
        let force = within(limit, force);
        let changes = [0, 1].map(|axis| self.set_force(problem, rows[axis], force[axis]));
        changes[0].max(changes[1])
    }

    /// Changes one force and what it moves; returns the size of the change.
    fn set_force(&mut self, problem: &Problem, row: usize, force: f64) -> f64 {
        let change = force - self.forces[row];
        if change != 0.0 {
            self.forces[row] = force;
            add_rows(problem.compliance(), &[row as u32], &[change], &mut self.moved);
        }
        change.abs()
    }

    /// Solves for the forces of the contacts that push or stick, and for the direction of the
    /// friction where they slide; returns the steps taken.
    fn improve(&mut self, problem: &Problem, candidates: &[Candidate]) -> usize {
        self.choose_equations(problem, candidates);
        let steps = self.descend(problem);
        for (block, candidate) in problem.blocks().iter().zip(candidates) {
            let row = block.first as usize;
            self.forces[row] = self.forces[row].max(0.0);
            if block.rows == 3 {
                let limit = candidate.friction * self.forces[row];
                let force = within(limit, [self.forces[row + 1], self.forces[row + 2]]);
                self.forces[row + 1..row + 3].copy_from_slice(&force);
            }
        }
        self.update_moved(problem);
        steps
    }

    fn choose_equations(&mut self, problem: &Problem, candidates: &[Candidate]) {
        self.equations.clear();
        for (block, candidate) in problem.blocks().iter().zip(candidates) {
            let row = block.first as usize;
            if self.forces[row] <= 0.0 {
                continue;
            }
            let own = problem.compliance_row(row)[row];
            let others = self.moved[row] - own * self.forces[row];
            let (_, mode) = normal_force(candidate, block, own, others);
            let (softness, target) = equation(candidate, block, own, mode);
            self.equations.push(Equation::along_row(row, softness, target));
            if block.rows == 1 {
                continue;
            }
            let rows = [row + 1, row + 2];
            let limit = candidate.friction * self.forces[row];
            let force = rows.map(|row| self.forces[row]);
            if force[0].hypot(force[1]) < (1.0 - 1e-9) * limit {
                let softness = SOFTNESS_FLOOR * stiffest(problem, rows);
                for (row, free) in rows.into_iter().zip([block.free.y, block.free.z]) {
                    self.equations.push(Equation::along_row(row, softness, -free));
                }
            } else if limit > 0.0 {
                // Friction is opposite to the slip: across it, it resists as `slip / limit`.
                let parts = [-force[1] / limit, force[0] / limit];
                let free = [block.free.y, block.free.z];
                let slip = [free[0] + self.moved[rows[0]], free[1] + self.moved[rows[1]]];
                self.equations.push(Equation {
                    rows: rows.map(|row| row as u32),
                    parts,
                    softness: slip[0].hypot(slip[1]) / limit,
                    target: -(parts[0] * free[0] + parts[1] * free[1]),
                });
            }
        }
    }

    /// Preconditioned conjugate gradients on the chosen equations; returns the steps taken.
    fn descend(&mut self, problem: &Problem) -> usize {
        let size = self.equations.len();
        self.rows.clear();
        for e in &self.equations {
            self.rows.extend(e.rows.iter().zip(e.parts).filter(|x| x.1 != 0.0).map(|x| x.0));
        }
        self.residual.clear();
        self.preconditioned.clear();
        for e in &self.equations {
            let (moved, force) = (e.along(&self.moved), e.along(&self.forces));
            self.residual.push(e.target - moved - e.softness * force);
            self.preconditioned.push((e.softness + e.compliance(problem)).recip());
        }
        self.direction.clear();
        self.direction.resize(size, 0.0);
        let weighted = |residual: &[f64], inverse: &[f64]| -> f64 {
            residual.iter().zip(inverse).map(|(r, d)| r * r * d).sum()
        };
        let start = weighted(&self.residual, &self.preconditioned);
        let mut now = start;
        let mut last = f64::INFINITY;
        for step in 0..MAX_GRADIENT_STEPS.min(size) {
            if now <= GRADIENT_REDUCTION * GRADIENT_REDUCTION * start {
                return step;
            }
            let mix = now / last;
            let terms = self.direction.iter_mut().zip(&self.residual).zip(&self.preconditioned);
            for ((direction, r), d) in terms {
                *direction = r * d + mix * *direction;
            }
            self.product.clear();
            self.product.resize(problem.row_count(), 0.0);
            self.factors.clear();
            for (e, p) in self.equations.iter().zip(&self.direction) {
                self.factors.extend(e.parts.iter().filter(|&&part| part != 0.0).map(|x| x * p));
            }
            add_rows(problem.compliance(), &self.rows, &self.factors, &mut self.product);
            let curvature: f64 = self
                .equations
                .iter()
                .zip(&self.direction)
                .map(|(e, p)| p * (e.along(&self.product) + e.softness * p))
                .sum();
            if curvature <= 0.0 {
                return step;
            }
            let length = now / curvature;
            let terms = self.equations.iter().zip(&self.direction).zip(&mut self.residual);
            for ((e, p), residual) in terms {
                for (&row, part) in e.rows.iter().zip(e.parts) {
                    self.forces[row as usize] += length * part * p;
                }
                *residual -= length * (e.along(&self.product) + e.softness * p);
            }
            last = now;
            now = weighted(&self.residual, &self.preconditioned);
        }
        MAX_GRADIENT_STEPS.min(size)
    }
}

fn at(values: &[f64], block: &Block) -> DVec3 {
    let first = block.first as usize;
    match block.rows {
        1 => DVec3::new(values[first], 0.0, 0.0),
        _ => DVec3::from_slice(&values[first..first + 3]),
    }
}

/// Largest eigenvalue of the block of W of two rows.
fn stiffest(problem: &Problem, [first, second]: [usize; 2]) -> f64 {
    let (a, b) = (problem.compliance_row(first)[first], problem.compliance_row(second)[second]);
    let c = problem.compliance_row(first)[second];
    0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt()
}

/// `force`, shortened to `limit`.
fn within(limit: f64, force: [f64; 2]) -> [f64; 2] {
    let length = force[0].hypot(force[1]);
    if length > limit { force.map(|f| f * limit / length) } else { force }
}

/// Softness D [m/N] and target s [m] of a normal's equation `D f + (W f) = s`.
fn equation(candidate: &Candidate, block: &Block, own: f64, mode: Mode) -> (f64, f64) {
    let hard = HARDENING * candidate.stiffness;
    let soft_part = SOFT_PART * candidate.distance;
    let (stiffness, goal) = match mode {
        Mode::Recovering => (hard, candidate.recovery),
        // Continues the soft law from the end of the soft part on.
        Mode::Hard => (hard, candidate.distance - soft_part + soft_part / HARDENING),
        Mode::Elastic => (candidate.stiffness, candidate.distance),
    };
    (stiffness.recip().max(SOFTNESS_FLOOR * own), goal - (candidate.gap + block.free.x))
}

/// Normal force that its law asks for when the other forces move the row by `others`, and the part
/// of the law that it lies on.
fn normal_force(candidate: &Candidate, block: &Block, own: f64, others: f64) -> (f64, Mode) {
    let force_in = |mode| {
        let (softness, target) = equation(candidate, block, own, mode);
        (target - others) / (softness + own)
    };
    let mut best = (force_in(Mode::Elastic), Mode::Elastic);
    let (hard, recovering) = (force_in(Mode::Hard), force_in(Mode::Recovering));
    if hard > best.0 {
        best = (hard, Mode::Hard);
    }
    if recovering < best.0 {
        best = (recovering, Mode::Recovering);
    }
    (best.0.max(0.0), best.1)
}
