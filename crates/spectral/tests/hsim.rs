//! Exact eigenpairs against what is known: analytic spectra with their order of convergence, references on real meshes,
//! hostile meshes.

mod references;

use chladni_base::{Cancelled, Monitor, SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::operator::{
    Boundary, EigenProblem, Laplacian, MassKind, MeshOperator, OperatorKind, OperatorParameters, Potential, assemble,
};
use chladni_spectral::spectrum::hsim::{Eigenpairs, HsimParameters, Selection, solve};
use references::{load, meshes, reference};

fn operator(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind, boundary: Boundary) -> MeshOperator {
    assemble(mesh, &OperatorParameters { operator, mass, boundary }, &Unwatched).unwrap()
}

fn laplacian(mesh: &TriangleMesh, boundary: Boundary) -> EigenProblem {
    operator(mesh, OperatorKind::Laplace, MassKind::Barycentric, boundary).problem
}

/// Solves, and holds that the answer is converged, orthonormal, ascending and proven complete by its inertia.
fn proven(mesh: &TriangleMesh, problem: &EigenProblem, count: usize, tolerance: f64, what: &str) -> Eigenpairs {
    let parameters = HsimParameters { selection: Selection::Count(count), tolerance, ..HsimParameters::default() };
    let pairs = solve(mesh, problem, &parameters, false, &Unwatched).unwrap_or_else(|error| panic!("{what}: {error}"));
    assert_eq!(pairs.values.len(), count, "{what}");
    assert!(pairs.values.is_sorted(), "{what}");
    let worst = pairs.residuals.iter().copied().fold(0.0, f64::max);
    assert!(worst <= tolerance, "{what}: residual {worst:e}");
    assert!(pairs.orthonormality_defect <= 1e-9, "{what}: defect {:e}", pairs.orthonormality_defect);
    let last = pairs.inertia.last().unwrap();
    assert!(last.shift > pairs.values[count - 1] && last.below >= count, "{what}: {last:?}");
    for counted in &pairs.inertia {
        let found = pairs.values.partition_point(|&value| value < counted.shift);
        assert!(found == counted.below || found == count, "{what}: {counted:?}, {found} found");
    }
    pairs
}

/// Every value within `share` of its reference, which are those of unit area, and within its bound.
fn agree(pairs: &Eigenpairs, area: f64, reference: &[f64], share: f64, what: &str) {
    let (mut highest, mut lowest) = (0f64, 0f64);
    for (value, truth) in pairs.values.iter().zip(reference) {
        if truth.abs() > 1e-6 {
            highest = highest.max(value * area / truth - 1.0);
            lowest = lowest.min(value * area / truth - 1.0);
        } else {
            assert!((value * area).abs() < 1e-6, "{what}: {value}");
        }
    }
    for (k, (value, truth)) in pairs.values.iter().zip(reference).enumerate() {
        let (error, bound) = ((value * area - truth).abs(), pairs.bounds[k] * area);
        assert!(error <= bound + 1e-8 * truth.abs() + 1e-6, "{what}: pair {k}: {error:e} is beyond {bound:e}");
    }
    println!("{what}: from {lowest:e} to {highest:e} of the references, {:?}", pairs.levels);
    assert!(highest <= share && lowest >= -share, "{what}: from {lowest:e} to {highest:e}");
}

/// The largest relative errors on meshes of one and four times as many vertices fall with the square of their edges.
fn converges(shape: Shape, vertices: usize, boundary: Boundary, exact: &[f64], finest: f64) {
    let error = |vertices| {
        let mesh = generate(shape, vertices).unwrap();
        let pairs = proven(&mesh, &laplacian(&mesh, boundary), exact.len(), 1e-6, &format!("{shape:?}, {boundary:?}"));
        let errors = pairs.values.iter().zip(exact).map(|(value, truth)| (value - truth).abs() / truth.max(1.0));
        errors.fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(vertices), error(4 * vertices));
    let order = (coarse / fine).log2();
    println!("{shape:?}, {boundary:?}: errors {coarse:e} and {fine:e}, order {order:.2}");
    assert!(fine <= finest, "{shape:?}, {boundary:?}: {fine:e}");
    assert!((1.6..=2.6).contains(&order), "{shape:?}, {boundary:?}: {coarse:e}, {fine:e}: order {order}");
}

#[test]
fn the_sphere_converges_to_its_spectrum() {
    let exact: Vec<f64> = (0..7).flat_map(|l: u32| vec![f64::from(l * (l + 1)); 2 * l as usize + 1]).collect();
    converges(Shape::Sphere, 2562, Boundary::Neumann, &exact, 0.01);
}

#[test]
fn the_rectangle_converges_to_both_spectra() {
    for (boundary, first) in [(Boundary::Neumann, 0), (Boundary::Dirichlet, 1)] {
        let pi = std::f64::consts::PI;
        let mut exact: Vec<f64> = (first..20)
            .flat_map(|a| (first..20).map(move |b| (f64::from(a) * pi / 1.6).powi(2) + (f64::from(b) * pi).powi(2)))
            .collect();
        exact.sort_by(f64::total_cmp);
        converges(Shape::Rectangle, 2000, boundary, &exact[..30], 0.02);
    }
}

#[test]
fn the_disk_converges_to_both_spectra() {
    // Zeros of Bessel functions and of their derivatives, with the order of the function.
    let dirichlet = [
        (0, 2.404825557695773),
        (1, 3.831705970207512),
        (2, 5.135622301840683),
        (0, 5.520078110286311),
        (3, 6.380161895923984),
        (1, 7.015586669815619),
        (4, 7.588342434503804),
    ];
    let neumann = [
        (0, 0.0),
        (1, 1.841183781340659),
        (2, 3.05423692822714),
        (0, 3.831705970207512),
        (3, 4.201188941210528),
        (4, 5.317553126083994),
        (1, 5.331442773525033),
    ];
    for (boundary, zeros) in [(Boundary::Dirichlet, dirichlet), (Boundary::Neumann, neumann)] {
        let exact: Vec<f64> = zeros
            .iter()
            .flat_map(|&(order, zero): &(i32, f64)| vec![zero * zero; if order == 0 { 1 } else { 2 }])
            .collect();
        converges(Shape::Disk, 2000, boundary, &exact, 0.01);
    }
}

#[test]
fn pairs_at_1e9_agree_with_scipy_to_1e8_on_real_meshes() {
    let Some(folder) = meshes() else { return };
    for (name, count) in [("igea.ply", 20), ("armadillo.obj", 20), ("rolling-stage.obj", 60), ("bunny.obj", 100)] {
        let mesh = load(&folder.join(name));
        let problem = laplacian(&mesh, Boundary::Neumann);
        agree(&proven(&mesh, &problem, count, 1e-9, name), problem.area, &reference(name), 1e-8, name);
    }
    for name in ["face.obj", "bunny.obj"] {
        let mesh = load(&folder.join(name));
        let problem = laplacian(&mesh, Boundary::Dirichlet);
        let truth = reference(&format!("{name}.dirichlet"));
        agree(&proven(&mesh, &problem, 40, 1e-9, name), problem.area, &truth, 1e-8, name);
    }
}

#[test]
fn other_operators_agree_with_scipy_on_real_meshes() {
    let Some(folder) = meshes() else { return };
    let hamiltonian = |t| OperatorKind::Hamiltonian { potential: Potential::Curvature { t } };
    for (name, suffix, kind) in [
        ("fandisk.obj", "hamiltonian-1", hamiltonian(1.0)),
        ("rocker-arm.off", "extrinsic-0.5", OperatorKind::Extrinsic { t: 0.5 }),
        ("camel-gallop/camel-gallop-01.off", "robust", OperatorKind::Robust),
    ] {
        let mesh = load(&folder.join(name));
        let problem = operator(&mesh, kind, MassKind::Barycentric, Boundary::Neumann).problem;
        let truth = reference(&format!("{}.{suffix}", name.rsplit('/').next().unwrap()));
        agree(&proven(&mesh, &problem, 60, 1e-9, name), problem.area, &truth, 1e-7, name);
    }
}

#[test]
fn no_pair_is_missed_where_others_miss_one() {
    let Some(folder) = meshes() else { return };
    for (name, count) in [("igea.ply", 50), ("armadillo.obj", 250), ("armadillo.obj", 1000)] {
        let mesh = load(&folder.join(name));
        let problem = laplacian(&mesh, Boundary::Neumann);
        let what = format!("{name}, {count} pairs");
        agree(&proven(&mesh, &problem, count, 1e-2, &what), problem.area, &reference(name), 1e-3, &what);
    }
}

#[test]
fn slivers_are_no_obstacle() {
    let Some(folder) = meshes() else { return };
    let mesh = load(&folder.join("nefertiti.obj"));
    for kind in [OperatorKind::Laplace, OperatorKind::Auto] {
        let what = format!("nefertiti, {kind:?}");
        let problem = operator(&mesh, kind, MassKind::Barycentric, Boundary::Neumann).problem;
        let loose = proven(&mesh, &problem, 50, 1e-2, &what);
        let tight = proven(&mesh, &problem, 50, 1e-7, &what);
        let truth: Vec<f64> = tight.values.iter().map(|value| value * problem.area).collect();
        agree(&loose, problem.area, &truth, 1e-3, &what);
    }
}

/// The stages that were gone through.
#[derive(Default)]
struct Stages(std::sync::Mutex<Vec<&'static str>>);

impl Monitor for Stages {
    fn stage(&self, name: &'static str) {
        self.0.lock().unwrap().push(name);
    }
    fn progress(&self, _fraction: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
}

#[test]
fn where_coarse_levels_know_nothing_of_the_mesh_random_vectors_do() {
    let mut repaired = 0;
    for seed in 1..=6 {
        // Triangles between vertices at random: no level of a hierarchy says anything about the next.
        let (n, mut random) = (1_800usize, SplitMix64::new(seed));
        let positions = (0..n).map(|_| [0; 3].map(|_| random.signed_unit())).collect();
        let faces = (0..2 * n).map(|t| {
            let mut other = || random.below(n - 1) as u32;
            let (first, second, third) = ((t % n) as u32, other(), other());
            let second = if second >= first { second + 1 } else { second };
            let third = if third == first || third == second { (first.max(second) + 1) % n as u32 } else { third };
            [first, second, third]
        });
        let faces = faces.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let mesh = TriangleMesh { positions, faces, ..Default::default() };
        let problem = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann).problem;
        let stages = Stages::default();
        let parameters =
            HsimParameters { selection: Selection::Count(50), levels: Some(2), ..HsimParameters::default() };
        let pairs =
            solve(&mesh, &problem, &parameters, false, &stages).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        repaired += usize::from(stages.0.lock().unwrap().contains(&"repair"));
        let closer = proven(&mesh, &problem, 60, 1e-8, "to a smaller tolerance");
        for (k, (value, other)) in pairs.values.iter().zip(&closer.values).enumerate() {
            let error = (value - other).abs();
            assert!(error <= pairs.bounds[k] + 1e-7 * other, "seed {seed}, pair {k}: {value} and {other}");
        }
    }
    println!("{repaired} of 6 were repaired");
    assert!(repaired > 0);
}

#[test]
fn every_component_of_the_dragon_adds_one_to_the_kernel() {
    let Some(folder) = meshes() else { return };
    let mesh = load(&folder.join("dragon.ply.gz"));
    let problem = laplacian(&mesh, Boundary::Neumann);
    let pairs = proven(&mesh, &problem, 200, 1e-2, "dragon");
    assert_eq!(pairs.values.iter().filter(|&&value| value == 0.0).count(), 151);
    assert!(pairs.values[151] * problem.area > 1e-3, "{}", pairs.values[151]);
}

#[test]
fn meshes_that_are_no_surfaces_are_solved_with_the_robust_laplacian() {
    let Some(folder) = meshes() else { return };
    for (name, count) in
        [("dragon-nonmanifold.ply.gz", 50), ("fan3.obj", 3), ("hourglass_ico.obj", 10), ("moebius.obj", 20)]
    {
        let mesh = load(&folder.join(name));
        let made = operator(&mesh, OperatorKind::Auto, MassKind::Barycentric, Boundary::Neumann);
        if name != "moebius.obj" {
            assert_eq!(made.report.laplacian, Laplacian::Robust, "{name}");
        }
        let pairs = proven(&mesh, &made.problem, count, 1e-2, name);
        assert!(pairs.values[0].abs() * made.problem.area < 1e-6, "{name}: {}", pairs.values[0]);
    }
}
