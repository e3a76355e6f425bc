//! Distances that come from the spectrum: diffusion, biharmonic, commute-time.
//!
//! All are of the form `d(x, y)² = Σ_k w_k (φ_k(x) − φ_k(y))²`. From a source `s` to all vertices this is
//! `Σ w φ(x)² − 2 Σ w φ(s) φ(x) + Σ w φ(s)²`: sums of squares and one combination of modes, so no mode is lifted.

use chladni_algebra::DenseMatrix;

use super::error::{self, AnalysisError};
use super::spectrum::kernel_size;
use crate::basis::Basis;

/// The most distances of one call: kinds and times by sources.
pub const MOST_COLUMNS: usize = 256;

/// Pairs whose rows are held at once.
const PAIRS_AT_ONCE: usize = 2048;

/// A distance on the surface, in the units that its weights have.
#[derive(Debug, Clone, PartialEq)]
pub enum SpectralDistance {
    /// `w = e^{−2λt}` (Nadler et al. 2005), one distance for each time `t > 0`, in length² of the input; in 1/length.
    Diffusion {
        /// The times.
        times: Vec<f64>,
    },
    /// `w = 1/λ²` (Lipman et al. 2010), the kernel left out; in length.
    Biharmonic,
    /// `w = 1/λ` (Fouss et al. 2007), the kernel left out; without unit. Its sum converges slowly: the value depends on
    /// how many modes the basis has.
    CommuteTime,
}

impl SpectralDistance {
    /// How many distances this is.
    pub fn columns(&self) -> usize {
        match self {
            Self::Diffusion { times } => times.len(),
            Self::Biharmonic | Self::CommuteTime => 1,
        }
    }

    /// The weights `w`, a column for each distance, `m × t`.
    ///
    /// # Errors
    /// [`AnalysisError`] names a time that is not above zero, or says that the spectrum has no such distance.
    pub fn weights(&self, eigenvalues: &[f64]) -> Result<DenseMatrix, AnalysisError> {
        let m = eigenvalues.len();
        let mut weights = DenseMatrix::zeros(m, self.columns());
        match self {
            Self::Diffusion { times } => {
                error::count("times", times.len(), 1, MOST_COLUMNS)?;
                for (column, &time) in times.iter().enumerate() {
                    error::positive("time", time)?;
                    let slots = weights.column_mut(column).iter_mut().zip(eigenvalues);
                    slots.for_each(|(weight, value)| *weight = (-2.0 * value * time).exp());
                    finite(weights.column(column), time)?;
                }
            }
            Self::Biharmonic | Self::CommuteTime => {
                let first = kernel_size(eigenvalues)?;
                let power = if matches!(self, Self::Biharmonic) { -2 } else { -1 };
                for mode in first..m {
                    weights.column_mut(0)[mode] = eigenvalues[mode].powi(power);
                }
            }
        }
        Ok(weights)
    }

    /// Distances of all vertices from each of some sources: `n × (s t)`, source after source and, within a source, time
    /// after time.
    ///
    /// # Errors
    /// [`AnalysisError`] names a source that is no vertex, a time that is not above zero, or too many columns.
    pub fn from_sources(&self, basis: &Basis, sources: &[u32]) -> Result<DenseMatrix, AnalysisError> {
        error::lowest(basis)?;
        error::count("sources", sources.len(), 1, MOST_COLUMNS / self.columns().max(1))?;
        let weights = self.weights(&basis.eigenvalues)?;
        let (m, t) = (basis.count(), weights.columns());
        let at_sources = basis.at_vertices(sources).map_err(AnalysisError::vertices("source"))?;
        let mut mixed = DenseMatrix::zeros(m, sources.len() * t);
        let mut own = Vec::with_capacity(sources.len() * t);
        for source in 0..sources.len() {
            for time in 0..t {
                let mut square = 0.0;
                let slots = mixed.column_mut(own.len()).iter_mut().zip(weights.column(time)).enumerate();
                for (mode, (slot, weight)) in slots {
                    let value = at_sources.column(mode)[source];
                    *slot = -2.0 * weight * value;
                    square += weight * value * value;
                }
                own.push(square);
            }
        }
        let squares = basis.weighted_squares(&weights)?;
        let mut distances = basis.evaluate(&mixed)?;
        for (column, own) in own.into_iter().enumerate() {
            let squares = squares.column(column % t);
            let distances = distances.column_mut(column);
            distances.iter_mut().zip(squares).for_each(|(d, square)| *d = (*d + square + own).max(0.0).sqrt());
            // Where all digits cancel, only rounding is left.
            distances[sources[column / t] as usize] = 0.0;
        }
        Ok(distances)
    }

