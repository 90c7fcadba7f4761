//! Orientation signs against determinants in integers.

use num_bigint::BigInt;
use num_traits::Signed;
use palpate_geometry::{
    Point,
    predicates::{orient2d, orient3d},
    tetrahedron::orientation,
};
use proptest::prelude::*;

use crate::{
    integers::{cross, dot, integer_points},
    strategies::{any_floats, floats, for_all, grid, perturbed_grid, scaled_grid},
};

fn sign(value: &BigInt) -> i8 {
    i8::from(value.is_positive()) - i8::from(value.is_negative())
}

fn agree(strategy: impl Strategy<Value = [Point; 4]>, cases: u32) {
    for_all(strategy, cases, |points| {
        let [a, b, c, d] = points;
        let (integers, _) = integer_points(&points);
        let normal = cross(&integers[1], &integers[2]);
        let expected = sign(&dot(&normal, &integers[3]));
        prop_assert_eq!(orient3d(a, b, c, d), expected);
        prop_assert_eq!(orientation(&points), expected);
        prop_assert_eq!(orient3d(b, a, c, d), -expected);
        prop_assert_eq!(orient3d(b, c, d, a), -expected);
        for axis in 0..3 {
            let plane = |point: Point| [point[(axis + 1) % 3], point[(axis + 2) % 3]];
            let expected = sign(&normal[axis]);
            prop_assert_eq!(orient2d(plane(a), plane(b), plane(c)), expected);
            prop_assert_eq!(orient2d(plane(c), plane(b), plane(a)), -expected);
        }
        Ok(())
    });
}

#[test]
fn on_a_grid() {
    agree(grid(), 40_000);
}

#[test]
fn on_a_grid_at_extreme_scales() {
    agree(scaled_grid(), 20_000);
}

#[test]
fn on_a_grid_moved_by_ulps() {
    agree(perturbed_grid(), 40_000);
}

#[test]
fn on_rounded_combinations() {
    agree(floats(), 40_000);
}

#[test]
fn on_all_magnitudes_at_once() {
    agree(any_floats(), 5_000);
}
