//! The rotation in a deformation gradient, also of flat and inverted elements.
//!
//! The R that maximises `R : F` over the proper rotations (for det F > 0 the polar factor) is the
//! unit quaternion that maximises `qᵀ K q` for Davenport's symmetric 4x4 matrix K(F) (Horn 1987).
//! Squaring `K + c I` again and again leaves the projector on its largest eigenvalue: no branch, no
//! division, no start value, and where R is not unique (a flat or reflected element) a column is
//! still a maximiser. One Newton step on the rotation (Kugelstadt, Koschier, Bender 2018) takes what
//! is left to round-off.

use super::matrix::{self, Matrix};
use super::real::Real;

/// The start of the Newton step is a column of `(K + c I)^64`: four squarings, then three products.
const SQUARINGS: usize = 4;
const PRODUCTS: usize = 3;

/// The rotation R with the largest `R : F`. The identity for F = 0.
#[inline(always)]
pub(super) fn rotation<R: Real>(f: &Matrix<R>) -> Matrix<R> {
    let one = f[0][0].splat(1.0);
    let scale = one / (matrix::dot(f, f) + one.splat(f64::MIN_POSITIVE)).sqrt();
    let f = &matrix::scale(scale, f);
    let [w, x, y, z] = normalised(largest_eigenvector(f));
    let [a, b, c] = half_turn(&quaternion_to_matrix(&[w, x, y, z]), f, f);
    // Followed by the half turn: the quaternion (1, a, b, c), up to its length (Cayley's map).
    quaternion_to_matrix(&normalised([
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b + z * a - x * c,
        z + w * c + x * b - y * a,
    ]))
}

/// The derivative of the rotation of `f` along `slope`.
#[inline(always)]
pub(super) fn rotation_slope<R: Real>(
    rotation: &Matrix<R>,
    f: &Matrix<R>,
    slope: &Matrix<R>,
) -> Matrix<R> {
    let half = half_turn(rotation, f, slope);
    let [x, y, z] = [half[0] + half[0], half[1] + half[1], half[2] + half[2]];
    let zero = x.splat(0.0);
    matrix::multiply(rotation, &[[zero, -z, y], [z, zero, -x], [-y, x, zero]])
}

/// Half of the rotation vector w with `(tr S I - S) w = axial(Rᵀ change)`, S = Rᵀ F symmetric.
#[inline(always)]
fn half_turn<R: Real>(rotation: &Matrix<R>, f: &Matrix<R>, change: &Matrix<R>) -> [R; 3] {
    let s = matrix::transpose_multiply(rotation, f);
    let c = matrix::transpose_multiply(rotation, change);
    let axial = [c[2][1] - c[1][2], c[0][2] - c[2][0], c[1][0] - c[0][1]];
    let half = s[0][0].splat(0.5);
    let (xy, yz, zx) =
        (half * (s[0][1] + s[1][0]), half * (s[1][2] + s[2][1]), half * (s[2][0] + s[0][2]));
    let system = [
        [s[1][1] + s[2][2], -xy, -zx],
        [-xy, s[2][2] + s[0][0], -yz],
        [-zx, -yz, s[0][0] + s[1][1]],
    ];
    let adjugate = matrix::cofactor(&system);
    let determinant = matrix::determinant(&system, &adjugate);
    // Where the rotation is not unique the determinant vanishes, and any small turn will do.
    let size = matrix::trace(&system);
    let floor = half.splat(1e-9) * size * size * size + half.splat(f64::MIN_POSITIVE);
    let determinant = determinant.if_greater(floor, determinant, floor);
    let turn = matrix::apply(&adjugate, &axial);
    let scale = half / determinant;
    [scale * turn[0], scale * turn[1], scale * turn[2]]
}

#[inline(always)]
fn largest_eigenvector<R: Real>(f: &Matrix<R>) -> [R; 4] {
    // With |F| = 1 the eigenvalues of K are within ±√3 and their sum is 0. The smallest is at most
    // 2/√3 further from zero than the largest (a reflection): half of that, and a little more,
    // brings the largest to the front. Powers stay within 0.7^64 and 2.5^64.
    let shift = f[0][0].splat(0.7);
    let mut k = [[shift; 4]; 4];
    k[0] = [
        f[0][0] + f[1][1] + f[2][2] + shift,
        f[2][1] - f[1][2],
        f[0][2] - f[2][0],
        f[1][0] - f[0][1],
    ];
    k[1][1] = f[0][0] - f[1][1] - f[2][2] + shift;
    k[2][2] = f[1][1] - f[0][0] - f[2][2] + shift;
    k[3][3] = f[2][2] - f[0][0] - f[1][1] + shift;
    k[1][2] = f[0][1] + f[1][0];
    k[1][3] = f[0][2] + f[2][0];
    k[2][3] = f[1][2] + f[2][1];
    for _ in 0..SQUARINGS {
        k = square(&k);
    }
    // The column with the largest entry on the diagonal.
    let mut largest = k[0][0];
    let mut column = k[0];
    for other in 1..4 {
        let diagonal = k[other][other];
        for row in 0..4 {
            let candidate = k[row.min(other)][row.max(other)];
            column[row] = diagonal.if_greater(largest, candidate, column[row]);
        }
        largest = diagonal.if_greater(largest, diagonal, largest);
    }
    for _ in 0..PRODUCTS {
        let mut product = column;
        for row in 0..4 {
            product[row] = k[0][row] * column[0];
            for col in 1..4 {
                product[row] = product[row] + k[row.min(col)][row.max(col)] * column[col];
            }
        }
        column = product;
    }
    column
}

/// The upper triangle of a symmetric matrix, squared.
#[inline(always)]
fn square<R: Real>(k: &[[R; 4]; 4]) -> [[R; 4]; 4] {
    let mut result = *k;
    for row in 0..4 {
        for col in row..4 {
            let mut sum = k[0][row] * k[0][col];
            for inner in 1..4 {
                let left = k[inner.min(row)][inner.max(row)];
                let right = k[inner.min(col)][inner.max(col)];
                sum = sum + left * right;
            }
            result[row][col] = sum;
        }
    }
    result
}

#[inline(always)]
fn normalised<R: Real>(q: [R; 4]) -> [R; 4] {
    let length = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let scale = length.splat(1.0) / length;
    [scale * q[0], scale * q[1], scale * q[2], scale * q[3]]
}

#[inline(always)]
fn quaternion_to_matrix<R: Real>(q: &[R; 4]) -> Matrix<R> {
    let [w, x, y, z] = *q;
    let (one, two) = (w.splat(1.0), w.splat(2.0));
    let (x2, y2, z2) = (two * x, two * y, two * z);
    [
        [one - y2 * y - z2 * z, x2 * y - z2 * w, x2 * z + y2 * w],
        [x2 * y + z2 * w, one - x2 * x - z2 * z, y2 * z - x2 * w],
        [x2 * z - y2 * w, y2 * z + x2 * w, one - x2 * x - y2 * y],
    ]
}
