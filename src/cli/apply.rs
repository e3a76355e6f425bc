//! What a stored basis is good for, without a server: distances, filters, designed fields. Requests are those of the
//! API.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use chladni_algebra::DenseMatrix;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::write::{PlyPrecision, SurfaceFormat};
use chladni_spectral::analysis::filter::{Transfer, filter};
use chladni_spectral::formats::npz::{self, DesignedField};
use chladni_work::design::{DesignFault, DesignRequest, ExactField, Form, MatchedFaces, written, written_at};
use chladni_work::distances::{DistanceFault, DistanceRequest, Distances, MeshDistances};
use chladni_work::projection::coordinates;
use chladni_work::table::Table;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::output::TableFormat;
use super::stored::{OnMesh, Stored};
use super::work::{OutputFile, json_argument};
use super::{CliError, MeshInput, NumberingArguments, arrays};

/// Compute distances on a surface from a stored eigenbasis, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni distances bunny.npz bunny.ply --request '{\"distance\": {\"kind\": \"geodesic\"}, \"sources\": [17]}' -o distances.npy")]
pub struct DistancesArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/distances as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the table to this file, .npy or .csv, instead of printing it as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Compute geodesic distances on a mesh, without a basis and without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni mesh-distances bunny.ply --request '{\"distance\": {\"kind\": \"geodesic\", \"method\": \"exact\"}, \"sources\": [17]}' -o distances.npy")]
pub struct MeshDistancesArguments {
    #[command(flatten)]
    input: MeshInput,

    #[command(flatten)]
    numbered: NumberingArguments,

    /// The request of POST /v1/meshes/{id}/distances as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// Write the table to this file, .npy or .csv, instead of printing it as JSON
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Filter the coordinates of a mesh by its spectrum, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni filter bunny.npz bunny.ply --transfer '{\"kind\": \"low_pass\", \"cutoff\": 250.0}' -o smooth.ply")]
pub struct FilterArguments {
    #[command(flatten)]
    stored: Stored,

    /// The transfer function of POST /v1/bases/{id}/filter as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    transfer: String,

    /// Write the filtered mesh to this file, .ply, .obj or .glb, with its texture coordinates, normals and names; it
    /// has the vertices kept after repairs, and points without faces in the order in which they are kept
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

/// Design a tangential field in a stored space of fields, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  chladni design fields.npz bunny.ply --request '{\"strokes\": [{\"face\": 17, \"direction\": [0, 0, 1]}]}' -o field.npy
  chladni design crosses.npz torus.ply --request '{\"singularities\": {\"at\": [{\"vertex\": 10, \"index\": 0.25}, {\"vertex\": 300, \"index\": -0.25}], \"exact\": true}}' -o field.npz
  chladni quads torus.ply --field field.npz -o quads.obj")]
pub struct DesignArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/design as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// How the numbers of each face are written
    #[arg(long, value_name = "FORM", default_value = "world", value_parser = form)]
    form: Form,

    /// Write the field, a row for each face, to this file, .npy or .csv; without it the coefficients and energies are
    /// printed as JSON. With "faces" in the request, the face of each row is printed as JSON, and with exact
    /// singularities the pairs of faces between which the field turns by more than half a turn, if there are any. As
    /// .npz it is an archive of the faces kept after repairs, with these pairs as "matching" and the maps vertex_map
    /// and face_map: what quads --field goes along
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn form(text: &str) -> Result<Form, String> {
    serde_json::from_value(json!(text)).map_err(|_| "one of world, frames, roots, axes".to_owned())
}

/// A file of a table, with its format by its ending.
pub(super) fn table_file(path: &Path) -> Result<(TableFormat, OutputFile), CliError> {
    Ok((TableFormat::of(path)?, OutputFile::probe(path)?))
}

/// A file of a table where one is asked for, with its format by its ending.
pub(super) struct TableOutput(Option<(TableFormat, OutputFile)>);

impl TableOutput {
    pub fn probe(path: Option<&Path>) -> Result<Self, CliError> {
        path.map(table_file).transpose().map(Self)
    }

    /// Whether there is a file.
    pub fn is_file(&self) -> bool {
        self.0.is_some()
    }

    /// Writes a matrix into the file, or prints it as a table of JSON.
    pub fn matrix(&self, matrix: &DenseMatrix) -> Result<ExitCode, CliError> {
        self.table(Table::from(matrix))
    }

