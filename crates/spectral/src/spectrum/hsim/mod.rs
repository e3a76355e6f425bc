//! HSIM, the hierarchical subspace iteration method (thesis, chapter 4): the lowest eigenpairs to any tolerance, proven
//! complete. What a hierarchy does not do for less comes from a Krylov space (`lanczos.rs`), many pairs from one for
//! each slice of the spectrum (`slices.rs`), which several machines may share (`parts`); counts and judgement are the
//! same.

mod bare;
mod certificate;
mod certify;
mod climb;
mod columns;
mod cuts;
mod deliver;
mod dense_pairs;
mod floor;
mod graded;
mod hierarchy;
mod iterate;
mod judge;
mod judge_slices;
mod kernel;
mod krylov;
mod krylov_request;
mod lanczos;
mod level;
mod null_space;
mod offset;
mod outliers;
pub mod parts;
mod polish;
mod published;
mod ritz;
mod scout;
mod segments;
mod semidefinite;
mod shifts;
mod slices;
mod solve;
mod stiff;
mod tuning;

use serde::{Deserialize, Serialize};

pub use crate::basis::{CutCluster, InertiaCount, LevelReport, OnBound};
use chladni_algebra::{EigenError, FactorError, GalerkinError, PanelMatrix, SparseMatrix};
use chladni_base::{Cancelled, stopped};

use super::radial::RadialError;

/// Which eigenpairs are wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Selection {
    /// The lowest so many, the kernel included.
    Count(usize),
    /// All whose eigenvalue lies below this, in the unit of the eigenvalues (1/length² of the input, for a mesh); at
    /// most so many are delivered, more are an error.
    Below {
        /// The bound on the eigenvalues.
        bound: f64,
        /// The most pairs that may be delivered.
        most: usize,
    },
    /// All whose eigenvalue is at least `from` and below `to`, in that unit too. All below `to` are computed, and may
    /// be `most`.
    Between {
        /// The lower end, which belongs to the interval.
        from: f64,
        /// The upper end, which does not.
        to: f64,
        /// The most pairs below the upper end.
        most: usize,
    },
}

/// How the eigenpairs are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// Ours: a Krylov space where that takes less, or several for slices of the spectrum; else better starting spaces,
    /// every group of eigenvalues with its own shift, one Rayleigh–Ritz over all.
    #[default]
    Sliced,
    /// The thesis' Algorithms 1 to 3: linear prolongations, one shift a level.
    Published,
    /// Plain subspace iteration on the finest level from random vectors: a baseline.
    Random,
    /// Plain subspace iteration from Bathe's unit vectors: a baseline.
    Bathe,
}

/// What is to be solved, and how well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HsimParameters {
    /// Which pairs.
    pub selection: Selection,
    /// Largest residual `‖S x − θ M x‖ / ‖S x‖` (4.6) of a pair that counts as converged: 1e-10 to 0.5.
    pub tolerance: f64,
    /// The algorithm.
    pub variant: Variant,
    /// Levels of the hierarchy, the mesh included, 1 to 6; `None`: chosen by size and count, or a Krylov space where
    /// that takes less.
    pub levels: Option<usize>,
    /// Overlap of the supports of prolongation functions; `None`: 7 for the published variant, 10 for ours.
    pub sigma: Option<f64>,
    /// Published variant: the shift of Algorithm 3 as a share of the wanted pairs, 0 to 1.
    pub shift_ratio: f64,
    /// Columns iterated on per wanted pair, 1 to 4; `None`: 1.5 for the published variant and the baselines, guards for
    /// ours.
    pub subspace_factor: Option<f64>,
    /// Seeds everything that is drawn at random.
    pub seed: u64,
}

/// Eigenpairs on the mesh, proven complete.
#[derive(Debug, Clone, PartialEq)]
pub struct Eigenpairs {
    /// `m` eigenvalues, ascending, in 1/length² of the input.
    pub values: Vec<f64>,
    /// `n × m`, a row for each vertex of the mesh (zero where the boundary condition makes it so), orthonormal for the
    /// mass of the input; in each column the entry of largest magnitude is positive.
    pub vectors: PanelMatrix,
    /// Per pair the residual (4.6).
    pub residuals: Vec<f64>,
    /// Per pair a bound on the distance of the exact eigenvalue of the same index, rounding errors included, in
    /// 1/length² of the input.
    pub bounds: Vec<f64>,
    /// The largest entry of `|XᵀMX − I|`.
    pub orthonormality_defect: f64,
    /// Inertia counts that prove that nothing was skipped, by ascending shift.
    pub inertia: Vec<InertiaCount>,
    /// The index of the first pair among all eigenvalues of the problem, from 0.
    pub first: usize,
    /// Pairs of which rounding does not let one tell on which side of a bound they lie, delivered or not.
    pub on_bounds: Vec<OnBound>,
    /// The cluster that the number of pairs asked for cuts, if it cuts one.
    pub cut: Option<CutCluster>,
    /// Coarsest level first, the mesh last.
    pub levels: Vec<LevelReport>,
    /// The finest nested space, `n × d`, if the caller asked to keep it.
    pub space: Option<SparseMatrix<f32>>,
}

