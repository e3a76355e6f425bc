//! An opened, tested and measured device, and which problems are its own.

use std::sync::{Mutex, MutexGuard, PoisonError};

use chladni_base::Monitor;

pub use super::device::{Adapter, adapters};

use super::GpuChoice;
use super::device::Device;
use super::error::GpuError;
use super::pair_sums::{Judge, MeasuredPairs, MeasuredPencil, PairSums};
use super::resident::Columns;
use super::speeds::{Precision, Speeds};
use super::{measure, refine, self_test, solver};
use crate::{DenseMatrix, MassMatrix, PanelMatrix, SparseMatrix};

/// The largest relative residual that a result may have.
const LARGEST_RESIDUAL: f64 = 1e-10;

/// Columns on the device.
pub(super) type DeviceColumns = Columns;

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
        let (auto, double) = (*choice == GpuChoice::Auto, device.adapter().f64);
        if double {
            self_test::test::<f64>(&device)?;
            self_test::measure::<f64>(&device)?;
            self_test::smoothing(&device, 41, 16)?;
            self_test::trees(&device, 64)?;
        }
        if auto || !double {
            self_test::test::<f32>(&device)?;
        }
        // Dispatches are cut by it, those of cycles too.
        self_test::measure::<f32>(&device)?;
        let speeds = if auto { Some(Speeds::measure(&device)?) } else { None };
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
    pub(super) fn prefers_device(&self, d: usize, count: usize) -> bool {
        self.precision(d, count).is_some()
    }

    /// How a problem of size `d` should run here, if at all.
    fn precision(&self, d: usize, count: usize) -> Option<Precision> {
        match &self.speeds {
            Some(speeds) => speeds.best(d, count),
            None if self.device.adapter().f64 => Some(Precision::Double),
            None => refine::refinement_pays(d, count).then_some(Precision::Single),
        }
    }

    /// Whether products with `n × q` numbers should run here.
    pub(super) fn wants_products(&self, n: usize, q: usize) -> bool {
        self.device.adapter().f64 && self.speeds.as_ref().is_none_or(|speeds| speeds.products_are_faster(n, q))
    }

    /// Whether `q` columns should be lifted to `n` rows here, by a matrix with so many entries.
    pub(super) fn wants_lifting(&self, n: usize, entries: usize, q: usize) -> bool {
        self.device.adapter().f64 && self.speeds.as_ref().is_none_or(|speeds| speeds.lifting_is_faster(n, entries, q))
    }

    fn turn(&self) -> MutexGuard<'_, ()> {
        self.turn.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Brings columns to the device.
    pub(super) fn hold(&self, x: &PanelMatrix) -> Result<DeviceColumns, GpuError> {
        let _turn = self.turn();
        Columns::new(&self.device, x)
    }

    /// `XᵀAX`.
    pub(super) fn stiffness(
        &self,
        x: &DeviceColumns,
        a: &SparseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        let _turn = self.turn();
        x.stiffness(&self.device, a, monitor)
    }

    /// `XᵀMX`.
    pub(super) fn mass(
        &self,
        x: &DeviceColumns,
        mass: &MassMatrix,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        let _turn = self.turn();
        x.mass(&self.device, mass, monitor)
    }

    /// `XZ`, back on this machine.
    pub(super) fn rotate(
        &self,
        x: &DeviceColumns,
        z: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<PanelMatrix, GpuError> {
        let _turn = self.turn();
        x.times(&self.device, z, monitor)?.read(&self.device)
    }

    /// `U c`, back on this machine.
    pub(super) fn lift(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<PanelMatrix, GpuError> {
        let _turn = self.turn();
        Columns::lifted(&self.device, space, coefficients, monitor)?.read(&self.device)
    }

    /// Whether `q` pairs on `n` rows should be measured here, lifted by a matrix with so many entries.
    pub(super) fn wants_measuring(&self, n: usize, entries: usize, q: usize) -> bool {
        self.device.adapter().f64 && self.speeds.as_ref().is_none_or(|speeds| speeds.measuring_is_faster(n, entries, q))
    }

    /// Measures pairs.
    pub(super) fn measure(
        &self,
        pencil: &MeasuredPencil<'_>,
        pairs: &MeasuredPairs<'_>,
        judge: &dyn Judge,
        monitor: &dyn Monitor,
    ) -> Result<PairSums, GpuError> {
        let _turn = self.turn();
        let measured = measure::measure(&self.device, pencil, pairs, judge, monitor);
        self.device.trim();
        measured
    }

    /// The lowest pairs of `A x = λ L Lᵀ x`.
    pub(super) fn lowest(
        &self,
        a: &DenseMatrix,
        l: &DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<(Vec<f64>, DenseMatrix), GpuError> {
        let _turn = self.turn();
        #[cfg_attr(not(test), expect(unused_mut, reason = "tests spoil the result"))]
        let (values, mut vectors) = match self.precision(a.rows(), count) {
            Some(Precision::Single) => refine::lowest(&self.device, a, l, count, monitor)?,
            _ => solver::lowest::<f64>(&self.device, a, l, count, monitor)?,
        };
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
