//! Residuals of pairs and what encloses their norms, on the device: lifted, multiplied, taken through multigrid cycles
//! and summed up there, some columns at a time, so that no more than a few numbers a column come back.

use chladni_base::Monitor;
use chladni_base::parallel::*;

use super::cycle::DeviceCycle;
use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::{KernelName, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, read_values, upload, write_values};
use super::measure_check;
use super::multiply::{Form, multiply};
use super::pair_sums::{EnclosureSums, Judge, MeasuredPairs, MeasuredPencil, PairSums, ResidualSums};
use super::recorder::Recorder;
use super::resident::offsets;
use super::sparse::DeviceSparse;
use super::trees::DeviceTrees;
use crate::{MassMatrix, SparseMatrix, WeightedMass};

/// Columns at once: the most whose memory stays below [`MOST_BYTES`], or the last of these.
const WIDTHS: [usize; 3] = [64, 32, 16];

/// Bytes of a row and column: `x` in double precision, and seven panels in single precision with the coarse levels.
const BYTES: u64 = 8 + 7 * 4;

/// Bytes of all panels. Wider ones gain little: of a matrix row they read less for each column, but the columns are
/// most of the traffic.
const MOST_BYTES: u64 = 3 << 30;

/// Groups that sum up rows: enough for a large device.
const GROUPS: usize = 1024;

/// What a panel of columns needs on the device.
struct Panels {
    coefficients: DeviceMatrix<f64>,
    x: DeviceMatrix<f64>,
    right: DeviceMatrix<f32>,
    y: DeviceMatrix<f32>,
    rest: DeviceMatrix<f32>,
    thetas: Buffer<f64>,
    shifts: Buffer<f64>,
    weights: Buffer<f64>,
}

/// The pencil on the device, in double precision.
struct DevicePencil {
    stiffness: [Buffer<u32>; 2],
    values: Buffer<f64>,
    mass: [Buffer<u32>; 2],
    masses: Buffer<f64>,
    /// One over the lumped mass of each row, and the weight of its rounding errors.
    weights: Buffer<f64>,
    /// What measures what is left; the mass alone if there is none.
    trees: Option<DeviceTrees>,
    entries: usize,
}

/// Measures pairs.
///
/// # Errors
/// [`GpuError`]: memory, whatever the device says, or sums that differ from those of the CPU.
pub(super) fn measure(
    device: &Device,
    pencil: &MeasuredPencil<'_>,
    pairs: &MeasuredPairs<'_>,
    judge: &dyn Judge,
    monitor: &dyn Monitor,
) -> Result<PairSums, GpuError> {
    let (n, d, q) = (pairs.space.rows(), pairs.space.columns(), pairs.values.len());
    assert!(
        pencil.stiffness.rows() == n
            && pencil.mass.size() == n
            && pencil.lumped.len() == n
            && pencil.rounding.len() == n
            && (pairs.coefficients.rows(), pairs.coefficients.columns()) == (d, q)
            && pairs.sigmas.len() == q,
        "a row for each unknown, a column for each value"
    );
    let width = width(device, n, q)?;
    let panels = Panels::new(device, n, d, width)?;
    let mut session = Session {
        device,
        pencil: DevicePencil::new(device, pencil, width)?,
        cycle: DeviceCycle::new(device, pencil.stiffness, pencil.hierarchy, width)?,
        space: lifted_by(device, pairs.space, &panels.coefficients)?,
        panels,
        monitor,
    };
    let density = device.buffer::<f64>(n as u64)?;
    let mut dense = false;
    let mut found = PairSums::default();
    for first in (0..q).step_by(width) {
        monitor.checkpoint()?;
        let count = width.min(q - first);
        session.panels.fill(device, pencil, pairs, first, count)?;
        session.shift(&panel_of(&pairs.sigmas[first..first + count], width, |&sigma| sigma))?;
        #[cfg_attr(not(test), expect(unused_mut, reason = "tests spoil a sum"))]
        let (residuals, mut enclosures) = session.sums(first, count, judge)?;
        if let Some(weights) = judge.weights(first, &residuals, &enclosures) {
            if !std::mem::replace(&mut dense, true) {
                write_values(device, &density, 0, &vec![0.0; n])?;
            }
            session.add_density(&weights, &density)?;
        }
        if first + count == q {
            let column = count / 2;
            let held = [pick(device, &session.panels.right, column)?, pick(device, &session.panels.y, column)?];
            #[cfg(test)]
            if device.spoiled() {
                enclosures[column].excess *= 1.0 - 1e-6;
            }
            let sums = (&residuals[column], &enclosures[column]);
            measure_check::check(pencil, pairs, first + column, &held, sums)?;
        }
        found.residuals.extend(residuals);
        found.enclosures.extend(enclosures);
        monitor.progress((first + count) as f64 / q as f64);
    }
    if dense {
        found.density = Some(read_values(device, &density, 0, n)?);
    }
    Ok(found)
}

