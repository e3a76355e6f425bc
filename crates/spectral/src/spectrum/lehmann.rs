//! Enclosures of approximate eigenvalues, index by index: one inertia count and the bounds of Lehmann and Goerisch.
//!
//! Ritz values lie above the eigenvalues of their index. For bounds from below let at most `k` eigenvalues lie below a
//! pole `ρ`, and let `V` be Ritz vectors with values `Θ` below it. With `A = S + (c + σ) M`, hats for values plus
//! `c + σ`, the operator `A⁻¹M` has the eigenvalues `1 / λ̂`, and Lehmann's bounds on those next to `1 / ρ̂` need
//! `(MV)ᵀA⁻¹(MV)`, which is known up to `G ⪰ RᵀA⁻¹R`, `R` the residuals. What remains is a symmetric matrix: with
//! `D = ρ̂ − Θ̂` and `VᵀMV = I`, `VᵀAV = Θ̂`, the eigenvalues `κ₁ ≤ κ₂ ≤ …` of
//!
//! ```text
//! Θ̂⁻¹ + ρ̂ Θ̂⁻¹ D^-½ G D^-½ Θ̂⁻¹
//! ```
//!
//! give `λ̂_{k+1−j} ≥ 1 / κⱼ` (Goerisch and He, 1990; Behnke and Goerisch, 1994). The lower bound of a pair is a pole
//! for those below it, so one count is enough for any number of pairs. Where more eigenvalues were counted than Ritz
//! values lie below the pole, the indices shift by the difference: bounds hold, and are wider. That `VᵀMV` and `VᵀAV`
//! are diagonal up to rounding alone is part of the bound.

use chladni_base::parallel::*;
use std::ops::Range;

use super::certificate::KERNEL;
use super::energy::{Corrections, Energy, MOST_FACTORED};
use super::error::ApproximationError;
use super::restricted::Ritz;
use super::shifted::ShiftedPencil;
use crate::operator::EigenProblem;
use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix, WeightedMass, galerkin, lowest_symmetric};
use chladni_base::Monitor;

/// σ as a share of the pole. Larger ones make cycles converge faster, and widen the bounds by about as much.
const SHIFT: f64 = 0.5;

/// Pairs that are enclosed together: products grow with the square.
const WINDOW: usize = 512;

/// A pair nearer to its pole than this share takes no part: rounding would be divided by it.
const NEAREST: f64 = 1e-4;

/// Estimates may be wrong by this factor before a pole is no longer in a gap.
const DOUBT: f64 = 1.3;

/// Fewer pairs than this are not counted apart.
const LEAST_AGAIN: usize = 2;

/// Where more eigenvalues are counted than values lie below, the next gap is tried: so many at most.
const MOST_COUNTS: usize = 3;

/// A bound above this share of its value says nothing.
const LARGEST_BOUND: f64 = 0.5;

/// Where the largest bound that cycles lead to exceeds this share of its value, a factor takes their place.
const WIDE: f64 = 0.1;

