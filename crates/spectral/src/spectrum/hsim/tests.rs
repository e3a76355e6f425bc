//! The solver against the dense one, on meshes that are made.

use std::sync::atomic::{AtomicUsize, Ordering};

use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::{Cancelled, Monitor, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate, noisy, renumbered};

use super::level::Level;
use super::offset::components;
use crate::operator::{
    Boundary, EigenProblem, MassKind, OperatorKind, OperatorParameters, Potential, assemble as assemble_operator,
};
use crate::spectrum::hsim::{Eigenpairs, HsimError, HsimParameters, Selection, Variant, solve};

pub(super) fn problem(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind, boundary: Boundary) -> EigenProblem {
    assemble_operator(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap().problem
}

pub(super) fn laplacian(mesh: &TriangleMesh) -> EigenProblem {
    problem(mesh, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Neumann)
}

pub(super) fn count(count: usize, tolerance: f64) -> HsimParameters {
    HsimParameters { selection: Selection::Count(count), tolerance, ..HsimParameters::default() }
}

pub(super) fn below(bound: f64, most: usize) -> HsimParameters {
    HsimParameters { selection: Selection::Below { bound, most }, tolerance: 1e-6, ..HsimParameters::default() }
}

/// The level of a problem, rows in an order for its factor.
pub(super) fn level_of(mesh: &TriangleMesh, problem: &EigenProblem) -> Level {
    let component = components(&problem.stiffness, &problem.mass, 0.0);
    let positions = match &problem.unknowns {
        None => mesh.positions.clone(),
        Some(unknowns) => unknowns.iter().map(|&vertex| mesh.positions[vertex as usize]).collect(),
    };
    let level = Level { stiffness: problem.stiffness.clone(), mass: problem.mass.clone(), positions, component };
    level.in_order(&level.factor_order(chladni_algebra::Ordering::Amd).unwrap())
}

/// The lowest eigenvalues by the dense solver, in the units of the input.
pub(super) fn exact(problem: &EigenProblem, count: usize) -> Vec<f64> {
    let mass = problem.mass.to_dense();
    let count = count.min(problem.size());
    let pairs = CpuSolver.lowest(problem.stiffness.to_dense(), mass, count, &Unwatched).unwrap();
    pairs.values.into_iter().map(|value| value / problem.area).collect()
}

/// Solves, and holds what every answer promises: order, residuals, bounds, orthonormality, signs, counts.
pub(super) fn solved(
    mesh: &TriangleMesh,
    problem: &EigenProblem,
    parameters: &HsimParameters,
    what: &str,
) -> Eigenpairs {
    let pairs = solve(mesh, problem, parameters, false, &Unwatched).unwrap_or_else(|error| panic!("{what}: {error}"));
    let (n, m, vertices) = (problem.size(), pairs.values.len(), mesh.positions.len());
    if let Selection::Count(count) = parameters.selection {
        assert_eq!(m, count, "{what}");
    }
    assert_eq!((pairs.vectors.rows(), pairs.vectors.columns()), (vertices, m), "{what}");
    assert_eq!((pairs.residuals.len(), pairs.bounds.len()), (m, m), "{what}");
    assert!(pairs.values.windows(2).all(|pair| pair[0] <= pair[1]), "{what}: {:?}", pairs.values);
    let worst = pairs.residuals.iter().copied().fold(0.0, f64::max);
    assert!(worst <= parameters.tolerance, "{what}: residual {worst}");
    assert!(pairs.bounds.iter().all(|bound| bound.is_finite() && *bound >= 0.0), "{what}");
    assert!(pairs.orthonormality_defect <= 1e-9, "{what}: {}", pairs.orthonormality_defect);
    assert!(pairs.inertia.windows(2).all(|pair| pair[0].shift <= pair[1].shift), "{what}");
    if let Some(last) = pairs.inertia.last() {
        assert!(last.below >= m && pairs.values.iter().all(|&value| value < last.shift), "{what}: {last:?}");
    }
    assert_eq!(pairs.levels.last().unwrap().dimension, n, "{what}");
    // Orthonormality for the mass of the input, and signs, measured anew.
    let rows: Vec<usize> = match &problem.unknowns {
        Some(unknowns) => unknowns.iter().map(|&vertex| vertex as usize).collect(),
        None => (0..vertices).collect(),
    };
    let columns: Vec<Vec<f64>> = (0..m).map(|column| pairs.vectors.column(column)).collect();
    let inside: Vec<Vec<f64>> = columns.iter().map(|x| rows.iter().map(|&row| x[row]).collect()).collect();
    for (k, (whole, x)) in columns.iter().zip(&inside).enumerate() {
        let squares = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
        assert!(squares(whole) <= squares(x) * (1.0 + 1e-12), "{what}: column {k} is not zero off the unknowns");
        let (highest, lowest) = x.iter().fold((0f64, 0f64), |(high, low), &x| (high.max(x), low.min(x)));
        assert!(highest >= -lowest * (1.0 - 1e-12), "{what}: column {k} has the wrong sign: {highest} {lowest}");
        let mx = problem.mass.multiply(x);
        for (j, y) in inside[..=k].iter().enumerate() {
            let product = problem.area * mx.iter().zip(y).map(|(a, b)| a * b).sum::<f64>();
            let expected = f64::from(u8::from(j == k));
            assert!((product - expected).abs() <= 1e-9, "{what}: columns {j} and {k}: {product}");
        }
    }
    pairs
}

/// Every value within its bound of the exact one, and within a share of it.
fn agree(pairs: &Eigenpairs, exact: &[f64], share: f64, what: &str) {
    let scale = exact[exact.len() - 1].abs().max(exact[0].abs());
    for (k, (&value, &truth)) in pairs.values.iter().zip(exact).enumerate() {
        let error = (value - truth).abs();
        assert!(error <= share * truth.abs() + 1e-9 * scale, "{what}: pair {k} is {value}, not {truth}");
        assert!(error <= pairs.bounds[k] + 1e-9 * scale, "{what}: pair {k}: {error:e} is beyond {:e}", pairs.bounds[k]);
        assert!(value >= truth - 1e-9 * scale, "{what}: pair {k}: {value} is below {truth}");
    }
}

/// Copies of a mesh side by side.
pub(super) fn copies(one: &TriangleMesh, count: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
    for copy in 0..count {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(one.positions.iter().map(|p| [p[0] + 7.0 * f64::from(copy), p[1], p[2]]));
        mesh.faces.extend(one.faces.iter().map(|face| face.map(|v| v + base)));
    }
    mesh
}

/// A square of `k × k` cells, all cut in the same direction, so that x and y can be exchanged.
fn square(k: usize) -> TriangleMesh {
    let at = |i: usize, j: usize| (i * (k + 1) + j) as u32;
    let positions = (0..=k).flat_map(|i| (0..=k).map(move |j| [i as f64 / k as f64, j as f64 / k as f64, 0.0]));
    let cells = (0..k).flat_map(|i| (0..k).map(move |j| (i, j)));
    let faces = cells
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
    TriangleMesh { positions: positions.collect(), faces: faces.collect(), ..Default::default() }
}

pub(super) fn rough(shape: Shape, vertices: usize) -> TriangleMesh {
    noisy(&generate(shape, vertices).unwrap(), 0.15, 7).unwrap()
}

#[test]
fn the_smallest_meshes_are_solved_for_any_number_of_pairs() {
    let triangle = TriangleMesh {
        positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2]],
        ..Default::default()
    };
    let tetrahedron = TriangleMesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        faces: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        ..Default::default()
    };
    let icosahedron = generate(Shape::Sphere, 12).unwrap();
    for (name, mesh) in [("triangle", triangle), ("tetrahedron", tetrahedron), ("icosahedron", icosahedron)] {
        for mass in [MassKind::Barycentric, MassKind::Consistent] {
            let problem = problem(&mesh, OperatorKind::Laplace, mass, Boundary::Neumann);
            let truth = exact(&problem, 100);
            for p in 1..=truth.len() {
                let what = format!("{name}, {mass:?}, {p} pairs");
                agree(&solved(&mesh, &problem, &count(p, 1e-6), &what), &truth, 1e-9, &what);
            }
        }
    }
}