    /// Writes a table into the file, or prints it as JSON.
    pub fn table(&self, table: Table) -> Result<ExitCode, CliError> {
        match &self.0 {
            None => print(&table),
            Some((format, file)) => {
                file.write(|out| format.write(&table.values, table.columns, out))?;
                Ok(ExitCode::SUCCESS)
            }
        }
    }
}

/// The error of a request that does not fit.
pub(super) fn refused(error: impl std::fmt::Display) -> CliError {
    CliError::Refused(error.to_string())
}

/// Runs `chladni distances`.
pub fn distances(arguments: DistancesArguments) -> Result<ExitCode, CliError> {
    let mut request: DistanceRequest = typed("--request", &arguments.request)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    let OnMesh { basis, mesh, to, .. } = arguments.stored.on_vertices()?;
    request.translate(&to, basis.vertices()).map_err(refused)?;
    let found = request.distances(&basis, Some(&mesh), &Unwatched).map_err(refused)?;
    tell_slopes(&found);
    output.matrix(&request.translated(&to, found.table))
}

/// Runs `chladni mesh-distances`.
pub fn mesh_distances(arguments: MeshDistancesArguments) -> Result<ExitCode, CliError> {
    let mut request: DistanceRequest = typed("--request", &arguments.request)?;
    let output = TableOutput::probe(arguments.output.as_deref())?;
    request.check().map_err(refused)?;
    let needs_basis = || refused(DistanceFault::NeedsBasis);
    let (method, time) = request.on_mesh().ok_or_else(needs_basis)?;
    let checked = arguments.input.load_body()?.surface;
    let to = arguments.numbered.translation(Arc::new(checked.numbering));
    request.translate(&to, checked.mesh.positions.len()).map_err(refused)?;
    let prepared = MeshDistances::new(&checked.mesh, method, time, &Unwatched).map_err(refused)?;
    let found = request.geodesics(&prepared.ok_or_else(needs_basis)?, &Unwatched).map_err(refused)?;
    tell_slopes(&found);
    output.matrix(&request.translated(&to, found.table))
}

/// How far distances by heat may be off.
fn tell_slopes(found: &Distances) {
    if let Some(error) = found.slope_error {
        let percent = 100.0 * error;
        eprintln!(
            "distances by heat: slopes are {percent:.1} % off, distances by about as much or less; the method \"exact\" has no such error"
        );
    }
}

/// Runs `chladni filter`.
pub fn filtered(arguments: FilterArguments) -> Result<ExitCode, CliError> {
    let transfer: Transfer = typed("--transfer", &arguments.transfer)?;
    let format = surface_format(&arguments.output)?;
    let output = OutputFile::probe(&arguments.output)?;
    let opened = arguments.stored.on_vertices()?;
    let moved =
        filter(&opened.basis, &coordinates(opened.positions().map_err(refused)?), &transfer).map_err(refused)?;
    write_moved(opened, &moved, format, &output)
}

/// Writes the mesh of a basis with three functions as the coordinates of its vertices.
pub(super) fn write_moved(
    opened: OnMesh,
    functions: &DenseMatrix,
    format: SurfaceFormat,
    output: &OutputFile,
) -> Result<ExitCode, CliError> {
    let OnMesh { basis, mut mesh, attributes, .. } = opened;
    if functions.columns() != 3 {
        let found = functions.columns();
        return Err(refused(format!("a surface needs exactly three functions as its coordinates, not {found}")));
    }
    let position = |row: usize| std::array::from_fn(|axis| functions.column(axis)[row]);
    // Of a solid, the vertices of its surface come first; the others would stand there without a face.
    let vertices = mesh.faces.iter().flatten().map(|&vertex| vertex as usize + 1).max().unwrap_or(0);
    let vertices = if basis.is_of_solid().map_err(refused)? { vertices } else { functions.rows() };
    mesh.positions.truncate(vertices);
    let positions: Vec<[f64; 3]> = (0..vertices).map(position).collect();
    let attributes = attributes.as_ref().map(|attributes| attributes.moved(&mesh, &positions));
    let moved = TriangleMesh { positions, faces: std::mem::take(&mut mesh.faces), ..Default::default() };
    let precision = PlyPrecision::of(&moved.positions);
    output.write(|out| Ok(format.write(&moved, attributes.as_deref(), precision, out)?))?;
    Ok(ExitCode::SUCCESS)
}

/// The format of a surface by the ending of its file.
pub(super) fn surface_format(path: &Path) -> Result<SurfaceFormat, CliError> {
    match path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("ply") => Ok(SurfaceFormat::Ply),
        Some("obj") => Ok(SurfaceFormat::Obj),
        Some("glb") => Ok(SurfaceFormat::Glb),
        _ => {
            let reason = format!("--output {}: surfaces are written as .ply, .obj or .glb", path.display());
            Err(CliError::Usage(reason))
        }
    }
}

/// What a designed field is written as.
enum DesignOutput {
    Table(TableFormat, OutputFile),
    Archive(OutputFile),
}

impl DesignOutput {
    fn probe(path: &Path) -> Result<Self, CliError> {
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz")) {
            return OutputFile::probe(path).map(Self::Archive);
        }
        table_file(path).map(|(format, file)| Self::Table(format, file))
    }
}

