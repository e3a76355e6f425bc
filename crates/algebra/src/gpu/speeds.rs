//! Which side solves a problem faster: a model of both, from a few measurements when the device is opened.

use std::time::Instant;

use chladni_base::Unwatched;

use super::device::Device;
use super::error::GpuError;
use super::matrix::DeviceMatrix;
use super::multiply::transpose;
use super::numbers::Numbers;
use super::real::Real;
use super::recorder::Recorder;
use super::refine;
use super::self_test::matrix;
use super::tridiagonal::reduce;
use crate::eigen::{CpuSolver, SymmetricDefiniteSolver, tridiagonal_lowest};
use crate::{DenseMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, panel_products};

/// The size at which the CPU is measured: large enough for its threads to pay, and done in a few hundredths of a
/// second.
const CPU_SIZE: usize = 512;

/// The size at which the columns of a reduction are measured: hardly any arithmetic, all waiting.
const COLUMNS: usize = 256;

/// The size at which memory is measured.
const MEMORY_SIZE: usize = 2048;

/// In which precision the device works on an eigenproblem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Precision {
    /// In f32, refined in f64 on the CPU.
    Single,
    /// In f64 throughout.
    Double,
}

/// How fast a device is in one precision.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rates {
    /// Seconds of a column of the reduction that are spent waiting.
    column_seconds: f64,
    /// Operations per second of products.
    products: f64,
}

/// How fast both sides are. What both do on the CPU, the Cholesky factor and divide and conquer, counts for neither.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Speeds {
    single: Rates,
    /// Where the device knows f64.
    double: Option<Rates>,
    /// Bytes per second of the device's memory.
    memory: f64,
    /// Bytes per second between both.
    transfer: f64,
    /// Operations per second of products on the CPU.
    cpu_products: f64,
    /// Entries of a sparse matrix per second that meet a column on the CPU.
    cpu_entries: f64,
    /// Seconds of the CPU for a problem of size one; they grow with the third power.
    cpu_seconds: f64,
}

impl Speeds {
    /// Measures a device whose products have been measured already, and this machine.
    pub(super) fn measure(device: &Device) -> Result<Self, GpuError> {
        let double = if device.adapter().f64 { Some(Rates::measure::<f64>(device)?) } else { None };
        Ok(Self {
            single: Rates::measure::<f32>(device)?,
            double,
            memory: memory(device)?,
            transfer: transfer(device)?,
            cpu_products: cpu_products(),
            cpu_entries: cpu_entries(),
            cpu_seconds: cpu() / (CPU_SIZE as f64).powi(3),
        })
    }

    /// How the device should solve for `count` pairs of a problem of size `d`; not at all where the CPU is faster.
    pub(super) fn best(&self, d: usize, count: usize) -> Option<Precision> {
        let (size, pairs) = (d as f64, count as f64);
        let single =
            refine::refinement_pays(d, count).then(|| (self.single_seconds(size, pairs), Some(Precision::Single)));
        let double = self.double.map(|rates| (self.double_seconds(rates, size, pairs), Some(Precision::Double)));
        let cpu = (self.cpu_seconds * size.powi(3), None);
        [Some(cpu), single, double].into_iter().flatten().min_by(|x, y| x.0.total_cmp(&y.0)).and_then(|best| best.1)
    }

    /// Whether the device should form two Gram matrices of `n × q` numbers and rotate them. That of the CPU costs half,
    /// since it knows of the symmetry.
    pub(super) fn products_are_faster(&self, n: usize, q: usize) -> bool {
        let Some(Rates { products, .. }) = self.double else { return false };
        let (n, q) = (n as f64, q as f64);
        let device = 6.0 * n * q * q / products + 5.0 * 8.0 * n * q / self.memory + 16.0 * n * q / self.transfer;
        device < 4.0 * n * q * q / self.cpu_products
    }

    /// Whether the device should lift `q` columns to `n` rows by a matrix with so many entries. Either side reads a
    /// number for each entry and column; what the device writes has to travel.
    pub(super) fn lifting_is_faster(&self, n: usize, entries: usize, q: usize) -> bool {
        let (work, written) = (entries as f64 * q as f64, 8.0 * n as f64 * q as f64);
        let device = (8.0 * work + written) / self.memory + written / self.transfer;
        self.double.is_some() && device < work / self.cpu_entries
    }

