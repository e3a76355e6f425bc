//! Functional maps between two surfaces.

use std::time::Instant;

use axum::body::Body;
use axum::http::HeaderMap;
use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::functional_map::{MapRequest, PointMap, Transfer, functional_map};
use chladni_work::mappable::check_alike;
use chladni_work::numbered;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use uuid::Uuid;

use super::bases::on_vertices;
use super::binary::{self, Dtype, Table};
use super::client::ClientState;
use super::comparisons::spectrum_of;
use super::exchange::{self, Answer, OCTETS};
use super::extract::QueryOf;
use super::ids::BasisId;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::Problem;
use super::problems::problems;
use super::shapes;
use super::state::AppState;

/// The route of functional maps.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(map_functions))
}

/// Functions that are known on both surfaces.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Descriptors {
    /// On the source: a row for each vertex.
    source: Table,
    /// On the target: as many columns.
    target: Table,
}

/// How functions are carried from the source to the target.
#[derive(Debug, Clone, Copy, Default, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum CarryBy {
    /// Each vertex of the target gets the value of the vertex that it is matched with: for colours, labels, texture
    /// coordinates.
    #[default]
    Points,
    /// By the matrix: smooth, and limited to what the modes hold.
    Modes,
}

/// Functions to be carried over.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Carried {
    /// On the source: a row for each vertex.
    functions: Table,
    /// How.
    #[serde(default)]
    #[schema(inline)]
    by: CarryBy,
}

/// Two surfaces, what is known of the map between them, and how it is refined.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "source": "019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "target": "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33",
    "landmarks": [[17, 33], [410, 2930], [1200, 871]], "pairs": 100
}))]
struct FunctionalMapRequest {
    /// The id of the basis on the source, where functions come from.
    source: String,
    /// The id of the basis on the target, where they go to.
    target: String,
    /// Pairs of a vertex of the source and the one of the target that it corresponds to.
    #[serde(default)]
    landmarks: Vec<[u32; 2]>,
    /// Functions that are known on both.
    descriptors: Option<Descriptors>,
    /// Whether heat kernel signatures are used as such functions. They cannot tell the sides of a symmetric shape
    /// apart.
    #[serde(default)]
    signatures: bool,
    /// The size of the first map; 20 by default.
    start: Option<usize>,
    /// The size of the refined map; 100 by default.
    pairs: Option<usize>,
    /// By how much ZoomOut lets it grow at once; 5 by default.
    step: Option<usize>,
    /// Vertices of each surface that stand for it meanwhile; 2000 by default.
    samples: Option<usize>,
    /// The weight of the preference for maps that commute with the Laplacians; 0.1 by default.
    commutativity: Option<f64>,
    /// Whether every vertex of the target is matched, or only those that stood for it.
    #[serde(default)]
    all_points: bool,
    /// Whether vertices of the source are matched with some of the target as well, by a map of their own.
    #[serde(default)]
    both_ways: bool,
    /// Functions on the source, colours or texture coordinates, that are carried over to the target.
    carry: Option<Carried>,
}

/// For vertices of the source those of the target.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Inverse {
    /// The vertices of the source that were matched; null: all of them, in order.
    pub matched: Option<Vec<u32>>,
    /// For each of them the vertex of the target that corresponds to it; null at vertices of the source's file that
    /// were dropped.
    pub points: Vec<Option<u32>>,
    /// For each of them how well the two agree, from 0 to 1; null where `points` is.
    pub confidences: Vec<Option<f32>>,
}

