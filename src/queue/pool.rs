//! The workers: they claim, run and go on, until they are told to stop.

use std::{
    panic::AssertUnwindSafe,
    sync::{Arc, Mutex},
    time::Duration,
};

use futures_util::FutureExt;
use tokio::{sync::watch, task::JoinHandle};
use tracing::Instrument;
use uuid::Uuid;

use super::{
    QueueObserver, Runner,
    attempt::{self, Threads},
    memory::Budget,
    options::WorkerOptions,
    shared::{Shared, signalled},
};
use crate::store::{JobStatus, Store, Worker};

/// An idle worker looks at the queue this often, beside being rung for.
const IDLE: Duration = Duration::from_millis(500);
/// Attempts that hang cannot be ended, only left behind, and each keeps its threads and memory: with so many, no more
/// jobs are claimed.
const MOST_LEFT_BEHIND: usize = 4;

/// The running worker pool. Dropped without [`drain`](Self::drain), it goes on until the runtime ends.
pub struct WorkerPool {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
    reaper: JoinHandle<()>,
}

impl std::fmt::Debug for WorkerPool {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("WorkerPool").field("options", &self.shared.options).finish_non_exhaustive()
    }
}

impl WorkerPool {
    /// Starts the workers and the reaper on the current tokio runtime.
    ///
    /// Each worker has a rayon pool of its own. In a shared one, a thread of one job that waits for its own parts would
    /// take up the whole of another job in the meantime, and be silent until that ends.
    pub fn start(
        store: Store,
        options: WorkerOptions,
        runner: Arc<dyn Runner>,
        observer: Arc<dyn QueueObserver>,
    ) -> Self {
        let threads = match options.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        };
        let own = Worker {
            // In containers every process may have the same number.
            id: format!("{}-{}", std::process::id(), Uuid::now_v7().simple()),
            solver_version: chladni_work::SOLVER_VERSION.to_owned(),
            seats: options.workers as u64,
            threads: threads as u64,
            memory_bytes: options.memory,
            kinds: options.kinds.clone(),
        };
        let shared = Arc::new(Shared {
            own,
            budget: Arc::new(Budget::new(options.memory, store.clone(), Arc::clone(&observer))),
            store,
            runner,
            observer,
            left_behind: Arc::default(),
            refused: Mutex::default(),
            give_back: watch::Sender::new(false),
            stopping: watch::Sender::new(false),
            options,
        });
        let workers = shared.options.workers;
        let workers = (0..workers)
            .map(|worker| {
                let share = (threads / workers + usize::from(worker < threads % workers)).max(1);
                tokio::spawn(work(Arc::clone(&shared), worker, share))
            })
            .collect();
        let reaper = tokio::spawn(reap(Arc::clone(&shared)));
        Self { shared, workers, reaper }
    }

    /// Whether every worker can still take jobs. False while it drains, too.
    pub fn alive(&self) -> bool {
        !self.shared.stopping()
            && !self.reaper.is_finished()
            && self.workers.iter().all(|worker| !worker.is_finished())
            && self.shared.hanging() < MOST_LEFT_BEHIND
    }

    /// Claims nothing more, lets running jobs go on for `limit`, then gives what still runs back to the queue. Work
    /// that does not stop at once is left behind; its result is void.
    pub async fn drain(&self, limit: Duration) {
        self.shared.stopping.send_replace(true);
        let ended = async {
            while !self.workers.iter().all(JoinHandle::is_finished) {
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        tokio::pin!(ended);
        if tokio::time::timeout(limit, &mut ended).await.is_err() {
            tracing::info!("running jobs go back to the queue");
            self.shared.give_back.send_replace(true);
            ended.await;
        }
        self.reaper.abort();
        if let Err(error) = self.shared.store.dismiss_worker(&self.shared.own.id).await {
            tracing::debug!(%error, "this process counts as a worker for a minute more");
        }
    }
}

async fn work(shared: Arc<Shared>, worker: usize, share: usize) {
    let name = format!("{}-{worker}", shared.own.id);
    let mut stopping = shared.stopping.subscribe();
    let mut threads: Option<rayon::ThreadPool> = None;
    while !shared.stopping() {
        let pool = match threads.take() {
            Some(pool) => pool,
            None => match thread_pool(worker, share) {
                Ok(pool) => pool,
                Err(error) => {
                    tracing::error!(%error, "could not start threads for a worker");
                    tokio::time::sleep(IDLE).await;
                    continue;
                }
            },
        };
        // Whatever goes wrong in here, the worker goes on; the lease of a job in hand runs out.
        match AssertUnwindSafe(one_job(&shared, &name, &pool)).catch_unwind().await {
            Ok(Some(Threads::Free)) => threads = Some(pool),
            Ok(Some(Threads::Occupied)) => {
                // Dropping the pool waits for nobody; its threads end with the work.
            }
            Ok(None) => {
                threads = Some(pool);
                tokio::select! {
                    () = shared.store.work().notified() => {}
                    () = tokio::time::sleep(IDLE) => {}
                    () = signalled(&mut stopping) => {}
                }
            }
            Err(_) => {
                tracing::error!(worker = name, "a worker panicked and goes on");
                tokio::time::sleep(IDLE).await;
            }
        }
    }
}

/// Claims and runs a job; `None` where there is none to do.
async fn one_job(shared: &Arc<Shared>, worker: &str, pool: &rayon::ThreadPool) -> Option<Threads> {
    // On a full disk no result could be stored: the job had better wait.
    if shared.hanging() >= MOST_LEFT_BEHIND || !shared.store.has_space() || !shared.is_let_in().await {
        return None;
    }
    let events = shared.store.watch_jobs();
    match shared.budget.claim(worker, &shared.options).await {
        Ok(Some((claim, memory))) => {
            let job = &claim.job;
            let span = tracing::info_span!("attempt", job = %job.id, kind = job.kind, attempt = job.attempt);
            Some(attempt::run(shared, claim, memory, events, pool).instrument(span).await)
        }
        Ok(None) => None,
        Err(error) => {
            tracing::warn!(%error, "claim refused");
            None
        }
    }
}

fn thread_pool(worker: usize, threads: usize) -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |thread| format!("job-{worker}-{thread}"))
        .start_handler(|_| give_way())
        .panic_handler(|_| tracing::error!("work panicked outside its attempt"))
        .build()
}

