//! `verify`: a basis judged again, from its mesh alone.

use chladni_mesh::check::RepairKind;
use chladni_mesh::numbering::{Extension, Translation};
use chladni_spectral::basis::Basis;
use chladni_spectral::formats::npz;
use chladni_spectral::verify::Verification;
use chladni_work::numbered::translate_parameters;
use chladni_work::packed::Packed;
use chladni_work::verification::{JudgeError, judge, problem_of, receipt};
use chladni_work::{EigenbasisParameters, MeshSize};

use super::{CliError, MeshInput, StageBars, Table, grouped, number, seconds};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Judge an eigenbasis again, from its mesh: residuals, orthonormality, and a count of eigenvalues by another factorisation
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct VerifyArguments {
    /// Eigenbasis, as solve --output or a server writes it
    #[arg(value_name = "BASIS.npz")]
    basis: PathBuf,

    #[command(flatten)]
    input: MeshInput,

    /// Operator, where the basis does not say: as for solve
    #[arg(long, value_name = "OPERATOR", help_heading = "Problem")]
    operator: Option<String>,

    /// Write a receipt, a JSON file: what was judged, by hashes, and what was found
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "against")]
    receipt: Option<PathBuf>,

    /// Refuse files that are not those of this receipt
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    against: Option<PathBuf>,

    /// Threads; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Method")]
    threads: usize,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Draw no progress bars
    #[arg(long, short = 'q', help_heading = "Output")]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni verify bunny.npz bunny.ply
  chladni verify bunny.npz bunny.ply --receipt bunny.receipt.json     something to cite
  chladni verify bunny.npz bunny.ply --against bunny.receipt.json     the same files, to the last bit?

Exit codes: 0 everything is as the basis says; 1 something is not, or the files are not those of the receipt.";

/// Findings that a table lists; JSON has all.
const MOST_LISTED: usize = 20;

/// Runs `chladni verify`.
pub fn verify(arguments: VerifyArguments) -> Result<ExitCode, CliError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", arguments.threads)))?;
    let bars = StageBars::new(arguments.json || arguments.quiet);
    let began = Instant::now();
    bars.begin("read");
    let read = |path: &Path| std::fs::read(path).map_err(|error| CliError::file("read", path, error));
    let bytes = read(&arguments.basis)?;
    let hashes = json!({
        "basis": blake3::hash(&bytes).to_hex().as_str(),
        "mesh": blake3::hash(&read(&arguments.input.mesh)?).to_hex().as_str(),
    });
    if let Some(path) = &arguments.against {
        let text = read(path)?;
        let receipt: Value = serde_json::from_slice(&text)
            .map_err(|error| CliError::Usage(format!("{}: this is no receipt: {error}", path.display())))?;
        for file in ["basis", "mesh"] {
            let claimed = &receipt["hashes"][file];
            if file == "mesh" && is_id(claimed) {
                eprintln!("{}: it names the mesh by its id on a server; the file is not compared", path.display());
            } else if *claimed != hashes[file] {
                return Err(CliError::Refused(format!("the {file} is not the one of {}", path.display())));
            }
        }
    }
    let unreadable = |error: String| CliError::Refused(format!("{}: {error}", arguments.basis.display()));
    pool.install(|| npz::check_sums(&bytes)).map_err(|error| unreadable(error.to_string()))?;
    let basis = npz::read(&bytes).map_err(|error| unreadable(error.to_string()))?;
    drop(bytes);
    let mut parameters = parameters(&basis, arguments.operator.as_deref())?;
    let body = pool.install(|| arguments.input.load_body())?;
    let (checked, solid) = (body.surface, body.solid);
    let turned = checked.report.repaired(RepairKind::FlippedFaces);
    let file = Translation::of_file(Arc::new(checked.numbering), Extension::None).turning(turned);
    let mesh = checked.mesh;
    if arguments.operator.is_some() {
        // A potential that is given here is given as the file numbers its vertices.
        let mut own = Packed::from(&parameters.canonical());
        translate_parameters(&mut own, &file, MeshSize::from(&mesh))?;
        parameters = EigenbasisParameters::read(&own)?;
    }
    let outcome = pool.install(|| {
        judge(&basis, &mesh, solid.as_ref(), &parameters, &bars).map_err(|error| match error {
            JudgeError::Operator(error) => CliError::from(error),
            other => unreadable(other.to_string()),
        })
    })?;
    let total = began.elapsed().as_secs_f64();
    bars.finish();
    let receipt = receipt(&basis, &parameters, &outcome, (&hashes, "BLAKE3 of the files"), total);
    if let Some(path) = &arguments.receipt {
        std::fs::write(path, format!("{receipt:#}\n")).map_err(|error| CliError::file("write", path, error))?;
    }
    let text = if arguments.json { format!("{receipt}\n") } else { page(&basis, &outcome, total) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(if outcome.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Whether a receipt names its mesh as a server does: by the id, 32 hexadecimal digits, which is no hash of a file.
fn is_id(claimed: &Value) -> bool {
    claimed.as_str().is_some_and(|id| id.len() == ID_DIGITS && id.bytes().all(|digit| digit.is_ascii_hexdigit()))
}

/// Hexadecimal digits of the id of a mesh.
const ID_DIGITS: usize = 32;

/// The problem that the basis is said to solve.
fn parameters(basis: &Basis, operator: Option<&str>) -> Result<EigenbasisParameters, CliError> {
    let operator = operator.map(super::solve::operator).transpose()?;
    let told = operator.is_some();
    problem_of(basis, operator).map_err(|error| match told {
        true => error.into(),
        false => CliError::Usage(format!("{error}; name it with --operator")),
    })
}

/// The same for people.
fn page(basis: &Basis, outcome: &Verification, total: f64) -> String {
    // Nothing is measured where sizes do not fit.
    let measured = |value: f64| if outcome.residuals.is_empty() { "–".to_owned() } else { number(value) };
    let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(*value));
    let mut table = Table::new(&["verified", ""]);
    let complete = match outcome.proven {
        Some(proven) if proven == basis.count() => "yes, none is missing".to_owned(),
        Some(proven) => format!("the lowest {} are, the rest is one cluster", grouped(proven)),
        None if basis.certificate.complete == Some(true) && basis.certificate.accuracy.is_some() => {
            "the count is confirmed; bounds of approximate pairs are not derived again".to_owned()
        }
        None if basis.certificate.complete == Some(true) => "not confirmed".to_owned(),
        None => "the basis does not claim it".to_owned(),
    };
    for (name, value) in [
        ("pairs", grouped(basis.count())),
        ("complete", complete),
        ("largest residual", measured(largest(&outcome.residuals))),
        ("orthonormality defect", measured(outcome.orthonormality_defect)),
        ("time", seconds(total)),
    ] {
        table.row([name.to_owned(), value]);
    }
    let mut text = format!("{table}\n");
    for count in &outcome.counts {
        let claimed = count.claimed.map_or(String::new(), |claimed| format!(" (the basis says {})", grouped(claimed)));
        text += &format!("{} eigenvalues lie below {}{claimed}\n", grouped(count.below), number(count.shift));
    }
    if outcome.findings.is_empty() {
        text += "everything is as the basis says\n";
    }
    for finding in outcome.findings.iter().take(MOST_LISTED) {
        text += &format!("wrong: {finding}\n");
    }
    if let Some(more @ 1..) = outcome.findings.len().checked_sub(MOST_LISTED) {
        text += &format!("and {} more; --json lists all\n", grouped(more));
    }
    text
}
