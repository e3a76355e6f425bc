//! Operators on tangential fields: what the parts of [`super::hodge`] and [`super::transport`] make together.

use chladni_algebra::BlockMatrix;
use chladni_mesh::TriangleMesh;
use chladni_mesh::dual::DualGraph;

use super::OperatorError;
use super::frames::FaceFrames;
use super::hodge::{FieldBoundary, hodge_stiffness};
use super::transport::{FieldKind, MOST_VECTORS, transport_stiffness};

/// `S u = λ M u` for fields of `B` numbers per face, on the surface scaled to unit area.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldOperator<const B: usize> {
    /// What is stored in a face.
    pub kind: FieldKind,
    /// The harmonic energy: `F × F` blocks, symmetric positive semi-definite.
    pub stiffness: BlockMatrix<B>,
    /// The mass of each of the `B` numbers of a face: its area. They add up to 1.
    pub mass: Vec<f64>,
    /// The area of the mesh in the units of the input, by which eigenvalues are to be divided.
    pub area: f64,
}

impl<const B: usize> FieldOperator<B> {
    /// Assembles the operator of a kind of field that stores `B` numbers in a face.
    ///
    /// # Errors
    /// [`OperatorError`]: the mesh does not fit its graph or frames, or the kind is out of range or does not store `B`
    /// numbers.
    pub fn assemble(
        kind: FieldKind,
        mesh: &TriangleMesh,
        dual: &DualGraph,
        frames: &FaceFrames,
        boundary: FieldBoundary,
    ) -> Result<Self, OperatorError> {
        check_kind(kind)?;
        let faces = mesh.faces.len();
        let fits = dual.faces() == faces && frames.faces() == faces && dual.vertices() == mesh.positions.len();
        if !fits || kind.block() != B {
            let reason =
                format!("fields of {kind:?} on {faces} faces do not fit blocks of {B} on {} faces", dual.faces());
            return Err(OperatorError::Parameter { name: "kind", reason });
        }
        let stiffness = match kind {
            FieldKind::Vector {} if let Err(at) = dual.oriented() => {
                let reason = format!("the Hodge–Laplacian of vector fields needs an oriented surface: {at}");
                return Err(OperatorError::Parameter { name: "kind", reason });
            }
            FieldKind::Vector {} => from_pairs(hodge_stiffness(mesh, dual, frames, boundary)),
            FieldKind::NVector { .. } | FieldKind::Tensor {} => transport_stiffness(kind, dual, frames),
        };
        Ok(Self { kind, stiffness, mass: frames.areas().to_vec(), area: frames.area() })
    }

    fn fits(&self, field: &[f64]) -> Result<(), OperatorError> {
        let expected = B * self.mass.len();
        if field.len() == expected {
            return Ok(());
        }
        let reason = format!("must be {expected} numbers, {B} for each face, not {}", field.len());
        Err(OperatorError::Parameter { name: "field", reason })
    }

    /// `‖u‖²_M`.
    ///
    /// # Errors
    /// [`OperatorError::Parameter`] unless the field has `B` numbers for each face.
    pub fn norm_squared(&self, field: &[f64]) -> Result<f64, OperatorError> {
        self.fits(field)?;
        Ok(field.chunks_exact(B).zip(&self.mass).map(|(u, m)| m * u.iter().map(|x| x * x).sum::<f64>()).sum())
    }

    /// `uᵀ S u`.
    ///
    /// # Errors
    /// As for [`norm_squared`](Self::norm_squared).
    pub fn harmonic_energy(&self, field: &[f64]) -> Result<f64, OperatorError> {
        self.fits(field)?;
        let image = self.stiffness.multiply(field);
        Ok(image.iter().zip(field).map(|(a, b)| a * b).sum())
    }

    /// `uᵀ S M⁻¹ S u`.
    ///
    /// # Errors
    /// As for [`norm_squared`](Self::norm_squared).
    pub fn biharmonic_energy(&self, field: &[f64]) -> Result<f64, OperatorError> {
        self.fits(field)?;
        let image = self.stiffness.multiply(field);
        Ok(image.chunks_exact(B).zip(&self.mass).map(|(a, m)| a.iter().map(|x| x * x).sum::<f64>() / m).sum())
    }
}

/// Whether a kind of field is in range.
///
/// # Errors
/// [`OperatorError::Parameter`].
pub fn check_kind(kind: FieldKind) -> Result<(), OperatorError> {
    match kind {
        FieldKind::NVector { n } if !(1..=MOST_VECTORS).contains(&n) => {
            let reason = format!("must be from 1 to {MOST_VECTORS}, not {n}");
            Err(OperatorError::Parameter { name: "n", reason })
        }
        _ => Ok(()),
    }
}

/// A matrix of 2 × 2 blocks as one of `B × B` blocks; `B` is 2 wherever this is called.
fn from_pairs<const B: usize>(matrix: BlockMatrix<2>) -> BlockMatrix<B> {
    matrix.map_blocks(|block| std::array::from_fn(|i| std::array::from_fn(|j| block[i.min(1)][j.min(1)])))
}

#[cfg(test)]
#[path = "tangential_tests.rs"]
mod tests;