/// Why eigenpairs were not delivered.
#[derive(Debug, thiserror::Error)]
pub enum HsimError {
    /// It was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A parameter is out of its range.
    #[error("parameter {name}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// More pairs than unknowns were asked for, or more lie below the bound than may be delivered.
    #[error("{wanted} eigenpairs were requested; at most {most} can be delivered")]
    Count {
        /// The pairs asked for.
        wanted: usize,
        /// The most there can be.
        most: usize,
    },
    /// A factorisation or a dense eigenproblem failed.
    #[error("{0}")]
    Numerical(String),
    /// What a factorisation needs was counted, and is more than was promised.
    #[error("{0}")]
    Memory(String),
    /// Some pairs did not reach the tolerance.
    #[error(
        "{count} pairs did not reach the tolerance of {tolerance:e} in {iterations} iterations; the worst residual is {worst:e}"
    )]
    NotConverged {
        /// How many pairs.
        count: usize,
        /// The tolerance asked for.
        tolerance: f64,
        /// Iterations made.
        iterations: usize,
        /// The largest residual.
        worst: f64,
    },
    /// Rounding does not let pairs come as close as they were asked to.
    #[error("a tolerance of {tolerance:e} is below what double precision allows on this mesh, {floor:e}")]
    Floor {
        /// The tolerance asked for.
        tolerance: f64,
        /// The least residual that can be relied on.
        floor: f64,
    },
    /// Pairs were found, but nothing that counts as a proof that they are the ones asked for.
    #[error("the pairs found could not be proven: {reason}")]
    Unproven {
        /// What the proof lacks.
        reason: String,
    },
    /// The inertia proves that pairs are missing, and they could not be found.
    #[error("{missing} eigenpairs below {shift} are missing")]
    Incomplete {
        /// How many pairs are missing.
        missing: usize,
        /// Below which shift, in 1/length² of the input.
        shift: f64,
    },
}

impl HsimError {
    /// That an interval ends before it begins.
    pub(in crate::spectrum) fn empty_interval(from: f64, to: f64) -> Self {
        Self::Parameter {
            name: "between",
            reason: format!("must begin below where it ends, and {from} is not below {to}"),
        }
    }

    /// A stable identifier of the failure, in kebab case.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::Parameter { .. } | Self::Count { .. } => "invalid-parameters",
            Self::Numerical(_) => "eigenproblem-failed",
            Self::Memory(_) => "memory-exceeded",
            Self::NotConverged { .. } => "not-converged",
            Self::Incomplete { .. } => "incomplete",
            Self::Floor { .. } => "tolerance-below-rounding",
            Self::Unproven { .. } => "unproven",
        }
    }

    /// Whether another start, or a longer iteration, may end better.
    pub(in crate::spectrum) fn is_of_the_iteration(&self) -> bool {
        matches!(self, Self::NotConverged { .. } | Self::Incomplete { .. } | Self::Unproven { .. } | Self::Numerical(_))
    }
}

pub(in crate::spectrum) use bare::{ordering as bare_ordering, plus_mass, solve as solve_bare};
pub(in crate::spectrum) use climb::{columns, is_dense, is_dense_by_blocks, solve_from};
pub use climb::{solve, solve_with_space};
pub use dense_pairs::repair_bytes;
pub(in crate::spectrum) use level::inverse;
pub(in crate::spectrum) use offset::{constants_in_kernel, is_balanced, taken_off};
pub use semidefinite::krylov_columns;
pub(in crate::spectrum) use semidefinite::{AboveKernel, above_kernel};

impl HsimParameters {
    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`HsimError::Parameter`] names the first that is outside.
    pub fn check(&self) -> Result<(), HsimError> {
        let within = |name, value: f64, least: f64, most: f64| {
            if value >= least && value <= most {
                return Ok(());
            }
            Err(HsimError::Parameter { name, reason: format!("must be between {least} and {most}, not {value}") })
        };
        match self.selection {
            Selection::Count(count) => within("count", count as f64, 1.0, f64::from(u32::MAX))?,
            Selection::Below { bound, most } => {
                within("below", bound, -MOST_BOUND, MOST_BOUND)?;
                within("at_most", most as f64, 1.0, f64::from(u32::MAX))?;
            }
            Selection::Between { from, to, most } => {
                within("between", to, -MOST_BOUND, MOST_BOUND)?;
                within("at_most", most as f64, 1.0, f64::from(u32::MAX))?;
                if !(from < to && from.is_finite()) {
                    return Err(HsimError::empty_interval(from, to));
                }
            }
        }
        within("tolerance", self.tolerance, 1e-10, 0.5)?;
        within("levels", self.levels.unwrap_or(2) as f64, 1.0, 6.0)?;
        within("sigma", self.sigma.unwrap_or(7.0), 3.0, 100.0)?;
        within("shift_ratio", self.shift_ratio, 0.0, 1.0)?;
        within("subspace_factor", self.subspace_factor.unwrap_or(1.5), 1.0, 4.0)
    }
}

/// Matrices are shifted by bounds, and must stay finite.
const MOST_BOUND: f64 = 1e300;

impl Default for HsimParameters {
    fn default() -> Self {
        Self {
            selection: Selection::Count(100),
            tolerance: 1e-2,
            variant: Variant::default(),
            levels: None,
            sigma: None,
            shift_ratio: 0.1,
            subspace_factor: None,
            seed: 0,
        }
    }
}

stopped!(
    HsimError:
    FactorError => |error: FactorError| match error {
        FactorError::Promise { .. } => Self::Memory(error.to_string()),
        other => Self::Numerical(other.to_string()),
    },
    EigenError => |error: EigenError| Self::Numerical(error.to_string()),
    GalerkinError => |error: GalerkinError| Self::Numerical(error.to_string()),
    RadialError => |error: RadialError| Self::Numerical(error.to_string()),
);

#[cfg(test)]
mod bounds_tests;
#[cfg(test)]
mod certify_tests;
#[cfg(test)]
mod potentials_tests;
#[cfg(test)]
mod tests;
