//! Products of dense matrices on the device, cut into dispatches that end soon.

use super::error::GpuError;
use super::kernel::{KernelName, TRANSPOSE_EDGE, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, View};
use super::real::Real;
use super::recorder::{PORTION_SECONDS, Recorder};

/// Which of the two factors is transposed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// `AB`, of `m × k` and `k × n`.
    Plain,
    /// `AᵀB`, of `k × m` and `k × n`.
    First,
    /// `ABᵀ`, of `m × k` and `n × k`.
    Second,
}

impl Form {
    pub(super) fn kernel(self) -> KernelName {
        match self {
            Self::Plain => KernelName::Product,
            Self::First => KernelName::TransposedProduct,
            Self::Second => KernelName::ProductTransposed,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Uniforms {
    m: u32,
    n: u32,
    k: u32,
    a_at: u32,
    a_pitch: u32,
    b_at: u32,
    b_pitch: u32,
    c_at: u32,
    c_pitch: u32,
    k_share: u32,
    c_part: u32,
    first_row: u32,
    first_column: u32,
    alpha: f32,
    beta: f32,
}

/// Groups that keep a large device busy.
const BUSY_GROUPS: usize = 256;

/// Terms that are worth a share of their own.
const LEAST_SHARE: usize = 512;

/// `C ← α op(A) op(B) + β C`, of at least one term. Parts of one matrix must not be read and written at once, not even
/// different ones.
///
/// # Errors
/// [`GpuError::Refused`] where the sizes do not fit; whatever the device says.
pub(super) fn multiply<T: Real>(
    recorder: &mut Recorder<'_>,
    form: Form,
    c: View<'_, T>,
    a: View<'_, T>,
    b: View<'_, T>,
    (alpha, beta): (f32, f32),
) -> Result<(), GpuError> {
    let (m, k) = if form == Form::First { (a.columns, a.rows) } else { (a.rows, a.columns) };
    let (n, k_of_b) = if form == Form::Second { (b.rows, b.columns) } else { (b.columns, b.rows) };
    if (c.rows, c.columns, k) != (m, n, k_of_b) {
        let reason =
            format!("a product of {}×{} and {}×{} into {}×{}", a.rows, a.columns, b.rows, b.columns, c.rows, c.columns);
        return Err(GpuError::Refused { reason });
    }
    // No piece crosses the edge of a panel.
    for i in pieces(m, &[Some(c), (form != Form::First).then_some(a)]) {
        for j in pieces(n, &[(form == Form::Second).then_some(b)]) {
            for (place, l) in
                pieces(k, &[(form == Form::First).then_some(a), (form != Form::Second).then_some(b)]).enumerate()
            {
                let beta = if place == 0 { beta } else { 1.0 };
                let c = c.cut(i.clone(), j.clone());
                let a = if form == Form::First { a.cut(l.clone(), i.clone()) } else { a.cut(i.clone(), l.clone()) };
                let b = if form == Form::Second { b.cut(j.clone(), l) } else { b.cut(l, j.clone()) };
                piece(recorder, form, c, a, b, (alpha, beta))?;
            }
        }
    }
    Ok(())
}

impl<T> View<'_, T> {
    fn cut(self, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> Self {
        Self {
            matrix: self.matrix,
            row: self.row + rows.start,
            column: self.column + columns.start,
            rows: rows.len(),
            columns: columns.len(),
        }
    }
}

/// Cuts `0..length` where rows of one of the views leave a panel.
fn pieces<'a, T: Real>(
    length: usize,
    views: &'a [Option<View<'a, T>>],
) -> impl Iterator<Item = std::ops::Range<usize>> + 'a {
    let mut start = 0;
    std::iter::from_fn(move || {
        if start >= length {
            return None;
        }
        let end = views
            .iter()
            .flatten()
            .map(|view| view.matrix.panel_end(view.row + start).saturating_sub(view.row))
            .fold(length, usize::min);
        let range = start..end.max(start);
        start = end.max(start + 1);
        Some(range)
    })
}

/// A product within one panel of each matrix.
fn piece<T: Real>(
    recorder: &mut Recorder<'_>,
    form: Form,
    c: View<'_, T>,
    a: View<'_, T>,
    b: View<'_, T>,
    (alpha, beta): (f32, f32),
) -> Result<(), GpuError> {
    let k = if form == Form::First { a.rows } else { a.columns };
    let tile = T::TILE;
    let groups = c.rows.div_ceil(tile.rows as usize) * c.columns.div_ceil(tile.columns as usize);
    let shares = (BUSY_GROUPS / groups.max(1)).min(k / LEAST_SHARE).min(64);
    if shares < 2 {
        return dispatch(recorder, form, c, a, b, (alpha, beta), (k, 1));
    }
    // A small result of many terms: several groups sum a share of the terms each.
    let share = k.div_ceil(shares);
    let shares = k.div_ceil(share);
    let device = recorder.device();
    let parts = match DeviceMatrix::<T>::new(device, shares * c.rows, c.columns) {
        Ok(parts) if parts.panels().count() == 1 => parts,
        _ => return dispatch(recorder, form, c, a, b, (alpha, beta), (k, 1)),
    };
    dispatch(recorder, form, parts.part(0, c.rows, 0, c.columns), a, b, (alpha, 0.0), (share, shares))?;
    fold(recorder, parts.all(), shares, c, beta)
}

