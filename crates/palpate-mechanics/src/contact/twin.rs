//! The contact solver against plain projected Gauss-Seidel and against the conditions themselves.

use glam::DVec3;
use palpate_contact::PairKind;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::active_set::{ActiveSet, HARDENING, SOFT_PART, SOFTNESS_FLOOR, SWEEP_TOLERANCE};
use super::filter::Candidate;
use super::problem::{Block, Problem};

/// The twin stops when no force changes by more than this part of the largest one.
const TWIN_TOLERANCE: f64 = 1e-10;
const TWIN_SWEEPS: usize = 20_000;
/// What the solver's stopping rule leaves of an error, relative to the largest force.
const TOLERANCE: f64 = 20.0 * SWEEP_TOLERANCE;

/// Uniform in [0, 1): splitmix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

/// What a random problem is like.
#[derive(Clone, Copy, Debug)]
struct Kind {
    seed: u64,
    count: usize,
    /// Rank of W per row; below 1 it is singular.
    rank: f64,
    /// Penalty stiffness times the compliance of a row.
    stiffness: f64,
    /// Largest friction coefficient; `None` without friction rows.
    friction: Option<f64>,
}

fn kinds(friction: bool) -> impl Strategy<Value = Kind> {
    let friction = if friction { (0.05..0.8).prop_map(Some).boxed() } else { Just(None).boxed() };
    // Stiff contacts on a singular W share a load in no definite way: there they are soft.
    let regular = (1.3..3.0, -2.0..1.5);
    let singular = (0.3..1.0, -2.0..-0.5);
    (any::<u64>(), 1_usize..=40, prop_oneof![regular, singular], friction).prop_map(
        |(seed, count, (rank, exponent), friction)| Kind {
            seed,
            count,
            rank,
            stiffness: 10_f64.powf(exponent),
            friction,
        },
    )
}

/// W = A A^T, which may be singular, scaled to a diagonal near 1 mm/N; with friction the response of
/// each contact to itself counts double, since Coulomb's law has a unique solution only while pressing
/// moves a contact more along its normal than across. Contacts overlap, approach or part.
fn random_problem(kind: Kind) -> (Problem, Vec<Candidate>) {
    let mut random = Random(kind.seed);
    let rows = if kind.friction.is_some() { 3 } else { 1 };
    let size = kind.count * rows;
    let rank = ((size as f64 * kind.rank).round() as usize).max(1);
    let scale = (3e-3 / rank as f64).sqrt();
    let factor: Vec<f64> = (0..size * rank).map(|_| scale * random.between(-1.0, 1.0)).collect();
    let row = |i: usize| &factor[i * rank..(i + 1) * rank];
    let product = |i: usize, j: usize| row(i).iter().zip(row(j)).map(|(a, b)| a * b).sum();
    let mut compliance: Vec<f64> =
        (0..size * size).map(|at| product(at / size, at % size)).collect();
    if kind.friction.is_some() {
        compliance.iter_mut().step_by(size + 1).for_each(|own| *own += 1e-3);
    }
    let mut free = Vec::new();
    let mut candidates = Vec::new();
    for index in 0..kind.count {
        free.push(DVec3::from_array([0; 3].map(|_| random.between(-3e-3, 1e-3))));
        let distance = random.between(0.5e-3, 2e-3);
        let gap = random.between(-2.0, 1.5) * distance;
        candidates.push(Candidate {
            kind: PairKind::VertexTriangle,
            bodies: [0, 1],
            nodes: [index as u32, 0, 1, 2],
            weights: [1.0, -0.5, -0.25, -0.25],
            normal: DVec3::Z,
            gap,
            distance,
            stiffness: 1e3 * kind.stiffness * random.between(0.5, 2.0),
            recovery: gap + distance / 3.0,
            friction: kind.friction.map_or(0.0, |most| random.between(0.2, 1.0) * most),
        });
    }
    (Problem::with_compliance(compliance, &free, rows as u32), candidates)
}

/// The penalty law: normal force [N] at a gap at the end of the step.
fn penalty_force(candidate: &Candidate, own: f64, gap: f64) -> f64 {
    let spring =
        |stiffness: f64, rest: f64| (rest - gap) / f64::max(1.0 / stiffness, SOFTNESS_FLOOR * own);
    let soft_part = SOFT_PART * candidate.distance;
    let soft = spring(candidate.stiffness, candidate.distance);
    let stiff = HARDENING * candidate.stiffness;
    let hard = spring(stiff, candidate.distance - soft_part + soft_part / HARDENING);
    soft.max(hard).min(spring(stiff, candidate.recovery)).max(0.0)
}

