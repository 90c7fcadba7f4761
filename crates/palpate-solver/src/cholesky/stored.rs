//! How the columns of panels are stored, and the two products of a solve with them.

use bytemuck::Pod;
use pulp::Simd;

use super::packed::{LANES, Panel, ROWS};
use super::real::Real;

/// A column of a panel as it is stored.
pub(super) trait Stored: Pod {
    /// What is calculated with.
    type Real: Real;

    const ZERO: Self;

    /// Stores the columns that `fill` writes, all of them. `memory` may be used for them.
    fn fill(
        columns: &mut [Self],
        memory: &mut Vec<Panel<Self::Real>>,
        fill: impl FnOnce(&mut [Panel<Self::Real>]),
    );

    /// The columns of one panel as numbers, in `memory` where that is needed.
    fn panel<'a>(
        columns: &'a [Self],
        memory: &'a mut [Panel<Self::Real>],
    ) -> &'a [Panel<Self::Real>];

    /// Columns of memory that [`Stored::panel`] needs for up to `widest` columns.
    fn memory_columns(widest: usize) -> usize;

    /// `panel * top` for the rows of one panel.
    fn product<S: Simd, const K: usize>(
        simd: S,
        panel: &[Self],
        top: &[[Self::Real; K]],
    ) -> [[Self::Real; ROWS]; K];

    /// Adds `panel^T * values` to the running sums of each column.
    fn add_transposed_product<S: Simd, const K: usize>(
        simd: S,
        panel: &[Self],
        values: &[[Self::Real; ROWS]; K],
        sums: &mut [[[Self::Real; LANES]; K]],
    );
}

#[allow(clippy::inline_always)] // compiled for the vector unit of the caller
impl<T: Real> Stored for Panel<T> {
    type Real = T;

    const ZERO: Self = Self([T::ZERO; ROWS]);

    fn fill(columns: &mut [Self], _: &mut Vec<Self>, fill: impl FnOnce(&mut [Self])) {
        fill(columns);
    }

    #[inline(always)]
    fn panel<'a>(columns: &'a [Self], _: &'a mut [Self]) -> &'a [Self] {
        columns
    }

    fn memory_columns(_: usize) -> usize {
        0
    }

    #[inline(always)]
    fn product<S: Simd, const K: usize>(simd: S, panel: &[Self], top: &[[T; K]]) -> [[T; ROWS]; K] {
        let mut result = [[T::ZERO; ROWS]; K];
        let count = ROWS / T::lanes::<S>();
        let mut first = 0;
        // As many chains at once as hide the latency of a multiplication and fit in the registers.
        if K == 1 {
            while first + 4 <= count {
                rows_product::<S, T, K, 4>(simd, panel, top, first, &mut result);
                first += 4;
            }
        }
        while first + 2 <= count {
            rows_product::<S, T, K, 2>(simd, panel, top, first, &mut result);
            first += 2;
        }
        result
    }

    #[inline(always)]
    fn add_transposed_product<S: Simd, const K: usize>(
        simd: S,
        panel: &[Self],
        values: &[[T; ROWS]; K],
        sums: &mut [[[T; LANES]; K]],
    ) {
        let per_sum = LANES / T::lanes::<S>();
        for (column, sums) in panel.iter().zip(sums) {
            let column = T::vectors::<S>(&column.0);
            for (sums, values) in sums.iter_mut().zip(values) {
                let sums = T::vectors_mut::<S>(sums);
                let values = T::vectors::<S>(values);
                for i in 0..per_sum {
                    let half = T::mul_add(simd, column[i], values[i], sums[i]);
                    sums[i] = T::mul_add(simd, column[i + per_sum], values[i + per_sum], half);
                }
            }
        }
    }
}

/// `panel * top` for `G` vectors of rows from vector `first` on.
#[allow(clippy::inline_always)] // as above
#[inline(always)]
fn rows_product<S: Simd, T: Real, const K: usize, const G: usize>(
    simd: S,
    panel: &[Panel<T>],
    top: &[[T; K]],
    first: usize,
    result: &mut [[T; ROWS]; K],
) {
    let mut sums = [[T::splat(simd, T::ZERO); G]; K];
    for (column, factor) in panel.iter().zip(top) {
        let column = &T::vectors::<S>(&column.0)[first..first + G];
        for k in 0..K {
            let factor = T::splat(simd, factor[k]);
            for i in 0..G {
                sums[k][i] = T::mul_add(simd, column[i], factor, sums[k][i]);
            }
        }
    }
    for k in 0..K {
        T::vectors_mut::<S>(&mut result[k])[first..first + G].copy_from_slice(&sums[k]);
    }
}
