//! The coarsest level, diagonalised once so that every shift is solved with it.

use chladni_base::Monitor;

use super::{CYCLE_WIDTH, CycleRow};
use crate::{CpuSolver, DenseMatrix, EigenError, SparseMatrix, SymmetricDefiniteSolver, vectorized};

/// `S = Wᵀ Λ W`, `M = WᵀW`: `values` are Λ, `vectors` the columns of `W⁻¹`, row after row.
#[derive(Debug)]
pub(crate) struct Coarsest {
    pub(crate) values: Vec<f32>,
    pub(crate) vectors: Vec<f32>,
}

impl Coarsest {
    pub(super) fn new(stiffness: &SparseMatrix, masses: Vec<f64>, monitor: &dyn Monitor) -> Result<Self, EigenError> {
        let n = masses.len();
        let mut mass = DenseMatrix::zeros(n, n);
        for (k, &m) in masses.iter().enumerate() {
            mass.column_mut(k)[k] = m;
        }
        let pairs = CpuSolver.lowest(stiffness.to_dense(), mass, n, monitor)?;
        let mut vectors = vec![0.0; n * n];
        for k in 0..n {
            for (row, &x) in pairs.vectors.column(k).iter().enumerate() {
                vectors[row * n + k] = x as f32;
            }
        }
        Ok(Self { values: pairs.values.iter().map(|&value| value.max(0.0) as f32).collect(), vectors })
    }

    /// `x = V (Λ + σ)⁻¹ Vᵀ b`.
    pub(super) fn solve(&self, sigma: f32, right: &[CycleRow], reduced: &mut [CycleRow], x: &mut [CycleRow]) {
        let n = self.values.len().max(1);
        vectorized(
            (reduced, x),
            #[inline(always)]
            |(reduced, x)| {
                reduced.fill([0.0; CYCLE_WIDTH]);
                for (vector, b) in self.vectors.chunks_exact(n).zip(right) {
                    for (&v, sum) in vector.iter().zip(reduced.iter_mut()) {
                        for k in 0..CYCLE_WIDTH {
                            sum[k] = v.mul_add(b[k], sum[k]);
                        }
                    }
                }
                for (row, value) in reduced.iter_mut().zip(&self.values) {
                    row.iter_mut().for_each(|c| *c /= value + sigma);
                }
                for (vector, x) in self.vectors.chunks_exact(n).zip(x.iter_mut()) {
                    let mut sum = [0f32; CYCLE_WIDTH];
                    for (&v, c) in vector.iter().zip(reduced.iter()) {
                        for k in 0..CYCLE_WIDTH {
                            sum[k] = v.mul_add(c[k], sum[k]);
                        }
                    }
                    *x = sum;
                }
            },
        );
    }
}
