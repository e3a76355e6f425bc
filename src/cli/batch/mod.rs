//! `batch`: every mesh of a folder, several at once; what is there already is left alone.

mod claims;
mod memory;
mod operators;
mod progress;
mod settings;

use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use chladni_base::Unwatched;
use chladni_mesh::check::{CheckOptions, Merge};
use chladni_mesh::read::MeshFormat;
use chladni_spectral::basis::{Product, ProductKind};
use chladni_spectral::formats::npz;
use chladni_work::{JobParameters, MESH_KINDS, SOLVER_VERSION};
use serde_json::{Value, json};

use self::claims::Claims;
use self::memory::Promises;
use self::progress::{Lines, Outcome};
use super::asked::Asked;
use super::input::MeshOptions;
use super::work::{OutputFile, insert_named, prepared};
use super::{CliError, MeshInput, NumberingArguments, seconds};

/// Compute something for every mesh of a folder, without a server: operators for learning, or any kind of job
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct BatchArguments {
    /// Folder with mesh files, of any supported format except NPZ and JSON, plain or compressed with gzip; subfolders
    /// are left alone
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,

    /// What is computed: operators (frames, mass, Laplacian, eigenpairs and gradients, as a cache for DiffusionNet), or
    /// a kind of job: eigenbasis, field_basis, operator_family, vibration_basis
    #[arg(long, value_name = "KIND", value_parser = kind)]
    kind: String,

    /// Folder for the results; created if missing
    #[arg(long, short = 'o', value_name = "FOLDER")]
    output: PathBuf,

    /// Eigenpairs of each mesh (operators, eigenbasis, vibration_basis); 128 for operators, else the default of the job
    #[arg(long, short = 'n', value_name = "M")]
    count: Option<usize>,

    /// Any parameter of the job by name, as the API takes it; may be given several times
    #[arg(long = "parameter", short = 'p', value_name = "NAME=VALUE")]
    named: Vec<String>,

    /// Number of meshes to work on at once, each with one thread; 0 for one per core
    #[arg(long, short = 'j', value_name = "N", default_value_t = 0)]
    jobs: usize,

    /// Whether vertices at equal positions become one: auto (where the format splits them, as STL does), always, never
    #[arg(long, value_name = "WHEN", value_parser = super::input::merge, default_value = "auto")]
    merge: Merge,

    /// Recompute existing results
    #[arg(long)]
    anew: bool,

    /// Print a line of JSON for each mesh
    #[arg(long)]
    json: bool,

    /// Draw no progress bar
    #[arg(long, short = 'q')]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni batch shapes --kind operators -o op_cache     for DiffusionNet's op_cache_dir=\"op_cache\"
  chladni batch scans --kind eigenbasis -n 200 -p method=hsim -o bases
  chladni batch plates --kind vibration_basis -p thickness=0.001 -o modes --jobs 4 --json

A result appears under its name only when it is complete; an interrupted run continues when started again.
Operators are named by a hash of positions and faces, everything else by the file of the mesh.

Exit codes: 0 all results are there; 1 some meshes failed, each with a line that says why; 2 wrong
usage; 3 a folder cannot be read or written.";

fn kind(text: &str) -> Result<String, String> {
    if text == "operators" || MESH_KINDS.contains(&text) {
        return Ok(text.to_owned());
    }
    Err(format!("possible values: operators, {}", MESH_KINDS.join(", ")))
}

/// What is computed of each mesh.
enum Computed {
    Operators { pairs: usize },
    Job(Box<Asked>),
}

impl BatchArguments {
    /// What is wanted, and all of it that a result depends on.
    fn task_and_settings(&self) -> Result<(Computed, Value), CliError> {
        let mut given = serde_json::Map::new();
        if let Some(count) = self.count {
            given.insert("count".to_owned(), json!(count));
        }
        insert_named(&mut given, &self.named)?;
        let (wanted, parameters) = if self.kind == "operators" {
            if !self.named.is_empty() {
                return Err(CliError::Usage("--parameter is for kinds of job; operators take only --count".to_owned()));
            }
            let pairs = self.count.unwrap_or(operators::PAIRS);
            if pairs == 0 {
                return Err(CliError::Usage("--count 0: at least one eigenpair is required".to_owned()));
            }
            (Computed::Operators { pairs }, json!({"count": pairs}))
        } else {
            let job = Asked::parse(&self.kind, &Value::Object(given))?;
            let parameters = job.canonical();
            (Computed::Job(Box::new(job)), parameters)
        };
        let settings = json!({
            "kind": self.kind, "parameters": parameters, "merge": self.merge, "solver_version": SOLVER_VERSION,
        });
        Ok((wanted, settings))
    }

    /// The meshes of the folder, by name.
    fn meshes(&self) -> Result<Vec<PathBuf>, CliError> {
        let failed = |error| CliError::file("read", &self.folder, error);
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            // A link that leads nowhere is a mesh that cannot be read, not one that is left out.
            if !path.is_dir() && is_mesh(&path) {
                found.push(path);
            }
        }
        found.sort();
        if found.is_empty() {
            return Err(CliError::Usage(format!("{}: there is no mesh file in this folder", self.folder.display())));
        }
        Ok(found)
    }

    /// Whether a result was made since the settings of the folder are these.
    fn is_current(&self, result: &Path) -> bool {
        is_newer(result, &settings::file(&self.output))
    }

    fn input(&self, mesh: &Path) -> MeshInput {
        let CheckOptions { surface, .. } = CheckOptions::default();
        let how = MeshOptions { format: None, merge: self.merge, surface, subdivide: 0 };
        MeshInput { mesh: mesh.to_owned(), how }
    }
}

