//! The lowest Ritz pairs in a space.

use chladni_base::parallel::*;

use super::super::domain::Domain;
use super::super::hats;
use super::super::restricted::Ritz;
use super::by_rows::Restricted;
use super::space::initial_space;
use super::{ApproximationError, ApproximationParameters};
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::{
    EigenError, EigenPairs, SparseMatrix, SymmetricDefiniteSolver, galerkin, gpu, independent_columns,
};
use chladni_base::Monitor;

/// The largest share of the last value that rounding makes of a zero, where the parts of a mesh have about one size.
const ROUNDING: f64 = 1e-6;

/// The same of the largest eigenvalue of the mesh: of a part that is far smaller than the others, the constant is
/// rounded as its own values are.
const UNIT: f64 = 64.0 * f64::EPSILON;

/// What is more than this share of the last value is no zero.
const MOST: f64 = 1e-3;

/// What rounding makes of a zero: a share of the last value, or, where parts of a mesh differ in size, of the largest
/// eigenvalue of all.
pub(in crate::spectrum) fn rounding(problem: &EigenProblem, last: f64, share: f64) -> f64 {
    by_rounding(largest_row(problem), last, share).min(MOST * last)
}

/// The same, however large, by the largest sum of magnitudes in a row over its mass.
fn by_rounding(largest: f64, last: f64, share: f64) -> f64 {
    (share * last).max(UNIT * largest)
}

/// The largest sum of magnitudes in a row of the stiffness over the mass of the row, which no eigenvalue exceeds.
fn largest_row(problem: &EigenProblem) -> f64 {
    let mass = problem.mass.lumped();
    let own = |row: usize| problem.stiffness.row(row).1.iter().map(|entry| entry.abs()).sum::<f64>() / mass[row];
    (0..mass.len()).map(own).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// A zero that rounding has made something of is less than this share of the first value that is none.
const APART: f64 = 0.5;

impl Ritz {
    /// With the lowest values exactly zero where constants on so many components are in the kernel: the functions of a
    /// space sum to one, and what a dense solver finds instead is rounding, of single precision for a component next to
    /// nothing in size. Values that are small for another reason can be told from them then.
    pub(super) fn with_zeros(self, problem: &EigenProblem, kernel: usize) -> Self {
        self.with_zeros_by(largest_row(problem), kernel)
    }

    /// The same, by the largest sum of magnitudes in a row of the stiffness over the mass of the row.
    pub(super) fn with_zeros_by(mut self, largest: f64, kernel: usize) -> Self {
        let values = &mut self.pairs.values;
        let last = values.last().copied().unwrap_or(0.0);
        let most = (MOST * last).max(values.get(kernel).map_or(0.0, |next| APART * next));
        let rounding = by_rounding(largest, last, ROUNDING).min(most);
        if let Some(lowest) = values.get_mut(..kernel)
            && lowest.iter().all(|value| value.abs() <= rounding)
        {
            lowest.fill(0.0);
        }
        self
    }
}

/// Builds the space and computes the lowest `count` Ritz pairs in it. `parameters` tell afterwards how its functions
/// were made.
pub(in crate::spectrum) fn ritz(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &mut ApproximationParameters,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    let problem = &operator.problem;
    if count > problem.size() {
        return Err(ApproximationError::Count { count, unknowns: problem.size() });
    }
    let space = initial_space(domain, operator, parameters, monitor)?;
    // Guards may be more than the space has.
    let count = count.min(space.columns().max(parameters.count));
    reduce(problem, space, count, monitor)
}

/// Where the mass of a space is not definite in double precision, columns this close to a combination of others are
/// dropped, one bound after the other.
const DEPENDENT: [f64; 3] = [1e-5, 1e-4, 1e-3];

/// Rounding may change no Ritz value by more than this share of the largest.
pub(super) const MOST_ROUNDING: f64 = 1e-6;

/// Whether some Ritz value is nothing but what rounding leaves of a sum of large terms: a combination of columns that
/// all but cancel has next to no mass and next to no energy, and any quotient of the two.
fn lost_to_rounding(stiffness: &SparseMatrix, pairs: &EigenPairs) -> bool {
    let largest = pairs.values.last().map_or(0.0, |value| value.abs());
    (0..pairs.values.len()).into_par_iter().any(|k| {
        let x = pairs.vectors.column(k);
        let terms: f64 = (0..stiffness.rows())
            .map(|row| {
                let (columns, values) = stiffness.row(row);
                let sum: f64 = columns.iter().zip(values).map(|(&column, s)| (s * x[column as usize]).abs()).sum();
                x[row].abs() * sum
            })
            .sum();
        4.0 * f64::EPSILON * terms > MOST_ROUNDING * largest
    })
}

/// A dense problem is solved with errors of this share of its largest value; so much of the largest wanted one is
/// nothing.
const PRECISION: f64 = 16.0 * f64::EPSILON;
const NOTHING: f64 = 1e-9;

/// Whether the wanted values may drown in the rounding errors of the largest ones: a column of a few vertices among
/// needles has a quotient of energy and mass of 10^15, where its neighbours have one of 10.
fn drowned(stiffness: &SparseMatrix, mass: &SparseMatrix, pairs: &EigenPairs) -> bool {
    let wanted = size_of(pairs);
    let diagonal = |matrix: &SparseMatrix, row: usize| {
        let (columns, values) = matrix.row(row);
        columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
    };
    let quotient = |row| diagonal(stiffness, row) / diagonal(mass, row);
    let largest = (0..stiffness.rows()).map(quotient).filter(|quotient| quotient.is_finite()).fold(0.0, f64::max);
    PRECISION * largest > NOTHING * wanted
}

/// The size of wanted values: on unit area no less than 1, since all of them may be zero.
fn size_of(pairs: &EigenPairs) -> f64 {
    pairs.values.last().map_or(1.0, |value| value.abs().max(1.0))
}

/// The same pairs from `M̄ x = μ (S̄ + σM̄) x`, whose largest values are the wanted ones, so that none drowns:
/// `θ = 1/μ − σ`.
///
/// # Errors
/// [`EigenError`]: a shifted matrix or a mass that is not definite, or cancellation. What has drowned is no result.
fn reversed(
    solver: &dyn SymmetricDefiniteSolver,
    stiffness: &SparseMatrix,
    mass: &SparseMatrix,
    found: &EigenPairs,
    monitor: &dyn Monitor,
) -> Result<EigenPairs, EigenError> {
    // Beside a potential that is negative somewhere the lowest values may be, and farther from zero than the last.
    let sigma = size_of(found) - 2.0 * found.values.first().map_or(0.0, |value| value.min(0.0));
    let (mut shifted, mut negative) = (stiffness.to_dense(), mass.to_dense());
    shifted.values_mut().iter_mut().zip(negative.values()).for_each(|(s, m)| *s += sigma * m);
    negative.values_mut().iter_mut().for_each(|m| *m = -*m);
    let mut pairs = solver.lowest(negative, shifted, found.values.len(), monitor)?;
    if let Some(pivot) = pairs.values.iter().position(|&value| !(value < 0.0)) {
        return Err(EigenError::NotPositiveDefinite { pivot });
    }
    for (k, value) in pairs.values.iter_mut().enumerate() {
        // Vectors are of unit length in the shifted matrix, and are to be so in the mass.
        let scale = (-*value).sqrt().recip();
        pairs.vectors.column_mut(k).iter_mut().for_each(|x| *x *= scale);
        *value = -1.0 / *value - sigma;
    }
    Ok(pairs)
}

/// The lowest `count` Ritz pairs in a space. Columns that depend on others are dropped.
pub(super) fn reduce(
    problem: &EigenProblem,
    space: SparseMatrix<f32>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    reduce_by(&*gpu::accelerator(), problem, space, count, monitor)
}

/// [`reduce`], with the dense problem solved by one.
pub(super) fn reduce_by(
    solver: &dyn SymmetricDefiniteSolver,
    problem: &EigenProblem,
    space: SparseMatrix<f32>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    monitor.stage("reduce");
    let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, monitor)?;
    solve_restricted(solver, Restricted { space, stiffness, mass }, count, monitor)
}

