//! The dense symmetric-definite eigenproblem `A x = λ B x`: one interface, and the solver on the CPU.

use chladni_base::Monitor;
use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor as cholesky;
use faer::linalg::evd::{self, ComputeEigenvectors};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::DenseMatrix;
use super::bisection::lowest_few;
use super::dense::{view, view_mut};
use super::eigen_error::{EigenError, memory};
use super::tridiagonal::tridiagonalise;

/// Where eigenpairs were computed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum ComputedOn {
    /// On the CPU.
    #[default]
    Cpu,
    /// On a graphics card.
    Gpu {
        /// Its name.
        adapter: String,
    },
    /// On the CPU, since a graphics card failed.
    CpuInstead {
        /// Its name.
        adapter: String,
        /// What happened.
        reason: String,
    },
}

/// Eigenpairs of a pencil of size `d`.
#[derive(Debug, Clone, PartialEq)]
pub struct EigenPairs {
    /// `m` eigenvalues, ascending.
    pub values: Vec<f64>,
    /// `d × m`, `B`-orthonormal; in each column the entry of largest magnitude is positive.
    pub vectors: DenseMatrix,
    /// Where they were computed.
    pub computed_on: ComputedOn,
}

/// Solves dense symmetric-definite eigenproblems.
pub trait SymmetricDefiniteSolver: Sync {
    /// A stable name for logs and metrics.
    fn name(&self) -> &'static str;

