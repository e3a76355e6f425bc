//! Restricting a sparse pencil to a space of locally supported functions: `UᵀSU` and `UᵀMU`.
//!
//! The rows of `U` are gathered into cells, one for each column: the rows whose largest entry lies there. The rows of a
//! cell share most of their columns, so that a cell is a small dense product; products are added row by row of the
//! result, always in the order of the cells. That makes the result independent of the number of threads, needs no
//! locks, and lets dense kernels do the work.

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, Spare};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, MatMut, MatRef, Par};

use super::{MassMatrix, Scalar, SparseMatrix, WeightedMass, vectorized};

/// Why a pencil cannot be restricted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum GalerkinError {
    /// Sizes do not fit each other.
    #[error("a space of {space} rows does not fit a stiffness of {stiffness} and a mass of {mass}")]
    Shape {
        /// Rows of the space.
        space: usize,
        /// Size of the stiffness.
        stiffness: usize,
        /// Size of the mass.
        mass: usize,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A cell with more rows than this is worked on in parts.
const ROWS_PER_PART: usize = 256;

/// Numbers of small products that may be held at once, as a multiple of what the entries of `U` explain, up to so many
/// a row. A space whose functions are not local exceeds it and takes the row-wise way.
const PRODUCTS_PER_ENTRY: usize = 24;
const MOST_ENTRIES_A_ROW: usize = 24;

/// `S̄ = UᵀSU` and `M̄ = UᵀMU`, `d × d`, both triangles stored and symmetric to the last bit.
///
/// `space` is `U`, `n × d`, about fifteen entries a row; `stiffness` is symmetric. Entries that are exactly zero are
/// left out. Where functions are local, a row of `S` whose entries sum to zero but for rounding is taken to sum to
/// zero.
///
/// # Errors
/// [`GalerkinError`]: sizes that do not fit, or the work was cancelled.
pub fn galerkin(
    space: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    mass: &MassMatrix,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix, SparseMatrix), GalerkinError> {
    let (n, d) = (space.rows(), space.columns());
    let square = stiffness.rows() == n && stiffness.columns() == n;
    if !square || mass.size() != n {
        return Err(GalerkinError::Shape { space: n, stiffness: stiffness.rows(), mass: mass.size() });
    }
    let cells = Cells::new(space);
    let Some(products) = cell_products(space, stiffness, mass, &cells, monitor)? else {
        return row_wise(space, stiffness, mass, monitor);
    };
    // Which products a row of the result is the sum of: (product, position of the row in it).
    let mut memberships = vec![Vec::new(); d];
    for (p, product) in products.iter().enumerate() {
        for (at, &column) in product.columns.iter().enumerate() {
            memberships[column as usize].push((p as u32, at as u32));
        }
    }
    monitor.checkpoint()?;
    let lower = |values: fn(&GalerkinProduct) -> &[f64]| {
        let rows: Vec<Row> = memberships
            .par_iter()
            .map_init(
                || (vec![0.0; d], Vec::new()),
                |(sum, touched), members| {
                    for &(p, at) in members {
                        let product = &products[p as usize];
                        let (at, c) = (at as usize, product.columns.len());
                        for (&column, &value) in product.columns[..=at].iter().zip(&values(product)[at * c..]) {
                            sum[column as usize] += value;
                        }
                        touched.extend_from_slice(&product.columns[..=at]);
                    }
                    take_row(sum, touched)
                },
            )
            .collect();
        symmetric_from_lower(d, &rows)
    };
    Ok((lower(|p| &p.stiffness), lower(|p| &p.mass)))
}

/// Columns and values of a sparse row.
type Row = (Vec<u32>, Vec<f64>);

/// Empties a dense accumulator into a sparse row without zeros.
fn take_row(sum: &mut [f64], touched: &mut Vec<u32>) -> Row {
    touched.sort_unstable();
    touched.dedup();
    let mut row = (Vec::with_capacity(touched.len()), Vec::with_capacity(touched.len()));
    for &column in touched.iter() {
        let value = std::mem::take(&mut sum[column as usize]);
        if value != 0.0 {
            row.0.push(column);
            row.1.push(value);
        }
    }
    touched.clear();
    row
}

/// A symmetric matrix from the rows of its lower triangle.
fn symmetric_from_lower(d: usize, rows: &[Row]) -> SparseMatrix {
    let mut offsets = vec![0usize; d + 1];
    for (r, (columns, _)) in rows.iter().enumerate() {
        offsets[r + 1] += columns.len();
        for &c in columns.iter().filter(|&&c| (c as usize) < r) {
            offsets[c as usize + 1] += 1;
        }
    }
    for r in 0..d {
        offsets[r + 1] += offsets[r];
    }
    let mut next = offsets.clone();
    let mut indices = vec![0u32; offsets[d]];
    let mut values = vec![0.0; offsets[d]];
    let mut put = |row: usize, column: u32, value: f64| {
        indices[next[row]] = column;
        values[next[row]] = value;
        next[row] += 1;
    };
    // Row r receives its lower part before any later row adds to its upper part: columns ascend.
    for (r, (columns, row_values)) in rows.iter().enumerate() {
        for (&c, &value) in columns.iter().zip(row_values) {
            put(r, c, value);
            if (c as usize) < r {
                put(c as usize, r as u32, value);
            }
        }
    }
    SparseMatrix::from_sorted_parts(d, d, offsets, indices, values)
}

/// Rows of `U` by the column of their largest entry; rows without entries are in no cell.
struct Cells {
    rows: Vec<u32>,
    /// Ranges of `rows`, none longer than [`ROWS_PER_PART`].
    parts: Vec<std::ops::Range<usize>>,
}

impl Cells {
    fn new(space: &SparseMatrix<f32>) -> Self {
        let largest = |row: usize| {
            let (columns, values) = space.row(row);
            let mut best = None;
            let mut most = f32::NEG_INFINITY;
            for (&column, &value) in columns.iter().zip(values) {
                if best.is_none() || value > most {
                    (best, most) = (Some(column), value);
                }
            }
            best
        };
        let owners: Vec<Option<u32>> = (0..space.rows()).into_par_iter().map(largest).collect();
        let mut starts = vec![0usize; space.columns() + 2];
        for &owner in owners.iter().flatten() {
            starts[owner as usize + 2] += 1;
        }
        for c in 2..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut rows = vec![0u32; starts.last().copied().unwrap_or(0)];
        for (row, owner) in owners.iter().enumerate() {
            if let Some(owner) = owner {
                let next = &mut starts[*owner as usize + 1];
                rows[*next] = row as u32;
                *next += 1;
            }
        }
        let mut parts = Vec::new();
        for cell in starts.windows(2).take(space.columns()) {
            let mut from = cell[0];
            while from < cell[1] {
                let to = cell[1].min(from + ROWS_PER_PART);
                parts.push(from..to);
                from = to;
            }
        }
        Self { rows, parts }
    }
}

/// The share of a part of a cell in the lower triangles of the result.
struct GalerkinProduct {
    /// Columns of the result, ascending.
    columns: Vec<u32>,
    /// `c × c`, row after row; only the lower triangle is set.
    stiffness: Vec<f64>,
    mass: Vec<f64>,
}

/// The products of all cells, or `None` where the functions of the space are not local enough for that.
fn cell_products(
    space: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    mass: &MassMatrix,
    cells: &Cells,
    monitor: &dyn Monitor,
) -> Result<Option<Vec<GalerkinProduct>>, Cancelled> {
    let entries = space.entries().min(MOST_ENTRIES_A_ROW * space.rows());
    let budget = PRODUCTS_PER_ENTRY * entries + (1 << 22);
    let held = std::sync::atomic::AtomicUsize::new(0);
    let spare = Spare::default();
    let products: Result<Vec<Option<GalerkinProduct>>, Cancelled> = cells
        .parts
        .par_iter()
        .map(|part| {
            monitor.checkpoint()?;
            spare.with(
                || Workspace::new(space),
                |workspace| {
                    workspace.gather(space, stiffness, mass, &cells.rows[part.clone()]);
                    let numbers = 2 * workspace.columns.len() * workspace.columns.len();
                    // The order in which tasks arrive here may vary, but not whether the sum of all exceeds the budget.
                    if held.fetch_add(numbers, std::sync::atomic::Ordering::Relaxed) + numbers > budget {
                        return Ok(None);
                    }
                    Ok(Some(workspace.product(space, stiffness, mass)))
                },
            )
        })
        .collect();
    Ok(products?.into_iter().collect())
}

/// What one thread needs to form products.
struct Workspace {
    /// Position of a row of `U` among `rows`, or `u32::MAX`.
    row_position: Vec<u32>,
    /// Position of a column of `U` among `columns`, or `u32::MAX`.
    column_position: Vec<u32>,
    /// Rows at work: first those of the part, then their neighbours in the pencil.
    rows: Vec<u32>,
    own: usize,
    /// Columns that the rows at work touch, ascending.
    columns: Vec<u32>,
    /// `rows × columns` of `U`, row after row.
    block: Vec<f64>,
    /// `own × columns` of `SU` and of `MU`, row after row.
    times_stiffness: Vec<f64>,
    times_mass: Vec<f64>,
}

impl Workspace {
    fn new(space: &SparseMatrix<f32>) -> Self {
        Self {
            row_position: vec![u32::MAX; space.rows()],
            column_position: vec![u32::MAX; space.columns()],
            rows: Vec::new(),
            own: 0,
            columns: Vec::new(),
            block: Vec::new(),
            times_stiffness: Vec::new(),
            times_mass: Vec::new(),
        }
    }

    /// Collects the rows and columns that a part touches.
    fn gather(&mut self, space: &SparseMatrix<f32>, stiffness: &SparseMatrix, mass: &MassMatrix, part: &[u32]) {
        for &row in &self.rows {
            self.row_position[row as usize] = u32::MAX;
        }
        for &column in &self.columns {
            self.column_position[column as usize] = u32::MAX;
        }
        self.rows.clear();
        self.columns.clear();
        for &row in part {
            self.row_position[row as usize] = self.rows.len() as u32;
            self.rows.push(row);
        }
        self.own = part.len();
        for &row in part {
            self.gather_neighbours(stiffness.row(row as usize).0);
            if let Some(mass) = mass.sparse() {
                self.gather_neighbours(mass.row(row as usize).0);
            }
        }
        for &row in &self.rows {
            for &column in space.row(row as usize).0 {
                let position = &mut self.column_position[column as usize];
                if *position == u32::MAX {
                    *position = 0;
                    self.columns.push(column);
                }
            }
        }
        self.columns.sort_unstable();
        for (position, &column) in self.columns.iter().enumerate() {
            self.column_position[column as usize] = position as u32;
        }
    }

    fn gather_neighbours(&mut self, neighbours: &[u32]) {
        for &neighbour in neighbours {
            let position = &mut self.row_position[neighbour as usize];
            if *position == u32::MAX {
                *position = self.rows.len() as u32;
                self.rows.push(neighbour);
            }
        }
    }

    fn product(&mut self, space: &SparseMatrix<f32>, stiffness: &SparseMatrix, mass: &MassMatrix) -> GalerkinProduct {
        // Rows padded to whole vectors.
        let c = self.columns.len();
        let width = c.next_multiple_of(8);
        self.block.clear();
        self.block.resize(self.rows.len() * width, 0.0);
        for (at, &row) in self.rows.iter().enumerate() {
            let target = &mut self.block[at * width..(at + 1) * width];
            let (columns, values) = space.row(row as usize);
            for (&column, &value) in columns.iter().zip(values) {
                target[self.column_position[column as usize] as usize] = value.wide();
            }
        }
        self.times_stiffness.resize(self.own * width, 0.0);
        self.times_mass.resize(self.own * width, 0.0);
        vectorized(
            (&mut self.times_stiffness, &mut self.times_mass),
            #[inline(always)]
            |(times_stiffness, times_mass)| {
                for own in 0..self.own {
                    let row = self.rows[own] as usize;
                    let into = own * width..(own + 1) * width;
                    let target = &mut times_stiffness[into.clone()];
                    differences(stiffness.row(row), own, &self.row_position, &self.block, width, target);
                    let target = &mut times_mass[into.clone()];
                    match mass {
                        MassMatrix::Diagonal(mass) => {
                            for (y, x) in target.iter_mut().zip(&self.block[into]) {
                                *y = mass[row] * x;
                            }
                        }
                        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                            combine(mass.row(row), &self.row_position, &self.block, width, target);
                        }
                    }
                }
            },
        );
        let mut product =
            GalerkinProduct { columns: self.columns.clone(), stiffness: vec![0.0; c * c], mass: vec![0.0; c * c] };
        let left = MatRef::from_row_major_slice(&self.block[..self.own * width], self.own, width).subcols(0, c);
        for (right, result) in [(&self.times_stiffness, &mut product.stiffness), (&self.times_mass, &mut product.mass)]
        {
            triangular::matmul(
                MatMut::from_row_major_slice_mut(result, c, c),
                BlockStructure::TriangularLower,
                Accum::Replace,
                left.transpose(),
                BlockStructure::Rectangular,
                MatRef::from_row_major_slice(&right[..self.own * width], self.own, width).subcols(0, c),
                BlockStructure::Rectangular,
                1.0,
                Par::Seq,
            );
        }
        product
    }
}

