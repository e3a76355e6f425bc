//! The shapes that a job or a request on several bases names: which they are, and whether they can be mapped to each
//! other.

use chladni_spectral::analysis::map_collection::{MOST_SHAPES, ShapeSize};
use chladni_spectral::basis::{MAP_COLLECTION, ProductKind};
use chladni_spectral::operator::Laplacian;
use chladni_work::mappable::{StoredSpectrum, Unmappable, check_collection};
use chladni_work::packed::Packed;
use chladni_work::{JobParameters, ParameterError, StoredShape};
use serde::Deserialize;
use uuid::Uuid;

use super::bases::find_kind;
use super::client::ClientState;
use super::comparisons::spectrum_of;
use super::ids::BasisId;
use super::jobs::{Planned, most_bytes};
use super::problem::{self, Problem};
use super::wire::JobRequest;
use crate::store::{BasisRecord, MeshRecord};

/// A refusal of what `bases` names.
fn refused(reason: impl Into<String>) -> Problem {
    ParameterError::Value { name: "bases", reason: reason.into() }.into()
}

/// Reads what a request for maps of a collection asks for, and checks it against the bases. Its parameters are taken
/// out of it.
pub(super) async fn plan(state: &ClientState, request: &mut JobRequest) -> Result<Planned, Problem> {
    let JobParameters::MapCollection(parameters) = JobParameters::read(&request.kind, &request.parameters)? else {
        return Err(Problem::internal("parameters of another kind were read"));
    };
    request.parameters = Packed::Null;
    for (name, given) in [("mesh", &request.mesh), ("pencil", &request.pencil)] {
        if given.is_some() {
            let detail =
                format!("{name}: a job of the kind \"{MAP_COLLECTION}\" works on stored bases, named by `bases`.");
            return Err(Problem::new(&problem::INVALID_REQUEST, detail));
        }
    }
    let Some(given) = request.bases.take() else {
        return Err(Problem::new(&problem::INVALID_REQUEST, "bases: the ids of the bases are missing."));
    };
    if !(2..=MOST_SHAPES).contains(&given.len()) {
        return Err(refused(format!("there must be 2 to {MOST_SHAPES}, one for each shape, not {}", given.len())));
    }
    let shapes = find(state, &given).await?;
    let stored = |(basis, mesh): &(BasisRecord, MeshRecord)| StoredShape {
        size: ShapeSize { vertices: basis.vertices as usize, faces: mesh.faces as usize, pairs: basis.count as usize },
        basis_bytes: basis.bytes,
    };
    let stored: Vec<StoredShape> = shapes.iter().map(stored).collect();
    let sizes: Vec<ShapeSize> = stored.iter().map(|shape| shape.size).collect();
    let parameters = parameters.fitted(&sizes)?;
    let Some((_, first)) = shapes.first() else { return Err(Problem::internal("a collection without shapes")) };
    let estimate = parameters.shapes_memory_bytes(&stored, most_threads(state).await?);
    Ok(Planned {
        source: first.id.clone(),
        bases: shapes.iter().map(|(basis, _)| basis.id).collect(),
        estimate,
        limit: most_bytes(state, &request.kind, estimate).await?,
        seconds: Some(parameters.shapes_seconds(&sizes)),
        parameters: JobParameters::MapCollection(parameters),
    })
}

/// The most threads that a job may get, of whichever worker takes it.
async fn most_threads(state: &ClientState) -> Result<usize, Problem> {
    let workers = state.store.workers().await?;
    let shares = workers.iter().map(|worker| worker.threads.div_ceil(worker.seats.max(1)) as usize);
    let own = state.config.job_threads().div_ceil(state.config.workers.max(1));
    Ok(shares.max().unwrap_or(own))
}

/// The bases, each with its mesh, if they can be mapped to each other.
///
/// # Errors
/// Those of finding them; [`Unmappable`].
pub(super) async fn find(state: &ClientState, ids: &[String]) -> Result<Vec<(BasisRecord, MeshRecord)>, Problem> {
    let (mut shapes, mut stored) = (Vec::with_capacity(ids.len()), Vec::with_capacity(ids.len()));
    for id in ids {
        let shape = find_one(state, BasisId::parse(id)?.0).await?;
        stored.push(stored_spectrum(&shape)?);
        shapes.push(shape);
    }
    check_collection(&stored)?;
    Ok(shapes)
}

/// A basis of functions on vertices, with its mesh.
pub(super) async fn find_one(state: &ClientState, id: Uuid) -> Result<(BasisRecord, MeshRecord), Problem> {
    let basis = find_kind(state, id, ProductKind::Eigenbasis).await?;
    if basis.operator.get("hodge").is_some() {
        return Err(super::bases::of_fields(id));
    }
    let mesh = state.store.mesh(&basis.mesh).await?;
    Ok((basis, mesh))
}

fn stored_spectrum((basis, mesh): &(BasisRecord, MeshRecord)) -> Result<StoredSpectrum, Problem> {
    let laplacian = Laplacian::deserialize(&basis.operator["laplacian"]).map_err(Problem::internal)?;
    Ok(StoredSpectrum {
        basis: basis.id.to_string(),
        mesh: mesh.id.clone(),
        of: spectrum_of(basis, mesh),
        is_of_solid: laplacian == Laplacian::Volume,
        // Not written where it is zero.
        first: basis.certificate["first"].as_u64().unwrap_or(0),
    })
}

impl From<Unmappable> for Problem {
    fn from(error: Unmappable) -> Self {
        match error {
            Unmappable::Unlike(unlike) => unlike.into(),
            other => refused(other.to_string()),
        }
    }
}
