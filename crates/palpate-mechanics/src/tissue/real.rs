//! Numbers that a law can be evaluated with: one f64, a vector of them, or either with a derivative.
//!
//! A law is written once, over [`Real`]; its tangent is the same code with [`Dual`] numbers, so it
//! cannot disagree with the stress. No operation contracts to a fused multiply-add and `exp` and `ln`
//! are our own, so the bits do not depend on the machine.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::matrix::Matrix;
use super::polar;

/// A number, or several in lanes.
pub(super) trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant of the same kind as `self`.
    fn splat(self, value: f64) -> Self;
    /// `then` where `self > limit`, else `otherwise`.
    fn if_greater(self, limit: Self, then: Self, otherwise: Self) -> Self;
    fn sqrt(self) -> Self;
    /// `e^self`, for -700 ..= 700.
    fn exp(self) -> Self;
    /// `e^self - 1`, accurate near 0.
    fn exp_minus_one(self) -> Self;
    /// Natural logarithm of a positive, normal number.
    fn ln(self) -> Self;
    /// The rotation nearest to `matrix`.
    fn rotation(matrix: &Matrix<Self>) -> Matrix<Self>;
}

/// `max(x, 0)`.
#[inline(always)]
pub(super) fn positive_part<R: Real>(x: R) -> R {
    let zero = x.splat(0.0);
    x.if_greater(zero, x, zero)
}

impl Real for f64 {
    #[inline]
    fn splat(self, value: f64) -> Self {
        value
    }

    #[inline]
    fn if_greater(self, limit: Self, then: Self, otherwise: Self) -> Self {
        if self > limit { then } else { otherwise }
    }

    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }

    #[inline]
    fn exp(self) -> Self {
        let (power, remainder) = scaled_exponential(self);
        power * remainder + power
    }

    #[inline]
    fn exp_minus_one(self) -> Self {
        let (power, remainder) = scaled_exponential(self);
        power * remainder + (power - 1.0)
    }

    #[inline]
    fn ln(self) -> Self {
        natural_logarithm(self)
    }

    #[inline]
    fn rotation(matrix: &Matrix<Self>) -> Matrix<Self> {
        polar::rotation(matrix)
    }
}

/// `2^k` and `e^r - 1` with `x = k ln 2 + r`, `|r| <= ln 2 / 2`: the Taylor series to r^13.
#[inline]
pub(super) fn scaled_exponential(x: f64) -> (f64, f64) {
    /// Adding it rounds to an integer, which then stands in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    // ln 2 in two parts, the first with trailing zeros: its product with k is exact.
    const LN_2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
    const LN_2_LOW: f64 = f64::from_bits(0x3dea_39ef_3579_3c76);
    const FACTORIALS: [f64; 12] = [
        479_001_600.0,
        39_916_800.0,
        3_628_800.0,
        362_880.0,
        40_320.0,
        5_040.0,
        720.0,
        120.0,
        24.0,
        6.0,
        2.0,
        1.0,
    ];
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let mut sum = 1.0 / 6_227_020_800.0;
    for factorial in FACTORIALS {
        sum = sum * r + 1.0 / factorial;
    }
    let power = f64::from_bits(rounded.to_bits().wrapping_add(1023) << 52);
    (power, sum * r)
}

/// `x = 2^k m` with m in [√½, √2), and `ln m = 2 artanh(s)`, `s = (m - 1)/(m + 1)`, to s^23.
#[inline]
fn natural_logarithm(x: f64) -> f64 {
    const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let k = (x.to_bits().wrapping_sub(ROOT_HALF) as i64) >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub((k << 52) as u64));
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let mut sum = 1.0 / 23.0;
    for n in [21.0, 19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * square + 1.0 / n;
    }
    k as f64 * std::f64::consts::LN_2 + 2.0 * s * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_and_logarithms_agree_with_the_library() {
        for step in -7_000..=7_000 {
            let x = 0.1 * f64::from(step) + 1e-3;
            let exact = f64::exp(x);
            assert!((Real::exp(x) - exact).abs() <= 1e-15 * exact, "exp({x})");
            assert!((Real::ln(exact) - x).abs() <= 4e-16 * x.abs() + 1e-15, "ln({exact})");
        }
        for exponent in -300..300 {
            let x = 0.7 * f64::powi(10.0, exponent);
            let exact = f64::ln(x);
            assert!((Real::ln(x) - exact).abs() <= 4e-16 * exact.abs(), "ln({x})");
        }
        for step in -400..=400 {
            let x = 1e-3 * f64::from(step);
            for x in [x, 1e-6 * x] {
                let exact = x.exp_m1();
                assert!((x.exp_minus_one() - exact).abs() <= 4e-16 * exact.abs(), "{x}");
            }
        }
        assert_eq!((Real::exp(0.0), 0.0.exp_minus_one(), Real::ln(1.0)), (1.0, 0.0, 0.0));
    }
}
