//! Triangles that share a corner or an edge against cones in exact integers.

use num_bigint::BigInt;
use num_traits::{Signed, Zero};
use palpate_geometry::{
    Point, triangles_intersect, triangles_intersect_beyond_edge, triangles_intersect_beyond_node,
};
use proptest::prelude::*;

use crate::{
    integers::{Vector, cross, dot, integer_points},
    oracle::hull_holds_zero,
    strategies::{floats, for_all, grid, perturbed_grid, scaled_grid},
};

type Vectors = Vec<Vector<BigInt>>;

fn is_zero(vector: &Vector<BigInt>) -> bool {
    vector.iter().all(Zero::is_zero)
}

/// What a triangle spans from its corner, as cones without a line in them: one where it has an area.
fn cones(u: &Vector<BigInt>, v: &Vector<BigInt>) -> Vec<Vectors> {
    if !is_zero(&cross(u, v)) {
        return vec![vec![u.clone(), v.clone()]];
    }
    [u, v].into_iter().filter(|ray| !is_zero(ray)).map(|ray| vec![ray.clone()]).collect()
}

/// Near the common corner the triangles are cones, and these have a ray in common or only their apex.
fn beyond_node(v: Point, a: [Point; 2], b: [Point; 2]) -> bool {
    let (points, _) = integer_points(&[v, a[0], a[1], b[0], b[1]]);
    let cones_b = cones(&points[3], &points[4]);
    cones(&points[1], &points[2]).iter().any(|cone_a| {
        cones_b.iter().any(|cone_b| {
            let minus_b = cone_b.iter().map(|ray| ray.clone().map(|value| -value));
            hull_holds_zero(&cone_a.iter().cloned().chain(minus_b).collect::<Vectors>())
        })
    })
}

/// Half-planes from the line of the edge, or points on that line.
fn beyond_edge([v, w]: [Point; 2], a: Point, b: Point) -> bool {
    if v == w {
        return beyond_node(v, [a, a], [b, b]);
    }
    let (points, _) = integer_points(&[v, w, a, b]);
    let (edge, a, b) = (&points[1], &points[2], &points[3]);
    let (normal_a, normal_b) = (cross(edge, a), cross(edge, b));
    if is_zero(&normal_a) && is_zero(&normal_b) {
        let (along_a, along_b, end) = (dot(edge, a), dot(edge, b), dot(edge, edge));
        return (along_a.is_negative() && along_b.is_negative())
            || (along_a > end && along_b > end);
    }
    // Zero beside a vector that is not zero has no product above zero.
    is_zero(&cross(&normal_a, &normal_b)) && dot(&normal_a, &normal_b).is_positive()
}

fn nodes_agree(strategy: impl Strategy<Value = [Point; 5]>, cases: u32) {
    for_all(strategy, cases, |[v, a1, a2, b1, b2]| {
        let expected = beyond_node(v, [a1, a2], [b1, b2]);
        for a in [[v, a1, a2], [v, a2, a1]] {
            for b in [[v, b1, b2], [v, b2, b1]] {
                prop_assert_eq!(triangles_intersect_beyond_node(&a, &b), expected);
                prop_assert_eq!(triangles_intersect_beyond_node(&b, &a), expected);
                prop_assert!(triangles_intersect(&a, &b));
            }
        }
        Ok(())
    });
}

fn edges_agree(strategy: impl Strategy<Value = [Point; 4]>, cases: u32) {
    for_all(strategy, cases, |[v, w, a, b]| {
        let expected = beyond_edge([v, w], a, b);
        for edge in [[v, w], [w, v]] {
            prop_assert_eq!(triangles_intersect_beyond_edge(&edge, a, b), expected);
            prop_assert_eq!(triangles_intersect_beyond_edge(&edge, b, a), expected);
        }
        Ok(())
    });
}

#[test]
fn triangles_that_share_a_corner() {
    nodes_agree(grid(), 40_000);
    nodes_agree(scaled_grid(), 5_000);
    nodes_agree(perturbed_grid(), 10_000);
    nodes_agree(floats(), 5_000);
}

#[test]
fn triangles_that_share_an_edge() {
    edges_agree(grid(), 40_000);
    edges_agree(scaled_grid(), 5_000);
    edges_agree(perturbed_grid(), 10_000);
    edges_agree(floats(), 5_000);
}

/// All ways in which points of a 3 x 3 x 1 and a 2 x 2 x 2 grid can be shared and degenerate.
#[test]
fn every_pair_of_neighbours_of_small_grids() {
    let flat: Vec<Point> = (0..9).map(|i| [f64::from(i % 3), f64::from(i / 3), 0.0]).collect();
    let cube: Vec<Point> = (0..8).map(|i| [i & 1, (i >> 1) & 1, i >> 2].map(f64::from)).collect();
    for points in [flat, cube] {
        let (mut more, mut all) = (0, 0);
        for &v in &points {
            for (i, &a1) in points.iter().enumerate() {
                for &a2 in &points[..=i] {
                    for (j, &b1) in points.iter().enumerate() {
                        let edge = triangles_intersect_beyond_edge(&[v, a1], a2, b1);
                        assert_eq!(
                            edge,
                            beyond_edge([v, a1], a2, b1),
                            "{v:?} {a1:?} {a2:?} {b1:?}"
                        );
                        for &b2 in &points[..=j] {
                            let node = triangles_intersect_beyond_node(&[v, a1, a2], &[v, b1, b2]);
                            let expected = beyond_node(v, [a1, a2], [b1, b2]);
                            assert_eq!(node, expected, "{v:?}: {a1:?} {a2:?}, {b1:?} {b2:?}");
                            more += usize::from(node);
                            all += 1;
                        }
                    }
                }
            }
        }
        assert!(5 * more > all && 5 * (all - more) > all, "{more} of {all}");
    }
}

#[test]
fn a_sheet_folded_flat_over_its_edge_and_a_fan_that_overlaps_itself() {
    let edge = [[0.0; 3], [1.0, 0.0, 0.0]];
    let above = [0.4, 1.0, 0.0];
    assert!(triangles_intersect_beyond_edge(&edge, above, [5.0, 0.01, 0.0]));
    assert!(!triangles_intersect_beyond_edge(&edge, above, [0.4, -1.0, 0.0]));
    assert!(!triangles_intersect_beyond_edge(&edge, above, [0.4, 1.0, f64::MIN_POSITIVE]));
    let fan = |b: [Point; 2]| {
        triangles_intersect_beyond_node(&[[0.0; 3], edge[1], above], &[[0.0; 3], b[0], b[1]])
    };
    assert!(fan([[1.0, 0.5, -1.0], [1.0, 0.5, 1.0]]));
    assert!(!fan([[-1.0, 0.5, -1.0], [-1.0, 0.5, 1.0]]));
    assert!(!fan([[1.0, 0.5, 1e-300], [0.5, 0.25, 1.0]]));
}
