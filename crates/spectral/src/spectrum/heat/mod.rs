//! The heat-smoothed construction: radial columns, diffused for a short time, make a subspace whose Ritz values err by
//! a few tenths of a percent where the radial columns alone err by a few percent.
//!
//! On the surface scaled to unit area, with `d` columns:
//! 1. every column `u` of the partition of unity becomes `(M + τS)⁻¹M … (M + τS)⁻¹M u`, `steps` implicit heat steps;
//! 2. small entries are shrunk smoothly to zero (a hard cut costs ten times the error at the same number of entries);
//! 3. rows are normalised to a partition of unity again.
//!
//! A fine mesh is coarsened first (`level`), the columns are diffused on the coarse level (`panel`), and local
//! smoothing on the way back removes what the coarse level cannot represent.

mod assemble;
mod coarsen;
mod level;
mod panel;
mod piecewise;
mod polish;
mod shrink;
mod solid;
#[cfg(test)]
mod tests;

use std::borrow::Borrow;

use chladni_base::parallel::*;

use super::peaks::{NO_PEAK, Peaks};
use super::radial::Grown;
use crate::operator::{EigenProblem, LaplacianByRows};
use chladni_algebra::SparseMatrix;
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;

use assemble::DroppingRule;
use coarsen::{Coarsening, Surface};
use level::HeatLevel;
pub(super) use piecewise::Diffused;
pub use solid::smooth_in_solid;

/// A level of at most so many vertices a column is coarse enough to take heat steps on. Measured: with a third of that
/// the error of the eigenvalues grows by a half.
const COARSE_RATIO: f64 = 70.0;

/// Levels above the mesh, at most.
const MOST_LEVELS: usize = 8;

/// Entries below this share of the threshold are dropped on coarse levels: what is shrunk away in the end need not be
/// carried.
const COARSE_DROP: f64 = 0.3;

/// What removes the kinks of linear interpolation. Degree 3 is nearly as good, degree 10 takes another third off the
/// error but spreads the columns.
const SMOOTHER: polish::Smoother = polish::Smoother { degree: 4, least: 0.2, block: 500 };

/// How columns are smoothed; lengths and times are relative to the surface of unit area and the number of columns `d`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct HeatParameters {
    /// Implicit heat steps, at least 1.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 32))]
    pub steps: usize,
    /// The time of one step times `d`.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 10))]
    pub time: f64,
    /// A column may spread beyond its support by this multiple of `√(steps · time / d)`.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 20))]
    pub margin: f64,
    /// Entries below this are dropped after the diffusion.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 0.01))]
    pub drop: f64,
    /// Entries at or below this become zero, larger ones `x` become `(x − threshold)²/x`.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 0.2))]
    pub threshold: f64,
    /// Relative residual at which the solve of a heat step ends.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 0.5))]
    pub tolerance: f64,
}

impl Default for HeatParameters {
    fn default() -> Self {
        Self { steps: 4, time: 0.05, margin: 2.5, drop: 1e-4, threshold: 0.003, tolerance: 3e-3 }
    }
}

impl HeatParameters {
    /// Heat steps solved more closely and a little less thinning; meant for `d = 3m`.
    pub fn accurate() -> Self {
        Self { threshold: 0.002, tolerance: 1e-3, ..Self::default() }
    }

    /// The usual parameters, [`Self::default`] or [`Self::accurate`], for cells of few vertices: twice the steps, and
    /// next to no thinning. A column of a dozen vertices that has diffused for less than the square of an edge, or is
    /// cut off early, is a step, and a limb or a crowd of thin triangles is missed by several percent; the longer rows
    /// cost little there, beside the dense part. `None` for parameters that somebody chose.
    pub fn for_few_vertices(self) -> Option<Self> {
        (self == Self::default() || self == Self::accurate()).then_some(Self {
            steps: 8,
            margin: 4.0,
            threshold: 2e-4,
            ..self
        })
    }

    /// The usual parameters that [`Self::for_few_vertices`] was made from; others as they are.
    pub(crate) fn for_many_vertices(self) -> Self {
        [Self::default(), Self::accurate()]
            .into_iter()
            .find(|usual| usual.for_few_vertices() == Some(self))
            .unwrap_or(self)
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`HeatError::Parameter`] names the first that is outside.
    pub fn check(&self) -> Result<(), HeatError> {
        let parameter = |name, value: f64, least: f64, most: f64| {
            if value >= least && value <= most {
                Ok(())
            } else {
                Err(HeatError::Parameter { name, value, least, most })
            }
        };
        parameter("steps", self.steps as f64, 1.0, 32.0)?;
        parameter("time", self.time, 1e-6, 10.0)?;
        parameter("margin", self.margin, 0.0, 20.0)?;
        parameter("drop", self.drop, 0.0, 0.01)?;
        parameter("threshold", self.threshold, 0.0, 0.2)?;
        parameter("tolerance", self.tolerance, 1e-6, 0.5)
    }
}

