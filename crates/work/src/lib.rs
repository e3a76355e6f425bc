//! The kinds of job, their parameters with defaults and limits, and how one runs: a pure function of its inputs and a
//! [`Monitor`].
//!
//! A further kind is a file with its parameters, which implement [`Work`], a variant of [`JobParameters`] and a line in
//! each of [`KINDS`], [`JobParameters::parse`] and `JobParameters::work`.

pub mod basis_comparison;
mod choice;
pub mod compression;
pub mod design;
pub mod distances;
mod eigenbasis;
pub mod family_spectrum;
mod field_basis;
pub mod functional_map;
mod idle;
mod map_collection;
pub mod mappable;
pub mod numbered;
mod operator_family;
pub mod own_mesh;
pub mod packed;
mod pencil_basis;
pub mod plain;
pub mod projection;
#[cfg(feature = "schema")]
pub mod schema;
pub mod shape_comparison;
pub mod signatures;
pub mod simulate;
pub mod table;
pub mod value_gradient;
pub mod verification;
mod vibration_basis;

use chladni_base::{Cancelled, Monitor, StageClock, stopped};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::basis::{JobRecord, PARTS, Product};
use chladni_spectral::operator::OperatorError;
use chladni_spectral::spectrum::ApproximationError;
use chladni_spectral::spectrum::hsim::HsimError;
use chladni_spectral::spectrum::hsim::parts::PartError;
use chladni_spectral::spectrum::pencil::PencilError;
use chladni_spectral::spectrum::vibration::VibrationError;

use packed::Packed;

pub use eigenbasis::{
    Accuracy, Approximate, Automatic, Construction, Division, EigenbasisParameters, Exact, HsimVariant, MOST_PARTS,
    MadePart, Method, MethodName, PartJob, PartSource, Parts, Start, StorageKind,
};

pub use field_basis::{FieldBasisParameters, FieldConstruction, FieldName};
pub use idle::{IDLE, IdleParameters};
pub use map_collection::{MapCollectionParameters, StoredShape};

use chladni_spectral::field::{DesignError, FieldError, RefineError, SurfaceError};
pub use operator_family::OperatorFamilyParameters;
pub use pencil_basis::{PencilBasisParameters, ProblemSize};
pub use vibration_basis::{VibrationBasisParameters, VibrationMethodName};

/// The version of the solvers: it enters the key of equal work, so that a better solver does not answer with old
/// results.
pub const SOLVER_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "+25");

/// The names of all kinds of job that work on a mesh.
pub const MESH_KINDS: &[&str] = &["eigenbasis", "field_basis", "operator_family", "vibration_basis"];

/// The names of all kinds of job.
pub const KINDS: &[&str] =
    &["eigenbasis", "field_basis", "operator_family", "vibration_basis", "pencil_basis", "map_collection"];

/// Why parameters were refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// There is no such kind of job.
    #[error("unknown kind of job \"{kind}\"; expected one of {}", KINDS.join(", "))]
    UnknownKind {
        /// The kind asked for.
        kind: String,
    },
    /// The parameters are not of the kind's form.
    #[error("parameters of a job of kind \"{kind}\": {reason}")]
    Form {
        /// The kind asked for.
        kind: &'static str,
        /// What does not fit, and where.
        reason: String,
    },
    /// The job needs faces, and the mesh has none.
    #[error("jobs of the kind \"{kind}\" need a surface with faces, and the mesh has only points")]
    NoFaces {
        /// The kind asked for.
        kind: &'static str,
    },
    /// A parameter has a value outside its range.
    #[error("parameter \"{name}\": {reason}")]
    Value {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
}

