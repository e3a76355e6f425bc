//! An algebraic multigrid cycle for `S + σM`, any σ > 0, on sixteen right-hand sides at once, in single precision.
//!
//! Smoothed aggregation (Vaněk, Mandel and Brezina 1996): vertices are gathered into aggregates of strongly connected neighbours, the
//! piecewise constant prolongation is smoothed once, coarse matrices are the restrictions `PᵀSP`, semi-definite like `S` itself. The
//! smoother is a Chebyshev polynomial of the matrix scaled by its absolute row sums, which bound its spectrum whatever the mesh. The
//! coarsest level is diagonalised once, so that σ may differ from call to call. The cycle is symmetric and positive definite: fit to
//! precondition conjugate gradients.

use super::{CpuSolver, DenseMatrix, EigenError, GalerkinError, MassMatrix, SparseMatrix, SymmetricDefiniteSolver};
use super::{galerkin, vectorized};
use chladni_base::{Cancelled, Monitor};

/// Right-hand sides of a panel.
pub const CYCLE_WIDTH: usize = 16;

/// A row of a panel of right-hand sides.
pub type CycleRow = [f32; CYCLE_WIDTH];

/// A level of at most so many unknowns is diagonalised.
const COARSEST: usize = 160;

/// Levels at most; a level that shrinks by less than a quarter is the last.
const MOST_LEVELS: usize = 12;

/// Entries below this share of the geometric mean of the two diagonals connect weakly.
const STRENGTH: f64 = 0.08;

/// How far the prolongation is smoothed, in multiples of the diagonal.
const DAMPING: f64 = 0.66;

/// The degree of the smoother before and after the coarse correction, and the share of the spectrum that it leaves to the coarse
/// level. Degree 3 costs half more and gains as much as half a cycle.
const DEGREE: usize = 2;
const LEFT_TO_COARSE: f32 = 0.12;

/// The middle and the half width of the interval that the smoother damps.
const MIDDLE: f32 = 0.5 * (1.0 + LEFT_TO_COARSE);
const HALF: f32 = 0.5 * (1.0 - LEFT_TO_COARSE);

/// Smoothing steps on the last level where it is too large to be diagonalised.
const LAST_DEGREE: usize = 8;

/// The hierarchy for one pencil `(S, M)`.
#[derive(Debug)]
pub struct Multigrid {
    levels: Vec<Level>,
    coarsest: Option<Coarsest>,
}

#[derive(Debug)]
struct Level {
    matrix: Rows,
    /// The absolute row sums of `S`.
    sums: Vec<f32>,
    /// The lumped mass.
    mass: Vec<f32>,
    /// From the next level to this one; none on the last.
    prolongation: Option<Rows>,
}

/// Rows of a sparse matrix, in single precision.
#[derive(Debug)]
struct Rows {
    offsets: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

/// `S = Wᵀ Λ W`, `M = WᵀW`: `values` are Λ, `vectors` the columns of `W⁻¹`, row after row.
#[derive(Debug)]
struct Coarsest {
    values: Vec<f32>,
    vectors: Vec<f32>,
}

/// What one panel needs on every level; one for each thread.
#[derive(Debug)]
pub struct CycleWorkspace {
    levels: Vec<Buffers>,
    reduced: Vec<CycleRow>,
}

#[derive(Debug)]
struct Buffers {
    right: Vec<CycleRow>,
    x: Vec<CycleRow>,
    before: Vec<CycleRow>,
}

/// Why there is no hierarchy.
#[derive(Debug, thiserror::Error)]
pub enum MultigridError {
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A coarse matrix could not be formed.
    #[error(transparent)]
    Restrict(GalerkinError),
    /// The coarsest level could not be diagonalised.
    #[error(transparent)]
    Coarsest(EigenError),
}

impl From<GalerkinError> for MultigridError {
    fn from(error: GalerkinError) -> Self {
        match error {
            GalerkinError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Restrict(other),
        }
    }
}

impl From<EigenError> for MultigridError {
    fn from(error: EigenError) -> Self {
        match error {
            EigenError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Coarsest(other),
        }
    }
}

impl Multigrid {
    /// The hierarchy of a positive semi-definite `stiffness`, `n × n`, and `n` positive lumped `masses`.
    ///
    /// # Errors
    /// [`MultigridError`]: masses that are not positive, or cancellation.
    ///
    /// # Panics
    /// Where `masses` has another length than the matrix rows.
    pub fn new(stiffness: &SparseMatrix, masses: &[f64], monitor: &dyn Monitor) -> Result<Self, MultigridError> {
        assert_eq!(stiffness.rows(), masses.len(), "a mass for each row");
        let mut levels = vec![Level::new(stiffness, masses)];
        let mut fine = (stiffness.clone(), masses.to_vec());
        while fine.1.len() > COARSEST && levels.len() < MOST_LEVELS {
            monitor.checkpoint()?;
            let prolongation = prolongation(&fine.0);
            if 4 * prolongation.columns() > 3 * fine.1.len() || prolongation.columns() == 0 {
                break;
            }
            let (coarse, mass) = galerkin(&prolongation, &fine.0, &MassMatrix::Diagonal(fine.1), monitor)?;
            let mass = MassMatrix::Sparse(mass).lumped();
            if let Some(level) = levels.last_mut() {
                level.prolongation = Some(Rows::of(&prolongation));
            }
            levels.push(Level::new(&coarse, &mass));
            fine = (coarse, mass);
        }
        let coarsest = if fine.1.len() <= COARSEST { Some(Coarsest::new(&fine.0, fine.1, monitor)?) } else { None };
        Ok(Self { levels, coarsest })
    }

