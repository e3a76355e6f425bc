//! Two shapes or more by their stored eigenbases, without a server: maps between them, and how much they are alike.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chladni_base::Unwatched;
use chladni_spectral::analysis::scatter;
use chladni_spectral::analysis::shape_dna::MOST_SHAPES;
use chladni_work::basis_comparison::BasisComparisonRequest;
use chladni_work::functional_map::{FunctionalMapRequest, MapSide};
use chladni_work::mappable::{SpectrumOf, check_alike};
use chladni_work::shape_comparison::{ComparedShape, ComparisonRequest};
use serde_json::{Value, json};

use super::CliError;
use super::apply::{TableOutput, fitting, print, refused, table_file};
use super::arrays::filled;
use super::stored::{OnMesh, StoredPairs, eigenbasis, refuse_fields};
use super::work::{OutputFile, json_argument};

/// Map functions and points of one surface to another by their stored eigenbases, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The source comes first, with its mesh, then the target.

Examples:
  chladni functional-map cat.npz cat.ply lion.npz lion.ply --request '{\"landmarks\": [[17, 33], [410, 2930], [1200, 871]]}'
  chladni functional-map cat.npz cat.ply lion.npz lion.ply --request '{\"landmarks\": \"@landmarks.npy\", \"all_points\": true}' -o points.npy")]
pub struct FunctionalMapArguments {
    #[command(flatten)]
    pairs: StoredPairs,

    /// The request of POST /v1/functional-maps as JSON, or @FILE, without the ids of the bases; "@FILE.npy" or .csv in
    /// the place of a table or of the landmarks is read
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the points to this file, .npy or .csv: a vertex of the source for each vertex of the target that was
    /// matched, -1 where there is none. What else is told of the map is printed as JSON, without a file everything
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,

    /// Write the matrix to this file, .npy or .csv
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,

    /// Write the functions that were carried over, a row for each vertex of the target, to this file, .npy or .csv
    #[arg(long, value_name = "FILE")]
    carried: Option<PathBuf>,
}

/// Compare shapes by the spectra of their stored eigenbases (Shape-DNA), without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni compare-shapes cat.npz cat.ply lion.npz lion.ply horse.npz horse.ply --request '{\"count\": 100}' -o places.svg")]
pub struct CompareShapesArguments {
    #[command(flatten)]
    pairs: StoredPairs,

    /// The request of POST /v1/shape-comparisons as JSON, or @FILE, without the ids of the bases
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,

    /// Write the distances between the shapes to this file, .npy or .csv, or their places as a picture, .svg, instead
    /// of printing everything as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Compare two stored eigenbases of one surface, function by function, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni compare-bases exact.npz approximate.npz --request '{\"pairs\": 100}'
  chladni compare-bases frame1.npz frame2.npz --request '{\"following\": true}'")]
pub struct CompareBasesArguments {
    /// NPZ file of the basis that the other one is projected on
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,

    /// NPZ file of the other basis, on the same mesh
    #[arg(value_name = "OTHER")]
    other: PathBuf,

