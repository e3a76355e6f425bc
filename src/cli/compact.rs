//! `compact`: gives the free space of a data folder back to the disk.

use super::{CliError, bytes, data_folder::DataFolder};
use std::process::ExitCode;

/// Return all the space of deleted content to the disk
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct CompactArguments {
    #[command(flatten)]
    data: DataFolder,
}

const EXAMPLES: &str = "\
Examples:
  chladni compact --data /srv/chladni

A running server returns space by itself, a little at a time. A folder made by an earlier version needs this once: its databases are
rewritten, which takes as much free space as they have content.

No server may use the folder in the meantime.

Exit codes: 0 done; 3 the folder cannot be used, or there is not enough space.";

/// Compacts a data folder.
pub fn compact(arguments: CompactArguments) -> Result<ExitCode, CliError> {
    let data = arguments.data;
    let compacted = data.with_store(|options| options, |store| async move { store.compact().await })?;
    data.print(&compacted, || {
        format!("The databases took {} and take {} now.", bytes(compacted.before), bytes(compacted.after))
    })?;
    Ok(ExitCode::SUCCESS)
}