    /// Unknowns of each level, the finest first.
    pub fn sizes(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.mass.len()).collect()
    }

    /// Memory for one panel at a time.
    pub fn workspace(&self) -> CycleWorkspace {
        let buffers = |level: &Level| {
            let zeros = || vec![[0.0; CYCLE_WIDTH]; level.mass.len()];
            Buffers { right: zeros(), x: zeros(), before: zeros() }
        };
        let reduced = vec![[0.0; CYCLE_WIDTH]; self.coarsest.as_ref().map_or(0, |coarsest| coarsest.values.len())];
        CycleWorkspace { levels: self.levels.iter().map(buffers).collect(), reduced }
    }

    /// An approximation of `(S + σM)⁻¹ b`, one V-cycle from zero: `n` rows. `sigma` is positive.
    ///
    /// # Panics
    /// Where `right` has another number of rows than the matrix.
    pub fn cycle<'w>(&self, sigma: f32, right: &[CycleRow], workspace: &'w mut CycleWorkspace) -> &'w [CycleRow] {
        workspace.levels[0].right.copy_from_slice(right);
        self.descend(0, sigma, &mut workspace.levels, &mut workspace.reduced);
        &workspace.levels[0].x
    }

    /// Solves level `at` approximately, from `right` into `x`.
    fn descend(&self, at: usize, sigma: f32, buffers: &mut [Buffers], reduced: &mut [CycleRow]) {
        let level = &self.levels[at];
        let Some((own, rest)) = buffers.split_first_mut() else { return };
        let Some(prolongation) = &level.prolongation else {
            match &self.coarsest {
                Some(coarsest) => coarsest.solve(sigma, &own.right, reduced, &mut own.x),
                None => {
                    level.first_step(sigma, own);
                    level.steps(sigma, 1..LAST_DEGREE, own);
                }
            }
            return;
        };
        level.first_step(sigma, own);
        level.steps(sigma, 1..DEGREE, own);
        rest[0].right.fill([0.0; CYCLE_WIDTH]);
        level.restrict_residual(sigma, prolongation, own, &mut rest[0].right);
        self.descend(at + 1, sigma, rest, reduced);
        prolongation.add_product(&rest[0].x, &mut own.x);
        level.steps(sigma, 0..DEGREE, own);
    }
}

impl Level {
    fn new(stiffness: &SparseMatrix, masses: &[f64]) -> Self {
        let sum = |row: usize| stiffness.row(row).1.iter().map(|value| value.abs()).sum::<f64>() as f32;
        Self {
            matrix: Rows::of(stiffness),
            sums: (0..masses.len()).map(sum).collect(),
            mass: masses.iter().map(|&mass| mass as f32).collect(),
            prolongation: None,
        }
    }

    /// One over the absolute sum of a row of `S + σM`.
    #[inline(always)]
    fn scale(&self, row: usize, sigma: f32) -> f32 {
        let size = self.sums[row] + sigma * self.mass[row];
        if size > 0.0 { 1.0 / size } else { 0.0 }
    }

    /// The first step of the smoother from zero.
    fn first_step(&self, sigma: f32, buffers: &mut Buffers) {
        let Buffers { right, x, .. } = buffers;
        for (row, (x, b)) in x.iter_mut().zip(right.iter()).enumerate() {
            let scale = self.scale(row, sigma) / MIDDLE;
            *x = b.map(|b| scale * b);
        }
    }

