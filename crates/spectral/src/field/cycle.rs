//! Multigrid cycles for `S + γM` on all faces, any γ > 0, in single precision: what preconditions solves in the space of all fields.
//!
//! The levels are those of [`super::hierarchy`]; γ may differ from call to call, so that one hierarchy serves every choice of weights. The smoother
//! is a Chebyshev polynomial, the same before and after the coarse correction: a cycle is symmetric and positive definite.

use chladni_algebra::{BlockMatrix, DefiniteFactor, DenseMatrix};
use chladni_base::{Cancelled, Monitor, Spare};
use rayon::prelude::*;

use super::cycle_rows::{SumRows, Vector};
use super::hierarchy::{Level, row_scales};
use super::smooth::{CYCLE_DEGREE, CYCLE_LEAST, chebyshev};

/// Degree of the smoother and the lower end of what it damps on the coarsest level, where that is too large to be factored.
const LAST_DEGREE: usize = 16;
const LAST_LEAST: f32 = 0.005;

/// Unknowns of a coarsest level that is factored.
const MOST_FACTORED: usize = 1500;

/// Nodes that one task handles. Sums are formed in pieces that do not depend on the number of threads.
const PIECE: usize = 4096;

/// Conjugate gradients in single precision make residuals so much smaller, in the norm of the cycles: beyond it rounding begins to count.
const ROUND: f64 = 3e-4;

/// Steps of such a round at most.
const ROUND_STEPS: usize = 30;

/// The levels of an operator, the finest first.
pub(super) struct Cycles<const B: usize> {
    grids: Vec<Grid<B>>,
    /// The coarsest matrices, where they are small.
    coarsest: Option<(DenseMatrix, DenseMatrix)>,
    /// Vectors of all levels.
    spare: Spare<Vec<Work<B>>>,
}

struct Grid<const B: usize> {
    rows: SumRows<B>,
    /// What rows of either matrix are to be divided by so that spectra end at 2.
    stiffness_scales: Vec<f32>,
    mass_scales: Vec<f32>,
    /// To and from the next coarser level.
    transfer: Option<(SumRows<B>, SumRows<B>)>,
}

/// What one level takes during a cycle.
struct Work<const B: usize> {
    right: Vector<B>,
    /// The solution.
    z: Vector<B>,
    next: Vector<B>,
    change: Vector<B>,
}

/// For each number of a vector, in parallel.
fn each<T: Send>(vector: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    vector.par_chunks_mut(PIECE).enumerate().for_each(|(task, chunk)| {
        chunk.iter_mut().enumerate().for_each(|(k, value)| act(task * PIECE + k, value));
    });
}

fn dot<const B: usize>(a: &[[f32; B]], b: &[[f32; B]]) -> f64 {
    let pieces = a.par_chunks(PIECE).zip(b.par_chunks(PIECE));
    let sums: Vec<f64> = pieces
        .map(|(a, b)| {
            a.iter().zip(b).map(|(a, b)| (0..B).map(|i| f64::from(a[i]) * f64::from(b[i])).sum::<f64>()).sum()
        })
        .collect();
    sums.iter().sum()
}

/// `a += factor · b`.
fn add<const B: usize>(a: &mut [[f32; B]], b: &[[f32; B]], factor: f64) {
    let factor = factor as f32;
    a.par_chunks_mut(PIECE).zip(b.par_chunks(PIECE)).for_each(|(a, b)| {
        a.as_flattened_mut().iter_mut().zip(b.as_flattened()).for_each(|(a, b)| *a += factor * b);
    });
}

/// A vector in single precision with what it has to be multiplied by: where its numbers lie beyond single precision is no matter.
fn narrowed<const B: usize>(r: &[f64]) -> (Vector<B>, f64) {
    let sizes = r.par_chunks(PIECE).map(|piece| piece.iter().fold(0.0f64, |most, x| most.max(x.abs())));
    let size = sizes.reduce(|| 0.0, f64::max);
    if !(size > 0.0) {
        return (Vec::new(), 0.0);
    }
    (r.as_chunks::<B>().0.par_iter().with_min_len(PIECE).map(|r| r.map(|x| (x / size) as f32)).collect(), size)
}

/// `size` times a vector.
fn widened<const B: usize>(z: &[[f32; B]], size: f64) -> Vec<f64> {
    z.as_flattened().par_iter().with_min_len(PIECE).map(|&z| size * f64::from(z)).collect()
}

/// The levels with one γ.
pub(super) struct Shifted<'a, const B: usize> {
    cycles: &'a Cycles<B>,
    gamma: f32,
    coarsest: Option<DefiniteFactor>,
}

