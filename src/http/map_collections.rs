//! Maps between all shapes of a collection.

use std::time::Instant;

use axum::http::HeaderMap;
use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::Translation;
use chladni_spectral::analysis::functional_map::PointMap;
use chladni_spectral::analysis::map_collection::{
    CollectionMap, CollectionRequest, CollectionShape, MOST_SHAPES, map_collection,
};
use chladni_spectral::basis::CycleErrors;
use chladni_work::functional_map::Inverse;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bases::on_vertices;
use super::binary::{self, Table};
use super::body;
use super::client::ClientState;
use super::exchange::{self, Answer};
use super::extract;
use super::numbering::{Numbered, NumberingQuery};
use super::problem::{self, Problem};
use super::problems::problems;
use super::shapes;
use super::state::AppState;

/// The most bytes of a request: some ids.
const MOST_BYTES: u64 = 1 << 16;

/// The route of collections.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(collect_maps))
}

/// Which shapes, and how they are mapped.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"bases": ["019aa5d0-6b0a-7d52-9a44-07a1c9f0aa10", "019aa5d1-0c2b-7aa1-b7f4-5f0d6a1c2e33"], "pairs": 100}))]
struct MapCollectionRequest {
    /// The ids of the bases, one for each shape: 2 to 32, of different meshes.
    bases: Vec<String>,
    /// The size of the first maps; 30 by default.
    start: Option<usize>,
    /// The size of the refined maps; 100 by default, or as many as all bases have. Shapes times pairs are at most
    /// 4,096.
    pairs: Option<usize>,
    /// By how much they grow at once; 5 by default.
    step: Option<usize>,
    /// Vertices of each surface that stand for it meanwhile; 2000 by default.
    samples: Option<usize>,
    /// Whether maps keep the orientation that the faces of the meshes give. Without it nothing tells the sides of a
    /// symmetric shape apart.
    #[serde(default = "yes")]
    #[schema(default = true)]
    oriented: bool,
    /// Whether each pair is refined by itself at the end: nearer to the truth, and a little less consistent.
    #[serde(default = "yes")]
    #[schema(default = true)]
    polish: bool,
    /// Whether the answer has the matrices beside the points.
    #[serde(default)]
    matrices: bool,
}

fn yes() -> bool {
    true
}

/// The map from one shape to another.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = MapOfCollection)]
pub(super) struct One {
    /// The place in `bases` of the shape where functions come from.
    source: usize,
    /// The place of the shape where they go to.
    target: usize,
    /// For each vertex of the target the vertex of the source that corresponds to it; null at vertices of the target's
    /// file that were dropped.
    points: Vec<Option<u32>>,
    /// For each of them how well the two agree in the latent space, from 0 to 1; null where `points` is.
    confidences: Vec<Option<f32>>,
    /// How far the map that the points of this pair alone made was from what the collection agrees on: 0 for none.
    disagreement: f64,
    /// C, k × k, at unit area, as in functional maps; null unless asked for.
    matrix: Option<Table>,
}

impl One {
    /// A map of points for all vertices, as the files number them.
    pub fn in_file_numbering(
        (source, target): (usize, usize),
        points: PointMap,
        disagreement: f64,
        matrix: Option<&DenseMatrix>,
        numberings: &[Translation],
    ) -> Self {
        let Inverse { points, confidences, .. } = Inverse::of(points, &numberings[source], &numberings[target]);
        Self { source, target, points, confidences, disagreement, matrix: matrix.map(binary::to_table) }
    }
}

/// How consistent the maps are: straight distances over the root of the area between a vertex and where a walk from
/// shape to shape leads it back to.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = CycleErrors)]
pub(super) struct Cycles {
    /// There and back, the mean over all pairs.
    pairs: f64,
    /// Over two other shapes, the mean over all triples; null for two shapes.
    triples: Option<f64>,
    /// The largest mean of a single walk.
    largest: f64,
}

impl From<CycleErrors> for Cycles {
    fn from(CycleErrors { pairs, triples, largest }: CycleErrors) -> Self {
        Self { pairs, triples, largest }
    }
}

