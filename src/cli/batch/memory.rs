//! Memory that is promised to meshes before they begin: those that would not fit beside the others wait, one alone that
//! never fits is refused.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::cli::{CliError, memory};

/// What is promised now.
#[derive(Debug, Default)]
pub struct Promises {
    taken: Mutex<u64>,
    less: Condvar,
}

/// Memory that is given back when this is dropped.
#[derive(Debug)]
pub struct Promise<'a> {
    of: &'a Promises,
    bytes: u64,
}

impl Promises {
    /// Waits until there is room.
    ///
    /// # Errors
    /// [`CliError::Refused`] where there is too little with nothing else at work.
    pub fn take(&self, bytes: u64) -> Result<Promise<'_>, CliError> {
        let mut taken = self.lock();
        loop {
            // What others were promised they may not have taken yet, so the free memory counts it twice at worst.
            let fits = memory::available().is_none_or(|free| taken.saturating_add(bytes) <= free);
            if fits {
                *taken += bytes;
                return Ok(Promise { of: self, bytes });
            }
            if *taken == 0 {
                return Err(CliError::Refused(format!("it needs about {bytes} bytes of memory, more than is free")));
            }
            taken = self.less.wait(taken).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn lock(&self) -> MutexGuard<'_, u64> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Promise<'_> {
    fn drop(&mut self) {
        *self.of.lock() -= self.bytes;
        self.of.less.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_back_can_be_promised_again() {
        let promises = Promises::default();
        let first = promises.take(1 << 10).unwrap();
        let second = promises.take(1 << 10).unwrap();
        assert_eq!(*promises.lock(), 2 << 10);
        drop((first, second));
        assert_eq!(*promises.lock(), 0);
        if memory::available().is_some() {
            assert!(promises.take(u64::MAX).unwrap_err().to_string().contains("memory"));
        }
    }
}
