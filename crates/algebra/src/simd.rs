//! Loops compiled for the vector units of the machine at hand.

pub use pulp::{Arch, Simd, WithSimd};

/// Runs `body` compiled for the widest vectors that this machine has.
///
/// `body` must not capture what it changes: that goes through `argument`. A closure that is only `FnMut` would be
/// called through a shim, which is compiled without those vectors (three times slower where it was measured). Mark it
/// `#[inline(always)]`.
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

/// `aᵀ b` of two vectors of one length, each term added to the sum of those before.
///
/// # Panics
/// Where the vectors have different lengths.
pub fn dot_in_order(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "an inner product of vectors of different lengths");
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `aᵀ b` of two vectors of one length, as eight sums at once: none waits for the one before. To be called within
/// [`vectorized`] where it matters.
///
/// # Panics
/// Where the vectors have different lengths.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "an inner product of vectors of different lengths");
    let (a8, a1) = a.as_chunks::<8>();
    let (b8, b1) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a8.iter().zip(b8) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + a1.iter().zip(b1).map(|(a, b)| a * b).sum::<f64>()
}
