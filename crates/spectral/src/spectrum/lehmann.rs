//! Enclosures of approximate eigenvalues, index by index: one inertia count and the bounds of Lehmann and Goerisch.
//!
//! Ritz values lie above the eigenvalues of their index. For bounds from below let at most `k` eigenvalues lie below a pole `ρ`, and let `V` be Ritz vectors with
//! values `Θ` below it. With `A = S + (c + σ) M`, hats for values plus `c + σ`, the operator `A⁻¹M` has the eigenvalues `1 / λ̂`, and Lehmann's bounds on those
//! next to `1 / ρ̂` need `(MV)ᵀA⁻¹(MV)`, which is known up to `G ⪰ RᵀA⁻¹R`, `R` the residuals. What remains is a symmetric matrix: with `D = ρ̂ − Θ̂` and
//! `VᵀMV = I`, `VᵀAV = Θ̂`, the eigenvalues `κ₁ ≤ κ₂ ≤ …` of
//!
//! ```text
//! Θ̂⁻¹ + ρ̂ Θ̂⁻¹ D^-½ G D^-½ Θ̂⁻¹
//! ```
//!
//! give `λ̂_{k+1−j} ≥ 1 / κⱼ` (Goerisch and He, 1990; Behnke and Goerisch, 1994). The lower bound of a pair is a pole for those below it, so one count is enough
//! for any number of pairs. That `VᵀMV` and `VᵀAV` are diagonal up to rounding alone is part of the bound.

use rayon::prelude::*;

use super::approximate::{ApproximationError, Ritz};
use super::certificate::KERNEL;
use super::energy::Energy;
use crate::operator::EigenProblem;
use chladni_algebra::{
    DenseMatrix, MassMatrix, Ordering, SparseMatrix, SymbolicFactor, fill_reducing_order, galerkin, lowest_symmetric,
};
use chladni_base::Monitor;

/// σ as a share of the pole. Larger ones make cycles converge faster, and widen the bounds by about as much.
const SHIFT: f64 = 0.5;

/// Pairs that are enclosed together: products grow with the square.
const WINDOW: usize = 512;

/// A pair nearer to its pole than this share takes no part: rounding would be divided by the square of it.
const NEAREST: f64 = 1e-4;

/// Estimates may be wrong by this factor before a pole is no longer in a gap.
const DOUBT: f64 = 3.0;

/// A count that rounding makes uncertain by more than this share of its shift proves nothing of pairs that are next to each other.
const LARGEST_RADIUS: f64 = 1e-3;

/// What is proven.
pub(super) struct Enclosed {
    /// Where eigenvalues were counted, on unit area.
    pub shift: f64,
    /// How many lie below.
    pub below: usize,
    /// The eigenvalue of the same index lies within this of the Ritz value, on unit area; one number for each pair.
    pub bounds: Vec<f64>,
}

/// Pairs that are computed beyond those that are delivered: the farther the pole, the closer the bounds.
pub(super) fn guards(count: usize) -> usize {
    count / 8 + 8
}

