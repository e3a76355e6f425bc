//! Distances on a surface, computed in a stored basis of it.

use chladni_algebra::DenseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::distance::{SpectralDistance, nearest};
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::analysis::spectrum::kernel_size;
use chladni_spectral::basis::Basis;
use serde::Deserialize;

/// A distance on the surface.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum DistanceKind {
    /// `d² = Σ e^{−2λt} (φ(x) − φ(y))²`, for each of the times.
    Diffusion {
        /// Times above zero, in length² of the mesh; without them, half the inverse of the first eigenvalue above zero.
        times: Option<Vec<f64>>,
    },
    /// `d² = Σ (φ(x) − φ(y))² / λ²`.
    Biharmonic,
    /// `d² = Σ (φ(x) − φ(y))² / λ`.
    CommuteTime,
    /// Geodesic distance by the heat method, both of its solves in the basis.
    Geodesic {
        /// How long heat flows, in length² of the mesh; without it, for each face the shortest of a ladder of times at which heat reaches it.
        time: Option<f64>,
    },
}

/// Which distances, and between what.
#[derive(Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "schema", schema(example = json!({"distance": {"kind": "diffusion", "times": [0.01, 0.1]}, "sources": [17, 2930], "nearest": false})))]
pub struct DistanceRequest {
    /// The distance.
    pub distance: DistanceKind,
    /// Vertices that distances of all vertices are measured from; instead of `pairs`.
    #[serde(default)]
    pub sources: Vec<u32>,
    /// Pairs of vertices that distances are measured between; instead of `sources`.
    #[serde(default)]
    pub pairs: Vec<[u32; 2]>,
    /// Whether to give the distance to the nearest source alone.
    #[serde(default)]
    pub nearest: bool,
}

/// Why distances cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum DistanceFault {
    /// It is not clear between what.
    #[error("either sources or pairs are needed, not both")]
    Between,
    /// A vertex, a time or the basis does not fit.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
}

impl DistanceRequest {
    /// Checks what no basis is needed for.
    ///
    /// # Errors
    /// [`DistanceFault::Between`].
    pub fn check(&self) -> Result<(), DistanceFault> {
        if self.sources.is_empty() == self.pairs.is_empty() { Err(DistanceFault::Between) } else { Ok(()) }
    }

    /// Whether the mesh is needed beside the basis.
    pub fn needs_mesh(&self) -> bool {
        matches!(self.distance, DistanceKind::Geodesic { .. })
    }

    /// A row for each vertex or pair, a column for each source and, within it, each time.
    ///
    /// # Errors
    /// [`DistanceFault`] names what does not fit.
    pub fn distances(&self, basis: &Basis, mesh: Option<&TriangleMesh>) -> Result<DenseMatrix, DistanceFault> {
        self.check()?;
        let spectral = match &self.distance {
            DistanceKind::Diffusion { times: Some(times) } => SpectralDistance::Diffusion { times: times.clone() },
            DistanceKind::Diffusion { times: None } => {
                let first = kernel_size(&basis.eigenvalues)?;
                SpectralDistance::Diffusion { times: vec![0.5 / basis.eigenvalues[first]] }
            }
            DistanceKind::Biharmonic => SpectralDistance::Biharmonic,
            DistanceKind::CommuteTime => SpectralDistance::CommuteTime,
            DistanceKind::Geodesic { time } => {
                let mesh = mesh.ok_or(AnalysisError::Mesh { basis: basis.vertices(), mesh: 0 })?;
                if !self.pairs.is_empty() {
                    return Ok(between(basis, mesh, &self.pairs, *time)?);
                }
                return Ok(geodesic(basis, mesh, &self.sources, self.nearest, *time)?);
            }
        };
        if !self.pairs.is_empty() {
            return Ok(spectral.between(basis, &self.pairs)?);
        }
        let all = spectral.from_sources(basis, &self.sources)?;
        Ok(if self.nearest { nearest(&all, spectral.columns()) } else { all })
    }
}

/// Geodesic distances of pairs: from each of their first vertices, once.
fn between(
    basis: &Basis,
    mesh: &TriangleMesh,
    pairs: &[[u32; 2]],
    time: Option<f64>,
) -> Result<DenseMatrix, AnalysisError> {
    let mut sources: Vec<u32> = pairs.iter().map(|pair| pair[0]).collect();
    sources.sort_unstable();
    sources.dedup();
    let vertices = basis.vertices();
    for (place, pair) in pairs.iter().enumerate() {
        if let Some(&vertex) = pair.iter().find(|&&vertex| vertex as usize >= vertices) {
            return Err(AnalysisError::Vertex { what: "pair", place, vertex, vertices });
        }
    }
    let all = geodesic(basis, mesh, &sources, false, time)?;
    let mut distances = DenseMatrix::zeros(pairs.len(), 1);
    for (slot, [a, b]) in distances.column_mut(0).iter_mut().zip(pairs) {
        let column = sources.partition_point(|source| source < a);
        *slot = all.column(column)[*b as usize];
    }
    Ok(distances)
}
