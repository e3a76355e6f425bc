//! A symmetric matrix to tridiagonal form by Householder reflections, and vectors back, on the CPU.
//!
//! Blocked as LAPACK's dsytrd (Dongarra, Hammarling and Sorensen 1989): half of the operations are products with
//! matrices. The other half are products of the matrix and a vector; they read each number of the lower triangle once,
//! and the memory bounds them. Threads share both in parts that do not depend on their number, so that no bit of the
//! result does either. docs/decisions/0021 tells what was measured.

use chladni_base::Cancelled;
use chladni_base::parallel::*;
use faer::dyn_stack::MemStack;
use faer::linalg::evd::tridiag;
use faer::linalg::householder;
use faer::linalg::matmul::matmul;
use faer::linalg::qr::no_pivoting::factor::recommended_block_size;
use faer::{Accum, Conj, MatMut, MatRef, Par};

use super::DenseMatrix;
use super::column_products::{add_combination, add_symmetric, dot_products};
use super::dense::{view, view_mut};
use super::eigen_error::{EigenError, memory};

/// Sizes below which the whole matrix fits the second-level cache, and faer's reduction, column by column, is as fast
/// or faster.
const LEAST_BLOCKED: usize = 512;

/// Columns whose updates are gathered before the matrix takes them.
const PANEL: usize = 32;

/// Columns that one task of such an update changes.
const STRIP: usize = 64;

/// Strips from which on threads share an update.
const LEAST_STRIPS: usize = 4;

/// Numbers of the triangle from which on another task takes a part of a product with a vector: one megabyte.
const TASK: usize = 1 << 17;

/// Tasks that such a product is cut into, at most.
const MOST_TASKS: usize = 32;

/// `A = Q T Qᵀ` with a tridiagonal `T` and a product `Q = H₀H₁⋯` of `d − 1` reflections.
pub(super) struct Tridiagonal {
    /// `d` numbers.
    pub(super) diagonal: Vec<f64>,
    /// `d` numbers, of which the last is zero.
    pub(super) off_diagonal: Vec<f64>,
    /// Column `k` below row `k + 1` is the reflector `vₖ` of `Hₖ = 1 − τₖ vₖvₖᵀ` without the one that it begins with.
    reflectors: DenseMatrix,
    /// The factors of the blocks of reflectors behind each other, as faer has them: `1/τₖ` on the diagonal, products
    /// `vᵢᵀvⱼ` above.
    factors: DenseMatrix,
}

/// Reduces `a`, of which the lower triangle is read. `done` hears now and then which fraction is done, and may end the
/// work.
///
/// # Errors
/// No memory, or what `done` says.
pub(super) fn tridiagonalise(
    a: DenseMatrix,
    done: &dyn Fn(f64) -> Result<(), Cancelled>,
) -> Result<Tridiagonal, EigenError> {
    if a.rows() < LEAST_BLOCKED { by_columns(a) } else { by_panels(a, done) }
}

impl Tridiagonal {
    /// `Z ← Q Z`: vectors in the basis of `T`, `d × m`, back to that of `A`.
    ///
    /// # Errors
    /// No memory.
    pub(super) fn back(&self, z: &mut DenseMatrix, par: Par) -> Result<(), EigenError> {
        let (d, count) = (z.rows(), z.columns());
        if d < 2 {
            return Ok(());
        }
        let block = self.factors.rows();
        let request =
            householder::apply_block_householder_sequence_on_the_left_in_place_scratch::<f64>(d - 1, block, count);
        let mut buffer = memory(request)?;
        householder::apply_block_householder_sequence_on_the_left_in_place_with_conj(
            view(&self.reflectors).submatrix(1, 0, d - 1, d - 1),
            view(&self.factors),
            Conj::No,
            view_mut(z).subrows_mut(1, d - 1),
            par,
            MemStack::new(&mut buffer),
        );
        Ok(())
    }
}

/// Room for the factors of blocks of reflectors.
fn block_factors(d: usize) -> DenseMatrix {
    let count = d.saturating_sub(1);
    DenseMatrix::zeros(if count > 0 { recommended_block_size::<f64>(count, count) } else { 0 }, count)
}

/// Small matrices: on one thread, since the sums of several would depend on their number.
fn by_columns(a: DenseMatrix) -> Result<Tridiagonal, EigenError> {
    by_columns_on(a, Par::Seq)
}

