//! The device of this process: opened once, given up when it fails, and the way back to the CPU.

use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, RwLock};

use chladni_base::Monitor;
use chladni_base::notes::DENSE_SOLVER;

use super::GpuChoice;
use super::engine::Engine;
use super::error::GpuError;
use crate::DenseMatrix;
use crate::EigenError;
use crate::eigen::{ComputedOn, EigenPairs, Pencil, SymmetricDefiniteSolver};

/// How often a device that failed is opened again, in the life of a process.
const REOPENINGS: i64 = 3;

/// Sizes below which no device is opened: the CPU needs milliseconds for them, and any device longer.
const LEAST_SIZE: usize = 64;

/// The same where the device is only used if it is faster.
const LEAST_SIZE_OF_AUTO: usize = 768;

/// Columns below which products stay on the CPU.
const LEAST_COLUMNS: usize = 32;

/// The same where the device is only used if it is faster.
const LEAST_COLUMNS_OF_AUTO: usize = 256;

/// Rows below which nothing is measured on a device that is only used if it is faster: the CPU is done before a card is
/// open.
const LEAST_ROWS_OF_AUTO: usize = 100_000;

/// A graphics card, if there is one, and the CPU. The card is opened when it is first needed.
pub struct Accelerator {
    choice: GpuChoice,
    state: Mutex<State>,
    fallbacks: AtomicU64,
    reopenings_left: AtomicI64,
    lose_once: AtomicBool,
}

struct State {
    engine: Option<Arc<Engine>>,
    /// Why there is no engine.
    reason: Option<GpuError>,
    openings_left: u32,
}

impl Accelerator {
    /// An accelerator over the chosen adapter, which is not opened yet. Where it cannot be, everything runs on the CPU,
    /// and [`reason`](Self::reason) tells why.
    pub fn new(choice: GpuChoice) -> Self {
        let openings_left = if choice == GpuChoice::Off { 0 } else { 1 };
        let state = State { engine: None, reason: None, openings_left };
        Self {
            choice,
            state: Mutex::new(state),
            fallbacks: AtomicU64::new(0),
            reopenings_left: REOPENINGS.into(),
            lose_once: AtomicBool::new(false),
        }
    }

    /// No graphics card.
    pub fn off() -> Self {
        Self::new(GpuChoice::Off)
    }

