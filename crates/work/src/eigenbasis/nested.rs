//! The operators `volume` and `graph`: their rows lie in no surface, so that they have a start of their own, and a
//! solid local functions of its own.

use chladni_base::Monitor;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::Basis;
use chladni_spectral::operator::{Laplacian, MassKind, MeshOperator, OperatorKind, OperatorParameters, graph};
use chladni_spectral::spectrum::hsim::{Selection, Variant};
use chladni_spectral::spectrum::nested::RowPositions;
use chladni_spectral::spectrum::{Domain, Space};

use super::{Approximate, Auto, Exact, Method, StorageKind, value};
use crate::{JobError, MeshSize, ParameterError};

/// Whether an operator is one of them.
pub fn is_nested(operator: &OperatorKind) -> bool {
    matches!(operator, OperatorKind::Volume | OperatorKind::Graph)
}

fn name(operator: &OperatorKind) -> &'static str {
    if *operator == OperatorKind::Volume { "volume" } else { "graph" }
}

/// What the functions of an operator live on.
pub fn domain<'a>(operator: &OperatorKind, mesh: &'a TriangleMesh, solid: Option<&'a TetMesh>) -> Domain<'a> {
    match solid {
        Some(solid) if *operator == OperatorKind::Volume => Domain::Solid(solid),
        _ => Domain::Surface(mesh),
    }
}

/// Checks that nothing is asked for that only operators on surfaces have.
///
/// # Errors
/// [`ParameterError::Value`] names it.
pub fn check(method: &Method, parameters: &OperatorParameters) -> Result<(), ParameterError> {
    let name = name(&parameters.operator);
    let exact = match method {
        Method::Exact(exact) => exact,
        Method::Approximate(approximate) if parameters.operator == OperatorKind::Volume => {
            if matches!(approximate.space, Space::Radial(_)) {
                let reason = "the operator \"volume\" needs the construction \"heat\": functions of the distance alone err by half of an eigenvalue in solids";
                return Err(value("construction", reason.to_owned()));
            }
            return check_mass(parameters);
        }
        Method::Auto(_) if parameters.operator == OperatorKind::Volume => return check_mass(parameters),
        _ => {
            let reason = format!(
                "the operator \"{name}\" needs the method \"hsim\": local functions to approximate with are made on surfaces and in solids"
            );
            return Err(value("method", reason));
        }
    };
    let methods = match parameters.operator {
        OperatorKind::Volume => "needs one of the methods \"hsim\" and \"approximate\"",
        _ => "needs the method \"hsim\"",
    };
    let refusal = match (exact.solver.variant, exact.solver.selection, exact.storage) {
        (Variant::Random | Variant::Bathe, _, _) => Some(("method", methods)),
        (Variant::Published, _, _) => Some(("variant", "needs the variant \"sliced\"")),
        (_, Selection::Below { .. }, _) => Some(("below", "needs a count, not a bound")),
        (_, Selection::Between { .. }, _) => Some(("between", "needs a count, not an interval")),
        (_, _, StorageKind::Compact) => Some(("storage", "has its eigenfunctions stored densely")),
        _ if exact.solver.levels.is_some() => Some(("levels", "has levels of its own")),
        _ if exact.solver.sigma.is_some() => Some(("sigma", "has levels of its own")),
        _ => None,
    };
    if let Some((parameter, reason)) = refusal {
        return Err(value(parameter, format!("the operator \"{name}\" {reason}")));
    }
    match parameters.operator {
        OperatorKind::Graph => Ok(graph::check(parameters)?),
        _ => check_mass(parameters),
    }
}

/// Checks the mass in a solid.
fn check_mass(parameters: &OperatorParameters) -> Result<(), ParameterError> {
    match parameters.mass {
        MassKind::Voronoi => Err(value(
            "mass",
            "the operator \"volume\" supports the masses \"barycentric\" and \"consistent\"".to_owned(),
        )),
        MassKind::Barycentric | MassKind::Consistent => Ok(()),
    }
}

/// The vertices that the operator acts on.
///
/// # Errors
/// [`ParameterError::Value`] where it needs a solid and there is none.
pub fn vertices(operator: &OperatorKind, mesh: MeshSize) -> Result<usize, ParameterError> {
    match operator {
        OperatorKind::Volume if mesh.tetrahedra == 0 => Err(no_solid()),
        OperatorKind::Volume => Ok(mesh.solid_vertices),
        _ => Ok(mesh.vertices),
    }
}

/// Why the operator `volume` cannot be made of a surface.
pub(crate) fn no_solid() -> ParameterError {
    value("operator", "\"volume\" needs a solid, and the mesh has no tetrahedra".to_owned())
}

/// An estimate of the memory of the work by any method, in bytes, beside the mesh.
pub fn bytes_of(operator: &OperatorKind, method: &Method, mesh: MeshSize) -> u64 {
    let approximately = |approximate: &Approximate| {
        assembly_bytes(mesh) + approximate.memory_bytes_in_solid(mesh.solid_vertices as u64)
    };
    match method {
        Method::Exact(exact) => memory_bytes(operator, exact, mesh),
        Method::Approximate(approximate) => approximately(approximate),
        Method::Auto(auto) => {
            let exact = memory_bytes(operator, &auto.exact, mesh);
            match auto.is_exact_in_solid(mesh.solid_vertices) {
                true => exact,
                false if Auto::may_become_exact(exact) => exact.max(approximately(&auto.approximate)),
                false => approximately(&auto.approximate),
            }
        }
    }
}