/// Why a job ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Its parameters do not fit the mesh.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// What it needs was counted, and is more than it was promised.
    #[error(
        "the job needs about {needed} bytes of memory, as counted before its work began, but may use only {promised}"
    )]
    Memory {
        /// About how much is needed.
        needed: u64,
        /// What was promised.
        promised: u64,
    },
    /// The operator could not be made.
    #[error(transparent)]
    Operator(OperatorError),
    /// The approximation failed.
    #[error(transparent)]
    Approximation(ApproximationError),
    /// The iteration failed.
    #[error(transparent)]
    Iteration(HsimError),
    /// The space of fields could not be made.
    #[error(transparent)]
    Field(FieldError),
    /// The eigenproblem in the space of fields failed.
    #[error(transparent)]
    Ritz(DesignError),
    /// Eigenfields cannot be judged.
    #[error(transparent)]
    Judged(RefineError),
    /// The vibration modes could not be computed.
    #[error(transparent)]
    Vibration(VibrationError),
    /// Matrices are no pencil.
    #[error(transparent)]
    Pencil(PencilError),
    /// Shapes could not be mapped to each other.
    #[error(transparent)]
    Analysis(AnalysisError),
    /// Parts of an eigenproblem could not be made, or joined.
    #[error(transparent)]
    Parts(PartError),
}

stopped!(
    JobError:
    VibrationError => Self::Vibration,
    HsimError => Self::Iteration,
    ApproximationError => Self::Approximation,
    OperatorError => Self::Operator,
    DesignError => Self::Ritz,
    FieldError => |error: FieldError| match error {
        FieldError::Operator(error) => error.into(),
        other => Self::Field(other),
    },
    RefineError => |error: RefineError| match error {
        RefineError::Operator(error) => error.into(),
        RefineError::Design(error) => error.into(),
        other => Self::Judged(other),
    },
);

impl From<SurfaceError> for JobError {
    fn from(error: SurfaceError) -> Self {
        FieldError::from(error).into()
    }
}

impl From<PartError> for JobError {
    fn from(error: PartError) -> Self {
        match error {
            PartError::Solver(error) => error.into(),
            PartError::Approximation(error) => error.into(),
            other => Self::Parts(other),
        }
    }
}

impl JobError {
    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Parameters(_) => "invalid-parameters",
            Self::Memory { .. } => "memory-exceeded",
            Self::Operator(error) => error.kind(),
            Self::Approximation(error) => error.kind(),
            Self::Iteration(error) => error.kind(),
            Self::Field(FieldError::Surface(_)) => "no-field-surface",
            Self::Field(FieldError::Parameter { .. } | FieldError::Weights { .. } | FieldError::Components { .. }) => {
                "invalid-parameters"
            }
            Self::Field(FieldError::Harmonic(_)) => "harmonic-fields-failed",
            Self::Field(FieldError::Restriction(_)) => "restriction-failed",
            Self::Field(_) => "subspace-failed",
            Self::Ritz(_) | Self::Judged(_) => "eigenproblem-failed",
            Self::Vibration(error) => error.kind(),
            Self::Pencil(error) => error.kind(),
            Self::Analysis(AnalysisError::Basis(_)) => "basis-unavailable",
            Self::Analysis(_) => "maps-failed",
            Self::Parts(error) => error.kind(),
        }
    }
}

/// What a job leaves behind.
#[derive(Debug)]
pub struct Outcome {
    /// What is to be stored.
    pub product: Product,
    /// Seconds spent in each stage, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

/// The size of the mesh that a job is to work on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshSize {
    /// Vertices.
    pub vertices: usize,
    /// Triangles; 0 where there are only points.
    pub faces: usize,
    /// Vertices of a solid, those of its surface included; 0 where there is none.
    pub solid_vertices: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
}

impl MeshSize {
    /// Whether the mesh has points without faces.
    pub fn are_points(&self) -> bool {
        self.faces == 0 && self.tetrahedra == 0 && self.vertices > 0
    }
}

impl From<&TriangleMesh> for MeshSize {
    fn from(mesh: &TriangleMesh) -> Self {
        Self { vertices: mesh.positions.len(), faces: mesh.faces.len(), ..Self::default() }
    }
}

impl MeshSize {
    /// The size of a mesh that may be the surface of a solid.
    pub fn of_body(mesh: &TriangleMesh, solid: Option<&TetMesh>) -> Self {
        let (solid_vertices, tetrahedra) =
            solid.map_or((0, 0), |solid| (solid.positions.len(), solid.tetrahedra.len()));
        Self { solid_vertices, tetrahedra, ..Self::from(mesh) }
    }
}

/// What the parameters of every kind of job can do.
pub trait Work {
    /// The parameters as JSON with every default filled in: equal work has equal canonical parameters. Parsing gives
    /// them back.
    fn canonical(&self) -> serde_json::Value;

