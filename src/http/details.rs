//! What a basis tells of itself by its kind, as the OpenAPI document describes it; what is sent is what was stored with
//! the basis.

use chladni_spectral::basis::{Certificate, FieldCertificate, InertiaCount};
use chladni_spectral::operator::OperatorReport;
use chladni_spectral::operator::elastic::ElasticReport;
use chladni_spectral::operator::transport::FieldKind;
use utoipa::ToSchema;

use super::map_collections::Cycles;

/// A long list of parameters, told by its length and its hash.
#[derive(ToSchema)]
#[schema(example = json!({"numbers": 2930, "blake3": "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262"}))]
#[allow(dead_code)]
pub struct AbbreviatedList {
    /// How many values it has.
    numbers: u64,
    /// The BLAKE3 hash of the values as little-endian f64, 64 hexadecimal digits.
    blake3: String,
}

/// How the operator of an eigenbasis was made: of functions, or of eigenfields.
#[derive(ToSchema)]
#[serde(untagged)]
#[allow(dead_code)]
pub enum EigenbasisOperator {
    /// Of functions.
    Functions(FunctionOperator),
    /// Of eigenfields.
    Fields(HodgeOperator),
}

/// How the operator of functions was made, and why.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct FunctionOperator {
    #[serde(flatten)]
    report: OperatorReport,
    /// Of a solid: whether the basis is of its inside; absent for other meshes.
    #[schema(inline)]
    domain: Domain,
}

/// What part of a solid a basis lives on.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code)]
enum Domain {
    /// Its tetrahedra.
    Solid,
    /// Its surface alone.
    SurfaceOfSolid,
}

/// How the Hodge–Laplacian was made.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct HodgeOperator {
    /// What the fields are.
    hodge: HodgeReport,
    /// Faces without an area.
    zero_area_faces: u64,
    /// `surface_of_solid`, where the mesh is one; absent for other meshes.
    #[schema(inline)]
    domain: Domain,
}

/// What the eigenfields are, and how they were counted.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct HodgeReport {
    /// Harmonic fields.
    harmonic: u64,
    /// Gradients.
    gradients: u64,
    /// Co-gradients.
    co_gradients: u64,
    /// What each field is.
    #[schema(inline)]
    parts: Vec<FieldPart>,
    /// The counts of the two scalar spectra.
    inertia: HodgeInertia,
}

/// What an eigenfield is.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code)]
enum FieldPart {
    /// Neither divergence nor curl.
    Harmonic,
    /// No curl.
    Gradient,
    /// No divergence.
    CoGradient,
}

/// Eigenvalues counted below shifts.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct HodgeInertia {
    /// Of gradients.
    gradients: Vec<InertiaCount>,
    /// Of co-gradients.
    co_gradients: Vec<InertiaCount>,
}

/// How a basis came about.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct EigenbasisDetails {
    /// A note for each dense problem: the graphics card that solved it, or why it did not; absent where no card had to
    /// do with it.
    dense_solver: Vec<String>,
    /// The graphics card that measured the errors of an approximation, a note for each time, or why it did not; absent
    /// where no card had to do with it.
    measured_on: Vec<String>,
    /// Where a faster way was given up for a surer one, and why; absent where none was.
    fallbacks: Vec<String>,
    /// The parts that it was joined of, from the lowest pairs up; absent where it was solved in one piece.
    #[schema(inline)]
    parts: Vec<SolvedPart>,
}

/// A part that was solved by itself.
#[derive(ToSchema)]
#[allow(dead_code)]
struct SolvedPart {
    /// Which one, from 1.
    part: u64,
    /// Its pairs, those that it shares with its neighbours included; 0 where it was given up, and of an approximation,
    /// whose parts are of the surface.
    pairs: u64,
    /// Of an approximation, the vertices on which it measured all pairs; else 0.
    unknowns: Option<u64>,
    /// Seconds that it took.
    seconds: f64,
    /// Threads that solved it.
    threads: u64,
}

/// The parameters of a job that solves a part of another.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct EigenbasisPartParameters {
    /// Which part, from 1.
    part: u64,
    /// Of so many.
    of: u64,
    /// The parameters of the whole.
    #[schema(schema_with = eigenbasis_parameters)]
    parameters: (),
}

fn eigenbasis_parameters() -> utoipa::openapi::Ref {
    utoipa::openapi::Ref::from_schema_name("EigenbasisParameters")
}