    /// The `count` lowest pairs of `A x = λ B x`. Only the lower triangles are read. The matrices are given away, since
    /// they may be large and are worked on in place.
    ///
    /// # Errors
    /// [`EigenError`] names what is wrong with the pencil.
    fn lowest(
        &self,
        a: DenseMatrix,
        b: DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<EigenPairs, EigenError>;
}

/// Cholesky, reduction to a standard problem, tridiagonalisation, divide and conquer, and transformation of the wanted
/// vectors only; all on the CPU, on the threads of the pool it is called from.
#[derive(Debug, Clone, Copy, Default)]
pub struct CpuSolver;

/// Below this size threads cost more than they save.
const LEAST_PARALLEL_SIZE: usize = 256;

impl SymmetricDefiniteSolver for CpuSolver {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn lowest(
        &self,
        a: DenseMatrix,
        b: DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<EigenPairs, EigenError> {
        let mut pencil = Pencil::new(a, b, count, monitor)?;
        let (values, vectors) = pencil.lowest_on_cpu(count, monitor)?;
        Ok(pencil.finish(values, vectors, monitor))
    }
}

/// Threads for a problem of size `d`.
pub(super) fn parallelism(d: usize) -> Par {
    let threads = rayon::current_num_threads();
    if d < LEAST_PARALLEL_SIZE || threads == 1 { Par::Seq } else { Par::rayon(threads) }
}

/// A pencil that is checked, scaled and factored, which every solver begins with.
pub(super) struct Pencil {
    /// `A`, scaled to a magnitude near 1: the lower triangle.
    pub(super) a: DenseMatrix,
    /// `L`, where `L Lᵀ` is the `B` scaled to a unit diagonal: the lower triangle.
    pub(super) l: DenseMatrix,
    scales: Vec<f64>,
    magnitude: f64,
}

impl Pencil {
    pub(super) fn new(
        mut a: DenseMatrix,
        mut b: DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<Self, EigenError> {
        let d = a.rows();
        if (a.columns(), b.rows(), b.columns()) != (d, d, d) {
            return Err(EigenError::Shape { a: (d, a.columns()), b: (b.rows(), b.columns()) });
        }
        if count > d {
            return Err(EigenError::Count { count, size: d });
        }
        check_finite('A', &a)?;
        check_finite('B', &b)?;
        let scales = scale_to_unit_diagonal(&mut a, &mut b)?;
        let magnitude = normalise_magnitude(&mut a);
        monitor.checkpoint()?;
        if d > 0 {
            factor(view_mut(&mut b), parallelism(d))?;
        }
        monitor.progress(0.05);
        monitor.checkpoint()?;
        Ok(Self { a, l: b, scales, magnitude })
    }

    /// The lowest pairs of `A x = λ L Lᵀ x`. `A` is used up.
    pub(super) fn lowest_on_cpu(
        &mut self,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<f64>, DenseMatrix), EigenError> {
        let d = self.l.rows();
        if count == 0 {
            return Ok((Vec::new(), DenseMatrix::zeros(d, 0)));
        }
        let par = parallelism(d);
        to_standard(&mut self.a, &self.l)?;
        monitor.progress(0.15);
        monitor.checkpoint()?;
        let (values, mut vectors) = standard_lowest(std::mem::take(&mut self.a), count, par, monitor)?;
        monitor.checkpoint()?;
        from_standard(&self.l, &mut vectors);
        Ok((values, vectors))
    }

    /// Pairs of the pencil as it was given.
    pub(super) fn finish(self, mut values: Vec<f64>, mut vectors: DenseMatrix, monitor: &dyn Monitor) -> EigenPairs {
        for column in 0..vectors.columns() {
            let column = vectors.column_mut(column);
            column.iter_mut().zip(&self.scales).for_each(|(x, s)| *x *= s);
            make_largest_positive(column);
        }
        values.iter_mut().for_each(|v| *v *= self.magnitude);
        monitor.progress(1.0);
        EigenPairs { values, vectors, computed_on: ComputedOn::Cpu }
    }
}

/// Turns a vector so that its entry of largest magnitude, the first such, is positive.
pub(super) fn make_largest_positive(vector: &mut [f64]) {
    let largest = vector.iter().fold(0.0f64, |most, &x| if x.abs() > most.abs() { x } else { most });
    if largest < 0.0 {
        vector.iter_mut().for_each(|x| *x = -*x);
    }
}

pub(super) fn check_finite(matrix: char, values: &DenseMatrix) -> Result<(), EigenError> {
    for column in 0..values.columns() {
        if let Some(below) = values.column(column)[column..].iter().position(|v| !v.is_finite()) {
            return Err(EigenError::NotFinite { matrix, row: column + below, column });
        }
    }
    Ok(())
}

/// The same of all entries, and not of the lower triangle alone.
pub(super) fn check_all_finite(matrix: char, values: &DenseMatrix) -> Result<(), EigenError> {
    for column in 0..values.columns() {
        if let Some(row) = values.column(column).iter().position(|v| !v.is_finite()) {
            return Err(EigenError::NotFinite { matrix, row, column });
        }
    }
    Ok(())
}

/// Scales rows and columns of both matrices so that `B` has ones on its diagonal, which makes Cholesky as stable as it
/// can be; gives the scales, by which eigenvectors have to be multiplied.
fn scale_to_unit_diagonal(a: &mut DenseMatrix, b: &mut DenseMatrix) -> Result<Vec<f64>, EigenError> {
    let d = a.rows();
    let mut scales = Vec::with_capacity(d);
    for pivot in 0..d {
        let scale = 1.0 / b.column(pivot)[pivot].sqrt();
        if !(scale.is_finite() && scale > 0.0) {
            return Err(EigenError::NotPositiveDefinite { pivot });
        }
        scales.push(scale);
    }
    for column in 0..d {
        for matrix in [&mut *a, &mut *b] {
            for (x, scale) in matrix.column_mut(column)[column..].iter_mut().zip(&scales[column..]) {
                *x *= scale * scales[column];
            }
        }
        b.column_mut(column)[column] = 1.0;
    }
    Ok(scales)
}

/// Divides `A` by the power of two that brings its largest diagonal entry near 1, and gives that power.
fn normalise_magnitude(a: &mut DenseMatrix) -> f64 {
    let largest = (0..a.rows()).map(|k| a.column(k)[k].abs()).fold(0.0, f64::max);
    if !(largest > 1e-280 && largest < 1e280) {
        return 1.0;
    }
    let magnitude = largest.log2().round().exp2();
    a.values_mut().iter_mut().for_each(|x| *x /= magnitude);
    magnitude
}

/// `B = L Lᵀ`, in the lower triangle.
fn factor(b: MatMut<'_, f64>, par: Par) -> Result<(), EigenError> {
    let mut buffer = memory(cholesky::cholesky_in_place_scratch::<f64>(b.nrows(), par, Default::default()))?;
    cholesky::cholesky_in_place(b, Default::default(), par, MemStack::new(&mut buffer), Default::default())
        .map(|_| ())
        .map_err(|cholesky::LltError::NonPositivePivot { index }| EigenError::NotPositiveDefinite { pivot: index })
}

/// `A ← L⁻¹ A L⁻ᵀ` in the lower triangle.
///
/// # Errors
/// No memory.
pub(super) fn to_standard(a: &mut DenseMatrix, l: &DenseMatrix) -> Result<(), EigenError> {
    let par = parallelism(l.rows());
    reduce(view_mut(a), view(l), par)
}

/// `X ← L⁻ᵀ X`: vectors of the standard problem, `d × m`, back to those of the pencil.
pub(super) fn from_standard(l: &DenseMatrix, vectors: &mut DenseMatrix) {
    let par = parallelism(l.rows());
    triangular_solve::solve_upper_triangular_in_place(view(l).transpose(), view_mut(vectors), par);
}

/// `A ← L⁻¹ A L⁻ᵀ` in the lower triangle: by halves, so that nearly all of the `d³` operations are matrix products (as
/// in LAPACK's dsygst, but recursive).
fn reduce(a: MatMut<'_, f64>, l: MatRef<'_, f64>, par: Par) -> Result<(), EigenError> {
    const SMALL: usize = 64;
    let n = a.nrows();
    if n <= SMALL {
        reduce_small(a, l);
        return Ok(());
    }
    let half = (n / 2).next_multiple_of(8);
    let (mut a11, _, mut a21, mut a22) = a.split_at_mut(half, half);
    let (l11, _, l21, l22) = l.split_at(half, half);
    reduce(a11.rb_mut(), l11, par)?;
    triangular_solve::solve_lower_triangular_in_place(l11, a21.rb_mut().transpose_mut(), par);
    // W = ½ L21 C11, where only the lower triangle of the symmetric C11 is stored.
    let mut storage = DenseMatrix::zeros(n - half, half);
    let mut w = view_mut(&mut storage);
    let product = |mut into: MatMut<'_, f64>, structure, c: MatRef<'_, f64>, triangle, factor| {
        triangular::matmul(
            into.rb_mut(),
            BlockStructure::Rectangular,
            structure,
            l21,
            BlockStructure::Rectangular,
            c,
            triangle,
            factor,
            par,
        );
    };
    product(w.rb_mut(), Accum::Replace, a11.rb(), BlockStructure::TriangularLower, 0.5);
    product(w.rb_mut(), Accum::Add, a11.rb().transpose(), BlockStructure::StrictTriangularUpper, 0.5);
    subtract(a21.rb_mut(), w.rb());
    for (left, right) in [(a21.rb(), l21), (l21, a21.rb())] {
        triangular::matmul(
            a22.rb_mut(),
            BlockStructure::TriangularLower,
            Accum::Add,
            left,
            BlockStructure::Rectangular,
            right.transpose(),
            BlockStructure::Rectangular,
            -1.0,
            par,
        );
    }
    subtract(a21.rb_mut(), w.rb());
    drop(storage);
    triangular_solve::solve_lower_triangular_in_place(l22, a21, par);
    reduce(a22, l22, par)
}

fn reduce_small(mut a: MatMut<'_, f64>, l: MatRef<'_, f64>) {
    let n = a.nrows();
    let mut full = DenseMatrix::zeros(n, n);
    for column in 0..n {
        for row in 0..n {
            full.column_mut(column)[row] = if row < column { a[(column, row)] } else { a[(row, column)] };
        }
    }
    triangular_solve::solve_lower_triangular_in_place(l, view_mut(&mut full), Par::Seq);
    triangular_solve::solve_lower_triangular_in_place(l, view_mut(&mut full).transpose_mut(), Par::Seq);
    for column in 0..n {
        for row in column..n {
            a[(row, column)] = full.column(column)[row];
        }
    }
}

fn subtract(mut from: MatMut<'_, f64>, what: MatRef<'_, f64>) {
    for column in 0..from.ncols() {
        for row in 0..from.nrows() {
            from[(row, column)] -= what[(row, column)];
        }
    }
}

/// The lowest pairs of a symmetric matrix, of which the lower triangle is read.
pub(super) fn standard_lowest(
    a: DenseMatrix,
    count: usize,
    par: Par,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, DenseMatrix), EigenError> {
    let d = a.rows();
    if d == 1 {
        let one = DenseMatrix::from_columns(1, 1, vec![1.0]);
        return Ok((a.values().to_vec(), one));
    }
    let reduced = tridiagonalise(a, &|done| {
        monitor.progress(0.15 + 0.35 * done);
        monitor.checkpoint()
    })?;
    monitor.checkpoint()?;
    let (values, mut vectors) = tridiagonal_lowest(&reduced.diagonal, &reduced.off_diagonal, count)?;
    monitor.progress(0.8);
    monitor.checkpoint()?;

    reduced.back(&mut vectors, par)?;
    monitor.progress(0.95);
    Ok((values, vectors))
}

/// Up to one pair in so many is few.
const FEW: usize = 4;

/// From so large a matrix on. Bisection knows values up to a rounding error of the largest; where a small matrix has
/// entries of very different sizes, divide and conquer happens to keep more digits of the low ones, and takes no time
/// either.
const LEAST_FEW: usize = 128;

/// The `count` lowest pairs of the symmetric tridiagonal matrix with this diagonal and, beside it, the first `d − 1` of
/// these numbers, by divide and conquer, or by bisection and inverse iteration where few are wanted.
pub(super) fn tridiagonal_lowest(
    diagonal: &[f64],
    off_diagonal: &[f64],
    count: usize,
) -> Result<(Vec<f64>, DenseMatrix), EigenError> {
    let d = diagonal.len();
    if d == 1 {
        return Ok((diagonal.to_vec(), DenseMatrix::from_columns(1, 1, vec![1.0])));
    }
    if d >= LEAST_FEW.max(FEW * count)
        && let Some(found) = lowest_few(diagonal, off_diagonal, count)
    {
        return Ok(found);
    }
    let par = parallelism(d);
    let mut values = vec![0.0; d];
    let mut vectors = DenseMatrix::zeros(d, d);
    let request = evd::self_adjoint_evd_scratch::<f64>(d, ComputeEigenvectors::Yes, par, Default::default());
    let mut buffer = memory(request)?;
    evd::tridiagonal_self_adjoint_evd(
        faer::diag::DiagRef::from_slice(diagonal),
        faer::diag::DiagRef::from_slice(off_diagonal),
        faer::diag::DiagMut::from_slice_mut(&mut values),
        Some(view_mut(&mut vectors)),
        par,
        MemStack::new(&mut buffer),
        Default::default(),
    )
    .map_err(|_| EigenError::NoConvergence)?;
    values.truncate(count);
    vectors.keep_columns(count);
    Ok((values, vectors))
}

#[cfg(test)]
#[path = "eigen_tests.rs"]
mod tests;
