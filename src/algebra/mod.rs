//! Sparse and dense matrices and the dense symmetric-definite eigenproblem. The only room that names faer.

mod dense;
mod sparse;

pub use dense::DenseMatrix;
pub use sparse::{SparseError, SparseMatrix};
