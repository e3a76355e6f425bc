//! The operator `hodge`: exact eigenfields of the Hodge–Laplacian, from two scalar spectra.

use chladni_base::Monitor;
use chladni_mesh::TriangleMesh;
use chladni_spectral::basis::{Basis, Certificate, DenseFunctions, Functions, Precision};
use chladni_spectral::field::{FieldSurface, HarmonicError, harmonic_fields};
use chladni_spectral::operator::hodge::{FieldBoundary, hodge_problem};
use chladni_spectral::operator::{MassKind, MassMatrix, OperatorError, OperatorParameters};
use chladni_spectral::spectrum::hodge::{FieldPart, hodge_spectrum, inverse_iteration_bytes};
use chladni_spectral::spectrum::hsim::{HsimError, HsimParameters, Selection, Variant};

use super::exact::residuals_as_stored;
use super::{Exact, Method, StorageKind, value};
use crate::{JobError, ParameterError};

/// Checks that nothing is asked for that only functions have.
pub fn check(method: &Method, operator: &OperatorParameters) -> Result<(), ParameterError> {
    let Method::Exact(exact) = method else {
        return Err(value("method", "the operator \"hodge\" needs the method \"hsim\"".to_owned()));
    };
    let refusal = match (exact.solver.variant, exact.solver.selection, exact.storage) {
        (Variant::Random | Variant::Bathe | Variant::Published, _, _) => {
            Some(("method", "the operator \"hodge\" needs the method \"hsim\" in its variant \"sliced\""))
        }
        (_, Selection::Below { .. }, _) => Some(("below", "the operator \"hodge\" needs a count")),
        (_, Selection::Between { .. }, _) => Some(("between", "the operator \"hodge\" needs a count")),
        (_, _, StorageKind::Compact) => Some(("storage", "eigenfields of \"hodge\" are stored densely")),
        _ if operator.mass != MassKind::Barycentric => Some(("mass", "the operator \"hodge\" has a mass of its own")),
        _ => None,
    };
    refusal.map_or(Ok(()), |(name, reason)| Err(value(name, reason.to_owned())))
}

/// An estimate of the memory of the work, in bytes: the larger of the scalar problems has an unknown for each edge;
/// fields are held in double precision and as they are stored.
pub fn memory_bytes(exact: &Exact, vertices: u64, faces: u64) -> u64 {
    let edges = (3 * faces).div_ceil(2).max(vertices);
    let (fields, half) = (exact.most_pairs() as u64, exact.most_pairs() as u64 / 2);
    let scalar = Exact {
        solver: HsimParameters { selection: Selection::Count(half as usize + half as usize / 10 + 8), ..exact.solver },
        ..exact.clone()
    };
    let graph = faces * 400;
    let results = 2 * faces * fields * (8 + exact.precision.unwrap_or(Precision::F64).bytes() as u64)
        + 8 * (vertices + edges) * half;
    graph + results + scalar.memory_bytes(edges) + edges * 160 + inverse_iteration_bytes(faces)
}

