//! A family of operators in one subspace (thesis, §2.6): the lowest pairs of any of them at interactive rates.
//!
//! In a fixed space every operator `(1 − t) S + t A + v V` restricts to `(1 − t) S̄ + t Ā + v V̄`. The family is kept
//! in the Ritz coordinates of the Laplacian, in which `M̄` is the identity and `S̄` diagonal. Then a query is one
//! standard symmetric eigenproblem of size `d`, of which only the lowest pairs are wanted.

use chladni_algebra::{DenseMatrix, EigenError, lowest_symmetric};
use chladni_base::Unwatched;

use crate::basis::ProvenanceError;
use crate::basis::family::FamilyBasis;

/// An operator of the family.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Member {
    /// `t`, from 0, the Laplacian, to 1, the operator that also follows the normals.
    pub extrinsic: f64,
    /// `v ≥ 0`, what multiplies the potential `κ₁² + κ₂²`.
    pub curvature: f64,
}

/// Why there is no spectrum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FamilyError {
    /// A parameter is out of its range.
    #[error("{name}: {reason}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// What its value must be, and what it is.
        reason: String,
    },
    /// The restricted problem could not be solved.
    #[error(transparent)]
    Eigen(#[from] EigenError),
    /// The family does not say for which members its space was made.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
}

/// The lowest pairs of one operator.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// `d × m`: eigenfunctions are the functions of the family times these, orthonormal for the mass of the input.
    pub coefficients: DenseMatrix,
    /// How many of the lowest pairs the space was made for: as [`covered`].
    pub covered: usize,
}

impl Member {
    /// Checks both parameters.
    ///
    /// # Errors
    /// [`FamilyError::Parameter`] names the first that is out of its range.
    pub fn check(&self) -> Result<(), FamilyError> {
        let within = |name, value: f64, most: f64| {
            if (0.0..=most).contains(&value) {
                return Ok(());
            }
            Err(FamilyError::Parameter { name, reason: format!("must be between 0 and {most}, not {value}") })
        };
        within("extrinsic", self.extrinsic, 1.0)?;
        within("curvature", self.curvature, 1e6)
    }
}

/// How many of the lowest pairs of a member the space was made for. With all functions of the mesh they are exact,
/// every one; else they are two thirds of the pairs that each anchor gave, of members whose curvature is no more than
/// that of the last anchor, and none of others: those can be many times too large.
///
/// # Errors
/// [`ProvenanceError`] where the family does not say for which members its space was made.
pub fn covered(family: &FamilyBasis, member: Member) -> Result<usize, ProvenanceError> {
    if family.dimension() == family.vertices() {
        return Ok(family.dimension());
    }
    let anchors = family.metadata.anchors()?;
    let most = anchors.iter().map(|anchor| anchor.curvature).fold(0.0, f64::max);
    let given = anchors.iter().map(|anchor| anchor.pairs).min().unwrap_or(0);
    Ok(if member.curvature <= most { given * 2 / 3 } else { 0 })
}

/// The lowest `count` pairs of an operator of the family, by the dense eigensolver: an answer depends on nothing that
/// was asked before, takes the same time for every member, and no multiplet is too large. On the threads of the pool it
/// is called from.
///
/// # Errors
/// [`FamilyError`]: parameters out of range, more pairs than the family has dimensions, a family that does not say for
/// which members its space was made.
pub fn spectrum(family: &FamilyBasis, member: Member, count: usize) -> Result<Spectrum, FamilyError> {
    member.check()?;
    let d = family.dimension();
    if !(1..=d).contains(&count) {
        let reason = format!("must be between 1 and {d}, the dimension of the family, not {count}");
        return Err(FamilyError::Parameter { name: "count", reason });
    }
    let covered = covered(family, member)?.min(count);
    if member == Member::default() {
        // The Laplacian: its pairs are the coordinates.
        let eigenvalues = family.eigenvalues[..count].to_vec();
        let mut coefficients = DenseMatrix::zeros(d, count);
        (0..count).for_each(|k| coefficients.column_mut(k)[k] = 1.0);
        return Ok(Spectrum { eigenvalues, coefficients, covered });
    }
    let matrix = family.combined(1.0 - member.extrinsic, member.extrinsic, member.curvature);
    let pairs = lowest_symmetric(matrix, count, &Unwatched)?;
    Ok(Spectrum { eigenvalues: pairs.values, coefficients: pairs.vectors, covered })
}

#[cfg(test)]
#[path = "family_tests.rs"]
mod tests;
