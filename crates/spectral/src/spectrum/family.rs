//! Restricting a family of operators to one subspace.
//!
//! The space is spanned by the lowest eigenfunctions of a few members, the anchors. Between two anchors eigenfunctions
//! turn into each other smoothly, so that the span of theirs holds those of every member between to a few hundredths of
//! a percent in the eigenvalues, where as many local functions of the Laplacian, which know nothing of where a surface
//! bends, err by percents.

use chladni_algebra::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, SymmetricDefiniteSolver, Weight, gpu,
    gram as gram_of, independent_columns, inner_products, restrict,
};
use chladni_base::{Monitor, Quiet};
use chladni_mesh::TriangleMesh;
use serde_json::json;

use super::approximate::ritz;
use super::hsim::{self, HsimError, HsimParameters, Wanted};
use super::refine::inverse_iterations;
use super::restricted::Ritz;
use super::{ApproximationError, ApproximationParameters, Space};
use crate::basis::family::FamilyBasis;
use crate::operator::{EigenProblem, FamilyOperators};
use crate::spectrum::heat::HeatParameters;

/// `(t, v)` of the members whose eigenfunctions span the space. Where the operator follows the normals a little, its
/// spectrum changes fastest; strong potentials confine eigenfunctions to where the surface is flat, step by step.
pub const ANCHORS: [[f64; 2]; 6] = [[0.0, 0.0], [0.08, 0.0], [0.3, 0.0], [1.0, 0.0], [0.0, 3.0], [0.0, 20.0]];

/// Pairs that are computed of each anchor, over its share of the dimension: some turn out to be dependent on those of
/// others.
const SURPLUS: f64 = 1.1;

/// The residual to which the pairs of an anchor are computed.
const TOLERANCE: f64 = 1e-2;

/// Inverse iterations for an anchor that the solver gives no answer for.
const ITERATIONS: usize = 4;

/// A column that is nearer to the span of the others than this share of its own length is left out.
const DEPENDENT: f64 = 1e-4;

/// Below this many vertices per dimension the space is that of all functions on the mesh.
const EXACT_RATIO: f64 = 1.5;

