//! A vector register of f64 as a number.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

use super::matrix::Matrix;
use super::polar;
use super::real::Real;

/// Elements that are computed together.
pub(super) const LANES: usize = 8;

/// One number of each of the elements of a group.
pub(super) type Eight = [f64; LANES];

/// Some of the lanes of an [`Eight`]: as many as the vector unit has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wide<S: Simd> {
    simd: S,
    lanes: S::f64s,
}

/// Vector registers that hold an [`Eight`].
#[inline(always)]
pub(super) const fn parts<S: Simd>() -> usize {
    LANES / S::F64_LANES
}

impl<S: Simd> Wide<S> {
    /// Register `part` of `eight`.
    #[inline(always)]
    pub(super) fn load(simd: S, eight: &Eight, part: usize) -> Self {
        Self { simd, lanes: S::as_simd_f64s(eight).0[part] }
    }

    /// Writes register `part` of `eight`.
    #[inline(always)]
    pub(super) fn store(self, eight: &mut Eight, part: usize) {
        S::as_mut_simd_f64s(eight).0[part] = self.lanes;
    }

    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        let mut eight = [0.0; LANES];
        self.store(&mut eight, 0);
        for lane in &mut eight[..S::F64_LANES] {
            *lane = function(*lane);
        }
        Self::load(self.simd, &eight, 0)
    }
}

impl<S: Simd> Add for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { simd: self.simd, lanes: self.simd.add_f64s(self.lanes, other.lanes) }
    }
}

impl<S: Simd> Sub for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { simd: self.simd, lanes: self.simd.sub_f64s(self.lanes, other.lanes) }
    }
}

impl<S: Simd> Mul for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { simd: self.simd, lanes: self.simd.mul_f64s(self.lanes, other.lanes) }
    }
}

impl<S: Simd> Div for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self { simd: self.simd, lanes: self.simd.div_f64s(self.lanes, other.lanes) }
    }
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { simd: self.simd, lanes: self.simd.neg_f64s(self.lanes) }
    }
}

impl<S: Simd> Real for Wide<S> {
    #[inline(always)]
    fn splat(self, value: f64) -> Self {
        Self { simd: self.simd, lanes: self.simd.splat_f64s(value) }
    }

    #[inline(always)]
    fn if_greater(self, limit: Self, then: Self, otherwise: Self) -> Self {
        let mask = self.simd.greater_than_f64s(self.lanes, limit.lanes);
        let lanes = self.simd.select_f64s(mask, then.lanes, otherwise.lanes);
        Self { simd: self.simd, lanes }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { simd: self.simd, lanes: self.simd.sqrt_f64s(self.lanes) }
    }

    #[inline(always)]
    fn exp(self) -> Self {
        self.map(Real::exp)
    }

    #[inline(always)]
    fn exp_minus_one(self) -> Self {
        self.map(Real::exp_minus_one)
    }

    #[inline(always)]
    fn ln(self) -> Self {
        self.map(Real::ln)
    }

    #[inline(always)]
    fn rotation(matrix: &Matrix<Self>) -> Matrix<Self> {
        polar::rotation(matrix)
    }
}