/// Everything that measuring needs on the device.
struct Session<'a> {
    device: &'a Device,
    pencil: DevicePencil,
    cycle: DeviceCycle,
    space: DeviceSparse<f64>,
    panels: Panels,
    monitor: &'a dyn Monitor,
}

impl Session<'_> {
    /// Sets σ for each column of a panel.
    fn shift(&self, sigmas: &[f64]) -> Result<(), GpuError> {
        let Self { device, pencil, cycle, monitor, .. } = self;
        let single: Vec<f32> = sigmas.iter().map(|&sigma| sigma as f32).collect();
        cycle.shift(device, &single)?;
        let Some(trees) = &pencil.trees else { return Ok(()) };
        let mut recorder = Recorder::new(device, *monitor);
        trees.shift(&mut recorder, sigmas, &pencil.weights)?;
        recorder.finish()
    }

    /// The sums of the pairs in the panels, the first of which is `first`, after as many cycles as the judge asks for.
    fn sums(
        &mut self,
        first: usize,
        count: usize,
        judge: &dyn Judge,
    ) -> Result<(Vec<ResidualSums>, Vec<EnclosureSums>), GpuError> {
        let Self { device, pencil, cycle, space, panels, monitor } = self;
        let mut recorder = Recorder::new(device, *monitor);
        space.times(&mut recorder, &panels.x, &panels.coefficients, (1.0, 0.0))?;
        let parts = pencil.residuals(&mut recorder, panels)?;
        let y = cycle.run(&mut recorder, &panels.right)?;
        let bytes = (y.rows() * y.columns() * size_of::<f32>()) as u64;
        recorder.copy(y.only()?.raw(), 0, panels.y.only()?.raw(), 0, bytes);
        let enclosing = pencil.enclosures(&mut recorder, panels)?;
        recorder.finish()?;
        let residuals: Vec<ResidualSums> = parts.read(device, count)?.into_iter().map(ResidualSums::of).collect();
        let mut enclosures = enclosing.read(device, count)?;
        for _ in 1..judge.most_cycles() {
            if judge.is_close(first, &residuals, &enclosures) {
                break;
            }
            let mut recorder = Recorder::new(device, *monitor);
            cycle.run(&mut recorder, &panels.rest)?;
            cycle.add_last(&mut recorder, &panels.y)?;
            let enclosing = pencil.enclosures(&mut recorder, panels)?;
            recorder.finish()?;
            enclosures = enclosing.read(device, count)?;
        }
        Ok((residuals, enclosures))
    }

    /// Adds the weighted `y r` of each row.
    fn add_density(&self, weights: &[f64], density: &Buffer<f64>) -> Result<(), GpuError> {
        let Self { device, panels, monitor, .. } = self;
        write_values(device, &panels.weights, 0, &panel_of(weights, panels.y.columns(), |&weight| weight))?;
        let mut recorder = Recorder::new(device, *monitor);
        panels.add_density(&mut recorder, density)?;
        recorder.finish()
    }
}