#[test]
fn a_single_unknown_is_solved() {
    let disk = generate(Shape::Disk, 7).unwrap();
    let problem = problem(&disk, OperatorKind::Laplace, MassKind::Barycentric, Boundary::Dirichlet);
    let truth = exact(&problem, 10);
    for p in 1..=truth.len() {
        agree(&solved(&disk, &problem, &count(p, 1e-6), "disk"), &truth, 1e-9, "disk");
    }
}

#[test]
fn any_share_of_the_pairs_of_a_small_mesh_is_delivered() {
    let mesh = rough(Shape::Torus, 300);
    let problem = laplacian(&mesh);
    let n = problem.size();
    let truth = exact(&problem, n);
    for p in [1, 2, 50, n / 2 + 1, n - 1, n] {
        let what = format!("{p} of {n} pairs");
        agree(&solved(&mesh, &problem, &count(p, 1e-2), &what), &truth, 1e-9, &what);
    }
    let error = solve(&mesh, &problem, &count(n + 1, 1e-2), false, &Unwatched).unwrap_err();
    assert!(matches!(error, HsimError::Count { wanted, most } if (wanted, most) == (n + 1, n)), "{error}");
}

#[test]
fn more_than_half_of_the_pairs_of_a_mesh_with_a_hierarchy_are_delivered() {
    let mesh = rough(Shape::Torus, 1000);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, problem.size());
    for p in [600, problem.size()] {
        let what = format!("{p} pairs");
        agree(&solved(&mesh, &problem, &count(p, 1e-2), &what), &truth, 1e-3, &what);
    }
}

