//! The latent basis of a collection: for each shape `Y`, `k × m`, such that all maps take these to each other as nearly
//! as can be.

use chladni_algebra::{DenseMatrix, lowest_symmetric, solve_definite};
use chladni_base::{Monitor, Quiet};

use super::{LATENT_SHARE, Maps};
use crate::analysis::error::AnalysisError;
use crate::analysis::functional_map::matching::transposed;
use crate::basis::BasisError;

/// Rounds of weighting, from nothing and from the weights of smaller maps.
pub(super) const FIRST_ROUNDS: usize = 4;
pub(super) const LATER_ROUNDS: usize = 2;

/// Maps whose disagreement is well below its root all count the same.
const FORGIVEN: f64 = 1e-2;

/// `argmin Σ w ‖C Y_source − Y_target‖²` over latent bases that are orthonormal together. Weights fall with the square
/// of what a pair disagrees by, so that maps that failed count little (iterative reweighting).
pub(super) struct Latent {
    /// `Y` of each shape, scaled so that orthonormal columns would have length 1.
    bases: Vec<DenseMatrix>,
    /// `(YᵀY)⁻¹Yᵀ` of each.
    inverses: Vec<DenseMatrix>,
    /// `‖C Y_source − Y_target‖ / √m`, by source and target.
    disagreements: Vec<f64>,
}

impl Latent {
    /// From maps of size `k` between `n` shapes, and what was known of them when they were smaller.
    pub fn new(
        n: usize,
        k: usize,
        maps: &Maps,
        before: Option<&Self>,
        monitor: &dyn Monitor,
    ) -> Result<Self, AnalysisError> {
        let m = ((LATENT_SHARE * k as f64) as usize).clamp(1, k);
        let (mut disagreements, rounds) = match before {
            Some(before) => (before.disagreements.clone(), LATER_ROUNDS),
            // All alike.
            None => (vec![0.0; n * n], FIRST_ROUNDS),
        };
        let mut bases = Vec::new();
        for _ in 0..rounds {
            monitor.checkpoint()?;
            let energy = energy(n, k, maps, &disagreements)?;
            let vectors = lowest_symmetric(energy, m, &Quiet(monitor))?.vectors;
            bases = (0..n).map(|shape| part(&vectors, shape, n, k)).collect();
            for ((source, target), map) in maps {
                let image = map.times(&bases[*source]);
                let gaps = image.values().iter().zip(bases[*target].values()).map(|(a, b)| (a - b).powi(2));
                disagreements[source * n + target] = (gaps.sum::<f64>() / m as f64).sqrt();
            }
        }
        let inverses = bases.iter().map(inverse).collect::<Result<_, _>>()?;
        Ok(Self { bases, inverses, disagreements })
    }

    /// `Y (YᵀY)⁻¹`, `k × m`: rows of modes times it are where deltas lie in the latent space.
    pub fn embedding(&self, shape: usize) -> Result<DenseMatrix, AnalysisError> {
        let inverse = self.inverses.get(shape).ok_or(BasisError::Inconsistent)?;
        Ok(transposed(inverse))
    }

    /// The map between two shapes that goes through the latent space.
    pub fn map(&self, source: usize, target: usize) -> Result<DenseMatrix, AnalysisError> {
        Ok(self.bases[target].times(&self.inverses[source]))
    }

    /// How far the map of a pair was from the one through the latent space.
    pub fn disagreement(&self, source: usize, target: usize) -> f64 {
        self.disagreements[source * self.bases.len() + target]
    }
}

/// The matrix of `Σ w ‖C Y_source − Y_target‖²`, `nk × nk`.
fn energy(n: usize, k: usize, maps: &Maps, disagreements: &[f64]) -> Result<DenseMatrix, AnalysisError> {
    let mut energy = DenseMatrix::zeros(n * k, n * k);
    for ((source, target), map) in maps {
        let weight = 1.0 / (disagreements[source * n + target].powi(2) + FORGIVEN);
        let gram = map.transposed_times(map);
        for column in 0..k {
            let into = &mut energy.column_mut(source * k + column);
            (0..k).for_each(|row| into[source * k + row] += weight * gram.column(column)[row]);
            (0..k).for_each(|row| into[target * k + row] -= weight * map.column(column)[row]);
            for row in 0..k {
                energy.column_mut(target * k + row)[source * k + column] -= weight * map.column(column)[row];
            }
            energy.column_mut(target * k + column)[target * k + column] += weight;
        }
    }
    Ok(energy)
}

/// The rows of one shape, `k × m`.
fn part(vectors: &DenseMatrix, shape: usize, n: usize, k: usize) -> DenseMatrix {
    let mut own = DenseMatrix::zeros(k, vectors.columns());
    let factor = (n as f64).sqrt();
    for column in 0..vectors.columns() {
        let values = &vectors.column(column)[shape * k..][..k];
        own.column_mut(column).iter_mut().zip(values).for_each(|(slot, value)| *slot = factor * value);
    }
    own
}

fn inverse(basis: &DenseMatrix) -> Result<DenseMatrix, AnalysisError> {
    let m = basis.columns();
    let mut gram = basis.transposed_times(basis);
    let mean = (0..m).map(|i| gram.column(i)[i]).sum::<f64>() / m as f64;
    // A shape that none of the others agrees with may have next to no part in some column.
    (0..m).for_each(|i| gram.column_mut(i)[i] += 1e-6 * mean.max(f64::MIN_POSITIVE));
    let mut inverse = transposed(basis);
    solve_definite(gram, &mut inverse)?;
    Ok(inverse)
}
