//! A space of functions that vanish on the boundary, made of one whose functions do not.
//!
//! To cut the boundary's rows off would leave functions that drop to zero within one edge, and Ritz values far too high. So every
//! function is multiplied by one smooth factor `w` that is zero on the boundary and grows like the distance from it: `w` is what is left
//! of the constant 1 after one implicit heat step, `(M + τS) w = M 1`, with the boundary held at zero. An eigenfunction that vanishes
//! on the boundary is `w` times a function as smooth as itself.

use rayon::prelude::*;

use crate::algebra::SparseMatrix;
use crate::monitor::{Cancelled, Monitor};
use crate::operator::EigenProblem;

/// The time of the heat step is this over the number of columns, on unit area: the factor grows over about one column's width.
const TIME: f64 = 0.5;

/// Relative residual at which the heat step is solved well enough.
const TOLERANCE: f64 = 1e-4;

/// Steps of the solver, at most.
const MOST_STEPS: usize = 2000;

/// The least factor: rounding and negative cotangents must not make it zero or less away from the boundary.
const LEAST: f64 = 1e-4;

/// The rows of `space`, `n × d`, that belong to the unknowns of a Dirichlet problem, each times the factor, without the columns that
/// this leaves empty. `laplacian` is the problem on all `n` vertices.
///
/// # Errors
/// [`Cancelled`], when asked to stop.
pub fn clamp(
    space: &SparseMatrix<f32>,
    laplacian: &EigenProblem,
    unknowns: &[u32],
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let factor = factor(laplacian, unknowns, TIME / space.columns().max(1) as f64, monitor)?;
    let mut offsets = Vec::with_capacity(unknowns.len() + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    let mut used = vec![false; space.columns()];
    offsets.push(0);
    for &v in unknowns {
        let (columns, entries) = space.row(v as usize);
        let w = factor[v as usize].clamp(LEAST, 1.0) as f32;
        indices.extend_from_slice(columns);
        values.extend(entries.iter().map(|x| w * x));
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
    Ok(SparseMatrix::from_sorted_parts(unknowns.len(), kept as usize, offsets, indices, values))
}

/// The rows of a space on the unknowns alone, back on all `n` vertices: those of the others are empty.
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

/// The factor on all vertices, zero where it is fixed; conjugate gradients with the diagonal as preconditioner.
fn factor(laplacian: &EigenProblem, unknowns: &[u32], time: f64, monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
    let n = laplacian.size();
    let stiffness = &laplacian.stiffness;
    let mass = laplacian.mass.lumped();
    let mut free = vec![false; n];
    unknowns.iter().for_each(|&v| free[v as usize] = true);
    let diagonal: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|row| {
            let (columns, values) = stiffness.row(row);
            mass[row] + time * columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at].max(0.0))
        })
        .collect();
    let apply = |x: &[f64]| -> Vec<f64> {
        let product = |row: usize| {
            let (columns, values) = stiffness.row(row);
            let sum: f64 = columns.iter().zip(values).map(|(&column, value)| value * x[column as usize]).sum();
            mass[row] * x[row] + time * sum
        };
        (0..n).into_par_iter().with_min_len(4096).map(|row| if free[row] { product(row) } else { 0.0 }).collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x: Vec<f64> = free.iter().map(|&free| f64::from(u8::from(free))).collect();
    let mut residual: Vec<f64> =
        apply(&x).iter().zip(&mass).zip(&free).map(|((ax, m), &free)| if free { m - ax } else { 0.0 }).collect();
    let target = TOLERANCE * TOLERANCE * mass.iter().zip(&diagonal).map(|(m, d)| m * m / d).sum::<f64>();
    let mut direction: Vec<f64> = residual.iter().zip(&diagonal).map(|(r, d)| r / d).collect();
    let mut energy = dot(&residual, &direction);
    for _ in 0..MOST_STEPS {
        monitor.checkpoint()?;
        if !(energy > target) {
            break;
        }
        let image = apply(&direction);
        let step = energy / dot(&direction, &image);
        if !step.is_finite() {
            break;
        }
        x.par_iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
        residual.par_iter_mut().zip(&image).for_each(|(r, a)| *r -= step * a);
        let smoothed: Vec<f64> = residual.par_iter().zip(&diagonal).map(|(r, d)| r / d).collect();
        let next = dot(&residual, &smoothed);
        let turn = next / energy;
        direction.par_iter_mut().zip(&smoothed).for_each(|(d, z)| *d = z + turn * *d);
        energy = next;
    }
    Ok(x)
}
