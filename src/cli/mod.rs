//! The command line: one file per command.

mod error;
mod input;
mod progress;
mod solve;
mod text;

pub use error::CliError;
pub use input::{MeshInput, read_bytes};
pub use progress::StageBars;
pub use text::{Table, bytes, grouped, number, seconds};

use clap::Parser;
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
  chladni solve bunny.ply --count 500 --output bunny.npz   500 eigenpairs, without a server

Exit codes: 0 done; 1 the mesh or the work failed; 2 wrong usage; 3 a file, the network or the storage failed.
'chladni help COMMAND' tells more about a command.";

#[derive(Debug, clap::Subcommand)]
enum Command {
    Solve(solve::SolveArguments),
}

/// Parses the command line and runs the chosen command.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Solve(arguments) => solve::solve(arguments),
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
