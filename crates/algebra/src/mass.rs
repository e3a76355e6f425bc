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

impl MassMatrix {
    /// The number `n` of rows.
    #[inline]
    pub fn size(&self) -> usize {
        match self {
            Self::Diagonal(diagonal) => diagonal.len(),
            Self::Sparse(matrix) => matrix.rows(),
        }
    }

    /// `M x`; `None` unless `x` has `n` entries.
    pub fn multiply(&self, x: &[f64]) -> Option<Vec<f64>> {
        match self {
            Self::Diagonal(m) => (x.len() == m.len()).then(|| m.iter().zip(x).map(|(m, x)| m * x).collect()),
            Self::Sparse(matrix) => matrix.multiply(x),
        }
    }

    /// The mass of the same unknowns in another order: number `k` is what was `order[k]`, a permutation.
    pub fn reordered(&self, order: &[u32]) -> Self {
        match self {
            Self::Diagonal(mass) => Self::Diagonal(order.iter().map(|&row| mass[row as usize]).collect()),
            Self::Sparse(mass) => Self::Sparse(mass.reordered(order)),
        }
    }

    /// The sums of the rows: the matrix itself where it is diagonal, and what lumping makes of it otherwise.
    pub fn lumped(&self) -> Vec<f64> {
        match self {
            Self::Diagonal(diagonal) => diagonal.clone(),
            Self::Sparse(matrix) => (0..matrix.rows()).map(|row| matrix.row(row).1.iter().sum()).collect(),
        }
    }

    /// By how much the lumped mass may exceed the matrix: `lumped ≤ ratio · M` as quadratic forms. Of a consistent mass the smallest eigenvalue on a triangle is a quarter
    /// of the lumped one, on a tetrahedron a fifth, and what holds on each holds for their sum.
    pub fn lumped_ratio(&self) -> f64 {
        match self {
            Self::Diagonal(_) => 1.0,
            Self::Sparse(_) => 5.0,
        }
    }

    /// The same matrix times a number.
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Diagonal(diagonal) => Self::Diagonal(diagonal.iter().map(|m| m * factor).collect()),
            Self::Sparse(m) => Self::Sparse(SparseMatrix::from_sorted_parts(
                m.rows(),
                m.columns(),
                m.offsets().to_vec(),
                m.indices().to_vec(),
                m.values().iter().map(|v| v * factor).collect(),
            )),
        }
    }
}