    /// Opens the adapter, tests its kernels and, for `auto`, measures it; does nothing where that was done before.
    pub fn open(&self) {
        self.engine();
    }

    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn with(engine: Engine, choice: GpuChoice) -> Self {
        let state = State { engine: Some(Arc::new(engine)), reason: None, openings_left: 0 };
        Self { state: Mutex::new(state), reopenings_left: 0.into(), ..Self::new(choice) }
    }

    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn inject(&self, fault: impl FnOnce(&mut super::faults::Faults)) {
        if let Some(engine) = &self.state().engine {
            fault(&mut engine.device().faults.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// Makes the next problem that reaches the device find it lost: for tests of whatever is built on this.
    pub fn lose_once(&self) {
        self.lose_once.store(true, Ordering::Relaxed);
    }

    /// What was chosen.
    pub fn choice(&self) -> &GpuChoice {
        &self.choice
    }

    /// Whether a device is open.
    pub fn available(&self) -> bool {
        self.state().engine.is_some()
    }

    /// The name of the open device.
    pub fn adapter(&self) -> Option<String> {
        self.state().engine.as_ref().map(|engine| engine.name().to_owned())
    }

    /// Why no device is open; nothing where none was wanted.
    pub fn reason(&self) -> Option<GpuError> {
        self.state().reason.clone()
    }

    /// How often work came back to the CPU because the device failed.
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks.load(Ordering::Relaxed)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn engine(&self) -> Option<Arc<Engine>> {
        let mut state = self.state();
        if state.engine.is_none() && state.openings_left > 0 {
            // Others wait for the lock, and find what this call leaves.
            state.openings_left -= 1;
            match Engine::open(&self.choice) {
                Ok(engine) => (state.engine, state.reason) = (Some(Arc::new(engine)), None),
                Err(error) => (state.reason, state.openings_left) = (Some(error), 0),
            }
        }
        state.engine.clone()
    }

    /// The device, if it should solve a problem of size `d`.
    fn engine_for(&self, d: usize, count: usize) -> Option<Arc<Engine>> {
        let least = if self.choice == GpuChoice::Auto { LEAST_SIZE_OF_AUTO } else { LEAST_SIZE };
        if count == 0 || d < least {
            return None;
        }
        self.engine().filter(|engine| engine.prefers_device(d, count))
    }

    fn least_columns(&self) -> usize {
        if self.choice == GpuChoice::Auto { LEAST_COLUMNS_OF_AUTO } else { LEAST_COLUMNS }
    }

    /// The device, if products with `n × q` numbers should run there.
    pub(super) fn engine_for_products(&self, n: usize, q: usize) -> Option<Arc<Engine>> {
        if q < self.least_columns() || n < q {
            return None;
        }
        self.engine().filter(|engine| engine.wants_products(n, q))
    }

    /// The device, if it should lift `q` columns to `n` rows by a matrix with so many entries.
    pub(super) fn engine_for_lifting(&self, n: usize, entries: usize, q: usize) -> Option<Arc<Engine>> {
        if q < self.least_columns() || n < q {
            return None;
        }
        self.engine().filter(|engine| engine.wants_lifting(n, entries, q))
    }

    /// The device, if it should measure `q` pairs on `n` rows, lifted by a matrix with so many entries.
    pub(super) fn engine_for_measuring(&self, n: usize, entries: usize, q: usize) -> Option<Arc<Engine>> {
        let least = if self.choice == GpuChoice::Auto { LEAST_ROWS_OF_AUTO } else { LEAST_SIZE };
        if q == 0 || n < least {
            return None;
        }
        self.engine().filter(|engine| engine.wants_measuring(n, entries, q))
    }

    /// Counts and notes, under a name, that work failed on the device.
    pub(super) fn failed(&self, engine: &Arc<Engine>, error: &GpuError, name: &'static str, monitor: &dyn Monitor) {
        monitor.note(name, &format!("the CPU instead of {}: {error}", engine.name()));
        self.fallbacks.fetch_add(1, Ordering::Relaxed);
        let mut state = self.state();
        if error.is_final() && state.engine.as_ref().is_some_and(|open| Arc::ptr_eq(open, engine)) {
            state.engine = None;
            state.reason = Some(error.clone());
            // A driver that was reset may come back, but one that fails again and again costs more than it gives.
            state.openings_left = self.reopenings_left.fetch_sub(1, Ordering::Relaxed).clamp(0, 1) as u32;
        }
    }
}

impl SymmetricDefiniteSolver for Accelerator {
    fn name(&self) -> &'static str {
        if self.available() { "gpu" } else { "cpu" }
    }

    fn lowest(
        &self,
        a: DenseMatrix,
        b: DenseMatrix,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<EigenPairs, EigenError> {
        let mut pencil = Pencil::new(a, b, count, monitor)?;
        let mut computed_on = ComputedOn::Cpu;
        if let Some(engine) = self.engine_for(pencil.l.rows(), count) {
            let adapter = engine.name().to_owned();
            let solved = match self.lose_once.swap(false, Ordering::Relaxed) {
                true => Err(GpuError::Lost { reason: "as a test asked for".into() }),
                false => engine.lowest(&pencil.a, &pencil.l, count, monitor),
            };
            match solved {
                Ok((values, vectors)) => {
                    let mut pairs = pencil.finish(values, vectors, monitor);
                    monitor.note(DENSE_SOLVER, &adapter);
                    pairs.computed_on = ComputedOn::Gpu { adapter };
                    return Ok(pairs);
                }
                Err(GpuError::Cancelled(cancelled)) => return Err(cancelled.into()),
                Err(error) => {
                    self.failed(&engine, &error, DENSE_SOLVER, monitor);
                    computed_on = ComputedOn::CpuInstead { adapter, reason: error.to_string() };
                }
            }
        }
        let (values, vectors) = pencil.lowest_on_cpu(count, monitor)?;
        let mut pairs = pencil.finish(values, vectors, monitor);
        pairs.computed_on = computed_on;
        Ok(pairs)
    }
}

static CHOSEN: LazyLock<RwLock<Arc<Accelerator>>> = LazyLock::new(|| RwLock::new(Arc::new(Accelerator::off())));

/// Makes a choice that of the whole process, and gives the accelerator over it: a device belongs to the machine, not to
/// a job. Until the first choice there is none. The same choice again changes nothing.
pub fn choose(choice: GpuChoice) -> Arc<Accelerator> {
    let mut chosen = CHOSEN.write().unwrap_or_else(PoisonError::into_inner);
    if chosen.choice != choice {
        *chosen = Arc::new(Accelerator::new(choice));
    }
    chosen.clone()
}

/// The accelerator of this process.
pub fn accelerator() -> Arc<Accelerator> {
    CHOSEN.read().unwrap_or_else(PoisonError::into_inner).clone()
}
