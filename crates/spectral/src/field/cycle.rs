//! Multigrid cycles for `S + γM` on all faces, any γ > 0, in single precision: what preconditions solves in the space of all fields.
//!
//! The levels are those of [`super::hierarchy`]; γ may differ from call to call, so that one hierarchy serves every choice of weights. The smoother
//! is a Chebyshev polynomial, the same before and after the coarse correction: a cycle is symmetric and positive definite.

use chladni_algebra::{BlockMatrix, DefiniteFactor, DenseMatrix};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};

use super::hierarchy::{Level, row_scales};
use super::smooth::{CYCLE_DEGREE, CYCLE_LEAST, Rows, Small, chebyshev};

/// Degree of the smoother and the lower end of what it damps on the coarsest level, where that is too large to be factored.
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

/// `y = A x`.
fn multiply<const B: usize>(rows: &Rows<B>, x: &[[f32; B]], y: &mut [[f32; B]]) {
    each(y, |row, y| {
        *y = [0.0; B];
        for at in rows.range(row) {
            add(y, &rows.blocks[at], &x[rows.indices[at] as usize]);
        }
    });
}

/// For each number of a vector, in parallel.
fn each<T: Send>(vector: &mut [T], act: impl Fn(usize, &mut T) + Sync) {
    vector.par_chunks_mut(ROWS).enumerate().for_each(|(task, chunk)| {
        chunk.iter_mut().enumerate().for_each(|(k, value)| act(task * ROWS + k, value));
    });
}

#[inline(always)]
fn add<const B: usize>(y: &mut [f32; B], block: &Small<B>, x: &[f32; B]) {
    for i in 0..B {
        for j in 0..B {
            y[i] += block[i][j] * x[j];
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
    pub fn new(levels: &[Level<B>], monitor: &dyn Monitor) -> Result<Self, Cancelled> {
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
    fn new(level: &Level<B>, finest: bool, transfer: Option<(Rows<B>, Rows<B>)>) -> Self {
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

    /// `y = (S + γM) x`.
    fn multiply(&self, gamma: f32, x: &[[f32; B]], y: &mut [[f32; B]]) {
        let rows = &self.stiffness;
        each(y, |row, y| {
            *y = [0.0; B];
            if self.mass.is_empty() {
                y.iter_mut().zip(&x[row]).for_each(|(y, x)| *y = gamma * self.masses[row] * x);
                for at in rows.range(row) {
                    add(y, &rows.blocks[at], &x[rows.indices[at] as usize]);
                }
            } else {
                for at in rows.range(row) {
                    let (s, m) = (&rows.blocks[at], &self.mass[at]);
                    let block = std::array::from_fn(|i| std::array::from_fn(|j| s[i][j] + gamma * m[i][j]));
                    add(y, &block, &x[rows.indices[at] as usize]);
                }
            }
        });
    }

    /// Chebyshev steps towards `(S + γM) z = r`; `zero` says that `z` is.
    fn smooth(&self, gamma: f32, z: &mut Vector<B>, r: &[[f32; B]], zero: bool, (degree, least): (usize, f32)) {
        let mut product = vec![[0f32; B]; z.len()];
        let mut change = vec![[0f32; B]; z.len()];
        for (step, (keep, add)) in chebyshev(degree, least).enumerate() {
            if step > 0 || !zero {
                self.multiply(gamma, z, &mut product);
            }
            each(&mut change, |row, change| {
                let scale = self.stiffness_scales[row] + gamma * self.mass_scales[row];
                let add = if scale > 0.0 { add / scale } else { 0.0 };
                for i in 0..B {
                    change[i] = keep * change[i] + add * (r[row][i] - product[row][i]);
                }
            });
            each(z, |row, z| z.iter_mut().zip(&change[row]).for_each(|(z, c)| *z += c));
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
        grid.multiply(self.gamma, &z, &mut residual);
        each(&mut residual, |row, residual| residual.iter_mut().zip(&r[row]).for_each(|(own, r)| *own = r - *own));
        let mut coarse = vec![[0f32; B]; down.offsets.len() - 1];
        multiply(down, &residual, &mut coarse);
        let correction = self.descend(at + 1, &coarse);
        multiply(up, &correction, &mut residual);
        each(&mut z, |row, z| z.iter_mut().zip(&residual[row]).for_each(|(z, c)| *z += c));
        grid.smooth(self.gamma, &mut z, r, false, (CYCLE_DEGREE, CYCLE_LEAST));
        z
    }
}
