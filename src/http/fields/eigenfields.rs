//! `GET /bases/{id}/eigenfields`: approximate eigenfields on the faces.

use std::sync::Arc;
use std::time::Instant;

use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_spectral::field::{FullSpace, LowestFields};
use chladni_spectral::formats::npz;
use chladni_work::design::{Eigenfield, EigenfieldFault, Eigenfields, Form, MOST_REFINED, written as written_as};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::octets;
use super::patience::{self, Patience};
use super::solve::{self, LoadedBasis};
use crate::http::body;
use crate::http::client::ClientState;
use crate::http::convert::sentence;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, OCTETS};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::BasisId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
use crate::http::shares::Share;
use crate::http::state::AppState;

/// The route of eigenfields.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(eigenfields))
}

const NPY: &str = "application/x-npy";

/// The most bytes of one answer.
const MOST_BYTES: usize = 256 << 20;

/// Which fields, and how to write them.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct EigenfieldsQuery {
    /// The first field, counted from 0.
    #[serde(default)]
    #[param(default = 0, example = 0)]
    from: usize,
    /// One past the last field; without it, the one after `from`.
    #[param(example = 4)]
    to: Option<usize>,
    /// How the numbers of a face are written.
    #[serde(default)]
    #[param(inline, default = "world")]
    form: Form,
    /// Corrects the fields among all fields of the surface until their eigenvalues are estimated to be right to this
    /// share of them: 1e-10 to below 1.
    #[param(minimum = 1e-10, example = 0.001)]
    refine: Option<f64>,
}

problems!(GetEigenfieldsProblems: SOLVE BODY [INVALID_RANGE_OF_MODES, INVALID_DESIGN, NO_FIELD_SURFACE]);