#[test]
fn every_tolerance_is_kept_and_values_are_as_exact_as_it_says() {
    let mesh = rough(Shape::Genus(2), 1200);
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let problem = problem(&mesh, OperatorKind::Laplace, mass, Boundary::Neumann);
        let truth = exact(&problem, 60);
        for (tolerance, share) in [(1e-2, 2e-3), (1e-4, 1e-6), (1e-6, 1e-9), (1e-9, 1e-9)] {
            for p in [1, 2, 10, 50] {
                let what = format!("{mass:?}, {p} pairs to {tolerance}");
                agree(&solved(&mesh, &problem, &count(p, tolerance), &what), &truth, share, &what);
            }
        }
    }
}

#[test]
fn every_component_adds_one_to_the_kernel() {
    let mesh = copies(&rough(Shape::Torus, 400), 3);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 40);
    for p in [1, 2, 3, 4, 30] {
        let what = format!("three tori, {p} pairs");
        let pairs = solved(&mesh, &problem, &count(p, 1e-6), &what);
        agree(&pairs, &truth, 1e-9, &what);
        assert!(pairs.values.iter().take(3).all(|&value| value == 0.0), "{what}: {:?}", pairs.values);
    }
    // More components than wanted pairs.
    let mesh = copies(&generate(Shape::Sphere, 12).unwrap(), 90);
    let problem = laplacian(&mesh);
    for p in [1, 40, 90] {
        let pairs = solved(&mesh, &problem, &count(p, 1e-2), "spheres");
        assert!(pairs.values.iter().all(|&value| value == 0.0), "{:?}", pairs.values);
    }
    // Multiplets of 90 · 3 and 90 · 5.
    let truth = exact(&problem, 500);
    for p in [91, 200, 400] {
        let what = format!("90 spheres, {p} pairs");
        agree(&solved(&mesh, &problem, &count(p, 1e-4), &what), &truth, 1e-6, &what);
    }
}

#[test]
fn multiplets_may_be_cut_anywhere() {
    let sphere = generate(Shape::Sphere, 1002).unwrap();
    let meshes = [("sphere", sphere), ("square", square(30)), ("torus", generate(Shape::Torus, 1000).unwrap())];
    for (name, mesh) in &meshes {
        let problem = laplacian(mesh);
        let truth = exact(&problem, 60);
        for p in [2, 3, 6, 12, 30, 50] {
            let what = format!("{name}, {p} pairs");
            agree(&solved(mesh, &problem, &count(p, 1e-4), &what), &truth, 1e-6, &what);
        }
    }
}

#[test]
fn boundary_conditions_and_masses_agree_with_the_dense_solver() {
    let mesh = noisy(&generate(Shape::Rectangle, 1100).unwrap(), 0.05, 2).unwrap();
    for boundary in [Boundary::Neumann, Boundary::Dirichlet] {
        for mass in [MassKind::Consistent, MassKind::Voronoi] {
            let problem = problem(&mesh, OperatorKind::Laplace, mass, boundary);
            let truth = exact(&problem, 40);
            let what = format!("{boundary:?}, {mass:?}");
            agree(&solved(&mesh, &problem, &count(40, 1e-6), &what), &truth, 1e-9, &what);
        }
    }
}

