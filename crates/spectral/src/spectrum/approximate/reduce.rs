//! The lowest Ritz pairs in a space.

use rayon::prelude::*;

use super::super::domain::Domain;
use super::super::hats;
use super::by_rows::Restricted;
use super::space::initial_space;
use super::{ApproximationError, ApproximationParameters};
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::{
    EigenError, EigenPairs, SparseMatrix, SymmetricDefiniteSolver, galerkin, gpu, independent_columns,
};
use chladni_base::Monitor;

/// Ritz pairs in the space, on unit area.
pub(in crate::spectrum) struct Ritz {
    /// `U` on the unknowns.
    pub space: SparseMatrix<f32>,
    /// `UᵀMU`.
    pub mass: SparseMatrix,
    /// `UᵀSU`.
    pub stiffness: SparseMatrix,
    /// Values and coefficients.
    pub pairs: EigenPairs,
}

/// The largest share of the last value that rounding makes of a zero, where the parts of a mesh have about one size.
const ROUNDING: f64 = 1e-6;

/// The same of the largest eigenvalue of the mesh: of a part that is far smaller than the others, the constant is rounded as its own values are.
const UNIT: f64 = 64.0 * f64::EPSILON;

/// What is more than this share of the last value is no zero.
const MOST: f64 = 1e-3;

/// What rounding makes of a zero: a share of the last value, or, where parts of a mesh differ in size, of the largest eigenvalue of all.
pub(in crate::spectrum) fn rounding(problem: &EigenProblem, last: f64, share: f64) -> f64 {
    let mass = problem.mass.lumped();
    let own = |row: usize| problem.stiffness.row(row).1.iter().map(|entry| entry.abs()).sum::<f64>() / mass[row];
    let largest = (0..mass.len()).map(own).filter(|value| value.is_finite()).fold(0.0, f64::max);
    rounding_of(largest, last, share)
}

/// [`rounding`], by the largest sum of magnitudes in a row over its mass.
fn rounding_of(largest: f64, last: f64, share: f64) -> f64 {
    (share * last).max(UNIT * largest).min(MOST * last)
}

impl Ritz {
    /// With the lowest values exactly zero where constants on so many components are in the kernel: the functions of a space sum to one, and what a
    /// dense solver finds instead is rounding. Values that are small for another reason can be told from them then.
    pub(super) fn with_zeros(mut self, problem: &EigenProblem, kernel: usize) -> Self {
        let rounding = rounding(problem, self.pairs.values.last().copied().unwrap_or(0.0), ROUNDING);
        self.zeros(rounding, kernel);
        self
    }

    /// The same, by the largest sum of magnitudes in a row of the stiffness over its mass.
    pub(super) fn with_zeros_by(mut self, largest: f64, kernel: usize) -> Self {
        let rounding = rounding_of(largest, self.pairs.values.last().copied().unwrap_or(0.0), ROUNDING);
        self.zeros(rounding, kernel);
        self
    }

    fn zeros(&mut self, rounding: f64, kernel: usize) {
        let values = &mut self.pairs.values;
        if let Some(lowest) = values.get_mut(..kernel)
            && lowest.iter().all(|value| value.abs() <= rounding)
        {
            lowest.fill(0.0);
        }
    }
}

/// Builds the space and computes the lowest `count` Ritz pairs in it. `parameters` tell afterwards how its functions were made.
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

/// Where the mass of a space is not definite in double precision, columns this close to a combination of others are dropped, one bound after the
/// other.
const DEPENDENT: [f64; 3] = [1e-5, 1e-4, 1e-3];

/// Rounding may change no Ritz value by more than this share of the largest.
const MOST_ROUNDING: f64 = 1e-6;

/// Whether some Ritz value is nothing but what rounding leaves of a sum of large terms: a combination of columns that all but cancel has next to no
/// mass and next to no energy, and any quotient of the two.
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
    mut space: SparseMatrix<f32>,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    let mut tries = DEPENDENT.iter();
    loop {
        monitor.stage("reduce");
        let (stiffness, mass) = galerkin(&space, &problem.stiffness, &problem.mass, monitor)?;
        monitor.stage("eigen");
        let solved = solver.lowest(stiffness.to_dense(), mass.to_dense(), count, monitor);
        match &solved {
            Ok(pairs) if !lost_to_rounding(&stiffness, pairs) => {}
            Ok(_) | Err(EigenError::NotPositiveDefinite { .. }) => {
                let smaller = tries.find_map(|&least| {
                    let kept = hats::independent(&space, &mass, least);
                    (kept.columns() < space.columns()).then_some(kept)
                });
                if let Some(smaller) = smaller.filter(|smaller| smaller.columns() >= count) {
                    space = smaller;
                    continue;
                }
            }
            Err(_) => {}
        }
        return Ok(Ritz { space, mass, stiffness, pairs: solved? });
    }
}

/// [`reduce_by`] of matrices that are restricted already; `space` may have some of its rows alone.
pub(super) fn solve_restricted(
    solver: &dyn SymmetricDefiniteSolver,
    Restricted { mut space, mut stiffness, mut mass }: Restricted,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, ApproximationError> {
    let mut tries = DEPENDENT.iter();
    loop {
        monitor.stage("eigen");
        let solved = solver.lowest(stiffness.to_dense(), mass.to_dense(), count, monitor);
        let dependent = match &solved {
            Ok(pairs) => lost_to_rounding(&stiffness, pairs),
            Err(error) => matches!(error, EigenError::NotPositiveDefinite { .. }),
        };
        if dependent {
            let kept = tries.find_map(|&least| {
                let kept = independent_columns(&mass.to_dense(), least);
                (kept.len() < space.columns()).then_some(kept)
            });
            if let Some(kept) = kept.filter(|kept| kept.len() >= count) {
                space = hats::of_columns(&space, &kept);
                let kept: Vec<u32> = kept.into_iter().map(|column| column as u32).collect();
                (stiffness, mass) = (stiffness.principal(&kept), mass.principal(&kept));
                continue;
            }
        }
        return Ok(Ritz { space, mass, stiffness, pairs: solved? });
    }
}
