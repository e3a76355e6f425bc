//! `quads`: a seamless parametrisation along a cross field, without a server.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use chladni_base::Unwatched;
use chladni_spectral::field::FieldSurface;
use chladni_spectral::field::quad::VertexOrder;
use chladni_spectral::formats::npz::{self, DesignedField};
use chladni_work::design::{
    CrossSource, Crosses, DesignFault, Lifted, MatchedFaces, QuadsFormat, QuadsRequest, Surface,
};
use serde_json::json;

use super::work::{OutputFile, json_argument};
use super::{CliError, MeshInput, grouped, read_bytes};

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

    /// Go along a designed field, the .npz of `chladni design`, in the place of "field" in the request; where it has
    /// exact singularities, the quads have these singular vertices and no others
    #[arg(long, value_name = "FILE")]
    field: Option<PathBuf>,

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
  chladni quads torus.ply --field field.npz -o torus-uv.obj
  chladni quads part.obj --request '{\"field\": {\"aligned\": {\"creases\": 40, \"curvature\": 10}}}' --directional part -o part.vtk";

/// The crosses of a designed field, if it is of this surface.
fn crosses(field: DesignedField, surface: &FieldSurface) -> Result<Crosses, String> {
    if field.mesh != npz::fingerprint(surface.mesh()) {
        return Err("the field was designed on another mesh".to_owned());
    }
    let pair = |(faces, turns)| MatchedFaces { faces, turns };
    let pairs = field.matching.map(|matching| matching.into_iter().map(pair).collect::<Vec<_>>());
    let on_surface = |pairs: Vec<MatchedFaces>| {
        MatchedFaces::on(&pairs, surface).ok_or("member \"matching\": it names faces that are not neighbours")
    };
    let matching = pairs.map(on_surface).transpose()?;
    let lifted = Lifted { kind: field.kind, field: field.stored, matching };
    let crosses = lifted.crosses(surface).map_err(|misfit| misfit.to_string())?;
    crosses.ok_or_else(|| {
        "fields of its kind do not define crosses: it must be of vectors, n-vectors with n 1, 2 or 4, or tensors"
            .to_owned()
    })
}

/// Runs `chladni quads`.
pub fn quads(arguments: QuadsArguments) -> Result<ExitCode, CliError> {
    let refused = |fault: DesignFault| CliError::Refused(fault.to_string());
    let value = json_argument("--request", &arguments.request)?;
    let request: QuadsRequest =
        chladni_work::plain::read_json(&value).map_err(|error| CliError::Usage(format!("--request: {error}")))?;
    if matches!(request.field, CrossSource::Basis(_) | CrossSource::Stored(_)) {
        let reason = "--request: fields of a basis and stored fields are on a server; write the field with `chladni design -o field.npz` and give it as --field field.npz";
        return Err(CliError::Usage(reason.to_owned()));
    }
    let designed = match &arguments.field {
        None => None,
        Some(_) if value.get("field").is_some() => {
            return Err(CliError::Usage(
                "--field: the request has a field already; leave out one of the two".to_owned(),
            ));
        }
        Some(path) => {
            let (bytes, _) = read_bytes(path)?;
            let read = npz::check_sums(&bytes).and_then(|()| npz::read_designed(&bytes));
            Some((path, read.map_err(|error| CliError::mesh(path, error))?))
        }
    };
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
    let crosses = match designed {
        None => request.field.crosses(&surface, &Unwatched).map_err(refused)?,
        Some((path, field)) => Some(crosses(field, &surface.surface).map_err(|reason| CliError::mesh(path, reason))?),
    };
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
