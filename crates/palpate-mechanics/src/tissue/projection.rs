//! Nearest positive semi-definite matrix of a small symmetric one, in all lanes at once.

use super::real::{Real, positive_part};

/// Cyclic Jacobi sweeps. What they leave beside the diagonal only tilts the projection a little: the
/// result is positive semi-definite whatever they leave.
pub(super) const SWEEPS: usize = 6;

/// 1 where `matrix` is positive semi-definite to round-off, else 0: the signs of the pivots.
#[inline(always)]
pub(super) fn is_semidefinite<R: Real, const SIZE: usize>(matrix: &[[R; SIZE]; SIZE]) -> R {
    let like = matrix[0][0];
    let (zero, one) = (like.splat(0.0), like.splat(1.0));
    let mut size = zero;
    for k in 0..SIZE {
        size = size + matrix[k][k];
    }
    let shift = like.splat(1e-11) * size;
    let mut rest = *matrix;
    let mut yes = one;
    for k in 0..SIZE {
        let pivot = rest[k][k] + shift;
        yes = pivot.if_greater(zero, yes, zero);
        let inverse = one / pivot;
        for row in k + 1..SIZE {
            let factor = rest[row][k] * inverse;
            for col in k + 1..=row {
                rest[row][col] = rest[row][col] - factor * rest[col][k];
            }
        }
    }
    yes
}

/// The matrix without its negative eigenvalues, by so many Jacobi sweeps.
#[inline(always)]
pub(super) fn without_negative<R: Real, const SIZE: usize>(
    matrix: &[[R; SIZE]; SIZE],
    sweeps: usize,
) -> [[R; SIZE]; SIZE] {
    let like = matrix[0][0];
    let (zero, one) = (like.splat(0.0), like.splat(1.0));
    let mut diagonal = *matrix;
    // Rows are the eigenvectors.
    let mut vectors = [[zero; SIZE]; SIZE];
    for k in 0..SIZE {
        vectors[k][k] = one;
    }
    for _ in 0..sweeps {
        for p in 0..SIZE {
            for q in p + 1..SIZE {
                let (c, s) = rotation(diagonal[p][p], diagonal[q][q], diagonal[p][q]);
                turn(&mut diagonal, p, q, c, s);
                for row in 0..SIZE {
                    let (a, b) = (diagonal[row][p], diagonal[row][q]);
                    diagonal[row][p] = c * a - s * b;
                    diagonal[row][q] = s * a + c * b;
                }
                turn(&mut vectors, p, q, c, s);
            }
        }
    }
    let mut result = [[zero; SIZE]; SIZE];
    for k in 0..SIZE {
        let value = positive_part(diagonal[k][k]);
        for row in 0..SIZE {
            let factor = value * vectors[k][row];
            for col in 0..SIZE {
                result[row][col] = result[row][col] + factor * vectors[k][col];
            }
        }
    }
    result
}

/// Turns rows p and q.
#[inline(always)]
fn turn<R: Real, const SIZE: usize>(
    matrix: &mut [[R; SIZE]; SIZE],
    p: usize,
    q: usize,
    c: R,
    s: R,
) {
    for col in 0..SIZE {
        let (a, b) = (matrix[p][col], matrix[q][col]);
        matrix[p][col] = c * a - s * b;
        matrix[q][col] = s * a + c * b;
    }
}

/// Cosine and sine of the rotation that makes the entry beside the diagonal zero.
#[inline(always)]
pub(super) fn rotation<R: Real>(pp: R, qq: R, pq: R) -> (R, R) {
    let (zero, one) = (pp.splat(0.0), pp.splat(1.0));
    let tiny = pp.splat(f64::MIN_POSITIVE);
    let difference = qq - pp;
    let twice = pq + pq;
    // t = sign(d) 2pq / (|d| + √(d² + 4 pq²)), the smaller root.
    let root = (difference * difference + twice * twice).sqrt();
    let size = difference.if_greater(zero, difference, -difference) + root + tiny;
    let t = difference.if_greater(zero, twice, -twice) / size;
    let c = one / (one + t * t).sqrt();
    (c, t * c)
}