    /// Distances within pairs of vertices: `p × t`.
    ///
    /// # Errors
    /// [`AnalysisError`] names a pair with a vertex that there is not, or a time that is not above zero.
    pub fn between(&self, basis: &Basis, pairs: &[[u32; 2]]) -> Result<DenseMatrix, AnalysisError> {
        error::lowest(basis)?;
        let weights = self.weights(&basis.eigenvalues)?;
        let mut distances = DenseMatrix::zeros(pairs.len(), weights.columns());
        for (block, pairs) in pairs.chunks(PAIRS_AT_ONCE).enumerate() {
            let from = block * PAIRS_AT_ONCE;
            let values = basis.at_vertices(pairs.as_flattened()).map_err(|error| {
                match AnalysisError::vertices("pair")(error) {
                    AnalysisError::Vertex { what, place, vertex, vertices } => {
                        AnalysisError::Vertex { what, place: from + place / 2, vertex, vertices }
                    }
                    other => other,
                }
            })?;
            for time in 0..weights.columns() {
                let sums = &mut distances.column_mut(time)[from..from + pairs.len()];
                for (mode, &weight) in weights.column(time).iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
                    let (ends, _) = values.column(mode).as_chunks::<2>();
                    sums.iter_mut().zip(ends).for_each(|(sum, [a, b])| *sum += weight * (a - b) * (a - b));
                }
                sums.iter_mut().for_each(|sum| *sum = sum.sqrt());
            }
        }
        Ok(distances)
    }
}

/// Negative eigenvalues make heat grow, at most until numbers end.
pub(super) fn finite(weights: &[f64], time: f64) -> Result<(), AnalysisError> {
    if weights.iter().all(|weight| weight.is_finite()) {
        return Ok(());
    }
    let expected = "a time at which negative eigenvalues have not grown beyond all numbers";
    Err(AnalysisError::Parameter { parameter: "time", value: time, expected })
}

