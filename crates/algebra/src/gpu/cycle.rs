//! The multigrid cycle of [`Multigrid`] on the device: the same levels, steps and factors, a panel of columns at a
//! time. Where the CPU takes a patch through all steps while it is in the cache, a card takes all rows through each
//! step.

use chladni_base::parallel::*;

use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::{KernelName, Pass, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, upload};
use super::multiply::{Form, multiply};
use super::recorder::Recorder;
use super::sparse::DeviceSparse;
use crate::multigrid::{
    AFTER, BEFORE, COARSE_AFTER, COARSE_BEFORE, ChebyshevStep, Coarsest, Diagonal, FIRST_GAMMA, LAST_DEGREE, chebyshev,
};
use crate::{Multigrid, SparseMatrix, SparseRows};

/// The hierarchy on the device, with memory for one panel.
pub(super) struct DeviceCycle {
    levels: Vec<DeviceLevel>,
    coarsest: Option<CoarsestLevel>,
    /// σ of each column.
    sigmas: Buffer<f32>,
}

/// One level. The right-hand side of the finest one comes from outside.
pub(super) struct DeviceLevel {
    starts: Buffer<u32>,
    columns: Buffer<u32>,
    values: Buffer<f32>,
    /// The absolute sum of each row, and its mass.
    diagonal: Buffer<f32>,
    floor: f32,
    entries: usize,
    transfer: Option<Transfer>,
    right: Option<DeviceMatrix<f32>>,
    x: DeviceMatrix<f32>,
    before: DeviceMatrix<f32>,
}

/// Between a level and the next one.
struct Transfer {
    prolongation: DeviceSparse<f32>,
    restriction: DeviceSparse<f32>,
}

/// The diagonalised level: its vectors, `n × n`, and its values, each with a mass of one.
struct CoarsestLevel {
    vectors: DeviceMatrix<f32>,
    values: Buffer<f32>,
    reduced: [DeviceMatrix<f32>; 2],
}

/// Rows of a matrix as kernels read them.
pub(super) struct Rows {
    pub(super) starts: Vec<u32>,
    pub(super) columns: Vec<u32>,
    pub(super) values: Vec<f32>,
}

impl Rows {
    fn of(rows: &SparseRows) -> Self {
        // What fills rows up is of use to loops of the CPU alone.
        let mut starts = Vec::with_capacity(rows.offsets().len());
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        starts.push(0);
        for row in 0..rows.offsets().len().saturating_sub(1) {
            for &(column, value) in rows.row(row).iter().filter(|entry| entry.1 != 0.0) {
                columns.push(column);
                values.push(value);
            }
            starts.push(columns.len() as u32);
        }
        Self { starts, columns, values }
    }
}

impl DeviceCycle {
    /// Brings a hierarchy to the device, for panels of `width` columns, a power of two that divides the threads of a
    /// group. `stiffness` is the matrix that it was made of.
    ///
    /// # Errors
    /// [`GpuError::Memory`], and [`GpuError::Refused`] for a hierarchy of a single level, which is none.
    pub(super) fn new(
        device: &Device,
        stiffness: &SparseMatrix,
        hierarchy: &Multigrid,
        width: usize,
    ) -> Result<Self, GpuError> {
        let Some(finest) = &hierarchy.finest else {
            return Err(GpuError::Refused { reason: "a hierarchy of one level".into() });
        };
        let rows = Rows {
            starts: super::resident::offsets(stiffness.offsets())?,
            columns: stiffness.indices().to_vec(),
            values: stiffness.values().par_iter().with_min_len(1 << 14).map(|&value| value as f32).collect(),
        };
        let first = DeviceLevel::new(device, rows, &finest.diagonal, width, false)?;
        let mut levels = vec![first];
        for level in &hierarchy.levels {
            levels.push(DeviceLevel::new(device, Rows::of(&level.matrix), &level.diagonal, width, true)?);
        }
        let down = std::iter::once(Some(&finest.prolongation));
        let down = down.chain(hierarchy.levels.iter().map(|level| level.prolongation.as_ref()));
        for (at, prolongation) in down.enumerate() {
            let Some(prolongation) = prolongation else { continue };
            let [fine, coarse] = &mut levels[at..at + 2] else { continue };
            fine.transfer = Some(Transfer::new(device, prolongation, &fine.before, &coarse.x)?);
        }
        let coarsest = match &hierarchy.coarsest {
            Some(coarsest) => Some(CoarsestLevel::new(device, coarsest, width)?),
            None => None,
        };
        Ok(Self { levels, coarsest, sigmas: device.buffer(width as u64)? })
    }

    /// Sets σ for each column.
    pub(super) fn shift(&self, device: &Device, sigmas: &[f32]) -> Result<(), GpuError> {
        super::matrix::write_values(device, &self.sigmas, 0, sigmas)
    }

