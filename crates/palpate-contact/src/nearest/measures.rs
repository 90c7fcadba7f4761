//! Lower bounds of boxes: distance from a point, entry of a ray, and whether a half line meets them.
//!
//! Those in `f32` are rounded towards "near" by more than their arithmetic can err.

#![allow(clippy::inline_always, reason = "kernels must be inlined: see `simd`")]

use palpate_geometry::{Aabb, Point, vec3};

use super::Measure;
use crate::simd::Lanes;
use crate::wide::{Block, BlockMeasure};

/// Twice what a sum or product of `f32` errs, relatively.
const NARROW_ERROR: f32 = f32::EPSILON;

/// Coordinates whose squares `f32` can hold.
const LARGEST_COORDINATE: f32 = 1e18;

/// `point` relative to `origin` in `f32`, and how much box tests with it may err \[m\].
fn narrowed(point: Point, origin: Point, largest: f32) -> Option<([f32; 3], f32)> {
    let point: [f32; 3] = std::array::from_fn(|axis| (point[axis] - origin[axis]) as f32);
    let largest = point.iter().fold(largest, |largest, value| largest.max(value.abs()));
    let margin = 8.0 * NARROW_ERROR * largest + f32::MIN_POSITIVE;
    (largest < LARGEST_COORDINATE).then_some((point, margin))
}

/// Squared distance \[m²\] from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance(pub(crate) Point);

#[derive(Clone, Copy, Debug)]
pub(crate) struct DistanceOfBlocks {
    point: [f32; 3],
    margin: f32,
}

impl Measure for Distance {
    type OfBlocks = DistanceOfBlocks;

    #[inline]
    fn of_box(&self, bounds: &Aabb) -> f64 {
        bounds.distance_squared(&self.0)
    }

    fn of_blocks(&self, origin: Point, largest: f32) -> Option<DistanceOfBlocks> {
        let (point, margin) = narrowed(self.0, origin, largest)?;
        Some(DistanceOfBlocks { point, margin })
    }
}

impl BlockMeasure for DistanceOfBlocks {
    #[inline(always)]
    fn of_block<L: Lanes>(&self, block: &Block) -> L {
        let mut sum = L::splat(0.0);
        for axis in 0..3 {
            let point = L::splat(self.point[axis]);
            let below = L::load(&block.min[axis]).sub(point);
            let above = point.sub(L::load(&block.max[axis]));
            let outside = below.max(above).sub(L::splat(self.margin)).max(L::splat(0.0));
            sum = sum.add(outside.mul(outside));
        }
        sum.mul(L::splat(1.0 - 8.0 * NARROW_ERROR))
    }
}

/// Zero for boxes that the half line from a point along +x meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfLine(pub(crate) Point);

#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfLineOfBlocks {
    point: [f32; 3],
    margin: f32,
}

impl Measure for HalfLine {
    type OfBlocks = HalfLineOfBlocks;

    #[inline]
    fn of_box(&self, bounds: &Aabb) -> f64 {
        let point = &self.0;
        let beside =
            |axis: usize| bounds.min[axis] <= point[axis] && point[axis] <= bounds.max[axis];
        let met = bounds.max[0] >= point[0] && beside(1) && beside(2);
        if met { 0.0 } else { f64::INFINITY }
    }

    fn of_blocks(&self, origin: Point, largest: f32) -> Option<HalfLineOfBlocks> {
        let (point, margin) = narrowed(self.0, origin, largest)?;
        Some(HalfLineOfBlocks { point, margin })
    }
}

