//! An algebraic multigrid cycle for `S + σM`, any σ > 0, on sixteen right-hand sides at once, in single precision.
//!
//! Smoothed aggregation (Vaněk, Mandel and Brezina 1996): vertices are gathered into aggregates of strongly connected neighbours, the
//! piecewise constant prolongation is smoothed once, coarse matrices are the restrictions `PᵀSP`, semi-definite like `S` itself. The
//! smoother is a Chebyshev polynomial of the matrix scaled by its absolute row sums, which bound its spectrum whatever the mesh. The
//! coarsest level is diagonalised once, so that σ may differ from call to call.
//!
//! On the finest level a panel exceeds the cache, and time is memory traffic: each patch of rows is taken through all smoothing steps at once, with
//! rings of neighbours around it. Steps cost little there, and most of them come last: what a cycle leaves is measured in the norm of the inverse
//! mass, in which the highest frequencies weigh most, the more so the finer the mesh. So the cycle is not symmetric, and no preconditioner for
//! conjugate gradients.

mod aggregate;
mod coarsest;
mod restrict;

use std::ops::Range;

use self::aggregate::prolongation;
use self::coarsest::Coarsest;
use self::restrict::restricted;
use super::patches::{RINGS, SparseRows, patches};
use super::{EigenError, MassMatrix, Patch, SparseMatrix, vectorized};
use chladni_base::{Cancelled, Monitor};

/// Right-hand sides of a panel.
pub const CYCLE_WIDTH: usize = 16;

/// A row of a panel of right-hand sides.
pub type CycleRow = [f32; CYCLE_WIDTH];

/// A level of at most so many unknowns is diagonalised.
const COARSEST: usize = 160;

/// Levels at most; a level that shrinks by less than a quarter is the last.
const MOST_LEVELS: usize = 12;

/// The degree of the smoother before and after the coarse correction on the matrix itself. Bounds of 500 approximate pairs after one cycle, in
/// percent of the value on average: igea with 134,345 vertices 6.3 with degrees 2 and 2, 4.6 with 2 and 3, 3.9 with 1 and 5, 3.6 with 1 and 7;
/// subdivided once, 7.2 with 2 and 3, 5.4 with 1 and 5, 5.0 with 1 and 7, and with 2 and 2 not close enough, so that a second cycle was due;
/// subdivided twice, a third.
const BEFORE: usize = 1;
const AFTER: usize = 5;

/// The same on coarser levels: estimates of errors are 4 % larger, and as much closer, than with two and two; more cycles there gain little.
const COARSE_BEFORE: usize = 2;
const COARSE_AFTER: usize = 4;

/// The share of the spectrum that the smoother leaves to the coarse level.
const LEFT_TO_COARSE: f32 = 0.12;

/// The middle and the half width of the interval that the smoother damps.
const MIDDLE: f32 = 0.5 * (1.0 + LEFT_TO_COARSE);
const HALF: f32 = 0.5 * (1.0 - LEFT_TO_COARSE);

/// Smoothing steps on the last level where it is too large to be diagonalised.
const LAST_DEGREE: usize = 8;

/// The hierarchy for one pencil `(S, M)`.
#[derive(Debug)]
pub struct Multigrid {
    patches: Vec<Patch>,
    /// From what is solved by levels to the matrix itself; none where the matrix itself is.
    finest: Option<Finest>,
    levels: Vec<Level>,
    coarsest: Option<Coarsest>,
}

/// The matrix itself, whose panels exceed the cache: it is smoothed patch by patch.
#[derive(Debug)]
struct Finest {
    diagonal: Diagonal,
    prolongation: SparseRows,
}

#[derive(Debug)]
struct Level {
    matrix: SparseRows,
    diagonal: Diagonal,
    /// From the next level to this one; none on the last.
    prolongation: Option<SparseRows>,
}

/// What smoothing needs to know of a row.
#[derive(Debug)]
struct Diagonal {
    /// The absolute row sums of `S + cM`.
    sums: Vec<f32>,
    /// The lumped mass.
    mass: Vec<f32>,
    /// The share of the mass that `sums` holds and the matrix does not.
    floor: f32,
}

