//! Why dense eigenproblems are not solved.

use chladni_base::Cancelled;
use faer::dyn_stack::{MemBuffer, StackReq};

/// Why an eigenproblem was not solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum EigenError {
    /// The matrices are not square or not of one size.
    #[error("a pencil of a {}×{} and a {}×{} matrix has no eigenvalues", a.0, a.1, b.0, b.1)]
    Shape {
        /// Rows and columns of `A`.
        a: (usize, usize),
        /// Rows and columns of `B`.
        b: (usize, usize),
    },
    /// More pairs are wanted than there are.
    #[error("{count} pairs were requested of a pencil of size {size}")]
    Count {
        /// How many were asked for.
        count: usize,
        /// The size of the pencil.
        size: usize,
    },
    /// An entry is infinite or not a number.
    #[error("entry ({row}, {column}) of {matrix} is not finite")]
    NotFinite {
        /// `A` or `B`.
        matrix: char,
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
    },
    /// `B` is not positive definite, as far as rounding lets one tell.
    #[error("B is not positive definite: pivot {pivot} is not positive")]
    NotPositiveDefinite {
        /// The first column where the Cholesky factorisation failed.
        pivot: usize,
    },
    /// There is not enough memory.
    #[error("could not allocate {bytes} bytes of working memory")]
    Memory {
        /// What was asked for.
        bytes: usize,
    },
    /// The iteration on the tridiagonal matrix did not converge.
    #[error("the eigenvalues of the tridiagonal matrix did not converge")]
    NoConvergence,
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Working memory, or a typed error where there is none.
pub(super) fn memory(request: StackReq) -> Result<MemBuffer, EigenError> {
    MemBuffer::try_new(request).map_err(|_| EigenError::Memory { bytes: request.unaligned_bytes_required() })
}