/// Lets the threads that answer requests go first: beside a nice value of 10 the default one gets nine tenths of a core
/// that both want, and is not kept waiting. The threads of jobs lose nothing where nobody else wants the core.
fn give_way() {
    // On Linux the calling thread alone is meant.
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, 10) {
        tracing::debug!(%error, "could not lower the priority of a job thread");
    }
}

/// Jobs that wait for their parts hear of them, and parts that nobody needs go.
async fn maintain_parts(shared: &Shared) {
    match shared.store.maintain_parts().await {
        Ok(ended) => ended.iter().for_each(|job| shared.observer.finished(&job.kind, job.status)),
        Err(error) => tracing::warn!(%error, "could not check on the parts of jobs"),
    }
}

async fn reap(shared: Arc<Shared>) {
    let mut every =
        tokio::time::interval((shared.options.lease / 3).clamp(Duration::from_millis(50), Duration::from_secs(5)));
    every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        let told = tokio::select! {
            _ = every.tick() => false,
            () = shared.store.parts().notified() => true,
        };
        maintain_parts(&shared).await;
        if told {
            continue;
        }
        if shared.options.workers > 0
            && let Err(error) = shared.store.announce_worker(&shared.own).await
        {
            tracing::debug!(%error, "could not announce this process to the others");
        }
        match shared.store.reap().await {
            Ok(reaped) => {
                for reaped in reaped {
                    let job = reaped.job;
                    tracing::warn!(job = %job.id, status = %job.status, "a worker was lost");
                    match job.status {
                        JobStatus::Enqueued => shared.observer.retried(&job.kind),
                        status => shared.observer.finished(&job.kind, status),
                    }
                }
            }
            Err(error) => tracing::warn!(%error, "reaping refused"),
        }
    }
}
