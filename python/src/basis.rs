//! Eigenbases, and what they are good for.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::sync::Arc;

use chladni_algebra::DenseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_mesh::numbering::{Numbering, Translation};
use chladni_spectral::analysis::filter::{Transfer, filter};
use chladni_spectral::analysis::signature::Signature;
use chladni_spectral::basis::Basis;
use chladni_spectral::formats::npz;
use chladni_work::basis_comparison::BasisComparisonRequest;
use chladni_work::distances::DistanceRequest;
use chladni_work::numbered::{pull, push};
use chladni_work::own_mesh::{StrangeMesh, check_own_mesh};
use chladni_work::value_gradient::{gradient, loss_gradient};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

use super::errors::Failure;
use super::mesh::{Body, NativeMesh, json, parsed, translation, vertex_map};
use super::{arrays, watch};

/// An eigenbasis, with the numbering of the arrays or the file that its mesh was made of.
#[pyclass(frozen, name = "Basis", module = "chladni._native")]
#[derive(Debug)]
pub struct NativeBasis {
    pub basis: Arc<Basis>,
    mesh: Option<Arc<Body>>,
    numbering: Arc<Numbering>,
    seconds: Vec<(&'static str, f64)>,
}

impl NativeBasis {
    /// A basis that was computed.
    pub fn new(basis: Arc<Basis>, mesh: Option<Arc<Body>>, seconds: Vec<(&'static str, f64)>) -> Self {
        let n = basis.vertices();
        let numbering =
            mesh.as_ref().map_or_else(|| Arc::new(Numbering::identity(n, 0)), |body| Arc::clone(&body.numbering));
        Self { basis, mesh, numbering, seconds }
    }

    /// How functions are brought from the numbering of the file into that of the mesh, and back.
    ///
    /// # Errors
    /// [`Failure`]: functions are numbered anew, and the basis does not say whether they are on vertices or faces.
    pub fn translation(&self, nearest: bool) -> Result<Translation, Failure> {
        let to = translation(&self.numbering, nearest);
        Ok(if !to.is_identity() && self.basis.is_of_fields()? { to.in_frames(2) } else { to })
    }

    /// The mesh that it was computed on, where that is known.
    pub fn surface(&self) -> Option<&TriangleMesh> {
        self.mesh.as_ref().map(|body| body.mesh())
    }

    /// Functions on the vertices of the file as functions on the rows of the basis.
    ///
    /// # Errors
    /// [`Failure`] names the vertex that does not fit.
    pub fn pulled(&self, functions: &PyReadonlyArray2<'_, f64>) -> Result<DenseMatrix, Failure> {
        Ok(pull(&self.translation(false)?, arrays::functions(functions)?, self.basis.vertices())?)
    }

    fn of_functions(&self) -> Result<(), Failure> {
        match self.basis.is_of_fields()? {
            true => Err(Failure::parameter("the basis is of tangential fields, not of functions on vertices")),
            false => Ok(()),
        }
    }
}

#[pymethods]
impl NativeBasis {
    /// Reads an NPZ file. The numbering is that of the mesh, or what the file tells of it.
    #[staticmethod]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        mesh: Option<&NativeMesh>,
        maps: Option<(PyReadonlyArray1<'_, i32>, PyReadonlyArray1<'_, i32>)>,
    ) -> PyResult<Self> {
        let bytes = std::fs::read(&path)
            .map_err(|error| PyOSError::new_err((error.raw_os_error(), error.to_string(), path.clone())))?;
        Self::of_bytes(py, &bytes, mesh, maps)
    }

    /// Reads the content of an NPZ file.
    #[staticmethod]
    fn of_bytes(
        py: Python<'_>,
        content: &[u8],
        mesh: Option<&NativeMesh>,
        maps: Option<(PyReadonlyArray1<'_, i32>, PyReadonlyArray1<'_, i32>)>,
    ) -> PyResult<Self> {
        let basis = watch::run(py, None, |_| Ok(npz::check_sums(content).and_then(|()| npz::read(content))?))?;
        let n = basis.vertices();
        let mut made = Self::new(Arc::new(basis), mesh.map(|mesh| Arc::clone(&mesh.body)), Vec::new());
        if let Some(body) = &made.mesh {
            let (basis, to) = (&made.basis, translation(&made.numbering, false));
            let solid = body.checked.solid.as_ref();
            watch::run(py, None, |monitor| {
                check_own_mesh(basis, body.mesh(), solid, monitor).map_err(|mut strange| {
                    match &mut strange {
                        StrangeMesh::Mass { vertex, .. } => *vertex = to.file_vertex(*vertex as u32) as usize,
                        StrangeMesh::Area { face, .. } => *face = to.file_face(*face as u32) as usize,
                        StrangeMesh::Rows { .. } | StrangeMesh::Operator(_) | StrangeMesh::Provenance(_) => {}
                    }
                    Failure::parameter(strange.to_string())
                })
            })?;
        } else if let Some((vertices, faces)) = maps {
            let numbering = Numbering::from_maps(arrays::numbers(&vertices)?, arrays::numbers(&faces)?, n);
            // Maps of a mesh that was divided, or of a surface inside a solid, do not tell all: the numbering is then
            // that of the mesh.
            made.numbering = Arc::new(numbering.unwrap_or_else(|| Numbering::identity(n, faces.len().unwrap_or(0))));
        }
        Ok(made)
    }

