//! Vibration modes of elastic shells and solids, how they move, and how they sound.

use std::sync::Arc;

use chladni_spectral::basis::Product;
use chladni_spectral::basis::modal::ModalBasis;
use chladni_work::simulate::{SimulateRequest, SimulationFault};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::json;

use super::errors::{Failure, Kind};
use super::mesh::{Body, NativeMesh, json as text, parsed};
use super::{arrays, watch};

/// The most numbers of one motion: four gigabytes.
const MOST_NUMBERS: usize = 1 << 30;

impl From<SimulationFault> for Failure {
    fn from(fault: SimulationFault) -> Self {
        match fault {
            SimulationFault::Cancelled(cancelled) => Self::new(Kind::Cancelled, "cancelled", cancelled.to_string()),
            other => Self::new(Kind::Parameter, "invalid-simulation", other.to_string()),
        }
    }
}

/// Modes of an elastic object, and the surface that they belong to.
#[pyclass(frozen, name = "Vibration", module = "chladni._native")]
#[derive(Debug)]
pub struct NativeVibration {
    modes: Arc<ModalBasis>,
    body: Arc<Body>,
}

/// Runs a job of the kind `vibration_basis` with parameters as JSON.
#[pyfunction]
#[pyo3(signature = (mesh, parameters, progress=None))]
pub fn vibration(
    py: Python<'_>,
    mesh: &NativeMesh,
    parameters: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<NativeVibration> {
    let body = Arc::clone(&mesh.body);
    let job = body.job("vibration_basis", parameters)?;
    let outcome = watch::run(py, progress, |monitor| body.run(&job, monitor))?;
    match outcome.product {
        Product::VibrationBasis(modes) => Ok(NativeVibration { modes, body }),
        _ => Err(Failure::new(Kind::Solve, "internal", "the job made a different kind of product").into()),
    }
}

#[pymethods]
impl NativeVibration {
    /// Squared angular frequencies, ascending.
    fn values(&self) -> Vec<f64> {
        self.modes.eigenvalues.clone()
    }

    /// For each value a bound on its error.
    fn bounds(&self) -> Vec<f64> {
        self.modes.bounds.clone()
    }

    /// How many of the modes are rigid motions.
    fn rigid(&self) -> usize {
        self.modes.rigid
    }

    /// What was done, as JSON.
    fn metadata(&self) -> PyResult<String> {
        text(self.modes.metadata.json())
    }

    /// Displacements (times, 3 n) in f32, a row for each time, of the vertices of the arrays; the request is that of
    /// the API.
    fn simulate<'py>(&self, py: Python<'py>, request: &str) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let request = self.request(request)?;
        let to = self.body.translation(false);
        let frames = watch::run(py, None, |monitor| {
            Ok(request.translated_frames(&to, request.frames(&self.modes, MOST_NUMBERS, monitor)?))
        })?;
        arrays::vector(py, frames.numbers).reshape([frames.rows, frames.columns])
    }

    /// Pressures at the listener, and as JSON how many modes are heard.
    fn sound<'py>(&self, py: Python<'py>, request: &str) -> PyResult<(Bound<'py, PyArray1<f64>>, String)> {
        let request = self.request(request)?;
        let sound = watch::run(py, None, |_| Ok(request.sound(&self.modes, self.body.mesh())?))?
            .ok_or_else(|| Failure::parameter("sound: is missing"))?;
        let about = json!({"modes": sound.modes, "too_high": sound.too_high});
        Ok((arrays::vector(py, sound.pressures), text(&about)?))
    }
}

impl NativeVibration {
    /// A request in the numbering of the mesh that was kept.
    fn request(&self, request: &str) -> Result<SimulateRequest, Failure> {
        let mut request: SimulateRequest = parsed("simulation", request)?;
        request.translate(&self.body.translation(false), self.modes.vertices())?;
        Ok(request)
    }
}