/// A count that rounding makes uncertain by more than this share of its shift proves nothing of pairs that are next to
/// each other.
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
/// [`ApproximationError::Unproven`] where no count can be trusted or a pair has no bound,
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
    let pencil = ShiftedPencil::new(problem, monitor)?;
    // Bounds are the closer, the farther the pole.
    let last = values.len() - 1;
    let first = count.max(1) - 1 + (last + 1 - count) / 3;
    // There is no gap among zeros.
    let first = first.max(values.partition_point(|&value| value <= 0.0)).min(last);
    let (shift, below, radius) = anchor(&pencil, values, estimates, first..last, monitor)?;
    if !(radius < LARGEST_RADIUS * shift.abs()) {
        let (at, by) = (shift / problem.area, radius / problem.area);
        let reason = if by.is_finite() {
            format!("rounding makes the count of eigenvalues at {at} uncertain by {by:e}")
        } else {
            format!("eigenvalues coincide at {at}, and there is no gap to count them in")
        };
        return Err(ApproximationError::Unproven { reason });
    }
    // Ritz values lie above the eigenvalues of their index.
    let least = values.partition_point(|&value| value < shift - radius);
    if below < least {
        let at = shift / problem.area;
        let reason = format!("{below} eigenvalues were counted below {at}, where {least} Ritz values lie");
        return Err(ApproximationError::Unproven { reason });
    }
    let sigma = SHIFT * (shift + energy.floor()).abs().max(KERNEL);
    let poles = poles(&pencil, values, estimates, (shift, below, radius), monitor)?;
    let space = energy.in_order(&ritz.space);
    let deviation = Deviation::new(problem, ritz, energy.floor() + sigma, monitor)?;
    let above = deviation.upper_bounds(&values[..count], energy.floor() + sigma);
    let bounds = |corrections: Corrections<'_>| -> Result<Vec<f64>, ApproximationError> {
        let mut lowest = vec![f64::NEG_INFINITY; count];
        for &pole in &poles {
            let found = lower_bounds(energy, &space, ritz, &deviation, pole, corrections, WINDOW, monitor)?;
            lowest.iter_mut().zip(found).for_each(|(lowest, found)| *lowest = lowest.max(found));
        }
        Ok((0..count).map(|k| (values[k] - lowest[k]).max(above[k] - values[k]).max(0.0)).collect())
    };
    let mut found = bounds(Corrections::Cycles(sigma))?;
    if largest_share(values, &found).1 > WIDE && energy.size() <= MOST_FACTORED {
        let solver = energy.solver(&pencil, sigma)?;
        let closer = bounds(Corrections::Factor(&solver))?;
        found.iter_mut().zip(closer).for_each(|(bound, closer)| *bound = bound.min(closer));
    }
    require_meaning(values, &found)?;
    Ok(Enclosed { shift, below, bounds: found })
}

/// A pole behind the last pair, and those below that put indices right: where more eigenvalues were counted than Ritz
/// values lie below, the pairs below the one that is missing have bounds of their own index only from a pole below it.
fn poles(
    pencil: &ShiftedPencil,
    values: &[f64],
    estimates: &[f64],
    (shift, below, radius): (f64, usize, f64),
    monitor: &dyn Monitor,
) -> Result<Vec<(f64, usize)>, ApproximationError> {
    let mut poles = vec![(shift - radius, below)];
    let mut end = values.partition_point(|&value| value < shift);
    let mut missing = below.saturating_sub(end);
    while missing > 0 && end > LEAST_AGAIN {
        let (shift, below, radius) = anchor(pencil, values, estimates, end / 4..(3 * end / 4).max(1), monitor)?;
        let next = values.partition_point(|&value| value < shift);
        if next >= end {
            break;
        }
        end = next;
        if below.saturating_sub(end) < missing {
            missing = below.saturating_sub(end);
            poles.push((shift - radius, below));
        }
    }
    Ok(poles)
}

/// The bound that is the largest share of its value, the values that are zero apart: its pair, and that share.
fn largest_share(values: &[f64], bounds: &[f64]) -> (usize, f64) {
    // Zeros have rounding errors for a bound, which are no share of them.
    let is_of_zero = |value: f64, bound: f64| value.abs() <= KERNEL && bound.is_finite();
    let shares = bounds.iter().zip(values).map(|(&bound, &value)| {
        let share = bound / value.abs();
        if is_of_zero(value, bound) {
            0.0
        } else if share.is_nan() {
            f64::INFINITY
        } else {
            share
        }
    });
    shares.enumerate().fold((0, 0.0), |worst, (pair, share)| if share > worst.1 { (pair, share) } else { worst })
}

