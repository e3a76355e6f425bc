//! Operators against identities, analytic spectra, each other, and hostile meshes.

use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::{Unwatched, Vector3};
use chladni_mesh::TriangleMesh;
use chladni_mesh::fixtures::{grid, sphere};
use chladni_mesh::intrinsic::Rim;
use chladni_mesh::shape::{Shape, generate, noisy};

use super::curvature::{Curvatures, curvatures, vertex_normals};
use super::*;

const PI: f64 = std::f64::consts::PI;

fn make(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind, boundary: Boundary) -> MeshOperator {
    let made = assemble(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap();
    check_form(&made.problem);
    check_form(made.laplacian());
    made
}

fn neumann(mesh: &TriangleMesh, operator: OperatorKind) -> MeshOperator {
    make(mesh, operator, MassKind::Barycentric, Boundary::Neumann)
}

/// Both matrices are well formed and symmetric to the last bit, and each row has its diagonal.
fn check_form(problem: &EigenProblem) {
    let check = |matrix: &SparseMatrix| {
        let parts = (matrix.offsets().to_vec(), matrix.indices().to_vec(), matrix.values().to_vec());
        SparseMatrix::new(matrix.rows(), matrix.columns(), parts.0, parts.1, parts.2).unwrap();
        for row in 0..matrix.rows() {
            let (columns, values) = matrix.row(row);
            assert!(columns.binary_search(&(row as u32)).is_ok());
            for (&column, &value) in columns.iter().zip(values) {
                assert_eq!(value, entry(matrix, column as usize, row), "entry ({row}, {column})");
            }
        }
    };
    check(&problem.stiffness);
    if let MassMatrix::Sparse(mass) = &problem.mass {
        check(mass);
    }
    assert!(problem.mass.lumped().iter().all(|&m| m > 0.0));
    if let Some(unknowns) = &problem.unknowns {
        assert_eq!(unknowns.len(), problem.size());
        assert!(unknowns.is_sorted_by(|a, b| a < b));
    }
}

fn entry(matrix: &SparseMatrix, row: usize, column: usize) -> f64 {
    let (columns, values) = matrix.row(row);
    columns.binary_search(&(column as u32)).map_or(0.0, |at| values[at])
}

/// The lowest eigenvalues in the units of the input.
pub(super) fn lowest(problem: &EigenProblem, count: usize) -> Vec<f64> {
    let mass = problem.mass.to_dense();
    let pairs = CpuSolver.lowest(problem.stiffness.to_dense(), mass, count, &Unwatched).unwrap();
    pairs.values.iter().map(|value| value / problem.area).collect()
}

fn assert_close(values: &[f64], expected: &[f64], relative: f64) {
    let size = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for (k, (value, truth)) in values.iter().zip(expected).enumerate() {
        let error = (value - truth).abs() / truth.abs().max(1e-6 * size);
        assert!(error <= relative, "pair {k}: {value} instead of {truth}: {error:e}");
    }
}

#[test]
fn the_rectangle_has_both_its_spectra() {
    let mesh = generate(Shape::Rectangle, 800).unwrap();
    for (boundary, from) in [(Boundary::Neumann, 0), (Boundary::Dirichlet, 1)] {
        let mut exact: Vec<f64> = (from..20)
            .flat_map(|a| (from..20).map(move |b| (f64::from(a) * PI / 1.6).powi(2) + (f64::from(b) * PI).powi(2)))
            .collect();
        exact.sort_by(f64::total_cmp);
        for (mass, bound) in [(MassKind::Barycentric, 0.04), (MassKind::Consistent, 0.06), (MassKind::Voronoi, 0.04)] {
            let made = make(&mesh, OperatorKind::Auto, mass, boundary);
            assert_eq!(made.problem.unknowns.is_some(), boundary == Boundary::Dirichlet);
            let values = lowest(&made.problem, 20);
            assert_close(&values[usize::from(from == 0)..], &exact[usize::from(from == 0)..20], bound);
            if mass == MassKind::Consistent {
                // Conforming elements with the Galerkin mass bound from above.
                assert!(values.iter().zip(&exact).all(|(value, exact)| value >= &(exact - 1e-9)));
            }
        }
    }
}

#[test]
fn the_clamped_disk_has_the_zeros_of_bessel_functions() {
    // Squares of the zeros j_{k,s}, twice for k > 0.
    let zeros = [2.404825557695773, 3.831705970207512, 5.135622301840683, 5.520078110286311, 6.380161895923983];
    let exact: Vec<f64> = [0, 1, 1, 2, 2, 3, 4, 4].iter().map(|&k: &usize| zeros[k] * zeros[k]).collect();
    let error = |vertices| {
        let mesh = generate(Shape::Disk, vertices).unwrap();
        let made = make(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Dirichlet);
        let values = lowest(&made.problem, 8);
        values.iter().zip(&exact).map(|(value, exact)| (value / exact - 1.0).abs()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(200), error(800));
    assert!(fine < 0.03, "{fine}");
    // Second order: four times the vertices, a quarter of the error.
    assert!(coarse / fine > 3.0, "{coarse} {fine}");
}

#[test]
fn a_surface_without_boundary_does_not_notice_the_condition() {
    let mesh = sphere(6);
    let made = make(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Dirichlet);
    assert_eq!((made.problem.unknowns.as_ref(), made.report.removed_vertices), (None, 0));
    let triangle = TriangleMesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2]],
        ..Default::default()
    };
    let parameters = OperatorParameters { boundary: Boundary::Dirichlet, ..Default::default() };
    assert_eq!(assemble(&triangle, &parameters, &Unwatched), Err(OperatorError::NoUnknowns { vertices: 3 }));
}

