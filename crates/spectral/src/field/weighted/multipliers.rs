//! Lagrange multipliers: what pulls at each constrained number so that the constraints are met.

use chladni_algebra::{DefiniteError, DefiniteFactor, DenseMatrix, lowest_symmetric, solve_definite};
use chladni_base::Unwatched;

use super::super::compliance::{mean_of_diagonal, slacks};
use super::super::constraints::{Condition, HARD, Slack};
use super::super::design::DesignError;
use super::super::idle::Kernel;
use super::super::idle_parts::{Parts, norm};
use super::{Inverse, WeightedModel};
use crate::basis::FieldBasis;

/// Steps that take back, where it matters, what hard constraints give way.
const REFINEMENTS: usize = 2;

/// The system for the multipliers, `C K⁻¹ Cᵀ` with what each constraint gives way on its diagonal.
pub(in super::super) struct System {
    matrix: DenseMatrix,
    pub(in super::super) factor: DefiniteFactor,
    /// Mean of the diagonal before constraints gave way.
    mean: f64,
    /// By how much each number gives way to a pull; nothing where a constraint is hard.
    slacks: Vec<f64>,
    /// How much fields without energy were added to it.
    held: f64,
}

/// How much there is of each field without energy.
pub(in super::super) struct Shares {
    /// In the field.
    pub amounts: Vec<f64>,
    /// In what constraints are missing.
    pub taken: Vec<f64>,
}

/// Fields without energy, of length 1 in the mean, are mixed to no more than so many times the longest value that is
/// asked for: where they are small at constraints, as harmonic fields are far from their holes, they would meet these
/// at no cost with fields of any length. What is missing costs energy then. No more is needed where they are about as
/// long everywhere.
pub(in super::super) const LONGEST_IDLE: f64 = 3.0;

/// Steps of bisection: to the last digit over 40 orders of magnitude.
const BISECTIONS: usize = 200;

impl WeightedModel {
    /// What pulls at each constrained number; puts the part of the solution that has no energy into `z`.
    pub(super) fn multipliers(
        &self,
        rows: &DenseMatrix,
        compliance: DenseMatrix,
        conditions: &[Condition],
        (basis, kernel): (&FieldBasis, Kernel<'_>),
        z: &mut [f64],
    ) -> Result<Vec<f64>, DesignError> {
        let b = basis.space.block();
        let right = right_hand_sides(rows, conditions, (b, kernel), z);
        let most = match &self.inverse {
            Inverse::Ritz(diagonal) => diagonal.iter().fold(0.0f64, |most, &d| most.max(d)),
            Inverse::Sparse(_) => 0.0,
        };
        let system = System::new(compliance, conditions, b, (&right, most))?;
        let mut solutions = right.clone();
        system.factor.solve(&mut solutions).map_err(DesignError::Factor)?;
        let mut y = solutions.column(0).to_vec();
        if matches!(self.inverse, Inverse::Sparse(_)) {
            system.refine(right.column(0), conditions, b, &mut y)?;
        }
        if kernel.count() > 0 {
            let parts = self.parts(basis, kernel, conditions);
            let shares = system.shares_of_kernel(&right, &solutions, (b, &parts), &mut Vec::new())?;
            for (j, (&amount, &taken)) in shares.amounts.iter().zip(&shares.taken).enumerate() {
                kernel.add(j, amount, z);
                y.iter_mut().zip(solutions.column(1 + j)).for_each(|(y, t)| *y -= taken * t);
            }
        }
        Ok(y)
    }

    /// `C K⁻¹ Cᵀ`: how far a pull at one constrained number moves each other.
    pub(super) fn compliance_of(&self, rows: &DenseMatrix, solved: &DenseMatrix) -> DenseMatrix {
        match &self.inverse {
            Inverse::Ritz(diagonal) => {
                // Half of K⁻¹ on either side keeps the product symmetric.
                let mut scaled = rows.clone();
                for column in 0..rows.columns() {
                    scaled.column_mut(column).iter_mut().zip(diagonal).for_each(|(x, d)| *x *= d.sqrt());
                }
                scaled.transposed_times(&scaled)
            }
            Inverse::Sparse(_) => rows.transposed_times(solved),
        }
    }
}

impl System {
    /// Of what pulls move, to which it adds by how much each condition gives way. `right` has the values of fields
    /// without energy in all columns but the first; `yielding` is what such a field may be taken to give way by, if it
    /// is more than what those with energy do at these numbers.
    ///
    /// # Errors
    /// [`DesignError::Dependent`]: a condition that follows from others, or contradicts them.
    pub(in super::super) fn new(
        mut matrix: DenseMatrix,
        conditions: &[Condition],
        b: usize,
        (right, yielding): (&DenseMatrix, f64),
    ) -> Result<Self, DesignError> {
        let mean = mean_of_diagonal(&matrix);
        let mut slacks = slacks(&matrix, conditions, b);
        for (i, slack) in slacks.iter_mut().enumerate() {
            matrix.column_mut(i)[i] += *slack;
            if is_hard(&conditions[i / b]) {
                *slack = 0.0;
            }
        }
        let held = hold_idle(&mut matrix, mean, (right, yielding));
        let factor = DefiniteFactor::new(matrix.clone()).map_err(|error| match error {
            DefiniteError::NotPositiveDefinite { pivot } => {
                DesignError::Dependent { face: conditions[(pivot / b).min(conditions.len() - 1)].face }
            }
            other => DesignError::Factor(other),
        })?;
        Ok(Self { matrix, factor, mean, slacks, held })
    }

