//! What stands in for a graphics card in a build without the feature `gpu`.

use chladni_base::Monitor;

use super::GpuChoice;
use super::error::GpuError;
use super::pair_sums::{Judge, MeasuredPairs, MeasuredPencil, PairSums};
use crate::{DenseMatrix, MassMatrix, PanelMatrix, SparseMatrix};

/// What is known of an adapter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is no hardware but a program on the CPU.
    pub software: bool,
    /// Whether its shaders know f64.
    pub f64: bool,
}

/// All adapters of this machine: none that this build could use.
pub fn adapters() -> Vec<Adapter> {
    Vec::new()
}

/// Nothing is held where there is no device.
pub(super) enum DeviceColumns {}

/// No device: none can be opened.
pub(super) enum Engine {}

impl Engine {
    pub(super) fn open(_: &GpuChoice) -> Result<Self, GpuError> {
        Err(GpuError::NotBuilt)
    }

    pub(super) fn name(&self) -> &str {
        match *self {}
    }

    pub(super) fn prefers_device(&self, _: usize, _: usize) -> bool {
        match *self {}
    }

    pub(super) fn wants_products(&self, _: usize, _: usize) -> bool {
        match *self {}
    }

    pub(super) fn wants_lifting(&self, _: usize, _: usize, _: usize) -> bool {
        match *self {}
    }

    pub(super) fn hold(&self, _: &PanelMatrix) -> Result<DeviceColumns, GpuError> {
        match *self {}
    }

    pub(super) fn stiffness(
        &self,
        _: &DeviceColumns,
        _: &SparseMatrix,
        _: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        match *self {}
    }

    pub(super) fn mass(&self, _: &DeviceColumns, _: &MassMatrix, _: &dyn Monitor) -> Result<DenseMatrix, GpuError> {
        match *self {}
    }

    pub(super) fn rotate(&self, _: &DeviceColumns, _: &DenseMatrix, _: &dyn Monitor) -> Result<PanelMatrix, GpuError> {
        match *self {}
    }

    pub(super) fn lift(
        &self,
        _: &SparseMatrix<f32>,
        _: &DenseMatrix,
        _: &dyn Monitor,
    ) -> Result<PanelMatrix, GpuError> {
        match *self {}
    }

    pub(super) fn wants_measuring(&self, _: usize, _: usize, _: usize) -> bool {
        match *self {}
    }

    pub(super) fn measure(
        &self,
        _: &MeasuredPencil<'_>,
        _: &MeasuredPairs<'_>,
        _: &dyn Judge,
        _: &dyn Monitor,
    ) -> Result<PairSums, GpuError> {
        match *self {}
    }

    pub(super) fn lowest(
        &self,
        _: &DenseMatrix,
        _: &DenseMatrix,
        _: usize,
        _: &dyn Monitor,
    ) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
        match *self {}
    }
}
