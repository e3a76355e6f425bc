//! One job without a server: the same for every kind and every command that runs one.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use chladni_algebra::gpu::{self, GpuChoice};
use chladni_mesh::check::{RepairKind, SurfaceOf};
use chladni_mesh::numbering::{Extension, Numbering};
use chladni_mesh::solid::CheckedBody;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Product;
use chladni_spectral::formats::FormatError;
use chladni_work::numbered::translate_parameters;
use chladni_work::{JobError, JobParameters, MeshSize, Outcome, SOLVER_VERSION, abbreviate};
use serde_json::{Map, Value, json};

use super::asked::Asked;
use super::output::OutputFormat;
use super::{CliError, MeshInput, NumberingArguments, StageBars, memory};

/// The mesh, and what does not depend on the kind of work.
#[derive(Debug, clap::Args)]
pub struct WorkArguments {
    #[command(flatten)]
    pub input: MeshInput,

    #[command(flatten)]
    pub numbered: NumberingArguments,

    /// Any parameter of the job by name, as the API takes it, such as radial.distance=dijkstra; may be given several
    /// times
    #[arg(long = "parameter", short = 'p', value_name = "NAME=VALUE", help_heading = "Method")]
    pub named: Vec<String>,

    /// Graphics card for large dense problems: off, auto, its number or part of its name
    #[arg(long, value_name = "CARD", env = "CHLADNI_GPU", help_heading = "Method", default_value = "off", value_parser = card)]
    pub gpu: GpuChoice,

    /// Threads; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0, help_heading = "Method", value_parser = threads)]
    pub threads: usize,

    /// Start even if the estimate says that there is too little memory
    #[arg(long, help_heading = "Method")]
    pub ignore_memory: bool,

    /// Write the result to this file: .npz with everything; for an eigenbasis also .mat (MATLAB, Octave), .csv (a row
    /// for each vertex, as --numbering says), .vtp or .ply (the surface with its eigenfunctions; points without faces
    /// in the order that --numbering says). Archives and surfaces have the vertices kept after repairs: .npz and .mat
    /// have the maps vertex_map and face_map, .vtp and .ply the arrays file_vertex and file_face
    #[arg(long, short = 'o', value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    /// Draw no progress bars
    #[arg(long, short = 'q', help_heading = "Output")]
    pub quiet: bool,
}

/// More threads than this take longer to start than they save.
const MOST_THREADS: usize = 1024;

/// A number of threads.
pub fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count) if count <= MOST_THREADS => Ok(count),
        _ => Err(format!("expected a whole number from 0 to {MOST_THREADS}")),
    }
}

fn card(text: &str) -> Result<GpuChoice, &'static str> {
    text.parse()
}

/// What one run made and measured.
pub struct Finished {
    /// The mesh.
    pub mesh: TriangleMesh,
    /// Where the vertices and faces of the file went.
    pub numbering: Arc<Numbering>,
    /// Which surface this is, where the file has tetrahedra.
    pub surface: Option<SurfaceOf>,
    /// What was made.
    pub product: Product,
    /// Seconds of each stage, reading first.
    pub stages: Vec<(&'static str, f64)>,
    /// Seconds from reading to the result.
    pub total: f64,
    /// Seconds of writing, where a file was asked for.
    pub write: Option<f64>,
    /// Threads that took part.
    pub threads: usize,
    /// The estimate of the memory, in bytes.
    pub memory_estimate: u64,
    /// The largest resident memory before writing, in bytes.
    pub peak_rss: Option<u64>,
}

impl WorkArguments {
    /// The parameters of a job of `kind`: `given`, with those that were given by name on top.
    ///
    /// # Errors
    /// [`CliError::Usage`] or [`CliError::Parameters`] names what does not fit.
    pub fn job(&self, kind: &str, mut given: Map<String, Value>) -> Result<Asked, CliError> {
        insert_named(&mut given, &self.named)?;
        Asked::parse(kind, &Value::Object(given))
    }

    /// Refuses parameters by name that a flag has `given` as well.
    ///
    /// # Errors
    /// [`CliError::Usage`] names the first.
    pub fn refuse_twice(&self, given: &Map<String, Value>) -> Result<(), CliError> {
        let names = self.named.iter().filter_map(|text| text.split_once('=')).map(|(name, _)| name);
        match names.into_iter().find(|name| given.contains_key(*name)) {
            Some(name) => Err(CliError::Usage(format!("--parameter {name}: a flag gives it as well"))),
            None => Ok(()),
        }
    }

