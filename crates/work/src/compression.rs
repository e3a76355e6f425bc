//! Spectral compression of functions on a mesh, with what it costs.

use chladni_algebra::DenseMatrix;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::compression::{Compressed, compress};
use chladni_spectral::basis::{Basis, ProvenanceError};
use serde::{Deserialize, Serialize};

use crate::projection::Functions;

/// Bits of the largest coefficient, unless they are given.
const BITS: u32 = 14;

/// What to compress, and how far.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"functions": "coordinates", "pairs": 300, "bits": 14})))]
pub struct CompressionRequest {
    /// `coordinates`, or a table with a row for each vertex.
    #[serde(default = "Functions::coordinates")]
    pub functions: Functions,
    /// How many modes are kept; all by default.
    pub pairs: Option<usize>,
    /// Bits of the largest coefficient, 2 to 30; 14 by default.
    pub bits: Option<u32>,
}

/// Rate and distortion.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({
    "pairs": 300, "bits": 14, "bytes": 1123, "bits_per_vertex": 0.067, "basis_bytes": 17400000, "basis_from_faces": false, "bits_per_vertex_with_basis": 2871.0, "step": 0.0021, "nonzeros": 812,
    "relative_errors": [0.004, 0.003, 0.004], "truncation_errors": [0.004, 0.003, 0.004]
})))]
pub struct CompressionAnswer {
    /// Modes that are kept.
    pub pairs: usize,
    /// Bits of the largest coefficient.
    pub bits: u32,
    /// Bytes of the whole, header included.
    pub bytes: usize,
    /// The same in bits for each vertex, all functions together.
    pub bits_per_vertex: f64,
    /// Bytes that the functions of the basis take as they are stored: who decompresses must have them, whatever the
    /// number of pairs.
    pub basis_bytes: u64,
    /// Whether whoever has the faces computes the basis anew, so that it need not be sent: it is of the operator
    /// `graph`.
    pub basis_from_faces: bool,
    /// Bits for each vertex where the basis has to be sent as well, once.
    pub bits_per_vertex_with_basis: f64,
    /// The width of a step of the rounding.
    pub step: f64,
    /// Coefficients that are not zero.
    pub nonzeros: usize,
    /// Of each function, how much is lost in the norm of the mass, relative to how far it is from its mean.
    pub relative_errors: Vec<f64>,
    /// How much of that the modes that are left out would lose alone.
    pub truncation_errors: Vec<f64>,
}

/// How far functions are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rate {
    /// Modes that are kept.
    pub pairs: usize,
    /// Bits of the largest coefficient.
    pub bits: u32,
}

impl CompressionRequest {
    /// How far functions in a basis are compressed.
    pub fn rate(&self, basis: &Basis) -> Rate {
        Rate { pairs: self.pairs.unwrap_or(basis.count()), bits: self.bits.unwrap_or(BITS) }
    }
}

impl Rate {
    /// Compresses functions on the kept vertices.
    ///
    /// # Errors
    /// [`AnalysisError`] names what does not fit.
    pub fn compress(self, basis: &Basis, functions: &DenseMatrix) -> Result<Compressed, AnalysisError> {
        compress(basis, functions, self.pairs, self.bits)
    }

    /// What functions that were compressed so cost, and what they lost.
    ///
    /// # Errors
    /// [`ProvenanceError`] where the basis does not say what its rows are.
    pub fn into_answer(self, basis: &Basis, packed: Compressed) -> Result<CompressionAnswer, ProvenanceError> {
        let (bytes, basis_bytes) = (packed.bytes.len(), basis.stored_bytes());
        let per_vertex = |bytes: f64| 8.0 * bytes / basis.vertices().max(1) as f64;
        Ok(CompressionAnswer {
            pairs: self.pairs,
            bits: self.bits,
            bytes,
            bits_per_vertex: per_vertex(bytes as f64),
            basis_bytes,
            basis_from_faces: basis.is_of_graph()?,
            bits_per_vertex_with_basis: per_vertex(bytes as f64 + basis_bytes as f64),
            step: packed.step,
            nonzeros: packed.nonzeros,
            relative_errors: packed.relative_errors,
            truncation_errors: packed.truncation_errors,
        })
    }
}
