//! Mass matrices: the inner product that eigenfunctions are orthonormal in.

use super::{DenseMatrix, SparseMatrix};

/// A mass matrix, `n × n`, symmetric positive definite.
#[derive(Debug, Clone, PartialEq)]
pub enum MassMatrix {
    /// A lumped mass: the diagonal.
    Diagonal(Vec<f64>),
    /// A consistent mass, both triangles stored.
    Sparse(SparseMatrix),
    /// Any other sparse mass, with weights that are proven to be no more than a multiple of it.
    Weighted(WeightedMass),
}

/// A sparse mass of which nothing is known but what was proven: the sums of its rows may be negative.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedMass {
    /// `n × n`, symmetric positive definite, both triangles stored.
    pub matrix: SparseMatrix,
    /// `n` positive weights.
    pub weights: Vec<f64>,
    /// `weights ≤ ratio · M` as quadratic forms.
    pub ratio: f64,
}

impl WeightedMass {
    /// The largest sum of magnitudes of a row over its weight.
    fn terms(&self) -> f64 {
        let sum = |row: usize| self.matrix.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
        self.weights.iter().enumerate().map(|(row, weight)| sum(row) / weight).fold(1.0, f64::max)
    }
}

impl MassMatrix {
    /// The number `n` of rows.
    #[inline]
    pub fn size(&self) -> usize {
        match self {
            Self::Diagonal(diagonal) => diagonal.len(),
            Self::Sparse(matrix) | Self::Weighted(WeightedMass { matrix, .. }) => matrix.rows(),
        }
    }

    /// `M x`.
    ///
    /// # Panics
    /// Unless `x` has `n` entries.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Diagonal(m) => {
                assert_eq!(x.len(), m.len(), "entries of the vector, rows of the mass");
                m.iter().zip(x).map(|(m, x)| m * x).collect()
            }
            Self::Sparse(matrix) | Self::Weighted(WeightedMass { matrix, .. }) => matrix.multiply(x),
        }
    }

    /// The mass of the same unknowns in another order: number `k` is what was `order[k]`, a permutation.
    pub fn reordered(&self, order: &[u32]) -> Self {
        debug_assert_eq!(order.len(), self.size());
        self.principal(order)
    }

    /// The mass of some unknowns alone: number `k` is what was `rows[k]`, each at most once. What is less than a
    /// multiple of a matrix is so on some of its rows.
    pub fn principal(&self, rows: &[u32]) -> Self {
        match self {
            Self::Diagonal(mass) => Self::Diagonal(rows.iter().map(|&row| mass[row as usize]).collect()),
            Self::Sparse(mass) => Self::Sparse(mass.principal(rows)),
            Self::Weighted(mass) => Self::Weighted(WeightedMass {
                matrix: mass.matrix.principal(rows),
                weights: rows.iter().map(|&row| mass.weights[row as usize]).collect(),
                ratio: mass.ratio,
            }),
        }
    }

    /// The matrix, where it is not stored as its diagonal.
    #[inline]
    pub fn sparse(&self) -> Option<&SparseMatrix> {
        match self {
            Self::Diagonal(_) => None,
            Self::Sparse(matrix) | Self::Weighted(WeightedMass { matrix, .. }) => Some(matrix),
        }
    }

    /// All entries.
    pub fn to_dense(&self) -> DenseMatrix {
        if let Some(matrix) = self.sparse() {
            return matrix.to_dense();
        }
        let diagonal = self.lumped();
        let mut dense = DenseMatrix::zeros(diagonal.len(), diagonal.len());
        diagonal.iter().enumerate().for_each(|(k, &mass)| dense.column_mut(k)[k] = mass);
        dense
    }

    /// The sums of the rows: the matrix itself where it is diagonal, and what lumping makes of it otherwise; the
    /// weights of a weighted one.
    pub fn lumped(&self) -> Vec<f64> {
        match self {
            Self::Diagonal(diagonal) => diagonal.clone(),
            Self::Sparse(matrix) => (0..matrix.rows()).map(|row| matrix.row(row).1.iter().sum()).collect(),
            Self::Weighted(mass) => mass.weights.clone(),
        }
    }

    /// By how much the lumped mass may exceed the matrix: `lumped ≤ ratio · M` as quadratic forms. Of a consistent mass
    /// the smallest eigenvalue on a triangle is a quarter of the lumped one, on a tetrahedron a fifth, and what holds
    /// on each holds for their sum.
    pub fn lumped_ratio(&self) -> f64 {
        match self {
            Self::Diagonal(_) => 1.0,
            Self::Sparse(_) => 5.0,
            Self::Weighted(mass) => mass.ratio,
        }
    }

    /// By how much the sum of magnitudes of a row may exceed its lumped mass.
    pub fn terms(&self) -> f64 {
        match self {
            Self::Diagonal(_) => 1.0,
            Self::Sparse(_) => 4.0,
            Self::Weighted(mass) => mass.terms(),
        }
    }

    /// The same matrix times a number.
    pub fn scaled(&self, factor: f64) -> Self {
        match self {
            Self::Diagonal(diagonal) => Self::Diagonal(diagonal.iter().map(|m| m * factor).collect()),
            Self::Sparse(m) => Self::Sparse(m.scaled(factor)),
            Self::Weighted(m) => Self::Weighted(WeightedMass {
                matrix: m.matrix.scaled(factor),
                weights: m.weights.iter().map(|w| w * factor).collect(),
                ratio: m.ratio,
            }),
        }
    }
}
