//! `restore`: makes a data folder of a backup.

use super::{CliError, data_folder::DataFolder, doctor};
use crate::store;
use std::path::PathBuf;
use std::process::ExitCode;

/// Create a data folder from a backup, after checking every hash in it
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct RestoreArguments {
    /// Folder of the backup; it is not changed
    #[arg(value_name = "FOLDER")]
    backup: PathBuf,

    #[command(flatten)]
    data: DataFolder,
}

const EXAMPLES: &str = "\
Examples:
  chladni restore /backups/chladni --data /srv/chladni

Exit codes: 0 done; 1 done, but something in the backup is damaged; 3 a folder cannot be used.";

/// Restores a backup.
pub fn restore(arguments: RestoreArguments) -> Result<ExitCode, CliError> {
    let RestoreArguments { backup, data } = arguments;
    let found = data.wait(store::restore(&backup, &data.folder))?;
    data.print(&found, || doctor::text_report(&found))?;
    Ok(if found.is_ill() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}
