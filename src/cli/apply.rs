//! What a stored basis is good for, without a server: distances, filters, designed fields. Requests are those of the
//! API.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use chladni_algebra::DenseMatrix;
use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::attributes::Attributes;
use chladni_mesh::check::CheckedMesh;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_mesh::write::{PlyPrecision, SurfaceFormat};
use chladni_spectral::analysis::filter::{Transfer, filter};
use chladni_spectral::basis::{Basis, StoredFields};
use chladni_spectral::formats::npz;
use chladni_work::design::{
    DesignFault, DesignRequest, Form, MatchedFaces, Setting, Surface, check_own_surface, written, written_at,
};
use chladni_work::distances::DistanceRequest;
use chladni_work::own_mesh::{StrangeMesh, check_own_mesh};
use serde::de::DeserializeOwned;
use serde_json::json;

use super::output::TableFormat;
use super::work::{OutputFile, json_argument};
use super::{CliError, MeshInput, NumberingArguments, read_bytes};

/// A stored basis and the mesh that it lives on.
#[derive(Debug, clap::Args)]
pub(super) struct Stored {
    /// NPZ file of the basis, from solve, field, run or the API
    #[arg(value_name = "BASIS")]
    basis: PathBuf,

    #[command(flatten)]
    input: MeshInput,

    #[command(flatten)]
    numbered: NumberingArguments,
}

impl Stored {
    fn read<T>(
        &self,
        read: impl FnOnce(&[u8]) -> Result<T, chladni_spectral::formats::FormatError>,
    ) -> Result<T, CliError> {
        let (bytes, _) = read_bytes(&self.basis)?;
        npz::check_sums(&bytes).and_then(|()| read(&bytes)).map_err(|error| CliError::mesh(&self.basis, error))
    }

    /// The basis of functions on the vertices of the mesh, and the mesh; where the basis is of the inside of a solid,
    /// with its inner vertices too. And what the file of the mesh has beside.
    fn functions(&self) -> Result<(Basis, TriangleMesh, Translation, Option<Attributes>), CliError> {
        let (basis, body) = (self.read(npz::read)?, self.input.load_body()?);
        let CheckedMesh { mut mesh, numbering, attributes, .. } = body.surface;
        let to = self.numbered.translation(Arc::new(numbering));
        check_own_mesh(&basis, &mesh, body.solid.as_ref(), &Unwatched).map_err(|mut strange| {
            match &mut strange {
                StrangeMesh::Mass { vertex, .. } => *vertex = to.file_vertex(*vertex as u32) as usize,
                StrangeMesh::Area { face, .. } => *face = to.file_face(*face as u32) as usize,
                StrangeMesh::Rows { .. } | StrangeMesh::Operator(_) => {}
            }
            CliError::mesh(&self.basis, strange)
        })?;
        if let (true, Some(solid)) = (basis.is_of_solid(), body.solid) {
            mesh.positions = solid.positions;
        }
        Ok((basis, mesh, to, attributes))
    }

    /// The basis of fields on its surface, and how the request numbers vertices and faces.
    pub(super) fn fields(&self) -> Result<(Setting, Translation), CliError> {
        let refused = |fault: DesignFault| CliError::Refused(fault.to_string());
        let fields: StoredFields = self.read(npz::read_fields)?;
        let checked = self.input.load_body()?.surface;
        let to = self.numbered.translation(Arc::new(checked.numbering));
        let surface = Surface::new(&checked.mesh).map_err(refused)?;
        check_own_surface(&fields.basis, &surface.surface).map_err(|error| CliError::mesh(&self.basis, error))?;
        Ok((Setting::new(Arc::new(fields), Arc::new(surface)).map_err(refused)?, to))
    }
}

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

    /// Write the filtered mesh to this file, .ply, .obj or .glb, with the texture coordinates, normals and names that
    /// it had; it has the kept vertices, and points without faces in the order in which they are kept
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

/// Design a tangential field in a stored space of fields, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  chladni design fields.npz bunny.ply --request '{\"strokes\": [{\"face\": 17, \"direction\": [0, 0, 1]}]}' -o field.npy")]
pub struct DesignArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request of POST /v1/bases/{id}/design as JSON, or @FILE
    #[arg(long, value_name = "JSON")]
    request: String,

    /// How the numbers of a face are written
    #[arg(long, value_name = "FORM", default_value = "world", value_parser = form)]
    form: Form,

    /// Write the field, a row for each face, to this file, .npy or .csv; without it the coefficients and energies are
    /// printed as JSON. With "faces" in the request, the face of each row is printed as JSON, and with exact
    /// singularities the pairs of faces between which the field turns by more than half a turn, if there are any
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,
}

fn form(text: &str) -> Result<Form, String> {
    serde_json::from_value(json!(text)).map_err(|_| "one of world, frames, roots, axes".to_owned())
}

/// A file of a table, with its format by its ending.
fn table_file(path: &Path) -> Result<(TableFormat, OutputFile), CliError> {
    Ok((TableFormat::of(path)?, OutputFile::probe(path)?))
}

