//! `worker-process`: a process that runs jobs for the server or the worker that started it.

use super::{CliError, poison::Poison, serve};
use crate::config::{Config, JobsIn, LogFormat, LogSettings};
use crate::queue::process::{self, ProcessOptions, Processes};
use crate::queue::{QueueObserver, Runner, Solver};
use crate::telemetry::start_logs;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// Run jobs for the server that started this process; not for use by hand
#[derive(Debug, clap::Args)]
#[command(hide = true)]
pub struct WorkerArguments {
    /// Graphics card for large dense problems, as for `serve`
    #[arg(long, default_value = "off")]
    gpu: String,

    /// A fault for tests: gpu-lost, or poison
    #[arg(long)]
    fault: Option<String>,

    /// Form of the log lines
    #[arg(long, default_value = "human")]
    log_format: LogFormat,

    /// What is logged
    #[arg(long, default_value = "info")]
    log_level: String,
}

/// With a graphics card to open and to test, a process takes a while until it is ready.
const PATIENCE: Duration = Duration::from_secs(60);

/// Runs `chladni worker-process` until its standard input ends.
pub fn worker(arguments: WorkerArguments) -> Result<ExitCode, CliError> {
    let failed = |error: io::Error| CliError::Service(format!("the worker could not start: {error}"));
    let (input, output) = pipes().map_err(failed)?;
    start_logs(&LogSettings { log_format: arguments.log_format, log_level: arguments.log_level })?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    // The server says when to stop. What an operator sends to every process of a service must not end the jobs that it
    // gives time to.
    let _ignored = runtime.block_on(async { serve::Signals::install() })?;
    let accelerator = runtime.block_on(serve::accelerator(&arguments.gpu))?;
    let runner: Box<dyn Runner> = match arguments.fault.as_deref() {
        Some("poison") => Box::new(Poison(Solver)),
        Some("gpu-lost") => {
            accelerator.lose_once();
            Box::new(Solver)
        }
        _ => Box::new(Solver),
    };
    process::work(input, output, runner.as_ref()).map_err(failed)?;
    Ok(ExitCode::SUCCESS)
}

/// The pipes to the server. Whatever else writes to standard output, a driver or a library of C, writes to standard
/// error from now on.
#[cfg(unix)]
fn pipes() -> io::Result<(File, File)> {
    use std::os::fd::AsFd;
    let input = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    let output = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    rustix::stdio::dup2_stdout(io::stderr())?;
    Ok((input, output))
}

/// The pipes to the server.
#[cfg(windows)]
fn pipes() -> io::Result<(File, File)> {
    use std::os::windows::io::AsHandle;
    let input = File::from(io::stdin().as_handle().try_clone_to_owned()?);
    let output = File::from(io::stdout().as_handle().try_clone_to_owned()?);
    Ok((input, output))
}

/// What runs the jobs of a server.
pub(super) fn runner(config: &Config, observer: Arc<dyn QueueObserver>) -> Result<Arc<dyn Runner>, CliError> {
    if config.jobs_in == JobsIn::Threads || config.workers == 0 {
        return Ok(Arc::new(Solver));
    }
    let format = match config.logs.log_format {
        LogFormat::Human => "human",
        LogFormat::Json => "json",
    };
    let mut arguments = vec!["worker-process", "--gpu", &config.gpu, "--log-format", format];
    arguments.extend(["--log-level", &config.logs.log_level]);
    if let Some(fault @ ("poison" | "gpu-lost")) = config.fault.as_deref() {
        arguments.extend(["--fault", fault]);
    }
    let options = ProcessOptions {
        program: this_program()?,
        arguments: arguments.into_iter().map(String::from).collect(),
        limit_memory: true,
        patience: PATIENCE,
        idle: config.workers,
    };
    let processes = Processes::start(options, observer).map_err(|error| {
        CliError::Service(format!("no worker process can be started: {error}; --jobs-in threads needs none"))
    })?;
    Ok(Arc::new(processes))
}

/// This very program, even if its file has been replaced since.
fn this_program() -> Result<PathBuf, CliError> {
    let own = PathBuf::from("/proc/self/exe");
    if cfg!(target_os = "linux") && own.exists() {
        return Ok(own);
    }
    std::env::current_exe().map_err(|error| CliError::Service(format!("this program cannot be found: {error}")))
}
