//! Local functions for operators beside the Laplacian: all take one common factor, the envelope.
//!
//! A space of smooth functions serves the Laplacian well. Functions that must vanish on the boundary, or that a
//! potential pushes away, it serves badly: cutting rows off at the boundary would let functions drop to zero within one
//! edge, and where a potential is steep eigenfunctions bend faster than a column is wide. So every function is
//! multiplied by one factor `w`, what is left of the constant 1 after an implicit heat step of the operator itself:
//! `(M + τK) w = M 1`, with zero on a clamped boundary. It vanishes on the boundary like the distance from it, and
//! bends where the potential bends the eigenfunctions: each of those is `w` times a smoother function (at a crease,
//! where `K` has a delta potential `c`, both slopes jump by `c` times the value, so the quotient has no kink).

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};

use super::domain::Domain;
use crate::operator::{EigenProblem, MeshOperator};

/// The time of the heat step is this times the square of a column's width, on unit size: the envelope changes over
/// about one column's width. Twice or half of it costs the Dirichlet spectra of real meshes up to a fifth in accuracy.
const TIME: f64 = 1.0;

/// Relative residual at which the heat step is solved well enough.
const TOLERANCE: f64 = 1e-4;

/// Steps of the solver, at most.
const MOST_STEPS: usize = 2000;

/// The least and the largest factor: neither rounding nor negative weights may make it zero or less, nor a deep well
/// make it huge.
const RANGE: (f64, f64) = (1e-6, 1e3);

/// Makes `space`, `n × d` on all vertices, one for the operator: its rows are the unknowns, each times the envelope,
/// its columns those that this does not leave empty. For the Laplacian itself nothing is done.
///
/// # Errors
/// [`Cancelled`], when asked to stop.
pub fn envelop(
    domain: Domain<'_>,
    space: SparseMatrix<f32>,
    operator: &MeshOperator,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let problem = &operator.problem;
    if operator.is_laplacian() {
        return Ok(space);
    }
    let envelope = envelope(problem, TIME * domain.cell(space.columns()), monitor)?;
    let mut offsets = Vec::with_capacity(envelope.len() + 1);
    let (mut indices, mut values) = (Vec::with_capacity(space.entries()), Vec::with_capacity(space.entries()));
    let mut used = vec![false; space.columns()];
    offsets.push(0);
    for (row, &w) in envelope.iter().enumerate() {
        let vertex = problem.unknowns.as_ref().map_or(row, |unknowns| unknowns[row] as usize);
        let (columns, entries) = space.row(vertex);
        indices.extend_from_slice(columns);
        values.extend(entries.iter().map(|x| w as f32 * x));
        columns.iter().for_each(|&column| used[column as usize] = true);
        offsets.push(indices.len());
    }
    let mut kept = 0;
    let numbers: Vec<u32> = used
        .iter()
        .map(|&used| {
            kept += u32::from(used);
            kept.wrapping_sub(1)
        })
        .collect();
    indices.iter_mut().for_each(|column| *column = numbers[*column as usize]);
    Ok(SparseMatrix::from_sorted_parts(envelope.len(), kept as usize, offsets, indices, values))
}

/// A space on the unknowns alone, back on all `n` vertices: the rows of the others are empty.
pub fn on_all_vertices(space: SparseMatrix<f32>, unknowns: &[u32], n: usize) -> SparseMatrix<f32> {
    let mut offsets = vec![0; n + 1];
    for (row, &v) in unknowns.iter().enumerate() {
        offsets[v as usize + 1] = space.row(row).0.len();
    }
    for v in 0..n {
        offsets[v + 1] += offsets[v];
    }
    SparseMatrix::from_sorted_parts(n, space.columns(), offsets, space.indices().to_vec(), space.values().to_vec())
}

/// The factor on every unknown. Where a negative potential makes `M + τK` indefinite, `M` is given more and more
/// weight.
fn envelope(problem: &EigenProblem, time: f64, monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
    let mut time = time;
    loop {
        if let Some(envelope) = heat_step(problem, time, monitor)? {
            return Ok(envelope.into_iter().map(|w| w.clamp(RANGE.0, RANGE.1)).collect());
        }
        time *= 0.25;
    }
}

/// Solves `(M + τK) w = M 1`, `M` lumped, by conjugate gradients with the diagonal as preconditioner. `None` where that
/// is seen not to be positive definite.
fn heat_step(problem: &EigenProblem, time: f64, monitor: &dyn Monitor) -> Result<Option<Vec<f64>>, Cancelled> {
    let n = problem.size();
    let stiffness = &problem.stiffness;
    // The mass of the whole surface acts on a constant, also that of clamped neighbours that a consistent mass would
    // leave out.
    let mass = problem.mass.lumped();
    let diagonal: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|row| {
            let (columns, values) = stiffness.row(row);
            mass[row] + time * columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
        })
        .collect();
    if !diagonal.iter().all(|&d| d > 0.0) {
        return Ok(None);
    }
    let apply = |x: &[f64]| -> Vec<f64> {
        let product = |row: usize| {
            let (columns, values) = stiffness.row(row);
            let sum: f64 = columns.iter().zip(values).map(|(&column, value)| value * x[column as usize]).sum();
            mass[row] * x[row] + time * sum
        };
        (0..n).into_par_iter().with_min_len(4096).map(product).collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![1.0; n];
    let mut residual: Vec<f64> = apply(&x).iter().zip(&mass).map(|(ax, m)| m - ax).collect();
    let target = TOLERANCE * TOLERANCE * mass.iter().zip(&diagonal).map(|(m, d)| m * m / d).sum::<f64>();
    let mut direction: Vec<f64> = residual.iter().zip(&diagonal).map(|(r, d)| r / d).collect();
    let mut energy = dot(&residual, &direction);
    for _ in 0..MOST_STEPS {
        monitor.checkpoint()?;
        if !(energy > target) {
            break;
        }
        let image = apply(&direction);
        let curvature = dot(&direction, &image);
        if !(curvature > 0.0) {
            return Ok(None);
        }
        let step = energy / curvature;
        x.par_iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
        residual.par_iter_mut().zip(&image).for_each(|(r, a)| *r -= step * a);
        let smoothed: Vec<f64> = residual.par_iter().zip(&diagonal).map(|(r, d)| r / d).collect();
        let next = dot(&residual, &smoothed);
        let turn = next / energy;
        direction.par_iter_mut().zip(&smoothed).for_each(|(d, z)| *d = z + turn * *d);
        energy = next;
    }
    Ok(Some(x))
}
