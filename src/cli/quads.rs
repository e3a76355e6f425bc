//! `quads`: a seamless parametrisation along a cross field, without a server.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use chladni_base::Unwatched;
use chladni_spectral::field::quad::VertexOrder;
use chladni_work::design::{CrossSource, DesignFault, QuadsFormat, QuadsRequest, Surface};
use serde_json::json;

use super::work::{OutputFile, json_argument};
use super::{CliError, MeshInput, grouped};

/// Parametrise a surface along a cross field that follows its creases, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct QuadsArguments {
    #[command(flatten)]
    input: MeshInput,

    /// The request of POST /v1/meshes/{id}/quads as JSON, or @FILE; vertices and faces are those of the mesh after
    /// repairs
    #[arg(long, value_name = "JSON", default_value = "{}")]
    request: String,

    /// Write the surface with texture coordinates to this OBJ file, or with another extension to a legacy VTK file
    #[arg(long, short = 'o', value_name = "FILE")]
    output: Option<PathBuf>,

    /// Write the field for Directional: FILE.rawfield, FILE.matching and FILE.sing, of the mesh that --output writes
    #[arg(long, value_name = "FILE")]
    directional: Option<PathBuf>,

    /// Print one line of JSON
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni quads fandisk.obj --request '{\"spacing\": 0.05, \"integers\": true}' -o fandisk-uv.obj
  chladni quads igea.ply --subdivide 1 --request '{\"field\": {\"aligned\": {\"creases\": null}}, \"creases\": null, \"stiffening\": 0}' --json
  chladni quads part.obj --request '{\"field\": {\"aligned\": {\"creases\": 40, \"curvature\": 10}}}' --directional part -o part.vtk";

/// Runs `chladni quads`.
pub fn quads(arguments: QuadsArguments) -> Result<ExitCode, CliError> {
    let refused = |fault: DesignFault| CliError::Refused(fault.to_string());
    let value = json_argument("--request", &arguments.request)?;
    let request: QuadsRequest =
        chladni_work::plain::read_json(&value).map_err(|error| CliError::Usage(format!("--request: {error}")))?;
    if matches!(request.field, CrossSource::Basis(_) | CrossSource::Stored(_)) {
        let reason = "--request: fields of a basis and stored fields are on a server; write it with `chladni design --form world --numbering kept` and give its rows as a table";
        return Err(CliError::Usage(reason.to_owned()));
    }
    let vtk = arguments.output.as_ref().is_some_and(|path| path.extension().is_none_or(|ending| ending != "obj"));
    let mut files = Vec::new();
    if let Some(path) = &arguments.output {
        files.push((OutputFile::probe(path)?, if vtk { QuadsFormat::Vtk } else { QuadsFormat::Obj }));
    }
    if let Some(path) = &arguments.directional {
        for (ending, format) in [
            ("rawfield", QuadsFormat::Rawfield),
            ("matching", QuadsFormat::Matching),
            ("sing", QuadsFormat::Singularities),
        ] {
            let mut name = path.clone().into_os_string();
            name.push(format!(".{ending}"));
            files.push((OutputFile::probe(&PathBuf::from(name))?, format));
        }
    }
    let mesh = arguments.input.load_body()?.surface.mesh;
    let mut surface = Surface::new(&mesh).map_err(refused)?;
    let begin = Instant::now();
    let mut split = Vec::new();
    if let Some(parts) = request.split(&surface.surface).map_err(refused)? {
        (surface, split) = (parts.surface, parts.faces);
    }
    let crosses = request.field.crosses(&surface, &Unwatched).map_err(refused)?;
    let field_seconds = begin.elapsed().as_secs_f64();
    let crosses = crosses.ok_or_else(|| CliError::Usage("--request: a field of a basis".to_owned()))?;
    let order = VertexOrder::new(&surface.surface).map_err(|error| CliError::Refused(error.to_string()))?;
    let order_seconds = begin.elapsed().as_secs_f64() - field_seconds;
    let found = request.quads(&surface.surface, crosses, &order, &Unwatched).map_err(refused)?;
    let quads_seconds = begin.elapsed().as_secs_f64() - field_seconds - order_seconds;
    for (file, format) in &files {
        file.write(|out| Ok(found.write(&surface.surface, *format, out)?))?;
    }
    let own = &found.parametrisation;
    let faces = surface.surface.faces();
    let share = own.inverted.len() as f64 / faces as f64;
    let text = if arguments.json {
        let line = json!({
            "faces": faces,
            "split": split.len(),
            "singularities": found.combed.singularities.len(),
            "cut_edges": found.combed.cut.iter().filter(|cut| **cut).count(),
            "crease_error": found.crease_error,
            "inverted": own.inverted.len(),
            "inverted_share": share,
            "deviation": own.deviation,
            "misfit": own.misfit,
            "spacing": own.spacing,
            "stiffening": own.rounds,
            "seconds": {"field": field_seconds, "order": order_seconds, "quads": quads_seconds},
        });
        format!("{line}\n")
    } else {
        let creases = found.crease_error.map_or(String::new(), |[mean, most]| {
            format!(", creases and boundaries missed by {mean:.3} degrees ({most:.1} at most)")
        });
        format!(
            "{} faces, {} singular vertices{creases}\n{} faces inverted ({:.3} %), off the field by {:.3}, in {:.2} s\n",
            grouped(faces),
            found.combed.singularities.len(),
            own.inverted.len(),
            100.0 * share,
            own.deviation,
            field_seconds + order_seconds + quads_seconds
        )
    };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
