//! Pencils without a mesh: `cargo bench --bench pencils`. CPU seconds and the largest resident memory so far.
//!
//! Stiffness matrices of a cube of tetrahedra with about `CHLADNI_PENCIL_TETS` (30000) unknowns and
//! `CHLADNI_PENCIL_COUNT` (200) pairs; and Laplacians of the surfaces in `CHLADNI_PENCIL_MESHES` (a list with commas of
//! files), with positions and without, 50 and 250 pairs. Residuals of 1e-2 on surfaces, as in the other tables, and
//! 1e-6 in the cube.

use std::path::Path;

use chladni_base::Unwatched;
use chladni_mesh::TetMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_spectral::operator::{Boundary, EigenProblem, MassKind, MassMatrix, OperatorParameters, assemble, volume};
use chladni_spectral::spectrum::hsim::{self, HsimParameters};
use chladni_spectral::spectrum::pencil::{Mass, Pairs, Parameters, Pencil, PencilSelection, solve};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}

fn peak_gigabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0) / 1e6
}

/// A cube of `side³` cells, six tetrahedra each.
fn cube(side: usize) -> TetMesh {
    let at = |x: usize, y: usize, z: usize| ((z * (side + 1) + y) * (side + 1) + x) as u32;
    let mut positions = Vec::new();
    for z in 0..=side {
        for y in 0..=side {
            for x in 0..=side {
                // A box without symmetries.
                positions.push([x as f64, 1.1 * y as f64, 1.3 * z as f64].map(|x| x / side as f64));
            }
        }
    }
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut tetrahedra = Vec::new();
    for cell in 0..side * side * side {
        let low = [cell % side, cell / side % side, cell / side / side];
        for order in orders {
            let mut corner = low;
            let mut tetrahedron = [at(low[0], low[1], low[2]); 4];
            for (k, axis) in order.into_iter().enumerate() {
                corner[axis] += 1;
                tetrahedron[k + 1] = at(corner[0], corner[1], corner[2]);
            }
            tetrahedra.push(tetrahedron);
        }
    }
    TetMesh { positions, tetrahedra }
}

fn without_positions(problem: &EigenProblem, count: usize, tolerance: f64) -> Pairs {
    let mass = match problem.mass.scaled(problem.area) {
        MassMatrix::Diagonal(mass) => Mass::Diagonal(mass),
        mass => Mass::Sparse(mass.sparse().expect("a sparse mass").clone()),
    };
    let pencil = Pencil::new(problem.stiffness.clone(), mass, &[], &Unwatched).expect("a pencil");
    let parameters = Parameters { selection: PencilSelection::Count(count), tolerance, seed: 0 };
    solve(&pencil, &parameters, &Unwatched).expect("eigenpairs")
}

fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let began = cpu_seconds();
    let made = work();
    (cpu_seconds() - began, made)
}

fn tetrahedra(unknowns: f64, count: usize) {
    let solid = cube((unknowns.cbrt() as usize).saturating_sub(1));
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let operator = volume::assemble(&solid, mass, Boundary::Neumann, &Unwatched).expect("an operator");
        let problem = &operator.problem;
        let (seconds, pairs) = timed(|| without_positions(problem, count, 1e-6));
        let (n, peak) = (problem.size(), peak_gigabytes());
        let report = pairs.certificate.levels.last().copied();
        println!("| cube, {mass:?} | {n} | {count} | {seconds:.1} | {peak:.2} GB | {report:?} |");
    }
}

fn surface(path: &Path) {
    let bytes = std::fs::read(path).expect("a file");
    let format = MeshFormat::from_extension(path.extension().and_then(|e| e.to_str()).unwrap_or("")).expect("a format");
    let raw = read(&bytes, format, &ReadLimits::default()).expect("a mesh");
    let mesh = check(raw, &CheckOptions::default()).expect("a surface").mesh;
    let problem = assemble(&mesh, &OperatorParameters::default(), &Unwatched).expect("an operator").problem;
    for count in [50, 250] {
        let wanted = HsimParameters { selection: hsim::Selection::Count(count), ..HsimParameters::default() };
        let mut best = [f64::INFINITY; 2];
        for _ in 0..3 {
            let (with, a) = timed(|| hsim::solve(&mesh, &problem, &wanted, false, &Unwatched).expect("eigenpairs"));
            let (without, b) = timed(|| without_positions(&problem, count, 1e-2));
            for ((a, b), bounds) in a.values.iter().zip(&b.values).zip(a.bounds.iter().zip(&b.certificate.bounds)) {
                assert!((a - b).abs() <= bounds.0 + bounds.1, "{a} is not {b}");
            }
            best = [best[0].min(with), best[1].min(without)];
        }
        let name = path.file_name().unwrap_or_default().display();
        let [with, without] = best;
        println!("| {name} | {} | {count} | {with:.2} | {without:.2} | {:.2} |", problem.size(), without / with);
    }
}

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    threads.install(|| {
        println!("| surface | unknowns | pairs | with positions | without | ratio |\n|---|---|---|---|---|---|");
        setting("CHLADNI_PENCIL_MESHES", "")
            .split(',')
            .filter(|name| !name.is_empty())
            .for_each(|name| surface(Path::new(name)));
        println!("| solid | unknowns | pairs | CPU s | peak | iteration |\n|---|---|---|---|---|---|");
        let unknowns: f64 = setting("CHLADNI_PENCIL_TETS", "30000").parse().expect("a number of unknowns");
        if unknowns > 0.0 {
            tetrahedra(unknowns, setting("CHLADNI_PENCIL_COUNT", "200").parse().expect("a number of pairs"));
        }
    });
}
