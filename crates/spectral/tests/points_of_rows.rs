//! Points in rows, as scanners and grids give them, have the eigenvalues of the surface that they came from.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use chladni_base::SplitMix64;
use chladni_spectral::Unwatched;

use chladni_spectral::mesh::TriangleMesh;
use chladni_spectral::mesh::points::with_local_triangles;
use chladni_spectral::operator::{OperatorParameters, assemble};
use chladni_spectral::spectrum::hsim::{HsimParameters, Wanted, solve};

fn eigenvalues(mesh: &TriangleMesh, count: usize) -> (Vec<f64>, f64) {
    let operator = assemble(mesh, &OperatorParameters::default(), &Unwatched).unwrap();
    let parameters = HsimParameters { wanted: Wanted::Count(count), tolerance: 1e-8, ..HsimParameters::default() };
    let pairs = solve(mesh, &operator.problem, &parameters, false, &Unwatched).unwrap();
    (pairs.values, operator.problem.area)
}

fn cloud(positions: Vec<[f64; 3]>) -> TriangleMesh {
    TriangleMesh { positions, ..Default::default() }
}

/// Points by rows over the unit square, whose sides are joined or not, with two triangles to a cell.
fn rows([across, along]: [usize; 2], joined: bool, at: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
    let cells = |points: usize| if joined { points } else { points - 1 };
    let share = |k: usize, points: usize| k as f64 / cells(points) as f64;
    let positions = (0..across * along).map(|k| at(share(k % across, across), share(k / across, along))).collect();
    let corner = |i: usize, j: usize| (j % along * across + i % across) as u32;
    let cell = |i: usize, j: usize| [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
    let quads = (0..cells(along)).flat_map(|j| (0..cells(across)).map(move |i| cell(i, j)));
    TriangleMesh {
        faces: quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        positions,
        ..Default::default()
    }
}

fn torus(u: f64, v: f64) -> [f64; 3] {
    let (u, v) = (TAU * u, TAU * v);
    let r = 1.0 + 0.3 * v.cos();
    [r * u.cos(), r * u.sin(), 0.3 * v.sin()]
}

/// Points of an open cylinder of radius 1 and length 3, each row turned by a share of a cell against the one before.
fn cylinder([across, along]: [usize; 2], shift: f64) -> Vec<[f64; 3]> {
    let at = |k: usize| {
        let (i, j) = ((k % across) as f64, (k / across) as f64);
        let angle = TAU * (i + shift * j) / across as f64;
        [angle.cos(), angle.sin(), 3.0 * j / (along - 1) as f64]
    };
    (0..across * along).map(at).collect()
}

/// Its eigenvalues, ascending; the lowest few dozen are all there.
fn of_cylinder() -> Vec<f64> {
    let mut exact: Vec<f64> =
        (-9..=9).flat_map(|m| (0..9).map(move |k| f64::from(m * m) + (PI * f64::from(k) / 3.0).powi(2))).collect();
    exact.sort_by(f64::total_cmp);
    exact
}

#[test]
fn points_of_a_torus_by_rows_have_the_eigenvalues_of_the_mesh() {
    for size in [[60, 20], [90, 41]] {
        let mesh = rows(size, true, torus);
        let ((wanted, whole), (found, area)) =
            (eigenvalues(&mesh, 12), eigenvalues(&cloud(mesh.positions.clone()), 12));
        // Diagonals differ, and with them the triangles in space.
        assert!((area / whole - 1.0).abs() < 1e-3, "{size:?}: {area} {whole}");
        for (x, y) in found.iter().zip(&wanted).skip(1) {
            assert!((x / y - 1.0).abs() < 1e-3, "{size:?}: {x} {y}");
        }
    }
}

#[test]
fn points_of_an_open_cylinder_have_its_analytic_eigenvalues_and_nearer_the_more_they_are() {
    let exact = of_cylinder();
    for shift in [0.0, 0.25, 0.5] {
        for (size, within) in [([40, 30], 2e-2), ([80, 60], 5e-3)] {
            let (found, area) = eigenvalues(&cloud(cylinder(size, shift)), 12);
            assert!((area / (6.0 * PI) - 1.0).abs() < within, "{area}");
            for (x, y) in found.iter().zip(&exact).skip(1) {
                assert!((x / y - 1.0).abs() < within, "{size:?}, {shift}: {x} {y}");
            }
        }
    }
}

/// Triangles that not all three of their points have, in per cent of all.
fn disputed(points: &TriangleMesh) -> f64 {
    let mut times: HashMap<[u32; 3], usize> = HashMap::new();
    for mut face in with_local_triangles(&points.positions, &Unwatched).unwrap().faces {
        face.sort_unstable();
        *times.entry(face).or_default() += 1;
    }
    100.0 * times.values().filter(|&&times| times != 3).count() as f64 / times.len() as f64
}

/// Eigenvalues 1 to 19 of points against others, with their area over another.
fn compare(name: &str, points: TriangleMesh, exact: &[f64], whole: f64) {
    let (found, area) = eigenvalues(&points, 20);
    let mut apart: Vec<f64> = found.iter().zip(exact).skip(1).map(|(x, y)| 100.0 * (x / y - 1.0).abs()).collect();
    apart.sort_by(f64::total_cmp);
    let (n, area, disputed) = (points.positions.len(), area / whole, disputed(&points));
    println!("{name}, {n}: {:.2} / {:.2} %, area {area:.4}, in dispute {disputed:.1} %", apart[18], apart[9]);
}

/// The surface of a cube by a lattice of so many cells along an edge.
fn cube(cells: usize) -> TriangleMesh {
    let mut numbers: HashMap<[usize; 3], u32> = HashMap::new();
    let mut mesh = TriangleMesh::default();
    for (axis, end, i, j) in (0..6 * cells * cells)
        .map(|k| (k / (2 * cells * cells), k / (cells * cells) % 2 * cells, k / cells % cells, k % cells))
    {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
            let mut place = [0; 3];
            (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (end, i + di, j + dj);
            *numbers.entry(place).or_insert_with(|| {
                mesh.positions.push(place.map(|x| x as f64 / cells as f64));
                mesh.positions.len() as u32 - 1
            })
        });
        let [a, b, c, d] = if end == 0 { [corners[3], corners[2], corners[1], corners[0]] } else { corners };
        mesh.faces.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// The figures of decision 0135. Real meshes are taken from the folder that `CHLADNI_MESHES` names.
#[test]
#[ignore = "a table of figures"]
fn how_far_points_are_off() {
    let of_mesh = |name: &str, mesh: TriangleMesh| {
        let (exact, whole) = eigenvalues(&mesh, 20);
        compare(name, cloud(mesh.positions), &exact, whole);
    };
    let mut random = SplitMix64::new(3);
    let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
    of_mesh("torus, 60 x 20", rows([60, 20], true, torus));
    of_mesh("torus, 200 x 60", rows([200, 60], true, torus));
    let mut noisy = rows([200, 60], true, torus);
    noisy.positions.as_flattened_mut().iter_mut().for_each(|x| *x += 1e-3 * normal());
    of_mesh("the same with noise of 1e-3", noisy);
    of_mesh("plane grid", rows([60, 60], false, |u, v| [0.36 * u - 0.8 * v, 0.48 * u + 0.6 * v, 0.8 * u]));
    let height = |u: f64, v: f64| 0.15 * (7.0 * u).sin() * (6.0 * v).cos() + 0.05 * (15.0 * u * v).sin();
    of_mesh("height field", rows([100, 100], false, |u, v| [u, v, height(u, v)]));
    of_mesh("cube", cube(32));
    let exact = of_cylinder();
    for size in [[40, 30], [80, 60], [160, 120]] {
        for shift in [0.0, 0.5] {
            compare(
                &format!("open cylinder, {size:?}, offset {shift}"),
                cloud(cylinder(size, shift)),
                &exact,
                6.0 * PI,
            );
        }
    }
    for (n, half) in [(1_000, false), (4_000, false), (20_000, false), (4_000, true)] {
        let mut points: Vec<[f64; 3]> = (0..n).map(|_| [normal(), normal(), normal()]).collect();
        for p in &mut points {
            let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            *p = p.map(|x| x / length);
        }
        if half {
            points.retain(|p| p[2] > 0.0);
        }
        // Of half a sphere, the harmonics that are even across its rim: l + 1 of degree l.
        let degrees = (0..20)
            .flat_map(|l| std::iter::repeat_n(f64::from(l * (l + 1)), if half { l + 1 } else { 2 * l + 1 } as usize));
        let whole = if half { TAU } else { 2.0 * TAU };
        compare(
            if half { "half a sphere at random" } else { "sphere at random" },
            cloud(points),
            &degrees.collect::<Vec<_>>(),
            whole,
        );
    }
    let Ok(folder) = std::env::var("CHLADNI_MESHES") else { return println!("CHLADNI_MESHES is not set") };
    for name in ["armadillo.obj", "fandisk.obj", "camelhead.off", "rocker-arm.off", "horse.ply", "nefertiti.obj"] {
        let mesh = chladni_spectral::Mesh::read(std::path::Path::new(&folder).join(name)).unwrap();
        of_mesh(name, TriangleMesh { local: Default::default(), ..mesh.surface().clone() });
    }
}
