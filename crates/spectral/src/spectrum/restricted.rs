//! What a problem restricted to a space of functions leaves.

use chladni_algebra::{EigenPairs, SparseMatrix};

/// Ritz pairs in the space, on unit area.
pub(super) struct Ritz {
    /// `U` on the unknowns.
    pub space: SparseMatrix<f32>,
    /// `UᵀMU`.
    pub mass: SparseMatrix,
    /// `UᵀSU`.
    pub stiffness: SparseMatrix,
    /// Values and coefficients.
    pub pairs: EigenPairs,
}
