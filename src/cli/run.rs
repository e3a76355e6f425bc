//! `run`: one job of any kind, without a server.

use std::io::Write;
use std::process::ExitCode;

use chladni_spectral::basis::ProductKind;
use chladni_work::MESH_KINDS;
use serde_json::{Map, Value};

use super::asked::Asked;
use super::work::{WorkArguments, json_argument};
use super::{CliError, Table, bytes, grouped};

/// Run one job of any kind on a mesh, without a server: the parameters are those of the API
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct RunArguments {
    /// Kind of job: eigenbasis, field_basis, operator_family, vibration_basis
    #[arg(value_name = "KIND", value_parser = kind)]
    kind: String,

    /// Parameters of the job as a JSON object, or @FILE; parameters that are absent take their defaults
    #[arg(long, value_name = "JSON", help_heading = "Method")]
    parameters: Option<String>,

    #[command(flatten)]
    work: WorkArguments,
}

/// A kind of job on a mesh; for those on something else, the command that has them.
fn kind(text: &str) -> Result<String, String> {
    if MESH_KINDS.contains(&text) {
        return Ok(text.to_owned());
    }
    Err(match ProductKind::of_name(text) {
        Some(ProductKind::PencilBasis) => "pairs of matrices are computed by `chladni eigsh`".to_owned(),
        Some(ProductKind::MapCollection) => "maps of shapes are computed by `chladni map-collection`".to_owned(),
        _ => format!("possible values: {}", MESH_KINDS.join(", ")),
    })
}

const EXAMPLES: &str = "\
Examples:
  chladni run vibration_basis plate.ply -p count=60 -p thickness=0.001 -o plate.npz
  chladni run operator_family bunny.ply --parameters '{\"dimension\": 780}' -o family.npz
  chladni run eigenbasis igea.ply --parameters @parameters.json --json";

impl RunArguments {
    fn job(&self) -> Result<Asked, CliError> {
        let given = match self.parameters.as_deref().map(|text| json_argument("--parameters", text)).transpose()? {
            None => Map::new(),
            Some(Value::Object(given)) => given,
            Some(_) => return Err(CliError::Usage("--parameters: expected a JSON object".to_owned())),
        };
        self.work.job(&self.kind, given)
    }
}

/// Runs `chladni run`.
pub fn run(arguments: RunArguments) -> Result<ExitCode, CliError> {
    let job = arguments.job()?;
    let finished = arguments.work.run(&job)?;
    let line = finished.json(&job)?;
    let text = if arguments.work.json {
        format!("{line}\n")
    } else {
        let mut stages = Table::new(&["stage", "seconds"]);
        for (name, seconds) in &finished.stages {
            stages.row([(*name).to_owned(), format!("{seconds:.3}")]);
        }
        stages.row(["total".into(), format!("{:.3}", finished.total)]);
        let values = line["eigenvalues"].as_array().map(Vec::as_slice).unwrap_or_default();
        let lowest: Vec<String> =
            values.iter().take(8).filter_map(Value::as_f64).map(|value| format!("{value:.5}")).collect();
        let size = bytes(finished.product.stored_bytes());
        let kept = match arguments.work.output {
            Some(_) => format!(", {size} stored"),
            None => format!("; its {size} are not stored, --output names a file for them"),
        };
        let mut text = format!(
            "{}: {} vertices, {} faces\n{} with {} eigenvalues{kept}\n\n{stages}\nlowest eigenvalues: {}\n",
            arguments.work.input.mesh.display(),
            grouped(finished.mesh.positions.len()),
            grouped(finished.mesh.faces.len()),
            job.kind(),
            grouped(values.len()),
            lowest.join(", ")
        );
        if let (Some(path), Some(seconds)) = (&arguments.work.output, finished.write) {
            text += &format!("written to {} in {seconds:.3} s\n", path.display());
        }
        text
    };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
