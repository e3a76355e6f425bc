//! Modes to a residual, by HSIM.
//!
//! HSIM knows the kernel of a scalar operator, the constants, not rigid motions. So it is given the problem shifted by the lowest elastic
//! eigenvalue, in units of it: rigid motions are then modes like others, with the value 1, and every residual is relative. What comes out
//! for them is replaced by what is known exactly.

use super::approximate::{modes as approximate, threefold};
use super::{ElasticBody, ElasticProblem, Found, FoundFunctions, Monitor, RigidMotions, VibrationError, space};
use crate::algebra::{
    DenseMatrix, MassMatrix, PanelMatrix, SparseMatrix, Weight, inner_products, subtract_combinations,
};
use crate::mesh::TriangleMesh;
use crate::operator::EigenProblem;
use crate::spectrum::hsim::{Eigenpairs, HsimParameters, Wanted, solve_with_space};

pub(super) fn modes(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    wanted: usize,
    tolerance: f64,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Found, VibrationError> {
    let free = rigid.motions.len();
    let count = free + wanted;
    if wanted == 0 {
        let functions = FoundFunctions::Dense(PanelMatrix::zeros(elastic.problem.size(), 0));
        return Ok(Found {
            values: Vec::new(),
            functions,
            rigid: DenseMatrix::zeros(free, 0),
            certificate: serde_json::Value::Null,
        });
    }
    let space = space::functions(body, elastic, dimension(count), false, seed, monitor)?;
    let lowest = approximate(elastic, rigid, &space, 1, monitor)?.values.first().copied().unwrap_or(1.0);
    let unit = if lowest > 0.0 && lowest.is_finite() { lowest } else { 1.0 };
    let problem = shifted(&elastic.problem, unit);
    let parameters = HsimParameters { wanted: Wanted::Count(count), tolerance, seed, ..HsimParameters::default() };
    // HSIM asks where the unknowns are, and how many.
    let places =
        TriangleMesh { positions: elastic.positions.iter().flat_map(|&p| [p; 3]).collect(), faces: Vec::new() };
    let pairs = solve_with_space(&places, &problem, &parameters, &threefold(&space), monitor)?;
    drop(space);
    beside_rigid(elastic, rigid, pairs, unit, monitor)
}

/// Scalar functions of the space that HSIM starts from: as many as its coarsest level, which is solved densely, can take.
fn dimension(count: usize) -> usize {
    let columns = (count + (count / 32).max(14)).next_multiple_of(32);
    let coarsest = (4 * columns).clamp(400, 1000).max(columns + columns.min(1000) * 4 / 5);
    (2 * coarsest - 1) / 3
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
    if let Some(motions) = DenseMatrix::from_columns(elastic.problem.size(), free, motions)
        && free > 0
    {
        let motions = PanelMatrix::from_dense(&motions);
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
) -> Result<Found, VibrationError> {
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
    Ok(Found {
        values: kept.iter().map(|&k| (pairs.values[k] - 1.0) * unit).collect(),
        rigid: DenseMatrix::zeros(free, kept.len()),
        functions: FoundFunctions::Dense(vectors),
        certificate: serde_json::json!({"complete": true, "inertia": inertia, "largest_residual": worst}),
    })
}
