//! `field`: one basis of tangential fields, without a server.

use std::io::Write;
use std::process::ExitCode;

use serde_json::{Value, json};

use super::asked::Asked;
use super::work::{WorkArguments, given};
use super::{CliError, bytes, grouped};

/// Compute a space of locally supported tangential fields on a mesh, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct FieldArguments {
    #[command(flatten)]
    work: WorkArguments,

    /// What is stored in each face
    #[arg(long, value_name = "KIND", help_heading = "Problem", value_parser = ["vector", "n_vector", "tensor"], default_value = "vector")]
    field: String,

    /// The n of n-vectors; 4 by default
    #[arg(long, value_name = "N", help_heading = "Problem")]
    n: Option<u32>,

    /// Dimension of the space; by default 1000, and on small meshes a quarter of the numbers of a field
    #[arg(long, short = 'd', value_name = "D", help_heading = "Problem")]
    dimension: Option<usize>,

    /// How the space is built: heat is more accurate, local_eigenfields is the construction of the thesis
    #[arg(long, value_name = "NAME", help_heading = "Method", value_parser = ["heat", "local_eigenfields"])]
    construction: Option<String>,

    /// How far the heat construction goes
    #[arg(long, value_name = "LEVEL", help_heading = "Method", value_parser = ["standard", "accurate"])]
    accuracy: Option<String>,

    /// The size of supports
    #[arg(long, value_name = "SIGMA", help_heading = "Method")]
    sigma: Option<f64>,

    /// Seed of the first sample
    #[arg(long, value_name = "SEED", help_heading = "Method")]
    seed: Option<u64>,
}

const EXAMPLES: &str = "\
Examples:
  chladni field bunny.ply --dimension 2000 --output fields.npz
  chladni field bunny.ply --field n_vector --n 4 --json
  chladni field igea.ply --subdivide 1 --dimension 2000 --threads 2 --json";

impl FieldArguments {
    /// The arguments as parameters of the job `field_basis`.
    fn job(&self) -> Result<Asked, CliError> {
        let given = given([
            ("field", Some(json!(self.field))),
            ("n", self.n.map(|value| json!(value))),
            ("dimension", self.dimension.map(|value| json!(value))),
            ("construction", self.construction.as_ref().map(|value| json!(value))),
            ("accuracy", self.accuracy.as_ref().map(|value| json!(value))),
            ("sigma", self.sigma.map(|value| json!(value))),
            ("seed", self.seed.map(|value| json!(value))),
        ]);
        self.work.job("field_basis", given)
    }
}

/// Runs `chladni field`.
pub fn field(arguments: FieldArguments) -> Result<ExitCode, CliError> {
    let job = arguments.job()?;
    let finished = arguments.work.run(&job)?;
    let summary = finished.product.summary().map_err(|error| CliError::stdout(error.into()))?;
    let text = if arguments.work.json {
        let mut line = finished.json(&job)?;
        line["eigenvalues"] = summary.eigenvalues.iter().take(20).copied().collect();
        line["certificate"] = summary.certificate;
        format!("{line}\n")
    } else {
        let lowest: Vec<String> = summary.eigenvalues.iter().take(8).map(|value| format!("{value:.5}")).collect();
        format!(
            "{} faces, {} dimensions, {} numbers a row, {} in {:.2} s\nlowest eigenvalues: {}\n{}",
            grouped(finished.mesh.faces.len()),
            grouped(summary.dimension.unwrap_or(0)),
            summary.details["nonzeros_per_row"].as_f64().unwrap_or(0.0).round(),
            bytes(finished.product.stored_bytes()),
            finished.total,
            lowest.join(", "),
            errors(&summary.certificate)
        )
    };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

/// How far the lowest eigenvalues are off, as a line.
fn errors(certificate: &Value) -> String {
    let accuracy = &certificate["accuracy"];
    let Some(largest) = accuracy["largest_estimate"].as_f64() else { return String::new() };
    let judged = certificate["estimates"].as_array().map_or(0, Vec::len);
    let usual = match accuracy["reached"] == json!(true) {
        true => "",
        false => ": these are eigenfields of the space, and not of the surface",
    };
    format!("too large by about {:.2} % at most, of the lowest {judged}{usual}\n", 100.0 * largest)
}
