//! Filtering functions by their spectrum (Vallet and Lévy 2008).

use chladni_algebra::DenseMatrix;

use crate::basis::{Basis, BasisError};

/// Why functions were not filtered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A parameter is not a number one can filter with.
    #[error("{parameter} must be {expected}, got {value}")]
    Parameter {
        /// Its name.
        parameter: &'static str,
        /// What it is.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// There is not one sample for each eigenvalue.
    #[error("expected {expected} samples, one for each eigenvalue, got {found}")]
    Samples {
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A curve has no points.
    #[error("points must not be empty")]
    NoPoints,
    /// A sample is infinite or not a number.
    #[error("sample {index} is not finite")]
    NotFinite {
        /// The first such sample.
        index: usize,
    },
    /// The functions do not fit the basis.
    #[error(transparent)]
    Basis(#[from] BasisError),
}

/// By what each part of a function is multiplied, as a function of the eigenvalue `λ ≥ 0` in 1/length² of the input.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Transfer {
    /// Keeps `λ ≤ cutoff`; the detail beyond the basis goes too.
    LowPass {
        /// The largest eigenvalue kept.
        cutoff: f64,
    },
    /// Keeps `λ > cutoff` and the detail beyond the basis.
    HighPass {
        /// The largest eigenvalue removed.
        cutoff: f64,
    },
    /// Keeps `low ≤ λ ≤ high` alone.
    BandPass {
        /// The least eigenvalue kept.
        low: f64,
        /// The largest eigenvalue kept.
        high: f64,
    },
    /// Multiplies `low ≤ λ ≤ high` by `gain` and keeps everything else: exaggerates or softens features of one size.
    Gain {
        /// The least eigenvalue that is changed.
        low: f64,
        /// The largest eigenvalue that is changed.
        high: f64,
        /// The factor.
        gain: f64,
    },
    /// Diffusion: `e^{−λ t}`, which grows where an eigenvalue is negative; the detail beyond the basis is damped as its
    /// last mode is.
    Heat {
        /// The time `t ≥ 0`, in length² of the input.
        time: f64,
    },
    /// Sharpening: `1 + strength · λ / (λ + cutoff)`, from 1 for the coarsest shape to `1 + strength` for detail, that
    /// beyond the basis included. A negative strength, not below −1, softens. Eigenvalues below zero are taken as 0.
    Sharpen {
        /// The eigenvalue where half of the strength is reached.
        cutoff: f64,
        /// By how much detail grows.
        strength: f64,
    },
    /// Any function of the eigenvalue, by its values at some of them: linear in between, constant outside. The detail
    /// beyond the basis gets what the last eigenvalue gets.
    Curve {
        /// Pairs of an eigenvalue and a factor, eigenvalues strictly ascending.
        points: Vec<[f64; 2]>,
    },
    /// One factor for each eigenvalue, and one for the detail beyond the basis.
    Samples {
        /// `m` factors.
        values: Vec<f64>,
        /// The factor of what the basis does not hold.
        beyond: f64,
    },
}

impl Transfer {
    /// The factors of the `m` modes and `F∞`, that of what the basis does not hold.
    ///
    /// # Errors
    /// [`FilterError`] names a parameter out of range.
    pub fn factors(&self, eigenvalues: &[f64]) -> Result<(Vec<f64>, f64), FilterError> {
        // What rounding alone keeps from zero is zero: a kernel at −1e-14 is within `0 ≤ λ`.
        let rounding = -1e-10 * eigenvalues.iter().fold(0.0f64, |most, value| most.max(value.abs()));
        let exact = |value: f64| if value < 0.0 && value >= rounding { 0.0 } else { value };
        // Below zero there is nothing to tell apart, unless some eigenvalue is there.
        let has_negative = eigenvalues.iter().any(|&value| exact(value) < 0.0);
        let limit = if has_negative { finite } else { non_negative };
        let each = |factor: &dyn Fn(f64) -> f64| eigenvalues.iter().map(|&value| factor(exact(value))).collect();
        let last = eigenvalues.last().map_or(0.0, |&value| exact(value));
        let unit = |holds: bool| if holds { 1.0 } else { 0.0 };
        Ok(match *self {
            Self::LowPass { cutoff } => {
                limit("cutoff", cutoff)?;
                (each(&|value| unit(value <= cutoff)), 0.0)
            }
            Self::HighPass { cutoff } => {
                limit("cutoff", cutoff)?;
                (each(&|value| unit(value > cutoff)), 1.0)
            }
            Self::BandPass { low, high } => {
                limit("low", low)?;
                band(low, high)?;
                (each(&|value| unit((low..=high).contains(&value))), 0.0)
            }
            Self::Gain { low, high, gain } => {
                limit("low", low)?;
                band(low, high)?;
                finite("gain", gain)?;
                (each(&|value| if (low..=high).contains(&value) { gain } else { 1.0 }), 1.0)
            }
            Self::Heat { time } => {
                non_negative("time", time)?;
                let heat = |value: f64| (-value * time).exp();
                if eigenvalues.first().is_some_and(|&least| !heat(least).is_finite()) {
                    let expected = "a time for which e^{-λ time} is finite at the least eigenvalue";
                    return Err(FilterError::Parameter { parameter: "time", value: time, expected });
                }
                (each(&heat), heat(last))
            }
            Self::Sharpen { cutoff, strength } => {
                if !(cutoff.is_finite() && cutoff > 0.0) {
                    let expected = "a finite positive number";
                    return Err(FilterError::Parameter { parameter: "cutoff", value: cutoff, expected });
                }
                if !(strength.is_finite() && strength >= -1.0) {
                    let expected = "a finite number, at least -1";
                    return Err(FilterError::Parameter { parameter: "strength", value: strength, expected });
                }
                let sharper = |value: f64| 1.0 + strength * value.max(0.0) / (value.max(0.0) + cutoff);
                (each(&sharper), 1.0 + strength)
            }
            Self::Curve { ref points } => {
                if points.is_empty() {
                    return Err(FilterError::NoPoints);
                }
                if let Some(index) = points.iter().flatten().position(|v| !v.is_finite()) {
                    return Err(FilterError::NotFinite { index: index / 2 });
                }
                if let Some(pair) = points.windows(2).find(|pair| pair[0][0] >= pair[1][0]) {
                    let (parameter, value) = ("points", pair[1][0]);
                    return Err(FilterError::Parameter {
                        parameter,
                        value,
                        expected: "an eigenvalue above the one before",
                    });
                }
                (each(&|value| on_curve(points, value)), on_curve(points, last))
            }
            Self::Samples { ref values, beyond } => {
                if values.len() != eigenvalues.len() {
                    return Err(FilterError::Samples { found: values.len(), expected: eigenvalues.len() });
                }
                if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                    return Err(FilterError::NotFinite { index });
                }
                finite("beyond", beyond)?;
                (values.clone(), beyond)
            }
        })
    }
}

