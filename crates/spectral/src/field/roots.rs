//! A sum of both energies and a multiple of the mass as a product of two of second order.

/// `K = h S + μ S M⁻¹ S + a M = μ (S + αM) M⁻¹ (S + βM)`, whose inverse is `scale · ((S + αM)⁻¹ − (S + βM)⁻¹)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Roots {
    /// `α`.
    pub small: f64,
    /// `β`.
    pub large: f64,
    /// `1 / μ (β − α)`.
    pub scale: f64,
}

impl Roots {
    /// Those of `harmonic`, `biharmonic` and `uniform` weights: where they are real, not the same, and of the range of
    /// numbers.
    pub fn of(harmonic: f64, biharmonic: f64, uniform: f64) -> Option<Self> {
        let (half, held) = (0.5 * harmonic / biharmonic, uniform / biharmonic);
        let square = half * half - held;
        if !(square > 0.0) {
            return None;
        }
        let large = half + square.sqrt();
        let small = held / large;
        let scale = 1.0 / (biharmonic * (large - small));
        scale.is_finite().then_some(Self { small, large, scale })
    }
}
