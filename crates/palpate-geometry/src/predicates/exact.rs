//! The signs in integers of any length: slow, valid for every finite input.

use num_bigint::BigInt;
use num_traits::{Signed, float::FloatCore};

use crate::Point;

/// Sign of `(b - a) × (c - a) · (d - a)`.
pub(super) fn orient3d(points: [Point; 4]) -> i8 {
    let [x, y, z] = [0, 1, 2].map(|axis| differences(points.map(|point| point[axis])));
    let minor = |i: usize, j: usize| &x[i] * &y[j] - &x[j] * &y[i];
    sign(&(minor(0, 1) * &z[2] + minor(1, 2) * &z[0] + minor(2, 0) * &z[1]))
}

/// Sign of `(b - a) × (c - a)`.
pub(super) fn orient2d(points: [[f64; 2]; 3]) -> i8 {
    let [x, y] = [0, 1].map(|axis| differences(points.map(|point| point[axis])));
    sign(&(&x[0] * &y[1] - &x[1] * &y[0]))
}

/// The differences of the later values to the first, times a power of two that makes all of them
/// integers. Each axis may have its own: a positive factor changes no sign of a determinant.
fn differences<const N: usize>(values: [f64; N]) -> Vec<BigInt> {
    let parts = values.map(FloatCore::integer_decode);
    let exponents = parts.iter().filter(|(mantissa, ..)| *mantissa != 0);
    let lowest = exponents.map(|&(_, exponent, _)| exponent).min().unwrap_or(0);
    let mut integers = parts.iter().map(|&(mantissa, exponent, sign)| {
        // Zero has an exponent too, which may lie below the lowest of the others.
        let shift = i32::from(exponent - lowest).max(0);
        (BigInt::from(mantissa) * sign) << shift
    });
    let first = integers.next().unwrap_or_default();
    integers.map(|integer| integer - &first).collect()
}

fn sign(value: &BigInt) -> i8 {
    i8::from(value.is_positive()) - i8::from(value.is_negative())
}
