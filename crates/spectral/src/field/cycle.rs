//! Multigrid cycles for `S + γM` on all faces, any γ > 0, in single precision: what preconditions solves in the space
//! of all fields.
//!
//! The levels are those of [`super::hierarchy`]; γ may differ from call to call, so that one hierarchy serves every
//! choice of weights. The smoother is a Chebyshev polynomial, the same before and after the coarse correction: a cycle
//! is symmetric and positive definite.

use chladni_algebra::{BlockMatrix, DefiniteFactor, DenseMatrix, vectorized};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};

use super::hierarchy::{FieldLevel, row_scales};
use super::smooth::{CYCLE_DEGREE, CYCLE_LEAST, Rows, Small, chebyshev};

/// Degree of the smoother and the lower end of what it damps on the coarsest level, where that is too large to be
/// factored.
const LAST_DEGREE: usize = 16;
const LAST_LEAST: f32 = 0.005;

/// Unknowns of a coarsest level that is factored.
const MOST_FACTORED: usize = 1500;

/// Rows that one task handles.
const ROWS: usize = 2048;

type Vector<const B: usize> = Vec<[f32; B]>;

/// The levels of an operator, the finest first.
pub(super) struct Cycles<const B: usize> {
    grids: Vec<Grid<B>>,
    /// The coarsest matrices, where they are small.
    coarsest: Option<(DenseMatrix, DenseMatrix)>,
}

struct Grid<const B: usize> {
    stiffness: Rows<B>,
    /// On the pattern of the stiffness; on the finest level the masses alone, one for each node.
    mass: Vec<Small<B>>,
    masses: Vec<f32>,
    /// What rows of either matrix are to be divided by so that spectra end at 2.
    stiffness_scales: Vec<f32>,
    mass_scales: Vec<f32>,
    /// To and from the next coarser level.
    transfer: Option<(Rows<B>, Rows<B>)>,
}

/// For each number of a vector, in parallel. `act` is to be inlined always, so that it is compiled for the vector units
/// at hand.
fn each<T: Send>(vector: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    vector.par_chunks_mut(ROWS).enumerate().for_each(|(task, chunk)| {
        vectorized(
            chunk,
            #[inline(always)]
            |chunk| chunk.iter_mut().enumerate().for_each(|(k, value)| act(task * ROWS + k, value)),
        );
    });
}

/// One row of `A x`. Each product of a block is summed by itself: no sum waits for the one beside it.
#[inline(always)]
fn row_times<const B: usize>(rows: &Rows<B>, row: usize, x: &[[f32; B]]) -> [f32; B] {
    let range = rows.range(row);
    let mut sums = [[0f32; B]; B];
    for (&column, block) in rows.indices[range.clone()].iter().zip(&rows.blocks[range]) {
        add(&mut sums, block, &x[column as usize]);
    }
    sums.map(|sums| sums.iter().sum())
}

#[inline(always)]
fn add<const B: usize>(sums: &mut Small<B>, block: &Small<B>, x: &[f32; B]) {
    for i in 0..B {
        for j in 0..B {
            sums[i][j] += block[i][j] * x[j];
        }
    }
}

/// The levels with one γ.
pub(super) struct Shifted<'a, const B: usize> {
    cycles: &'a Cycles<B>,
    gamma: f32,
    coarsest: Option<DefiniteFactor>,
}

impl<const B: usize> Cycles<B> {
    /// From one level or more.
    ///
    /// # Errors
    /// Cancellation, between levels.
    pub fn new(levels: &[FieldLevel<B>], monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        let grids = levels.iter().enumerate().map(|(at, level)| {
            monitor.checkpoint()?;
            let interpolation = levels.get(at + 1).and_then(|coarser| coarser.interpolation.as_ref());
            let transfer = interpolation.map(|to| (Rows::of(&to.matrix.transpose()), Rows::of(&to.matrix)));
            Ok(Grid::new(level, at == 0, transfer))
        });
        let grids = grids.collect::<Result<Vec<Grid<B>>, Cancelled>>()?;
        let coarsest = levels.last().filter(|last| B * last.roots.len() <= MOST_FACTORED);
        let coarsest = coarsest.map(|last| (last.stiffness.to_sparse().to_dense(), last.mass.to_sparse().to_dense()));
        Ok(Self { grids, coarsest })
    }

