//! Sums of rows of a dense matrix.

/// Adds `factors[i]` times row `rows[i]` of a matrix with rows of `sum.len()` entries to `sum`.
///
/// The order of the additions depends on `rows` alone. Bound by reading the rows once.
///
/// # Panics
/// If a row does not exist, or there is not one factor per row.
pub fn add_rows(matrix: &[f64], rows: &[u32], factors: &[f64], sum: &mut [f64]) {
    assert_eq!(rows.len(), factors.len(), "one factor per row");
    pulp::Arch::new().dispatch(|| add_rows_here(matrix, rows, factors, sum));
}

#[allow(clippy::inline_always)] // compiled for the vector unit that `dispatch` found
#[inline(always)]
fn add_rows_here(matrix: &[f64], rows: &[u32], factors: &[f64], sum: &mut [f64]) {
    let size = sum.len();
    let row = |index: u32| &matrix[index as usize * size..][..size];
    let (fours, rest) = rows.as_chunks::<4>();
    let (factor_fours, factor_rest) = factors.as_chunks::<4>();
    for (four, f) in fours.iter().zip(factor_fours) {
        let [a, b, c, d] = four.map(row);
        let lines = sum.iter_mut().zip(a).zip(b).zip(c).zip(d);
        for ((((sum, a), b), c), d) in lines {
            *sum += (f[0] * a + f[1] * b) + (f[2] * c + f[3] * d);
        }
    }
    for (&index, factor) in rest.iter().zip(factor_rest) {
        for (sum, entry) in sum.iter_mut().zip(row(index)) {
            *sum += factor * entry;
        }
    }
}
