//! A basis judged again from its mesh, and the receipt of it.

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::modal::ModalBasis;
use chladni_spectral::basis::{AskedOperator, Basis, ProvenanceError, VibratingObject};
use chladni_spectral::field::FieldSurface;
use chladni_spectral::operator::{OperatorError, elastic};
use chladni_spectral::spectrum::pencil::{Mass, Matrices};
use chladni_spectral::verify::{Verification, VerifyError, verify, verify_fields, verify_modes};
use serde_json::{Value, json};

use crate::eigenbasis::POINT_BYTES;
use crate::{EigenbasisParameters, JobError, ParameterError, VibrationBasisParameters};

/// Why a basis was not judged.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// It is of an operator that cannot be judged, or does not say of which.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The operator could not be assembled on the mesh, or the work was cancelled.
    #[error(transparent)]
    Operator(#[from] JobError),
    /// Its functions could not be read, it does not say what it claims, or the work was cancelled.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// It does not say what its residuals are relative to.
    #[error(transparent)]
    Provenance(#[from] ProvenanceError),
}

/// The problem that a basis is said to solve: operator, mass and boundary condition of the job that made it; `operator`
/// takes the place of that of the basis, which does not carry a potential that came with the job.
///
/// # Errors
/// [`ParameterError::Value`] where operator, mass or boundary condition is not said.
pub fn problem_of(basis: &Basis, operator: Option<Value>) -> Result<EigenbasisParameters, ParameterError> {
    let made = &basis.metadata;
    let unsaid = |name| move |error: ProvenanceError| ParameterError::Value { name, reason: error.to_string() };
    let operator = match operator {
        Some(operator) => operator,
        None => match made.operator().map_err(unsaid("operator"))? {
            AskedOperator::Whole(operator) => json!(operator),
            AskedOperator::Abbreviated { name } => {
                let reason = format!("the numbers of \"{name}\" are too many for this basis to carry");
                return Err(ParameterError::Value { name: "operator", reason });
            }
        },
    };
    let (mass, boundary) = (made.mass().map_err(unsaid("mass"))?, made.boundary().map_err(unsaid("boundary"))?);
    // Of the methods, the exact one takes every operator.
    EigenbasisParameters::parse(&json!({"method": "hsim", "operator": operator, "mass": mass, "boundary": boundary}))
}

/// What the modes of a vibration are said to be of: object, material and held vertices of the job that made them.
///
/// # Errors
/// [`ParameterError`] where they do not say it in full, as where more vertices are held than a file lists; `clamped`
/// takes their place.
pub fn vibration_of(modes: &ModalBasis, clamped: Option<Vec<u32>>) -> Result<VibrationBasisParameters, ParameterError> {
    let unsaid = |error: ProvenanceError| match error {
        ProvenanceError::Missing { member: "parameters.clamped", .. }
        | ProvenanceError::Unknown { member: "parameters.clamped", .. } => {
            ParameterError::Value { name: "clamped", reason: error.to_string() }
        }
        _ => ParameterError::Value { name: "object", reason: error.to_string() },
    };
    let object = modes.metadata.vibrating(clamped.as_deref()).map_err(unsaid)?;
    let VibratingObject { thickness, material, clamped, clamped_rotations } = object;
    let mut given = json!({"count": modes.count(), "material": material, "clamped": clamped, "clamped_rotations": clamped_rotations});
    if let Some(thickness) = thickness {
        given["thickness"] = json!(thickness);
    }
    VibrationBasisParameters::parse(&given)
}

/// Assembles the operator of `parameters` on the mesh, or on the solid whose surface it is, and judges the basis by it.
/// Stages: those of the operator, then `residuals`, `orthonormality`, `count`.
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
    if parameters.is_hodge() {
        let refused = |reason: String| JobError::Operator(OperatorError::Parameter { name: "operator", reason });
        let surface = FieldSurface::new(mesh.clone()).map_err(|error| refused(error.to_string()))?;
        surface
            .dual()
            .oriented()
            .map_err(|at| refused(format!("the Hodge–Laplacian needs an oriented surface: {at}")))?;
        return Ok(verify_fields(basis, &surface, parameters.field_boundary(), monitor)?);
    }
    let operator = parameters.assemble(mesh, solid, monitor)?;
    Ok(verify(basis, &operator, monitor)?)
}

