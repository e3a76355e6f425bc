//! `GET /bases/{id}/eigenfields`: approximate eigenfields on the faces.

use std::sync::Arc;
use std::time::Instant;

use axum::http::HeaderMap;
use chladni_base::Monitor;
use chladni_spectral::field::{EigenfieldGoal, FullSpace, LowestFields, RefineError};
use chladni_spectral::formats::npz;
use chladni_work::design::{Form, written as written_as};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::octets;
use super::patience::{self, Patience};
use super::solve::{self, LoadedBasis};
use crate::http::body;
use crate::http::client::ClientState;
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

/// The most fields that one request refines, those below the first included.
const MOST_REFINED: usize = 256;

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
    let (from, to) = (query.from, query.to.unwrap_or(query.from.saturating_add(1)));
    let count = model.dimension();
    let refused = |detail: String| Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail).with("count", count));
    if from >= to || to > count {
        return refused(format!("Fields {from}..{to} were requested, but the basis has {count}."));
    }
    let one = 4 * form.columns(kind) * faces;
    if (to - from).saturating_mul(one) > MOST_BYTES {
        return refused(format!(
            "{} fields of {one} bytes exceed the limit of one response; ask for fewer.",
            to - from
        ));
    }
    let area = loaded.fields.basis.area;
    let written = move |loaded: &LoadedBasis, bytes: &mut Vec<u8>, field: Vec<f32>| {
        let written = written_as(loaded.surface.surface.frames(), kind, form, field);
        bytes.extend_from_slice(&octets::to_bytes(via.push_faces(&written, form.columns(kind))));
    };
    let head =
        move || if npy { npz::npy("<f4", false, &[to - from, faces, form.columns(kind)], &[]) } else { Vec::new() };
    let answer = move |bytes: Vec<u8>, values: &mut dyn Iterator<Item = f64>| {
        let answer = Answer::new(bytes, if npy { NPY } else { OCTETS }, begin)
            .with("chladni-rows", faces)
            .with("chladni-columns", form.columns(kind))
            .with("chladni-dtype", "f32")
            .with("chladni-form", form.name());
        // Clients have limits on headers.
        if to - from <= MOST_REFINED { answer.with("chladni-eigenvalues", listed(values, area)) } else { answer }
    };
    let Some(tolerance) = query.refine else {
        let lift = move |monitor: &dyn Monitor| {
            let mut bytes = head();
            bytes.reserve_exact((to - from) * one);
            for k in from..to {
                monitor.checkpoint()?;
                let field = loaded.lift(&model.eigenfield(k))?;
                written(&loaded, &mut bytes, field);
            }
            let told = answer(bytes, &mut model.values()[from..to].iter().copied());
            Ok(match estimates(&loaded.fields.metadata, from..to) {
                Some(estimates) => told.with("chladni-estimates", estimates),
                None => told,
            })
        };
        return state.solve("eigenfields", lift).await;
    };
    let (full, together, memory) = whole(&state, &loaded, (to, count), tolerance).await?;
    let correct = move |monitor: &dyn Monitor| {
        let _memory = memory;
        let lifted = |k: usize| Ok(loaded.lift(&model.eigenfield(k))?.into_iter().map(f64::from).collect());
        let start = (0..together).map(lifted).collect::<Result<Vec<Vec<f64>>, Problem>>()?;
        let instead = "Ask for fewer, or for a larger tolerance.";
        let too_long = patience::too_long("refine", patience::USUAL, "The eigenfields were not corrected", instead);
        let patient = Patience::new(patience::USUAL, monitor);
        let found = full.eigenfields(start, to, EigenfieldGoal::Tolerance(tolerance), &patient);
        let found = found.map_err(|error| too_long(error.into()))?;
        if !found.reached {
            return Err(RefineError::NotConverged { tolerance }.into());
        }
        let mut bytes = head();
        bytes.reserve_exact((to - from) * one);
        let lacking = || Problem::internal("eigenfields of a basis that depend on each other");
        let own = found.fields.get(from..to).ok_or_else(lacking)?;
        for one in own {
            written(&loaded, &mut bytes, one.field.iter().map(|&x| x as f32).collect());
        }
        Ok(answer(bytes, &mut own.iter().map(|own| own.value))
            .with("chladni-estimates", listed(&mut own.iter().map(|own| own.left), area)))
    };
    state.solve("eigenfields", correct).await
}

/// How far the values of some fields of the space lie above the exact ones, in 1/length² of the mesh, where all of them
/// were judged when the basis was made.
fn estimates(metadata: &serde_json::Value, range: std::ops::Range<usize>) -> Option<String> {
    let judged = metadata["certificate"]["estimates"].as_array()?.get(range)?;
    let numbers: Option<Vec<String>> = judged.iter().map(|one| one.as_f64().map(|one| one.to_string())).collect();
    Some(numbers?.join(", "))
}

/// Values on unit area in 1/length² of the mesh, as a header has them.
fn listed(values: &mut dyn Iterator<Item = f64>, area: f64) -> String {
    values.map(|value| (value / area).to_string()).collect::<Vec<_>>().join(", ")
}

/// All fields of the surface, how many fields are corrected together, and the memory that they take.
async fn whole(
    state: &ClientState,
    loaded: &LoadedBasis,
    (to, count): (usize, usize),
    tolerance: f64,
) -> Result<(Arc<FullSpace>, usize, Share), Problem> {
    FullSpace::check_tolerance(tolerance)?;
    if to > MOST_REFINED {
        let detail = format!("Fields up to {to} were requested; the lowest {MOST_REFINED} can be refined.");
        return Err(Problem::new(&problem::INVALID_RANGE_OF_MODES, detail).with("count", count));
    }
    let together = LowestFields::together(to, count);
    let mut memory = state.memory();
    body::reserve(&mut memory, LowestFields::bytes(together, loaded.fields.rows()))?;
    Ok((solve::full_space(state, loaded).await?, together, memory))
}
