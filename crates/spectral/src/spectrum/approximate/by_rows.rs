//! The space of an approximation a piece of the surface at a time: no one holds all of its columns, nor the whole
//! matrix.
//!
//! Pieces are the same whoever asks and however many parts there are, and so is the order in which what they give is
//! added up: all parts have the same restricted matrices, to the last bit. Of a single piece they are those of a space
//! in one piece. A part keeps the rows of the space that it measures with as they come by.

use chladni_base::parallel::*;

use super::super::domain::Domain;
use super::super::hats;
use super::super::heat::{self, Diffused};
use super::super::radial::{self, Profile};
use super::parts::divided;
use super::space::{DIJKSTRA_SUFFICES, EXACT_RATIO, FEW_ENTRIES, LLOYD_MOVES, SIGMA};
use super::stack::Stack;
use super::{ApproximationError, ApproximationParameters, Space};
use crate::operator::LaplacianByRows;
use chladni_algebra::{SparseMatrix, galerkin};
use chladni_base::{Monitor, Quiet};
use chladni_mesh::TriangleMesh;
use chladni_mesh::connected::Components;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::DistanceKind;
use chladni_mesh::sample::well_spread_points;

/// Entries on the diagonal that exceed this share of what makes a needle may do so by rounding.
const ALMOST: f64 = 0.99;

/// The vertices of a piece.
pub const ROWS_OF_PIECE: usize = 500_000;

/// What a whole space comes to, of which some rows are there.
pub(super) struct Restricted {
    /// `n × d`; rows that were not asked for are empty.
    pub space: SparseMatrix<f32>,
    /// `UᵀSU` and `UᵀMU`.
    pub stiffness: SparseMatrix,
    pub mass: SparseMatrix,
}

/// Prepares the columns that [`initial_space`](super::space::initial_space) makes. `parameters` tell afterwards how
/// they were made. `None` where they are made in one piece alone: where some vertices become columns by themselves.
pub(super) fn columns(
    problem: &LaplacianByRows<'_>,
    parameters: &mut ApproximationParameters,
    monitor: &dyn Monitor,
) -> Result<Option<Diffused>, ApproximationError> {
    let (mesh, n) = (problem.mesh(), problem.size());
    let d = parameters.dimension.max(parameters.count);
    let Space::Heat(of_heat) = parameters.space else { return Ok(None) };
    if !has_short_edges(problem, d) {
        return Ok(None);
    }
    monitor.stage("sampling");
    let mut connectivity = Connectivity::new(mesh);
    let dijkstra = n >= DIJKSTRA_SUFFICES * d;
    if dijkstra {
        connectivity.forget_faces();
    }
    monitor.checkpoint()?;
    let masses = problem.masses();
    let samples = well_spread_points(mesh, &connectivity, masses, d, LLOYD_MOVES, parameters.seed, monitor)?;
    monitor.stage("basis");
    let distance = if dijkstra { DistanceKind::Dijkstra } else { DistanceKind::FastMarching };
    let start = radial::grown(mesh, &connectivity, &samples, (distance, Profile::Cubic), SIGMA, monitor)?;
    connectivity.forget_faces();
    let far = start.entries() > FEW_ENTRIES * n;
    let of_heat = if far { of_heat.for_many_vertices() } else { of_heat };
    parameters.space = Space::Heat(of_heat);
    Ok(heat::smooth_by_rows(problem, connectivity, start, &of_heat, hats::STIFFEST as f32, monitor)?)
}

/// Whether the mesh has vertices enough for so many columns, and no edge that is longer than one of them is wide.
fn has_short_edges(problem: &LaplacianByRows<'_>, d: usize) -> bool {
    let n = problem.size() as f64;
    n >= EXACT_RATIO * d as f64 && !hats::has_long_edges(Domain::Surface(problem.mesh()), problem.area(), d)
}