/// Cuts a product into dispatches that take a fraction of a portion each.
fn dispatch<T: Real>(
    recorder: &mut Recorder<'_>,
    form: Form,
    c: View<'_, T>,
    a: View<'_, T>,
    b: View<'_, T>,
    (alpha, beta): (f32, f32),
    (share, shares): (usize, usize),
) -> Result<(), GpuError> {
    let device = recorder.device();
    let kernel = device.kernel::<T>(form.kernel())?;
    let (Some((c_first, c_buffer)), Some((a_first, a_buffer)), Some((b_first, b_buffer))) =
        (c.matrix.panel_of(c.row), a.matrix.panel_of(a.row), b.matrix.panel_of(b.row))
    else {
        return Ok(());
    };
    let group = kernel.bind(&device.device, &[a_buffer.binding(), b_buffer.binding(), c_buffer.binding()]);
    let k = if form == Form::First { a.rows } else { a.columns };
    let place = |view: &View<'_, T>, first: usize| ((view.row - first) * view.matrix.columns() + view.column) as u32;
    let tile = T::TILE;
    let (down, across) = (c.rows.div_ceil(tile.rows as usize), c.columns.div_ceil(tile.columns as usize));
    let tile_seconds = 2.0 * f64::from(tile.rows * tile.columns) * k as f64 / device.rate::<T>();
    let at_once = ((0.5 * PORTION_SECONDS / tile_seconds.max(1e-12)) as usize).max(1);
    let most = device.limits().groups as usize;
    let columns_at_once = across.min(at_once).min(most).max(1);
    let rows_at_once = down.min(at_once / columns_at_once).min(most).max(1);
    for row in (0..down).step_by(rows_at_once) {
        for column in (0..across).step_by(columns_at_once) {
            let uniforms = Uniforms {
                m: c.rows as u32,
                n: c.columns as u32,
                k: k as u32,
                a_at: place(&a, a_first),
                a_pitch: a.matrix.columns() as u32,
                b_at: place(&b, b_first),
                b_pitch: b.matrix.columns() as u32,
                c_at: place(&c, c_first),
                c_pitch: c.matrix.columns() as u32,
                k_share: share as u32,
                c_part: (c.rows * c.columns) as u32,
                first_row: (row * tile.rows as usize) as u32,
                first_column: (column * tile.columns as usize) as u32,
                alpha,
                beta,
            };
            let (rows, columns) = (rows_at_once.min(down - row), columns_at_once.min(across - column));
            let seconds = tile_seconds * (rows * columns) as f64;
            let groups = (columns as u32, rows as u32, shares as u32);
            recorder.dispatch(&kernel, &group, bytemuck::bytes_of(&uniforms), groups, seconds)?;
        }
    }
    Ok(())
}

/// `C ← βC +` the sum of `parts` matrices of C's shape that lie behind each other.
fn fold<T: Real>(
    recorder: &mut Recorder<'_>,
    parts: View<'_, T>,
    count: usize,
    c: View<'_, T>,
    beta: f32,
) -> Result<(), GpuError> {
    #[repr(C)]
    #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
    struct Uniforms {
        parts: u32,
        count: u32,
        n: u32,
        c_at: u32,
        c_pitch: u32,
        first: u32,
        beta: f32,
    }
    let device = recorder.device();
    let kernel = device.kernel::<T>(KernelName::Fold)?;
    let (Some((c_first, c_buffer)), Some((_, buffer))) = (c.matrix.panel_of(c.row), parts.matrix.panel_of(0)) else {
        return Ok(());
    };
    let group = kernel.bind(&device.device, &[buffer.binding(), c_buffer.binding()]);
    let numbers = c.rows * c.columns;
    let at_once = device.limits().groups as usize * VECTOR_THREADS as usize;
    for first in (0..numbers).step_by(at_once) {
        let uniforms = Uniforms {
            parts: count as u32,
            count: numbers as u32,
            n: c.columns as u32,
            c_at: ((c.row - c_first) * c.matrix.columns() + c.column) as u32,
            c_pitch: c.matrix.columns() as u32,
            first: first as u32,
            beta,
        };
        let here = at_once.min(numbers - first);
        let groups = (here.div_ceil(VECTOR_THREADS as usize) as u32, 1, 1);
        let seconds = here as f64 * count as f64 / device.rate::<T>();
        recorder.dispatch(&kernel, &group, bytemuck::bytes_of(&uniforms), groups, seconds)?;
    }
    Ok(())
}

/// `C ← Aᵀ`, of different matrices.
pub(super) fn transpose<T: Real>(
    recorder: &mut Recorder<'_>,
    c: &DeviceMatrix<T>,
    a: &DeviceMatrix<T>,
) -> Result<(), GpuError> {
    #[repr(C)]
    #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
    struct Uniforms {
        m: u32,
        n: u32,
        a_at: u32,
        a_pitch: u32,
        c_at: u32,
        c_pitch: u32,
    }
    let device = recorder.device();
    let kernel = device.kernel::<T>(KernelName::Transpose)?;
    for (a_first, a_rows, a_buffer) in a.panels() {
        for (c_first, c_rows, c_buffer) in c.panels() {
            let group = kernel.bind(&device.device, &[a_buffer.binding(), c_buffer.binding()]);
            let at_once = (device.limits().groups * TRANSPOSE_EDGE) as usize;
            for row in (0..a_rows).step_by(at_once) {
                let rows = at_once.min(a_rows - row);
                let uniforms = Uniforms {
                    m: rows as u32,
                    n: c_rows as u32,
                    a_at: (row * a.columns() + c_first) as u32,
                    a_pitch: a.columns() as u32,
                    c_at: (a_first + row) as u32,
                    c_pitch: c.columns() as u32,
                };
                let groups = ((c_rows as u32).div_ceil(TRANSPOSE_EDGE), (rows as u32).div_ceil(TRANSPOSE_EDGE), 1);
                let seconds = 20.0 * rows as f64 * c_rows as f64 / device.rate::<T>();
                recorder.dispatch(&kernel, &group, bytemuck::bytes_of(&uniforms), groups, seconds)?;
            }
        }
    }
    Ok(())
}
