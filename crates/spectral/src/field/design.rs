//! Designing fields in a reduced space: weighted harmonic and biharmonic energies, soft and hard constraints, alignment
//! to a field (thesis, eqs. 3.8 to 3.11).
//!
//! In spaces of up to [`MOST_DIMENSIONS`] dimensions one dense eigenproblem at set-up makes both energies diagonal: `Λ`
//! and `Λ²` in Ritz coordinates `z`, `x = X z`. The biharmonic energy is thereby `B̃ = S̄ M̄⁻¹ S̄`, that of the
//! projected Laplacian; `UᵀSM⁻¹SU` would see the noise of the basis at the spacing of the samples, and its minimisers
//! are useless. New weights then cost nothing and `k` constraints a system of their own size:
//! `z = z₀ + K⁻¹Cᵀ (W⁻¹ + C K⁻¹ Cᵀ)⁻¹ (c − C z₀)`, where hard constraints have `W⁻¹ = 0` (the Schur complement).
//!
//! In larger spaces, for alignments with weights per face and for the full biharmonic energy `K⁻¹` is a sparse factor
//! (see [`super::pencil`]), made once for given weights.

use std::sync::{Arc, OnceLock};

use chladni_algebra::{
    CpuSolver, DefiniteError, DenseMatrix, EigenError, FactorError, GalerkinError, SparseMatrix,
    SymmetricDefiniteSolver, solve_definite, vectorized,
};
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, stopped};

use crate::basis::{FieldBasis, FieldMisfit, RitzFields};
use crate::operator::frames::Complex64;
use crate::operator::transport::FieldKind;

use super::idle_parts::{FaceComponents, IdlePart};
use super::pencil::Pencil;

/// The largest dimension that gets Ritz coordinates: the eigenproblem of the set-up is dense, `O(d³)`.
pub const MOST_DIMENSIONS: usize = 8192;

/// Why there is no design.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The space is too large.
    #[error("a space of {dimension} dimensions is too large for this design; the limit is {most}")]
    Dimension {
        /// Its dimension.
        dimension: usize,
        /// The most.
        most: usize,
    },
    /// The eigenproblem of the set-up failed.
    #[error(transparent)]
    Eigen(EigenError),
    /// A weight is negative or not finite.
    #[error("the weight {name} is {value}; it must be a number of at least 0")]
    Weight {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Both energies have no weight and there is no alignment.
    #[error(
        "give a weight to an energy or an alignment; without one the field is undetermined between the constraints"
    )]
    NoEnergy,
    /// There is neither a constraint nor an alignment.
    #[error("give a constraint or an alignment; without one the solution is not unique")]
    NoData,
    /// A constraint refers to a face that is not there.
    #[error("constraint {constraint} refers to face {face} of {faces}")]
    Face {
        /// The constraint, soft ones first.
        constraint: usize,
        /// The face.
        face: u32,
        /// The number of faces.
        faces: usize,
    },
    /// A constraint gives no direction, or a value that is not finite.
    #[error("constraint {constraint} on face {face} gives no direction")]
    Direction {
        /// The constraint, soft ones first.
        constraint: usize,
        /// The face.
        face: u32,
    },
    /// Two hard constraints require different values on one face.
    #[error("two hard constraints require different values on face {face}")]
    Contradiction {
        /// The face.
        face: u32,
    },
    /// The space has no freedom left to be as it has to be on this face.
    #[error(
        "the basis is too small to meet the constraint on face {face} together with the others; use a larger basis, or strokes in place of some of them"
    )]
    Dependent {
        /// The face.
        face: u32,
    },
    /// A field or weights do not fit the faces.
    #[error("{what}: expected {wanted} numbers, got {got}")]
    Length {
        /// What does not fit.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// How many are wanted.
        wanted: usize,
    },
    /// Coefficients or a field do not fit the space or the surface.
    #[error(transparent)]
    Misfit(#[from] FieldMisfit),
    /// There is not enough memory, or the numbers are beyond what can be factored.
    #[error(transparent)]
    Factor(DefiniteError),
    /// The sparse system of the restricted matrices was not factored.
    #[error(transparent)]
    Sparse(FactorError),
    /// The products of the space that weights per face ask for were not formed.
    #[error(transparent)]
    Products(GalerkinError),
    /// A prescription is of another kind of field.
    #[error("the prescribed field has a different number of components per face than the space")]
    Kind,
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

stopped!(
    DesignError:
    EigenError => Self::Eigen,
    FactorError => Self::Sparse,
    GalerkinError => Self::Products,
);

/// A space made ready for design. Cheap to clone.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignModel {
    pub(super) kind: FieldKind,
    dimension: usize,
    /// Empty in spaces without Ritz coordinates.
    pub(super) ritz: Arc<RitzFields>,
    /// The restricted matrices, where they are known.
    pub(super) pencil: Option<Arc<Pencil>>,
    pub(super) bending: Bending,
    /// The components of the surface, where they are known.
    pub(super) components: Option<Arc<FaceComponents>>,
    /// Fields without energy by component.
    pub(super) idle_parts: OnceOfModel<Vec<IdlePart>>,
}

