//! Signatures of points: what the spectrum says about the surface around a vertex.

use chladni_algebra::DenseMatrix;

use super::error::{self, AnalysisError};
use super::spectrum::{heat_times, kernel_size, log_spaced};
use crate::basis::Basis;

/// The most values of a signature.
pub const MOST_VALUES: usize = 256;

/// A wave kernel signature of fewer energies would have no energies to look at: its range is narrowed by twice the
/// width of a band.
const LEAST_ENERGIES: usize = 32;

/// A signature of points.
#[derive(Debug, Clone, PartialEq)]
pub enum Signature {
    /// `Σ e^{−λt} φ(x)²`, for each time (Sun et al. 2009); of its definition's two forms the plain one, or divided by
    /// the trace `Σ e^{−λt}`, so that all times weigh the same.
    HeatKernel {
        /// The times `t > 0`, in length² of the input.
        times: Vec<f64>,
        /// Whether to divide by the trace.
        normalised: bool,
    },
    /// `Σ e^{−(e − ln λ)²/2σ²} φ(x)² / Σ e^{−(e − ln λ)²/2σ²}`, for energies `e` spaced evenly in
    /// `[ln λ_1 + 2σ, ln λ_max − 2σ]`, `σ` being seven times their spacing (Aubry et al. 2011).
    WaveKernel {
        /// How many energies, at least 32.
        count: usize,
    },
    /// `φ_k(x)/√λ_k` for the first modes above the kernel (Rustamov 2007). Signs, and rotations among equal
    /// eigenvalues, are those of the basis: compare points of one basis alone.
    GlobalPoint {
        /// How many modes.
        count: usize,
    },
}

impl Signature {
    /// The heat kernel signature at so many times, log-spaced over what the spectrum can tell.
    ///
    /// # Errors
    /// [`AnalysisError`]: a count out of its range, a spectrum without values above zero.
    pub fn heat_kernel(eigenvalues: &[f64], count: usize, normalised: bool) -> Result<Self, AnalysisError> {
        error::count("count", count, 1, MOST_VALUES)?;
        Ok(Self::HeatKernel { times: heat_times(eigenvalues, count)?, normalised })
    }

    /// Weights of squares, `m × t`; `None` for the global point signature, which is none of sums of squares.
    fn weights(&self, eigenvalues: &[f64]) -> Result<Option<DenseMatrix>, AnalysisError> {
        let m = eigenvalues.len();
        match self {
            Self::HeatKernel { times, normalised } => {
                error::count("times", times.len(), 1, MOST_VALUES)?;
                let mut weights = DenseMatrix::zeros(m, times.len());
                for (column, &time) in times.iter().enumerate() {
                    error::positive("time", time)?;
                    let weights = weights.column_mut(column);
                    weights.iter_mut().zip(eigenvalues).for_each(|(weight, value)| *weight = (-value * time).exp());
                    super::distance::finite(weights, time)?;
                    if *normalised {
                        scale_to_unit_sum(weights);
                    }
                    drop_negligible(weights);
                }
                Ok(Some(weights))
            }
            Self::WaveKernel { count } => {
                error::count("count", *count, LEAST_ENERGIES, MOST_VALUES)?;
                let first = kernel_size(eigenvalues)?;
                let [low, high] = [eigenvalues[first], eigenvalues[m - 1]].map(f64::ln);
                if !(high > low) {
                    let what = "different eigenvalues above zero";
                    return Err(AnalysisError::Count { what, found: 1, least: 2, most: usize::MAX });
                }
                let sigma = 7.0 * (high - low) / *count as f64;
                let energies = log_spaced((low + 2.0 * sigma).exp(), (high - 2.0 * sigma).exp(), *count);
                let mut weights = DenseMatrix::zeros(m, *count);
                for (column, energy) in energies.into_iter().enumerate() {
                    let weights = &mut weights.column_mut(column)[first..];
                    weights.iter_mut().zip(&eigenvalues[first..]).for_each(|(weight, value)| {
                        let gap = (energy.ln() - value.ln()) / sigma;
                        *weight = (-0.5 * gap * gap).exp();
                    });
                    scale_to_unit_sum(weights);
                    drop_negligible(weights);
                }
                Ok(Some(weights))
            }
            Self::GlobalPoint { .. } => Ok(None),
        }
    }

