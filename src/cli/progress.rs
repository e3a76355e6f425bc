//! One progress bar per stage, on a terminal; nothing elsewhere.

use chladni_base::{Cancelled, Monitor};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Steps of a bar; a fraction is rounded to one of them.
const STEPS: u64 = 1000;

/// Progress bars on standard error, one below the other, one for each stage.
pub struct StageBars {
    hidden: bool,
    current: Mutex<Option<Stage>>,
}

struct Stage {
    name: String,
    began: Instant,
    bar: ProgressBar,
}

impl StageBars {
    /// Bars that are drawn where standard error is a terminal and `quiet` is false.
    pub fn new(quiet: bool) -> Self {
        Self { hidden: quiet, current: Mutex::new(None) }
    }

    /// Begins a stage, which ends the one before. The same stage again changes nothing.
    pub fn begin(&self, name: &str) {
        let mut current = self.lock();
        if current.as_ref().is_some_and(|stage| stage.name == name) {
            return;
        }
        end(current.take());
        let target = if self.hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target).with_message(name.to_owned());
        // The template is a constant; should it ever be wrong, the plain bar does.
        if let Ok(style) = ProgressStyle::with_template("  {msg:<12} {bar:40.cyan/dim} {percent:>3} %  {prefix}") {
            bar.set_style(style.progress_chars("━━─"));
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        *current = Some(Stage { name: name.to_owned(), began: Instant::now(), bar });
    }

    /// Sets the fraction of the current stage that is done. It never goes backwards.
    pub fn advance(&self, fraction: f64) {
        if let Some(stage) = self.lock().as_ref() {
            let position = (fraction.clamp(0.0, 1.0) * STEPS as f64) as u64;
            if position > stage.bar.position() {
                stage.bar.set_position(position);
            }
        }
    }

    /// Says where the current stage stands, in a few words; none take it away.
    pub fn show_detail(&self, detail: &str) {
        if let Some(stage) = self.lock().as_ref() {
            stage.bar.set_prefix(detail.to_owned());
        }
    }

    /// Ends the last stage.
    pub fn finish(&self) {
        end(self.lock().take());
    }

    fn lock(&self) -> MutexGuard<'_, Option<Stage>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Leaves a full bar with its time behind.
fn end(stage: Option<Stage>) {
    let Some(stage) = stage else { return };
    if let Ok(style) = ProgressStyle::with_template("  {msg}") {
        stage.bar.set_style(style);
    }
    let seconds = super::seconds(stage.began.elapsed().as_secs_f64());
    stage.bar.finish_with_message(format!("{:<12} {seconds:>10}", stage.name));
}

impl Drop for StageBars {
    fn drop(&mut self) {
        if let Some(stage) = self.lock().take() {
            stage.bar.abandon();
        }
    }
}

impl Monitor for StageBars {
    fn stage(&self, name: &'static str) {
        self.begin(name);
    }
    fn progress(&self, fraction: f64) {
        self.advance(fraction);
    }
    fn detail(&self, text: &str) {
        self.show_detail(text);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
}
