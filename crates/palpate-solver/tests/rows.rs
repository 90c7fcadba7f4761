//! Sums of rows against one addition at a time.

use palpate_solver::add_rows;
use proptest::prelude::*;

proptest! {
    #[test]
    fn sums_of_rows_equal_the_plain_ones(
        size in 0_usize..40,
        picks in prop::collection::vec((0_u32..7, -2.0..2.0_f64), 0..12),
        seed in prop::collection::vec(-1.0..1.0_f64, 280),
    ) {
        let matrix = &seed[..7 * size];
        let (rows, factors): (Vec<u32>, Vec<f64>) = picks.into_iter().unzip();
        let mut sum = vec![0.5; size];
        add_rows(matrix, &rows, &factors, &mut sum);
        for (col, found) in sum.iter().enumerate() {
            let terms = rows.iter().zip(&factors).map(|(&row, f)| f * matrix[row as usize * size + col]);
            let expected = 0.5 + terms.sum::<f64>();
            prop_assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
    }
}