/// Computes the basis: `2F` rows, two for each face in its frame, with the area of the face as the mass of both.
pub fn run(
    exact: &Exact,
    mesh: &TriangleMesh,
    boundary: FieldBoundary,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Basis, JobError> {
    monitor.stage("operator");
    let refused = |reason: String| JobError::Operator(OperatorError::Parameter { name: "operator", reason });
    let surface = FieldSurface::new(mesh.clone()).map_err(|error| refused(error.to_string()))?;
    monitor.checkpoint()?;
    monitor.stage("harmonic");
    let harmonic = harmonic_fields(&surface, boundary, monitor).map_err(|error| match error {
        HarmonicError::Cancelled(cancelled) => JobError::Cancelled(cancelled),
        other => refused(other.to_string()),
    })?;
    let (dual, frames) = (surface.dual(), surface.frames());
    let count = exact.most_pairs();
    let parameters = HsimParameters { seed, ..exact.solver };
    let mut found = hodge_spectrum(mesh, (dual, frames), boundary, &harmonic, count, &parameters, monitor)?;
    if found.values.len() < count {
        return Err(HsimError::Count { wanted: count, most: found.values.len() }.into());
    }
    if !found.complete {
        let reason = "the inertia counts of gradients and co-gradients do not cover the fields".to_owned();
        return Err(HsimError::Unproven { reason }.into());
    }
    let part = |part: FieldPart| found.parts.iter().filter(|own| **own == part).count();
    let metadata = serde_json::json!({"operator": {
        "hodge": {
            "harmonic": part(FieldPart::Harmonic),
            "gradients": part(FieldPart::Gradient),
            "co_gradients": part(FieldPart::CoGradient),
            "parts": found.parts,
            "inertia": {"gradients": found.inertia[0], "co_gradients": found.inertia[1]},
        },
        "zero_area_faces": frames.degenerate_faces(),
    }});
    let precision = exact.precision.unwrap_or(Precision::F64);
    if precision == Precision::F32 {
        let problem = hodge_problem(mesh, dual, frames, boundary);
        found.residuals = residuals_as_stored((&found.fields, &found.values, &found.residuals), &problem, monitor)?;
    }
    let area = frames.area();
    // Where rounding left no room for what was asked for, the certificate says what was met.
    let met = found.residuals.iter().copied().fold(exact.solver.tolerance, f64::max);
    Ok(Basis {
        functions: Functions::Dense(DenseFunctions::from_panels(found.fields, precision)),
        eigenvalues: found.values,
        mass: MassMatrix::Diagonal(frames.areas().iter().flat_map(|a| [a * area; 2]).collect()),
        certificate: Certificate {
            complete: Some(found.complete),
            residuals: found.residuals,
            bounds: found.bounds,
            orthonormality_defect: found.orthonormality_defect,
            tolerance: Some(met),
            levels: found.levels,
            ..Certificate::default()
        },
        metadata: metadata.into(),
    })
}

#[cfg(test)]
mod tests {
    use crate::EigenbasisParameters;
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use serde_json::json;

    #[test]
    fn a_basis_of_eigenfields_has_two_rows_for_each_face_and_its_parts_in_the_metadata() {
        let mesh = generate(Shape::Torus, 300).unwrap();
        let json = json!({"operator": "hodge", "method": "hsim", "count": 20, "tolerance": 1e-6});
        let parameters = EigenbasisParameters::parse(&json).unwrap();
        let basis = parameters.run(&mesh, &Unwatched).unwrap();
        assert_eq!((basis.vertices(), basis.mass.size(), basis.count()), (1200, 1200, 20));
        assert_eq!(basis.metadata.json()["operator"]["hodge"]["harmonic"], 2);
        assert_eq!(basis.certificate.complete, Some(true));
        assert!(basis.certificate.tolerance == Some(1e-6) && basis.certificate.residuals.iter().all(|r| *r <= 1e-6));
        let parts = basis.metadata.json()["operator"]["hodge"]["parts"].as_array().unwrap();
        let count = |name: &str| parts.iter().filter(|part| *part == name).count() as u64;
        assert_eq!((parts.len(), count("harmonic")), (20, 2));
        assert_eq!(basis.metadata.json()["operator"]["hodge"]["gradients"], count("gradient"));
        // Of what was counted, at least the fields that are there.
        for (part, kernel) in [("gradients", 1), ("co_gradients", 1)] {
            let counts = basis.metadata.json()["operator"]["hodge"]["inertia"][part].as_array().unwrap().clone();
            let most = counts.iter().filter_map(|count| count["below"].as_u64()).max().unwrap();
            assert!(
                most >= basis.metadata.json()["operator"]["hodge"][part].as_u64().unwrap() + kernel,
                "{part}: {counts:?}"
            );
        }
        assert!(basis.eigenvalues[1] == 0.0 && basis.eigenvalues[2] > 0.0);
        // Along a boundary and across it: other fields, each with its own name, of which one is that of functions too.
        let mut annulus = generate(Shape::Rectangle, 300).unwrap();
        let plate = annulus.clone();
        annulus.faces.retain(|f| {
            let centre = [0, 1].map(|i| f.iter().map(|&v| plate.positions[v as usize][i]).sum::<f64>() / 3.0);
            (centre[0] - 0.8).abs() > 0.2 || (centre[1] - 0.5).abs() > 0.2
        });
        let of = |boundary: &str| {
            let json =
                json!({"operator": "hodge", "method": "hsim", "count": 6, "tolerance": 1e-6, "boundary": boundary});
            EigenbasisParameters::parse(&json).unwrap()
        };
        let [along, across] = ["tangential", "normal"].map(|boundary| of(boundary).run(&annulus, &Unwatched).unwrap());
        for basis in [&along, &across] {
            assert_eq!(basis.metadata.json()["operator"]["hodge"]["harmonic"], 1);
            assert!(basis.certificate.complete == Some(true) && basis.eigenvalues[0] == 0.0);
        }
        assert!((across.eigenvalues[1] / along.eigenvalues[1] - 1.0).abs() > 1e-6);
        assert_eq!(of("tangential"), of("neumann"));
        for (basis, boundary) in [(&along, "tangential"), (&across, "normal")] {
            let judged = |parameters: &EigenbasisParameters| {
                crate::verification::judge(basis, &annulus, None, parameters, &Unwatched).unwrap().findings
            };
            assert!(judged(&of(boundary)).is_empty(), "{boundary}: {:?}", judged(&of(boundary)));
            let other = if boundary == "normal" { "tangential" } else { "normal" };
            assert!(!judged(&of(other)).is_empty(), "{boundary} as {other}");
        }
        // More fields than there are; a surface that is none.
        let all = EigenbasisParameters::parse(&json!({"operator": "hodge", "method": "hsim", "count": 2000})).unwrap();
        assert!(all.run(&mesh, &Unwatched).is_err());
        let mut broken = mesh;
        broken.faces.push(broken.faces[0]);
        let error = parameters.run(&broken, &Unwatched).unwrap_err().to_string();
        assert!(error.contains("edge from vertex"), "{error}");
    }
}