#[test]
fn extrinsic_operators_agree_with_the_dense_solver() {
    let mesh = rough(Shape::Genus(1), 1100);
    for t in [0.3, 1.0] {
        let problem = problem(&mesh, OperatorKind::Extrinsic { t }, MassKind::Barycentric, Boundary::Neumann);
        let truth = exact(&problem, 40);
        let what = format!("extrinsic, t = {t}");
        agree(&solved(&mesh, &problem, &count(40, 1e-6), &what), &truth, 1e-9, &what);
    }
}

#[test]
fn potentials_of_either_sign_agree_with_the_dense_solver() {
    let mesh = rough(Shape::Genus(2), 1100);
    let vertices = mesh.positions.len();
    let well = |depth: f64| -> Vec<f64> {
        (0..vertices).map(|v| -depth * (-mesh.positions[v][0].powi(2)).exp() + 0.2 * depth).collect()
    };
    let curvature = Potential::Curvature { t: 0.1 };
    let cases = [
        ("curvature", curvature),
        ("shallow well", Potential::Values(well(3.0))),
        ("deep well", Potential::Values(well(300.0))),
    ];
    for (name, potential) in cases {
        let problem = problem(&mesh, OperatorKind::Hamiltonian { potential }, MassKind::Barycentric, Boundary::Neumann);
        let truth = exact(&problem, 40);
        for p in [1, 3, 40] {
            let what = format!("{name}, {p} pairs");
            agree(&solved(&mesh, &problem, &count(p, 1e-6), &what), &truth, 1e-8, &what);
        }
        if name != "curvature" {
            assert!(truth[0] < 0.0, "{name}");
            let bound = 0.5 * (truth[4] + truth[5]);
            let pairs = solved(&mesh, &problem, &below(bound, 100), name);
            assert_eq!(pairs.values.len(), 5, "{name}");
            agree(&pairs, &truth, 1e-8, name);
        }
    }
}

#[test]
fn a_potential_on_one_component_leaves_the_kernel_of_the_other() {
    let mesh = copies(&rough(Shape::Torus, 500), 2);
    let half = mesh.positions.len() / 2;
    for height in [-30.0, 30.0] {
        let values = (0..2 * half).map(|v| if v < half { height } else { 0.0 }).collect();
        let operator = OperatorKind::Hamiltonian { potential: Potential::Values(values) };
        let problem = problem(&mesh, operator, MassKind::Barycentric, Boundary::Neumann);
        let truth = exact(&problem, 60);
        for p in [1, 2, 5, 40] {
            let what = format!("height {height}, {p} pairs");
            let pairs = solved(&mesh, &problem, &count(p, 1e-6), &what);
            agree(&pairs, &truth, 1e-8, &what);
        }
        let negative = truth.partition_point(|&value| value < -1e-6);
        let pairs = solved(&mesh, &problem, &below(-1e-4, 100), "below zero");
        assert_eq!(pairs.values.len(), negative, "height {height}");
        let pairs = solved(&mesh, &problem, &below(1e-4, 100), "the kernel too");
        assert_eq!(pairs.values.len(), negative + 1, "height {height}");
    }
}

#[test]
fn a_constant_potential_moves_every_eigenvalue_by_itself() {
    let mesh = rough(Shape::Knot, 1500);
    let plain = solved(&mesh, &laplacian(&mesh), &count(30, 1e-8), "Laplacian").values;
    for height in [-40.0, 25.0] {
        let potential = Potential::Values(vec![height; mesh.positions.len()]);
        let problem = problem(&mesh, OperatorKind::Hamiltonian { potential }, MassKind::Barycentric, Boundary::Neumann);
        let moved = solved(&mesh, &problem, &count(30, 1e-8), "Hamiltonian").values;
        for (k, (moved, plain)) in moved.iter().zip(&plain).enumerate() {
            assert!((moved - plain - height).abs() < 1e-8 * (1.0 + plain.abs()), "pair {k}: {moved} {plain}");
        }
    }
}

