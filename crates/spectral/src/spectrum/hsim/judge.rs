//! What is proven about pairs as they are delivered: one judgement of the final columns, the kernel among them, by an
//! inertia count.
//!
//! With `N` eigenvalues below a shift (up to what rounding may have done to the factor) and `N` orthonormal columns
//! whose Ritz values lie below it, the Ritz values bound the lowest `N` eigenvalues from above, each the one of its
//! index (Cauchy), and nothing is missing. From below, Lehmann's bounds hold, index by index as well: where exactly `t`
//! eigenvalues lie below `β`, the `j`-th is at least the `j`-th least of the eigenvalues of
//! `Θ − D^{-1/2} RᵀM⁻¹R D^{-1/2}` with `D = β − Θ`. The positive semi-definite matrix that is taken off is at most the
//! diagonal matrix of its weighted row sums, with any weights; those by the inverse norms of its rows leave
//! `‖r‖² / (β − θ)` times the sum of the cosines between the residuals: the bound of Temple for each, without an
//! assumption on gaps. `β` is the shift for all pairs, and then the lower bound of pair `t + 1` for the first `t`.
//!
//! Of a cluster that is cut, with more members than were found, a second shift lies just below it, with `t` eigenvalues
//! below. Those are bounded as above with that shift, and what was found of the cluster lies between the shift
//! (whatever is the `j`-th eigenvalue, with `j > t`, is not below it) and its Ritz value.
//!
//! Of a segment between two counts, with as many columns of its own as eigenvalues, Lehmann's bounds need no column
//! from outside (Zimmermann and Mertins 1995): above `Θ − D^{-1/2} RᵀM⁻¹R D^{-1/2}` and below `β` lie as many
//! eigenvalues as columns, and at most so many are counted there. From above they are enclosed in the same way, with
//! the count below.

use chladni_algebra::{
    ColumnSums, DenseMatrix, Factor, Magnitudes, PanelMatrix, residual_gram, residual_magnitudes, residual_sums,
    restrict,
};
use chladni_base::Monitor;

use super::HsimError;
use super::level::Level;

/// How many eigenvalues lie below a shift: at least those below `shift − radius`, at most those below `shift + radius`,
/// whatever rounding did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Count {
    pub shift: f64,
    pub below: usize,
    pub radius: f64,
}

impl Count {
    /// What a factor of a level at a shift says.
    pub fn of(level: &Level, shift: f64, factor: &Factor<'_>) -> Self {
        let radius = factor.uncertainty(&level.stiffness, &level.mass, shift);
        Self { shift, below: factor.eigenvalues_below(), radius }
    }

    /// Whether no value lies so close to the shift that the count may have taken it for one on the other side. `values`
    /// ascend.
    pub fn is_clear_of(&self, values: &[f64]) -> bool {
        let reach = 2.0 * self.radius;
        let inside = |value: f64| (value - self.shift).abs() <= reach;
        let at = values.partition_point(|&value| value < self.shift);
        !(at > 0 && inside(values[at - 1]) || values.get(at).is_some_and(|&value| inside(value)))
    }
}

/// Pairs that are to be judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidates<'a> {
    pub level: &'a Level,
    /// All pairs below the shift of `count`, by ascending value; more than are delivered where the last of those
    /// belongs to a cluster. Where there is a count below that cluster, those that are delivered.
    pub vectors: &'a PanelMatrix,
    /// On unit area.
    pub values: &'a [f64],
    /// The columns that are the kernel of the operator by its components.
    pub kernel: &'a std::ops::Range<usize>,
    pub count: Count,
    /// A count below all of them, where they are not the lowest.
    pub floor: Option<Count>,
    /// A count below the cluster that the last pair belongs to, where not all of that is here.
    pub below_cluster: Option<Count>,
    /// How many are delivered.
    pub wanted: usize,
    /// The largest residual (4.6).
    pub tolerance: f64,
    /// What was taken off the matrix times the mass: the eigenvalues of the problem are those of the level plus this.
    pub offset: f64,
}