/// One column of a panel, back on this machine.
fn pick(device: &Device, panel: &DeviceMatrix<f32>, column: usize) -> Result<Vec<f64>, GpuError> {
    let (rows, width) = (panel.rows(), panel.columns());
    let (one, unit) = (DeviceMatrix::<f32>::new(device, rows, 1)?, DeviceMatrix::<f32>::new(device, width, 1)?);
    unit.write(device, |row, into| into[0] = f32::from(u8::from(row == column)))?;
    let mut recorder = Recorder::new(device, &chladni_base::Unwatched);
    multiply(&mut recorder, Form::Plain, one.all(), panel.all(), unit.all(), (1.0, 0.0))?;
    recorder.finish()?;
    let mut values = Vec::with_capacity(rows);
    one.read(device, 0..rows, |_, row| values.push(f64::from(row[0])))?;
    Ok(values)
}

/// Columns at once for so many rows and columns.
fn width(device: &Device, n: usize, q: usize) -> Result<usize, GpuError> {
    let limits = device.limits();
    let most = limits.binding_bytes.min(limits.buffer_bytes);
    let fits = |width: usize| (n * width * size_of::<f64>()) as u64 <= most;
    let [.., least] = WIDTHS;
    let wanted =
        |&width: &usize| (n * width) as u64 * BYTES <= MOST_BYTES && fits(width) && width < 2 * q.next_power_of_two();
    let width = WIDTHS.into_iter().find(wanted).unwrap_or(least);
    if fits(width) { Ok(width) } else { Err(GpuError::Memory { bytes: (n * width * size_of::<f64>()) as u64 }) }
}

/// As many numbers as a panel has columns, the last one repeated.
fn panel_of<T, S: Copy + Default>(values: &[T], width: usize, of: impl Fn(&T) -> S) -> Vec<S> {
    let last = values.last().map_or(S::default(), &of);
    let mut panel: Vec<S> = values.iter().map(of).collect();
    panel.resize(width, last);
    panel
}

/// `U` on the device.
fn lifted_by(
    device: &Device,
    space: &SparseMatrix<f32>,
    coefficients: &DeviceMatrix<f64>,
) -> Result<DeviceSparse<f64>, GpuError> {
    let values: Vec<f64> = space.values().par_iter().with_min_len(1 << 14).map(|&x| f64::from(x)).collect();
    DeviceSparse::new(device, space.columns(), &offsets(space.offsets())?, space.indices(), &values, coefficients)
}

impl Panels {
    fn new(device: &Device, n: usize, d: usize, width: usize) -> Result<Self, GpuError> {
        Ok(Self {
            coefficients: DeviceMatrix::new(device, d, width)?,
            x: DeviceMatrix::new(device, n, width)?,
            right: DeviceMatrix::new(device, n, width)?,
            y: DeviceMatrix::new(device, n, width)?,
            rest: DeviceMatrix::new(device, n, width)?,
            thetas: device.buffer(width as u64)?,
            shifts: device.buffer(width as u64)?,
            weights: device.buffer(width as u64)?,
        })
    }

    /// The numbers of some pairs; columns beyond them are zeros.
    fn fill(
        &self,
        device: &Device,
        pencil: &MeasuredPencil<'_>,
        pairs: &MeasuredPairs<'_>,
        first: usize,
        count: usize,
    ) -> Result<(), GpuError> {
        let width = self.x.columns();
        self.coefficients.write(device, |row, into| {
            for (k, value) in into.iter_mut().enumerate() {
                *value = if k < count { pairs.coefficients.column(first + k)[row] } else { 0.0 };
            }
        })?;
        let thetas = panel_of(&pairs.values[first..first + count], width, |&theta| theta);
        let shifts = panel_of(&pairs.sigmas[first..first + count], width, |&sigma| sigma + pencil.floor);
        write_values(device, &self.thetas, 0, &thetas)?;
        write_values(device, &self.shifts, 0, &shifts)
    }