/// Runs `chladni design`.
pub fn design(arguments: DesignArguments) -> Result<ExitCode, CliError> {
    let mut request: DesignRequest = typed("--request", &arguments.request)?;
    let output = arguments.output.as_deref().map(DesignOutput::probe).transpose()?;
    if let (Some(DesignOutput::Archive(_)), Some(_)) = (&output, &request.faces) {
        let reason = "--output: an archive has all faces; write a table, or leave out faces in the request";
        return Err(CliError::Usage(reason.to_owned()));
    }
    let (setting, to, numbering) = arguments.stored.fields_and_numbering()?;
    let vertices = setting.surface.surface.mesh().positions.len();
    request.translate(&to, setting.kind(), vertices).map_err(refused)?;
    let told = |fault: DesignFault| refused(fault.numbered(&to));
    let designed = setting.design(&request, &Unwatched).map_err(told)?;
    let sampled = request.faces.as_ref().map(|wanted| setting.faces(wanted, &Unwatched)).transpose().map_err(told)?;
    let file_faces = |faces: &Vec<u32>| faces.iter().map(|&face| to.file_face(face)).collect::<Vec<_>>();
    let field_faces = sampled.as_ref().map(file_faces);
    let matching = designed.exact.as_ref().map(|exact| MatchedFaces::in_file_faces(&exact.matching, &to));
    let Some(output) = output else {
        let space = if designed.refined.is_some() { "surface" } else { "basis" };
        let design = designed.design;
        return print(&json!({
            "coefficients": design.coefficients,
            "harmonic_energy": design.harmonic_energy,
            "biharmonic_energy": design.biharmonic_energy,
            "alignment_energy": design.alignment_energy,
            "faces": designed.constraints.iter().map(|constraint| to.file_face(constraint.face)).collect::<Vec<_>>(),
            "residuals": design.residuals,
            "space": space,
            "error": designed.error,
            "field_faces": field_faces,
            "matching": matching,
        }));
    };
    let (kind, surface) = (setting.kind(), &setting.surface.surface);
    let (form, columns) = (arguments.form, arguments.form.columns(kind));
    let (format, file) = match output {
        DesignOutput::Table(format, file) => (format, file),
        DesignOutput::Archive(file) => {
            let stored = setting.lifted(&designed).map_err(refused)?;
            let numbers = written(surface.frames(), kind, form, stored.clone());
            let pairs = |exact: ExactField| exact.matching.iter().map(|m| (m.faces, m.turns)).collect();
            let mesh = npz::fingerprint(surface.mesh());
            let field = DesignedField { mesh, kind, stored, matching: designed.exact.map(pairs) };
            let of_form = (form.name(), columns, &numbers[..]);
            file.write(|out| npz::write_designed(&field, of_form, Some(&numbering), out))?;
            return Ok(ExitCode::SUCCESS);
        }
    };
    let numbers = match &sampled {
        None => {
            let field = setting.lifted(&designed).map_err(refused)?;
            to.push_faces(&written(surface.frames(), kind, form, field), columns)
        }
        Some(faces) => {
            let part = setting.lifted_at(&designed, faces).map_err(refused)?;
            written_at(surface.frames(), kind, form, faces, part)
        }
    };
    file.write(|out| format.write(&numbers, columns, out))?;
    // What the numbers of the file alone do not tell.
    match (field_faces, matching.filter(|matching| !matching.is_empty())) {
        (None, None) => Ok(ExitCode::SUCCESS),
        (Some(faces), None) => print(&json!({ "field_faces": faces })),
        (None, Some(matching)) => print(&json!({ "matching": matching })),
        (Some(faces), Some(matching)) => print(&json!({ "field_faces": faces, "matching": matching })),
    }
}

/// A typed request from the command line, with what files of arrays it names.
pub(super) fn typed<T: DeserializeOwned>(flag: &str, text: &str) -> Result<T, CliError> {
    fitting(flag, arrays::filled(json_argument(flag, text)?)?)
}

/// A typed request from a value.
pub(super) fn fitting<T: DeserializeOwned>(flag: &str, value: serde_json::Value) -> Result<T, CliError> {
    chladni_work::plain::read_json(&value).map_err(|error| CliError::Usage(format!("{flag}: {error}")))
}

/// Prints one line of JSON.
pub(super) fn print(value: &impl serde::Serialize) -> Result<ExitCode, CliError> {
    let text = serde_json::to_string(value).map_err(|error| CliError::Service(error.to_string()))?;
    writeln!(std::io::stdout(), "{text}").map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
