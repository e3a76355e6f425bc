//! What a Krylov space is to hold.

use super::lanczos::most;
use super::scout::NEGLIGIBLE;
use super::tuning::TUNING;

/// What is wanted, beside the kernel.
#[derive(Debug, Clone, Copy)]
pub(super) struct KrylovRequest {
    /// The index of the first pair.
    pub from: usize,
    /// Pairs that must converge.
    pub pairs: usize,
    /// Columns to give back, the others with whatever residual they have.
    pub columns: usize,
    /// The residual (4.6).
    pub tolerance: f64,
    /// The most columns of the space.
    pub most: usize,
    /// The least shift, as a share of the largest eigenvalue.
    pub least_shift: f64,
    pub seed: u64,
    /// How many pairs may be left to an iteration.
    pub leave: Leave,
    /// So many of the lowest eigenvalues are zero, and residuals are relative to `‖(S + σM) x‖`, where `σ` is the next
    /// one.
    pub zeros: Option<usize>,
}

/// Which of the wanted pairs may be left, before they have converged, to an iteration that refines what is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Leave {
    /// None: what is found is joined to other pairs as it is.
    Nothing,
    /// Some, once the space may not grow any more: where an iteration takes more memory than columns do.
    WhenFull,
    /// A few after some looks too: where an iteration takes less time than columns do.
    Stragglers,
}

impl Leave {
    /// How many of so many wanted pairs may be left after so many looks, or when the space cannot grow.
    pub(super) fn most(self, pairs: usize, is_full: bool, looks: usize) -> usize {
        match (self, is_full) {
            (Self::Nothing, _) | (Self::WhenFull, false) => 0,
            (Self::WhenFull | Self::Stragglers, true) => pairs / TUNING.krylov.many_left,
            (Self::Stragglers, false) => looks / TUNING.krylov.few_left,
        }
    }
}

impl KrylovRequest {
    /// The lowest pairs of a level of a size.
    pub fn lowest(size: usize, pairs: usize, columns: usize, tolerance: f64, seed: u64) -> Self {
        let (most, least_shift) = (most(size, pairs), NEGLIGIBLE);
        let (leave, zeros) = (Leave::Stragglers, None);
        Self { from: 0, pairs, columns, tolerance, most, least_shift, seed, leave, zeros }
    }
}
