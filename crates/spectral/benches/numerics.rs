//! The numerical stages of a fast approximation, one at a time. `cargo bench --bench numerics`
//!
//! The surface has genus 3 and about 100,000 vertices; `CHLADNI_BENCH_VERTICES` asks for another size.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex};

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver, lowest_symmetric};
use chladni_base::Unwatched;
use chladni_mesh::{
    TriangleMesh,
    check::{CheckOptions, check},
    connectivity::Connectivity,
    read::{MeshFormat, ReadLimits, read},
    shape::{Shape, generate},
};
use chladni_spectral::analysis::distance::SpectralDistance;
use chladni_spectral::analysis::family::{Member, spectrum};
use chladni_spectral::analysis::filter::{Transfer, filter};
use chladni_spectral::analysis::functional_map::{MapRequest, functional_map};
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::analysis::signature::Signature;
use chladni_spectral::basis::family::FamilyBasis;
use chladni_spectral::basis::modal::{ModalBasis, ModalFunctions};
use chladni_spectral::basis::{Basis, Compact, Functions};
use chladni_spectral::operator::{EigenProblem, MassKind, family::family, laplace};
use chladni_spectral::spectrum::{
    certificate::certify,
    energy::Energy,
    family::restrict_family,
    radial::{RadialParameters, space},
};
use divan::Bencher;

/// What the server allocates with.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    divan::main();
}

/// Everything that the stages start from.
struct Case {
    mesh: TriangleMesh,
    problem: EigenProblem,
    space: SparseMatrix<f32>,
    stiffness: SparseMatrix,
    mass: SparseMatrix,
    basis: Basis,
    functions: DenseMatrix,
}

const DIMENSION: usize = 1000;
const COUNT: usize = 500;

static CASE: LazyLock<Case> = LazyLock::new(|| {
    let vertices = std::env::var("CHLADNI_BENCH_VERTICES").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000);
    let mesh = generate(Shape::Genus(3), vertices).unwrap();
    let problem = laplace::assemble(&mesh, MassKind::Barycentric).unwrap();
    let connectivity = Connectivity::new(&mesh);
    let mut space = space(&mesh, &connectivity, DIMENSION, 1, &RadialParameters::default(), &Unwatched).unwrap();
    let (stiffness, mass) = problem.restrict(&space, &Unwatched).unwrap();
    let mut pairs = CpuSolver.lowest(stiffness.to_dense(), mass.to_dense(), COUNT, &Unwatched).unwrap();
    let energy = Energy::new(&problem, 0.0, &Unwatched).unwrap();
    let (certificate, _) =
        certify(&energy, &problem, &mut space, &mass, &mut pairs.vectors, &pairs.values, None, &Unwatched).unwrap();
    let basis = Basis {
        functions: Functions::Compact(Compact::new(space.clone(), pairs.vectors)),
        eigenvalues: pairs.values,
        mass: problem.mass.clone(),
        certificate,
        metadata: serde_json::Value::Null.into(),
    };
    let coordinates = (0..3).flat_map(|k| mesh.positions.iter().map(move |p| p[k])).collect();
    let functions = DenseMatrix::from_columns(mesh.positions.len(), 3, coordinates);
    Case { mesh, problem, space, stiffness, mass, basis, functions }
});

#[divan::bench(max_time = 3)]
fn assemble(bencher: Bencher) {
    bencher.bench(|| laplace::assemble(&CASE.mesh, MassKind::Barycentric));
}

#[divan::bench(max_time = 3)]
fn restrict(bencher: Bencher) {
    bencher.bench(|| CASE.problem.restrict(&CASE.space, &Unwatched));
}

/// The dense eigenproblem, d = 1000, 500 pairs.
#[divan::bench(max_time = 5)]
fn eigen(bencher: Bencher) {
    let inputs = || (CASE.stiffness.to_dense(), CASE.mass.to_dense());
    bencher.with_inputs(inputs).bench_values(|(a, b)| CpuSolver.lowest(a, b, COUNT, &Unwatched));
}

/// Half the pairs of a random pencil.
#[divan::bench(args = [216, 500, 1000, 2000, 5000], max_time = 10)]
fn dense_eigenproblem(bencher: Bencher, d: usize) {
    let entry = |k: usize| ((k as f64 + 0.5) * 12.9898).sin();
    let matrix = |values: Vec<f64>| DenseMatrix::from_columns(d, d, values);
    let a = matrix((0..d * d).map(|k| entry((k / d).max(k % d) * d + (k / d).min(k % d))).collect());
    let b = matrix((0..d * d).map(|k| if k % (d + 1) == 0 { 2.0 } else { 1.0 / d as f64 }).collect());
    bencher.with_inputs(|| (a.clone(), b.clone())).bench_values(|(a, b)| CpuSolver.lowest(a, b, d / 2, &Unwatched));
}

#[divan::bench(max_time = 5)]
fn certificate(bencher: Bencher) {
    let problem = &CASE.problem;
    let inputs = || (CASE.basis.compact().unwrap().coefficients.clone(), CASE.space.clone());
    bencher.with_inputs(inputs).bench_values(|(mut x, mut space)| {
        let energy = Energy::new(problem, 0.0, &Unwatched).unwrap();
        certify(&energy, problem, &mut space, &CASE.mass, &mut x, &CASE.basis.eigenvalues, None, &Unwatched)
    });
}

/// Three functions through 500 modes and back.
#[divan::bench(max_time = 2)]
fn filter_coordinates(bencher: Bencher) {
    bencher.bench(|| filter(&CASE.basis, &CASE.functions, &Transfer::Heat { time: 1e-3 }));
}

