//! Sparse Cholesky for elastic bodies: order, factor, solve.
//!
//! Matrices are symmetric positive definite with one 3x3 block per pair of nodes that share an
//! element. Order and structure are found on the node graph, supernodes are factored front by front on
//! the calling thread, with the same bits on any vector unit, and solving allocates nothing.

pub mod block_matrix;
pub mod cholesky;
pub mod ordering;
pub mod rows;

pub use block_matrix::{BlockMatrix, BlockPattern};
pub use cholesky::{
    Cholesky, FactorError, FactorStats, HalfSolution, Precision, SolveWorkspace, half_products,
    half_products_between,
};
pub use ordering::{NodeOrder, OrderingMethod};
pub use rows::add_rows;
