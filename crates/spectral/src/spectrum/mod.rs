//! Eigenproblems solved: the fast approximation (chapter 2 of the thesis) and what certifies a result.

mod approximate;
pub mod certificate;
mod domain;
pub mod energy;
pub mod envelope;
mod error;
pub mod family;
mod hats;
pub mod heat;
mod hidden;
pub mod hodge;
pub mod hsim;
mod lehmann;
mod local;
pub mod nested;
mod peaks;
pub mod pencil;
pub mod radial;
mod refine;
mod restricted;
mod shifted;
pub mod vibration;

pub use approximate::parts as approximate_parts;
pub use approximate::{
    ApproximationError, ApproximationParameters, FEW_VERTICES, Goal, MEASURED_IN_PARTS_FROM, MOST_COUNTED_IN_SOLID,
    MOST_ROUNDS, ROWS_OF_PART, Space, approximate, dimension_for, most_columns, most_initial_columns, subspace,
};
pub use domain::Domain;
pub use energy::{FACTOR_BYTES, MOST_FACTORED, SHARED_FROM};
pub use refine::{Refined, Refinement, approximate_refined};
