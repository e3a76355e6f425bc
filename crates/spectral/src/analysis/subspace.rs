//! Two bases of one surface, compared: how much of the functions of one lies in the other, and by which angles their
//! eigenspaces are turned against each other (thesis, figures 2.7, 2.8 and 2.B).
//!
//! Single eigenfunctions of a multiple or nearly multiple eigenvalue mean nothing: any rotation of them is as good. So
//! eigenvalues that lie close together are taken as one cluster, and its spaces are compared by their principal angles
//! (Björck and Golub 1973).

use std::ops::Range;

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver};
use chladni_base::{Monitor, Unwatched};

use super::error::{self, AnalysisError};
use crate::basis::{Basis, BasisError};

/// The most pairs of a comparison.
pub const MOST_PAIRS: usize = 1000;

/// Functions that are lifted at once.
const AT_ONCE: usize = 32;

/// Numbers of functions that are lifted at once where all are multiplied with all.
const GRAM_NUMBERS: usize = 1 << 24;

/// Eigenvalues that lie close together, and the spaces of their functions.
#[derive(Debug, Clone, PartialEq)]
pub struct Eigenspace {
    /// Its modes.
    pub modes: Range<usize>,
    /// The principal angles between its spaces in the two bases, in radians, ascending.
    pub angles: Vec<f64>,
}

/// Two bases, compared.
#[derive(Debug, Clone, PartialEq)]
pub struct SubspaceComparison {
    /// `ΦᵀMΨ`, `pairs × pairs`: column `j` has the Fourier coefficients of function `j` of the other basis in the
    /// reference.
    pub coefficients: DenseMatrix,
    /// `ΨᵀMΨ`, `pairs × pairs`: the inner products of the functions of the other basis in the mass of the reference;
    /// the identity where both have one mass.
    pub gram: DenseMatrix,
    /// Per function of the other basis, which share of it, in the norm of the mass, lies outside of all the functions
    /// of the reference.
    pub projection_errors: Vec<f64>,
    /// Per pair `(θ − λ) / λ`, `λ` of the reference; 0 where both are zero.
    pub eigenvalue_errors: Vec<f64>,
    /// The principal angles between the spans of all the functions, in radians, ascending.
    pub angles: Vec<f64>,
    /// The eigenspaces, by ascending eigenvalues of the reference.
    pub eigenspaces: Vec<Eigenspace>,
}

/// Compares the first `pairs` functions of two bases; the mass is that of the reference. Eigenvalues of the reference
/// that follow on each other with a relative gap of at most `gap` are one cluster.
///
/// # Errors
/// [`AnalysisError`]: more pairs than a basis has, bases on different numbers of vertices, a gap that is no number from
/// 0 on, cancellation.
pub fn compare(
    reference: &Basis,
    other: &Basis,
    pairs: usize,
    gap: f64,
    monitor: &dyn Monitor,
) -> Result<SubspaceComparison, AnalysisError> {
    error::count("pairs", pairs, 1, reference.count().min(other.count()).min(MOST_PAIRS))?;
    check_gap(gap)?;
    let n = reference.vertices();
    if other.vertices() != n {
        return Err(AnalysisError::Basis(BasisError::Rows { found: other.vertices(), expected: n }));
    }
    let mut coefficients = DenseMatrix::zeros(pairs, pairs);
    let mut projection_errors = Vec::with_capacity(pairs);
    for from in (0..pairs).step_by(AT_ONCE) {
        monitor.checkpoint()?;
        let range = from..pairs.min(from + AT_ONCE);
        let functions = DenseMatrix::from_columns(n, range.len(), other.lift(range.clone())?);
        let found = reference.project(&functions)?;
        for ((column, k), norm) in range.zip(0..).zip(reference.norms(&functions)?) {
            let found = &found.column(k)[..pairs];
            coefficients.column_mut(column).copy_from_slice(found);
            let held: f64 = found.iter().map(|c| c * c).sum();
            projection_errors.push(if norm > 0.0 { (1.0 - held / (norm * norm)).max(0.0).sqrt() } else { 0.0 });
        }
    }
    // In the mass of the reference the functions of the other basis need not be orthonormal.
    let gram = match other.mass == reference.mass {
        true => SparseMatrix::<f64>::identity(pairs).to_dense(),
        false => gram(reference, other, pairs, monitor)?,
    };
    let eigenspaces = clusters(&reference.eigenvalues[..pairs], gap)
        .into_iter()
        .map(|modes| Ok(Eigenspace { angles: angles(&block(&coefficients, &modes), block(&gram, &modes))?, modes }))
        .collect::<Result<_, AnalysisError>>()?;
    let zero = super::spectrum::NEARLY * reference.eigenvalues[pairs - 1].abs();
    let values = reference.eigenvalues.iter().zip(&other.eigenvalues).take(pairs);
    Ok(SubspaceComparison {
        angles: angles(&coefficients, gram.clone())?,
        eigenvalue_errors: values.map(|(a, b)| if (b - a).abs() <= zero { 0.0 } else { (b - a) / a }).collect(),
        projection_errors,
        eigenspaces,
        coefficients,
        gram,
    })
}