/// Maps between all shapes, both ways.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "maps": [
        {"source": 0, "target": 1, "points": [5, 9], "confidences": [0.98, 0.95], "disagreement": 0.1, "matrix": null},
        {"source": 1, "target": 0, "points": [7, 2], "confidences": [0.97, 0.91], "disagreement": 0.1, "matrix": null}
    ],
    "cycles": {"pairs": 0.01, "triples": null, "largest": 0.01}
}))]
pub(super) struct MapCollectionAnswer {
    /// A map for each ordered pair of shapes: by source, then by target.
    pub maps: Vec<One>,
    /// How consistent they are.
    #[schema(inline)]
    pub cycles: Cycles,
}

problems!(MapCollectionProblems: SOLVE BODY JSON [UNKNOWN_BASIS, BASIS_KIND, NOT_ACCEPTABLE, INCOMPARABLE_BASES, INVALID_PARAMETER, INVALID_ANALYSIS]);

/// Maps all shapes of a collection to each other
///
/// Without landmarks: first maps follow from wave kernel signatures and the orientation of the surfaces, are refined by
/// ZoomOut (Melzi et al. 2019), and made consistent by a latent basis that all shapes have in common (Huang et al.
/// 2020), so that pairs that fail by themselves follow those that agree. Each basis has to be of another surface, and
/// all of one operator and one condition at the boundary. The answer has a map of points for each ordered pair. Shapes
/// are taken to be nearly isometric: poses of one animal, say. For more than a few shapes there is the job
/// `map_collection`, which does the same in the queue and keeps what it finds.
#[utoipa::path(
    post, path = "/v1/map-collections", tag = "analysis", operation_id = "mapCollection",
    params(NumberingQuery),
    request_body(content = MapCollectionRequest),
    responses(
        (status = 200, description = "The maps", body = MapCollectionAnswer, headers(("Server-Timing" = String))),
        MapCollectionProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn collect_maps(
    state: ClientState,
    numbered: Numbered,
    headers: HeaderMap,
    content: axum::body::Body,
) -> Result<Answer, Problem> {
    extract::require_json(&headers)?;
    exchange::answer_type(&headers, false, &[])?;
    let body = body::read(&state, &headers, content, MOST_BYTES).await?;
    let request: MapCollectionRequest = exchange::parse(&state, body, exchange::BYTES_PER_NUMBER).await?;
    if request.bases.len() > MOST_SHAPES {
        let detail = format!("bases: {} were given; at most {MOST_SHAPES} can be mapped.", request.bases.len());
        return Err(Problem::new(&problem::INVALID_ANALYSIS, detail));
    }
    let (mut bases, mut meshes, mut numberings) = (Vec::new(), Vec::new(), Vec::new());
    for (record, mesh) in shapes::find(&state, &request.bases).await? {
        let basis = on_vertices(&state, record.id).await?;
        numberings.push(numbered.on_basis(&state, record.id, &basis.metadata).await?);
        meshes.push(state.store.load_mesh(&mesh.id).await?);
        bases.push(basis);
    }
    let defaults = CollectionRequest::default();
    let most = bases.iter().map(|basis| basis.count()).min().unwrap_or(0);
    let pairs = request.pairs.unwrap_or(defaults.pairs.min(most));
    let wanted = CollectionRequest {
        start: request.start.unwrap_or(defaults.start.min(pairs)),
        pairs,
        step: request.step.unwrap_or(defaults.step),
        samples: request.samples.unwrap_or(defaults.samples),
        oriented: request.oriented,
        polish: request.polish,
    };
    state
        .solve("map_collection", move |monitor| {
            let begin = Instant::now();
            let shapes: Vec<CollectionShape<'_>> =
                bases.iter().zip(&meshes).map(|(basis, mesh)| CollectionShape { basis, mesh }).collect();
            let found = map_collection(&shapes, &wanted, monitor)?;
            let in_file_numbering = |map: CollectionMap| {
                let matrix = request.matrices.then_some(&map.matrix);
                One::in_file_numbering((map.source, map.target), map.to_source, map.disagreement, matrix, &numberings)
            };
            let maps = found.maps.into_iter().map(in_file_numbering).collect();
            let answer = MapCollectionAnswer { maps, cycles: found.cycles.into() };
            Answer::json(&answer, begin)
        })
        .await
}
