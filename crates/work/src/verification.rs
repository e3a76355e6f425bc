//! A basis judged again from its mesh, and the receipt of it.

use chladni_algebra::MassMatrix;
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Basis;
use chladni_spectral::spectrum::pencil::{Mass, Matrices};
use chladni_spectral::verify::{Finding, Verification, VerifyError, verify};
use serde_json::{Value, json};

use crate::{EigenbasisParameters, JobError, ParameterError, PencilBasisParameters};

/// Why a basis was not judged.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// It is of an operator that cannot be judged, or does not say of which.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The operator could not be assembled on the mesh, or the work was cancelled.
    #[error(transparent)]
    Operator(#[from] JobError),
    /// Its functions could not be read, or the work was cancelled.
    #[error(transparent)]
    Verify(#[from] VerifyError),
}

/// The problem that a basis is said to solve: operator, mass and boundary condition of the job that made it; `operator` takes the place of that of the
/// basis, which does not carry a potential that came with the job.
///
/// # Errors
/// [`ParameterError::Value`] where no operator is named, or it has fields for eigenfunctions.
pub fn problem_of(basis: &Basis, operator: Option<Value>) -> Result<EigenbasisParameters, ParameterError> {
    let refused = |reason: &str| Err(ParameterError::Value { name: "operator", reason: reason.to_owned() });
    let mut parameters = basis.metadata["parameters"].clone();
    if let Some(operator) = operator {
        if !parameters.is_object() {
            parameters = json!({});
        }
        parameters["operator"] = operator;
    }
    if !parameters.is_object() || parameters.get("operator").is_none_or(Value::is_null) {
        return refused("this basis does not say which operator it is of");
    }
    let problem = ["operator", "mass", "boundary"].map(|name| (name.to_owned(), parameters[name].clone()));
    let given = problem.into_iter().filter(|(_, value)| !value.is_null()).collect();
    let parameters = EigenbasisParameters::parse(&Value::Object(given))?;
    if parameters.is_hodge() {
        return refused("eigenfields (operator \"hodge\") cannot be judged yet");
    }
    Ok(parameters)
}

/// Assembles the operator of `parameters` on the mesh, or on the solid whose surface it is, and judges the basis by it. Stages: those of the operator, then `residuals`, `orthonormality`, `count`.
///
/// # Errors
/// [`JudgeError`]; whatever is wrong with the basis is a finding.
pub fn judge(
    basis: &Basis,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    parameters: &EigenbasisParameters,
    monitor: &dyn Monitor,
) -> Result<Verification, JudgeError> {
    let operator = parameters.assemble(mesh, solid, monitor)?;
    Ok(verify(basis, &operator, monitor)?)
}

/// The memory that judging `count` functions of `vertices` numbers takes, in bytes: the functions, once more where a boundary is held, some of their products, the
/// operator and a factor, which fills in more in a solid.
pub fn judging_bytes(vertices: usize, count: usize, parameters: &EigenbasisParameters) -> u64 {
    let (n, m) = (vertices as u64, count as u64);
    let fill = if parameters.is_of_volume() {
        4.0 * (n as f64).powf(4.0 / 3.0)
    } else {
        4.7 * n as f64 * (n.max(2) as f64).log2()
    };
    16 * n * m + 16 * n * m.min(64) + 300 * n + 10 * fill as u64
}

/// Work that was promised so many bytes.
pub struct Promised<'a> {
    /// Who watches it.
    pub inner: &'a dyn Monitor,
    /// What was promised.
    pub bytes: u64,
}

impl Monitor for Promised<'_> {
    fn stage(&self, name: &'static str) {
        self.inner.stage(name);
    }
    fn progress(&self, fraction: f64) {
        self.inner.progress(fraction);
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        self.inner.checkpoint()
    }
    fn promised_bytes(&self) -> Option<u64> {
        Some(self.bytes)
    }
}

/// What was judged and what was found, to be cited. `hashes` name the basis and the mesh, and `hash` says what they are.
pub fn receipt(
    basis: &Basis,
    parameters: &EigenbasisParameters,
    outcome: &Verification,
    (hashes, hash): (&Value, &str),
    seconds: f64,
) -> Value {
    told(basis, parameters.canonical(), outcome, (hashes, hash), seconds)
}

/// `problem` has the operator, its mass and its boundary condition.
fn told(basis: &Basis, problem: Value, outcome: &Verification, (hashes, hash): (&Value, &str), seconds: f64) -> Value {
    json!({
        "verdict": outcome.verdict(),
        "hashes": hashes,
        "hash": hash,
        "verified_by": format!("chladni {}", env!("CARGO_PKG_VERSION")),
        "operator": problem["operator"],
        "mass": problem["mass"],
        "boundary": problem["boundary"],
        "solved_with": basis.metadata["parameters"],
        "first": basis.certificate.first,
        "pairs": basis.count(),
        "proven_complete": outcome.proven,
        "findings": outcome.findings,
        "counts": outcome.counts,
        "orthonormality_defect": outcome.orthonormality_defect,
        "eigenvalues": basis.eigenvalues,
        "bounds": basis.certificate.bounds,
        "residuals": outcome.residuals,
        "distances": outcome.distances,
        "seconds": seconds,
    })
}

