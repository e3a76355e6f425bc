//! The shared state as one client uses it: under its name, with its part of what all clients share.

use std::net::SocketAddr;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use axum::extract::FromRequestParts;
use axum::http::Extensions;
use axum::http::request::Parts;
use chladni_base::{Cancelled, Monitor};
use tokio::sync::oneshot;

use super::access::Principal;
use super::problem::{self, Problem};
use super::serve::Peer;
use super::shares::{Refused, Share};
use super::slots::Turn;
use super::state::AppState;

/// What a handler works with: the shared state, and on whose behalf.
#[derive(Debug, Clone)]
pub struct ClientState {
    state: AppState,
    /// The name of the API key, or `anonymous`.
    pub principal: Arc<str>,
    /// Whose part of what is shared the request takes from: the key's or, where the server has none, the address's.
    name: Arc<str>,
    /// What the request holds as long as it, or work of it, goes on.
    held: Arc<Mutex<Vec<Share>>>,
    /// Where the request stands among those that only read.
    pub(super) turn: Turn,
    /// Its place among the solves, where it has one already.
    pub(super) place: SolvePlace,
}

/// A place among the synchronous solves, taken before a request is read: whoever has too many of them waiting is
/// refused before anything is done for it.
#[derive(Debug, Clone, Default)]
pub struct SolvePlace(Arc<Mutex<Option<Share>>>);

impl SolvePlace {
    /// Takes one for a client.
    ///
    /// # Errors
    /// `busy` where too many solves of this client, or of all, are waiting.
    pub fn of(state: &AppState, client: &Arc<str>) -> Result<Self, Problem> {
        Ok(Self(Arc::new(Mutex::new(Some(solve_place(state, client)?)))))
    }

    /// Gives it back: the client is not through with its request, and others must not wait for that.
    pub fn give_back(&self) {
        drop(self.take());
    }

    fn take(&self) -> Option<Share> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn solve_place(state: &AppState, client: &Arc<str>) -> Result<Share, Problem> {
    state.solve_places.take(client, 1).map_err(|refused| {
        let detail = match refused {
            Refused::Everyone => "Too many solves are waiting.",
            Refused::Client | Refused::TooMuch { .. } => "Too many solves from this client are waiting.",
        };
        Problem::new(&problem::BUSY, detail).retry_after(1)
    })
}

impl Deref for ClientState {
    type Target = AppState;
    fn deref(&self) -> &AppState {
        &self.state
    }
}

impl FromRequestParts<AppState> for ClientState {
    type Rejection = std::convert::Infallible;

    async fn from_request_parts(parts: &mut Parts, state: &AppState) -> Result<Self, Self::Rejection> {
        let Principal(principal) = parts.extensions.get::<Principal>().cloned().unwrap_or_default();
        let name = client_name(state, &parts.extensions, &principal);
        let turn = parts.extensions.get::<Turn>().cloned().unwrap_or_default();
        let place = parts.extensions.get::<SolvePlace>().cloned().unwrap_or_default();
        Ok(Self { state: state.clone(), principal, name, held: Arc::default(), turn, place })
    }
}

/// Whose part of what is shared a request takes from: the key's or, where the server has none, the address's.
pub fn client_name(state: &AppState, extensions: &Extensions, principal: &Arc<str>) -> Arc<str> {
    match extensions.get::<Peer>() {
        Some(peer) if state.keys().is_empty() => address_name(peer.address),
        _ => principal.clone(),
    }
}

/// The name of a client that has no key.
pub fn address_name(address: SocketAddr) -> Arc<str> {
    address.ip().to_canonical().to_string().into()
}

/// Looks whether anybody still waits for the result of work.
struct Attended<'a>(&'a AtomicBool);

impl Monitor for Attended<'_> {
    fn stage(&self, _name: &'static str) {}
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        if self.0.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }
}

/// Raises a flag where it is dropped before the work has ended: the connection was closed, and the handler went with
/// it.
struct Attendance {
    left: Arc<AtomicBool>,
    ended: bool,
}

impl Drop for Attendance {
    fn drop(&mut self) {
        if !self.ended {
            self.left.store(true, Ordering::Relaxed);
        }
    }
}

impl From<Cancelled> for Problem {
    /// Work is cancelled where nobody waits for it any more, or where it takes longer than a request may.
    fn from(_: Cancelled) -> Self {
        Self::new(&problem::BUSY, "The work was cancelled before it was done.").retry_after(1)
    }
}

impl ClientState {
    /// An empty share of the memory for requests.
    pub fn memory(&self) -> Share {
        self.request_memory.none(&self.name)
    }

    /// Holds a share until the request, and all work that it began, has ended.
    pub fn hold(&self, share: Share) {
        self.held.lock().unwrap_or_else(PoisonError::into_inner).push(share);
    }

    /// A place for a stream of events or a long poll.
    ///
    /// # Errors
    /// `busy` where too many are open.
    pub fn watch(&self) -> Result<Share, Problem> {
        self.turn.step_aside();
        self.watchers.take(&self.name, 1).map_err(|refused| {
            let detail = match refused {
                Refused::Everyone => "Too many requests are waiting for jobs.",
                Refused::Client | Refused::TooMuch { .. } => "Too many requests from this client are waiting for jobs.",
            };
            Problem::new(&problem::BUSY, detail).retry_after(5)
        })
    }

