//! Blocks of eight columns, and their products with a wide basis: what a block Lanczos iteration works on. They are
//! bounded by the reading of the basis, which is why they have kernels of their own beside those of panels.

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use pulp::Simd;

use super::{MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, WeightedMass, vectorized};

/// Columns of a block: enough for a cache line, and few enough for the spaces that are made of them to grow by powers
/// of the operator.
pub const KRYLOV_WIDTH: usize = 8;

/// One row of a block.
pub type KrylovRow = [f64; KRYLOV_WIDTH];

/// A square matrix of the size of a block, row after row.
pub type KrylovSquare = [KrylovRow; KRYLOV_WIDTH];

/// Rows that are handled at once.
const ROWS: usize = 256;

/// Rows that one task handles.
const ROWS_PER_TASK: usize = 32 * ROWS;

/// `A x` for a block, into `out`.
fn matrix_times_block(matrix: &SparseMatrix, x: &[KrylovRow], out: &mut Vec<KrylovRow>) {
    assert_eq!(x.len(), matrix.columns(), "rows of a block");
    out.resize(matrix.rows(), [0.0; KRYLOV_WIDTH]);
    out.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, out)| {
        vectorized(
            out,
            #[inline(always)]
            |out| {
                for (row, out) in (task * ROWS_PER_TASK..).zip(out) {
                    let (columns, values) = matrix.row(row);
                    let mut acc = [0.0; KRYLOV_WIDTH];
                    for (&column, &value) in columns.iter().zip(values) {
                        let x = &x[column as usize];
                        for k in 0..KRYLOV_WIDTH {
                            acc[k] += value * x[k];
                        }
                    }
                    *out = acc;
                }
            },
        );
    });
}

/// `M x` for a block, into `out`.
///
/// # Panics
/// Where there are not as many rows as those of the matrix.
pub fn mass_times_block(mass: &MassMatrix, x: &[KrylovRow], out: &mut Vec<KrylovRow>) {
    let mass = match mass {
        MassMatrix::Diagonal(mass) => mass,
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
            return matrix_times_block(mass, x, out);
        }
    };
    assert_eq!(x.len(), mass.len(), "rows of a block");
    out.resize(x.len(), [0.0; KRYLOV_WIDTH]);
    let tasks = out.par_chunks_mut(ROWS_PER_TASK).zip(x.par_chunks(ROWS_PER_TASK)).zip(mass.par_chunks(ROWS_PER_TASK));
    tasks.for_each(|((out, x), mass)| {
        for ((out, x), mass) in out.iter_mut().zip(x).zip(mass) {
            *out = x.map(|x| mass * x);
        }
    });
}