    /// Whether the device should measure `q` pairs on `n` rows, lifted by a matrix with so many entries. On the CPU a
    /// row and column costs as much as lifting by some 130 entries (igea subdivided once, 500 pairs, two threads: 4.4 s
    /// for 537,374 rows and 554 columns, at 9.0e9 entries a second); 80 leaves to the device what it is clearly faster
    /// at.
    pub(super) fn measuring_is_faster(&self, n: usize, entries: usize, q: usize) -> bool {
        let (rows, columns, entries) = (n as f64, q as f64, entries as f64);
        let bytes = rows * columns * 600.0 + 8.0 * entries * columns;
        let moved = 200.0 * rows + 12.0 * entries;
        let device = bytes / self.memory + moved / self.transfer + 0.004 * columns / 32.0 + 0.1;
        self.double.is_some() && device < (80.0 * rows * columns + entries * columns) / self.cpu_entries
    }

    fn double_seconds(&self, rates: Rates, d: f64, count: f64) -> f64 {
        // Two triangular solves, the updates, the blocks' factors, then reflectors and a triangular solve for the
        // vectors.
        let products = d * d * (2.0 * d + 4.0 / 3.0 * d + 0.3 * d + 3.0 * count);
        let bytes = 8.0 / 3.0 * d * d * d;
        let moved = 8.0 * d * (2.0 * d + 2.0 * count);
        d * rates.column_seconds + bytes / self.memory + products / rates.products + moved / self.transfer
    }

    fn single_seconds(&self, d: f64, count: f64) -> f64 {
        // Two steps of refinement; some pairs more than are wanted.
        let m = 1.1 * count + 16.0;
        // The updates, the blocks' factors, all vectors back, and the corrections by those that are not wanted.
        let products = d * (d * d * (4.0 / 3.0 + 0.3 + 2.0) + 8.0 * m * (d - m).max(0.0));
        let bytes = 4.0 / 3.0 * d * d * d;
        let moved = 4.0 * d * (2.0 * d + 8.0 * m);
        let device = d * self.single.column_seconds
            + bytes / self.memory
            + products / self.single.products
            + moved / self.transfer;
        // The standard form, three products with it, Gram matrices and rotations, vectors back; and problems of the
        // size of what is refined.
        let products = d * (d * d + 6.0 * d * m + 16.0 * m * m + d * count);
        device + products / self.cpu_products + 3.0 * self.cpu_seconds * m.powi(3)
    }
}

impl Rates {
    fn measure<T: Real>(device: &Device) -> Result<Self, GpuError> {
        Ok(Self { column_seconds: columns::<T>(device)? / COLUMNS as f64, products: device.rate::<T>() })
    }
}

/// The least seconds of two runs: the first one compiles.
fn least(mut run: impl FnMut() -> Result<(), GpuError>) -> Result<f64, GpuError> {
    let mut seconds = f64::INFINITY;
    for _ in 0..2 {
        let began = Instant::now();
        run()?;
        seconds = seconds.min(began.elapsed().as_secs_f64());
    }
    Ok(seconds.max(1e-9))
}

fn columns<T: Real>(device: &Device) -> Result<f64, GpuError> {
    let mut values: Vec<T> = Numbers(1).take(COLUMNS * COLUMNS);
    for row in 0..COLUMNS {
        (0..row).for_each(|column| values[row * COLUMNS + column] = values[column * COLUMNS + row]);
    }
    least(|| {
        let matrix = matrix(device, COLUMNS, COLUMNS, &values)?;
        reduce(&mut Recorder::new(device, &Unwatched), &matrix, &|_| {}).map(drop)
    })
}

fn memory(device: &Device) -> Result<f64, GpuError> {
    let matrices = [
        DeviceMatrix::<f32>::new(device, MEMORY_SIZE, MEMORY_SIZE)?,
        DeviceMatrix::new(device, MEMORY_SIZE, MEMORY_SIZE)?,
    ];
    for matrix in &matrices {
        matrix.write(device, |_, values| values.fill(0.0))?;
    }
    const TIMES: usize = 8;
    let seconds = least(|| {
        let mut recorder = Recorder::new(device, &Unwatched);
        for k in 0..TIMES {
            transpose(&mut recorder, &matrices[k % 2], &matrices[(k + 1) % 2])?;
        }
        recorder.finish()
    })?;
    device.trim();
    Ok((TIMES * 2 * 4 * MEMORY_SIZE * MEMORY_SIZE) as f64 / seconds)
}

fn transfer(device: &Device) -> Result<f64, GpuError> {
    let matrix = DeviceMatrix::<f32>::new(device, MEMORY_SIZE, MEMORY_SIZE)?;
    let seconds = least(|| {
        matrix.write(device, |row, values| values.fill(row as f32))?;
        matrix.read(device, 0..MEMORY_SIZE, |_, _| {})
    })?;
    Ok((2 * 4 * MEMORY_SIZE * MEMORY_SIZE) as f64 / seconds)
}

