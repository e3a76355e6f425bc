//! An algebraic multigrid cycle for `S + σM`, any σ > 0, on sixteen right-hand sides at once, in single precision.
//!
//! Smoothed aggregation (Vaněk, Mandel and Brezina 1996): vertices are gathered into aggregates of strongly connected
//! neighbours, the piecewise constant prolongation is smoothed once, coarse matrices are the restrictions `PᵀSP`,
//! semi-definite like `S` itself. The smoother is a Chebyshev polynomial of the matrix scaled by its absolute row sums,
//! which bound its spectrum whatever the mesh. The coarsest level is diagonalised once, so that σ may differ from call
//! to call.
//!
//! On the finest level a panel exceeds the cache, and time is memory traffic: each patch of rows is taken through all
//! smoothing steps at once, with rings of neighbours around it. Steps cost little there, and most of them come last:
//! what a cycle leaves is measured in the norm of the inverse mass, in which the highest frequencies weigh most, the
//! more so the finer the mesh. So the cycle is not symmetric, and no preconditioner for conjugate gradients.

mod aggregate;
mod coarsest;
mod restrict;
mod sharing;
mod smoother;

use std::borrow::Cow;
use std::sync::OnceLock;

use chladni_base::parallel::*;

use self::aggregate::prolongation;
pub(crate) use self::coarsest::Coarsest;
use self::restrict::restricted;
use self::sharing::{SHARED_ROWS, Sharing, over_patches};
pub use self::sharing::{by_patch, zeros_by_all};
use self::smoother::{Buffers, Factors, Given, add_product, residual, restrict};
#[cfg(feature = "gpu")]
pub(crate) use self::smoother::{ChebyshevStep, FIRST_GAMMA, chebyshev};
use super::patches::{RINGS, SparseRows, patches};
use super::{EigenError, MassMatrix, Patch, SparseMatrix, vectorized};
use chladni_base::{Cancelled, Monitor, Spare, stopped};

/// Right-hand sides of a panel.
pub const CYCLE_WIDTH: usize = 16;

/// A row of a panel of right-hand sides.
pub type CycleRow = [f32; CYCLE_WIDTH];

/// A level of at most so many unknowns is diagonalised.
const COARSEST: usize = 160;

/// Levels at most; a level that shrinks by less than a quarter is the last.
const MOST_LEVELS: usize = 12;

/// The degree of the smoother before and after the coarse correction on the matrix itself. Bounds of 500 approximate
/// pairs after one cycle, in percent of the value on average: igea with 134,345 vertices 6.3 with degrees 2 and 2, 4.6
/// with 2 and 3, 3.9 with 1 and 5, 3.6 with 1 and 7; subdivided once, 7.2 with 2 and 3, 5.4 with 1 and 5, 5.0 with 1
/// and 7, and with 2 and 2 not close enough, so that a second cycle was due; subdivided twice, a third.
pub(crate) const BEFORE: usize = 1;
pub(crate) const AFTER: usize = 5;

/// The same on coarser levels: estimates of errors are 4 % larger, and as much closer, than with two and two; more
/// cycles there gain little.
pub(crate) const COARSE_BEFORE: usize = 2;
pub(crate) const COARSE_AFTER: usize = 4;

/// Smoothing steps on the last level where it is too large to be diagonalised.
pub(crate) const LAST_DEGREE: usize = 8;

/// The hierarchy for one pencil `(S, M)`.
#[derive(Debug)]
pub struct Multigrid {
    patches: Vec<Patch>,
    /// From what is solved by levels to the matrix itself; none where the matrix itself is.
    pub(crate) finest: Option<Finest>,
    pub(crate) levels: Vec<MultigridLevel>,
    pub(crate) coarsest: Option<Coarsest>,
}

/// The matrix itself, whose panels exceed the cache: it is smoothed patch by patch.
#[derive(Debug)]
pub(crate) struct Finest {
    pub(crate) diagonal: Diagonal,
    pub(crate) prolongation: SparseRows,
    restriction: OnceLock<SparseRows>,
}

