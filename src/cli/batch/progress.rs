//! What is told of a folder: a bar on a terminal, a line for each mesh elsewhere, and how it went.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;

use crate::cli::CliError;

/// What became of a mesh.
pub enum Outcome {
    /// Its result was made.
    Made(PathBuf),
    /// Its result was there.
    There(PathBuf),
    /// Why it has none.
    Failed(String),
}

#[derive(Default)]
struct Counts {
    made: usize,
    there: usize,
    failed: usize,
}

/// The lines, the bar and the counts.
pub struct Lines {
    json: bool,
    quiet: bool,
    all: usize,
    bar: ProgressBar,
    counts: Mutex<Counts>,
}

impl Lines {
    pub fn new(all: usize, json: bool, quiet: bool) -> Self {
        let hidden = quiet || json || !std::io::stderr().is_terminal();
        let target = if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(all as u64), target);
        // The template is a constant; should it ever be wrong, the plain bar does.
        if let Ok(style) = ProgressStyle::with_template("  {bar:40.cyan/dim} {pos} of {len}, {eta} left  {msg}") {
            bar.set_style(style.progress_chars("━━─"));
        }
        Self { json, quiet, all, bar, counts: Mutex::default() }
    }

    /// Tells what became of a mesh.
    ///
    /// # Errors
    /// [`CliError::Io`] where standard output cannot be written.
    pub fn report(&self, mesh: &Path, outcome: &Outcome, seconds: f64) -> Result<(), CliError> {
        let name = mesh.file_name().unwrap_or_default().to_string_lossy();
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let (status, output, error) = match outcome {
            Outcome::Made(path) => ("made", Some(path), None),
            Outcome::There(path) => ("there", Some(path), None),
            Outcome::Failed(reason) => ("failed", None, Some(reason)),
        };
        *match outcome {
            Outcome::Made(_) => &mut counts.made,
            Outcome::There(_) => &mut counts.there,
            Outcome::Failed(_) => &mut counts.failed,
        } += 1;
        let done = counts.made + counts.there + counts.failed;
        if self.json {
            // As text: names need not be UTF-8.
            let (mesh, output) = (mesh.to_string_lossy(), output.map(|path| path.to_string_lossy()));
            let line = json!({"mesh": mesh, "status": status, "output": output, "error": error, "seconds": seconds});
            writeln!(std::io::stdout().lock(), "{line}").map_err(CliError::stdout)?;
        } else if let Some(reason) = error {
            // Failures are told even to those who want no progress.
            self.bar.suspend(|| to_stderr(&format!("chladni: {name}: {reason}")));
        } else if self.bar.is_hidden() && !self.quiet {
            let how = match outcome {
                Outcome::There(_) => "up to date".to_owned(),
                _ => format!("{status} in {}", crate::cli::seconds(seconds)),
            };
            to_stderr(&format!("[{done} of {}] {name}: {how}", self.all));
        }
        self.bar.set_message(name.into_owned());
        self.bar.inc(1);
        Ok(())
    }

    /// Ends with how it went, and gives the number of failures.
    ///
    /// # Errors
    /// As [`report`](Self::report), but for a closed pipe: everything is done, and whether it failed is still to be
    /// told.
    pub fn finish(self, time: &str) -> Result<usize, CliError> {
        self.bar.finish_and_clear();
        let Counts { made, there, failed } = self.counts.into_inner().unwrap_or_else(PoisonError::into_inner);
        if !self.json {
            let line = format!("{made} made, {there} there already, {failed} failed in {time}");
            let written = writeln!(std::io::stdout().lock(), "{line}").map_err(CliError::stdout);
            if let Err(error) = written
                && !error.is_closed_pipe()
            {
                return Err(error);
            }
        }
        Ok(failed)
    }
}

/// A line for whoever reads it: nobody may be there, which must not end the work.
fn to_stderr(line: &str) {
    let _written = writeln!(std::io::stderr().lock(), "{line}");
}
