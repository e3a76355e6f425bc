//! `doctor`: looks at everything that a data folder holds.

use super::{CliError, Table, bytes, grouped, serve::runtime};
use crate::store::{Examination, Store, StoreOptions};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Check every record, every piece of content and every hash of a data folder, and repair what can be repaired
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct DoctorArguments {
    /// Folder of the databases; no server may use it meanwhile
    #[arg(long, value_name = "FOLDER", env = "CHLADNI_DATA", default_value = "chladni-data")]
    data: PathBuf,

    /// Do what can be done: enqueue jobs whose bases are damaged, clear references to nothing, delete damaged content that nothing refers to
    #[arg(long)]
    repair: bool,

    /// Use databases that do not belong together as they are; what one of them lacks is lost
    #[arg(long)]
    pair: bool,

    /// Print one line of JSON instead of a table
    #[arg(long, help_heading = "Output")]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni doctor --data /srv/chladni
  chladni doctor --data /srv/chladni --repair            then start the server: it solves damaged bases anew

A damaged mesh is repaired by uploading the same file again, a damaged basis also by submitting the same job again.

Exit codes: 0 all is well, or was put right; 1 something is wrong; 3 the folder cannot be used.";

/// Examines a data folder.
pub fn doctor(arguments: DoctorArguments) -> Result<ExitCode, CliError> {
    let service = |error: &dyn std::fmt::Display| CliError::Service(error.to_string());
    if !arguments.data.join("meta.db").exists() && !arguments.data.join("blobs.db").exists() {
        return Err(CliError::Usage(format!("{} is no data folder: it holds no databases", arguments.data.display())));
    }
    let options =
        StoreOptions { least_free_bytes: 0, pair_anyway: arguments.pair, ..StoreOptions::new(&arguments.data) };
    let found = runtime()?.block_on(async {
        let store = Store::open(options).await.map_err(|error| service(&error))?;
        let found = store.examine(arguments.repair).await;
        store.close().await;
        found.map_err(|error| service(&error))
    })?;
    let text = if arguments.json {
        serde_json::to_string(&found).map_err(|error| CliError::stdout(error.into()))?
    } else {
        page(&found)
    };
    writeln!(std::io::stdout().lock(), "{}", text.trim_end()).map_err(CliError::stdout)?;
    Ok(if found.is_ill() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// An examination as text for people.
pub(super) fn page(found: &Examination) -> String {
    let mut counts = Table::new(&["looked at", ""]);
    for (name, count) in
        [("meshes", found.meshes), ("bases", found.bases), ("jobs", found.jobs), ("pieces of content", found.blobs)]
    {
        counts.row([name.to_owned(), grouped(count as usize)]);
    }
    counts.row(["bytes".to_owned(), bytes(found.bytes)]);
    let mut text = counts.to_string();
    if found.findings.is_empty() {
        text.push_str("\nAll is well.\n");
    }
    for finding in &found.findings {
        let mark = if finding.done { "done" } else { "to do" };
        text.push_str(&format!("\n{}.\n  {mark}: {}\n", finding.what, finding.remedy));
    }
    text
}