/// `XᵀY` of two blocks.
///
/// # Panics
/// Where they have different numbers of rows.
pub fn block_products(x: &[KrylovRow], y: &[KrylovRow]) -> KrylovSquare {
    assert_eq!(x.len(), y.len(), "rows of two blocks");
    let products = |(rows, y): (&[KrylovRow], &[KrylovRow])| {
        let mut sums = [[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH];
        pulp::Arch::new().dispatch(Products { rows, y, sums: &mut sums });
        sums
    };
    summed(x.par_chunks(ROWS_PER_TASK).zip(y.par_chunks(ROWS_PER_TASK)).map(products).collect())
}

/// `XᵀMX` of a block; `scratch` is used for a mass that is not diagonal.
///
/// # Panics
/// Where there are not as many rows as those of the matrix.
pub fn block_gram(mass: &MassMatrix, x: &[KrylovRow], scratch: &mut Vec<KrylovRow>) -> KrylovSquare {
    let MassMatrix::Diagonal(mass) = mass else {
        mass_times_block(mass, x, scratch);
        return block_products(scratch, x);
    };
    assert_eq!(x.len(), mass.len(), "rows of a block");
    let gram = |(x, mass): (&[KrylovRow], &[f64])| {
        let mut sums = [[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH];
        let mut weighted = [[0.0; KRYLOV_WIDTH]; ROWS];
        for (x, mass) in x.chunks(ROWS).zip(mass.chunks(ROWS)) {
            for ((weighted, x), mass) in weighted.iter_mut().zip(x).zip(mass) {
                *weighted = x.map(|x| mass * x);
            }
            pulp::Arch::new().dispatch(Products { rows: &weighted[..x.len()], y: x, sums: &mut sums });
        }
        sums
    };
    summed(x.par_chunks(ROWS_PER_TASK).zip(mass.par_chunks(ROWS_PER_TASK)).map(gram).collect())
}

/// In the order of the tasks, so that the sum does not depend on threads.
fn summed(parts: Vec<KrylovSquare>) -> KrylovSquare {
    let mut sums = [[0.0; KRYLOV_WIDTH]; KRYLOV_WIDTH];
    for part in parts {
        for (sums, part) in sums.iter_mut().zip(part) {
            sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
    }
    sums
}

/// `Y ← Y − Σ X C` for a block and some others, each with its coefficients.
///
/// # Panics
/// Where they have different numbers of rows.
pub fn subtract_blocks(y: &mut [KrylovRow], others: &[(&[KrylovRow], KrylovSquare)]) {
    others.iter().for_each(|(x, _)| assert_eq!(x.len(), y.len(), "rows of two blocks"));
    let factors: Vec<KrylovSquare> = others.iter().map(|(_, c)| c.map(|row| row.map(|c| -c))).collect();
    y.par_chunks_mut(ROWS).enumerate().for_each(|(task, y)| {
        for ((x, _), factors) in others.iter().zip(&factors) {
            pulp::Arch::new().dispatch(Combine { rows: &x[task * ROWS..][..y.len()], factors, y: &mut *y });
        }
    });
}

/// `X ← X R` for a block.
pub fn block_times_square(x: &mut [KrylovRow], r: &KrylovSquare) {
    x.par_chunks_mut(ROWS_PER_TASK).for_each(|x| {
        vectorized(
            x,
            #[inline(always)]
            |x| {
                for x in x {
                    let mut acc = [0.0; KRYLOV_WIDTH];
                    for j in 0..KRYLOV_WIDTH {
                        for k in 0..KRYLOV_WIDTH {
                            acc[k] += x[j] * r[j][k];
                        }
                    }
                    *x = acc;
                }
            },
        );
    });
}

/// `BᵀY` for a basis of `q` columns, those of panels and then those of blocks, and some blocks `Y`: for each a row for
/// each column of the basis, which is read once for all of them.
///
/// # Errors
/// The monitor asked to stop.
///
/// # Panics
/// Where they have different numbers of rows.
pub fn basis_products<const K: usize>(
    (panels, blocks): (&PanelMatrix, &[Vec<KrylovRow>]),
    ys: [&[KrylovRow]; K],
    monitor: &dyn Monitor,
) -> Result<[Vec<KrylovRow>; K], Cancelled> {
    let rows = panels.rows();
    ys.iter().for_each(|y| assert_eq!(y.len(), rows, "rows of a basis and a block"));
    blocks.iter().for_each(|block| assert_eq!(block.len(), rows, "rows of a basis and a block"));
    let width = panels.panels().len() * PANEL_WIDTH;
    let nothing = || -> [Vec<KrylovRow>; K] {
        std::array::from_fn(|_| vec![[0.0; KRYLOV_WIDTH]; width + blocks.len() * KRYLOV_WIDTH])
    };
    let parts: Vec<[Vec<KrylovRow>; K]> = (0..rows.div_ceil(ROWS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            monitor.checkpoint()?;
            let mut sums = nothing();
            let end = rows.min((task + 1) * ROWS_PER_TASK);
            for from in (task * ROWS_PER_TASK..end).step_by(ROWS) {
                let range = from..end.min(from + ROWS);
                for (k, panel) in panels.panels().iter().enumerate() {
                    let rows = &panel.as_chunks::<PANEL_WIDTH>().0[range.clone()];
                    for (y, sums) in ys.iter().zip(&mut sums) {
                        let sums = &mut sums[..width].as_chunks_mut::<PANEL_WIDTH>().0[k];
                        pulp::Arch::new().dispatch(Products { rows, y: &y[range.clone()], sums });
                    }
                }
                for (k, block) in blocks.iter().enumerate() {
                    let rows = &block[range.clone()];
                    for (y, sums) in ys.iter().zip(&mut sums) {
                        let sums = &mut sums[width..].as_chunks_mut::<KRYLOV_WIDTH>().0[k];
                        pulp::Arch::new().dispatch(Products { rows, y: &y[range.clone()], sums });
                    }
                }
            }
            Ok(sums)
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut parts = parts.into_iter();
    let mut sums = parts.next().unwrap_or_else(nothing);
    for part in parts {
        for (sums, part) in sums.iter_mut().flatten().zip(part.iter().flatten()) {
            sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
    }
    Ok(sums)
}

/// `Y ← Y − B C` for some blocks, a basis of panels and blocks, and coefficients as [`basis_products`] gives them.
///
/// # Errors
/// The monitor asked to stop; the blocks are then of no further use.
///
/// # Panics
/// Where sizes do not fit.
pub fn subtract_from_blocks<const K: usize>(
    ys: [&mut [KrylovRow]; K],
    (panels, blocks): (&PanelMatrix, &[Vec<KrylovRow>]),
    coefficients: &[Vec<KrylovRow>; K],
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let (rows, width) = (panels.rows(), panels.panels().len() * PANEL_WIDTH);
    ys.iter().for_each(|y| assert_eq!(y.len(), rows, "rows of a basis and a block"));
    blocks.iter().for_each(|block| assert_eq!(block.len(), rows, "rows of a basis and a block"));
    let factors: [Vec<KrylovRow>; K] = std::array::from_fn(|k| {
        assert_eq!(coefficients[k].len(), width + blocks.len() * KRYLOV_WIDTH, "coefficients of a block");
        coefficients[k].iter().map(|row| row.map(|c| -c)).collect()
    });
    let mut tasks: Vec<Vec<&mut [KrylovRow]>> = (0..rows.div_ceil(ROWS)).map(|_| Vec::with_capacity(K)).collect();
    for y in ys {
        tasks.iter_mut().zip(y.chunks_mut(ROWS)).for_each(|(task, y)| task.push(y));
    }
    tasks.into_par_iter().enumerate().try_for_each(|(task, mut ys)| {
        monitor.checkpoint()?;
        let from = task * ROWS;
        let range = from..rows.min(from + ROWS);
        for (k, panel) in panels.panels().iter().enumerate() {
            let rows = &panel.as_chunks::<PANEL_WIDTH>().0[range.clone()];
            for (y, factors) in ys.iter_mut().zip(&factors) {
                let factors = &factors[..width].as_chunks::<PANEL_WIDTH>().0[k];
                pulp::Arch::new().dispatch(Combine { rows, factors, y });
            }
        }
        for (k, block) in blocks.iter().enumerate() {
            for (y, factors) in ys.iter_mut().zip(&factors) {
                let factors = &factors[width..].as_chunks::<KRYLOV_WIDTH>().0[k];
                pulp::Arch::new().dispatch(Combine { rows: &block[range.clone()], factors, y });
            }
        }
        Ok(())
    })
}

/// Puts blocks behind the columns of a basis, in memory of panels that are not needed any more where there are such.
///
/// # Panics
/// Where they have another number of rows, the columns do not end with a panel, or there are more blocks than make up a
/// panel.
pub fn append_blocks(basis: &mut PanelMatrix, blocks: &[Vec<KrylovRow>], spare: &mut Vec<Vec<f64>>) {
    let columns = basis.columns();
    blocks.iter().for_each(|block| assert_eq!(basis.rows(), block.len(), "rows of a basis and a block"));
    assert!(columns.is_multiple_of(PANEL_WIDTH) && blocks.len() * KRYLOV_WIDTH <= PANEL_WIDTH, "blocks of one panel");
    basis.widen_into(columns + blocks.len() * KRYLOV_WIDTH, spare);
    let Some(panel) = basis.panels_mut().get_mut(columns / PANEL_WIDTH) else { return };
    panel.par_chunks_mut(ROWS_PER_TASK * PANEL_WIDTH).enumerate().for_each(|(task, panel)| {
        for (row, to) in (task * ROWS_PER_TASK..).zip(panel.chunks_exact_mut(PANEL_WIDTH)) {
            to.chunks_exact_mut(KRYLOV_WIDTH).zip(blocks).for_each(|(to, block)| to.copy_from_slice(&block[row]));
            to[blocks.len() * KRYLOV_WIDTH..].fill(0.0);
        }
    });
}

/// Adds `rowsᵀ y` to sums.
struct Products<'a, const W: usize> {
    rows: &'a [[f64; W]],
    y: &'a [KrylovRow],
    sums: &'a mut [KrylovRow; W],
}

impl<const W: usize> pulp::WithSimd for Products<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // So many vectors of a row of the basis, and columns of the block, as their products leave registers for.
        match (W, S::F64_LANES, S::REGISTER_COUNT) {
            (32, 8, 32) => self.run::<S, 2, 8>(simd),
            (_, 8, _) => self.run::<S, 1, 8>(simd),
            _ => self.run::<S, 2, 4>(simd),
        }
    }
}

impl<const W: usize> Products<'_, W> {
    #[inline(always)]
    fn run<S: Simd, const V: usize, const J: usize>(self, simd: S) {
        let Self { rows, y, sums } = self;
        for first in (0..W / S::F64_LANES).step_by(V) {
            for column in (0..KRYLOV_WIDTH).step_by(J) {
                let mut acc = [[simd.splat_f64s(0.0); V]; J];
                for (row, y) in rows.iter().zip(y) {
                    let row = S::as_simd_f64s(row).0;
                    let x: [S::f64s; V] = std::array::from_fn(|v| row[first + v]);
                    for j in 0..J {
                        let factor = simd.splat_f64s(y[column + j]);
                        for v in 0..V {
                            acc[j][v] = simd.mul_add_f64s(factor, x[v], acc[j][v]);
                        }
                    }
                }
                for j in 0..J {
                    for v in 0..V {
                        let mut lanes = [0.0; W];
                        S::as_mut_simd_f64s(&mut lanes).0[0] = acc[j][v];
                        let at = (first + v) * S::F64_LANES;
                        for lane in 0..S::F64_LANES {
                            sums[at + lane][column + j] += lanes[lane];
                        }
                    }
                }
            }
        }
    }
}

/// Adds `rows · factors` to a block.
struct Combine<'a, const W: usize> {
    rows: &'a [[f64; W]],
    factors: &'a [KrylovRow; W],
    y: &'a mut [KrylovRow],
}

impl<const W: usize> pulp::WithSimd for Combine<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F64_LANES {
            8 => self.run::<S, 1, 8>(simd),
            4 => self.run::<S, 2, 4>(simd),
            2 => self.run::<S, 4, 2>(simd),
            _ => self.run::<S, 8, 1>(simd),
        }
    }
}

