//! Residuals of many pairs together: the matrix `RᵀA⁻¹R` from above.
//!
//! With any `Y` and `E = R − AY` it is `YᵀR + EᵀY + EᵀA⁻¹E`, and the last term is at most `Eᵀ(σM)⁻¹E`. Columns come
//! from the same cycles as those of single pairs. Whatever rounding does to a column is one more vector with a known
//! norm; `‖a + b‖² ≤ (1 + s)‖a‖² + (1 + 1/s)‖b‖²` takes it apart, and what rounding does to an entry of a product goes
//! to the diagonal by Cauchy and Schwarz.
//!
//! Where triangles differ in size by many orders of magnitude, cycles in single precision leave too much of `E`, and a
//! factor takes their place. `Y` is then kept as the sum of two columns in single precision, and of `E`, which is next
//! to nothing, the norms are enough.

use chladni_base::parallel::*;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::direct::Solver;
use super::rows::{Enclosure, PairResidual, Residuals};
use super::{CycleOutput, Energy, HALVES, MASS_ROUNDING, MOST_STEPS, SINGLE, Step, Workspace, over_panels};
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, DenseMatrix, LIFT_WIDTH, RowLifter, SparseMatrix, symmetric_product, weighted_gram,
};
use chladni_base::{Cancelled, Monitor};

/// Another cycle is taken where what is left of a residual may weigh more than this share of what was found of it.
const SLACK: f64 = 0.1;

/// The `s` that takes rounding apart, at least.
const PART: f64 = 1e-3;

/// Of a sum over all rows, over the sum of its magnitudes: chunks of a few hundred rows, then hundreds of chunks.
const SUMMED: f64 = 1e-12;

/// Where `Y` comes from.
#[derive(Clone, Copy)]
pub(in crate::spectrum) enum Corrections<'a> {
    /// Multigrid cycles, with this σ.
    Cycles(f64),
    /// A factor.
    Factor(&'a Solver<'a>),
}

impl Corrections<'_> {
    /// σ.
    pub(in crate::spectrum) fn sigma(self) -> f64 {
        match self {
            Self::Cycles(sigma) => sigma,
            Self::Factor(solver) => solver.sigma,
        }
    }
}

