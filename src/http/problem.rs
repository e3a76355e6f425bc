//! Problems: every error of the API as `application/problem+json` (RFC 9457). The one file where errors of other rooms
//! become answers.

use std::borrow::Cow;

use axum::http::{HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use problem_details::ProblemDetails;
use serde_json::{Map, Value};

/// The media type of every error.
pub const MEDIA_TYPE: &str = "application/problem+json";

/// The longest text that is echoed back to a client, in characters.
const LONGEST_DETAIL: usize = 500;

/// A kind of problem: the end of its `type` URI, its status and its title. Kinds are part of the API and do not change.
#[derive(Debug, PartialEq, Eq)]
pub struct Kind {
    /// The end of the `type` URI `/problems/{id}`.
    pub id: &'static str,
    /// The HTTP status.
    pub status: u16,
    /// A short summary, the same for every occurrence.
    pub title: &'static str,
    /// What it means and what to do, for the page that documents it.
    pub meaning: &'static str,
}

macro_rules! kinds {
    ($($name:ident = $id:literal, $status:literal, $title:literal, $meaning:literal;)*) => {
        $(#[doc = $title] pub static $name: Kind = Kind { id: $id, status: $status, title: $title, meaning: $meaning };)*
        /// Every kind of problem, in the order of the documentation.
        pub static KINDS: &[&Kind] = &[$(&$name),*];
    };
}

kinds! {
    NOT_FOUND = "not-found", 404, "There is nothing here",
        "No route has this path. The document at /openapi.json lists them all.";
    METHOD_NOT_ALLOWED = "method-not-allowed", 405, "The method is not allowed here",
        "The route exists, but not with this method. The header Allow lists those it has.";
    UNKNOWN_MESH = "unknown-mesh", 404, "There is no such mesh",
        "No mesh has this id. It may have been deleted.";
    UNKNOWN_PROBLEM = "unknown-problem", 404, "There is no such problem",
        "No problem, a pencil of matrices, has this id. It may have been deleted.";
    UNKNOWN_SAMPLE = "unknown-sample", 404, "There is no such sample",
        "No generated mesh has this name. /v1/samples lists them.";
    UNKNOWN_JOB = "unknown-job", 404, "There is no such job",
        "No job has this id.";
    UNKNOWN_BASIS = "unknown-basis", 404, "There is no such basis",
        "No basis has this id. It may have been deleted.";
    UNKNOWN_FIELD = "unknown-field", 404, "There is no such field",
        "No stored field has this id. It may have been deleted, or gone with its mesh or its basis.";
    NOT_ACCEPTABLE = "not-acceptable", 406, "No such representation",
        "The resource is not available in any of the media types that Accept names. The detail lists those that are.";
    UNSUPPORTED_MEDIA_TYPE = "unsupported-media-type", 415, "The media type is not supported here",
        "Content-Type names something this route does not read. The detail lists what it reads.";
    UNSUPPORTED_ENCODING = "unsupported-content-encoding", 415, "The content encoding is not supported",
        "Content-Encoding may be gzip, zstd or identity.";
    DAMAGED_ENCODING = "damaged-content-encoding", 400, "The compressed body is damaged",
        "The body cannot be decompressed as Content-Encoding says.";
    BODY_TOO_LARGE = "body-too-large", 413, "The body is too large",
        "The body, or what it decompresses to, is larger than the server accepts. The member `limit` has the bytes.";
    BODY_INCOMPLETE = "body-incomplete", 400, "The body ended early",
        "The connection ended before the announced body was there.";
    BODY_TOO_SLOW = "body-too-slow", 408, "The body came too slowly",
        "The client sent nothing for too long, or less than the least rate.";
    INVALID_JSON = "invalid-json", 400, "The body is not JSON",
        "The body does not parse. The detail says where.";
    INVALID_REQUEST = "invalid-request", 422, "The request is invalid",
        "The body parses, but a member is missing, unknown or of the wrong type. The detail names it.";
    INVALID_QUERY = "invalid-query", 400, "The query is invalid",
        "A query parameter is unknown, missing or malformed. The detail names it.";
    INVALID_HEADER = "invalid-header", 400, "A header is invalid",
        "A request header is malformed. The detail names it.";
    INVALID_CURSOR = "invalid-cursor", 400, "The cursor is invalid",
        "`from` must be the `next` of an earlier page of the same list.";
    INVALID_MULTIPART = "invalid-multipart", 400, "The multipart body is invalid",
        "The multipart body is malformed, or lacks the part that it must have. The detail says what is wrong.";
    INVALID_FUNCTION = "invalid-function", 422, "The function does not fit the mesh",
        "A function needs one finite value per vertex and column. The detail names the offending value or count.";
    INVALID_TRANSFER = "invalid-transfer-function", 422, "The transfer function is invalid",
        "A transfer function is of a known kind or a list of one finite value per eigenvalue.";
    INVALID_VERTEX = "invalid-vertex", 422, "There is no such vertex",
        "A source, landmark or other vertex is not one of the mesh, or none is given. The detail names it.";
    INVALID_ANALYSIS = "invalid-analysis", 422, "This cannot be computed in the basis",
        "A time, a count or another number of the request is out of its range, or the basis has no spectrum for it. The detail names it.";
    INVALID_STREAM = "invalid-compressed-functions", 422, "The bytes are not compressed functions of such a basis",
        "The body must be what `compress` gave for the same basis; the bytes themselves do not say which basis that was. The member `at` has the byte where it was noticed.";
    INVALID_RANGE_OF_MODES = "invalid-mode-range", 422, "There are no such modes",
        "`from` must be less than `to`, and `to` at most the number of eigenfunctions of the basis.";
    INVALID_DESIGN = "invalid-design", 422, "The field cannot be designed",
        "The type goes on with what is wrong, as in invalid-design/face. The detail names the stroke, the constraint or the face.\n\n`face` (it is not there, or none is named), `direction` (zero, or perpendicular to its face), `value` (a stroke has no value, or one of another kind of field), `points` (a line without length), `contradiction` (hard constraints require different values on one face), `dependent` (the space cannot meet them all), `weight`, `no-energy` (nothing says what the field is between constraints), `no-data` (there is neither a constraint nor an alignment), `alignment`, `singularities` (they are not inside the surface, or their indices do not add up to the Euler characteristic), `constraints` (too many), `dimension` (the space is too large to design in), `fur`, `hatching`, `camera`, `light` (of a picture), `coefficients`, `eigenfield`, `refine` (a tolerance that is out of range, a design that stands for no field of least energy, or one that takes longer than a request may), `error`, `reach` (no heat arrives at a face), `sources` (their vectors cancel each other), `faces` (of the answer), `encoding` (a number is beyond f16, or is part of no direction), `field` (one that is to be decomposed or integrated), `basis` (of a field to be integrated), `stored` (a stored field is of another mesh, or of a kind that does not fit), `request` (one that is too long to be kept), `quads` (a parameter of a parametrisation, or one that takes too long), `creases`, `numbering` (corners of faces that the file has others of), `memory` (a factor of the mesh would need more than those of surfaces do).";
    NO_FIELD_SURFACE = "no-field-surface", 422, "The mesh cannot carry fields",
        "Tangential fields need a manifold, and some uses of them an oriented one. The detail names the edge, the vertex or the faces where the mesh is not. Triangles of almost no area are refused as well, since equations on them are singular.";
    INVALID_SPECTRUM = "invalid-spectrum", 422, "There is no such spectrum",
        "The type goes on with the parameter that does not fit: extrinsic, curvature or count. The detail says what it may be.";
    INVALID_SIMULATION = "invalid-simulation", 422, "This cannot be simulated",
        "The type goes on with what does not fit: vertex-out-of-range, loads, damping, times or sound. The detail names the element.";
    INVALID_PARAMETER = "invalid-parameter", 422, "A parameter of the job is invalid",
        "The detail names the parameter, its value and the values it may have.";
    JOB_TOO_LARGE = "job-too-large", 422, "The job needs too much memory",
        "The estimate of the memory that the job needs is above what the server admits. The members `estimate` and `limit` have the bytes.";
    QUEUE_FULL = "queue-full", 429, "The queue is full",
        "Too many jobs wait. Retry-After says when to try again.";
    IDEMPOTENCY_CONFLICT = "idempotency-conflict", 409, "The idempotency key was used for another request",
        "An Idempotency-Key stands for one request. Use a fresh key for another body.";
    MESH_IN_USE = "mesh-in-use", 409, "The mesh is in use",
        "Unfinished jobs, on it or on its bases, stored bases or stored fields refer to the mesh. Delete them first, or pass cascade=true. The member `job` names the first of the jobs.";
    PROBLEM_IN_USE = "problem-in-use", 409, "The problem is in use",
        "Unfinished jobs or stored bases refer to the matrices. Delete them first, or pass cascade=true.";
    BASIS_IN_USE = "basis-in-use", 409, "The basis is in use",
        "A job works on the basis that waits or runs. The member `job` names it: cancel it first, or wait for its end.";
    BASIS_WITHOUT_MESH = "basis-without-mesh", 409, "The basis has no mesh",
        "The basis is of a problem, matrices that came without a mesh, and the route computes with a mesh or with functions on one. Its vectors can be downloaded and verified. The member `kinds` has what the route serves.";
    BASIS_KIND = "basis-kind", 409, "The basis is of another kind",
        "The route serves bases of another kind. The member `kind` has the kind of this one, `kinds` those that the route serves.";
    INCOMPARABLE_BASES = "incomparable-bases", 409, "The bases cannot be compared",
        "Their spectra are those of different operators, or of different conditions at a boundary. The member `bases` has two of them, `spectra` what each is of. `mixed: true` compares them all the same.";
    STATE_CONFLICT = "state-conflict", 409, "The resource is not in a state for this",
        "A job that has ended cannot be canceled, one that has succeeded cannot be retried, and one that waits or runs, or whose basis is stored, cannot be deleted. The member `job_status` has its status.";
    JOB_FAILED = "job", 500, "The job failed",
        "Never the answer to a request: the `problem` of a failed job. The type goes on with why.\n\nOf the work itself, which another attempt would not help: `not-converged` (some pairs did not reach the tolerance: ask for less, or for another variant), `incomplete` (inertia counts prove that pairs are missing, and they could not be found: nothing is stored as if it were complete), `unproven` (pairs were found, but no count or bound could be trusted to prove them), `tolerance-below-rounding` (the message says which tolerance double precision allows on this mesh), `invalid-parameters` (they do not fit the mesh), `no-field-surface` (fields need a manifold, and those of the Hodge–Laplacian an oriented one), `harmonic-fields-failed`, `operator-failed`, `subspace-failed`, `restriction-failed`, `eigenproblem-failed`, `certificate-failed`, `job-too-large` (it, or one of its parts, needs more memory than any worker has by now), `memory-exceeded` (it needs more memory than it was promised: the mesh is connected as no surface is, or one vertex has very many triangles), `maps-failed` (the shapes of a collection tell too little to be mapped to each other).\n\nOf the service: `worker-lost`, `worker-panicked`, `worker-stalled` after the last attempt; `quarantined` (the process of the job, or the server, crashed twice while the job ran: it is not tried again by itself); `mesh-unavailable`, `basis-unavailable`, `parts-unavailable`, `part-missing` (what the job is on could not be read), `part-lost` (of a job in parts: one was given up without a reason; any other reason of a part is that of its job, with the number of the part before it), `storage-full`, `storage-unavailable`, `storage-refused` (the keys or rights of the worker do not let it store a result).\n\nOf matrices: `invalid-pencil` (the mass is not positive definite, which was left to the job to find out).";
    RANGE_NOT_SATISFIABLE = "range-not-satisfiable", 416, "The range cannot be satisfied",
        "The range begins beyond the end. The header Content-Range has the length.";
    PRECONDITION_FAILED = "precondition-failed", 412, "The resource is in another state",
        "`If-Match` names another state than the present one, so nothing was changed: somebody renamed the resource, or it went on. Get it again, and send its `ETag`.";
    UNAUTHENTICATED = "unauthenticated", 401, "An API key is needed",
        "Send `Authorization: Bearer KEY` with one of the server's keys.";
    FORBIDDEN = "scope-missing", 403, "The API key lacks a scope",
        "The member `scope` names the one that is needed: read, submit or operate.";
    HOST_NOT_KNOWN = "host-not-known", 421, "The server does not have this name",
        "The request names a host that is not this server. A server on loopback without keys answers only to localhost, to addresses and to the names of --hosts.";
    ORIGIN_NOT_ALLOWED = "origin-not-allowed", 403, "The origin is not allowed",
        "A browser sent this from a page of another origin that the server was not told to trust.";
    DAMAGED_CONTENT = "damaged-content", 500, "The stored content is damaged",
        "The stored bytes are missing or not what was stored, and are not served. Upload the same mesh again, or submit the same job again: the content is written anew under the same ids. `chladni doctor` lists all damage.";
    STORAGE_FULL = "storage-full", 507, "The storage is full",
        "Nothing was stored. Reading goes on; writing works again once there is room.";
    STORAGE_REPLACED = "storage-replaced", 503, "The storage was removed or replaced",
        "A database of the data folder was removed or replaced while the server ran. Nothing is stored any more. The server has to be stopped, the databases put back, and the server started.";
    STORAGE_BUSY = "storage-busy", 503, "The storage is busy",
        "The database was locked for too long. Nothing was stored; try again.";
    STORAGE_UNAVAILABLE = "storage-unavailable", 503, "The storage does not answer",
        "The database or the object store does not answer, or is being restarted. Nothing was changed; try again.";
    BUSY = "busy", 503, "The server is busy",
        "Too many requests of this kind are running or waiting, of this client or of all. Retry-After says when to try again.";
    DRAINING = "draining", 503, "The server is shutting down",
        "It finishes what runs and accepts nothing new.";
    NOT_READY = "not-ready", 503, "The server is not ready",
        "The member `reasons` says why: storage-full, storage-replaced, storage-unavailable, workers-dead or draining.";
    INTERNAL = "internal-error", 500, "Something went wrong in the server",
        "The fault is logged under the request id that the header X-Request-Id has.";
    UNREADABLE_MESH = "unreadable-mesh", 422, "The mesh cannot be read",
        "The type goes on with what is wrong, as in unreadable-mesh/index-out-of-range. The detail names the line or the element.";
    UNUSABLE_MESH = "unusable-mesh", 422, "The mesh cannot be used",
        "The type goes on with what is wrong, as in unusable-mesh/no-faces. The detail names the element.";
    UNREADABLE_MATRIX = "unreadable-matrix", 422, "A matrix cannot be read",
        "The type goes on with what is wrong: unreadable-matrix/unknown-format (neither an NPZ of scipy.sparse.save_npz, nor NPY, nor Matrix Market), /archive, /line, /entries, /too-large or /problem. The detail names the member, the line or the row; the member `matrix` is S or M.";
    INVALID_PENCIL = "invalid-pencil", 422, "The matrices do not form a pencil",
        "The type goes on with what is wrong: invalid-pencil/not-square, /not-finite, /not-symmetric, /not-definite (the mass), /empty or /structure. The members `matrix`, `row` and `column`, counted from 0, have the first place where it shows.";
    UNKNOWN_FORMAT = "unknown-mesh-format", 415, "The format of the mesh is unknown",
        "Name the format by Content-Type or ?format=: obj, ply, off, stl, medit, vtk, gmsh, freesurfer, gltf or gifti.";
}

/// An error on its way to a client.
#[derive(Debug, Clone)]
pub struct Problem {
    kind: &'static Kind,
    within: Option<Cow<'static, str>>,
    detail: String,
    members: Map<String, Value>,
    headers: Vec<(HeaderName, HeaderValue)>,
}

impl Problem {
    /// A problem of a kind; `detail` is one sentence that names the offending element and shows no internals.
    pub fn new(kind: &'static Kind, detail: impl Into<String>) -> Self {
        Self { kind, within: None, detail: shorten(detail.into()), members: Map::new(), headers: Vec::new() }
    }

    /// A kind within a family of kinds: `unreadable-mesh/index-out-of-range`.
    pub fn within(kind: &'static Kind, within: impl Into<Cow<'static, str>>, detail: impl Into<String>) -> Self {
        Self { within: Some(within.into()), ..Self::new(kind, detail) }
    }

    /// A fault of the server: logged with its cause, told without it.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        tracing::error!(cause = %cause, "internal error");
        Self::new(&INTERNAL, "The server could not do this. The request id finds the cause in its log.")
    }

    /// Adds an extension member.
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.members.insert(name.to_owned(), value.into());
        self
    }

    /// Adds a response header.
    pub fn header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.headers.push((name, value));
        self
    }

    /// Adds `Retry-After`, in seconds.
    pub fn retry_after(self, seconds: u64) -> Self {
        self.header(header::RETRY_AFTER, HeaderValue::from(seconds))
    }

    /// The kind.
    pub fn kind(&self) -> &'static Kind {
        self.kind
    }

    /// The sentence.
    pub fn detail(&self) -> &str {
        &self.detail
    }

    /// The `type` URI: a path on this server, where the kind is documented.
    pub fn type_uri(&self) -> String {
        match &self.within {
            Some(within) => format!("/problems/{}/{within}", self.kind.id),
            None => format!("/problems/{}", self.kind.id),
        }
    }
}

