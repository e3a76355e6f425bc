//! What is proven about Ritz pairs: residuals, a-posteriori bounds, orthonormality on the fine mesh; and what is
//! estimated.
//!
//! Bounds need no assumption: neither that θ is close to anything, nor that no eigenvalue was missed. They and the
//! estimates measure residuals in the norm that belongs to them ([`energy`](super::energy)), rounding enclosed. Ritz
//! values are besides upper bounds: the k-th exact eigenvalue is at most the k-th Ritz value.

use chladni_base::parallel::*;

use super::energy::{Density, Energy, Measure};
pub use super::error::CertificateError;
use crate::basis::Certificate;
use crate::operator::EigenProblem;
use chladni_algebra::{DenseMatrix, SparseMatrix};
use chladni_base::Monitor;

/// Up to this Ritz value (unit area) a pair counts as one of the kernel, whose relative residual (4.6) would compare
/// rounding errors.
pub const KERNEL: f64 = 1e-6;

/// Certifies `m` Ritz pairs and turns each so that its lifted vector's entry of largest magnitude is positive.
///
/// `energy` is `problem`, prepared; `space` is `U`, `n × d`; `reduced_mass` is `UᵀMU`, `d × d`; `coefficients` are
/// `φ̄`, `d × m`, orthonormal for it; `ritz` are the values on unit area, ascending. Everything is computed on the fine
/// mesh, panel by panel, without ever lifting more than 32 columns a thread. The orthonormality defect is the largest
/// entry of `|φ̄ᵀ(UᵀMU)φ̄ − I|`, which is the fine mesh's inner product, and of `|xᵀMx − 1|` over the lifted vectors.
/// Bounds and estimates are in the units of the input.
///
/// With a `goal`, what pairs miss whose estimated relative error exceeds it comes back as a density over the rows.
///
/// # Errors
/// [`CertificateError`]: sizes that do not fit, or the work was cancelled.
#[expect(clippy::too_many_arguments, reason = "a pencil, pairs in three parts, and what to do with them")]
pub fn certify(
    energy: &Energy<'_>,
    problem: &EigenProblem,
    space: &mut SparseMatrix<f32>,
    reduced_mass: &SparseMatrix,
    coefficients: &mut DenseMatrix,
    ritz: &[f64],
    goal: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<(Certificate, Density), CertificateError> {
    let (n, d, m) = (space.rows(), space.columns(), coefficients.columns());
    let fits = problem.stiffness.rows() == n
        && problem.stiffness.columns() == n
        && problem.mass.size() == n
        && energy.size() == n
        && coefficients.rows() == d
        && ritz.len() == m
        && (reduced_mass.rows(), reduced_mass.columns()) == (d, d);
    if !fits {
        return Err(CertificateError::Shape {
            values: ritz.len(),
            rows: coefficients.rows(),
            columns: m,
            vertices: n,
            dimension: d,
            size: problem.stiffness.rows(),
        });
    }
    let (measures, density) = energy.measure(space, coefficients, ritz, KERNEL, goal, monitor)?;
    monitor.checkpoint()?;
    let defect = gram_defect(reduced_mass, coefficients);
    let certificate =
        certificate_of(&measures, (infinity_norm(&problem.stiffness), defect, problem.area), coefficients, ritz);
    Ok((certificate, density))
}

/// The certificate of pairs that are measured; each is turned as [`certify`] says. `stiffness_norm` is the largest sum
/// of magnitudes in a row of the stiffness, `defect` how far coefficients are from orthonormal.
pub(super) fn certificate_of(
    measures: &[Measure],
    (stiffness_norm, defect, area): (f64, f64, f64),
    coefficients: &mut DenseMatrix,
    ritz: &[f64],
) -> Certificate {
    let mut certificate = Certificate::default();
    for (k, (measure, &theta)) in measures.iter().zip(ritz).enumerate() {
        certificate.residuals.push(if theta.abs() <= KERNEL {
            ratio(measure.sums.stiffness.sqrt(), stiffness_norm * measure.sums.square.sqrt())
        } else {
            ratio(measure.sums.residual.sqrt(), measure.sums.stiffness.sqrt())
        });
        certificate.bounds.push(measure.bound / area);
        certificate.estimates.push(measure.estimate / area);
        if measure.sums.lowest < -measure.sums.highest {
            coefficients.column_mut(k).iter_mut().for_each(|x| *x = -*x);
        }
    }
    let lifted = measures.iter().map(|measure| (measure.sums.mass - 1.0).abs()).fold(0.0, f64::max);
    certificate.orthonormality_defect = defect.max(lifted);
    certificate
}

/// A quotient of non-negative numbers; nothing over nothing is nothing.
fn ratio(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

/// The largest sum of magnitudes in a row.
pub(super) fn infinity_norm(matrix: &SparseMatrix) -> f64 {
    infinity_norm_of(matrix, (0..matrix.rows() as u32).into_par_iter())
}

/// The same of some rows.
pub(super) fn infinity_norm_of(matrix: &SparseMatrix, rows: impl ParallelIterator<Item = u32>) -> f64 {
    rows.map(|row| matrix.row(row as usize).1.iter().map(|v| v.abs()).sum::<f64>()).reduce(|| 0.0, f64::max)
}

/// The largest entry of `|φ̄ᵀ M̄ φ̄ − I|`; `mass` is `d × d` and `coefficients` `d × m`, or the products panic.
pub(super) fn gram_defect(mass: &SparseMatrix, coefficients: &DenseMatrix) -> f64 {
    let gram = coefficients.transposed_times(&mass.multiply_dense(coefficients));
    let mut worst = 0.0f64;
    for j in 0..gram.columns() {
        for (i, value) in gram.column(j).iter().enumerate() {
            worst = worst.max((value - if i == j { 1.0 } else { 0.0 }).abs());
        }
    }
    worst
}

#[cfg(test)]
#[path = "certificate_tests.rs"]
mod tests;
