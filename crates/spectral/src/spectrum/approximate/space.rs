//! The space: locally supported functions, and hat functions where those are too coarse.

use super::super::domain::Domain;
use super::super::envelope::envelop;
use super::super::radial::{self, Profile};
use super::super::{hats, heat};
use super::{ApproximationError, ApproximationParameters, Space};
use crate::operator::{EigenProblem, MeshOperator};
use chladni_algebra::SparseMatrix;
use chladni_base::Monitor;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::DistanceKind;
use chladni_mesh::sample::well_spread_points;
use chladni_mesh::{TetMesh, TriangleMesh};

/// The overlap of supports, `σ`: the thesis takes 7 to 10.
pub(super) const SIGMA: f64 = 10.0;

/// Moves of the samples toward the centroids of their cells: three of them take 15 % off the error.
pub(super) const LLOYD_MOVES: usize = 3;

/// Below this many vertices per dimension a mesh is solved exactly, in the space of all its hat functions: local
/// functions of so few vertices would be close to dependent, and the dense problem is hardly larger.
pub(super) const EXACT_RATIO: f64 = 1.5;

/// Rows of more entries than this are those of functions that reach everywhere, on what is no surface. They do not
/// diffuse for longer.
pub(super) const FEW_ENTRIES: usize = 25;

/// The space that the approximation begins with: local functions, and hat functions where those are too coarse.
/// `parameters` tell afterwards how the functions were made.
pub(super) fn initial_space(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &mut ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, ApproximationError> {
    let (space, made) = functions(domain, operator, parameters, monitor)?;
    parameters.space = made;
    let n = operator.problem.size();
    if !matches!(parameters.space, Space::Heat(_)) || space.columns() >= n {
        return Ok(space);
    }
    let d = parameters.dimension.max(parameters.count);
    let rows = hats::too_coarse(domain, operator.laplacian(), d, d);
    let rows = match &operator.problem.unknowns {
        Some(unknowns) => unknowns.iter().map(|&v| rows[v as usize]).collect(),
        None => rows,
    };
    let chosen = rows.iter().filter(|&&chosen| chosen).count();
    if chosen == 0 {
        return Ok(space);
    }
    if (n as f64) < EXACT_RATIO * (d + chosen) as f64 && n <= 2 * d {
        return Ok(SparseMatrix::identity(n));
    }
    let with_hats = hats::with_hats(&space, &rows);
    // What hats leave of other columns may ask for more of them; memory is promised for so many.
    Ok(if with_hats.columns() <= most_initial_columns(n, d) { with_hats } else { space })
}

/// The columns that a space of a dimension begins with at most on a mesh of `n` vertices: those of its samples, and as
/// many hat functions; but for one in each component that has no sample.
pub fn most_initial_columns(n: usize, dimension: usize) -> usize {
    (radial::most_columns(dimension) + dimension).min(n)
}

/// The space `U` of about `dimension` locally supported functions on the unknowns: its rows have the sum 1, or that of
/// the envelope. A mesh of fewer than `1.5 d` unknowns gets all its hat functions.
///
/// # Errors
/// [`ApproximationError`]: a mesh without area, or cancellation.
pub fn subspace<'a>(
    domain: impl Into<Domain<'a>>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, ApproximationError> {
    let domain = domain.into();
    match domain {
        Domain::Surface(_) => functions(domain, operator, parameters, monitor),
        Domain::Solid(_) => functions(domain, &operator.on_unit_volume(), parameters, monitor),
    }
    .map(|(space, _)| space)
}

/// [`subspace`], and how it was made.
fn functions(
    domain: Domain<'_>,
    operator: &MeshOperator,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix<f32>, Space), ApproximationError> {
    let (n, d) = (operator.problem.size(), parameters.dimension.max(parameters.count));
    if (n as f64) < EXACT_RATIO * d as f64 {
        return Ok((SparseMatrix::identity(n), parameters.space));
    }
    let (space, made) = local_functions(domain, operator.laplacian(), d, parameters, monitor)?;
    Ok((envelop(domain, space, operator, monitor)?, made))
}