    /// Refuses to extend what has no value at dropped vertices anyway, where the job names no vertex either.
    fn refuse_extension(&self, format: OutputFormat, job: &Asked) -> Result<(), CliError> {
        if self.numbered.extend == Extension::None || format.has_dropped_vertices() || job.is_numbered() {
            return Ok(());
        }
        let reason = "--extend: is for .csv, which has a row for each vertex of the file, and for jobs that name vertices; .npz, .mat, \
                      .vtp and .ply have no dropped vertices";
        Err(CliError::Usage(reason.to_owned()))
    }

    /// Chooses the graphics card, which has to be there if it is named.
    fn choose_card(&self) -> Result<(), CliError> {
        let accelerator = gpu::choose(self.gpu.clone());
        if matches!(self.gpu, GpuChoice::Index(_) | GpuChoice::Name(_)) {
            accelerator.open();
            if let Some(reason) = accelerator.reason() {
                return Err(CliError::Usage(format!("--gpu {}: {reason}", self.gpu)));
            }
        }
        Ok(())
    }

    /// The threads that work, once the graphics card is chosen.
    ///
    /// # Errors
    /// [`CliError`]: a card that is not there, threads that do not start.
    pub fn pool(&self) -> Result<rayon::ThreadPool, CliError> {
        self.choose_card()?;
        rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads)
            .build()
            .map_err(|error| CliError::Service(format!("cannot start {} threads: {error}", self.threads)))
    }

    /// Reads the mesh, and the job as it runs on it.
    ///
    /// # Errors
    /// [`CliError`]: a file that is no mesh, parameters that do not fit it.
    pub fn prepare(&self, job: &Asked, pool: &rayon::ThreadPool) -> Result<Prepared, CliError> {
        let body = pool.install(|| self.input.load_body())?;
        let (job, size, numbering) = prepared(&body, job, &self.numbered)?;
        let surface = body.surface.report.surface;
        Ok(Prepared { mesh: body.surface.mesh, solid: body.solid, job, size, numbering, surface })
    }

    /// Refuses work that needs more memory than is free. What this process has already, such as the mesh, is part of
    /// what the work takes.
    ///
    /// # Errors
    /// [`CliError::Refused`].
    pub fn refuse_memory(&self, estimate: u64) -> Result<(), CliError> {
        let free = memory::available().map(|free| free.saturating_add(memory::resident().unwrap_or(0)));
        match free.filter(|free| estimate > *free && !self.ignore_memory) {
            Some(free) => Err(CliError::Refused(format!(
                "the job needs about {estimate} bytes of memory and {free} are free; ask for less, or pass --ignore-memory"
            ))),
            None => Ok(()),
        }
    }

    /// The same of work that needs at `most` so much; where that is not free, a look at the mesh tells what it needs.
    /// Gives the estimate that counts.
    ///
    /// # Errors
    /// [`CliError::Refused`]; those of the look.
    pub fn refuse_memory_by(&self, most: u64, exact: impl FnOnce() -> Result<u64, CliError>) -> Result<u64, CliError> {
        if self.refuse_memory(most).is_ok() {
            return Ok(most);
        }
        let exact = exact()?;
        self.refuse_memory(exact)?;
        Ok(exact)
    }

    /// Reads the mesh, runs the job and writes its result where that is asked for.
    ///
    /// # Errors
    /// [`CliError`]: an output that cannot be written is found out before the work begins.
    pub fn run(&self, job: &Asked) -> Result<Finished, CliError> {
        let memory = |prepared: &Prepared, _: &StageBars| {
            let estimate = prepared.job.memory_bytes(prepared.size);
            self.refuse_memory(estimate).map(|()| estimate)
        };
        self.run_by(job, memory, |job, mesh, solid, bars| job.run_body(mesh, solid, bars))
    }

    /// The same with the memory that the work takes, refused where it is not free, and the work itself.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_by(
        &self,
        job: &Asked,
        memory: impl FnOnce(&Prepared, &StageBars) -> Result<u64, CliError> + Send,
        work: impl FnOnce(&JobParameters, &TriangleMesh, Option<&TetMesh>, &StageBars) -> Result<Outcome, JobError> + Send,
    ) -> Result<Finished, CliError> {
        let pool = self.pool()?;
        // Before the work: a solve of minutes must not end at a folder that does not exist.
        let output = self
            .output
            .as_deref()
            .map(|path| Ok::<_, CliError>((OutputFormat::of(path, job.kind())?, OutputFile::probe(path)?)));
        let output = output.transpose()?;
        if let Some((format, _)) = &output {
            self.refuse_extension(*format, job)?;
        }
        let bars = StageBars::new(self.json || self.quiet);
        let began = Instant::now();
        bars.begin("read");
        let prepared = self.prepare(job, &pool)?;
        let mut stages = vec![("read", began.elapsed().as_secs_f64())];
        let memory_estimate = pool.install(|| memory(&prepared, &bars))?;
        let Prepared { mesh, solid, job, numbering, surface, .. } = prepared;
        let to = self.numbered.translation(Arc::clone(&numbering));
        let outcome = pool.install(|| work(&job, &mesh, solid.as_ref(), &bars))?;
        let total = began.elapsed().as_secs_f64();
        bars.finish();
        stages.extend(outcome.seconds);
        let peak_rss = peak_rss_bytes();
        let product = outcome.product;
        let write = match output {
            None => None,
            Some((format, file)) => {
                let began = Instant::now();
                file.write(|out| format.write(&product, &mesh, &numbering, &to, out))?;
                Some(began.elapsed().as_secs_f64())
            }
        };
        let threads = pool.current_num_threads();
        Ok(Finished { mesh, numbering, surface, product, stages, total, write, threads, memory_estimate, peak_rss })
    }
}

