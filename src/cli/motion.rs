//! What stored vibration modes, families of operators and eigenvalues answer, without a server.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use chladni_base::Unwatched;
use chladni_work::family_spectrum::SpectrumRequest;
use chladni_work::simulate::SimulateRequest;
use chladni_work::value_gradient::{ValueGradientRequest, gradient};
use serde_json::json;

use super::CliError;
use super::apply::{TableOutput, print, refused, table_file, typed};
use super::stored::{OnMesh, Stored};
use super::work::OutputFile;

/// Simulate an object in its stored vibration modes, or hear it, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
BASIS is of the kind vibration_basis, from run.

Examples:
  chladni simulate plate.npz plate.ply --request '{\"loads\": [{\"impulse\": {\"vertex\": 17, \"momentum\": [0, 0, -0.01]}}], \"times\": [0, 0.001]}' -o frames.npy
  chladni simulate bell.npz bell.ply --request '{\"loads\": [{\"impulse\": {\"vertex\": 17, \"momentum\": [0, 0, -0.01]}}], \"sound\": {\"listener\": [0, 0, 1]}}' -o tap.wav")]
pub struct SimulateArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/simulate as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the frames, a row for each time, to this file, .npy or .csv, instead of printing the motion as JSON; a
    /// sound, which needs a file, as .wav
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Compute the spectrum of an operator of a stored family, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
BASIS is of the kind operator_family, from run.

Example:
  chladni family-spectrum family.npz bunny.ply --request '{\"extrinsic\": 0.5, \"count\": 100}'")]
pub struct FamilySpectrumArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/spectrum as JSON, or @FILE
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,

    /// Write what "give" names, the eigenvalues, the coefficients or the modes, to this file, .npy or .csv, instead of
    /// printing everything as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Compute the gradient of a sum of eigenvalues by the positions of the vertices, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni value-gradient bunny.npz bunny.ply --request '{\"weights\": [0, 1]}' -o gradient.npy
  chladni value-gradient bunny.npz bunny.ply --request '{\"weights\": \"@weights.npy\"}' -o gradient.npy")]
pub struct ValueGradientArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/value-gradient as JSON, or @FILE; "@FILE.npy" or .csv in the place of the
    /// weights is read
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the gradient, three numbers for each vertex, to this file, .npy or .csv, instead of printing it as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs `chladni simulate`.
pub fn simulate(arguments: SimulateArguments) -> Result<ExitCode, CliError> {
    let mut request: SimulateRequest = typed("--request", &arguments.request)?;
    if request.sound.is_some() {
        return heard(&arguments, request);
    }
    let output = arguments.output.as_deref().map(table_file).transpose()?;
    let (modes, _, to) = arguments.stored.modes()?;
    request.translate(&to, modes.vertices()).map_err(refused)?;
    let Some((format, file)) = output else {
        let answer = request.answer(&modes, usize::MAX, &Unwatched).map_err(refused)?;
        return print(&request.translated(&to, answer));
    };
    let frames = request.frames(&modes, usize::MAX, &Unwatched).map_err(refused)?;
    let frames = request.translated_frames(&to, frames);
    file.write(|out| format.write(&frames.numbers, frames.columns, out))?;
    Ok(ExitCode::SUCCESS)
}

fn heard(arguments: &SimulateArguments, mut request: SimulateRequest) -> Result<ExitCode, CliError> {
    let wav = |path: &&PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("wav"));
    let Some(path) = arguments.output.as_ref().filter(wav) else {
        return Err(CliError::Usage("--output: sounds are written as .wav".to_owned()));
    };
    let output = OutputFile::probe(path)?;
    let (modes, surface, to) = arguments.stored.modes()?;
    request.translate(&to, modes.vertices()).map_err(refused)?;
    let sound = request.sound(&modes, &surface).map_err(refused)?;
    let sound = sound.ok_or_else(|| CliError::Usage("--request: it asks for no sound".to_owned()))?;
    output.write(|out| Ok(out.write_all(&sound.to_wav())?))?;
    print(&json!({ "peak": sound.peak(), "modes": sound.modes, "modes_too_high": sound.too_high }))
}

/// Runs `chladni family-spectrum`.
pub fn family_spectrum(arguments: FamilySpectrumArguments) -> Result<ExitCode, CliError> {
    let request: SpectrumRequest = typed("--request", &arguments.request)?;
    request.check().map_err(refused)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let (family, to) = arguments.stored.family()?;
    let found = request.find(&family, &to).map_err(refused)?;
    if !output.is_file() {
        return print(&request.answer(found));
    }
    match &found.matrix {
        Some(matrix) => output.matrix(matrix),
        None => output.table(chladni_work::table::Table { columns: 1, values: found.eigenvalues }),
    }
}

/// Runs `chladni value-gradient`.
pub fn value_gradient(arguments: ValueGradientArguments) -> Result<ExitCode, CliError> {
    let request: ValueGradientRequest = typed("--request", &arguments.request)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let OnMesh { basis, mesh, solid, to, .. } = arguments.stored.on_vertices()?;
    let found = gradient(&basis, (&mesh, solid.as_ref()), &request.weights, &to, &Unwatched);
    output.matrix(&found.map_err(refused)?)
}
