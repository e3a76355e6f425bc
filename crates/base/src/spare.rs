//! Memory that one piece of work leaves to the next.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// What pieces of work on many threads take, use and leave behind: fresh memory often costs as much as the work itself.
/// There is never more than was in use at once.
#[derive(Debug)]
pub struct Spare<T>(Mutex<Vec<T>>);

impl<T> Default for Spare<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Spare<T> {
    /// Works with what was left behind, or with what is made now.
    pub fn with<R>(&self, make: impl FnOnce() -> T, work: impl FnOnce(&mut T) -> R) -> R {
        let left = self.idle().pop();
        let mut own = left.unwrap_or_else(make);
        let answer = work(&mut own);
        self.idle().push(own);
        answer
    }

    fn idle(&self) -> MutexGuard<'_, Vec<T>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_behind_is_used_again_and_two_at_once_have_their_own() {
        let (spare, mut made) = (Spare::default(), 0);
        let mut make = || {
            made += 1;
            vec![made]
        };
        spare.with(&mut make, |own| own.push(7));
        spare.with(&mut make, |own| {
            assert_eq!(own, &[1, 7]);
            spare.with(|| vec![9], |other| assert_eq!(other, &[9]));
        });
        assert_eq!(made, 1);
    }
}