#[test]
fn the_robust_laplacian_is_the_one_by_cotangents_where_that_is_delaunay() {
    for mass in [MassKind::Consistent, MassKind::Barycentric, MassKind::Voronoi] {
        let close = |a: &[f64], b: &[f64], bound: f64| {
            assert_eq!(a.len(), b.len());
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < bound));
        };
        for mesh in [sphere(9), grid(12)] {
            let (robust, report) = robust::assemble(&mesh, mass, Rim::Free, &Unwatched).unwrap();
            let plain = laplace::assemble(&mesh, mass).unwrap();
            assert_eq!((report.flips, report.mollification), (0, 0.0));
            close(robust.stiffness.values(), plain.stiffness.values(), 1e-12);
            close(&robust.mass.lumped(), &plain.mass.lumped(), 1e-15);
            assert!((robust.area / plain.area - 1.0).abs() < 1e-13);
        }
    }
}

#[test]
fn the_robust_laplacian_has_no_negative_weight_and_less_dirichlet_energy() {
    let mesh = noisy(&generate(Shape::Genus(1), 800).unwrap(), 0.9, 4).unwrap();
    let (robust, plain) = (neumann(&mesh, OperatorKind::Robust), neumann(&mesh, OperatorKind::Laplace));
    assert!(robust.report.flips > 50 && robust.report.delaunay);
    let s = &robust.problem.stiffness;
    for row in 0..s.rows() {
        let (columns, values) = s.row(row);
        assert!(columns.iter().zip(values).all(|(&column, &v)| column as usize == row || v < 1e-9));
        assert!(values.iter().sum::<f64>().abs() < 1e-11 * entry(s, row, row));
    }
    // Rippa 1990: among all triangulations Delaunay's has the least Dirichlet energy, for every function.
    let difference = |x: &dyn Fn(usize) -> f64| {
        let energy = |problem: &EigenProblem| {
            let x: Vec<f64> = (0..problem.size()).map(x).collect();
            problem.stiffness.multiply(&x).iter().zip(&x).map(|(a, b)| a * b).sum::<f64>()
        };
        energy(&plain.problem) - energy(&robust.problem)
    };
    for k in 0..3 {
        assert!(difference(&|v| mesh.positions[v][k]) > 0.0);
        assert!(difference(&|v| ((v * (k + 7)) % 13) as f64) > 0.0);
    }
}

