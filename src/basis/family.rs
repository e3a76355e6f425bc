//! A family of operators restricted to one subspace.

use rayon::prelude::*;

use crate::algebra::{DenseMatrix, MassMatrix, SparseMatrix};

/// `S`, `A` and the curvature potential `V` in one space of `d` functions on `n` vertices, in the Ritz coordinates of `S`.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyBasis {
    /// `U`, `n × d`.
    pub space: SparseMatrix<f32>,
    /// `d × d`: the Ritz vectors `W` of the Laplacian in the space; `WᵀM̄W = I` for the mass of the input.
    pub coefficients: DenseMatrix,
    /// `d` Ritz values of the Laplacian, ascending, in 1/length² of the input: the diagonal of `WᵀS̄W`.
    pub eigenvalues: Vec<f64>,
    /// `WᵀĀW`, `d × d`, symmetric.
    pub extrinsic: DenseMatrix,
    /// `WᵀV̄W`, `d × d`, symmetric, with `V = κ₁² + κ₂²`.
    pub curvature: DenseMatrix,
    /// The mass of the input, `n × n`.
    pub mass: MassMatrix,
    /// How the family was made, as a JSON object.
    pub metadata: serde_json::Value,
}

impl FamilyBasis {
    /// `d`.
    pub fn dimension(&self) -> usize {
        self.eigenvalues.len()
    }

    /// `n`.
    pub fn vertices(&self) -> usize {
        self.space.rows()
    }

    /// `s S + a A + v V` in Ritz coordinates, `d × d`.
    pub fn combined(&self, s: f64, a: f64, v: f64) -> DenseMatrix {
        let d = self.dimension();
        let mut matrix = DenseMatrix::zeros(d, d);
        matrix.values_mut().par_chunks_mut(d.max(1)).enumerate().for_each(|(column, into)| {
            let (extrinsic, curvature) = (self.extrinsic.column(column), self.curvature.column(column));
            for ((x, e), c) in into.iter_mut().zip(extrinsic).zip(curvature) {
                *x = a * e + v * c;
            }
            into[column] += s * self.eigenvalues[column];
        });
        matrix
    }

    /// About the bytes that the family takes as stored.
    pub fn stored_bytes(&self) -> u64 {
        let (n, d) = (self.vertices() as u64, self.dimension() as u64);
        8 * self.space.entries() as u64 + 12 * n + 8 * d + 24 * d * d
    }
}