impl<const W: usize> Combine<'_, W> {
    /// `R` rows of `V` vectors are handled at once.
    #[inline(always)]
    fn run<S: Simd, const V: usize, const R: usize>(self, simd: S) {
        let Self { rows, factors, y } = self;
        let (several, ones) = y.as_chunks_mut::<R>();
        let (several_rows, one_rows) = rows.as_chunks::<R>();
        for (y, rows) in several.iter_mut().zip(several_rows) {
            combine::<S, V, R, W>(simd, rows, factors, y);
        }
        for (y, row) in ones.iter_mut().zip(one_rows) {
            combine::<S, V, 1, W>(simd, std::array::from_ref(row), factors, std::array::from_mut(y));
        }
    }
}

#[inline(always)]
fn combine<S: Simd, const V: usize, const R: usize, const W: usize>(
    simd: S,
    rows: &[[f64; W]; R],
    factors: &[KrylovRow; W],
    y: &mut [KrylovRow; R],
) {
    let load = |row: &KrylovRow| -> [S::f64s; V] {
        let vectors = S::as_simd_f64s(row).0;
        std::array::from_fn(|v| vectors[v])
    };
    let mut acc: [[S::f64s; V]; R] = std::array::from_fn(|r| load(&y[r]));
    for k in 0..W {
        let factor = load(&factors[k]);
        for r in 0..R {
            let x = simd.splat_f64s(rows[r][k]);
            for v in 0..V {
                acc[r][v] = simd.mul_add_f64s(x, factor[v], acc[r][v]);
            }
        }
    }
    for r in 0..R {
        S::as_mut_simd_f64s(&mut y[r]).0.copy_from_slice(&acc[r]);
    }
}

#[cfg(test)]
#[path = "krylov_block_tests.rs"]
mod tests;
