//! Eliminating the columns of one front: `L` and `D` of its own columns, and what they take off the rest, `−L D Lᵀ`.
//!
//! Large fronts are cut into tiles by their size alone, so that the bits are the same whether threads share them or
//! not.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::{LdltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place;
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, MatMut, MatRef, Par};

use super::few::{Few, NoPivot};
use super::plan::stride;

/// Columns that are eliminated together in a large front.
const PANEL: usize = 128;

/// Rows and columns of a tile, and the rows that are solved for together.
const TILE: usize = 192;

/// Fronts of so few columns and rows below are eliminated column by column, without the ceremony that products of large
/// matrices take.
const FEW_COLUMNS: usize = 16;
const FEW_ROWS: usize = 160;

/// Memory for the elimination of a front, for the next one.
#[derive(Default)]
pub struct Scratch {
    /// `L D`, and `L` where the front is small.
    pub scaled: Vec<f64>,
    pub lower: Vec<f64>,
    /// What the factor of a diagonal block needs.
    diagonal: Option<MemBuffer>,
}

/// The columns of a front, `rows × columns` one after the other: the lower trapezoid.
pub struct Columns<'a> {
    pub values: &'a mut [f64],
    pub rows: usize,
    pub columns: usize,
}

/// `values ← L` with `D` on its diagonal, and `update ← −L D Lᵀ` for the rows below: the lower triangle of a square
/// matrix whose columns are [`stride`] apart. Above its diagonal there is anything.
pub fn eliminate(front: Columns<'_>, update: &mut [f64], scratch: &mut Scratch, parallel: bool) -> Result<(), NoPivot> {
    let Columns { values, rows, columns } = front;
    let below = rows - columns;
    if columns <= FEW_COLUMNS && below <= FEW_ROWS {
        let Scratch { scaled, lower, .. } = scratch;
        return pulp::Arch::new().dispatch(Few { values, rows, columns, update, scaled, lower });
    }
    let Scratch { scaled, diagonal, .. } = scratch;
    if scaled.len() < rows * columns {
        scaled.resize(rows * columns, 0.0);
    }
    let mut scaled = MatMut::from_column_major_slice_mut(&mut scaled[..rows * columns], rows, columns);
    let mut front = MatMut::from_column_major_slice_mut(values, rows, columns);
    for from in (0..columns).step_by(PANEL) {
        let to = (from + PANEL).min(columns);
        let (left, right) = front.rb_mut().split_at_col_mut(to);
        let left = left.submatrix_mut(from, from, rows - from, to - from);
        let (mut top, mut lower) = left.split_at_row_mut(to - from);
        factor_diagonal(top.rb_mut(), diagonal)?;
        let mut scaled = scaled.rb_mut().submatrix_mut(to, from, rows - to, to - from);
        solve(top.rb(), lower.rb_mut(), scaled.rb_mut(), parallel);
        if to < columns {
            let right = right.submatrix_mut(to, 0, rows - to, columns - to);
            let (own, rest) = right.split_at_row_mut(columns - to);
            let (lower_own, lower_rest) = lower.rb().split_at_row(columns - to);
            let scaled = scaled.rb().subrows(0, columns - to);
            join(
                parallel,
                || triangle(own, Accum::Add, lower_own, scaled, parallel),
                || product(rest, Accum::Add, lower_rest, scaled, parallel),
            );
        }
    }
    if below > 0 {
        let update = MatMut::from_column_major_slice_with_stride_mut(update, below, below, stride(below));
        let lower = front.rb().submatrix(columns, 0, below, columns);
        triangle(update, Accum::Replace, lower, scaled.rb().submatrix(columns, 0, below, columns), parallel);
    }
    Ok(())
}

