//! Jobs that harm the process they run in, for tests of what becomes of them. Only a server that was started with the
//! hidden `--fault poison` has them; they are told by their priority.

use crate::queue::{JobFailure, Outcome, Runner, Watch};
use crate::store::JobRecord;
use chladni_base::Monitor;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::spectrum::pencil::Matrices;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

/// A runner that does harm where the priority of a job asks for it, and else what another one does.
pub(super) struct Poison<R>(pub R);

impl<R: Runner> Runner for Poison<R> {
    fn run(&self, job: &JobRecord, mesh: Arc<TriangleMesh>, monitor: &dyn Monitor) -> Result<Outcome, JobFailure> {
        monitor.stage("poison");
        harm(job.priority);
        self.0.run(job, mesh, monitor)
    }

    fn run_body(
        &self,
        job: &JobRecord,
        mesh: Arc<TriangleMesh>,
        solid: Option<Arc<TetMesh>>,
        watch: &dyn Watch,
    ) -> Result<Outcome, JobFailure> {
        watch.stage("poison");
        harm(job.priority);
        self.0.run_body(job, mesh, solid, watch)
    }

    fn run_problem(&self, job: &JobRecord, matrices: Arc<Matrices>, watch: &dyn Watch) -> Result<Outcome, JobFailure> {
        watch.stage("poison");
        harm(job.priority);
        self.0.run_problem(job, matrices, watch)
    }
}

// It is asked to do harm.
#[allow(clippy::panic)]
fn harm(priority: i32) {
    match priority {
        -91 => {
            let mut all = Vec::new();
            loop {
                all.push(black_box(vec![1u8; 16 << 20]));
            }
        }
        -92 => std::process::abort(),
        // Deaf to whoever asks it to stop.
        -93 => loop {
            black_box(());
            std::hint::spin_loop();
        },
        -94 => send_itself(true),
        -95 => send_itself(false),
        -96 => panic!("poison"),
        -97 => std::process::exit(0),
        -98 => drop(black_box(deep(0))),
        -99 => loop {
            std::thread::sleep(Duration::from_secs(3600));
        },
        _ => {}
    }
}

/// Sends this process SIGSEGV, or SIGKILL, until that ends it.
fn send_itself(fault: bool) {
    #[cfg(unix)]
    {
        use rustix::process::{Signal, getpid, kill_process};
        let signal = if fault { Signal::SEGV } else { Signal::KILL };
        loop {
            let _ = kill_process(getpid(), signal);
        }
    }
    #[cfg(not(unix))]
    if fault {
        std::process::abort()
    }
}

/// Calls itself until the stack is full.
fn deep(depth: u64) -> u64 {
    let here = black_box([depth; 512]);
    if black_box(depth) == u64::MAX { 0 } else { deep(depth + 1) + here[depth as usize % 512] }
}