/// That every bound says something of its value.
fn require_meaning(values: &[f64], bounds: &[f64]) -> Result<(), ApproximationError> {
    let (pair, share) = largest_share(values, bounds);
    if share <= LARGEST_BOUND {
        return Ok(());
    }
    let percent = 100.0 * share;
    let reason = format!(
        "the bound of pair {pair} would be {percent:.0} % of its value; the method \"hsim\" proves such pairs, and a larger dimension may"
    );
    Err(ApproximationError::Unproven { reason })
}

/// Shifts in the widest gaps behind the values of some indices, those first. Where there is no gap, one behind the last
/// of them.
fn gaps(values: &[f64], estimates: &[f64], places: Range<usize>) -> Vec<f64> {
    let size = |k: usize| values[k].abs().max(KERNEL);
    let gap = |k: usize| (values[k + 1] - DOUBT * estimates[k + 1] - values[k]) / size(k);
    let mut wide: Vec<usize> = places.clone().filter(|&k| k + 1 < values.len() && gap(k) > 0.0).collect();
    wide.sort_by(|&a, &b| gap(b).total_cmp(&gap(a)));
    wide.truncate(MOST_COUNTS);
    if wide.is_empty() {
        let last = places.end.min(values.len() - 1);
        return vec![values[last] + 1e-3 * size(last)];
    }
    wide.into_iter().map(|k| values[k] + 0.75 * gap(k) * size(k)).collect()
}

/// A shift behind one of some values, how many eigenvalues lie below, and how uncertain that is: the first of a few
/// where no more lie below than values, if there is one.
fn anchor(
    pencil: &ShiftedPencil,
    values: &[f64],
    estimates: &[f64],
    places: Range<usize>,
    monitor: &dyn Monitor,
) -> Result<(f64, usize, f64), ApproximationError> {
    let mut found = (f64::NAN, 0, f64::INFINITY);
    for shift in gaps(values, estimates, places) {
        monitor.checkpoint()?;
        let (below, radius) = match pencil.count(shift) {
            // On an eigenvalue, as where many coincide and there is no gap.
            Err(ApproximationError::Factor(_)) => {
                found.0 = shift;
                continue;
            }
            counted => counted?,
        };
        found = (shift, below, radius);
        if below == values.partition_point(|&value| value < shift) {
            break;
        }
    }
    Ok(found)
}

/// Lower bounds of the eigenvalues of the lowest indices, from a pole below which at most so many lie; that of the
/// whole operator where there is none.
#[expect(clippy::too_many_arguments, reason = "pairs in three parts, and where they are enclosed")]
fn lower_bounds(
    energy: &Energy<'_>,
    space: &SparseMatrix<f32>,
    ritz: &Ritz,
    deviation: &Deviation,
    (mut pole, mut most): (f64, usize),
    corrections: Corrections<'_>,
    window: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, ApproximationError> {
    let values = &ritz.pairs.values;
    let offset = energy.floor() + corrections.sigma();
    let mut lowest = vec![-energy.floor(); values.len().max(most)];
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
        let energies = energy.residual_energies(space, &vectors, theta, corrections, monitor)?;
        let hats: Vec<f64> = theta.iter().map(|value| value + offset).collect();
        let rounding = deviation.rows(start, &hats, hat);
        for (j, bound) in goerisch(&hats, hat, &energies, &rounding, monitor)?.into_iter().enumerate() {
            if let Some(lowest) = most.checked_sub(j + 1).and_then(|index| lowest.get_mut(index)) {
                *lowest = lowest.max(bound - offset);
            }
        }
        // The next pole: where a lower bound is farthest above the value before it.
        let gap = |k: &usize| (lowest[*k] - values[k - 1]) / values[*k].abs().max(KERNEL);
        let next = if start > 0 {
            (start + window / 4..start + window / 2).max_by(|a, b| gap(a).total_cmp(&gap(b)))
        } else {
            None
        };
        let Some(next) = next else { return Ok(lowest) };
        (pole, most) = (lowest[next], next);
    }
}

