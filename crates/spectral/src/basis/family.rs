//! A family of operators restricted to one subspace.

use chladni_algebra::{DenseMatrix, MassMatrix, row_parts};
use chladni_base::parallel::*;

use super::Provenance;

/// `S`, `A` and the curvature potential `V` in one space of `d` functions on `n` vertices, in the Ritz coordinates of
/// `S`.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyBasis {
    /// `W`, `n × d`, one column after the other: the Ritz vectors of the Laplacian in the space; `WᵀMW = I` for the
    /// mass of the input.
    pub functions: Vec<f32>,
    /// `d` Ritz values of the Laplacian, ascending, in 1/length² of the input: the diagonal of `WᵀSW`.
    pub eigenvalues: Vec<f64>,
    /// `WᵀAW`, `d × d`, symmetric.
    pub extrinsic: DenseMatrix,
    /// `WᵀVW`, `d × d`, symmetric, with `V = κ₁² + κ₂²`.
    pub curvature: DenseMatrix,
    /// The mass of the input, `n × n`.
    pub mass: MassMatrix,
    /// How the family was made.
    pub metadata: Provenance,
}

impl FamilyBasis {
    /// `d`.
    pub fn dimension(&self) -> usize {
        self.eigenvalues.len()
    }

    /// `n`.
    pub fn vertices(&self) -> usize {
        self.mass.size()
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

    /// `W c` for coefficients `c`, `d × m`: `n × m`. In f64, in parallel.
    ///
    /// # Panics
    /// Unless there are `d` coefficients for each of the `m`.
    pub fn lift(&self, coefficients: &DenseMatrix) -> DenseMatrix {
        let (n, d, m) = (self.vertices(), self.dimension(), coefficients.columns());
        assert_eq!(
            [coefficients.rows(), self.functions.len()],
            [d, n * d],
            "coefficients of a mode, numbers of the space"
        );
        let mut lifted = DenseMatrix::zeros(n, m);
        let tasks = row_parts(lifted.values_mut(), n, ROWS_PER_TASK);
        tasks.into_par_iter().enumerate().for_each(|(task, mut columns)| {
            let (from, rows) = (task * ROWS_PER_TASK, columns.first().map_or(0, |column| column.len()));
            let mut block = DenseMatrix::zeros(rows, d);
            for (to, function) in block.values_mut().chunks_exact_mut(rows.max(1)).zip(self.functions.chunks_exact(n)) {
                to.iter_mut().zip(&function[from..]).for_each(|(to, &value)| *to = f64::from(value));
            }
            let product = block.times(coefficients);
            for (mode, out) in columns.iter_mut().enumerate() {
                out.copy_from_slice(product.column(mode));
            }
        });
        lifted
    }

    /// About the bytes that the family takes as stored.
    pub fn stored_bytes(&self) -> u64 {
        let (n, d) = (self.vertices() as u64, self.dimension() as u64);
        4 * n * d + 8 * n + 8 * d + 16 * d * d
    }
}

/// Rows that one task widens to double precision at a time.
const ROWS_PER_TASK: usize = 512;
