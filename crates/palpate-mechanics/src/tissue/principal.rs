//! The tangent of an isotropic law in the axes of its stretches, without its negative part.
//!
//! With `F = U diag(s) Vᵀ` the nine eigenvectors of ∂P/∂F are known up to a 3x3 problem: three
//! stretchings, whose matrix is `∂²W/∂s_i∂s_j`, and for each pair of axes a twist (antisymmetric) and a
//! flip (symmetric) with eigenvalues `(W_i + W_j)/(s_i + s_j)` and `(W_i - W_j)/(s_i - s_j)`. Source: Smith,
//! de Goes, Kim, "Analytic eigensystems for isotropic distortion energies", ACM Trans. Graph. 38
//! (2019). One stretch of an inverted element is negative: U and V are rotations.

use super::matrix::{self, Matrix};
use super::projection::{self, is_semidefinite, rotation, without_negative};
use super::real::{Real, positive_part};

/// Jacobi sweeps for the axes of a symmetric matrix: to round-off, from any start.
const SWEEPS: usize = 5;

/// The axes that are not axis k, in cyclic order: pair k.
pub(super) const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// A tangent by its parts.
#[derive(Clone, Copy)]
pub(super) struct PrincipalTangent<R> {
    /// `∂²W/∂s_i∂s_j`
    pub(super) stretching: Matrix<R>,
    /// Eigenvalue of the twist and of the flip of pair k.
    pub(super) twist: [R; 3],
    pub(super) flip: [R; 3],
}

impl<R: Real> PrincipalTangent<R> {
    /// That of an energy g(J) of the volume alone, given g' and g''.
    #[inline(always)]
    pub(super) fn of_volume(stretches: &[R; 3], first: R, second: R) -> Self {
        let mut result =
            Self { stretching: matrix::zero(first), twist: *stretches, flip: *stretches };
        let mut slope = *stretches;
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            slope[k] = stretches[i] * stretches[j];
            result.twist[k] = first * stretches[k];
            result.flip[k] = -result.twist[k];
        }
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            result.stretching[k][k] = second * slope[k] * slope[k];
            result.stretching[i][j] = second * slope[i] * slope[j] + result.twist[k];
            result.stretching[j][i] = result.stretching[i][j];
        }
        result
    }

    #[inline(always)]
    pub(super) fn add(&self, other: &Self) -> Self {
        let mut sum = *self;
        sum.stretching = matrix::add(&self.stretching, &other.stretching);
        for k in 0..3 {
            sum.twist[k] = self.twist[k] + other.twist[k];
            sum.flip[k] = self.flip[k] + other.flip[k];
        }
        sum
    }

    /// The nearest tangent that is positive semi-definite.
    #[inline(always)]
    pub(super) fn without_negative(&self, is_all: impl Fn(R) -> bool) -> Self {
        let mut result = *self;
        for k in 0..3 {
            result.twist[k] = positive_part(self.twist[k]);
            result.flip[k] = positive_part(self.flip[k]);
        }
        let keep = is_semidefinite(&self.stretching);
        if !is_all(keep) {
            let half = keep.splat(0.5);
            let projected = without_negative(&self.stretching, projection::SWEEPS);
            for row in 0..3 {
                for col in 0..3 {
                    let kept = self.stretching[row][col];
                    result.stretching[row][col] = keep.if_greater(half, kept, projected[row][col]);
                }
            }
        }
        result
    }

    /// Stiffness between two nodes by their shape gradients in the axes V, in the axes U.
    #[inline(always)]
    pub(super) fn block(&self, a: &[R; 3], b: &[R; 3]) -> Matrix<R> {
        let half = a[0].splat(0.5);
        let mut result = matrix::zero(half);
        for k in 0..3 {
            result[k][k] = self.stretching[k][k] * a[k] * b[k];
        }
        for k in 0..3 {
            let [i, j] = OTHERS[k];
            // Entry ij of the stress by entry ij of F, and by entry ji.
            let same = half * (self.flip[k] + self.twist[k]);
            let other = half * (self.flip[k] - self.twist[k]);
            let normal = self.stretching[i][j];
            result[i][i] = result[i][i] + same * a[j] * b[j];
            result[j][j] = result[j][j] + same * a[i] * b[i];
            result[i][j] = normal * a[i] * b[j] + other * a[j] * b[i];
            result[j][i] = normal * a[j] * b[i] + other * a[i] * b[j];
        }
        result
    }
}

/// Rotations U and V, by their columns, and the stretches with `F = U diag(s) Vᵀ`.
#[inline(always)]
pub(super) fn axes<R: Real>(f: &Matrix<R>) -> (Matrix<R>, [R; 3], Matrix<R>) {
    let turn = R::rotation(f);
    let half = f[0][0].splat(0.5);
    let product = matrix::transpose_multiply(&turn, f);
    let mut s = matrix::scale(half, &matrix::add(&product, &matrix::transpose(&product)));
    let mut v = matrix::zero(half);
    for k in 0..3 {
        v[k][k] = half.splat(1.0);
    }
    for _ in 0..SWEEPS {
        for [p, q] in OTHERS {
            let (c, n) = rotation(s[p][p], s[q][q], s[p][q]);
            for k in 0..3 {
                (s[p][k], s[q][k]) = (c * s[p][k] - n * s[q][k], n * s[p][k] + c * s[q][k]);
            }
            for k in 0..3 {
                (s[k][p], s[k][q]) = (c * s[k][p] - n * s[k][q], n * s[k][p] + c * s[k][q]);
                (v[k][p], v[k][q]) = (c * v[k][p] - n * v[k][q], n * v[k][p] + c * v[k][q]);
            }
        }
    }
    (matrix::multiply(&turn, &v), [s[0][0], s[1][1], s[2][2]], v)
}
