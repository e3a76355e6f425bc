//! The product: a sparse factor, a dense factor, eigenvalues and a certificate.

use crate::algebra::{DenseMatrix, MassMatrix, SparseMatrix};

/// A compact basis `Φ = U φ̄` of `m` approximate eigenfunctions on `n` vertices, `M`-orthonormal in the units of the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// `U`, `n × d`, in single precision: the reduced problem was formed with these very values, so nothing is lost by storing
    /// them so.
    pub space: SparseMatrix<f32>,
    /// `φ̄`, `d × m`, one column per eigenfunction.
    pub coefficients: DenseMatrix,
    /// `m` Ritz values, ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// The mass matrix in the units of the input, `n × n`: what filters and projections take inner products with.
    pub mass: MassMatrix,
    /// What is proven about each pair and about the whole.
    pub certificate: Certificate,
    /// How the basis was made, as a JSON object: method, parameters with defaults filled in, solver version, mesh.
    pub metadata: serde_json::Value,
}

/// What is proven about a basis.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Certificate {
    /// Per pair `‖S x − θ M x‖ / ‖S x‖` (thesis, eq. 4.6); for the kernel `‖S x‖ / (‖S‖ ‖x‖)`.
    pub residuals: Vec<f64>,
    /// Per pair an a-posteriori bound: some exact eigenvalue lies within `[θ − bound, θ + bound]`, in 1/length² of the input.
    pub bounds: Vec<f64>,
    /// The largest entry of `|ΦᵀMΦ − I|`.
    pub orthonormality_defect: f64,
}