/// By its name; archives and JSON may be anything.
fn is_mesh(path: &Path) -> bool {
    let bare = path.extension().filter(|ending| ending.eq_ignore_ascii_case("gz")).map(|_| path.with_extension(""));
    let ending = bare.as_deref().unwrap_or(path).extension();
    let format = ending.and_then(|ending| MeshFormat::from_extension(ending.to_str()?));
    format.is_some_and(|format| !matches!(format, MeshFormat::Npz | MeshFormat::Json))
}

/// Runs `chladni batch`.
pub fn batch(arguments: BatchArguments) -> Result<ExitCode, CliError> {
    let (wanted, settings) = arguments.task_and_settings()?;
    let meshes = arguments.meshes()?;
    fs::create_dir_all(&arguments.output).map_err(|error| CliError::file("write", &arguments.output, error))?;
    settings::keep(&arguments.output, &settings, arguments.anew)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let at_once = if arguments.jobs == 0 { cores } else { arguments.jobs }.min(meshes.len());
    let lines = Lines::new(meshes.len(), arguments.json, arguments.quiet);
    let (next, shared) = (AtomicUsize::new(0), Shared::default());
    let broken: Mutex<Option<CliError>> = Mutex::new(None);
    let began = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..at_once {
            scope.spawn(|| {
                let result = worker(&arguments, &wanted, &meshes, &next, &shared, &lines);
                if let Err(error) = result {
                    // Nothing else can be told to whoever asks: the others stop as well.
                    next.store(meshes.len(), Ordering::Relaxed);
                    broken.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(error);
                }
            });
        }
    });
    if let Some(error) = broken.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        // Elsewhere a closed pipe means that the reader has all that it wanted; here meshes are left.
        let cut = error.is_closed_pipe();
        return Err(if cut { CliError::Service(format!("ended before the last mesh: {error}")) } else { error });
    }
    let failed = lines.finish(&seconds(began.elapsed().as_secs_f64()))?;
    Ok(ExitCode::from(u8::from(failed > 0)))
}

/// What the workers share.
#[derive(Debug, Default)]
struct Shared {
    promises: Promises,
    claims: Claims,
}

/// Takes meshes until there are none left.
fn worker(
    arguments: &BatchArguments,
    wanted: &Computed,
    meshes: &[PathBuf],
    next: &AtomicUsize,
    shared: &Shared,
    lines: &Lines,
) -> Result<(), CliError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|error| CliError::Service(format!("cannot start a thread: {error}")))?;
    while let Some(mesh) = meshes.get(next.fetch_add(1, Ordering::Relaxed)) {
        let began = Instant::now();
        let outcome = pool.install(|| match wanted {
            // A pipe or a device could be waited for without end.
            _ if fs::metadata(mesh).is_ok_and(|found| !found.is_file()) => {
                Err(CliError::mesh(mesh, "it is not a regular file"))
            }
            Computed::Operators { pairs } => operators::run_on_mesh(arguments, mesh, *pairs, shared),
            Computed::Job(job) => run_on_mesh(arguments, mesh, job, &shared.promises),
        });
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err(error) if fails_for_all(&error, &arguments.output) => return Err(error),
            Err(error) => Outcome::Failed(message(&error, mesh)),
        };
        lines.report(mesh, &outcome, began.elapsed().as_secs_f64())?;
    }
    Ok(())
}