/// Why columns could not be smoothed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HeatError {
    /// A parameter is out of its range.
    #[error("heat parameter {name} is {value}, not in {least}..={most}")]
    Parameter {
        /// The name of the parameter.
        name: &'static str,
        /// What was asked for.
        value: f64,
        /// The least allowed value.
        least: f64,
        /// The largest allowed value.
        most: f64,
    },
    /// The inputs are not of one mesh.
    #[error("the eigenproblem has {problem} vertices, the mesh {mesh}, the columns {columns}")]
    Shape {
        /// Rows of the stiffness matrix.
        problem: usize,
        /// Vertices of the connectivity.
        mesh: usize,
        /// Rows of the columns.
        columns: usize,
    },
    /// A row of the initial columns is empty or does not sum to a positive finite number.
    #[error("vertex {vertex} is outside every column")]
    Uncovered {
        /// The first such vertex.
        vertex: usize,
    },
    /// A column has no entry.
    #[error("column {column} has no entry")]
    EmptyColumn {
        /// The first such column.
        column: usize,
    },
    /// A stiffness entry, mass or area is not finite, or the area is not positive.
    #[error("row {row} of the eigenproblem holds a value that is not finite")]
    NotFinite {
        /// The offending row.
        row: usize,
    },
    /// The monitor asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Smooths `columns` (`n × d`, rows sum to 1) by heat steps and returns the final `n × d` matrix.