/// A map between two surfaces, and what tells how good it is.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "matrix": {"columns": 2, "values": [1.0, 0.01, -0.01, 0.99]}, "matched": [0, 3], "points": [5, 9], "confidences": [0.98, 0.95],
    "inverse": null, "carried": null, "descriptor_residual": 0.1,
    "orthogonality_defect": 0.2, "commutativity_defect": 0.05, "embedding_error": 0.1, "coverage": 0.8
}))]
struct FunctionalMapAnswer {
    /// C, k × k: takes coefficients on the source to coefficients on the target, both surfaces scaled to unit area.
    /// Coefficients in the bases as they are stored are taken over by √(area of the target / area of the source) C.
    matrix: Table,
    /// The vertices of the target that were matched; null: all of them, in order.
    matched: Option<Vec<u32>>,
    /// For each of them the vertex of the source that corresponds to it; null at vertices of the target's file that
    /// were dropped.
    points: Vec<Option<u32>>,
    /// For each of them how well its embedding x agrees with the image y of the vertex that corresponds to it: 1 − ‖x −
    /// y‖² / (‖x‖² + ‖y‖²), from 0 to 1; null where `points` is.
    confidences: Vec<Option<f32>>,
    /// The other way, where both were asked for.
    inverse: Option<Inverse>,
    /// The functions that were to be carried over: a row for each vertex of the target.
    carried: Option<Table>,
    /// ‖CA − B‖ / ‖B‖ of the first map: how well it takes the known functions to each other.
    descriptor_residual: f64,
    /// ‖CᵀC − I‖ / √k: 0 for a map that preserves areas.
    orthogonality_defect: f64,
    /// ‖CΛ − Λ'C‖ / ‖CΛ‖: 0 for an isometry.
    commutativity_defect: f64,
    /// The root mean square of the distances between matched points in the spectral embedding, relative to its size.
    embedding_error: f64,
    /// The share of the source's area whose vertices were matched with.
    coverage: f64,
}

/// What a raw body does not say.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct MapQuery {
    /// The type of the numbers of a raw answer.
    #[serde(default)]
    #[param(inline, default = "f32")]
    dtype: Dtype,
    /// For a raw body, the rest of the request as JSON.
    request: Option<String>,
    /// Whether a raw answer is the matched points as little-endian u32, not the matrix.
    #[serde(default)]
    #[param(default = false)]
    points: bool,
}

problems!(FunctionalMapProblems: SOLVE BODY JSON [INVALID_VERTEX, INVALID_FUNCTION, INCOMPARABLE_BASES, INVALID_ANALYSIS]);

