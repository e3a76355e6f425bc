//! The protocol of leases against a model of it: schedules at random of clients, workers that come too late and a clock
//! that jumps. Both kinds of records have to answer every call as the model does, and to look like it after every step.
//!
//! 256 schedules from a fixed seed; `CHLADNI_SCHEDULES=100000` runs more, of which these are the first, and
//! `CHLADNI_SEED=7` others.

use std::cell::Cell;

use proptest::{
    collection::vec,
    prelude::*,
    test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner},
};

use super::*;

/// Different pieces of work; equal ones meet.
const WORKS: usize = 3;
const LEASE_MS: i64 = 30_000;
/// The pause after a first failure, and the longest.
const PAUSES_MS: [i64; 2] = [1000, 60_000];

#[derive(Debug, Clone)]
enum Step {
    Enqueue { work: usize, priority: i32, max_attempts: u32 },
    Claim,
    Beat { lease: usize, moved: bool },
    Complete { lease: usize },
    Fail { lease: usize, retryable: bool },
    Release { lease: usize },
    Stop { lease: usize },
    Cancel { job: usize },
    Retry { job: usize },
    Reap,
    Wait { ms: i64 },
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let lease = 0..64usize;
    vec(
        prop_oneof![
            4 => (0..WORKS, -1..2, 1..4u32)
                .prop_map(|(work, priority, max_attempts)| Step::Enqueue { work, priority, max_attempts }),
            6 => Just(Step::Claim),
            2 => (lease.clone(), any::<bool>()).prop_map(|(lease, moved)| Step::Beat { lease, moved }),
            2 => lease.clone().prop_map(|lease| Step::Complete { lease }),
            3 => (lease.clone(), any::<bool>()).prop_map(|(lease, retryable)| Step::Fail { lease, retryable }),
            1 => lease.clone().prop_map(|lease| Step::Release { lease }),
            1 => lease.prop_map(|lease| Step::Stop { lease }),
            2 => (0..16usize).prop_map(|job| Step::Cancel { job }),
            2 => (0..16usize).prop_map(|job| Step::Retry { job }),
            2 => Just(Step::Reap),
            4 => prop_oneof![0..2500i64, LEASE_MS - 1..LEASE_MS + 2, 50_000..70_000i64].prop_map(|ms| Step::Wait { ms }),
        ],
        1..28,
    )
}

/// A job as it should be.
#[derive(Debug, Clone)]
struct Expected {
    id: Uuid,
    work: usize,
    priority: i32,
    status: JobStatus,
    attempt: u32,
    max_attempts: u32,
    asked_to_stop: bool,
    /// The lease on it, by its place among all.
    lease: Option<usize>,
    expires_ms: i64,
    not_before_ms: i64,
    /// Of which lease the result is.
    result: Option<usize>,
}

impl Expected {
    fn end(&mut self, status: JobStatus) {
        (self.status, self.lease, self.asked_to_stop) = (status, None, false);
    }

    fn wait(&mut self, not_before_ms: i64) {
        (self.status, self.lease, self.not_before_ms) = (JobStatus::Enqueued, None, not_before_ms);
    }

    /// An attempt came to nothing; another may be made after so many doublings of the first pause.
    fn lose(&mut self, doublings: Option<u32>, now_ms: i64) {
        if self.asked_to_stop {
            self.end(JobStatus::Canceled);
            return;
        }
        match doublings.filter(|_| self.attempt < self.max_attempts) {
            Some(doublings) => self.wait(now_ms + (PAUSES_MS[0] << doublings).min(PAUSES_MS[1])),
            None => self.end(JobStatus::Failed),
        }
    }

    fn does(&self, work: usize) -> bool {
        self.work == work
            && match self.status {
                JobStatus::Enqueued | JobStatus::Processing => !self.asked_to_stop,
                other => other == JobStatus::Succeeded,
            }
    }
}

/// The records as they should be.
struct Model {
    jobs: Vec<Expected>,
    tokens: Vec<Uuid>,
    shared: bool,
}

