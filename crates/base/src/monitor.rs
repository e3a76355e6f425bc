//! The one hook through which long work reports its stage, progress and detail, and learns that it was cancelled.

/// Work was asked to stop at a checkpoint and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// The names under which a [`Monitor`] takes notes, and under which a product shows them.
pub mod notes {
    /// What solved each dense problem where a graphics card had to do with it, or why that did not.
    pub const DENSE_SOLVER: &str = "dense_solver";

    /// What measured the errors of an approximation where a graphics card had to do with it, or why that did not.
    pub const MEASURED_ON: &str = "measured_on";

    /// Where a faster way was given up for a surer one, and why.
    pub const FALLBACKS: &str = "fallbacks";

    /// Every name.
    pub const ALL: [&str; 3] = [DENSE_SOLVER, MEASURED_ON, FALLBACKS];
}

/// Watches long work. Implementations are called from many threads at once and must return quickly.
pub trait Monitor: Sync {
    /// A stage begins; the one before it, if any, has ended. Stage names are stable identifiers (`operator`,
    /// `sampling`, …).
    fn stage(&self, name: &'static str);

    /// The fraction of the current stage that is done, in `0..=1`. It may arrive out of order from parallel work.
    fn progress(&self, fraction: f64);

    /// Where the work stands within its stage, in a few words for people: `level 2 of 3, iteration 1, slice 4 of 8`. It
    /// holds until the next call or the next stage.
    fn detail(&self, _text: &str) {}

    /// How the result came about, where that is worth keeping with it, under one of the [names](notes):
    /// `("dense_solver", "NVIDIA H200")`.
    fn note(&self, _name: &'static str, _text: &str) {}

    /// Ends the work with [`Cancelled`] where that was asked for. Called often: at least every few milliseconds of
    /// work.
    fn checkpoint(&self) -> Result<(), Cancelled>;

    /// Bytes of memory that the work was promised, by an estimate made before it began. Work that counts what it will
    /// need ends where that is more. `None` where nobody promised anything.
    fn promised_bytes(&self) -> Option<u64> {
        None
    }
}

/// Watches nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Monitor for Unwatched {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
}

/// Passes on notes and cancellation alone: for a solver within a solver, whose stages and progress are not those of the
/// caller.
pub struct Quiet<'a>(pub &'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn note(&self, name: &'static str, text: &str) {
        self.0.note(name, text);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.0.checkpoint()
    }
    fn promised_bytes(&self) -> Option<u64> {
        self.0.promised_bytes()
    }
}

/// Passes everything on, and promises a part of the memory alone: for a step that the work can do without, beside what
/// it already holds.
pub struct Share<'a> {
    /// Who watches the whole.
    pub whole: &'a dyn Monitor,
    /// What the step may take of what was promised for all, in bytes.
    pub bytes: u64,
}

impl Monitor for Share<'_> {
    fn stage(&self, name: &'static str) {
        self.whole.stage(name);
    }
    fn progress(&self, fraction: f64) {
        self.whole.progress(fraction);
    }
    fn detail(&self, text: &str) {
        self.whole.detail(text);
    }
    fn note(&self, name: &'static str, text: &str) {
        self.whole.note(name, text);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.whole.checkpoint()
    }
    fn promised_bytes(&self) -> Option<u64> {
        self.whole.promised_bytes().map(|promised| promised.min(self.bytes))
    }
}

/// Passes everything on, and tells progress as that of the whole stage: for a step of which several make one.
pub struct Portion<'a> {
    /// Who watches the whole.
    pub whole: &'a dyn Monitor,
    /// Which step it is, from 0, and of how many.
    pub step: (usize, usize),
}

impl Monitor for Portion<'_> {
    fn stage(&self, name: &'static str) {
        self.whole.stage(name);
    }
    fn progress(&self, fraction: f64) {
        let (step, steps) = self.step;
        self.whole.progress((step as f64 + fraction.clamp(0.0, 1.0)) / steps.max(1) as f64);
    }
    fn detail(&self, text: &str) {
        self.whole.detail(text);
    }
    fn note(&self, name: &'static str, text: &str) {
        self.whole.note(name, text);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.whole.checkpoint()
    }
    fn promised_bytes(&self) -> Option<u64> {
        self.whole.promised_bytes()
    }
}

/// Seconds spent in each stage, in order of first appearance; wraps another monitor and passes everything on to it.
pub struct StageClock<'a> {
    inner: &'a dyn Monitor,
    state: std::sync::Mutex<ClockState>,
}

#[derive(Default)]
struct ClockState {
    seconds: Vec<(&'static str, f64)>,
    current: Option<(&'static str, std::time::Instant)>,
    notes: Vec<(&'static str, String)>,
}

impl ClockState {
    fn close(&mut self) {
        if let Some((name, since)) = self.current.take() {
            let elapsed = since.elapsed().as_secs_f64();
            match self.seconds.iter_mut().find(|(n, _)| *n == name) {
                Some((_, total)) => *total += elapsed,
                None => self.seconds.push((name, elapsed)),
            }
        }
    }
}

impl<'a> StageClock<'a> {
    /// A clock that has not begun a stage yet.
    pub fn new(inner: &'a dyn Monitor) -> Self {
        Self { inner, state: std::sync::Mutex::default() }
    }

    /// What was noted, each text once, in order.
    pub fn notes(&self) -> Vec<(&'static str, String)> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner).notes.clone()
    }

    /// Ends the last stage and gives the seconds of each.
    pub fn finish(self) -> Vec<(&'static str, f64)> {
        let mut state = self.state.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        state.close();
        state.seconds
    }
}

impl Monitor for StageClock<'_> {
    fn stage(&self, name: &'static str) {
        {
            let mut state = self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            state.close();
            state.current = Some((name, std::time::Instant::now()));
        }
        self.inner.stage(name);
    }
    fn progress(&self, fraction: f64) {
        self.inner.progress(fraction);
    }
    fn detail(&self, text: &str) {
        self.inner.detail(text);
    }
    fn note(&self, name: &'static str, text: &str) {
        {
            let mut state = self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if !state.notes.iter().any(|(n, t)| (*n, t.as_str()) == (name, text)) {
                state.notes.push((name, text.to_owned()));
            }
        }
        self.inner.note(name, text);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.inner.checkpoint()
    }
    fn promised_bytes(&self) -> Option<u64> {
        self.inner.promised_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Told(std::sync::Mutex<Vec<f64>>);

    impl Monitor for Told {
        fn stage(&self, _name: &'static str) {}
        fn progress(&self, fraction: f64) {
            self.0.lock().unwrap().push(fraction);
        }
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Ok(())
        }
    }

    #[test]
    fn steps_of_a_stage_tell_one_progress_that_never_falls() {
        let told = Told::default();
        for step in 0..4 {
            let portion = Portion { whole: &told, step: (step, 4) };
            [0.0, 0.5, 1.0].into_iter().for_each(|fraction| portion.progress(fraction));
        }
        let told = told.0.into_inner().unwrap();
        assert!(told.is_sorted(), "{told:?}");
        assert_eq!((told[1], told.last()), (0.125, Some(&1.0)));
    }
}
