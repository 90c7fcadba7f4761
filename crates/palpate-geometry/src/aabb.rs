//! Axis-aligned bounding boxes.

use crate::Point;

/// A closed axis-aligned box; empty when `min > max` on some axis.
///
/// The empty box is the identity of [`Aabb::union`] and meets nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Aabb {
    /// Smallest corner [m].
    pub min: Point,
    /// Largest corner [m].
    pub max: Point,
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// The smallest box around `points`.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        let mut result = Self::EMPTY;
        for point in points {
            result.insert(*point);
        }
        result
    }

    /// True when the box holds no point.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.min[axis] > self.max[axis])
    }

    /// Grows the box to hold `point`.
    #[inline]
    pub fn insert(&mut self, point: Point) {
        for (axis, &value) in point.iter().enumerate() {
            self.min[axis] = self.min[axis].min(value);
            self.max[axis] = self.max[axis].max(value);
        }
    }

    /// The smallest box around both.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        let mut result = *self;
        for axis in 0..3 {
            result.min[axis] = result.min[axis].min(other.min[axis]);
            result.max[axis] = result.max[axis].max(other.max[axis]);
        }
        result
    }

    /// True when the closed boxes share a point.
    #[inline]
    pub fn intersects(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis])
    }

    /// True when the closed boxes come within `margin` of each other on every axis.
    ///
    /// One-sided in floating point: the comparison is widened by an ulp, so a box pair at exactly
    /// `margin` is never lost.
    #[inline]
    pub fn intersects_within(&self, other: &Self, margin: f64) -> bool {
        (0..3).all(|axis| {
            self.min[axis] <= (other.max[axis] + margin).next_up()
                && other.min[axis] <= (self.max[axis] + margin).next_up()
        })
    }

    /// True when the closed box holds `point`.
    #[inline]
    pub fn contains(&self, point: &Point) -> bool {
        (0..3).all(|axis| self.min[axis] <= point[axis] && point[axis] <= self.max[axis])
    }

    /// Squared distance [m²] from `point` to the box, zero inside, infinite for the empty box.
    #[inline]
    pub fn distance_squared(&self, point: &Point) -> f64 {
        let mut sum = 0.0;
        for (axis, &value) in point.iter().enumerate() {
            let outside = (self.min[axis] - value).max(value - self.max[axis]).max(0.0);
            sum += outside * outside;
        }
        sum
    }

    /// Edge lengths [m]; negative or infinite for the empty box.
    pub fn extent(&self) -> Point {
        std::array::from_fn(|axis| self.max[axis] - self.min[axis])
    }

    /// Centre of the box.
    pub fn center(&self) -> Point {
        std::array::from_fn(|axis| 0.5 * self.min[axis] + 0.5 * self.max[axis])
    }

    /// The axis (0, 1 or 2) of the longest edge; the first of equals.
    pub fn longest_axis(&self) -> usize {
        let extent = self.extent();
        let mut longest = 0;
        for axis in 1..3 {
            if extent[axis] > extent[longest] {
                longest = axis;
            }
        }
        longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_box_is_the_identity_of_union_and_meets_nothing() {
        let unit = Aabb { min: [0.0; 3], max: [1.0; 3] };
        assert!(Aabb::EMPTY.is_empty());
        assert_eq!(Aabb::EMPTY.union(&unit), unit);
        assert!(!Aabb::EMPTY.intersects(&unit));
        assert!(!Aabb::EMPTY.intersects_within(&unit, 1e300));
        assert!(!Aabb::EMPTY.contains(&[0.0; 3]));
    }

    #[test]
    fn boxes_are_closed() {
        let left = Aabb { min: [0.0; 3], max: [1.0; 3] };
        let right = Aabb { min: [1.0; 3], max: [2.0; 3] };
        assert!(left.intersects(&right));
        assert!(left.contains(&[1.0; 3]));
        assert_eq!(left.distance_squared(&[2.0, 0.5, 3.0]), 5.0);
    }

    #[test]
    fn longest_axis_takes_the_first_of_equals() {
        assert_eq!(Aabb { min: [0.0; 3], max: [1.0, 2.0, 2.0] }.longest_axis(), 1);
        assert_eq!(Aabb { min: [0.0; 3], max: [1.0; 3] }.longest_axis(), 0);
    }
}
