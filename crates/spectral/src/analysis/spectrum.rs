//! What several analyses ask of eigenvalues.

use super::error::AnalysisError;

/// Eigenvalues below this share of the largest count as zero.
pub(super) const ZERO: f64 = 1e-8;

/// How many of the ascending eigenvalues are zero: the functions that are constant on each component.
///
/// # Errors
/// [`AnalysisError::OnlyKernel`] where none is above zero; [`AnalysisError::Negative`] names the first that is below.
pub fn kernel_size(eigenvalues: &[f64]) -> Result<usize, AnalysisError> {
    let largest = eigenvalues.last().copied().unwrap_or(0.0);
    if !(largest > 0.0) {
        return Err(AnalysisError::OnlyKernel);
    }
    let zero = ZERO * largest;
    if let Some(index) = eigenvalues.iter().position(|&value| value < -zero) {
        return Err(AnalysisError::Negative { index, value: eigenvalues[index] });
    }
    Ok(eigenvalues.iter().take_while(|&&value| value <= zero).count())
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
        assert_eq!(kernel_size(&[0.0, 0.0]).unwrap_err(), AnalysisError::OnlyKernel);
        assert_eq!(kernel_size(&[]).unwrap_err(), AnalysisError::OnlyKernel);
        assert_eq!(kernel_size(&[-0.5, 2.0]).unwrap_err(), AnalysisError::Negative { index: 0, value: -0.5 });
    }

    #[test]
    fn times_span_the_spectrum() {
        let times = heat_times(&[0.0, 2.0, 8.0], 3).unwrap();
        let decades = |t: f64, value: f64| t * value / std::f64::consts::LN_10;
        assert!((decades(times[0], 8.0) - 4.0).abs() < 1e-12 && (decades(times[2], 2.0) - 4.0).abs() < 1e-12);
        assert!((times[1] * times[1] - times[0] * times[2]).abs() < 1e-12);
    }
}
