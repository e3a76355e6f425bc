//! Products with panel matrices: Gram matrices, rotations, prolongation, residuals. Threads share the rows or the
//! columns in a way that does not depend on their number, so that results do not either.

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::panels::PanelRow;
use super::product::Scalar;
use super::{DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, WeightedMass, vectorized};

/// Rows that are multiplied at once: with all columns of a few hundred they fit the second-level cache.
const ROWS: usize = 256;

/// Panels that make up one task of a Gram matrix.
const GROUP: usize = 3;

/// `y ← rows · x` for some rows of a sparse matrix and one panel.
fn multiply_rows<T: Scalar>(
    matrix: &SparseMatrix<T>,
    rows: std::ops::Range<usize>,
    x: &[PanelRow],
    out: &mut [PanelRow],
) {
    vectorized(
        out,
        #[inline(always)]
        |out| {
            for (row, out) in rows.clone().zip(out) {
                let (columns, values) = matrix.row(row);
                let mut acc = [0.0; PANEL_WIDTH];
                for (&column, &value) in columns.iter().zip(values) {
                    let value = value.wide();
                    if let Some(x) = x.get(column as usize) {
                        for k in 0..PANEL_WIDTH {
                            acc[k] += value * x[k];
                        }
                    }
                }
                *out = acc;
            }
        },
    );
}

/// `y ← M x` for some rows and one panel.
fn mass_rows(mass: &MassMatrix, rows: std::ops::Range<usize>, x: &[PanelRow], out: &mut [PanelRow]) {
    match mass {
        MassMatrix::Diagonal(mass) => {
            for ((out, x), mass) in out.iter_mut().zip(&x[rows.clone()]).zip(&mass[rows]) {
                for k in 0..PANEL_WIDTH {
                    out[k] = mass * x[k];
                }
            }
        }
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
            multiply_rows(mass, rows, x, out)
        }
    }
}

fn rows_of(panel: &[f64]) -> &[PanelRow] {
    panel.as_chunks::<PANEL_WIDTH>().0
}

fn rows_of_mut(panel: &mut [f64]) -> &mut [PanelRow] {
    panel.as_chunks_mut::<PANEL_WIDTH>().0
}

/// `M x` for one panel of 32 columns, into `out`.
pub fn mass_times_panel(mass: &MassMatrix, x: &[f64], out: &mut [f64]) {
    let x = rows_of(x);
    mass_rows(mass, 0..x.len(), x, rows_of_mut(out));
}

/// `x ← M x` for one panel of 32 columns; `scratch` is used for a mass that is not diagonal.
pub fn apply_mass(mass: &MassMatrix, x: &mut Vec<f64>, scratch: &mut Vec<f64>) {
    match mass {
        MassMatrix::Diagonal(mass) => {
            for (row, mass) in rows_of_mut(x).iter_mut().zip(mass) {
                row.iter_mut().for_each(|x| *x *= mass);
            }
        }
        MassMatrix::Sparse(_) | MassMatrix::Weighted(_) => {
            scratch.resize(x.len(), 0.0);
            mass_times_panel(mass, x, scratch);
            std::mem::swap(x, scratch);
        }
    }
}

/// `U X`: the columns of `x` prolonged.
///
/// # Panics
/// Unless `x` has a row for each column of `space`.
pub fn prolong<T: Scalar>(space: &SparseMatrix<T>, x: &PanelMatrix) -> PanelMatrix {
    assert_eq!(space.columns(), x.rows(), "a space of so many columns for vectors of so many rows");
    let mut y = PanelMatrix::zeros(space.rows(), x.columns());
    y.panels_mut().par_iter_mut().zip(x.panels()).for_each(|(y, x)| {
        let x = rows_of(x);
        rows_of_mut(y)
            .par_chunks_mut(8 * ROWS)
            .enumerate()
            .for_each(|(part, out)| multiply_rows(space, part * 8 * ROWS..part * 8 * ROWS + out.len(), x, out));
    });
    y
}

