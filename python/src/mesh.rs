//! Meshes: checked once, then shared by everything that is computed on them.

use std::sync::{Arc, OnceLock};

use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, Merge, RepairKind, SurfaceOf};
use chladni_mesh::numbering::{Extension, Numbering, Translation};
use chladni_mesh::read::{MeshFormat, Polygons, RawMesh, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::solid::{CheckedBody, check_body};
use chladni_spectral::basis::Product;
use chladni_spectral::operator::{MeshOperator, OperatorParameters, assemble};
use chladni_work::distances::{DistanceRequest, MeshDistances};
use chladni_work::numbered::translate_parameters;
use chladni_work::packed::Packed;
use chladni_work::{JobParameters, MeshSize, Outcome};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde::de::DeserializeOwned;

use super::basis::NativeBasis;
use super::errors::{Failure, Kind};
use super::{arrays, watch};

/// A mesh, and the arrays that it was made of.
#[derive(Debug)]
pub struct Body {
    pub checked: CheckedBody,
    pub numbering: Arc<Numbering>,
    /// Positions and triangles as they were given, where the mesh that was kept has others.
    given: Option<TriangleMesh>,
    /// What geodesic distances by heat at the usual time are computed with, from the first of them on.
    heat: OnceLock<Arc<MeshDistances>>,
}

impl Body {
    fn new(raw: RawMesh, options: &CheckOptions) -> Result<Self, Failure> {
        let given = TriangleMesh { positions: raw.positions.clone(), faces: raw.faces.clone(), ..Default::default() };
        let checked = check_body(raw, options)?;
        let numbering = Arc::new(checked.surface.numbering.clone());
        let given = (!numbering.is_identity()).then_some(given);
        Ok(Self { checked, numbering, given, heat: OnceLock::new() })
    }

    /// The mesh that was kept.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.checked.surface.mesh
    }

    fn size(&self) -> MeshSize {
        MeshSize::of_body(self.mesh(), self.checked.solid.as_ref())
    }

    /// How requests and answers in the numbering of the arrays are brought into that of the mesh, and back.
    pub fn translation(&self, nearest: bool) -> Translation {
        let turned = self.checked.surface.report.repaired(RepairKind::FlippedFaces);
        translation(&self.numbering, nearest).turning(turned)
    }

    /// A job with parameters in the numbering of the arrays.
    pub fn job(&self, kind: &str, parameters: &str) -> Result<JobParameters, Failure> {
        let mut parameters: Packed = parsed("parameters", parameters)?;
        translate_parameters(&mut parameters, &self.translation(false), self.size())?;
        Ok(JobParameters::read(kind, &parameters)?.undivided()?)
    }

    /// Runs a job.
    pub fn run(&self, job: &JobParameters, monitor: &dyn chladni_base::Monitor) -> Result<Outcome, Failure> {
        Ok(job.run_body(self.mesh(), self.checked.solid.as_ref(), monitor)?)
    }
}

/// A translation between a file's numbering and the kept one.
pub fn translation(numbering: &Arc<Numbering>, nearest: bool) -> Translation {
    let extend = if nearest { Extension::Nearest } else { Extension::None };
    Translation::of_file(Arc::clone(numbering), extend)
}

/// Reads a request that the package wrote as JSON.
///
/// # Errors
/// [`Kind::Parameter`] names what does not fit.
pub fn parsed<T: DeserializeOwned>(what: &str, text: &str) -> Result<T, Failure> {
    serde_json::from_str(text).map_err(|error| Failure::parameter(format!("{what}: {error}")))
}

fn word<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, Failure> {
    serde_json::from_value(serde_json::Value::from(text))
        .map_err(|error| Failure::parameter(format!("{name}: {error}")))
}

/// The faces of an array of signed numbers.
///
/// # Errors
/// [`Kind::Mesh`] names the first face that refers to a vertex that is not there.
pub fn faces_of(faces: &[[i64; 3]], vertices: usize) -> Result<Vec<[u32; 3]>, Failure> {
    let inside = |vertex: i64| u32::try_from(vertex).ok().filter(|&own| (own as usize) < vertices);
    let face = |(face, corners): (usize, &[i64; 3])| {
        let mut own = [0; 3];
        for (slot, &vertex) in own.iter_mut().zip(corners) {
            *slot = inside(vertex).ok_or_else(|| {
                let message = format!("face {face} refers to vertex {vertex} of {vertices}");
                Failure::new(Kind::Mesh, "index-out-of-range", message)
            })?;
        }
        Ok(own)
    };
    faces.iter().enumerate().map(face).collect()
}

