//! An opened, tested and measured device, and which problems are its own.

use std::sync::{Mutex, PoisonError};

pub use super::device::{Adapter, adapters};

use super::GpuChoice;
use super::device::Device;
use super::error::GpuError;
use super::speeds::Speeds;
use super::{self_test, solver};
use crate::algebra::DenseMatrix;
use crate::monitor::Monitor;

/// The largest relative residual that a result may have.
const LARGEST_RESIDUAL: f64 = 1e-10;

/// An opened device.
pub(super) struct Engine {
    device: Device,
    name: String,
    /// Both sides' speeds, where they decide.
    speeds: Option<Speeds>,
    /// One problem at a time: the memory of the device is for one.
    turn: Mutex<()>,
}

impl Engine {
    /// Opens, tests and measures an adapter.
    pub(super) fn open(choice: &GpuChoice) -> Result<Self, GpuError> {
        let device = Device::open(choice)?;
        self_test::test::<f32>(&device)?;
        if device.adapter().f64 {
            self_test::test::<f64>(&device)?;
            self_test::measure::<f64>(&device)?;
        } else {
            self_test::measure::<f32>(&device)?;
        }
        let speeds = match choice {
            GpuChoice::Auto if device.adapter().f64 => Some(Speeds::measure(&device)?),
            _ => None,
        };
        Ok(Self { name: device.adapter().name.clone(), speeds, device, turn: Mutex::default() })
    }

    /// A device as it is.
    #[cfg(test)]
    pub(super) fn untested(device: Device) -> Self {
        Self { name: device.adapter().name.clone(), speeds: None, device, turn: Mutex::default() }
    }

    /// The name of the adapter.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    #[cfg(test)]
    pub(super) fn device(&self) -> &Device {
        &self.device
    }

    /// Whether a problem of size `d` should run here.
    pub(super) fn wants(&self, d: usize, count: usize) -> bool {
        self.device.adapter().f64 && self.speeds.as_ref().is_none_or(|speeds| speeds.device_is_faster(d, count))
    }

    /// The lowest pairs of `A x = λ L Lᵀ x`.
    pub(super) fn lowest(
        &self,
        a: &DenseMatrix,
        l: &DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
        let _turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        #[cfg_attr(not(test), expect(unused_mut, reason = "tests spoil the result"))]
        let (values, mut vectors) = solver::lowest::<f64>(&self.device, a, l, count, monitor)?;
        #[cfg(test)]
        if self.device.spoiled() {
            vectors.column_mut(count / 2)[0] += 1e-6;
        }
        let residual = solver::probe(a, l, &values, &vectors);
        if residual > LARGEST_RESIDUAL {
            return Err(GpuError::Wrong { residual });
        }
        Ok((values, vectors))
    }
}