/// Whether [`columns`] are made for sure: what is close to a needle is told to be one.
pub(super) fn are_made(problem: &LaplacianByRows<'_>, parameters: &ApproximationParameters) -> bool {
    let d = parameters.dimension.max(parameters.count);
    matches!(parameters.space, Space::Heat(_))
        && has_short_edges(problem, d)
        && problem.stiffest() < ALMOST * hats::STIFFEST
}

/// The restricted matrices of all columns, and those rows of them that are `kept`.
pub(super) fn restricted(
    problem: &LaplacianByRows<'_>,
    columns: &Diffused,
    rows_of_piece: usize,
    kept: &[bool],
    monitor: &dyn Monitor,
) -> Result<Restricted, ApproximationError> {
    let mut bare: Vec<u32> = Vec::new();
    loop {
        let (found, empty) = restricted_with_peaks(problem, columns, rows_of_piece, (kept, &bare), monitor)?;
        if empty.is_empty() || !bare.is_empty() {
            return Ok(found);
        }
        // Which columns are left with nothing is known when all rows were there.
        bare = empty;
    }
}

/// [`restricted`] with the peaks of some columns put back, and the columns that have no entry.
fn restricted_with_peaks(
    problem: &LaplacianByRows<'_>,
    columns: &Diffused,
    rows_of_piece: usize,
    (kept, bare): (&[bool], &[u32]),
    monitor: &dyn Monitor,
) -> Result<(Restricted, Vec<u32>), ApproximationError> {
    monitor.stage("reduce");
    let (mesh, n) = (problem.mesh(), problem.size());
    let pieces = n.div_ceil(rows_of_piece).max(1);
    let piece_of = divided(mesh, (n, None), pieces);
    let mut sums: Option<(SparseMatrix, SparseMatrix)> = None;
    let d = columns.columns();
    let mut own = Stack::new(n, d);
    let mut filled = vec![false; d];
    for piece in 0..pieces {
        monitor.checkpoint()?;
        if pieces > 1 {
            monitor.detail(&format!("piece {} of {pieces}", piece + 1));
        }
        monitor.progress(piece as f64 / pieces as f64);
        let is_own = |row: u32| piece_of[row as usize] == piece as u32;
        let rows: Vec<u32> = (0..n as u32).filter(|&row| is_own(row)).collect();
        let wanted = with_neighbours(mesh, is_own);
        let space = columns.rows(&wanted, bare, &Quiet(monitor))?;
        drop(wanted);
        space.indices().iter().for_each(|&column| filled[column as usize] = true);
        let of_rows = problem.problem_with(&rows, true);
        let (stiffness, mass) = galerkin(&space, &of_rows.stiffness, &of_rows.mass, &Quiet(monitor))?;
        drop(of_rows);
        sums = Some(match sums {
            None => (stiffness, mass),
            Some((of_stiffness, of_mass)) => (sum(&of_stiffness, &stiffness), sum(&of_mass, &mass)),
        });
        let rows: Vec<u32> = rows.into_iter().filter(|&row| kept[row as usize]).collect();
        let share = space.select_rows(&rows);
        own.push(rows, share);
    }
    monitor.progress(1.0);
    let empty = SparseMatrix::from_sorted_parts(d, d, vec![0; d + 1], Vec::new(), Vec::new());
    let (stiffness, mass) = sums.unwrap_or_else(|| (empty.clone(), empty));
    let found = Restricted { space: own.finish(), stiffness, mass };
    let empty = filled.iter().zip(0..).filter(|(filled, _)| !**filled).map(|(_, column)| column).collect();
    Ok((found, empty))
}

/// Which vertices are among some, or next to them.
pub(super) fn with_neighbours(mesh: &TriangleMesh, is_own: impl Fn(u32) -> bool) -> Vec<bool> {
    let mut all = vec![false; mesh.positions.len()];
    (0..all.len() as u32).filter(|&v| is_own(v)).for_each(|v| all[v as usize] = true);
    for face in &mesh.faces {
        if face.iter().any(|&v| is_own(v)) {
            face.iter().for_each(|&v| all[v as usize] = true);
        }
    }
    all
}

