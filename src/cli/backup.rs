//! `backup`: copies a data folder, in use or not.

use super::{CliError, bytes, data_folder::DataFolder, grouped};
use crate::store;
use std::path::PathBuf;
use std::process::ExitCode;

/// Back up a data folder while its server runs; what the backup already has is not copied again
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct BackupArguments {
    /// Folder of the backup; created if missing, brought up to date otherwise
    #[arg(value_name = "FOLDER")]
    backup: PathBuf,

    #[command(flatten)]
    data: DataFolder,
}

const EXAMPLES: &str = "\
Examples:
  chladni backup /backups/chladni --data /srv/chladni
  chladni restore /backups/chladni --data /srv/chladni-2

The backup is a consistent snapshot: every record in it has its content. It is a data folder of two files; keep older ones by copying it
once this command has ended. Copying the files of a running server would lose data.

Exit codes: 0 done; 1 done, but some of the source content is damaged; 3 a folder cannot be used.";

/// Backs a data folder up.
pub fn backup(arguments: BackupArguments) -> Result<ExitCode, CliError> {
    let BackupArguments { backup, data } = arguments;
    let report = data.wait(store::backup(&data.folder, &backup))?;
    data.print(&report, || {
        format!(
            "{} meshes, {} bases and {} jobs are in {}; {} of {} pieces of content were new, {}.",
            grouped(report.meshes as usize),
            grouped(report.bases as usize),
            grouped(report.jobs as usize),
            backup.display(),
            grouped(report.copied_blobs as usize),
            grouped(report.blobs as usize),
            bytes(report.copied_bytes),
        )
    })?;
    if report.damaged.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    let list = report.damaged.join(", ");
    eprintln!("chladni: content is damaged or missing in {}: {list}; see `chladni doctor`", data.folder.display());
    Ok(ExitCode::from(1))
}