#[derive(Debug)]
pub(crate) struct MultigridLevel {
    pub(crate) matrix: SparseRows,
    pub(crate) diagonal: Diagonal,
    /// From the next level to this one; none on the last.
    pub(crate) prolongation: Option<SparseRows>,
    restriction: OnceLock<SparseRows>,
}

impl MultigridLevel {
    /// The transposed prolongation, with as many rows as the next level, made when threads first share a panel.
    fn restriction(&self, prolongation: &SparseRows, rows: usize) -> &SparseRows {
        self.restriction.get_or_init(|| prolongation.transposed(rows))
    }
}

/// What smoothing needs to know of a row.
#[derive(Debug)]
pub(crate) struct Diagonal {
    /// The absolute row sums of `S + cM`.
    pub(crate) sums: Vec<f32>,
    /// The lumped mass.
    pub(crate) mass: Vec<f32>,
    /// The share of the mass that `sums` holds and the matrix does not.
    pub(crate) floor: f32,
}

/// What one panel needs on every level: one for each thread, or one that all threads share.
#[derive(Debug)]
pub struct CycleWorkspace {
    /// The factors of all rows on the finest level.
    factors: Vec<Factors>,
    /// Where threads share a panel, what is left of the right-hand side on the finest level.
    rest: Option<Vec<CycleRow>>,
    /// Patches with their rings, one for each thread.
    patches: Spare<Buffers>,
    levels: Vec<Buffers>,
    reduced: Vec<CycleRow>,
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

stopped!(MultigridError: EigenError => Self::Coarsest);

impl Multigrid {
    /// The hierarchy of `S + cM`, `n × n` and positive semi-definite; `S` is `stiffness`, its rows in a compact order
    /// ([`compact_order`](super::compact_order) with [`PATCH_ROWS`](super::PATCH_ROWS)), `c` is `floor`, `M` the lumped
    /// `mass`, positive.
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
        let finest_matrix = match floor > 0.0 {
            true => Cow::Owned(plus_mass(stiffness, &lumped, floor)),
            false => Cow::Borrowed(stiffness),
        };
        let mut level = (finest_matrix, lumped);
        let mut finest = None;
        let mut levels: Vec<MultigridLevel> = Vec::new();
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
                finest = rows.map(|prolongation| Finest { diagonal, prolongation, restriction: OnceLock::new() });
            } else {
                let (matrix, diagonal) = (SparseRows::of(&level.0), Diagonal::of(&level.0, &level.1, 0.0));
                levels.push(MultigridLevel { matrix, diagonal, prolongation: rows, restriction: OnceLock::new() });
            }
            if last {
                break;
            }
            let (matrix, masses) = restricted(&prolongation, &level.0, &level.1);
            level = (Cow::Owned(matrix), masses);
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

    /// Memory for one panel at a time, which one thread works on.
    pub fn workspace(&self) -> CycleWorkspace {
        self.workspace_of(None)
    }

    /// Memory for one panel at a time, which all threads work on together. Sums on coarse levels are in another order,
    /// and results the same up to rounding, whatever the number of threads.
    pub fn shared_workspace(&self) -> CycleWorkspace {
        let n = self.finest.as_ref().map_or(0, |finest| finest.diagonal.mass.len());
        self.workspace_of(Some(zeros_by_all(n)))
    }

    fn workspace_of(&self, rest: Option<Vec<CycleRow>>) -> CycleWorkspace {
        let zeros = |n| vec![[0.0; CYCLE_WIDTH]; n];
        let buffers = |level: &MultigridLevel| {
            let n = level.diagonal.mass.len();
            let factors = vec![Factors::default(); n];
            Buffers { right: zeros(n), x: zeros(n), before: zeros(n), factors }
        };
        CycleWorkspace {
            factors: vec![Factors::default(); self.finest.as_ref().map_or(0, |finest| finest.diagonal.mass.len())],
            rest,
            patches: Spare::default(),
            levels: self.levels.iter().map(buffers).collect(),
            reduced: zeros(self.coarsest.as_ref().map_or(0, |coarsest| coarsest.values.len())),
        }
    }

