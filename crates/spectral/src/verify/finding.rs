//! What is found wrong with a basis.

use serde::Serialize;

/// Something that is not as the basis says.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Finding {
    /// Parts of the basis do not fit each other or the mesh.
    #[error("{0}")]
    Shape(String),
    /// A value is not finite, or less than the one before.
    #[error("eigenvalue {pair} is {value}, after {before}")]
    Order {
        /// Its number, from 0.
        pair: usize,
        /// Its value.
        value: f64,
        /// The one before.
        before: f64,
    },
    /// The mass of a vertex is another than that of the mesh.
    #[error("the mass matrix is not that of the mesh: row {row} sums to {found}, not {expected}")]
    Mass {
        /// The row.
        row: usize,
        /// What the basis has.
        found: f64,
        /// What the mesh has.
        expected: f64,
    },
    /// A function does not vanish where the boundary condition demands it.
    #[error("function {pair} is {value} at vertex {vertex}, where the boundary condition holds it at zero")]
    Boundary {
        /// Its number, from 0.
        pair: usize,
        /// The vertex.
        vertex: usize,
        /// Its value there.
        value: f64,
    },
    /// A function or a number of the certificate is not finite.
    #[error("{what} of pair {pair} is not finite")]
    NotFinite {
        /// Its number, from 0.
        pair: usize,
        /// What.
        what: &'static str,
    },
    /// The functions are less orthonormal than the certificate says.
    #[error("the functions are {found:e} away from orthonormal, not {claimed:e}")]
    Orthonormality {
        /// As measured.
        found: f64,
        /// As the certificate has it.
        claimed: f64,
    },
    /// A residual is another than the certificate says.
    #[error("the residual of pair {pair} is {found:e}, not {claimed:e}")]
    Residual {
        /// Its number, from 0.
        pair: usize,
        /// As measured.
        found: f64,
        /// As the certificate has it.
        claimed: f64,
    },
    /// A residual is above the tolerance.
    #[error("the residual of pair {pair} is {found:e}, above the tolerance of {tolerance:e}")]
    Tolerance {
        /// Its number, from 0.
        pair: usize,
        /// As measured.
        found: f64,
        /// The tolerance.
        tolerance: f64,
    },
    /// A value is not the Rayleigh quotient of its function.
    #[error("eigenvalue {pair} is {value}, but its function has the Rayleigh quotient {quotient}")]
    Quotient {
        /// Its number, from 0.
        pair: usize,
        /// The value.
        value: f64,
        /// The quotient.
        quotient: f64,
    },
    /// A bound promises more than its pair keeps.
    #[error("the bound of pair {pair} is {claimed:e}, which is not a valid bound")]
    Bound {
        /// Its number, from 0.
        pair: usize,
        /// As the certificate has it.
        claimed: f64,
    },
    /// A count is another than the certificate says.
    #[error("{found} eigenvalues lie below {shift}, not {claimed}")]
    Count {
        /// The shift.
        shift: f64,
        /// As counted now.
        found: usize,
        /// As the certificate has it.
        claimed: usize,
    },
    /// Eigenvalues are missing, or counted twice.
    #[error("{found} eigenvalues lie below {shift}, but the basis has {values} there")]
    Missing {
        /// The shift.
        shift: f64,
        /// Eigenvalues below it.
        found: usize,
        /// Values of the basis below it.
        values: usize,
    },
    /// The basis claims to be complete, and no count can tell.
    #[error("the basis claims that no eigenvalue is missing, which could not be confirmed: {reason}")]
    Unconfirmed {
        /// Why.
        reason: String,
    },
}

impl Serialize for Finding {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Finding {
    /// Eigenvalues and shifts of the finding in other units.
    pub fn map_values(&mut self, map: impl Fn(f64) -> f64) {
        let numbers: &mut [&mut f64] = match self {
            Self::Order { value, before, .. } => &mut [value, before],
            Self::Quotient { value, quotient, .. } => &mut [value, quotient],
            Self::Count { shift, .. } | Self::Missing { shift, .. } => &mut [shift],
            _ => &mut [],
        };
        numbers.iter_mut().for_each(|number| **number = map(**number));
    }
}