/// What one panel needs on every level; one for each thread.
#[derive(Debug)]
pub struct CycleWorkspace {
    /// The smoothed panel on the finest level.
    smoothed: Vec<CycleRow>,
    /// A patch with its rings.
    patch: Buffers,
    levels: Vec<Buffers>,
    reduced: Vec<CycleRow>,
}

#[derive(Debug, Default)]
struct Buffers {
    right: Vec<CycleRow>,
    x: Vec<CycleRow>,
    before: Vec<CycleRow>,
    factors: Vec<Factors>,
}

/// What a row is scaled by in the smoother, one over the absolute sum of `S + σM`, and its own multiple of `M`.
#[derive(Debug, Clone, Copy, Default)]
struct Factors {
    scale: f32,
    mass: f32,
}

/// Why there is no hierarchy.
#[derive(Debug, thiserror::Error)]
pub enum MultigridError {
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The coarsest level could not be diagonalised.
    #[error(transparent)]
    Coarsest(EigenError),
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
    /// The hierarchy of `S + cM`, `n × n` and positive semi-definite; `S` is `stiffness`, its rows in a compact order
    /// ([`compact_order`](super::compact_order) with [`PATCH_ROWS`](super::PATCH_ROWS)), `c` is `floor`, `M` the lumped `mass`, positive.
    ///
    /// # Errors
    /// [`MultigridError`]: masses that are not positive, or cancellation.
    ///
    /// # Panics
    /// Where `mass` has another size than `stiffness`.
    pub fn new(
        stiffness: &SparseMatrix,
        mass: &MassMatrix,
        floor: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, MultigridError> {
        let lumped = mass.lumped();
        assert_eq!(stiffness.rows(), lumped.len(), "a mass for each row");
        let mut level = (if floor > 0.0 { plus_mass(stiffness, &lumped, floor) } else { stiffness.clone() }, lumped);
        let mut finest = None;
        let mut levels: Vec<Level> = Vec::new();
        for number in 0.. {
            monitor.checkpoint()?;
            let prolongation = prolongation(&level.0);
            let last = level.1.len() <= COARSEST
                || number + 1 == MOST_LEVELS
                || 4 * prolongation.columns() > 3 * level.1.len()
                || prolongation.columns() == 0;
            let rows = (!last).then(|| SparseRows::of(&prolongation));
            if number == 0 && !last {
                let diagonal = Diagonal::of(&level.0, &level.1, floor);
                finest = rows.map(|prolongation| Finest { diagonal, prolongation });
            } else {
                let (matrix, diagonal) = (SparseRows::of(&level.0), Diagonal::of(&level.0, &level.1, 0.0));
                levels.push(Level { matrix, diagonal, prolongation: rows });
            }
            if last {
                break;
            }
            level = restricted(&prolongation, &level.0, &level.1);
        }
        let coarsest = if level.1.len() <= COARSEST { Some(Coarsest::new(&level.0, level.1, monitor)?) } else { None };
        Ok(Self { patches: patches(stiffness, mass), finest, levels, coarsest })
    }

    /// The matrix in patches.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// Unknowns of each level, the finest first.
    pub fn sizes(&self) -> Vec<usize> {
        let finest = self.finest.iter().map(|finest| finest.diagonal.mass.len());
        finest.chain(self.levels.iter().map(|level| level.diagonal.mass.len())).collect()
    }

    /// Memory for one panel at a time.
    pub fn workspace(&self) -> CycleWorkspace {
        let zeros = |n| vec![[0.0; CYCLE_WIDTH]; n];
        let buffers = |level: &Level| {
            let n = level.diagonal.mass.len();
            let factors = vec![Factors::default(); n];
            Buffers { right: zeros(n), x: zeros(n), before: zeros(n), factors }
        };
        CycleWorkspace {
            smoothed: zeros(self.finest.as_ref().map_or(0, |finest| finest.diagonal.mass.len())),
            patch: Buffers::default(),
            levels: self.levels.iter().map(buffers).collect(),
            reduced: zeros(self.coarsest.as_ref().map_or(0, |coarsest| coarsest.values.len())),
        }
    }

    /// `y`, an approximation of `(S + (c + σ) M)⁻¹ b`: one V-cycle from zero. `sigma` is positive, `right` holds `b`. Calls `visit` for each patch in
    /// turn with `y` on the patch and its first ring.
    ///
    /// # Panics
    /// Where `right` has another number of rows than the matrix.
    pub fn cycle(
        &self,
        sigma: f32,
        right: &[CycleRow],
        workspace: &mut CycleWorkspace,
        mut visit: impl FnMut(&Patch, &[CycleRow]),
    ) {
        let CycleWorkspace { smoothed, patch: local, levels, reduced } = workspace;
        assert_eq!(right.len(), self.patches.last().map_or(0, |patch| patch.rows().end), "a row for each unknown");
        let Some(finest) = &self.finest else {
            levels[0].right.copy_from_slice(right);
            self.descend(0, sigma, levels, reduced);
            for patch in &self.patches {
                local.gather(patch, 1, &levels[0].x);
                visit(patch, &local.x);
            }
            return;
        };
        levels[0].right.fill([0.0; CYCLE_WIDTH]);
        for patch in &self.patches {
            finest.down(patch, sigma, right, local, smoothed, &mut levels[0].right);
        }
        self.descend(0, sigma, levels, reduced);
        for patch in &self.patches {
            finest.up(patch, sigma, right, local, smoothed, &levels[0].x);
            visit(patch, &local.x[..patch.vertices(1).len()]);
        }
    }

    /// Solves level `at` approximately, from `right` into `x`.
    fn descend(&self, at: usize, sigma: f32, buffers: &mut [Buffers], reduced: &mut [CycleRow]) {
        let level = &self.levels[at];
        let n = level.diagonal.mass.len();
        let Some((own, rest)) = buffers.split_first_mut() else { return };
        for (row, factors) in own.factors.iter_mut().enumerate() {
            *factors = level.diagonal.factors(row, sigma);
        }
        let Some(prolongation) = &level.prolongation else {
            match &self.coarsest {
                Some(coarsest) => coarsest.solve(sigma, &own.right, reduced, &mut own.x),
                None => {
                    own.first_step(n);
                    own.steps(&level.matrix, 1..LAST_DEGREE, |_| n);
                }
            }
            return;
        };
        own.first_step(n);
        own.steps(&level.matrix, 1..COARSE_BEFORE, |_| n);
        rest[0].right.fill([0.0; CYCLE_WIDTH]);
        own.restrict_residual(&level.matrix, prolongation, 0..n, &mut rest[0].right);
        self.descend(at + 1, sigma, rest, reduced);
        vectorized(
            &mut own.x,
            #[inline(always)]
            |x: &mut Vec<CycleRow>| {
                for (row, x) in x.iter_mut().enumerate() {
                    add_product(prolongation.row(row), &rest[0].x, x);
                }
            },
        );
        own.steps(&level.matrix, 0..COARSE_AFTER, |_| n);
    }
}

impl Finest {
    /// Smooths from zero on a patch, and adds what remains to the right-hand side of the level below.
    fn down(
        &self,
        patch: &Patch,
        sigma: f32,
        right: &[CycleRow],
        local: &mut Buffers,
        smoothed: &mut [CycleRow],
        coarse: &mut [CycleRow],
    ) {
        let ends: [usize; BEFORE + 1] = std::array::from_fn(|rings| patch.vertices(rings).len());
        local.prepare(patch, BEFORE, sigma, &self.diagonal, right);
        local.x.resize(ends[BEFORE], [0.0; CYCLE_WIDTH]);
        local.before.resize(ends[BEFORE], [0.0; CYCLE_WIDTH]);
        local.first_step(ends[BEFORE]);
        local.steps(patch.matrix(), 1..BEFORE, |step| ends[BEFORE - step]);
        let rows = patch.rows();
        smoothed[rows.clone()].copy_from_slice(&local.x[..rows.len()]);
        local.restrict_residual(patch.matrix(), &self.prolongation, rows, coarse);
    }

