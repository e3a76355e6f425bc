//! Mass matrices: the inner product that eigenfunctions are orthonormal in.

use super::SparseMatrix;

/// A mass matrix, `n × n`, symmetric positive definite.
#[derive(Debug, Clone, PartialEq)]
pub enum MassMatrix {
    /// A lumped mass: the diagonal.
    Diagonal(Vec<f64>),
    /// A consistent mass, both triangles stored.
    Sparse(SparseMatrix),
}
