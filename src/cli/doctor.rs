//! `doctor`: looks at everything that a data folder holds.

use super::{CliError, Table, bytes, data_folder::DataFolder, grouped};
use crate::store::{Examination, StoreOptions};
use std::process::ExitCode;

/// Check every record, every piece of content and every hash of a data folder, and repair what can be repaired
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct DoctorArguments {
    #[command(flatten)]
    data: DataFolder,

    /// Do what can be done: enqueue jobs whose bases are damaged, clear dangling references, delete damaged content
    /// that nothing refers to
    #[arg(long)]
    repair: bool,

    /// Use databases that do not belong together anyway; what one of them lacks is lost
    #[arg(long)]
    pair: bool,
}

const EXAMPLES: &str = "\
Examples:
  chladni doctor --data /srv/chladni
  chladni doctor --data /srv/chladni --repair            then start the server: it recomputes damaged bases

A damaged mesh is repaired by uploading the same file again, a damaged basis also by submitting the same job again.

No server may use the folder in the meantime.

Exit codes: 0 all is well, or was repaired; 1 something is wrong; 3 the folder cannot be used.";

/// Examines a data folder.
pub fn doctor(arguments: DoctorArguments) -> Result<ExitCode, CliError> {
    let DoctorArguments { data, repair, pair } = arguments;
    let settings = |options| StoreOptions { pair_anyway: pair, ..options };
    let found = data.with_store(settings, |store| async move { store.examine(repair).await })?;
    data.print(&found, || text_report(&found))?;
    Ok(if found.is_ill() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// An examination as text for people.
pub(super) fn text_report(found: &Examination) -> String {
    let mut counts = Table::new(&["looked at", ""]);
    for (name, count) in [
        ("meshes", found.meshes),
        ("bases", found.bases),
        ("fields", found.fields),
        ("jobs", found.jobs),
        ("pieces of content", found.blobs),
    ] {
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
