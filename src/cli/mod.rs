//! The command line: one file per command.

mod apply;
mod arrays;
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
mod functions;
mod input;
mod join;
mod map_collection;
mod memory;
#[cfg(feature = "cluster")]
mod migrate;
mod motion;
mod output;
mod pictures;
mod points;
mod poison;
mod private;
mod progress;
mod quads;
mod restore;
mod run;
mod sample;
pub mod serve;
mod shapes;
mod solve;
mod stored;
mod text;
mod vectors;
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
  chladni eigsh S.npz M.npz --count 200                    the same for any sparse symmetric matrices
  chladni check scan.obj                                   what is wrong with a mesh, what was repaired
  chladni verify bunny.npz bunny.ply                       whether a basis is what it claims to be
  chladni sample genus-3 -n 100000 -o genus-3.ply          a mesh to try things out on

Exit codes: 0 done; 1 the mesh or the work failed; 2 wrong usage; 3 a file, the network or the storage failed.
Run 'chladni COMMAND --help' for more about a command.";

#[derive(Debug, clap::Subcommand)]
enum Command {
    Demo(demo::DemoArguments),
    /// Serve the API over HTTP, with the queue, the storage and workers in separate processes
    #[command(after_help = SERVE_HELP)]
    Serve(Box<Config>),
    Solve(Box<solve::SolveArguments>),
    Join(Box<join::JoinArguments>),
    Eigsh(Box<eigsh::EigshArguments>),
    Field(Box<field::FieldArguments>),
    Run(Box<run::RunArguments>),
    Batch(Box<batch::BatchArguments>),
    Distances(apply::DistancesArguments),
    MeshDistances(apply::MeshDistancesArguments),
    Signatures(points::SignaturesArguments),
    SimilarPoints(points::SimilarPointsArguments),
    Filter(apply::FilterArguments),
    Project(functions::ProjectArguments),
    Reconstruct(functions::ReconstructArguments),
    Compress(functions::CompressArguments),
    Decompress(functions::DecompressArguments),
    ValueGradient(motion::ValueGradientArguments),
    Simulate(motion::SimulateArguments),
    FamilySpectrum(motion::FamilySpectrumArguments),
    CompareBases(shapes::CompareBasesArguments),
    CompareShapes(shapes::CompareShapesArguments),
    FunctionalMap(shapes::FunctionalMapArguments),
    Design(apply::DesignArguments),
    Eigenfields(vectors::EigenfieldsArguments),
    VectorTransport(vectors::VectorTransportArguments),
    HodgeDecomposition(vectors::HodgeDecompositionArguments),
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
    /// Run jobs for servers that share their records: takes the settings of `serve`, without an API
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

A server that others can reach does not start without API keys unless given --insecure. The first SIGTERM
or Ctrl-C drains: running jobs get --drain-seconds, then they return to the queue. A second one ends the
process at once.";

const WORKER_HELP: &str = "\
Examples:
  chladni worker --database postgres://chladni@db/chladni --objects s3://spectra/lab
  chladni worker --database ... --objects ... --workers 4 --memory-bytes 64GiB --kinds eigenbasis,field_basis

A worker takes jobs that fit its memory and its kinds, of the solver versions that it knows. The first SIGTERM
drains it, a second one ends it at once; the job of a killed worker goes to another when its lease expires. It
answers no requests, so settings of the network and of requests have no effect.";

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
        Command::MeshDistances(arguments) => apply::mesh_distances(arguments),
        Command::Signatures(arguments) => points::signatures(arguments),
        Command::SimilarPoints(arguments) => points::similar_points(arguments),
        Command::Filter(arguments) => apply::filtered(arguments),
        Command::Project(arguments) => functions::project(arguments),
        Command::Reconstruct(arguments) => functions::reconstruct(arguments),
        Command::Compress(arguments) => functions::compress(arguments),
        Command::Decompress(arguments) => functions::decompress(arguments),
        Command::ValueGradient(arguments) => motion::value_gradient(arguments),
        Command::Simulate(arguments) => motion::simulate(arguments),
        Command::FamilySpectrum(arguments) => motion::family_spectrum(arguments),
        Command::CompareBases(arguments) => shapes::compare_bases(arguments),
        Command::CompareShapes(arguments) => shapes::compare_shapes(arguments),
        Command::FunctionalMap(arguments) => shapes::functional_map(arguments),
        Command::Design(arguments) => apply::design(arguments),
        Command::Eigenfields(arguments) => vectors::eigenfields(arguments),
        Command::VectorTransport(arguments) => vectors::vector_transport(arguments),
        Command::HodgeDecomposition(arguments) => vectors::hodge_decomposition(arguments),
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
