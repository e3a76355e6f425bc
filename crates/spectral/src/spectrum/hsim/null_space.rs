//! A start where zero is an eigenvalue of very many vectors, as for the curl-curl operator of edge elements, whose
//! kernel are all gradients.
//!
//! A Krylov space of blocks holds no more vectors of one eigenvalue than a block has columns. As many random vectors as
//! the kernel has dimensions, solved at a shift next to zero, span it at once; what lies above has a space beside it.

use chladni_algebra::{PANEL_WIDTH, PanelMatrix, SymbolicFactor, restrict, rotate};
use chladni_base::{Monitor, SplitMix64};

use super::HsimError;
use super::kernel::Kernel;
use super::krylov;
use super::level::Level;
use super::ritz::ritz;
use super::scout::{NEGLIGIBLE, Scout};
use super::shifts::factor_near;

/// A kernel of so many dimensions is left to a Krylov space, whose iteration finds what a block did not hold.
const FEW: usize = 2 * PANEL_WIDTH;

/// Solves: each leaves of other eigenvectors about the ratio of the shift and their eigenvalues.
const SOLVES: usize = 2;

/// `columns` Ritz pairs beside the known kernel, ascending by value, of a pencil without negative eigenvalues; nothing
/// where zero has few eigenvectors or more than so many.
pub(super) fn start(
    (level, symbolic): (&Level, &SymbolicFactor),
    kernel: &Kernel<'_>,
    scout: &mut Scout<'_>,
    columns: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Option<(Vec<f64>, PanelMatrix)>, HsimError> {
    if columns <= FEW || !scout.is_semidefinite()? {
        return Ok(None);
    }
    let zero = NEGLIGIBLE * scout.spread();
    let dimension = scout.count(zero)?.saturating_sub(kernel.dimension());
    if dimension <= FEW || dimension > columns {
        return Ok(None);
    }
    let (_, factor) = factor_near(level, symbolic, -zero, scout.spread(), Vec::new(), monitor)?;
    let room = level.size() - kernel.dimension();
    let mut random = SplitMix64::new(seed ^ 0x4e75_6c6c);
    // Some more: a square matrix of random numbers may be nearly singular.
    let mut vectors = krylov::random_block(level.size(), (dimension + PANEL_WIDTH).min(room), &mut random);
    for _ in 0..SOLVES {
        monitor.checkpoint()?;
        krylov::solve(level, kernel, &factor, &mut vectors);
    }
    drop(factor);
    // Columns are close to dependent: the first Rayleigh–Ritz loses digits, and the second one has them all.
    for _ in 0..2 {
        let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &vectors, monitor)?;
        let (_, rotation) = ritz(stiffness, gram, dimension, monitor)?;
        rotate(&mut vectors, &rotation, monitor)?;
    }
    let window = scout.window(columns + kernel.dimension(), None, true, monitor)?;
    let factor = window.factor_below(level, symbolic, monitor)?;
    krylov::start(vectors, level, kernel, &factor, columns, seed, monitor).map(Some)
}