/// By faer.
fn by_columns_on(mut a: DenseMatrix, par: Par) -> Result<Tridiagonal, EigenError> {
    let d = a.rows();
    let mut factors = block_factors(d);
    if d > 1 {
        let mut buffer = memory(tridiag::tridiag_in_place_scratch::<f64>(d, par, Default::default()))?;
        let stack = MemStack::new(&mut buffer);
        tridiag::tridiag_in_place(view_mut(&mut a), view_mut(&mut factors), par, stack, Default::default());
    }
    let diagonal = (0..d).map(|k| a.column(k)[k]).collect();
    let off_diagonal = (0..d).map(|k| if k + 1 < d { a.column(k)[k + 1] } else { 0.0 }).collect();
    Ok(Tridiagonal { diagonal, off_diagonal, reflectors: a, factors })
}

/// Large matrices, panel by panel.
fn by_panels(mut a: DenseMatrix, done: &dyn Fn(f64) -> Result<(), Cancelled>) -> Result<Tridiagonal, EigenError> {
    let d = a.rows();
    let (mut diagonal, mut off_diagonal, mut tau) = (vec![0.0; d], vec![0.0; d], vec![0.0; d]);
    let (mut panel, mut product) = (ReflectorPanel::new(d), SymmetricProduct::new(d));
    for start in (0..d).step_by(PANEL) {
        let end = (start + PANEL).min(d);
        for column in start..end {
            let x = a.column_mut(column);
            panel.update(column, column - start, x);
            diagonal[column] = x[column];
            if column + 1 < d {
                (off_diagonal[column], tau[column]) = reflector(&mut x[column + 1..]);
                let v = a.column(column);
                let product = product.of(a.values(), column + 1, v);
                panel.append(column, column - start, v, product, tau[column]);
            }
        }
        panel.apply(&mut a, end);
        done(1.0 - (1.0 - end as f64 / d as f64).powi(3))?;
    }
    let factors = factors_of(&a, &tau);
    Ok(Tridiagonal { diagonal, off_diagonal, reflectors: a, factors })
}

/// The factors of all blocks, where column `k` of `a` holds `vₖ` from row `k + 1` on.
fn factors_of(a: &DenseMatrix, tau: &[f64]) -> DenseMatrix {
    let count = tau.len().saturating_sub(1);
    let mut factors = block_factors(tau.len());
    let block = factors.rows();
    if count == 0 {
        return factors;
    }
    let reflectors = view(a).submatrix(1, 0, count, count);
    factors.values_mut().par_chunks_mut(block * block).enumerate().for_each(|(k, values)| {
        let (start, width) = (k * block, values.len() / block);
        let mut factor = MatMut::from_column_major_slice_mut(values, block, width).subrows_mut(0, width);
        for l in 0..width {
            // A reflection that changes nothing has τ = 0, for which faer's notation is infinity.
            factor[(l, l)] = 1.0 / tau[start + l];
        }
        let reflectors = reflectors.submatrix(start, start, count - start, width);
        householder::upgrade_householder_factor(factor, reflectors, width, 1, Par::Seq);
    });
    factors
}

/// Makes `x` the reflector that takes it to a multiple of the first unit vector; gives that multiple and τ.
fn reflector(x: &mut [f64]) -> (f64, f64) {
    let (head, tail) = x.split_at_mut(1);
    let alpha = head[0];
    head[0] = 1.0;
    let mut scale = 1.0;
    let mut square = dot(tail, tail);
    if !(square > 1e-250 && square < 1e250) {
        // Squares leave the range of numbers: a power of two brings them back.
        scale = if square < 1.0 { 2f64.powi(600) } else { 2f64.powi(-600) };
        // What is so much smaller than the first number is nothing beside it.
        let factor = if square < 1.0 && alpha.abs() > 1.0 { 0.0 } else { scale };
        tail.iter_mut().for_each(|x| *x *= factor);
        square = dot(tail, tail);
    }
    if square == 0.0 {
        return (alpha, 0.0);
    }
    let alpha = alpha * scale;
    let beta = -alpha.hypot(square.sqrt()).copysign(alpha);
    let factor = 1.0 / (alpha - beta);
    tail.iter_mut().for_each(|x| *x *= factor);
    (beta / scale, (beta - alpha) / beta)
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut product = [0.0];
    dot_products(x, y, 0, &mut product);
    product[0]
}

/// The reflectors `V` of a panel and the vectors `W` that make the update `A ← A − V Wᵀ − W Vᵀ`, as one matrix
/// `[V W V]`: its first two thirds times its last two thirds, transposed.
struct ReflectorPanel {
    d: usize,
    values: Vec<f64>,
    /// Rows of `[W V]`, or products with the columns of `[V W]`.
    factors: [f64; 2 * PANEL],
}

