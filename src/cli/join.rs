//! `join`: an eigenbasis from the parts that `solve --part` wrote.

use std::collections::BTreeMap;
use std::io::{BufReader, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chladni_base::trim;
use chladni_spectral::basis::{Part, PartPlan};
use chladni_spectral::formats::{FormatError, npz};
use chladni_spectral::spectrum::hsim::parts::PartError;
use chladni_work::{JobError, JobParameters, SOLVER_VERSION};
use serde_json::Value;

use super::solve::report::Run;
use super::work::{Prepared, WorkArguments};
use super::{CliError, StageBars};

/// Join the parts of an eigenbasis that `solve --part` wrote, and certify the whole from what they carry
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct JoinArguments {
    #[command(flatten)]
    work: WorkArguments,

    /// All parts, in any order; they hold the parameters of the solve
    #[arg(value_name = "PART.npz", required = true)]
    parts: Vec<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  chladni solve igea.ply -n 1000 --tolerance 1e-6 --part 1/2 -o one.npz    on one machine
  chladni solve igea.ply -n 1000 --tolerance 1e-6 --part 2/2 -o two.npz    on another
  chladni join igea.ply one.npz two.npz -o igea.npz                       where both files are";

/// Runs `chladni join`.
pub fn join(arguments: JoinArguments) -> Result<ExitCode, CliError> {
    let JoinArguments { work, parts } = arguments;
    if !work.named.is_empty() {
        return Err(CliError::Usage(
            "--parameter: parameters are set when the parts are solved, not when they are joined".to_owned(),
        ));
    }
    let Sorted { job, parts, files } = Sorted::of(&parts)?;
    let memory = |prepared: &Prepared, bars: &StageBars| {
        let Prepared { mesh, solid, job, size, .. } = prepared;
        let exact = || Ok(job.join_memory_bytes_on(mesh, solid.as_ref(), bars)?);
        work.refuse_memory_by(job.memory_bytes(*size), exact)
    };
    let finished = work.run_by(&job.clone().into(), memory, |job, mesh, solid, bars| {
        job.join_parts(mesh, solid, parts, &mut |number| read(&files, number, parts), bars)
    })?;
    let wrong = || CliError::Service("the parts did not make an eigenbasis".to_owned());
    let run = Run::of(finished).ok_or_else(wrong)?;
    let text = if work.json { format!("{}\n", run.json(&job)) } else { run.table(&job, &work) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

/// What is to be joined, by what the files say of themselves.
struct Sorted {
    job: JobParameters,
    parts: NonZeroUsize,
    /// The file of each part.
    files: BTreeMap<usize, PathBuf>,
}

impl Sorted {
    /// Looks at the heads of files, before any work.
    fn of(paths: &[PathBuf]) -> Result<Self, CliError> {
        let mut files: BTreeMap<usize, PathBuf> = BTreeMap::new();
        let mut first: Option<(PartPlan, Value, &Path)> = None;
        for path in paths {
            let (plan, number, about) = head(path)?;
            if plan.version != SOLVER_VERSION {
                let (found, version) = (plan.version, SOLVER_VERSION.to_owned());
                return Err(refused(PartError::Version { number: number.saturating_add(1), found, version }));
            }
            match &first {
                None => first = Some((plan, about, path)),
                Some((other, asked, of)) => {
                    let differs = other.difference(&plan).or((*asked != about).then_some("its parameters differ"));
                    if let Some(reason) = differs {
                        let reason = format!("{}: {reason}, unlike {}", path.display(), of.display());
                        return Err(refused(PartError::Foreign { number: number.saturating_add(1), reason }));
                    }
                }
            }
            if let Some(twice) = files.insert(number, path.clone()) {
                let (twice, path) = (twice.display(), path.display());
                return Err(CliError::Usage(format!("{twice} and {path} are the same part, {}", number + 1)));
            }
        }
        let none = || CliError::Usage("no parts are given".to_owned());
        let (plan, about, path) = first.ok_or_else(none)?;
        let damaged = || CliError::mesh(path, "not a part written by solve --part");
        let parts = NonZeroUsize::new(plan.parts).ok_or_else(damaged)?;
        if let Some(number) = (0..plan.parts).find(|number| !files.contains_key(number)) {
            return Err(refused(PartError::Missing { number: number + 1, parts: plan.parts }));
        }
        let unsaid = || CliError::mesh(path, "this part does not say of which job it is");
        let parameters = about.get("parameters").filter(|parameters| parameters.is_object()).ok_or_else(unsaid)?;
        let job = JobParameters::parse(about["kind"].as_str().ok_or_else(unsaid)?, parameters)?;
        Ok(Self { job, parts, files })
    }
}

fn refused(error: PartError) -> CliError {
    JobError::from(error).into()
}

/// What the file of a part says of itself.
fn head(path: &Path) -> Result<(PartPlan, usize, Value), CliError> {
    let file = std::fs::File::open(path).map_err(|error| CliError::file("read", path, error))?;
    npz::read_part_head(BufReader::new(file)).map_err(|error| match error {
        FormatError::Write(error) => CliError::file("read", path, error),
        FormatError::Other { found, .. } => {
            CliError::Refused(format!("{} is {found}, not a part written by solve --part", path.display()))
        }
        error => CliError::mesh(path, format!("not a part written by solve --part: {error}")),
    })
}

/// Reads a part when it is its turn.
fn read(files: &BTreeMap<usize, PathBuf>, number: usize, parts: NonZeroUsize) -> Result<Part, PartError> {
    let missing = PartError::Missing { number: number + 1, parts: parts.get() };
    let path = files.get(&number).ok_or(missing)?;
    let damaged = |reason: String| PartError::Damaged { number: number + 1, reason };
    let bytes = std::fs::read(path).map_err(|error| damaged(format!("cannot read {}: {error}", path.display())))?;
    let (part, _) = npz::read_part(&bytes).map_err(|error| damaged(format!("{}: {error}", path.display())))?;
    // The file is as large as the part, and that of the last would lie beside the whole.
    drop(bytes);
    trim();
    Ok(part)
}
