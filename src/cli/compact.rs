//! `compact`: gives the free space of a data folder back to the disk.

use super::{CliError, bytes, serve::runtime};
use crate::store::{Store, StoreOptions};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Give the space of what was deleted back to the disk, all of it
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct CompactArguments {
    /// Folder of the databases; no server may use it meanwhile
    #[arg(long, value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data")]
    data: PathBuf,

    /// Print one line of JSON
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni compact --data /srv/chladni

A running server gives space back by itself, some at a time. A folder that an earlier version made needs this once: its databases are
written anew, which takes as much free space as they have content.

Exit codes: 0 done; 3 the folder cannot be used, or there is no room.";

/// Compacts a data folder.
pub fn compact(arguments: CompactArguments) -> Result<ExitCode, CliError> {
    let service = |error: &dyn std::fmt::Display| CliError::Service(error.to_string());
    if !arguments.data.join("meta.db").exists() {
        return Err(CliError::Usage(format!("{} is no data folder: it holds no databases", arguments.data.display())));
    }
    let compacted = runtime()?.block_on(async {
        let options = StoreOptions { least_free_bytes: 0, ..StoreOptions::new(&arguments.data) };
        let store = Store::open(options).await.map_err(|error| service(&error))?;
        let compacted = store.compact().await;
        store.close().await;
        compacted.map_err(|error| service(&error))
    })?;
    let text = if arguments.json {
        serde_json::to_string(&compacted).map_err(|error| CliError::stdout(error.into()))?
    } else {
        format!("The databases took {} and take {} now.", bytes(compacted.before), bytes(compacted.after))
    };
    writeln!(std::io::stdout().lock(), "{text}").map_err(CliError::stdout)?;
    Ok(ExitCode::SUCCESS)
}
