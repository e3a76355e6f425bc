//! Numbers that look random, always the same.

use super::real::Real;

/// Numbers in `−1..1`, from a seed.
pub(super) struct Numbers(pub(super) u64);

impl Numbers {
    pub(super) fn next<T: Real>(&mut self) -> T {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        T::of((self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }

    pub(super) fn take<T: Real>(&mut self, count: usize) -> Vec<T> {
        (0..count).map(|_| self.next()).collect()
    }
}