    /// `y`, an approximation of `(S + (c + σ) M)⁻¹ b`: one V-cycle from zero. `sigma` is positive, `right` holds `b`.
    /// Calls `visit` for each patch with `y` on the patch and its first ring, which may be changed, and with what
    /// `targets` have for it; the answers are in the order of the patches. In a shared workspace patches are visited by
    /// many threads at once.
    ///
    /// # Panics
    /// Where `right` has another number of rows than the matrix, or there is not a target for each patch.
    pub fn cycle<T: Send, S: Send>(
        &self,
        sigma: f32,
        right: &[CycleRow],
        workspace: &mut CycleWorkspace,
        targets: Vec<T>,
        visit: impl Fn(&Patch, &mut [CycleRow], T) -> S + Sync,
    ) -> Vec<S> {
        let CycleWorkspace { factors, rest, patches, levels, reduced } = workspace;
        assert_eq!(right.len(), self.patches.last().map_or(0, |patch| patch.rows().end), "a row for each unknown");
        assert_eq!(targets.len(), self.patches.len(), "a target for each patch");
        let sharing = if rest.is_some() { Sharing::AllThreads } else { Sharing::OneThread };
        let patches = &*patches;
        let Some(finest) = &self.finest else {
            levels[0].right.copy_from_slice(right);
            self.descend(0, sigma, levels, reduced, sharing);
            let x = &levels[0].x;
            return over_patches(sharing, &self.patches, patches, targets, |patch, local, target| {
                local.gather(patch, 1, x);
                visit(patch, &mut local.x, target)
            });
        };
        finest.diagonal.put_factors(sigma, sharing, factors);
        let given = Given { right, factors };
        match rest {
            None => {
                levels[0].right.fill([0.0; CYCLE_WIDTH]);
                patches.with(Buffers::default, |local| {
                    for patch in &self.patches {
                        finest.down(patch, given, local, &mut levels[0].right);
                    }
                });
            }
            Some(rest) => {
                over_patches(sharing, &self.patches, patches, by_patch(&self.patches, rest), |patch, local, rest| {
                    finest.smooth_from_zero(patch, given, local);
                    residual(patch.matrix(), 0, given.part(patch.rows()), &local.x, rest);
                });
                restrict(finest.restriction(levels[0].right.len()), rest, &mut levels[0].right, sharing);
            }
        }
        self.descend(0, sigma, levels, reduced, sharing);
        let coarse = &levels[0].x;
        over_patches(sharing, &self.patches, patches, targets, |patch, local, target| {
            finest.up(patch, given, local, coarse);
            visit(patch, &mut local.x[..patch.vertices(1).len()], target)
        })
    }

    /// Solves level `at` approximately, from `right` into `x`.
    fn descend(&self, at: usize, sigma: f32, buffers: &mut [Buffers], reduced: &mut [CycleRow], sharing: Sharing) {
        let level = &self.levels[at];
        let n = level.diagonal.mass.len();
        let sharing = sharing.of(n);
        let Some((own, rest)) = buffers.split_first_mut() else { return };
        level.diagonal.put_factors(sigma, sharing, &mut own.factors);
        let Some(prolongation) = &level.prolongation else {
            match &self.coarsest {
                Some(coarsest) => coarsest.solve(sigma, &own.right, reduced, &mut own.x),
                None => {
                    own.first_step(n, sharing);
                    own.steps(&level.matrix, 1..LAST_DEGREE, n, sharing);
                }
            }
            return;
        };
        own.first_step(n, sharing);
        own.steps(&level.matrix, 1..COARSE_BEFORE, n, sharing);
        match sharing {
            Sharing::OneThread => {
                rest[0].right.fill([0.0; CYCLE_WIDTH]);
                let given = Given { right: &own.right, factors: &own.factors };
                own.restrict_residual(&level.matrix, given, prolongation, 0..n, &mut rest[0].right);
            }
            Sharing::AllThreads => {
                let Buffers { right, x, before, factors } = &mut *own;
                let given = Given { right, factors };
                let part = |(at, out): (usize, &mut [CycleRow])| {
                    let from = at * SHARED_ROWS;
                    residual(&level.matrix, from, given.part(from..from + out.len()), x, out);
                };
                before.par_chunks_mut(SHARED_ROWS).enumerate().for_each(part);
                restrict(level.restriction(prolongation, rest[0].right.len()), before, &mut rest[0].right, sharing);
            }
        }
        self.descend(at + 1, sigma, rest, reduced, sharing);
        let coarse = &rest[0].x;
        sharing.rows(&mut own.x, |from, x| {
            vectorized(
                x,
                #[inline(always)]
                |x| {
                    for (row, x) in x.iter_mut().enumerate() {
                        add_product(prolongation.row(from + row), coarse, x);
                    }
                },
            );
        });
        own.steps(&level.matrix, 0..COARSE_AFTER, n, sharing);
    }
}

