//! `demo`: the whole service in one go, through its own API.

use chladni_mesh::shape::{self, Shape};
use chladni_mesh::write::write_ply;

use super::client::{Client, text};
use super::serve::{Running, Signals, bind, runtime, start_on};
use super::solve::{eigenvalue_table, storage};
use super::{CliError, StageBars, Table, bytes, grouped};
use crate::config::{Config, LogFormat, LogSettings};
use crate::telemetry::start_logs;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Start the service, send a mesh through it, show what comes out, and go on serving
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct DemoArguments {
    /// Mesh file, plain or compressed with gzip; without one, a surface of genus 3 with 100,000 vertices is generated
    #[arg(value_name = "MESH")]
    mesh: Option<PathBuf>,

    /// Exit after the table instead of continuing to serve
    #[arg(long)]
    once: bool,

    /// Number of eigenpairs
    #[arg(long, short = 'n', value_name = "M", default_value_t = 500)]
    count: usize,

    /// Folder of the databases; created if missing
    #[arg(long, value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data")]
    data: PathBuf,

    /// Port on this machine; if it is taken, a free one
    #[arg(long, value_name = "PORT", default_value_t = 8080)]
    port: u16,

    /// Threads of the job; 0 for one per core
    #[arg(long, value_name = "N", env = "CHLADNI_THREADS", default_value_t = 0)]
    threads: usize,
}

const EXAMPLES: &str = "\
Examples:
  chladni demo                         a generated surface, then serve until Ctrl-C
  chladni demo dragon.ply.gz -n 1000   your own mesh
  chladni demo --once                  only the table";

/// Vertices of the generated surface.
const VERTICES: usize = 100_000;

/// Its genus.
const GENUS: u32 = 3;

/// A mesh file in memory.
struct Source {
    name: String,
    format: Option<String>,
    content: Vec<u8>,
}

/// Runs `chladni demo`.
pub fn demo(arguments: DemoArguments) -> Result<ExitCode, CliError> {
    start_logs(&LogSettings { log_format: LogFormat::Human, log_level: "warn".into() })?;
    let source = match &arguments.mesh {
        Some(path) => Source::open(path)?,
        None => Source::generate()?,
    };
    runtime()?.block_on(async {
        let mut signals = Signals::install()?;
        let running = start(&arguments).await?;
        print_text(&format!("Serving on {}, data in {}\n\n", running.url(), arguments.data.display()))?;
        let shown = tokio::select! {
            shown = show(&running, &arguments, source) => shown,
            signal = signals.next() => Err(CliError::Service(format!("ended by {signal}"))),
        };
        if let Err(error) = shown {
            // What went wrong matters more than how the server ends; it is asked all the same.
            let _ended = running.stop().await;
            return Err(error);
        }
        if arguments.once {
            running.stop().await?;
            return Ok(ExitCode::SUCCESS);
        }
        print_text("\nServing until Ctrl-C.\n")?;
        signals.stop_on_first(running).await
    })
}

/// Starts the server on the wanted port or, where that is taken, on a free one.
async fn start(arguments: &DemoArguments) -> Result<Running, CliError> {
    let wanted = SocketAddr::from((Ipv4Addr::LOCALHOST, arguments.port));
    let listener = match bind(wanted).await {
        Err(CliError::Io { source, .. }) if source.kind() == io::ErrorKind::AddrInUse => {
            bind(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))).await?
        }
        bound => bound?,
    };
    let config =
        Config { listen: wanted, data: arguments.data.clone(), threads: arguments.threads, ..Config::default() };
    start_on(listener, config).await
}

/// Upload, job, result: everything through the API.
async fn show(running: &Running, arguments: &DemoArguments, source: Source) -> Result<(), CliError> {
    let client = Client::new(running.address);
    let began = Instant::now();
    let size = source.content.len() as u64;
    let mesh = client.upload(&source.name, source.format.as_deref(), source.content).await?;
    print_text(&format!("{}\n", describe(&mesh)))?;
    print_text(&format!(
        "  {} uploaded, checked and stored in {:.2} s\n\n",
        bytes(size),
        began.elapsed().as_secs_f64()
    ))?;

    let began = Instant::now();
    let job = client.submit("eigenbasis", text(&mesh, "/id")?, &json!({"count": arguments.count})).await?;
    let known = job["status"] == "succeeded";
    let bars = StageBars::new(false);
    let job = client
        .watch(&job, |state| {
            if let Some(stage) = state["stage"].as_str().filter(|_| state["status"] == "processing") {
                bars.begin(stage);
                bars.advance(state["progress"].as_f64().unwrap_or(0.0));
                bars.show_detail(state["detail"].as_str().unwrap_or_default());
            }
        })
        .await?;
    bars.finish();
    let elapsed = began.elapsed().as_secs_f64();
    if job["status"] != "succeeded" {
        let reason = job.pointer("/problem/detail").and_then(Value::as_str).unwrap_or("no reason is given");
        return Err(CliError::Refused(format!("the job is {}: {reason}", text(&job, "/status")?)));
    }
    let basis = client.get(text(&job, "/links/basis")?).await?;
    print_text(&report(&basis, known, elapsed, &running.url())?)
}