/// What is proven, pair by pair.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    /// The residuals (4.6); for the kernel `‖S x‖ / (‖S‖ ‖x‖)`.
    pub residuals: Vec<f64>,
    /// The `k`-th eigenvalue lies so close to the `k`-th value, on unit area.
    pub bounds: Vec<f64>,
    /// How much of each bound is rounding, which no iteration makes smaller.
    pub errors: Vec<f64>,
    /// The largest entry of `|XᵀMX − I|`.
    pub defect: f64,
    /// What each column sums up to.
    pub sums: Vec<ColumnSums>,
}

/// The largest defect of orthonormality that is delivered.
pub(super) const LARGEST_DELIVERED_DEFECT: f64 = 1e-9;

/// Couplings `x_iᵀ(S − θM)x_j` above this share of the largest value are none of rounding.
const LARGEST_COUPLING: f64 = 1e-9;

/// Where `‖S x‖` is not larger than this times `‖S‖ ‖x‖`, it is as good as zero in double precision.
pub(super) const NULL: f64 = 64.0 * f64::EPSILON;

/// So much of `‖S x‖` may be rounding errors before the value of a pair is as good as zero: no tolerance that can be
/// asked for is as large.
pub(super) const AS_GOOD_AS_ZERO: f64 = 0.5;

/// Judges columns as they are.
///
/// # Errors
/// [`HsimError::Incomplete`] where columns and count differ, [`HsimError::NotConverged`] and [`HsimError::Unproven`]
/// where the columns are no such pairs.
pub(super) fn certify(found: &Candidates<'_>, monitor: &dyn Monitor) -> Result<Verdict, HsimError> {
    let Candidates { level, vectors, values, kernel, count, wanted, .. } = *found;
    let k = values.len();
    let unproven = |reason: String| Err(HsimError::Unproven { reason });
    let before = found.floor.map_or(0, |floor| floor.below);
    let fits = match found.below_cluster {
        None => before + k == count.below,
        Some(low) => {
            before + k <= count.below && before + values.partition_point(|&value| value < low.shift) == low.below
        }
    };
    if vectors.columns() != k || !fits || wanted > k {
        return Err(HsimError::Incomplete {
            missing: count.below.abs_diff(before + k).max(wanted.saturating_sub(k)),
            shift: count.shift,
        });
    }
    if values.iter().any(|value| !value.is_finite()) || !values.is_sorted() {
        return unproven("values are not in order".to_owned());
    }
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, vectors, monitor)?;
    let defect = defect(&gram);
    if !(defect <= LARGEST_DELIVERED_DEFECT) {
        return unproven(format!("columns are {defect:e} away from orthonormal"));
    }
    let couplings = couplings(&stiffness, &gram, values);
    let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let magnitudes = residual_magnitudes(&level.stiffness, &level.mass, vectors, values, found.offset, monitor)?;
    let unit = Units::new(level);
    let rounding: Vec<f64> = magnitudes.iter().map(|magnitude| unit.row * magnitude.product).collect();
    for (column, coupling) in couplings.iter().enumerate() {
        let allowed = LARGEST_COUPLING * largest + (k as f64) * rounding[column];
        if !(*coupling <= allowed) {
            return unproven(format!("pair {column} is coupled to others by {coupling:e}"));
        }
    }
    let sums = residual_sums(&level.stiffness, &level.mass, vectors, values, monitor)?;
    let norm = norm(level);
    let residuals: Vec<f64> = (0..wanted)
        .map(|column| {
            let floor = unit.row * (magnitudes[column].square / sums[column].stiffness).sqrt();
            let null = kernel.contains(&column) || floor >= AS_GOOD_AS_ZERO;
            residual(&sums[column], values[column], found.offset, norm, null)
        })
        .collect();
    require(&residuals, &sums, &magnitudes, unit, found.tolerance)?;
    // How far each value may be off the Ritz value of the exact matrices.
    let errors: Vec<f64> = (0..k)
        .map(|j| rounding[j] + couplings[j] + unit.sum * (values[j].abs() + found.offset.abs() + count.shift.abs()))
        .collect();
    let highest = values.iter().zip(&errors).map(|(value, error)| value + error).fold(f64::NEG_INFINITY, f64::max);
    if !(highest < count.shift - count.radius) {
        return unproven(format!("the count at {} is uncertain by {:e}", count.shift, count.radius));
    }
    if let Some(floor) = found.floor {
        let lowest = values.iter().zip(&errors).map(|(value, error)| value - error).fold(f64::INFINITY, f64::min);
        if !(lowest > floor.shift + floor.radius) {
            return unproven(format!("the count at {} is uncertain by {:e}", floor.shift, floor.radius));
        }
    }
    if let Some(low) = found.below_cluster {
        let below = values.iter().zip(&errors).take(low.below - before).map(|(value, error)| value + error);
        if !(below.fold(f64::NEG_INFINITY, f64::max) < low.shift - low.radius) {
            return unproven(format!("the count at {} is uncertain by {:e}", low.shift, low.radius));
        }
    }
    let squares = residual_gram(&level.stiffness, &level.mass, vectors, values, monitor)?;
    // So many eigenvalues at most lie below this.
    let ceiling = match found.below_cluster {
        None => (k, count.shift - count.radius),
        Some(low) => (low.below - before, low.shift - low.radius),
    };
    let floor = found.floor.map(|floor| floor.shift + floor.radius);
    let bounds = bounds(values, &squares, &magnitudes, &errors, level, unit, (floor, ceiling));
    Ok(Verdict { residuals, bounds, errors, defect, sums })
}