    /// The modes of a global point signature, and their factors.
    fn points(count: usize, eigenvalues: &[f64]) -> Result<(std::ops::Range<usize>, Vec<f64>), AnalysisError> {
        let first = kernel_size(eigenvalues)?;
        error::count("count", count, 1, MOST_VALUES.min(eigenvalues.len() - first))?;
        let range = first..first + count;
        let factors = eigenvalues[range.clone()].iter().map(|value| 1.0 / value.sqrt()).collect();
        Ok((range, factors))
    }

    /// The signature of every vertex, a row each: `n × t`.
    ///
    /// # Errors
    /// [`AnalysisError`] names a parameter out of its range.
    pub fn everywhere(&self, basis: &Basis) -> Result<DenseMatrix, AnalysisError> {
        error::lowest(basis)?;
        if let Self::GlobalPoint { count } = self {
            let (range, factors) = Self::points(*count, &basis.eigenvalues)?;
            let mut values = basis.lift::<f64>(range)?;
            for (column, factor) in values.chunks_mut(basis.vertices().max(1)).zip(factors) {
                column.iter_mut().for_each(|value| *value *= factor);
            }
            return Ok(DenseMatrix::from_columns(basis.vertices(), *count, values));
        }
        let weights = self.weights(&basis.eigenvalues)?.ok_or(AnalysisError::OnlyKernel)?;
        Ok(basis.weighted_squares(&weights)?)
    }

    /// The signatures of some vertices, a row each: `p × t`.
    ///
    /// # Errors
    /// [`AnalysisError`] names a vertex that there is not, or a parameter out of its range.
    pub fn at(&self, basis: &Basis, vertices: &[u32]) -> Result<DenseMatrix, AnalysisError> {
        error::lowest(basis)?;
        let mut values = basis.at_vertices(vertices).map_err(AnalysisError::vertices("point"))?;
        if let Self::GlobalPoint { count } = self {
            let (range, factors) = Self::points(*count, &basis.eigenvalues)?;
            let mut values = values.slice_columns(range);
            for (column, factor) in factors.into_iter().enumerate() {
                values.column_mut(column).iter_mut().for_each(|value| *value *= factor);
            }
            return Ok(values);
        }
        let weights = self.weights(&basis.eigenvalues)?.ok_or(AnalysisError::OnlyKernel)?;
        values.values_mut().iter_mut().for_each(|value| *value *= *value);
        Ok(values.times(&weights))
    }

    /// How far the signature of every vertex is from that of one: heat kernels by
    /// `(∫ (k_t(x)/tr − k_t(y)/tr)² d ln t)^½`, as the mean over the times; wave kernels by the mean of
    /// `|a − b| / (a + b)`; global points by their Euclidean distance.
    ///
    /// # Errors
    /// [`AnalysisError`] names a vertex that there is not, or a parameter out of its range.
    pub fn similarity(&self, basis: &Basis, vertex: u32) -> Result<Vec<f64>, AnalysisError> {
        error::lowest(basis)?;
        let own = match self {
            // Unnormalised, the earliest time would drown the others.
            Self::HeatKernel { times, .. } => &Self::HeatKernel { times: times.clone(), normalised: true },
            other => other,
        };
        if vertex as usize >= basis.vertices() {
            let vertices = basis.vertices();
            return Err(AnalysisError::Vertex { what: "point", place: 0, vertex, vertices });
        }
        let all = own.everywhere(basis)?;
        let mut sums = vec![0.0; basis.vertices()];
        for column in 0..all.columns() {
            let values = all.column(column);
            let here = values[vertex as usize];
            let add = |(sum, &value): (&mut f64, &f64)| {
                *sum += match own {
                    Self::WaveKernel { .. } if value + here > 0.0 => (value - here).abs() / (value + here),
                    Self::WaveKernel { .. } => 0.0,
                    _ => (value - here) * (value - here),
                }
            };
            sums.iter_mut().zip(values).for_each(add);
        }
        let count = all.columns().max(1) as f64;
        sums.iter_mut().for_each(|sum| {
            *sum = match own {
                Self::HeatKernel { .. } => (*sum / count).sqrt(),
                Self::WaveKernel { .. } => *sum / count,
                Self::GlobalPoint { .. } => sum.sqrt(),
            };
        });
        Ok(sums)
    }
}

/// The `count` nearest items of a list of distances, nearest first; equal ones by their number.
pub fn nearest_items(distances: &[f64], count: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..distances.len() as u32).collect();
    let by_distance = |a: &u32, b: &u32| {
        let [x, y] = [a, b].map(|&item| distances[item as usize]);
        x.total_cmp(&y).then(a.cmp(b))
    };
    let count = count.min(order.len());
    if count > 0 && count < order.len() {
        order.select_nth_unstable_by(count - 1, by_distance);
    }
    order.truncate(count);
    order.sort_unstable_by(by_distance);
    order
}

