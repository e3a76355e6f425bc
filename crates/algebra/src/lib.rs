//! Sparse and dense matrices and the dense symmetric-definite eigenproblem. The only crate that names faer or wgpu.

mod bisection;
mod block_matrix;
mod blocks;
mod column_products;
mod cycle_products;
mod definite;
mod dense;
mod dissection;
mod eigen;
mod eigen_error;
mod factor;
mod factor_column;
mod factor_count;
mod factor_error;
mod factor_solve;
mod factor_symbolic;
mod factored;
mod galerkin;
pub mod gpu;
mod independent;
mod krylov_block;
mod lift;
mod mass;
mod multifrontal;
mod multigrid;
mod ordering;
mod panel_products;
mod panels;
mod patches;
mod polar;
mod product;
mod recount;
mod residual_gram;
pub mod simd;
mod sparse;
mod symmetric;
mod tridiagonal;

pub use block_matrix::{Block, BlockMatrix, BlockPlaces, add_product, inverse_positive, transposed};
pub use blocks::compact_order;
pub use cycle_products::{symmetric_product, weighted_gram};
pub use definite::{DefiniteError, DefiniteFactor, orthonormalise, solve_definite};
pub use dense::{DenseMatrix, row_parts};
pub use eigen::{ComputedOn, CpuSolver, EigenPairs, SymmetricDefiniteSolver};
pub use eigen_error::EigenError;
pub use factor::{Factor, FactorError, FactorNumbers, SymbolicFactor};
pub use factor_column::ColumnTree;
pub use factor_count::EigenvalueCount;
pub use factor_solve::{HalfSolved, ReachTree, Sides, SolveScratch, SolveTree};
pub use factored::{space_times, space_times_single, space_transposed_mass_times};
pub use galerkin::{GalerkinError, galerkin};
pub use independent::independent_columns;
pub use krylov_block::{
    KRYLOV_WIDTH, KrylovRow, KrylovSquare, append_blocks, basis_products, block_gram, block_products,
    block_times_square, mass_times_block, subtract_blocks, subtract_from_blocks,
};
pub use lift::{LIFT_WIDTH, RowLifter};
pub use mass::{MassMatrix, WeightedMass};
pub use multigrid::{CYCLE_WIDTH, CycleRow, CycleWorkspace, Multigrid, MultigridError, by_patch, zeros_by_all};
pub use ordering::{Ordering, fill_reducing_order, postordered};
use panel_products::residual_panel_rows;
pub use panel_products::{
    ColumnSums, Weight, apply_mass, gram, inner_products, mass_times_panel, prolong, residual_panel, residual_sums,
    restrict, rotate, rotate_and_spare, subtract_combinations,
};
pub use panels::{PANEL_WIDTH, PanelMatrix};
pub use patches::{ENTRIES_AT_ONCE, ExactRow, PATCH_ROWS, Patch, RINGS, SparseRows, fill_up};
pub use polar::nearest_orthogonal;
pub use product::{Panel, Scalar};
pub use recount::eigenvalues_below;
pub use residual_gram::{Magnitudes, residual_gram, residual_magnitudes};
pub use simd::{dot, dot_in_order, vectorized};
pub use sparse::{SparseError, SparseMatrix};
pub use symmetric::lowest_symmetric;
