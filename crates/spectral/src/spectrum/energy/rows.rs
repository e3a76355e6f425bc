//! The rows of a patch: residuals of sixteen pairs, and the terms that enclose their norms.

use super::forest::{Forest, Pivot, Pivots};
use super::{Energy, MASS_ROUNDING, SINGLE};
use chladni_algebra::gpu::{EnclosureSums, ResidualSums};
use chladni_algebra::{
    CYCLE_WIDTH, CycleRow, ENTRIES_AT_ONCE, ExactRow, LIFT_WIDTH, MassMatrix, Patch, SparseMatrix, vectorized,
};
use chladni_base::parallel::*;

/// What is enclosed on a patch.
#[derive(Clone, Copy)]
pub(super) struct Enclosed<'a> {
    pub(super) patch: &'a Patch,
    /// `r` of its rows.
    pub(super) right: &'a [CycleRow],
    pub(super) sigma: f64,
    /// What measures what is left; the mass alone if there is none.
    pub(super) forest: Option<&'a Forest>,
}

/// Memory for the trees of a patch.
#[derive(Default)]
pub(super) struct Trees {
    pivots: Pivots,
    carried: Vec<[f64; CYCLE_WIDTH]>,
}

/// Sums over the residuals of sixteen pairs.
#[derive(Default)]
pub(super) struct Residuals {
    pub(super) pairs: [PairResidual; CYCLE_WIDTH],
}