fn cpu_products() -> f64 {
    let factor = DenseMatrix::from_columns(CPU_SIZE, CPU_SIZE, Numbers(3).take(CPU_SIZE * CPU_SIZE));
    let seconds = (0..3).map(|_| {
        let began = Instant::now();
        // Kept, so that the product is not left out.
        std::hint::black_box(factor.times(&factor));
        began.elapsed().as_secs_f64()
    });
    2.0 * (CPU_SIZE as f64).powi(3) / seconds.fold(f64::INFINITY, f64::min).max(1e-9)
}

/// By lifting a panel of columns, each row from 16 of theirs.
fn cpu_entries() -> f64 {
    const ROWS: usize = 1 << 15;
    const EACH: usize = 16;
    let places = (0..ROWS * EACH).map(|k| (k / EACH / 64 + k % EACH) as u32).collect();
    let starts = (0..=ROWS).map(|row| row * EACH).collect();
    let space = SparseMatrix::from_sorted_parts(ROWS, ROWS / 64 + EACH, starts, places, vec![0.5f32; ROWS * EACH]);
    let columns = PanelMatrix::zeros(space.columns(), 2 * PANEL_WIDTH);
    let seconds = (0..3).map(|_| {
        let began = Instant::now();
        std::hint::black_box(panel_products::prolong(&space, &columns));
        began.elapsed().as_secs_f64()
    });
    (space.entries() * columns.columns()) as f64 / seconds.fold(f64::INFINITY, f64::min).max(1e-9)
}

/// Seconds of the CPU for what the device would do.
fn cpu() -> f64 {
    let d = CPU_SIZE;
    let mut numbers = Numbers(2);
    let (mut a, mut b) = (DenseMatrix::zeros(d, d), DenseMatrix::zeros(d, d));
    for column in 0..d {
        for row in column..d {
            a.column_mut(column)[row] = numbers.next();
        }
        b.column_mut(column)[column] = 1.0;
    }
    let (diagonal, off_diagonal): (Vec<f64>, Vec<f64>) = (numbers.take(d), numbers.take(d));
    let run = |action: &mut dyn FnMut() -> bool| {
        let began = Instant::now();
        // What does not converge took its time all the same.
        let _ = action();
        began.elapsed().as_secs_f64()
    };
    let mut seconds = f64::INFINITY;
    for _ in 0..2 {
        let whole = run(&mut || CpuSolver.lowest(a.clone(), b.clone(), d / 2, &Unwatched).is_ok());
        let shared = run(&mut || tridiagonal_lowest(&diagonal, &off_diagonal, d / 2).is_ok());
        seconds = seconds.min((whole - shared).max(0.2 * whole));
    }
    seconds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_device_gets_what_it_does_faster() {
        let fast = Speeds {
            single: Rates { column_seconds: 2e-5, products: 2e13 },
            double: Some(Rates { column_seconds: 2e-5, products: 5e12 }),
            memory: 2e12,
            transfer: 1e10,
            cpu_products: 1e11,
            cpu_entries: 1e10,
            cpu_seconds: 4e-10,
        };
        assert_eq!((fast.best(100, 50), fast.best(2000, 1000)), (None, Some(Precision::Double)));
        // A card whose f64 is a sixty-fourth of its f32, beside many cores.
        let slow_rates = Rates { column_seconds: 2e-5, products: 5e10 };
        let slow = Speeds { double: Some(slow_rates), cpu_seconds: 2e-11, ..fast };
        assert_eq!(slow.best(10_000, 5000), None);
        // Few pairs of many are refined from f32, where f64 is slow or absent; all of them are not.
        let slow = Speeds { cpu_seconds: 1e-10, ..slow };
        assert_eq!((slow.best(5000, 300), slow.best(5000, 5000)), (Some(Precision::Single), None));
        let without = Speeds { double: None, ..slow };
        assert_eq!((without.best(5000, 300), without.best(5000, 5000)), (Some(Precision::Single), None));
        assert!(!without.products_are_faster(1_000_000, 1000));
        assert!(fast.products_are_faster(1_000_000, 1000) && !slow.products_are_faster(1_000_000, 1000));
        assert!(!fast.products_are_faster(1_000_000, 32));
        // What is lifted has to travel, which takes about as long as lifting it.
        assert!(fast.lifting_is_faster(1_000_000, 16_000_000, 500));
        assert!(!Speeds { transfer: 3e9, ..fast }.lifting_is_faster(1_000_000, 16_000_000, 500));
        assert!(fast.measuring_is_faster(1_000_000, 16_000_000, 500));
        assert!(
            !fast.measuring_is_faster(10_000, 160_000, 50) && !without.measuring_is_faster(1_000_000, 16_000_000, 500)
        );
    }
}