/// What a round of conjugate gradients made of a right-hand side.
pub(super) struct Round {
    /// About `(S + γM)⁻¹ r`.
    pub x: Vec<f64>,
    /// The squared residual before and after it in the norm of the cycles, as far as single precision knows.
    pub before: f64,
    pub after: f64,
}

impl<const B: usize> Cycles<B> {
    /// From one level or more.
    ///
    /// # Errors
    /// Cancellation, between levels.
    pub fn new(levels: &[Level<B>], monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        let grids = levels.iter().enumerate().map(|(at, level)| {
            monitor.checkpoint()?;
            let interpolation = levels.get(at + 1).and_then(|coarser| coarser.interpolation.as_ref());
            let transfer = interpolation.map(|to| (SumRows::of(&to.matrix.transpose()), SumRows::of(&to.matrix)));
            Ok(Grid::new(level, at == 0, transfer))
        });
        let grids = grids.collect::<Result<Vec<Grid<B>>, Cancelled>>()?;
        let coarsest = levels.last().filter(|last| B * last.roots.len() <= MOST_FACTORED);
        let coarsest = coarsest.map(|last| (last.stiffness.to_sparse().to_dense(), last.mass.to_sparse().to_dense()));
        Ok(Self { grids, coarsest, spare: Spare::default() })
    }

    /// About the bytes that they take, with the vectors of one solve.
    pub fn bytes(&self) -> u64 {
        let grid = |grid: &Grid<B>| {
            let transfer = grid.transfer.as_ref().map_or(0, |(down, up)| down.bytes() + up.bytes());
            grid.rows.bytes() + transfer + (8 + 16 * B as u64) * grid.rows.nodes() as u64
        };
        let coarsest =
            self.coarsest.as_ref().map_or(0, |(stiffness, _)| 16 * (stiffness.rows() * stiffness.rows()) as u64);
        self.grids.iter().map(grid).sum::<u64>() + coarsest
    }

    /// Cycles for `S + γM`, `γ > 0`.
    pub fn shifted(&self, gamma: f64) -> Shifted<'_, B> {
        let factor = |(stiffness, mass): &(DenseMatrix, DenseMatrix)| {
            let mut sum = stiffness.clone();
            sum.values_mut().iter_mut().zip(mass.values()).for_each(|(s, m)| *s += gamma * m);
            DefiniteFactor::new(sum).ok()
        };
        Shifted { cycles: self, gamma: gamma as f32, coarsest: self.coarsest.as_ref().and_then(factor) }
    }

    fn work(&self) -> Vec<Work<B>> {
        let vector = |grid: &Grid<B>| vec![[0.0; B]; grid.rows.nodes()];
        let work = |grid| Work { right: vector(grid), z: vector(grid), next: vector(grid), change: vector(grid) };
        self.grids.iter().map(work).collect()
    }
}

impl<const B: usize> Grid<B> {
    fn new(level: &Level<B>, finest: bool, transfer: Option<(SumRows<B>, SumRows<B>)>) -> Self {
        let rows = match finest {
            // On the finest level the masses alone, one for each node.
            true => {
                let masses = level.mass.diagonal().iter().map(|block| block[0][0] as f32).collect();
                SumRows::with_masses(&level.stiffness, masses)
            }
            false => SumRows::with(&level.stiffness, &level.mass),
        };
        let scales = |matrix: &BlockMatrix<B>| row_scales(matrix).iter().map(|&s| s as f32).collect();
        let (stiffness_scales, mass_scales) = (scales(&level.stiffness), scales(&level.mass));
        Self { rows, stiffness_scales, mass_scales, transfer }
    }

    /// Chebyshev steps towards `(S + γM) z = r`; `zero` says that `z` is to be taken for zero.
    fn smooth(&self, gamma: f32, work: &mut Work<B>, zero: bool, (degree, least): (usize, f32)) {
        let Work { right, z, next, change } = work;
        for (step, (keep, add)) in chebyshev(degree, least).enumerate() {
            let add = |row: usize| {
                let scale = self.stiffness_scales[row] + gamma * self.mass_scales[row];
                if scale > 0.0 { add / scale } else { 0.0 }
            };
            if step == 0 && zero {
                z.par_chunks_mut(PIECE).zip(change.par_chunks_mut(PIECE)).enumerate().for_each(
                    |(task, (z, change))| {
                        for (k, (z, change)) in z.iter_mut().zip(change).enumerate() {
                            let row = task * PIECE + k;
                            let add = add(row);
                            *change = right[row].map(|r| add * r);
                            *z = *change;
                        }
                    },
                );
                continue;
            }
            self.rows.step((gamma, keep), add, (z, right), (change, next));
            std::mem::swap(z, next);
        }
    }
}

