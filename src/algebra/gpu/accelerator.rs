//! The device of this process: opened once, given up when it fails, and the way back to the CPU.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, RwLock};

use super::GpuChoice;
use super::engine::Engine;
use super::error::GpuError;
use crate::algebra::DenseMatrix;
use crate::algebra::eigen::{ComputedOn, EigenError, EigenPairs, Pencil, SymmetricDefiniteSolver};
use crate::monitor::Monitor;

/// How often a device that failed is opened again, in the life of a process.
const REOPENINGS: u32 = 3;

/// A graphics card, if there is one, and the CPU.
pub struct Accelerator {
    choice: GpuChoice,
    state: Mutex<State>,
    fallbacks: AtomicU64,
}

struct State {
    engine: Option<Arc<Engine>>,
    /// Why there is no engine.
    reason: Option<GpuError>,
    reopenings_left: u32,
}

impl Accelerator {
    /// Opens the chosen adapter, tests its kernels and measures it. Where that fails, everything runs on the CPU, and
    /// [`reason`](Self::reason) tells why.
    pub fn new(choice: GpuChoice) -> Self {
        let (engine, reason) = if choice == GpuChoice::Off { (None, None) } else { open(&choice) };
        Self {
            choice,
            // What could not be opened at the start has nothing to come back from.
            state: Mutex::new(State { reopenings_left: if engine.is_some() { REOPENINGS } else { 0 }, engine, reason }),
            fallbacks: AtomicU64::new(0),
        }
    }

    /// No graphics card.
    pub fn off() -> Self {
        Self::new(GpuChoice::Off)
    }

    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn with(engine: Engine, choice: GpuChoice) -> Self {
        let state = State { engine: Some(Arc::new(engine)), reason: None, reopenings_left: 0 };
        Self { choice, state: Mutex::new(state), fallbacks: AtomicU64::new(0) }
    }

    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn inject(&self, fault: impl FnOnce(&mut super::faults::Faults)) {
        if let Some(engine) = &self.state().engine {
            fault(&mut engine.device().faults.lock().unwrap_or_else(PoisonError::into_inner));
        }
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
        if state.engine.is_none() && state.reopenings_left > 0 {
            state.reopenings_left -= 1;
            (state.engine, state.reason) = open(&self.choice);
        }
        state.engine.clone()
    }

    /// Notes that work failed on the device.
    fn failed(&self, engine: &Arc<Engine>, error: &GpuError) {
        self.fallbacks.fetch_add(1, Ordering::Relaxed);
        let mut state = self.state();
        if error.is_final() && state.engine.as_ref().is_some_and(|open| Arc::ptr_eq(open, engine)) {
            state.engine = None;
            state.reason = Some(error.clone());
        }
    }
}

fn open(choice: &GpuChoice) -> (Option<Arc<Engine>>, Option<GpuError>) {
    match Engine::open(choice) {
        Ok(engine) => (Some(Arc::new(engine)), None),
        Err(error) => (None, Some(error)),
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
        if let Some(engine) = self.engine().filter(|engine| count > 0 && engine.wants(pencil.l.rows(), count)) {
            let adapter = engine.name().to_owned();
            match engine.lowest(&pencil.a, &pencil.l, count, monitor) {
                Ok((values, vectors)) => {
                    let mut pairs = pencil.finish(values, vectors, monitor);
                    pairs.computed_on = ComputedOn::Gpu { adapter };
                    return Ok(pairs);
                }
                Err(GpuError::Cancelled(cancelled)) => return Err(cancelled.into()),
                Err(error) => {
                    self.failed(&engine, &error);
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

static INSTALLED: LazyLock<RwLock<Arc<Accelerator>>> = LazyLock::new(|| RwLock::new(Arc::new(Accelerator::off())));

/// Makes an accelerator that of the whole process: a device belongs to the machine, not to a job. Until then there is none.
pub fn install(accelerator: Arc<Accelerator>) {
    *INSTALLED.write().unwrap_or_else(PoisonError::into_inner) = accelerator;
}

/// The accelerator of this process.
pub fn accelerator() -> Arc<Accelerator> {
    INSTALLED.read().unwrap_or_else(PoisonError::into_inner).clone()
}