    /// Steps of the Chebyshev iteration from `x`: `x ← x + β (x − before) + γ D⁻¹ (b − A x)`, one pass each. Step 0 looks at no `before`; where the
    /// iteration began with [`first_step`](Self::first_step), that was zero at step 1.
    fn steps(&self, sigma: f32, range: std::ops::Range<usize>, buffers: &mut Buffers) {
        let mut rho = HALF / MIDDLE;
        let first = range.start;
        for step in 0..range.end {
            let (beta, gamma) = if step == 0 {
                (0.0, 1.0 / MIDDLE)
            } else {
                let next = 1.0 / (2.0 * MIDDLE / HALF - rho);
                let factors = (next * rho, 2.0 * next / HALF);
                rho = next;
                factors
            };
            if step < first {
                continue;
            }
            let Buffers { right, x, before } = &mut *buffers;
            let from_zero = step == 1 && first == 1;
            let fresh = step == 0 || from_zero;
            vectorized(
                &mut *before,
                #[inline(always)]
                |before: &mut Vec<CycleRow>| {
                    for (row, before) in before.iter_mut().enumerate() {
                        let image = self.image(row, sigma, x);
                        let (own, b, scale) = (&x[row], &right[row], gamma * self.scale(row, sigma));
                        for k in 0..CYCLE_WIDTH {
                            let old = if fresh { 0.0 } else { beta * before[k] };
                            let kept = own[k] + beta * own[k] - old;
                            before[k] = scale.mul_add(b[k] - image[k], kept);
                        }
                    }
                },
            );
            std::mem::swap(x, before);
        }
    }

    /// Row `row` of `(S + σM) x`.
    #[inline(always)]
    fn image(&self, row: usize, sigma: f32, x: &[CycleRow]) -> CycleRow {
        let (own, mass) = (&x[row], sigma * self.mass[row]);
        let mut sum: CycleRow = std::array::from_fn(|k| mass * own[k]);
        for &(column, value) in self.matrix.row(row) {
            let x = &x[column as usize];
            for k in 0..CYCLE_WIDTH {
                sum[k] = value.mul_add(x[k], sum[k]);
            }
        }
        sum
    }

    /// Adds `Pᵀ (b − A x)` to `out`.
    fn restrict_residual(&self, sigma: f32, prolongation: &Rows, buffers: &Buffers, out: &mut [CycleRow]) {
        let Buffers { right, x, .. } = buffers;
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, b) in right.iter().enumerate() {
                    let image = self.image(row, sigma, x);
                    let residual: CycleRow = std::array::from_fn(|k| b[k] - image[k]);
                    for &(column, value) in prolongation.row(row) {
                        let out = &mut out[column as usize];
                        for k in 0..CYCLE_WIDTH {
                            out[k] = value.mul_add(residual[k], out[k]);
                        }
                    }
                }
            },
        );
    }
}

impl Rows {
    fn of<T: Copy + Into<f64>>(matrix: &SparseMatrix<T>) -> Self {
        Self {
            offsets: matrix.offsets().iter().map(|&offset| offset as u32).collect(),
            entries: matrix
                .indices()
                .iter()
                .zip(matrix.values())
                .map(|(&column, &value)| (column, value.into() as f32))
                .collect(),
        }
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[(u32, f32)] {
        &self.entries[self.offsets[row] as usize..self.offsets[row + 1] as usize]
    }

    /// `out += A x`.
    fn add_product(&self, x: &[CycleRow], out: &mut [CycleRow]) {
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, out) in out.iter_mut().enumerate() {
                    for &(column, value) in self.row(row) {
                        let x = &x[column as usize];
                        for k in 0..CYCLE_WIDTH {
                            out[k] = value.mul_add(x[k], out[k]);
                        }
                    }
                }
            },
        );
    }
}

impl Coarsest {
    fn new(stiffness: &SparseMatrix, masses: Vec<f64>, monitor: &dyn Monitor) -> Result<Self, EigenError> {
        let n = masses.len();
        let mut mass = DenseMatrix::zeros(n, n);
        for (k, &m) in masses.iter().enumerate() {
            mass.column_mut(k)[k] = m;
        }
        let pairs = CpuSolver.lowest(stiffness.to_dense(), mass, n, monitor)?;
        let mut vectors = vec![0.0; n * n];
        for k in 0..n {
            for (row, &x) in pairs.vectors.column(k).iter().enumerate() {
                vectors[row * n + k] = x as f32;
            }
        }
        Ok(Self { values: pairs.values.iter().map(|&value| value.max(0.0) as f32).collect(), vectors })
    }