    /// The request of POST /v1/basis-comparisons as JSON, or @FILE, without the ids of the bases
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,
}

/// A request with the names of files in the place of ids.
fn naming(text: &str, names: &[(&str, Value)]) -> Result<Value, CliError> {
    let mut value = filled(json_argument("--request", text)?)?;
    let Some(members) = value.as_object_mut() else {
        return Err(CliError::Usage("--request: expected a JSON object".to_owned()));
    };
    for (name, file) in names {
        if members.insert((*name).to_owned(), file.clone()).is_some() {
            return Err(CliError::Usage(format!("--request: {name} is told by the files, and not here")));
        }
    }
    Ok(value)
}

fn named(path: &Path) -> Value {
    json!(path.display().to_string())
}

/// Runs `chladni functional-map`.
pub fn functional_map(arguments: FunctionalMapArguments) -> Result<ExitCode, CliError> {
    let pairs = arguments.pairs.pairs(2..=2)?;
    let names = [("source", named(pairs[0].0)), ("target", named(pairs[1].0))];
    let mut request: FunctionalMapRequest = fitting("--request", naming(&arguments.request, &names)?)?;
    let points = arguments.output.as_deref().map(table_file).transpose()?;
    let [matrix, carried] = [&arguments.matrix, &arguments.carried].map(|path| TableOutput::probe(path.as_deref()));
    let (matrix, carried) = (matrix?, carried?);
    if carried.is_file() && request.carry.is_none() {
        return Err(CliError::Usage("--carried: the request has no \"carry\"".to_owned()));
    }
    let (source, target) = (arguments.pairs.on_vertices(pairs[0])?, arguments.pairs.on_vertices(pairs[1])?);
    let of =
        [(&request.source, &source), (&request.target, &target)].map(|(name, own)| (name.clone(), spectrum_of(own)));
    check_alike(of.iter().map(|(name, of)| (name.as_str(), of))).map_err(refused)?;
    request.translate(side(&source), side(&target)).map_err(refused)?;
    let found = request.find(side(&source), side(&target)).map_err(refused)?;
    if matrix.is_file() {
        matrix.matrix(&found.map.matrix)?;
    }
    if let (true, Some(functions)) = (carried.is_file(), &found.carried) {
        carried.matrix(functions)?;
    }
    if let Some((format, file)) = &points {
        let numbers: Vec<i32> =
            found.forward.points.iter().map(|point| point.map_or(-1, |point| point as i32)).collect();
        file.write(|out| format.write(&numbers, 1, out))?;
    }
    let mut told = serde_json::to_value(found.into_answer()).map_err(|error| CliError::Service(error.to_string()))?;
    for (written, member) in
        [(matrix.is_file(), "matrix"), (carried.is_file(), "carried"), (points.is_some(), "points")]
    {
        if let (true, Some(members)) = (written, told.as_object_mut()) {
            members.remove(member);
        }
    }
    print(&told)
}

/// A surface as a map has it.
fn side(own: &OnMesh) -> MapSide<'_> {
    MapSide { basis: &own.basis, to: &own.to }
}

/// What the spectrum of a basis of a file is of.
fn spectrum_of(own: &OnMesh) -> SpectrumOf {
    SpectrumOf::new(&own.basis.metadata.json()["parameters"], own.report.closed)
}

/// Where a comparison of shapes goes.
enum Compared {
    Printed,
    Picture(OutputFile),
    Distances(TableOutput),
}

/// Runs `chladni compare-shapes`.
pub fn compare_shapes(arguments: CompareShapesArguments) -> Result<ExitCode, CliError> {
    let pairs = arguments.pairs.pairs(2..=MOST_SHAPES)?;
    let names: Value = pairs.iter().map(|(basis, _)| named(basis)).collect();
    let request: ComparisonRequest = fitting("--request", naming(&arguments.request, &[("bases", names)])?)?;
    request.check().map_err(refused)?;
    let output = match arguments.output.as_deref() {
        None => Compared::Printed,
        Some(path) if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("svg")) => {
            Compared::Picture(OutputFile::probe(path)?)
        }
        path => Compared::Distances(TableOutput::probe(path)?),
    };
    let (mut shapes, mut labels) = (Vec::new(), Vec::new());
    for (place, &(basis, mesh)) in pairs.iter().enumerate() {
        let own = arguments.pairs.on_vertices((basis, mesh))?;
        let report = serde_json::to_value(&own.report).map_err(|error| CliError::Service(error.to_string()))?;
        let values = (own.basis.eigenvalues, own.basis.certificate.first as u64);
        let shape =
            ComparedShape::new(basis.display().to_string(), values, &own.basis.metadata.json()["parameters"], &report);
        shapes.push(shape.map_err(refused)?);
        let stem = mesh.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        labels.push(request.labels.as_ref().map_or(stem, |labels| labels[place].clone()));
    }
    let found = request.compare(shapes).map_err(refused)?;
    match output {
        Compared::Printed => print(&request.answer(labels, found)),
        Compared::Distances(output) => output.matrix(&found.distances),
        Compared::Picture(file) => {
            let drawing = scatter::svg(&found.places, &labels, &found.held);
            file.write(|out| Ok(std::io::Write::write_all(out, drawing.as_bytes())?))?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Runs `chladni compare-bases`.
pub fn compare_bases(arguments: CompareBasesArguments) -> Result<ExitCode, CliError> {
    let names = [("reference", named(&arguments.reference)), ("other", named(&arguments.other))];
    let request: BasisComparisonRequest = fitting("--request", naming(&arguments.request, &names)?)?;
    let of = |path: &Path| {
        let basis = eigenbasis(path)?;
        refuse_fields(path, &basis)?;
        Ok::<_, CliError>(basis)
    };
    let (reference, other) = (of(&arguments.reference)?, of(&arguments.other)?);
    print(&request.answer(&reference, &other, None, &Unwatched).map_err(refused)?)
}
