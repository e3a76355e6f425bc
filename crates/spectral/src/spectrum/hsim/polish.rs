//! What Rayleigh–Ritz leaves of rounding errors in stiff directions, taken off column by column.
//!
//! A column that is a sum of others is rounded in every entry, and an entry of the matrix of 1e9, as beside a needle or
//! a hair, makes a residual of such an error that no solve followed by a sum removes. `x ← x − (S − μM)⁻¹(S x − θ M x)`
//! is an inverse iteration of which only a small correction is rounded. With `μ` as far below zero as the values lie
//! above it, it changes what belongs to them by less than twice its error, and takes off what lies far above.
//!
//! What a stiff direction leaves in two columns couples them, by the product of both parts with its eigenvalue: a
//! Rayleigh–Ritz turns the columns into each other by that over the gap between their values. Where this is more than
//! rounding, it is made anew for the columns that are clear of the stiff direction.

use chladni_algebra::{Factor, PANEL_WIDTH, PanelMatrix, residual_panel, residual_sums, restrict, rotate};
use chladni_base::parallel::*;

use super::HsimError;
use super::columns::lengths;
use super::iterate::Iteration;
use super::ritz::ritz;
use super::shifts::factor_near;

/// The most corrections with one shift.
const MOST: usize = 4;

/// What is longer than this, in the norm of the mass, is no rounding error, and columns that take it are no longer
/// orthonormal.
const SMALL: f64 = 1e-10;

/// What is longer than this belongs to columns that have not converged.
const LARGE: f64 = 1e-3;

/// A correction counts where it leaves less than this share of a residual.
const BETTER: f64 = 0.8;

/// Columns whose values are up to this times those that are corrected may be coupled to them.
const BAND: f64 = 1e3;

/// What corrections came to.
struct Corrected {
    columns: PanelMatrix,
    /// The Rayleigh quotients.
    values: Vec<f64>,
    sums: Vec<chladni_algebra::ColumnSums>,
    /// How long the corrections were.
    sizes: Vec<f64>,
}

