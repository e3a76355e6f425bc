//! A stored basis judged again, from its mesh alone.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_spectral::basis::ProductKind;
use chladni_spectral::verify::VerifyError;
use chladni_work::verification::{
    JudgeError, Promised, judge, judge_modes, judge_pencil, judging_bytes, modes_receipt, pencil_receipt, receipt,
};
use chladni_work::{
    EigenbasisParameters, JobError, JobParameters, MeshSize, PencilBasisParameters, ProblemSize,
    VibrationBasisParameters,
};
use serde_json::json;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::body;
use super::client::ClientState;
use super::exchange::Answer;
use super::extract;
use super::ids::BasisId;
use super::problem::{self, Problem};
use super::problems::problems;
use super::shares::Share;
use super::state::AppState;
use crate::store::BasisRecord;

/// The route of verification.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(verify_basis))
}

/// What the hashes of a receipt are.
const HASH: &str = "BLAKE3 of the content of the basis, the id of the mesh";

/// What was judged and what was found, as the answer has it.
#[derive(ToSchema)]
#[schema(as = VerificationReceipt, example = json!({
    "verdict": "confirmed", "hashes": {"basis": "2f1c…", "mesh": "0f6d2c4ab1e84cf29be2e3f0b5d1a7c3"}, "hash": "BLAKE3 of the content of the basis, the id of the mesh", "verified_by": "chladni 0.1.0",
    "operator": "laplace", "mass": "barycentric", "boundary": "neumann", "solved_with": {"method": "hsim", "count": 3}, "first": 0, "pairs": 3, "proven_complete": 3,
    "findings": [], "counts": [{"shift": 2.4, "below": 3, "claimed": 3, "values_below": 3}], "orthonormality_defect": 2e-15, "eigenvalues": [0.0, 1.1, 1.9],
    "bounds": [1e-14, 1e-9, 1e-9], "residuals": [1e-16, 2e-7, 3e-7], "distances": [1e-14, 2e-6, 3e-6], "seconds": 0.04
}))]
#[allow(dead_code)]
struct ReceiptSchema {
    /// `confirmed` where everything is as the basis says, `refuted` where something is not, `unconfirmed` where nothing
    /// is wrong and something could not be judged.
    verdict: String,
    /// BLAKE3 of the content of the basis, and the id of the mesh or of the problem.
    hashes: ReceiptHashes,
    /// What the hashes are of.
    hash: String,
    /// Program and version.
    verified_by: String,
    /// The operator that was assembled anew; `{"elastic": …}` of vibration modes, `pencil` where the matrices came as
    /// they are.
    operator: serde_json::Value,
    /// Its mass matrix; `lumped` of vibration modes, of a problem `identity`, `diagonal` or `sparse`.
    mass: String,
    /// Its boundary condition; of vibration modes `free` or `clamped`, of a problem `dirichlet` where rows are fixed,
    /// else `none`.
    boundary: String,
    /// The parameters of the job that made the basis.
    solved_with: serde_json::Value,
    /// The index of the first pair among all eigenvalues.
    first: u64,
    /// How many pairs there are.
    pairs: u64,
    /// So many of the pairs, from the first, are proven to be all there are from there; null where the basis claims no
    /// such thing, or it is not confirmed.
    proven_complete: Option<u64>,
    /// What is wrong, a sentence each.
    findings: Vec<String>,
    /// Eigenvalues counted anew below shifts.
    counts: Vec<RecountSchema>,
    /// The largest entry of |ΦᵀMΦ − I|.
    orthonormality_defect: f64,
    /// The eigenvalues of the basis.
    eigenvalues: Vec<f64>,
    /// Their bounds.
    bounds: Vec<f64>,
    /// The residuals of the functions as they are stored.
    residuals: Vec<f64>,
    /// Some exact eigenvalue lies within this of each.
    distances: Vec<f64>,
    /// How long it took.
    seconds: f64,
}

/// What was judged.
#[derive(ToSchema)]
#[allow(dead_code)]
struct ReceiptHashes {
    /// BLAKE3 of the content of the basis, 64 hexadecimal digits.
    basis: String,
    /// The id of the mesh; absent where there is a problem.
    mesh: String,
    /// The id of the problem, of a basis of the kind `pencil_basis`.
    problem: String,
}

/// A count made anew.
#[derive(ToSchema)]
#[schema(as = Recount)]
#[allow(dead_code)]
struct RecountSchema {
    /// The shift, in 1/length² of the mesh.
    shift: f64,
    /// Eigenvalues below it.
    below: u64,
    /// How many the certificate says there are; null where it did not count there.
    claimed: Option<u64>,
    /// How many eigenvalues of the basis lie below, with those before its first.
    values_below: u64,
}

problems!(VerifyBasisProblems: SOLVE [BODY_TOO_LARGE, INVALID_ANALYSIS]);