/// Distances from the nearest of several sources, out of those from each: `n × (s t)` becomes `n × t`.
pub fn nearest(distances: &DenseMatrix, times: usize) -> DenseMatrix {
    let mut least = distances.slice_columns(0..times);
    for column in times..distances.columns() {
        let values = least.column_mut(column % times.max(1)).iter_mut().zip(distances.column(column));
        values.for_each(|(least, &distance)| *least = least.min(distance));
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fixtures::{chain, dense};
    use crate::analysis::signature::Signature;

    const N: usize = 60;

    fn kinds() -> [SpectralDistance; 3] {
        [
            SpectralDistance::Diffusion { times: vec![0.5, 20.0, 300.0] },
            SpectralDistance::Biharmonic,
            SpectralDistance::CommuteTime,
        ]
    }

    #[test]
    fn bases_without_the_lowest_pairs_are_refused() {
        let mut basis = chain(30, 10);
        assert!(SpectralDistance::Biharmonic.from_sources(&basis, &[3]).is_ok());
        basis.certificate.first = 4;
        for refused in [
            SpectralDistance::Biharmonic.from_sources(&basis, &[3]),
            SpectralDistance::CommuteTime.between(&basis, &[[3, 5]]),
            Signature::GlobalPoint { count: 3 }.everywhere(&basis),
            Signature::GlobalPoint { count: 3 }.at(&basis, &[3]),
        ] {
            assert_eq!(refused.unwrap_err(), AnalysisError::NotLowest { first: 4 });
        }
    }

    #[test]
    fn distances_from_sources_are_those_of_the_pairs() {
        let sources = [7, 40];
        for basis in [chain(N, 25), dense(&chain(N, 25))] {
            for kind in kinds() {
                let found = kind.from_sources(&basis, &sources).unwrap();
                let t = kind.columns();
                assert_eq!((found.rows(), found.columns()), (N, 2 * t));
                for (place, &source) in sources.iter().enumerate() {
                    let pairs: Vec<[u32; 2]> = (0..N as u32).map(|x| [x, source]).collect();
                    let pairs = kind.between(&basis, &pairs).unwrap();
                    for time in 0..t {
                        let (a, b) = (found.column(place * t + time), pairs.column(time));
                        let largest = b.iter().copied().fold(0.0, f64::max);
                        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-7 * largest), "{kind:?}");
                        assert_eq!(a[source as usize], 0.0);
                    }
                }
                let least = nearest(&found, t);
                for time in 0..t {
                    for x in 0..N {
                        assert_eq!(least.column(time)[x], found.column(time)[x].min(found.column(t + time)[x]));
                    }
                }
            }
        }
    }

    /// On a chain with unit resistances, the commute time between two points is proportional to how many links lie
    /// between them; with all modes this is exact.
    #[test]
    fn commute_times_on_a_chain_are_resistances() {
        let basis = chain(N, N);
        let found = SpectralDistance::CommuteTime.from_sources(&basis, &[10]).unwrap();
        for (x, distance) in found.column(0).iter().enumerate() {
            let links = (x as f64 - 10.0).abs();
            assert!((distance - links.sqrt()).abs() < 1e-6, "{x}: {distance}");
        }
    }

    #[test]
    fn distances_are_metrics() {
        let basis = chain(N, 25);
        for kind in kinds() {
            let points = [0, 13, 14, 41, 59];
            let all = kind.from_sources(&basis, &points).unwrap();
            let t = kind.columns();
            for time in 0..t {
                let d = |a: usize, b: usize| all.column(a * t + time)[points[b] as usize];
                for (a, b, c) in [(0, 1, 2), (0, 2, 4), (3, 1, 4), (2, 3, 1)] {
                    assert!(d(a, b) >= 0.0 && (d(a, b) - d(b, a)).abs() < 1e-9);
                    assert!(d(a, c) <= d(a, b) + d(b, c) + 1e-9);
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_is_named() {
        let basis = chain(10, 4);
        let diffusion = |time| SpectralDistance::Diffusion { times: vec![1.0, time] };
        let text = |found: Result<DenseMatrix, AnalysisError>| found.unwrap_err().to_string();
        assert_eq!(text(diffusion(1.0).from_sources(&basis, &[1, 10])), "source 1 is vertex 10 of 10");
        assert!(
            text(diffusion(0.0).from_sources(&basis, &[1])).starts_with("time must be a finite positive number, got 0")
        );
        assert!(
            text(diffusion(f64::NAN).from_sources(&basis, &[1]))
                .starts_with("time must be a finite positive number, got NaN")
        );
        assert!(text(diffusion(1.0).from_sources(&basis, &[])).ends_with("sources must be between 1 and 128, got 0"));
        assert!(
            text(diffusion(1.0).from_sources(&basis, &[0; 129]))
                .ends_with("sources must be between 1 and 128, got 129")
        );
        assert_eq!(text(diffusion(1.0).between(&basis, &[[0, 1], [2, 10]])), "pair 1 is vertex 10 of 10");
        let mut negative = chain(10, 4);
        negative.eigenvalues[0] = -1.0;
        assert!(text(diffusion(1e300).from_sources(&negative, &[1])).contains(", got 1000"));
        assert!(text(SpectralDistance::Biharmonic.from_sources(&negative, &[1])).starts_with("eigenvalue 0 is -1"));
    }
}