/// A checked mesh.
#[pyclass(frozen, name = "Mesh", module = "chladni._native")]
#[derive(Debug)]
pub struct NativeMesh {
    pub body: Arc<Body>,
}

#[pymethods]
impl NativeMesh {
    /// Checks a mesh of arrays: positions (n, 3) and triangles (f, 3), C-contiguous. `polygons`: which polygon each
    /// triangle is a part of.
    #[staticmethod]
    #[pyo3(signature = (vertices, faces, merge, subdivide, polygons = None))]
    fn from_arrays(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
        merge: &str,
        subdivide: u8,
        polygons: Option<Vec<u32>>,
    ) -> PyResult<Self> {
        let positions = arrays::rows::<f64, 3>(&vertices, "vertices")?.to_vec();
        let faces = faces_of(arrays::rows::<i64, 3>(&faces, "faces")?, positions.len())?;
        let polygons = polygons.filter(|of_triangle| of_triangle.len() == faces.len()).map(|of_triangle| {
            let count = of_triangle.iter().max().map_or(0, |&last| last as usize + 1);
            Polygons { of_triangle, count }
        });
        let raw = RawMesh { positions, faces, polygons, ..RawMesh::default() };
        let options =
            CheckOptions { merge: word::<Merge>("merge", merge)?, subdivisions: subdivide, ..CheckOptions::default() };
        let body = watch::run(py, None, |_| Body::new(raw, &options))?;
        Ok(Self { body: Arc::new(body) })
    }

    /// Checks the mesh of a file that is in memory. Without a format, it is told by the ending of the name, or by the
    /// content.
    #[staticmethod]
    fn from_bytes(
        py: Python<'_>,
        content: &[u8],
        name: &str,
        format: Option<&str>,
        merge: &str,
        surface: &str,
        subdivide: u8,
    ) -> PyResult<Self> {
        let unknown =
            || Failure::new(Kind::Format, "unknown-format", format!("{name}: the format cannot be recognised"));
        let format = match format {
            Some(format) => MeshFormat::from_extension(format),
            None => name
                .rsplit_once('.')
                .and_then(|(_, ending)| MeshFormat::from_extension(ending))
                .or_else(|| MeshFormat::sniff(content)),
        };
        let format = format.ok_or_else(unknown)?;
        let options = CheckOptions {
            merge: word::<Merge>("merge", merge)?,
            surface: word::<SurfaceOf>("surface", surface)?,
            subdivisions: subdivide,
            ..CheckOptions::default()
        };
        let body = watch::run(py, None, |_| Body::new(read(content, format, &ReadLimits::default())?, &options))?;
        Ok(Self { body: Arc::new(body) })
    }

