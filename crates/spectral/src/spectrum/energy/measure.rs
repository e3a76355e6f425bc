//! What is known of one pair: a bound and an estimate of its error from the sums over the mesh.

use chladni_algebra::gpu::ResidualSums;

/// A pair that misses what is not far above its value, or below, gains more than this many times `‖r‖²_{A⁻¹}`, and
/// nobody knows how much.
const MOST_AMPLIFIED: f64 = 6.0;

/// One correction gains less than there is to gain: 9 % less in the median of 500 pairs on igea, armadillo,
/// rolling-stage and bunny, 1 to 3 % for 50.
const UNGAINED: f64 = 1.12;

/// What is known of one pair on the mesh, on unit area.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measure {
    /// Sums over the rows of its residual.
    pub sums: ResidualSums,
    /// σ.
    pub sigma: f64,
    /// `‖r‖_{A⁻¹}` from below.
    pub below: f64,
    /// `‖r‖_{A⁻¹}` from above.
    pub above: f64,
    /// `‖r‖_{M⁻¹}` from above.
    pub above_dual: f64,
    /// Some exact eigenvalue is nearer to the Ritz value than this.
    pub bound: f64,
    /// About how far the Ritz value lies above the exact one.
    pub estimate: f64,
}

impl Measure {
    /// Some exact eigenvalue is nearer to the Ritz value than this, on unit area: `η (θ + c + σ) / (1 − η)`, or
    /// `‖r‖_{M⁻¹} / ‖x‖_M` where that is less.
    pub(super) fn distance(&self, theta: f64, floor: f64) -> f64 {
        let shifted = theta + floor + self.sigma;
        // Sums of squares err by far less than this.
        let exact = 1.0 - 1e-10;
        let norm = (exact * (self.sums.energy + (floor + self.sigma) * self.sums.mass)).max(0.0).sqrt();
        let eta = self.above / norm;
        let energy = if eta < 1.0 { eta * shifted / (1.0 - eta) } else { f64::INFINITY };
        let dual = self.above_dual / (exact * self.sums.mass).max(0.0).sqrt();
        // NaN, from a vector of zeros, bounds nothing.
        if energy <= dual {
            energy
        } else if dual >= 0.0 {
            dual
        } else {
            f64::INFINITY
        }
    }

    /// About how far the Ritz value lies above the exact one, on unit area: what is gained by the best multiple of
    /// `y ≈ A⁻¹r`, which is what the pair misses, `(yᵀr)² / yᵀ(S − θM)y`. `mass_of_y` is `yᵀMy`.
    pub(super) fn error(&self, theta: f64, mass_of_y: f64) -> f64 {
        let square = self.below * self.below;
        let left = 1.0 - (theta + self.sigma) * mass_of_y / square.max(f64::MIN_POSITIVE);
        UNGAINED * square / (left.max(1.0 / MOST_AMPLIFIED) * self.sums.mass.max(f64::MIN_POSITIVE))
    }
}
