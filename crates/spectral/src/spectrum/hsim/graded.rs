//! Pencils whose eigenvalues spread over many orders of magnitude, as needles and hairs make them: a dense eigenproblem
//! is solved to within rounding of its largest eigenvalue, in which the low ones get lost.

use chladni_algebra::{DenseMatrix, PanelMatrix, SymmetricDefiniteSolver, gpu, restrict, rotate};
use chladni_base::{Monitor, Quiet};

use super::HsimError;
use super::level::Level;
use super::ritz::ritz;

/// Values below this share of the highest one lose digits to it that may be wanted.
const SHARE: f64 = 1e-6;

/// Pencils whose largest eigenvalue exceeds the wanted ones by this are solved by their inverse.
const WIDE: f64 = 1e5;

/// Adds `factor · M 1 1ᵀ M / 1ᵀM1` for the constants `1` of every component.
pub(super) fn add_constants(matrix: &mut DenseMatrix, lumped: &[f64], components: &[Vec<usize>], factor: f64) {
    for rows in components {
        let total: f64 = rows.iter().map(|&row| lumped[row]).sum();
        for &column in rows {
            let factor = factor * lumped[column] / total;
            let entries = matrix.column_mut(column);
            rows.iter().for_each(|&row| entries[row] += factor * lumped[row]);
        }
    }
}

/// How many of ascending values are so far below the last that they lose digits to it.
fn cut(values: &[f64]) -> Option<usize> {
    let last = *values.last()?;
    let cut = values.partition_point(|&value| value <= SHARE * last);
    (last > 0.0 && cut > 0 && cut < values.len()).then_some(cut)
}

/// Makes Ritz pairs, ascending by value, as exact as the pencil allows: those that are small beside the highest ones
/// are Ritz pairs of their own span anew, and so on down. Columns stay orthonormal.
pub(super) fn sharpen(
    level: &Level,
    vectors: &mut PanelMatrix,
    values: &mut [f64],
    monitor: &dyn Monitor,
) -> Result<(), HsimError> {
    let mut high = values.len();
    while let Some(cut) = cut(&values[..high]) {
        let columns: Vec<usize> = (0..cut).collect();
        let mut low = vectors.select(&columns);
        let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &low, monitor)?;
        let (sharper, rotation) = ritz(stiffness, gram, cut, monitor)?;
        if sharper.len() < cut || sharper.last().is_none_or(|&last| !(last <= values[cut])) {
            return Ok(());
        }
        rotate(&mut low, &rotation, monitor)?;
        vectors.assign(&columns, &low);
        values[..cut].copy_from_slice(&sharper);
        high = cut;
    }
    Ok(())
}

/// The lowest `count` pairs of `(stiffness, mass)`, both dense, by the largest eigenvalues of the inverse:
/// `M x = ν (S + σM) x`, from which the `kernel` of constants on components is taken. `None` where the pencil is not
/// wide, or `S + σM` not definite. `ratios` are the row sums of `|S|` over the mass.
pub(super) fn by_inverse(
    level: &Level,
    (stiffness, mass): (&DenseMatrix, &DenseMatrix),
    kernel: &[Vec<usize>],
    count: usize,
    mut ratios: Vec<f64>,
    monitor: &dyn Monitor,
) -> Result<Option<(Vec<f64>, PanelMatrix)>, HsimError> {
    let n = stiffness.rows();
    let top = ratios.iter().copied().fold(0.0, f64::max);
    let median = *ratios.select_nth_unstable_by(n / 2, f64::total_cmp).1;
    // By Weyl's law, about the last wanted one.
    let shift = median * count as f64 / n as f64;
    if !(shift > 0.0 && top > WIDE * shift) {
        return Ok(None);
    }
    let (mut shifted, mut negative) = (stiffness.clone(), mass.clone());
    shifted.values_mut().iter_mut().zip(mass.values()).for_each(|(s, m)| *s += shift * m);
    negative.values_mut().iter_mut().for_each(|m| *m = -*m);
    // Far on the other side: next to zero lie the inverses of the highest values.
    add_constants(&mut negative, &level.mass.lumped(), kernel, 2.0);
    monitor.checkpoint()?;
    let Ok(pairs) = gpu::accelerator().lowest(negative, shifted, count, &Quiet(monitor)) else { return Ok(None) };
    monitor.checkpoint()?;
    let mut vectors = PanelMatrix::from_dense(&pairs.vectors);
    super::columns::normalise(&mut vectors);
    let (stiffness, gram) = restrict(&level.stiffness, &level.mass, &vectors, monitor)?;
    let (mut values, rotation) = ritz(stiffness, gram, count, monitor)?;
    if values.len() < count {
        return Ok(None);
    }
    rotate(&mut vectors, &rotation, monitor)?;
    sharpen(level, &mut vectors, &mut values, monitor)?;
    Ok(Some((values, vectors)))
}

#[cfg(test)]
#[path = "graded_tests.rs"]
mod tests;