/// What follows from the space and the surface, once it was needed. It tells no models apart.
#[derive(Debug, Clone)]
pub(super) struct OnceOfModel<T>(pub Arc<OnceLock<T>>);

impl<T> Default for OnceOfModel<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> PartialEq for OnceOfModel<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// `S̄ M̄⁻¹ S̄`, dense.
pub(super) type Bending = OnceOfModel<DenseMatrix>;

impl Bending {
    /// It is computed once; `O(d³)`.
    pub fn of(&self, basis: &FieldBasis) -> Result<&DenseMatrix, DesignError> {
        if let Some(known) = self.0.get() {
            return Ok(known);
        }
        let (stiffness, mass) = (&basis.stiffness, &basis.mass);
        let mut inverse = stiffness.to_dense();
        solve_definite(mass.to_dense(), &mut inverse).map_err(DesignError::Factor)?;
        let product = stiffness.multiply_dense(&inverse);
        Ok(self.0.get_or_init(|| product))
    }
}

/// What a face should carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// The face.
    pub face: u32,
    /// The numbers in its frame, as they are stored for the kind of field: two or three.
    pub value: [f64; 3],
    /// How firmly.
    pub hold: Hold,
}

/// How firmly a constraint holds a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hold {
    /// Softly, against what the field resists with at this face: a lone constraint of strength `s` misses the share
    /// `1 / (1 + 100 s)` of its length, whatever the surface, its scale, the energies and the space. At 1 that is a
    /// percent.
    Strength(f64),
    /// Softly, with a weight of the squared deviation on the surface of unit area.
    Weight(f64),
    /// Exactly.
    Exact,
}

impl Hold {
    /// The number that says how softly.
    pub(super) fn softness(self) -> Option<f64> {
        match self {
            Self::Strength(number) | Self::Weight(number) => Some(number),
            Self::Exact => None,
        }
    }

    pub(super) fn is_exact(self) -> bool {
        self == Self::Exact
    }
}

/// The pull of a constraint of strength 1, in units of what the field resists with.
pub(super) const FIRM: f64 = 100.0;

/// Weights of the energies, on the surface of unit area.
///
/// With points alone and no biharmonic energy there is no answer: a field of finite harmonic energy has no value at a
/// point, and what a space gives depends on its dimension. See [`BENDING`].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnergyWeights {
    /// Of the harmonic energy.
    pub harmonic: f64,
    /// Of the biharmonic energy.
    pub biharmonic: f64,
}

/// The biharmonic weight that goes with a harmonic weight of 1 where nobody says otherwise: below a length of
/// `√BENDING`, of a surface of unit area, the energy that takes values at points rules, above it the harmonic one.
pub const BENDING: f64 = 0.05;

impl Default for EnergyWeights {
    fn default() -> Self {
        Self { harmonic: 1.0, biharmonic: BENDING }
    }
}

/// A designed field.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Coefficients in the space, to be lifted by [`super::FieldSpace::lift`].
    pub coefficients: Vec<f32>,
    /// The same in Ritz coordinates; empty in spaces without.
    pub ritz: Vec<f64>,
    /// `xᵀ S̄ x`.
    pub harmonic_energy: f64,
    /// `xᵀ B̃ x`.
    pub biharmonic_energy: f64,
    /// The deviation from the fields to stay close to, `Σ a w |u − target|²`, added up; a prescribed field is one of
    /// them.
    pub alignment_energy: Option<f64>,
    /// For each constraint the length of `u − value`.
    pub residuals: Vec<f64>,
    /// The unit number that a prescribed field was turned by, to fit the constraints.
    pub turn: Option<Complex64>,
}

impl DesignModel {
    /// Solves the dense eigenproblem of the space.
    ///
    /// # Errors
    /// [`DesignError`]: the space has more than [`MOST_DIMENSIONS`] or is degenerate, or the work was cancelled.
    pub fn new(basis: &FieldBasis, monitor: &dyn Monitor) -> Result<Self, DesignError> {
        let d = basis.stiffness.rows();
        if d > MOST_DIMENSIONS {
            return Err(DesignError::Dimension { dimension: d, most: MOST_DIMENSIONS });
        }
        monitor.stage("ritz");
        let pairs = CpuSolver.lowest(basis.stiffness.to_dense(), basis.mass.to_dense(), d, monitor)?;
        let mut rows = vec![0f32; d * d];
        for (at, row) in rows.chunks_exact_mut(d.max(1)).enumerate() {
            for (k, value) in row.iter_mut().enumerate() {
                *value = pairs.vectors.values()[k * d + at] as f32;
            }
        }
        let values = pairs.values.into_iter().map(|v| v.max(0.0)).collect();
        let ritz = Arc::new(RitzFields { values, vectors: rows });
        Ok(Self::of(basis.kind, d, ritz, None))
    }

