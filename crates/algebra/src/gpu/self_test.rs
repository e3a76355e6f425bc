//! Every kernel against its twin on the CPU, at small odd sizes: run when a device is opened, since a driver may
//! compile one wrong.

use std::time::Instant;

use chladni_base::Unwatched;

use super::cycle::{DeviceLevel, Rows};
use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::{KernelName, Pass, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, read_values, upload, write_values};
use super::multiply::{Form, multiply, transpose};
use super::numbers::Numbers;
use super::pair_sums::{MeasuredTrees, TreeNode};
use super::real::Real;
use super::recorder::Recorder;
use super::sparse::DeviceSparse;
use super::trees::DeviceTrees;
use super::tridiagonal::Step;
use super::twin::{self, Submatrix};
use crate::multigrid::Diagonal;

/// Roundings by which a kernel may differ from its twin, for each term of a sum.
const ROUNDINGS: f64 = 8.0;

/// Tests all kernels in one precision.
///
/// # Errors
/// [`GpuError::SelfTest`] names the kernel that is wrong; whatever the device says.
pub(super) fn test<T: Real>(device: &Device) -> Result<(), GpuError> {
    for form in [Form::Plain, Form::First, Form::Second] {
        product::<T>(device, form, (37, 29, 41))?;
    }
    // So many terms that several groups share them, which folds.
    product::<T>(device, Form::First, (5, 3, 1100))?;
    transposition::<T>(device, 37, 29)?;
    for (d, j, l) in [(37, 0, 0), (37, 20, 7), (67, 66, 2), (67, 65, 1)] {
        reduction_step::<T>(device, d, j, l, (0, d))?;
    }
    reduction_step::<T>(device, 37, 9, 3, (5, 11))?;
    sparse_product::<T>(device, 23, 19, 7)
}

/// Complains where `found` differs from `expected` by more than sums of so many terms may.
fn compare<T: Real>(name: KernelName, terms: usize, found: &[T], expected: &[T]) -> Result<(), GpuError> {
    let scale = expected.iter().map(|x| x.value().abs()).fold(1.0, f64::max);
    // A NaN is a difference too.
    let worst = found.iter().zip(expected).map(|(x, y)| (x.value() - y.value()).abs() / scale);
    let difference = worst.fold(0.0, |worst: f64, x| if x.is_nan() { f64::INFINITY } else { worst.max(x) });
    if difference > ROUNDINGS * (terms as f64).sqrt() * T::ROUNDING || found.len() != expected.len() {
        return Err(GpuError::SelfTest { kernel: name.text(), precision: T::NAME, difference });
    }
    Ok(())
}

pub(super) fn matrix<T: Real>(
    device: &Device,
    rows: usize,
    columns: usize,
    values: &[T],
) -> Result<DeviceMatrix<T>, GpuError> {
    let matrix = DeviceMatrix::new(device, rows, columns)?;
    matrix.write(device, |row, into| into.copy_from_slice(&values[row * columns..(row + 1) * columns]))?;
    Ok(matrix)
}

pub(super) fn values<T: Real>(device: &Device, matrix: &DeviceMatrix<T>) -> Result<Vec<T>, GpuError> {
    let mut values = Vec::with_capacity(matrix.rows() * matrix.columns());
    matrix.read(device, 0..matrix.rows(), |_, row| values.extend_from_slice(row))?;
    Ok(values)
}

/// A product of parts of larger matrices.
pub(super) fn product<T: Real>(device: &Device, form: Form, (m, n, k): (usize, usize, usize)) -> Result<(), GpuError> {
    let mut numbers = Numbers((m * n * k) as u64);
    let (a_rows, a_columns) = if form == Form::First { (k, m) } else { (m, k) };
    let (b_rows, b_columns) = if form == Form::Second { (n, k) } else { (k, n) };
    let mut operand = |rows: usize, columns: usize| {
        let values: Vec<T> = numbers.take((rows + 3) * (columns + 5));
        matrix(device, rows + 3, columns + 5, &values).map(|matrix| (matrix, values))
    };
    let ((a, a_values), (b, b_values)) = (operand(a_rows, a_columns)?, operand(b_rows, b_columns)?);
    let (c, mut c_values) = operand(m, n)?;
    let mut recorder = Recorder::new(device, &Unwatched);
    let (inner_a, inner_b) = (a.part(2, a_rows, 1, a_columns), b.part(1, b_rows, 4, b_columns));
    multiply(&mut recorder, form, c.part(3, m, 2, n), inner_a, inner_b, (-1.0, 1.0))?;
    recorder.finish()?;
    let at =
        |row: usize, column: usize, columns: usize| Submatrix { at: row * (columns + 5) + column, pitch: columns + 5 };
    twin::multiply(
        form,
        (m, n, k),
        (&a_values, at(2, 1, a_columns)),
        (&b_values, at(1, 4, b_columns)),
        (&mut c_values, at(3, 2, n)),
        (-1.0, 1.0),
    );
    compare(form.kernel(), k, &values(device, &c)?, &c_values)
}