    /// Runs the reading and checking of an upload, or the writing of a file, on the pool for these, which has a line of
    /// its own: whatever waits in it keeps nobody from reading.
    ///
    /// # Errors
    /// Whatever `work` answers.
    pub async fn on_intake_pool<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        self.turn.step_aside();
        self.state.on_intake_pool(work).await
    }

    /// Runs a synchronous solve on its own small pool, so that neither jobs nor uploads starve it; clients take turns
    /// at it. Where the client goes away the work is skipped, or cancelled at its next checkpoint; its place is held
    /// until it has ended.
    ///
    /// # Errors
    /// `busy` where too many solves of this client, or of all, are waiting, and whatever `work` answers.
    pub async fn solve<T: Send + 'static>(
        &self,
        operation: &'static str,
        work: impl FnOnce(&dyn Monitor) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let place = match self.place.take() {
            Some(place) => place,
            None => solve_place(&self.state, &self.name)?,
        };
        // Solves have a line of their own.
        self.turn.step_aside();
        let begin = Instant::now();
        let left = Arc::new(AtomicBool::new(false));
        let mut attendance = Attendance { left: left.clone(), ended: false };
        let (sender, receiver) = oneshot::channel();
        let (held, metrics) = (self.held.clone(), self.metrics.clone());
        self.solve_turns.spawn(&self.solves, &self.name, move || {
            let result = match left.load(Ordering::Relaxed) {
                true => Err(Cancelled.into()),
                // A panic that left the closure would end the process.
                false => catch_unwind(AssertUnwindSafe(|| work(&Attended(&left))))
                    .unwrap_or_else(|_| Err(Problem::internal("the work panicked"))),
            };
            if left.load(Ordering::Relaxed) {
                metrics.solves_abandoned.inc();
            }
            // Before the answer, so that who has it finds the place free.
            drop((place, held));
            let _receiver_is_gone = sender.send(result);
        });
        let result = receiver.await.map_err(|_| Problem::internal("the pool dropped the work"))?;
        attendance.ended = true;
        self.metrics.reduced_solve_seconds.with_label_values(&[operation]).observe(begin.elapsed().as_secs_f64());
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::http::slots::Slots;
    use crate::store::{Store, StoreOptions};
    use crate::telemetry::Metrics;
    use futures_util::FutureExt;
    use std::sync::mpsc;

    async fn client(folder: &std::path::Path) -> ClientState {
        let store = Store::open(StoreOptions::new(folder)).await.unwrap();
        let config = Config { solve_threads: 1, ..Config::default() };
        let state = AppState::new(store, config, Arc::new(Metrics::new().unwrap()), || true).unwrap();
        ClientState {
            state,
            principal: "a".into(),
            name: "a".into(),
            held: Arc::default(),
            turn: Turn::default(),
            place: SolvePlace::default(),
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn what_nobody_waits_for_is_skipped_or_cancelled_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let client = client(folder.path()).await;
        let (begun, running) = mpsc::channel();
        let (go_on, gate) = mpsc::channel();
        let (told, heard) = mpsc::channel();
        let first = {
            let client = client.clone();
            tokio::spawn(async move {
                let work = move |monitor: &dyn Monitor| {
                    begun.send(monitor.checkpoint().is_ok()).unwrap();
                    gate.recv().unwrap();
                    told.send(monitor.checkpoint().is_err()).unwrap();
                    Ok(())
                };
                client.solve("first", work).await
            })
        };
        assert!(tokio::task::spawn_blocking(move || running.recv().unwrap()).await.unwrap());
        let second = {
            let client = client.clone();
            tokio::spawn(async move { client.solve("second", |_| -> Result<(), Problem> { panic!("it runs") }).await })
        };
        while client.solve_places.held() < 2 {
            tokio::task::yield_now().await;
        }
        first.abort();
        second.abort();
        assert!(first.await.unwrap_err().is_cancelled() && second.await.unwrap_err().is_cancelled());
        assert_eq!(client.solve_places.held(), 2, "places are held until the work has ended");
        go_on.send(()).unwrap();
        assert!(tokio::task::spawn_blocking(move || heard.recv().unwrap()).await.unwrap(), "the work is cancelled");
        // On a pool of one thread this one comes after both.
        client.solve("third", |_| Ok(())).await.unwrap();
        assert_eq!((client.metrics.solves_abandoned.get(), client.solve_places.held()), (2, 0));
        client.store.close().await;
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn what_waits_for_the_pool_of_uploads_keeps_nobody_from_reading() {
        let folder = tempfile::tempdir().unwrap();
        let slots = Slots::new(2);
        let mut client = client(folder.path()).await;
        client.turn = Turn::of(&slots, &client.name).await;
        let name = client.name.clone();
        assert!(Turn::of(&slots, &name).now_or_never().is_none(), "one client has one of two slots");
        let (begun, running) = mpsc::channel();
        let (go_on, gate) = mpsc::channel();
        let written = {
            let client = client.clone();
            tokio::spawn(async move {
                let work = move || {
                    begun.send(()).unwrap();
                    gate.recv().unwrap();
                    Ok(())
                };
                client.on_intake_pool(work).await
            })
        };
        tokio::task::spawn_blocking(move || running.recv().unwrap()).await.unwrap();
        assert!(Turn::of(&slots, &name).now_or_never().is_some(), "the slot is free while the work goes on");
        go_on.send(()).unwrap();
        written.await.unwrap().unwrap();
        client.store.close().await;
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_client_beyond_its_part_is_told_to_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let client = client(folder.path()).await;
        let held: Vec<Share> =
            (0..client.solve_places.most()).map(|_| client.solve_places.take(&client.name, 1).unwrap()).collect();
        let refused = client.solve("filter", |_| Ok(())).await.unwrap_err();
        assert_eq!(refused.kind(), &problem::BUSY);
        assert!(refused.detail().contains("this client"), "{}", refused.detail());
        let other = ClientState { name: "b".into(), ..client.clone() };
        other.solve("filter", |_| Ok(())).await.unwrap();
        drop(held);
        client.solve("filter", |_| Ok(())).await.unwrap();
    }
}
