//! What processes that share the records tell each other of jobs: docs/decisions/0075 and 0103.
//!
//! That a job is enqueued or to be stopped is told by `NOTIFY`, after the commit and in a transaction of its own: one
//! that notifies takes a lock of the whole server when it commits. Each process listens on one connection. How a job
//! that somebody waits for comes along is looked for many times a second: a message for each end would wake every
//! process that listens, whatever the channel, for the sake of the one that is waited for. Behind both, once a second,
//! each process looks at the jobs that run or have changed lately: whatever was not heard otherwise is heard of that
//! way.

use std::{
    collections::{HashMap, hash_map::Entry},
    sync::{
        Mutex, PoisonError, Weak,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use sqlx::postgres::PgListener;
use tokio::{sync::mpsc, task::JoinHandle};
use uuid::Uuid;

use super::{Inner, JobEvent, JobStatus, Store, StoreError, jobs, sql};

/// The channel on which processes hear of jobs that are enqueued, or to be stopped.
const WORK: &str = "chladni_work";
/// A message of PostgreSQL has 8000 bytes at most.
const MOST_MESSAGE_BYTES: usize = 7000;
/// What comes within so long of a message that was told waits for the next one, so that listeners wake once for many
/// jobs.
const BETWEEN_MESSAGES: Duration = Duration::from_millis(20);
/// Where messages go on without a pause, they come to be so far apart: workers that are kept busy need not be told of
/// more.
const BETWEEN_MANY_MESSAGES: Duration = Duration::from_millis(160);
/// How often a process looks for itself.
const LOOK: Duration = Duration::from_secs(1);
/// How often it looks at jobs that somebody waits for.
const LOOK_AT_WATCHED: Duration = Duration::from_millis(50);
/// Pause before a lost connection is tried anew.
const PAUSE: Duration = Duration::from_secs(1);
/// A look goes back so far, in milliseconds: several looks may fail.
const LATELY_MS: i64 = 10_000;
/// So many of the processes that work look for a job that was enqueued elsewhere. The others look within half a second
/// anyway, each at its own time.
const CALLED: u64 = 4;
/// Jobs whose revisions are remembered; beyond, all are forgotten, and some changes may be told twice.
const MOST_REMEMBERED: usize = 10_000;

/// What was heard of jobs, and what is to be told.
#[derive(Debug)]
pub(super) struct Hearing {
    revisions: Mutex<HashMap<Uuid, i64>>,
    /// Jobs that somebody waits for, and how many do.
    watched: Mutex<HashMap<Uuid, usize>>,
    told: mpsc::UnboundedSender<JobEvent>,
    /// Tells this process from others.
    own: Uuid,
    /// Processes that work, as far as is known.
    workers: AtomicU64,
    tasks: Vec<JoinHandle<()>>,
}

impl Drop for Hearing {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Hearing {
    /// Begins to tell, to listen and to look, for as long as the store lives; for what concerns whoever works alone, or
    /// for everything.
    pub fn start(store: Weak<Inner>, work_alone: bool) -> Self {
        let (told, telling) = mpsc::unbounded_channel();
        let mut tasks = vec![
            tokio::spawn(forward_events(store.clone(), telling)),
            tokio::spawn(listen(store.clone())),
            tokio::spawn(look(store.clone(), work_alone)),
        ];
        // Nobody waits for a job of a process that only works.
        if !work_alone {
            tasks.push(tokio::spawn(look_at_watched(store)));
        }
        Self {
            revisions: Mutex::default(),
            watched: Mutex::default(),
            told,
            own: Uuid::now_v7(),
            workers: AtomicU64::new(1),
            tasks,
        }
    }

    /// Whether a change is news: each is told once here, by whichever way it is heard of first.
    fn is_news(&self, event: &JobEvent) -> bool {
        let mut revisions = self.revisions.lock().unwrap_or_else(PoisonError::into_inner);
        if revisions.len() >= MOST_REMEMBERED && !revisions.contains_key(&event.job) {
            // Some may be told twice then, which is no harm.
            revisions.clear();
        }
        let known = revisions.entry(event.job).or_insert(i64::MIN);
        std::mem::replace(known, event.revision.max(*known)) < event.revision
    }

    /// Looks at a job often, until [`unwatch`](Self::unwatch) was called as often as this.
    pub fn watch(&self, job: Uuid) {
        *self.watched.lock().unwrap_or_else(PoisonError::into_inner).entry(job).or_default() += 1;
    }

    /// One fewer waits for a job.
    pub fn unwatch(&self, job: Uuid) {
        let mut watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        if let Entry::Occupied(mut count) = watched.entry(job) {
            *count.get_mut() -= 1;
            if *count.get() == 0 {
                count.remove();
            }
        }
    }

    /// Jobs that somebody waits for, as PostgreSQL reads a list; `None` where there are none.
    fn watched(&self) -> Option<String> {
        let watched = self.watched.lock().unwrap_or_else(PoisonError::into_inner);
        let ids: Vec<String> = watched.keys().map(Uuid::to_string).collect();
        (!ids.is_empty()).then(|| ids.join(","))
    }

    /// Remembers how many processes work.
    pub fn count_workers(&self, workers: u64) {
        self.workers.store(workers, Ordering::Relaxed);
    }

    /// Whether this process is among those that look for a job which was enqueued elsewhere. Were it all of them, each
    /// job would be asked for by every idle worker, and a database with many had little time for anything else.
    fn is_called(&self, job: Uuid) -> bool {
        let workers = self.workers.load(Ordering::Relaxed).max(1);
        let mut hasher = blake3::Hasher::new();
        hasher.update(job.as_bytes()).update(self.own.as_bytes());
        let [a, b, ..] = *hasher.finalize().as_bytes();
        u64::from(u16::from_be_bytes([a, b])) * workers < CALLED << 16
    }

    /// Tells the other processes of a change of this one.
    pub fn publish(&self, event: &JobEvent) {
        self.is_news(event);
        // All else is looked for by those who want to know.
        if event.status == JobStatus::Enqueued || event.cancel_requested {
            let _ = self.told.send(event.clone());
        }
    }

    /// Ends it.
    pub fn stop(&self) {
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

async fn forward_events(store: Weak<Inner>, mut telling: mpsc::UnboundedReceiver<JobEvent>) {
    let (mut events, mut pause) = (Vec::new(), BETWEEN_MESSAGES);
    loop {
        let waits = Instant::now();
        if telling.recv_many(&mut events, 64).await == 0 {
            return;
        }
        pause = if waits.elapsed() < pause { (pause * 2).min(BETWEEN_MANY_MESSAGES) } else { BETWEEN_MESSAGES };
        {
            let Some(inner) = store.upgrade() else { return };
            let mut message = String::new();
            for event in events.drain(..) {
                let line = written(&event);
                if message.len() + line.len() >= MOST_MESSAGE_BYTES {
                    send(&inner, std::mem::take(&mut message)).await;
                }
                message.push_str(&line);
            }
            send(&inner, message).await;
        }
        tokio::time::sleep(pause).await;
    }
}

async fn send(inner: &Inner, message: String) {
    let sent = sql::query("SELECT 1 FROM (SELECT pg_notify(?, ?)) AS told").bind(WORK).bind(message);
    if let Err(error) = sent.fetch_optional(inner.catalog.reader()).await {
        tracing::debug!(%error, "could not notify other processes; they poll once a second");
    }
}

async fn listen(store: Weak<Inner>) {
    loop {
        if let Err(error) = listen_once(&store).await {
            tracing::warn!(%error, "polling for changes once a second until the database answers");
        }
        if store.strong_count() == 0 {
            return;
        }
        tokio::time::sleep(PAUSE).await;
    }
}

async fn listen_once(store: &Weak<Inner>) -> Result<(), StoreError> {
    let mut listener: PgListener = {
        let Some(inner) = store.upgrade() else { return Ok(()) };
        let Some(postgres) = inner.catalog.postgres() else { return Ok(()) };
        postgres.listener(&[WORK]).await?
    };
    // `None` where the connection was lost: what was told meanwhile is found by looking.
    while let Some(notification) = listener.try_recv().await? {
        let Some(inner) = store.upgrade() else { return Ok(()) };
        let store = Store { inner };
        notification.payload().lines().filter_map(read).for_each(|event| store.deliver_event(event));
    }
    Ok(())
}

async fn look(store: Weak<Inner>, work_alone: bool) {
    let mut every = tokio::time::interval(LOOK);
    every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        every.tick().await;
        let Some(inner) = store.upgrade() else { return };
        if let Err(error) = (Store { inner }).look_at_jobs(work_alone).await {
            tracing::debug!(%error, "could not read the changed jobs");
        }
    }
}

async fn look_at_watched(store: Weak<Inner>) {
    let mut every = tokio::time::interval(LOOK_AT_WATCHED);
    every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        every.tick().await;
        let Some(inner) = store.upgrade() else { return };
        let Some(watched) = inner.hearing.get().and_then(Hearing::watched) else { continue };
        let query = sql::query(
            "SELECT id, revision, status, cancel_requested FROM jobs WHERE id = ANY (string_to_array(?, ','))",
        );
        if let Err(error) = (Store { inner }).hear_of(query.bind(watched)).await {
            tracing::debug!(%error, "could not read the jobs that are waited for");
        }
    }
}

impl Store {
    /// Tells listeners of this process of a change that another one made.
    fn deliver_event(&self, event: JobEvent) {
        let Some(hearing) = self.inner.hearing.get() else { return self.tell_here(event, true) };
        if hearing.is_news(&event) {
            let called = hearing.is_called(event.job);
            self.tell_here(event, called);
        }
    }

    /// Workers look for jobs to do by themselves; of those that run they need to know which are to be stopped.
    async fn look_at_jobs(&self, work_alone: bool) -> Result<(), StoreError> {
        let since_ms = self.now_ms() - LATELY_MS;
        let query = if work_alone {
            sql::query(
                "SELECT id, revision, status, cancel_requested FROM jobs WHERE status = 'processing' AND cancel_requested <> 0",
            )
        } else {
            sql::query(
                "SELECT id, revision, status, cancel_requested FROM jobs WHERE status = 'processing' OR finished_ms > ?1
                    OR (status = 'enqueued' AND enqueued_ms > ?1)",
            )
            .bind(since_ms)
        };
        self.hear_of(query).await
    }

    /// Hears of the jobs that a statement gives.
    async fn hear_of(&self, query: sql::Query) -> Result<(), StoreError> {
        let rows = query.fetch_all(self.inner.catalog.reader()).await?;
        for row in &rows {
            self.deliver_event(JobEvent {
                job: jobs::uuid_column(row, "id")?,
                revision: row.try_get("revision")?,
                status: jobs::status_column(row)?,
                cancel_requested: row.try_get("cancel_requested")?,
            });
        }
        Ok(())
    }
}

/// One line of a message.
fn written(event: &JobEvent) -> String {
    let cancel = i32::from(event.cancel_requested);
    format!("{} {} {} {cancel}\n", event.job, event.revision, event.status)
}

/// Reads what [`written`] wrote. What another version says beside it is passed over.
fn read(line: &str) -> Option<JobEvent> {
    let mut words = line.split(' ');
    Some(JobEvent {
        job: Uuid::try_parse(words.next()?).ok()?,
        revision: words.next()?.parse().ok()?,
        status: words.next()?.parse().ok()?,
        cancel_requested: words.next()? == "1",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_they_were_written() {
        for (status, cancel_requested) in [(JobStatus::Enqueued, false), (JobStatus::Processing, true)] {
            let event = JobEvent { job: Uuid::now_v7(), revision: 7, status, cancel_requested };
            assert_eq!(read(written(&event).trim_end()), Some(event));
        }
        for bad in ["", "x 1 enqueued 0", "019aa5d0-5c3e-7c11-8a53-3a0f1c7ce1f2 1 soon 0"] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
