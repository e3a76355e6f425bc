//! What Rayleigh–Ritz leaves of rounding errors in stiff directions, taken off column by column.
//!
//! A column that is a sum of others is rounded in every entry, and an entry of the matrix of 1e9, as beside a needle or a hair, makes a residual of such an
//! error that no solve followed by a sum removes. `x ← x − (S − μM)⁻¹(S x − θ M x)` is an inverse iteration of which only a small correction is rounded. With
//! `μ` as far below zero as the values lie above it, it changes what belongs to them by less than twice its error, and takes off what lies far above.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, residual_panel, residual_sums};
use rayon::prelude::*;

use super::HsimError;
use super::columns::lengths;
use super::iterate::Iteration;
use super::shifts::factor_near;

/// The most corrections.
const MOST: usize = 3;

/// What is longer than this, in the norm of the mass, is no rounding error, and columns that take it are no longer orthonormal.
const SMALL: f64 = 1e-10;

/// A correction counts where it leaves less than this share of a residual.
const BETTER: f64 = 0.8;

impl Iteration<'_> {
    /// Corrects those of the lowest `wanted` columns whose residual (4.6) exceeds the tolerance. Columns that this does not improve stay as they are.
    pub fn polish(&mut self, wanted: usize, tolerance: f64) -> Result<(), HsimError> {
        let (level, monitor, kernel) = (self.level, self.monitor, self.kernel);
        let mut order = self.order();
        order.truncate(wanted);
        let mut pending: Vec<usize> = order.iter().copied().filter(|&k| !(self.residual(k) <= tolerance)).collect();
        let mut sizes: Vec<f64> = self.values.iter().map(|value| value.abs()).collect();
        if pending.is_empty() || !sizes.iter().all(|size| size.is_finite()) {
            return Ok(());
        }
        // Where next to zero is all that is to be corrected, a shift as near to it would make the matrix singular but for rounding.
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let reach = pending.iter().map(|&column| self.values[column].abs()).fold(median, f64::max);
        if reach == 0.0 {
            return Ok(());
        }
        let lowest = order.first().map_or(0.0, |&column| self.values[column]).min(0.0);
        let storage = self.storage();
        let (_, factor) = factor_near(level, self.symbolic, lowest - reach, self.spread, storage)?;
        for _ in 0..MOST {
            let mut block = self.vectors.select(&pending);
            let values: Vec<f64> = pending.iter().map(|&column| self.values[column]).collect();
            let mut corrections = PanelMatrix::zeros(level.size(), pending.len());
            let tasks =
                corrections.panels_mut().par_iter_mut().zip(block.panels_mut()).zip(values.par_chunks(PANEL_WIDTH));
            tasks.try_for_each(|((correction, panel), values)| {
                monitor.checkpoint()?;
                residual_panel(&level.stiffness, &level.mass, panel, values, correction);
                factor.solve_panel(correction);
                kernel.remove_from_panel(correction);
                panel.iter_mut().zip(correction.iter()).for_each(|(x, y)| *x -= y);
                Ok::<(), HsimError>(())
            })?;
            let sizes = lengths(&level.mass, &corrections);
            let lengths = lengths(&level.mass, &block);
            scale(&mut block, &lengths);
            let first = residual_sums(&level.stiffness, &level.mass, &block, &values, monitor)?;
            let quotients: Vec<f64> =
                first.iter().zip(&values).map(|(sums, value)| value + sums.product / sums.mass).collect();
            let sums = residual_sums(&level.stiffness, &level.mass, &block, &quotients, monitor)?;
            let better: Vec<usize> = (0..pending.len())
                .filter(|&k| sizes[k] <= SMALL && self.residual_of(&sums[k]) <= BETTER * self.residual(pending[k]))
                .collect();
            if better.is_empty() {
                break;
            }
            let places: Vec<usize> = better.iter().map(|&k| pending[k]).collect();
            self.vectors.assign(&places, &block.select(&better));
            for (&k, &place) in better.iter().zip(&places) {
                (self.values[place], self.sums[place]) = (quotients[k], sums[k]);
            }
            pending.retain(|&column| !(self.residual(column) <= tolerance));
            if pending.is_empty() {
                break;
            }
        }
        self.keep_storage(factor);
        // A value that was corrected may have passed its neighbour.
        let order = self.order();
        self.keep(order);
        Ok(())
    }
}

/// Divides every column by its length.
fn scale(columns: &mut PanelMatrix, lengths: &[f64]) {
    columns.panels_mut().iter_mut().zip(lengths.chunks(PANEL_WIDTH)).for_each(|(panel, lengths)| {
        for row in panel.as_chunks_mut::<PANEL_WIDTH>().0 {
            row.iter_mut().zip(lengths).for_each(|(x, length)| *x /= length);
        }
    });
}