/// Encloses the lowest `count` pairs of `ritz`. `estimates` are of their errors, on unit area.
///
/// # Errors
/// [`ApproximationError::Incomplete`] where more eigenvalues lie below the shift than the pairs stand for, [`ApproximationError::Unproven`] where no count can be trusted,
/// [`ApproximationError::Cancelled`].
pub(super) fn enclose(
    energy: &Energy<'_>,
    problem: &EigenProblem,
    ritz: &Ritz,
    estimates: &[f64],
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Enclosed, ApproximationError> {
    let values = &ritz.pairs.values;
    let shift = pole(values, estimates, count);
    let (below, radius) = counted(problem, shift, monitor)?;
    if !(radius < LARGEST_RADIUS * shift.abs()) {
        let reason = format!("rounding makes the count of eigenvalues at {shift} uncertain by {radius:e}");
        return Err(ApproximationError::Unproven { reason });
    }
    // Ritz values lie above the eigenvalues that they stand for: beyond the shift, some of them.
    let least = values.partition_point(|&value| value < shift - radius);
    let most = values.iter().zip(estimates).filter(|&(value, error)| value - DOUBT * error <= shift + radius).count();
    if below < least {
        let reason = format!("{below} eigenvalues were counted below {shift}, where {least} Ritz values lie");
        return Err(ApproximationError::Unproven { reason });
    }
    if below > most.max(least) {
        return Err(ApproximationError::Incomplete { missing: below - most.max(least), shift: shift / problem.area });
    }
    let space = energy.in_order(&ritz.space);
    let sigma = SHIFT * (shift + energy.floor()).abs().max(KERNEL);
    let deviation = Deviation::new(problem, ritz, energy.floor() + sigma, monitor)?;
    let lowest = lower_bounds(energy, &space, ritz, &deviation, (shift - radius, below), sigma, WINDOW, monitor)?;
    let above = deviation.upper_bounds(&values[..count], energy.floor() + sigma);
    let bounds =
        (0..count).map(|k| (values[k] - lowest[k]).max(above[k] - values[k]).max(0.0)).collect::<Vec<_>>();
    if let Some(pair) = bounds.iter().position(|bound| !bound.is_finite()) {
        return Err(ApproximationError::Unproven { reason: format!("pair {pair} could not be enclosed") });
    }
    Ok(Enclosed { shift, below, bounds })
}

/// A shift beyond the pair `count`, in a gap if there is one.
fn pole(values: &[f64], estimates: &[f64], count: usize) -> f64 {
    let last = values.len() - 1;
    let gap = |k: usize| (values[k + 1] - DOUBT * estimates[k + 1] - values[k]) / values[k].abs().max(KERNEL);
    // Far off, but in a gap as wide as any.
    let widest = (count.max(1) - 1..last).map(gap).fold(0.0, f64::max);
    let place = (count.max(1) - 1..last).rev().find(|&k| gap(k) > 0.0 && gap(k) >= 0.5 * widest);
    match place {
        Some(k) => values[k] + 0.75 * gap(k) * values[k].abs().max(KERNEL),
        None => values[last] + 1e-3 * values[last].abs().max(KERNEL),
    }
}

/// Eigenvalues below a shift, and how far off that they may be which were counted.
fn counted(problem: &EigenProblem, shift: f64, monitor: &dyn Monitor) -> Result<(usize, f64), ApproximationError> {
    let factor = |error: chladni_algebra::FactorError| ApproximationError::Factor(error.to_string());
    let order = fill_reducing_order(&problem.stiffness, Ordering::Amd).map_err(factor)?;
    monitor.checkpoint()?;
    let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
    let symbolic = SymbolicFactor::new(&stiffness, &mass).map_err(factor)?;
    monitor.checkpoint()?;
    let factor = symbolic.factor(&stiffness, &mass, shift).map_err(factor)?;
    Ok((factor.eigenvalues_below(), factor.uncertainty(&stiffness, &mass, shift)))
}

#[expect(clippy::too_many_arguments, reason = "pairs in three parts, and where they are enclosed")]
/// Lower bounds of the eigenvalues of the lowest indices, as many as there are Ritz values; `-∞` where there is none.
fn lower_bounds(
    energy: &Energy<'_>,
    space: &SparseMatrix<f32>,
    ritz: &Ritz,
    deviation: &Deviation,
    (mut pole, mut most): (f64, usize),
    sigma: f64,
    window: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, ApproximationError> {
    let values = &ritz.pairs.values;
    let offset = energy.floor() + sigma;
    let mut lowest = vec![f64::NEG_INFINITY; values.len().max(most)];
    loop {
        // At most `most` eigenvalues lie below the pole.
        let hat = pole + offset;
        let end = values.partition_point(|value| value + offset < hat * (1.0 - NEAREST));
        let start = if end <= window + window / 4 { 0 } else { end - window };
        if start == end {
            return Ok(lowest);
        }
        let pairs = start..end;
        let theta = &values[pairs.clone()];
        let vectors = ritz.pairs.vectors.slice_columns(pairs.clone());
        let energies = energy.residual_energies(space, &vectors, theta, sigma, monitor)?;
        let hats: Vec<f64> = theta.iter().map(|value| value + offset).collect();
        let widening = deviation.widening(start, &hats, hat);
        for (j, bound) in goerisch(&hats, hat, &energies, widening, monitor)?.into_iter().enumerate() {
            if let Some(lowest) = (most - 1).checked_sub(j).and_then(|index| lowest.get_mut(index)) {
                *lowest = lowest.max(bound - offset);
            }
        }
        if start == 0 {
            return Ok(lowest);
        }
        // The next pole: in the upper half of the window, where a lower bound is farthest above the value before it.
        let gap = |k: &usize| (lowest[*k] - values[k - 1]) / values[*k].abs().max(KERNEL);
        let Some(next) = (start + window / 4..start + window / 2).max_by(|a, b| gap(a).total_cmp(&gap(b))) else {
            return Ok(lowest);
        };
        (pole, most) = (lowest[next], next);
    }
}

/// `1 / κⱼ`, from the one next to the pole downward: what `λ̂` of the `j`-th eigenvalue below the pole is at least. `widening` is what rounding may have done to
/// `κ − 1 / ρ̂`, as a factor.
fn goerisch(
    hats: &[f64],
    pole: f64,
    energies: &DenseMatrix,
    widening: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, ApproximationError> {
    let t = hats.len();
    assert_eq!((energies.rows(), energies.columns()), (t, t), "an energy for each two pairs");
    let scales: Vec<f64> = hats.iter().map(|hat| (pole / (pole - hat)).sqrt() / hat).collect();
    let mut matrix = DenseMatrix::zeros(t, t);
    for j in 0..t {
        let column = matrix.column_mut(j);
        for i in 0..t {
            column[i] = scales[i] * energies.column(j)[i] * scales[j];
        }
        column[j] += 1.0 / hats[j];
    }
    let largest = (0..t).map(|j| matrix.column(j).iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    // A symmetric eigensolver is backward stable.
    let rounding = 10.0 * t as f64 * f64::EPSILON * largest;
    let kappa = lowest_symmetric(matrix, t, monitor).map_err(ApproximationError::from)?.values;
    let base = 1.0 / pole;
    let bound = |kappa: f64| {
        let kappa = base + (kappa + rounding - base).max(0.0) * widening;
        if kappa.is_finite() { 1.0 / kappa } else { 0.0 }
    };
    Ok(kappa.into_iter().map(bound).collect())
}

/// How far `VᵀMV` and `VᵀAV` may be from the identity and the diagonal matrix of values, entry by entry.
struct Deviation {
    mass: DenseMatrix,
    energy: DenseMatrix,
}

impl Deviation {
    /// Of the restricted matrices, and of what rounding has done to them: the magnitudes that their entries are sums of, times the number of terms.
    fn new(
        problem: &EigenProblem,
        ritz: &Ritz,
        offset: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, ApproximationError> {
        let Ritz { space, mass, stiffness, pairs } = ritz;
        let vectors = &pairs.vectors;
        let (m, d) = (vectors.columns(), vectors.rows());
        let magnitude = |matrix: &SparseMatrix| {
            let values = matrix.values().iter().map(|value| value.abs()).collect();
            let (offsets, indices) = (matrix.offsets().to_vec(), matrix.indices().to_vec());
            SparseMatrix::from_sorted_parts(matrix.rows(), matrix.columns(), offsets, indices, values)
        };
        let columns = space.values().iter().map(|value| value.abs()).collect();
        let (offsets, indices) = (space.offsets().to_vec(), space.indices().to_vec());
        let magnitudes = SparseMatrix::from_sorted_parts(space.rows(), space.columns(), offsets, indices, columns);
        let of_mass = match &problem.mass {
            MassMatrix::Diagonal(_) => problem.mass.clone(),
            MassMatrix::Sparse(mass) => MassMatrix::Sparse(magnitude(mass)),
        };
        let (of_stiffness, of_mass) = galerkin(&magnitudes, &magnitude(&problem.stiffness), &of_mass, monitor)?;
        let mut entries = vec![0usize; d];
        space.indices().iter().for_each(|&column| entries[column as usize] += 1);
        let longest = (0..problem.size()).map(|row| problem.stiffness.row(row).0.len()).max().unwrap_or(0);
        let terms = entries.into_iter().max().unwrap_or(0) + longest + 2 * d + 8;
        let unit = 0.5 * f64::EPSILON * terms as f64;
        // |cᵢ|ᵀ B |cⱼ| is at most the root of the product of these.
        let sizes: Vec<(f64, f64)> = (0..m)
            .into_par_iter()
            .map(|k| {
                let form = |matrix: &SparseMatrix| -> f64 {
                    let c = vectors.column(k);
                    let row = |row: usize| {
                        let (columns, values) = matrix.row(row);
                        columns.iter().zip(values).map(|(&j, value)| value * c[j as usize].abs()).sum::<f64>()
                    };
                    (0..d).map(|i| c[i].abs() * row(i)).sum()
                };
                let mass = form(&of_mass);
                (mass, form(&of_stiffness) + offset.abs() * mass)
            })
            .collect();
        monitor.checkpoint()?;
        let gram = |matrix: &SparseMatrix| matrix.multiply_dense(vectors).and_then(|image| vectors.transposed_times(&image));
        let (Some(mut mass), Some(mut energy)) = (gram(mass), gram(stiffness)) else {
            panic!("restricted matrices of {} and {} rows for vectors of {d}", mass.rows(), stiffness.rows())
        };
        for j in 0..m {
            for i in 0..m {
                let of_mass = mass.column(j)[i];
                let (unit_mass, value) = if i == j { (1.0, pairs.values[j] + offset) } else { (0.0, 0.0) };
                let form = energy.column(j)[i] + offset * of_mass;
                mass.column_mut(j)[i] = (of_mass - unit_mass).abs() + unit * (sizes[i].0 * sizes[j].0).sqrt();
                energy.column_mut(j)[i] = (form - value).abs() + unit * (sizes[i].1 * sizes[j].1).sqrt();
            }
        }
        Ok(Self { mass, energy })
    }

    /// Upper bounds of the eigenvalues of the lowest indices: the Ritz values, and what the deviation of the pairs up to there adds.
    fn upper_bounds(&self, values: &[f64], offset: f64) -> Vec<f64> {
        let (mut of_mass, mut of_energy) = (0.0, 0.0);
        let mut bounds = Vec::with_capacity(values.len());
        for (j, value) in values.iter().enumerate() {
            // Norms of the leading blocks.
            for i in 0..=j {
                let twice = if i == j { 1.0 } else { 2.0 };
                of_mass += twice * self.mass.column(j)[i].powi(2);
                of_energy += twice * self.energy.column(j)[i].powi(2);
            }
            let (of_mass, of_energy) = (f64::sqrt(of_mass), f64::sqrt(of_energy));
            bounds.push(if of_mass < 1.0 { (value + offset + of_energy) / (1.0 - of_mass) - offset } else { f64::INFINITY });
        }
        bounds
    }

    /// The factor that the deviation of the pairs from `start` on may put on `κ − 1 / ρ̂`.
    fn widening(&self, start: usize, hats: &[f64], pole: f64) -> f64 {
        let base = 1.0 / pole;
        let gaps: Vec<f64> = hats.iter().map(|hat| (pole - hat) * base).collect();
        let (mut numerator, mut denominator) = (0.0, 0.0);
        for (j, hat) in hats.iter().enumerate() {
            let (mass, energy) = (&self.mass.column(start + j)[start..], &self.energy.column(start + j)[start..]);
            for (i, other) in hats.iter().enumerate() {
                let (mass, energy) = (mass[i], energy[i]);
                numerator += (mass + base * energy).powi(2) / (gaps[i] * gaps[j]);
                let form = mass * (1.0 / hat + 1.0 / other + 2.0 * base) + energy * (1.0 / (hat * other) + base * base);
                denominator += form * form * hat * other / (gaps[i] * gaps[j]).powi(2);
            }
        }
        let (numerator, denominator) = (numerator.sqrt(), denominator.sqrt());
        if numerator < 1.0 { (1.0 + denominator) / (1.0 - numerator) } else { f64::INFINITY }
    }
}

#[cfg(test)]
#[path = "lehmann_tests.rs"]
mod tests;
