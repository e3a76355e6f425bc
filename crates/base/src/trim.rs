//! Memory that was let go of, and that the allocator keeps for what is asked for next.

use std::sync::OnceLock;

/// How the allocator of this program gives memory back; libraries do not know which one it is.
static TRIM: OnceLock<fn()> = OnceLock::new();

/// Says how the allocator of this program gives back to the system what it keeps. The first word counts.
pub fn set_trim(trim: fn()) {
    // Whoever comes second is a part of the same program.
    let _ = TRIM.set(trim);
}

/// Asks the allocator to give back to the system what it keeps of what was let go of: between steps that each take much
/// of the memory of a machine, and no two of which are like each other. Does nothing where nobody said how. It may take
/// milliseconds, and memory that is asked for afterwards is cleared anew: nothing for a loop.
pub fn trim() {
    if let Some(trim) = TRIM.get() {
        trim();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn the_allocator_is_asked_as_often_as_that_is_wanted_and_the_first_word_counts() {
        static ASKED: AtomicUsize = AtomicUsize::new(0);
        trim();
        set_trim(|| {
            ASKED.fetch_add(1, Ordering::Relaxed);
        });
        set_trim(|| ASKED.store(1000, Ordering::Relaxed));
        trim();
        trim();
        assert_eq!(ASKED.load(Ordering::Relaxed), 2);
    }
}