    /// Adds the coarse correction on a patch and smooths: the result, in `local.x`, holds on the patch and its first ring.
    fn up(
        &self,
        patch: &Patch,
        sigma: f32,
        right: &[CycleRow],
        local: &mut Buffers,
        smoothed: &[CycleRow],
        coarse: &[CycleRow],
    ) {
        let ends: [usize; AFTER + 1] = std::array::from_fn(|rings| patch.vertices(rings).len());
        local.prepare(patch, AFTER, sigma, &self.diagonal, right);
        local.gather(patch, RINGS, smoothed);
        local.before.resize(local.x.len(), [0.0; CYCLE_WIDTH]);
        vectorized(
            &mut local.x,
            #[inline(always)]
            |x: &mut Vec<CycleRow>| {
                for (&vertex, x) in patch.vertices(RINGS).iter().zip(x) {
                    add_product(self.prolongation.row(vertex as usize), coarse, x);
                }
            },
        );
        local.steps(patch.matrix(), 0..AFTER, |step| ends[AFTER - step]);
    }
}

/// The last step of the smoother that begins on all rings leaves one.
const _: () = assert!(AFTER + 1 == RINGS && BEFORE < RINGS);

impl Diagonal {
    fn of(matrix: &SparseMatrix, masses: &[f64], floor: f64) -> Self {
        let sum = |row: usize| matrix.row(row).1.iter().map(|value| value.abs()).sum::<f64>() as f32;
        Self {
            sums: (0..masses.len()).map(sum).collect(),
            mass: masses.iter().map(|&mass| mass as f32).collect(),
            floor: floor as f32,
        }
    }

