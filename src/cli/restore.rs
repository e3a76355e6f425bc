//! `restore`: makes a data folder of a backup.

use super::{CliError, doctor, serve::runtime};
use crate::store;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make a data folder of a backup, after every hash in it was checked
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct RestoreArguments {
    /// Folder of the backup; it stays as it is
    #[arg(value_name = "FOLDER")]
    backup: PathBuf,

    /// Folder of the databases to be made; it may hold none yet
    #[arg(long, value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data")]
    data: PathBuf,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni restore /backups/chladni --data /srv/chladni

Exit codes: 0 done; 1 done, but something in the backup is damaged; 3 a folder cannot be used.";

/// Restores a backup.
pub fn restore(arguments: RestoreArguments) -> Result<ExitCode, CliError> {
    let found = runtime()?
        .block_on(store::restore(&arguments.backup, &arguments.data))
        .map_err(|error| CliError::Service(error.to_string()))?;
    let text = if arguments.json {
        serde_json::to_string(&found).map_err(|error| CliError::stdout(error.into()))?
    } else {
        doctor::page(&found)
    };
    writeln!(std::io::stdout().lock(), "{}", text.trim_end()).map_err(CliError::stdout)?;
    Ok(if found.is_ill() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