    /// Positions and triangles, (n, 3) and (f, 3), as they were given.
    fn given<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        match &self.body.given {
            Some(TriangleMesh { positions, faces, .. }) => pair(py, positions, faces),
            None => self.kept(py),
        }
    }

    /// Positions and triangles of the mesh that was kept after repairs.
    fn kept<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let mesh = self.body.mesh();
        pair(py, &mesh.positions, &mesh.faces)
    }

    /// For each vertex that was given the kept one, −1 where it was dropped.
    fn vertex_map<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        vertex_map(py, &self.body.numbering)
    }

    /// For each kept face the one that it is or is a part of.
    fn face_map<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.body.numbering.face_map().map(i64::from).collect::<Vec<_>>().into_pyarray(py)
    }

    /// What a check found and repaired, as JSON.
    fn report(&self) -> PyResult<String> {
        json(&self.body.checked.surface.report)
    }

    /// Runs a job of the kind `eigenbasis` with parameters as JSON.
    #[pyo3(signature = (parameters, progress=None))]
    fn eigenbasis(
        &self,
        py: Python<'_>,
        parameters: &str,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<NativeBasis> {
        let body = Arc::clone(&self.body);
        let job = body.job("eigenbasis", parameters)?;
        let outcome = watch::run(py, progress, |monitor| body.run(&job, monitor))?;
        match outcome.product {
            Product::Eigenbasis(basis) => Ok(NativeBasis::new(basis, Some(Arc::clone(&body)), outcome.seconds)),
            _ => Err(Failure::new(Kind::Solve, "internal", "the job made a different kind of product").into()),
        }
    }

    /// Stiffness and mass of an operator, in the numbering of the kept mesh:
    /// `((data, indices, indptr), mass, area, unknowns)`.
    fn pencil<'py>(&self, py: Python<'py>, parameters: &str) -> PyResult<Bound<'py, PyTuple>> {
        let mut given: Packed = parsed("operator", parameters)?;
        translate_parameters(&mut given, &self.body.translation(false), self.body.size()).map_err(Failure::from)?;
        let Packed::Object(_) = &given else { return Err(Failure::parameter("operator: expected an object").into()) };
        let parameters: OperatorParameters = serde::Deserialize::deserialize(&given)
            .map_err(|error: serde_json::Error| Failure::parameter(format!("operator: {error}")))?;
        let body = Arc::clone(&self.body);
        let MeshOperator { problem, .. } =
            watch::run(py, None, |monitor| Ok(assemble(body.mesh(), &parameters, monitor)?))?;
        let unknowns =
            problem.unknowns.map(|unknowns| unknowns.into_iter().map(i64::from).collect::<Vec<_>>().into_pyarray(py));
        let mass = problem.mass.scaled(problem.area);
        (arrays::csr(py, &problem.stiffness)?, arrays::mass(py, &mass)?, problem.area, unknowns).into_pyobject(py)
    }

    /// Geodesic distances: a row for each vertex, or pair, a column for each source. The request is that of the API, as
    /// JSON.
    fn distances<'py>(&self, py: Python<'py>, request: &str, nearest: bool) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut request: DistanceRequest = parsed("distances", request)?;
        let body = Arc::clone(&self.body);
        let to = body.translation(nearest);
        request.translate(&to, body.mesh().positions.len()).map_err(Failure::from)?;
        let found = watch::run(py, None, |monitor| {
            request.check()?;
            let Some((method, time)) = request.on_mesh() else {
                return Err(chladni_work::distances::DistanceFault::NeedsBasis.into());
            };
            let usual = time.is_none() && method == chladni_work::distances::GeodesicMethod::Heat;
            let prepared = match body.heat.get().filter(|_| usual) {
                Some(prepared) => Arc::clone(prepared),
                None => {
                    let made = MeshDistances::new(body.mesh(), method, time, monitor)?;
                    let made = made.ok_or(chladni_work::distances::DistanceFault::NeedsBasis)?;
                    let made = Arc::new(made);
                    if usual { Arc::clone(body.heat.get_or_init(|| made)) } else { made }
                }
            };
            let found = request.geodesics(&prepared, monitor)?;
            Ok((request.translated(&to, found.table), found.slope_error))
        })?;
        arrays::distances(py, found)
    }
}

/// The vertex map of a numbering.
pub fn vertex_map<'py>(py: Python<'py>, numbering: &Numbering) -> Bound<'py, PyArray1<i64>> {
    numbering.vertex_map().map(|kept| kept.map_or(-1, i64::from)).collect::<Vec<_>>().into_pyarray(py)
}

/// A value as JSON.
///
/// # Errors
/// [`Kind::Solve`], which no value of ours comes to.
pub fn json(value: &impl serde::Serialize) -> PyResult<String> {
    Ok(serde_json::to_string(value).map_err(|error| Failure::new(Kind::Solve, "internal", error.to_string()))?)
}

fn pair<'py>(py: Python<'py>, positions: &[[f64; 3]], faces: &[[u32; 3]]) -> PyResult<Bound<'py, PyTuple>> {
    let corners: Vec<i64> = faces.as_flattened().iter().map(|&vertex| i64::from(vertex)).collect();
    let positions = positions.as_flattened().to_vec().into_pyarray(py).reshape([positions.len(), 3])?;
    (positions, corners.into_pyarray(py).reshape([faces.len(), 3])?).into_pyobject(py)
}

/// Positions and triangles of a generated shape.
#[pyfunction]
pub fn sample<'py>(py: Python<'py>, shape: &str, vertices: usize) -> PyResult<Bound<'py, PyTuple>> {
    let shape: Shape =
        shape.parse().map_err(|error: chladni_mesh::shape::ShapeError| Failure::parameter(error.to_string()))?;
    let mesh = generate(shape, vertices).map_err(|error| Failure::parameter(error.to_string()))?;
    pair(py, &mesh.positions, &mesh.faces)
}
