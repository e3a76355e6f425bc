//! `chladni eigsh`: eigenpairs of matrices that someone else assembled.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use chladni_base::{Monitor, StageClock};
use chladni_spectral::basis::{Around, Basis, NearPair, PENCIL, Precision};
use chladni_spectral::formats::matrix::{MatrixFile, MatrixLimits};
use chladni_spectral::formats::npz;
use chladni_spectral::spectrum::pencil::{Mass, Parameters, Pencil, PencilError, PencilSelection, solve};
use chladni_work::SOLVER_VERSION;
use serde_json::{Map, Value, json};

use super::solve::report::{cut_of, eigenvalue_table, interval_of};
use super::solve::{finite, interval};
use super::work::{OutputFile, peak_rss_bytes, threads};
use super::{CliError, StageBars, Table, grouped, number, read_bytes};

/// Solve S x = λ M x for sparse symmetric matrices: the lowest eigenpairs, proven complete
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct EigshArguments {
    /// The matrix S: .npz of scipy.sparse.save_npz (CSR, CSC, COO, DIA, BSR), or Matrix Market; both triangles, or a
    /// symmetric .mtx
    #[arg(value_name = "S")]
    stiffness: PathBuf,

    /// The mass M, positive definite: a matrix like S, or its diagonal as .npy or an array .mtx; the identity by
    /// default
    #[arg(value_name = "M")]
    mass: Option<PathBuf>,

    /// Number of eigenpairs, the lowest ones
    #[arg(long, short = 'n', value_name = "COUNT", default_value_t = 10, help_heading = "Problem")]
    count: usize,

    /// All eigenpairs below this bound instead
    #[arg(long, value_name = "BOUND", conflicts_with = "count", allow_negative_numbers = true, value_parser = finite, help_heading = "Problem")]
    below: Option<f64>,

    /// All eigenpairs from the first number on and below the second instead; all below the second are computed
    #[arg(long, value_name = "FROM,TO", conflicts_with_all = ["count", "below"], allow_hyphen_values = true, value_parser = interval, help_heading = "Problem")]
    between: Option<[f64; 2]>,

    /// Instead of the lowest, those whose eigenvalues are nearest to this number; all below it are computed too
    #[arg(long, value_name = "SHIFT", conflicts_with_all = ["below", "between"], allow_negative_numbers = true, value_parser = finite, help_heading = "Problem")]
    around: Option<f64>,

    /// With a bound or a shift: it is an error to compute more pairs than this
    #[arg(long, value_name = "COUNT", default_value_t = 2000, help_heading = "Problem")]
    at_most: usize,

    /// Rows that are fixed at zero, by their numbers from 0: a file of whole numbers separated by spaces or newlines
    #[arg(long, value_name = "FILE", help_heading = "Problem")]
    fixed: Option<PathBuf>,

    /// Largest residual of a pair, relative to (S + cM) x; eigenvalues are accurate to about its square
    #[arg(long, value_name = "EPSILON", default_value_t = 1e-8, help_heading = "Method")]
    tolerance: f64,

    /// Seed of everything drawn at random
    #[arg(long, value_name = "SEED", default_value_t = 0, help_heading = "Method")]
    seed: u64,

    /// Threads; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Method", value_parser = threads)]
    threads: usize,

    /// Write the result to this .npz file, in the format of `solve`
    #[arg(long, short = 'o', value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,

    /// Draw no progress bars
    #[arg(long, short = 'q', help_heading = "Output")]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni eigsh S.npz M.npz -n 200 -o pairs.npz        200 lowest pairs of S x = λ M x
  chladni eigsh L.npz --below 0.5                      all below a bound
  chladni eigsh K.mtx M.mtx --fixed clamped.txt -n 20  some rows at zero
  chladni eigsh A.npz --between -0.1,0.1               around zero, with the index of the first
  chladni eigsh A.npz --around 2.5 -n 8                the eight nearest to a number";

/// What a run made and measured.
struct Run {
    basis: Basis,
    rows: usize,
    unknowns: usize,
    moved: f64,
    stages: Vec<(&'static str, f64)>,
    total: f64,
    peak_rss: Option<u64>,
    write: Option<f64>,
}

/// Runs `chladni eigsh`.
pub fn eigsh(arguments: EigshArguments) -> Result<ExitCode, CliError> {
    let run = arguments.run()?;
    let text = if arguments.json { format!("{}\n", run.json()) } else { run.table(&arguments) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

impl EigshArguments {
    fn selection(&self) -> PencilSelection {
        let most = self.at_most;
        match (self.below, self.between, self.around) {
            (Some(bound), _, _) => PencilSelection::Below { bound, most },
            (None, Some([from, to]), _) => PencilSelection::Between { from, to, most },
            (None, None, Some(shift)) => PencilSelection::Around { shift, count: self.count, most },
            (None, None, None) => PencilSelection::Count(self.count),
        }
    }

    fn run(&self) -> Result<Run, CliError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()
            .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", self.threads)))?;
        let output = self.output.as_deref().map(|path| {
            if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("npz")) {
                let reason = format!("--output {}: eigenpairs of matrices are written as .npz", path.display());
                return Err(CliError::Usage(reason));
            }
            OutputFile::probe(path)
        });
        let output = output.transpose()?;
        let bars = StageBars::new(self.json || self.quiet);
        let clock = StageClock::new(&bars);
        let began = Instant::now();
        let parameters = Parameters { selection: self.selection(), tolerance: self.tolerance, seed: self.seed };
        let basis = pool.install(|| {
            clock.stage("read");
            let pencil = self.pencil(&clock)?;
            let pairs = solve(&pencil, &parameters, &clock).map_err(|error| match error.kind() {
                "invalid-parameters" => CliError::Usage(error.to_string()),
                _ => CliError::Refused(error.to_string()),
            })?;
            let (rows, unknowns, moved) = (pencil.rows(), pencil.unknowns(), pairs.moved);
            let basis = pairs.into_basis(&pencil, Precision::F64, self.about(&parameters), &clock);
            Ok::<_, CliError>((basis.map_err(|error| CliError::Refused(error.to_string()))?, rows, unknowns, moved))
        });
        let (basis, rows, unknowns, moved) = basis?;
        let (total, peak_rss) = (began.elapsed().as_secs_f64(), peak_rss_bytes());
        let stages = clock.finish();
        bars.finish();
        let write = match output {
            None => None,
            Some(file) => {
                let began = Instant::now();
                file.write(|out| npz::write(&basis, out))?;
                Some(began.elapsed().as_secs_f64())
            }
        };
        Ok(Run { basis, rows, unknowns, moved, stages, total, peak_rss, write })
    }

    /// How the basis was made, as it is written.
    fn about(&self, parameters: &Parameters) -> Map<String, Value> {
        let selection = match parameters.selection {
            PencilSelection::Count(count) => json!({ "count": count }),
            PencilSelection::Below { bound, most } => json!({ "below": bound, "at_most": most }),
            PencilSelection::Between { from, to, most } => json!({ "between": [from, to], "at_most": most }),
            PencilSelection::Around { shift, count, most } => {
                json!({ "around": shift, "count": count, "at_most": most })
            }
        };
        let about = [
            ("kind", json!(PENCIL)),
            ("method", json!("hsim")),
            ("wanted", selection),
            ("tolerance", json!(parameters.tolerance)),
            ("seed", json!(parameters.seed)),
            ("solver_version", json!(SOLVER_VERSION)),
        ];
        about.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    fn pencil(&self, monitor: &dyn Monitor) -> Result<Pencil, CliError> {
        let stiffness = matrix(&self.stiffness)?.into_matrix();
        let mass = mass(self.mass.as_deref())?;
        let fixed = self.fixed.as_deref().map(rows).transpose()?.unwrap_or_default();
        Pencil::new(stiffness, mass, &fixed, monitor).map_err(|error| {
            let of_mass = matches!(
                error,
                PencilError::NotPositive { .. } | PencilError::NotDefinite { .. } | PencilError::NearlySingular
            );
            let file = self.mass.as_ref().filter(|_| of_mass).unwrap_or(&self.stiffness);
            CliError::mesh(file, error)
        })
    }
}

/// What pairs around a shift are, in words.
fn around_of(first: usize, around: &Around) -> String {
    let shift = number(around.shift);
    let mut text = format!("\nthe nearest to {shift}; the first has the index {first}\n");
    if !around.ties.is_empty() {
        let (kept, left): (Vec<_>, Vec<_>) = around.ties.iter().partition(|tie| tie.delivered);
        let (kept, left) = (ranges(&kept), ranges(&left));
        text += &format!("as near as one can tell: {kept}, which are listed, and {left}, which are not\n");
    }
    text
}

/// The indices of pairs, ascending, with "to" between the ends of three and more in a row.
fn ranges(pairs: &[&NearPair]) -> String {
    let runs = pairs.chunk_by(|a, b| b.index == a.index + 1);
    let words = runs.map(|run| match (run.first(), run.last()) {
        (Some(first), Some(last)) if run.len() > 2 => format!("{} to {}", first.index, last.index),
        _ => run.iter().map(|pair| pair.index.to_string()).collect::<Vec<_>>().join(", "),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// A matrix, or the diagonal of one.
pub(super) fn matrix(path: &Path) -> Result<MatrixFile, CliError> {
    let (bytes, _) = read_bytes(path)?;
    MatrixFile::read(&bytes, &MatrixLimits::default()).map_err(|error| CliError::mesh(path, error))
}

/// The mass of a file; the identity where there is none.
pub(super) fn mass(path: Option<&Path>) -> Result<Mass, CliError> {
    Ok(match path.map(matrix).transpose()? {
        None => Mass::Identity,
        Some(MatrixFile::Sparse(mass)) => Mass::Sparse(mass),
        Some(MatrixFile::Vector(diagonal)) => Mass::Diagonal(diagonal),
    })
}

/// Whole numbers with white space between them.
pub(super) fn rows(path: &Path) -> Result<Vec<u32>, CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| CliError::file("read", path, error))?;
    let number = |word: &str| word.parse().map_err(|_| CliError::mesh(path, format!("\"{word}\" is not a row")));
    text.split_whitespace().map(number).collect()
}

impl Run {
    fn json(&self) -> Value {
        let certificate = &self.basis.certificate;
        let stages: Map<String, Value> =
            self.stages.iter().map(|&(name, seconds)| (name.to_owned(), json!(seconds))).collect();
        json!({
            "rows": self.rows,
            "unknowns": self.unknowns,
            "eigenvalues": self.basis.eigenvalues,
            "certificate": certificate,
            "moved": self.moved,
            "seconds": {"total": self.total, "stages": stages, "write": self.write},
            "peak_rss_bytes": self.peak_rss,
            "solver_version": SOLVER_VERSION,
        })
    }

    fn table(&self, arguments: &EigshArguments) -> String {
        let mass = arguments.mass.as_ref().map_or_else(|| "the identity".into(), |path| path.display().to_string());
        let fixed = match self.rows - self.unknowns {
            0 => String::new(),
            fixed => format!(", {} of them fixed", grouped(fixed)),
        };
        let certificate = &self.basis.certificate;
        let mut text = format!(
            "{}: {} rows{fixed}; mass: {mass}\n{} eigenpairs to a tolerance of {:e}\n\n",
            arguments.stiffness.display(),
            grouped(self.rows),
            grouped(self.basis.eigenvalues.len()),
            arguments.tolerance,
        );
        let mut stages = Table::new(&["stage", "seconds"]);
        for (name, seconds) in &self.stages {
            stages.row([(*name).to_owned(), format!("{seconds:.3}")]);
        }
        stages.row(["total".into(), format!("{:.3}", self.total)]);
        text += &format!("{stages}\n");
        text += &eigenvalue_table(&self.basis.eigenvalues, &certificate.residuals, &[], &certificate.bounds);
        if let Some(interval) = &certificate.interval {
            text += &interval_of(certificate.first, interval);
        }
        if let Some(around) = &certificate.around {
            text += &around_of(certificate.first, around);
        }
        if let Some(cut) = certificate.cut {
            text += &cut_of(cut, certificate.first..certificate.first + self.basis.eigenvalues.len());
        }
        if self.moved != 0.0 {
            text += &format!("\nresiduals are relative to (S + cM) x with c = {}\n", number(self.moved));
        }
        text += "\ncomplete: inertia counts prove that no eigenvalue was skipped\n";
        if let (Some(path), Some(seconds)) = (&arguments.output, self.write) {
            text += &format!("written to {} in {seconds:.3} s\n", path.display());
        }
        text
    }
}