impl Iteration<'_> {
    /// Corrects those of the lowest `wanted` columns whose residual (4.6) exceeds the tolerance. Columns that this does
    /// not improve stay as they are.
    pub fn polish(&mut self, wanted: usize, tolerance: f64) -> Result<(), HsimError> {
        let mut order = self.order();
        order.truncate(wanted);
        let pending: Vec<usize> = order.into_iter().filter(|&k| !(self.residual(k) <= tolerance)).collect();
        let mut sizes: Vec<f64> = self.values.iter().map(|value| value.abs()).collect();
        if pending.is_empty() || !sizes.iter().all(|size| size.is_finite()) {
            return Ok(());
        }
        let most = pending.iter().map(|&column| self.values[column].abs()).fold(0.0, f64::max);
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        // Where next to zero is all that is to be corrected, a shift as near to it would make the matrix singular but
        // for rounding.
        let mut reaches = vec![most];
        if median > most {
            reaches.push(median);
        }
        for reach in reaches.into_iter().filter(|&reach| reach > 0.0) {
            if self.polish_from(wanted, tolerance, reach)? {
                break;
            }
        }
        // A value that was corrected may have passed its neighbour.
        let order = self.order();
        self.keep(order);
        Ok(())
    }

    /// The same with a shift so far below zero; says whether all columns pass.
    fn polish_from(&mut self, wanted: usize, tolerance: f64, reach: f64) -> Result<bool, HsimError> {
        let lowest = self.values.iter().copied().fold(0.0, f64::min);
        let storage = self.storage();
        let (_, factor) = factor_near(self.level, self.symbolic, lowest - reach, self.spread, storage, self.monitor)?;
        let mut passed = false;
        for _ in 0..MOST {
            let mut pending = self.order();
            pending.truncate(wanted);
            pending.retain(|&column| !(self.residual(column) <= tolerance));
            passed = pending.is_empty();
            if passed || !self.correct(&pending, &factor)? {
                break;
            }
        }
        self.keep_storage(factor);
        Ok(passed)
    }

    /// Corrects columns once; says whether that made any better.
    fn correct(&mut self, pending: &[usize], factor: &Factor<'_>) -> Result<bool, HsimError> {
        let corrected = self.corrected(pending, factor)?;
        let better = |k: &usize| {
            corrected.sizes[*k] <= LARGE && self.residual_of(&corrected.sums[*k]) <= BETTER * self.residual(pending[*k])
        };
        let mut better: Vec<usize> = (0..pending.len()).filter(better).collect();
        if better.iter().any(|&k| corrected.sizes[k] > SMALL) && self.correct_together(pending, factor)? {
            return Ok(true);
        }
        better.retain(|&k| corrected.sizes[k] <= SMALL);
        let places: Vec<usize> = better.iter().map(|&k| pending[k]).collect();
        if !places.is_empty() {
            self.forget_cuts();
        }
        self.vectors.assign(&places, &corrected.columns.select(&better));
        for (&k, &place) in better.iter().zip(&places) {
            (self.values[place], self.sums[place]) = (corrected.values[k], corrected.sums[k]);
        }
        Ok(!better.is_empty())
    }

    /// Corrects columns with all that they may be coupled to, and makes these Ritz vectors of their span.
    fn correct_together(&mut self, pending: &[usize], factor: &Factor<'_>) -> Result<bool, HsimError> {
        let (level, monitor) = (self.level, self.monitor);
        let most = pending.iter().map(|&column| self.values[column].abs()).fold(0.0, f64::max);
        let mut band = self.order();
        band.retain(|&column| self.values[column].abs() <= BAND * most);
        let Corrected { mut columns, .. } = self.corrected(&band, factor)?;
        let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &columns, monitor)?;
        let (values, rotation) = ritz(stiffness, gram, band.len(), monitor)?;
        if values.len() < band.len() {
            return Ok(false);
        }
        rotate(&mut columns, &rotation, monitor)?;
        let sums = residual_sums(&level.stiffness, &level.mass, &columns, &values, monitor)?;
        // Columns of one value may have been turned into each other: they are compared as a whole.
        let before = pending.iter().map(|&column| self.residual(column)).fold(0.0, f64::max);
        let after = band.iter().zip(&sums).filter(|(column, _)| pending.contains(column));
        let after = after.map(|(_, sums)| self.residual_of(sums)).fold(0.0, f64::max);
        if !(after <= BETTER * before) {
            return Ok(false);
        }
        self.forget_cuts();
        self.vectors.assign(&band, &columns);
        for ((&place, value), sums) in band.iter().zip(values).zip(sums) {
            (self.values[place], self.sums[place]) = (value, sums);
        }
        Ok(true)
    }

    /// What was known of products between segments is of the columns before, which are Ritz vectors of their segments
    /// only.
    fn forget_cuts(&mut self) {
        self.ritz &= self.cuts.take().is_none();
    }

    /// Some columns with their corrections, of unit length.
    fn corrected(&self, places: &[usize], factor: &Factor<'_>) -> Result<Corrected, HsimError> {
        let (level, monitor, kernel) = (self.level, self.monitor, self.kernel);
        let mut columns = self.vectors.select(places);
        let values: Vec<f64> = places.iter().map(|&column| self.values[column]).collect();
        let mut corrections = PanelMatrix::zeros(level.size(), places.len());
        let tasks =
            corrections.panels_mut().par_iter_mut().zip(columns.panels_mut()).zip(values.par_chunks(PANEL_WIDTH));
        tasks.try_for_each(|((correction, panel), values)| {
            monitor.checkpoint()?;
            residual_panel(&level.stiffness, &level.mass, panel, values, correction);
            factor.solve_panel(correction);
            kernel.remove_from_panel(correction);
            panel.iter_mut().zip(correction.iter()).for_each(|(x, y)| *x -= y);
            Ok::<(), HsimError>(())
        })?;
        let sizes = lengths(&level.mass, &corrections);
        let lengths = lengths(&level.mass, &columns);
        scale(&mut columns, &lengths);
        let first = residual_sums(&level.stiffness, &level.mass, &columns, &values, monitor)?;
        let quotients = first.iter().zip(&values).map(|(sums, value)| value + sums.product / sums.mass);
        let values: Vec<f64> = quotients.collect();
        let sums = residual_sums(&level.stiffness, &level.mass, &columns, &values, monitor)?;
        Ok(Corrected { columns, values, sums, sizes })
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
