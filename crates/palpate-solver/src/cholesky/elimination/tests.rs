//! Fronts eliminated entry by entry, and on a vector unit without vectors.

use proptest::prelude::*;
use pulp::WithSimd;

use super::{Elimination, Finish, Front};
use crate::cholesky::product::Product;

/// The lower triangle of a positive definite front, as its first columns and the rest.
fn front(width: usize, below: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let height = width + below;
    let mut state = seed | 1;
    let mut draw = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut columns = vec![0.0; height * width];
    for column in 0..width {
        for row in column..height {
            columns[column * height + row] = draw();
        }
        columns[column * height + column] = height as f64;
    }
    (columns, (0..below * below).map(|_| draw()).collect())
}

struct Plain {
    columns: Vec<f64>,
    contribution: Vec<f64>,
    finished: Vec<f64>,
}

fn eliminate_plainly(mut columns: Vec<f64>, width: usize, mut contribution: Vec<f64>) -> Plain {
    let height = columns.len() / width;
    let below = height - width;
    for k in 0..width {
        let root = columns[k * height + k].sqrt();
        for row in k..height {
            columns[k * height + row] /= root;
        }
        for col in k + 1..width {
            for row in col..height {
                columns[col * height + row] -=
                    columns[k * height + row] * columns[k * height + col];
            }
        }
        for col in 0..below {
            for row in col..below {
                contribution[col * below + row] -=
                    columns[k * height + width + row] * columns[k * height + width + col];
            }
        }
    }
    // Every row of X from X T = [1; B].
    let mut finished = vec![0.0; height * width];
    for row in 0..height {
        for col in (0..width).rev() {
            let right = if row < width {
                f64::from(u8::from(row == col))
            } else {
                columns[col * height + row]
            };
            let known: f64 = (col + 1..width)
                .map(|k| finished[k * height + row] * columns[col * height + k])
                .sum();
            finished[col * height + row] = (right - known) / columns[col * height + col];
        }
    }
    Plain { columns, contribution, finished }
}

fn is_lower(entry: usize, height: usize) -> bool {
    entry % height >= entry / height
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn a_front_is_eliminated_as_entry_by_entry(
        width in 1_usize..150,
        below in 0_usize..90,
        seed in any::<u64>(),
    ) {
        let height = width + below;
        let (given, given_rest) = front(width, below, seed);
        let mut elimination = Elimination::default();
        let (mut columns, mut contribution) = (given.clone(), given_rest.clone());
        elimination.eliminate(&mut columns, width, &mut contribution).unwrap();
        let mut finished = columns.clone();
        elimination.finish(&mut finished, width, &mut Product::default());

        let plain = eliminate_plainly(given.clone(), width, given_rest.clone());
        for (entry, (found, exact)) in columns.iter().zip(&plain.columns).enumerate() {
            prop_assert!(!is_lower(entry, height) || (found - exact).abs() < 1e-12);
        }
        for (entry, (found, exact)) in contribution.iter().zip(&plain.contribution).enumerate() {
            prop_assert!(!is_lower(entry, below) || (found - exact).abs() < 1e-12);
        }
        for (found, exact) in finished.iter().zip(&plain.finished) {
            prop_assert!((found - exact).abs() < 1e-12);
        }

        let (mut scalar_columns, mut scalar_contribution) = (given, given_rest);
        let mut memory = Elimination::default();
        let scalar = pulp::Scalar::new();
        Front {
            columns: &mut scalar_columns,
            width,
            height,
            contribution: &mut scalar_contribution,
            memory: &mut memory,
        }
        .with_simd(scalar)
        .unwrap();
        let mut scalar_finished = scalar_columns.clone();
        let mut product = Product::default();
        Finish {
            columns: &mut scalar_finished,
            width,
            height,
            inverses: &memory.inverses,
            product: &mut product,
        }
        .with_simd(scalar);
        for (entry, (one, other)) in contribution.iter().zip(&scalar_contribution).enumerate() {
            prop_assert!(!is_lower(entry, below) || one.to_bits() == other.to_bits());
        }
        for (one, other) in finished.iter().zip(&scalar_finished) {
            prop_assert_eq!(one.to_bits(), other.to_bits());
        }
    }

    #[test]
    fn a_pivot_that_is_not_positive_is_named(width in 1_usize..80, pivot in 0_usize..80, kind in 0..3) {
        let pivot = pivot % width;
        let (mut columns, _) = front(width, 0, 7);
        columns[pivot * width + pivot] = [-1.0, f64::NAN, f64::INFINITY][kind as usize];
        let found = Elimination::default().eliminate(&mut columns, width, &mut []);
        prop_assert_eq!(found, Err(pivot));
    }
}