impl BlockMeasure for HalfLineOfBlocks {
    #[inline(always)]
    fn of_block<L: Lanes>(&self, block: &Block) -> L {
        let low = |axis: usize| self.point[axis] - self.margin;
        let mut met = L::splat(low(0)).le(L::load(&block.max[0]));
        met = met.and(L::load(&block.min[0]).le(L::splat(f32::MAX)));
        for axis in 1..3 {
            met = met.and(L::splat(low(axis)).le(L::load(&block.max[axis])));
            let high = L::splat(self.point[axis] + self.margin);
            met = met.and(L::load(&block.min[axis]).le(high));
        }
        L::splat(f32::INFINITY).blend(L::splat(0.0), met)
    }
}

/// Distance \[m\] along a ray of unit direction to where it enters a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    origin: Point,
    inverse: Point,
    /// What the tests of triangles may err \[m\].
    margin: f64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct EntryOfBlocks {
    origin: [f32; 3],
    inverse: [f32; 3],
    margin: f32,
}

/// Smaller parts of a direction count as this: a ray strays by less than boxes are widened.
const SMALLEST_PART: f64 = 1e-30;

impl Entry {
    /// `margin` \[m\]: what the tests of triangles may err.
    pub(crate) fn new(origin: Point, direction: Point, margin: f64) -> Self {
        let inverse = direction.map(|part| {
            if part.abs() > SMALLEST_PART { part.recip() } else { SMALLEST_PART.recip() }
        });
        Self { origin, inverse, margin: margin + f64::MIN_POSITIVE }
    }
}

impl Measure for Entry {
    type OfBlocks = EntryOfBlocks;

    #[inline]
    fn of_box(&self, bounds: &Aabb) -> f64 {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let low = (bounds.min[axis] - self.margin - self.origin[axis]) * self.inverse[axis];
            let high = (bounds.max[axis] + self.margin - self.origin[axis]) * self.inverse[axis];
            enter = enter.max(low.min(high));
            leave = leave.min(low.max(high));
        }
        let error = 16.0 * f64::EPSILON;
        let met = enter <= leave * (1.0 + error) && bounds.min[0] <= bounds.max[0];
        if met { enter * (1.0 - error) } else { f64::INFINITY }
    }

    fn of_blocks(&self, origin: Point, largest: f32) -> Option<EntryOfBlocks> {
        let (narrow, margin) = narrowed(self.origin, origin, largest)?;
        let margin = margin + (self.margin as f32).next_up();
        let usable = margin < LARGEST_COORDINATE;
        let inverse = self.inverse.map(|value| value as f32);
        usable.then_some(EntryOfBlocks { origin: narrow, inverse, margin })
    }
}

impl BlockMeasure for EntryOfBlocks {
    #[inline(always)]
    fn of_block<L: Lanes>(&self, block: &Block) -> L {
        let (mut enter, mut leave) = (L::splat(0.0), L::splat(f32::MAX));
        let margin = L::splat(self.margin);
        for axis in 0..3 {
            let (origin, inverse) = (L::splat(self.origin[axis]), L::splat(self.inverse[axis]));
            let low = L::load(&block.min[axis]).sub(margin).sub(origin).mul(inverse);
            let high = L::load(&block.max[axis]).add(margin).sub(origin).mul(inverse);
            enter = low.min(high).max(enter);
            leave = low.max(high).min(leave);
        }
        let error = 16.0 * NARROW_ERROR;
        let met = enter.le(leave.mul(L::splat(1.0 + error)));
        let met = met.and(L::load(&block.min[0]).le(L::load(&block.max[0])));
        L::splat(f32::INFINITY).blend(enter.mul(L::splat(1.0 - error)), met)
    }
}

/// A bound \[m\] of what differences of coordinates near `bounds` and `point` err by rounding.
pub(crate) fn rounding_at(bounds: &Aabb, point: &Point) -> f64 {
    let empty = bounds.is_empty();
    let largest = [bounds.min, bounds.max]
        .iter()
        .filter(|_| !empty)
        .fold(vec3::max_abs(*point), |largest, &corner| largest.max(vec3::max_abs(corner)));
    if largest.is_finite() { 16.0 * f64::EPSILON * largest } else { 0.0 }
}