/// Maps functions between two surfaces
///
/// A functional map (Ovsjanikov et al. 2012) from landmarks, descriptors or signatures, refined by ZoomOut (Melzi et
/// al. 2019), with the correspondence of points that it makes: for vertices of the target, vertices of the source, and
/// with `both_ways` the other way. With `carry` functions on the source are carried over, colours and texture
/// coordinates among them. Both bases have to be of one operator and one condition at the boundary. Sizes decide how
/// long it takes: a hundred pairs and two thousand samples are a matter of a second, matching all points of large
/// meshes one of many.
///
/// JSON, or raw numbers: with `Content-Type: application/octet-stream` the body is pairs of little-endian u32, the
/// landmarks, and the rest of the request stands in the query. A raw answer is the matrix, row after row, or with
/// `points=true` the points (4294967295 where a vertex has none).
#[utoipa::path(
    post, path = "/v1/functional-maps", tag = "analysis", operation_id = "functionalMap",
    params(NumberingQuery, MapQuery),
    request_body(description = "The surfaces and what is known", content((FunctionalMapRequest = "application/json"), (super::docs::Binary = "application/octet-stream"))),
    responses(
        (status = 200, description = "The map", content((FunctionalMapAnswer = "application/json"), (super::docs::Binary = "application/octet-stream")),
            headers(("Chladni-Rows" = u64), ("Chladni-Columns" = u64), ("Chladni-Dtype" = String), ("Server-Timing" = String))),
        FunctionalMapProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn map_functions(
    state: ClientState,
    numbered: Numbered,
    QueryOf(query): QueryOf<MapQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Answer, Problem> {
    let fill = |request: &mut FunctionalMapRequest, bytes: &[u8]| {
        request.landmarks = binary::decode_tuples(bytes)?;
        Ok(())
    };
    let (mut request, raw) = exchange::request(&state, &headers, body, query.request.as_deref(), fill).await?;
    let (source_id, target_id) = (BasisId::parse(&request.source)?.0, BasisId::parse(&request.target)?.0);
    check_alike_bases(&state, [source_id, target_id]).await?;
    let source = on_vertices(&state, source_id).await?;
    let target = on_vertices(&state, target_id).await?;
    let to_source = numbered.on_basis(&state, source_id, &source.metadata).await?;
    let to_target = numbered.on_basis(&state, target_id, &target.metadata).await?;
    for [from, onto] in &mut request.landmarks {
        *from = to_source.vertex(u64::from(*from), source.vertices())?;
        *onto = to_target.vertex(u64::from(*onto), target.vertices())?;
    }
    state
        .solve("functional_map", move |_| {
            let begin = Instant::now();
            let most = source.count().min(target.count());
            let pairs = request.pairs.unwrap_or(100.min(most));
            let descriptors = match &request.descriptors {
                None => None,
                Some(Descriptors { source: a, target: b }) => {
                    let a = a.functions(source.vertices(), &to_source)?;
                    let b = b.functions(target.vertices(), &to_target)?;
                    if a.columns() != b.columns() {
                        let detail =
                            format!("descriptors: the source has {} and the target {}.", a.columns(), b.columns());
                        return Err(Problem::new(&super::problem::INVALID_FUNCTION, detail));
                    }
                    Some((source.project(&a)?, target.project(&b)?))
                }
            };
            let wanted = MapRequest {
                landmarks: request.landmarks,
                descriptors,
                signatures: request.signatures,
                start: request.start.unwrap_or(20.min(pairs)),
                pairs,
                step: request.step.unwrap_or(5),
                samples: request.samples.unwrap_or(2000),
                commutativity: request.commutativity.unwrap_or(0.1),
                all_points: request.all_points || matches!(&request.carry, Some(Carried { by: CarryBy::Points, .. })),
                both_ways: request.both_ways,
            };
            let carried = match &request.carry {
                Some(Carried { functions, by }) => Some((functions.functions(source.vertices(), &to_source)?, *by)),
                None => None,
            };
            let found = functional_map(&source, &target, &wanted)?;
            let carried = match carried {
                Some((functions, by)) => {
                    let how = if matches!(by, CarryBy::Points) { Transfer::Points } else { Transfer::Modes };
                    let functions = found.transfer(&source, &target, &functions, how)?;
                    Some(binary::to_table(&numbered::push(&to_target, functions)))
                }
                None => None,
            };
            let forward = translated(found.to_source, &to_source, &to_target);
            if raw && query.points {
                let points: Vec<u32> = forward.points.iter().map(|point| point.unwrap_or(u32::MAX)).collect();
                return Ok(Answer::new(binary::encode_u32(&points), OCTETS, begin)
                    .with("chladni-rows", points.len())
                    .with("chladni-columns", 1)
                    .with("chladni-dtype", "u32"));
            }
            if raw {
                return Ok(Answer::raw(&found.matrix, query.dtype, begin));
            }
            let answer = FunctionalMapAnswer {
                matrix: binary::to_table(&found.matrix),
                matched: forward.matched,
                points: forward.points,
                confidences: forward.confidences,
                inverse: found.to_target.map(|inverse| translated(inverse, &to_target, &to_source)),
                carried,
                descriptor_residual: found.descriptor_residual,
                orthogonality_defect: found.orthogonality_defect,
                commutativity_defect: found.commutativity_defect,
                embedding_error: found.embedding_error,
                coverage: found.coverage,
            };
            Answer::json(&answer, begin)
        })
        .await
}

/// Functions of different operators, or of different conditions at a boundary, do not correspond to each other.
async fn check_alike_bases(state: &ClientState, ids: [Uuid; 2]) -> Result<(), Problem> {
    let mut of = Vec::with_capacity(2);
    for id in ids {
        let (basis, mesh) = shapes::find_one(state, id).await?;
        of.push((id.to_string(), spectrum_of(&basis, &mesh)));
    }
    Ok(check_alike(of.iter().map(|(id, of)| (id.as_str(), of)))?)
}

/// A map of points as the files number them: from vertices of `from` to those of `onto`.
pub(super) fn translated(
    PointMap { matched, points, confidences }: PointMap,
    onto: &Translation,
    from: &Translation,
) -> Inverse {
    let points: Vec<Option<u32>> = points.into_iter().map(|point| Some(onto.file_vertex(point))).collect();
    let confidences: Vec<Option<f32>> = confidences.into_iter().map(Some).collect();
    match matched {
        Some(matched) => {
            let matched = matched.into_iter().map(|vertex| from.file_vertex(vertex)).collect();
            Inverse { matched: Some(matched), points, confidences }
        }
        // A point for every vertex: one for each of the file.
        None => Inverse { matched: None, points: from.push(&points, 1), confidences: from.push(&confidences, 1) },
    }
}