/// Whether no other result could be written either: the disk is full or read-only, or the folder is gone.
fn fails_for_all(error: &CliError, folder: &Path) -> bool {
    let CliError::Io { action: "write", source, .. } = error else { return false };
    match source.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::ReadOnlyFilesystem => true,
        ErrorKind::NotFound => !folder.is_dir(),
        _ => false,
    }
}

/// The reason alone: the line begins with the name.
fn message(error: &CliError, mesh: &Path) -> String {
    let whole = error.to_string();
    whole.strip_prefix(&format!("{}: ", mesh.display())).unwrap_or(&whole).to_owned()
}

/// Runs a job on a mesh, unless its result is there, whole, and no older than the mesh and the settings.
fn run_on_mesh(arguments: &BatchArguments, mesh: &Path, job: &Asked, promises: &Promises) -> Result<Outcome, CliError> {
    let path = arguments.output.join(result_name(mesh));
    if !arguments.anew
        && arguments.is_current(&path)
        && is_newer_than_mesh(&path, mesh)
        && is_whole(&path, job, promises)?
    {
        return Ok(Outcome::There(path));
    }
    let file = OutputFile::probe(&path)?;
    let body = arguments.input(mesh).load_body()?;
    let (job, size, numbering) = prepared(&body, job, &NumberingArguments::default())?;
    let _promise = promises.take(job.memory_bytes(size))?;
    let outcome = job.run_body(&body.surface.mesh, body.solid.as_ref(), &Unwatched)?;
    file.write(|out| outcome.product.write_npz_numbered(Some(&numbering), out))?;
    Ok(Outcome::Made(path))
}

/// The name of the mesh with an ending; two names that are no UTF-8 stay two.
fn result_name(mesh: &Path) -> OsString {
    let mut name = mesh.file_name().unwrap_or_default().to_owned();
    name.push(".npz");
    name
}

/// Whether a file holds a result of this kind that can be read.
fn is_whole(path: &Path, job: &JobParameters, promises: &Promises) -> Result<bool, CliError> {
    let kind = ProductKind::of_name(job.kind());
    let (Some(kind), Ok(found)) = (kind, fs::metadata(path)) else { return Ok(false) };
    // The bytes and what is made of them.
    let _promise = promises.take(found.len().saturating_mul(2))?;
    let reads = |bytes: Vec<u8>| npz::check_sums(&bytes).is_ok() && Product::read_npz(kind, &bytes).is_ok();
    Ok(fs::read(path).is_ok_and(reads))
}

fn is_newer(path: &Path, than: &Path) -> bool {
    let changed = |path: &Path| fs::metadata(path).and_then(|found| found.modified()).ok();
    changed(path).zip(changed(than)).is_some_and(|(made, source)| made >= source)
}

/// A file that is moved, copied or unpacked into the place of a mesh keeps the time at which it was written, which may
/// be long ago: what counts is also when it came there, where the system tells.
fn is_newer_than_mesh(path: &Path, mesh: &Path) -> bool {
    is_newer(path, mesh) && came_before(path, mesh)
}

#[cfg(unix)]
fn came_before(path: &Path, mesh: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(result), Ok(mesh)) = (fs::metadata(path), fs::metadata(mesh)) else { return false };
    (result.mtime(), result.mtime_nsec()) >= (mesh.ctime(), mesh.ctime_nsec())
}

#[cfg(not(unix))]
fn came_before(_path: &Path, _mesh: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bad_name_ends_nothing_and_a_full_disk_everything() {
        let folder = tempfile::tempdir().unwrap();
        let gone = folder.path().join("gone");
        for (kind, output, expected) in [
            (ErrorKind::StorageFull, folder.path(), true),
            (ErrorKind::ReadOnlyFilesystem, folder.path(), true),
            (ErrorKind::NotFound, gone.as_path(), true),
            (ErrorKind::NotFound, folder.path(), false),
            (ErrorKind::InvalidFilename, folder.path(), false),
            (ErrorKind::PermissionDenied, folder.path(), false),
        ] {
            let error = CliError::file("write", &output.join("a.npz"), kind.into());
            assert_eq!(fails_for_all(&error, output), expected, "{kind}");
        }
    }

    #[test]
    fn meshes_are_told_by_their_names() {
        for (name, expected) in [
            ("a.off", true),
            ("a.PLY.gz", true),
            ("lh.pial", true),
            ("a.npz", false),
            ("a.json", false),
            ("a.txt", false),
        ] {
            assert_eq!(is_mesh(Path::new(name)), expected, "{name}");
        }
    }
}
