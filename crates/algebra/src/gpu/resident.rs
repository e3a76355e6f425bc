//! Tall matrices that stay on the device between the products of Rayleigh and Ritz: `ΨᵀSΨ`, `ΨZ`, and the lifting
//! `U φ̄`.

use chladni_base::Monitor;

use super::device::Device;
use super::error::GpuError;
use super::matrix::DeviceMatrix;
use super::multiply::{Form, multiply};
use super::recorder::Recorder;
use super::sparse::DeviceSparse;
use crate::{DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, WeightedMass};

/// `n × q` numbers on the device.
pub(super) struct Columns {
    matrix: DeviceMatrix<f64>,
}

impl Columns {
    /// Brings columns to the device.
    pub(super) fn new(device: &Device, columns: &PanelMatrix) -> Result<Self, GpuError> {
        let matrix = DeviceMatrix::new(device, columns.rows(), columns.columns())?;
        matrix.write(device, |row, values| {
            for (values, panel) in values.chunks_mut(PANEL_WIDTH).zip(columns.panels()) {
                values.copy_from_slice(&panel[row * PANEL_WIDTH..row * PANEL_WIDTH + values.len()]);
            }
        })?;
        Ok(Self { matrix })
    }

    /// `U c` for a sparse `U`, `n × d`, and `c`, `d × q`.
    pub(super) fn lifted(
        device: &Device,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<Self, GpuError> {
        let narrow = DeviceMatrix::new(device, coefficients.rows(), coefficients.columns())?;
        narrow.write(device, |row, values| {
            values.iter_mut().enumerate().for_each(|(k, value)| *value = coefficients.column(k)[row]);
        })?;
        let values: Vec<f64> = space.values().iter().map(|&x| f64::from(x)).collect();
        let on_device =
            DeviceSparse::new(device, space.columns(), &offsets(space.offsets())?, space.indices(), &values, &narrow)?;
        let matrix = DeviceMatrix::new(device, space.rows(), coefficients.columns())?;
        let mut recorder = Recorder::new(device, monitor);
        on_device.times(&mut recorder, &matrix, &narrow, (1.0, 0.0))?;
        recorder.finish()?;
        Ok(Self { matrix })
    }

    /// `XᵀAX`, `q × q`.
    pub(super) fn stiffness(
        &self,
        device: &Device,
        a: &SparseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        self.weighted(device, (&offsets(a.offsets())?, a.indices(), a.values()), monitor)
    }

    /// `XᵀMX`, `q × q`.
    pub(super) fn mass(
        &self,
        device: &Device,
        mass: &MassMatrix,
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        match mass {
            MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
                self.stiffness(device, mass, monitor)
            }
            MassMatrix::Diagonal(mass) => {
                let places: Vec<u32> = (0..=mass.len() as u32).collect();
                self.weighted(device, (&places, &places[..mass.len()], mass), monitor)
            }
        }
    }

    fn weighted(
        &self,
        device: &Device,
        (starts, places, values): (&[u32], &[u32], &[f64]),
        monitor: &dyn Monitor,
    ) -> Result<DenseMatrix, GpuError> {
        let (n, q) = (self.matrix.rows(), self.matrix.columns());
        let weight = DeviceSparse::new(device, n, starts, places, values, &self.matrix)?;
        let image = DeviceMatrix::new(device, starts.len() - 1, q)?;
        let product = DeviceMatrix::new(device, q, q)?;
        let mut recorder = Recorder::new(device, monitor);
        weight.times(&mut recorder, &image, &self.matrix, (1.0, 0.0))?;
        multiply(&mut recorder, Form::First, product.all(), self.matrix.all(), image.all(), (1.0, 0.0))?;
        recorder.finish()?;
        let mut result = DenseMatrix::zeros(q, q);
        // Rows for columns: it is symmetric but for rounding.
        product.read(device, 0..q, |row, values| result.column_mut(row).copy_from_slice(values))?;
        Ok(result)
    }

    /// `X Z` for `Z` of `q × p`.
    pub(super) fn times(&self, device: &Device, z: &DenseMatrix, monitor: &dyn Monitor) -> Result<Self, GpuError> {
        let turned = DeviceMatrix::new(device, z.columns(), z.rows())?;
        turned.write(device, |row, values| values.copy_from_slice(z.column(row)))?;
        let matrix = DeviceMatrix::new(device, self.matrix.rows(), z.columns())?;
        let mut recorder = Recorder::new(device, monitor);
        multiply(&mut recorder, Form::Second, matrix.all(), self.matrix.all(), turned.all(), (1.0, 0.0))?;
        recorder.finish()?;
        Ok(Self { matrix })
    }

    /// The columns, back on this machine.
    pub(super) fn read(&self, device: &Device) -> Result<PanelMatrix, GpuError> {
        let mut columns = PanelMatrix::zeros(self.matrix.rows(), self.matrix.columns());
        self.matrix.read(device, 0..self.matrix.rows(), |row, values| {
            for (values, panel) in values.chunks(PANEL_WIDTH).zip(columns.panels_mut()) {
                panel[row * PANEL_WIDTH..row * PANEL_WIDTH + values.len()].copy_from_slice(values);
            }
        })?;
        Ok(columns)
    }
}

/// Where rows begin, in the 32 bits that kernels count in.
pub(super) fn offsets(offsets: &[usize]) -> Result<Vec<u32>, GpuError> {
    let most = offsets.last().copied().unwrap_or(0);
    if u32::try_from(most).is_err() {
        return Err(GpuError::Memory { bytes: most as u64 * 8 });
    }
    Ok(offsets.iter().map(|&offset| offset as u32).collect())
}
