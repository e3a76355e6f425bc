//! What a stored eigenbasis says about single points, without a server. Requests are those of the API.

use std::path::PathBuf;
use std::process::ExitCode;

use chladni_work::signatures::{SignatureRequest, SimilarRequest};

use super::CliError;
use super::apply::{TableOutput, print, refused, typed};
use super::stored::{OnMesh, Stored};

/// Compute signatures of points from a stored eigenbasis, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni signatures bunny.npz bunny.ply --request '{\"signature\": {\"kind\": \"heat_kernel\"}}' -o signatures.npy")]
pub struct SignaturesArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/signatures as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the table, a row for each vertex, to this file, .npy or .csv, instead of printing it as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Find the points that are most similar to one, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni similar-points bunny.npz bunny.ply --request '{\"vertex\": 17, \"signature\": {\"kind\": \"wave_kernel\"}, \"count\": 20}'")]
pub struct SimilarPointsArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/similar-points as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,
}

/// Runs `chladni signatures`.
pub fn signatures(arguments: SignaturesArguments) -> Result<ExitCode, CliError> {
    let mut request: SignatureRequest = typed("--request", &arguments.request)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let OnMesh { basis, to, .. } = arguments.stored.on_vertices()?;
    request.translate(&to, basis.vertices()).map_err(refused)?;
    output.matrix(&request.table(&basis, &to).map_err(refused)?)
}

/// Runs `chladni similar-points`.
pub fn similar_points(arguments: SimilarPointsArguments) -> Result<ExitCode, CliError> {
    let mut request: SimilarRequest = typed("--request", &arguments.request)?;
    request.check().map_err(refused)?;
    let OnMesh { basis, to, .. } = arguments.stored.on_vertices()?;
    request.translate(&to, basis.vertices()).map_err(refused)?;
    print(&request.answer(&basis, &to).map_err(refused)?)
}
