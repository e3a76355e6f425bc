//! Heat steps in solids.
//!
//! Two things differ from surfaces. A cell of `d` in the unit volume is `d^(-⅓)` wide, and more columns reach over it.
//! And tetrahedra of next to no height, which most files have, tie the values at their corners together by a linear
//! relation that is no mean: columns that follow it have negative entries, and what is cut off near them must be
//! smaller than elsewhere. Without negative entries, eigenvalues of bunny-tet.mesh are 20 % too high; with them .1 %.

use chladni_base::parallel::*;

use super::assemble::DroppingRule;
use super::level::HeatLevel;
use super::{HeatError, HeatParameters, panel, peaks, shrink};
use crate::operator::EigenProblem;
use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::connectivity::Connectivity;

/// Entries a row on average, beyond which columns reach everywhere, and how many each row keeps then. Cubes have 110 at
/// most.
const MOST: (usize, usize) = (400, 150);

/// A vertex is stiff where its entry on the diagonal, over the width of its own share of the volume, exceeds that of
/// the median vertex by this factor.
const STIFF: f32 = 3.0;

/// The mass of a vertex is at least this share of its stiffness over a heat step: less is lost in single precision
/// beside it.
const LEAST_MASS: f32 = 1e-6;

/// A row whose entries cancel to less than this share of their size is no mean of anything.
const CANCELLED: f32 = 0.1;

impl HeatParameters {
    /// The usual parameters of surfaces as solids need them: more steps, since eigenfunctions of the same number bend
    /// more, and entries cut off where they are smaller. Parameters that somebody chose are left alone.
    pub fn in_solid(self) -> Self {
        let (usual, accurate) = (Self::default(), Self::accurate());
        let few = |parameters: Self| parameters.for_few_vertices() == Some(self);
        match self {
            _ if self == usual => Self { steps: 6, margin: 4.0, threshold: 5e-4, tolerance: 1e-3, ..self },
            _ if self == accurate => Self { steps: 6, margin: 4.0, threshold: 2e-4, tolerance: 5e-4, ..self },
            _ if few(usual) || few(accurate) => {
                Self { steps: 6, margin: 4.0, threshold: 2e-4, tolerance: 5e-4, ..self }
            }
            _ => self,
        }
    }
}

/// Smooths `columns` (`n × d`, rows sum to 1) by heat steps of the Laplacian of a solid and returns the final `n × d`
/// matrix: rows sum to 1, and may have negative entries. `problem` is on unit volume, its `area` the square of the
/// length that this makes 1; `connectivity` holds the edges.
///
/// `parameters` are taken as they are; `drop` and `threshold` together are the size of an entry that stays. The result
/// does not depend on the number of threads.
///
/// # Errors
/// [`HeatError`] names what is wrong with the parameters or the inputs, or says that the monitor cancelled.
pub fn smooth_in_solid(
    problem: &EigenProblem,
    connectivity: &Connectivity,
    columns: &SparseMatrix<f32>,
    parameters: &HeatParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, HeatError> {
    parameters.check()?;
    let (n, d) = (columns.rows(), columns.columns());
    if problem.stiffness.rows() != n || connectivity.vertices() != n {
        return Err(HeatError::Shape { problem: problem.stiffness.rows(), mesh: connectivity.vertices(), columns: n });
    }
    let tops = peaks(columns)?;
    monitor.checkpoint()?;
    let width = (d.max(1) as f64).cbrt().recip();
    let least = parameters.threshold.max(parameters.drop) as f32;
    let mut level = HeatLevel::finest(problem, connectivity)?;
    let shares = shares(&level);
    // What no row keeps in the end need not be carried.
    let smallest = least * shares.par_iter().copied().reduce(|| 1.0, f32::min);
    let heat = panel::Heat {
        steps: parameters.steps,
        time: (parameters.time * width * width) as f32,
        margin: (parameters.margin * (parameters.steps as f64 * parameters.time).sqrt() * width) as f32,
        dropping: DroppingRule { least: smallest.max(0.01 * least), signed: true, most: MOST },
        tolerance: parameters.tolerance as f32,
    };
    level.mass.iter_mut().zip(&level.diagonal).for_each(|(mass, s)| *mass = mass.max(LEAST_MASS * heat.time * s));
    let spread = panel::diffuse(&level, columns, &tops.rows, &heat, monitor)?;
    let mut result = cut(&spread, least, &shares);
    shrink::refill_columns(&mut result, &spread, d);
    Ok(result)
}

/// The share of the threshold that holds at each vertex: 1, and less where it is stiff.
fn shares(level: &HeatLevel) -> Vec<f32> {
    let stiffness: Vec<f32> = level
        .diagonal
        .par_iter()
        .zip(&level.mass)
        .map(|(s, m)| if *s > 0.0 && *m > 0.0 { s / m.cbrt() } else { 0.0 })
        .collect();
    let mut sorted = stiffness.clone();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return Vec::new();
    }
    let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    stiffness.into_par_iter().map(|s| if s > STIFF * median { STIFF * median / s } else { 1.0 }).collect()
}

/// Drops entries smaller than `least` times the share of their row, and normalises rows. What an entry of less loses by
/// shrinking smoothly is more than what it loses by being cut off: beside flat tetrahedra a relation between values
/// holds for sums, and for no other function of them.
fn cut(spread: &SparseMatrix<f32>, least: f32, shares: &[f32]) -> SparseMatrix<f32> {
    SparseMatrix::from_rows(spread.rows(), spread.columns(), Default::default, |(indices, values), row, entries| {
        let (indices, values): (&mut Vec<u32>, &mut Vec<f32>) = (indices, values);
        indices.clear();
        values.clear();
        push_row(spread.row(row), least * shares[row], indices, values);
        entries.extend(indices.iter().copied().zip(values.iter().copied()));
    })
}

/// Appends one row.
fn push_row((columns, row): (&[u32], &[f32]), least: f32, indices: &mut Vec<u32>, values: &mut Vec<f32>) {
    let begin = indices.len();
    let whole: f32 = row.iter().sum();
    let (mut sum, mut size) = (0.0, 0.0);
    for (&column, &x) in columns.iter().zip(row).filter(|(_, x)| x.abs() >= least * whole.abs()) {
        indices.push(column);
        values.push(x);
        sum += x;
        size += x.abs();
    }
    if sum > CANCELLED * size {
        values[begin..].iter_mut().for_each(|value| *value /= sum);
        return;
    }
    indices.truncate(begin);
    values.truncate(begin);
    if let Some((&column, _)) = columns.iter().zip(row).reduce(|a, b| if b.1 > a.1 { b } else { a }) {
        indices.push(column);
        values.push(1.0);
    }
}