/// The largest entry of `|G − I|`.
fn defect(gram: &DenseMatrix) -> f64 {
    let mut defect = 0f64;
    for column in 0..gram.columns() {
        for (row, &value) in gram.column(column).iter().enumerate() {
            let entry = (value - f64::from(u8::from(row == column))).abs();
            // Anything that is not a number counts as well.
            defect = if entry <= defect { defect } else { entry };
        }
    }
    defect
}

/// Per column the norm of the couplings `x_iᵀ(S − ½(θ_i + θ_j)M)x_j`, its own, by which it is no Rayleigh quotient,
/// included.
fn couplings(stiffness: &DenseMatrix, gram: &DenseMatrix, values: &[f64]) -> Vec<f64> {
    let column = |j: usize| {
        let entries = stiffness.column(j).iter().zip(gram.column(j)).zip(values);
        entries.map(|((s, g), value)| (s - 0.5 * (value + values[j]) * g).powi(2)).sum::<f64>().sqrt()
    };
    (0..values.len()).map(column).collect()
}

/// What rounding errors are multiples of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Units {
    /// Of an entry of `S x − θ M x`, over the magnitudes that it sums.
    pub row: f64,
    /// Of a sum over all rows, over the sum of its magnitudes.
    sum: f64,
}

impl Units {
    pub fn new(level: &Level) -> Self {
        let n = level.size();
        let longest = (0..n).map(|row| level.stiffness.row(row).0.len()).max().unwrap_or(0);
        let unit = 0.5 * f64::EPSILON;
        // Twice: entries of the matrices are rounded themselves.
        Self { row: 2.0 * unit * (longest as f64 + 4.0), sum: unit * (256.0 + n as f64 / 256.0) }
    }
}

fn norm(level: &Level) -> f64 {
    let sum = |row: usize| level.stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>();
    (0..level.size()).map(sum).fold(0.0, f64::max)
}

/// The residual (4.6) of the problem without the offset, that of a kernel for the kernel.
fn residual(sums: &ColumnSums, value: f64, offset: f64, norm: f64, kernel: bool) -> f64 {
    let null = offset == 0.0 && (kernel || sums.stiffness <= (NULL * norm).powi(2) * sums.square);
    let (part, whole) = if null {
        (sums.stiffness, norm * norm * sums.square)
    } else if offset == 0.0 {
        (sums.residual, sums.stiffness)
    } else if kernel {
        // The operator is the offset times the mass on these columns.
        (sums.residual, (norm * norm).max(offset * offset) * sums.square)
    } else {
        // ‖S x‖ + offset ‖M x‖ for a pair, whose two parts have one direction.
        let share = match value {
            0.0 => 1.0,
            value if offset < 0.0 => 1.0 + offset / value,
            value => 1.0 + offset / value.abs(),
        };
        (sums.residual, sums.stiffness * share * share)
    };
    if part == 0.0 { 0.0 } else { (part / whole).sqrt() }
}

