//! `field`: one basis of tangential fields, without a server.

use chladni_work::{JobParameters, SOLVER_VERSION, abbreviate};

use super::solve::{OutputFile, peak_rss_bytes};
use super::{CliError, MeshInput, StageBars, bytes, grouped, memory};
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Compute a space of locally supported tangential fields on a mesh, without a server
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct FieldArguments {
    #[command(flatten)]
    input: MeshInput,

    /// What is stored in a face
    #[arg(long, value_name = "KIND", help_heading = "Problem", value_parser = ["vector", "n_vector", "tensor"], default_value = "vector")]
    field: String,

    /// The n of n-vectors; 4 where it is not given
    #[arg(long, value_name = "N", help_heading = "Problem")]
    n: Option<u32>,

    /// Dimension of the space; where it is not given 1000, and on small meshes a quarter of the numbers of a field
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

    /// Threads; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Method")]
    threads: usize,

    /// Begin even where the estimate says that the memory will not do
    #[arg(long, help_heading = "Method")]
    ignore_memory: bool,

    /// Write the basis to this NPZ file
    #[arg(long, short = 'o', value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,

    /// Print one line of JSON instead of a few lines
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Draw no progress bars
    #[arg(long, short = 'q', help_heading = "Output")]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni field bunny.ply --dimension 2000 --output fields.npz
  chladni field bunny.ply --field n_vector --n 4 --json
  chladni field igea.ply --subdivide 1 --dimension 2000 --threads 2 --json";

impl FieldArguments {
    /// The arguments as parameters of the job `field_basis`.
    fn job(&self) -> Result<JobParameters, CliError> {
        let given = [
            ("field", Some(json!(self.field))),
            ("n", self.n.map(|value| json!(value))),
            ("dimension", self.dimension.map(|value| json!(value))),
            ("construction", self.construction.as_ref().map(|value| json!(value))),
            ("accuracy", self.accuracy.as_ref().map(|value| json!(value))),
            ("sigma", self.sigma.map(|value| json!(value))),
            ("seed", self.seed.map(|value| json!(value))),
        ];
        let parameters: Map<String, Value> =
            given.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect();
        Ok(JobParameters::parse("field_basis", &Value::Object(parameters))?)
    }
}

/// Runs `chladni field`.
pub fn field(arguments: FieldArguments) -> Result<ExitCode, CliError> {
    let job = arguments.job()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", arguments.threads)))?;
    let output = arguments.output.as_deref().map(OutputFile::probe).transpose()?;
    let bars = StageBars::new(arguments.json || arguments.quiet);
    let began = Instant::now();
    bars.begin("read");
    let mesh = pool.install(|| arguments.input.load())?;
    let read = began.elapsed().as_secs_f64();
    job.check_mesh((&mesh).into())?;
    let needed = job.memory_bytes((&mesh).into());
    if let Some(free) = memory::available().filter(|free| needed > *free && !arguments.ignore_memory) {
        return Err(CliError::Refused(format!(
            "the job needs about {needed} bytes of memory, {free} are free; ask for a smaller dimension, or go on with --ignore-memory"
        )));
    }
    let outcome = pool.install(|| job.run(&mesh, &bars))?;
    let total = began.elapsed().as_secs_f64();
    bars.finish();
    let peak = peak_rss_bytes();
    let write = match output {
        None => None,
        Some(file) => {
            let began = Instant::now();
            file.write(|out| outcome.product.write_npz(out))?;
            Some(began.elapsed().as_secs_f64())
        }
    };
    let summary = outcome.product.summary();
    let text = if arguments.json {
        let stages: Map<String, Value> =
            outcome.seconds.iter().map(|&(name, seconds)| (name.to_owned(), json!(seconds))).collect();
        let mut parameters = job.canonical();
        abbreviate(&mut parameters);
        let line = json!({
            "vertices": mesh.positions.len(),
            "faces": mesh.faces.len(),
            "dimension": summary.dimension,
            "details": summary.details,
            "parameters": parameters,
            "basis_bytes": outcome.product.stored_bytes(),
            "seconds": {"total": total, "read": read, "stages": stages, "write": write},
            "threads": pool.current_num_threads(),
            "peak_rss_bytes": peak,
            "memory_estimate_bytes": needed,
            "solver_version": SOLVER_VERSION,
            "eigenvalues": summary.eigenvalues.iter().take(20).collect::<Vec<_>>(),
        });
        format!("{line}\n")
    } else {
        let lowest: Vec<String> = summary.eigenvalues.iter().take(8).map(|value| format!("{value:.5}")).collect();
        format!(
            "{} faces, {} dimensions, {} numbers a row, {} in {total:.2} s\nlowest eigenvalues: {}\n",
            grouped(mesh.faces.len()),
            grouped(summary.dimension.unwrap_or(0)),
            summary.details["nonzeros_per_row"].as_f64().unwrap_or(0.0).round(),
            bytes(outcome.product.stored_bytes()),
            lowest.join(", ")
        )
    };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