    /// A model without Ritz coordinates, for spaces of any size: ready at once, but every choice of weights takes a
    /// sparse factorisation.
    pub fn sparse(basis: &FieldBasis) -> Self {
        let d = basis.stiffness.rows();
        let ritz = Arc::new(RitzFields { values: Vec::new(), vectors: Vec::new() });
        let pencil = Some(Arc::new(Pencil::new(basis)));
        Self::of(basis.kind, d, ritz, pencil)
    }

    /// A model from eigenpairs that were computed before. `None` unless they are `d × d`.
    pub fn from_ritz(kind: FieldKind, ritz: Arc<RitzFields>) -> Option<Self> {
        let d = ritz.values.len();
        let square = d.checked_mul(d) == Some(ritz.vectors.len());
        square.then(|| Self::of(kind, d, ritz, None))
    }

    fn of(kind: FieldKind, dimension: usize, ritz: Arc<RitzFields>, pencil: Option<Arc<Pencil>>) -> Self {
        let (bending, idle_parts) = (Bending::default(), OnceOfModel::default());
        Self { kind, dimension, ritz, pencil, bending, components: None, idle_parts }
    }

    /// The same with the components of its surface: what is asked for on one then bounds fields without energy on that
    /// one alone ([`WeightedModel::solve`](super::WeightedModel::solve)).
    #[must_use]
    pub fn with_components(self, components: Arc<FaceComponents>) -> Self {
        Self { components: Some(components), idle_parts: OnceOfModel::default(), ..self }
    }

    /// The eigenpairs that the model is made of; none in a space without Ritz coordinates.
    pub fn ritz(&self) -> &Arc<RitzFields> {
        &self.ritz
    }

    /// The same space with the biharmonic energy of a given matrix, `d × d`, in the place of `B̃ = S̄ M̄⁻¹ S̄`: for
    /// comparison, with `B̄ = UᵀSM⁻¹SU` of [`super::full_biharmonic`]. Weights then take a sparse factorisation.
    ///
    /// # Errors
    /// [`DesignError::Length`]: a basis or a matrix of another size.
    pub fn with_biharmonic(self, basis: &FieldBasis, energy: SparseMatrix) -> Result<Self, DesignError> {
        length("the space", basis.stiffness.rows(), self.dimension)?;
        length("the biharmonic energy", energy.rows().max(energy.columns()), self.dimension)?;
        Ok(Self { pencil: Some(Arc::new(Pencil::new(basis).with_full_biharmonic(energy))), ..self })
    }

    /// The Ritz values, ascending, on the surface of unit area: approximate eigenvalues of the field's Laplacian.
    pub fn values(&self) -> &[f64] {
        &self.ritz.values
    }

    /// The dimension, `d`.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The coefficients of the `k`-th approximate eigenfield, of unit norm on unit area; zeros beyond the last, and
    /// without Ritz coordinates.
    pub fn eigenfield(&self, k: usize) -> Vec<f32> {
        if !self.has_ritz() {
            return vec![0.0; self.dimension];
        }
        let rows = self.ritz.vectors.chunks_exact(self.dimension.max(1));
        rows.map(|row| row.get(k).copied().unwrap_or(0.0)).collect()
    }

    pub(super) fn has_ritz(&self) -> bool {
        self.ritz.values.len() == self.dimension
    }

    /// `x = X z`.
    pub(super) fn expand(&self, z: &[f64]) -> Vec<f32> {
        let single: Vec<f32> = z.iter().map(|&v| v as f32).collect();
        let d = self.dimension().max(1);
        let mut x = vec![0f32; self.dimension()];
        x.par_iter_mut().with_min_len(128).zip(self.ritz.vectors.par_chunks_exact(d)).for_each(|(x, row)| {
            *x = vectorized(
                row,
                #[inline(always)]
                |row| {
                    let mut sums = [0f32; 16];
                    let (a, b) = (row.as_chunks::<16>(), single.as_chunks::<16>());
                    for (a, b) in a.0.iter().zip(b.0) {
                        for i in 0..16 {
                            sums[i] += a[i] * b[i];
                        }
                    }
                    sums.iter().sum::<f32>() + a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f32>()
                },
            );
        });
        x
    }

    /// `Xᵀ y`.
    pub(super) fn project(&self, y: &[f64]) -> Vec<f64> {
        let d = self.dimension();
        let mut z = vec![0.0; d];
        for (row, &y) in self.ritz.vectors.chunks_exact(d.max(1)).zip(y) {
            add_row(&mut z, row, y);
        }
        z
    }
}

/// `into += factor · row`.
pub(super) fn add_row(into: &mut [f64], row: &[f32], factor: f64) {
    vectorized(
        into,
        #[inline(always)]
        |into| into.iter_mut().zip(row).for_each(|(z, &x)| *z += factor * f64::from(x)),
    );
}

pub(super) fn length(what: &'static str, got: usize, wanted: usize) -> Result<(), DesignError> {
    if got == wanted { Ok(()) } else { Err(DesignError::Length { what, got, wanted }) }
}

#[cfg(test)]
#[path = "design_tests.rs"]
mod tests;
