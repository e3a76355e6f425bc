//! Loops compiled for the vector units of the machine at hand.

pub use pulp::{Arch, Simd, WithSimd};

/// Runs `body` compiled for the widest vectors that this machine has.
///
/// `body` must not capture what it changes: that goes through `argument`. A closure that is only `FnMut` would be called through a
/// shim, which is compiled without those vectors (three times slower where it was measured). Mark it `#[inline(always)]`.
#[inline]
pub fn vectorized<A, R>(argument: A, body: impl Fn(A) -> R) -> R {
    pulp::Arch::new().dispatch(Task { argument, body })
}

struct Task<A, F> {
    argument: A,
    body: F,
}

impl<A, R, F: Fn(A) -> R> pulp::WithSimd for Task<A, F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> R {
        (self.body)(self.argument)
    }
}
