//! What is asked of a device that measures pairs, and what it answers: sums over the rows, column by column.

use crate::{DenseMatrix, MassMatrix, Multigrid, SparseMatrix};

/// A pencil, prepared for measuring pairs: the rows of everything are in the same order.
#[derive(Clone, Copy)]
pub struct MeasuredPencil<'a> {
    /// `S`, `n × n`.
    pub stiffness: &'a SparseMatrix,
    /// `M`, `n × n`.
    pub mass: &'a MassMatrix,
    /// Its lumped diagonal, `n`, positive.
    pub lumped: &'a [f64],
    /// The weight of each row's squares in a bound on rounding errors, `n`.
    pub rounding: &'a [f64],
    /// `c`, so that `S + cM` is positive semi-definite.
    pub floor: f64,
    /// The hierarchy of `S + cM`.
    pub hierarchy: &'a Multigrid,
    /// What is below `S + cM`, if it is known.
    pub trees: Option<MeasuredTrees<'a>>,
}

/// Trees on the rows, each within a patch: the Laplacian of their edges is below the pencil's `S + cM`.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredTrees<'a> {
    /// Row by row in the order of elimination, children before what they hang on, patch after patch, `n`.
    pub nodes: &'a [TreeNode],
    /// The first row of each patch, and `n`.
    pub patches: &'a [u32],
}

/// A row of a tree, and the one that it hangs on, numbered within the patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeNode {
    /// The row.
    pub row: u32,
    /// Its own number for a root.
    pub parent: u32,
    /// The weight of the edge between, no more than what it is in double precision; zero for a root.
    pub weight: f32,
}

/// Pairs with values `θ` and vectors `X = U c`.
#[derive(Clone, Copy)]
pub struct MeasuredPairs<'a> {
    /// `U`, `n × d`.
    pub space: &'a SparseMatrix<f32>,
    /// `c`, `d × q`.
    pub coefficients: &'a DenseMatrix,
    /// The values, `q`.
    pub values: &'a [f64],
    /// σ of each, `q`, positive.
    pub sigmas: &'a [f64],
}

/// Sums over the residual `r = S x − θ M x` of a pair.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ResidualSums {
    /// `‖r‖²`
    pub residual: f64,
    /// The same in the inverse lumped mass.
    pub dual: f64,
    /// `‖S x‖²`
    pub stiffness: f64,
    /// `‖x‖²`
    pub square: f64,
    /// `xᵀ M x`
    pub mass: f64,
    /// `xᵀ S x`
    pub energy: f64,
    /// The squares of `x` by the weights of rounding errors.
    pub rounding: f64,
    /// The least entry of `x`, and at most 0.
    pub lowest: f64,
    /// The greatest entry of `x`, and at least 0.
    pub highest: f64,
}

/// Sums over a correction `y`, which encloses the norm of `r`, and over `e = r − Ay`, `A = S + (c + σ) M`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EnclosureSums {
    /// `2 yᵀr − yᵀAy`
    pub below: f64,
    /// The sum of the magnitudes of its terms.
    pub size: f64,
    /// `‖e‖²` in the inverse lumped mass; where there are trees, with Laplacian `T`, in that of `T/m + lumped mass`,
    /// `m` = σ over the mass's [`lumped_ratio`](MassMatrix::lumped_ratio).
    pub excess: f64,
    /// The squares of `y` by the weights of rounding errors.
    pub rounding: f64,
    /// `yᵀ M y`
    pub mass: f64,
}

impl ResidualSums {
    #[cfg(feature = "gpu")]
    pub(super) const COUNT: usize = 9;

    #[cfg(feature = "gpu")]
    pub(super) fn of(sums: [f64; Self::COUNT]) -> Self {
        let [residual, dual, stiffness, square, mass, energy, rounding, lowest, highest] = sums;
        Self { residual, dual, stiffness, square, mass, energy, rounding, lowest, highest }
    }

    #[cfg(feature = "gpu")]
    pub(super) fn all(&self) -> [f64; Self::COUNT] {
        let Self { residual, dual, stiffness, square, mass, energy, rounding, lowest, highest } = *self;
        [residual, dual, stiffness, square, mass, energy, rounding, lowest, highest]
    }
}

impl EnclosureSums {
    #[cfg(feature = "gpu")]
    pub(super) const COUNT: usize = 5;

    #[cfg(feature = "gpu")]
    pub(super) fn of(sums: [f64; Self::COUNT]) -> Self {
        let [below, size, excess, rounding, mass] = sums;
        Self { below, size, excess, rounding, mass }
    }

    #[cfg(feature = "gpu")]
    pub(super) fn all(&self) -> [f64; Self::COUNT] {
        let Self { below, size, excess, rounding, mass } = *self;
        [below, size, excess, rounding, mass]
    }
}

/// What decides, some columns at a time, while a device measures.
pub trait Judge: Sync {
    /// Whether the columns from `first` on are enclosed closely enough; another cycle is taken where not.
    fn is_close(&self, first: usize, residuals: &[ResidualSums], enclosures: &[EnclosureSums]) -> bool;

    /// The weight of each of them in the density of what is missed; none where none of them counts.
    fn weights(&self, first: usize, residuals: &[ResidualSums], enclosures: &[EnclosureSums]) -> Option<Vec<f64>>;

    /// Cycles at most.
    fn most_cycles(&self) -> usize;
}

/// What a device has measured.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PairSums {
    /// Of each pair.
    pub residuals: Vec<ResidualSums>,
    /// Of each pair, for the last of its cycles.
    pub enclosures: Vec<EnclosureSums>,
    /// The weighted sum of `y r` over the pairs for each row, `n`; none where no pair has a weight.
    pub density: Option<Vec<f64>>,
}