#[test]
fn thin_triangles_are_cured_by_the_robust_laplacian() {
    // A sphere whose faces are cut by a point next to an edge, each: needles and caps all over.
    let base = sphere(8);
    let mut mesh = base.clone();
    mesh.faces.clear();
    for (f, &[a, b, c]) in base.faces.iter().enumerate() {
        let v = mesh.positions.len() as u32;
        let [p, q, r] = base.corners(&[a, b, c]);
        let s = [1e-6, 0.3 + 0.4 * (f % 2) as f64];
        mesh.positions.push((s[0] * r + (1.0 - s[0]) * (s[1] * p + (1.0 - s[1]) * q)).into());
        mesh.faces.extend([[a, b, v], [b, c, v], [c, a, v]]);
    }
    let made = neumann(&mesh, OperatorKind::Auto);
    assert_eq!((made.report.laplacian, made.report.reason), (Laplacian::Robust, Reason::ThinFaces));
    let exact = [2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0];
    assert_close(&lowest(&made.problem, 9)[1..], &exact, 0.03);
}

#[test]
fn fair_manifold_meshes_keep_their_cotangents() {
    for mesh in [sphere(7), grid(9), noisy(&generate(Shape::Knot, 600).unwrap(), 0.3, 2).unwrap()] {
        let made = neumann(&mesh, OperatorKind::Auto);
        assert_eq!(made.problem, laplace::assemble(&mesh, MassKind::Barycentric).unwrap());
        assert_eq!((made.report.laplacian, made.report.reason), (Laplacian::Cotangent, Reason::FairMesh));
        assert_eq!(made.laplacian(), &made.problem);
    }
}

#[test]
fn meshes_that_are_no_surfaces_have_a_laplacian_with_their_components_as_kernel() {
    let book = TriangleMesh {
        positions: vec![[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 0.5], [-0.5, 0.8, 0.5], [-0.5, -0.8, 0.5]],
        faces: vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]],
        ..Default::default()
    };
    let mut twice = grid(5);
    twice.faces.extend_from_within(3..9);
    let mut hostile = grid(6);
    hostile.positions.extend([[9.0; 3], [9.0; 3], [20.0, 0.0, 0.0]]);
    // A folded pair, a point pair with an edge of no length, a face on one line, faces that repeat a vertex, and a lone
    // vertex.
    hostile.faces.extend([[0, 6, 1], [0, 1, 6], [0, 36, 37], [0, 1, 2], [3, 3, 4], [5, 5, 5]]);
    for (mesh, edges, massless, kernel) in [(book, 1, 0, 1), (twice, 0, 0, 1), (hostile, 0, 1, 2)] {
        let made = neumann(&mesh, OperatorKind::Auto);
        assert_eq!((made.report.laplacian, made.report.reason), (Laplacian::Robust, Reason::NonManifold));
        assert!(made.report.non_manifold_edges >= edges);
        assert_eq!(made.report.massless_vertices, massless);
        let values = lowest(&made.problem, kernel + 1);
        assert!(values[kernel - 1].abs() < 1e-4 * values[kernel], "{values:?}");
        for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
            for mass in [MassKind::Consistent, MassKind::Voronoi] {
                for operator in [OperatorKind::Extrinsic { t: 0.5 }, curvature(0.1)] {
                    match assemble(&mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched) {
                        Ok(made) => {
                            let values = lowest(&made.problem, 2);
                            assert!(values[0] >= -1e-6, "{values:?}");
                        }
                        Err(error) => assert!(matches!(error, OperatorError::NoUnknowns { .. }), "{error}"),
                    }
                }
            }
        }
    }
}

fn curvature(t: f64) -> OperatorKind {
    OperatorKind::Hamiltonian { potential: Potential::Curvature { t } }
}

fn values(values: Vec<f64>) -> OperatorKind {
    OperatorKind::Hamiltonian { potential: Potential::Values(values) }
}

