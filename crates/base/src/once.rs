//! Values that are made when somebody first asks for them.

use std::sync::OnceLock;

/// The value of a cell, made where there is none yet. It is made while nothing is locked: several who ask at once may
/// each make one, of which the first is kept.
///
/// A thread that makes something by parallel loops while it holds a lock, as within [`OnceLock::get_or_init`], waits
/// for other threads of its pool, and works for them meanwhile: on a piece of work that waits for the same lock,
/// perhaps, and then neither ends.
pub fn made_once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    if let Some(known) = cell.get() {
        return known;
    }
    let made = make();
    cell.get_or_init(|| made)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_asks_while_the_value_is_made_gets_one_and_the_first_is_kept() {
        let cell = OnceLock::new();
        let outer = made_once(&cell, || {
            // What a thread that waits for a part of its work may be given to do.
            assert_eq!(*made_once(&cell, || 1), 1);
            2
        });
        assert_eq!(*outer, 1);
        assert_eq!(*made_once(&cell, || 3), 1);
    }
}
