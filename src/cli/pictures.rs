//! Pictures of what fields are good for, without a server: hatchings and fur. Requests are those of the API.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chladni_base::Vector3;
use chladni_spectral::operator::transport::FieldKind;
use chladni_work::design::{DesignFault, FurRequest, HatchingRequest, Setting};
use serde_json::{Value, json};

use super::apply::fitting;
use super::stored::Stored;
use super::work::{OutputFile, json_argument};
use super::{CliError, StageBars};

/// What both commands take.
#[derive(Debug, clap::Args)]
struct PictureArguments {
    #[command(flatten)]
    stored: Stored,

    /// The request, as for the route of the same name under POST /v1/bases/{id}/, as JSON or @FILE
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,

    /// Write the picture to this file: .png, or for hatchings .svg
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,

    /// Draw no progress bars
    #[arg(long, short = 'q')]
    quiet: bool,
}

/// Draw a hatching along a field of a stored space, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Without a field in the request, lines follow the smoothed principal curvatures of the mesh, or for a basis of vectors the lowest eigenfield.

Examples:
  chladni run field_basis kitten.obj -p dimension=800 -p field=n_vector -p n=2 -o kitten.npz
  chladni hatching kitten.npz kitten.obj -o kitten.svg
  chladni hatching kitten.npz kitten.obj --request '{\"camera\": {\"from\": [1, 0.3, 0.2]}, \"stroke\": 1.4}' -o kitten.png")]
pub struct HatchingArguments {
    #[command(flatten)]
    picture: PictureArguments,
}

/// Paint fur along a vector field of a stored space, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Without a field in the request, the fur is combed downwards and backwards; its length is by default a twentieth of the diagonal of the mesh.

Examples:
  chladni run field_basis kitten.obj -p dimension=800 -o kitten.npz
  chladni fur kitten.npz kitten.obj -o kitten.png
  chladni fur kitten.npz kitten.obj --request '{\"strands\": 400000, \"gravity\": 0.4, \"look\": {\"colour\": [0.8, 0.5, 0.2]}}' -o kitten.png")]
pub struct FurArguments {
    #[command(flatten)]
    picture: PictureArguments,
}

/// Runs `chladni hatching`.
pub fn hatching(HatchingArguments { picture: arguments }: HatchingArguments) -> Result<ExitCode, CliError> {
    let value = object(&arguments.request)?;
    let png = match ending(&arguments.output).as_deref() {
        Some("png") => true,
        Some("svg") => false,
        _ => {
            let reason = format!("--output {}: drawings are written as .svg or .png", arguments.output.display());
            return Err(CliError::Usage(reason));
        }
    };
    let output = OutputFile::probe(&arguments.output)?;
    let (setting, to) = arguments.stored.fields()?;
    let mut request: HatchingRequest = fitting("--request", with(value, "field", usual_lines(&setting)))?;
    request.field.translate(&to, setting.kind(), vertices(&setting)).map_err(refused)?;
    request.check(png).map_err(refused)?;
    let bars = StageBars::new(arguments.quiet);
    let field = request.field.lifted(&setting, &bars).map_err(|fault| refused(fault.numbered(&to)))?;
    let (drawing, lines) = request.drawing(&setting, field, &bars).map_err(refused)?;
    bars.finish();
    let bytes = match png {
        true => drawing.png().ok_or_else(|| CliError::Service("the drawing has no size".to_owned()))?,
        false => drawing.svg().into_bytes(),
    };
    output.write(|out| Ok(std::io::Write::write_all(out, &bytes)?))?;
    eprintln!("{lines} lines, {} strokes", drawing.strokes.len());
    Ok(ExitCode::SUCCESS)
}

/// Runs `chladni fur`.
pub fn fur(FurArguments { picture: arguments }: FurArguments) -> Result<ExitCode, CliError> {
    let value = object(&arguments.request)?;
    if ending(&arguments.output).as_deref() != Some("png") {
        let reason = format!("--output {}: pictures of fur are written as .png", arguments.output.display());
        return Err(CliError::Usage(reason));
    }
    let output = OutputFile::probe(&arguments.output)?;
    let (setting, to) = arguments.stored.fields()?;
    let value = with(value, "field", combed_back(&setting));
    let value = with(value, "length", json!(0.05 * setting.surface.reach));
    let mut request: FurRequest = fitting("--request", value)?;
    request.translate(&to, setting.kind(), vertices(&setting)).map_err(refused)?;
    request.check(&setting).map_err(refused)?;
    let bars = StageBars::new(arguments.quiet);
    let field = request.field.lifted(&setting, &bars).map_err(|fault| refused(fault.numbered(&to)))?;
    let coat = request.coat(&setting, &field, &bars).map_err(refused)?;
    let picture = request.picture(&setting, &coat, &bars).map_err(refused)?;
    bars.finish();
    output.write(|out| Ok(std::io::Write::write_all(out, &picture)?))?;
    Ok(ExitCode::SUCCESS)
}

fn refused(fault: DesignFault) -> CliError {
    CliError::Refused(fault.to_string())
}

fn vertices(setting: &Setting) -> usize {
    setting.surface.surface.mesh().positions.len()
}

fn ending(path: &Path) -> Option<String> {
    path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase())
}

/// A request that is an object: members can be added.
fn object(text: &str) -> Result<Value, CliError> {
    let value = json_argument("--request", text)?;
    match value.is_object() {
        true => Ok(value),
        false => Err(CliError::Usage("--request must be a JSON object".to_owned())),
    }
}

/// Adds a member that is not there.
fn with(mut value: Value, name: &str, usual: Value) -> Value {
    if let Some(object) = value.as_object_mut() {
        object.entry(name).or_insert(usual);
    }
    value
}

/// The field that lines follow where none is named.
fn usual_lines(setting: &Setting) -> Value {
    let even = match setting.kind() {
        FieldKind::NVector { n } => n.is_multiple_of(2),
        FieldKind::Tensor {} => true,
        FieldKind::Vector {} => false,
    };
    if !even {
        return json!({"eigenfield": 0});
    }
    let mut alignment = json!({"to": "curvature", "weight": 1.0});
    if !matches!(setting.kind(), FieldKind::Tensor {}) {
        alignment["per_face"] = json!("anisotropy");
    }
    json!({"design": {"weights": {"harmonic": 0.05}, "alignment": alignment}})
}

/// A field that runs down and back over the surface: for each face the part of one direction that lies in it.
fn combed_back(setting: &Setting) -> Value {
    let frames = setting.surface.surface.frames();
    let way = Vector3::new(0.0, -0.8, -0.6);
    let rows = (0..frames.faces()).flat_map(|face| frames.to_world(face, frames.from_world(face, way)).0);
    let table = json!({"columns": 3, "values": rows.collect::<Vec<f64>>()});
    json!({"design": {"weights": {"harmonic": 0.01}, "alignment": {"to": table, "weight": 1.0}}})
}