/// What only a field basis has.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct FieldBasisDetails {
    /// What is stored in a face.
    field: FieldKind,
    /// Faces of the surface.
    faces: u64,
    /// Numbers in a face: 2, or 3 of a tensor.
    numbers_per_face: u64,
    /// Columns that are not local, for the harmonic fields of handles.
    dense_columns: u64,
    /// Entries of a row on average.
    nonzeros_per_row: f64,
    /// The area of the surface, in squared units of the mesh.
    area: f64,
    /// What solved its dense problems; absent where no graphics card had to do with it.
    dense_solver: Vec<String>,
}

/// What only a family of operators has.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct OperatorFamilyDetails {
    /// The members whose eigenfunctions span the space; none where it holds every function.
    anchors: Vec<AnchorReport>,
    /// What solved its dense problems; absent where no graphics card had to do with it.
    dense_solver: Vec<String>,
}

/// A member whose eigenfunctions are in the space.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct AnchorReport {
    /// Its `t`.
    extrinsic: f64,
    /// Its `v`.
    curvature: f64,
    /// How many of its pairs were taken.
    pairs: u64,
    /// How they were computed.
    method: String,
}

/// What only a vibration basis has.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct VibrationBasisDetails {
    /// The first modes, of frequency zero, that move the object as a rigid one.
    rigid_motions: u64,
    /// Vertices of the object.
    vertices: u64,
    /// The frequency of each mode, in 1/time.
    frequencies: Vec<f64>,
    /// What solved its dense problems; absent where no graphics card had to do with it.
    dense_solver: Vec<String>,
}

/// What only eigenvectors of a problem have.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct PencilBasisDetails {
    /// Rows that are not fixed.
    unknowns: Option<u64>,
    /// The multiple c of the mass that residuals ‖Sx − λMx‖ / ‖(S + cM)x‖ are relative to.
    moved: f64,
    /// What solved its dense problems; absent where no graphics card had to do with it.
    dense_solver: Vec<String>,
    /// Where a faster way was given up for a surer one, and why; absent where none was.
    fallbacks: Vec<String>,
}

/// What only maps between shapes have.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct MapCollectionDetails {
    /// The bases of the shapes, in their order.
    bases: Vec<String>,
    /// Their meshes.
    meshes: Vec<String>,
    /// The vertices of each.
    vertices: Vec<u64>,
    /// How consistent the maps are.
    #[schema(inline)]
    cycles: Cycles,
    /// What solved its dense problems; absent where no graphics card had to do with it.
    dense_solver: Vec<String>,
}

/// What is known of vibration modes: proven by HSIM, or estimated for the approximation.
#[derive(ToSchema)]
#[serde(untagged)]
#[allow(dead_code)]
pub enum VibrationCertificate {
    /// By HSIM.
    Proven(ProvenModes),
    /// By the approximation, refined.
    Estimated(EstimatedModes),
}

/// What HSIM has proven of modes.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct ProvenModes {
    /// That none was skipped.
    complete: bool,
    /// Eigenvalues counted below shifts.
    inertia: Vec<InertiaCount>,
    /// The largest residual of a mode.
    largest_residual: f64,
}

/// What the approximation estimates of modes.
#[derive(ToSchema)]
#[allow(dead_code)]
pub struct EstimatedModes {
    /// Whether none was skipped: only where exact modes stand in for approximate ones, of which some were lacking or
    /// too far off.
    complete: bool,
    /// Eigenvalues counted below shifts, of approximate modes near the last.
    inertia: Vec<InertiaCount>,
    /// How many of those counted the approximate modes lack.
    lacking: u64,
    /// How often the modes were refined on the mesh.
    inverse_iterations: u64,
    /// The largest estimated relative error of a frequency.
    estimated_error: f64,
    /// Per mode.
    estimated_errors: Vec<f64>,
}

/// Everything of which the document makes bases, by kind.
#[derive(utoipa::OpenApi)]
#[openapi(components(schemas(
    AbbreviatedList,
    Certificate,
    OperatorReport,
    ElasticReport,
    EigenbasisOperator,
    EigenbasisDetails,
    EigenbasisPartParameters,
    FieldBasisDetails,
    FieldCertificate,
    OperatorFamilyDetails,
    VibrationBasisDetails,
    VibrationCertificate,
    PencilBasisDetails,
    MapCollectionDetails
)))]
pub struct Details;