fn scale_to_unit_sum(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|weight| *weight /= sum);
    }
}

/// Sets to zero what no digit of the sum shows, so that those modes need not be looked at.
fn drop_negligible(weights: &mut [f64]) {
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let least = 1e-18 * largest;
    weights.iter_mut().filter(|weight| **weight < least).for_each(|weight| *weight = 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::{chain, dense};

    fn signatures(eigenvalues: &[f64]) -> [Signature; 4] {
        [
            Signature::heat_kernel(eigenvalues, 9, false).unwrap(),
            Signature::HeatKernel { times: vec![3.0], normalised: true },
            Signature::WaveKernel { count: 40 },
            Signature::GlobalPoint { count: 6 },
        ]
    }

    #[test]
    fn chosen_vertices_have_the_rows_of_all() {
        for basis in [chain(80, 30), dense(&chain(80, 30))] {
            for signature in signatures(&basis.eigenvalues) {
                let all = signature.everywhere(&basis).unwrap();
                let some = signature.at(&basis, &[5, 79, 5]).unwrap();
                for column in 0..all.columns() {
                    for (row, vertex) in [5, 79, 5].into_iter().enumerate() {
                        let (a, b) = (all.column(column)[vertex], some.column(column)[row]);
                        assert!((a - b).abs() < 1e-12 * a.abs().max(1.0), "{signature:?}");
                    }
                }
            }
        }
    }

    /// The integral of the heat kernel over the diagonal is the trace.
    #[test]
    fn normalised_signatures_integrate_to_one() {
        let basis = chain(80, 30);
        for signature in
            [Signature::heat_kernel(&basis.eigenvalues, 7, true).unwrap(), Signature::WaveKernel { count: 50 }]
        {
            let all = signature.everywhere(&basis).unwrap();
            for column in 0..all.columns() {
                assert!((all.column(column).iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn mirror_images_are_alike() {
        let basis = chain(80, 30);
        for signature in &signatures(&basis.eigenvalues)[..3] {
            let similar = signature.similarity(&basis, 12).unwrap();
            let nearest = nearest_items(&similar, 2);
            assert!(nearest.contains(&12) && nearest.contains(&67), "{signature:?}: {nearest:?}");
            assert!(similar[12] < 1e-12 && similar[40] > 1e3 * similar[67]);
        }
        let own = Signature::GlobalPoint { count: 6 }.similarity(&basis, 12).unwrap();
        assert_eq!(nearest_items(&own, 1), [12]);
        assert!(own[67] > 1.0);
    }

    #[test]
    fn the_nearest_come_first() {
        assert_eq!(nearest_items(&[3.0, 1.0, 2.0, 1.0], 3), [1, 3, 2]);
        assert_eq!(nearest_items(&[3.0, 1.0], 9), [1, 0]);
        assert!(nearest_items(&[], 3).is_empty() && nearest_items(&[1.0], 0).is_empty());
    }

    #[test]
    fn what_cannot_be_is_named() {
        let basis = chain(20, 8);
        let text = |signature: Signature| signature.everywhere(&basis).unwrap_err().to_string();
        assert!(
            text(Signature::HeatKernel { times: vec![-1.0], normalised: false })
                .ends_with("time must be a finite positive number, got -1")
        );
        assert!(text(Signature::HeatKernel { times: vec![], normalised: false }).ends_with(", got 0"));
        assert!(text(Signature::WaveKernel { count: 3 }).starts_with("count must be between 32 and "));
        let few = Signature::WaveKernel { count: 32 }.everywhere(&chain(20, 2)).unwrap_err();
        assert_eq!(few.to_string(), "the number of different eigenvalues above zero must be at least 2, got 1");
        assert!(text(Signature::GlobalPoint { count: 8 }).ends_with("count must be between 1 and 7, got 8"));
        let error = Signature::GlobalPoint { count: 2 }.at(&basis, &[0, 20]).unwrap_err();
        assert_eq!(error.to_string(), "point 1 is vertex 20 of 20");
        assert!(Signature::WaveKernel { count: 32 }.similarity(&basis, 20).is_err());
        assert!(Signature::heat_kernel(&[0.0; 3], 4, true).is_err());
    }
}
