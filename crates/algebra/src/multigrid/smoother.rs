//! The smoother: a Chebyshev polynomial of the matrix scaled by its absolute row sums, on sixteen right-hand sides.

use std::ops::Range;

use super::sharing::Sharing;
use super::{CYCLE_WIDTH, CycleRow};
use crate::patches::{ENTRIES_AT_ONCE, SparseRows};
use crate::{Patch, vectorized};

/// The share of the spectrum that the smoother leaves to the coarse level.
const LEFT_TO_COARSE: f32 = 0.12;

/// The middle and the half width of the interval that the smoother damps.
const MIDDLE: f32 = 0.5 * (1.0 + LEFT_TO_COARSE);
const HALF: f32 = 0.5 * (1.0 - LEFT_TO_COARSE);

/// γ of the first step.
pub(crate) const FIRST_GAMMA: f32 = 1.0 / MIDDLE;

/// A panel on some rows, and its last iterate; of a level also what it is to solve for, of a patch that on its rings.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    pub(super) right: Vec<CycleRow>,
    pub(super) x: Vec<CycleRow>,
    pub(super) before: Vec<CycleRow>,
    pub(super) factors: Vec<Factors>,
}

/// What a row is scaled by in the smoother, one over the absolute sum of `S + σM`, and its own multiple of `M`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Factors {
    pub(super) scale: f32,
    pub(super) mass: f32,
}

/// Right-hand sides of some rows that follow each other, and their factors.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub(super) right: &'a [CycleRow],
    pub(super) factors: &'a [Factors],
}

impl<'a> Given<'a> {
    /// Of some of these rows.
    pub(super) fn part(self, rows: Range<usize>) -> Self {
        Self { right: &self.right[rows.clone()], factors: &self.factors[rows] }
    }

    /// The first step of the smoother from zero, of one row.
    #[inline(always)]
    pub(super) fn first_step(&self, row: usize) -> CycleRow {
        let scale = FIRST_GAMMA * self.factors[row].scale;
        self.right[row].map(|b| scale * b)
    }

    /// Of the rows from this one on.
    fn rows_from(self, row: usize) -> Self {
        self.part(row..self.right.len())
    }
}

impl Buffers {
    /// Right-hand sides and factors of the first `rings` rings around a patch; its own are among those of all rows.
    pub(super) fn prepare(&mut self, patch: &Patch, rings: usize, all: Given<'_>) {
        let rings = &patch.vertices(rings)[patch.rows().len()..];
        self.right.clear();
        self.right.extend(rings.iter().map(|&vertex| all.right[vertex as usize]));
        self.factors.clear();
        self.factors.extend(rings.iter().map(|&vertex| all.factors[vertex as usize]));
    }

    /// `x` on a patch and its first `rings` rings.
    pub(super) fn gather(&mut self, patch: &Patch, rings: usize, x: &[CycleRow]) {
        self.x.clear();
        self.x.extend_from_slice(&x[patch.rows()]);
        self.x.extend(patch.vertices(rings)[patch.rows().len()..].iter().map(|&vertex| x[vertex as usize]));
    }

    /// The first step of the smoother from zero, on the first `rows` rows of a level.
    pub(super) fn first_step(&mut self, rows: usize, sharing: Sharing) {
        let Self { right, x, factors, .. } = self;
        let given = Given { right, factors };
        sharing.rows(&mut x[..rows], |from, x| {
            x.iter_mut().enumerate().for_each(|(row, x)| *x = given.first_step(from + row));
        });
    }

    /// Steps of the Chebyshev iteration from `x`: `x ← x + β (x − before) + γ D⁻¹ (b − A x)`, one pass over the first
    /// `rows` rows of a level each. Step 0 looks at no `before`; where the iteration began with
    /// [`first_step`](Self::first_step), that was zero at step 1.
    pub(super) fn steps(&mut self, matrix: &SparseRows, range: Range<usize>, rows: usize, sharing: Sharing) {
        for step in chebyshev(range) {
            let Self { right, x, before, factors } = &mut *self;
            let given = Given { right, factors };
            sharing.rows(&mut before[..rows], |from, out| sweep(step, matrix, from, given.rows_from(from), x, out));
            std::mem::swap(x, before);
        }
    }

    /// The same on a patch and its rings, as many as the steps that are left; `own` are right-hand sides and factors of
    /// its own rows.
    pub(super) fn steps_on_patch(&mut self, patch: &Patch, own: Given<'_>, count: usize) {
        let begin = patch.rows().len();
        for (number, step) in chebyshev(0..count).enumerate() {
            let Self { right, x, before, factors } = &mut *self;
            let rings = Given { right, factors };
            let (inner, outer) = before[..patch.vertices(count - number).len()].split_at_mut(begin);
            sweep(step, patch.matrix(), 0, own, x, inner);
            sweep(step, patch.matrix(), begin, rings, x, outer);
            std::mem::swap(x, before);
        }
    }

