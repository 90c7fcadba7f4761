//! Input made to be nasty: few grid points used again and again, exactly and almost coplanar,
//! far away, tiny, huge.

use palpate_geometry::Point;
use proptest::{
    array::uniform3, collection::vec, prelude::*, sample::select, test_runner::TestCaseResult,
    test_runner::TestRunner,
};

/// Runs `check` on `cases` values of `strategy`; panics with the smallest counter-example found.
pub(crate) fn for_all<S: Strategy>(
    strategy: S,
    cases: u32,
    check: impl Fn(S::Value) -> TestCaseResult,
) {
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let outcome = TestRunner::new(config).run(&strategy, check);
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

/// `N` points of a small integer grid (possibly sheared by an integer matrix and moved far away)
/// at a scale of a power of two: exactly degenerate in every way. The first three are free; each
/// later one may be any of the earlier, an affine combination of the first three, or free.
pub(crate) fn grid<const N: usize>() -> impl Strategy<Value = [Point; N]> {
    (integer_points(), matrix(), offset()).prop_map(|(points, matrix, offset)| {
        points.map(|point: [i64; 3]| place(point, &matrix, offset).map(|value| value as f64))
    })
}

/// `grid` at scales from the smallest to the largest numbers.
pub(crate) fn scaled_grid<const N: usize>() -> impl Strategy<Value = [Point; N]> {
    (grid(), select(vec![-1074, -1040, -1022, -530, -350, -60, 60, 280, 498, 900, 970]))
        .prop_map(|(points, exponent)| scale(points, exponent))
}

/// `grid` within a few units in the last place of each coordinate: almost degenerate.
pub(crate) fn perturbed_grid<const N: usize>() -> impl Strategy<Value = [Point; N]> {
    let ulps = vec(select(vec![0, 0, 0, 0, -1, 1, 2]), 3 * N);
    (grid(), ulps, select(vec![0, 0, 0, -3, -530, 498])).prop_map(
        |(points, ulps, exponent): ([Point; N], Vec<i32>, i32)| {
            let mut points = scale(points, exponent);
            for (value, &ulps) in points.as_flattened_mut().iter_mut().zip(&ulps) {
                for _ in 0..ulps.abs() {
                    *value = if ulps > 0 { value.next_up() } else { value.next_down() };
                }
            }
            points
        },
    )
}

/// Floats with full mantissas; later points rounded affine combinations of the first three, as a
/// simulation makes them.
pub(crate) fn floats<const N: usize>() -> impl Strategy<Value = [Point; N]> {
    let point = || uniform3(-1.0..1.0_f64);
    let later = (0..5, point(), 0..3_usize);
    (vec(point(), N), vec(later, N)).prop_map(|(mut points, later): (Vec<Point>, Vec<_>)| {
        for (i, (kind, weights, other)) in later.into_iter().enumerate().skip(3) {
            let [a, b, c]: [Point; 3] = [points[0], points[1], points[2]];
            match kind {
                0 => points[i] = points[other],
                1 => {
                    let [u, v, _] = weights;
                    points[i] = [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
                }
                2 => {
                    let near = |value: f64| value + 1e-14 * weights[2];
                    points[i] = [0, 1, 2].map(|k| near(a[k] + weights[0] * (b[k] - a[k])));
                }
                _ => {}
            }
        }
        points.try_into().expect("N points")
    })
}

/// Any finite floats at all, of every magnitude at once.
pub(crate) fn any_floats<const N: usize>() -> impl Strategy<Value = [Point; N]> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    let value = || POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO;
    vec(uniform3(value()), N).prop_map(|points| points.try_into().expect("N points"))
}

fn integer_points<const N: usize>() -> impl Strategy<Value = [[i64; 3]; N]> {
    let free = || select(vec![1_i64, 2, 2, 4, 9]);
    let point = |reach: i64| uniform3(-reach..=reach);
    let later = (0..4, 0..64_usize, uniform3(-3..=5_i64));
    (free().prop_flat_map(move |reach| vec(point(reach), N)), vec(later, N)).prop_map(
        |(mut points, later)| {
            // Quarters of the first three points' differences stay integers.
            points.iter_mut().take(3).for_each(|point| *point = point.map(|value| 4 * value));
            for (i, (kind, other, [u, v, _])) in later.into_iter().enumerate().skip(1) {
                let [a, b, c] = [points[0], points[1], points[2]];
                match kind {
                    0 if other % 3 == 0 || i >= 3 => points[i] = points[other % i],
                    1 if i >= 3 => {
                        points[i] =
                            [0, 1, 2].map(|k| a[k] + (u * (b[k] - a[k]) + v * (c[k] - a[k])) / 4);
                    }
                    _ => {}
                }
            }
            points.try_into().expect("N points")
        },
    )
}

fn matrix() -> impl Strategy<Value = [[i64; 3]; 3]> {
    prop_oneof![Just([[1, 0, 0], [0, 1, 0], [0, 0, 1]]), uniform3(uniform3(-3..=3_i64))]
}

fn offset() -> impl Strategy<Value = [i64; 3]> {
    prop_oneof![2 => Just([0; 3]), 1 => uniform3(select(vec![0, 1 << 20, 3 << 38, -(5 << 44)]))]
}

fn place(point: [i64; 3], matrix: &[[i64; 3]; 3], offset: [i64; 3]) -> [i64; 3] {
    [0, 1, 2].map(|i| offset[i] + (0..3).map(|j| matrix[i][j] * point[j]).sum::<i64>())
}

/// Times 2^`exponent`, in two factors since one alone may be no normal number.
fn scale<const N: usize>(points: [Point; N], exponent: i32) -> [Point; N] {
    let factors = [exponent / 2, exponent - exponent / 2].map(|half| 2.0_f64.powi(half));
    points.map(|point| point.map(|value| value * factors[0] * factors[1]))
}
