//! What clients share and none may use up: places for solves, bytes of requests, event streams. One client may hold a
//! part of it, so that another one always finds something left.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The part of the whole that one client may hold, as a fraction.
const PART: (u64, u64) = (3, 4);

/// A number of things, or of bytes, that all clients share.
#[derive(Debug, Clone)]
pub struct Shares(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    whole: u64,
    held: Mutex<SharesInUse>,
}

#[derive(Debug, Default)]
struct SharesInUse {
    total: u64,
    by_client: HashMap<Arc<str>, u64>,
}

/// Why nothing was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// The client holds its part already.
    Client,
    /// All clients together hold all of it.
    Everyone,
    /// It is more than one client may ever hold.
    TooMuch {
        /// What one client may hold.
        most: u64,
    },
}

impl Shares {
    /// So many things to share.
    pub fn new(whole: u64) -> Self {
        Self(Arc::new(Inner { whole, held: Mutex::default() }))
    }

    /// What one client may hold; at least one.
    pub fn most(&self) -> u64 {
        let (over, under) = PART;
        let most = u128::from(self.0.whole) * u128::from(over) / u128::from(under);
        u64::try_from(most).unwrap_or(u64::MAX).max(1)
    }

    /// A share that holds nothing yet.
    pub fn none(&self, client: &Arc<str>) -> Share {
        Share { shares: self.clone(), client: client.clone(), held: 0 }
    }

    /// Takes `count` for a client.
    ///
    /// # Errors
    /// [`Refused`]; nothing is held then.
    pub fn take(&self, client: &Arc<str>, count: u64) -> Result<Share, Refused> {
        let mut share = self.none(client);
        share.grow_to(count)?;
        Ok(share)
    }

    /// What all clients hold together.
    pub fn held(&self) -> u64 {
        self.lock().total
    }

    fn lock(&self) -> MutexGuard<'_, SharesInUse> {
        self.0.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What one client holds until it is dropped.
#[derive(Debug)]
pub struct Share {
    shares: Shares,
    client: Arc<str>,
    held: u64,
}

impl Share {
    /// Holds `count` in all; what is held already stays.
    ///
    /// # Errors
    /// [`Refused`]; what was held before is still held.
    pub fn grow_to(&mut self, count: u64) -> Result<(), Refused> {
        let more = count.saturating_sub(self.held);
        if more == 0 {
            return Ok(());
        }
        let most = self.shares.most();
        if count > most {
            return Err(Refused::TooMuch { most });
        }
        let mut held = self.shares.lock();
        let own = held.by_client.get(&self.client).copied().unwrap_or(0).saturating_add(more);
        let total = held.total.saturating_add(more);
        if total > self.shares.0.whole {
            return Err(Refused::Everyone);
        }
        if own > most {
            return Err(Refused::Client);
        }
        held.total = total;
        held.by_client.insert(self.client.clone(), own);
        self.held = count;
        Ok(())
    }
}

impl Share {
    /// Gives back what is held beyond `count`.
    pub fn shrink_to(&mut self, count: u64) {
        let less = self.held.saturating_sub(count);
        if less == 0 {
            return;
        }
        self.held -= less;
        let mut held = self.shares.lock();
        held.total = held.total.saturating_sub(less);
        // Who holds nothing is forgotten, so that the table stays as small as the number of those who do.
        if let Some(own) = held.by_client.get_mut(&self.client) {
            *own = own.saturating_sub(less);
            if *own == 0 {
                held.by_client.remove(&self.client);
            }
        }
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.shrink_to(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_client_leaves_something_to_the_others() {
        let shares = Shares::new(8);
        let (greedy, modest): (Arc<str>, Arc<str>) = ("greedy".into(), "modest".into());
        let mut held: Vec<Share> = (0..6).map(|_| shares.take(&greedy, 1).unwrap()).collect();
        assert_eq!(shares.take(&greedy, 1).unwrap_err(), Refused::Client);
        let first = shares.take(&modest, 2).unwrap();
        assert_eq!(shares.take(&modest, 1).unwrap_err(), Refused::Everyone);
        held.pop();
        assert_eq!(shares.held(), 7);
        drop((first, held));
        assert_eq!((shares.held(), shares.lock().by_client.len()), (0, 0));
    }

    #[test]
    fn what_can_never_fit_is_told_apart_and_holds_nothing() {
        let shares = Shares::new(100);
        let client: Arc<str> = "a".into();
        let mut share = shares.none(&client);
        share.grow_to(50).unwrap();
        assert_eq!(share.grow_to(76), Err(Refused::TooMuch { most: 75 }));
        share.grow_to(20).unwrap();
        assert_eq!(shares.held(), 50);
        share.grow_to(75).unwrap();
        share.shrink_to(90);
        share.shrink_to(30);
        assert_eq!(shares.held(), 30);
        drop(share);
        assert_eq!(shares.held(), 0);
        assert_eq!(Shares::new(1).most(), 1);
    }
}