#[test]
fn a_constant_potential_shifts_every_eigenvalue() {
    let mut mesh = noisy(&generate(Shape::Torus, 300).unwrap(), 0.5, 1).unwrap();
    mesh.positions.iter_mut().flatten().for_each(|x| *x *= 7.0);
    let n = mesh.positions.len();
    for kind in [MassKind::Consistent, MassKind::Barycentric, MassKind::Voronoi] {
        let plain = lowest(&make(&mesh, OperatorKind::Auto, kind, Boundary::Neumann).problem, 30);
        for shift in [0.25, -0.125] {
            let made = make(&mesh, values(vec![shift; n]), kind, Boundary::Neumann);
            let shifted: Vec<f64> = plain.iter().map(|value| value + shift).collect();
            let found = lowest(&made.problem, 30);
            assert!(found.iter().zip(&shifted).all(|(a, b)| (a - b).abs() < 1e-10), "{kind:?}");
            assert_eq!(made.laplacian(), &laplace::assemble(&mesh, kind).unwrap());
        }
    }
}

#[test]
fn the_harmonic_oscillator_has_its_levels() {
    // −Δ + ω²r² on the plane: 2ω (k + 1), k + 1 times; at the rim of the rectangle the states have died away.
    let mesh = generate(Shape::Rectangle, 900).unwrap();
    let omega = 80.0;
    let potential: Vec<f64> =
        mesh.positions.iter().map(|p| omega * omega * ((p[0] - 0.8).powi(2) + (p[1] - 0.5).powi(2))).collect();
    let exact = [1.0, 2.0, 2.0, 3.0, 3.0, 3.0].map(|k| 2.0 * omega * k);
    for mass in [MassKind::Consistent, MassKind::Barycentric] {
        for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
            let made = make(&mesh, values(potential.clone()), mass, boundary);
            assert_close(&lowest(&made.problem, 6), &exact, 0.1);
        }
    }
}

#[test]
fn curvature_lifts_the_spectrum_of_the_sphere_and_does_not_depend_on_its_size() {
    for radius in [1.0, 250.0] {
        let mut mesh = generate(Shape::Sphere, 900).unwrap();
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= radius);
        for (operator, lift) in [
            (curvature(0.1), 0.2),
            (curvature(1.0), 2.0),
            // ∫ |∇(u N)|² = ∫ |∇u|² + (κ₁² + κ₂²) u²
            (OperatorKind::Extrinsic { t: 0.5 }, 1.0),
            (OperatorKind::Extrinsic { t: 1.0 }, 2.0),
        ] {
            let found: Vec<f64> = lowest(&neumann(&mesh, operator.clone()).problem, 9)
                .iter()
                .map(|value| value * radius * radius)
                .collect();
            let exact = [0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0].map(|value| value + lift);
            assert_close(&found, &exact, 0.03);
        }
    }
}