/// A row that sums to less than this share of its magnitudes sums to zero, but for rounding.
const ROUNDED: f64 = 64.0 * f64::EPSILON;

/// [`combine`] with the row `own` of the block taken from every other, and added so many times as weights sum to. Where
/// they sum to zero and are large, as around a needle, the sum of products would be all rounding: functions differ
/// little there, and what counts is by how much.
#[inline(always)]
fn differences(
    (columns, weights): (&[u32], &[f64]),
    own: usize,
    position: &[u32],
    block: &[f64],
    width: usize,
    target: &mut [f64],
) {
    let (sum, size) = weights.iter().fold((0.0, 0.0), |(sum, size): (f64, f64), w| (sum + w, size + w.abs()));
    let sum = if sum.abs() <= ROUNDED * size { 0.0 } else { sum };
    for (group, target) in target.chunks_exact_mut(8).enumerate() {
        let own: [f64; 8] = std::array::from_fn(|k| block[own * width + 8 * group + k]);
        let mut acc = own.map(|x| sum * x);
        for (&column, &weight) in columns.iter().zip(weights) {
            let start = position[column as usize] as usize * width + 8 * group;
            for ((a, x), own) in acc.iter_mut().zip(&block[start..start + 8]).zip(&own) {
                *a += weight * (x - own);
            }
        }
        target.copy_from_slice(&acc);
    }
}