/// The value of a curve through points of ascending places.
fn on_curve(points: &[[f64; 2]], at: f64) -> f64 {
    let above = points.partition_point(|point| point[0] <= at);
    match (above.checked_sub(1).map(|k| points[k]), points.get(above)) {
        (Some([x, y]), Some([u, v])) => y + (v - y) * (at - x) / (u - x),
        (Some([_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => 1.0,
    }
}

fn non_negative(parameter: &'static str, value: f64) -> Result<(), FilterError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(FilterError::Parameter { parameter, value, expected: "a finite number that is not negative" })
}

fn finite(parameter: &'static str, value: f64) -> Result<(), FilterError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(FilterError::Parameter { parameter, value, expected: "a finite number" })
}

fn band(low: f64, high: f64) -> Result<(), FilterError> {
    if high.is_finite() && high >= low {
        return Ok(());
    }
    Err(FilterError::Parameter { parameter: "high", value: high, expected: "a finite number not below low" })
}

/// `x' = Φ F(Λ) ΦᵀM x + F∞ (x − ΦΦᵀM x)` for `k` functions, `n × k`: detail that the basis does not hold is not lost
/// but multiplied by `F∞`.
///
/// # Errors
/// [`FilterError`] names what does not fit.
pub fn filter(basis: &Basis, functions: &DenseMatrix, transfer: &Transfer) -> Result<DenseMatrix, FilterError> {
    let (mut factors, beyond) = transfer.factors(&basis.eigenvalues)?;
    // F∞ x is added below, so that one evaluation serves both terms.
    factors.iter_mut().for_each(|factor| *factor -= beyond);
    let (_, mut filtered) = basis.apply_diagonal(functions, &factors)?;
    if beyond != 0.0 {
        filtered.values_mut().iter_mut().zip(functions.values()).for_each(|(y, x)| *y += beyond * x);
    }
    Ok(filtered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::{chain, dense};

    fn functions(n: usize, k: usize) -> DenseMatrix {
        DenseMatrix::from_columns(n, k, (0..n * k).map(|i| (i as f64 * 1.7).sin()).collect())
    }

    fn distance(a: &DenseMatrix, b: &DenseMatrix) -> f64 {
        a.values().iter().zip(b.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_transfer_of_ones_changes_nothing_even_beyond_the_basis() {
        let (basis, x) = (chain(50, 12), functions(50, 3));
        let transfer = Transfer::Samples { values: vec![1.0; 12], beyond: 1.0 };
        assert!(distance(&filter(&basis, &x, &transfer).unwrap(), &x) < 1e-14);
        let transfer = Transfer::Heat { time: 0.0 };
        assert!(distance(&filter(&basis, &x, &transfer).unwrap(), &x) < 1e-14);
    }

    #[test]
    fn low_and_high_pass_are_complementary_projections() {
        let (basis, x) = (chain(50, 20), functions(50, 2));
        let cutoff = basis.eigenvalues[7];
        let low = filter(&basis, &x, &Transfer::LowPass { cutoff }).unwrap();
        let high = filter(&basis, &x, &Transfer::HighPass { cutoff }).unwrap();
        let sum: Vec<f64> = low.values().iter().zip(high.values()).map(|(a, b)| a + b).collect();
        assert!(distance(&DenseMatrix::from_columns(50, 2, sum), &x) < 1e-13);
        assert!(distance(&filter(&basis, &low, &Transfer::LowPass { cutoff }).unwrap(), &low) < 1e-13);
        assert!(filter(&basis, &high, &Transfer::LowPass { cutoff }).unwrap().values().iter().all(|v| v.abs() < 1e-13));
        let band = Transfer::BandPass { low: 0.0, high: cutoff };
        assert!(distance(&filter(&basis, &x, &band).unwrap(), &low) < 1e-14);
    }

    #[test]
    fn a_mode_is_multiplied_by_its_own_factor() {
        let basis = chain(40, 10);
        let mode = basis.compact().unwrap().coefficients.slice_columns(4..5);
        let value = basis.eigenvalues[4];
        let cases = [
            (Transfer::Heat { time: 3.0 }, (-3.0 * value).exp()),
            (Transfer::Gain { low: 0.9 * value, high: 1.1 * value, gain: -2.5 }, -2.5),
            (Transfer::Gain { low: 1.1 * value, high: 2.0 * value, gain: -2.5 }, 1.0),
        ];
        for (transfer, factor) in cases {
            let found = filter(&basis, &mode, &transfer).unwrap();
            let expected: Vec<f64> = mode.values().iter().map(|x| factor * x).collect();
            assert!(distance(&found, &DenseMatrix::from_columns(40, 1, expected)) < 1e-14);
        }
    }

    #[test]
    fn sharpening_and_curves_are_what_their_samples_are() {
        let (basis, x) = (chain(50, 20), functions(50, 2));
        let by_samples = |factor: &dyn Fn(f64) -> f64, beyond: f64| {
            let values = basis.eigenvalues.iter().map(|&value| factor(value)).collect();
            filter(&basis, &x, &Transfer::Samples { values, beyond }).unwrap()
        };
        let sharpened = filter(&basis, &x, &Transfer::Sharpen { cutoff: 0.5, strength: 2.0 }).unwrap();
        assert!(distance(&sharpened, &by_samples(&|value| 1.0 + 2.0 * value / (value + 0.5), 3.0)) < 1e-13);
        let curve = Transfer::Curve { points: vec![[0.1, 1.0], [0.3, 3.0], [0.4, 2.0]] };
        let hand = |value: f64| match value {
            v if v <= 0.1 => 1.0,
            v if v <= 0.3 => 1.0 + 10.0 * (v - 0.1),
            v if v <= 0.4 => 3.0 - 10.0 * (v - 0.3),
            _ => 2.0,
        };
        assert!(distance(&filter(&basis, &x, &curve).unwrap(), &by_samples(&hand, 2.0)) < 1e-13);
        let constant = Transfer::Curve { points: vec![[1.0, 0.5]] };
        assert!(distance(&filter(&basis, &x, &constant).unwrap(), &by_samples(&|_| 0.5, 0.5)) < 1e-13);
    }

    #[test]
    fn negative_eigenvalues_are_themselves_and_rounding_below_zero_is_zero() {
        let values = [-2.0, -1e-13, 0.5, 3.0];
        let factors = |transfer: Transfer| transfer.factors(&values).unwrap();
        let exact: Vec<f64> = [2.0f64, 0.0, -0.5, -3.0].iter().map(|x| x.exp()).collect();
        assert_eq!(factors(Transfer::Heat { time: 1.0 }), (exact, (-3.0f64).exp()));
        assert_eq!(factors(Transfer::BandPass { low: 0.0, high: 1.0 }).0, [0.0, 1.0, 1.0, 0.0]);
        assert_eq!(factors(Transfer::HighPass { cutoff: -1.0 }).0, [0.0, 1.0, 1.0, 1.0]);
        assert_eq!(factors(Transfer::Sharpen { cutoff: 2.0, strength: 1.0 }).0[..3], [1.0, 1.0, 1.2]);
        let boundless = Transfer::Heat { time: 1e3 }.factors(&values).unwrap_err().to_string();
        assert!(boundless.starts_with("time must be a time for which"), "{boundless}");
    }

    #[test]
    fn a_dense_basis_filters_as_a_compact_one_does() {
        let (compact, x) = (chain(50, 40), functions(50, 3));
        let dense = dense(&compact);
        let transfer = Transfer::Gain { low: 0.1, high: 1.0, gain: 2.0 };
        let filtered = filter(&dense, &x, &transfer).unwrap();
        assert!(distance(&filtered, &filter(&compact, &x, &transfer).unwrap()) < 1e-13);
    }

    #[test]
    fn bad_parameters_are_named() {
        let (basis, x) = (chain(10, 3), functions(10, 1));
        let error = |transfer: Transfer| filter(&basis, &x, &transfer).unwrap_err().to_string();
        assert_eq!(error(Transfer::Heat { time: -1.0 }), "time must be a finite number that is not negative, got -1");
        assert!(
            error(Transfer::LowPass { cutoff: f64::NAN })
                .ends_with("cutoff must be a finite number that is not negative, got NaN")
        );
        assert!(
            error(Transfer::BandPass { low: 2.0, high: 1.0 })
                .ends_with("high must be a finite number not below low, got 1")
        );
        assert_eq!(
            error(Transfer::Samples { values: vec![1.0; 2], beyond: 0.0 }),
            "expected 3 samples, one for each eigenvalue, got 2"
        );
        assert!(
            error(Transfer::Sharpen { cutoff: 0.0, strength: 1.0 })
                .starts_with("cutoff must be a finite positive number, got 0")
        );
        assert!(
            error(Transfer::Sharpen { cutoff: 1.0, strength: -1.5 })
                .starts_with("strength must be a finite number, at least -1, got -1.5")
        );
        assert_eq!(error(Transfer::Curve { points: vec![] }), "points must not be empty");
        assert_eq!(error(Transfer::Curve { points: vec![[0.0, 1.0], [1.0, f64::NAN]] }), "sample 1 is not finite");
        assert!(
            error(Transfer::Curve { points: vec![[1.0, 1.0], [1.0, 2.0]] })
                .starts_with("points must be an eigenvalue above the one before, got 1")
        );
        let values = vec![1.0, f64::INFINITY, 0.0];
        assert_eq!(error(Transfer::Samples { values, beyond: 0.0 }), "sample 1 is not finite");
        let short = functions(9, 1);
        let found = filter(&basis, &short, &Transfer::Heat { time: 1.0 }).unwrap_err();
        assert_eq!(found, FilterError::Basis(BasisError::Rows { found: 9, expected: 10 }));
    }
}