impl<const B: usize> Shifted<'_, B> {
    /// `z ≈ (S + γM)⁻¹ r`: one V-cycle from zero.
    pub fn cycle(&self, r: &[f64]) -> Vec<f64> {
        let (right, size) = narrowed::<B>(r);
        if !(size > 0.0) {
            return vec![0.0; r.len()];
        }
        self.with_work(|work| {
            self.cycle_of(&right, work);
            widened(&work[0].z, size)
        })
    }

    fn with_work<R>(&self, act: impl FnOnce(&mut [Work<B>]) -> R) -> R {
        self.cycles.spare.with(|| self.cycles.work(), |work| act(work))
    }

    /// The same of a vector in single precision; the answer is the solution of the finest level.
    fn cycle_of(&self, r: &[[f32; B]], work: &mut [Work<B>]) {
        let right = &mut work[0].right;
        right.par_chunks_mut(PIECE).zip(r.par_chunks(PIECE)).for_each(|(to, from)| to.copy_from_slice(from));
        self.descend(0, work);
    }

    fn descend(&self, at: usize, work: &mut [Work<B>]) {
        let grid = &self.cycles.grids[at];
        let Some((own, coarser)) = work.split_first_mut() else { return };
        let (Some((down, up)), Some(coarse)) = (&grid.transfer, coarser.first_mut()) else {
            match &self.coarsest {
                Some(factor) => {
                    let mut dense = DenseMatrix::zeros(B * own.z.len(), 1);
                    let right = own.right.as_flattened();
                    dense.column_mut(0).iter_mut().zip(right).for_each(|(d, &r)| *d = f64::from(r));
                    if let Err(misfit) = factor.solve(&mut dense) {
                        panic!("{} nodes on the coarsest level: {misfit}", own.z.len());
                    }
                    own.z.as_flattened_mut().iter_mut().zip(dense.column(0)).for_each(|(z, &d)| *z = d as f32);
                }
                None => grid.smooth(self.gamma, own, true, (LAST_DEGREE, LAST_LEAST)),
            }
            return;
        };
        grid.smooth(self.gamma, own, true, (CYCLE_DEGREE, CYCLE_LEAST));
        grid.rows.rest(self.gamma, &own.z, &own.right, &mut own.next);
        down.multiply(0.0, &own.next, &mut coarse.right);
        self.descend(at + 1, coarser);
        if let Some(coarse) = coarser.first() {
            up.add(0.0, &coarse.z, &mut own.z);
        }
        grid.smooth(self.gamma, own, false, (CYCLE_DEGREE, CYCLE_LEAST));
    }

    /// Conjugate gradients from zero in single precision for `(S + γM) x = r`, with a γ of its own, preconditioned by cycles: until the squared residual
    /// in their norm is at most `goal(before)`, or smaller by as much as single precision can tell.
    ///
    /// # Errors
    /// Cancellation.
    pub fn round(
        &self,
        gamma: f64,
        r: &[f64],
        goal: impl FnOnce(f64) -> f64,
        monitor: &dyn Monitor,
    ) -> Result<Round, Cancelled> {
        let (mut residual, size) = narrowed::<B>(r);
        if !(size > 0.0) {
            return Ok(Round { x: vec![0.0; r.len()], before: 0.0, after: 0.0 });
        }
        let rows = &self.cycles.grids[0].rows;
        self.with_work(|work| {
            self.cycle_of(&residual, work);
            let before = dot(&residual, &work[0].z);
            let goal = (goal(before * size * size) / (size * size)).max(ROUND * ROUND * before);
            let mut x: Vector<B> = vec![[0.0; B]; residual.len()];
            let mut direction = work[0].z.clone();
            let mut product = vec![[0.0; B]; residual.len()];
            let mut square = before;
            for _ in 0..ROUND_STEPS {
                monitor.checkpoint()?;
                if !(square > goal && square.is_finite()) {
                    break;
                }
                rows.multiply(gamma as f32, &direction, &mut product);
                let curvature = dot(&direction, &product);
                if !(curvature > 0.0) {
                    break;
                }
                let step = square / curvature;
                add(&mut x, &direction, step);
                add(&mut residual, &product, -step);
                self.cycle_of(&residual, work);
                let z = &work[0].z;
                let next = dot(&residual, z);
                // A cycle is the same operator every time but for rounding, of which this takes out what residuals share.
                let shared = next + step * dot(&product, z);
                let keep = ((next - shared) / square) as f32;
                square = next;
                each(&mut direction, |row, d| *d = std::array::from_fn(|i| z[row][i] + keep * d[i]));
            }
            Ok(Round { x: widened(&x, size), before: before * size * size, after: square * size * size })
        })
    }
}
