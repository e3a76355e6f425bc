//! Who works on a panel: a thread of its own, or all threads together. Panels of their own need no waiting, but memory
//! for each, and leave threads idle where there are fewer panels.

use chladni_base::Spare;
use chladni_base::parallel::*;

use super::CycleRow;
use super::smoother::Buffers;
use crate::Patch;

/// Who works on a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sharing {
    OneThread,
    AllThreads,
}

/// Rows of a level that a thread takes at once, where threads share a panel: a quarter of a megabyte.
pub(super) const SHARED_ROWS: usize = 4096;

impl Sharing {
    /// A level that is not worth sharing is left to one thread.
    pub(super) fn of(self, rows: usize) -> Self {
        if rows < 2 * SHARED_ROWS { Self::OneThread } else { self }
    }

    /// Calls `work` with all rows, from the first on, or with some of them at a time.
    pub(super) fn rows(self, rows: &mut [CycleRow], work: impl Fn(usize, &mut [CycleRow]) + Sync) {
        match self {
            Self::OneThread => work(0, rows),
            Self::AllThreads => {
                rows.par_chunks_mut(SHARED_ROWS).enumerate().for_each(|(at, rows)| work(at * SHARED_ROWS, rows));
            }
        }
    }
}

/// Rows of zeros, written by all threads: what fresh memory costs is the first touch.
pub fn zeros_by_all(rows: usize) -> Vec<CycleRow> {
    (0..rows).into_par_iter().with_min_len(SHARED_ROWS).map(|_| Default::default()).collect()
}

/// Calls `work` with each patch, buffers and its target; the answers are in order.
pub(super) fn over_patches<T: Send, S: Send>(
    sharing: Sharing,
    patches: &[Patch],
    buffers: &Spare<Buffers>,
    targets: Vec<T>,
    work: impl Fn(&Patch, &mut Buffers, T) -> S + Sync,
) -> Vec<S> {
    let one = |(patch, target): (&Patch, T)| buffers.with(Buffers::default, |local| work(patch, local, target));
    match sharing {
        Sharing::OneThread => patches.iter().zip(targets).map(one).collect(),
        Sharing::AllThreads => patches.par_iter().zip(targets).map(one).collect(),
    }
}

/// The rows of each patch.
pub fn by_patch<'a, T>(patches: &[Patch], rows: &'a mut [T]) -> Vec<&'a mut [T]> {
    let mut left = rows;
    let cut = |patch: &Patch| {
        let (own, others) = std::mem::take(&mut left).split_at_mut(patch.rows().len());
        left = others;
        own
    };
    patches.iter().map(cut).collect()
}