/// Assembles the object of `parameters` on the mesh, or on the solid whose surface it is, and judges the modes by it.
/// Stages: `operator`, `residuals`, `orthonormality`, `count`.
///
/// # Errors
/// [`JudgeError`]; whatever is wrong with the modes is a finding.
pub fn judge_modes(
    modes: &ModalBasis,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    parameters: &VibrationBasisParameters,
    monitor: &dyn Monitor,
) -> Result<Verification, JudgeError> {
    let body = parameters.elastic_body(mesh, solid)?;
    let elastic =
        elastic::assemble(body, &parameters.material, &parameters.clamps(), monitor).map_err(JobError::from)?;
    Ok(verify_modes(modes, elastic, monitor)?)
}

/// The memory that judging `count` functions of `rows` numbers takes, in bytes: the functions, once more where a
/// boundary is held, some of their products, the operator and a factor, which fills in more in a solid.
///
/// Without `faces` they are functions on points, whose triangles are made.
pub fn judging_bytes(rows: usize, faces: usize, count: usize, parameters: &EigenbasisParameters) -> u64 {
    let n = rows as u64;
    let planar = |per_row: f64| per_row * n as f64 * (n.max(2) as f64).log2();
    let fill = match (parameters.is_of_volume(), parameters.is_hodge()) {
        (true, _) => 4.0 * (n as f64).powf(4.0 / 3.0),
        // Some twenty-six entries a row instead of seven.
        (_, true) => planar(15.0),
        _ => planar(4.7),
    };
    // The rows of the Hodge–Laplacian and its pattern.
    let assembly = if parameters.is_hodge() { 1200 } else { 300 };
    let local = if faces == 0 { POINT_BYTES } else { 0 };
    16 * n * count as u64 + 16 * n * count.min(64) as u64 + (assembly + local) * n + 10 * fill as u64
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

/// What a receipt says of the pairs themselves.
struct Pairs<'a> {
    first: usize,
    eigenvalues: &'a [f64],
    bounds: &'a [f64],
    solved_with: &'a Value,
}

impl<'a> From<&'a Basis> for Pairs<'a> {
    fn from(basis: &'a Basis) -> Self {
        Self {
            first: basis.certificate.first,
            eigenvalues: &basis.eigenvalues,
            bounds: &basis.certificate.bounds,
            solved_with: &basis.metadata.json()["parameters"],
        }
    }
}

/// What was judged and what was found, to be cited. `hashes` name the basis and the mesh, and `hash` says what they
/// are.
pub fn receipt(
    basis: &Basis,
    parameters: &EigenbasisParameters,
    outcome: &Verification,
    hashes: (&Value, &str),
    seconds: f64,
) -> Value {
    receipt_of(&basis.into(), parameters.canonical(), outcome, hashes, seconds)
}

/// The same of vibration modes; eigenvalues, bounds, distances and shifts are squared angular frequencies.
pub fn modes_receipt(
    modes: &ModalBasis,
    parameters: &VibrationBasisParameters,
    outcome: &Verification,
    hashes: (&Value, &str),
    seconds: f64,
) -> Value {
    let solved_with = &modes.metadata.json()["parameters"];
    let pairs = Pairs { first: 0, eigenvalues: &modes.eigenvalues, bounds: &modes.bounds, solved_with };
    let operator = json!({"elastic": {"thickness": parameters.thickness, "material": parameters.material}});
    let boundary = if parameters.clamped.is_empty() { "free" } else { "clamped" };
    let judged = json!({ "operator": operator, "mass": "lumped", "boundary": boundary });
    receipt_of(&pairs, judged, outcome, hashes, seconds)
}

/// `problem` has the operator, its mass and its boundary condition.
fn receipt_of(
    pairs: &Pairs<'_>,
    problem: Value,
    outcome: &Verification,
    (hashes, hash): (&Value, &str),
    seconds: f64,
) -> Value {
    json!({
        "verdict": outcome.verdict(),
        "hashes": hashes,
        "hash": hash,
        "verified_by": format!("chladni {}", env!("CARGO_PKG_VERSION")),
        "operator": problem["operator"],
        "mass": problem["mass"],
        "boundary": problem["boundary"],
        "solved_with": pairs.solved_with,
        "first": pairs.first,
        "pairs": pairs.eigenvalues.len(),
        "proven_complete": outcome.proven,
        "findings": outcome.findings,
        "counts": outcome.counts,
        "orthonormality_defect": outcome.orthonormality_defect,
        "eigenvalues": pairs.eigenvalues,
        "bounds": pairs.bounds,
        "residuals": outcome.residuals,
        "distances": outcome.distances,
        "seconds": seconds,
    })
}