/// Locally supported functions on all vertices, rows with sum 1, and how they were made. They follow the Laplacian,
/// whatever the operator.
fn local_functions(
    domain: Domain<'_>,
    laplacian: &EigenProblem,
    d: usize,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix<f32>, Space), ApproximationError> {
    let mesh = match domain {
        Domain::Surface(mesh) => mesh,
        Domain::Solid(solid) => return in_solid(solid, laplacian, d, parameters, monitor),
    };
    monitor.stage("sampling");
    let connectivity = Connectivity::new(mesh);
    monitor.checkpoint()?;
    match &parameters.space {
        Space::Radial(radial) => {
            Ok((radial::space(mesh, &connectivity, d, parameters.seed, radial, monitor)?, parameters.space))
        }
        Space::Heat(heat) => {
            let masses = laplacian.mass.lumped();
            let samples = well_spread_points(mesh, &connectivity, &masses, d, LLOYD_MOVES, parameters.seed, monitor)?;
            drop(masses);
            monitor.stage("basis");
            // Edge paths are as good a start as fast marching where a support holds many vertices, and cheaper.
            let far = mesh.positions.len() >= DIJKSTRA_SUFFICES * d;
            let distance = if far { DistanceKind::Dijkstra } else { DistanceKind::FastMarching };
            let start = radial::columns(mesh, &connectivity, &samples, distance, Profile::Cubic, SIGMA, monitor)?;
            let far = start.entries() > FEW_ENTRIES * mesh.positions.len();
            let heat = if far { heat.for_many_vertices() } else { *heat };
            Ok((heat::smooth(mesh, laplacian, connectivity, start, &heat, monitor)?, Space::Heat(heat)))
        }
    }
}

/// The same in a solid, whose `laplacian` is on unit volume.
fn in_solid(
    solid: &TetMesh,
    laplacian: &EigenProblem,
    d: usize,
    parameters: &ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<(SparseMatrix<f32>, Space), ApproximationError> {
    let Space::Heat(heat) = parameters.space else {
        let reason = "functions of the distance alone err by half of an eigenvalue in solids; use heat".to_owned();
        return Err(ApproximationError::Parameter { name: "space", reason });
    };
    monitor.stage("sampling");
    let connectivity = Connectivity::of_solid(solid);
    // Edges are all that samples and distances ask for.
    let vertices = TriangleMesh { positions: solid.positions.clone(), faces: Vec::new(), ..Default::default() };
    monitor.checkpoint()?;
    let masses = laplacian.mass.lumped();
    let samples = well_spread_points(&vertices, &connectivity, &masses, d, LLOYD_MOVES, parameters.seed, monitor)?;
    monitor.stage("basis");
    let radius = REACH_IN_SOLID * (laplacian.area / (samples.len().max(1) as f64).powf(2.0 / 3.0)).sqrt();
    let inside = (4.0 / 3.0 * std::f64::consts::PI * REACH_IN_SOLID.powi(3), radius);
    let (kind, profile) = (DistanceKind::Dijkstra, Profile::Cubic);
    let start = radial::columns_within(&vertices, &connectivity, &samples, kind, profile, inside, monitor)?;
    drop(vertices);
    let smooth = heat::smooth_in_solid(laplacian, &connectivity, &start, &heat.in_solid(), monitor)?;
    Ok((smooth, parameters.space))
}

/// The support of a function in a solid over the width of a cell, before it diffuses. With less than 1.5 columns that
/// have diffused are 40 % worse, with 2.2 a tenth better for a tenth more entries.
const REACH_IN_SOLID: f64 = 1.8;

/// From this many vertices per sample on, Dijkstra's distances start the heat steps as well as those of fast marching.
pub(super) const DIJKSTRA_SUFFICES: usize = 500;