#[test]
fn the_extrinsic_matrix_is_the_sum_over_the_coordinates_of_the_normal() {
    let mesh = noisy(&generate(Shape::Genus(2), 1000).unwrap(), 0.3, 9).unwrap();
    let normals = vertex_normals(&mesh).unwrap();
    assert!(normals.iter().all(|n| (n.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14));
    let s = laplace::assemble(&mesh, MassKind::Barycentric).unwrap().stiffness;
    let a = neumann(&mesh, OperatorKind::Extrinsic { t: 1.0 }).problem.stiffness;
    let half = neumann(&mesh, OperatorKind::Extrinsic { t: 0.5 }).problem.stiffness;
    assert_eq!(neumann(&mesh, OperatorKind::Extrinsic { t: 0.0 }).problem.stiffness, s);
    for row in 0..s.rows() {
        assert_eq!(entry(&a, row, row), entry(&s, row, row));
        for (&column, &value) in s.row(row).0.iter().zip(s.row(row).1) {
            let product: f64 = (0..3).map(|c| normals[row][c] * value * normals[column as usize][c]).sum();
            let (one, blend) = (entry(&a, row, column as usize), entry(&half, row, column as usize));
            assert!((one - product).abs() <= 1e-14 * (1.0 + value.abs()));
            assert!((blend - 0.5 * (value + product)).abs() <= 1e-14 * (1.0 + value.abs()));
        }
    }
    // A flat piece looks the same from outside.
    let flat = grid(8);
    assert_eq!(
        neumann(&flat, OperatorKind::Extrinsic { t: 0.7 }).problem,
        laplace::assemble(&flat, MassKind::Barycentric).unwrap()
    );
}

fn mean_error(found: &[f64], expected: impl Fn(usize) -> f64) -> f64 {
    found.iter().enumerate().map(|(v, value)| (value - expected(v)).abs()).sum::<f64>() / found.len() as f64
}

#[test]
fn principal_curvatures_of_the_torus_come_with_their_directions() {
    let mut mesh = generate(Shape::Torus, 6000).unwrap();
    let check = |mesh: &TriangleMesh, scale: f64, sign: f64| {
        let Curvatures { normals, largest, smallest, directions } = curvatures(mesh).unwrap();
        // κ around the tube is 1/r; around the axis cos θ / (R + r cos θ).
        let around = |v: usize| {
            let p = mesh.positions[v].map(|x| x / scale);
            let radius = p[0].hypot(p[1]);
            (radius - 1.0) / 0.4 / radius
        };
        let (tube, axis) = if sign > 0.0 { (&largest, &smallest) } else { (&smallest, &largest) };
        assert!(mean_error(tube, |_| sign * 2.5 / scale) < 0.03 / scale);
        assert!(mean_error(axis, |v| sign * around(v) / scale) < 0.03 / scale);
        for v in 0..mesh.positions.len() {
            let (p, n, d) = (mesh.positions[v], Vector3(normals[v]), Vector3(directions[v]));
            assert!((d.norm_squared() - 1.0).abs() < 1e-12 && d.dot(n).abs() < 1e-12);
            let along_the_axis = d.dot(Vector3::new(-p[1], p[0], 0.0)).abs() / p[0].hypot(p[1]);
            assert!(if sign > 0.0 { along_the_axis < 0.3 } else { along_the_axis > 0.95 }, "{v}: {along_the_axis}");
        }
    };
    check(&mesh, 1.0, 1.0);
    mesh.positions.iter_mut().flatten().for_each(|x| *x *= 1e-3);
    check(&mesh, 1e-3, 1.0);
    mesh.faces.iter_mut().for_each(|face| face.swap(0, 1));
    check(&mesh, 1e-3, -1.0);
}

#[test]
fn a_plane_is_flat_and_a_cylinder_is_curved_once() {
    let found = curvatures(&grid(9)).unwrap();
    assert!(found.squares().iter().all(|&square| square < 1e-20));
    // Radius 2, rolled from a grid, its axis along y.
    let mut mesh = grid(40);
    for p in &mut mesh.positions {
        let t = 0.1 * p[0];
        *p = [2.0 * t.sin(), 0.2 * p[1], 2.0 * t.cos()];
    }
    let found = curvatures(&mesh).unwrap();
    let inner = |v: &usize| (2..38).contains(&(v % 40)) && (2..38).contains(&(v / 40));
    for v in (0..1600).filter(inner) {
        let (larger, smaller) = (found.largest[v].abs(), found.smallest[v].abs());
        let (larger, smaller) = (larger.max(smaller), larger.min(smaller));
        assert!((larger - 0.5).abs() < 0.03 && smaller < 0.03, "{v}: {larger} {smaller}");
    }
}

#[test]
fn needles_and_folds_have_finite_curvature() {
    let mut mesh = noisy(&generate(Shape::Knot, 500).unwrap(), 1.0, 3).unwrap();
    let last = mesh.positions.len() as u32;
    mesh.positions.push([1.0; 3]);
    mesh.faces.extend([[0, 1, last], [1, 0, last], [2, 3, 3]]);
    let found = curvatures(&mesh).unwrap();
    assert!(found.squares().iter().all(|square| square.is_finite()));
    let made = neumann(&mesh, curvature(0.5));
    assert!(made.problem.stiffness.values().iter().all(|value| value.is_finite()));
}

#[test]
fn parameters_read_as_the_api_writes_them_and_are_checked() {
    let parse = |text: &str| serde_json::from_str::<OperatorParameters>(text);
    assert_eq!(parse("{}").unwrap(), OperatorParameters::default());
    let full = parse(
        r#"{"operator": {"hamiltonian": {"potential": {"curvature": {"t": 0.1}}}}, "mass": "consistent",
            "boundary": "dirichlet"}"#,
    )
    .unwrap();
    assert_eq!((full.operator.clone(), full.boundary), (curvature(0.1), Boundary::Dirichlet));
    assert_eq!(parse(&serde_json::to_string(&full).unwrap()).unwrap(), full);
    assert_eq!(parse(r#"{"operator": "robust"}"#).unwrap().operator, OperatorKind::Robust);
    assert_eq!(parse(r#"{"operator": {"extrinsic": {"t": 1}}}"#).unwrap().operator, OperatorKind::Extrinsic { t: 1.0 });
    assert!(parse(r#"{"operator": {"extrinsic": {"s": 1}}}"#).is_err());
    assert!(parse(r#"{"operator": "magic"}"#).is_err());

    let mesh = grid(3);
    let error = |operator| {
        assemble(&mesh, &OperatorParameters { operator, ..Default::default() }, &Unwatched).unwrap_err().to_string()
    };
    assert!(error(OperatorKind::Extrinsic { t: 1.5 }).contains("must be between 0 and 1, not 1.5"));
    assert!(error(OperatorKind::Extrinsic { t: f64::NAN }).contains("NaN"));
    assert!(error(curvature(-1.0)).contains("must be between 0 and 1e6, not -1"));
    assert!(error(values(vec![0.0; 4])).contains("4 values were sent for 9 vertices"));
    assert!(error(values(vec![0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])).contains("vertex 2"));
    assert!(error(values(vec![1e300; 9])).contains("vertex 0"));
}

#[test]
fn work_that_is_cancelled_ends() {
    struct Never;
    impl Monitor for Never {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let made = assemble(&grid(3), &OperatorParameters::default(), &Never);
    assert_eq!(made, Err(OperatorError::Cancelled(Cancelled)));
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let mesh = noisy(&generate(Shape::Rectangle, 10_000).unwrap(), 0.9, 4).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            [OperatorKind::Robust, curvature(0.2), OperatorKind::Extrinsic { t: 0.3 }]
                .map(|operator| make(&mesh, operator, MassKind::Barycentric, Boundary::Dirichlet))
        })
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn random_soups_of_triangles_make_well_formed_operators() {
    let mut state = 7u64;
    let mut below = |bound: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % bound
    };
    for trial in 0..200usize {
        let (n, f) = (4 + below(12), 1 + below(40));
        // Coordinates from few values, so that vertices coincide and faces are flat.
        let steps = [2, 3, 5, 1000][trial % 4];
        let unit = [1.0, 1e-9, 1e9][trial % 3] / steps as f64;
        let positions = (0..n).map(|_| std::array::from_fn(|_| below(steps) as f64 * unit)).collect();
        let faces = (0..f).map(|_| std::array::from_fn(|_| below(n) as u32)).collect();
        let mesh = TriangleMesh { positions, faces, ..Default::default() };
        for operator in [OperatorKind::Auto, OperatorKind::Robust, curvature(0.5), OperatorKind::Extrinsic { t: 0.5 }] {
            for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
                let mass = [MassKind::Consistent, MassKind::Barycentric, MassKind::Voronoi][trial % 3];
                let parameters = OperatorParameters { operator: operator.clone(), mass, boundary };
                match assemble(&mesh, &parameters, &Unwatched) {
                    Ok(made) => {
                        check_form(&made.problem);
                        check_form(made.laplacian());
                        let finite = |matrix: &SparseMatrix| matrix.values().iter().all(|value| value.is_finite());
                        assert!(finite(&made.problem.stiffness), "trial {trial} {operator:?}");
                        assert!(made.problem.area > 0.0 && made.problem.area.is_finite());
                    }
                    Err(error) => {
                        assert!(matches!(error, OperatorError::NoArea | OperatorError::NoUnknowns { .. }), "{error}");
                    }
                }
            }
        }
    }
}
