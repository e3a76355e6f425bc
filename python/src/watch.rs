//! Long work on a thread of its own, while the calling one listens for signals.
//!
//! The calling thread gives up the interpreter's lock and waits. Some twenty times a second it takes the lock for as
//! long as Python needs to run what a signal has asked for, and to be told how far the work is; where that raises, the
//! work is asked to stop at its next checkpoint and the exception goes on.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use chladni_base::{Cancelled, Monitor};
use pyo3::prelude::*;

use super::errors::{Failure, Kind};
use super::threads;

/// How long a signal waits at most until somebody looks.
const PAUSE: Duration = Duration::from_millis(50);

/// Where the work stands, and whether it is to end.
#[derive(Default)]
struct Watch {
    cancelled: AtomicBool,
    stage: Mutex<&'static str>,
    /// The bits of the fraction of the stage that is done.
    done: AtomicU64,
}

impl Watch {
    fn stands(&self) -> (&'static str, f64) {
        let stage = *self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        (stage, f64::from_bits(self.done.load(Ordering::Relaxed)))
    }
}

impl Monitor for Watch {
    fn stage(&self, name: &'static str) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = name;
        self.done.store(0f64.to_bits(), Ordering::Relaxed);
    }

    fn progress(&self, fraction: f64) {
        self.done.store(fraction.to_bits(), Ordering::Relaxed);
    }

    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.cancelled.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }
}

/// Runs work on the pool of the package, without the interpreter's lock. `progress` is called with the stage and the
/// fraction of it that is done.
///
/// # Errors
/// What the work ends with; what a signal or `progress` raised; [`Kind::Solve`] where the work panicked, which would be
/// a mistake of the library.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&dyn Monitor) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let pool = threads::pool()?;
    let progress = progress.map(|callback| callback.clone().unbind());
    let watch = Watch::default();
    let (result, raised) = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, done) = channel::<()>();
            let watch = &watch;
            let worker = scope.spawn(move || {
                // Dropped when the work ends, in whichever way.
                let _sender = sender;
                pool.install(|| work(watch))
            });
            let mut raised = None;
            while done.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
                if raised.is_some() {
                    continue;
                }
                if let Err(error) = look(watch, progress.as_ref()) {
                    watch.cancelled.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            (worker.join(), raised)
        })
    });
    if let Some(error) = raised {
        return Err(error);
    }
    match result {
        Ok(result) => {
            if let (Ok(_), Some(callback)) = (&result, &progress) {
                callback.call1(py, ("done", 1.0))?;
            }
            Ok(result?)
        }
        Err(_) => Err(Failure::new(Kind::Solve, "internal", "the library failed at a place where it must not").into()),
    }
}

/// Lets Python answer signals, and tells how far the work is.
fn look(watch: &Watch, progress: Option<&Py<PyAny>>) -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        match progress {
            Some(callback) => callback.call1(py, watch.stands()).map(drop),
            None => Ok(()),
        }
    })
}
