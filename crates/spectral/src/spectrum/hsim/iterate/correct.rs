//! The step of Davidson's kind: what has not converged is improved with solves of its residuals.

use chladni_algebra::{
    ColumnSums, DenseMatrix, Factor, PANEL_WIDTH, PanelMatrix, Weight, inner_products, residual_panel, residual_sums,
    restrict, rotate,
};
use chladni_base::parallel::*;

use super::super::HsimError;
use super::super::columns::normalise;
use super::super::ritz::ritz;
use super::super::shifts::{LOWEST, Strays, factor_near, shift, strays, unit};
use super::{Iteration, taken_out};

/// A coupling of a new direction with an old column counts from this share of what the tolerance allows.
const COUPLED: f64 = 0.1;

/// A new Ritz vector joins the block if its residual (4.6) is at most this: rounding errors look like vectors too.
const LARGEST_FOUND: f64 = 0.5;

/// How far a factor's shift may lie from a value, relative to the value.
const NEAR: f64 = 0.3;

impl<'a> Iteration<'a> {
    /// One step that improves some columns, given by ascending value, with solves of their residuals.
    pub(super) fn refine(&mut self, pending: &[usize], tolerance: f64) -> Result<(), HsimError> {
        let (level, monitor) = (self.level, self.monitor);
        let block = self.vectors.select(pending);
        let values: Vec<f64> = pending.iter().map(|&column| self.values[column]).collect();
        let mut directions = PanelMatrix::zeros(level.size(), pending.len());
        directions.panels_mut().par_iter_mut().zip(block.panels()).zip(values.par_chunks(PANEL_WIDTH)).for_each(
            |((direction, column), values)| residual_panel(&level.stiffness, &level.mass, column, values, direction),
        );
        self.solve_residuals(&values, &mut directions)?;
        normalise(&mut directions);
        self.project(&mut directions)?;
        normalise(&mut directions);
        let count = directions.columns();
        if count == 0 {
            // Rounding has made the directions dependent on the columns.
            return self.orthonormalise();
        }
        let mut both = block;
        let pairs = pending.len();
        both.widen(pairs + count);
        both.assign(&(pairs..pairs + count).collect::<Vec<_>>(), &directions);
        // The pencil in old and new directions, of which the old ones are orthonormal and nearly Ritz vectors.
        let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &directions, monitor)?;
        let coupling = inner_products(&self.vectors, Weight::Stiffness(&level.stiffness), &both, monitor)?;
        let active = self.active(pending, &coupling, &gram, tolerance);
        let old = active.len();
        let mut pencil = (DenseMatrix::zeros(old + count, old + count), DenseMatrix::zeros(old + count, old + count));
        let mut place = vec![usize::MAX; self.values.len()];
        for (k, &column) in active.iter().enumerate() {
            place[column] = k;
            pencil.0.column_mut(k)[k] = self.values[column];
            pencil.1.column_mut(k)[k] = 1.0;
        }
        for j in 0..pairs + count {
            let to = if j < pairs { place[pending[j]] } else { old + j - pairs };
            for (k, &column) in active.iter().enumerate() {
                let value = coupling.column(j)[column];
                pencil.0.column_mut(k)[to] = value;
                pencil.0.column_mut(to)[k] = value;
            }
        }
        for j in 0..count {
            pencil.0.column_mut(old + j)[old..].copy_from_slice(stiffness.column(j));
            pencil.1.column_mut(old + j)[old..].copy_from_slice(gram.column(j));
        }
        let top = self.values.iter().copied().fold(f64::MIN, f64::max);
        let (mut values, rotation) = ritz(pencil.0, pencil.1, old + count, monitor)?;
        if values.len() < old {
            // Rounding has made the directions dependent on the columns.
            return self.orthonormalise();
        }
        // What comes out below the top of the block beside the old columns was missing from it.
        let room = level.size().saturating_sub(self.kernel.dimension() + self.values.len());
        let mut kept = values.partition_point(|&value| value < top).max(old).min(values.len()).min(old + room);
        let mut both = self.vectors.select(&active);
        both.widen(old + count);
        both.assign(&(old..old + count).collect::<Vec<_>>(), &directions);
        drop(directions);
        rotate(&mut both, &rotation.slice_columns(0..kept), monitor)?;
        let clear = self.not_of_the_kernel(&both, &values[..kept], top);
        if clear.len() < old {
            return self.orthonormalise();
        }
        if clear.len() < kept {
            kept = clear.len();
            both = both.select(&clear);
            values = clear.iter().map(|&k| values[k]).collect();
        }
        let sums = residual_sums(&level.stiffness, &level.mass, &both, &values[..kept], monitor)?;
        while kept > old && !(self.residual_of(&sums[kept - 1]) <= LARGEST_FOUND) {
            kept -= 1;
        }
        both.keep_columns(kept);
        (self.ritz, self.cuts) = (false, None);
        let before = self.values.len();
        let places: Vec<usize> = active.iter().copied().chain(before..before + kept - old).collect();
        self.vectors.widen(before + kept - old);
        self.vectors.assign(&places, &both);
        self.values.resize(before + kept - old, 0.0);
        self.sums.resize(before + kept - old, ColumnSums::default());
        for (k, &place) in places.iter().enumerate() {
            (self.values[place], self.sums[place]) = (values[k], sums[k]);
        }
        Ok(())
    }

    /// The pending columns, and those that a new direction is coupled to so strongly that leaving them alone would show
    /// in a residual.
    fn active(&self, pending: &[usize], coupling: &DenseMatrix, gram: &DenseMatrix, tolerance: f64) -> Vec<usize> {
        let (pairs, count) = (pending.len(), gram.columns());
        let mut chosen = vec![false; self.values.len()];
        for j in 0..pairs + count {
            let (length, pair) = if j < pairs {
                (1.0, j)
            } else {
                (gram.column(j - pairs)[j - pairs].max(0.0).sqrt(), (j - pairs).min(pairs - 1))
            };
            let limit = COUPLED * tolerance * self.values[pending[pair]].abs() * length;
            for (chosen, coupling) in chosen.iter_mut().zip(coupling.column(j)) {
                *chosen |= !(coupling.abs() <= limit);
            }
        }
        pending.iter().for_each(|&column| chosen[column] = true);
        let mut active = self.order();
        active.retain(|&column| chosen[column]);
        active
    }

    /// Solves with residuals as right-hand sides, each panel with a shift near its values.
    fn solve_residuals(&mut self, values: &[f64], directions: &mut PanelMatrix) -> Result<(), HsimError> {
        let low = self.order().get(LOWEST).map_or(0.0, |&column| self.values[column]);
        let top = self.values.iter().copied().fold(f64::MIN, f64::max);
        let apart: Vec<Strays> = values
            .chunks(PANEL_WIDTH)
            .enumerate()
            .flat_map(|(k, values)| strays(values, shift(values, top), top, k * PANEL_WIDTH))
            .collect();
        let apart = taken_out(apart, directions);
        let mut panels = directions.panels_mut().iter_mut();
        let mut open: Vec<(f64, &mut Vec<f64>)> = Vec::new();
        let mut known: Vec<(&Factor<'_>, &mut Vec<f64>)> = Vec::new();
        for (values, panel) in values.chunks(PANEL_WIDTH).zip(panels.by_ref()) {
            // A factor at hand serves as long as its shift is not much farther away than the columns are wide apart.
            let beside = |value: f64| unit(value, values[0], top).max(unit(low, values[0], top));
            let near = self.kept.iter().map(|(shift, factor)| {
                let farthest = values.iter().map(|&value| (value - shift).abs() / beside(value)).fold(0.0, f64::max);
                (farthest, factor)
            });
            match near.min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((farthest, factor)) if farthest <= NEAR => known.push((factor, panel)),
                _ => open.push((shift(values, top), panel)),
            }
        }
        known.into_par_iter().try_for_each(|(factor, panel)| {
            self.monitor.checkpoint()?;
            factor.solve_panel(panel);
            self.kernel.remove_from_panel(panel);
            Ok::<(), HsimError>(())
        })?;
        let kernel = self.kernel;
        let width = self.batch();
        for batch in open.chunks_mut(width) {
            let storage: Vec<Vec<f64>> = batch.iter().map(|_| self.storage()).collect();
            let (level, symbolic, monitor, spread) = (self.level, self.symbolic, self.monitor, self.spread);
            let factors: Vec<(f64, Factor<'a>)> = batch
                .par_iter_mut()
                .zip(storage)
                .map(|((shift, panel), storage)| {
                    monitor.checkpoint()?;
                    let (at, factor) = factor_near(level, symbolic, *shift, spread, storage, monitor)?;
                    factor.solve_panel(panel);
                    kernel.remove_from_panel(panel);
                    Ok((at, factor))
                })
                .collect::<Result<_, HsimError>>()?;
            self.record_inertia(factors);
        }
        self.solve_apart(apart, directions, |factor, panel, _| {
            factor.solve_panel(panel);
            kernel.remove_from_panel(panel);
            Ok(())
        })
    }
}
