//! Commands on their way to the device: recorded, handed over in portions of about 50 ms, and waited for with a time
//! limit.

use std::collections::VecDeque;

use chladni_base::Monitor;

use super::device::Device;
use super::error::GpuError;
use super::kernel::Kernel;

/// Seconds of work, by estimate, that are handed over at once. Windows resets a driver that takes two seconds over a
/// submission.
pub(super) const PORTION_SECONDS: f64 = 0.05;

/// Portions on their way at once: while the device works on one, the next is recorded.
const IN_FLIGHT: usize = 2;

/// Records commands and hands them over.
pub(super) struct Recorder<'a> {
    device: &'a Device,
    monitor: &'a dyn Monitor,
    encoder: Option<wgpu::CommandEncoder>,
    pass: Option<wgpu::ComputePass<'static>>,
    seconds: f64,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(device: &'a Device, monitor: &'a dyn Monitor) -> Self {
        Self { device, monitor, encoder: None, pass: None, seconds: 0.0, in_flight: VecDeque::new() }
    }

    pub(super) fn device(&self) -> &'a Device {
        self.device
    }

    /// Rows that a dispatch takes where each takes so many seconds and a group works on some at a time: half a portion
    /// of work at most, and no more groups than the device allows.
    pub(super) fn rows_at_once(&self, row_seconds: f64, rows_of_group: usize) -> usize {
        let groups = (0.5 * PORTION_SECONDS / (row_seconds * rows_of_group as f64)) as usize;
        groups.clamp(1, self.device.limits().groups as usize) * rows_of_group
    }

    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.encoder.get_or_insert_with(|| self.device.device.create_command_encoder(&Default::default()))
    }

    /// Runs a kernel. `seconds` is what it may take.
    pub(super) fn dispatch(
        &mut self,
        kernel: &Kernel,
        buffers: &wgpu::BindGroup,
        parameters: &[u8],
        groups: (u32, u32, u32),
        seconds: f64,
    ) -> Result<(), GpuError> {
        if groups.0 == 0 || groups.1 == 0 || groups.2 == 0 {
            return Ok(());
        }
        if self.seconds + seconds > PORTION_SECONDS {
            self.submit()?;
        }
        let pass = match self.pass.take() {
            Some(pass) => pass,
            None => self.encoder().begin_compute_pass(&Default::default()).forget_lifetime(),
        };
        let pass = self.pass.insert(pass);
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, buffers, &[]);
        pass.set_immediates(0, parameters);
        pass.dispatch_workgroups(groups.0, groups.1, groups.2);
        self.seconds += seconds;
        Ok(())
    }

    /// Copies bytes from buffer to buffer.
    pub(super) fn copy(&mut self, from: &wgpu::Buffer, start: u64, to: &wgpu::Buffer, at: u64, bytes: u64) {
        self.pass = None;
        self.encoder().copy_buffer_to_buffer(from, start, to, at, bytes);
    }

    /// Hands over what was recorded, and waits until little else is on its way.
    pub(super) fn submit(&mut self) -> Result<(), GpuError> {
        self.pass = None;
        self.seconds = 0.0;
        if let Some(encoder) = self.encoder.take() {
            let submission = self.device.submit(encoder.finish())?;
            self.in_flight.push_back(submission);
        }
        self.monitor.checkpoint()?;
        while self.in_flight.len() > IN_FLIGHT {
            self.device.wait(self.in_flight.pop_front())?;
        }
        Ok(())
    }

    /// Hands over the rest and waits for all of it.
    pub(super) fn finish(&mut self) -> Result<(), GpuError> {
        self.submit()?;
        while let Some(submission) = self.in_flight.pop_front() {
            self.device.wait(Some(submission))?;
        }
        Ok(())
    }
}