/// Checks that a gap is one.
pub(super) fn check_gap(gap: f64) -> Result<(), AnalysisError> {
    if gap.is_finite() && gap >= 0.0 {
        return Ok(());
    }
    let expected = "a finite number that is not negative";
    Err(AnalysisError::Parameter { parameter: "gap", value: gap, expected })
}

/// Runs of ascending values in which each follows on the one before with a relative gap of at most `gap`; zeros, as far
/// as rounding tells, are one run.
pub(super) fn clusters(values: &[f64], gap: f64) -> Vec<Range<usize>> {
    let largest = values.last().copied().unwrap_or(0.0).abs();
    let zero = super::spectrum::NEARLY * largest;
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (index, value) in values.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if value - values[index - 1] <= (gap * value.abs()).max(zero) => run.end = index + 1,
            _ => runs.push(index..index + 1),
        }
    }
    runs
}

/// Some rows of the same columns.
fn block(matrix: &DenseMatrix, modes: &Range<usize>) -> DenseMatrix {
    let mut block = DenseMatrix::zeros(modes.len(), modes.len());
    for (column, mode) in modes.clone().enumerate() {
        block.column_mut(column).copy_from_slice(&matrix.column(mode)[modes.clone()]);
    }
    block
}

/// `ΨᵀMΨ` of the first functions of the other basis, `M` of the reference.
fn gram(reference: &Basis, other: &Basis, pairs: usize, monitor: &dyn Monitor) -> Result<DenseMatrix, AnalysisError> {
    let n = reference.vertices();
    let at_once = (GRAM_NUMBERS / n.max(1)).clamp(AT_ONCE, MOST_PAIRS);
    let lifted = |from: usize| {
        let range = from..pairs.min(from + at_once);
        Ok::<_, AnalysisError>(DenseMatrix::from_columns(n, range.len(), other.lift(range)?))
    };
    let mut gram = DenseMatrix::zeros(pairs, pairs);
    for right in (0..pairs).step_by(at_once) {
        let functions = reference.mass_times(&lifted(right)?)?;
        for left in (0..=right).step_by(at_once) {
            monitor.checkpoint()?;
            let products = lifted(left)?.transposed_times(&functions);
            for j in 0..products.columns() {
                for (i, &product) in products.column(j).iter().enumerate() {
                    gram.column_mut(right + j)[left + i] = product;
                    gram.column_mut(left + i)[right + j] = product;
                }
            }
        }
    }
    Ok(gram)
}