/// Judges a basis again
///
/// Nothing of a solver takes part: the operator or the elastic object is assembled anew, or the matrices of the problem
/// are read again, residuals and inner products are summed from the functions as they are stored, and where the basis
/// claims to be complete its eigenvalues are counted by another factorisation. The answer is a receipt, as
/// `chladni verify --receipt` writes it. Of vibration modes its eigenvalues, bounds, distances and shifts are squared
/// angular frequencies, in 1/time². Of bases of fields for design, families of operators and maps nothing is proven,
/// and there is nothing to be judged.
#[utoipa::path(
    post, path = "/v1/bases/{id}/verification", tag = "bases", operation_id = "verifyBasis",
    params(BasisId),
    responses(
        (status = 200, description = "The receipt", content((ReceiptSchema = "application/json")), headers(("Server-Timing" = String))),
        VerifyBasisProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn verify_basis(state: ClientState, BasisId(id): BasisId, headers: HeaderMap) -> Result<Answer, Problem> {
    extract::negotiated(&headers, &["application/json"])?;
    let record = state.store.basis(id).await?;
    let parameters = JobParameters::parse(&record.kind, &state.store.job_parameters(record.job).await?)?;
    match parameters {
        JobParameters::Eigenbasis(parameters) => verify_eigenbasis(state, record, parameters).await,
        JobParameters::VibrationBasis(parameters) => verify_vibration(state, record, parameters).await,
        JobParameters::PencilBasis(parameters) => verify_pencil(state, record, parameters).await,
        JobParameters::FieldBasis(_)
        | JobParameters::OperatorFamily(_)
        | JobParameters::MapCollection(_)
        | JobParameters::Idle(_) => {
            let kinds = [ProductKind::Eigenbasis, ProductKind::VibrationBasis, ProductKind::PencilBasis]
                .map(|kind| kind.name());
            let detail = format!(
                "Basis {id} is of the kind {}; those of the kinds {} are verified.",
                record.kind,
                kinds.join(", ")
            );
            Err(Problem::new(&problem::BASIS_KIND, detail).with("kind", record.kind).with("kinds", kinds.to_vec()))
        }
    }
}

async fn verify_eigenbasis(
    state: ClientState,
    record: BasisRecord,
    parameters: EigenbasisParameters,
) -> Result<Answer, Problem> {
    let faces = state.store.mesh(&record.mesh).await?.faces as usize;
    let bytes = judging_bytes(record.rows as usize, faces, record.count as usize, &parameters);
    let mut memory = state.memory();
    body::reserve(&mut memory, bytes)?;
    let basis = state.store.load_basis(record.id).await?;
    let (mesh, solid) = state.store.load_body(&record.mesh).await?;
    let hashes = json!({"basis": record.content_hash, "mesh": record.mesh});
    judged(state, memory, bytes, move |begin, monitor| {
        let outcome = judge(&basis, &mesh, solid.as_deref(), &parameters, monitor)?;
        Ok(receipt(&basis, &parameters, &outcome, (&hashes, HASH), begin.elapsed().as_secs_f64()))
    })
    .await
}

/// The same for the modes of a vibration.
async fn verify_vibration(
    state: ClientState,
    record: BasisRecord,
    parameters: VibrationBasisParameters,
) -> Result<Answer, Problem> {
    let (mesh, solid) = state.store.load_body(&record.mesh).await?;
    let bytes = parameters.judging_bytes(MeshSize::of_body(&mesh, solid.as_deref()), record.count as usize);
    let mut memory = state.memory();
    body::reserve(&mut memory, bytes)?;
    let modes = state.store.load_modes(record.id).await?;
    let hashes = json!({"basis": record.content_hash, "mesh": record.mesh});
    judged(state, memory, bytes, move |begin, monitor| {
        let outcome = judge_modes(&modes, &mesh, solid.as_deref(), &parameters, monitor)?;
        Ok(modes_receipt(&modes, &parameters, &outcome, (&hashes, HASH), begin.elapsed().as_secs_f64()))
    })
    .await
}

/// Judges in a solve of its own, with so many bytes: a factor that fills in more is not computed, and the count stays
/// unconfirmed.
async fn judged(
    state: ClientState,
    memory: Share,
    bytes: u64,
    judge: impl FnOnce(Instant, &dyn Monitor) -> Result<serde_json::Value, JudgeError> + Send + 'static,
) -> Result<Answer, Problem> {
    state
        .solve("verify", move |monitor| {
            let (begin, _memory) = (Instant::now(), memory);
            let receipt = judge(begin, &Promised { inner: monitor, bytes }).map_err(unjudged)?;
            Answer::json(&receipt, begin)
        })
        .await
}

fn unjudged(error: JudgeError) -> Problem {
    match error {
        JudgeError::Operator(JobError::Cancelled(cancelled))
        | JudgeError::Verify(VerifyError::Cancelled(cancelled)) => cancelled.into(),
        JudgeError::Verify(VerifyError::Functions(error)) => error.into(),
        JudgeError::Verify(VerifyError::Provenance(error)) | JudgeError::Provenance(error) => error.into(),
        other => Problem::new(&problem::INVALID_ANALYSIS, format!("This basis cannot be judged: {other}.")),
    }
}

/// The same for a basis of a problem.
async fn verify_pencil(
    state: ClientState,
    record: BasisRecord,
    parameters: PencilBasisParameters,
) -> Result<Answer, Problem> {
    let source = state.store.problem(&record.mesh).await?;
    let size = ProblemSize::of_report(source.rows as usize, &source.report);
    let bytes = size.judging_bytes(record.count as usize);
    let mut memory = state.memory();
    body::reserve(&mut memory, bytes)?;
    let basis = state.store.load_eigenvectors(record.id).await?;
    let matrices = state.store.load_problem(&source.id).await?;
    let hashes = json!({"basis": record.content_hash, "problem": source.id});
    judged(state, memory, bytes, move |begin, monitor| {
        let outcome = judge_pencil(&basis, &matrices, &parameters.fixed, monitor)?;
        let hash = (&hashes, "BLAKE3 of the content of the basis, the id of the problem");
        let (fixed, seconds) = (!parameters.fixed.is_empty(), begin.elapsed().as_secs_f64());
        Ok(pencil_receipt(&basis, &matrices, fixed, &outcome, hash, seconds))
    })
    .await
}
