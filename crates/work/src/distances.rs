//! Distances on a surface: by a stored basis of it, or on the mesh itself.

use chladni_algebra::DenseMatrix;
use chladni_base::Monitor;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;
use chladni_mesh::distance::ExactGeodesics;
use chladni_mesh::points::are_points;
use chladni_spectral::analysis::AnalysisError;
use chladni_spectral::analysis::distance::{SpectralDistance, nearest};
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::analysis::heat::HeatGeodesics;
use chladni_spectral::analysis::spectrum::kernel_size;
use chladni_spectral::basis::{Basis, ProvenanceError, RowsOf};
use serde::Deserialize;

/// The most sources of one request for geodesic distances on a mesh.
const MOST_SOURCES: usize = 256;

/// How geodesic distances are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum GeodesicMethod {
    /// The heat method on the mesh, with the robust Laplacian: a percent or two off, milliseconds a source once the
    /// mesh is prepared.
    #[default]
    Heat,
    /// The lengths of shortest paths over the faces, to rounding.
    Exact,
    /// The heat method with both of its solves in the basis: some percent off, since a basis cannot resolve the tip of
    /// a cone.
    Spectral,
}

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
    /// Geodesic distance. Vertices that no path leads to are at an infinite distance, `null` in JSON, but for
    /// `spectral`, which cannot tell.
    Geodesic {
        /// How it is computed.
        #[serde(default)]
        #[cfg_attr(feature = "schema", schema(inline))]
        method: GeodesicMethod,
        /// How long heat flows, in length² of the mesh; without it, the square of the mean edge, and by `spectral` for
        /// each face the shortest of a ladder of times at which heat reaches it. Not for `exact`.
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
    #[error("give either sources or pairs, not both")]
    Between,
    /// There is nothing to measure from.
    #[error("give either sources or pairs; neither was given")]
    Nowhere,
    /// Nothing flows.
    #[error("time: exact geodesic distances take no time step")]
    Time,
    /// Pairs have no nearest source.
    #[error("nearest: goes with sources, not with pairs")]
    Nearest,
    /// Without a basis there are geodesic distances on the mesh alone.
    #[error("distance: without a basis, only geodesic distances by heat or exact ones can be computed")]
    NeedsBasis,
    /// The basis is of the inside of a solid, where shortest paths are straight as far as its surface lets them.
    #[error(
        "distance: geodesic distances run over surfaces, and the basis is of the inside of a solid; ask its mesh for those of its surface"
    )]
    Inside,
    /// The basis is of the combinatorial Laplacian, whose eigenvalues have no unit of length.
    #[error(
        "distance: eigenvalues of the combinatorial Laplacian have no unit of length; ask the mesh for geodesic distances"
    )]
    Unitless,
    /// A vertex, a time or the basis does not fit.
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    /// The basis does not say what its rows are.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
}

/// Distances, and how far they may be off.
#[derive(Debug, Clone)]
pub struct Distances {
    /// A row for each vertex or pair, a column for each source and, within it, each time.
    pub table: DenseMatrix,
    /// Of geodesic distances by heat, by how much their slope, which is one, differs from one, on average over the area
    /// that is reached or along paths to the sources: the largest of all sources. They are off by about this share of
    /// themselves or less.
    pub slope_error: Option<f64>,
}

impl From<DenseMatrix> for Distances {
    /// Distances that nothing is told of.
    fn from(table: DenseMatrix) -> Self {
        Self { table, slope_error: None }
    }
}

/// What geodesic distances on a mesh are computed with; it serves any number of requests.
#[derive(Debug)]
pub enum MeshDistances {
    /// Two factors.
    Heat(Box<HeatGeodesics>),
    /// The shapes of all faces, and who lies beside whom.
    Exact(ExactGeodesics),
}