///
/// `problem` is the eigenproblem of `mesh` on unit area, `connectivity` its edges. Every row of the result sums to 1
/// and every column has an entry; negative entries are cut. The result does not depend on the number of threads. A
/// consistent mass is used lumped: only the smoothness of the columns depends on it, not the exactness of what is
/// computed with them later.
///
/// # Errors
/// [`HeatError`] names what is wrong with the parameters or the inputs, or says that the monitor cancelled.
pub fn smooth(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    connectivity: impl Borrow<Connectivity>,
    columns: impl Borrow<SparseMatrix<f32>>,
    parameters: &HeatParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, HeatError> {
    parameters.check()?;
    let (n, d) = (columns.borrow().rows(), columns.borrow().columns());
    if problem.stiffness.rows() != n || connectivity.borrow().vertices() != n || mesh.positions.len() != n {
        let (problem, mesh) = (problem.stiffness.rows(), connectivity.borrow().vertices());
        return Err(HeatError::Shape { problem, mesh, columns: n });
    }
    let peaks = peaks(columns.borrow())?;
    monitor.checkpoint()?;
    let level = HeatLevel::finest(problem, connectivity.borrow())?;
    // What is given away is let go of as soon as it has served: of millions of vertices it is a good part of what there
    // is.
    drop(connectivity);
    let rows = move |vertices: Option<&[u32]>| match vertices {
        Some(vertices) => columns.borrow().select_rows(vertices),
        None => columns.borrow().clone(),
    };
    let start = Start { peaks, d, rows };
    Ok(diffused((mesh, problem.area), level, start, parameters, monitor)?.all(monitor)?)
}

/// The same of columns that are not put in rows, and a problem without its matrix; what comes out makes the rows that
/// are asked for. `connectivity` needs no faces. `None` where some entry on the diagonal of the stiffness exceeds
/// `most`.
///
/// # Errors
/// As [`smooth`].
pub(super) fn smooth_by_rows(
    problem: &LaplacianByRows<'_>,
    connectivity: Connectivity,
    columns: Grown,
    parameters: &HeatParameters,
    most: f32,
    monitor: &dyn Monitor,
) -> Result<Option<Diffused>, HeatError> {
    parameters.check()?;
    let (n, d) = (columns.rows(), columns.columns());
    if problem.size() != n || connectivity.vertices() != n {
        return Err(HeatError::Shape { problem: problem.size(), mesh: connectivity.vertices(), columns: n });
    }
    if let Some(vertex) = columns.uncovered() {
        return Err(HeatError::Uncovered { vertex });
    }
    let (mut vertices, mut heights) = (Vec::with_capacity(d), Vec::with_capacity(d));
    for column in 0..d {
        let (height, vertex) = columns.peak(column).ok_or(HeatError::EmptyColumn { column })?;
        heights.push(height);
        vertices.push(vertex);
    }
    monitor.checkpoint()?;
    let level = HeatLevel::finest_by_rows(problem, connectivity)?;
    if level.diagonal.iter().any(|&entry| entry > most) {
        return Ok(None);
    }
    let rows = move |vertices: Option<&[u32]>| match vertices {
        Some(vertices) => columns.select_rows(vertices),
        None => columns.select_rows(&(0..n as u32).collect::<Vec<u32>>()),
    };
    let start = Start { peaks: Peaks { rows: vertices, heights }, d, rows };
    Ok(Some(diffused((problem.mesh(), problem.area()), level, start, parameters, monitor)?))
}

/// The columns that diffuse.
struct Start<R> {
    peaks: Peaks,
    /// How many there are.
    d: usize,
    /// Their rows at some vertices, or at all.
    rows: R,
}

/// Columns that have diffused on a coarse level of the mesh. What makes their rows is let go of before the way back.
fn diffused(
    (mesh, area): (&TriangleMesh, f64),
    mut level: HeatLevel,
    start: Start<impl Fn(Option<&[u32]>) -> SparseMatrix<f32>>,
    parameters: &HeatParameters,
    monitor: &dyn Monitor,
) -> Result<Diffused, HeatError> {
    let Start { peaks: Peaks { rows: peaks, heights }, d, rows } = start;
    let heat = panel::Heat {
        steps: parameters.steps,
        time: (parameters.time / d.max(1) as f64) as f32,
        margin: (parameters.margin * (parameters.steps as f64 * parameters.time / d.max(1) as f64).sqrt()) as f32,
        dropping: DroppingRule::positive(parameters.drop as f32),
        tolerance: parameters.tolerance as f32,
    };
    let origin = mesh.points().first().copied().unwrap_or_default();
    let unit = 1.0 / area.sqrt();
    let positions: Vec<[f32; 3]> = mesh.points().iter().map(|&p| ((p - origin) * unit).map(|x| x as f32)).collect();
    let surface = Surface { positions: &positions, triangles: &mesh.faces };
    if level.is_stiff() {
        level.take_weights(surface);
    }
    let mut hierarchy = coarsen(&level, surface, &peaks, d, monitor)?;
    drop(positions);
    let Some(coarsest) = hierarchy.last() else {
        let spread = panel::diffuse(&level, &rows(None), &peaks, &heat, monitor)?;
        let mut result = shrink::shrink(&spread, parameters.drop as f32, parameters.threshold as f32);
        shrink::refill_columns(&mut result, &spread, d);
        return Ok(Diffused::done(result));
    };
    // The fine vertex of every coarse one, and the coarse vertex of every peak.
    let mut vertices = coarsest.seeds.clone();
    for coarsening in hierarchy.iter().rev().skip(1) {
        vertices.iter_mut().for_each(|v| *v = coarsening.seeds[*v as usize]);
    }
    let mut tops = peaks.clone();
    for coarsening in &hierarchy {
        tops.iter_mut().for_each(|v| *v = coarsening.cells[*v as usize]);
    }
    let initial = rows(Some(&vertices));
    drop(rows);
    let coarse_drop = (COARSE_DROP * parameters.threshold).max(parameters.drop) as f32;
    let heat = panel::Heat { dropping: DroppingRule::positive(coarse_drop), ..heat };
    let mut spread = panel::diffuse(&coarsest.level, &initial, &tops, &heat, monitor)?;
    let thinning = polish::Thinning { drop: coarse_drop, threshold: 0.0 };
    while hierarchy.len() > 1
        && let Some(coarsening) = hierarchy.pop()
        && let Some(finer) = hierarchy.last()
    {
        spread = polish::prolong(&finer.level, &coarsening, &spread, &SMOOTHER, &thinning, monitor)?;
    }
    let thinning = polish::Thinning { drop: parameters.drop as f32, threshold: parameters.threshold as f32 };
    match hierarchy.pop() {
        Some(first) => Ok(Diffused::on_level((level, first), spread, SMOOTHER, thinning, (peaks, heights))),
        None => Ok(Diffused::done(spread)),
    }
}

/// Coarser and coarser levels until one has at most [`COARSE_RATIO`] vertices a column.
fn coarsen(
    level: &HeatLevel,
    surface: Surface,
    peaks: &[u32],
    d: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<Coarsening>, Cancelled> {
    let mut hierarchy: Vec<Coarsening> = Vec::new();
    let mut forced = peaks.to_vec();
    loop {
        let fine = hierarchy.last().map_or(level, |c| &c.level);
        let surface = hierarchy.last().map_or(surface, Coarsening::surface);
        let n = fine.vertices();
        let ratio = n as f64 / d.max(1) as f64;
        if ratio <= COARSE_RATIO || hierarchy.len() == MOST_LEVELS {
            return Ok(hierarchy);
        }
        // Cells of one hop hold about 4 vertices, of two about 9.
        let hops = if ratio > 5.0 * COARSE_RATIO { 2 } else { 1 };
        let reach = (1.4 * hops as f64 * (1.15 / n as f64).sqrt()) as f32;
        let coarsening = Coarsening::new(fine, surface, hops, reach, &forced, monitor)?;
        if coarsening.seeds.len() * 3 > n * 2 {
            return Ok(hierarchy);
        }
        forced.iter_mut().for_each(|v| *v = coarsening.cells[*v as usize]);
        hierarchy.push(coarsening);
    }
}

/// The largest entry of every column, where every column has one and every row is covered.
fn peaks(columns: &SparseMatrix<f32>) -> Result<Peaks, HeatError> {
    let is_bare = |&row: &usize| {
        let sum: f32 = columns.row(row).1.iter().fold(0.0, |sum, value| sum + value);
        !(sum > 0.0 && sum.is_finite())
    };
    if let Some(vertex) = (0..columns.rows()).into_par_iter().find_first(is_bare) {
        return Err(HeatError::Uncovered { vertex });
    }
    let peaks = Peaks::of(columns);
    match peaks.rows.iter().position(|&row| row == NO_PEAK) {
        Some(column) => Err(HeatError::EmptyColumn { column }),
        None => Ok(peaks),
    }
}
