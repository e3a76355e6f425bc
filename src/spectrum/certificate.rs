//! What is proven about Ritz pairs: residuals, a-posteriori bounds, orthonormality on the fine mesh.
//!
//! For `‖x‖_M = 1` and `r = S x − θ M x`, some exact eigenvalue lies within `‖r‖_{M⁻¹}` of θ. This needs no assumption: neither that θ is
//! close to anything, nor that no eigenvalue was missed. A bound that falls with the square of the residual (Kato and Temple) would
//! need to know an interval around θ that holds no second eigenvalue, which takes an inertia count; it is not claimed here. Ritz
//! values are besides upper bounds: the k-th exact eigenvalue is at most the k-th Ritz value. Rounding in the evaluation of `r` is
//! not enclosed.

use rayon::prelude::*;

use crate::algebra::{DenseMatrix, LIFT_WIDTH, MassMatrix, RowLifter, SparseMatrix, compact_order, vectorized};
use crate::basis::Certificate;
use crate::monitor::{Cancelled, Monitor};
use crate::operator::EigenProblem;

/// Why pairs were not certified.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CertificateError {
    /// Sizes do not fit each other.
    #[error(
        "{values} Ritz values, coefficients of {rows}×{columns}, a space of {vertices}×{dimension} and a problem of size {size} do \
         not fit"
    )]
    Shape {
        /// Ritz values.
        values: usize,
        /// Rows of the coefficients.
        rows: usize,
        /// Columns of the coefficients.
        columns: usize,
        /// Rows of the space.
        vertices: usize,
        /// Columns of the space.
        dimension: usize,
        /// Size of the problem.
        size: usize,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Up to this Ritz value (unit area) a pair counts as one of the kernel, whose relative residual (4.6) would compare rounding errors.
pub const KERNEL: f64 = 1e-6;

/// Rows of a compact block; with its rim and 32 columns it fits the second-level cache.
const ROWS_PER_BLOCK: usize = 512;

/// Sums over blocks are formed in this many groups, whatever the number of threads.
const GROUPS: usize = 128;

/// Certifies `m` Ritz pairs and turns each so that its lifted vector's entry of largest magnitude is positive.
///
/// `space` is `U`, `n × d`; `reduced_mass` is `UᵀMU`, `d × d`; `coefficients` are `φ̄`, `d × m`, orthonormal for it; `ritz` are the values on
/// unit area, ascending. Residuals and norms are computed on the fine mesh, block by block, without ever lifting more than a
/// few hundred rows. The orthonormality defect is the largest entry of `|φ̄ᵀ(UᵀMU)φ̄ − I|`, which is the fine mesh's inner
/// product, and of `|xᵀMx − 1|` over the lifted vectors. Bounds are in the units of the input.
///
/// For a consistent mass the norm `‖r‖_{M⁻¹}` is bounded by twice that of the lumped mass, since on every face the smallest eigenvalue of the
/// consistent mass is a quarter of the lumped one.
///
/// # Errors
/// [`CertificateError`]: sizes that do not fit, or the work was cancelled.
pub fn certify(
    problem: &EigenProblem,
    space: &SparseMatrix<f32>,
    reduced_mass: &SparseMatrix,
    coefficients: &mut DenseMatrix,
    ritz: &[f64],
    monitor: &dyn Monitor,
) -> Result<Certificate, CertificateError> {
    let (n, d, m) = (space.rows(), space.columns(), coefficients.columns());
    let misfit = CertificateError::Shape {
        values: ritz.len(),
        rows: coefficients.rows(),
        columns: m,
        vertices: n,
        dimension: d,
        size: problem.stiffness.rows(),
    };
    let fits = problem.stiffness.rows() == n
        && problem.stiffness.columns() == n
        && problem.mass.size() == n
        && coefficients.rows() == d
        && ritz.len() == m
        && (reduced_mass.rows(), reduced_mass.columns()) == (d, d);
    let lifter = RowLifter::new(space, coefficients).filter(|_| fits).ok_or(misfit)?;
    let sums = sums_over_mesh(problem, space, &lifter, ritz, monitor)?;
    let stiffness_norm = infinity_norm(&problem.stiffness);
    let factor = match problem.mass {
        MassMatrix::Diagonal(_) => 1.0,
        MassMatrix::Sparse(_) => 2.0,
    };
    let mut certificate =
        Certificate { residuals: Vec::with_capacity(m), bounds: Vec::with_capacity(m), ..Default::default() };
    for (k, (sum, &theta)) in sums.iter().zip(ritz).enumerate() {
        let residual = if theta.abs() <= KERNEL {
            ratio(sum.stiffness.sqrt(), stiffness_norm * sum.square.sqrt())
        } else {
            ratio(sum.residual.sqrt(), sum.stiffness.sqrt())
        };
        certificate.residuals.push(residual);
        certificate.bounds.push(factor * ratio(sum.dual.sqrt(), sum.mass.sqrt()) / problem.area);
        if sum.lowest < -sum.highest {
            coefficients.column_mut(k).iter_mut().for_each(|x| *x = -*x);
        }
    }
    monitor.checkpoint()?;
    let lifted = sums.iter().map(|sum| (sum.mass - 1.0).abs()).fold(0.0, f64::max);
    certificate.orthonormality_defect = gram_defect(reduced_mass, coefficients).ok_or(misfit)?.max(lifted);
    Ok(certificate)
}

/// A quotient of non-negative numbers; nothing over nothing is nothing.
fn ratio(part: f64, whole: f64) -> f64 {
    if part == 0.0 { 0.0 } else { part / whole }
}

fn infinity_norm(matrix: &SparseMatrix) -> f64 {
    (0..matrix.rows())
        .into_par_iter()
        .map(|row| matrix.row(row).1.iter().map(|v| v.abs()).sum::<f64>())
        .reduce(|| 0.0, f64::max)
}

/// What is summed over the vertices for one pair.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// `‖S x − θ M x‖²`
    residual: f64,
    /// The same in the inverse lumped mass.
    dual: f64,
    /// `‖S x‖²`
    stiffness: f64,
    /// `‖x‖²`
    square: f64,
    /// `xᵀ M x`
    mass: f64,
    /// The least and the greatest entry of `x`.
    lowest: f64,
    highest: f64,
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.residual += other.residual;
        self.dual += other.dual;
        self.stiffness += other.stiffness;
        self.square += other.square;
        self.mass += other.mass;
        self.lowest = self.lowest.min(other.lowest);
        self.highest = self.highest.max(other.highest);
    }
}

