//! The Laplacian on tetrahedra against one that SciPy assembles of the same file, in the numbering of the file and by
//! another formula.

use std::process::Command;

use chladni_spectral::Unwatched;
use chladni_spectral::mesh::check::CheckOptions;
use chladni_spectral::mesh::read::{MeshFormat, ReadLimits, read};
use chladni_spectral::mesh::solid::check_body;
use chladni_spectral::operator::{Boundary, MassKind, volume};
use chladni_spectral::spectrum::hsim::{HsimParameters, Selection};
use chladni_spectral::spectrum::nested::{RowPositions, solve};

const SCRIPT: &str = r#"
import sys, numpy as np, scipy.sparse as sp, scipy.sparse.linalg as la
path, mass, boundary, count = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
words = iter(open(path).read().split())
P = T = None
for word in words:
    if word == "Vertices":
        n = int(next(words)); P = np.array([[float(next(words)) for _ in range(4)][:3] for _ in range(n)])
    elif word == "Tetrahedra":
        n = int(next(words)); T = np.array([[int(next(words)) for _ in range(5)][:4] for _ in range(n)]) - 1
used, T = np.unique(T, return_inverse=True); T = T.reshape(-1, 4); P = P[used]; n = len(P)
# Hat functions are the rows of the inverse of the corners with a column of ones.
C = np.concatenate([np.ones((len(T), 4, 1)), P[T]], axis=2)
V = np.abs(np.linalg.det(C)) / 6
G = np.linalg.inv(C)[:, 1:, :]
I, J = np.repeat(T, 4, axis=1).ravel(), np.tile(T, (1, 4)).ravel()
S = sp.csc_matrix(((np.einsum("tki,tkj->tij", G, G) * V[:, None, None]).ravel(), (I, J)), (n, n))
if mass == "consistent":
    M = sp.csc_matrix((((np.ones((4, 4)) + np.eye(4)) / 20 * V[:, None, None]).ravel(), (I, J)), (n, n))
else:
    M = sp.diags(np.bincount(T.ravel(), np.repeat(V / 4, 4), n)).tocsc()
if boundary == "dirichlet":
    sides = np.sort(np.concatenate([np.delete(T, k, axis=1) for k in range(4)]), axis=1)
    sides, times = np.unique(sides, axis=0, return_counts=True)
    inner = np.setdiff1d(np.arange(n), sides[times == 1])
    S, M = S[inner][:, inner], M[inner][:, inner]
values = np.sort(la.eigsh(S, count, M, sigma=-1e-3 * S.diagonal().sum() / M.diagonal().sum(), tol=1e-13)[0])
print(S.shape[0], repr(float(sp.linalg.norm(S))), repr(float(sp.linalg.norm(M))), repr(float(V.sum())))
print(*[repr(float(x)) for x in values])
"#;

fn python() -> Option<String> {
    let named = std::env::var("CHLADNI_PYTHON").ok();
    named.into_iter().chain(["python3".to_owned(), "/usr/bin/python3".to_owned()]).find(|python| {
        Command::new(python).args(["-c", "import numpy, scipy.sparse"]).output().is_ok_and(|out| out.status.success())
    })
}

#[test]
fn a_real_solid_has_the_matrices_and_eigenvalues_of_scipy() {
    let (Some(folder), Some(python)) = (std::env::var_os("CHLADNI_MESHES"), python()) else {
        eprintln!("skipped: CHLADNI_MESHES is not set, or no Python with SciPy was found");
        return;
    };
    let path = std::path::Path::new(&folder).join("bunny-tet.mesh");
    let raw = read(&std::fs::read(&path).unwrap(), MeshFormat::Medit, &ReadLimits::default()).unwrap();
    let solid = check_body(raw, &CheckOptions::default()).unwrap().solid.unwrap();
    let count = 40;
    for (mass, boundary, name, condition) in [
        (MassKind::Barycentric, Boundary::Neumann, "barycentric", "neumann"),
        (MassKind::Consistent, Boundary::Neumann, "consistent", "neumann"),
        (MassKind::Barycentric, Boundary::Dirichlet, "barycentric", "dirichlet"),
    ] {
        let out = Command::new(&python)
            .args(["-c", SCRIPT, path.to_str().unwrap(), name, condition, &count.to_string()])
            .output()
            .unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let numbers: Vec<f64> =
            String::from_utf8(out.stdout).unwrap().split_whitespace().map(|word| word.parse().unwrap()).collect();
        let (sizes, values) = numbers.split_at(4);
        let problem = volume::assemble(&solid, mass, boundary, &Unwatched).unwrap().problem;
        let norm = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>().sqrt();
        let masses = problem.mass.sparse().map_or_else(|| norm(&problem.mass.lumped()), |mass| norm(mass.values()));
        let found = [problem.size() as f64, norm(problem.stiffness.values()), masses * problem.area, problem.area];
        for (found, expected) in found.iter().zip(sizes) {
            // The largest entries are those of slivers, and differences of nearly equal numbers.
            assert!((found - expected).abs() <= 1e-10 * expected, "{name} {condition}: {found} is not {expected}");
        }
        let parameters =
            HsimParameters { selection: Selection::Count(count), tolerance: 1e-8, ..HsimParameters::default() };
        let places = RowPositions::Positions(&solid.positions);
        let pairs = solve(&problem, places, solid.positions.len(), &parameters, &Unwatched).unwrap();
        for (found, expected) in pairs.values.iter().zip(values) {
            let error = (found - expected).abs();
            assert!(
                error <= 1e-8 * values[count - 1].min(expected.abs().max(1.0)),
                "{name} {condition}: {found} is not {expected}"
            );
        }
    }
}
