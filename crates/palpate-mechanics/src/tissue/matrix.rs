//! 3x3 matrices of [`Real`] numbers, row by row.
//!
//! Loops instead of closures: everything here must be inlined into the code that was compiled for
//! the vector unit.

use super::real::Real;

pub(super) type Matrix<R> = [[R; 3]; 3];

#[inline(always)]
pub(super) fn zero<R: Real>(like: R) -> Matrix<R> {
    [[like.splat(0.0); 3]; 3]
}

#[inline(always)]
pub(super) fn add<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    let mut result = *a;
    for row in 0..3 {
        for col in 0..3 {
            result[row][col] = a[row][col] + b[row][col];
        }
    }
    result
}

#[inline(always)]
pub(super) fn scale<R: Real>(factor: R, a: &Matrix<R>) -> Matrix<R> {
    let mut result = *a;
    for row in 0..3 {
        for col in 0..3 {
            result[row][col] = factor * a[row][col];
        }
    }
    result
}

/// `a + factor I`.
#[inline(always)]
pub(super) fn add_diagonal<R: Real>(a: &Matrix<R>, factor: R) -> Matrix<R> {
    let mut result = *a;
    for k in 0..3 {
        result[k][k] = a[k][k] + factor;
    }
    result
}

#[inline(always)]
pub(super) fn transpose<R: Real>(a: &Matrix<R>) -> Matrix<R> {
    [[a[0][0], a[1][0], a[2][0]], [a[0][1], a[1][1], a[2][1]], [a[0][2], a[1][2], a[2][2]]]
}

/// `a b`.
#[inline(always)]
pub(super) fn multiply<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    let mut result = *a;
    for row in 0..3 {
        for col in 0..3 {
            result[row][col] =
                a[row][0] * b[0][col] + a[row][1] * b[1][col] + a[row][2] * b[2][col];
        }
    }
    result
}

/// `aᵀ b`.
#[inline(always)]
pub(super) fn transpose_multiply<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> Matrix<R> {
    multiply(&transpose(a), b)
}

/// `a v`.
#[inline(always)]
pub(super) fn apply<R: Real>(a: &Matrix<R>, v: &[R; 3]) -> [R; 3] {
    let mut result = *v;
    for row in 0..3 {
        result[row] = a[row][0] * v[0] + a[row][1] * v[1] + a[row][2] * v[2];
    }
    result
}

/// Sum of the products of the entries.
#[inline(always)]
pub(super) fn dot<R: Real>(a: &Matrix<R>, b: &Matrix<R>) -> R {
    let mut sum = a[0][0] * b[0][0];
    for entry in 1..9 {
        sum = sum + a[entry / 3][entry % 3] * b[entry / 3][entry % 3];
    }
    sum
}

#[inline(always)]
pub(super) fn trace<R: Real>(a: &Matrix<R>) -> R {
    a[0][0] + a[1][1] + a[2][2]
}

/// The matrix of the minors with their signs: the derivative of the determinant.
#[inline(always)]
pub(super) fn cofactor<R: Real>(a: &Matrix<R>) -> Matrix<R> {
    [cross(&a[1], &a[2]), cross(&a[2], &a[0]), cross(&a[0], &a[1])]
}

/// The determinant, from the cofactors.
#[inline(always)]
pub(super) fn determinant<R: Real>(a: &Matrix<R>, cofactor: &Matrix<R>) -> R {
    a[0][0] * cofactor[0][0] + a[0][1] * cofactor[0][1] + a[0][2] * cofactor[0][2]
}

#[inline(always)]
pub(super) fn cross<R: Real>(a: &[R; 3], b: &[R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
