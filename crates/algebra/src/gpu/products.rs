//! The products of Rayleigh and Ritz with tall matrices, on the device where that is faster, and on the CPU otherwise.

use std::sync::Arc;

use chladni_base::notes::{DENSE_SOLVER, MEASURED_ON};
use chladni_base::{Cancelled, Monitor};

use super::Accelerator;
use super::engine::{DeviceColumns, Engine};
use super::error::GpuError;
use super::pair_sums::{Judge, MeasuredPairs, MeasuredPencil, PairSums};
use crate::{DenseMatrix, MassMatrix, PanelMatrix, SparseMatrix, panel_products};

/// Columns that a device still holds from the product before.
pub struct Resident {
    engine: Arc<Engine>,
    held: DeviceColumns,
}

impl Accelerator {
    /// The restricted pencil `XᵀAX` and `XᵀMX`, both `q × q`, and, where the device formed it, the columns that are
    /// there now.
    ///
    /// # Errors
    /// The monitor asked to stop.
    pub fn restrict(
        &self,
        a: &SparseMatrix,
        mass: &MassMatrix,
        x: &PanelMatrix,
        monitor: &dyn Monitor,
    ) -> Result<(DenseMatrix, DenseMatrix, Option<Resident>), Cancelled> {
        if let Some(engine) = self.engine_for_products(x.rows(), x.columns()) {
            let formed = self.attempt(&engine, DENSE_SOLVER, monitor, || {
                let held = engine.hold(x)?;
                let (stiffness, gram) = (engine.stiffness(&held, a, monitor)?, engine.mass(&held, mass, monitor)?);
                Ok((stiffness, gram, held))
            })?;
            if let Some((stiffness, gram, held)) = formed {
                return Ok((stiffness, gram, Some(Resident { engine, held })));
            }
        }
        let (stiffness, gram) = panel_products::restrict(a, mass, x, monitor)?;
        Ok((stiffness, gram, None))
    }

    /// `X ← X Z` for `X` of `q` columns and `Z` of `q × p`, `p ≤ q`, on the device that holds `X`, if one does.
    ///
    /// # Errors
    /// The monitor asked to stop; `x` is then of no further use.
    pub fn rotate(
        &self,
        x: &mut PanelMatrix,
        resident: Option<Resident>,
        z: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        if let Some(Resident { engine, held }) = resident
            && z.rows() == x.columns()
            && z.columns() <= z.rows()
            && let Some(rotated) = self.attempt(&engine, DENSE_SOLVER, monitor, || engine.rotate(&held, z, monitor))?
        {
            *x = rotated;
            return Ok(());
        }
        panel_products::rotate(x, z, monitor)
    }

    /// `U c` for a sparse `U`, `n × d`, and `c`, `d × q`.
    ///
    /// # Errors
    /// The monitor asked to stop.
    pub fn lift(
        &self,
        space: &SparseMatrix<f32>,
        coefficients: &DenseMatrix,
        monitor: &dyn Monitor,
    ) -> Result<PanelMatrix, Cancelled> {
        if let Some(engine) = self.engine_for_lifting(space.rows(), space.entries(), coefficients.columns())
            && coefficients.rows() == space.columns()
            && let Some(lifted) =
                self.attempt(&engine, DENSE_SOLVER, monitor, || engine.lift(space, coefficients, monitor))?
        {
            return Ok(lifted);
        }
        Ok(panel_products::prolong(space, &PanelMatrix::from_dense(coefficients)))
    }

    /// Whether [`measure`](Self::measure) would use a device for `q` pairs on `n` rows, lifted by a matrix with so many
    /// entries.
    pub fn would_measure(&self, n: usize, entries: usize, q: usize) -> bool {
        self.engine_for_measuring(n, entries, q).is_some()
    }

    /// Measures pairs on the device; nothing where that is not faster, or where it fails.
    ///
    /// # Errors
    /// The monitor asked to stop.
    ///
    /// # Panics
    /// Where the sizes of what is given do not fit each other.
    pub fn measure(
        &self,
        pencil: &MeasuredPencil<'_>,
        pairs: &MeasuredPairs<'_>,
        judge: &dyn Judge,
        monitor: &dyn Monitor,
    ) -> Result<Option<PairSums>, Cancelled> {
        let (n, entries, q) = (pairs.space.rows(), pairs.space.entries(), pairs.values.len());
        let Some(engine) = self.engine_for_measuring(n, entries, q) else { return Ok(None) };
        if pencil.hierarchy.sizes().len() < 2 {
            return Ok(None);
        }
        let measured = self.attempt(&engine, MEASURED_ON, monitor, || engine.measure(pencil, pairs, judge, monitor))?;
        if measured.is_some() {
            monitor.note(MEASURED_ON, engine.name());
        }
        Ok(measured)
    }

    /// What the device computes; nothing where it fails, which is counted and noted under this name.
    fn attempt<T>(
        &self,
        engine: &Arc<Engine>,
        name: &'static str,
        monitor: &dyn Monitor,
        action: impl FnOnce() -> Result<T, GpuError>,
    ) -> Result<Option<T>, Cancelled> {
        match action() {
            Ok(value) => Ok(Some(value)),
            Err(GpuError::Cancelled(cancelled)) => Err(cancelled),
            Err(error) => {
                self.failed(engine, &error, name, monitor);
                Ok(None)
            }
        }
    }
}