/// The sum of two matrices of one shape.
fn sum(a: &SparseMatrix, b: &SparseMatrix) -> SparseMatrix {
    SparseMatrix::from_rows(
        a.rows(),
        a.columns(),
        || (),
        |(), row, entries| {
            let ((columns, values), (others, more)) = (a.row(row), b.row(row));
            entries.extend(columns.iter().copied().zip(values.iter().copied()));
            entries.extend(others.iter().copied().zip(more.iter().copied()));
            // Stable: of two entries of one place the first comes first.
            entries.sort_by_key(|entry| entry.0);
            entries.dedup_by(|later, kept| {
                let same = later.0 == kept.0;
                if same {
                    kept.1 += later.1;
                }
                same
            });
        },
    )
}

/// The largest sum of magnitudes in a row of the stiffness over its mass, and other things that ask for each row once:
/// [`Survey::new`].
pub(super) struct Survey {
    /// `xᵀSx` and `xᵀMx` for some vectors.
    pub products: Vec<f64>,
    /// Stored numbers of the stiffness.
    pub entries: usize,
    /// On how many components constants are in the kernel.
    pub kernel: usize,
    /// The largest sum of magnitudes in a row over the mass of the row.
    pub largest: f64,
}

impl Survey {
    /// Goes over all rows once. `balanced` tells whether the sum of a row is zero, as far as rounding lets one tell.
    pub fn new(
        problem: &LaplacianByRows<'_>,
        vectors: &[Vec<f64>],
        balanced: impl Fn(&SparseMatrix, usize) -> bool + Sync,
        monitor: &dyn Monitor,
    ) -> Result<Self, ApproximationError> {
        let (n, masses) = (problem.size(), problem.masses());
        let mut products = vec![0.0; 2 * vectors.len()];
        let mut components = Components::new(n);
        let mut unbalanced = Vec::new();
        let (mut entries, mut largest) = (0, 0f64);
        for from in (0..n).step_by(ROWS_OF_PIECE) {
            monitor.checkpoint()?;
            let rows: Vec<u32> = (from as u32..n.min(from + ROWS_OF_PIECE) as u32).collect();
            let stiffness = problem.rows(&rows);
            entries += stiffness.entries();
            for (x, sums) in vectors.iter().zip(products.chunks_exact_mut(2)) {
                let images: Vec<f64> = (0..rows.len())
                    .into_par_iter()
                    .map(|at| {
                        let (columns, values) = stiffness.row(at);
                        x[from + at] * columns.iter().zip(values).map(|(&c, s)| s * x[c as usize]).sum::<f64>()
                    })
                    .collect();
                sums[0] += images.iter().sum::<f64>();
                sums[1] += (from..from + rows.len()).map(|row| x[row] * x[row] * masses[row]).sum::<f64>();
            }
            for at in 0..rows.len() {
                let (columns, values) = stiffness.row(at);
                let row = from + at;
                columns.iter().filter(|&&c| (c as usize) > row).for_each(|&c| components.join(row as u32, c));
                if !balanced(&stiffness, at) {
                    unbalanced.push(row as u32);
                }
                let size = values.iter().map(|value| value.abs()).sum::<f64>() / masses[row];
                largest = largest.max(if size.is_finite() { size } else { 0.0 });
            }
        }
        let mut is_kernel = vec![false; n];
        components.roots().for_each(|row| is_kernel[row] = true);
        for row in unbalanced {
            is_kernel[components.root(row) as usize] = false;
        }
        let kernel = is_kernel.into_iter().filter(|&is| is).count();
        Ok(Self { products, entries, kernel, largest })
    }
}

#[cfg(test)]
#[path = "by_rows_tests.rs"]
mod tests;