impl Model {
    /// The job that is next.
    fn next(&self, now_ms: i64) -> Option<usize> {
        let ready = |job: &Expected| match job.status {
            JobStatus::Enqueued => job.not_before_ms <= now_ms || job.not_before_ms > now_ms + PAUSES_MS[1],
            // Where records are shared, a claim takes over from who was lost.
            JobStatus::Processing => {
                self.shared && !job.asked_to_stop && job.attempt < job.max_attempts && job.expires_ms < now_ms
            }
            _ => false,
        };
        (0..self.jobs.len())
            .filter(|&place| ready(&self.jobs[place]))
            .max_by_key(|&place| (self.jobs[place].priority, std::cmp::Reverse(place)))
    }

    /// The job that a lease holds.
    fn held(&mut self, lease: usize) -> Option<&mut Expected> {
        self.jobs.iter_mut().find(|job| job.lease == Some(lease))
    }
}

/// Schedules in a store, one after the other.
struct Trial {
    runtime: tokio::runtime::Runtime,
    store: Store,
    hands: Arc<AtomicI64>,
    mesh: String,
    /// Makes the work of each schedule its own.
    schedule: Cell<usize>,
}

impl Trial {
    fn work(&self, work: usize) -> String {
        format!("schedule {} work {work}", self.schedule.get())
    }

    async fn run(&self, steps: &[Step], model: &mut Model) -> Result<(), TestCaseError> {
        for (place, step) in steps.iter().enumerate() {
            let answered = self.step(step, model).await;
            answered.map_err(|error| TestCaseError::fail(format!("step {place}, {step:?}: {error}")))?;
            let same = self.compare(model).await;
            same.map_err(|error| TestCaseError::fail(format!("after step {place}, {step:?}: {error}")))?;
        }
        for job in &model.jobs {
            let record = self.store.job(job.id).await.unwrap();
            prop_assert_eq!(record.basis.is_some(), job.result.is_some());
            if let (Some(basis), Some(lease)) = (record.basis, job.result) {
                let found = self.store.load_basis(basis).await.unwrap().eigenvalues[1];
                prop_assert_eq!(found, seed(lease), "the result of another attempt");
            }
        }
        Ok(())
    }

