//! The rows of a patch: residuals of sixteen pairs, and the terms that enclose their norms.

use super::{Energy, MASS_ROUNDING, SINGLE};
use chladni_algebra::gpu::{EnclosureSums, ResidualSums};
use chladni_algebra::{CYCLE_WIDTH, CycleRow, LIFT_WIDTH, MassMatrix, Patch, SparseMatrix, vectorized};

/// Sums over the residuals of sixteen pairs.
#[derive(Default)]
pub(super) struct Residuals {
    pub(super) pairs: [PairResidual; CYCLE_WIDTH],
}

/// Sums over the residual of a pair.
#[derive(Default, Clone, Copy)]
pub(super) struct PairResidual {
    pub(super) sums: ResidualSums,
    /// `‖δ‖` in the inverse lumped mass, δ a bound on the rounding errors of each row, storing it in single precision included.
    pub(super) rounding: f64,
}

impl PairResidual {
    /// Of the sums of a pair with the value `theta`.
    pub(super) fn new(sums: &ResidualSums, theta: f64) -> Self {
        let ResidualSums { dual, mass, rounding, .. } = *sums;
        let rounding = rounding.sqrt() + MASS_ROUNDING * theta.abs() * mass.sqrt() + SINGLE * dual.sqrt();
        Self { sums: *sums, rounding }
    }
}

/// The terms of the enclosure; those of `r − Ay` are in the inverse lumped mass.
#[derive(Default)]
pub(super) struct Enclosure {
    /// `2 yᵀr − yᵀAy`
    pub(super) below: [f64; CYCLE_WIDTH],
    /// The sum of the magnitudes of its terms.
    pub(super) size: [f64; CYCLE_WIDTH],
    /// `‖r − Ay‖²`
    pub(super) excess: [f64; CYCLE_WIDTH],
    /// A bound on the square of `‖δ‖`, δ the rounding error of `S y`.
    pub(super) rounding: [f64; CYCLE_WIDTH],
    /// `yᵀMy`
    pub(super) mass: [f64; CYCLE_WIDTH],
}

/// Adds the sums of some rows to those of others.
pub(super) fn add_totals(totals: &mut [[f64; CYCLE_WIDTH]; 9], part: &[[f64; CYCLE_WIDTH]; 9]) {
    for (v, (totals, part)) in totals.iter_mut().zip(part).enumerate() {
        for (total, part) in totals.iter_mut().zip(part) {
            *total = match v {
                7 => total.min(*part),
                8 => total.max(*part),
                _ => *total + part,
            };
        }
    }
}

impl Enclosure {
    /// Adds the terms of other rows.
    pub(super) fn add(&mut self, other: &Self) {
        let Self { below, size, excess, rounding, mass } = self;
        let sums = [below, size, excess, rounding, mass];
        let others = [&other.below, &other.size, &other.excess, &other.rounding, &other.mass];
        for (sums, others) in sums.into_iter().zip(others) {
            sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
        }
    }

    /// The terms of one pair.
    pub(super) fn of(&self, k: usize) -> EnclosureSums {
        EnclosureSums {
            below: self.below[k],
            size: self.size[k],
            excess: self.excess[k],
            rounding: self.rounding[k],
            mass: self.mass[k],
        }
    }
}

