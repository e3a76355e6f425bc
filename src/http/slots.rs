//! How many requests are worked on at once, whose turn is next, and when a request that waits for somebody else steps
//! aside.
//!
//! What a request reads from the store stands in one line with what all others read. A client that has a thousand
//! requests open would have everybody else wait behind them, although each takes less than a millisecond; so only a few
//! are let on at a time, client by client, and the rest wait without taking anything.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

use super::turns::Lines;

/// The part of all slots that one client may hold, as a fraction.
const PART: (usize, usize) = (3, 4);

/// The slots of a server.
#[derive(Debug, Clone)]
pub struct Slots(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    most_of_one: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    free: usize,
    held: HashMap<Arc<str>, usize>,
    lines: Lines<oneshot::Sender<Slot>>,
}

/// The right to be worked on, until it is dropped.
#[derive(Debug)]
struct Slot(Option<(Slots, Arc<str>)>);

impl Slots {
    /// So many slots, two at least.
    pub fn new(count: usize) -> Self {
        let free = count.max(2);
        let most_of_one = free * PART.0 / PART.1;
        Self(Arc::new(Inner { most_of_one, state: Mutex::new(State { free, ..State::default() }) }))
    }

    async fn take(&self, client: &Arc<str>) -> Slot {
        let (sender, receiver) = oneshot::channel();
        {
            let mut state = self.lock();
            state.lines.add(client, sender);
            self.grant_slots(&mut state);
        }
        // Slots are dealt as long as there are any, and whoever waits is in the line: it comes.
        receiver.await.unwrap_or(Slot(None))
    }

    /// Gives free slots to those whose turn it is.
    fn grant_slots(&self, state: &mut State) {
        while state.free > 0 {
            let (held, most) = (&state.held, self.0.most_of_one);
            let may = |client: &Arc<str>| held.get(client).copied().unwrap_or(0) < most;
            let Some((client, sender)) = state.lines.next(may) else { return };
            match sender.send(Slot(Some((self.clone(), client.clone())))) {
                Ok(()) => {
                    state.free -= 1;
                    *state.held.entry(client).or_default() += 1;
                }
                // Whoever waited has gone. What it was to have must not be given back: it was never taken.
                Err(mut slot) => slot.0 = None,
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let Some((slots, client)) = self.0.take() else { return };
        let mut state = slots.lock();
        state.free += 1;
        if let Some(held) = state.held.get_mut(&client) {
            *held -= 1;
            if *held == 0 {
                state.held.remove(&client);
            }
        }
        slots.grant_slots(&mut state);
    }
}

/// The slot of one request, which everything that works for it shares. Without one it is not in line: an operation that
/// writes waits for other writes.
#[derive(Debug, Clone, Default)]
pub struct Turn(Option<Arc<TurnSlot>>);

#[derive(Debug)]
struct TurnSlot {
    slots: Slots,
    client: Arc<str>,
    slot: Mutex<Option<Slot>>,
}

impl Turn {
    /// Waits for a slot of the client's.
    pub async fn of(slots: &Slots, client: &Arc<str>) -> Self {
        let slot = Mutex::new(Some(slots.take(client).await));
        Self(Some(Arc::new(TurnSlot { slots: slots.clone(), client: client.clone(), slot })))
    }

    /// Lets others on while the request waits for its client, for a job, or for threads that have a line of their own;
    /// or when it is answered.
    pub fn step_aside(&self) {
        if let Some(held) = &self.0 {
            let slot = held.lock().take();
            drop(slot);
        }
    }

    /// Waits for a slot again, where there is none.
    pub async fn go_on(&self) {
        let Some(held) = &self.0 else { return };
        if held.lock().is_some() {
            return;
        }
        let slot = held.slots.take(&held.client).await;
        *held.lock() = Some(slot);
    }
}

impl TurnSlot {
    fn lock(&self) -> MutexGuard<'_, Option<Slot>> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt;

    use super::*;

    #[tokio::test]
    async fn one_client_leaves_slots_to_others_and_waits_alone() {
        let slots = Slots::new(4);
        let (greedy, modest): (Arc<str>, Arc<str>) = ("greedy".into(), "modest".into());
        let mut held = Vec::new();
        for _ in 0..3 {
            held.push(slots.take(&greedy).await);
        }
        let mut fourth = std::pin::pin!(slots.take(&greedy));
        assert!(fourth.as_mut().now_or_never().is_none(), "three of four are what one client may hold");
        let own = slots.take(&modest).now_or_never().expect("there is one left");
        let mut second = std::pin::pin!(slots.take(&modest));
        assert!(second.as_mut().now_or_never().is_none());
        // The greedy client came first, but may have no more: the slot is not for it.
        drop(own);
        let second = second.now_or_never().expect("it is the modest client's turn");
        held.pop();
        let fourth = fourth.now_or_never().expect("it may hold one again");
        drop((held, second, fourth));
        let state = slots.lock();
        assert_eq!((state.free, state.held.len()), (4, 0));
    }

    #[tokio::test]
    async fn whoever_goes_away_while_it_waits_takes_nothing() {
        let slots = Slots::new(2);
        let client: Arc<str> = "a".into();
        let held = slots.take(&client).await;
        {
            let mut gone = std::pin::pin!(slots.take(&client));
            assert!(gone.as_mut().now_or_never().is_none());
        }
        let mut given = Box::pin(slots.take(&client));
        assert!(given.as_mut().now_or_never().is_none());
        drop(held);
        // It was given its slot and goes away before it knows.
        drop(given);
        let state = slots.lock();
        assert_eq!((state.free, state.held.len()), (2, 0));
    }

    #[tokio::test]
    async fn a_request_that_steps_aside_has_to_wait_for_its_turn_again() {
        let slots = Slots::new(2);
        let (a, b): (Arc<str>, Arc<str>) = ("a".into(), "b".into());
        let turn = Turn::of(&slots, &a).await;
        turn.go_on().now_or_never().expect("it has its slot");
        turn.clone().step_aside();
        let other = slots.take(&a).await;
        let one = slots.take(&b).await;
        let mut again = std::pin::pin!(turn.go_on());
        assert!(again.as_mut().now_or_never().is_none());
        drop(other);
        assert!(again.now_or_never().is_some());
        turn.step_aside();
        turn.step_aside();
        drop(one);
        assert_eq!(slots.lock().free, 2);
        Turn::default().go_on().await;
    }
}