    /// One cycle from zero for `right`. The result holds until the next one.
    pub(super) fn run(
        &mut self,
        recorder: &mut Recorder<'_>,
        right: &DeviceMatrix<f32>,
    ) -> Result<&DeviceMatrix<f32>, GpuError> {
        let Self { levels, coarsest, sigmas } = self;
        descend(levels, coarsest.as_ref(), sigmas, recorder, Some(right))?;
        Ok(&levels[0].x)
    }

    /// Adds the result of the last cycle to a panel of the finest level.
    pub(super) fn add_last(&self, recorder: &mut Recorder<'_>, into: &DeviceMatrix<f32>) -> Result<(), GpuError> {
        let finest = &self.levels[0];
        finest.pass(recorder, Pass::Add, (0.0, 0.0), &self.sigmas, [&finest.x, &finest.x, into])
    }
}

/// Solves the first of some levels approximately; `right` is given for the finest one.
fn descend(
    levels: &mut [DeviceLevel],
    coarsest: Option<&CoarsestLevel>,
    sigmas: &Buffer<f32>,
    recorder: &mut Recorder<'_>,
    right: Option<&DeviceMatrix<f32>>,
) -> Result<(), GpuError> {
    let Some((own, rest)) = levels.split_first_mut() else { return Ok(()) };
    let held = own.right.take();
    let Some(b) = right.or(held.as_ref()) else { return Ok(()) };
    let (before, after) = if right.is_some() { (BEFORE, AFTER) } else { (COARSE_BEFORE, COARSE_AFTER) };
    match (&own.transfer, rest.first()) {
        (Some(_), Some(_)) => {
            own.pass(recorder, Pass::Scale, (0.0, FIRST_GAMMA), sigmas, [b, b, &own.x])?;
            own.steps(recorder, 1..before, sigmas, b)?;
            own.pass(recorder, Pass::Rest, (0.0, 0.0), sigmas, [b, &own.x, &own.before])?;
            own.restrict(recorder, &rest[0])?;
            descend(rest, coarsest, sigmas, recorder, None)?;
            own.prolong(recorder, &rest[0])?;
            own.steps(recorder, 0..after, sigmas, b)?;
        }
        _ => match coarsest {
            Some(coarsest) => coarsest.solve(recorder, own, sigmas, b)?,
            None => {
                own.pass(recorder, Pass::Scale, (0.0, FIRST_GAMMA), sigmas, [b, b, &own.x])?;
                own.steps(recorder, 1..LAST_DEGREE, sigmas, b)?;
            }
        },
    }
    own.right = held;
    Ok(())
}

impl DeviceLevel {
    pub(super) fn new(
        device: &Device,
        rows: Rows,
        diagonal: &Diagonal,
        width: usize,
        holds_right: bool,
    ) -> Result<Self, GpuError> {
        let n = diagonal.mass.len();
        let pairs: Vec<f32> = diagonal.sums.iter().zip(&diagonal.mass).flat_map(|(&sum, &mass)| [sum, mass]).collect();
        Ok(Self {
            starts: upload(device, &rows.starts)?,
            columns: upload(device, &rows.columns)?,
            values: upload(device, &rows.values)?,
            diagonal: upload(device, &pairs)?,
            floor: diagonal.floor,
            entries: rows.values.len(),
            transfer: None,
            right: if holds_right { Some(DeviceMatrix::new(device, n, width)?) } else { None },
            x: DeviceMatrix::new(device, n, width)?,
            before: DeviceMatrix::new(device, n, width)?,
        })
    }

    /// Steps of the smoother from `x`, into `x`.
    fn steps(
        &mut self,
        recorder: &mut Recorder<'_>,
        range: std::ops::Range<usize>,
        sigmas: &Buffer<f32>,
        right: &DeviceMatrix<f32>,
    ) -> Result<(), GpuError> {
        for ChebyshevStep { fresh, beta, gamma } in chebyshev(range) {
            let pass = if fresh { Pass::Fresh } else { Pass::Step };
            self.pass(recorder, pass, (beta, gamma), sigmas, [right, &self.x, &self.before])?;
            std::mem::swap(&mut self.x, &mut self.before);
        }
        Ok(())
    }

    /// What [`Pass`] says; the panels are `b`, `x` and `out`.
    pub(super) fn pass(
        &self,
        recorder: &mut Recorder<'_>,
        pass: Pass,
        (beta, gamma): (f32, f32),
        sigmas: &Buffer<f32>,
        [right, x, out]: [&DeviceMatrix<f32>; 3],
    ) -> Result<(), GpuError> {
        pass_over(recorder, pass, (beta, gamma, self.floor), self, &self.diagonal, sigmas, [right, x, out])
    }

