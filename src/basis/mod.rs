//! The product: a sparse factor, a dense factor, eigenvalues and a certificate.

mod evaluate;
pub mod matrix_market;
pub mod npz;
pub mod safetensors;

pub use evaluate::BasisError;
pub use npz::FormatError;

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

impl Basis {
    /// The number of vertices, `n`.
    pub fn vertices(&self) -> usize {
        self.space.rows()
    }

    /// The dimension of the subspace, `d`.
    pub fn dimension(&self) -> usize {
        self.space.columns()
    }

    /// The number of eigenpairs, `m`.
    pub fn count(&self) -> usize {
        self.eigenvalues.len()
    }

    /// The bytes that `U` and `φ̄` take as stored: four for each value and column index of `U`, four for each row offset,
    /// eight for each coefficient and eigenvalue.
    pub fn compact_bytes(&self) -> u64 {
        let sparse = 8 * self.space.entries() + 4 * (self.space.rows() + 1);
        let dense = 8 * self.coefficients.values().len() + 8 * self.eigenvalues.len();
        (sparse + dense) as u64
    }

    /// The bytes that the `n × m` lifted eigenfunctions and the eigenvalues would take in double precision.
    pub fn dense_bytes(&self) -> u64 {
        8 * (self.vertices() as u64 + 1) * self.count() as u64
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two eigenfunctions on three vertices in a space of two functions.
    pub(crate) fn small_basis(sparse_mass: bool) -> Basis {
        let mass = if sparse_mass {
            let values = vec![0.5, 0.1, 0.1, 0.5, 0.25];
            MassMatrix::Sparse(SparseMatrix::new(3, 3, vec![0, 2, 4, 5], vec![0, 1, 0, 1, 2], values).unwrap())
        } else {
            MassMatrix::Diagonal(vec![0.5, 0.25, 0.25])
        };
        Basis {
            space: SparseMatrix::new(3, 2, vec![0, 1, 3, 4], vec![0, 0, 1, 1], vec![1.0, 0.25, 0.75, 1.0]).unwrap(),
            coefficients: DenseMatrix::from_columns(2, 2, vec![1.0, 1.0, 0.1, -1.0 / 3.0]).unwrap(),
            eigenvalues: vec![0.0, 3.25],
            mass,
            certificate: Certificate {
                residuals: vec![1e-15, 0.125],
                bounds: vec![0.0, 0.5],
                orthonormality_defect: 1.0 / 7.0,
            },
            metadata: serde_json::json!({"parameters": {"count": 2}}),
        }
    }
}