/// `A ← L` with `D` on its diagonal and nothing above.
fn factor_diagonal(mut block: MatMut<'_, f64>, memory: &mut Option<MemBuffer>) -> Result<(), NoPivot> {
    let size = block.ncols();
    if size > 1 {
        let memory = memory.get_or_insert_with(|| {
            MemBuffer::new(cholesky_in_place_scratch::<f64>(PANEL, Par::Seq, Default::default()))
        });
        let stack = MemStack::new(memory);
        cholesky_in_place(block.rb_mut(), LdltRegularization::default(), Par::Seq, stack, Default::default())
            .map_err(|_| NoPivot)?;
    }
    for column in 0..size {
        let d = block[(column, column)];
        if !(d.is_finite() && d != 0.0) {
            return Err(NoPivot);
        }
        block.rb_mut().col_mut(column).subrows_mut(0, column).fill(0.0);
    }
    Ok(())
}

/// `scaled ← A L⁻ᵀ` and `A ← A L⁻ᵀ D⁻¹`, some rows at a time.
fn solve(top: MatRef<'_, f64>, mut rows: MatMut<'_, f64>, mut scaled: MatMut<'_, f64>, parallel: bool) {
    if rows.nrows() > TILE {
        let half = halved(rows.nrows());
        let (first, second) = rows.split_at_row_mut(half);
        let (first_scaled, second_scaled) = scaled.split_at_row_mut(half);
        return join(
            parallel,
            || solve(top, first, first_scaled, parallel),
            || solve(top, second, second_scaled, parallel),
        );
    }
    solve_unit_lower_triangular_in_place(top, rows.rb_mut().transpose_mut(), Par::Seq);
    for column in 0..top.ncols() {
        let inverse = top[(column, column)].recip();
        let (rows, scaled) = (rows.rb_mut().col_mut(column), scaled.rb_mut().col_mut(column));
        // Both are contiguous.
        if let (Some(rows), Some(scaled)) = (rows.try_as_col_major_mut(), scaled.try_as_col_major_mut()) {
            for (l, scaled) in rows.as_slice_mut().iter_mut().zip(scaled.as_slice_mut()) {
                *scaled = *l;
                *l *= inverse;
            }
        }
    }
}

/// `target − L Sᵀ` in the lower triangle.
fn triangle(target: MatMut<'_, f64>, kind: Accum, lower: MatRef<'_, f64>, scaled: MatRef<'_, f64>, parallel: bool) {
    if target.nrows() <= TILE {
        let all = BlockStructure::Rectangular;
        let lower_part = BlockStructure::TriangularLower;
        return triangular::matmul(target, lower_part, kind, lower, all, scaled.transpose(), all, -1.0, Par::Seq);
    }
    let half = halved(target.nrows());
    let (first, _, between, second) = target.split_at_mut(half, half);
    let (lower_first, lower_second) = lower.split_at_row(half);
    let (scaled_first, scaled_second) = scaled.split_at_row(half);
    join(
        parallel,
        || {
            join(
                parallel,
                || triangle(first, kind, lower_first, scaled_first, parallel),
                || triangle(second, kind, lower_second, scaled_second, parallel),
            );
        },
        || product(between, kind, lower_second, scaled_first, parallel),
    );
}

/// `target − L Sᵀ`.
fn product(target: MatMut<'_, f64>, kind: Accum, lower: MatRef<'_, f64>, scaled: MatRef<'_, f64>, parallel: bool) {
    let (rows, columns) = (target.nrows(), target.ncols());
    if rows.max(columns) <= TILE {
        return matmul(target, kind, lower, scaled.transpose(), -1.0, Par::Seq);
    }
    if rows >= columns {
        let (first, second) = target.split_at_row_mut(halved(rows));
        let (lower_first, lower_second) = lower.split_at_row(halved(rows));
        join(
            parallel,
            || product(first, kind, lower_first, scaled, parallel),
            || product(second, kind, lower_second, scaled, parallel),
        );
    } else {
        let (first, second) = target.split_at_col_mut(halved(columns));
        let (scaled_first, scaled_second) = scaled.split_at_row(halved(columns));
        join(
            parallel,
            || product(first, kind, lower, scaled_first, parallel),
            || product(second, kind, lower, scaled_second, parallel),
        );
    }
}

/// About half, in whole cache lines.
fn halved(size: usize) -> usize {
    (size / 2).next_multiple_of(8)
}

fn join(parallel: bool, first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    if parallel {
        rayon::join(first, second);
    } else {
        first();
        second();
    }
}