    /// The right-hand side of the next level, of the residual in `before`.
    fn restrict(&self, recorder: &mut Recorder<'_>, next: &Self) -> Result<(), GpuError> {
        match (&self.transfer, &next.right) {
            (Some(transfer), Some(right)) => transfer.restriction.times(recorder, right, &self.before, (1.0, 0.0)),
            _ => Ok(()),
        }
    }

    /// Adds the correction of the next level.
    fn prolong(&self, recorder: &mut Recorder<'_>, next: &Self) -> Result<(), GpuError> {
        match &self.transfer {
            Some(transfer) => transfer.prolongation.times(recorder, &self.x, &next.x, (1.0, 1.0)),
            None => Ok(()),
        }
    }
}

/// Dispatches a pass over the rows of a level; `diagonal` may be that of its eigenvalues.
fn pass_over(
    recorder: &mut Recorder<'_>,
    pass: Pass,
    (beta, gamma, floor): (f32, f32, f32),
    level: &DeviceLevel,
    diagonal: &Buffer<f32>,
    sigmas: &Buffer<f32>,
    [right, x, out]: [&DeviceMatrix<f32>; 3],
) -> Result<(), GpuError> {
    #[repr(C)]
    #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
    struct Uniforms {
        end: u32,
        width: u32,
        first: u32,
        kind: u32,
        floor: f32,
        beta: f32,
        gamma: f32,
    }
    let (rows, width) = (out.rows(), out.columns());
    let device = recorder.device();
    let kernel = device.kernel::<f32>(KernelName::Smooth)?;
    let bound = kernel.bind(
        &device.device,
        &[
            level.starts.binding(),
            level.columns.binding(),
            level.values.binding(),
            diagonal.binding(),
            sigmas.binding(),
            right.only()?.binding(),
            x.only()?.binding(),
            out.only()?.binding(),
        ],
    );
    let rows_of_group = VECTOR_THREADS as usize / width;
    let row_seconds = 16.0 * (level.entries as f64 / rows.max(1) as f64 + 4.0) * width as f64 / device.rate::<f32>();
    let at_once = recorder.rows_at_once(row_seconds, rows_of_group);
    for first in (0..rows).step_by(at_once) {
        let count = at_once.min(rows - first);
        let uniforms = Uniforms {
            end: (first + count) as u32,
            width: width as u32,
            first: first as u32,
            kind: pass as u32,
            floor,
            beta,
            gamma,
        };
        let groups = (count.div_ceil(rows_of_group) as u32, 1, 1);
        recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&uniforms), groups, row_seconds * count as f64)?;
    }
    Ok(())
}

impl Transfer {
    fn new(
        device: &Device,
        prolongation: &SparseRows,
        fine: &DeviceMatrix<f32>,
        coarse: &DeviceMatrix<f32>,
    ) -> Result<Self, GpuError> {
        let down = Rows::of(prolongation);
        let up = Rows::of(&prolongation.transposed(coarse.rows()));
        let (n, d) = (fine.rows(), coarse.rows());
        Ok(Self {
            prolongation: DeviceSparse::new(device, d, &down.starts, &down.columns, &down.values, coarse)?,
            restriction: DeviceSparse::new(device, n, &up.starts, &up.columns, &up.values, fine)?,
        })
    }
}

impl CoarsestLevel {
    fn new(device: &Device, coarsest: &Coarsest, width: usize) -> Result<Self, GpuError> {
        let n = coarsest.values.len();
        let vectors = DeviceMatrix::new(device, n, n)?;
        vectors.write(device, |row, into| into.copy_from_slice(&coarsest.vectors[row * n..(row + 1) * n]))?;
        let values: Vec<f32> = coarsest.values.iter().flat_map(|&value| [value, 1.0]).collect();
        let reduced = [DeviceMatrix::new(device, n, width)?, DeviceMatrix::new(device, n, width)?];
        Ok(Self { vectors, values: upload(device, &values)?, reduced })
    }

    /// `x = V (Λ + σ)⁻¹ Vᵀ b`.
    fn solve(
        &self,
        recorder: &mut Recorder<'_>,
        level: &DeviceLevel,
        sigmas: &Buffer<f32>,
        right: &DeviceMatrix<f32>,
    ) -> Result<(), GpuError> {
        let [first, second] = &self.reduced;
        multiply(recorder, Form::First, first.all(), self.vectors.all(), right.all(), (1.0, 0.0))?;
        pass_over(recorder, Pass::Scale, (0.0, 1.0, 0.0), level, &self.values, sigmas, [first, first, second])?;
        multiply(recorder, Form::Plain, level.x.all(), self.vectors.all(), second.all(), (1.0, 0.0))
    }
}
