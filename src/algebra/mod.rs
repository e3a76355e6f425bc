//! Sparse and dense matrices and the dense symmetric-definite eigenproblem. The only room that names faer.

mod dense;
mod mass;
mod sparse;

pub use dense::DenseMatrix;
pub use mass::MassMatrix;
pub use sparse::{SparseError, SparseMatrix};