/// The force that agrees with its own penalty when the gap is `gap + own * force`, by bisection.
fn consistent_force(candidate: &Candidate, own: f64, gap: f64) -> f64 {
    let (mut low, mut high) = (0.0, penalty_force(candidate, own, gap));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle < penalty_force(candidate, own, gap + own * middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

fn moved(problem: &Problem, row: usize, forces: &[f64]) -> f64 {
    problem.compliance_row(row).iter().zip(forces).map(|(w, f)| w * f).sum()
}

fn largest_normal(problem: &Problem, forces: &[f64]) -> f64 {
    problem.blocks().iter().map(|block| forces[block.first as usize]).fold(0.0, f64::max)
}

/// Normal forces by Gauss-Seidel sweeps from zero; `None` if they do not settle.
fn plain_sweeps(problem: &Problem, candidates: &[Candidate]) -> Option<Vec<f64>> {
    let mut forces = vec![0.0_f64; candidates.len()];
    for _ in 0..TWIN_SWEEPS {
        let mut change = 0.0_f64;
        for (row, candidate) in candidates.iter().enumerate() {
            let own = problem.compliance_row(row)[row];
            let others = moved(problem, row, &forces) - own * forces[row];
            let gap = candidate.gap + problem.blocks()[row].free.x + others;
            let force = consistent_force(candidate, own, gap);
            change = change.max((force - forces[row]).abs());
            forces[row] = force;
        }
        if change <= TWIN_TOLERANCE * largest_normal(problem, &forces) {
            return Some(forces);
        }
    }
    None
}

fn solve(problem: &Problem, candidates: &[Candidate]) -> (Vec<f64>, f64) {
    let mut solver = ActiveSet::default();
    let cost = solver.solve(problem, candidates, |_| DVec3::ZERO);
    let rows = |block| solver.force(block).to_array();
    let forces = problem.blocks().iter().flat_map(|b| rows(b).into_iter().take(b.rows as usize));
    (forces.collect(), cost.residual)
}

/// Slip of a contact across its normal [m].
fn slip(problem: &Problem, block: &Block, forces: &[f64]) -> [f64; 2] {
    let row = block.first as usize;
    let moved = [1, 2].map(|axis| moved(problem, row + axis, forces));
    [block.free.y + moved[0], block.free.z + moved[1]]
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 150,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(1),
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn normal_forces_are_those_of_plain_sweeps(kind in kinds(false)) {
        let (problem, candidates) = random_problem(kind);
        let twin = plain_sweeps(&problem, &candidates).expect("plain sweeps settle");
        let (forces, residual) = solve(&problem, &candidates);
        let largest = largest_normal(&problem, &twin);
        let error = twin.iter().zip(&forces).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        prop_assert!(residual <= SWEEP_TOLERANCE, "not solved: {residual:e}");
        prop_assert!(error <= TOLERANCE * largest, "{:e} of the largest", error / largest);
    }

    #[test]
    fn friction_obeys_its_law(kind in kinds(true)) {
        let (problem, candidates) = random_problem(kind);
        let (forces, residual) = solve(&problem, &candidates);
        let largest = largest_normal(&problem, &forces);
        let mut worst = [0.0_f64; 3];
        for (block, candidate) in problem.blocks().iter().zip(&candidates) {
            let row = block.first as usize;
            let own = problem.compliance_row(row)[row];
            let others = moved(&problem, row, &forces) - own * forces[row];
            let expected = consistent_force(candidate, own, candidate.gap + block.free.x + others);
            worst[0] = worst[0].max((forces[row] - expected).abs());
            let limit = candidate.friction * forces[row];
            let friction = [forces[row + 1], forces[row + 2]];
            let size = friction[0].hypot(friction[1]);
            worst[1] = worst[1].max(size - limit);
            // A slip whose undoing would take more than the tolerance is a slide.
            let slip = slip(&problem, block, &forces);
            let speed = slip[0].hypot(slip[1]);
            if speed > TOLERANCE * largest * own {
                let along = (friction[0] * slip[0] + friction[1] * slip[1]) / speed;
                worst[2] = worst[2].max(along + limit);
            }
        }
        prop_assert!(residual <= SWEEP_TOLERANCE, "not solved: {residual:e}");
        let [normal, cone, slide] = worst.map(|error| error / largest.max(f64::MIN_POSITIVE));
        prop_assert!(normal <= TOLERANCE, "normal force off by {normal:e}");
        prop_assert!(cone <= 1e-12, "friction beyond its limit by {cone:e}");
        prop_assert!(slide <= TOLERANCE, "friction not opposite to the slip: {slide:e}");
    }
}