impl Energy<'_> {
    /// The rows of a patch of one half of [`residuals`](Self::residuals); `x` holds the patch and its first ring.
    pub(super) fn patch_residuals(
        &self,
        patch: &Patch,
        x: &[[f64; LIFT_WIDTH]],
        half: usize,
        theta: &[f64; CYCLE_WIDTH],
        totals: &mut [[f64; CYCLE_WIDTH]; 9],
        right: &mut [CycleRow],
    ) {
        vectorized(
            (totals, right),
            #[inline(always)]
            |(totals, right)| {
                for (row, (right, global)) in right.iter_mut().zip(patch.rows()).enumerate() {
                    let own = lanes_of(&x[row], half);
                    if global >= self.own {
                        // A row of another part: its value enters the rounding errors of those beside it.
                        *right = [0.0; CYCLE_WIDTH];
                        for k in 0..CYCLE_WIDTH {
                            totals[6][k] += self.rounding[global] * own[k] * own[k];
                        }
                        continue;
                    }
                    let (columns, values) = patch.exact(row);
                    let values = self.coupled.as_ref().map_or(values, |coupled| coupled.row(global).1);
                    let mut sx = [0.0; CYCLE_WIDTH];
                    for (&(column, _), &value) in columns.iter().zip(values) {
                        let x = lanes_of(&x[column as usize], half);
                        for k in 0..CYCLE_WIDTH {
                            sx[k] = value.mul_add(x[k], sx[k]);
                        }
                    }
                    let mut mx = [0.0; CYCLE_WIDTH];
                    match (&self.mass, patch.consistent_mass(row)) {
                        (MassMatrix::Sparse(_), Some((columns, values))) => {
                            for (&(column, _), &value) in columns.iter().zip(values) {
                                let x = lanes_of(&x[column as usize], half);
                                for k in 0..CYCLE_WIDTH {
                                    mx[k] = value.mul_add(x[k], mx[k]);
                                }
                            }
                        }
                        _ => {
                            for k in 0..CYCLE_WIDTH {
                                mx[k] = self.lumped[global] * own[k];
                            }
                        }
                    }
                    let (inverse, weight) = (1.0 / self.lumped[global], self.rounding[global]);
                    for k in 0..CYCLE_WIDTH {
                        let r = sx[k] - theta[k] * mx[k];
                        right[k] = r as f32;
                        totals[0][k] += r * r;
                        totals[1][k] += r * r * inverse;
                        totals[2][k] += sx[k] * sx[k];
                        totals[3][k] += own[k] * own[k];
                        totals[4][k] += own[k] * mx[k];
                        totals[5][k] += own[k] * sx[k];
                        totals[6][k] += weight * own[k] * own[k];
                        totals[7][k] = if own[k] < totals[7][k] { own[k] } else { totals[7][k] };
                        totals[8][k] = if own[k] > totals[8][k] { own[k] } else { totals[8][k] };
                    }
                }
            },
        );
    }

    /// Adds the terms of the enclosure on a patch, in double precision; `y` holds the patch and its first ring. `rests`, if there are as many, become
    /// `r − Ay`.
    pub(super) fn enclose<T: Copy + Into<f64>>(
        &self,
        patch: &Patch,
        y: &[[T; CYCLE_WIDTH]],
        right: &[CycleRow],
        sigma: f64,
        found: &mut Enclosure,
        rests: &mut [CycleRow],
    ) {
        let shift = sigma + self.floor;
        vectorized(
            (found, rests),
            #[inline(always)]
            |(found, rests)| {
                for (row, (r, global)) in right.iter().zip(patch.rows()).enumerate() {
                    if global >= self.own {
                        // A row of another part: `y` is nothing there, and so is what is left.
                        if let Some(rests) = rests.get_mut(row) {
                            *rests = [0.0; CYCLE_WIDTH];
                        }
                        continue;
                    }
                    let own = &y[row];
                    let (columns, values) = patch.exact(row);
                    let mut ay = [0.0; CYCLE_WIDTH];
                    for (&(column, _), &value) in columns.iter().zip(values) {
                        let y = &y[column as usize];
                        for k in 0..CYCLE_WIDTH {
                            ay[k] = value.mul_add(y[k].into(), ay[k]);
                        }
                    }
                    let mut mass_y = [0.0; CYCLE_WIDTH];
                    match (&self.mass, patch.consistent_mass(row)) {
                        (MassMatrix::Sparse(_), Some((columns, values))) => {
                            for (&(column, _), &value) in columns.iter().zip(values) {
                                let y = &y[column as usize];
                                for k in 0..CYCLE_WIDTH {
                                    mass_y[k] = value.mul_add(y[k].into(), mass_y[k]);
                                }
                            }
                        }
                        _ => {
                            for k in 0..CYCLE_WIDTH {
                                mass_y[k] = self.lumped[global] * own[k].into();
                            }
                        }
                    }
                    let (inverse, weight) = (1.0 / self.lumped[global], self.rounding[global]);
                    let mut rests = rests.get_mut(row);
                    for k in 0..CYCLE_WIDTH {
                        let (r, y): (f64, f64) = (f64::from(r[k]), own[k].into());
                        let rest = r - ay[k] - shift * mass_y[k];
                        ay[k] = rest;
                        found.below[k] += y * (r + rest);
                        found.size[k] += (y * r).abs() + (y * rest).abs();
                        found.excess[k] += rest * rest * inverse;
                        found.rounding[k] += weight * y * y;
                        found.mass[k] += y * mass_y[k];
                    }
                    if let Some(rests) = &mut rests {
                        rests.iter_mut().zip(&ay).for_each(|(to, &rest)| *to = rest as f32);
                    }
                }
            },
        );
    }
}

#[inline(always)]
fn lanes_of(row: &[f64; LIFT_WIDTH], half: usize) -> &[f64; CYCLE_WIDTH] {
    let (halves, _) = row.as_chunks::<CYCLE_WIDTH>();
    &halves[half]
}

/// For each `j` the weight `w_j` with `Σ_i γ_i² (Σ_j |S_ij| |x_j|)² / m_i ≤ Σ_j w_j x_j²`, by Cauchy and Schwarz row by row: γ_i bounds the
/// rounding errors of a sum as long as row `i`.
pub(super) fn rounding_weights(stiffness: &SparseMatrix, lumped: &[f64]) -> Vec<f64> {
    let mut weights = vec![0.0; lumped.len()];
    for (row, mass) in lumped.iter().enumerate() {
        let (columns, values) = stiffness.row(row);
        let unit = (columns.len() + 4) as f64 * f64::EPSILON;
        let share = unit * unit * values.iter().map(|value| value.abs()).sum::<f64>() / mass;
        for (&column, value) in columns.iter().zip(values) {
            weights[column as usize] += share * value.abs();
        }
    }
    weights
}