    /// Checks the parameters against the size of a mesh.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where they ask for more than the mesh has.
    fn check_mesh(&self, mesh: MeshSize) -> Result<(), ParameterError>;

    /// An estimate of the memory that the job needs beside the server itself, in bytes.
    fn memory_bytes(&self, mesh: MeshSize) -> u64;

    /// About how many seconds of one core the job takes, where that is known.
    fn seconds(&self, _mesh: MeshSize) -> Option<f64> {
        None
    }

    /// Does the work on the rayon pool of the calling thread.
    ///
    /// # Errors
    /// [`JobError`]; in particular [`JobError::Cancelled`] soon after the monitor's checkpoint asks for it.
    fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Product, JobError>;

    /// The same for a mesh that may be the surface of a solid.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    fn run_body(
        &self,
        mesh: &TriangleMesh,
        _solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<Product, JobError> {
        self.run(mesh, monitor)
    }
}

/// The parameters of a job, checked, with every default filled in.
#[derive(Debug, Clone, PartialEq)]
pub enum JobParameters {
    /// Eigenpairs of an operator on a mesh.
    Eigenbasis(EigenbasisParameters),
    /// A space of tangential fields on a mesh.
    FieldBasis(FieldBasisParameters),
    /// A family of operators in one space.
    OperatorFamily(OperatorFamilyParameters),
    /// Vibration modes.
    VibrationBasis(VibrationBasisParameters),
    /// Eigenpairs of a pencil that came as matrices.
    PencilBasis(PencilBasisParameters),
    /// Maps between all shapes of a collection.
    MapCollection(MapCollectionParameters),
    /// Nothing, for trials.
    Idle(IdleParameters),
}

impl JobParameters {
    /// Reads and checks the parameters of a job of the given kind; `null` stands for all defaults.
    ///
    /// # Errors
    /// [`ParameterError`] names the kind or the parameter that does not fit.
    pub fn parse(kind: &str, parameters: &serde_json::Value) -> Result<Self, ParameterError> {
        Self::read(kind, &Packed::from(parameters))
    }

