//! A start from columns that are thought to be near the wanted eigenvectors: those of the same connectivity in another pose, or of another operator on it.
//!
//! Nothing about them is taken for granted. They only say where shifts should lie and what the first solves begin with; what they lack is added from random
//! vectors, what they miss is found as it is after any other start, and the certificate does not know where the iteration began.

use chladni_algebra::{PanelMatrix, residual_sums};
use chladni_base::{Monitor, SplitMix64};

use super::HsimError;
use super::columns::{lengths, normalise};
use super::kernel::Kernel;
use super::krylov::{random_block, solve};
use super::shifts::factor_near;
use super::solve::Finest;

/// A column of which the kernel leaves less than this share belongs to it.
const KERNEL_SHARE: f64 = 1e-3;

/// Solves with random vectors, which leave of them what belongs to eigenvalues near the shift.
const SOLVES: usize = 2;

/// Columns to iterate on, `columns` of them, and estimates of their values, both by ascending value: the given ones, lowest first, without those of the
/// kernel, and as many as they lack from beside the last of them. `given` has a row for each row of the level.
///
/// # Errors
/// [`HsimError::Parameter`] where there is nothing in the columns to start from, [`HsimError`] otherwise where a factor fails or the work was cancelled.
pub(super) fn start(
    finest: &Finest,
    kernel: &Kernel<'_>,
    mut given: PanelMatrix,
    columns: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(PanelMatrix, Vec<f64>), HsimError> {
    let level = &finest.level;
    monitor.checkpoint()?;
    normalise(&mut given);
    let before = lengths(&level.mass, &given);
    kernel.remove(&mut given);
    let after = lengths(&level.mass, &given);
    let mut clear: Vec<usize> = (0..before.len()).filter(|&k| after[k] > KERNEL_SHARE * before[k]).collect();
    let nothing = |reason: &str| HsimError::Parameter { name: "start", reason: reason.to_owned() };
    if clear.is_empty() {
        return Err(nothing("has nothing beside the kernel of this operator, or what is no number"));
    }
    given = given.select(&clear);
    let sums = residual_sums(&level.stiffness, &level.mass, &given, &vec![0.0; clear.len()], monitor)?;
    let quotients: Vec<f64> = sums.iter().map(|sums| sums.product / sums.mass).collect();
    if !quotients.iter().all(|value| value.is_finite()) {
        return Err(nothing("has values that are no finite numbers"));
    }
    clear = (0..quotients.len()).collect();
    clear.sort_by(|&a, &b| quotients[a].total_cmp(&quotients[b]));
    clear.truncate(columns);
    let mut values: Vec<f64> = clear.iter().map(|&column| quotients[column]).collect();
    given = given.select(&clear);
    let (have, missing) = (values.len(), columns - values.len());
    if missing > 0 {
        let (lowest, top) = (values[0], values[have - 1]);
        // Eigenvalues of a surface grow with their index: the middle of those that are missing.
        let beyond = (top - lowest.min(0.0)).max(1e-6 * finest.level.spread()) * 0.5 * missing as f64 / have as f64;
        let (at, factor) = factor_near(level, &finest.symbolic, top + beyond, level.spread(), Vec::new())?;
        let mut random = SplitMix64::new(seed ^ 0x57a7_2e4b);
        let mut fresh = random_block(level.size(), missing, &mut random);
        for _ in 0..SOLVES {
            monitor.checkpoint()?;
            solve(level, kernel, &factor, &mut fresh);
        }
        given.widen(columns);
        given.assign(&(have..columns).collect::<Vec<_>>(), &fresh);
        values.resize(columns, at);
    }
    Ok((given, values))
}