    /// Asks the store and the model, and compares what they answer.
    async fn step(&self, step: &Step, model: &mut Model) -> Result<(), TestCaseError> {
        let (store, now_ms) = (&self.store, self.hands.load(Ordering::Relaxed));
        let lease_of = |lease: usize, model: &Model| {
            let count = model.tokens.len();
            (count > 0).then(|| (lease % count, model.tokens[lease % count]))
        };
        match *step {
            Step::Wait { ms } => drop(self.hands.fetch_add(ms, Ordering::Relaxed)),
            Step::Enqueue { work, priority, max_attempts } => {
                let new = NewJob { priority, max_attempts, ..new_job(&self.mesh, &self.work(work)) };
                let answer = store.enqueue(new).await.unwrap();
                match model.jobs.iter_mut().rev().find(|job| job.does(work)) {
                    Some(same) => {
                        prop_assert_eq!((answer.outcome, answer.record.id), (EnqueueOutcome::SameWork, same.id));
                        if same.status == JobStatus::Enqueued {
                            same.priority = same.priority.max(priority);
                        }
                    }
                    None => {
                        prop_assert_eq!(answer.outcome, EnqueueOutcome::Created);
                        model.jobs.push(Expected {
                            id: answer.record.id,
                            work,
                            priority,
                            status: JobStatus::Enqueued,
                            attempt: 0,
                            max_attempts,
                            asked_to_stop: false,
                            lease: None,
                            expires_ms: 0,
                            not_before_ms: now_ms,
                            result: None,
                        });
                    }
                }
            }
            Step::Claim => {
                let claim = store.claim("w", &[], LEASE).await.unwrap();
                let next = model.next(now_ms);
                prop_assert_eq!(claim.as_ref().map(|claim| claim.job.id), next.map(|next| model.jobs[next].id));
                if let (Some(claim), Some(next)) = (claim, next) {
                    let lease = model.tokens.len();
                    model.tokens.push(claim.token);
                    let job = &mut model.jobs[next];
                    job.attempt += 1;
                    prop_assert_eq!(claim.job.attempt, job.attempt);
                    (job.status, job.lease) = (JobStatus::Processing, Some(lease));
                    job.expires_ms = now_ms + LEASE_MS;
                }
            }
            Step::Beat { lease, moved } => {
                let Some((lease, token)) = lease_of(lease, model) else { return Ok(()) };
                let progress = Progress { stage: Some("solve".to_owned()), ..Progress::default() };
                let answer = store.heartbeat(token, moved.then_some(&progress), LEASE).await.unwrap();
                let expected = match model.held(lease) {
                    Some(job) => {
                        job.expires_ms = now_ms + LEASE_MS;
                        HeartbeatAnswer::Held { cancel_requested: job.asked_to_stop }
                    }
                    None => HeartbeatAnswer::Lost,
                };
                prop_assert_eq!(answer, expected);
            }
            Step::Complete { lease } => {
                let Some((lease, token)) = lease_of(lease, model) else { return Ok(()) };
                let answer = store.complete(token, basis(seed(lease), 4), vec![]).await.unwrap();
                match model.held(lease) {
                    Some(job) if job.asked_to_stop => {
                        prop_assert_eq!(answer, CompleteAnswer::Canceled);
                        job.end(JobStatus::Canceled);
                    }
                    Some(job) => {
                        prop_assert!(matches!(answer, CompleteAnswer::Stored(_)));
                        job.end(JobStatus::Succeeded);
                        job.result = Some(lease);
                    }
                    None => prop_assert_eq!(answer, CompleteAnswer::Lost),
                }
            }
            Step::Fail { lease, retryable } => {
                let Some((lease, token)) = lease_of(lease, model) else { return Ok(()) };
                let answer = store.fail(token, &problem(), retryable).await.unwrap();
                let expected = match model.held(lease) {
                    Some(job) => {
                        let doublings = retryable.then_some(job.attempt - 1);
                        job.lose(doublings, now_ms);
                        match job.status {
                            JobStatus::Enqueued => FailAnswer::Retried,
                            status => FailAnswer::Finished(status),
                        }
                    }
                    None => FailAnswer::Lost,
                };
                prop_assert_eq!(answer, expected);
            }
            Step::Release { lease } => {
                let Some((lease, token)) = lease_of(lease, model) else { return Ok(()) };
                let answer = store.release(token).await.unwrap();
                let held = model.held(lease);
                prop_assert_eq!(answer, held.is_some());
                if let Some(job) = held {
                    if job.asked_to_stop {
                        job.end(JobStatus::Canceled);
                    } else {
                        job.attempt -= 1;
                        job.wait(now_ms);
                    }
                }
            }
            Step::Stop { lease } => {
                let Some((lease, token)) = lease_of(lease, model) else { return Ok(()) };
                let answer = store.finish_canceled(token).await.unwrap();
                let held = model.held(lease);
                prop_assert_eq!(answer, held.is_some());
                held.into_iter().for_each(|job| job.end(JobStatus::Canceled));
            }
            Step::Cancel { job } => {
                let count = model.jobs.len();
                let Some(job) = model.jobs.get_mut(job % count.max(1)) else { return Ok(()) };
                let answer = store.cancel_job(job.id).await;
                match job.status {
                    JobStatus::Succeeded | JobStatus::Failed => {
                        let refused = matches!(answer, Err(StoreError::JobState { .. }));
                        prop_assert!(refused);
                    }
                    status => {
                        prop_assert!(answer.is_ok());
                        match status {
                            JobStatus::Enqueued => job.end(JobStatus::Canceled),
                            JobStatus::Processing => job.asked_to_stop = true,
                            _ => {}
                        }
                    }
                }
            }
            Step::Retry { job } => {
                let place = job % model.jobs.len().max(1);
                let Some(job) = model.jobs.get(place).cloned() else { return Ok(()) };
                let answer = store.retry_job(job.id).await;
                let under_way = model.jobs.iter().any(|other| {
                    let waits_or_runs = matches!(other.status, JobStatus::Enqueued | JobStatus::Processing);
                    other.work == job.work && waits_or_runs && !other.asked_to_stop
                });
                match job.status {
                    JobStatus::Enqueued | JobStatus::Processing => {
                        prop_assert_eq!(answer.is_ok(), !job.asked_to_stop);
                    }
                    JobStatus::Succeeded => prop_assert!(answer.is_err()),
                    JobStatus::Failed | JobStatus::Canceled => {
                        prop_assert_eq!(answer.is_ok(), !under_way);
                        if !under_way {
                            let job = &mut model.jobs[place];
                            job.attempt = 0;
                            job.wait(now_ms);
                        }
                    }
                }
            }
            Step::Reap => {
                let reaped: HashSet<Uuid> =
                    store.reap().await.unwrap().into_iter().map(|reaped| reaped.job.id).collect();
                let lost = |job: &&mut Expected| job.status == JobStatus::Processing && job.expires_ms < now_ms;
                let mut expected = HashSet::new();
                for job in model.jobs.iter_mut().filter(lost) {
                    expected.insert(job.id);
                    job.lose(Some(0), now_ms);
                }
                prop_assert_eq!(reaped, expected);
            }
        }
        Ok(())
    }

