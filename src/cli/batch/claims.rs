//! Results that are being made: equal meshes have one result, and are worked on one after the other.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

#[derive(Debug, Default)]
struct Paths {
    in_work: HashSet<PathBuf>,
    made: HashSet<PathBuf>,
}

/// What is in work, and what this run has made.
#[derive(Debug, Default)]
pub struct Claims {
    paths: Mutex<Paths>,
    fewer: Condvar,
}

/// A result that nobody else works on until this is dropped.
#[derive(Debug)]
pub struct Claim<'a> {
    of: &'a Claims,
    path: PathBuf,
}

impl Claims {
    /// Waits until nobody works on this result. To be taken before memory is promised: who waits here must hold none.
    pub fn take(&self, path: &Path) -> Claim<'_> {
        let mut paths = self.lock();
        while !paths.in_work.insert(path.to_owned()) {
            paths = self.fewer.wait(paths).unwrap_or_else(PoisonError::into_inner);
        }
        Claim { of: self, path: path.to_owned() }
    }

    fn lock(&self) -> MutexGuard<'_, Paths> {
        self.paths.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Claim<'_> {
    /// Whether this run has made it, for an equal mesh.
    pub fn was_made(&self) -> bool {
        self.of.lock().made.contains(&self.path)
    }

    /// Remembers that this run has made it.
    pub fn made(&self) {
        self.of.lock().made.insert(self.path.clone());
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        self.of.lock().in_work.remove(&self.path);
        self.of.fewer.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_in_work_once() {
        let claims = Claims::default();
        let made = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let claim = claims.take(Path::new("one"));
                    if !claim.was_made() {
                        made.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        claim.made();
                    }
                });
            }
        });
        assert_eq!(made.into_inner(), 1);
        assert!(!claims.take(Path::new("other")).was_made());
    }
}