    /// Adds the weighted `y r` of each row.
    fn add_density(&self, recorder: &mut Recorder<'_>, density: &Buffer<f64>) -> Result<(), GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Uniforms {
            first: u32,
            end: u32,
            width: u32,
        }
        let device = recorder.device();
        let kernel = device.kernel::<f64>(KernelName::Density)?;
        let [right, y] = [self.right.only()?, self.y.only()?];
        let bound =
            kernel.bind(&device.device, &[self.weights.binding(), right.binding(), y.binding(), density.binding()]);
        let (rows, width) = (self.y.rows(), self.y.columns());
        let rows_of_group = VECTOR_THREADS as usize / width;
        let row_seconds = 32.0 * width as f64 / device.rate::<f64>();
        let at_once = recorder.rows_at_once(row_seconds, rows_of_group);
        for first in (0..rows).step_by(at_once) {
            let count = at_once.min(rows - first);
            let uniforms = Uniforms { first: first as u32, end: (first + count) as u32, width: width as u32 };
            let groups = (count.div_ceil(rows_of_group) as u32, 1, 1);
            recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&uniforms), groups, row_seconds * count as f64)?;
        }
        Ok(())
    }
}

/// `N` sums of each column, in parts.
struct Parts<const N: usize> {
    sums: Buffer<f64>,
    parts: usize,
    width: usize,
}

impl<const N: usize> Parts<N> {
    /// The sums of the first `count` columns.
    fn read(&self, device: &Device, count: usize) -> Result<Vec<[f64; N]>, GpuError> {
        let values = read_values(device, &self.sums, 0, N * self.parts * self.width)?;
        let mut columns = vec![[0.0f64; N]; count];
        for (v, parts) in values.chunks_exact(self.parts * self.width).enumerate() {
            for part in parts.chunks_exact(self.width) {
                for (column, &part) in columns.iter_mut().zip(part) {
                    let sum = &mut column[v];
                    // The last two of nine are the least and the greatest.
                    *sum = match (N, v) {
                        (ResidualSums::COUNT, 7) => sum.min(part),
                        (ResidualSums::COUNT, 8) => sum.max(part),
                        _ => *sum + part,
                    };
                }
            }
        }
        Ok(columns)
    }
}

/// The sums of an enclosure, and what trees make of one of them.
struct Enclosing {
    sums: Parts<{ EnclosureSums::COUNT }>,
    by_trees: Option<Parts<1>>,
}

impl Enclosing {
    /// Those of the first `count` columns.
    fn read(&self, device: &Device, count: usize) -> Result<Vec<EnclosureSums>, GpuError> {
        let mut sums: Vec<EnclosureSums> = self.sums.read(device, count)?.into_iter().map(EnclosureSums::of).collect();
        if let Some(by_trees) = &self.by_trees {
            sums.iter_mut().zip(by_trees.read(device, count)?).for_each(|(sums, [excess])| sums.excess = excess);
        }
        Ok(sums)
    }
}

