//! `triangles_intersect` and `segment_triangle_intersect` against the linear program.

use std::sync::atomic::{AtomicUsize, Ordering};

use palpate_geometry::{Point, intersection::segment_triangle_intersect, triangles_intersect};
use proptest::prelude::*;

use crate::{
    oracle::hulls_intersect,
    strategies::{any_floats, floats, for_all, grid, perturbed_grid, scaled_grid},
};

const PERMUTATIONS: [[usize; 3]; 6] =
    [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

fn split(points: &[Point; 6]) -> ([Point; 3], [Point; 3]) {
    let [a, b, c, d, e, f] = *points;
    ([a, b, c], [d, e, f])
}

/// Compares `cases` pairs with the oracle; at least a twentieth must meet, and miss.
fn triangles_agree(strategy: impl Strategy<Value = [Point; 6]>, cases: u32) {
    let hits = AtomicUsize::new(0);
    for_all(strategy, cases, |points| {
        let (a, b) = split(&points);
        let expected = hulls_intersect(&a, &b);
        hits.fetch_add(usize::from(expected), Ordering::Relaxed);
        prop_assert_eq!(triangles_intersect(&a, &b), expected);
        prop_assert_eq!(triangles_intersect(&b, &a), expected);
        Ok(())
    });
    let hits = hits.into_inner() as u32;
    assert!(20 * hits > cases && 20 * (cases - hits) > cases, "{hits} of {cases} meet");
}

#[test]
fn triangles_of_a_grid() {
    triangles_agree(grid(), 100_000);
}

#[test]
fn triangles_of_a_grid_at_extreme_scales() {
    triangles_agree(scaled_grid(), 20_000);
}

#[test]
fn triangles_of_a_grid_moved_by_ulps() {
    triangles_agree(perturbed_grid(), 20_000);
}

#[test]
fn triangles_with_rounded_combinations() {
    triangles_agree(floats(), 20_000);
}

#[test]
fn triangles_of_all_magnitudes_at_once() {
    triangles_agree(any_floats(), 500);
}

fn segments_agree(strategy: impl Strategy<Value = [Point; 5]>, cases: u32) {
    for_all(strategy, cases, |[a, b, c, d, e]| {
        let (triangle, segment) = ([a, b, c], [d, e]);
        let expected = hulls_intersect(&segment, &triangle);
        for corners in PERMUTATIONS.map(|order| order.map(|i| triangle[i])) {
            prop_assert_eq!(segment_triangle_intersect(&segment, &corners), expected);
            prop_assert_eq!(segment_triangle_intersect(&[e, d], &corners), expected);
        }
        Ok(())
    });
}

#[test]
fn segments_and_triangles() {
    segments_agree(grid(), 30_000);
    segments_agree(scaled_grid(), 5_000);
    segments_agree(perturbed_grid(), 5_000);
    segments_agree(floats(), 5_000);
}

#[test]
fn neither_the_order_of_triangles_nor_of_corners_matters() {
    let strategy = prop_oneof![grid(), perturbed_grid(), scaled_grid()];
    for_all(strategy, 5_000, |points| {
        let (a, b) = split(&points);
        let expected = triangles_intersect(&a, &b);
        for a in PERMUTATIONS.map(|order| order.map(|i| a[i])) {
            for b in PERMUTATIONS.map(|order| order.map(|i| b[i])) {
                prop_assert_eq!(triangles_intersect(&a, &b), expected);
                prop_assert_eq!(triangles_intersect(&b, &a), expected);
            }
        }
        Ok(())
    });
}

/// Every pair of a 2 x 2 x 2 grid: all ways in which eight points can be shared and degenerate.
#[test]
fn every_pair_of_triangles_of_the_unit_cube() {
    let corner = |i: usize| [i & 1, (i >> 1) & 1, i >> 2].map(|bit| bit as f64);
    let triangles = (0..512).map(|i| [i & 7, (i >> 3) & 7, i >> 6]);
    // Sorted corners only: their order is another test's question.
    let triangles = triangles.filter(|[i, j, k]| i <= j && j <= k);
    let triangles: Vec<[Point; 3]> = triangles.map(|corners| corners.map(corner)).collect();
    for a in &triangles {
        for b in &triangles {
            assert_eq!(triangles_intersect(a, b), hulls_intersect(a, b), "{a:?} {b:?}");
        }
    }
}