impl MeshDistances {
    /// Prepares a mesh for a method; `None` for the one that needs a basis.
    ///
    /// # Errors
    /// [`AnalysisError`]: a time that is not above zero, a mesh that cannot be prepared, cancellation.
    pub fn new(
        mesh: &TriangleMesh,
        method: GeodesicMethod,
        time: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, AnalysisError> {
        if are_points(mesh) {
            return Err(AnalysisError::NoFaces);
        }
        Ok(match method {
            GeodesicMethod::Heat => Some(Self::Heat(HeatGeodesics::new(mesh, time, monitor)?.into())),
            GeodesicMethod::Exact => Some(Self::Exact(ExactGeodesics::new(mesh))),
            GeodesicMethod::Spectral => None,
        })
    }

    /// About the bytes that it takes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Heat(heat) => heat.bytes(),
            // Six faces around a vertex, three half-edges to a face.
            Self::Exact(exact) => 300 * exact.vertices() as u64,
        }
    }

    fn vertices(&self) -> usize {
        match self {
            Self::Heat(heat) => heat.vertices(),
            Self::Exact(exact) => exact.vertices(),
        }
    }

    /// Distances of all vertices from the nearest of each group: a column for each.
    fn nearest_of(&self, groups: &[&[u32]], monitor: &dyn Monitor) -> Result<Distances, AnalysisError> {
        match self {
            Self::Heat(heat) => {
                let found = heat.from_nearest(groups, monitor)?;
                let slope_error = found.slope_errors.iter().flatten().copied().reduce(f64::max);
                Ok(Distances { table: found.distances, slope_error })
            }
            Self::Exact(exact) => {
                let columns: Result<Vec<Vec<f64>>, _> =
                    groups.par_iter().map(|group| exact.from_nearest(group, monitor)).collect();
                Ok(DenseMatrix::from_columns(exact.vertices(), groups.len(), columns?.concat()).into())
            }
        }
    }
}

/// Checks that sources, or the vertices of pairs, are vertices.
fn check_vertices(
    what: &'static str,
    at: impl Iterator<Item = (usize, u32)>,
    vertices: usize,
) -> Result<(), AnalysisError> {
    match at.into_iter().find(|&(_, vertex)| vertex as usize >= vertices) {
        Some((place, vertex)) => Err(AnalysisError::Vertex { what, place, vertex, vertices }),
        None => Ok(()),
    }
}

/// Takes the distances of pairs out of those of all vertices from their first vertices, which `from` computes for each
/// once.
fn of_pairs(
    pairs: &[[u32; 2]],
    vertices: usize,
    from: impl FnOnce(&[u32]) -> Result<Distances, AnalysisError>,
) -> Result<Distances, AnalysisError> {
    check_vertices("pair", pairs.iter().enumerate().flat_map(|(k, pair)| pair.map(|v| (k, v))), vertices)?;
    let mut sources: Vec<u32> = pairs.iter().map(|pair| pair[0]).collect();
    sources.sort_unstable();
    sources.dedup();
    let all = from(&sources)?;
    let mut distances = DenseMatrix::zeros(pairs.len(), 1);
    for (slot, [a, b]) in distances.column_mut(0).iter_mut().zip(pairs) {
        let column = sources.partition_point(|source| source < a);
        *slot = all.table.column(column)[*b as usize];
    }
    Ok(Distances { table: distances, slope_error: all.slope_error })
}

impl DistanceRequest {
    /// Checks what neither mesh nor basis is needed for.
    ///
    /// # Errors
    /// [`DistanceFault::Between`], [`DistanceFault::Nowhere`], [`DistanceFault::Nearest`], [`DistanceFault::Time`].
    pub fn check(&self) -> Result<(), DistanceFault> {
        match (self.sources.is_empty(), self.pairs.is_empty()) {
            (true, true) => return Err(DistanceFault::Nowhere),
            (false, false) => return Err(DistanceFault::Between),
            (true, false) if self.nearest => return Err(DistanceFault::Nearest),
            _ => {}
        }
        match self.distance {
            DistanceKind::Geodesic { method: GeodesicMethod::Exact, time: Some(_) } => Err(DistanceFault::Time),
            _ => Ok(()),
        }
    }

    /// Whether the mesh is needed, beside or instead of the basis.
    pub fn needs_mesh(&self) -> bool {
        matches!(self.distance, DistanceKind::Geodesic { .. })
    }