/// What rounding may have done to the row of a pair: it takes the first off `D / ρ̂`, and adds the second to what is
/// divided by it.
type Rounding = (f64, f64);

/// `1 / κⱼ`, from the one next to the pole downward: what `λ̂` of the `j`-th eigenvalue below the pole is at least.
/// Nothing where rounding leaves nothing of a distance to the pole.
fn goerisch(
    hats: &[f64],
    pole: f64,
    energies: &DenseMatrix,
    rounding: &[Rounding],
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, ApproximationError> {
    let t = hats.len();
    assert_eq!((energies.rows(), energies.columns()), (t, t), "an energy for each two pairs");
    let base = 1.0 / pole;
    let gaps: Vec<f64> = hats.iter().map(|hat| (pole - hat) * base).collect();
    let least: Vec<f64> = gaps.iter().zip(rounding).map(|(gap, (of_gap, _))| gap - of_gap).collect();
    if !least.iter().all(|&gap| gap > 0.0) {
        return Ok(Vec::new());
    }
    let scales: Vec<f64> = hats.iter().zip(&least).map(|(hat, gap)| gap.sqrt().recip() / hat).collect();
    let mut matrix = DenseMatrix::zeros(t, t);
    for j in 0..t {
        let column = matrix.column_mut(j);
        for i in 0..t {
            column[i] = scales[i] * energies.column(j)[i] * scales[j];
        }
        column[j] += base + (gaps[j] * gaps[j] / hats[j] + rounding[j].1) / least[j];
    }
    let largest = (0..t).map(|j| matrix.column(j).iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    // A symmetric eigensolver is backward stable.
    let solved = 10.0 * t as f64 * f64::EPSILON * largest;
    let kappa = lowest_symmetric(matrix, t, monitor).map_err(ApproximationError::from)?.values;
    let bound = |kappa: f64| 1.0 / (kappa + solved).max(base);
    Ok(kappa.into_iter().map(bound).collect())
}

/// How far `VᵀMV` and `VᵀAV` may be from the identity and the diagonal matrix of values, entry by entry.
struct Deviation {
    mass: DenseMatrix,
    energy: DenseMatrix,
}

impl Deviation {
    /// Of the restricted matrices, and of what rounding has done to them: the magnitudes that their entries are sums
    /// of, times the number of terms.
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
            MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                MassMatrix::Sparse(magnitude(mass))
            }
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
        let gram = |matrix: &SparseMatrix| vectors.transposed_times(&matrix.multiply_dense(vectors));
        let (mut mass, mut energy) = (gram(mass), gram(stiffness));
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

    /// Upper bounds of the eigenvalues of the lowest indices: the Ritz values, and what the deviation of the pairs up
    /// to there adds.
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
            bounds.push(if of_mass < 1.0 {
                (value + offset + of_energy) / (1.0 - of_mass) - offset
            } else {
                f64::INFINITY
            });
        }
        bounds
    }

    /// What the deviation of the pairs from `start` on does to their rows, by row sums.
    fn rows(&self, start: usize, hats: &[f64], pole: f64) -> Vec<Rounding> {
        let base = 1.0 / pole;
        let row = |(j, hat): (usize, &f64)| {
            let (mass, energy) = (&self.mass.column(start + j)[start..], &self.energy.column(start + j)[start..]);
            let entries = hats.iter().zip(mass.iter().zip(energy)).map(|(other, (mass, energy))| {
                let of_gap = mass + base * energy;
                let of_form =
                    mass * (1.0 / hat + 1.0 / other + 2.0 * base) + energy * (1.0 / (hat * other) + base * base);
                (of_gap, of_form)
            });
            entries.fold((0.0, 0.0), |(gap, form), (of_gap, of_form)| (gap + of_gap, form + of_form))
        };
        hats.iter().enumerate().map(row).collect()
    }
}

#[cfg(test)]
#[path = "lehmann_tests.rs"]
mod tests;