/// The principal angles of the spaces of two bases with these inner products, the first orthonormal and the second with
/// this Gram matrix: squares of their cosines are the eigenvalues of the pencil of both.
fn angles(products: &DenseMatrix, gram: DenseMatrix) -> Result<Vec<f64>, AnalysisError> {
    let k = products.columns();
    let mut squares = products.transposed_times(products);
    squares.values_mut().iter_mut().for_each(|value| *value = -*value);
    let found = CpuSolver.lowest(squares, gram, k, &Unwatched)?;
    // Largest cosines first. Sines tell small angles better than cosines do.
    let angle = |value: &f64| {
        let square = (-value).clamp(0.0, 1.0);
        (1.0 - square).sqrt().atan2(square.sqrt())
    };
    Ok(found.values.iter().map(angle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::{chain, dense};
    use crate::basis::{DenseFunctions, Functions, Precision};
    use chladni_algebra::MassMatrix;

    /// The chain with two of its functions turned against each other by an angle.
    fn turned(basis: &Basis, a: usize, b: usize, angle: f64) -> Basis {
        let (n, m) = (basis.vertices(), basis.count());
        let mut columns = DenseMatrix::from_columns(n, m, basis.lift(0..m).unwrap());
        let (x, y) = (columns.column(a).to_vec(), columns.column(b).to_vec());
        let (sine, cosine) = angle.sin_cos();
        for v in 0..n {
            columns.column_mut(a)[v] = cosine * x[v] + sine * y[v];
            columns.column_mut(b)[v] = cosine * y[v] - sine * x[v];
        }
        Basis { functions: Functions::Dense(DenseFunctions::from_columns(&columns, Precision::F64)), ..basis.clone() }
    }

    #[test]
    fn a_rotation_within_a_cluster_is_none_and_between_clusters_is_its_angle() {
        let mut basis = dense(&chain(60, 20));
        // Modes 4 and 5 have one eigenvalue, as far as the gap goes.
        basis.eigenvalues[5] = basis.eigenvalues[4] * 1.001;
        let inside = compare(&basis, &turned(&basis, 4, 5, 0.7), 20, 0.01, &Unwatched).unwrap();
        assert_eq!(inside.eigenspaces.len(), 19);
        assert!(inside.eigenspaces.iter().flat_map(|space| &space.angles).all(|&angle| angle < 1e-7));
        assert!((inside.coefficients.column(4)[5] - 0.7f64.sin()).abs() < 1e-12);
        let across = compare(&basis, &turned(&basis, 7, 9, 0.3), 20, 0.01, &Unwatched).unwrap();
        for space in &across.eigenspaces {
            let expected = if [7, 9].contains(&space.modes.start) { 0.3 } else { 0.0 };
            assert!(space.angles.iter().all(|angle| (angle - expected).abs() < 1e-7), "{space:?}");
        }
        // All functions together span the same, and lie in the reference.
        assert!(across.angles.iter().chain(&across.projection_errors).all(|&x| x < 1e-7));
    }

    #[test]
    fn what_leaves_the_span_is_measured() {
        let basis = dense(&chain(60, 20));
        let found = compare(&basis, &turned(&basis, 3, 15, 0.2), 10, 0.01, &Unwatched).unwrap();
        for (k, error) in found.projection_errors.iter().enumerate() {
            let expected = if k == 3 { 0.2f64.sin() } else { 0.0 };
            assert!((error - expected).abs() < 1e-7, "{k}: {error}");
        }
        assert!((found.angles[9] - 0.2).abs() < 1e-7 && found.angles[8] < 1e-7, "{:?}", found.angles);
        let mut other = basis.clone();
        other.eigenvalues[2] *= 1.5;
        let found = compare(&basis, &other, 10, 0.01, &Unwatched).unwrap();
        assert!((found.eigenvalue_errors[2] - 0.5).abs() < 1e-12 && found.eigenvalue_errors[0] == 0.0);
    }

    #[test]
    fn another_mass_and_another_scale_turn_no_space() {
        let basis = dense(&chain(60, 20));
        let (n, m) = (basis.vertices(), basis.count());
        // The same space by functions that are orthonormal in no mass of the reference: sums of one and the next, ever
        // longer.
        let columns = DenseMatrix::from_columns(n, m, basis.lift(0..m).unwrap());
        let mut other = columns.clone();
        for k in 0..m - 1 {
            let next = columns.column(k + 1).to_vec();
            let length = 1.0 + k as f64;
            other.column_mut(k).iter_mut().zip(next).for_each(|(x, y)| *x = length * (*x + 0.5 * y));
        }
        let mass = MassMatrix::Diagonal(vec![7.0; n]);
        let functions = Functions::Dense(DenseFunctions::from_columns(&other, Precision::F64));
        let other = Basis { functions, mass, ..basis.clone() };
        let found = compare(&basis, &other, m, 0.01, &Unwatched).unwrap();
        assert!(found.angles.iter().all(|&angle| angle < 1e-6), "{:?}", found.angles);
        // A function and half of the next: an angle of arctan 1/2, whatever its length.
        for space in &found.eigenspaces[..m - 1] {
            assert!((space.angles[0] - 0.5f64.atan()).abs() < 1e-7, "{space:?}");
        }
        // Of fewer pairs the last function leaves the span by what it has of the next.
        let fewer = compare(&basis, &other, 10, 0.01, &Unwatched).unwrap();
        assert!(fewer.angles[8] < 1e-6 && fewer.angles[9] > 1e-3, "{:?}", fewer.angles);
    }

    #[test]
    fn clusters_are_runs_of_small_gaps() {
        assert_eq!(clusters(&[0.0, 1e-12, 1.0, 1.005, 1.009, 2.0], 0.01), [0..2, 2..5, 5..6]);
        assert_eq!(clusters(&[1.0, 2.0, 9.0], 0.6), [0..2, 2..3]);
        assert!(clusters(&[], 0.1).is_empty());
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let (basis, other) = (chain(60, 20), chain(50, 20));
        let told =
            |b: &Basis, pairs: usize, gap: f64| compare(&basis, b, pairs, gap, &Unwatched).unwrap_err().to_string();
        assert!(
            told(&basis, 21, 0.1).ends_with("pairs must be between 1 and 20, got 21")
                && told(&basis, 0, 0.1).ends_with("pairs must be between 1 and 20, got 0")
        );
        assert!(told(&basis, 5, -0.1).ends_with("got -0.1") && told(&basis, 5, f64::NAN).ends_with("got NaN"));
        assert!(told(&other, 5, 0.1).contains("50"));
    }
}
