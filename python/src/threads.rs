//! The threads that the work runs on: a pool of the package's own, made when it is first needed.
//!
//! A process that was forked, as PyTorch's loaders and `multiprocessing` do on Linux, has a copy of the pool and none
//! of its threads: work given to it would wait for ever. The pool therefore belongs to the process that made it, and
//! another process makes its own.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::ThreadPool;

use super::errors::{Failure, Kind};

struct ThreadPoolState {
    /// Threads asked for; 0 for one per core.
    wanted: usize,
    /// The process that the pool belongs to, and the pool.
    pool: Option<(u32, Arc<ThreadPool>)>,
}

static HELD: Mutex<ThreadPoolState> = Mutex::new(ThreadPoolState { wanted: 0, pool: None });

/// The pool of this process.
///
/// # Errors
/// [`Failure`] where its threads cannot be started.
pub fn pool() -> Result<Arc<ThreadPool>, Failure> {
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = &held.pool
        && *owner == process
    {
        return Ok(Arc::clone(pool));
    }
    let made = rayon::ThreadPoolBuilder::new().num_threads(held.wanted).thread_name(|k| format!("chladni-{k}")).build();
    let pool = Arc::new(made.map_err(|error| Failure::new(Kind::Solve, "no-threads", error.to_string()))?);
    if let Some((_, lost)) = held.pool.replace((process, Arc::clone(&pool))) {
        // Of a pool that was forked there are no threads that could be waited for.
        std::mem::forget(lost);
    }
    Ok(pool)
}

/// Sets the number of threads of what is called from now on; 0 for one per core.
#[pyfunction]
pub fn set_threads(count: usize) {
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    held.wanted = count;
    // Whoever works in it holds it until the work is done.
    let former = held.pool.take();
    if former.as_ref().is_some_and(|(owner, _)| *owner != std::process::id()) {
        std::mem::forget(former);
    }
}

/// The number of threads that work runs on.
#[pyfunction]
pub fn get_threads() -> PyResult<usize> {
    Ok(pool()?.current_num_threads())
}
