//! What of two elements is closest to each other, where `f32` is certain of it.
//!
//! A component of a vector between two points is off by `D` = three times `Reach::coordinate_error` at most, two points
//! relative to a third being subtracted. So a scalar product `u . w` is off by `2 D (|u| + |w|)` at most, norms
//! being sums of components, its own rounding included; and `(u . w) v² - (u . v) (v . w)`, which tells on which side of a
//! line through u and v a point lies, by `10 D l² (l + |w|)` where l = |u| + |v|: the sum over the factors of
//! each term, and as much again for what is rounded. A third more at least is asked for, which covers the
//! `f64` code as well: it is off by some 2⁻⁵⁰ of the size. Squares of `D` may be left out: a result that exceeds its error
//! has edges longer than 8 D.

use super::separation::{Reach, dot, sub};
use crate::simd::Lanes;

/// Lanes where the closest points of the lines through two edges certainly do not both lie between the ends: the
/// edge from the origin along `u`, and `b`.
#[inline(always)]
pub(super) fn closest_beyond_ends<L: Lanes>(reach: Reach, u: [L; 3], b: [[L; 3]; 2]) -> L {
    let v = sub(b[1], b[0]);
    let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
    let (u_offset, v_offset) = (dot(u, b[0]), dot(v, b[0]));
    // Where they are along u and v, times the determinant.
    let determinant = uu.mul(vv).sub(uv.mul(uv));
    let s = u_offset.mul(vv).sub(uv.mul(v_offset));
    let t = uv.mul(u_offset).sub(uu.mul(v_offset));
    let error = error_of_side(reach, norm(u).add(norm(v)), norm(b[0]));
    let zero = L::splat(0.0);
    let before = zero.sub(s).gt(error).or(zero.sub(t).gt(error));
    before.or(s.sub(determinant).gt(error)).or(t.sub(determinant).gt(error))
}

/// For the corners a, b, c and the edges ab, bc, ca of a triangle: in which lanes, as bits, it certainly is
/// what is closest to the origin.
#[inline(always)]
pub(super) fn closest_features<L: Lanes>(reach: Reach, corners: [[L; 3]; 3]) -> [u32; 6] {
    let [a, b, c] = corners;
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let zero = L::splat(0.0);
    // Beyond the start and the end of each edge, between them, and outside of it.
    let (mut before, mut after, mut between) = ([zero; 3], [zero; 3], [zero; 3]);
    for i in 0..3 {
        let (corner, edge, back) = (corners[i], edges[i], edges[(i + 2) % 3]);
        let square = dot(edge, edge);
        let past = zero.sub(dot(corner, edge));
        let left = square.sub(past);
        let error = error_of_product(reach, norm(corner).add(norm(edge)));
        before[i] = zero.sub(past).gt(error);
        after[i] = zero.sub(left).gt(error);
        let outside = dot(back, edge).mul(dot(edge, corner)).sub(dot(back, corner).mul(square));
        let outside = outside.gt(error_of_side(reach, norm(edge).add(norm(back)), norm(corner)));
        between[i] = past.gt(error).and(left.gt(error)).and(outside);
    }
    let mut features = [0; 6];
    for i in 0..3 {
        features[i] = before[i].and(after[(i + 2) % 3]).bits();
        features[3 + i] = between[i].bits();
    }
    features
}

/// Sum of the components.
#[inline(always)]
fn norm<L: Lanes>(vector: [L; 3]) -> L {
    vector[0].abs().add(vector[1].abs()).add(vector[2].abs())
}

/// Of a scalar product of vectors whose norms add up to `length`, less a square of one of them.
#[inline(always)]
fn error_of_product<L: Lanes>(reach: Reach, length: L) -> L {
    let error = L::splat(24.0 * reach.coordinate_error()).mul(length);
    bounded(error, length.mul(length))
}

/// Of the side on which a point at a distance of `offset` lies, by vectors whose norms add up to `length`.
#[inline(always)]
fn error_of_side<L: Lanes>(reach: Reach, length: L, offset: L) -> L {
    let sum = length.add(offset);
    let cube = length.mul(length).mul(sum);
    let error = L::splat(64.0 * reach.coordinate_error()).mul(cube);
    bounded(error, cube.mul(sum))
}

/// An error, with what underflows; infinite where terms up to `largest` could overflow.
#[inline(always)]
fn bounded<L: Lanes>(error: L, largest: L) -> L {
    let error = error.add(L::splat(16.0 * f32::MIN_POSITIVE));
    error.blend(L::splat(f32::INFINITY), largest.gt(L::splat(f32::MAX / 8.0)))
}
