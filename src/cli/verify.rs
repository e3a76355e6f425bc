//! `verify`: a basis judged again, from its mesh or its matrices alone.

use chladni_mesh::TetMesh;
use chladni_mesh::check::{CheckedMesh, RepairKind};
use chladni_mesh::numbering::{Extension, Translation};
use chladni_mesh::solid::CheckedBody;
use chladni_spectral::basis::modal::ModalBasis;
use chladni_spectral::basis::{Basis, ProductKind};
use chladni_spectral::formats::npz;
use chladni_spectral::spectrum::pencil::Matrices;
use chladni_spectral::verify::{Finding, Verification};
use chladni_work::numbered::translate_parameters;
use chladni_work::packed::Packed;
use chladni_work::verification::{
    JudgeError, judge, judge_modes, judge_pencil, modes_receipt, pencil_receipt, problem_of, receipt, vibration_of,
};
use chladni_work::{EigenbasisParameters, MeshSize, ParameterError, VibrationBasisParameters, Work};

use super::asked::without_gaps;
use super::eigsh::{mass, matrix, rows};
use super::stored::kind_of;
use super::{CliError, MeshInput, StageBars, Table, grouped, number, seconds};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Verify eigenpairs again from their mesh or their matrices: residuals, orthonormality, and a count of eigenvalues by
/// another factorisation
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct VerifyArguments {
    /// The result, as written by solve, run, eigsh or a server: an eigenbasis (of fields as well), vibration modes, or
    /// pairs of matrices, for which MESH is the matrix S
    #[arg(value_name = "BASIS.npz")]
    basis: PathBuf,

    #[command(flatten)]
    input: MeshInput,

    /// Operator, if the basis does not say: as for solve
    #[arg(long, value_name = "OPERATOR", help_heading = "Problem")]
    operator: Option<String>,

    /// The mass of pairs of matrices, if they had one: as for eigsh
    #[arg(long, value_name = "M", help_heading = "Problem")]
    mass: Option<PathBuf>,

    /// What is held fixed, if the basis does not list it: rows of matrices, or clamped vertices of a vibration, by
    /// their numbers from 0; a file of whole numbers
    #[arg(long, value_name = "FILE", help_heading = "Problem")]
    fixed: Option<PathBuf>,

    /// Write a receipt, a JSON file: what was verified, by hashes, and what was found
    #[arg(long, value_name = "FILE", help_heading = "Output", conflicts_with = "against")]
    receipt: Option<PathBuf>,

    /// Refuse files other than those of this receipt
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
  chladni verify modes.npz bell.ply                                   modes of run vibration_basis
  chladni verify pairs.npz S.npz --mass M.npz                         pairs of eigsh

Exit codes: 0 everything is as the basis claims; 1 something is not, or the files are not those of the receipt.";

/// Findings that a table lists; JSON has all.
const MOST_LISTED: usize = 20;

/// What was judged, and how it came out.
struct Judged {
    outcome: Verification,
    /// What is to be cited, but for the seconds.
    receipt: Value,
    pairs: usize,
    /// Whether the basis claims that no eigenvalue is missing.
    complete: bool,
    /// Whether it is of an approximation, with enclosures by index.
    approximate: bool,
}

/// What a file holds.
enum Stored {
    Eigenbasis(Basis),
    Pencil(Basis),
    Modes(ModalBasis),
}

/// Runs `chladni verify`.
pub fn verify(arguments: VerifyArguments) -> Result<ExitCode, CliError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads)
        .build()
        .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", arguments.threads)))?;
    let bars = StageBars::new(arguments.json || arguments.quiet);
    let began = Instant::now();
    bars.begin("read");
    let mut judged = pool.install(|| arguments.judge(&bars))?;
    let total = began.elapsed().as_secs_f64();
    bars.finish();
    judged.receipt["seconds"] = json!(total);
    let receipt = &judged.receipt;
    if let Some(path) = &arguments.receipt {
        std::fs::write(path, format!("{receipt:#}\n")).map_err(|error| CliError::file("write", path, error))?;
    }
    let text = if arguments.json { format!("{receipt}\n") } else { text_report(&judged, total) };
    std::io::stdout().write_all(text.as_bytes()).map_err(CliError::stdout)?;
    Ok(if judged.outcome.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

impl VerifyArguments {
    fn judge(&self, bars: &StageBars) -> Result<Judged, CliError> {
        let bytes = read(&self.basis)?;
        let basis_hash = hash(&bytes);
        if let Some(path) = &self.against {
            // A file that is not the one of the receipt need not be readable.
            compare(path, &json!({ "basis": basis_hash }))?;
        }
        let stored = self.stored(&bytes)?;
        let is_pencil = matches!(stored, Stored::Pencil(_));
        self.refuse_misfits(&stored)?;
        let other = if is_pencil { "stiffness" } else { "mesh" };
        let mut hashes = json!({ "basis": basis_hash, other: hash(&read(&self.input.mesh)?) });
        if let Some(path) = &self.mass {
            hashes["mass"] = json!(hash(&read(path)?));
        }
        drop(bytes);
        if let Some(path) = &self.against {
            compare(path, &hashes)?;
        }
        let hashes = (&hashes, "BLAKE3 of the files");
        match stored {
            Stored::Eigenbasis(basis) => self.judge_eigenbasis(&basis, hashes, bars),
            Stored::Pencil(basis) => self.judge_pencil(&basis, hashes, bars),
            Stored::Modes(modes) => self.judge_modes(&modes, hashes, bars),
        }
    }

    fn unreadable(&self, error: impl std::fmt::Display) -> CliError {
        CliError::Refused(format!("{}: {error}", self.basis.display()))
    }

    fn unjudged(&self, error: JudgeError) -> CliError {
        match error {
            JudgeError::Operator(error) => CliError::from(error),
            other => self.unreadable(other),
        }
    }

    fn stored(&self, bytes: &[u8]) -> Result<Stored, CliError> {
        npz::check_sums(bytes).map_err(|error| self.unreadable(error))?;
        let basis = match npz::read(bytes) {
            Ok(basis) => basis,
            // Modes have members of their own; of what is neither, the first message tells more.
            Err(error) => {
                let unjudged = || match kind_of(bytes) {
                    Some(kind) => self.unreadable(format!(
                        "results of kind {kind} have no eigenpairs to verify; only the kinds {} can be verified",
                        JUDGED.map(ProductKind::name).join(", ")
                    )),
                    None => self.unreadable(&error),
                };
                return npz::read_modes(bytes).map(Stored::Modes).map_err(|_| unjudged());
            }
        };
        Ok(if basis.metadata.is_of_pencil() { Stored::Pencil(basis) } else { Stored::Eigenbasis(basis) })
    }

    /// Options that say nothing about what is there.
    fn refuse_misfits(&self, stored: &Stored) -> Result<(), CliError> {
        let (is_eigenbasis, is_pencil) = (matches!(stored, Stored::Eigenbasis(_)), matches!(stored, Stored::Pencil(_)));
        for (given, option, fits, of) in [
            (self.operator.is_some(), "--operator", is_eigenbasis, "an eigenbasis"),
            (self.mass.is_some(), "--mass", is_pencil, "pairs of matrices"),
            (self.fixed.is_some(), "--fixed", !is_eigenbasis, "pairs of matrices and vibration modes"),
        ] {
            if given && !fits {
                let what = match stored {
                    Stored::Eigenbasis(_) => "an eigenbasis of a mesh",
                    Stored::Pencil(_) => "pairs of matrices",
                    Stored::Modes(_) => "vibration modes",
                };
                let reason = format!("{option} is for {of}; {} holds {what}", self.basis.display());
                return Err(CliError::Usage(reason));
            }
        }
        Ok(())
    }

    fn judge_eigenbasis(&self, basis: &Basis, hashes: (&Value, &str), bars: &StageBars) -> Result<Judged, CliError> {
        let mut parameters = parameters(basis, self.operator.as_deref())?;
        let CheckedBody { surface, solid } = self.input.load_body()?;
        if self.operator.is_some() {
            // A potential that is given here is given as the file numbers its vertices.
            let mut own = Packed::from(&parameters.canonical());
            if let (Some(operator), Some(own)) = (self.operator.as_deref(), own.get_mut("operator")) {
                *own = Packed::from(&super::solve::operator(operator)?);
            }
            let own = of_the_file(own, &surface, solid.as_ref())?;
            parameters = EigenbasisParameters::read(&own)?;
        }
        let outcome = judge(basis, &surface.mesh, solid.as_ref(), &parameters, bars);
        let outcome = outcome.map_err(|error| self.unjudged(error))?;
        Ok(Judged {
            receipt: receipt(basis, &parameters, &outcome, hashes, 0.0),
            outcome,
            pairs: basis.count(),
            complete: basis.certificate.complete == Some(true),
            approximate: basis.certificate.accuracy.is_some(),
        })
    }

    fn judge_pencil(&self, basis: &Basis, hashes: (&Value, &str), bars: &StageBars) -> Result<Judged, CliError> {
        let stiffness = matrix(&self.input.mesh)?.into_matrix();
        let matrices = Matrices::new(stiffness, mass(self.mass.as_deref())?)
            .map_err(|error| CliError::mesh(&self.input.mesh, error))?;
        let fixed = match &self.fixed {
            Some(path) => rows(path)?,
            None => self.listed(basis)?,
        };
        let outcome = judge_pencil(basis, &matrices, &fixed, bars).map_err(|error| self.unjudged(error))?;
        Ok(Judged {
            receipt: pencil_receipt(basis, &matrices, !fixed.is_empty(), &outcome, hashes, 0.0),
            outcome,
            pairs: basis.count(),
            complete: basis.certificate.complete == Some(true),
            approximate: false,
        })
    }

    /// The rows that are held, where the basis lists them.
    fn listed(&self, basis: &Basis) -> Result<Vec<u32>, CliError> {
        match basis.metadata.fixed_rows().map_err(|error| self.unreadable(error))? {
            (_, Some(listed)) => Ok(listed.to_vec()),
            (held, None) => {
                let reason = format!(
                    "{} was solved with some rows held ({}), and does not list them; give them with --fixed",
                    self.basis.display(),
                    grouped(held)
                );
                Err(CliError::Usage(reason))
            }
        }
    }

    fn judge_modes(&self, modes: &ModalBasis, hashes: (&Value, &str), bars: &StageBars) -> Result<Judged, CliError> {
        let clamped = self.fixed.as_deref().map(rows).transpose()?;
        let mut parameters = vibration_of(modes, clamped).map_err(|error| match error {
            ParameterError::Value { name: "clamped", .. } => {
                CliError::Usage(format!("{error}; list the clamped vertices with --fixed"))
            }
            error => self.unreadable(error),
        })?;
        let CheckedBody { surface, solid } = self.input.load_body()?;
        if self.fixed.is_some() {
            let own = of_the_file(Packed::from(&parameters.canonical()), &surface, solid.as_ref())?;
            parameters = VibrationBasisParameters::read(&own)?;
        }
        let outcome = judge_modes(modes, &surface.mesh, solid.as_ref(), &parameters, bars);
        let outcome = outcome.map_err(|error| self.unjudged(error))?;
        Ok(Judged {
            receipt: modes_receipt(modes, &parameters, &outcome, hashes, 0.0),
            outcome,
            pairs: modes.count(),
            complete: modes
                .metadata
                .modes_claim()
                .map_err(|error| self.unreadable(error))?
                .is_some_and(|claim| claim.complete),
            approximate: false,
        })
    }
}

/// Parameters that name vertices as the file does, as they are in the mesh that is kept of it.
fn of_the_file(mut own: Packed, surface: &CheckedMesh, solid: Option<&TetMesh>) -> Result<Packed, CliError> {
    let turned = surface.report.repaired(RepairKind::FlippedFaces);
    let file = Translation::of_file(Arc::new(surface.numbering.clone()), Extension::None).turning(turned);
    translate_parameters(&mut own, &file, MeshSize::of_body(&surface.mesh, solid))?;
    Ok(own)
}

/// What is verified.
const JUDGED: [ProductKind; 3] = [ProductKind::Eigenbasis, ProductKind::PencilBasis, ProductKind::VibrationBasis];

fn read(path: &Path) -> Result<Vec<u8>, CliError> {
    std::fs::read(path).map_err(|error| CliError::file("read", path, error))
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Refuses files that are not those of the receipt.
fn compare(path: &Path, hashes: &Value) -> Result<(), CliError> {
    let receipt: Value = serde_json::from_slice(&read(path)?)
        .map_err(|error| CliError::Usage(format!("{}: not a receipt: {error}", path.display())))?;
    for (file, found) in hashes.as_object().into_iter().flatten() {
        let claimed = &receipt["hashes"][file];
        let id = if file == "stiffness" { &receipt["hashes"]["problem"] } else { claimed };
        if file != "basis" && is_id(id) {
            let what = if file == "mesh" { "mesh" } else { "problem" };
            eprintln!("{}: it names the {what} by its id on a server; the file is not compared", path.display());
        } else if claimed != found {
            return Err(CliError::Refused(format!("the {file} is not the one of {}", path.display())));
        }
    }
    Ok(())
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
    // Where it has no value at dropped vertices, any will do until the mesh is known.
    let operator = operator.map(|operator| {
        let mut filled = without_gaps(&json!({ "operator": operator }));
        filled.as_mut().map_or(operator, |filled| filled["operator"].take())
    });
    let told = operator.is_some();
    problem_of(basis, operator).map_err(|error| match told {
        true => error.into(),
        false if matches!(error, ParameterError::Value { name: "operator", .. }) => {
            CliError::Usage(format!("{error}; name it with --operator"))
        }
        false => error.into(),
    })
}

/// The same for people.
fn text_report(judged: &Judged, total: f64) -> String {
    let Judged { outcome, pairs, .. } = judged;
    // Nothing is measured where sizes do not fit.
    let measured = |value: f64| if outcome.residuals.is_empty() { "–".to_owned() } else { number(value) };
    let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(*value));
    let mut table = Table::new(&["verified", ""]);
    let complete = match outcome.proven {
        Some(proven) if proven == *pairs => "yes, none is missing".to_owned(),
        Some(proven) => format!("the lowest {} are, the rest is one cluster", grouped(proven)),
        None if judged.complete && judged.approximate => {
            "the count is confirmed; bounds of approximate pairs are not derived again".to_owned()
        }
        None if judged.complete => "not confirmed".to_owned(),
        None => "the basis does not claim it".to_owned(),
    };
    for (name, value) in [
        ("pairs", grouped(*pairs)),
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
        let lie = if count.below == 1 { "eigenvalue lies" } else { "eigenvalues lie" };
        text += &format!("{} {lie} below {}{claimed}\n", grouped(count.below), number(count.shift));
    }
    if outcome.findings.is_empty() {
        text += "everything is as the basis says\n";
    }
    for finding in outcome.findings.iter().take(MOST_LISTED) {
        let kind = if matches!(finding, Finding::Unconfirmed { .. }) { "unconfirmed" } else { "wrong" };
        text += &format!("{kind}: {finding}\n");
    }
    if let Some(more @ 1..) = outcome.findings.len().checked_sub(MOST_LISTED) {
        text += &format!("and {} more; --json lists all\n", grouped(more));
    }
    text
}
