//! Products: what jobs leave in the store. An eigenbasis has eigenfunctions, eigenvalues and a certificate; its
//! eigenfunctions are kept compactly, as a sparse factor times a dense one, or densely, as columns. A field basis has a
//! sparse space of tangential fields.

mod certificate;
mod dense;
mod evaluate;
pub mod family;
mod field;
mod field_space;
mod maps;
pub mod modal;
mod part;
mod product;
mod provenance;
mod squares;

pub use certificate::{
    AccuracyReport, Around, Certificate, CutCluster, FieldAccuracyReport, FieldCertificate, InertiaCount, Interval,
    LevelReport, NearPair, OnBound, completeness,
};
pub(crate) use dense::Visit;
pub use dense::{CHUNK_COLUMNS, ColumnChunk, ColumnError, ColumnSource, DenseFunctions, Precision, Real};
pub use evaluate::BasisError;
pub use field::{FieldBasis, RitzFields, StoredFields};
pub use field_space::{FieldMisfit, FieldSpace, SpaceError};
pub use maps::{CycleErrors, MAP_COLLECTION, StoredMap, StoredMaps, ordered_pairs};
pub(crate) use part::SHARED;
pub use part::{
    EIGENBASIS_PART, Fingerprint, NUMBERS_OF_SHARE, Part, PartCount, PartPlan, PartShare, PartSlice, StoredPart,
};
pub use product::{PARTS, PENCIL, Product, ProductKind, Summary};

// What a field basis says its fields are.
pub use crate::operator::transport::FieldKind;

pub use provenance::{
    Anchor, AskedOperator, JobRecord, ModesClaim, Provenance, ProvenanceError, RowsOf, VibratingObject,
};

use std::sync::{Arc, OnceLock};

use chladni_algebra::{DenseMatrix, MassMatrix, SparseMatrix};

/// A basis of `m` eigenfunctions on `n` vertices, `M`-orthonormal in the units of the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// The eigenfunctions.
    pub functions: Functions,
    /// `m` eigenvalues, ascending, in 1/length² of the input.
    pub eigenvalues: Vec<f64>,
    /// The mass matrix in the units of the input, `n × n`: what filters and projections take inner products with.
    pub mass: MassMatrix,
    /// What is proven about each pair and about the whole.
    pub certificate: Certificate,
    /// How the basis was made: operator, method, parameters with defaults filled in, solver version, mesh.
    pub metadata: Provenance,
}

impl Basis {
    /// Whether its rows are the vertices of a solid, those of the surface first, and distances between them run through
    /// its inside.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it does not say what its rows are.
    pub fn is_of_solid(&self) -> Result<bool, ProvenanceError> {
        Ok(self.metadata.rows_of()? == RowsOf::Solid)
    }

    /// Whether it is of the combinatorial Laplacian, which knows of no lengths.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it does not say what its rows are.
    pub fn is_of_graph(&self) -> Result<bool, ProvenanceError> {
        Ok(self.metadata.rows_of()? == RowsOf::Graph)
    }

    /// Whether its rows are two numbers for each face, of tangential fields.
    ///
    /// # Errors
    /// [`ProvenanceError`] where it does not say what its rows are.
    pub fn is_of_fields(&self) -> Result<bool, ProvenanceError> {
        Ok(self.metadata.rows_of()? == RowsOf::Fields)
    }
}

/// The eigenfunctions of a basis.
#[derive(Debug, Clone, PartialEq)]
pub enum Functions {
    /// `Φ = U φ̄`.
    Compact(Compact),
    /// The columns of `Φ` themselves.
    Dense(DenseFunctions),
}

/// Eigenfunctions as a product of two factors: `Φ = U φ̄`.
#[derive(Debug, Clone, PartialEq)]
pub struct Compact {
    /// `U`, `n × d`, in single precision: the reduced problem was formed with these very values, so nothing is lost by
    /// storing them so.
    pub space: SparseMatrix<f32>,
    /// `φ̄`, `d × m`, one column per eigenfunction.
    pub coefficients: DenseMatrix,
    /// What sums of squares need to know of `space`, from the first of them on.
    pairs: Cached<squares::Pairs>,
}

/// Something that follows from the rest of a value, and is kept from when it is first needed. It makes no difference
/// between values.
#[derive(Debug)]
struct Cached<T>(OnceLock<Arc<T>>);

impl<T> Clone for Cached<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Cached<T> {
    /// What is kept, or what is made now. Nobody waits for another to make it: who waits in a pool of threads may be
    /// given work that needs the same.
    fn get_or(&self, make: impl FnOnce() -> T) -> Arc<T> {
        if let Some(kept) = self.0.get() {
            return kept.clone();
        }
        let made = Arc::new(make());
        self.0.get_or_init(|| made).clone()
    }
}

impl<T> Default for Cached<T> {
    fn default() -> Self {
        Self(OnceLock::new())
    }
}