    /// Writes an NPZ file.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (basis, numbering) = (&self.basis, &self.numbering);
        let failed =
            |error: std::io::Error| PyOSError::new_err((error.raw_os_error(), error.to_string(), path.clone()));
        let file = File::create(&path).map_err(failed)?;
        watch::run(py, None, |_| Ok(npz::write_numbered(basis, Some(numbering), BufWriter::new(file))?))
    }

    /// The content of an NPZ file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyBytes>> {
        let (basis, numbering) = (&self.basis, &self.numbering);
        let bytes = watch::run(py, None, |_| {
            let mut bytes = std::io::Cursor::new(Vec::new());
            npz::write_numbered(basis, Some(numbering), &mut bytes)?;
            Ok(bytes.into_inner())
        })?;
        Ok(pyo3::types::PyBytes::new(py, &bytes))
    }

    /// The eigenvalues.
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.basis.eigenvalues.clone().into_pyarray(py)
    }

    /// The number of rows of functions, and of pairs.
    fn shape(&self) -> PyResult<(usize, usize)> {
        Ok((self.translation(false)?.rows(self.basis.vertices()), self.basis.count()))
    }

    /// The dimension of the subspace of a compact basis.
    fn dimension(&self) -> Option<usize> {
        self.basis.dimension()
    }

    /// Eigenfunctions `from..to`, (n, to − from) in Fortran order.
    fn vectors<'py>(
        &self,
        py: Python<'py>,
        from: usize,
        to: usize,
        nearest: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (basis, numbers) = (&self.basis, self.translation(nearest)?);
        let n = basis.vertices();
        let lifted = watch::run(py, None, |_| {
            let lifted = basis.lift::<f64>(from..to)?;
            Ok(push(&numbers, DenseMatrix::from_columns(n, to - from, lifted)))
        })?;
        arrays::table(py, lifted)
    }

    /// The mass matrix, in the numbering of the kept mesh: its diagonal, or the parts of a CSR matrix.
    fn mass(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        arrays::mass(py, &self.basis.mass)
    }

    /// For each vertex of the file the row of the basis, −1 where it was dropped.
    fn vertex_map<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        vertex_map(py, &self.numbering)
    }

    /// Whether rows are numbers in the frames of faces.
    fn of_fields(&self) -> PyResult<bool> {
        Ok(self.basis.is_of_fields().map_err(Failure::from)?)
    }

    /// What is proven, as JSON.
    fn certificate(&self) -> PyResult<String> {
        json(&self.basis.certificate)
    }

    /// How the basis was made, as JSON.
    fn metadata(&self) -> PyResult<String> {
        json(self.basis.metadata.json())
    }

    /// Seconds of each stage of the work.
    fn seconds(&self) -> Vec<(&'static str, f64)> {
        self.seconds.clone()
    }

    /// Signatures of all vertices or of some: a row each.
    #[expect(clippy::too_many_arguments, reason = "the package names them")]
    fn signatures<'py>(
        &self,
        py: Python<'py>,
        kind: &str,
        times: Option<Vec<f64>>,
        count: Option<usize>,
        normalised: bool,
        vertices: Option<Vec<u32>>,
        nearest: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_functions()?;
        let (basis, to) = (&self.basis, self.translation(nearest)?);
        let mut vertices = vertices;
        if let Some(vertices) = &mut vertices {
            to.vertices(vertices, basis.vertices()).map_err(Failure::from)?;
        }
        let found = watch::run(py, None, |_| {
            let signature = match (kind, times) {
                ("hks", Some(times)) => Signature::HeatKernel { times, normalised },
                ("hks", None) => Signature::heat_kernel(&basis.eigenvalues, count.unwrap_or(16), normalised)?,
                ("wks", _) => Signature::WaveKernel { count: count.unwrap_or(100) },
                ("gps", _) => Signature::GlobalPoint { count: count.unwrap_or(20) },
                _ => {
                    return Err(Failure::parameter(format!(
                        "there is no signature \"{kind}\"; there are hks, wks, gps"
                    )));
                }
            };
            Ok(match &vertices {
                Some(vertices) => signature.at(basis, vertices)?,
                None => push(&to, signature.everywhere(basis)?),
            })
        })?;
        arrays::table(py, found)
    }

    /// Distances: a row for each vertex or pair, a column for each source and time. The request is that of the API, as
    /// JSON.
    fn distances<'py>(&self, py: Python<'py>, request: &str, nearest: bool) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_functions()?;
        let mut request: DistanceRequest = parsed("distances", request)?;
        let (basis, to) = (&self.basis, self.translation(nearest)?);
        request.translate(&to, basis.vertices()).map_err(Failure::from)?;
        let mesh = self.mesh.as_ref().map(|body| body.mesh());
        let found = watch::run(py, None, |monitor| {
            let found = request.distances(basis, mesh, monitor)?;
            Ok((request.translated(&to, found.table), found.slope_error))
        })?;
        arrays::distances(py, found)
    }

    /// The gradient of a weighted sum of eigenvalues by positions, (n, 3).
    fn value_gradient<'py>(&self, py: Python<'py>, weights: Vec<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_functions()?;
        let Some(body) = &self.mesh else {
            return Err(Failure::parameter("a gradient needs the mesh as well as a loaded basis").into());
        };
        let (basis, to) = (&self.basis, self.translation(false)?);
        let solid = body.checked.solid.as_ref();
        let found = watch::run(py, None, |monitor| Ok(gradient(basis, (body.mesh(), solid), &weights, &to, monitor)?))?;
        arrays::table(py, found)
    }

    /// The gradient by positions, (n, 3), of a loss with these derivatives by eigenvalues and by the first
    /// eigenfunctions, (n, c) in Fortran order.
    fn loss_gradient<'py>(
        &self,
        py: Python<'py>,
        weights: Vec<f64>,
        functions: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.of_functions()?;
        let Some(body) = &self.mesh else {
            return Err(Failure::parameter("a gradient needs the mesh as well as a loaded basis").into());
        };
        let (basis, to, functions) = (&self.basis, self.translation(false)?, arrays::functions(&functions)?);
        let of = (body.mesh(), body.checked.solid.as_ref());
        let found =
            watch::run(py, None, |monitor| Ok(loss_gradient(basis, of, (&weights, &functions), &to, monitor)?))?;
        arrays::table(py, found)
    }

    /// Which modes of another basis follow those of this one, as JSON: the member `following` of the API's answer.
    fn follow(&self, py: Python<'_>, other: &Self, pairs: Option<usize>, gap: f64) -> PyResult<String> {
        self.of_functions()?;
        other.of_functions()?;
        // Names are for the API, which finds bases by them.
        let (reference, named) = (String::new(), String::new());
        let request =
            BasisComparisonRequest { reference, other: named, pairs, gap, coefficients: false, following: true };
        let answer = watch::run(py, None, |monitor| Ok(request.answer(&self.basis, &other.basis, None, monitor)?))?;
        json(&answer.following)
    }

    /// Filters functions, (n, k) in Fortran order. The transfer function is that of the API, as JSON.
    fn filter<'py>(
        &self,
        py: Python<'py>,
        functions: PyReadonlyArray2<'_, f64>,
        transfer: &str,
        nearest: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let transfer: Transfer = parsed("transfer", transfer)?;
        let functions = self.pulled(&functions)?;
        let (basis, to) = (&self.basis, self.translation(nearest)?);
        let found = watch::run(py, None, |_| Ok(push(&to, filter(basis, &functions, &transfer)?)))?;
        arrays::table(py, found)
    }

    /// `ΦᵀM f`, (m, k), of functions (n, k) in Fortran order.
    fn project<'py>(
        &self,
        py: Python<'py>,
        functions: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let functions = self.pulled(&functions)?;
        let basis = &self.basis;
        let found = watch::run(py, None, |_| Ok(basis.project(&functions)?))?;
        arrays::table(py, found)
    }

    /// `Φ c`, (n, k), of coefficients (m, k) in Fortran order.
    fn reconstruct<'py>(
        &self,
        py: Python<'py>,
        coefficients: PyReadonlyArray2<'_, f64>,
        nearest: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let coefficients = arrays::functions(&coefficients)?;
        let (basis, to) = (&self.basis, self.translation(nearest)?);
        let found = watch::run(py, None, |_| Ok(push(&to, basis.evaluate(&coefficients)?)))?;
        arrays::table(py, found)
    }
}
