//! Eigenfields of the Hodge–Laplacian and vibration modes, as pencils that are judged like any other.

use chladni_algebra::DenseMatrix;
use chladni_base::Monitor;

use super::{Claims, Finding, Verification, VerifyError, verify_claims};
use crate::basis::modal::{FIXED, ModalBasis};
use crate::basis::{Basis, Certificate, DenseFunctions, Functions, InertiaCount, Precision};
use crate::field::FieldSurface;
use crate::operator::MeshOperator;
use crate::operator::elastic::ElasticProblem;
use crate::operator::hodge::{FieldBoundary, hodge_problem};

/// Judges eigenfields by the Hodge–Laplacian on the faces, two numbers each in the frame of the face, with the areas of
/// the faces as its mass: that of both divergence and curl, from which eigenfields are not computed. Counts of the
/// certificate are of two problems of functions; one is made here of that of fields, in a gap. Stages: `operator`,
/// `residuals`, `orthonormality`, `count`.
///
/// # Errors
/// [`VerifyError`]: functions that cannot be read, or cancellation. Whatever is wrong with the fields is a [`Finding`].
pub fn verify_fields(
    basis: &Basis,
    surface: &FieldSurface,
    boundary: FieldBoundary,
    monitor: &dyn Monitor,
) -> Result<Verification, VerifyError> {
    monitor.stage("operator");
    let (dual, frames) = (surface.dual(), surface.frames());
    let problem = hodge_problem(surface.mesh(), dual, frames, boundary);
    monitor.checkpoint()?;
    let lowest =
        basis.eigenvalues.iter().find(|value| **value > 0.0).map_or(f64::INFINITY, |value| value * problem.area);
    let claims = Claims { counts: false, gradients_of: Some(lowest), ..Claims::of(basis) };
    verify_claims(basis, &MeshOperator::whole(problem), claims, monitor)
}

/// The orthonormality of modes that are stored in single precision, which nobody states.
const ORTHONORMALITY: f64 = 1e-6;

/// Judges modes by the elastic problem, which is assembled anew from the object that they are said to be of. Residuals
/// are relative to `‖K x‖`; nobody claims those of modes. Stages: `residuals`, `orthonormality`, `count`.
///
/// # Errors
/// [`VerifyError`]: cancellation, modes that do not say what they claim. Whatever is wrong with the modes is a
/// [`Finding`].
pub fn verify_modes(
    modes: &ModalBasis,
    elastic: ElasticProblem,
    monitor: &dyn Monitor,
) -> Result<Verification, VerifyError> {
    let unit = elastic.eigenvalue_scale;
    let outside = place_findings(modes, &elastic);
    if let Some(finding) = outside {
        return Ok(Verification { findings: vec![finding], ..Verification::unmeasured() });
    }
    let there = on_coordinates(modes, &elastic, monitor)?;
    let operator = MeshOperator::whole(elastic.problem);
    let claims = Claims { residuals: false, counts: true, gradients_of: None, unit: f64::from(f32::EPSILON) / 2.0 };
    let mut found = verify_claims(&there, &operator, claims, monitor)?;
    found.distances.iter_mut().for_each(|distance| *distance *= unit);
    found.counts.iter_mut().for_each(|count| count.shift *= unit);
    found.findings.iter_mut().for_each(|finding| finding.map_values(|value| value * unit));
    Ok(found)
}

/// Vertices that are others than those of the object, or move where it is held.
fn place_findings(modes: &ModalBasis, elastic: &ElasticProblem) -> Option<Finding> {
    let vertices = elastic.report.vertices;
    if modes.vertices() != vertices {
        return Some(Finding::Shape(format!("{} vertices instead of {vertices}", modes.vertices())));
    }
    let lumped = elastic.problem.mass.lumped();
    let mut expected = vec![None; vertices];
    elastic
        .moving
        .iter()
        .zip(lumped.chunks_exact(3))
        .for_each(|(&vertex, mass)| expected[vertex as usize] = Some(mass[0]));
    for (vertex, expected) in expected.into_iter().enumerate() {
        let (found, held) = (modes.masses[vertex], modes.part[vertex] == FIXED);
        let Some(mass) = expected else {
            if !held {
                return Some(Finding::Shape(format!("vertex {vertex} belongs to a part that moves, and it is held")));
            }
            continue;
        };
        let mass = mass * elastic.report.total_mass;
        if held || !((found - mass).abs() <= 1e-9 * mass) {
            return Some(Finding::Mass { row: vertex, found, expected: mass });
        }
    }
    None
}

/// The modes on the coordinates that can move, in the units of the problem.
fn on_coordinates(modes: &ModalBasis, elastic: &ElasticProblem, monitor: &dyn Monitor) -> Result<Basis, VerifyError> {
    let (rows, count) = (elastic.problem.size(), modes.count());
    let scale = elastic.report.total_mass.sqrt();
    let mut functions = DenseMatrix::zeros(rows, count);
    for (place, &vertex) in elastic.moving.iter().enumerate() {
        if place.is_multiple_of(LOOK_EVERY) {
            monitor.checkpoint()?;
        }
        let Ok(displacements) = modes.at(vertex as usize) else { panic!("vertex {vertex} is one of the modes") };
        for (mode, displacement) in displacements.into_iter().enumerate() {
            let column = functions.column_mut(mode);
            (0..3).for_each(|axis| column[3 * place + axis] = scale * displacement[axis]);
        }
    }
    let unit = elastic.eigenvalue_scale;
    let claim = modes.metadata.modes_claim()?;
    let counts = claim.map_or_else(Vec::new, |claim| claim.inertia.clone());
    Ok(Basis {
        functions: Functions::Dense(DenseFunctions::from_columns(&functions, Precision::F64)),
        eigenvalues: modes.eigenvalues.iter().map(|value| value / unit).collect(),
        mass: elastic.problem.mass.clone(),
        certificate: Certificate {
            bounds: modes.bounds.iter().map(|bound| bound / unit).collect(),
            orthonormality_defect: ORTHONORMALITY,
            complete: claim.filter(|claim| claim.complete).map(|_| true),
            inertia: counts.into_iter().map(|count| InertiaCount { shift: count.shift / unit, ..count }).collect(),
            ..Certificate::default()
        },
        metadata: serde_json::Value::Null.into(),
    })
}

/// Vertices between two looks at whether to go on.
const LOOK_EVERY: usize = 4096;