    /// Adds `Pᵀ (b − A x)` to `out`, for the rows that come first here and are `rows` of the prolongation.
    pub(super) fn restrict_residual(
        &self,
        matrix: &SparseRows,
        given: Given<'_>,
        prolongation: &SparseRows,
        rows: Range<usize>,
        out: &mut [CycleRow],
    ) {
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, global) in rows.clone().enumerate() {
                    let image = image(matrix.row(row), given.factors[row].mass, &self.x[row], &self.x);
                    let residual: CycleRow = std::array::from_fn(|k| given.right[row][k] - image[k]);
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

/// One step of the Chebyshev iteration: `x ← x + β (x − before) + γ D⁻¹ (b − A x)`, where `before` is zero or not
/// looked at if `fresh`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChebyshevStep {
    pub(crate) fresh: bool,
    pub(crate) beta: f32,
    pub(crate) gamma: f32,
}

/// The steps of such numbers. Those from 1 on follow a first one from zero, which is `γ D⁻¹ b` with [`FIRST_GAMMA`].
pub(crate) fn chebyshev(range: Range<usize>) -> impl Iterator<Item = ChebyshevStep> {
    let first = range.start;
    let mut rho = HALF / MIDDLE;
    let steps = (0..range.end).map(move |step| {
        if step == 0 {
            return ChebyshevStep { fresh: true, beta: 0.0, gamma: FIRST_GAMMA };
        }
        let next = 1.0 / (2.0 * MIDDLE / HALF - rho);
        let (beta, gamma) = (next * rho, 2.0 * next / HALF);
        rho = next;
        ChebyshevStep { fresh: step == 1 && first == 1, beta, gamma }
    });
    steps.skip(first)
}

/// One step of the iteration on the CPU: puts the new iterate in the place of the one before, for rows from `from` on,
/// which are given.
fn sweep(
    step: ChebyshevStep,
    matrix: &SparseRows,
    from: usize,
    given: Given<'_>,
    x: &[CycleRow],
    before: &mut [CycleRow],
) {
    if step.fresh {
        vectorized(
            before,
            #[inline(always)]
            |before| sweep_rows::<true>(step, matrix, from, given, x, before),
        );
    } else {
        vectorized(
            before,
            #[inline(always)]
            |before| sweep_rows::<false>(step, matrix, from, given, x, before),
        );
    }
}

/// The iterate before is not looked at if `FRESH`.
#[inline(always)]
fn sweep_rows<const FRESH: bool>(
    ChebyshevStep { beta, gamma, .. }: ChebyshevStep,
    matrix: &SparseRows,
    from: usize,
    given: Given<'_>,
    x: &[CycleRow],
    before: &mut [CycleRow],
) {
    for (row, ((before, b), factors)) in (from..).zip(before.iter_mut().zip(given.right).zip(given.factors)) {
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

/// A row of `(S + σM) x`.
#[inline(always)]
fn image(entries: &[(u32, f32)], mass: f32, own: &CycleRow, x: &[CycleRow]) -> CycleRow {
    let mut sum: CycleRow = std::array::from_fn(|k| mass * own[k]);
    add_product(entries, x, &mut sum);
    sum
}

/// `out += (row of A) x`.
#[inline(always)]
pub(super) fn add_product(entries: &[(u32, f32)], x: &[CycleRow], out: &mut CycleRow) {
    let mut sum = *out;
    for &[a, b, c, d] in entries.as_chunks::<ENTRIES_AT_ONCE>().0 {
        let rows = [a, b, c, d].map(|(column, _)| &x[column as usize]);
        for k in 0..CYCLE_WIDTH {
            sum[k] = a.1.mul_add(rows[0][k], sum[k]);
            sum[k] = b.1.mul_add(rows[1][k], sum[k]);
            sum[k] = c.1.mul_add(rows[2][k], sum[k]);
            sum[k] = d.1.mul_add(rows[3][k], sum[k]);
        }
    }
    *out = sum;
}

/// `b − A x` of the rows from `from` on, which are given.
pub(super) fn residual(matrix: &SparseRows, from: usize, given: Given<'_>, x: &[CycleRow], out: &mut [CycleRow]) {
    vectorized(
        out,
        #[inline(always)]
        |out| {
            for ((row, out), (b, factors)) in (from..).zip(out).zip(given.right.iter().zip(given.factors)) {
                let image = image(matrix.row(row), factors.mass, &x[row], x);
                *out = std::array::from_fn(|k| b[k] - image[k]);
            }
        },
    );
}

/// `out = Pᵀ x`.
pub(super) fn restrict(restriction: &SparseRows, x: &[CycleRow], out: &mut [CycleRow], sharing: Sharing) {
    sharing.rows(out, |from, out| {
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, out) in (from..).zip(out) {
                    *out = [0.0; CYCLE_WIDTH];
                    add_product(restriction.row(row), x, out);
                }
            },
        );
    });
}