/// [`reduce_by`] of matrices that are restricted already; `space` may have some of its rows alone.
pub(super) fn solve_restricted(
    solver: &dyn SymmetricDefiniteSolver,
    Restricted { mut space, mut stiffness, mut mass }: Restricted,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    monitor.stage("eigen");
    let mut tries = DEPENDENT.iter();
    loop {
        let solved = match solver.lowest(stiffness.to_dense(), mass.to_dense(), count, monitor) {
            Ok(pairs) if drowned(&stiffness, &mass, &pairs) => reversed(solver, &stiffness, &mass, &pairs, monitor),
            other => other,
        };
        let dependent = match &solved {
            Ok(pairs) => lost_to_rounding(&stiffness, pairs),
            Err(error) => matches!(error, EigenError::NotPositiveDefinite { .. }),
        };
        if dependent {
            let fewer = tries.find_map(|&least| {
                let kept = independent_columns(&mass.to_dense(), least);
                (kept.len() < space.columns()).then_some(kept)
            });
            if let Some(kept) = fewer.filter(|kept| kept.len() >= count) {
                space = hats::of_columns(&space, &kept);
                let kept: Vec<u32> = kept.into_iter().map(|column| column as u32).collect();
                (stiffness, mass) = (stiffness.principal(&kept), mass.principal(&kept));
                continue;
            }
        }
        return Ok(Ritz { space, mass, stiffness, pairs: solved? });
    }
}

#[cfg(test)]
#[path = "reduce_tests.rs"]
mod tests;