    /// Compares every job of the schedule with the model.
    async fn compare(&self, model: &Model) -> Result<(), TestCaseError> {
        if model.jobs.is_empty() {
            return Ok(());
        }
        let page = PageRequest { limit: model.jobs.len() as u32, from: None };
        let records = self.store.jobs(&JobFilter::default(), &page).await.unwrap().items;
        for (record, job) in records.iter().rev().zip(&model.jobs) {
            let found = (record.id, record.status, record.attempt, record.cancel_requested, record.priority);
            prop_assert_eq!(found, (job.id, job.status, job.attempt, job.asked_to_stop, job.priority));
            if job.status == JobStatus::Enqueued {
                prop_assert_eq!(record.not_before_ms, job.not_before_ms);
            }
        }
        Ok(())
    }

    /// Ends what a schedule left behind.
    async fn clear(&self, model: &Model) {
        for job in &model.jobs {
            let _ = self.store.cancel_job(job.id).await;
        }
        for &token in &model.tokens {
            self.store.finish_canceled(token).await.unwrap();
        }
    }
}

/// What tells the result of a lease from others.
fn seed(lease: usize) -> f64 {
    1.0 + lease as f64
}

/// Runs the schedules where the stores of this thread keep their records.
pub(super) fn schedules() {
    let cases = std::env::var("CHLADNI_SCHEDULES").ok().and_then(|count| count.parse().ok()).unwrap_or(256);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let hands = Arc::new(AtomicI64::new(1_000_000_000));
    let timed = StoreOptions { clock: Clock::manual(Arc::clone(&hands)), ..options(&folder) };
    let (store, mesh) = runtime.block_on(async {
        let store = Store::open(timed).await.unwrap();
        let mesh = store.add_mesh(mesh(1, 9)).await.unwrap().record.id;
        (store, mesh)
    });
    let trial = Trial { runtime, store, hands, mesh, schedule: Cell::new(0) };
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 2000, ..Config::default() };
    let rng = match std::env::var("CHLADNI_SEED").ok().and_then(|seed| seed.parse::<u64>().ok()) {
        None => TestRng::deterministic_rng(RngAlgorithm::ChaCha),
        Some(seed) => TestRng::from_seed(RngAlgorithm::ChaCha, &[seed.to_le_bytes(); 4].concat()),
    };
    let mut runner = TestRunner::new_with_rng(config, rng);
    let ended = runner.run(&steps(), |steps| {
        trial.schedule.set(trial.schedule.get() + 1);
        let mut model = Model { jobs: Vec::new(), tokens: Vec::new(), shared: trial.store.is_shared() };
        trial.runtime.block_on(async {
            let ended = trial.run(&steps, &mut model).await;
            trial.clear(&model).await;
            ended
        })
    });
    if let Err(error) = ended {
        panic!("{error}");
    }
    trial.runtime.block_on(trial.store.close());
}

#[test]
fn every_schedule_of_leases_goes_as_the_model_says() {
    schedules();
}
