//! Uploaded matrices: taken out of the body, read, and checked, within the memory of the client.

use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::request::Parts;
use bytes::Bytes;
use chladni_base::Unwatched;
use chladni_spectral::formats::matrix::{MatrixError, MatrixFile, MatrixLimits};
use chladni_spectral::formats::npz;
use chladni_spectral::spectrum::hsim::HsimError;
use chladni_spectral::spectrum::pencil::{Mass, Matrices, PencilError};
use chladni_work::verification::Promised;
use serde_json::json;

use super::body;
use super::convert::sentence;
use super::extract;
use super::problem::{self, Problem};
use super::shares::Share;
use super::upload::LONGEST_NAME;
use crate::config::Limits;
use crate::store::{self, NewProblem, StoreError};
use std::sync::Arc;

/// The bytes of a factor that proves a mass definite while its upload waits; larger ones are left to jobs.
const PROOF_BYTES: u64 = 256 << 20;

/// Matrices of more entries are not analysed while their upload waits: what a job on them takes is told from their size
/// alone.
const ANALYSED_ENTRIES: usize = 40_000_000;

/// Bytes of memory for each byte of matrices as they are kept: they are copied, mirrored and ordered on the way.
const COPIES: u64 = 5;

/// Bytes of memory for each row beside its entries: offsets, orders, and what the symbolic factor knows of it.
const ROW_BYTES: u64 = 100;

/// Rows and entries of a matrix take this many bytes each at least, unfolded: whatever tells of more has next to
/// nothing in it.
const LEAST_BYTES: u64 = 4;

/// What was sent.
#[derive(Debug, Default)]
pub struct SentMatrices {
    /// S.
    pub stiffness: Bytes,
    /// M, where it is not the identity.
    pub mass: Option<Bytes>,
    /// A name for people.
    pub name: Option<String>,
}

impl SentMatrices {
    /// Takes the matrices out of a body.
    ///
    /// # Errors
    /// `invalid-multipart`.
    pub async fn of(parts: Parts, bytes: Bytes) -> Result<Self, Problem> {
        if extract::media_type(&parts.headers).as_deref() != Some("multipart/form-data") {
            return Ok(Self { stiffness: bytes, ..Self::default() });
        }
        let malformed = |what: String| Problem::new(&problem::INVALID_MULTIPART, what);
        // The body is in memory already, so that this only cuts it up.
        let request = Request::from_parts(parts, Body::from(bytes));
        let mut multipart =
            Multipart::from_request(request, &()).await.map_err(|error| malformed(error.body_text()))?;
        let (mut stiffness, mut mass, mut name) = (None, None, None);
        while let Some(field) = multipart.next_field().await.map_err(|error| malformed(error.body_text()))? {
            let part = field.name().unwrap_or_default().to_owned();
            let bytes = field.bytes().await.map_err(|error| malformed(error.body_text()))?;
            let twice = match part.as_str() {
                "stiffness" => stiffness.replace(bytes).is_some(),
                "mass" => mass.replace(bytes).is_some(),
                "name" => match std::str::from_utf8(&bytes) {
                    Ok(text) if text.len() <= 4 * LONGEST_NAME => name.replace(text.trim().to_owned()).is_some(),
                    _ => return Err(malformed("The part \"name\" is not a short text.".to_owned())),
                },
                other => {
                    let other = problem::shorten(other.to_owned());
                    let detail = format!("The part {other:?} is unknown; the parts are stiffness, mass and name.");
                    return Err(malformed(detail));
                }
            };
            if twice {
                return Err(malformed(format!("The part {part:?} appears twice.")));
            }
        }
        let stiffness = stiffness.ok_or_else(|| malformed("There is no part named stiffness.".to_owned()))?;
        Ok(Self { stiffness, mass, name })
    }
}

/// Reads and checks matrices.
///
/// # Errors
/// `unreadable-matrix`, `invalid-pencil`; `body-too-large` and `busy` where the client has not the memory for it.
pub fn read(
    sent: SentMatrices,
    name: Option<String>,
    limits: &Limits,
    mut memory: Share,
) -> Result<NewProblem, Problem> {
    let SentMatrices { stiffness, mass, .. } = sent;
    let source_bytes = (stiffness.len() + mass.as_ref().map_or(0, Bytes::len)) as u64;
    let unfolded = MatrixFile::memory_bytes(&stiffness) + mass.as_deref().map_or(0, MatrixFile::memory_bytes);
    let copies = unfolded.saturating_mul(COPIES);
    body::reserve(&mut memory, copies)?;
    // Whatever unfolds to more than a body may be is too much.
    let entries = usize::try_from(limits.max_body_bytes / 8).unwrap_or(usize::MAX);
    let most = MatrixLimits { rows: limits.max_vertices, entries };
    let matrices = matrices(stiffness, mass, &most, |rows| {
        body::reserve(&mut memory, copies.saturating_add(ROW_BYTES * rows as u64))
    })?;
    let (rows, entries) = (matrices.rows(), matrices.stiffness().entries() + matrices.mass_entries());
    let kind = match matrices.mass() {
        Mass::Identity => "identity",
        Mass::Diagonal(_) => "diagonal",
        Mass::Sparse(_) => "sparse",
    };
    let analysed = entries <= ANALYSED_ENTRIES;
    let factor = analysed.then(|| matrices.factor_entries(&Unwatched)).transpose().map_err(refused)?;
    let proven = kind != "sparse" || analysed && prove(&matrices, limits, &mut memory)?;
    let report = json!({
        "rows": rows,
        "entries": matrices.stiffness().entries(),
        "mass": kind,
        "mass_entries": matrices.mass_entries(),
        "mass_proven": proven,
        "factor_entries": factor,
    });
    Ok(NewProblem { matrices: Arc::new(matrices), report, name, source_bytes })
}

