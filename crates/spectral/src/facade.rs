//! The short way: a mesh file in, eigenpairs out.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};

use chladni_base::{Monitor, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::points::{check_points, has_points_alone};
use chladni_mesh::check::{CheckOptions, MeshError, MeshReport, check};
use chladni_mesh::numbering::Numbering;
use chladni_mesh::points::{are_points, once_each};
use chladni_mesh::read::{MeshFormat, RawMesh, ReadError, ReadLimits, read};

use crate::basis::Basis;
use crate::operator::points::{assemble_local, local_triangles};
use crate::operator::{MeshOperator, OperatorError, OperatorParameters, assemble};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::hsim::{self, Eigenpairs, HsimError, HsimParameters, Selection};
use crate::spectrum::{
    ApproximationError, ApproximationParameters, Goal, MOST_ROUNDS, Space, approximate, dimension_for,
};

/// A surface that was read and checked, and is ready to be solved on.
///
/// ```no_run
/// use chladni_spectral::Mesh;
///
/// let pairs = Mesh::read("bunny.ply")?.eigen(50).exact(1e-6)?;
/// println!("{:?}", pairs.values);
/// # Ok::<(), chladni_spectral::MeshSolveError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    surface: TriangleMesh,
    report: MeshReport,
    numbering: Numbering,
}

/// Why there is no mesh, or there are no eigenpairs.
#[derive(Debug, thiserror::Error)]
pub enum MeshSolveError {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The ending of the file names no format.
    #[error("{}: the ending names no mesh format", .0.display())]
    Format(PathBuf),
    /// The file is none of its format.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The mesh cannot be used.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// There is no such operator on the mesh.
    #[error(transparent)]
    Operator(#[from] OperatorError),
    /// The exact solve failed.
    #[error(transparent)]
    Exact(#[from] HsimError),
    /// The approximation failed.
    #[error(transparent)]
    Approximation(#[from] ApproximationError),
}

impl Mesh {
    /// Reads a file, in the format that its ending names, and repairs what can be repaired without loss; gzip is
    /// unpacked first, and its ending `.gz` is none. Vertices and faces are limited as in [`ReadLimits::default`].
    ///
    /// # Errors
    /// [`MeshSolveError`]: a file that cannot be read, or is no mesh.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, MeshSolveError> {
        let path = path.as_ref();
        let named_gz = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
        let inner = if named_gz { path.with_extension("") } else { path.to_owned() };
        let format = inner
            .extension()
            .and_then(|ending| MeshFormat::from_extension(ending.to_str()?))
            .ok_or_else(|| MeshSolveError::Format(path.to_owned()))?;
        let failed = |source| MeshSolveError::File { path: path.to_owned(), source };
        let mut bytes = std::fs::read(path).map_err(failed)?;
        if bytes.starts_with(&[0x1f, 0x8b]) {
            let mut unpacked = Vec::new();
            flate2::read::MultiGzDecoder::new(&bytes[..]).read_to_end(&mut unpacked).map_err(failed)?;
            bytes = unpacked;
        }
        Self::checked(read(&bytes, format, &ReadLimits::default())?)
    }

    /// A mesh of positions and faces, which name them from 0 on; without faces, a set of points, which are numbered
    /// anew: see [`numbering`](Self::numbering).
    ///
    /// # Errors
    /// [`MeshSolveError::Mesh`] names the first element that makes the mesh unusable.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, MeshSolveError> {
        Self::checked(RawMesh { positions, faces, ..RawMesh::default() })
    }

    fn checked(raw: RawMesh) -> Result<Self, MeshSolveError> {
        let options = CheckOptions::default();
        let checked = if has_points_alone(&raw) { check_points(raw, &options)? } else { check(raw, &options)? };
        Ok(Self { surface: checked.mesh, report: checked.report, numbering: checked.numbering })
    }

    /// The vertices and faces that are solved on: those of the file, in its order, without what was dropped.
    pub fn surface(&self) -> &TriangleMesh {
        &self.surface
    }

    /// What was found and repaired.
    pub fn report(&self) -> &MeshReport {
        &self.report
    }

    /// Where the vertices and faces of the file went.
    pub fn numbering(&self) -> &Numbering {
        &self.numbering
    }

    /// A question for the lowest `count` eigenpairs, the constants included; nothing is computed yet.
    pub fn eigen(&self, count: usize) -> Eigen<'_> {
        Eigen { mesh: self, count, operator: OperatorParameters::default(), seed: 0, monitor: &Unwatched }
    }
}

/// A question for eigenpairs of a [`Mesh`], until [`exact`](Self::exact) or [`approximate`](Self::approximate) answers
/// it.
#[derive(Clone)]
pub struct Eigen<'a> {
    mesh: &'a Mesh,
    count: usize,
    operator: OperatorParameters,
    seed: u64,
    monitor: &'a dyn Monitor,
}