/// A mesh, and a job as it runs on it.
pub struct Prepared {
    /// The mesh.
    pub mesh: TriangleMesh,
    /// The solid whose surface it is, where the file has tetrahedra.
    pub solid: Option<TetMesh>,
    /// The job, in the numbering of the mesh.
    pub job: JobParameters,
    /// How large the mesh is.
    pub size: MeshSize,
    /// Where the vertices and faces of the file went.
    pub numbering: Arc<Numbering>,
    /// Which surface this is, where the file has tetrahedra.
    pub surface: Option<SurfaceOf>,
}

impl Finished {
    /// What every kind of work tells, as one object.
    pub fn json(&self, job: &JobParameters) -> Result<Value, CliError> {
        let mut parameters = job.canonical();
        abbreviate(&mut parameters);
        let summary = self.product.summary().map_err(|error| CliError::stdout(error.into()))?;
        Ok(json!({
            "kind": job.kind(),
            "vertices": self.mesh.positions.len(),
            "faces": self.mesh.faces.len(),
            "file": {"vertices": self.numbering.file_vertices(), "faces": self.numbering.file_faces()},
            "surface": self.surface,
            "dimension": summary.dimension,
            "details": summary.details,
            "parameters": parameters,
            "basis_bytes": self.product.stored_bytes(),
            "seconds": {"total": self.total, "stages": self.stage_seconds(), "write": self.write},
            "threads": self.threads,
            "peak_rss_bytes": self.peak_rss,
            "memory_estimate_bytes": self.memory_estimate,
            "solver_version": SOLVER_VERSION,
            "eigenvalues": summary.eigenvalues,
        }))
    }

    /// Seconds of each stage; one that came more than once counts whole.
    pub fn stage_seconds(&self) -> Map<String, Value> {
        let mut stages: Map<String, Value> = Map::new();
        for &(name, seconds) in &self.stages {
            let before = stages.get(name).and_then(Value::as_f64).unwrap_or(0.0);
            stages.insert(name.to_owned(), json!(before + seconds));
        }
        stages
    }
}

/// A job as it runs on a mesh: its parameters in the numbering of the mesh that was kept, and checked against its size.
///
/// # Errors
/// [`CliError::Parameters`] names what does not fit.
pub fn prepared(
    body: &CheckedBody,
    job: &Asked,
    numbered: &NumberingArguments,
) -> Result<(JobParameters, MeshSize, Arc<Numbering>), CliError> {
    let size = MeshSize::of_body(&body.surface.mesh, body.solid.as_ref());
    let numbering = Arc::new(body.surface.numbering.clone());
    let mut parameters = job.given();
    let turned = body.surface.report.repaired(RepairKind::FlippedFaces);
    let to = numbered.translation(Arc::clone(&numbering)).turning(turned);
    translate_parameters(&mut parameters, &to, size)?;
    let job = JobParameters::read(job.kind(), &parameters)?;
    job.check_mesh(size)?;
    Ok((job, size, numbering))
}

/// Adds parameters that were given as NAME=VALUE.
///
/// # Errors
/// [`CliError::Usage`] where one is not of this form.
pub fn insert_named(given: &mut Map<String, Value>, named: &[String]) -> Result<(), CliError> {
    for text in named {
        let (name, value) = text
            .split_once('=')
            .ok_or_else(|| CliError::Usage(format!("--parameter takes NAME=VALUE, not \"{text}\"")))?;
        // What is not JSON is a word: `accuracy=accurate` needs no quotes.
        let value = serde_json::from_str(value).unwrap_or_else(|_| json!(value));
        insert(given, name, value);
    }
    Ok(())
}

/// The members of an object that were given.
pub fn given<const N: usize>(members: [(&str, Option<Value>); N]) -> Map<String, Value> {
    members.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect()
}