/// Whether the mass was proven definite within what memory there is for it.
fn prove(matrices: &Matrices, limits: &Limits, memory: &mut Share) -> Result<bool, Problem> {
    let bytes = PROOF_BYTES.min(limits.max_body_bytes);
    if body::reserve(memory, bytes.saturating_add(COPIES * matrices.bytes())).is_err() {
        return Ok(false);
    }
    match matrices.prove(&Promised { inner: &Unwatched, bytes }) {
        Ok(()) => Ok(true),
        Err(PencilError::Solve(HsimError::Memory(_))) => Ok(false),
        Err(error) => Err(refused(error)),
    }
}

/// `make_room` is told the rows once they are known.
fn matrices(
    stiffness: Bytes,
    mass: Option<Bytes>,
    limits: &MatrixLimits,
    make_room: impl FnOnce(usize) -> Result<(), Problem>,
) -> Result<Matrices, Problem> {
    let within = |bytes: &Bytes| {
        let most = usize::try_from(MatrixFile::memory_bytes(bytes) / LEAST_BYTES + 16).unwrap_or(usize::MAX);
        MatrixLimits { rows: limits.rows.min(most), entries: limits.entries.min(most) }
    };
    let read =
        |what: &str, bytes: &Bytes| MatrixFile::read(bytes, &within(bytes)).map_err(|error| unreadable(what, &error));
    if mass.is_none() && MatrixFile::has_member(&stiffness, &["mass", "mass_data"]) {
        // What this server gave, with its mass beside S.
        let (stiffness, diagonal, mass) = npz::read_problem(&stiffness, within(&stiffness).rows).map_err(|error| {
            Problem::within(&problem::UNREADABLE_MATRIX, "problem", format!("The body: {}", sentence(&error)))
        })?;
        make_room(stiffness.rows())?;
        return Matrices::of_parts(stiffness, diagonal, mass).map_err(refused);
    }
    let whole = read("stiffness", &stiffness)?.into_matrix();
    drop(stiffness);
    make_room(whole.rows())?;
    let weights = match mass {
        None => Mass::Identity,
        Some(bytes) => match read("mass", &bytes)? {
            MatrixFile::Sparse(matrix) => Mass::Sparse(matrix),
            MatrixFile::Vector(diagonal) => Mass::Diagonal(diagonal),
        },
    };
    Matrices::new(whole, weights).map_err(refused)
}

fn unreadable(what: &str, error: &MatrixError) -> Problem {
    let within = match error {
        MatrixError::Unknown => "unknown-format",
        MatrixError::TooLarge { .. } => "too-large",
        MatrixError::Entries(_) => "entries",
        MatrixError::Archive(_) | MatrixError::Member { .. } => "archive",
        MatrixError::Line { .. } => "line",
    };
    Problem::within(&problem::UNREADABLE_MATRIX, within, format!("{what}: {}", sentence(error)))
        .with("matrix", if what == "mass" { "M" } else { "S" })
}

/// Matrices that are no pencil; the row and the column that show it are members.
fn refused(error: PencilError) -> Problem {
    let text = sentence(&error);
    let (within, matrix, row, column) = match &error {
        PencilError::Cancelled(cancelled) => return (*cancelled).into(),
        PencilError::Structure(_) => ("structure", None, None, None),
        PencilError::Shape { matrix, .. } => ("not-square", Some(*matrix), None, None),
        PencilError::NotFinite { matrix, row, column, .. } => ("not-finite", Some(*matrix), Some(*row), Some(*column)),
        PencilError::NotSymmetric { matrix, row, column, .. } => {
            ("not-symmetric", Some(*matrix), Some(*row), Some(*column))
        }
        PencilError::NotPositive { row, .. } | PencilError::NotDefinite { row } => {
            ("not-definite", Some("M"), Some(*row), None)
        }
        PencilError::NearlySingular => ("not-definite", Some("M"), None, None),
        PencilError::TooSmall { matrix, .. } => ("too-small", Some(*matrix), None, None),
        PencilError::Empty => ("empty", None, None, None),
        PencilError::Fixed { .. } => ("fixed", None, None, None),
        PencilError::Solve(_) => return Problem::internal(error),
    };
    let mut found = Problem::within(&problem::INVALID_PENCIL, within, text);
    if let Some(matrix) = matrix {
        found = found.with("matrix", matrix);
    }
    for (name, place) in [("row", row), ("column", column)] {
        if let Some(place) = place {
            found = found.with(name, place);
        }
    }
    found
}

/// A problem that cannot be deleted.
pub fn in_use(error: StoreError) -> Problem {
    match error {
        StoreError::MeshInUse { mesh, unfinished_jobs, job, bases, .. } => Problem::new(
            &problem::PROBLEM_IN_USE,
            format!("Problem {mesh} is in use by {}.", store::uses(unfinished_jobs, job, bases, 0)),
        )
        .with("unfinished_jobs", unfinished_jobs)
        .with("bases", bases),
        other => other.into(),
    }
}
