//! The smoother: a Chebyshev polynomial of the matrix scaled by its absolute row sums, on sixteen right-hand sides.

use std::ops::Range;

use super::sharing::Sharing;
use super::{CYCLE_WIDTH, CycleRow, Diagonal};
use crate::patches::SparseRows;
use crate::{Patch, vectorized};

/// The share of the spectrum that the smoother leaves to the coarse level.
const LEFT_TO_COARSE: f32 = 0.12;

/// The middle and the half width of the interval that the smoother damps.
const MIDDLE: f32 = 0.5 * (1.0 + LEFT_TO_COARSE);
const HALF: f32 = 0.5 * (1.0 - LEFT_TO_COARSE);

/// γ of the first step.
pub(crate) const FIRST_GAMMA: f32 = 1.0 / MIDDLE;

/// A panel on some rows, what it is to solve for, and its last iterate.
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

impl Buffers {
    /// Right-hand sides and factors of a patch and its first `rings` rings.
    pub(super) fn prepare(&mut self, patch: &Patch, rings: usize, sigma: f32, diagonal: &Diagonal, right: &[CycleRow]) {
        let vertices = patch.vertices(rings);
        self.right.clear();
        self.right.extend_from_slice(&right[patch.rows()]);
        self.right.extend(vertices[patch.rows().len()..].iter().map(|&vertex| right[vertex as usize]));
        self.factors.clear();
        self.factors.extend(vertices.iter().map(|&vertex| diagonal.factors(vertex as usize, sigma)));
    }

    /// `x` on a patch and its first `rings` rings.
    pub(super) fn gather(&mut self, patch: &Patch, rings: usize, x: &[CycleRow]) {
        self.x.clear();
        self.x.extend_from_slice(&x[patch.rows()]);
        self.x.extend(patch.vertices(rings)[patch.rows().len()..].iter().map(|&vertex| x[vertex as usize]));
    }

    /// The first step of the smoother from zero, on the first `rows` rows.
    pub(super) fn first_step(&mut self, rows: usize, sharing: Sharing) {
        let Self { right, x, factors, .. } = self;
        sharing.rows(&mut x[..rows], |from, x| {
            for ((x, b), factors) in x.iter_mut().zip(&right[from..]).zip(&factors[from..]) {
                let scale = factors.scale / MIDDLE;
                *x = b.map(|b| scale * b);
            }
        });
    }

    /// Steps of the Chebyshev iteration from `x`: `x ← x + β (x − before) + γ D⁻¹ (b − A x)`, one pass over the first
    /// `rows(step)` rows each. Step 0 looks at no `before`; where the iteration began with
    /// [`first_step`](Self::first_step), that was zero at step 1.
    pub(super) fn steps(
        &mut self,
        matrix: &SparseRows,
        range: Range<usize>,
        rows: impl Fn(usize) -> usize,
        sharing: Sharing,
    ) {
        for (step, ChebyshevStep { fresh, beta, gamma }) in range.clone().zip(chebyshev(range)) {
            let Self { right, x, before, factors } = &mut *self;
            let count = rows(step);
            let sweep = Sweep { matrix, right, factors, x, beta, gamma };
            sharing.rows(&mut before[..count], |from, out| {
                if fresh {
                    vectorized(
                        out,
                        #[inline(always)]
                        |out| sweep.run::<true>(from, out),
                    );
                } else {
                    vectorized(
                        out,
                        #[inline(always)]
                        |out| sweep.run::<false>(from, out),
                    );
                }
            });
            std::mem::swap(x, before);
        }
    }

    /// `b − A x` of the rows that come first.
    pub(super) fn residual(&self, matrix: &SparseRows, out: &mut [CycleRow]) {
        residual(matrix, 0, (&self.right, &self.x, &self.factors), out);
    }

    /// Adds `Pᵀ (b − A x)` to `out`, for the rows that come first here and are `rows` of the prolongation.
    pub(super) fn restrict_residual(
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

/// One step of the iteration on the CPU.
pub(super) struct Sweep<'a> {
    matrix: &'a SparseRows,
    right: &'a [CycleRow],
    factors: &'a [Factors],
    x: &'a [CycleRow],
    beta: f32,
    gamma: f32,
}

impl Sweep<'_> {
    /// Puts the new iterate in the place of the one before, for rows from `from` on; the one before is not looked at if
    /// `FRESH`.
    #[inline(always)]
    fn run<const FRESH: bool>(&self, from: usize, before: &mut [CycleRow]) {
        let Self { matrix, right, factors, x, beta, gamma } = *self;
        for (row, ((before, b), factors)) in (from..).zip(before.iter_mut().zip(&right[from..]).zip(&factors[from..])) {
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
pub(super) fn add_product(entries: &[(u32, f32)], x: &[CycleRow], out: &mut CycleRow) {
    for &(column, value) in entries {
        let x = &x[column as usize];
        for k in 0..CYCLE_WIDTH {
            out[k] = value.mul_add(x[k], out[k]);
        }
    }
}

/// `b − A x` of the rows from `from` on.
pub(super) fn residual(
    matrix: &SparseRows,
    from: usize,
    (right, x, factors): (&[CycleRow], &[CycleRow], &[Factors]),
    out: &mut [CycleRow],
) {
    vectorized(
        out,
        #[inline(always)]
        |out| {
            for (row, out) in (from..).zip(out) {
                let (b, image) = (&right[row], image(matrix.row(row), factors[row].mass, &x[row], x));
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