impl DevicePencil {
    fn new(device: &Device, pencil: &MeasuredPencil<'_>, width: usize) -> Result<Self, GpuError> {
        let MeasuredPencil { stiffness, mass, lumped, rounding, trees, .. } = pencil;
        let n = stiffness.rows();
        let ratio = mass.lumped_ratio();
        let trees = trees.as_ref().map(|trees| DeviceTrees::new(device, trees, ratio, width)).transpose()?;
        let (mass, masses) = match mass {
            MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                let starts = upload(device, &offsets(mass.offsets())?)?;
                ([starts, upload(device, mass.indices())?], upload(device, mass.values())?)
            }
            MassMatrix::Diagonal(mass) => {
                let places: Vec<u32> = (0..=n as u32).collect();
                ([upload(device, &places)?, upload(device, &places[..n])?], upload(device, mass)?)
            }
        };
        let weights: Vec<f64> = lumped.iter().zip(*rounding).flat_map(|(mass, &weight)| [1.0 / mass, weight]).collect();
        Ok(Self {
            stiffness: [upload(device, &offsets(stiffness.offsets())?)?, upload(device, stiffness.indices())?],
            values: upload(device, stiffness.values())?,
            mass,
            masses,
            weights: upload(device, &weights)?,
            entries: stiffness.entries(),
            trees,
        })
    }

    /// The residuals of a panel, and their sums.
    fn residuals(
        &self,
        recorder: &mut Recorder<'_>,
        panels: &Panels,
    ) -> Result<Parts<{ ResidualSums::COUNT }>, GpuError> {
        let after = [panels.thetas.binding(), panels.x.only()?.binding(), panels.right.only()?.binding()];
        self.sums(recorder, KernelName::Residuals, &panels.x, &after)
    }

    /// What the corrections of a panel leave of them, and its sums.
    fn enclosures(&self, recorder: &mut Recorder<'_>, panels: &Panels) -> Result<Enclosing, GpuError> {
        let [right, y, rest] = [&panels.right, &panels.y, &panels.rest].map(DeviceMatrix::only);
        // The pairs themselves are not needed any more: what is left of their residuals takes their place.
        let left = panels.x.only()?.binding();
        let after = [panels.shifts.binding(), right?.binding(), y?.binding(), rest?.binding(), left];
        let sums = self.sums(recorder, KernelName::Enclosure, &panels.y, &after)?;
        let by_trees = match &self.trees {
            Some(trees) => {
                let (sums, parts) = trees.gather(recorder, &panels.x)?;
                Some(Parts { sums, parts, width: panels.x.columns() })
            }
            None => None,
        };
        Ok(Enclosing { sums, by_trees })
    }

    fn sums<T: super::real::Real, const N: usize>(
        &self,
        recorder: &mut Recorder<'_>,
        name: KernelName,
        of: &DeviceMatrix<T>,
        after: &[wgpu::BindingResource<'_>],
    ) -> Result<Parts<N>, GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Uniforms {
            first: u32,
            end: u32,
            width: u32,
            groups: u32,
            part: u32,
            parts: u32,
            exact: u32,
        }
        let (rows, width) = (of.rows(), of.columns());
        let device = recorder.device();
        let kernel = device.kernel::<f64>(name)?;
        let rows_of_group = VECTOR_THREADS as usize / width;
        let row_seconds = 16.0 * (self.entries as f64 / rows.max(1) as f64 + 8.0) * width as f64 / device.rate::<f64>();
        let at_once = recorder.rows_at_once(row_seconds, rows_of_group);
        let groups_of = |first: usize| at_once.min(rows - first).div_ceil(rows_of_group).min(GROUPS);
        let parts: usize = (0..rows).step_by(at_once).map(groups_of).sum();
        let sums = device.buffer::<f64>((N * parts * width) as u64)?;
        let [starts, columns] = &self.stiffness;
        let [mass_starts, mass_columns] = &self.mass;
        let mut buffers = vec![
            starts.binding(),
            columns.binding(),
            self.values.binding(),
            mass_starts.binding(),
            mass_columns.binding(),
            self.masses.binding(),
            self.weights.binding(),
            sums.binding(),
        ];
        buffers.extend_from_slice(after);
        let bound = kernel.bind(&device.device, &buffers);
        let mut part = 0;
        for first in (0..rows).step_by(at_once) {
            let (count, groups) = (at_once.min(rows - first), groups_of(first));
            let uniforms = Uniforms {
                first: first as u32,
                end: (first + count) as u32,
                width: width as u32,
                groups: groups as u32,
                part: part as u32,
                parts: parts as u32,
                exact: u32::from(self.trees.is_some()),
            };
            let seconds = row_seconds * count as f64;
            recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&uniforms), (groups as u32, 1, 1), seconds)?;
            part += groups;
        }
        drop(bound);
        Ok(Parts { sums, parts, width })
    }
}