/// What tetrahedra and matrices take: shapes and corners of tetrahedra; about fifteen entries a row of stiffness, mass
/// and a copy of either.
fn assembly_bytes(mesh: MeshSize) -> u64 {
    176 * mesh.tetrahedra as u64 + mesh.solid_vertices as u64 * 15 * 40
}

/// An estimate of the memory of the work by the exact method, in bytes, beside the mesh.
pub fn memory_bytes(operator: &OperatorKind, exact: &Exact, mesh: MeshSize) -> u64 {
    if *operator != OperatorKind::Volume {
        let n = mesh.vertices as u64;
        return 300 * n + exact.memory_bytes(n);
    }
    let n = mesh.solid_vertices as u64;
    // A factor in space fills in faster than one of a surface, which is counted too.
    let fill = (4.0 * (n as f64).powf(4.0 / 3.0)) as u64 * 20;
    assembly_bytes(mesh) + fill + exact.memory_bytes(n)
}

/// Computes the basis: a row for each vertex of the solid, those of its surface first, or of the mesh.
///
/// # Errors
/// [`JobError`]: pairs that do not converge, cancellation.
pub fn run(
    exact: &Exact,
    operator: &MeshOperator,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Basis, JobError> {
    let (places, vertices) = match (operator.report.laplacian, solid) {
        (Laplacian::Volume, Some(solid)) => (RowPositions::Positions(&solid.positions), solid.positions.len()),
        _ => (RowPositions::Nowhere, mesh.positions.len()),
    };
    exact.run_nested(operator, places, vertices, seed, monitor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EigenbasisParameters, Work};
    use chladni_base::Unwatched;
    use chladni_mesh::read::RawMesh;
    use chladni_mesh::shape::{Shape, generate};
    use chladni_mesh::solid::check_body;
    use serde_json::json;

    #[test]
    fn what_only_surfaces_have_is_refused_by_name() {
        for (parameters, name) in [
            (json!({"construction": "radial", "operator": "volume"}), "construction"),
            (json!({"method": "approximate", "mass": "voronoi", "operator": "volume"}), "mass"),
            (json!({"method": "approximate", "operator": "graph"}), "method"),
            (json!({"method": "sim", "operator": "volume"}), "method"),
            (json!({"variant": "published", "operator": "volume"}), "variant"),
            (json!({"below": 2.0, "operator": "volume"}), "below"),
            (json!({"between": [0.0, 2.0], "operator": "graph"}), "between"),
            (json!({"storage": "compact", "operator": "graph"}), "storage"),
            (json!({"levels": 1, "operator": "graph"}), "levels"),
            (json!({"mass": "voronoi", "operator": "volume"}), "mass"),
            (json!({"mass": "consistent", "operator": "graph"}), "mass"),
            (json!({"boundary": "dirichlet", "operator": "graph"}), "boundary"),
        ] {
            let error = EigenbasisParameters::parse(&parameters).unwrap_err();
            assert!(matches!(error, ParameterError::Value { name: found, .. } if found == name), "{error}");
        }
        let volume = EigenbasisParameters::parse(&json!({"operator": "volume", "count": 5})).unwrap();
        assert_eq!(volume.canonical()["method"], "auto");
        assert_eq!(EigenbasisParameters::parse(&volume.canonical()).unwrap(), volume);
        let surface = generate(Shape::Sphere, 200).unwrap();
        let refused = Work::check_mesh(&volume, MeshSize::from(&surface)).unwrap_err().to_string();
        assert_eq!(refused, "parameter \"operator\": \"volume\" needs a solid, and the mesh has no tetrahedra");
        let error = volume.run(&surface, &Unwatched).unwrap_err();
        assert_eq!(error.kind(), "invalid-parameters");
    }

    #[test]
    fn a_solid_is_solved_inside_or_as_its_skin_and_says_which() {
        // A cube around its centre: twelve tetrahedra, nine vertices.
        let mut positions: Vec<[f64; 3]> = vec![[0.5; 3]];
        positions.extend((0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from)));
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let tetrahedra = sides.iter().flat_map(|&[a, b, c, d]| [[0, a + 1, b + 1, c + 1], [0, a + 1, c + 1, d + 1]]);
        let raw = RawMesh { positions, tetrahedra: tetrahedra.collect(), ..RawMesh::default() };
        let body = check_body(raw, &Default::default()).unwrap();
        let (mesh, solid) = (body.surface.mesh, body.solid);
        let run = |operator: &str| {
            let parameters = EigenbasisParameters::parse(&json!({"operator": operator, "count": 4})).unwrap();
            parameters.run_body(&mesh, solid.as_ref(), &Unwatched).unwrap()
        };
        let (inside, skin) = (run("volume"), run("auto"));
        let rows = |product: &chladni_spectral::basis::Product| match product {
            chladni_spectral::basis::Product::Eigenbasis(basis) => {
                (basis.vertices(), basis.metadata.clone(), basis.mass.lumped())
            }
            _ => panic!("an eigenbasis"),
        };
        let (rows_inside, metadata, mass) = rows(&inside);
        assert_eq!((rows_inside, &metadata.json()["operator"]["domain"]), (9, &json!("solid")));
        assert_eq!(metadata.json()["operator"]["laplacian"], "volume");
        assert!((mass.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        let (rows_outside, metadata, mass) = rows(&skin);
        assert_eq!((rows_outside, &metadata.json()["operator"]["domain"]), (8, &json!("surface_of_solid")));
        assert!((mass.iter().sum::<f64>() - 6.0).abs() < 1e-14);
    }
}
