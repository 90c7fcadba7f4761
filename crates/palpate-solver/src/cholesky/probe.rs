//! What a solve with a known right-hand side leaves: a matrix may be positive definite and yet have no factor
//! of use.

use super::{Cholesky, Precision, SolveWorkspace};
use crate::BlockMatrix;

/// Largest residual, relative to the right-hand side.
const TOLERANCE: f64 = 1e-6;
/// The same for a factor kept in single precision, and the largest error relative to the solution;
/// beyond them, it is kept in double precision. Rounding the soft part of a solution leaves a
/// residual in the stiff part, where it moves nothing: the error is a thousandth of it.
const SINGLE_TOLERANCES: [f64; 2] = [1e-2, 1e-5];
/// Largest error of a factor kept in sixteen bits, relative to the solution, both in the norm of the
/// matrix; beyond it, it is kept in single precision. That of the worst right-hand side was up to forty times this
/// one's.
const BLOCK_FLOAT_TOLERANCE: f64 = 1e-2;

/// Memory for probes.
#[derive(Default)]
pub(super) struct ProbeMemory {
    rhs: Vec<[f64; 3]>,
    solution: Vec<[f64; 3]>,
    residual: Vec<[f64; 3]>,
    error: Vec<[f64; 3]>,
    workspace: SolveWorkspace,
}

/// What is left.
pub(super) struct Probe {
    /// Relative to the right-hand side.
    pub(super) residual: f64,
    /// Estimated, relative to the solution.
    error: f64,
    /// The same in the norm of the matrix.
    energy_error: f64,
}

impl Probe {
    pub(super) fn new(factor: &Cholesky, matrix: &BlockMatrix, memory: &mut ProbeMemory) -> Self {
        let ProbeMemory { rhs, solution, residual, error, workspace } = memory;
        let count = factor.node_count();
        let mut state = 1_u32;
        let mut draw = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        rhs.clear();
        rhs.extend((0..count).map(|_| -> [f64; 3] { std::array::from_fn(|_| draw()) }));
        solution.clone_from(rhs);
        factor.solve_in_place(solution, workspace);
        residual.resize(count, [0.0; 3]);
        matrix.multiply(solution, residual);
        for (p, r) in residual.as_flattened_mut().iter_mut().zip(rhs.as_flattened()) {
            *p -= r;
        }
        let dot = |a: &[[f64; 3]], b: &[[f64; 3]]| {
            let pairs = a.as_flattened().iter().zip(b.as_flattened());
            pairs.map(|(a, b)| a * b).sum::<f64>()
        };
        let ratio = |part: f64, whole: f64| (part / whole).sqrt();
        let left = ratio(dot(residual, residual), dot(rhs, rhs));
        error.clone_from(residual);
        factor.solve_in_place(error, workspace);
        Self {
            residual: left,
            error: ratio(dot(error, error), dot(solution, solution)),
            energy_error: ratio(dot(residual, error), dot(rhs, solution)),
        }
    }

    /// Whether a factor kept in this precision is of use.
    pub(super) fn is_accurate(&self, precision: Precision) -> bool {
        match precision {
            Precision::Double => self.residual < TOLERANCE,
            Precision::Single => {
                self.residual < SINGLE_TOLERANCES[0] && self.error < SINGLE_TOLERANCES[1]
            }
            Precision::BlockFloat => self.energy_error < BLOCK_FLOAT_TOLERANCE,
        }
    }
}
