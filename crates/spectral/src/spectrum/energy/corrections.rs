//! Residuals of many pairs together: the matrix `RᵀA⁻¹R` from above.
//!
//! With any `Y` and `E = R − AY` it is `YᵀR + EᵀY + EᵀA⁻¹E`, and the last term is at most `Eᵀ(σM)⁻¹E`. Columns come from the same cycles as those of single
//! pairs. Whatever rounding does to a column is one more vector with a known norm; `‖a + b‖² ≤ (1 + s)‖a‖² + (1 + 1/s)‖b‖²` takes it apart, and what
//! rounding does to an entry of a product goes to the diagonal by Cauchy and Schwarz.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::rows::{Enclosure, Residuals};
use super::{Energy, MASS_ROUNDING, MOST_STEPS, SINGLE, Step, Workspace};
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, DenseMatrix, LIFT_WIDTH, MassMatrix, RowLifter, SparseMatrix, symmetric_product,
    weighted_gram,
};
use chladni_base::{Cancelled, Monitor};

/// Another cycle is taken where what is left of a residual may weigh more than this share of what was found of it.
const SLACK: f64 = 0.1;

/// The `s` that takes rounding apart.
const PART: f64 = 1e-3;

/// Of a sum over all rows, over the sum of its magnitudes: chunks of a few hundred rows, then hundreds of chunks.
const SUMMED: f64 = 1e-12;

/// Sixteen residuals, what was found of them, and the sums.
struct Half {
    right: Vec<CycleRow>,
    y: Vec<CycleRow>,
    rest: Vec<CycleRow>,
    columns: Vec<Column>,
}

/// The norms of one column; in the lumped mass or its inverse, from above.
#[derive(Clone, Copy)]
struct Column {
    /// `‖y‖`
    y: f64,
    /// `‖R‖ + ‖E‖`
    sum: f64,
    /// What rounding does to `E`, storing it included.
    of_rest: f64,
    /// What rounding does to `R`, storing it included.
    of_residual: f64,
}