pub(super) fn transposition<T: Real>(device: &Device, m: usize, n: usize) -> Result<(), GpuError> {
    let numbers: Vec<T> = Numbers(m as u64).take(m * n);
    let (a, c) = (matrix(device, m, n, &numbers)?, DeviceMatrix::new(device, n, m)?);
    let mut recorder = Recorder::new(device, &Unwatched);
    transpose(&mut recorder, &c, &a)?;
    recorder.finish()?;
    compare(KernelName::Transpose, 1, &values(device, &c)?, &twin::transpose(m, n, &numbers))
}

/// One column of a reduction of order `d`, from arbitrary vectors, each kernel by itself; `panel` has the first row and
/// the rows of A that lie in its buffer.
pub(super) fn reduction_step<T: Real>(
    device: &Device,
    d: usize,
    j: usize,
    l: usize,
    panel: (usize, usize),
) -> Result<(), GpuError> {
    let mut numbers = Numbers((d * 100 + j) as u64);
    let step = Step::of(d).at_column(j, l).for_panel(panel.0, panel.1, true);
    let a: Vec<T> = numbers.take(panel.1 * d);
    let mut vw: Vec<T> = numbers.take(2 * step.nb as usize * d);
    let mut work: Vec<T> = numbers.take(step.work());
    // Squares are not negative.
    work.iter_mut().filter(|x| x.value() < 0.0).for_each(|x| *x = T::of(0.0) - *x);
    let on_device: [Buffer<T>; 3] = {
        let upload = |values: &[T]| {
            let buffer = device.buffer(values.len() as u64)?;
            write_values(device, &buffer, 0, values).map(|()| buffer)
        };
        [upload(&a)?, upload(&vw)?, upload(&work)?]
    };
    let [a_buffer, vw_buffer, work_buffer] = &on_device;
    let run = |name: KernelName, step: &Step, groups: u32, vw: &mut Vec<T>, work: &mut Vec<T>| {
        let kernel = device.kernel::<T>(name)?;
        let bound = kernel.bind(&device.device, &[a_buffer.binding(), vw_buffer.binding(), work_buffer.binding()]);
        let mut recorder = Recorder::new(device, &Unwatched);
        recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(step), (groups, 1, 1), 0.0)?;
        recorder.finish()?;
        match name {
            KernelName::Column => twin::column(step, &a, vw, work),
            KernelName::Reflect => twin::reflect(step, &a, vw, work),
            _ => twin::combine(step, vw, work),
        }
        // Both go on from what the twin has, so that differences do not add up.
        for (buffer, twin) in [(vw_buffer, &*vw), (work_buffer, &*work)] {
            let found = read_values(device, buffer, 0, twin.len())?;
            compare(name, d + l, &found, twin)?;
            write_values(device, buffer, 0, twin)?;
        }
        Ok::<(), GpuError>(())
    };
    if (panel.0..panel.0 + panel.1).contains(&j) {
        run(KernelName::Column, &step, step.groups, &mut vw, &mut work)?;
    }
    if j + 1 < d {
        run(KernelName::Reflect, &step, step.reflect_groups(), &mut vw, &mut work)?;
        run(KernelName::Combine, &step, (step.d - step.j - 1).div_ceil(VECTOR_THREADS), &mut vw, &mut work)?;
    }
    if l > 0 {
        let flush = Step { flush: 1, ..step };
        run(KernelName::Column, &flush, step.groups, &mut vw, &mut work)?;
    }
    Ok(())
}

/// A sparse matrix of `m × k` times a dense one of `n` columns.
pub(super) fn sparse_product<T: Real>(device: &Device, m: usize, k: usize, n: usize) -> Result<(), GpuError> {
    let mut numbers = Numbers((m * k + n) as u64);
    let (mut starts, mut columns) = (vec![0u32], Vec::new());
    for row in 0..m {
        columns.extend((0..k as u32).filter(|&column| (column as usize * 7 + row * 3).is_multiple_of(5)));
        starts.push(columns.len() as u32);
    }
    let entries: Vec<T> = numbers.take(columns.len());
    let (a, mut c): (Vec<T>, Vec<T>) = (numbers.take(k * n), numbers.take(m * n));
    let (a_matrix, c_matrix) = (matrix(device, k, n, &a)?, matrix(device, m, n, &c)?);
    let sparse = DeviceSparse::new(device, k, &starts, &columns, &entries, &a_matrix)?;
    let mut recorder = Recorder::new(device, &Unwatched);
    sparse.times(&mut recorder, &c_matrix, &a_matrix, (-1.0, 1.0))?;
    recorder.finish()?;
    twin::sparse((&starts, &columns, &entries), n, &a, &mut c, (-1.0, 1.0));
    compare(KernelName::Sparse, k, &values(device, &c_matrix)?, &c)
}