/// Judges a basis of a problem by its matrices. Residuals are relative to `‖(S + cM) x‖`, with the `moved` of its
/// metadata for `c`; rows of `fixed` have to be zero.
///
/// # Errors
/// [`JudgeError`]; whatever is wrong with the basis is a finding.
pub fn judge_pencil(
    basis: &Basis,
    matrices: &Matrices,
    fixed: &[u32],
    monitor: &dyn Monitor,
) -> Result<Verification, JudgeError> {
    let moved = basis.metadata.moved()?;
    let operator = matrices.moved(moved, fixed, monitor).map_err(JobError::from)?;
    if moved == 0.0 {
        return Ok(verify(basis, &operator, monitor)?);
    }
    let mut there = basis.clone();
    there.eigenvalues.iter_mut().for_each(|value| *value += moved);
    there.certificate.inertia.iter_mut().for_each(|count| count.shift += moved);
    let mut found = verify(&there, &operator, monitor)?;
    found.counts.iter_mut().for_each(|count| count.shift -= moved);
    found.findings.iter_mut().for_each(|finding| finding.map_values(|value| value - moved));
    Ok(found)
}

/// The receipt of a basis of a problem, with rows that are fixed or without.
pub fn pencil_receipt(
    basis: &Basis,
    matrices: &Matrices,
    has_fixed: bool,
    outcome: &Verification,
    (hashes, hash): (&Value, &str),
    seconds: f64,
) -> Value {
    let mass = match matrices.mass() {
        Mass::Identity => "identity",
        Mass::Diagonal(_) => "diagonal",
        Mass::Sparse(_) => "sparse",
    };
    let boundary = if has_fixed { "dirichlet" } else { "none" };
    let judged = json!({ "operator": "pencil", "mass": mass, "boundary": boundary });
    receipt_of(&basis.into(), judged, outcome, (hashes, hash), seconds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Work;
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use chladni_spectral::basis::{DenseFunctions, Functions, Precision, Product};
    use chladni_spectral::verify::Finding;

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
            assert_eq!(basis.metadata.json()["interval"].is_null(), parameters.get("between").is_none());
            // Another first index: one pair more is said to lie below.
            basis.certificate.first += 1;
            let outcome = judge(&basis, &mesh, None, &problem, &Unwatched).unwrap();
            assert!(!outcome.findings.is_empty(), "{parameters}");
        }
    }

    #[test]
    fn what_is_stored_keeps_the_tolerance_or_says_which_one() {
        // Two vertices almost at one place: across weights of 1e5 single precision has little left for the lowest
        // pairs.
        let mut mesh = generate(Shape::Sphere, 2_000).unwrap();
        let [a, b, _] = mesh.faces[0].map(|vertex| vertex as usize);
        mesh.positions[a] =
            [0, 1, 2].map(|k| mesh.positions[b][k] + 1e-5 * (mesh.positions[a][k] - mesh.positions[b][k]));
        let solved = |tolerance: f64, precision: Option<&str>| {
            let mut parameters = json!({"method": "hsim", "operator": "laplace", "count": 10, "tolerance": tolerance});
            precision.into_iter().for_each(|name| parameters["precision"] = json!(name));
            let parameters = EigenbasisParameters::parse(&parameters).unwrap();
            // A job is run from its canonical parameters.
            let parameters = EigenbasisParameters::parse(&parameters.canonical()).unwrap();
            let basis = parameters.run(&mesh, &Unwatched).unwrap();
            let outcome = judge(&basis, &mesh, None, &parameters, &Unwatched).unwrap();
            assert!(outcome.findings.is_empty(), "{tolerance} {precision:?}: {:?}", outcome.findings);
            let Functions::Dense(dense) = &basis.functions else { panic!("dense was asked for") };
            let worst = basis.certificate.residuals.iter().copied().fold(0.0, f64::max);
            let kept = basis.certificate.tolerance.unwrap();
            assert!(worst <= kept, "{tolerance} {precision:?}: {worst}");
            (dense.precision(), kept)
        };
        assert_eq!(solved(0.1, None), (Precision::F32, 0.1));
        assert_eq!(solved(2e-4, None), (Precision::F64, 2e-4));
        let (precision, kept) = solved(2e-4, Some("f32"));
        assert!(precision == Precision::F32 && kept > 2e-4, "{precision:?} {kept}");
        assert_eq!(solved(0.1, Some("f64")), (Precision::F64, 0.1));
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
    }

    #[test]
    fn eigenfields_are_confirmed_and_what_was_altered_is_refuted() {
        // A torus has two harmonic fields, a disk has none.
        for (shape, harmonic) in [(Shape::Torus, 2), (Shape::Disk, 0)] {
            let mesh = generate(shape, 400).unwrap();
            // In single precision as well, of which the certificate says what it keeps; and where values are not those
            // of the fields to rounding.
            for (tolerance, precision) in [(1e-6, "f32"), (1e-2, "f64")] {
                let parameters = json!({"operator": "hodge", "method": "hsim", "count": 24, "tolerance": tolerance, "precision": precision});
                let parameters = EigenbasisParameters::parse(&parameters).unwrap();
                let mut basis = parameters.run(&mesh, &Unwatched).unwrap();
                basis.metadata = json!({"parameters": parameters.canonical()}).into();
                let outcome = judge(&basis, &mesh, None, &parameters, &Unwatched).unwrap();
                assert!(outcome.findings.is_empty(), "{shape} {precision}: {:?}", outcome.findings);
            }
            let parameters =
                json!({"operator": "hodge", "method": "hsim", "count": 24, "tolerance": 1e-6, "precision": "f64"});
            let parameters = EigenbasisParameters::parse(&parameters).unwrap();
            let (product, basis) = (parameters.canonical(), parameters.run(&mesh, &Unwatched).unwrap());
            let mut basis = Basis { metadata: json!({"parameters": product}).into(), ..basis };
            let problem = problem_of(&basis, None).unwrap();
            assert!(problem.is_hodge());
            let outcome = judge(&basis, &mesh, None, &problem, &Unwatched).unwrap();
            assert!(outcome.findings.is_empty(), "{shape}: {:?}", outcome.findings);
            assert!(outcome.proven.is_some_and(|proven| proven + 6 >= basis.count()), "{shape}: {outcome:?}");
            assert_eq!(basis.eigenvalues.iter().filter(|value| **value == 0.0).count(), harmonic);
            // A value a bit too high, or too low, is none of its field.
            for factor in [1.001, 0.999] {
                let mut altered = basis.clone();
                altered.eigenvalues[8..].iter_mut().for_each(|value| *value *= factor);
                let outcome = judge(&altered, &mesh, None, &problem, &Unwatched).unwrap();
                let wrong = outcome.findings.iter().any(|finding| matches!(finding, Finding::Quotient { .. }));
                assert!(wrong, "{shape}: {:?}", outcome.findings);
            }
            // A field less, and nothing else altered: the count finds it missing.
            let columns = basis.lift::<f64>(0..24).unwrap();
            basis.eigenvalues.remove(5);
            basis.certificate.residuals.remove(5);
            basis.certificate.bounds.remove(5);
            let rows = columns.len() / 24;
            let kept = [&columns[..5 * rows], &columns[6 * rows..]].concat();
            let kept = chladni_algebra::DenseMatrix::from_columns(rows, 23, kept);
            basis.functions = Functions::Dense(DenseFunctions::from_columns(&kept, Precision::F64));
            let outcome = judge(&basis, &mesh, None, &problem, &Unwatched).unwrap();
            assert_eq!(outcome.verdict(), "refuted", "{shape}: {:?}", outcome.findings);
        }
    }

    #[test]
    fn modes_are_confirmed_and_what_was_altered_is_refuted() {
        let mesh = generate(Shape::Torus, 500).unwrap();
        for clamped in [vec![], vec![0, 1, 2, 3, 10, 11]] {
            let parameters = json!({"count": 30, "thickness": 0.05, "clamped": clamped, "clamped_rotations": !clamped.is_empty(), "tolerance": 1e-6});
            let parameters = VibrationBasisParameters::parse(&parameters).unwrap();
            let modes = match parameters.run(&mesh, &Unwatched).unwrap() {
                Product::VibrationBasis(modes) => modes,
                other => panic!("{:?}", other.kind()),
            };
            let outcome = judge_modes(&modes, &mesh, None, &parameters, &Unwatched).unwrap();
            assert!(outcome.findings.is_empty(), "{clamped:?}: {:?}", outcome.findings);
            assert!(outcome.proven.is_some_and(|proven| proven + 6 >= modes.count()), "{clamped:?}: {outcome:?}");
            let told = modes_receipt(&modes, &parameters, &outcome, (&json!({}), ""), 0.0);
            assert_eq!(told["boundary"], if clamped.is_empty() { "free" } else { "clamped" });
            let judged = |altered: &ModalBasis| judge_modes(altered, &mesh, None, &parameters, &Unwatched).unwrap();
            let mut altered = ModalBasis::clone(&modes);
            altered.eigenvalues[20] *= 1.001;
            assert_eq!(judged(&altered).verdict(), "refuted");
            let mut altered = ModalBasis::clone(&modes);
            altered.masses[7] *= 1.001;
            assert_eq!(judged(&altered).verdict(), "refuted");
            // Of another object: thicker.
            let thicker = VibrationBasisParameters { thickness: Some(0.06), ..parameters.clone() };
            assert_eq!(judge_modes(&modes, &mesh, None, &thicker, &Unwatched).unwrap().verdict(), "refuted");
        }
    }
}