fn sums_over_mesh(
    problem: &EigenProblem,
    space: &SparseMatrix<f32>,
    lifter: &RowLifter<'_>,
    ritz: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<Sums>, Cancelled> {
    let (n, m) = (space.rows(), ritz.len());
    let lumped = problem.mass.lumped();
    let order = compact_order(&problem.stiffness, ROWS_PER_BLOCK);
    let blocks: Vec<&[u32]> = order.chunks(ROWS_PER_BLOCK).collect();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let groups: Result<Vec<Vec<Sums>>, Cancelled> = blocks
        .par_chunks(blocks.len().div_ceil(GROUPS).max(1))
        .map_init(
            || Workspace::new(n),
            |workspace, group| {
                let mut sums = vec![Sums::default(); m];
                for block in group {
                    workspace.gather(problem, block);
                    for from in (0..m).step_by(WIDTH) {
                        monitor.checkpoint()?;
                        let columns = from..m.min(from + WIDTH);
                        workspace.add_sums(problem, lifter, &lumped, &ritz[columns.clone()], from, &mut sums[columns]);
                    }
                    let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                    monitor.progress(done as f64 / blocks.len() as f64);
                }
                Ok(sums)
            },
        )
        .collect();
    let mut total = vec![Sums::default(); m];
    for group in groups? {
        total.iter_mut().zip(&group).for_each(|(total, sum)| total.add(sum));
    }
    Ok(total)
}

/// Columns that are worked on at once.
const WIDTH: usize = LIFT_WIDTH;

/// What one thread needs for a block of rows.
struct Workspace {
    /// Position of a vertex among `rows`, or `u32::MAX`.
    position: Vec<u32>,
    /// First the rows of the block, then its rim.
    rows: Vec<u32>,
    own: usize,
    /// Lifted rows, `WIDTH` numbers each.
    lifted: Vec<[f64; WIDTH]>,
}

impl Workspace {
    fn new(n: usize) -> Self {
        Self { position: vec![u32::MAX; n], rows: Vec::new(), own: 0, lifted: Vec::new() }
    }

    fn gather(&mut self, problem: &EigenProblem, block: &[u32]) {
        for &row in &self.rows {
            self.position[row as usize] = u32::MAX;
        }
        self.rows.clear();
        self.rows.extend_from_slice(block);
        self.own = block.len();
        for (at, &row) in block.iter().enumerate() {
            self.position[row as usize] = at as u32;
        }
        for &row in block {
            self.gather_neighbours(problem.stiffness.row(row as usize).0);
            if let MassMatrix::Sparse(mass) = &problem.mass {
                self.gather_neighbours(mass.row(row as usize).0);
            }
        }
        self.lifted.resize(self.rows.len(), [0.0; WIDTH]);
    }

    fn gather_neighbours(&mut self, neighbours: &[u32]) {
        for &neighbour in neighbours {
            let position = &mut self.position[neighbour as usize];
            if *position == u32::MAX {
                *position = self.rows.len() as u32;
                self.rows.push(neighbour);
            }
        }
    }

    /// Adds the share of this block in the sums of the pairs from `from` on.
    fn add_sums(
        &mut self,
        problem: &EigenProblem,
        lifter: &RowLifter<'_>,
        lumped: &[f64],
        ritz: &[f64],
        from: usize,
        sums: &mut [Sums],
    ) {
        lifter.lift(&self.rows, from / WIDTH, &mut self.lifted);
        let mut theta = [0.0; WIDTH];
        theta[..ritz.len()].copy_from_slice(ritz);
        let mut parts = [[0.0; WIDTH]; 5];
        let (mut lowest, mut highest) = ([0.0; WIDTH], [0.0; WIDTH]);
        vectorized(
            (&mut parts, &mut lowest, &mut highest),
            #[inline(always)]
            |(parts, lowest, highest)| {
                // Four rows at a time, so that sums are loaded and stored a quarter as often.
                for (rows, x) in self.rows[..self.own].chunks(BATCH).zip(self.lifted.chunks(BATCH)) {
                    let mut sx = [[0.0; WIDTH]; BATCH];
                    let mut mx = [[0.0; WIDTH]; BATCH];
                    let mut inverse = [0.0; BATCH];
                    for (at, &row) in rows.iter().enumerate() {
                        let row = row as usize;
                        sx[at] = self.combine(problem.stiffness.row(row));
                        mx[at] = match &problem.mass {
                            MassMatrix::Diagonal(mass) => x[at].map(|x| mass[row] * x),
                            MassMatrix::Sparse(mass) => self.combine(mass.row(row)),
                        };
                        inverse[at] = 1.0 / lumped[row];
                    }
                    // A last batch that is not full is filled with zeros, which add nothing.
                    let mut padded = [[0.0; WIDTH]; BATCH];
                    padded.iter_mut().zip(&x[..rows.len()]).for_each(|(to, from)| *to = *from);
                    add_batch(&padded, &sx, &mx, &inverse, &theta, parts, lowest, highest);
                }
            },
        );
        for (k, sum) in sums.iter_mut().enumerate() {
            sum.add(&Sums {
                residual: parts[0][k],
                dual: parts[1][k],
                stiffness: parts[2][k],
                square: parts[3][k],
                mass: parts[4][k],
                lowest: lowest[k],
                highest: highest[k],
            });
        }
    }

    #[inline(always)]
    fn combine(&self, (columns, weights): (&[u32], &[f64])) -> [f64; WIDTH] {
        let mut acc = [0.0; WIDTH];
        for (&column, &weight) in columns.iter().zip(weights) {
            let x = &self.lifted[self.position[column as usize] as usize];
            for k in 0..WIDTH {
                acc[k] += weight * x[k];
            }
        }
        acc
    }
}

/// Rows whose sums are formed together.
const BATCH: usize = 4;

/// Adds what a batch of rows contributes to the sums of each column.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn add_batch(
    x: &[[f64; WIDTH]; BATCH],
    sx: &[[f64; WIDTH]; BATCH],
    mx: &[[f64; WIDTH]; BATCH],
    inverse: &[f64; BATCH],
    theta: &[f64; WIDTH],
    parts: &mut [[f64; WIDTH]; 5],
    lowest: &mut [f64; WIDTH],
    highest: &mut [f64; WIDTH],
) {
    for k in 0..WIDTH {
        let mut sums = [0.0; 5];
        let (mut low, mut high) = (lowest[k], highest[k]);
        for at in 0..BATCH {
            let (x, sx, mx) = (x[at][k], sx[at][k], mx[at][k]);
            let r = sx - theta[k] * mx;
            let square = r * r;
            sums[0] += square;
            sums[1] += square * inverse[at];
            sums[2] += sx * sx;
            sums[3] += x * x;
            sums[4] += x * mx;
            low = if x < low { x } else { low };
            high = if x > high { x } else { high };
        }
        for (part, sum) in parts.iter_mut().zip(sums) {
            part[k] += sum;
        }
        (lowest[k], highest[k]) = (low, high);
    }
}

/// The largest entry of `|φ̄ᵀ M̄ φ̄ − I|`; `None` where sizes do not fit.
fn gram_defect(mass: &SparseMatrix, coefficients: &DenseMatrix) -> Option<f64> {
    let gram = coefficients.transposed_times(&mass.multiply_dense(coefficients)?)?;
    let mut worst = 0.0f64;
    for j in 0..gram.columns() {
        for (i, value) in gram.column(j).iter().enumerate() {
            worst = worst.max((value - if i == j { 1.0 } else { 0.0 }).abs());
        }
    }
    Some(worst)
}

#[cfg(test)]
#[path = "certificate_tests.rs"]
mod tests;