/// Every pass of a multigrid cycle over `n` rows and `width` columns.
pub(super) fn smoothing(device: &Device, n: usize, width: usize) -> Result<(), GpuError> {
    let mut numbers = Numbers((n * width) as u64);
    let (mut starts, mut columns) = (vec![0u32], Vec::new());
    for row in 0..n as u32 {
        columns.extend((0..n as u32).filter(|column| (column * 5 + row * 11).is_multiple_of(7)));
        starts.push(columns.len() as u32);
    }
    let values: Vec<f32> = numbers.take(columns.len());
    let mut positive = || numbers.next::<f32>().abs() + 0.5;
    let diagonal = Diagonal {
        sums: (0..n).map(|row| if row == 3 { 0.0 } else { positive() }).collect(),
        mass: (0..n).map(|row| if row == 3 { 0.0 } else { positive() }).collect(),
        floor: 0.25,
    };
    let sigmas: Vec<f32> = (0..width).map(|_| positive()).collect();
    let rows = Rows { starts, columns, values };
    let [right, x, before]: [Vec<f32>; 3] = std::array::from_fn(|_| numbers.take(n * width));
    let factors = (0.3, 1.7);
    for pass in [Pass::Scale, Pass::Rest, Pass::Fresh, Pass::Step, Pass::Add] {
        let mut expected = before.clone();
        twin::smooth(pass, factors, (&rows, &diagonal, &sigmas), [&right, &x], &mut expected);
        let own = Rows { starts: rows.starts.clone(), columns: rows.columns.clone(), values: rows.values.clone() };
        let level = DeviceLevel::new(device, own, &diagonal, width, false)?;
        let panels =
            [matrix(device, n, width, &right)?, matrix(device, n, width, &x)?, matrix(device, n, width, &before)?];
        let mut recorder = Recorder::new(device, &Unwatched);
        level.pass(&mut recorder, pass, factors, &upload(device, &sigmas)?, panels.each_ref())?;
        recorder.finish()?;
        compare(KernelName::Smooth, n, &self::values(device, &panels[2])?, &expected)?;
    }
    Ok(())
}

/// Trees on three patches, through panels of `width` columns.
pub(super) fn trees(device: &Device, width: usize) -> Result<(), GpuError> {
    let mut numbers = Numbers(width as u64);
    let patches = [0u32, 23, 24, 61];
    // Rows hang on some of those behind them; every ninth is a root.
    let node = |row: u32, size: u32| match (row + 1 < size && row % 9 != 4, row + 1 + row * 7 % 5) {
        (true, parent) => TreeNode { row, parent: parent.min(size - 1), weight: 0.1 + 0.3 * (row % 4) as f32 },
        (false, _) => TreeNode { row, parent: row, weight: 0.0 },
    };
    let nodes: Vec<TreeNode> = patches
        .windows(2)
        .flat_map(|ends| (0..ends[1] - ends[0]).map(move |row| node(row, ends[1] - ends[0])))
        .collect();
    let n = nodes.len();
    let weights: Vec<f64> = (0..2 * n).map(|_| numbers.next::<f64>().abs() + 0.5).collect();
    let sigmas: Vec<f64> = (0..width).map(|column| 0.2 + (column / 16) as f64).collect();
    let left: Vec<f64> = numbers.take(n * width);
    let measured = MeasuredTrees { nodes: &nodes, patches: &patches };
    let on_device = DeviceTrees::new(device, &measured, 4.0, width)?;
    let panel = matrix(device, n, width, &left)?;
    let mut recorder = Recorder::new(device, &Unwatched);
    on_device.shift(&mut recorder, &sigmas, &upload(device, &weights)?)?;
    let (sums, parts) = on_device.gather(&mut recorder, &panel)?;
    recorder.finish()?;
    let sums = read_values(device, &sums, 0, parts * width)?;
    let found: Vec<f64> = (0..width).map(|column| sums.iter().skip(column).step_by(width).sum()).collect();
    let (expected, gathered) = twin::trees(&measured, 4.0, &weights, &sigmas, left);
    compare(KernelName::Trees, n, &found, &expected)?;
    compare(KernelName::Trees, n, &values(device, &panel)?, &gathered)
}

/// Measures how fast products are, for cutting them into dispatches and for choosing the faster side.
pub(super) fn measure<T: Real>(device: &Device) -> Result<f64, GpuError> {
    let mut size = 128;
    loop {
        let matrices: [DeviceMatrix<T>; 3] = [
            DeviceMatrix::new(device, size, size)?,
            DeviceMatrix::new(device, size, size)?,
            DeviceMatrix::new(device, size, size)?,
        ];
        let [a, b, c] = &matrices;
        for matrix in [a, b] {
            matrix.write(device, |row, values| values.fill(T::of(row as f64 / size as f64)))?;
        }
        let mut seconds = f64::INFINITY;
        for _ in 0..2 {
            let began = Instant::now();
            let mut recorder = Recorder::new(device, &Unwatched);
            multiply(&mut recorder, Form::Plain, c.all(), a.all(), b.all(), (1.0, 0.0))?;
            recorder.finish()?;
            seconds = seconds.min(began.elapsed().as_secs_f64());
        }
        let rate = 2.0 * (size as f64).powi(3) / seconds.max(1e-9);
        device.set_rate::<T>(rate);
        if seconds > 0.01 || size >= 2048 {
            return Ok(rate);
        }
        size *= 2;
    }
}
