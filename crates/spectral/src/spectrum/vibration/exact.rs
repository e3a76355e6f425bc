//! Modes to a residual, by HSIM.
//!
//! HSIM knows the kernel of a scalar operator, the constants, not rigid motions. So it is given the problem shifted by
//! the lowest elastic eigenvalue, in units of it: rigid motions are then modes like others, with the value 1, and every
//! residual is relative. What comes out for them is replaced by what is known exactly. Modes come from a Krylov space,
//! or where that does not hold them from refined approximate ones.

use std::iter;

use chladni_algebra::{
    DenseMatrix, MassMatrix, PanelMatrix, SparseMatrix, Weight, inner_products, subtract_combinations,
};
use chladni_mesh::TriangleMesh;

use super::approximate::modes as approximate;
use super::{
    ElasticBody, ElasticProblem, FoundFunctions, Iterations, Monitor, NonrigidModes, RigidMotions, VibrationError,
    refined, space,
};
use crate::operator::EigenProblem;
use crate::spectrum::hsim::{self, Eigenpairs, HsimError, HsimParameters, Selection};

pub(super) fn modes(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    wanted: usize,
    tolerance: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<NonrigidModes, VibrationError> {
    let free = rigid.motions.len();
    let count = free + wanted;
    if wanted == 0 {
        let functions = FoundFunctions::Dense(PanelMatrix::zeros(elastic.problem.size(), 0));
        return Ok(NonrigidModes {
            values: Vec::new(),
            functions,
            rigid: DenseMatrix::zeros(free, 0),
            certificate: serde_json::Value::Null,
        });
    }
    let size = elastic.problem.size();
    // HSIM asks where the unknowns are, and how many.
    let places = TriangleMesh {
        positions: elastic.positions.iter().flat_map(|&p| [p; 3]).collect(),
        faces: Vec::new(),
        ..Default::default()
    };
    let parameters =
        HsimParameters { selection: Selection::Count(count), tolerance, seed, ..HsimParameters::default() };
    if hsim::is_dense(size, count) {
        let space = space::functions(body, elastic, elastic.moving.len(), false, seed, monitor)?;
        let unit = unit(approximate(elastic, rigid, &space, 1, monitor)?.values.first());
        let pairs = hsim::solve(&places, &shifted(&elastic.problem, unit), &parameters, false, monitor)?;
        return beside_rigid(elastic, rigid, pairs, unit, monitor);
    }
    if let Some(hsim::AboveKernel { pairs, unit }) = hsim::above_kernel(&elastic.problem, free, &parameters, monitor)? {
        return beside_rigid(elastic, rigid, pairs, unit, monitor);
    }
    refuse_beyond_promise(&elastic.problem, count, monitor)?;
    let columns = hsim::columns(size, count);
    // Three times as many functions as an iteration has columns, and at most half of all.
    let dimension = columns.max(LEAST_DIMENSION).min(elastic.moving.len() / 2);
    let space = space::functions(body, elastic, dimension, true, seed, monitor)?;
    let ritz = approximate(elastic, rigid, &space, columns - free, monitor)?;
    let start = refined::modes(elastic, rigid, (&space, ritz), columns - free, START_ITERATIONS, monitor)?;
    drop(space);
    let unit = unit(start.values.first());
    let problem = shifted(&elastic.problem, unit);
    let values = iter::repeat_n(1.0, free).chain(start.values.iter().map(|value| 1.0 + value / unit)).collect();
    let vectors = after_rigid(elastic, rigid, &start.vectors);
    let pairs = hsim::solve_from(&places, &problem, &parameters, (vectors, values), monitor)?;
    beside_rigid(elastic, rigid, pairs, unit, monitor)
}

/// Refuses an iteration that takes more memory than all of the work was promised, which is what a Krylov space takes:
/// three blocks of columns, the problem twice, and two factors with some seven times its entries each.
fn refuse_beyond_promise(problem: &EigenProblem, count: usize, monitor: &dyn Monitor) -> Result<(), VibrationError> {
    let bytes = 24 * problem.size() as u64 * (count as u64 + 64) + 136 * problem.stiffness.entries() as u64;
    match monitor.promised_bytes() {
        Some(promised) if bytes > promised => Err(VibrationError::Iteration(HsimError::Memory(format!(
            "a Krylov space does not hold these modes, and an iteration needs about {bytes} bytes; the job may use {promised}"
        )))),
        _ => Ok(()),
    }
}

/// Scalar functions of a start, at least.
const LEAST_DIMENSION: usize = 150;

/// Inverse iterations of a start: without them what the space locks lies so high that the first shifts would be far
/// from everything wanted.
const START_ITERATIONS: Iterations = Iterations::Exactly(2);

/// What eigenvalues are measured in.
fn unit(lowest: Option<&f64>) -> f64 {
    lowest.copied().filter(|lowest| *lowest > 0.0 && lowest.is_finite()).unwrap_or(1.0)
}

/// Columns with the rigid motions before them.
fn after_rigid(elastic: &ElasticProblem, rigid: &RigidMotions, vectors: &PanelMatrix) -> PanelMatrix {
    let free = rigid.motions.len();
    let mut all = PanelMatrix::zeros(vectors.rows(), 0);
    all.widen(free + vectors.columns());
    let motions: Vec<f64> = rigid.motions.iter().flat_map(|motion| rigid.displacement(elastic, motion)).collect();
    let motions = DenseMatrix::from_columns(vectors.rows(), free, motions);
    all.assign(&(0..free).collect::<Vec<_>>(), &PanelMatrix::from_dense(&motions));
    all.assign(&(free..free + vectors.columns()).collect::<Vec<_>>(), vectors);
    all
}

/// `K / unit + M`.
fn shifted(problem: &EigenProblem, unit: f64) -> EigenProblem {
    let stiffness = &problem.stiffness;
    let mass = problem.mass.lumped();
    let mut values: Vec<f64> = stiffness.values().iter().map(|value| value / unit).collect();
    for row in 0..stiffness.rows() {
        let start = stiffness.offsets()[row];
        if let Ok(at) = stiffness.row(row).0.binary_search(&(row as u32)) {
            values[start + at] += mass[row];
        }
    }
    EigenProblem {
        stiffness: SparseMatrix::from_sorted_parts(
            stiffness.rows(),
            stiffness.columns(),
            stiffness.offsets().to_vec(),
            stiffness.indices().to_vec(),
            values,
        ),
        mass: problem.mass.clone(),
        area: 1.0,
        unknowns: None,
    }
}

/// Makes columns orthogonal to the rigid motions.
pub(super) fn apart_from_rigid(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    vectors: &mut PanelMatrix,
    monitor: &dyn Monitor,
) -> Result<(), VibrationError> {
    let free = rigid.motions.len();
    let motions: Vec<f64> = rigid.motions.iter().flat_map(|motion| rigid.displacement(elastic, motion)).collect();
    if free > 0 {
        let motions = PanelMatrix::from_dense(&DenseMatrix::from_columns(elastic.problem.size(), free, motions));
        let mass: &MassMatrix = &elastic.problem.mass;
        let products = inner_products(&motions, Weight::Mass(mass), vectors, monitor)?;
        subtract_combinations(vectors, &motions, &products, monitor)?;
    }
    Ok(())
}

/// Drops what was found of the rigid motions, and makes the rest orthogonal to them.
fn beside_rigid(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    pairs: Eigenpairs,
    unit: f64,
    monitor: &dyn Monitor,
) -> Result<NonrigidModes, VibrationError> {
    let free = rigid.motions.len();
    let count = pairs.values.len();
    let kept: Vec<usize> = (free.min(count)..count).collect();
    let mut vectors = pairs.vectors.select(&kept);
    apart_from_rigid(elastic, rigid, &mut vectors, monitor)?;
    let physical = unit * elastic.eigenvalue_scale;
    let inertia: Vec<_> = pairs
        .inertia
        .iter()
        .map(|count| serde_json::json!({"shift": (count.shift - 1.0) * physical, "below": count.below}))
        .collect();
    let worst = pairs.residuals.iter().copied().fold(0.0, f64::max);
    Ok(NonrigidModes {
        values: kept.iter().map(|&k| (pairs.values[k] - 1.0) * unit).collect(),
        rigid: DenseMatrix::zeros(free, kept.len()),
        functions: FoundFunctions::Dense(vectors),
        certificate: serde_json::json!({"complete": true, "inertia": inertia, "largest_residual": worst}),
    })
}