/// That every pair has converged; where rounding does not let it, that is said.
fn require(
    residuals: &[f64],
    sums: &[ColumnSums],
    magnitudes: &[Magnitudes],
    unit: Units,
    tolerance: f64,
) -> Result<(), HsimError> {
    let failed: Vec<usize> = (0..residuals.len()).filter(|&column| !(residuals[column] <= tolerance)).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let worst = failed.iter().map(|&column| residuals[column]).fold(0.0, f64::max);
    let floors = failed.iter().map(|&column| unit.row * (magnitudes[column].square / sums[column].stiffness).sqrt());
    let floor = floors.fold(0.0, f64::max);
    if worst <= floor {
        return Err(HsimError::Floor { tolerance, floor });
    }
    Err(HsimError::NotConverged { count: failed.len(), tolerance, iterations: 0, worst })
}

/// Lehmann's bounds: see the head of the file.
fn bounds(
    values: &[f64],
    squares: &DenseMatrix,
    magnitudes: &[Magnitudes],
    errors: &[f64],
    level: &Level,
    unit: Units,
    (floor, (below, ceiling)): (Option<f64>, (usize, f64)),
) -> Vec<f64> {
    let k = values.len();
    let factor = level.mass.lumped_ratio();
    // ‖a + b‖² ≤ (1 + s)‖a‖² + (1 + 1/s)‖b‖², with s = 1/64 for what was computed and what rounding did to it.
    let part = factor * (1.0 + 1.0 / 32.0);
    let own =
        |j: usize| part * squares.column(j)[j] + factor * 65.0 * k as f64 * unit.row * unit.row * magnitudes[j].dual;
    let lengths: Vec<f64> = (0..k).map(|j| own(j).sqrt()).collect();
    let weighted: Vec<f64> = (0..k)
        .map(|j| {
            let cosines: f64 = (0..k)
                .filter(|&i| i != j && lengths[i] > 0.0)
                .map(|i| part * squares.column(j)[i].abs() / lengths[i])
                .sum();
            lengths[j] * (lengths[j] + cosines)
        })
        .collect();
    let lower = lower_bounds(values, errors, &weighted, below, ceiling);
    // Of the lowest pairs, Ritz values are bounds from above. Others are enclosed by what lies below them as by what
    // lies above, in a mirror.
    let upper = floor.map(|floor| {
        let mirrored = |numbers: &[f64]| numbers.iter().rev().copied().collect::<Vec<f64>>();
        let negative: Vec<f64> = values.iter().rev().map(|value| -value).collect();
        lower_bounds(&negative, &mirrored(errors), &mirrored(&weighted), k, -floor)
    });
    let above = |j: usize| upper.as_ref().map_or(0.0, |upper| -upper[k - 1 - j] - values[j]);
    (0..k).map(|j| (values[j] - lower[j]).max(above(j)).max(0.0) + errors[j]).collect()
}

/// What the eigenvalues that belong to ascending values are at least, where at most `below` of them, counted from the
/// first, lie below `ceiling`: `weighted` are their residuals by Lehmann's bound.
fn lower_bounds(values: &[f64], errors: &[f64], weighted: &[f64], below: usize, ceiling: f64) -> Vec<f64> {
    let mut lower = vec![f64::NEG_INFINITY; values.len()];
    lower[below..].fill(ceiling);
    let mut temples: Vec<f64> = Vec::with_capacity(below);
    for t in (1..=below).rev() {
        // At most t eigenvalues lie below this.
        let beta = if t == below { ceiling } else { lower[t] };
        if !(beta > values[t - 1] + errors[t - 1]) {
            continue;
        }
        temples.clear();
        temples.extend((0..t).map(|j| values[j] - errors[j] - weighted[j] / (beta - values[j])));
        temples.sort_by(f64::total_cmp);
        lower.iter_mut().zip(&temples).for_each(|(lower, &temple)| *lower = lower.max(temple));
    }
    lower
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