/// Judges a basis of a problem by its matrices. Residuals are relative to `‖(S + cM) x‖`, with the `moved` of its metadata for `c`; rows of `fixed` have to be zero.
///
/// # Errors
/// [`JudgeError`]; whatever is wrong with the basis is a finding.
pub fn judge_pencil(
    basis: &Basis,
    matrices: &Matrices,
    fixed: &[u32],
    monitor: &dyn Monitor,
) -> Result<Verification, JudgeError> {
    let moved = basis.metadata["moved"].as_f64().filter(|moved| moved.is_finite()).unwrap_or(0.0);
    let operator = matrices.moved(moved, fixed, monitor).map_err(JobError::from)?;
    let mut there = basis.clone();
    there.eigenvalues.iter_mut().for_each(|value| *value += moved);
    there.certificate.inertia.iter_mut().for_each(|count| count.shift += moved);
    if let MassMatrix::Weighted(mass) = there.mass {
        there.mass = MassMatrix::Sparse(mass.matrix);
    }
    let mut found = verify(&there, &operator, monitor)?;
    found.counts.iter_mut().for_each(|count| count.shift -= moved);
    found.findings.iter_mut().for_each(|finding| move_back(finding, moved));
    Ok(found)
}

/// Numbers of a finding in the units of the pencil.
fn move_back(finding: &mut Finding, moved: f64) {
    match finding {
        Finding::Order { value, before, .. } => (*value, *before) = (*value - moved, *before - moved),
        Finding::Quotient { value, quotient, .. } => (*value, *quotient) = (*value - moved, *quotient - moved),
        Finding::Count { shift, .. } | Finding::Missing { shift, .. } => *shift -= moved,
        _ => {}
    }
}

/// The receipt of a basis of a problem.
pub fn pencil_receipt(
    basis: &Basis,
    matrices: &Matrices,
    parameters: &PencilBasisParameters,
    outcome: &Verification,
    (hashes, hash): (&Value, &str),
    seconds: f64,
) -> Value {
    let mass = match matrices.mass() {
        Mass::Identity => "identity",
        Mass::Diagonal(_) => "diagonal",
        Mass::Sparse(_) => "sparse",
    };
    let boundary = if parameters.fixed.is_empty() { "none" } else { "dirichlet" };
    let judged = json!({ "operator": "pencil", "mass": mass, "boundary": boundary });
    told(basis, judged, outcome, (hashes, hash), seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};

    #[test]
    fn a_basis_and_an_interval_are_confirmed_and_what_was_altered_is_refuted() {
        let mesh = generate(Shape::Torus, 300).unwrap();
        for parameters in [
            json!({"method": "hsim", "count": 20, "tolerance": 1e-6}),
            json!({"between": [0.5, 2.5], "tolerance": 1e-6}),
            json!({"between": [-1.0, 2.5], "boundary": "dirichlet"}),
        ] {
            let solver = EigenbasisParameters::parse(&parameters).unwrap();
            let mut basis = solver.run(&mesh, &Unwatched).unwrap();
            let problem = problem_of(&basis, None).unwrap();
            let outcome = judge(&basis, &mesh, None, &problem, &Unwatched).unwrap();
            assert!(outcome.findings.is_empty(), "{parameters}: {:?}", outcome.findings);
            assert!(outcome.proven.is_some_and(|proven| proven > 0), "{parameters}: {outcome:?}");
            let receipt = receipt(&basis, &problem, &outcome, (&json!({}), ""), 0.0);
            assert_eq!((&receipt["verdict"], &receipt["pairs"]), (&json!("confirmed"), &json!(basis.count())));
            assert_eq!(basis.metadata["interval"].is_null(), parameters.get("between").is_none());
            // Another first index: one pair more is said to lie below.
            basis.certificate.first += 1;
            let outcome = judge(&basis, &mesh, None, &problem, &Unwatched).unwrap();
            assert!(!outcome.findings.is_empty(), "{parameters}");
        }
    }

    #[test]
    fn a_basis_that_does_not_say_what_it_is_of_needs_to_be_told() {
        let mesh = generate(Shape::Sphere, 100).unwrap();
        let values = vec![1.0; mesh.positions.len()];
        let operator = json!({"hamiltonian": {"potential": {"values": values}}});
        let parameters = json!({"method": "hsim", "count": 5, "operator": operator});
        let basis = EigenbasisParameters::parse(&parameters).unwrap().run(&mesh, &Unwatched).unwrap();
        assert!(matches!(problem_of(&basis, None), Err(ParameterError::Value { name: "operator", .. })));
        let problem = problem_of(&basis, Some(operator)).unwrap();
        assert!(judge(&basis, &mesh, None, &problem, &Unwatched).unwrap().findings.is_empty());
        let hodge = problem_of(&basis, Some(json!("hodge")));
        assert!(hodge.unwrap_err().to_string().contains("hodge"));
    }
}
