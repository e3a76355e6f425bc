//! What several analyses ask of eigenvalues.

use super::error::AnalysisError;

/// Eigenvalues below this share of the largest are rounding errors of zero.
const ROUNDING: f64 = 1e-13;

/// Those below this share may be, if the next one is so many times as large.
pub(super) const NEARLY: f64 = 1e-10;
const GAP: f64 = 1e3;

/// What lies below zero by more than this share of the largest is negative.
const NEGATIVE: f64 = 1e-8;

/// How many of the ascending eigenvalues are zero: the functions that are constant on each component.
///
/// Solvers that know the kernel give its eigenvalues as exactly zero, and then these are all: on shapes of very
/// different sizes, or graded triangles, the next ones may be smaller than the last by any factor. Without them zero is
/// what rounding makes of it.
///
/// # Errors
/// [`AnalysisError::OnlyKernel`] where none is above zero; [`AnalysisError::Negative`] names the first that is below.
pub fn kernel_size(eigenvalues: &[f64]) -> Result<usize, AnalysisError> {
    let largest = eigenvalues.last().copied().unwrap_or(0.0);
    if !(largest > 0.0) {
        return Err(AnalysisError::OnlyKernel);
    }
    if let Some(index) = eigenvalues.iter().position(|&value| value < -NEGATIVE * largest) {
        return Err(AnalysisError::Negative { index, value: eigenvalues[index] });
    }
    let up_to = |least: f64| eigenvalues.partition_point(|&value| value <= least);
    if eigenvalues.contains(&0.0) {
        return Ok(up_to(0.0));
    }
    let (surely, at_most) = (up_to(ROUNDING * largest), up_to(NEARLY * largest));
    let ends = |&k: &usize| eigenvalues[k] >= GAP * eigenvalues[k - 1].abs();
    Ok((surely + 1..=at_most).rev().find(ends).unwrap_or(surely))
}

/// `count` numbers from `low` to `high`, both above zero, whose ratio is constant.
pub fn log_spaced(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = if count > 1 { (high / low).ln() / (count - 1) as f64 } else { 0.0 };
    (0..count).map(|k| low * (step * k as f64).exp()).collect()
}

/// Times at which heat tells most: `count` of them, log-spaced in `[4 ln 10 / λ_max, 4 ln 10 / λ_1]` (Sun et al. 2009).
///
/// # Errors
/// As [`kernel_size`].
pub fn heat_times(eigenvalues: &[f64], count: usize) -> Result<Vec<f64>, AnalysisError> {
    let first = kernel_size(eigenvalues)?;
    let scale = 4.0 * std::f64::consts::LN_10;
    let last = eigenvalues.last().copied().unwrap_or(1.0);
    Ok(log_spaced(scale / last, scale / eigenvalues[first], count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_told_from_small_values() {
        assert_eq!(kernel_size(&[-1e-12, 1e-11, 0.5, 2.0]).unwrap(), 2);
        assert_eq!(kernel_size(&[0.5, 2.0]).unwrap(), 0);
        assert_eq!(kernel_size(&[-1e-14, 2e-14, 1e-11, 0.5, 2.0]).unwrap(), 3);
        assert_eq!(kernel_size(&[0.0, 0.0]).unwrap_err(), AnalysisError::OnlyKernel);
        assert_eq!(kernel_size(&[]).unwrap_err(), AnalysisError::OnlyKernel);
        assert_eq!(kernel_size(&[-0.5, 2.0]).unwrap_err(), AnalysisError::Negative { index: 0, value: -0.5 });
    }

    #[test]
    fn small_values_beside_exact_zeros_or_in_a_row_are_no_zeros() {
        assert_eq!(kernel_size(&[0.0, 0.0, 1e-14, 1e-12, 1.0]).unwrap(), 2);
        assert_eq!(kernel_size(&[-1e-17, 0.0, 1e-14, 1.0]).unwrap(), 2);
        assert_eq!(kernel_size(&[1e-12, 3e-12, 2e-11, 1e-9, 1e-7, 1e-5, 1e-3, 1.0]).unwrap(), 0);
        assert_eq!(kernel_size(&[2e-16, 3e-12, 2e-11, 1e-9, 1e-7, 1e-5, 1e-3, 1.0]).unwrap(), 1);
    }

    #[test]
    fn times_span_the_spectrum() {
        let times = heat_times(&[0.0, 2.0, 8.0], 3).unwrap();
        let decades = |t: f64, value: f64| t * value / std::f64::consts::LN_10;
        assert!((decades(times[0], 8.0) - 4.0).abs() < 1e-12 && (decades(times[2], 2.0) - 4.0).abs() < 1e-12);
        assert!((times[1] * times[1] - times[0] * times[2]).abs() < 1e-12);
    }
}