    #[inline(always)]
    fn factors(&self, row: usize, sigma: f32) -> Factors {
        let size = self.sums[row] + sigma * self.mass[row];
        let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
        Factors { scale, mass: (sigma + self.floor) * self.mass[row] }
    }
}

impl Buffers {
    /// Right-hand sides and factors of a patch and its first `rings` rings.
    fn prepare(&mut self, patch: &Patch, rings: usize, sigma: f32, diagonal: &Diagonal, right: &[CycleRow]) {
        let vertices = patch.vertices(rings);
        self.right.clear();
        self.right.extend_from_slice(&right[patch.rows()]);
        self.right.extend(vertices[patch.rows().len()..].iter().map(|&vertex| right[vertex as usize]));
        self.factors.clear();
        self.factors.extend(vertices.iter().map(|&vertex| diagonal.factors(vertex as usize, sigma)));
    }

    /// `x` on a patch and its first `rings` rings.
    fn gather(&mut self, patch: &Patch, rings: usize, x: &[CycleRow]) {
        self.x.clear();
        self.x.extend_from_slice(&x[patch.rows()]);
        self.x.extend(patch.vertices(rings)[patch.rows().len()..].iter().map(|&vertex| x[vertex as usize]));
    }

    /// The first step of the smoother from zero, on the first `rows` rows.
    fn first_step(&mut self, rows: usize) {
        for ((x, b), factors) in self.x[..rows].iter_mut().zip(&self.right).zip(&self.factors) {
            let scale = factors.scale / MIDDLE;
            *x = b.map(|b| scale * b);
        }
    }

