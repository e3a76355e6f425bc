//! The shapes that a job on several bases names: which they are, and whether they can be mapped to each other.

use chladni_spectral::analysis::map_collection::{MOST_SHAPES, ShapeSize};
use chladni_spectral::basis::{MAP_COLLECTION, ProductKind};
use chladni_work::packed::Packed;
use chladni_work::{JobParameters, ParameterError, StoredShape};
use uuid::Uuid;

use super::bases::find_kind;
use super::client::ClientState;
use super::comparisons::{SpectrumOf, check_alike};
use super::ids::BasisId;
use super::jobs::{Planned, most_bytes};
use super::problem::{self, Problem};
use super::wire::JobRequest;
use crate::store::{BasisRecord, MeshRecord};

/// A refusal of what `bases` names.
fn refused(reason: impl Into<String>) -> Problem {
    ParameterError::Value { name: "bases", reason: reason.into() }.into()
}

/// Reads what a request for maps of a collection asks for, and checks it against the bases. Its parameters are taken out of it.
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
        return Err(refused(format!("there must be 2 to {MOST_SHAPES}, one for each shape, and not {}", given.len())));
    }
    let shapes = find(state, &given).await?;
    check_different(&shapes)?;
    let spectrum = |(basis, mesh): &(BasisRecord, MeshRecord)| (basis.id, SpectrumOf::of(basis, mesh));
    check_alike(&shapes.iter().map(spectrum).collect::<Vec<_>>())?;
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

/// The bases, each with its mesh.
async fn find(state: &ClientState, ids: &[String]) -> Result<Vec<(BasisRecord, MeshRecord)>, Problem> {
    let mut shapes = Vec::with_capacity(ids.len());
    for (place, id) in ids.iter().enumerate() {
        let basis = find_kind(state, BasisId::parse(id)?.0, ProductKind::Eigenbasis).await?;
        let id = basis.id;
        if basis.operator.get("hodge").is_some() {
            return Err(super::bases::of_fields(id));
        }
        if basis.operator["laplacian"] == "volume" {
            let reason = format!("bases[{place}], {id}, is of the inside of a solid; collections are of surfaces");
            return Err(refused(reason));
        }
        if let Some(first) = basis.certificate["first"].as_u64().filter(|&first| first > 0) {
            let reason = format!(
                "bases[{place}], {id}, holds the pairs of an interval, from number {first} on; shapes are mapped by their lowest ones"
            );
            return Err(refused(reason));
        }
        let mesh = state.store.mesh(&basis.mesh).await?;
        shapes.push((basis, mesh));
    }
    Ok(shapes)
}

/// A shape is mapped to others, and not to itself.
fn check_different(shapes: &[(BasisRecord, MeshRecord)]) -> Result<(), Problem> {
    for (place, (basis, mesh)) in shapes.iter().enumerate() {
        let before = shapes[..place].iter().position(|(_, other)| other.id == mesh.id);
        let Some(before) = before else { continue };
        let same: Uuid = shapes[before].0.id;
        return Err(refused(match same == basis.id {
            true => format!("bases[{place}] is bases[{before}] once more, {same}"),
            false => format!("bases[{place}], {}, is of the mesh of bases[{before}], {}", basis.id, mesh.id),
        }));
    }
    Ok(())
}