/// One line about a stored mesh.
fn describe(mesh: &Value) -> String {
    let report = &mesh["report"];
    let mut line = format!(
        "{}: {} vertices, {} faces",
        mesh["name"].as_str().unwrap_or("mesh"),
        count(mesh, "vertices"),
        count(mesh, "faces")
    );
    if let Some(genus) = report["genus"].as_i64() {
        line += &format!(", genus {genus}");
    }
    for (name, one) in [("components", "component"), ("boundary_loops", "boundary loop")] {
        if let Some(number) = report[name].as_u64() {
            line += &format!(", {} {one}{}", grouped(number as usize), if number == 1 { "" } else { "s" });
        }
    }
    line
}

/// The table and the addresses.
fn report(basis: &Value, known: bool, elapsed: f64, url: &str) -> Result<String, CliError> {
    let mut out = format!(
        "{} eigenpairs from a subspace of dimension {}, {} nonzeros\n\n",
        count(basis, "count"),
        count(basis, "dimension"),
        count(basis, "nonzeros"),
    );
    let mut stages = Table::new(&["stage", "seconds"]);
    let listed = basis["stage_seconds"].as_array().map(Vec::as_slice).unwrap_or_default();
    for stage in listed {
        let seconds = stage["seconds"].as_f64().unwrap_or(0.0);
        stages.row([stage["stage"].as_str().unwrap_or("–").to_owned(), format!("{seconds:.3}")]);
    }
    let total: f64 = listed.iter().filter_map(|stage| stage["seconds"].as_f64()).sum();
    stages.row(["all stages".into(), format!("{total:.3}")]);
    out += &stages.to_string();
    out += &if known {
        "  The result was stored already: equal work is done once.\n\n".to_owned()
    } else {
        format!("  {elapsed:.3} s from submission to the stored result\n\n")
    };
    let numbers = |pointer: &str| -> Vec<f64> {
        let list = basis.pointer(pointer).and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        list.iter().filter_map(Value::as_f64).collect()
    };
    out += &eigenvalue_table(
        &numbers("/eigenvalues"),
        &numbers("/certificate/residuals"),
        &numbers("/certificate/estimates"),
        &numbers("/certificate/bounds"),
    );
    let (compact, dense) = (basis["bytes"].as_u64().unwrap_or(0), basis["dense_bytes"].as_u64().unwrap_or(0));
    out += &format!("\n{}\n\n", storage(compact, dense));
    let (itself, content) = (text(basis, "/links/self")?, text(basis, "/links/content")?);
    out += &format!("  see it   {url}/#mesh={}&basis={}\n", text(basis, "/mesh")?, text(basis, "/id")?);
    for (what, path) in [("docs", "/docs"), ("basis", itself), ("as NPZ", content), ("metrics", "/metrics")] {
        out += &format!("  {what:<9}{url}{path}\n");
    }
    Ok(out)
}

fn count(value: &Value, name: &str) -> String {
    grouped(value[name].as_u64().unwrap_or(0) as usize)
}

fn print_text(text: &str) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(CliError::stdout)
}

impl Source {
    /// Reads a file as it is; the server decompresses it.
    fn open(path: &Path) -> Result<Self, CliError> {
        let content = std::fs::read(path).map_err(|error| CliError::file("read", path, error))?;
        let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let plain = Path::new(file.strip_suffix(".gz").unwrap_or(&file));
        let format = plain.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let name = plain.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, format, content })
    }

    /// Makes the default surface.
    fn generate() -> Result<Self, CliError> {
        let mesh =
            shape::generate(Shape::Genus(GENUS), VERTICES).map_err(|error| CliError::Usage(error.to_string()))?;
        let mut content = Vec::new();
        write_ply(&mesh, None, &mut content).map_err(|source| CliError::Io {
            action: "write",
            target: "the generated surface".into(),
            source,
        })?;
        Ok(Self { name: format!("genus-{GENUS}"), format: Some("ply".into()), content })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_described_in_one_line() {
        let mesh = json!({"name": "spot", "vertices": 2930, "faces": 5856,
            "report": {"genus": 0, "components": 1, "boundary_loops": 0}});
        assert_eq!(describe(&mesh), "spot: 2,930 vertices, 5,856 faces, genus 0, 1 component, 0 boundary loops");
    }

    #[test]
    fn names_and_formats_come_from_the_file_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dragon.PLY.gz");
        std::fs::write(&path, "x").unwrap();
        let source = Source::open(&path).unwrap();
        assert_eq!((source.name.as_str(), source.format.as_deref()), ("dragon", Some("ply")));
    }

    #[test]
    fn the_report_names_sizes_and_addresses() {
        let basis = json!({"id": "b", "mesh": "m", "count": 2, "dimension": 4, "nonzeros": 40, "bytes": 1000, "dense_bytes": 4000,
            "stage_seconds": [{"stage": "eigen", "seconds": 0.25}], "eigenvalues": [0.0, 1.5],
            "certificate": {"residuals": [0.0, 0.1], "bounds": [0.0, 0.2]},
            "links": {"self": "/v1/bases/b", "content": "/v1/bases/b/content"}});
        let text = report(&basis, false, 0.3, "http://h").unwrap();
        for part in [
            "2 eigenpairs",
            "dimension 4",
            "0.250",
            "1.5000",
            "25 % of the 4.0 kB",
            "http://h/#mesh=m&basis=b",
            "http://h/v1/bases/b/content",
        ] {
            assert!(text.contains(part), "{part} is missing from\n{text}");
        }
    }
}