/// Runs `chladni distances`.
pub fn distances(arguments: DistancesArguments) -> Result<ExitCode, CliError> {
    let mut request: DistanceRequest = typed("--request", &arguments.request)?;
    let output = arguments.output.as_deref().map(table_file).transpose()?;
    let (basis, mesh, to, _) = arguments.stored.functions()?;
    let refused = |error: NumberingError| CliError::Refused(error.to_string());
    request.translate(&to, basis.vertices()).map_err(refused)?;
    let found =
        request.distances(&basis, Some(&mesh), &Unwatched).map_err(|error| CliError::Refused(error.to_string()))?;
    if let Some(error) = found.slope_error {
        let percent = 100.0 * error;
        eprintln!(
            "distances by heat: slopes are {percent:.1} % off, distances by about as much or less; the method \"exact\" has no such error"
        );
    }
    let table = request.translated(&to, found.table);
    match output {
        None => print(&chladni_work::table::Table::from(&table)),
        Some((format, file)) => {
            let row = |row: usize| (0..table.columns()).map(move |column| (row, column));
            let numbers: Vec<f64> =
                (0..table.rows()).flat_map(row).map(|(row, column)| table.column(column)[row]).collect();
            file.write(|out| format.write(&numbers, table.columns(), out))?;
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// Runs `chladni filter`.
pub fn filtered(arguments: FilterArguments) -> Result<ExitCode, CliError> {
    let transfer: Transfer = typed("--transfer", &arguments.transfer)?;
    let format = surface_format(&arguments.output)?;
    let output = OutputFile::probe(&arguments.output)?;
    let (basis, mut mesh, _, attributes) = arguments.stored.functions()?;
    let mut coordinates = DenseMatrix::zeros(mesh.positions.len(), 3);
    for axis in 0..3 {
        coordinates.column_mut(axis).iter_mut().zip(&mesh.positions).for_each(|(x, position)| *x = position[axis]);
    }
    let moved = filter(&basis, &coordinates, &transfer).map_err(|error| CliError::Refused(error.to_string()))?;
    let position = |row: usize| std::array::from_fn(|axis| moved.column(axis)[row]);
    // Of a solid, the vertices of its surface come first; the others would stand there without a face.
    let vertices = mesh.faces.iter().flatten().map(|&vertex| vertex as usize + 1).max().unwrap_or(0);
    let vertices = if basis.is_of_solid() { vertices } else { moved.rows() };
    mesh.positions.truncate(vertices);
    let positions: Vec<[f64; 3]> = (0..vertices).map(position).collect();
    let attributes = attributes.as_ref().map(|attributes| attributes.moved(&mesh, &positions));
    let moved = TriangleMesh { positions, faces: std::mem::take(&mut mesh.faces), ..Default::default() };
    let precision = PlyPrecision::of(&moved.positions);
    output.write(|out| Ok(format.write(&moved, attributes.as_deref(), precision, out)?))?;
    Ok(ExitCode::SUCCESS)
}

/// The format of a surface by the ending of its file.
fn surface_format(path: &Path) -> Result<SurfaceFormat, CliError> {
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

/// Runs `chladni design`.
pub fn design(arguments: DesignArguments) -> Result<ExitCode, CliError> {
    let refused = |fault: DesignFault| CliError::Refused(fault.to_string());
    let mut request: DesignRequest = typed("--request", &arguments.request)?;
    let output = arguments.output.as_deref().map(table_file).transpose()?;
    let (setting, to) = arguments.stored.fields()?;
    let vertices = setting.surface.surface.mesh().positions.len();
    request.translate(&to, setting.kind(), vertices).map_err(refused)?;
    let designed = setting.design(&request, &Unwatched).map_err(refused)?;
    let sampled =
        request.faces.as_ref().map(|wanted| setting.faces(wanted, &Unwatched)).transpose().map_err(refused)?;
    let file_faces = |faces: &Vec<u32>| faces.iter().map(|&face| to.file_face(face)).collect::<Vec<_>>();
    let field_faces = sampled.as_ref().map(file_faces);
    let matching = designed.exact.as_ref().map(|exact| MatchedFaces::told(&exact.matching, &to));
    let Some((format, file)) = output else {
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

/// A typed request from the command line.
pub(super) fn typed<T: DeserializeOwned>(flag: &str, text: &str) -> Result<T, CliError> {
    fitting(flag, json_argument(flag, text)?)
}

/// A typed request from a value.
pub(super) fn fitting<T: DeserializeOwned>(flag: &str, value: serde_json::Value) -> Result<T, CliError> {
    chladni_work::plain::read_json(&value).map_err(|error| CliError::Usage(format!("{flag}: {error}")))
}

fn print(value: &impl serde::Serialize) -> Result<ExitCode, CliError> {
    let text = serde_json::to_string(value).map_err(|error| CliError::Service(error.to_string()))?;
    writeln!(std::io::stdout(), "{text}").map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
