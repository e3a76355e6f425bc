//! A basis of tangential fields: a sparse space, its energies, and the approximate eigenfields in it.

use std::sync::Arc;

use chladni_algebra::SparseMatrix;

use super::{FieldSpace, Provenance};
use crate::operator::transport::FieldKind;

/// A space of fields and the energies restricted to it, on the surface scaled to unit area.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldBasis {
    /// What is stored in a face.
    pub kind: FieldKind,
    /// `U`.
    pub space: FieldSpace,
    /// `S̄ = UᵀSU`, `d × d`: the harmonic energy.
    pub stiffness: SparseMatrix,
    /// `M̄ = UᵀMU`, `d × d`.
    pub mass: SparseMatrix,
    /// The faces that the groups of columns are centred at.
    pub samples: Vec<u32>,
    /// The area of the mesh in the units of the input, by which eigenvalues are to be divided.
    pub area: f64,
}

/// All eigenpairs of the restricted operator, `S̄ x = θ M̄ x`: what design takes place in.
#[derive(Debug, Clone, PartialEq)]
pub struct RitzFields {
    /// `d` values, ascending, on the surface of unit area.
    pub values: Vec<f64>,
    /// `X`, `d × d`, row after row, `M̄`-orthonormal columns: what a coefficient of the space is in Ritz coordinates.
    pub vectors: Vec<f32>,
}

/// A field basis as a job leaves it behind.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredFields {
    /// The space and its energies.
    pub basis: FieldBasis,
    /// Its eigenpairs; `None` where the space is too large for a dense eigenproblem.
    pub ritz: Option<Arc<RitzFields>>,
    /// How the basis was made.
    pub metadata: Provenance,
}

impl StoredFields {
    /// Numbers of one field: two or three per face.
    pub fn rows(&self) -> usize {
        self.basis.space.block() * self.basis.space.faces()
    }

    /// The dimension of the space, `d`.
    pub fn dimension(&self) -> usize {
        self.basis.space.dimension()
    }

    /// The approximate eigenvalues, ascending, in 1/length² of the input; empty where there are none.
    pub fn eigenvalues(&self) -> Vec<f64> {
        let values = self.ritz.as_ref().map_or(&[][..], |ritz| &ritz.values);
        values.iter().map(|value| value / self.basis.area).collect()
    }

    /// About the bytes that the parts take as stored.
    pub fn stored_bytes(&self) -> u64 {
        let FieldBasis { space, stiffness, mass, samples, .. } = &self.basis;
        let matrices = 12 * (stiffness.entries() + mass.entries()) + 8 * (stiffness.rows() + mass.rows() + 2);
        let ritz = self.ritz.as_ref().map_or(0, |ritz| 8 * ritz.values.len() + 4 * ritz.vectors.len());
        space.bytes() + (matrices + 4 * samples.len() + ritz) as u64
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A basis of four columns and a dense one on three faces.
    pub(crate) fn small_fields(ritz: bool) -> StoredFields {
        let blocks = (0..16).map(|i| 0.25 * i as f32 - 1.0).collect();
        let space = FieldSpace::from_parts(2, 2, vec![0, 1, 3, 4], vec![0, 0, 1, 1], blocks, vec![]).unwrap();
        let space = space.with_dense(vec![(0..6).map(|i| i as f32 * 0.5).collect()]);
        let diagonal = |scale: f64| {
            SparseMatrix::new(5, 5, (0..=5).collect(), (0..5).collect(), (0..5).map(|i| scale * i as f64).collect())
        };
        StoredFields {
            basis: FieldBasis {
                kind: FieldKind::NVector { n: 4 },
                space,
                stiffness: diagonal(3.5).unwrap(),
                mass: diagonal(0.5).unwrap(),
                samples: vec![2, 0],
                area: 4.0,
            },
            ritz: ritz.then(|| {
                let vectors = (0..25).map(|i| (i as f32).sin()).collect();
                Arc::new(RitzFields { values: vec![0.0, 1.0, 2.0, 4.0, 8.0], vectors })
            }),
            metadata: serde_json::json!({"kind": "field_basis"}).into(),
        }
    }

    #[test]
    fn eigenvalues_are_told_in_the_units_of_the_input() {
        let fields = small_fields(true);
        assert_eq!((fields.rows(), fields.dimension()), (6, 5));
        assert_eq!(fields.eigenvalues(), [0.0, 0.25, 0.5, 1.0, 2.0]);
        assert!(small_fields(false).eigenvalues().is_empty());
    }
}
