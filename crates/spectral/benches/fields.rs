//! Field bases and design on a sphere of 82,000 faces, 1,000 dimensions: `cargo bench --bench fields`.
//!
//! The cost of a basis over its dimension, as a table: `CHLADNI_TABLE=1 cargo bench --bench fields`, on that sphere or
//! on the mesh files (PLY, OBJ, OFF, separated by commas) of `CHLADNI_TABLE_MESHES`, for the dimensions of
//! `CHLADNI_TABLE_DIMENSIONS`, the field of `CHLADNI_TABLE_FIELD` (`vector`, `tensor` or the `n` of n-vectors), on as
//! many threads as `RAYON_NUM_THREADS` says.

use std::sync::{LazyLock, Mutex};
use std::time::Instant;

use chladni_base::{Cancelled, Monitor, Unwatched};
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_spectral::field::{
    Constraint, Construction, DesignModel, EnergyWeights, FieldBasis, FieldParameters, FieldSurface, Hold,
    LocalEigenfields, field_basis, singularities,
};
use chladni_spectral::operator::transport::FieldKind;
use divan::Bencher;

fn main() {
    if std::env::var_os("CHLADNI_TABLE").is_some() { table() } else { divan::main() }
}

/// Wall and CPU seconds of each stage.
#[derive(Default)]
struct Stages(Mutex<Vec<(&'static str, Instant, f64)>>);

impl Monitor for Stages {
    fn stage(&self, name: &'static str) {
        self.0.lock().unwrap().push((name, Instant::now(), cpu_seconds()));
    }
    fn progress(&self, _: f64) {}
    fn checkpoint(&self) -> Result<(), Cancelled> {
        Ok(())
    }
}

impl Stages {
    /// Wall and CPU seconds of some stages.
    fn seconds(&self, names: &[&str]) -> (f64, f64) {
        let stages = self.0.lock().unwrap();
        let pairs = stages.windows(2).filter(|pair| names.contains(&pair[0].0));
        pairs.fold((0.0, 0.0), |(wall, cpu), pair| {
            (wall + (pair[1].1 - pair[0].1).as_secs_f64(), cpu + pair[1].2 - pair[0].2)
        })
    }
}

/// User and system seconds of this process; 0 where the system does not say.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

fn peak_megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|number| number.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn table() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let kind = match setting("CHLADNI_TABLE_FIELD", "vector").as_str() {
        "vector" => FieldKind::Vector {},
        "tensor" => FieldKind::Tensor {},
        n => FieldKind::NVector { n: n.parse().expect("vector, tensor or a number") },
    };
    let dimensions: Vec<usize> = setting("CHLADNI_TABLE_DIMENSIONS", "500,1000,2000")
        .split(',')
        .map(|dimension| dimension.trim().parse().expect("dimensions are numbers"))
        .collect();
    println!("wall seconds (CPU seconds), {} threads, {kind:?}", rayon::current_num_threads());
    println!(
        "| mesh | faces | d | sampling | columns | smoothing | restriction | all | nonzeros of U | of S̄ | MB | peak MB | ready for design | new weights | 10 constraints, ms | lift, ms |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let files = setting("CHLADNI_TABLE_MESHES", "");
    for file in files.split(',') {
        let mesh = if file.is_empty() {
            noisy(&generate(Shape::Sphere, 41_000).unwrap(), 0.2, 0).unwrap()
        } else {
            let format = MeshFormat::from_extension(file.rsplit('.').next().unwrap()).expect("a format of meshes");
            let raw = read(&std::fs::read(file).unwrap(), format, &Default::default()).unwrap();
            check(raw, &Default::default()).unwrap().mesh
        };
        let surface = FieldSurface::new(mesh).unwrap();
        for &dimension in &dimensions {
            row(file.rsplit('/').next().unwrap(), &surface, kind, dimension);
        }
    }
}

fn row(name: &str, surface: &FieldSurface, kind: FieldKind, dimension: usize) {
    let stages = Stages::default();
    let basis = field_basis(surface, &FieldParameters::new(kind, dimension), &stages).unwrap();
    stages.stage("end");
    let both = |(wall, cpu): (f64, f64)| format!("{wall:.1} ({cpu:.1})");
    let all: Vec<&str> = stages.0.lock().unwrap().iter().map(|stage| stage.0).collect();
    let peak = peak_megabytes();
    stages.stage("ready");
    // Beyond a few thousand dimensions the sparse way is ready at once.
    let model = if basis.space.dimension() > 3000 {
        DesignModel::sparse(&basis)
    } else {
        DesignModel::new(&basis, &Unwatched).unwrap()
    };
    stages.stage("weights");
    let weighted = model.weighted(WEIGHTS, None).unwrap();
    stages.stage("done");
    let faces = surface.faces();
    let constraints: Vec<Constraint> = (0..10)
        .map(|i| Constraint {
            face: (i * faces / 10) as u32,
            value: [(i as f64).cos(), (i as f64).sin(), 0.0],
            hold: Hold::Exact,
        })
        .collect();
    // The least of five.
    let least = |work: &dyn Fn()| {
        let once = |_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        };
        (0..5).map(once).fold(f64::INFINITY, f64::min)
    };
    let solve = || weighted.solve(&basis, &constraints).unwrap();
    let design = solve();
    let (solving, lifting) = (least(&|| drop(solve())), least(&|| drop(basis.space.lift(&design.coefficients))));
    println!(
        "| {name} | {faces} | {dimension} | {} | {} | {} | {} | {} | {:.1}m | {:.1}k | {:.0} | {peak:.0} | {} | {} | {solving:.1} | {lifting:.1} |",
        both(stages.seconds(&["sampling"])),
        both(stages.seconds(&["hierarchy", "columns", "heat"])),
        both(stages.seconds(&["smoothing"])),
        both(stages.seconds(&["restriction"])),
        both(stages.seconds(&all)),
        basis.space.per_row() * (kind.block() * faces) as f64 / 1e6,
        basis.stiffness.entries() as f64 / 1e3,
        basis.space.bytes() as f64 / 1e6,
        both(stages.seconds(&["ready", "ritz"])),
        both(stages.seconds(&["weights"])),
    );
}

const DIMENSION: usize = 1000;

/// A sphere with triangles of all shapes, and a basis ready for design.
struct Setup {
    surface: FieldSurface,
    basis: FieldBasis,
    model: DesignModel,
}

static SETUP: LazyLock<Setup> = LazyLock::new(|| {
    let mesh = noisy(&generate(Shape::Sphere, 41_000).unwrap(), 0.2, 0).unwrap();
    let surface = FieldSurface::new(mesh).unwrap();
    let basis = field_basis(&surface, &FieldParameters::new(FieldKind::Vector {}, DIMENSION), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    Setup { surface, basis, model }
});

const WEIGHTS: EnergyWeights = EnergyWeights { harmonic: 1.0, biharmonic: 0.01 };

fn constraints(count: usize) -> Vec<Constraint> {
    let faces = SETUP.surface.faces();
    let at = |i: usize| Constraint {
        face: (i * faces / count) as u32,
        value: [(i as f64).cos(), (i as f64).sin(), 0.0],
        hold: Hold::Exact,
    };
    (0..count).map(at).collect()
}

#[divan::bench(args = ["vector", "n_vector", "tensor"], sample_count = 3)]
fn heat_basis(bencher: Bencher, kind: &str) {
    let field = match kind {
        "vector" => FieldKind::Vector {},
        "tensor" => FieldKind::Tensor {},
        _ => FieldKind::NVector { n: 4 },
    };
    let surface = &SETUP.surface;
    bencher.bench(|| field_basis(surface, &FieldParameters::new(field, DIMENSION), &Unwatched));
}

#[divan::bench(sample_count = 3)]
fn local_eigenfields(bencher: Bencher) {
    let mut parameters = FieldParameters::new(FieldKind::Vector {}, DIMENSION);
    parameters.construction = Construction::LocalEigenfields(LocalEigenfields::default());
    let surface = &SETUP.surface;
    bencher.bench(|| field_basis(surface, &parameters, &Unwatched));
}

#[divan::bench(sample_count = 3)]
fn set_up_design(bencher: Bencher) {
    let basis = &SETUP.basis;
    bencher.bench(|| DesignModel::new(basis, &Unwatched));
}

#[divan::bench(args = [1, 10, 100])]
fn solve(bencher: Bencher, count: usize) {
    let Setup { basis, model, .. } = &*SETUP;
    let (model, constraints) = (model.weighted(WEIGHTS, None).unwrap(), constraints(count));
    bencher.bench(|| model.solve(basis, &constraints));
}

#[divan::bench]
fn lift(bencher: Bencher) {
    let Setup { basis, model, .. } = &*SETUP;
    let design = model.weighted(WEIGHTS, None).unwrap().solve(basis, &constraints(10)).unwrap();
    bencher.bench(|| basis.space.lift(&design.coefficients));
}

#[divan::bench]
fn singular_vertices(bencher: Bencher) {
    let Setup { surface, basis, model } = &*SETUP;
    let design = model.weighted(WEIGHTS, None).unwrap().solve(basis, &constraints(10)).unwrap();
    let field = basis.space.lift(&design.coefficients).unwrap();
    bencher.bench(|| singularities(surface, basis.kind, &field));
}
