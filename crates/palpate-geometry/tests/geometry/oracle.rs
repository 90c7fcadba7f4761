//! Do two convex hulls share a point? A linear program in exact integers that proves its answer.
//!
//! Unknown weights `λ ≥ 0` of one hull and `μ ≥ 0` of the other with `Σ λᵢ aᵢ = Σ μⱼ bⱼ`,
//! `Σ λ = Σ μ = 1`: phase one of the simplex method, Bland's rule (it ends on degenerate input),
//! fraction-free pivots (Edmonds 1967). It knows no case: not coplanar, not collinear, not touching.
//! Its end is checked here: either the weights name a common point, or the dual prices are the
//! normal of a plane strictly between the hulls.

use num_bigint::BigInt;
use palpate_geometry::Point;

use crate::integers::{Integer, Vector, dot, integer_points, narrow};

/// Whether the hulls of `a` and of `b` share a point.
pub(crate) fn hulls_intersect(a: &[Point], b: &[Point]) -> bool {
    let (points, _) = integer_points(&[a, b].concat());
    if let Some(points) = narrow(&points) {
        decide(&points[..a.len()], &points[a.len()..])
    } else {
        decide(&points[..a.len()], &points[a.len()..])
    }
}

/// Whether zero is in the hull of `vectors`: whether they have a sum of zero with weights that are not
/// negative, and not all zero.
pub(crate) fn hull_holds_zero(vectors: &[Vector<BigInt>]) -> bool {
    let zero = std::array::from_fn(|_| BigInt::ZERO);
    decide(&[zero], vectors)
}

const ROWS: usize = 5;

fn decide<T: Integer>(a: &[Vector<T>], b: &[Vector<T>]) -> bool {
    let structural = a.len() + b.len();
    let right_side = structural + ROWS;
    let mut table: Vec<Vec<T>> = (0..ROWS).map(|row| first_row(row, a, b)).collect();
    // Reduced costs of the sum of the artificial unknowns, which are the basis at the start.
    let cost = (0..=right_side).map(|column| {
        let is_artificial = (structural..right_side).contains(&column);
        let own = T::from(i64::from(is_artificial));
        table.iter().fold(own, |sum, row| sum - row[column].clone())
    });
    let cost = cost.collect();
    table.push(cost);
    let mut basis: Vec<usize> = (structural..right_side).collect();
    let mut denominator = T::one();

    while let Some(entering) = (0..structural).find(|&column| table[ROWS][column].is_negative()) {
        let leaving = leaving_row(&table, &basis, entering, right_side);
        pivot(&mut table, leaving, entering, &denominator);
        denominator = table[leaving][entering].clone();
        basis[leaving] = entering;
    }

    if table[ROWS][right_side].is_zero() {
        let mut weights = vec![T::zero(); right_side];
        for (row, &unknown) in basis.iter().enumerate() {
            weights[unknown] = table[row][right_side].clone();
        }
        check_common_point(a, b, &weights[..structural]);
        return true;
    }
    let normal = [0, 1, 2].map(|row| denominator.clone() - table[ROWS][structural + row].clone());
    check_separation(a, b, &normal);
    false
}

/// Coordinates (rows 0 to 2), sum of one hull's weights (3), of the other's (4).
fn first_row<T: Integer>(row: usize, a: &[Vector<T>], b: &[Vector<T>]) -> Vec<T> {
    let entry = |point: &Vector<T>, sum_row: usize| match row {
        0..3 => point[row].clone(),
        _ => T::from(i64::from(row == sum_row)),
    };
    let mut result: Vec<T> = a.iter().map(|point| entry(point, 3)).collect();
    result.extend(b.iter().map(|point| if row < 3 { -entry(point, 4) } else { entry(point, 4) }));
    result.extend((0..ROWS).map(|artificial| T::from(i64::from(artificial == row))));
    result.push(T::from(i64::from(row >= 3)));
    result
}

/// The row whose unknown reaches zero first; of equals that of the smallest unknown.
fn leaving_row<T: Integer>(
    table: &[Vec<T>],
    basis: &[usize],
    entering: usize,
    right_side: usize,
) -> usize {
    let mut best: Option<usize> = None;
    for row in (0..ROWS).filter(|&row| table[row][entering].is_positive()) {
        let is_better = best.is_none_or(|best| {
            let left = table[row][right_side].clone() * table[best][entering].clone();
            let right = table[best][right_side].clone() * table[row][entering].clone();
            left < right || (left == right && basis[row] < basis[best])
        });
        if is_better {
            best = Some(row);
        }
    }
    best.expect("a sum of non-negative unknowns is bounded below")
}

fn pivot<T: Integer>(table: &mut [Vec<T>], leaving: usize, entering: usize, denominator: &T) {
    let pivot_row = table[leaving].clone();
    let pivot = &pivot_row[entering];
    for row in table.iter_mut().enumerate().filter(|(row, _)| *row != leaving).map(|(_, row)| row) {
        let factor = row[entering].clone();
        for (value, above) in row.iter_mut().zip(&pivot_row) {
            let numerator = value.clone() * pivot.clone() - factor.clone() * above.clone();
            *value = numerator / denominator.clone();
        }
    }
}

fn check_common_point<T: Integer>(a: &[Vector<T>], b: &[Vector<T>], weights: &[T]) {
    assert!(weights.iter().all(|weight| !weight.is_negative()));
    let sum = |values: &[T]| values.iter().fold(T::zero(), |sum, value| sum + value.clone());
    let mean = |points: &[Vector<T>], weights: &[T], axis: usize| {
        let terms = points.iter().zip(weights);
        terms.fold(T::zero(), |sum, (point, w)| sum + point[axis].clone() * w.clone())
    };
    let (lambda, mu) = weights.split_at(a.len());
    assert!(sum(lambda).is_positive() && sum(lambda) == sum(mu));
    assert!((0..3).all(|axis| mean(a, lambda, axis) == mean(b, mu, axis)));
}

fn check_separation<T: Integer>(a: &[Vector<T>], b: &[Vector<T>], normal: &Vector<T>) {
    assert!(a.iter().all(|p| b.iter().all(|q| dot(normal, p) < dot(normal, q))));
}
