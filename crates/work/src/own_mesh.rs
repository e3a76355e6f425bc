//! Whether a mesh is the one that a basis of a file lives on: a file has no positions, but the mass of every vertex.

use crate::JobError;
use crate::eigenbasis::no_solid;
use chladni_base::Monitor;
use chladni_mesh::measure::face_area;
use chladni_mesh::{TetMesh, TriangleMesh};
use chladni_spectral::basis::{Basis, ProvenanceError, RowsOf};
use chladni_spectral::operator::{self, Boundary, Laplacian, MassKind, MeshOperator, OperatorKind, OperatorParameters};

/// By how much positions may differ that went through a file, next to the largest coordinate: single precision, or six
/// digits of a text.
const ROUNDED: f64 = 4e-6;

/// Why a basis is none of a mesh.
#[derive(Debug, thiserror::Error)]
pub enum StrangeMesh {
    /// It has other numbers of rows.
    #[error("the basis has {rows} rows, but the mesh has {vertices} vertices")]
    Rows {
        /// Rows of the basis.
        rows: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A vertex has another mass: the mesh has another size or shape, or its vertices another order.
    #[error(
        "the basis does not belong to this mesh: vertex {vertex} has the mass {found} in the basis and {expected} in the mesh, which may be scaled, changed or numbered differently"
    )]
    Mass {
        /// The vertex of the mesh as it is kept.
        vertex: usize,
        /// Its mass in the basis.
        found: f64,
        /// That in the mesh.
        expected: f64,
    },
    /// A face has another area.
    #[error(
        "the basis does not belong to this mesh: face {face} has the area {found} in the basis and {expected} in the mesh, which may be scaled, changed or numbered differently"
    )]
    Area {
        /// The face of the mesh as it is kept.
        face: usize,
        /// Its area in the basis.
        found: f64,
        /// That in the mesh.
        expected: f64,
    },
    /// The operator of the basis cannot be made on the mesh.
    #[error("the basis does not belong to this mesh: {0}")]
    Operator(JobError),
    /// The basis does not say what to compare.
    #[error("whether the basis is of this mesh cannot be checked: {0}")]
    Provenance(#[from] ProvenanceError),
}

/// Checks that a basis lives on this mesh, or on the solid whose surface it is, by the mass of every vertex. Positions
/// may be rounded as files round them, and moved or turned as a whole. A basis of matrices says that it came without a
/// mesh, and is taken for any of as many vertices.
///
/// Meshes whose vertices all have one mass are alike by it, however they are numbered.
///
/// # Errors
/// [`StrangeMesh`] names the first vertex that differs, or what the basis does not say.
pub fn check_own_mesh(
    basis: &Basis,
    mesh: &TriangleMesh,
    solid: Option<&TetMesh>,
    monitor: &dyn Monitor,
) -> Result<(), StrangeMesh> {
    let rows_of = basis.metadata.rows_of()?;
    if rows_of == RowsOf::Fields {
        return check_areas(basis, mesh);
    }
    let solid = solid.filter(|_| rows_of == RowsOf::Solid);
    let vertices = solid.map_or(mesh.positions.len(), |solid| solid.positions.len());
    if basis.vertices() != vertices {
        return Err(StrangeMesh::Rows { rows: basis.vertices(), vertices });
    }
    if rows_of == RowsOf::Matrix {
        return Ok(());
    }
    let laplacian = basis.metadata.laplacian()?;
    let operator =
        assembled(laplacian, basis.metadata.mass()?, (mesh, solid), monitor).map_err(StrangeMesh::Operator)?;
    let ones = vec![1.0; vertices];
    let expected = operator.laplacian().mass.scaled(operator.problem.area).multiply(&ones);
    let found = basis.mass.multiply(&ones);
    let room = room(mesh, solid);
    let differs = |v: &usize| !((found[*v] - expected[*v]).abs() <= room[*v] + ROUNDED * expected[*v].abs());
    let Some(first) = (0..vertices).find(differs) else { return Ok(()) };
    // An intrinsic triangulation, or one of points, may turn edges over where positions are rounded, and has other
    // masses around these alone.
    let rounded = laplacian == Laplacian::Robust || mesh.faces.is_empty();
    let most: f64 = (0..vertices).filter(differs).map(|v| expected[v].abs()).sum();
    if rounded && most < 0.5 * expected.iter().map(|mass| mass.abs()).sum::<f64>() {
        return Ok(());
    }
    Err(StrangeMesh::Mass { vertex: first, found: found[first], expected: expected[first] })
}

