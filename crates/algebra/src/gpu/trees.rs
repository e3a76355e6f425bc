//! What a correction leaves of residuals, measured by trees on the device: a thread takes a column through a patch, from the leaves to the roots.

use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::{KernelName, VECTOR_THREADS};
use super::matrix::{DeviceMatrix, upload, write_values};
use super::pair_sums::{MeasuredTrees, TreeNode};
use super::recorder::Recorder;

/// Columns of a panel that have a σ in common, at least.
const SHARED: usize = 16;

/// Operations that a row of a tree counts for: it waits for memory twice.
const ROW_WORK: f64 = 64.0;

/// Trees on the rows, with memory for one panel.
pub(super) struct DeviceTrees {
    patches: Buffer<u32>,
    nodes: Buffer<u32>,
    bases: Buffer<f64>,
    pivots: Buffer<f64>,
    ratio: f64,
    count: usize,
    /// Rows of the largest patch.
    most_rows: usize,
    sigmas: usize,
}

impl DeviceTrees {
    /// Brings trees to the device, for panels of `width` columns; the lumped mass is at most `ratio` times the mass.
    ///
    /// # Errors
    /// [`GpuError::Memory`].
    pub(super) fn new(device: &Device, trees: &MeasuredTrees<'_>, ratio: f64, width: usize) -> Result<Self, GpuError> {
        let packed = |node: &TreeNode| [node.row, node.parent, node.weight.to_bits()];
        let nodes: Vec<u32> = trees.nodes.iter().flat_map(packed).collect();
        let sigmas = (width / SHARED).max(1);
        let most_rows = trees.patches.windows(2).map(|ends| (ends[1] - ends[0]) as usize).max().unwrap_or(0);
        Ok(Self {
            patches: upload(device, trees.patches)?,
            nodes: upload(device, &nodes)?,
            bases: device.buffer(sigmas as u64)?,
            pivots: device.buffer((2 * sigmas * trees.nodes.len()) as u64)?,
            ratio,
            count: trees.patches.len().saturating_sub(1),
            most_rows,
            sigmas,
        })
    }

    /// Finds the pivots for the σ of each column. `weights` has one over the lumped mass of each row, and another number.
    pub(super) fn shift(
        &self,
        recorder: &mut Recorder<'_>,
        sigmas: &[f64],
        weights: &Buffer<f64>,
    ) -> Result<(), GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Shape {
            first: u32,
            end: u32,
            sigmas: u32,
        }
        let device = recorder.device();
        let each = sigmas.len() / self.sigmas;
        assert!(
            sigmas.chunks(each).all(|chunk| chunk.iter().all(|sigma| sigma == &chunk[0])),
            "columns beside each other have σ in common"
        );
        let bases: Vec<f64> = sigmas.iter().step_by(each).map(|sigma| sigma / self.ratio).collect();
        write_values(device, &self.bases, 0, &bases)?;
        let kernel = device.kernel::<f64>(KernelName::Pivots)?;
        let buffers = [&self.patches, &self.nodes].map(Buffer::binding);
        let [patches, nodes] = buffers;
        let bound = kernel
            .bind(&device.device, &[patches, nodes, weights.binding(), self.bases.binding(), self.pivots.binding()]);
        let at_once = VECTOR_THREADS as usize / self.sigmas;
        self.in_portions(recorder, self.sigmas, at_once, |recorder, first, end, seconds| {
            let shape = Shape { first: first as u32, end: end as u32, sigmas: self.sigmas as u32 };
            let groups = ((end - first).div_ceil(at_once) as u32, 1, 1);
            recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&shape), groups, seconds)
        })
    }

    /// Gathers what is left of a panel, and sums its squares over the pivots up: for each group of the device a number a column. `left` is used up.
    pub(super) fn gather(
        &self,
        recorder: &mut Recorder<'_>,
        left: &DeviceMatrix<f64>,
    ) -> Result<(Buffer<f64>, usize), GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Shape {
            first: u32,
            end: u32,
            width: u32,
            sigmas: u32,
            part: u32,
        }
        let (device, width) = (recorder.device(), left.columns());
        let at_once = VECTOR_THREADS as usize / width;
        let parts = self.count.div_ceil(at_once);
        let sums = device.buffer::<f64>((parts * width) as u64)?;
        let kernel = device.kernel::<f64>(KernelName::Trees)?;
        let bound = kernel.bind(
            &device.device,
            &[
                self.patches.binding(),
                self.nodes.binding(),
                self.pivots.binding(),
                left.only()?.binding(),
                sums.binding(),
            ],
        );
        self.in_portions(recorder, width, at_once, |recorder, first, end, seconds| {
            let shape = Shape {
                first: first as u32,
                end: end as u32,
                width: width as u32,
                sigmas: self.sigmas as u32,
                part: (first / at_once) as u32,
            };
            let groups = ((end - first).div_ceil(at_once) as u32, 1, 1);
            recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&shape), groups, seconds)
        })?;
        drop(bound);
        Ok((sums, parts))
    }

    /// Dispatches patches, `at_once` of them for each group, in portions that do not take too long.
    fn in_portions(
        &self,
        recorder: &mut Recorder<'_>,
        columns: usize,
        at_once: usize,
        mut dispatch: impl FnMut(&mut Recorder<'_>, usize, usize, f64) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let patch_seconds = ROW_WORK * (self.most_rows * columns) as f64 / recorder.device().rate::<f64>();
        let portion = recorder.rows_at_once(patch_seconds, at_once);
        for first in (0..self.count).step_by(portion) {
            let end = (first + portion).min(self.count);
            dispatch(recorder, first, end, patch_seconds * (end - first) as f64)?;
        }
        Ok(())
    }
}
