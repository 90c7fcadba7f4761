//! Pairs of triangles that an axis proves to be apart: a one-sided filter before the exact test.

use super::boxes::corners;
use super::{WIDTH, WideBody};
use crate::simd::{Kernel, Lanes};

/// Bounds the error of a projection's gap by this part of |axis| (sum of its components) times eight
/// times the largest coordinate M: a coordinate is off by 2⁻²³ M at most, a difference of two and
/// the scalar product by 2⁻²² of terms up to 2 M, and two projections are compared; together below
/// 2.2 · 2⁻²⁰ M, here 3 · 2⁻²⁰ M.
const ERROR: f32 = 3.0 / 8_388_608.0;

/// How far apart is enough, and the scale of the rounding errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    margin: f32,
    /// Eight times the largest coordinate.
    scale: f32,
}

impl Reach {
    /// Elements of two bodies further apart than `margin` are not wanted.
    pub(crate) fn new(a: &WideBody, b: &WideBody, margin: f64) -> Self {
        let largest = [a, b].map(|body| body.triangles.boxes.largest_coordinate());
        let largest = largest[0].max(largest[1]);
        let margin = if margin > 0.0 { round_up(margin) } else { 0.0 };
        Self { margin, scale: 8.0 * largest }
    }

    /// At most how far a coordinate relative to a common point is off, in `f32`: 2⁻²² of the largest.
    pub(super) fn coordinate_error(self) -> f32 {
        self.scale / 33_554_432.0
    }

    /// Lanes where the points of `a` and `b`, relative to a common point, lie on two sides of a slab
    /// across `axis` wider than the margin. Any axis is right, the best is along the closest points.
    #[inline(always)]
    pub(super) fn separated<L: Lanes, const A: usize, const B: usize>(
        self,
        axis: [L; 3],
        a: [[L; 3]; A],
        b: [[L; 3]; B],
    ) -> L {
        let ([min_a, max_a], [min_b, max_b]) = (extent(axis, a), extent(axis, b));
        let gap = min_b.sub(max_a).max(min_a.sub(max_b));
        let sum = axis[0].abs().add(axis[1].abs()).add(axis[2].abs());
        // Infinite where a projection could overflow, so that it decides nothing.
        let error = sum.mul(L::splat(self.scale)).mul(L::splat(ERROR));
        let mut needed = error.add(L::splat(16.0 * f32::MIN_POSITIVE));
        if self.margin > 0.0 {
            // An upper bound of the norm: squares that underflow, and half a dozen roundings.
            let norm = dot(axis, axis).add(L::splat(f32::MIN_POSITIVE)).sqrt();
            let norm = norm.mul(L::splat(1.0 + 4.0 * f32::EPSILON));
            needed = needed.add(norm.mul(L::splat(self.margin)));
        }
        gap.gt(needed)
    }
}

/// Least and largest projection of some points.
#[inline(always)]
fn extent<L: Lanes, const N: usize>(axis: [L; 3], points: [[L; 3]; N]) -> [L; 2] {
    let first = dot(axis, points[0]);
    let (mut min, mut max) = (first, first);
    for &point in &points[1..] {
        let along = dot(axis, point);
        min = min.min(along);
        max = max.max(along);
    }
    [min, max]
}

/// At least `value`, which is not negative.
pub(super) fn round_up(value: f64) -> f32 {
    value as f32 * (1.0 + 2.0 * f32::EPSILON) + f32::MIN_POSITIVE
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

#[inline(always)]
pub(super) fn sub<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
pub(super) fn cross<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [
        a[1].mul(b[2]).sub(a[2].mul(b[1])),
        a[2].mul(b[0]).sub(a[0].mul(b[2])),
        a[0].mul(b[1]).sub(a[1].mul(b[0])),
    ]
}

/// Passes on the candidates that no axis separates: the normals of both triangles, and across each edge
/// within the plane.
pub(crate) struct SeparateTriangles<'a> {
    pub(crate) a: &'a WideBody,
    pub(crate) b: &'a WideBody,
    pub(crate) reach: Reach,
    /// Slots of a and of b.
    pub(crate) candidates: &'a [[u32; 2]],
    pub(crate) kept: &'a mut Vec<[u32; 2]>,
}

impl Kernel for SeparateTriangles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { a, b, reach, candidates, kept } = self;
        for batch in candidates.chunks(WIDTH) {
            let (of_a, of_b) = from_corner::<L>(a, b, batch);
            let (edges_a, edges_b) = (edges(of_a), edges(of_b));
            let normal_a = cross(edges_a[0], edges_a[1]);
            let normal_b = cross(edges_b[0], edges_b[1]);
            let mut apart = reach.separated(normal_a, of_a, of_b);
            apart = apart.or(reach.separated(normal_b, of_a, of_b));
            if apart.bits() != 0xff {
                for i in 0..3 {
                    apart = apart.or(reach.separated(cross(edges_a[i], normal_a), of_a, of_b));
                    apart = apart.or(reach.separated(cross(edges_b[i], normal_b), of_a, of_b));
                }
            }
            keep(batch, apart, kept);
        }
    }
}

/// Passes on the candidates that are not in the lanes `apart`.
#[inline(always)]
pub(super) fn keep<L: Lanes>(batch: &[[u32; 2]], apart: L, kept: &mut Vec<[u32; 2]>) {
    let apart = apart.bits();
    for (i, candidate) in batch.iter().enumerate() {
        if apart >> i & 1 == 0 {
            kept.push(*candidate);
        }
    }
}

/// The corners of up to eight pairs of triangles, relative to the first of a. Lanes beyond the last
/// candidate repeat the first.
#[inline(always)]
pub(super) fn from_corner<L: Lanes>(
    a: &WideBody,
    b: &WideBody,
    batch: &[[u32; 2]],
) -> ([[L; 3]; 3], [[L; 3]; 3]) {
    let lane = |i: usize| batch.get(i).unwrap_or(&batch[0]);
    let slots = |side: usize, body: &WideBody| {
        std::array::from_fn(|i| body.triangles.corners[lane(i)[side] as usize])
    };
    let [a0, a1, a2] = corners::<L>(&a.nodes, &slots(0, a));
    let [b0, b1, b2] = corners::<L>(&b.nodes, &slots(1, b));
    let zero = [L::splat(0.0); 3];
    ([zero, sub(a1, a0), sub(a2, a0)], [sub(b0, a0), sub(b1, a0), sub(b2, a0)])
}

/// From each corner to the next.
#[inline(always)]
pub(super) fn edges<L: Lanes>([a, b, c]: [[L; 3]; 3]) -> [[L; 3]; 3] {
    [sub(b, a), sub(c, b), sub(a, c)]
}