/// The Laplacian whose mass a basis has, made anew.
fn assembled(
    laplacian: Laplacian,
    mass: MassKind,
    (mesh, solid): (&TriangleMesh, Option<&TetMesh>),
    monitor: &dyn Monitor,
) -> Result<MeshOperator, JobError> {
    let operator = match laplacian {
        Laplacian::Volume => {
            let solid = solid.ok_or_else(no_solid)?;
            return Ok(operator::volume::assemble(solid, mass, Boundary::Neumann, monitor)?);
        }
        Laplacian::Cotangent => OperatorKind::Laplace,
        Laplacian::Polygon => OperatorKind::Polygon,
        Laplacian::Robust => OperatorKind::Robust,
        Laplacian::Graph => OperatorKind::Graph,
    };
    Ok(operator::assemble(mesh, &OperatorParameters { operator, mass, boundary: Boundary::Neumann }, monitor)?)
}

/// By how much rounded positions change the mass of each vertex: for each of its triangles by an edge times what a
/// coordinate may be off, for each of its tetrahedra by the square of an edge times that.
fn room(mesh: &TriangleMesh, solid: Option<&TetMesh>) -> Vec<f64> {
    let positions = solid.map_or(&mesh.positions, |solid| &solid.positions);
    let off = ROUNDED * positions.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let mut room = vec![0.0; positions.len()];
    let longest = |corners: &[u32]| {
        let pairs = corners.iter().flat_map(|&a| corners.iter().map(move |&b| (a as usize, b as usize)));
        pairs.map(|(a, b)| distance(positions, a, b)).fold(0.0, f64::max)
    };
    match solid {
        Some(solid) => solid.tetrahedra.iter().for_each(|corners| {
            let length = longest(corners);
            corners.iter().for_each(|&v| room[v as usize] += off * length * length);
        }),
        None => mesh.faces.iter().for_each(|corners| {
            let length = longest(corners);
            corners.iter().for_each(|&v| room[v as usize] += off * length);
        }),
    }
    room
}

fn distance(positions: &[[f64; 3]], a: usize, b: usize) -> f64 {
    (0..3).map(|k| (positions[a][k] - positions[b][k]).powi(2)).sum::<f64>().sqrt()
}

