//! Tangential fields: a space of them on a mesh, and fields designed in it.

use std::sync::{Arc, OnceLock};

use chladni_spectral::basis::{Product, StoredFields};
use chladni_work::design::{DesignFault, DesignRequest, Form, Setting, Surface, written, written_at};
use numpy::PyArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde_json::json;

use super::errors::{Failure, Kind};
use super::mesh::{Body, NativeMesh, json as text, parsed};
use super::{arrays, watch};

impl From<DesignFault> for Failure {
    fn from(fault: DesignFault) -> Self {
        Self::new(Kind::Parameter, "invalid-design", fault.to_string())
    }
}

/// A space of tangential fields, and the surface that it lives on.
#[pyclass(frozen, name = "Fields", module = "chladni._native")]
#[derive(Debug)]
pub struct NativeFields {
    fields: Arc<StoredFields>,
    body: Arc<Body>,
    /// The surface as design needs it, from the first design on.
    setting: OnceLock<Setting>,
    seconds: Vec<(&'static str, f64)>,
}

/// Runs a job of the kind `field_basis` with parameters as JSON.
#[pyfunction]
#[pyo3(signature = (mesh, parameters, progress=None))]
pub fn design_space(
    py: Python<'_>,
    mesh: &NativeMesh,
    parameters: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<NativeFields> {
    let body = Arc::clone(&mesh.body);
    let job = body.job("field_basis", parameters)?;
    let outcome = watch::run(py, progress, |monitor| body.run(&job, monitor))?;
    match outcome.product {
        Product::FieldBasis(fields) => {
            Ok(NativeFields { fields, body: Arc::clone(&body), setting: OnceLock::new(), seconds: outcome.seconds })
        }
        _ => Err(Failure::new(Kind::Solve, "internal", "the job made a different kind of product").into()),
    }
}

#[pymethods]
impl NativeFields {
    /// The eigenvalues of the operator in the space, as far as they are known.
    fn values(&self) -> Vec<f64> {
        self.fields.eigenvalues()
    }

    /// The number of locally supported columns.
    fn dimension(&self) -> usize {
        self.fields.dimension()
    }

    /// Seconds of each stage of the work.
    fn seconds(&self) -> Vec<(&'static str, f64)> {
        self.seconds.clone()
    }

    /// Designs a field: `(numbers, about)`, numbers (f, columns) in f32, a row for each face of the arrays, or of those
    /// that the request asks for, `about` as JSON with `field_faces` in the latter case. The request is that of the
    /// API.
    fn design<'py>(&self, py: Python<'py>, request: &str, form: &str) -> PyResult<Bound<'py, PyTuple>> {
        let mut request: DesignRequest = parsed("design", request)?;
        let form: Form = serde_json::from_value(json!(form))
            .map_err(|_| Failure::parameter("form: one of world, frames, roots, axes"))?;
        let to = self.body.translation(false);
        let (numbers, columns, about) = watch::run(py, None, |monitor| {
            let setting = match self.setting.get() {
                Some(setting) => setting,
                None => {
                    let made = Setting::new(Arc::clone(&self.fields), Arc::new(Surface::new(self.body.mesh())?))?;
                    self.setting.get_or_init(|| made)
                }
            };
            request.translate(&to, setting.kind(), self.body.mesh().positions.len())?;
            let designed = setting.design(&request, monitor)?;
            let (kind, frames) = (setting.kind(), setting.surface.surface.frames());
            let columns = form.columns(kind);
            let (numbers, field_faces) = match &request.faces {
                None => (to.push_faces(&written(frames, kind, form, setting.lifted(&designed)?), columns), None),
                Some(wanted) => {
                    let faces = setting.faces(wanted, monitor)?;
                    let numbers = written_at(frames, kind, form, &faces, setting.lifted_at(&designed, &faces)?);
                    (numbers, Some(faces.iter().map(|&face| to.file_face(face)).collect::<Vec<_>>()))
                }
            };
            let about = json!({
                "harmonic_energy": designed.design.harmonic_energy,
                "biharmonic_energy": designed.design.biharmonic_energy,
                "alignment_energy": designed.design.alignment_energy,
                "faces": designed.constraints.iter().map(|constraint| to.file_face(constraint.face)).collect::<Vec<_>>(),
                "residuals": designed.design.residuals,
                "space": if designed.refined.is_some() { "surface" } else { "basis" },
                "error": designed.error,
                "field_faces": field_faces,
            });
            Ok((numbers, columns, about))
        })?;
        let rows = numbers.len() / columns.max(1);
        (arrays::vector(py, numbers).reshape([rows, columns])?, text(&about)?).into_pyobject(py)
    }
}