impl<'a> Eigen<'a> {
    /// The operator, its mass and its boundary condition, instead of the Laplacian with a lumped mass and a free
    /// boundary.
    pub fn operator(mut self, operator: OperatorParameters) -> Self {
        self.operator = operator;
        self
    }

    /// Seeds what is drawn at random, instead of 0.
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Is told how the work gets on, and may end it.
    pub fn watched_by(mut self, monitor: &'a dyn Monitor) -> Self {
        self.monitor = monitor;
        self
    }

    /// The operator, and the triangles that a solver's spaces are made of: of points those around each.
    fn operator_on(&self) -> Result<(MeshOperator, Cow<'a, TriangleMesh>), MeshSolveError> {
        let surface = &self.mesh.surface;
        if !are_points(surface) {
            return Ok((assemble(surface, &self.operator, self.monitor)?, Cow::Borrowed(surface)));
        }
        self.operator.check_points()?;
        let triangles = local_triangles(surface, self.monitor)?;
        let operator = assemble_local(&triangles, &self.operator, self.monitor)?;
        Ok((operator, Cow::Owned(once_each(&triangles))))
    }

    /// The pairs to a relative residual of `tolerance`, 1e-10 to 0.5, proven complete: [`hsim::solve`].
    ///
    /// # Errors
    /// [`MeshSolveError`]: an operator that the mesh does not allow, or pairs that do not converge.
    pub fn exact(self, tolerance: f64) -> Result<Eigenpairs, MeshSolveError> {
        let (operator, surface) = self.operator_on()?;
        let selection = Selection::Count(self.count);
        let parameters = HsimParameters { selection, tolerance, seed: self.seed, ..HsimParameters::default() };
        Ok(hsim::solve(&surface, &operator.problem, &parameters, false, self.monitor)?)
    }

    /// The pairs in a space of locally supported functions, each with an estimate of its error, which is to be at most
    /// `goal` of the value: [`approximate`].
    ///
    /// # Errors
    /// [`MeshSolveError`]: an operator that the mesh does not allow, or a space that does not hold so many pairs.
    pub fn approximate(self, goal: f64) -> Result<Basis, MeshSolveError> {
        let (operator, surface) = self.operator_on()?;
        let parameters = ApproximationParameters {
            count: self.count,
            dimension: dimension_for(self.count, 2),
            space: Space::Heat(HeatParameters::default()),
            goal: Some(Goal { error: goal, rounds: MOST_ROUNDS }),
            certify: false,
            seed: self.seed,
        };
        Ok(approximate(&*surface, &operator, &parameters, self.monitor)?)
    }
}

#[cfg(test)]
mod tests {
    use chladni_mesh::shape::{Shape, generate};
    use chladni_mesh::write::write_obj;

    use super::{Mesh, MeshSolveError};

    #[test]
    fn a_file_is_solved_in_two_lines_and_both_ways_agree() {
        let sphere = generate(Shape::Sphere, 3000).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sphere.obj");
        let mut text = Vec::new();
        write_obj(&sphere, &mut text).unwrap();
        std::fs::write(&path, &text).unwrap();
        let mesh = Mesh::read(&path).unwrap();
        assert_eq!(mesh.surface().faces, sphere.faces);
        let exact = mesh.eigen(9).exact(1e-8).unwrap();
        let approximate = mesh.eigen(9).seed(3).approximate(0.01).unwrap();
        for (k, l) in [0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0].into_iter().enumerate() {
            let analytic: f64 = l * (l + 1.0);
            assert!((exact.values[k] - analytic).abs() <= 0.01 * analytic + 1e-9);
            assert!((approximate.eigenvalues[k] - exact.values[k]).abs() <= 0.02 * analytic + 1e-6);
        }
    }

    #[test]
    fn points_without_faces_are_solved_too() {
        let sphere = generate(Shape::Sphere, 3000).unwrap();
        let points = Mesh::new(sphere.positions, Vec::new()).unwrap();
        assert!(points.report().points);
        let exact = points.eigen(9).exact(1e-6).unwrap();
        let approximate = points.eigen(9).approximate(0.01).unwrap();
        for (k, l) in [0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0].into_iter().enumerate() {
            let analytic: f64 = l * (l + 1.0);
            assert!((exact.values[k] - analytic).abs() <= 0.02 * analytic + 1e-9);
            assert!((approximate.eigenvalues[k] - exact.values[k]).abs() <= 0.02 * analytic + 1e-6);
        }
    }

    #[test]
    fn what_is_no_mesh_is_named() {
        assert!(matches!(Mesh::read("bunny.txt"), Err(MeshSolveError::Format(path)) if path.ends_with("bunny.txt")));
        let missing = Mesh::read("no-such-folder/bunny.ply").unwrap_err();
        assert!(missing.to_string().contains("no-such-folder/bunny.ply"), "{missing}");
        let open = Mesh::new(vec![[0.0; 3]; 3], vec![[0, 1, 7]]).unwrap_err();
        assert!(open.to_string().contains('7'), "{open}");
    }
}