/// The same for eigenfields, two numbers for each face, whose mass is the area of the face.
fn check_areas(basis: &Basis, mesh: &TriangleMesh) -> Result<(), StrangeMesh> {
    let rows = 2 * mesh.faces.len();
    if basis.vertices() != rows {
        return Err(StrangeMesh::Rows { rows: basis.vertices(), vertices: mesh.positions.len() });
    }
    let found = basis.mass.multiply(&vec![1.0; rows]);
    let positions = &mesh.positions;
    let off = ROUNDED * positions.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    for (face, corners) in mesh.faces.iter().enumerate() {
        let [a, b, c] = corners.map(|vertex| vertex as usize);
        let (expected, edges) = (face_area(mesh, corners), distance(positions, a, b) + distance(positions, a, c));
        if !((found[2 * face] - expected).abs() <= ROUNDED * expected + 4.0 * off * edges) {
            return Err(StrangeMesh::Area { face, found: found[2 * face], expected });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    use crate::verification::problem_of;
    use crate::{EigenbasisParameters, Work};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};
    use chladni_spectral::basis::Product;
    use chladni_spectral::formats::npz;
    use chladni_spectral::spectrum::heat::HeatParameters;
    use chladni_spectral::spectrum::{ApproximationParameters, Space, approximate};
    use serde_json::{Value, json};

    /// The basis with another text in place of one of its metadata.
    fn saying(basis: &Basis, this: &str, instead: &str) -> Basis {
        let said = basis.metadata.json().to_string();
        assert!(said.contains(this), "{said}");
        let metadata: Value = serde_json::from_str(&said.replace(this, instead)).unwrap();
        Basis { metadata: metadata.into(), ..basis.clone() }
    }

    #[test]
    fn a_basis_that_does_not_say_what_it_is_of_is_refused_by_name() {
        let mesh = generate(Shape::Sphere, 300).unwrap();
        for parameters in
            [json!({"count": 6, "operator": "laplace"}), json!({"method": "hsim", "count": 6, "operator": "graph"})]
        {
            let basis = solved(&mesh, &parameters);
            let refused = |this: &str, instead: &str| {
                check_own_mesh(&saying(&basis, this, instead), &mesh, None, &Unwatched)
                    .map_err(|error| error.to_string())
            };
            let none = refused("\"laplacian\"", "\"another\"").unwrap_err();
            assert!(
                none.contains("with which Laplacian it was made: its metadata have no \"operator.laplacian\""),
                "{none}"
            );
            let unknown = refused("\"laplacian\":\"", "\"laplacian\":\"un").unwrap_err();
            assert!(unknown.contains("\"operator.laplacian\" of its metadata is \"un"), "{unknown}");
            let none = refused("\"mass\"", "\"another\"").unwrap_err();
            assert!(none.contains("with which mass it was made: its metadata have no \"parameters.mass\""), "{none}");
            let bare = Basis { metadata: json!({}).into(), ..Basis::clone(&basis) };
            assert!(matches!(check_own_mesh(&bare, &mesh, None, &Unwatched), Err(StrangeMesh::Provenance(_))));
        }
    }

    #[test]
    fn bases_that_no_job_made_are_checked_too() {
        let mesh = generate(Shape::Torus, 600).unwrap();
        let parameters = ApproximationParameters {
            count: 6,
            dimension: 60,
            space: Space::Heat(HeatParameters::default()),
            goal: None,
            certify: false,
            seed: 0,
        };
        let stretched = moved(&mesh, |[x, y, z]| [x, y, 3.0 * z]);
        for mass in [MassKind::Barycentric, MassKind::Consistent] {
            let asked = OperatorParameters { mass, ..OperatorParameters::default() };
            let operator = operator::assemble(&mesh, &asked, &Unwatched).unwrap();
            let basis = approximate(&mesh, &operator, &parameters, &Unwatched).unwrap();
            let mut file = Cursor::new(Vec::new());
            npz::write(&basis, &mut file).unwrap();
            let read = npz::read(file.get_ref()).unwrap();
            assert_eq!(read.metadata, basis.metadata);
            check_own_mesh(&read, &mesh, None, &Unwatched).unwrap();
            let refused = check_own_mesh(&read, &stretched, None, &Unwatched);
            assert!(matches!(refused, Err(StrangeMesh::Mass { .. })), "{refused:?}");
            // It says enough to be judged, too.
            let problem = problem_of(&read, None).unwrap();
            assert_eq!(problem.canonical()["mass"], serde_json::to_value(mass).unwrap());
        }
        let short = chladni_spectral::Mesh::new(mesh.positions.clone(), mesh.faces.clone()).unwrap();
        let basis = short.eigen(6).approximate(0.05).unwrap();
        check_own_mesh(&basis, short.surface(), None, &Unwatched).unwrap();
        assert!(matches!(check_own_mesh(&basis, &stretched, None, &Unwatched), Err(StrangeMesh::Mass { .. })));
    }

    fn solved(mesh: &TriangleMesh, parameters: &Value) -> std::sync::Arc<Basis> {
        let parameters = EigenbasisParameters::parse(parameters).unwrap();
        let Product::Eigenbasis(basis) = Work::run(&parameters, mesh, &Unwatched).unwrap() else { panic!() };
        basis
    }

    /// The mesh with its vertices in another order.
    fn permuted(mesh: &TriangleMesh) -> TriangleMesh {
        let n = mesh.positions.len();
        // A step that is prime to `n` visits all.
        let step =
            (2..n).map(|k| n / 3 + k).find(|k| (2..=*k).all(|d| !k.is_multiple_of(d) || !n.is_multiple_of(d))).unwrap();
        let place = |v: usize| (v * step + 5) % n;
        let mut positions = vec![[0.0; 3]; n];
        mesh.positions.iter().enumerate().for_each(|(v, at)| positions[place(v)] = *at);
        let faces = mesh.faces.iter().map(|face| face.map(|v| place(v as usize) as u32)).collect();
        TriangleMesh { positions, faces, ..Default::default() }
    }

    fn moved(mesh: &TriangleMesh, move_one: impl Fn([f64; 3]) -> [f64; 3]) -> TriangleMesh {
        let positions = mesh.positions.iter().map(|at| move_one(*at)).collect();
        TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() }
    }

    #[test]
    fn a_basis_is_taken_for_its_own_mesh_alone() {
        let mesh = generate(Shape::Knot, 800).unwrap();
        for parameters in [
            json!({"method": "hsim", "count": 6, "operator": "laplace"}),
            json!({"method": "hsim", "count": 6, "operator": "robust"}),
            json!({"method": "hsim", "count": 6, "mass": "consistent"}),
            json!({"method": "hsim", "count": 6, "operator": {"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}}),
            json!({"method": "hsim", "count": 6, "operator": "hodge"}),
        ] {
            let basis = solved(&mesh, &parameters);
            let check = |mesh: &TriangleMesh| check_own_mesh(&basis, mesh, None, &Unwatched);
            check(&mesh).unwrap();
            // As a file in single precision has it, and six decimals of a text.
            check(&moved(&mesh, |at| at.map(|x| f64::from(x as f32)))).unwrap();
            check(&moved(&mesh, |at| at.map(|x| (1e6 * x).round() / 1e6))).unwrap();
            // Moved and turned as a whole.
            check(&moved(&mesh, |[x, y, z]| [3.0 - y, x, z + 1.0])).unwrap();
            let hodge = parameters["operator"] == "hodge";
            let refused = |mesh: &TriangleMesh| match check(mesh) {
                Err(StrangeMesh::Mass { found, expected, .. }) => !hodge && found != expected,
                Err(StrangeMesh::Area { found, expected, .. }) => hodge && found != expected,
                _ => false,
            };
            assert!(refused(&moved(&mesh, |at| at.map(|x| 1.5 * x))), "{parameters}");
            assert!(refused(&moved(&mesh, |at| at.map(|x| 1.001 * x))), "{parameters}");
            if !hodge {
                assert!(refused(&permuted(&mesh)), "{parameters}");
            }
            let other = generate(Shape::Knot, 600).unwrap();
            assert!(matches!(check(&other), Err(StrangeMesh::Rows { .. })), "{parameters}");
        }
    }

    #[test]
    fn the_first_vertex_that_differs_is_named() {
        let mesh = generate(Shape::Torus, 500).unwrap();
        let basis = solved(&mesh, &json!({"method": "hsim", "count": 6}));
        let mut dented = mesh.clone();
        dented.positions[100][0] *= 1.05;
        let near: std::collections::BTreeSet<usize> =
            mesh.faces.iter().filter(|face| face.contains(&100)).flatten().map(|&v| v as usize).collect();
        match check_own_mesh(&basis, &dented, None, &Unwatched) {
            Err(StrangeMesh::Mass { vertex, .. }) => assert!(near.contains(&vertex), "{vertex} {near:?}"),
            other => panic!("{other:?}"),
        }
    }
}