impl Finest {
    /// Smooths from zero on a patch, and adds what remains to the right-hand side of the level below.
    fn down(&self, patch: &Patch, given: Given<'_>, local: &mut Buffers, coarse: &mut [CycleRow]) {
        self.smooth_from_zero(patch, given, local);
        let own = given.part(patch.rows());
        local.restrict_residual(patch.matrix(), own, &self.prolongation, patch.rows(), coarse);
    }

    /// The transposed prolongation, with as many rows as the next level, made when threads first share a panel.
    fn restriction(&self, rows: usize) -> &SparseRows {
        self.restriction.get_or_init(|| self.prolongation.transposed(rows))
    }

    /// Smooths from zero on a patch and its first ring: a single step, which is taken again on the way up.
    fn smooth_from_zero(&self, patch: &Patch, given: Given<'_>, local: &mut Buffers) {
        let vertices = patch.vertices(BEFORE);
        local.x.resize(vertices.len(), [0.0; CYCLE_WIDTH]);
        vectorized(
            &mut local.x,
            #[inline(always)]
            |x: &mut Vec<CycleRow>| {
                vertices.iter().zip(x).for_each(|(&vertex, x)| *x = given.first_step(vertex as usize));
            },
        );
    }

    /// Adds the coarse correction to what is smoothed from zero on a patch, and smooths: the result, in `local.x`,
    /// holds on the patch and its first ring.
    fn up(&self, patch: &Patch, given: Given<'_>, local: &mut Buffers, coarse: &[CycleRow]) {
        local.prepare(patch, AFTER, given);
        let vertices = patch.vertices(RINGS);
        local.x.resize(vertices.len(), [0.0; CYCLE_WIDTH]);
        local.before.resize(vertices.len(), [0.0; CYCLE_WIDTH]);
        vectorized(
            &mut local.x,
            #[inline(always)]
            |x: &mut Vec<CycleRow>| {
                for (&vertex, x) in vertices.iter().zip(x) {
                    let mut sum = given.first_step(vertex as usize);
                    add_product(self.prolongation.row(vertex as usize), coarse, &mut sum);
                    *x = sum;
                }
            },
        );
        local.steps_on_patch(patch, given.part(patch.rows()), AFTER);
    }
}

/// The last step of the smoother that begins on all rings leaves one; a first step of one row needs no other.
const _: () = assert!(AFTER + 1 == RINGS && BEFORE == 1);

impl Diagonal {
    fn of(matrix: &SparseMatrix, masses: &[f64], floor: f64) -> Self {
        let sum = |row: usize| matrix.row(row).1.iter().map(|value| value.abs()).sum::<f64>() as f32;
        Self {
            sums: (0..masses.len()).into_par_iter().with_min_len(1 << 12).map(sum).collect(),
            mass: masses.iter().map(|&mass| mass as f32).collect(),
            floor: floor as f32,
        }
    }

    /// The factors of all rows.
    fn put_factors(&self, sigma: f32, sharing: Sharing, out: &mut [Factors]) {
        let one = |(out, (sum, mass)): (&mut Factors, (&f32, &f32))| {
            let size = sum + sigma * mass;
            let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
            *out = Factors { scale, mass: (sigma + self.floor) * mass };
        };
        match sharing {
            Sharing::OneThread => out.iter_mut().zip(self.sums.iter().zip(&self.mass)).for_each(one),
            Sharing::AllThreads => {
                let rows = out.par_iter_mut().zip(self.sums.par_iter().zip(&self.mass));
                rows.with_min_len(SHARED_ROWS).for_each(one);
            }
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