impl ReflectorPanel {
    fn new(d: usize) -> Self {
        Self { d, values: vec![0.0; 3 * PANEL * d], factors: [0.0; 2 * PANEL] }
    }

    /// Brings a column of the matrix up to date, with the first `count` vectors of either kind.
    fn update(&mut self, row: usize, count: usize, x: &mut [f64]) {
        let Self { d, values, factors } = self;
        for (first, other) in [(0, PANEL), (PANEL, 0)] {
            for k in 0..count {
                factors[k] = -values[(other + k) * *d + row];
            }
            add_combination(&values[first * *d..], &factors[..count], row, x);
        }
    }

    /// Takes in the reflector `v` of a column, and from `product = A v` the vector beside it.
    fn append(&mut self, column: usize, count: usize, v: &[f64], w: &mut [f64], tau: f64) {
        let Self { d, values, factors } = self;
        let (d, first) = (*d, column + 1);
        let (of_v, of_w) = factors.split_at_mut(PANEL);
        dot_products(values, v, first, &mut of_v[..count]);
        dot_products(&values[PANEL * d..], v, first, &mut of_w[..count]);
        factors.iter_mut().for_each(|x| *x = -*x);
        add_combination(values, &factors[PANEL..PANEL + count], first, w);
        add_combination(&values[PANEL * d..], &factors[..count], first, w);
        w[first..].iter_mut().for_each(|x| *x *= tau);
        let along = dot(&w[first..], &v[first..]);
        add_combination(v, &[-0.5 * tau * along], first, w);
        for (place, from) in [(count, v), (PANEL + count, &*w), (2 * PANEL + count, v)] {
            values[place * d + first..(place + 1) * d].copy_from_slice(&from[first..]);
        }
    }

    /// `A ← A − V Wᵀ − W Vᵀ` in the lower triangle from row and column `end` on; what is above the diagonal is of no
    /// use.
    fn apply(&self, a: &mut DenseMatrix, end: usize) {
        let d = self.d;
        let panel = MatRef::from_column_major_slice(&self.values, d, 3 * PANEL);
        let strip = |(k, strip): (usize, &mut [f64])| {
            let (first, columns) = (end + k * STRIP, strip.len() / d);
            let strip = MatMut::from_column_major_slice_mut(strip, d, columns).subrows_mut(first, d - first);
            let left = panel.submatrix(first, 0, d - first, 2 * PANEL);
            let right = panel.submatrix(first, PANEL, columns, 2 * PANEL);
            matmul(strip, Accum::Add, left, right.transpose(), -1.0, Par::Seq);
        };
        let rest = &mut a.values_mut()[end * d..];
        if d - end < LEAST_STRIPS * STRIP {
            rest.chunks_mut(STRIP * d).enumerate().for_each(strip);
        } else {
            rest.par_chunks_mut(STRIP * d).enumerate().for_each(strip);
        }
    }
}

/// Products of what is left of the matrix and a vector.
struct SymmetricProduct {
    d: usize,
    /// What each task adds.
    parts: Vec<f64>,
    sum: Vec<f64>,
}

fn tasks(size: usize) -> usize {
    (size * size / (2 * TASK)).clamp(1, MOST_TASKS)
}

impl SymmetricProduct {
    fn new(d: usize) -> Self {
        Self { d, parts: vec![0.0; d * tasks(d)], sum: vec![0.0; d] }
    }

    /// `A x` for the rows and columns from `first` on.
    fn of(&mut self, a: &[f64], first: usize, x: &[f64]) -> &mut [f64] {
        let Self { d, parts, sum } = self;
        let (d, size) = (*d, *d - first);
        let tasks = tasks(size);
        // Columns that cut the triangle into parts of one size.
        let cut = |task: usize| {
            let left = (1.0 - task as f64 / tasks as f64).sqrt();
            first + (size as f64 * (1.0 - left)) as usize
        };
        let part = |(task, part): (usize, &mut [f64])| {
            let (from, to) = (cut(task), if task + 1 == tasks { d } else { cut(task + 1) });
            part[from..].fill(0.0);
            add_symmetric(a, from..to, x, part);
        };
        if tasks == 1 {
            part((0, sum));
            return sum;
        }
        let parts = &mut parts[..tasks * d];
        parts.par_chunks_mut(d).enumerate().for_each(part);
        sum[first..].fill(0.0);
        for (task, part) in parts.chunks(d).enumerate() {
            let from = cut(task);
            sum[from..].iter_mut().zip(&part[from..]).for_each(|(sum, part)| *sum += part);
        }
        sum
    }
}

#[cfg(test)]
#[path = "tridiagonal_tests.rs"]
mod tests;
