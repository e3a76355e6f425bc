//! The command line: one file per command.

mod apply;
mod asked;
mod backup;
mod batch;
mod check;
mod client;
mod compact;
#[cfg(unix)]
mod crash_mark;
mod data_folder;
mod demo;
mod doctor;
mod eigsh;
mod error;
mod field;
mod input;
mod join;
mod map_collection;
mod memory;
#[cfg(feature = "cluster")]
mod migrate;
mod output;
mod pictures;
mod poison;
mod private;
mod progress;
mod quads;
mod restore;
mod run;
mod sample;
pub mod serve;
mod solve;
mod text;
mod verify;
mod work;
mod worker;

pub use error::CliError;
pub use input::{MeshInput, NumberingArguments, read_bytes};
pub use progress::StageBars;
pub use text::{Table, bytes, grouped, number, seconds};

use crate::config::Config;
use clap::Parser;
use std::io::Write;
use std::process::ExitCode;

/// Spectral geometry as a service: eigenbases of surfaces, compact and certified.
#[derive(Debug, Parser)]
#[command(name = "chladni", version, max_term_width = 110, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  chladni demo                                             see it work, from upload to basis
  chladni serve --data /srv/chladni --workers 2            the service
  chladni solve bunny.ply --count 500 --output bunny.npz   500 eigenpairs, without a server
  chladni run vibration_basis plate.ply -p thickness=0.001 any kind of job, with the parameters of the API
  chladni batch shapes --kind operators -o op_cache        every mesh of a folder, for learning
  chladni eigsh S.npz M.npz --count 200                    the same of any sparse symmetric matrices
  chladni check scan.obj                                   what is wrong with a mesh, what was repaired
  chladni verify bunny.npz bunny.ply                       whether a basis is what it says
  chladni sample genus-3 -n 100000 -o genus-3.ply          a mesh to try things on

Exit codes: 0 done; 1 the mesh or the work failed; 2 wrong usage; 3 a file, the network or the storage failed.
'chladni COMMAND --help' tells more about a command.";

#[derive(Debug, clap::Subcommand)]
enum Command {
    Demo(demo::DemoArguments),
    /// Serve the API over HTTP, with the queue, the storage and workers in processes of their own
    #[command(after_help = SERVE_HELP)]
    Serve(Box<Config>),
    Solve(Box<solve::SolveArguments>),
    Join(Box<join::JoinArguments>),
    Eigsh(Box<eigsh::EigshArguments>),
    Field(Box<field::FieldArguments>),
    Run(Box<run::RunArguments>),
    Batch(Box<batch::BatchArguments>),
    Distances(apply::DistancesArguments),
    Filter(apply::FilterArguments),
    Design(apply::DesignArguments),
    Hatching(pictures::HatchingArguments),
    Fur(pictures::FurArguments),
    Quads(quads::QuadsArguments),
    MapCollection(Box<map_collection::MapCollectionArguments>),
    Check(check::CheckArguments),
    Verify(Box<verify::VerifyArguments>),
    Backup(backup::BackupArguments),
    Restore(restore::RestoreArguments),
    Doctor(doctor::DoctorArguments),
    Compact(compact::CompactArguments),
    #[cfg(feature = "cluster")]
    Migrate(migrate::MigrateArguments),
    Sample(sample::SampleArguments),
    /// Run jobs of servers that share their records: the settings of `serve`, without an API
    #[command(after_help = WORKER_HELP)]
    Worker(Box<Config>),
    WorkerProcess(worker::WorkerArguments),
    /// Print the OpenAPI document of the API
    Openapi,
}

const SERVE_HELP: &str = "\
Examples:
  chladni serve                                           on this machine alone, data in ./chladni-data
  chladni serve --data /srv/chladni --workers 2 --threads 16 --log-format json
  chladni serve --listen 0.0.0.0:8080 --keys-file keys    for others: one NAME:SCOPES:SECRET per line

A server that others can reach does not start without API keys unless told --insecure. The first SIGTERM
or Ctrl-C drains: running jobs get --drain-seconds, then they return to the queue. A second one ends the
process at once.";

const WORKER_HELP: &str = "\
Examples:
  chladni worker --database postgres://chladni@db/chladni --objects s3://spectra/lab
  chladni worker --database ... --objects ... --workers 4 --memory-bytes 64GiB --kinds eigenbasis,field_basis

A worker takes what fits its memory and its kinds, of the versions that it knows. The first SIGTERM drains, a
second one ends it at once; the job of one that is killed goes to another when its lease runs out. It answers
no requests: settings of the network and of requests have no effect.";

/// Parses the command line and runs the chosen command.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Demo(arguments) => demo::demo(arguments),
        Command::Serve(config) => serve::serve(*config),
        Command::Solve(arguments) => solve::solve(*arguments),
        Command::Join(arguments) => join::join(*arguments),
        Command::Eigsh(arguments) => eigsh::eigsh(*arguments),
        Command::Field(arguments) => field::field(*arguments),
        Command::Run(arguments) => run::run(*arguments),
        Command::Batch(arguments) => batch::batch(*arguments),
        Command::Distances(arguments) => apply::distances(arguments),
        Command::Filter(arguments) => apply::filtered(arguments),
        Command::Design(arguments) => apply::design(arguments),
        Command::Hatching(arguments) => pictures::hatching(arguments),
        Command::Fur(arguments) => pictures::fur(arguments),
        Command::Quads(arguments) => quads::quads(arguments),
        Command::MapCollection(arguments) => map_collection::collect(*arguments),
        Command::Check(arguments) => check::check(arguments),
        Command::Verify(arguments) => verify::verify(*arguments),
        Command::Backup(arguments) => backup::backup(arguments),
        Command::Restore(arguments) => restore::restore(arguments),
        Command::Doctor(arguments) => doctor::doctor(arguments),
        Command::Compact(arguments) => compact::compact(arguments),
        #[cfg(feature = "cluster")]
        Command::Migrate(arguments) => migrate::migrate(arguments),
        Command::Sample(arguments) => sample::sample(arguments),
        Command::Worker(config) => serve::work(*config),
        Command::WorkerProcess(arguments) => worker::worker(arguments),
        Command::Openapi => openapi(),
    };
    result.unwrap_or_else(|error| {
        // A reader that closed the pipe, such as `head`, has all that it wanted.
        if error.is_closed_pipe() {
            return ExitCode::SUCCESS;
        }
        eprintln!("chladni: {error}");
        error.exit_code()
    })
}

/// Runs `chladni openapi`.
fn openapi() -> Result<ExitCode, CliError> {
    let document = crate::http::openapi().map_err(|error| CliError::Service(error.to_string()))?;
    std::io::stdout().write_all(document.as_bytes()).map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_and_flag_has_a_help_text() {
        for command in Cli::command().get_subcommands() {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            for argument in command.get_arguments() {
                assert!(argument.get_help().is_some(), "{} {}", command.get_name(), argument.get_id());
            }
        }
    }
}