    /// Steps of the Chebyshev iteration from `x`: `x ← x + β (x − before) + γ D⁻¹ (b − A x)`, one pass over the first `rows(step)` rows each. Step 0
    /// looks at no `before`; where the iteration began with [`first_step`](Self::first_step), that was zero at step 1.
    fn steps(&mut self, matrix: &SparseRows, range: Range<usize>, rows: impl Fn(usize) -> usize) {
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
            let Self { right, x, before, factors } = &mut *self;
            let fresh = step == 0 || (step == 1 && first == 1);
            let count = rows(step);
            let sweep = Sweep { matrix, right, factors, x, beta, gamma };
            let out = &mut before[..count];
            if fresh {
                vectorized(
                    out,
                    #[inline(always)]
                    |out| sweep.run::<true>(out),
                );
            } else {
                vectorized(
                    out,
                    #[inline(always)]
                    |out| sweep.run::<false>(out),
                );
            }
            std::mem::swap(x, before);
        }
    }

    /// Adds `Pᵀ (b − A x)` to `out`, for the rows that come first here and are `rows` of the prolongation.
    fn restrict_residual(
        &self,
        matrix: &SparseRows,
        prolongation: &SparseRows,
        rows: Range<usize>,
        out: &mut [CycleRow],
    ) {
        let Self { right, x, factors, .. } = self;
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, global) in rows.clone().enumerate() {
                    let (b, image) = (&right[row], image(matrix.row(row), factors[row].mass, &x[row], x));
                    let residual: CycleRow = std::array::from_fn(|k| b[k] - image[k]);
                    for &(column, value) in prolongation.row(global) {
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

/// One step of the Chebyshev iteration.
struct Sweep<'a> {
    matrix: &'a SparseRows,
    right: &'a [CycleRow],
    factors: &'a [Factors],
    x: &'a [CycleRow],
    beta: f32,
    gamma: f32,
}

impl Sweep<'_> {
    /// Puts the new iterate in the place of the one before, which is not looked at if `FRESH`.
    #[inline(always)]
    fn run<const FRESH: bool>(&self, before: &mut [CycleRow]) {
        let Self { matrix, right, factors, x, beta, gamma } = *self;
        for (row, ((before, b), factors)) in before.iter_mut().zip(right).zip(factors).enumerate() {
            let own = x[row];
            let image = image(matrix.row(row), factors.mass, &own, x);
            let scale = gamma * factors.scale;
            // Whole rows, not lane by lane in place: the compiler keeps each in one register.
            let mut new = [0.0; CYCLE_WIDTH];
            if FRESH {
                for k in 0..CYCLE_WIDTH {
                    new[k] = scale.mul_add(b[k] - image[k], (1.0 + beta) * own[k]);
                }
            } else {
                let old = *before;
                for k in 0..CYCLE_WIDTH {
                    let kept = (1.0 + beta) * own[k] - beta * old[k];
                    new[k] = scale.mul_add(b[k] - image[k], kept);
                }
            }
            *before = new;
        }
    }
}

/// A row of `(S + σM) x`.
#[inline(always)]
fn image(entries: &[(u32, f32)], mass: f32, own: &CycleRow, x: &[CycleRow]) -> CycleRow {
    let mut sum: CycleRow = std::array::from_fn(|k| mass * own[k]);
    add_product(entries, x, &mut sum);
    sum
}

/// `out += (row of A) x`.
#[inline(always)]
fn add_product(entries: &[(u32, f32)], x: &[CycleRow], out: &mut CycleRow) {
    for &(column, value) in entries {
        let x = &x[column as usize];
        for k in 0..CYCLE_WIDTH {
            out[k] = value.mul_add(x[k], out[k]);
        }
    }
}

/// `S + cM`, `M` lumped.
fn plus_mass(stiffness: &SparseMatrix, lumped: &[f64], shift: f64) -> SparseMatrix {
    let mut values = stiffness.values().to_vec();
    for (row, mass) in lumped.iter().enumerate() {
        let start = stiffness.offsets()[row];
        if let Ok(at) = stiffness.row(row).0.binary_search(&(row as u32)) {
            values[start + at] += shift * mass;
        }
    }
    SparseMatrix::from_sorted_parts(
        stiffness.rows(),
        stiffness.columns(),
        stiffness.offsets().to_vec(),
        stiffness.indices().to_vec(),
        values,
    )
}

#[cfg(test)]
#[path = "multigrid_tests.rs"]
mod tests;