/// Sets a member by its name; a dot leads into an object: `radial.distance`.
fn insert(object: &mut Map<String, Value>, name: &str, value: Value) {
    let Some((outer, inner)) = name.split_once('.') else {
        object.insert(name.to_owned(), value);
        return;
    };
    let member = object.entry(outer).or_insert_with(|| json!({}));
    if !member.is_object() {
        *member = json!({});
    }
    if let Value::Object(member) = member {
        insert(member, inner, value);
    }
}

/// A JSON value from the command line: as it stands there, or `@FILE`.
///
/// # Errors
/// [`CliError`] names the flag or the file.
pub fn json_argument(flag: &str, text: &str) -> Result<Value, CliError> {
    let read = match text.strip_prefix('@') {
        None => text.to_owned(),
        Some(path) => std::fs::read_to_string(path).map_err(|error| CliError::file("read", Path::new(path), error))?,
    };
    serde_json::from_str(&read).map_err(|error| {
        let file = !text.starts_with('@') && Path::new(text).is_file();
        let hint = if file { format!("; the file of that name is read by {flag} @{text}") } else { String::new() };
        CliError::Usage(format!("{flag} is not valid JSON: {error}{hint}"))
    })
}

/// The largest resident memory of this process so far, in bytes; absent where the system does not tell.
pub fn peak_rss_bytes() -> Option<u64> {
    memory::field(&std::fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// What a file is written through.
pub type Out = BufWriter<std::fs::File>;

/// Distinguishes the parts of one process: two threads may write the same file.
static PARTS: AtomicU64 = AtomicU64::new(0);

/// A file that appears under its name only when it is whole.
pub struct OutputFile {
    path: PathBuf,
    part: PathBuf,
}

impl OutputFile {
    /// Makes sure that the file can be written; leaves nothing behind, so that an interrupted solve does not either.
    pub fn probe(path: &Path) -> Result<Self, CliError> {
        let mut name = path
            .file_name()
            .map(std::ffi::OsStr::to_owned)
            .ok_or_else(|| CliError::Usage(format!("--output {}: this is not the name of a file", path.display())))?;
        let part = PARTS.fetch_add(1, Ordering::Relaxed);
        name.push(format!(".{}-{part}.part", std::process::id()));
        let output = Self { path: path.to_owned(), part: path.with_file_name(name) };
        let failed = |error| CliError::file("write", &output.path, error);
        std::fs::File::create(&output.part).map_err(failed)?;
        std::fs::remove_file(&output.part).map_err(failed)?;
        Ok(output)
    }

    /// Writes the file by `write`, whole or not at all.
    pub fn write(&self, write: impl FnOnce(&mut Out) -> Result<(), FormatError>) -> Result<(), CliError> {
        let written = self.write_part(write).and_then(|()| std::fs::rename(&self.part, &self.path));
        written.map_err(|error| {
            // What was written so far is of no use; that it may not be removed either adds nothing.
            let _removed = std::fs::remove_file(&self.part);
            CliError::file("write", &self.path, error)
        })
    }

    fn write_part(&self, write: impl FnOnce(&mut Out) -> Result<(), FormatError>) -> std::io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 20, std::fs::File::create(&self.part)?);
        write(&mut out).map_err(|error| match error {
            // The kind says whether anything else can be written.
            FormatError::Write(source) => source,
            FormatError::Archive(source) => source.into(),
            error => std::io::Error::other(error),
        })?;
        out.flush()?;
        // Otherwise the name may outlive the content when the machine fails.
        out.get_ref().sync_all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_memory_is_told_on_linux() {
        assert!(!cfg!(target_os = "linux") || peak_rss_bytes().is_some_and(|bytes| bytes > 1 << 20));
    }

    #[test]
    fn two_writers_of_one_file_do_not_share_a_part() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.txt");
        let (first, second) = (OutputFile::probe(&path).unwrap(), OutputFile::probe(&path).unwrap());
        first
            .write(|out| {
                out.write_all(b"first")?;
                second.write(|out| Ok(out.write_all(b"second")?)).unwrap();
                Ok(())
            })
            .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn json_comes_from_the_command_line_or_from_a_file() {
        assert_eq!(json_argument("--request", "{\"a\": 1}").unwrap(), json!({"a": 1}));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("request.json");
        std::fs::write(&path, "[1, 2]").unwrap();
        assert_eq!(json_argument("--request", &format!("@{}", path.display())).unwrap(), json!([1, 2]));
        assert!(
            json_argument("--request", "{").unwrap_err().to_string().starts_with("--request is not valid JSON: EOF")
        );
        // One who forgets the @ is told.
        let forgotten = json_argument("--request", &path.display().to_string()).unwrap_err().to_string();
        assert!(forgotten.ends_with(&format!("is read by --request @{}", path.display())), "{forgotten}");
        assert!(json_argument("--request", "@/no/such/file").unwrap_err().to_string().contains("/no/such/file"));
    }
}