#[test]
fn all_pairs_below_a_bound_are_delivered() {
    let mesh = copies(&rough(Shape::Genus(1), 550), 2);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 120);
    for pairs in [2, 4, 20, 102] {
        let bound = 0.5 * (truth[pairs - 1] + truth[pairs]);
        let what = format!("{pairs} below {bound}");
        let found = solved(&mesh, &problem, &below(bound, 200), &what);
        assert_eq!(found.values.len(), pairs, "{what}");
        agree(&found, &truth, 1e-8, &what);
    }
    for bound in [-1e6, -1.0, 0.0] {
        let found = solved(&mesh, &problem, &below(bound, 200), "nothing");
        assert!(found.values.is_empty(), "below {bound}: {:?}", found.values);
    }
    let found = solved(&mesh, &problem, &below(0.1 * truth[2], 200), "the kernel");
    assert_eq!(found.values, [0.0, 0.0]);
    let bound = 0.5 * (truth[29] + truth[30]);
    let error = solve(&mesh, &problem, &below(bound, 29), false, &Unwatched).unwrap_err();
    assert!(matches!(error, HsimError::Count { wanted: 30, most: 29 }), "{error}");
    // Beyond the last.
    let small = rough(Shape::Torus, 100);
    let problem = laplacian(&small);
    let found = solved(&small, &problem, &below(1e9, 1000), "all");
    assert_eq!(found.values.len(), small.positions.len());
}

#[test]
fn a_bound_on_an_eigenvalue_of_a_multiplet_is_no_trap() {
    let sphere = generate(Shape::Sphere, 1002).unwrap();
    let problem = laplacian(&sphere);
    let truth = exact(&problem, 40);
    // Inside the rounding of the values between l = 2 and themselves: either none of the five counts or some do, but
    // never a failure.
    let found = solved(&sphere, &problem, &below(truth[6], 100), "on a multiplet");
    assert!((4..=9).contains(&found.values.len()), "{}", found.values.len());
}

#[test]
fn the_variants_agree() {
    let mesh = rough(Shape::Genus(2), 2400);
    let problem = laplacian(&mesh);
    let ours = solved(&mesh, &problem, &count(40, 1e-8), "sliced");
    for variant in [Variant::Published, Variant::Random, Variant::Bathe] {
        for shift_ratio in [0.0, 0.1, 0.6] {
            let what = format!("{variant:?}, shift ratio {shift_ratio}");
            let parameters = HsimParameters { variant, shift_ratio, ..count(40, 1e-7) };
            let pairs = solved(&mesh, &problem, &parameters, &what);
            for (k, (a, b)) in pairs.values.iter().zip(&ours.values).enumerate() {
                assert!((a - b).abs() <= 1e-8 * b.abs() + 1e-10, "{what}: pair {k}: {a} {b}");
            }
        }
    }
    for (variant, p) in [(Variant::Published, 1), (Variant::Random, 1), (Variant::Bathe, 1), (Variant::Random, 100)] {
        solved(&mesh, &problem, &HsimParameters { variant, ..count(p, 1e-2) }, &format!("{variant:?}, {p}"));
    }
    // Dirichlet, three levels, another overlap and subspace.
    let disk = generate(Shape::Disk, 2600).unwrap();
    let problem = super_problem(&disk);
    let ours = solved(&disk, &problem, &count(20, 1e-7), "disk");
    let parameters = HsimParameters {
        variant: Variant::Published,
        levels: Some(3),
        sigma: Some(9.0),
        subspace_factor: Some(2.0),
        ..count(20, 1e-7)
    };
    let pairs = solved(&disk, &problem, &parameters, "published disk");
    assert_eq!(pairs.levels.len(), 3);
    assert!(pairs.values.iter().zip(&ours.values).all(|(a, b)| (a - b).abs() < 1e-8 * b));
}

fn super_problem(mesh: &TriangleMesh) -> EigenProblem {
    problem(mesh, OperatorKind::Laplace, MassKind::Consistent, Boundary::Dirichlet)
}

#[test]
fn the_baselines_take_all_pairs_of_a_small_mesh() {
    let mesh = rough(Shape::Torus, 60);
    let problem = laplacian(&mesh);
    let truth = exact(&problem, 60);
    for variant in [Variant::Random, Variant::Bathe] {
        for p in [1, 31, 59, 60] {
            let what = format!("{variant:?}, {p} of 60 pairs");
            agree(&solved(&mesh, &problem, &HsimParameters { variant, ..count(p, 1e-6) }, &what), &truth, 1e-8, &what);
        }
    }
    let error =
        solve(&mesh, &problem, &HsimParameters { variant: Variant::Published, ..count(5, 1e-2) }, false, &Unwatched);
    assert!(matches!(error, Err(HsimError::Parameter { name: "variant", .. })), "no levels were asked for");
}

