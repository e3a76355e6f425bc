//! `GET /bases/{id}/eigenfields`: approximate eigenfields on the faces.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_spectral::formats::npz;
use chladni_work::design::{Form, written as written_as};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::octets;
use super::solve::LoadedBasis;
use crate::http::client::ClientState;
use crate::http::docs::Binary;
use crate::http::exchange::{Answer, OCTETS};
use crate::http::extract::{self, QueryOf};
use crate::http::ids::BasisId;
use crate::http::numbering::{Numbered, NumberingQuery};
use crate::http::problem::{self, Problem};
use crate::http::problems::problems;
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
}

problems!(GetEigenfieldsProblems: SOLVE [INVALID_RANGE_OF_MODES, INVALID_DESIGN]);

/// Gets approximate eigenfields
///
/// The lowest fields of the Laplacian of the basis, restricted to its space, of unit norm on the surface of unit area. Their eigenvalues are
/// `eigenvalues` of the basis: exact ones lie below them. By `Accept`: `application/x-npy` (the default), an array of fields × faces × numbers
/// for `numpy.load`; `application/octet-stream`, the same little-endian f32 without a header.
#[utoipa::path(
    get, path = "/v1/bases/{id}/eigenfields", tag = "fields", operation_id = "getEigenfields",
    params(BasisId, NumberingQuery, EigenfieldsQuery),
    responses(
        (status = 200, description = "The fields", content((Binary = "application/x-npy"), (Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String))),
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
    state
        .solve("eigenfields", move |monitor| {
            let columns = form.columns(kind);
            let mut bytes = if npy { npz::npy("<f4", false, &[to - from, faces, columns], &[]) } else { Vec::new() };
            bytes.reserve_exact((to - from) * one);
            for k in from..to {
                monitor.checkpoint()?;
                let field = loaded.lift(&model.eigenfield(k))?;
                let written = written_as(loaded.surface.surface.frames(), kind, form, field);
                bytes.extend_from_slice(&octets::to_bytes(via.push_faces(&written, columns)));
            }
            Ok(Answer::new(bytes, if npy { NPY } else { OCTETS }, begin)
                .with("chladni-rows", faces)
                .with("chladni-columns", columns)
                .with("chladni-dtype", "f32")
                .with("chladni-form", form.name()))
        })
        .await
}
