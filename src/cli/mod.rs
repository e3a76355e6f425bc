//! The command line: one file per command.

/// Parses the command line and runs the chosen command.
pub fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
