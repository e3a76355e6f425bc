//! What a correction leaves of residuals, measured by trees on the device: a group of threads takes a panel through a
//! patch, level by level, from the leaves to the roots.

use chladni_base::parallel::*;

use super::device::{Buffer, Device};
use super::error::GpuError;
use super::kernel::KernelName;
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
    levels: Buffer<u32>,
    nodes: Buffer<u32>,
    bases: Buffer<f64>,
    grounds: Buffer<f64>,
    pivots: Buffer<f64>,
    /// The lumped mass is at most so many times the mass.
    ratio: f64,
    count: usize,
    /// Rows of the largest patch.
    most_rows: usize,
    sigmas: usize,
}

/// The trees of one patch, their nodes level by level.
struct Levels {
    /// Row, where children begin and end, and the bits of the weight to the parent.
    nodes: Vec<[u32; 4]>,
    /// Where each level begins, and where the last one ends.
    starts: Vec<u32>,
}

impl Levels {
    /// Those of some nodes; rows, and the places of nodes, are counted from `first`.
    fn of(nodes: &[TreeNode], first: u32) -> Self {
        // The children of each row, one row after the other.
        let mut begins = vec![0u32; nodes.len() + 1];
        let children = || nodes.iter().filter(|node| node.parent != node.row);
        children().for_each(|node| begins[node.parent as usize + 1] += 1);
        (0..nodes.len()).for_each(|row| begins[row + 1] += begins[row]);
        let (mut next, mut sorted) = (begins.clone(), vec![(0u32, 0f32); nodes.len()]);
        for node in children() {
            let place = &mut next[node.parent as usize];
            sorted[*place as usize] = (node.row, node.weight);
            *place += 1;
        }
        let mut queue: Vec<(u32, f32)> =
            nodes.iter().filter(|node| node.parent == node.row).map(|node| (node.row, node.weight)).collect();
        let (mut ordered, mut starts) = (Vec::with_capacity(nodes.len()), vec![first]);
        while ordered.len() < queue.len() {
            let end = queue.len();
            for at in ordered.len()..end {
                let (row, weight) = queue[at];
                let from = queue.len() as u32;
                queue.extend_from_slice(&sorted[begins[row as usize] as usize..begins[row as usize + 1] as usize]);
                ordered.push([first + row, first + from, first + queue.len() as u32, weight.to_bits()]);
            }
            starts.push(first + end as u32);
        }
        assert_eq!(ordered.len(), nodes.len(), "every row hangs on a root");
        Self { nodes: ordered, starts }
    }
}

impl DeviceTrees {
    /// Brings trees to the device, for panels of `width` columns; the lumped mass is at most `ratio` times the mass.
    ///
    /// # Errors
    /// [`GpuError::Memory`].
    ///
    /// # Panics
    /// Where a row hangs on itself in a circle.
    pub(super) fn new(device: &Device, trees: &MeasuredTrees<'_>, ratio: f64, width: usize) -> Result<Self, GpuError> {
        let one = |ends: &[u32]| Levels::of(&trees.nodes[ends[0] as usize..ends[1] as usize], ends[0]);
        let patches: Vec<Levels> =
            (1..trees.patches.len()).into_par_iter().map(|end| one(&trees.patches[end - 1..=end])).collect();
        let (mut begins, mut levels) = (vec![0u32], Vec::new());
        let mut nodes = Vec::with_capacity(4 * trees.nodes.len());
        for patch in &patches {
            levels.extend_from_slice(&patch.starts);
            begins.push(levels.len() as u32);
            nodes.extend_from_slice(patch.nodes.as_flattened());
        }
        let sigmas = (width / SHARED).max(1);
        Ok(Self {
            patches: upload(device, &begins)?,
            levels: upload(device, &levels)?,
            nodes: upload(device, &nodes)?,
            bases: device.buffer(sigmas as u64)?,
            grounds: device.buffer((sigmas * trees.nodes.len()) as u64)?,
            pivots: device.buffer((2 * sigmas * trees.nodes.len()) as u64)?,
            ratio,
            count: patches.len(),
            most_rows: patches.iter().map(|patch| patch.nodes.len()).max().unwrap_or(0),
            sigmas,
        })
    }

    /// Finds the pivots for the σ of each column. `weights` has one over the lumped mass of each row, and another
    /// number.
    ///
    /// # Panics
    /// Where columns beside each other have not σ in common, sixteen by sixteen.
    pub(super) fn shift(
        &self,
        recorder: &mut Recorder<'_>,
        sigmas: &[f64],
        weights: &Buffer<f64>,
    ) -> Result<(), GpuError> {
        let device = recorder.device();
        let each = sigmas.len() / self.sigmas;
        let in_common = |chunk: &[f64]| chunk.iter().all(|sigma| sigma == &chunk[0]);
        assert!(sigmas.chunks(each).all(in_common), "columns beside each other have σ in common");
        let bases: Vec<f64> = sigmas.iter().step_by(each).map(|sigma| sigma / self.ratio).collect();
        write_values(device, &self.bases, 0, &bases)?;
        let after = [weights.binding(), self.bases.binding(), self.grounds.binding(), self.pivots.binding()];
        self.dispatch(recorder, KernelName::Pivots, self.sigmas, after)
    }

    /// Gathers what is left of a panel, and sums its squares over the pivots up: for each patch a number a column.
    /// `left` is used up.
    pub(super) fn gather(
        &self,
        recorder: &mut Recorder<'_>,
        left: &DeviceMatrix<f64>,
    ) -> Result<(Buffer<f64>, usize), GpuError> {
        let width = left.columns();
        let sums = recorder.device().buffer::<f64>((self.count * width) as u64)?;
        let after = [self.pivots.binding(), left.only()?.binding(), sums.binding()];
        self.dispatch(recorder, KernelName::Trees, width, after)?;
        Ok((sums, self.count))
    }

    /// Runs a kernel that takes so many columns through all patches, in portions that do not take too long.
    fn dispatch<const N: usize>(
        &self,
        recorder: &mut Recorder<'_>,
        name: KernelName,
        width: usize,
        after: [wgpu::BindingResource<'_>; N],
    ) -> Result<(), GpuError> {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct Uniforms {
            first: u32,
            width: u32,
            sigmas: u32,
        }
        let device = recorder.device();
        let kernel = device.kernel::<f64>(name)?;
        let mut buffers = vec![self.patches.binding(), self.levels.binding(), self.nodes.binding()];
        buffers.extend(after);
        let bound = kernel.bind(&device.device, &buffers);
        let patch_seconds = ROW_WORK * (self.most_rows * width) as f64 / device.rate::<f64>();
        let portion = recorder.rows_at_once(patch_seconds, 1);
        for first in (0..self.count).step_by(portion) {
            let groups = portion.min(self.count - first);
            let uniforms = Uniforms { first: first as u32, width: width as u32, sigmas: self.sigmas as u32 };
            let seconds = patch_seconds * groups as f64;
            recorder.dispatch(&kernel, &bound, bytemuck::bytes_of(&uniforms), (groups as u32, 1, 1), seconds)?;
        }
        Ok(())
    }
}