    /// `x = V (Λ + σ)⁻¹ Vᵀ b`.
    fn solve(&self, sigma: f32, right: &[CycleRow], reduced: &mut [CycleRow], x: &mut [CycleRow]) {
        let n = self.values.len().max(1);
        vectorized(
            (reduced, x),
            #[inline(always)]
            |(reduced, x)| {
                reduced.fill([0.0; CYCLE_WIDTH]);
                for (vector, b) in self.vectors.chunks_exact(n).zip(right) {
                    for (&v, sum) in vector.iter().zip(reduced.iter_mut()) {
                        for k in 0..CYCLE_WIDTH {
                            sum[k] = v.mul_add(b[k], sum[k]);
                        }
                    }
                }
                for (row, value) in reduced.iter_mut().zip(&self.values) {
                    row.iter_mut().for_each(|c| *c /= value + sigma);
                }
                for (vector, x) in self.vectors.chunks_exact(n).zip(x.iter_mut()) {
                    let mut sum = [0f32; CYCLE_WIDTH];
                    for (&v, c) in vector.iter().zip(reduced.iter()) {
                        for k in 0..CYCLE_WIDTH {
                            sum[k] = v.mul_add(c[k], sum[k]);
                        }
                    }
                    *x = sum;
                }
            },
        );
    }
}

/// `P = (I − ω D⁻¹ S̃) T` from aggregates to rows: `T` is 1 where a row belongs to an aggregate, `S̃` is `S` with weak connections put
/// on the diagonal.
fn prolongation(stiffness: &SparseMatrix) -> SparseMatrix<f32> {
    let n = stiffness.rows();
    let diagonal: Vec<f64> = (0..n)
        .map(|row| {
            let (columns, values) = stiffness.row(row);
            columns.binary_search(&(row as u32)).map_or(0.0, |at| values[at])
        })
        .collect();
    let strong = |row: usize, column: u32, value: f64| {
        let size = diagonal[row] * diagonal[column as usize];
        column as usize != row && value < 0.0 && size > 0.0 && value * value > STRENGTH * STRENGTH * size
    };
    let (aggregates, count) = aggregate(stiffness, &strong);
    let mut offsets = Vec::with_capacity(n + 1);
    let (mut indices, mut values) = (Vec::with_capacity(3 * n), Vec::with_capacity(3 * n));
    let mut row_entries: Vec<(u32, f64)> = Vec::new();
    offsets.push(0);
    for row in 0..n {
        row_entries.clear();
        let own = aggregates[row];
        if own != NONE {
            row_entries.push((own, 1.0));
            let (columns, entries) = stiffness.row(row);
            let kept: f64 = columns.iter().zip(entries).filter(|&(&c, &v)| strong(row, c, v)).map(|(_, v)| v).sum();
            // Rows of S̃ sum to what rows of S do, nearly zero, so the diagonal is minus the sum of the rest.
            let scale = if kept < 0.0 { DAMPING / -kept } else { 0.0 };
            for (&column, &value) in columns.iter().zip(entries) {
                let other = aggregates[column as usize];
                if strong(row, column, value) && other != own && other != NONE {
                    let share = -scale * value;
                    row_entries[0].1 -= share;
                    match row_entries[1..].iter_mut().find(|entry| entry.0 == other) {
                        Some(entry) => entry.1 += share,
                        None => row_entries.push((other, share)),
                    }
                }
            }
            row_entries.sort_unstable_by_key(|entry| entry.0);
        }
        indices.extend(row_entries.iter().map(|entry| entry.0));
        values.extend(row_entries.iter().map(|entry| entry.1 as f32));
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(n, count, offsets, indices, values)
}

/// A row of no aggregate: nothing connects it strongly, and the smoother is all it needs.
const NONE: u32 = u32::MAX;

/// Gathers rows: first around rows that lie apart, then what is left joins the neighbour it is connected to most.
fn aggregate(stiffness: &SparseMatrix, strong: &impl Fn(usize, u32, f64) -> bool) -> (Vec<u32>, usize) {
    let n = stiffness.rows();
    let mut aggregates = vec![NONE; n];
    let mut count = 0u32;
    for row in 0..n {
        let (columns, values) = stiffness.row(row);
        let neighbours = || columns.iter().zip(values).filter(|&(&c, &v)| strong(row, c, v)).map(|(&c, _)| c);
        let free = aggregates[row] == NONE && neighbours().all(|c| aggregates[c as usize] == NONE);
        if free && neighbours().next().is_some() {
            aggregates[row] = count;
            neighbours().for_each(|c| aggregates[c as usize] = count);
            count += 1;
        }
    }
    let roots = aggregates.clone();
    for row in (0..n).filter(|&row| roots[row] == NONE) {
        let (columns, values) = stiffness.row(row);
        let joined = columns
            .iter()
            .zip(values)
            .filter(|&(&c, &v)| strong(row, c, v) && roots[c as usize] != NONE)
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((&column, _)) = joined {
            aggregates[row] = roots[column as usize];
        }
    }
    (aggregates, count as usize)
}

#[cfg(test)]
#[path = "multigrid_tests.rs"]
mod tests;
