//! Residuals `R = A X − M X Θ` as a whole, and what rounding does to them: what bounds on eigenvalues are made of.

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::dense::sum_of_lower;
use super::panels::PanelRow;
use super::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, WeightedMass, residual_panel_rows, vectorized,
};

/// Rows that are multiplied at once.
const ROWS: usize = 256;

/// Panels that make up one block of columns of the result.
const GROUP: usize = 3;

/// `RᵀW⁻¹R`, `q × q`, for the residuals `R = A X − M X Θ` of `q` columns with the values `Θ`, and `W` the lumped mass.
///
/// # Errors
/// The monitor asked to stop.
pub fn residual_gram(
    a: &SparseMatrix,
    mass: &MassMatrix,
    x: &PanelMatrix,
    values: &[f64],
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, Cancelled> {
    let (n, q) = (x.rows(), x.columns().min(values.len()));
    let scales: Vec<f64> = mass.lumped().iter().map(|m| m.sqrt().recip()).collect();
    let panels: Vec<&[PanelRow]> = x.panels().iter().map(|panel| panel.as_chunks::<PANEL_WIDTH>().0).collect();
    let width = panels.len() * PANEL_WIDTH;
    let segments = (n / (8 * ROWS)).clamp(1, 8);
    let segment = n.div_ceil(segments).next_multiple_of(ROWS);
    let parts: Vec<DenseMatrix> = (0..segments)
        .into_par_iter()
        .map(|s| {
            let mut sums = DenseMatrix::zeros(width, width);
            let mut block = vec![0.0; ROWS * width];
            let mut rest = vec![[0.0; PANEL_WIDTH]; ROWS];
            let (mut from, end) = ((s * segment).min(n), n.min((s + 1) * segment));
            while from < end {
                monitor.checkpoint()?;
                let to = end.min(from + ROWS);
                for (k, (panel, values)) in panels.iter().zip(values.chunks(PANEL_WIDTH)).enumerate() {
                    residual_panel_rows(a, mass, panel, values, from..to, &mut rest[..to - from]);
                    for ((row, rest), scale) in
                        block.chunks_exact_mut(width).zip(&rest[..to - from]).zip(&scales[from..to])
                    {
                        let into = &mut row[k * PANEL_WIDTH..(k + 1) * PANEL_WIDTH];
                        into.iter_mut().zip(rest).for_each(|(into, r)| *into = scale * r);
                    }
                }
                let rows = MatRef::from_row_major_slice(&block[..(to - from) * width], to - from, width);
                let mut sums = MatMut::from_column_major_slice_mut(sums.values_mut(), width, width);
                for start in (0..width).step_by(GROUP * PANEL_WIDTH) {
                    // The lower triangle alone.
                    let columns = (GROUP * PANEL_WIDTH).min(width - start);
                    matmul(
                        sums.as_mut().submatrix_mut(start, start, width - start, columns),
                        Accum::Add,
                        rows.subcols(start, width - start).transpose(),
                        rows.subcols(start, columns),
                        1.0,
                        Par::Seq,
                    );
                }
                from = to;
            }
            Ok(sums)
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(sum_of_lower(&parts, q))
}

/// Sums over `t = |A| |x| + (|θ| + |offset|) |M| |x|`, the magnitudes that the residual of one column is a difference
/// of: rounding errors are a few units of them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Magnitudes {
    /// `‖t‖²`.
    pub square: f64,
    /// The same in the norm of the inverse of the lumped mass.
    pub dual: f64,
    /// `|x|ᵀt`.
    pub product: f64,
}

/// The magnitudes of every column of `x` with its value; `offset` is the part of the values that was taken off the
/// matrix.
///
/// # Errors
/// The monitor asked to stop.
pub fn residual_magnitudes(
    a: &SparseMatrix,
    mass: &MassMatrix,
    x: &PanelMatrix,
    values: &[f64],
    offset: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Magnitudes>, Cancelled> {
    let lumped = mass.lumped();
    let sums: Vec<Vec<Magnitudes>> = x
        .panels()
        .par_iter()
        .zip(values.par_chunks(PANEL_WIDTH))
        .map(|(panel, values)| {
            monitor.checkpoint()?;
            let panel = panel.as_chunks::<PANEL_WIDTH>().0;
            let mut theta = [0.0; PANEL_WIDTH];
            theta.iter_mut().zip(values).for_each(|(theta, value)| *theta = value.abs() + offset.abs());
            let mut sums = [[0.0; PANEL_WIDTH]; 3];
            vectorized(
                &mut sums,
                #[inline(always)]
                |[square, dual, product]| {
                    for (row, x) in panel.iter().enumerate() {
                        let mut magnitude = [0.0; PANEL_WIDTH];
                        let (columns, entries) = a.row(row);
                        for (&column, entry) in columns.iter().zip(entries) {
                            let (x, entry) = (&panel[column as usize], entry.abs());
                            for k in 0..PANEL_WIDTH {
                                magnitude[k] += entry * x[k].abs();
                            }
                        }
                        match mass {
                            MassMatrix::Diagonal(mass) => {
                                for k in 0..PANEL_WIDTH {
                                    magnitude[k] += theta[k] * mass[row] * x[k].abs();
                                }
                            }
                            MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                                let (columns, entries) = mass.row(row);
                                for (&column, entry) in columns.iter().zip(entries) {
                                    let (x, entry) = (&panel[column as usize], entry.abs());
                                    for k in 0..PANEL_WIDTH {
                                        magnitude[k] += theta[k] * entry * x[k].abs();
                                    }
                                }
                            }
                        }
                        let weight = lumped[row].recip();
                        for k in 0..PANEL_WIDTH {
                            square[k] += magnitude[k] * magnitude[k];
                            dual[k] += magnitude[k] * magnitude[k] * weight;
                            product[k] += x[k].abs() * magnitude[k];
                        }
                    }
                },
            );
            let column = |k: usize| Magnitudes { square: sums[0][k], dual: sums[1][k], product: sums[2][k] };
            Ok((0..values.len()).map(column).collect())
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(sums.into_iter().flatten().collect())
}