/// What a response carries beside its bytes, so that the request log can name the problem.
#[derive(Debug, Clone)]
pub struct ProblemNote {
    /// The `type` URI.
    pub kind: String,
    /// The sentence.
    pub detail: String,
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.kind.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let uri = self.type_uri();
        let mut details = ProblemDetails::new()
            .with_status(status)
            .with_title(self.kind.title)
            .with_detail(self.detail.clone())
            .with_extensions(self.members);
        if let Ok(uri) = uri.parse::<Uri>() {
            details = details.with_type(uri);
        }
        // A map of JSON values always serialises.
        let body = serde_json::to_vec(&details).unwrap_or_default();
        let mut response = (status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        for (name, value) in self.headers {
            headers.insert(name, value);
        }
        response.extensions_mut().insert(ProblemNote { kind: uri, detail: self.detail });
        response
    }
}

/// Cuts a text that is too long to echo.
pub fn shorten(text: String) -> String {
    match text.char_indices().nth(LONGEST_DETAIL) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_unique_ids_and_error_statuses() {
        let mut ids: Vec<_> = KINDS.iter().map(|k| k.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), KINDS.len());
        assert!(KINDS.iter().all(|k| (400..600).contains(&k.status)));
    }

    #[tokio::test]
    async fn problem_becomes_rfc_9457_json() {
        let problem = Problem::within(&UNREADABLE_MESH, "index-out-of-range", "face 17 refers to vertex 99 of 40")
            .with("limit", 40)
            .retry_after(3);
        let response = problem.into_response();
        assert_eq!(response.status(), 422);
        assert_eq!(response.headers()["content-type"], MEDIA_TYPE);
        assert_eq!(response.headers()["retry-after"], "3");
        let body = axum::body::to_bytes(response.into_body(), 10_000).await.unwrap();
        let value: Value = serde_json::from_slice(&body).unwrap();
        assert_eq!(value["type"], "/problems/unreadable-mesh/index-out-of-range");
        assert_eq!(value["status"], 422);
        assert_eq!(value["title"], "The mesh cannot be read");
        assert_eq!(value["detail"], "face 17 refers to vertex 99 of 40");
        assert_eq!(value["limit"], 40);
    }

    #[test]
    fn long_details_are_cut_at_a_character() {
        let cut = shorten("é".repeat(2000));
        assert_eq!(cut.chars().count(), LONGEST_DETAIL + 1);
    }
}