/// A frame of a simulation: 500 modes with three coordinates in a space of 1000 functions.
/// `CHLADNI_BENCH_VERTICES=165000` for the thesis' size.
#[divan::bench(max_time = 3)]
fn frame_of_500_modes(bencher: Bencher) {
    let n = CASE.mesh.positions.len();
    let values = (0..3 * DIMENSION * COUNT).map(|k| (k as f64 * 0.7).sin()).collect();
    let basis = ModalBasis {
        eigenvalues: vec![1.0; COUNT],
        rigid: 0,
        masses: vec![1.0; n],
        part: vec![0; n],
        rest: vec![[0.5; 3]; n],
        length: 1.0,
        affine: DenseMatrix::zeros(12, COUNT),
        functions: ModalFunctions::Compact {
            space: CASE.space.clone(),
            coefficients: DenseMatrix::from_columns(3 * DIMENSION, COUNT, values),
        },
        bounds: vec![0.0; COUNT],
        metadata: serde_json::Value::Null.into(),
    };
    let lifter = basis.lifter();
    let q: Vec<f64> = (0..COUNT).map(|k| (k as f64).cos()).collect();
    let mut out = vec![0f32; 3 * n];
    bencher.bench_local(|| lifter.lift(&q, &mut out).unwrap());
}

/// The lowest 100 pairs of members of a family, d = 780, on a knot of 20,000 vertices and, where `CHLADNI_MESHES` names
/// their folder, on real meshes: the extrinsic parameter and the factor of the curvature potential (at unit area).
#[divan::bench(max_time = 1, args = ["knot", "armadillo.obj", "bunny.obj"], consts = [0, 1, 2, 3, 4, 5, 6])]
fn family_spectrum<const MEMBER: usize>(bencher: Bencher, name: &str) {
    static FAMILIES: LazyLock<Mutex<HashMap<String, Arc<FamilyBasis>>>> = LazyLock::new(Mutex::default);
    let family = {
        let mut families = FAMILIES.lock().unwrap();
        match families.get(name) {
            Some(family) => family.clone(),
            None => {
                let Some(found) = restricted_family(name) else { return };
                families.entry(name.to_owned()).or_insert(Arc::new(found)).clone()
            }
        }
    };
    let [extrinsic, curvature] = MEMBERS[MEMBER];
    bencher.bench(|| spectrum(&family, Member { extrinsic, curvature }, 100));
}

const FAMILY_DIMENSION: usize = 780;

/// `t` and `v`.
const MEMBERS: [[f64; 2]; 7] = [[0.0, 0.0], [0.01, 0.0], [0.1, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 0.1], [0.0, 1.0]];

fn restricted_family(name: &str) -> Option<FamilyBasis> {
    let mesh = match name {
        "knot" => generate(Shape::Knot, 20_000).unwrap(),
        file => {
            let path = std::path::PathBuf::from(std::env::var_os("CHLADNI_MESHES")?).join(file);
            let format = MeshFormat::from_extension(path.extension()?.to_str()?)?;
            let raw = read(&std::fs::read(path).ok()?, format, &ReadLimits::default()).unwrap();
            check(raw, &CheckOptions::default()).unwrap().mesh
        }
    };
    Some(restrict_family(&mesh, &family(&mesh, &Unwatched).unwrap(), FAMILY_DIMENSION, 0, &Unwatched).unwrap())
}

/// The lowest 100 pairs of a symmetric matrix of size 1000.
#[divan::bench(max_time = 3)]
fn lowest_100_of_1000(bencher: Bencher) {
    bencher.with_inputs(|| CASE.stiffness.to_dense()).bench_values(|a| lowest_symmetric(a, 100, &Unwatched));
}

/// Sums of squares of 500 modes everywhere, for so many columns of weights.
#[divan::bench(max_time = 2, args = [1, 3, 8, 16])]
fn squares(bencher: Bencher, columns: usize) {
    let signature = Signature::heat_kernel(&CASE.basis.eigenvalues, columns, false).unwrap();
    bencher.bench(|| signature.everywhere(&CASE.basis));
}

/// Biharmonic distances from so many sources.
#[divan::bench(max_time = 2, args = [1, 10])]
fn biharmonic(bencher: Bencher, sources: u32) {
    let sources: Vec<u32> = (0..sources).map(|k| 1000 * k).collect();
    bencher.bench(|| SpectralDistance::Biharmonic.from_sources(&CASE.basis, &sources));
}

/// Geodesic distances from so many sources.
#[divan::bench(max_time = 2, args = [1, 10])]
fn geodesic_distance(bencher: Bencher, sources: u32) {
    let sources: Vec<u32> = (0..sources).map(|k| 1000 * k).collect();
    bencher.bench(|| geodesic(&CASE.basis, &CASE.mesh, &sources, false, None));
}

/// A functional map of 100 pairs from ten landmarks, 2000 samples.
#[divan::bench(max_time = 3)]
fn map_to_itself(bencher: Bencher) {
    let request = MapRequest {
        landmarks: (0..10).map(|k| [9000 * k, 9000 * k]).collect(),
        descriptors: None,
        signatures: false,
        start: 20,
        pairs: 100,
        step: 5,
        samples: 2000,
        commutativity: 0.1,
        all_points: false,
        both_ways: false,
    };
    bencher.bench(|| functional_map(&CASE.basis, &CASE.basis, &request));
}

#[divan::bench(max_time = 2)]
fn lift_32_modes(bencher: Bencher) {
    bencher.bench(|| CASE.basis.lift::<f32>(0..32));
}