    /// About the bytes that they take.
    pub fn bytes(&self) -> u64 {
        let grid = |grid: &Grid<B>| {
            let transfer = grid.transfer.as_ref().map_or(0, |(down, up)| down.bytes() + up.bytes());
            grid.stiffness.bytes()
                + transfer
                + (size_of::<Small<B>>() * grid.mass.len() + 12 * grid.masses.len()) as u64
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
}

impl<const B: usize> Grid<B> {
    fn new(level: &FieldLevel<B>, finest: bool, transfer: Option<(Rows<B>, Rows<B>)>) -> Self {
        let stiffness = Rows::of(&level.stiffness);
        let masses = level.mass.diagonal().iter().map(|block| block[0][0] as f32).collect();
        let mut mass = Vec::new();
        if !finest {
            // The pattern of the mass lies within that of the stiffness.
            for row in 0..level.stiffness.rows() {
                let (columns, blocks) = level.mass.row(row);
                let own = |column: &u32| columns.binary_search(column).map_or([[0.0; B]; B], |at| blocks[at]);
                mass.extend(level.stiffness.row(row).0.iter().map(|c| own(c).map(|row| row.map(|x| x as f32))));
            }
        }
        let scales = |matrix: &BlockMatrix<B>| row_scales(matrix).iter().map(|&s| s as f32).collect();
        let (stiffness_scales, mass_scales) = (scales(&level.stiffness), scales(&level.mass));
        Self { stiffness, mass, masses, stiffness_scales, mass_scales, transfer }
    }

    /// One row of `(S + γM) x`.
    #[inline(always)]
    fn row_times(&self, gamma: f32, row: usize, x: &[[f32; B]]) -> [f32; B] {
        let rows = &self.stiffness;
        if self.mass.is_empty() {
            let (image, mass) = (row_times(rows, row, x), gamma * self.masses[row]);
            return std::array::from_fn(|i| image[i] + mass * x[row][i]);
        }
        let range = rows.range(row);
        let mut sums = [[0f32; B]; B];
        let blocks = rows.blocks[range.clone()].iter().zip(&self.mass[range.clone()]);
        for (&column, (s, m)) in rows.indices[range].iter().zip(blocks) {
            let block = std::array::from_fn(|i| std::array::from_fn(|j| s[i][j] + gamma * m[i][j]));
            add(&mut sums, &block, &x[column as usize]);
        }
        sums.map(|sums| sums.iter().sum())
    }

    /// Chebyshev steps towards `(S + γM) z = r`; `zero` says that `z` is.
    fn smooth(&self, gamma: f32, z: &mut Vector<B>, r: &[[f32; B]], zero: bool, (degree, least): (usize, f32)) {
        let mut change = vec![[0f32; B]; z.len()];
        let scaled = |row: usize, add: f32| {
            let scale = self.stiffness_scales[row] + gamma * self.mass_scales[row];
            if scale > 0.0 { add / scale } else { 0.0 }
        };
        for (step, (keep, add)) in chebyshev(degree, least).enumerate() {
            if step == 0 && zero {
                each(
                    &mut change,
                    #[inline(always)]
                    |row, change| *change = r[row].map(|r| scaled(row, add) * r),
                );
                z.copy_from_slice(&change);
                continue;
            }
            let before = &*z;
            each(
                &mut change,
                #[inline(always)]
                |row, change| {
                    let (image, add) = (self.row_times(gamma, row, before), scaled(row, add));
                    for i in 0..B {
                        change[i] = keep * change[i] + add * (r[row][i] - image[i]);
                    }
                },
            );
            each(
                z,
                #[inline(always)]
                |row, z| z.iter_mut().zip(&change[row]).for_each(|(z, c)| *z += c),
            );
        }
    }
}

impl<const B: usize> Shifted<'_, B> {
    /// `z ≈ (S + γM)⁻¹ r`: one V-cycle from zero.
    pub fn cycle(&self, r: &[f64]) -> Vec<f64> {
        // Where numbers are beyond single precision is no matter: cycles are linear.
        let size = r.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        if !(size > 0.0) {
            return vec![0.0; r.len()];
        }
        let right: Vector<B> =
            r.as_chunks::<B>().0.par_iter().with_min_len(ROWS).map(|r| r.map(|x| (x / size) as f32)).collect();
        let z = self.descend(0, &right);
        let mut out = vec![0.0; r.len()];
        let chunks = out.as_chunks_mut::<B>().0;
        each(chunks, |row, out| *out = z[row].map(|x| size * f64::from(x)));
        out
    }

    fn descend(&self, at: usize, r: &[[f32; B]]) -> Vector<B> {
        let grid = &self.cycles.grids[at];
        let mut z = vec![[0f32; B]; r.len()];
        let Some((down, up)) = &grid.transfer else {
            match &self.coarsest {
                Some(factor) => {
                    let mut dense = DenseMatrix::zeros(B * r.len(), 1);
                    dense.column_mut(0).iter_mut().zip(r.as_flattened()).for_each(|(d, &r)| *d = f64::from(r));
                    if let Err(misfit) = factor.solve(&mut dense) {
                        panic!("{} nodes on the coarsest level: {misfit}", r.len());
                    }
                    z.as_flattened_mut().iter_mut().zip(dense.column(0)).for_each(|(z, &d)| *z = d as f32);
                }
                None => grid.smooth(self.gamma, &mut z, r, true, (LAST_DEGREE, LAST_LEAST)),
            }
            return z;
        };
        grid.smooth(self.gamma, &mut z, r, true, (CYCLE_DEGREE, CYCLE_LEAST));
        let mut residual = vec![[0f32; B]; r.len()];
        each(
            &mut residual,
            #[inline(always)]
            |row, residual| {
                let image = grid.row_times(self.gamma, row, &z);
                *residual = std::array::from_fn(|i| r[row][i] - image[i]);
            },
        );
        let mut coarse = vec![[0f32; B]; down.offsets.len() - 1];
        each(
            &mut coarse,
            #[inline(always)]
            |row, coarse| *coarse = row_times(down, row, &residual),
        );
        drop(residual);
        let correction = self.descend(at + 1, &coarse);
        each(
            &mut z,
            #[inline(always)]
            |row, z| z.iter_mut().zip(row_times(up, row, &correction)).for_each(|(z, c)| *z += c),
        );
        grid.smooth(self.gamma, &mut z, r, false, (CYCLE_DEGREE, CYCLE_LEAST));
        z
    }
}