/// Restricts the Laplacian, the extrinsic operator and the curvature potential to a space of at most `dimension`
/// functions, or of all functions where the mesh has fewer than `1.5 dimension` vertices. The metadata tell of the
/// anchors.
///
/// An equal share of the dimension belongs to each anchor; spectra are accurate up to about three quarters of that many
/// pairs.
///
/// Stages: `anchors`, `reduce`, `eigen`.
///
/// # Errors
/// [`ApproximationError`]: a numerical failure, or cancellation.
pub fn restrict_family(
    mesh: &TriangleMesh,
    operators: &FamilyOperators,
    dimension: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<FamilyBasis, ApproximationError> {
    monitor.stage("anchors");
    let problem = &operators.laplacian.problem;
    let n = problem.size();
    let (columns, anchors) = if (n as f64) < EXACT_RATIO * dimension as f64 {
        (identity(n), json!([]))
    } else {
        anchored(mesh, operators, dimension, seed, monitor)?
    };
    monitor.stage("reduce");
    let (eigenvalues, columns) = ritz_pairs(problem, columns, usize::MAX, monitor)?;
    monitor.progress(0.4);
    let mass = &problem.mass;
    let (mut extrinsic, _) = restrict(&operators.extrinsic, mass, &columns, monitor)?;
    monitor.progress(0.8);
    let mut curvature = inner_products(&columns, Weight::Mass(&operators.curvature), &columns, monitor)?;
    let (scale, length) = (problem.area.recip(), problem.area.sqrt().recip());
    for matrix in [&mut extrinsic, &mut curvature] {
        matrix.values_mut().iter_mut().for_each(|x| *x *= scale);
        symmetrise(matrix);
    }
    let mut functions = vec![0f32; n * eigenvalues.len()];
    for (column, to) in functions.chunks_exact_mut(n.max(1)).enumerate() {
        let panel = &columns.panels()[column / PANEL_WIDTH];
        let from = panel.iter().skip(column % PANEL_WIDTH).step_by(PANEL_WIDTH);
        to.iter_mut().zip(from).for_each(|(to, from)| *to = (from * length) as f32);
    }
    Ok(FamilyBasis {
        functions,
        eigenvalues: eigenvalues.into_iter().map(|value| value * scale).collect(),
        extrinsic,
        curvature,
        mass: MassMatrix::Diagonal(mass.scaled(problem.area).lumped()),
        metadata: json!({ "anchors": anchors }),
    })
}

/// The lowest eigenfunctions of the anchors, independent of each other, `n × d`; and what is told of them.
fn anchored(
    mesh: &TriangleMesh,
    operators: &FamilyOperators,
    dimension: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<(PanelMatrix, serde_json::Value), ApproximationError> {
    let n = operators.laplacian.problem.size();
    let count = ((SURPLUS * dimension as f64 / ANCHORS.len() as f64).ceil() as usize).clamp(1, n);
    let mut columns = PanelMatrix::zeros(n, 0);
    // The place of each column in the spectrum of its anchor.
    let mut places: Vec<usize> = Vec::new();
    let mut told = Vec::new();
    for (k, [t, v]) in ANCHORS.into_iter().enumerate() {
        monitor.progress(k as f64 / ANCHORS.len() as f64);
        monitor.detail(&format!("extrinsic {t}, curvature {v}"));
        let problem = member(operators, t, v);
        let parameters =
            HsimParameters { wanted: Wanted::Count(count), tolerance: TOLERANCE, seed, ..HsimParameters::default() };
        let (found, method) = match hsim::solve(mesh, &problem, &parameters, false, &Quiet(monitor)) {
            Ok(pairs) => (pairs.vectors, "hsim"),
            Err(HsimError::Cancelled(cancelled)) => return Err(cancelled.into()),
            // No pair has to be proven: whatever is near the lowest ones spans a good space.
            Err(_) => {
                let start = if k == 0 { local(mesh, operators, 2 * count, seed, monitor)? } else { columns.clone() };
                (improved(&problem, start, count, monitor)?, "inverse_iteration")
            }
        };
        told.push(json!({"extrinsic": t, "curvature": v, "pairs": found.columns(), "method": method}));
        let before = columns.columns();
        columns.widen(before + found.columns());
        columns.assign(&(before..before + found.columns()).collect::<Vec<_>>(), &found);
        places.extend(0..found.columns());
    }
    // The lowest functions of every anchor first, so that the highest are what does not fit.
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&column| places[column]);
    let mut kept =
        independent_columns(&gram_of(&operators.laplacian.problem.mass, &columns.select(&order), monitor)?, DEPENDENT);
    kept.truncate(dimension);
    kept.iter_mut().for_each(|column| *column = order[*column]);
    Ok((columns.select(&kept), told.into()))
}

/// `(1 − t) S + t A + v V`.
fn member(operators: &FamilyOperators, t: f64, v: f64) -> EigenProblem {
    let problem = &operators.laplacian.problem;
    let (stiffness, potential) = (&problem.stiffness, operators.curvature.lumped());
    let mut values: Vec<f64> =
        stiffness.values().iter().zip(operators.extrinsic.values()).map(|(s, a)| (1.0 - t) * s + t * a).collect();
    for (row, potential) in potential.iter().enumerate() {
        if let Ok(at) = stiffness.row(row).0.binary_search(&(row as u32)) {
            values[stiffness.offsets()[row] + at] += v * potential;
        }
    }
    let (offsets, indices) = (stiffness.offsets().to_vec(), stiffness.indices().to_vec());
    let stiffness = SparseMatrix::from_sorted_parts(stiffness.rows(), stiffness.columns(), offsets, indices, values);
    EigenProblem { stiffness, ..problem.clone() }
}

/// The lowest Ritz pairs, `M`-orthonormal, in the span of some columns, `count` at most; columns that depend on the
/// others are left out.
fn ritz_pairs(
    problem: &EigenProblem,
    columns: PanelMatrix,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<(Vec<f64>, PanelMatrix), ApproximationError> {
    let kept = independent_columns(&gram_of(&problem.mass, &columns, monitor)?, DEPENDENT);
    let mut columns = if kept.len() == columns.columns() { columns } else { columns.select(&kept) };
    let accelerator = gpu::accelerator();
    let (stiffness, gram, resident) = accelerator.restrict(&problem.stiffness, &problem.mass, &columns, monitor)?;
    let pairs = accelerator.lowest(stiffness, gram, count.min(kept.len()), &Quiet(monitor))?;
    accelerator.rotate(&mut columns, resident, &pairs.vectors, monitor)?;
    Ok((pairs.values, columns))
}

/// Columns near the lowest eigenfunctions, by inverse iterations from the lowest Ritz pairs in the span of others.
fn improved(
    problem: &EigenProblem,
    start: PanelMatrix,
    count: usize,
    monitor: &dyn Monitor,
) -> Result<PanelMatrix, ApproximationError> {
    let (values, columns) = ritz_pairs(problem, start, count, monitor)?;
    inverse_iterations(problem, columns, &values, ITERATIONS, &Quiet(monitor))
}

/// The lowest Ritz vectors of the Laplacian in a space of local functions.
fn local(
    mesh: &TriangleMesh,
    operators: &FamilyOperators,
    dimension: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<PanelMatrix, ApproximationError> {
    let space = Space::Heat(HeatParameters::default());
    let count = dimension / 2;
    let mut parameters = ApproximationParameters { count, dimension, space, goal: None, certify: false, seed };
    let Ritz { space, pairs, .. } = ritz(mesh.into(), &operators.laplacian, &mut parameters, count, &Quiet(monitor))?;
    Ok(gpu::accelerator().lift(&space, &pairs.vectors, monitor)?)
}

fn identity(n: usize) -> PanelMatrix {
    let mut columns = PanelMatrix::zeros(n, n);
    for (k, panel) in columns.panels_mut().iter_mut().enumerate() {
        let rows = panel.chunks_exact_mut(PANEL_WIDTH).skip(k * PANEL_WIDTH).take(PANEL_WIDTH);
        rows.enumerate().for_each(|(lane, row)| row[lane] = 1.0);
    }
    columns
}

fn symmetrise(matrix: &mut DenseMatrix) {
    for column in 0..matrix.columns() {
        for row in column + 1..matrix.rows() {
            let mean = 0.5 * (matrix.column(column)[row] + matrix.column(row)[column]);
            matrix.column_mut(column)[row] = mean;
            matrix.column_mut(row)[column] = mean;
        }
    }
}