    /// The same from packed JSON.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read(kind: &str, parameters: &Packed) -> Result<Self, ParameterError> {
        match kind {
            "eigenbasis" => EigenbasisParameters::read(parameters).map(Self::Eigenbasis),
            "field_basis" => FieldBasisParameters::read(parameters).map(Self::FieldBasis),
            "operator_family" => OperatorFamilyParameters::read(parameters).map(Self::OperatorFamily),
            "vibration_basis" => VibrationBasisParameters::read(parameters).map(Self::VibrationBasis),
            "pencil_basis" => PencilBasisParameters::read(parameters).map(Self::PencilBasis),
            "map_collection" => MapCollectionParameters::read(parameters).map(Self::MapCollection),
            other => Err(ParameterError::UnknownKind { kind: other.chars().take(64).collect() }),
        }
    }

    /// The same for work that is done at once, here: nothing divides it.
    ///
    /// # Errors
    /// [`ParameterError::Value`]: it asks for parts, which a server's workers solve.
    pub fn undivided(self) -> Result<Self, ParameterError> {
        match &self {
            Self::Eigenbasis(EigenbasisParameters { parts: Some(_), .. }) => {
                let reason = "divides a job over the workers of a server; without one, `chladni solve --part K/N` solves a part, and \
                              `chladni join` makes the whole";
                Err(ParameterError::Value { name: "parts", reason: reason.to_owned() })
            }
            _ => Ok(self),
        }
    }

    /// The same where trials are welcome, which have a kind of their own.
    ///
    /// # Errors
    /// As for [`parse`](Self::parse).
    pub fn read_any(kind: &str, parameters: &Packed) -> Result<Self, ParameterError> {
        match kind {
            IDLE => IdleParameters::read(parameters).map(Self::Idle),
            kind => Self::read(kind, parameters),
        }
    }

    /// The kind of job.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Eigenbasis(_) => "eigenbasis",
            Self::FieldBasis(_) => "field_basis",
            Self::OperatorFamily(_) => "operator_family",
            Self::VibrationBasis(_) => "vibration_basis",
            Self::PencilBasis(_) => "pencil_basis",
            Self::MapCollection(_) => "map_collection",
            Self::Idle(_) => IDLE,
        }
    }

    fn work(&self) -> &dyn Work {
        match self {
            Self::Eigenbasis(parameters) => parameters,
            Self::FieldBasis(parameters) => parameters,
            Self::OperatorFamily(parameters) => parameters,
            Self::VibrationBasis(parameters) => parameters,
            Self::PencilBasis(parameters) => parameters,
            Self::MapCollection(parameters) => parameters,
            Self::Idle(parameters) => parameters,
        }
    }

    /// The parameters as JSON with every default filled in: equal work has equal canonical parameters.
    pub fn canonical(&self) -> serde_json::Value {
        self.work().canonical()
    }

    /// The key of equal work, 64 hexadecimal digits: a hash of mesh, kind, canonical parameters and solver version.
    /// Into how many parts it is divided makes no other work.
    pub fn work_key(&self, mesh: &str) -> String {
        self.work_key_of(mesh, &self.canonical())
    }

    /// The same where the canonical parameters are at hand.
    pub fn work_key_of(&self, mesh: &str, canonical: &serde_json::Value) -> String {
        match canonical.get(PARTS) {
            None => hash_of(&(mesh, self.kind(), canonical, SOLVER_VERSION)),
            Some(_) => hash_of(&(mesh, self.kind(), of_result(canonical.clone()), SOLVER_VERSION)),
        }
    }

    /// Checks the parameters against the size of a mesh.
    ///
    /// # Errors
    /// [`ParameterError::Value`] where they ask for more than the mesh has, [`ParameterError::NoFaces`] where it has
    /// only points and they need more.
    pub fn check_mesh(&self, mesh: MeshSize) -> Result<(), ParameterError> {
        let needs_faces = matches!(self, Self::FieldBasis(_) | Self::OperatorFamily(_) | Self::VibrationBasis(_));
        if mesh.are_points() && needs_faces {
            return Err(ParameterError::NoFaces { kind: self.kind() });
        }
        self.work().check_mesh(mesh)
    }

    /// An estimate of the memory that the job needs beside the server itself, in bytes.
    pub fn memory_bytes(&self, mesh: MeshSize) -> u64 {
        self.work().memory_bytes(mesh)
    }

    /// About how many seconds of one core the job takes, right to a factor of two; `None` where nobody has fitted it.
    pub fn seconds(&self, mesh: MeshSize) -> Option<f64> {
        self.work().seconds(mesh)
    }

    /// Runs the job on the rayon pool of the calling thread.
    ///
    /// # Errors
    /// [`JobError`]; in particular [`JobError::Cancelled`] soon after the monitor's checkpoint asks for it.
    pub fn run(&self, mesh: &TriangleMesh, monitor: &dyn Monitor) -> Result<Outcome, JobError> {
        self.run_body(mesh, None, monitor)
    }

    /// The same for a mesh that may be the surface of a solid.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_body(
        &self,
        mesh: &TriangleMesh,
        solid: Option<&TetMesh>,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, JobError> {
        self.check_mesh(MeshSize::of_body(mesh, solid))?;
        self.outcome(mesh, monitor, |clock| self.work().run_body(mesh, solid, clock))
    }

    /// What work on a mesh leaves behind, with what a product says about itself.
    fn outcome(
        &self,
        mesh: &TriangleMesh,
        monitor: &dyn Monitor,
        work: impl FnOnce(&dyn Monitor) -> Result<Product, JobError>,
    ) -> Result<Outcome, JobError> {
        let clock = StageClock::new(monitor);
        let mut product = work(&clock)?;
        let notes = clock.notes();
        let seconds = clock.finish();
        let mut parameters = of_result(self.canonical());
        abbreviate(&mut parameters);
        let made = JobRecord {
            kind: self.kind().to_owned(),
            parameters: parameters.as_object().cloned().unwrap_or_default(),
            solver_version: SOLVER_VERSION.to_owned(),
            vertices: mesh.positions.len(),
            faces: mesh.faces.len(),
        };
        let mut about = made.into_members();
        add_notes(&mut about, notes);
        product.describe(about);
        Ok(Outcome { product, seconds })
    }
}