impl Energy<'_> {
    /// The matrix `G`, symmetric, with `G − RᵀA⁻¹R` positive semi-definite, `A = S + (c + σ) M` and `R` the residuals of the pairs with values `ritz`
    /// and vectors `space · coefficients`; the rows of `space` are in the order of the patches.
    ///
    /// # Errors
    /// [`Cancelled`], when asked to stop.
    ///
    /// # Panics
    /// Where sizes do not fit: `space` is `n × d`, `coefficients` `d × m`, and there are `m` Ritz values.
    pub(in crate::spectrum) fn residual_energies(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        ritz: &[f64],
        sigma: f64,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, Cancelled> {
        assert_eq!(coefficients.columns(), ritz.len(), "a value for each column");
        let Some(lifter) = RowLifter::new(space, coefficients) else {
            panic!("{} coefficients for {} columns", coefficients.rows(), space.columns())
        };
        let panels = ritz.len().div_ceil(LIFT_WIDTH);
        let done = AtomicUsize::new(0);
        let idle: Mutex<Vec<Workspace>> = Mutex::new(Vec::new());
        let halves: Vec<Vec<Half>> = (0..panels)
            .into_par_iter()
            .map(|panel| {
                let left = idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
                let mut workspace = left.unwrap_or_else(|| Workspace::new(self.size(), &self.hierarchy));
                let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
                let residuals = self.residuals(&lifter, panel, theta, &mut workspace);
                let mut halves = Vec::with_capacity(2);
                for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
                    monitor.checkpoint()?;
                    halves.push(self.corrected(&mut workspace, half, theta.len(), &residuals[half], sigma));
                }
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                monitor.progress(0.6 * done as f64 / panels as f64);
                idle.lock().unwrap_or_else(PoisonError::into_inner).push(workspace);
                Ok(halves)
            })
            .collect::<Result<_, Cancelled>>()?;
        drop(idle);
        let (mut y, mut sums, mut rests, mut columns) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for half in halves.into_iter().flatten() {
            let mut sum = half.right;
            let add = |(sum, rest): (&mut CycleRow, &CycleRow)| sum.iter_mut().zip(rest).for_each(|(a, b)| *a += b);
            sum.par_iter_mut().zip(&half.rest).for_each(add);
            sums.push(sum);
            y.push(half.y);
            rests.push(half.rest);
            columns.extend(half.columns);
        }
        let inverse: Vec<f64> = self.lumped.iter().map(|mass| mass.recip()).collect();
        let found = symmetric_product(&y, &sums, monitor)?;
        monitor.progress(0.9);
        let left = weighted_gram(&rests, &inverse, monitor)?;
        Ok(self.bounded(&found, &left, &columns, sigma))
    }

    /// Cycles until little is left of sixteen residuals.
    fn corrected(
        &self,
        workspace: &mut Workspace,
        half: usize,
        count: usize,
        residuals: &Residuals,
        sigma: f64,
    ) -> Half {
        let mut enclosed = Enclosure::default();
        for step in 0..MOST_STEPS {
            enclosed = self.step(workspace, half, sigma, Step { first: step == 0, keep: true });
            let is_close = |k: usize| self.mass_ratio() * enclosed.excess[k] <= SLACK * sigma * enclosed.below[k];
            if (0..count).all(is_close) {
                break;
            }
        }
        let factor = self.mass_ratio().sqrt();
        let columns = (0..count).map(|k| {
            let mass_of_y = enclosed.mass[k].max(0.0).sqrt();
            let computed = enclosed.rounding[k].sqrt() + MASS_ROUNDING * (sigma + self.floor) * mass_of_y;
            Column {
                y: factor * mass_of_y,
                sum: residuals.sums[k].dual.sqrt() + enclosed.excess[k].sqrt(),
                // `R + E` is stored in single precision once more.
                of_rest: computed + SINGLE * (residuals.sums[k].dual.sqrt() + 2.0 * enclosed.excess[k].sqrt()),
                of_residual: residuals.rounding[k],
            }
        });
        let columns = columns.collect();
        Half { right: workspace.right[half].clone(), y: workspace.y.clone(), rest: workspace.rest.clone(), columns }
    }

    /// How much larger than the mass the lumped one may be.
    fn mass_ratio(&self) -> f64 {
        // On every face the smallest eigenvalue of the consistent mass is a quarter of the lumped one.
        if matches!(self.mass, MassMatrix::Diagonal(_)) { 1.0 } else { 4.0 }
    }

    /// `found` is `½(Yᵀ(R + E) + (R + E)ᵀY)`, `left` is `EᵀM⁻¹E` of the lumped mass; both have more columns than there are pairs.
    fn bounded(&self, found: &DenseMatrix, left: &DenseMatrix, columns: &[Column], sigma: f64) -> DenseMatrix {
        let m = columns.len();
        let norm = |of: &dyn Fn(&Column) -> f64| columns.iter().map(|column| of(column).powi(2)).sum::<f64>().sqrt();
        // The ratio that the products below are split by: any is right, this one makes both parts alike.
        let balance = norm(&|column| column.sum + column.of_rest) / norm(&|column| column.y).max(f64::MIN_POSITIVE);
        let balance = if balance.is_finite() && balance > 0.0 { balance } else { 1.0 };
        let tail = self.mass_ratio() / sigma;
        let mut bound = DenseMatrix::zeros(m, m);
        for j in 0..m {
            let into = bound.column_mut(j);
            for i in 0..m {
                into[i] = (1.0 + PART) * (found.column(j)[i] + tail * (1.0 + PART) * left.column(j)[i]);
            }
        }
        let split = |a: f64, b: f64| 0.5 * m as f64 * (balance * a * a + b * b / balance);
        for (j, column) in columns.iter().enumerate() {
            let Column { y, sum, of_rest, of_residual } = *column;
            // `|yᵢᵀδⱼ|`: what is wrong with `E`, and with the sums.
            let products = split(SINGLE.sqrt() * y, of_rest / SINGLE.sqrt()) + SUMMED * split(y, sum);
            let rest = tail * (1.0 + 1.0 / PART) * m as f64 * (1.0 + PART) * of_rest * of_rest;
            let residual = tail * (1.0 + 1.0 / PART) * m as f64 * of_residual * of_residual;
            bound.column_mut(j)[j] += (1.0 + PART) * (products + rest) + residual;
        }
        bound
    }
}
