//! The monitor of one attempt: written by the work, read by the heartbeat.

use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use chladni_base::{Cancelled, Monitor};

use super::Watch;
use crate::store::{
    Progress,
    fault::{FailPoint, Faults},
};

/// Characters of a detail that are kept.
const LONGEST_DETAIL: usize = 200;
/// Characters of the name of a stage that is told by another process.
const LONGEST_STAGE: usize = 40;

/// Collects stage, progress and signs of life of one attempt, and tells the work to stop.
#[derive(Debug)]
pub(super) struct AttemptMonitor {
    begun: Instant,
    cancelled: AtomicBool,
    /// Milliseconds after `begun` at which the work was last heard of.
    heard_ms: AtomicU64,
    /// The bits of an f64.
    fraction: AtomicU64,
    stages: Mutex<Stages>,
    faults: Faults,
    /// Bytes of memory; 0 where nothing was promised.
    promised: u64,
}

#[derive(Debug, Default)]
struct Stages {
    ended: Vec<(String, f64)>,
    current: Option<(String, Instant)>,
    detail: Option<String>,
}

impl Stages {
    /// Seconds in each stage, in order of first appearance, with the one that runs counted up to now.
    fn seconds(&self) -> Vec<(String, f64)> {
        let current = self.current.as_ref().map(|(name, since)| (name, since.elapsed().as_secs_f64()));
        let ended = self.ended.iter().map(|(name, elapsed)| (name, *elapsed));
        let mut seconds: Vec<(String, f64)> = Vec::with_capacity(self.ended.len() + 1);
        for (name, elapsed) in ended.chain(current) {
            match seconds.iter_mut().find(|(known, _)| known == name) {
                Some((_, total)) => *total += elapsed,
                None => seconds.push((name.clone(), elapsed)),
            }
        }
        seconds
    }
}

impl AttemptMonitor {
    pub fn new(faults: Faults, promised: u64) -> Self {
        Self {
            promised,
            begun: Instant::now(),
            cancelled: AtomicBool::new(false),
            heard_ms: AtomicU64::new(0),
            fraction: AtomicU64::new(0f64.to_bits()),
            stages: Mutex::default(),
            faults,
        }
    }

    /// Asks the work to stop at its next checkpoint.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// How long the work has not been heard of.
    pub fn since_last_activity(&self) -> Duration {
        let heard = Duration::from_millis(self.heard_ms.load(Ordering::Relaxed));
        self.begun.elapsed().saturating_sub(heard)
    }

    /// How far the work has come.
    pub fn snapshot(&self) -> Progress {
        let stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let stage = stages.current.as_ref().map(|(name, _)| name.clone());
        let fraction = f64::from_bits(self.fraction.load(Ordering::Relaxed));
        Progress {
            fraction: stage.as_ref().map(|_| fraction),
            detail: stages.detail.clone(),
            stage,
            stage_seconds: stages.seconds(),
        }
    }

    /// Begins a stage.
    fn turn(&self, next: &str) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((name, since)) = stages.current.take() {
            stages.ended.push((name, since.elapsed().as_secs_f64()));
        }
        stages.current = Some((next.to_owned(), Instant::now()));
        stages.detail = None;
        self.fraction.store(0f64.to_bits(), Ordering::Relaxed);
    }

    /// Ends the last stage and begins the storing of the result.
    pub fn begin_storing(&self) {
        self.turn("store");
        self.record_activity();
    }

    fn record_activity(&self) {
        self.heard_ms.store(self.begun.elapsed().as_millis() as u64, Ordering::Relaxed);
    }
}

impl Monitor for AttemptMonitor {
    fn stage(&self, name: &'static str) {
        self.turn(name);
        self.record_activity();
    }

    fn progress(&self, fraction: f64) {
        if fraction.is_finite() {
            self.fraction.store(fraction.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
        }
        self.record_activity();
    }

    fn detail(&self, text: &str) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        stages.detail = Some(text.chars().take(LONGEST_DETAIL).collect());
        drop(stages);
        self.record_activity();
    }

    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.record_activity();
        self.faults.reach(FailPoint::MidRun);
        if self.cancelled.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }

    fn promised_bytes(&self) -> Option<u64> {
        (self.promised > 0).then_some(self.promised)
    }
}

impl Watch for AttemptMonitor {
    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    fn stage_named(&self, name: &str) {
        self.turn(&name.chars().take(LONGEST_STAGE).collect::<String>());
        self.record_activity();
    }
}
