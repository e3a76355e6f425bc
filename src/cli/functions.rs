//! Functions in a stored basis, without a server: their coefficients, and these put together again.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chladni_spectral::analysis::compression::decompress as decompressed;
use chladni_spectral::analysis::projection::project as projected;
use chladni_work::compression::CompressionRequest;
use chladni_work::numbered::{in_basis, push};
use chladni_work::projection::{ProjectAnswer, ProjectRequest, reconstruct as reconstructed};
use chladni_work::table::Table;

use super::apply::{TableOutput, print, refused, surface_format, typed, write_moved};
use super::arrays::Array;
use super::stored::{OnMesh, Stored};
use super::work::OutputFile;
use super::{CliError, read_bytes};

/// Project functions onto a stored basis, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni project bunny.npz bunny.ply --request '{\"functions\": \"@functions.npy\"}' -o coefficients.npy
  chladni project bunny.npz bunny.ply --request '{\"functions\": \"coordinates\", \"pairs\": 100, \"reconstruct\": true}'")]
pub struct ProjectArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/project as JSON, or @FILE; "@FILE.npy" or .csv in the place of the table of
    /// functions is a row for each vertex
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the coefficients, a row for each mode, to this file, .npy or .csv, or with "reconstruct" the projected
    /// functions, a row for each vertex; the relative errors are printed as JSON, without a file everything
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Put functions together from coefficients in a stored basis, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni reconstruct bunny.npz bunny.ply --coefficients coefficients.npy -o functions.npy")]
pub struct ReconstructArguments {
    #[command(flatten)]
    stored: Stored,

    /// The coefficients, a row for each eigenfunction and a column for each function: .npy or .csv, as project writes
    /// them
    #[arg(long, value_name = "FILE")]
    coefficients: PathBuf,

    /// Write the functions, a row for each vertex, to this file, .npy or .csv, instead of printing them as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Compress functions to their coefficients in a stored basis, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni compress bunny.npz bunny.ply --request '{\"pairs\": 300, \"bits\": 14}' -o bunny.packed
  chladni compress bunny.npz bunny.ply --request '{\"functions\": \"@functions.npy\"}' -o functions.packed")]
pub struct CompressArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/compress as JSON, or @FILE; "@FILE.npy" or .csv in the place of the table of
    /// functions is a row for each vertex
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,

    /// Write the compressed functions to this file; rate and distortion are printed as JSON either way
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Put compressed functions together again, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni decompress bunny.npz bunny.ply --compressed bunny.packed -o bunny-again.ply")]
pub struct DecompressArguments {
    #[command(flatten)]
    stored: Stored,

    /// What compress wrote with the same basis
    #[arg(long, value_name = "FILE")]
    compressed: PathBuf,

    /// Write the functions, a row for each vertex, to this file, .npy or .csv, or, of three functions, the mesh with
    /// them as its coordinates, .ply, .obj or .glb
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

/// Runs `chladni project`.
pub fn project(arguments: ProjectArguments) -> Result<ExitCode, CliError> {
    let request: ProjectRequest = typed("--request", &arguments.request)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let opened = arguments.stored.open()?;
    let to = in_basis(opened.to.clone(), &opened.basis).map_err(refused)?;
    let basis = &opened.basis;
    let functions =
        request.functions.on(opened.positions().map_err(refused)?, basis.vertices(), &to).map_err(refused)?;
    let found = projected(basis, &functions, request.pairs.unwrap_or(basis.count())).map_err(refused)?;
    if !output.is_file() {
        return print(&ProjectAnswer::new(found, request.reconstruct, &to));
    }
    let told = serde_json::json!({ "relative_errors": found.relative_errors });
    match request.reconstruct {
        true => output.matrix(&push(&to, found.reconstruction))?,
        false => output.matrix(&found.coefficients)?,
    };
    print(&told)
}

/// Runs `chladni reconstruct`.
pub fn reconstruct(arguments: ReconstructArguments) -> Result<ExitCode, CliError> {
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let coefficients: Table = Array::read(&arguments.coefficients)?.into_table();
    let OnMesh { basis, to, .. } = arguments.stored.open()?;
    let misfit = |error: chladni_work::table::TableError| CliError::mesh(&arguments.coefficients, error);
    let coefficients = coefficients.matrix(basis.count()).map_err(misfit)?;
    let to = in_basis(to, &basis).map_err(refused)?;
    output.matrix(&reconstructed(&basis, &coefficients, &to).map_err(refused)?)
}

/// Runs `chladni compress`.
pub fn compress(arguments: CompressArguments) -> Result<ExitCode, CliError> {
    let request: CompressionRequest = typed("--request", &arguments.request)?;
    let output = arguments.output.as_deref().map(OutputFile::probe).transpose()?;
    let opened = arguments.stored.on_vertices()?;
    let (basis, rate) = (&opened.basis, request.rate(&opened.basis));
    let functions =
        request.functions.on(opened.positions().map_err(refused)?, basis.vertices(), &opened.to).map_err(refused)?;
    let packed = rate.compress(basis, &functions).map_err(refused)?;
    if let Some(file) = output {
        file.write(|out| Ok(out.write_all(&packed.bytes)?))?;
    }
    print(&rate.into_answer(basis, packed).map_err(refused)?)
}

/// Where functions go that were put together.
enum Decompressed {
    Table(TableOutput),
    Surface(chladni_mesh::write::SurfaceFormat, OutputFile),
}

impl Decompressed {
    fn probe(path: &Path) -> Result<Self, CliError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("npy" | "csv") => TableOutput::probe(Some(path)).map(Self::Table),
            Some("ply" | "obj" | "glb") => Ok(Self::Surface(surface_format(path)?, OutputFile::probe(path)?)),
            _ => {
                let path = path.display();
                let reason =
                    format!("--output {path}: functions are written as .npy or .csv, surfaces as .ply, .obj or .glb");
                Err(CliError::Usage(reason))
            }
        }
    }
}

/// Runs `chladni decompress`.
pub fn decompress(arguments: DecompressArguments) -> Result<ExitCode, CliError> {
    let output = Decompressed::probe(&arguments.output)?;
    let (bytes, _) = read_bytes(&arguments.compressed)?;
    let opened = arguments.stored.on_vertices()?;
    let functions = decompressed(&opened.basis, &bytes);
    let functions = functions.map_err(|error| CliError::mesh(&arguments.compressed, error))?;
    match output {
        Decompressed::Table(output) => output.matrix(&push(&opened.to, functions)),
        Decompressed::Surface(format, file) => write_moved(opened, &functions, format, &file),
    }
}
