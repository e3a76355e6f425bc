//! Generated meshes to begin with, for who has none at hand. They are made for the request, and nothing is stored.

use axum::Json;
use axum::extract::Path;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use chladni_mesh::read::MeshFormat;
use chladni_mesh::shape::{Shape, ShapeError, generate};
use chladni_mesh::write::{write_obj, write_ply};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::client::ClientState;
use super::extract::QueryOf;
use super::problem::{self, Problem};
use super::problems::problems;
use super::state::AppState;

/// The most vertices of a sample: it is made while the client waits.
const MOST_VERTICES: usize = 500_000;

/// The highest genus of a sample: chains of more rings take many attempts.
const HIGHEST_GENUS: u32 = 50;

/// Those that are listed; any other genus can be asked for too.
const LISTED: [(Shape, &str); 9] = [
    (Shape::Bell, "A bell, open at its rim"),
    (Shape::Violin, "The plate of a violin, flat"),
    (Shape::Starfish, "A starfish with five arms"),
    (Shape::Sphere, "The unit sphere"),
    (Shape::Torus, "A torus of radii 1 and 0.4"),
    (Shape::Knot, "A tube around the (2, 3) torus knot"),
    (Shape::Genus(3), "A chain of three rings: genus 3"),
    (Shape::Disk, "The unit disk, flat"),
    (Shape::Rectangle, "A rectangle of sides 1.6 and 1, flat"),
];

/// The routes of samples.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(show))
}

/// A mesh that can be generated.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"name": "bell", "description": "A bell, open at its rim", "fewest_vertices": 7}))]
struct Sample {
    /// Its name in paths.
    name: String,
    /// What it is, in a few words.
    description: &'static str,
    /// The fewest vertices that it can be made of.
    fewest_vertices: usize,
}

/// The meshes that can be generated.
#[derive(Debug, Serialize, ToSchema)]
#[schema(example = json!({"items": [{"name": "bell", "description": "A bell, open at its rim", "fewest_vertices": 7}]}))]
struct Samples {
    /// All of them but further genera.
    items: Vec<Sample>,
}

problems!(ListSamplesProblems: [INVALID_QUERY]);

/// Lists the meshes that can be generated
///
/// For a first look at the service without a file at hand; nothing is stored.
#[utoipa::path(
    get, path = "/v1/samples", tag = "meshes", operation_id = "listSamples",
    responses((status = 200, description = "The samples", body = Samples), ListSamplesProblems),
    security(("bearer" = ["read"]))
)]
async fn list() -> Json<Samples> {
    let sample = |(name, description): (Shape, _)| Sample {
        name: name.to_string(),
        description,
        fewest_vertices: name.fewest_vertices(),
    };
    Json(Samples { items: LISTED.map(sample).into() })
}

/// How a sample is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum SampleFormat {
    /// Binary, in double precision.
    #[default]
    Ply,
    Obj,
}

/// What sample is wanted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct SampleQuery {
    /// About how many vertices: the mesh has the nearest number that the pattern of the shape allows.
    #[param(minimum = 4, maximum = 500_000, default = 10_000)]
    vertices: Option<usize>,
    /// The format of the file.
    #[serde(default)]
    #[param(inline)]
    format: SampleFormat,
}

problems!(GetSampleProblems: [INVALID_QUERY, UNKNOWN_SAMPLE, BUSY]);

/// Generates a mesh
///
/// The file can be uploaded as it is:
/// `curl -sS $url/v1/samples/bell | curl -sS $url/v1/meshes?name=bell --data-binary @-`. The same request gives the
/// same bytes.
#[utoipa::path(
    get, path = "/v1/samples/{shape}", tag = "meshes", operation_id = "getSample",
    params(("shape" = String, Path, description = "A name from the list, or `genus-G` for a whole number G up to 50", example = "bell"), SampleQuery),
    responses(
        (status = 200, description = "The mesh", content((super::docs::Binary = "model/ply"), (super::docs::Binary = "model/obj"))),
        GetSampleProblems,
    ),
    security(("bearer" = ["read"]))
)]
async fn show(
    state: ClientState,
    shape: Result<Path<String>, axum::extract::rejection::PathRejection>,
    QueryOf(query): QueryOf<SampleQuery>,
) -> Result<Response, Problem> {
    let unknown = |text: String| Problem::new(&problem::UNKNOWN_SAMPLE, text);
    let name = shape.map_err(|_| unknown("No sample has such a name.".to_owned()))?.0;
    let shape: Shape = name.parse().map_err(|error: ShapeError| unknown(format!("{error}.")))?;
    let vertices = query.vertices.unwrap_or(10_000);
    if let Shape::Genus(genus) = shape
        && genus > HIGHEST_GENUS
    {
        return Err(unknown(format!("Samples have a genus of at most {HIGHEST_GENUS}, not {genus}.")));
    }
    let fewest = shape.fewest_vertices();
    if !(fewest..=MOST_VERTICES).contains(&vertices) {
        let text = format!("\"vertices\" is {vertices}; the sample {shape} takes {fewest} to {MOST_VERTICES}.");
        return Err(Problem::new(&problem::INVALID_QUERY, text));
    }
    let format = query.format;
    let bytes = state
        .solve("sample", move |_| {
            let refuse = |error: ShapeError| Problem::new(&problem::INVALID_QUERY, format!("{error}."));
            let mesh = generate(shape, vertices).map_err(refuse)?;
            let mut bytes = Vec::new();
            match format {
                SampleFormat::Ply => write_ply(&mesh, None, &mut bytes),
                SampleFormat::Obj => write_obj(&mesh, &mut bytes),
            }
            .map_err(Problem::internal)?;
            Ok(bytes)
        })
        .await?;
    let (media_type, ending) = match format {
        SampleFormat::Ply => (MeshFormat::Ply.media_type(), "ply"),
        SampleFormat::Obj => (MeshFormat::Obj.media_type(), "obj"),
    };
    let disposition = format!("attachment; filename=\"{shape}.{ending}\"");
    let headers = [(header::CONTENT_TYPE, media_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)];
    Ok((headers, bytes).into_response())
}