#[test]
fn any_number_of_levels_and_overlap_gives_the_same_pairs() {
    let mesh = rough(Shape::Genus(1), 2500);
    let problem = laplacian(&mesh);
    let plain = solved(&mesh, &problem, &count(40, 1e-7), "plain").values;
    for (levels, sigma) in [(1, 10.0), (2, 4.0), (3, 10.0), (4, 30.0), (6, 10.0)] {
        let what = format!("{levels} levels, overlap {sigma}");
        let parameters = HsimParameters { levels: Some(levels), sigma: Some(sigma), ..count(40, 1e-7) };
        let values = solved(&mesh, &problem, &parameters, &what).values;
        assert!(values.iter().zip(&plain).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs()), "{what}");
    }
}

struct Countdown(AtomicUsize);

impl Monitor for Countdown {
    fn stage(&self, _: &'static str) {}
    fn progress(&self, fraction: f64) {
        assert!((0.0..=1.0).contains(&fraction));
    }
    fn checkpoint(&self) -> Result<(), Cancelled> {
        let left = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| Some(left.saturating_sub(1)));
        if left == Ok(0) { Err(Cancelled) } else { Ok(()) }
    }
}

#[test]
fn it_stops_at_whatever_checkpoint_it_is_told_to() {
    let mesh = rough(Shape::Genus(2), 2100);
    let problem = laplacian(&mesh);
    for variant in [Variant::Sliced, Variant::Published] {
        let parameters = HsimParameters { variant, ..count(30, 1e-6) };
        let whole = Countdown(AtomicUsize::new(usize::MAX));
        solve(&mesh, &problem, &parameters, false, &whole).unwrap();
        let checkpoints = usize::MAX - whole.0.load(Ordering::SeqCst);
        assert!(checkpoints > 20, "{checkpoints}");
        for part in [0, 1, 2, 5, 20, 40, 60, 80, 95] {
            let at = if part < 5 { part } else { checkpoints * part / 100 };
            let result = solve(&mesh, &problem, &parameters, false, &Countdown(AtomicUsize::new(at)));
            assert!(
                matches!(result, Err(HsimError::Cancelled(_))),
                "{variant:?}: at {at} of {checkpoints}: {result:?}"
            );
        }
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let plain = HsimParameters::default();
    let cases = [
        ("count", HsimParameters { selection: Selection::Count(0), ..plain }),
        ("below", HsimParameters { selection: Selection::Below { bound: f64::NAN, most: 5 }, ..plain }),
        ("below", HsimParameters { selection: Selection::Below { bound: f64::INFINITY, most: 5 }, ..plain }),
        ("at_most", HsimParameters { selection: Selection::Below { bound: 1.0, most: 0 }, ..plain }),
        ("tolerance", HsimParameters { tolerance: 0.0, ..plain }),
        ("tolerance", HsimParameters { tolerance: 1.0, ..plain }),
        ("tolerance", HsimParameters { tolerance: f64::NAN, ..plain }),
        ("levels", HsimParameters { levels: Some(0), ..plain }),
        ("levels", HsimParameters { levels: Some(7), ..plain }),
        ("sigma", HsimParameters { sigma: Some(0.5), ..plain }),
        ("shift_ratio", HsimParameters { shift_ratio: -0.1, ..plain }),
        ("shift_ratio", HsimParameters { shift_ratio: f64::NAN, ..plain }),
        ("subspace_factor", HsimParameters { subspace_factor: Some(0.9), ..plain }),
    ];
    let mesh = generate(Shape::Sphere, 12).unwrap();
    let problem = laplacian(&mesh);
    for (expected, parameters) in cases {
        match solve(&mesh, &problem, &parameters, false, &Unwatched) {
            Err(error @ HsimError::Parameter { name, .. }) => {
                assert_eq!((name, error.kind()), (expected, "invalid-parameters"));
            }
            other => panic!("{expected}: {other:?}"),
        }
    }
}

#[test]
fn a_problem_of_another_mesh_is_refused() {
    let mesh = generate(Shape::Sphere, 12).unwrap();
    let other = laplacian(&generate(Shape::Sphere, 42).unwrap());
    let error = solve(&mesh, &other, &count(3, 1e-2), false, &Unwatched).unwrap_err();
    assert_eq!(error.kind(), "eigenproblem-failed", "{error}");
}

#[test]
fn the_same_seed_gives_the_same_answer_and_another_one_the_same_values() {
    let mesh = rough(Shape::Genus(2), 2500);
    let problem = laplacian(&mesh);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let answer = |seed, tolerance| {
        let parameters = HsimParameters { seed, ..count(60, tolerance) };
        pool.install(|| solve(&mesh, &problem, &parameters, false, &Unwatched).unwrap())
    };
    let (first, second) = (answer(3, 1e-2), answer(3, 1e-2));
    assert!(first == second);
    let (first, second) = (answer(3, 1e-7), answer(4, 1e-7));
    assert!(first.values.iter().zip(&second.values).all(|(a, b)| (a - b).abs() <= 1e-9 * a));
}

#[test]
fn eigenvalues_do_not_depend_on_placement_or_numbers_and_follow_the_scale() {
    let mesh = rough(Shape::Knot, 2000);
    let values = |mesh: &TriangleMesh| solved(mesh, &laplacian(mesh), &count(40, 1e-8), "moved").values;
    let plain = values(&mesh);
    let (cosine, sine) = (0.7f64.cos(), 0.7f64.sin());
    let mut moved = mesh.clone();
    for p in &mut moved.positions {
        let turned = [cosine * p[0] - sine * p[1], sine * p[0] + cosine * p[1], p[2]];
        *p = [3.0 * turned[2] + 1.0, 3.0 * turned[0] - 2.0, 3.0 * turned[1] + 3.0];
    }
    let moved: Vec<f64> = values(&moved).into_iter().map(|value| 9.0 * value).collect();
    let numbered = values(&renumbered(&mesh, 5).0);
    for (k, &value) in plain.iter().enumerate() {
        assert!((moved[k] - value).abs() <= 1e-8 * value, "pair {k}: {} {value}", moved[k]);
        assert!((numbered[k] - value).abs() <= 1e-8 * value, "pair {k}: {} {value}", numbered[k]);
    }
}

#[test]
fn the_finest_space_is_given_on_request_over_all_vertices() {
    let disk = generate(Shape::Disk, 2500).unwrap();
    for (variant, problem) in [
        (Variant::Sliced, super_problem(&disk)),
        (Variant::Sliced, laplacian(&disk)),
        (Variant::Published, laplacian(&disk)),
    ] {
        let parameters = HsimParameters { variant, ..count(30, 1e-2) };
        let space = solve(&disk, &problem, &parameters, true, &Unwatched).unwrap().space.unwrap();
        assert_eq!(space.rows(), disk.positions.len());
        assert!(space.columns() < disk.positions.len() && space.columns() >= 30);
        let unknown = |vertex: usize| {
            problem.unknowns.as_ref().is_none_or(|unknowns| unknowns.binary_search(&(vertex as u32)).is_ok())
        };
        for vertex in 0..space.rows() {
            let sum: f32 = space.row(vertex).1.iter().sum();
            let expected = f32::from(u8::from(unknown(vertex)));
            let partition = variant == Variant::Sliced || problem.unknowns.is_none();
            assert!(!partition || (sum - expected).abs() < 1e-5, "{variant:?}: vertex {vertex}: {sum}");
        }
        assert!(solve(&disk, &problem, &parameters, false, &Unwatched).unwrap().space.is_none());
    }
}

#[test]
fn levels_of_a_surface_squashed_to_a_line_are_as_small_as_others() {
    // Areas would ask for a sample at nearly every vertex.
    let mut mesh = generate(Shape::Torus, 6000).unwrap();
    mesh.positions.iter_mut().for_each(|p| *p = [p[0], 1e-3 * p[1], 1e-5 * p[2]]);
    let parameters = HsimParameters { levels: Some(3), ..count(20, 1e-2) };
    let pairs = solve(&mesh, &laplacian(&mesh), &parameters, false, &Unwatched).unwrap();
    let levels: Vec<usize> = pairs.levels.iter().map(|level| level.dimension).collect();
    assert!(levels.len() > 1 && levels[0] <= 700, "{levels:?}");
    assert_eq!(pairs.values.len(), 20);
}