    /// What is missing at each constrained number of a field, whose numbers there are `values`, under pulls; and the
    /// most of it where a constraint is hard.
    pub(in super::super) fn missing(
        &self,
        values: impl Iterator<Item = f64>,
        conditions: &[Condition],
        b: usize,
        y: &[f64],
    ) -> (Vec<f64>, f64) {
        let own = |(i, value): (usize, f64)| conditions[i / b].value[i % b] - value - self.slacks[i] * y[i];
        let missing: Vec<f64> = values.enumerate().map(own).collect();
        let hard = missing.iter().enumerate().filter(|(i, _)| is_hard(&conditions[i / b]));
        let most = hard.fold(0.0f64, |most, (_, missed)| most.max(missed.abs()));
        (missing, most)
    }

    /// Has hard constraints give way no longer. Where `K⁻¹` is a sparse factor, a pull moves what has nearly no energy
    /// so far that the share of it which they give way is much.
    pub(in super::super) fn refine(
        &self,
        right: &[f64],
        conditions: &[Condition],
        b: usize,
        y: &mut [f64],
    ) -> Result<(), DesignError> {
        let k = y.len();
        for _ in 0..REFINEMENTS {
            let mut rest = DenseMatrix::zeros(k, 1);
            for i in 0..k {
                let own: f64 = self.matrix.column(i).iter().zip(y.iter()).map(|(s, y)| s * y).sum();
                let given = if is_hard(&conditions[i / b]) { HARD * self.mean * y[i] } else { 0.0 };
                rest.column_mut(0)[i] = right[i] - own + given;
            }
            self.factor.solve(&mut rest).map_err(DesignError::Factor)?;
            y.iter_mut().zip(rest.column(0)).for_each(|(y, r)| *y += r);
        }
        Ok(())
    }
}

/// Adds `c N Nᵀ` to what pulls move, with the values `N` of fields without energy. Pulls do no work on these,
/// `Nᵀ y = 0`, so that it changes no solution; but where nothing else moves, as on a component of which the space has
/// these fields alone, it is what the system is solved by. Without, all that it had there was rounding, whose inverse
/// drowned what the other components say. Gives `c`.
fn hold_idle(matrix: &mut DenseMatrix, mean: f64, (right, yielding): (&DenseMatrix, f64)) -> f64 {
    let (k, columns) = (matrix.columns(), right.columns());
    if columns < 2 || k == 0 {
        return 0.0;
    }
    let mut values = DenseMatrix::zeros(columns - 1, k);
    for j in 1..columns {
        right.column(j).iter().enumerate().for_each(|(i, &value)| values.column_mut(i)[j - 1] = value);
    }
    let products = values.transposed_times(&values);
    let size = mean_of_diagonal(&products);
    if !(size > 0.0) {
        return 0.0;
    }
    let scale = if mean > 0.0 { (mean / size).max(yielding) } else { yielding.max(1.0) };
    matrix.values_mut().iter_mut().zip(products.values()).for_each(|(own, product)| *own += scale * product);
    scale
}

fn is_hard(condition: &Condition) -> bool {
    matches!(condition.slack, Slack::Share(share) if share == HARD)
}

/// `k × (1 + f)`: what is missing at each constrained number, and there the values of the `f` fields of the kernel.
fn right_hand_sides(
    rows: &DenseMatrix,
    conditions: &[Condition],
    (b, kernel): (usize, Kernel<'_>),
    z: &[f64],
) -> DenseMatrix {
    let (k, free) = (rows.columns(), kernel.count());
    let mut right = DenseMatrix::zeros(k, 1 + free);
    for i in 0..k {
        let reached: f64 = rows.column(i).iter().zip(z.iter()).map(|(r, z)| r * z).sum();
        right.column_mut(0)[i] = conditions[i / b].value[i % b] - reached;
        for j in 0..free {
            right.column_mut(1 + j)[i] = kernel.along(j, rows.column(i));
        }
    }
    right
}

impl System {
    /// How much of each field of the kernel there is; where constraints do not say, as little as possible, and on no
    /// component more than [`LONGEST_IDLE`] allows. Whether that is so is told by the first of several steps and kept
    /// in `yielding`, by how much the fields of each component give way then.
    pub(in super::super) fn shares_of_kernel(
        &self,
        right: &DenseMatrix,
        solutions: &DenseMatrix,
        (b, parts): (usize, &Parts<'_>),
        yielding: &mut Vec<f64>,
    ) -> Result<Shares, DesignError> {
        let free = right.columns() - 1;
        let first = yielding.is_empty();
        let mut all = Shares { amounts: vec![0.0; free], taken: vec![0.0; free] };
        if free == 0 {
            return Ok(all);
        }
        for (at, part) in parts.list.iter().enumerate() {
            if !parts.has_conditions(part) {
                yielding.extend(first.then_some(f64::INFINITY));
                continue;
            }
            let products = part.mixed(right).transposed_times(&part.mixed(solutions));
            let amounts = amounts_of_kernel(&products)?;
            if first {
                let most = LONGEST_IDLE * part.unit * parts.asked(part, right.column(0), b);
                let bounded = norm(&amounts) > most;
                yielding.push(if bounded { Mixture::of(&products)?.yielding(self.held, most) } else { f64::INFINITY });
            }
            let own = match yielding[at] {
                yielding if yielding.is_finite() => Mixture::of(&products)?.shares(self.held, yielding),
                _ => Shares { taken: amounts.clone(), amounts },
            };
            part.add_to(&own.amounts, &mut all.amounts);
            part.add_to(&own.taken, &mut all.taken);
        }
        Ok(all)
    }
}

/// Fields without energy in mixtures that the system has nothing in common for: with `S' = S + c N Nᵀ`, `Nᵀ S'⁻¹ N` is
/// diagonal in them.
struct Mixture {
    /// A mixture in each column.
    vectors: DenseMatrix,
    /// The diagonal.
    diagonal: Vec<f64>,
    /// `Nᵀ S'⁻¹` of what is missing.
    known: Vec<f64>,
}

impl Mixture {
    fn of(products: &DenseMatrix) -> Result<Self, DesignError> {
        let free = products.columns() - 1;
        let mut square = DenseMatrix::zeros(free, free);
        for j in 0..free {
            for i in 0..free {
                square.column_mut(j)[i] = 0.5 * (products.column(1 + j)[1 + i] + products.column(1 + i)[1 + j]);
            }
        }
        let pairs = lowest_symmetric(square, free, &Unwatched).map_err(DesignError::Eigen)?;
        let dot = |column: &[f64]| column.iter().zip(&products.column(0)[1..]).map(|(v, q)| v * q).sum();
        let known = (0..free).map(|k| dot(pairs.vectors.column(k))).collect();
        Ok(Self { vectors: pairs.vectors, diagonal: pairs.values, known })
    }

    /// What each mixture is answered with where fields without energy give way by `w`, `S + w N Nᵀ`: the amount, and
    /// what is taken from `S'⁻¹` of what is missing, which has given way by `c` already.
    fn answer(&self, held: f64, yielding: f64) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.diagonal.iter().zip(&self.known).map(move |(&p, q)| {
            let share = q / ((1.0 - held * p).max(0.0) + yielding * p).max(f64::MIN_POSITIVE);
            [yielding * share, (yielding - held) * share]
        })
    }

    /// By how much they give way where they are as long as they may be.
    fn yielding(&self, held: f64, most: f64) -> f64 {
        let size = |w: f64| self.answer(held, w).map(|[amount, _]| amount * amount).sum::<f64>().sqrt();
        let scale = self.diagonal.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE).recip();
        let (mut low, mut high) = (1e-20 * scale, 1e20 * scale);
        for _ in 0..BISECTIONS {
            let middle = (low * high).sqrt();
            *(if size(middle) <= most { &mut low } else { &mut high }) = middle;
        }
        low
    }

    fn shares(&self, held: f64, yielding: f64) -> Shares {
        let size = self.diagonal.len();
        let (mut amounts, mut taken) = (vec![0.0; size], vec![0.0; size]);
        for (k, [amount, own]) in self.answer(held, yielding).enumerate() {
            let column = self.vectors.column(k);
            amounts.iter_mut().zip(column).for_each(|(a, v)| *a += amount * v);
            taken.iter_mut().zip(column).for_each(|(t, v)| *t += own * v);
        }
        Shares { amounts, taken }
    }
}

/// How much of each field of the kernel there is where that costs nothing.
fn amounts_of_kernel(products: &DenseMatrix) -> Result<Vec<f64>, DesignError> {
    let free = products.columns() - 1;
    let largest = (0..free).map(|j| products.column(1 + j)[1 + j]).fold(0.0, f64::max);
    let mut square = DenseMatrix::zeros(free, free);
    let mut known = DenseMatrix::zeros(free, 1);
    for j in 0..free {
        square.column_mut(j).copy_from_slice(&products.column(1 + j)[1..]);
        square.column_mut(j)[j] += 1e-9 * largest + f64::MIN_POSITIVE;
        known.column_mut(0)[j] = products.column(0)[1 + j];
    }
    solve_definite(square, &mut known).map_err(DesignError::Factor)?;
    Ok(known.column(0).to_vec())
}
