//! Exact integers in place of floats.

use num_bigint::BigInt;
use num_traits::Signed;

/// What the twins compute with: `i128` where it is wide enough, else `BigInt`.
pub(crate) trait Integer: Signed + Clone + PartialOrd + From<i64> {}

impl<T: Signed + Clone + PartialOrd + From<i64>> Integer for T {}

pub(crate) type Vector<T> = [T; 3];

/// All values times one power of two that makes them integers, and that power's exponent.
pub(crate) fn integers(values: &[f64]) -> (Vec<BigInt>, i32) {
    let parts: Vec<(i64, i32)> = values.iter().map(|&value| decode(value)).collect();
    let lowest = parts.iter().filter(|part| part.0 != 0).map(|part| part.1).min().unwrap_or(0);
    let scaled = parts.iter().map(|&(mantissa, exponent)| {
        if mantissa == 0 { BigInt::ZERO } else { BigInt::from(mantissa) << (exponent - lowest) }
    });
    (scaled.collect(), lowest)
}

/// `(m, e)` with `value = m 2^e`, `m` odd or zero.
fn decode(value: f64) -> (i64, i32) {
    let bits = value.to_bits();
    let (fraction, exponent) = ((bits & ((1 << 52) - 1)) as i64, ((bits >> 52) & 0x7ff) as i32);
    let (magnitude, exponent) =
        if exponent == 0 { (fraction, -1074) } else { (fraction | (1 << 52), exponent - 1075) };
    let mantissa = if value < 0.0 { -magnitude } else { magnitude };
    let zeros = if mantissa == 0 { 0 } else { mantissa.trailing_zeros() };
    (mantissa >> zeros, exponent + zeros as i32)
}

/// Points relative to the first, as integers in one unit; the exponent of that unit.
pub(crate) fn integer_points(points: &[[f64; 3]]) -> (Vec<Vector<BigInt>>, i32) {
    let (flat, exponent) = integers(points.as_flattened());
    let relative = flat.chunks(3).map(|p| [0, 1, 2].map(|axis| &p[axis] - &flat[axis]));
    (relative.collect(), exponent)
}

/// The same in `i128`, where no coordinate has more than 17 bits (a product of two 5 x 5
/// determinants with three such rows then fits).
pub(crate) fn narrow(points: &[Vector<BigInt>]) -> Option<Vec<Vector<i128>>> {
    let fits = points.as_flattened().iter().all(|value| value.bits() <= 17);
    fits.then(|| points.iter().map(|p| [0, 1, 2].map(|i| i128::try_from(&p[i]).unwrap())).collect())
}

pub(crate) fn sub<T: Integer>(a: &Vector<T>, b: &Vector<T>) -> Vector<T> {
    [0, 1, 2].map(|i| a[i].clone() - b[i].clone())
}

pub(crate) fn dot<T: Integer>(a: &Vector<T>, b: &Vector<T>) -> T {
    (0..3).fold(T::zero(), |sum, i| sum + a[i].clone() * b[i].clone())
}

pub(crate) fn cross<T: Integer>(a: &Vector<T>, b: &Vector<T>) -> Vector<T> {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].clone() * b[j].clone() - a[j].clone() * b[i].clone())
}
