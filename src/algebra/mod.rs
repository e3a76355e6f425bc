//! Sparse and dense matrices and the dense symmetric-definite eigenproblem. The only room that names faer.

mod dense;
mod eigen;
mod galerkin;
mod mass;
mod product;
mod sparse;

pub use dense::DenseMatrix;
pub use eigen::{CpuSolver, EigenError, EigenPairs, SymmetricDefiniteSolver};
pub use galerkin::{GalerkinError, galerkin};
pub use mass::MassMatrix;
pub use product::{Panel, Scalar};
pub use sparse::{SparseError, SparseMatrix};