impl<T> PartialEq for Cached<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Compact {
    /// Functions from their factors, `n × d` and `d × m`.
    pub fn new(space: SparseMatrix<f32>, coefficients: DenseMatrix) -> Self {
        Self { space, coefficients, pairs: Cached::default() }
    }
}

impl Basis {
    /// The number of vertices, `n`.
    pub fn vertices(&self) -> usize {
        match &self.functions {
            Functions::Compact(compact) => compact.space.rows(),
            Functions::Dense(dense) => dense.rows(),
        }
    }

    /// The factors of a compact basis.
    pub fn compact(&self) -> Option<&Compact> {
        match &self.functions {
            Functions::Compact(compact) => Some(compact),
            Functions::Dense(_) => None,
        }
    }

    /// The dimension of the subspace of a compact basis, `d`.
    pub fn dimension(&self) -> Option<usize> {
        self.compact().map(|compact| compact.space.columns())
    }

    /// The number of eigenpairs, `m`.
    pub fn count(&self) -> usize {
        self.eigenvalues.len()
    }

    /// The bytes that eigenfunctions and eigenvalues take as stored. Of a compact basis: four for each value and column
    /// index of `U`, four for each row offset, eight for each coefficient and eigenvalue.
    pub fn stored_bytes(&self) -> u64 {
        let functions = match &self.functions {
            Functions::Compact(Compact { space, coefficients, .. }) => {
                (8 * space.entries() + 4 * (space.rows() + 1) + 8 * coefficients.values().len()) as u64
            }
            Functions::Dense(dense) => dense.bytes(),
        };
        functions + 8 * self.eigenvalues.len() as u64
    }

    /// The bytes that the basis may come to hold in memory besides what is stored, once it is used: tables of a compact
    /// one.
    pub fn derived_bytes(&self) -> u64 {
        self.compact().map_or(0, |compact| squares::Pairs::bytes(&compact.space))
    }

    /// The bytes that the `n × m` lifted eigenfunctions and the eigenvalues would take in double precision.
    pub fn dense_bytes(&self) -> u64 {
        8 * (self.vertices() as u64 + 1) * self.count() as u64
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two eigenfunctions on three vertices in a space of two functions.
    pub(crate) fn small_basis(sparse_mass: bool) -> Basis {
        let mass = if sparse_mass {
            let values = vec![0.5, 0.1, 0.1, 0.5, 0.25];
            MassMatrix::Sparse(SparseMatrix::new(3, 3, vec![0, 2, 4, 5], vec![0, 1, 0, 1, 2], values).unwrap())
        } else {
            MassMatrix::Diagonal(vec![0.5, 0.25, 0.25])
        };
        Basis {
            functions: Functions::Compact(Compact::new(
                SparseMatrix::new(3, 2, vec![0, 1, 3, 4], vec![0, 0, 1, 1], vec![1.0, 0.25, 0.75, 1.0]).unwrap(),
                DenseMatrix::from_columns(2, 2, vec![1.0, 1.0, 0.1, -1.0 / 3.0]),
            )),
            eigenvalues: vec![0.0, 3.25],
            mass,
            certificate: Certificate {
                residuals: vec![1e-15, 0.125],
                bounds: vec![0.0, 0.5],
                orthonormality_defect: 1.0 / 7.0,
                ..Certificate::default()
            },
            metadata: serde_json::json!({"parameters": {"count": 2}}).into(),
        }
    }

    /// The same functions in columns, and `more` further ones, so that there are several chunks.
    pub(crate) fn dense_basis(precision: Precision, more: usize) -> Basis {
        let basis = small_basis(false);
        let modes: Vec<f64> = basis.lift(0..2).unwrap();
        let further = (0..3 * more).map(|i| (i as f64 * 0.7).sin());
        let columns = DenseMatrix::from_columns(3, 2 + more, modes.into_iter().chain(further).collect());
        let m = 2 + more;
        Basis {
            functions: Functions::Dense(DenseFunctions::from_columns(&columns, precision)),
            eigenvalues: (0..m).map(|k| k as f64 * 3.25).collect(),
            certificate: Certificate {
                residuals: vec![0.125; m],
                bounds: vec![0.5; m],
                complete: Some(true),
                inertia: vec![InertiaCount { shift: 1e6, below: m }],
                levels: vec![LevelReport { dimension: 3, iterations: 2, shifts: 1 }],
                tolerance: Some(0.01),
                ..basis.certificate
            },
            ..basis
        }
    }

    #[test]
    fn what_a_basis_takes_is_told_for_both_kinds() {
        let compact = small_basis(false);
        assert_eq!((compact.dimension(), compact.stored_bytes()), (Some(2), 8 * 4 + 4 * 4 + 8 * 4 + 16));
        let dense = dense_basis(Precision::F32, 40);
        assert_eq!((dense.dimension(), dense.vertices(), dense.count()), (None, 3, 42));
        assert_eq!((dense.stored_bytes(), dense.dense_bytes()), (4 * 3 * 42 + 8 * 42, 8 * 4 * 42));
    }
}
