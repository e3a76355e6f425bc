//! Signatures of points, and points that are similar to one.

use chladni_algebra::DenseMatrix;
use chladni_mesh::numbering::{NumberingError, Translation};
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::signature::{Signature, nearest_items};
use chladni_spectral::basis::Basis;
use serde::{Deserialize, Serialize};

use crate::numbered::push;

/// The most points of a list of similar ones.
const MOST_SIMILAR: usize = 100_000;

/// A signature of points.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum SignatureKind {
    /// The heat kernel signature, `Σ e^{−λt} φ(x)²` for each time.
    HeatKernel {
        /// Times above zero, in length² of the mesh.
        times: Option<Vec<f64>>,
        /// Without times, how many, log-spaced in `[4 ln 10 / λ_max, 4 ln 10 / λ_1]`; 16 by default.
        count: Option<usize>,
        /// Whether to divide by the trace `Σ e^{−λt}`.
        #[serde(default)]
        normalised: bool,
    },
    /// The wave kernel signature.
    WaveKernel {
        /// How many energies, at least 32; 100 by default.
        count: Option<usize>,
    },
    /// The global point signature, `φ_k(x)/√λ_k`.
    GlobalPoint {
        /// How many modes; 20 by default.
        count: Option<usize>,
    },
}

impl SignatureKind {
    fn signature(&self, basis: &Basis) -> Result<Signature, AnalysisError> {
        Ok(match self {
            Self::HeatKernel { times: Some(times), normalised, .. } => {
                Signature::HeatKernel { times: times.clone(), normalised: *normalised }
            }
            Self::HeatKernel { times: None, count, normalised } => {
                Signature::heat_kernel(&basis.eigenvalues, count.unwrap_or(16), *normalised)?
            }
            Self::WaveKernel { count } => Signature::WaveKernel { count: count.unwrap_or(100) },
            Self::GlobalPoint { count } => Signature::GlobalPoint { count: count.unwrap_or(20) },
        })
    }
}

/// Which signature, and where.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"signature": {"kind": "heat_kernel", "count": 16}, "vertices": [17, 2930]})))]
pub struct SignatureRequest {
    /// The signature.
    pub signature: SignatureKind,
    /// Vertices; without them, all.
    pub vertices: Option<Vec<u32>>,
}

impl SignatureRequest {
    /// Brings the vertices into the numbering of the kept mesh, which has so many.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn translate(&mut self, to: &Translation, rows: usize) -> Result<(), NumberingError> {
        self.vertices.iter_mut().try_for_each(|vertices| to.vertices(vertices, rows))
    }

    /// A row for each of the vertices, as they were given, or for each vertex in the numbering of `to`; a column for
    /// each time, energy or mode.
    ///
    /// # Errors
    /// [`AnalysisError`] names what does not fit.
    pub fn table(&self, basis: &Basis, to: &Translation) -> Result<DenseMatrix, AnalysisError> {
        let signature = self.signature.signature(basis)?;
        match &self.vertices {
            Some(vertices) => signature.at(basis, vertices),
            None => Ok(push(to, signature.everywhere(basis)?)),
        }
    }
}

/// A point, and what makes others similar to it.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"vertex": 17, "signature": {"kind": "wave_kernel", "count": 100}, "count": 20})))]
pub struct SimilarRequest {
    /// The point.
    #[serde(default)]
    pub vertex: u32,
    /// By what they are compared.
    pub signature: SignatureKind,
    /// How many points.
    #[serde(default = "ten")]
    #[cfg_attr(feature = "schema", schema(default = 10))]
    pub count: usize,
}

fn ten() -> usize {
    10
}

/// Similar points, the most similar first.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[cfg_attr(feature = "schema", schema(example = json!({"vertices": [17, 2930], "differences": [0.0, 0.0013]})))]
pub struct SimilarAnswer {
    /// Their numbers; the first is the point itself, or one that cannot be told from it.
    pub vertices: Vec<u32>,
    /// How different their signatures are from that of the point.
    pub differences: Vec<f64>,
}

impl SimilarRequest {
    /// Checks what the basis is not needed for.
    ///
    /// # Errors
    /// [`AnalysisError::Count`] where too many points are asked for, or none.
    pub fn check(&self) -> Result<(), AnalysisError> {
        match (1..=MOST_SIMILAR).contains(&self.count) {
            true => Ok(()),
            false => Err(AnalysisError::Count { what: "count", found: self.count, least: 1, most: MOST_SIMILAR }),
        }
    }

    /// Brings the point into the numbering of the kept mesh, which has so many vertices.
    ///
    /// # Errors
    /// [`NumberingError`] names the vertex.
    pub fn translate(&mut self, to: &Translation, rows: usize) -> Result<(), NumberingError> {
        self.vertex = to.vertex(self.vertex.into(), rows)?;
        Ok(())
    }

    /// How different the signature of every kept vertex is from that of the point.
    ///
    /// # Errors
    /// [`AnalysisError`] names what does not fit.
    pub fn differences(&self, basis: &Basis) -> Result<Vec<f64>, AnalysisError> {
        self.check()?;
        self.signature.signature(basis)?.similarity(basis, self.vertex)
    }

    /// The most similar points in the numbering of `to`. What subdivision made is no vertex of the file, and left out.
    ///
    /// # Errors
    /// [`AnalysisError`] names what does not fit.
    pub fn answer(&self, basis: &Basis, to: &Translation) -> Result<SimilarAnswer, AnalysisError> {
        let mut differences = self.differences(basis)?;
        let mut told = 0;
        for (vertex, difference) in differences.iter_mut().enumerate() {
            match to.is_of_file(vertex as u32) {
                true => told += 1,
                false => *difference = f64::INFINITY,
            }
        }
        let vertices = nearest_items(&differences, self.count.min(told));
        let differences = vertices.iter().map(|&vertex| differences[vertex as usize]).collect();
        let vertices = vertices.into_iter().map(|vertex| to.file_vertex(vertex)).collect();
        Ok(SimilarAnswer { vertices, differences })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_points_and_too_many_are_refused_by_their_number() {
        let asked =
            |count: usize| SimilarRequest { vertex: 0, signature: SignatureKind::WaveKernel { count: None }, count };
        assert!(asked(1).check().is_ok() && asked(MOST_SIMILAR).check().is_ok());
        for count in [0, MOST_SIMILAR + 1] {
            let refused = asked(count).check().unwrap_err();
            assert!(
                matches!(refused, AnalysisError::Count { what: "count", found, .. } if found == count),
                "{refused}"
            );
        }
    }
}