/// Gets approximate eigenfields
///
/// The lowest fields of the Laplacian of the basis, restricted to its space, of unit norm on the surface of unit area.
/// Their eigenvalues, in `Chladni-Eigenvalues` (of up to 256 fields), are `eigenvalues` of the basis: exact ones lie
/// below them, by about what `Chladni-Estimates` says, `certificate.estimates` of the basis, where all of the fields
/// were judged. With `refine` they are corrected by multigrid among all fields of the
/// surface, at most the lowest 256: the fields and their eigenvalues are then those of the surface, to a tolerance, and
/// the estimates are those of what is left. By `Accept`:
/// `application/x-npy` (the default), an array of fields × faces × numbers for `numpy.load`;
/// `application/octet-stream`, the same little-endian f32 without a header.
#[utoipa::path(
    get, path = "/v1/bases/{id}/eigenfields", tag = "fields", operation_id = "getEigenfields",
    params(BasisId, NumberingQuery, EigenfieldsQuery),
    responses(
        (status = 200, description = "The fields", content((Binary = "application/x-npy"), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Chladni-Eigenvalues" = String), ("Chladni-Estimates" = String))),
        GetEigenfieldsProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn eigenfields(
    state: ClientState,
    BasisId(id): BasisId,
    numbered: Numbered,
    QueryOf(query): QueryOf<EigenfieldsQuery>,
    headers: HeaderMap,
) -> Result<Answer, Problem> {
    let begin = Instant::now();
    let npy = extract::negotiated(&headers, &[NPY, OCTETS])? == NPY;
    let loaded = LoadedBasis::load(&state, id).await?;
    let model = loaded.model();
    let via = numbered.on_basis(&state, id, &loaded.fields.metadata).await?;
    let (kind, form, faces) = (loaded.kind(), query.form, via.faces(loaded.surface.surface.faces()));
    let count = model.dimension();
    let wanted = Eigenfields::new(query.from, query.to, count)?;
    let refused = |detail: String| Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail).with("count", count));
    let one = 4 * form.columns(kind) * faces;
    if wanted.count().saturating_mul(one) > MOST_BYTES {
        return refused(format!(
            "{} fields of {one} bytes exceed the limit of one response; ask for fewer.",
            wanted.count()
        ));
    }
    let area = loaded.fields.basis.area;
    let written = move |loaded: &LoadedBasis, bytes: &mut Vec<u8>, field: Vec<f32>| {
        let written = written_as(loaded.surface.surface.frames(), kind, form, field);
        bytes.extend_from_slice(&octets::to_bytes(via.push_faces(&written, form.columns(kind))));
    };
    let refined = match query.refine {
        None => None,
        Some(tolerance) => Some((whole(&state, &loaded, &wanted, tolerance).await?, tolerance)),
    };
    let give = move |monitor: &dyn Monitor| {
        let mut bytes =
            if npy { npz::npy("<f4", false, &[wanted.count(), faces, form.columns(kind)], &[]) } else { Vec::new() };
        bytes.reserve_exact(wanted.count() * one);
        let (mut values, mut above) = (Vec::new(), Vec::new());
        let take = |own: Eigenfield| {
            values.push(own.value);
            above.extend(own.above);
            written(&loaded, &mut bytes, own.field);
        };
        match &refined {
            None => wanted.each(&loaded, None, monitor, take)?,
            Some(((full, _memory), tolerance)) => {
                let instead = "Ask for fewer, or for a larger tolerance.";
                let too_long =
                    patience::too_long("refine", patience::USUAL, "The eigenfields were not corrected", instead);
                let patient = Patience::new(patience::USUAL, monitor);
                wanted.each(&loaded, Some((full, *tolerance)), &patient, take).map_err(too_long)?;
            }
        }
        if values.len() < wanted.count() {
            return Err(Problem::internal("eigenfields of a basis that depend on each other"));
        }
        let mut answer = Answer::new(bytes, if npy { NPY } else { OCTETS }, begin)
            .with("chladni-rows", faces)
            .with("chladni-columns", form.columns(kind))
            .with("chladni-dtype", "f32")
            .with("chladni-form", form.name());
        // Clients have limits on headers.
        if wanted.count() <= MOST_REFINED {
            answer = answer.with("chladni-eigenvalues", listed(&values, area));
        }
        let estimates = match refined {
            Some(_) => Some(listed(&above, area)),
            None => estimates(loaded.fields.metadata.json(), wanted.range()),
        };
        Ok(match estimates {
            Some(estimates) => answer.with("chladni-estimates", estimates),
            None => answer,
        })
    };
    state.solve("eigenfields", give).await
}

/// How far the values of some fields of the space lie above the exact ones, in 1/length² of the mesh, where all of them
/// were judged when the basis was made.
fn estimates(metadata: &serde_json::Value, range: std::ops::Range<usize>) -> Option<String> {
    let judged = metadata["certificate"]["estimates"].as_array()?.get(range)?;
    let numbers: Option<Vec<String>> = judged.iter().map(|one| one.as_f64().map(|one| one.to_string())).collect();
    Some(numbers?.join(", "))
}

/// Values on unit area in 1/length² of the mesh, as a header has them.
fn listed(values: &[f64], area: f64) -> String {
    values.iter().map(|value| (value / area).to_string()).collect::<Vec<_>>().join(", ")
}

/// All fields of the surface, and the memory that correcting some takes.
async fn whole(
    state: &ClientState,
    loaded: &LoadedBasis,
    wanted: &Eigenfields,
    tolerance: f64,
) -> Result<(Arc<FullSpace>, Share), Problem> {
    wanted.check_refined(tolerance)?;
    let mut memory = state.memory();
    body::reserve(&mut memory, LowestFields::bytes(wanted.block_size(), loaded.fields.rows()))?;
    Ok((solve::full_space(state, loaded).await?, memory))
}

impl From<EigenfieldFault> for Problem {
    fn from(fault: EigenfieldFault) -> Self {
        match fault {
            EigenfieldFault::Range { count, .. } | EigenfieldFault::Refined { count, .. } => {
                Self::new(&problem::INVALID_RANGE_OF_MODES, sentence(&fault)).with("count", count)
            }
            EigenfieldFault::Design(fault) => fault.into(),
        }
    }
}