/// Sums over the residual of a pair.
#[derive(Default, Clone, Copy)]
pub(super) struct PairResidual {
    pub(super) sums: ResidualSums,
    /// `‖δ‖` in the inverse lumped mass, δ a bound on the rounding errors of each row, storing it in single precision
    /// included.
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

/// The terms of the enclosure; those of `r − Ay` are in the inverse lumped mass, or less.
#[derive(Default)]
pub(super) struct Enclosure {
    /// `2 yᵀr − yᵀAy`
    pub(super) below: [f64; CYCLE_WIDTH],
    /// The sum of the magnitudes of its terms.
    pub(super) size: [f64; CYCLE_WIDTH],
    /// `‖r − Ay‖²`; by a forest `σ ‖r − Ay‖²_{B⁻¹}`, `B = T + σM`, of which the other is what `σM` alone makes.
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
                    let lanes = |column: u32| lanes_of(&x[column as usize], half);
                    let sx = match &self.coupled {
                        None => exact_product(patch.exact(row), lanes),
                        Some(coupled) => {
                            let (columns, values) = (patch.exact(row).0, coupled.row(global).1);
                            let mut sum = [0.0; CYCLE_WIDTH];
                            for (&(column, _), &value) in columns.iter().zip(values) {
                                let x = lanes(column);
                                for k in 0..CYCLE_WIDTH {
                                    sum[k] = value.mul_add(x[k], sum[k]);
                                }
                            }
                            sum
                        }
                    };
                    let mut mx = [0.0; CYCLE_WIDTH];
                    match (&self.mass, patch.consistent_mass(row)) {
                        (MassMatrix::Sparse(_), Some(entries)) => mx = exact_product(entries, lanes),
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

    /// Adds the terms of the enclosure on a patch, in double precision; `y` holds the patch and its first ring.
    /// `rests`, if there are as many, become `r − Ay`.
    pub(super) fn enclose<T: Copy + Into<f64>>(
        &self,
        of: Enclosed<'_>,
        y: &[[T; CYCLE_WIDTH]],
        found: &mut Enclosure,
        rests: &mut [CycleRow],
        trees: &mut Trees,
    ) {
        let Enclosed { patch, right, sigma, forest } = of;
        let shift = sigma + self.floor;
        let Trees { pivots, carried } = trees;
        let of_mass = sigma / self.mass.lumped_ratio();
        match forest {
            Some(forest) => forest.pivots(patch.rows(), |row| of_mass * self.lumped[row], of_mass, pivots),
            None => pivots.of_mass(&self.lumped[patch.rows()]),
        }
        carried.resize(patch.rows().len(), [0.0; CYCLE_WIDTH]);
        let pivots = pivots.all();
        // Rows of other parts come last in all; `y` is nothing there, and so is what is left.
        let owned = self.own.saturating_sub(patch.rows().start).min(patch.rows().len());
        vectorized(
            (found, rests, carried),
            #[inline(always)]
            |(found, rests, carried)| {
                let mut sums = Enclosure::default();
                for (row, (global, carried)) in patch.rows().zip(carried.iter_mut()).enumerate() {
                    if row >= owned {
                        *carried = [0.0; CYCLE_WIDTH];
                        continue;
                    }
                    let own: [f64; CYCLE_WIDTH] = std::array::from_fn(|k| y[row][k].into());
                    let lanes = |column: u32| &y[column as usize];
                    let ay = exact_product(patch.exact(row), lanes);
                    let mass_y = match (&self.mass, patch.consistent_mass(row)) {
                        (MassMatrix::Sparse(_), Some(entries)) => exact_product(entries, lanes),
                        _ => own.map(|y| self.lumped[global] * y),
                    };
                    let weight = self.rounding[global];
                    let mut rest = [0.0; CYCLE_WIDTH];
                    for k in 0..CYCLE_WIDTH {
                        let (r, y) = (f64::from(right[row][k]), own[k]);
                        rest[k] = r - ay[k] - shift * mass_y[k];
                        sums.below[k] += y * (r + rest[k]);
                        sums.size[k] += (y * r).abs() + (y * rest[k]).abs();
                        sums.rounding[k] += weight * y * y;
                        sums.mass[k] += y * mass_y[k];
                    }
                    *carried = rest;
                }
                for (rests, rest) in rests.iter_mut().zip(carried.iter()) {
                    *rests = rest.map(|rest| rest as f32);
                }
                for &Pivot { row, parent, share, inverse } in pivots {
                    let sum = carried[row as usize];
                    let above = &mut carried[parent as usize];
                    for k in 0..CYCLE_WIDTH {
                        above[k] = share.mul_add(sum[k], above[k]);
                        sums.excess[k] += sum[k] * sum[k] * inverse;
                    }
                }
                found.add(&sums);
            },
        );
    }
}

/// A row times columns in double precision.
#[inline(always)]
fn exact_product<'a, T: Copy + Into<f64> + 'a>(
    (columns, values): ExactRow<'_>,
    lanes: impl Fn(u32) -> &'a [T; CYCLE_WIDTH],
) -> [f64; CYCLE_WIDTH] {
    let mut sum = [0.0; CYCLE_WIDTH];
    for (columns, values) in
        columns.as_chunks::<ENTRIES_AT_ONCE>().0.iter().zip(values.as_chunks::<ENTRIES_AT_ONCE>().0)
    {
        let rows = columns.map(|(column, _)| lanes(column));
        for k in 0..CYCLE_WIDTH {
            for entry in 0..ENTRIES_AT_ONCE {
                sum[k] = values[entry].mul_add(rows[entry][k].into(), sum[k]);
            }
        }
    }
    sum
}

#[inline(always)]
fn lanes_of(row: &[f64; LIFT_WIDTH], half: usize) -> &[f64; CYCLE_WIDTH] {
    let (halves, _) = row.as_chunks::<CYCLE_WIDTH>();
    &halves[half]
}

/// For each `j` the weight `w_j` with `Σ_i γ_i² (Σ_j |S_ij| |x_j|)² / m_i ≤ Σ_j w_j x_j²`, by Cauchy and Schwarz row by
/// row: γ_i bounds the rounding errors of a sum as long as row `i`.
pub(super) fn rounding_weights(stiffness: &SparseMatrix, lumped: &[f64]) -> Vec<f64> {
    let mut weights = vec![0.0; lumped.len()];
    for row in 0..lumped.len() {
        let share = share_of_row(stiffness, lumped, row);
        let (columns, values) = stiffness.row(row);
        for (&column, value) in columns.iter().zip(values) {
            weights[column as usize] += share * value.abs();
        }
    }
    weights
}

/// The same of a symmetric matrix, whose columns are its rows.
pub(super) fn rounding_weights_of_symmetric(stiffness: &SparseMatrix, lumped: &[f64]) -> Vec<f64> {
    const ROWS: usize = 1 << 12;
    let rows = || (0..lumped.len()).into_par_iter().with_min_len(ROWS);
    let shares: Vec<f64> = rows().map(|row| share_of_row(stiffness, lumped, row)).collect();
    let weight = |row: usize| {
        let (columns, values) = stiffness.row(row);
        columns.iter().zip(values).map(|(&column, value)| shares[column as usize] * value.abs()).sum()
    };
    rows().map(weight).collect()
}

/// `γ² Σ_j |S_ij| / m_i`
fn share_of_row(stiffness: &SparseMatrix, lumped: &[f64], row: usize) -> f64 {
    let (columns, values) = stiffness.row(row);
    let unit = (columns.len() + 4) as f64 * f64::EPSILON;
    unit * unit * values.iter().map(|value| value.abs()).sum::<f64>() / lumped[row]
}
