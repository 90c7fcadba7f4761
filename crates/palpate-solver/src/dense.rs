//! Dense Cholesky of a small system whose size changes from call to call.

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::{MatMut, MatRef};

use crate::FactorError;

/// Memory for factoring dense symmetric positive definite matrices in place.
pub struct DenseCholesky {
    memory: MemBuffer,
    size: usize,
}

impl Default for DenseCholesky {
    fn default() -> Self {
        Self { memory: Self::memory(0), size: 0 }
    }
}

impl DenseCholesky {
    fn memory(size: usize) -> MemBuffer {
        let params = faer::Spec::default();
        MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(size, Par::Seq, params))
    }

    /// Solves `matrix * x = rhs` in place; `matrix` (n x n, its lower triangle column by column)
    /// becomes the factor. Allocates only when n exceeds every n before.
    ///
    /// # Errors
    /// If a pivot is not positive: [`FactorError::NotPositiveDefinite`] with its row.
    ///
    /// # Panics
    /// If `matrix` has not n² entries for the n of `rhs`.
    pub fn solve_in_place(
        &mut self,
        matrix: &mut [f64],
        rhs: &mut [f64],
    ) -> Result<(), FactorError> {
        let size = rhs.len();
        assert_eq!(matrix.len(), size * size, "matrix size");
        if size > self.size {
            self.size = size.next_power_of_two();
            self.memory = Self::memory(self.size);
        }
        let stack = MemStack::new(&mut self.memory);
        let params = faer::Spec::default();
        llt::factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(matrix, size, size),
            llt::factor::LltRegularization::default(),
            Par::Seq,
            stack,
            params,
        )
        .map_err(|llt::factor::LltError::NonPositivePivot { index }| {
            FactorError::NotPositiveDefinite { node: index / 3, column: index }
        })?;
        let factor = MatRef::from_column_major_slice(&*matrix, size, size);
        let rhs = MatMut::from_column_major_slice_mut(rhs, size, 1);
        llt::solve::solve_in_place(factor, rhs, Par::Seq, stack);
        Ok(())
    }
}
