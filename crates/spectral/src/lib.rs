//! Spectral geometry: eigenbases of surfaces and solids, compact and certified, and what they are good for.
//!
//! A [`mesh`] is read and checked, an [`operator`] is assembled on it, its eigenproblem is solved ([`spectrum`]), and
//! the eigenfunctions become a [`basis`] that can be stored in several [`formats`] and used in [`analysis`]: filters,
//! distances, signatures, functional maps, vibration. Tangential fields have spaces of their own ([`field`]).
//!
//! # A file and its eigenpairs
//!
//! ```no_run
//! # use chladni_spectral::Mesh;
//! let pairs = Mesh::read("bunny.ply")?.eigen(50).exact(1e-6)?;
//! # Ok::<(), chladni_spectral::MeshSolveError>(())
//! ```
//!
//! # Eigenpairs that are proven complete
//!
//! The same step by step:
//!
//! ```
//! use chladni_spectral::mesh::shape::{Shape, generate};
//! use chladni_spectral::operator::{OperatorParameters, assemble};
//! use chladni_spectral::spectrum::hsim::{HsimParameters, Selection, solve};
//! use chladni_spectral::Unwatched;
//!
//! let sphere = generate(Shape::Sphere, 1000)?;
//! let operator = assemble(&sphere, &OperatorParameters::default(), &Unwatched)?;
//! let parameters = HsimParameters { selection: Selection::Count(9), tolerance: 1e-6, ..HsimParameters::default() };
//! let pairs = solve(&sphere, &operator.problem, &parameters, false, &Unwatched)?;
//!
//! // On the unit sphere they are l (l + 1), each 2 l + 1 times; the mesh has them to within a percent.
//! for (found, exact) in pairs.values.iter().zip([0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0]) {
//!     assert!((found - exact).abs() <= 0.01 * exact + 1e-6, "{found} is not {exact}");
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A basis of a mesh file
//!
//! A hundred approximate pairs in a subspace of 300 locally supported functions, each pair with an estimate of its
//! error, as an NPZ file that NumPy and SciPy open:
//!
//! ```no_run
//! use chladni_spectral::formats::npz;
//! use chladni_spectral::mesh::check::{CheckOptions, check};
//! use chladni_spectral::mesh::read::{MeshFormat, ReadLimits, read};
//! use chladni_spectral::operator::{OperatorParameters, assemble};
//! use chladni_spectral::spectrum::heat::HeatParameters;
//! use chladni_spectral::spectrum::{ApproximationParameters, Goal, MOST_ROUNDS, Space, approximate};
//! use chladni_spectral::Unwatched;
//!
//! let file = read(&std::fs::read("bunny.ply")?, MeshFormat::Ply, &ReadLimits::default())?;
//! let mesh = check(file, &CheckOptions::default())?.mesh;
//! let operator = assemble(&mesh, &OperatorParameters::default(), &Unwatched)?;
//! let parameters = ApproximationParameters {
//!     count: 100,
//!     dimension: 300,
//!     space: Space::Heat(HeatParameters::default()),
//!     goal: Some(Goal { error: 0.01, rounds: MOST_ROUNDS }),
//!     certify: false,
//!     seed: 0,
//! };
//! let basis = approximate(&mesh, &operator, &parameters, &Unwatched)?;
//! npz::write(&basis, std::fs::File::create("bunny.npz")?)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Long work
//!
//! What takes long reports to a [`Monitor`], which may also end it; [`Unwatched`] does neither. All of it runs on the
//! rayon pool of the calling thread. Nothing here reads the environment or prints, and [`Mesh::read`] alone opens a
//! file.
//!
//! # Features
//!
//! `gpu`, off by default: large dense problems on a graphics card, through wgpu, once [`algebra::gpu::choose`] has
//! named one.

pub mod analysis;
pub mod basis;
mod facade;
pub mod field;
pub mod formats;
pub mod operator;
pub mod spectrum;
pub mod verify;

pub use chladni_base::{Cancelled, Monitor, Quiet, StageClock, Unwatched};
pub use chladni_mesh as mesh;
pub use facade::{Eigen, Mesh, MeshSolveError};

/// Of the matrices and dense solvers what takes part in signatures here.
pub mod algebra {
    pub use chladni_algebra::{
        ComputedOn, CpuSolver, DenseMatrix, EigenError, EigenPairs, FactorError, GalerkinError, MassMatrix,
        PanelMatrix, SparseError, SparseMatrix, SymmetricDefiniteSolver, gpu,
    };
}
