//! Numbers with a derivative along one direction (forward differentiation).

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::matrix::{self, Matrix};
use super::polar;
use super::real::Real;

/// A value and its derivative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dual<R> {
    pub(super) value: R,
    pub(super) slope: R,
}

/// Pairs a matrix with its derivative.
#[inline(always)]
pub(super) fn join<R: Real>(value: &Matrix<R>, slope: &Matrix<R>) -> Matrix<Dual<R>> {
    let mut result = [[Dual { value: value[0][0], slope: slope[0][0] }; 3]; 3];
    for row in 0..3 {
        for col in 0..3 {
            result[row][col] = Dual { value: value[row][col], slope: slope[row][col] };
        }
    }
    result
}

/// Value and derivative of a matrix.
#[inline(always)]
pub(super) fn split<R: Real>(dual: &Matrix<Dual<R>>) -> (Matrix<R>, Matrix<R>) {
    let mut value = matrix::zero(dual[0][0].value);
    let mut slope = value;
    for row in 0..3 {
        for col in 0..3 {
            value[row][col] = dual[row][col].value;
            slope[row][col] = dual[row][col].slope;
        }
    }
    (value, slope)
}

impl<R: Real> Add for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl<R: Real> Sub for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl<R: Real> Mul for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: self.slope * other.value + self.value * other.slope,
        }
    }
}

impl<R: Real> Div for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

impl<R: Real> Neg for Dual<R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl<R: Real> Real for Dual<R> {
    #[inline(always)]
    fn splat(self, value: f64) -> Self {
        Self { value: self.value.splat(value), slope: self.value.splat(0.0) }
    }

    #[inline(always)]
    fn if_greater(self, limit: Self, then: Self, otherwise: Self) -> Self {
        Self {
            value: self.value.if_greater(limit.value, then.value, otherwise.value),
            slope: self.value.if_greater(limit.value, then.slope, otherwise.slope),
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let value = self.value.sqrt();
        Self { value, slope: self.slope / (value + value) }
    }

    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        Self { value, slope: value * self.slope }
    }

    #[inline(always)]
    fn exp_minus_one(self) -> Self {
        Self { value: self.value.exp_minus_one(), slope: self.value.exp() * self.slope }
    }

    #[inline(always)]
    fn ln(self) -> Self {
        Self { value: self.value.ln(), slope: self.slope / self.value }
    }

    #[inline(always)]
    fn rotation(dual: &Matrix<Self>) -> Matrix<Self> {
        let (value, slope) = split(dual);
        let rotation = R::rotation(&value);
        join(&rotation, &polar::rotation_slope(&rotation, &value, &slope))
    }
}