/// What long work noted on its way, a list under each name.
fn add_notes(about: &mut serde_json::Map<String, serde_json::Value>, notes: Vec<(&'static str, String)>) {
    for (name, text) in notes {
        if let Some(list) = about.entry(name).or_insert_with(|| serde_json::json!([])).as_array_mut() {
            list.push(text.into());
        }
    }
}

/// Parameters without what makes no other result: into how many parts a job is divided.
fn of_result(mut parameters: serde_json::Value) -> serde_json::Value {
    if let Some(members) = parameters.as_object_mut() {
        members.remove(PARTS);
    }
    parameters
}

/// Reads parameters; `null` stands for all defaults.
fn read_parameters<T: serde::de::DeserializeOwned>(kind: &'static str, value: &Packed) -> Result<T, ParameterError> {
    let form = |reason| ParameterError::Form { kind, reason };
    let empty = Packed::Object(std::collections::BTreeMap::new());
    let value = match value {
        Packed::Null => &empty,
        Packed::Object(_) => value,
        _ => return Err(form("they must be an object".to_owned())),
    };
    plain::read(value).map_err(form)
}

/// The BLAKE3 hash of something as JSON, 64 hexadecimal digits; the text is not kept.
pub fn hash_of(something: &impl serde::Serialize) -> String {
    let mut hasher = blake3::Hasher::new();
    // A hasher takes whatever is written to it, and numbers, strings and lists can be written.
    let _ = serde_json::to_writer(std::io::BufWriter::new(&mut hasher), something);
    hasher.finalize().to_hex().to_string()
}

/// The same as [`abbreviate`], beside the parameters in full.
pub fn abbreviated(parameters: &serde_json::Value) -> serde_json::Value {
    match parameters {
        serde_json::Value::Object(members) => {
            members.iter().map(|(name, value)| (name.clone(), abbreviated(value))).collect()
        }
        serde_json::Value::Array(values) if values.len() > LONGEST_LIST => abbreviated_list(values),
        other => other.clone(),
    }
}

/// Values that are listed in full; longer lists are told by their number and their hash.
pub const LONGEST_LIST: usize = 16;

/// Shortens parameters for people: a list of numbers that is long, such as a potential, becomes its length and its
/// BLAKE3 hash.
pub fn abbreviate(parameters: &mut serde_json::Value) {
    match parameters {
        serde_json::Value::Object(members) => members.values_mut().for_each(abbreviate),
        serde_json::Value::Array(values) if values.len() > LONGEST_LIST => *parameters = abbreviated_list(values),
        _ => {}
    }
}

/// The number of values in a long list, and their hash.
fn abbreviated_list(values: &[serde_json::Value]) -> serde_json::Value {
    let mut hasher = blake3::Hasher::new();
    values.iter().filter_map(serde_json::Value::as_f64).for_each(|x| {
        hasher.update(&x.to_le_bytes());
    });
    serde_json::json!({"numbers": values.len(), "blake3": hasher.finalize().to_hex().as_str()})
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn keys_of_equal_work_are_hashes_of_the_canonical_parameters() {
        let values: Vec<f64> = (0..100).map(|i| f64::from(i) / 4.0).collect();
        let job = JobParameters::parse(
            "eigenbasis",
            &json!({"count": 7, "operator": {"hamiltonian": {"potential": {"values": values}}}}),
        );
        let job = job.unwrap();
        let text = json!(["a mesh", "eigenbasis", job.canonical(), SOLVER_VERSION]).to_string();
        assert_eq!(job.work_key("a mesh"), blake3::hash(text.as_bytes()).to_hex().to_string());
        let mut brief = job.canonical();
        abbreviate(&mut brief);
        assert_eq!(abbreviated(&job.canonical()), brief);
    }

    #[test]
    fn long_lists_are_told_by_their_length_and_hash() {
        let mut parameters = json!({"a": {"values": vec![0.5; 1000]}, "b": [1, 2]});
        abbreviate(&mut parameters);
        assert_eq!((&parameters["a"]["values"]["numbers"], &parameters["b"]), (&json!(1000), &json!([1, 2])));
        let mut other = json!({"a": {"values": vec![0.25; 1000]}});
        abbreviate(&mut other);
        assert_ne!(other["a"]["values"]["blake3"], parameters["a"]["values"]["blake3"]);
    }
}