    /// Refuses distances over a surface by a basis of the inside of a solid.
    ///
    /// # Errors
    /// [`DistanceFault::Inside`], [`DistanceFault::Unitless`], [`DistanceFault::Provenance`].
    pub fn check_basis(&self, basis: &Basis) -> Result<(), DistanceFault> {
        if !self.needs_mesh() {
            return Ok(());
        }
        match basis.metadata.rows_of()? {
            RowsOf::Solid => Err(DistanceFault::Inside),
            RowsOf::Graph => Err(DistanceFault::Unitless),
            RowsOf::Surface | RowsOf::Points | RowsOf::Fields | RowsOf::Matrix => Ok(()),
        }
    }

    /// How and for which time a mesh has to be [prepared](MeshDistances::new), where no basis is needed.
    pub fn on_mesh(&self) -> Option<(GeodesicMethod, Option<f64>)> {
        match self.distance {
            DistanceKind::Geodesic { method: GeodesicMethod::Spectral, .. } => None,
            DistanceKind::Geodesic { method, time } => Some((method, time)),
            _ => None,
        }
    }

    /// Geodesic distances on a mesh that was prepared: a row for each vertex or pair, a column for each source.
    ///
    /// # Errors
    /// [`DistanceFault`] names what does not fit, or says that it was cancelled.
    pub fn geodesics(&self, mesh: &MeshDistances, monitor: &dyn Monitor) -> Result<Distances, DistanceFault> {
        self.check()?;
        let vertices = mesh.vertices();
        let from = |sources: &[u32]| -> Result<Distances, AnalysisError> {
            if sources.len() > MOST_SOURCES {
                return Err(AnalysisError::Count {
                    what: "sources",
                    found: sources.len(),
                    least: 1,
                    most: MOST_SOURCES,
                });
            }
            let groups: Vec<&[u32]> = sources.chunks(1).collect();
            mesh.nearest_of(&groups, monitor)
        };
        if !self.pairs.is_empty() {
            return Ok(of_pairs(&self.pairs, vertices, from)?);
        }
        check_vertices("source", self.sources.iter().copied().enumerate(), vertices)?;
        Ok(if self.nearest { mesh.nearest_of(&[&self.sources], monitor)? } else { from(&self.sources)? })
    }

    /// A row for each vertex or pair, a column for each source and, within it, each time. What a mesh is needed for is
    /// prepared, and forgotten.
    ///
    /// # Errors
    /// [`DistanceFault`] names what does not fit.
    pub fn distances(
        &self,
        basis: &Basis,
        mesh: Option<&TriangleMesh>,
        monitor: &dyn Monitor,
    ) -> Result<Distances, DistanceFault> {
        self.check()?;
        self.check_basis(basis)?;
        let spectral = match &self.distance {
            DistanceKind::Diffusion { times: Some(times) } => SpectralDistance::Diffusion { times: times.clone() },
            DistanceKind::Diffusion { times: None } => {
                let first = kernel_size(&basis.eigenvalues)?;
                SpectralDistance::Diffusion { times: vec![0.5 / basis.eigenvalues[first]] }
            }
            DistanceKind::Biharmonic => SpectralDistance::Biharmonic,
            DistanceKind::CommuteTime => SpectralDistance::CommuteTime,
            DistanceKind::Geodesic { method, time } => {
                let mesh = mesh.ok_or(AnalysisError::Mesh { basis: basis.vertices(), mesh: 0 })?;
                if let Some(prepared) = MeshDistances::new(mesh, *method, *time, monitor)? {
                    return self.geodesics(&prepared, monitor);
                }
                if !self.pairs.is_empty() {
                    let from = |sources: &[u32]| Ok(geodesic(basis, mesh, sources, false, *time)?.into());
                    return Ok(of_pairs(&self.pairs, basis.vertices(), from)?);
                }
                return Ok(geodesic(basis, mesh, &self.sources, self.nearest, *time)?.into());
            }
        };
        if !self.pairs.is_empty() {
            return Ok(spectral.between(basis, &self.pairs)?.into());
        }
        let all = spectral.from_sources(basis, &self.sources)?;
        Ok(if self.nearest { nearest(&all, spectral.columns()) } else { all }.into())
    }
}