/// The symmetric matrix `W` of an inner product `xᵀWy`.
#[derive(Debug, Clone, Copy)]
pub enum Weight<'a> {
    /// A mass matrix.
    Mass(&'a MassMatrix),
    /// A stiffness matrix.
    Stiffness(&'a SparseMatrix),
}

impl Weight<'_> {
    fn size(&self) -> usize {
        match self {
            Self::Mass(mass) => mass.size(),
            Self::Stiffness(matrix) => matrix.rows(),
        }
    }

    /// Some rows of `W x` for one panel.
    fn rows(&self, rows: std::ops::Range<usize>, x: &[PanelRow], out: &mut [PanelRow]) {
        match self {
            Self::Mass(mass) => mass_rows(mass, rows, x, out),
            Self::Stiffness(matrix) => multiply_rows(matrix, rows, x, out),
        }
    }
}

/// The restricted pencil `XᵀAX` and `XᵀMX`, both `q × q`. Only the lower triangles are formed, and mirrored.
///
/// # Errors
/// The monitor asked to stop.
pub fn restrict(
    a: &SparseMatrix,
    mass: &MassMatrix,
    x: &PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<(DenseMatrix, DenseMatrix), Cancelled> {
    let mut both = symmetric_products([Weight::Stiffness(a), Weight::Mass(mass)], x, monitor)?.into_iter();
    Ok((both.next().unwrap_or_default(), both.next().unwrap_or_default()))
}

/// `XᵀMX`, `q × q`.
///
/// # Errors
/// The monitor asked to stop.
pub fn gram(mass: &MassMatrix, x: &PanelMatrix, monitor: &dyn Monitor) -> Result<DenseMatrix, Cancelled> {
    let [gram] = symmetric_products([Weight::Mass(mass)], x, monitor)?;
    Ok(gram)
}

/// `XᵀWX` for some weights.
fn symmetric_products<const K: usize>(
    weights: [Weight<'_>; K],
    x: &PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<[DenseMatrix; K], Cancelled> {
    let (n, q) = (x.rows(), x.columns());
    weights.iter().for_each(|weight| assert_eq!(weight.size(), n, "rows of columns and of a weight"));
    let panels: Vec<&[PanelRow]> = x.panels().iter().map(|panel| rows_of(panel)).collect();
    let segments = (n / (32 * ROWS)).clamp(1, 4);
    let segment = n.div_ceil(segments).next_multiple_of(ROWS);
    let groups = panels.len().div_ceil(GROUP);
    // Long tasks first.
    let tasks: Vec<(usize, usize)> = (0..groups).flat_map(|group| (0..segments).map(move |s| (group, s))).collect();
    let parts: Vec<(usize, DenseMatrix)> = tasks
        .into_par_iter()
        .map(|(group, s)| {
            let first = group * GROUP;
            let last = (first + GROUP).min(panels.len());
            let (left, right) = ((panels.len() - first) * PANEL_WIDTH, K * (last - first) * PANEL_WIDTH);
            let mut sums = DenseMatrix::zeros(left, right);
            let (mut tall, mut wide) = (vec![0.0; ROWS * left], vec![0.0; ROWS * right]);
            let mut scratch = vec![[0.0; PANEL_WIDTH]; ROWS];
            let mut from = s * segment;
            let end = n.min(from + segment);
            while from < end {
                monitor.checkpoint()?;
                let to = end.min(from + ROWS);
                let rows = to - from;
                for (k, panel) in panels[first..].iter().enumerate() {
                    scatter(&panel[from..to], &mut tall, left, k);
                }
                for (k, panel) in panels[first..last].iter().enumerate() {
                    for (w, weight) in weights.iter().enumerate() {
                        weight.rows(from..to, panel, &mut scratch[..rows]);
                        scatter(&scratch[..rows], &mut wide, right, w * (last - first) + k);
                    }
                }
                matmul(
                    MatMut::from_column_major_slice_mut(sums.values_mut(), left, right),
                    Accum::Add,
                    MatRef::from_column_major_slice(&tall[..rows * left], left, rows),
                    MatRef::from_row_major_slice(&wide[..rows * right], rows, right),
                    1.0,
                    Par::Seq,
                );
                from = to;
            }
            Ok((group, sums))
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut products: [DenseMatrix; K] = std::array::from_fn(|_| DenseMatrix::zeros(q, q));
    for (group, sums) in &parts {
        let start = group * GROUP * PANEL_WIDTH;
        let width = sums.columns() / K;
        for (w, product) in products.iter_mut().enumerate() {
            for k in 0..width.min(q - start) {
                let from = &sums.column(w * width + k)[k..q - start];
                let into = &mut product.column_mut(start + k)[start + k..];
                into.iter_mut().zip(from).for_each(|(into, from)| *into += from);
            }
        }
    }
    for product in &mut products {
        for column in 0..q {
            for row in column + 1..q {
                let value = product.column(column)[row];
                product.column_mut(row)[column] = value;
            }
        }
    }
    Ok(products)
}

/// Rows of a panel into the columns `32 k..` of a row-major matrix of the given width.
fn scatter(panel: &[PanelRow], into: &mut [f64], width: usize, k: usize) {
    for (into, row) in into.chunks_exact_mut(width).zip(panel) {
        into[k * PANEL_WIDTH..(k + 1) * PANEL_WIDTH].copy_from_slice(row);
    }
}

/// `X ← X Z` in place, for `X` of `q` columns and `Z` of `q × p`, `p ≤ q`.
///
/// # Errors
/// The monitor asked to stop; `x` is then of no further use.
///
/// # Panics
/// Where sizes do not fit.
pub fn rotate(x: &mut PanelMatrix, z: &DenseMatrix, monitor: &dyn Monitor) -> Result<(), Cancelled> {
    rotate_and_spare(x, z, monitor).map(drop)
}

/// The same; gives the panels that are not used any more, as memory for others.
///
/// # Errors
/// As for [`rotate`].
///
/// # Panics
/// As for [`rotate`].
pub fn rotate_and_spare(
    x: &mut PanelMatrix,
    z: &DenseMatrix,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>, Cancelled> {
    let (n, q, p) = (x.rows(), x.columns(), z.columns());
    assert!(z.rows() == q && p <= q, "{q} columns times a {}×{p} matrix", z.rows());
    let width = x.panels().len() * PANEL_WIDTH;
    let padded = p.next_multiple_of(PANEL_WIDTH).min(width);
    // Z with the same padding as the panels, so that unused columns come out zero.
    let mut factor = DenseMatrix::zeros(width, padded);
    for column in 0..p {
        factor.column_mut(column)[..q].copy_from_slice(z.column(column));
    }
    let mut tasks: Vec<Vec<&mut [PanelRow]>> = (0..n.div_ceil(ROWS)).map(|_| Vec::new()).collect();
    for panel in x.panels_mut() {
        for (task, rows) in tasks.iter_mut().zip(rows_of_mut(panel).chunks_mut(ROWS)) {
            task.push(rows);
        }
    }
    tasks.into_par_iter().try_for_each_init(
        || (vec![0.0; ROWS * width], vec![0.0; ROWS * padded]),
        |(from, to), mut panels| {
            monitor.checkpoint()?;
            let rows = panels.first().map_or(0, |panel| panel.len());
            for (k, panel) in panels.iter().enumerate() {
                scatter(panel, from, width, k);
            }
            matmul(
                MatMut::from_row_major_slice_mut(&mut to[..rows * padded], rows, padded),
                Accum::Replace,
                MatRef::from_row_major_slice(&from[..rows * width], rows, width),
                MatRef::from_column_major_slice(factor.values(), width, padded),
                1.0,
                Par::Seq,
            );
            for (k, panel) in panels.iter_mut().take(padded / PANEL_WIDTH).enumerate() {
                for (row, to) in panel.iter_mut().zip(to.chunks_exact(padded)) {
                    row.copy_from_slice(&to[k * PANEL_WIDTH..(k + 1) * PANEL_WIDTH]);
                }
            }
            Ok(())
        },
    )?;
    Ok(x.split_off(p))
}

/// `XᵀWY`, for `X` of `q` and `Y` of `k` columns: `q × k`.
///
/// # Errors
/// The monitor asked to stop.
///
/// # Panics
/// Where sizes do not fit.
pub fn inner_products(
    x: &PanelMatrix,
    weight: Weight<'_>,
    y: &PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<DenseMatrix, Cancelled> {
    let n = x.rows();
    assert!(y.rows() == n && weight.size() == n, "products of columns of {n} and {} rows", y.rows());
    let (left, right) = (x.panels().len() * PANEL_WIDTH, y.panels().len() * PANEL_WIDTH);
    let segments = (n / (8 * ROWS)).clamp(1, 8);
    let segment = n.div_ceil(segments).next_multiple_of(ROWS);
    let parts: Vec<DenseMatrix> = (0..segments)
        .into_par_iter()
        .map(|s| {
            let mut sums = DenseMatrix::zeros(left, right);
            let (mut tall, mut wide) = (vec![0.0; ROWS * left], vec![0.0; ROWS * right]);
            let mut scratch = vec![[0.0; PANEL_WIDTH]; ROWS];
            let (mut from, end) = ((s * segment).min(n), n.min((s + 1) * segment));
            while from < end {
                monitor.checkpoint()?;
                let to = end.min(from + ROWS);
                let rows = to - from;
                for (k, panel) in x.panels().iter().enumerate() {
                    scatter(&rows_of(panel)[from..to], &mut tall, left, k);
                }
                for (k, panel) in y.panels().iter().enumerate() {
                    weight.rows(from..to, rows_of(panel), &mut scratch[..rows]);
                    scatter(&scratch[..rows], &mut wide, right, k);
                }
                matmul(
                    MatMut::from_column_major_slice_mut(sums.values_mut(), left, right),
                    Accum::Add,
                    MatRef::from_column_major_slice(&tall[..rows * left], left, rows),
                    MatRef::from_row_major_slice(&wide[..rows * right], rows, right),
                    1.0,
                    Par::Seq,
                );
                from = to;
            }
            Ok(sums)
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut products = DenseMatrix::zeros(x.columns(), y.columns());
    for part in &parts {
        for column in 0..y.columns() {
            products.column_mut(column).iter_mut().zip(part.column(column)).for_each(|(sum, part)| *sum += part);
        }
    }
    Ok(products)
}

/// `Y ← Y − X C`.
///
/// # Errors
/// The monitor asked to stop; `y` is then of no further use.
///
/// # Panics
/// Where sizes do not fit.
pub fn subtract_combinations(
    y: &mut PanelMatrix,
    x: &PanelMatrix,
    c: &DenseMatrix,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let (n, q, k) = (x.rows(), x.columns(), y.columns());
    assert_eq!((y.rows(), c.rows(), c.columns()), (n, q, k), "{k} columns less combinations of {q}");
    let (left, right) = (x.panels().len() * PANEL_WIDTH, y.panels().len() * PANEL_WIDTH);
    let mut factor = DenseMatrix::zeros(left, right);
    for column in 0..k {
        factor.column_mut(column)[..q].copy_from_slice(c.column(column));
    }
    let mut tasks: Vec<Vec<&mut [PanelRow]>> = (0..n.div_ceil(ROWS)).map(|_| Vec::new()).collect();
    for panel in y.panels_mut() {
        for (task, rows) in tasks.iter_mut().zip(rows_of_mut(panel).chunks_mut(ROWS)) {
            task.push(rows);
        }
    }
    tasks.into_par_iter().enumerate().try_for_each_init(
        || (vec![0.0; ROWS * left], vec![0.0; ROWS * right]),
        |(from, to), (task, mut panels)| {
            monitor.checkpoint()?;
            let start = task * ROWS;
            let rows = panels.first().map_or(0, |panel| panel.len());
            for (k, panel) in x.panels().iter().enumerate() {
                scatter(&rows_of(panel)[start..start + rows], from, left, k);
            }
            matmul(
                MatMut::from_row_major_slice_mut(&mut to[..rows * right], rows, right),
                Accum::Replace,
                MatRef::from_row_major_slice(&from[..rows * left], rows, left),
                MatRef::from_column_major_slice(factor.values(), left, right),
                1.0,
                Par::Seq,
            );
            for (k, panel) in panels.iter_mut().enumerate() {
                for (row, to) in panel.iter_mut().zip(to.chunks_exact(right)) {
                    row.iter_mut().zip(&to[k * PANEL_WIDTH..]).for_each(|(y, product)| *y -= product);
                }
            }
            Ok(())
        },
    )
}

/// `A x − θ M x` for one panel of 32 columns, into `out`.
pub fn residual_panel(a: &SparseMatrix, mass: &MassMatrix, x: &[f64], values: &[f64], out: &mut [f64]) {
    let (x, out) = (rows_of(x), rows_of_mut(out));
    for (chunk, out) in out.chunks_mut(ROWS).enumerate() {
        residual_panel_rows(a, mass, x, values, chunk * ROWS..chunk * ROWS + out.len(), out);
    }
}

/// The same for some rows, at most a few hundred.
pub(super) fn residual_panel_rows(
    a: &SparseMatrix,
    mass: &MassMatrix,
    x: &[PanelRow],
    values: &[f64],
    rows: std::ops::Range<usize>,
    out: &mut [PanelRow],
) {
    let mut theta = [0.0; PANEL_WIDTH];
    theta.iter_mut().zip(values).for_each(|(theta, value)| *theta = *value);
    let mut scratch = [[0.0; PANEL_WIDTH]; ROWS];
    let scratch = &mut scratch[..rows.len().min(ROWS)];
    multiply_rows(a, rows.clone(), x, out);
    mass_rows(mass, rows, x, scratch);
    for (out, mx) in out.iter_mut().zip(scratch) {
        for k in 0..PANEL_WIDTH {
            out[k] -= theta[k] * mx[k];
        }
    }
}

/// What one column of a residual sums up to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ColumnSums {
    /// `‖A x − θ M x‖²`.
    pub residual: f64,
    /// The same in the norm of the inverse of the lumped mass.
    pub dual: f64,
    /// `xᵀ(A x − θ M x)`: zero where `θ` is the Rayleigh quotient of `x`.
    pub product: f64,
    /// `‖A x‖²`.
    pub stiffness: f64,
    /// `‖x‖²`.
    pub square: f64,
    /// `xᵀMx`.
    pub mass: f64,
    /// The largest entry, at least zero.
    pub highest: f64,
    /// The smallest entry, at most zero.
    pub lowest: f64,
}

/// Residual sums of every column of `x` for its value `θ`; one for each value.
///
/// # Errors
/// The monitor asked to stop.
pub fn residual_sums(
    a: &SparseMatrix,
    mass: &MassMatrix,
    x: &PanelMatrix,
    values: &[f64],
    monitor: &dyn Monitor,
) -> Result<Vec<ColumnSums>, Cancelled> {
    let lumped = mass.lumped();
    let sums: Vec<Vec<ColumnSums>> = x
        .panels()
        .par_iter()
        .zip(values.par_chunks(PANEL_WIDTH))
        .map(|(panel, values)| {
            let panel = rows_of(panel);
            let mut theta = [0.0; PANEL_WIDTH];
            theta[..values.len()].copy_from_slice(values);
            let mut sums = [[0.0; PANEL_WIDTH]; 8];
            let mut stiffness = vec![[0.0; PANEL_WIDTH]; ROWS];
            let mut inertia = vec![[0.0; PANEL_WIDTH]; ROWS];
            let mut from = 0;
            while from < panel.len() {
                monitor.checkpoint()?;
                let to = panel.len().min(from + ROWS);
                multiply_rows(a, from..to, panel, &mut stiffness[..to - from]);
                mass_rows(mass, from..to, panel, &mut inertia[..to - from]);
                vectorized(
                    &mut sums,
                    #[inline(always)]
                    |[residual, dual, coupling, square_a, square, product, highest, lowest]| {
                        for row in from..to {
                            let (ax, mx, x) = (&stiffness[row - from], &inertia[row - from], &panel[row]);
                            let weight = lumped[row].recip();
                            for k in 0..PANEL_WIDTH {
                                let r = ax[k] - theta[k] * mx[k];
                                residual[k] += r * r;
                                dual[k] += r * r * weight;
                                coupling[k] += x[k] * r;
                                square_a[k] += ax[k] * ax[k];
                                square[k] += x[k] * x[k];
                                product[k] += x[k] * mx[k];
                                highest[k] = highest[k].max(x[k]);
                                lowest[k] = lowest[k].min(x[k]);
                            }
                        }
                    },
                );
                from = to;
            }
            let column = |k: usize| ColumnSums {
                residual: sums[0][k],
                dual: sums[1][k],
                product: sums[2][k],
                stiffness: sums[3][k],
                square: sums[4][k],
                mass: sums[5][k],
                highest: sums[6][k],
                lowest: sums[7][k],
            };
            Ok((0..values.len()).map(column).collect())
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(sums.into_iter().flatten().collect())
}