/// `target = Σ weight · block[position[column]]`, eight numbers at a time.
#[inline(always)]
fn combine((columns, weights): (&[u32], &[f64]), position: &[u32], block: &[f64], width: usize, target: &mut [f64]) {
    for (group, target) in target.chunks_exact_mut(8).enumerate() {
        let mut acc = [0.0; 8];
        for (&column, &weight) in columns.iter().zip(weights) {
            let start = position[column as usize] as usize * width + 8 * group;
            for (a, x) in acc.iter_mut().zip(&block[start..start + 8]) {
                *a += weight * x;
            }
        }
        target.copy_from_slice(&acc);
    }
}

/// The same products for any space: row `p` of the result is the sum over column `p` of `U` of rows of `SU`.
fn row_wise(
    space: &SparseMatrix<f32>,
    stiffness: &SparseMatrix,
    mass: &MassMatrix,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix, SparseMatrix), GalerkinError> {
    let d = space.columns();
    let transposed = space.transpose();
    #[allow(clippy::type_complexity)] // A name for a type used once would say less.
    let lower = |apply: &(dyn Fn(usize, f64, &mut dyn FnMut(usize, f64)) + Sync)| -> Result<SparseMatrix, Cancelled> {
        let rows: Result<Vec<Row>, Cancelled> = (0..d)
            .into_par_iter()
            .map_init(
                || (vec![0.0; d], vec![false; d], Vec::new()),
                |(sum, seen, touched), p| {
                    monitor.checkpoint()?;
                    let (rows, values) = transposed.row(p);
                    for (&row, &value) in rows.iter().zip(values) {
                        apply(row as usize, value.wide(), &mut |neighbour, weight| {
                            let (columns, values) = space.row(neighbour);
                            for (&column, &value) in columns.iter().zip(values).take_while(|(c, _)| **c as usize <= p) {
                                sum[column as usize] += weight * value.wide();
                                if !std::mem::replace(&mut seen[column as usize], true) {
                                    touched.push(column);
                                }
                            }
                        });
                    }
                    for &column in touched.iter() {
                        seen[column as usize] = false;
                    }
                    Ok(take_row(sum, touched))
                },
            )
            .collect();
        Ok(symmetric_from_lower(d, &rows?))
    };
    let sparse = |matrix: &SparseMatrix, row: usize, factor: f64, each: &mut dyn FnMut(usize, f64)| {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            each(column as usize, factor * value);
        }
    };
    let restricted_stiffness = lower(&|row, factor, each| sparse(stiffness, row, factor, each))?;
    let restricted_mass = match mass {
        MassMatrix::Diagonal(mass) => lower(&|row, factor, each| each(row, factor * mass[row]))?,
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
            lower(&|row, factor, each| sparse(mass, row, factor, each))?
        }
    };
    Ok((restricted_stiffness, restricted_mass))
}

#[cfg(test)]
#[path = "galerkin_tests.rs"]
mod tests;