/// Sixteen residuals, what was found of them, and the sums.
struct Half {
    right: Vec<CycleRow>,
    y: Vec<CycleRow>,
    /// `E` of cycles; of a factor what storing `Y` in single precision leaves of it.
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
    /// The matrix `G`, symmetric, with `G − RᵀA⁻¹R` positive semi-definite, `A = S + (c + σ) M` and `R` the residuals
    /// of the pairs with values `ritz` and vectors `space · coefficients`; the rows of `space` are in the order of the
    /// patches.
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
        corrections: Corrections<'_>,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, Cancelled> {
        assert_eq!(coefficients.columns(), ritz.len(), "a value for each column");
        let lifter = RowLifter::new(space, coefficients);
        let panels = ritz.len().div_ceil(LIFT_WIDTH);
        let done = AtomicUsize::new(0);
        let halves: Vec<Vec<Half>> = over_panels(self, panels, |panel, workspace| {
            let theta = &ritz[panel * LIFT_WIDTH..ritz.len().min((panel + 1) * LIFT_WIDTH)];
            let residuals = self.residuals(&lifter, panel, theta, workspace);
            let halves = match corrections {
                Corrections::Cycles(sigma) => {
                    let mut halves = Vec::with_capacity(2);
                    for (half, theta) in theta.chunks(CYCLE_WIDTH).enumerate() {
                        monitor.checkpoint()?;
                        halves.push(self.corrected(workspace, half, theta.len(), &residuals[half], sigma));
                    }
                    halves
                }
                Corrections::Factor(solver) => {
                    monitor.checkpoint()?;
                    self.solved_for(workspace, theta.len(), &residuals, solver)
                }
            };
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            monitor.progress(0.6 * done as f64 / panels as f64);
            Ok(halves)
        })?;
        let (mut y, mut right, mut rests, mut columns) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for half in halves.into_iter().flatten() {
            right.push(half.right);
            y.push(half.y);
            rests.push(half.rest);
            columns.extend(half.columns);
        }
        let found = match corrections {
            Corrections::Cycles(sigma) => {
                for (sum, rest) in right.iter_mut().zip(&rests) {
                    let add =
                        |(sum, rest): (&mut CycleRow, &CycleRow)| sum.iter_mut().zip(rest).for_each(|(a, b)| *a += b);
                    sum.par_iter_mut().zip(rest).for_each(add);
                }
                let mut found = symmetric_product(&y, &right, monitor)?;
                monitor.progress(0.9);
                let inverse: Vec<f64> = self.lumped.iter().map(|mass| mass.recip()).collect();
                let tail = (1.0 + PART) * self.mass_ratio() / sigma;
                add_scaled(&mut found, tail, &weighted_gram(&rests, &inverse, monitor)?);
                found
            }
            Corrections::Factor(_) => {
                let mut found = symmetric_product(&y, &right, monitor)?;
                monitor.progress(0.9);
                add_scaled(&mut found, 1.0, &symmetric_product(&rests, &right, monitor)?);
                found
            }
        };
        Ok(self.bounded(&found, &columns, corrections))
    }

    /// The solutions of a panel, and what rounding has left of their residuals.
    fn solved_for(
        &self,
        workspace: &Workspace,
        count: usize,
        residuals: &[Residuals; HALVES],
        solver: &Solver<'_>,
    ) -> Vec<Half> {
        let solutions = solver.solve(&workspace.right);
        let halves = solutions.into_iter().zip(&workspace.right).zip(residuals).take(count.div_ceil(CYCLE_WIDTH));
        let half = |(half, ((solution, right), residuals)): (usize, ((Vec<_>, &Vec<CycleRow>), &Residuals))| {
            let enclosed = self.enclose_all(&solution, right, solver.sigma);
            let y: Vec<CycleRow> = solution.iter().map(|row| row.map(|y| y as f32)).collect();
            let low = |(row, high): (&[f64; CYCLE_WIDTH], &CycleRow)| {
                std::array::from_fn(|k| (row[k] - f64::from(high[k])) as f32)
            };
            let rest = solution.iter().zip(&y).map(low).collect();
            let columns = (0..(count - half * CYCLE_WIDTH).min(CYCLE_WIDTH)).map(|k| {
                let Norms { y, rest, computed } = self.norms(&enclosed, k, solver.sigma);
                let PairResidual { sums, rounding } = residuals.pairs[k];
                let sum = sums.dual.sqrt();
                Column { y, sum, of_rest: (1.0 + MASS_ROUNDING) * rest + computed, of_residual: rounding }
            });
            Half { right: right.clone(), columns: columns.collect(), y, rest }
        };
        halves.enumerate().map(half).collect()
    }

    /// The norms of column `k` of an enclosure.
    fn norms(&self, enclosed: &Enclosure, k: usize, sigma: f64) -> Norms {
        let mass_of_y = enclosed.mass[k].max(0.0).sqrt();
        Norms {
            y: self.mass_ratio().sqrt() * mass_of_y,
            rest: enclosed.excess[k].sqrt(),
            computed: enclosed.rounding[k].sqrt() + MASS_ROUNDING * (sigma + self.floor) * mass_of_y,
        }
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
            enclosed =
                self.step(workspace, half, sigma, Step { first: step == 0, keep: CycleOutput::Both, by_trees: false });
            let is_close = |k: usize| self.mass_ratio() * enclosed.excess[k] <= SLACK * sigma * enclosed.below[k];
            if (0..count).all(is_close) {
                break;
            }
        }
        let columns = (0..count).map(|k| {
            let Norms { y, rest, computed } = self.norms(&enclosed, k, sigma);
            let PairResidual { sums, rounding } = residuals.pairs[k];
            let dual = sums.dual.sqrt();
            Column {
                y,
                sum: dual + rest,
                // `R + E` is stored in single precision once more.
                of_rest: computed + SINGLE * (dual + 2.0 * rest),
                of_residual: rounding,
            }
        });
        let columns = columns.collect();
        Half { right: workspace.right[half].clone(), y: workspace.y.clone(), rest: workspace.rest.clone(), columns }
    }

    /// How much larger than the mass the lumped one may be.
    fn mass_ratio(&self) -> f64 {
        self.mass.lumped_ratio()
    }

    /// `found` is what was computed of `YᵀR + EᵀY + Eᵀ(σM)⁻¹E`; it has more columns than there are pairs.
    fn bounded(&self, found: &DenseMatrix, columns: &[Column], corrections: Corrections<'_>) -> DenseMatrix {
        let m = columns.len();
        let squares = |of: &dyn Fn(&Column) -> f64| columns.iter().map(|column| of(column).powi(2)).sum::<f64>();
        // Products are split by the ratio of their factors: any is right, this one makes both parts alike.
        let ratio = |of: &dyn Fn(&Column) -> f64| {
            let ratio = (squares(of) / squares(&|column| column.y).max(f64::MIN_POSITIVE)).sqrt();
            if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
        };
        let (by_sum, by_rest) = (ratio(&|column| column.sum), ratio(&|column| column.of_rest));
        let tail = self.mass_ratio() / corrections.sigma();
        // So is the part that rounding is taken apart by: where rounding is much, a larger one.
        let trace: f64 = (0..m).map(|j| found.column(j)[j].abs()).sum();
        let lost = tail * m as f64 * squares(&|column| column.of_residual);
        let part = (lost / trace.max(f64::MIN_POSITIVE)).sqrt().clamp(PART, 1.0);
        // Cycles leave an `E` that is summed, this is what rounding does to it; a factor leaves nothing else.
        let apart = if matches!(corrections, Corrections::Cycles(_)) { 1.0 + 1.0 / PART } else { 1.0 };
        let mut bound = DenseMatrix::zeros(m, m);
        for j in 0..m {
            let into = bound.column_mut(j);
            for i in 0..m {
                into[i] = (1.0 + part) * found.column(j)[i];
            }
        }
        let split = |ratio: f64, a: f64, b: f64| 0.5 * m as f64 * (ratio * a * a + b * b / ratio);
        for (j, column) in columns.iter().enumerate() {
            let Column { y, sum, of_rest, of_residual } = *column;
            // `|yᵢᵀδⱼ|`: what is wrong with `E`, and with the sums.
            let products = split(by_rest, y, of_rest) + SUMMED * split(by_sum, y, sum);
            let rest = apart * tail * m as f64 * of_rest * of_rest;
            let residual = tail * (1.0 + 1.0 / part) * m as f64 * of_residual * of_residual;
            bound.column_mut(j)[j] += (1.0 + part) * (products + rest) + residual;
        }
        bound
    }
}

/// The norms of what was found of a column: in the mass `y`, in the inverse lumped mass `R − Ay` and what rounding does
/// to it.
struct Norms {
    y: f64,
    rest: f64,
    computed: f64,
}

/// `A ← A + s B`.
fn add_scaled(a: &mut DenseMatrix, s: f64, b: &DenseMatrix) {
    assert_eq!((a.rows(), a.columns()), (b.rows(), b.columns()), "matrices of one shape");
    a.values_mut().iter_mut().zip(b.values()).for_each(|(a, b)| *a += s * b);
}
