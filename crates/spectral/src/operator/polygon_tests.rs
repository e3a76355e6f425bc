use std::sync::Arc;

use super::*;
use crate::operator::{Boundary, Laplacian, OperatorKind, OperatorParameters, Potential, Reason, assemble};
use chladni_algebra::{CpuSolver, DenseMatrix, SymmetricDefiniteSolver};
use chladni_base::Unwatched;
use chladni_mesh::fixtures::sphere;
use chladni_mesh::polygons::Polygons;

/// A mesh of polygons, cut into fans.
fn of_polygons(positions: Vec<[f64; 3]>, polygons: &[Vec<u32>]) -> TriangleMesh {
    let (mut faces, mut of_face) = (Vec::new(), Vec::new());
    for (number, corners) in polygons.iter().enumerate() {
        for i in 1..corners.len() - 1 {
            faces.push([corners[0], corners[i], corners[i + 1]]);
            of_face.push(number as u32);
        }
    }
    TriangleMesh { positions, faces, polygons: Polygons::new(of_face).map(Arc::new), ..Default::default() }
}

/// Quads of a grid of `k × k` cells on the unit square, moved by `bend`.
fn quads(k: usize, bend: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
    let at = |i: usize, j: usize| (j * (k + 1) + i) as u32;
    let place = |v: usize| bend((v % (k + 1)) as f64 / k as f64, (v / (k + 1)) as f64 / k as f64);
    let cells = (0..k * k).map(|c| (c % k, c / k));
    let polygons: Vec<Vec<u32>> =
        cells.map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]).collect();
    of_polygons((0..(k + 1) * (k + 1)).map(place).collect(), &polygons)
}

/// A cube with `k × k` quads on each side, drawn out to the unit sphere.
fn quad_sphere(k: usize) -> TriangleMesh {
    let mut index = std::collections::HashMap::new();
    let (mut positions, mut polygons) = (Vec::new(), Vec::new());
    for side in 0..6 {
        let mut at = |i: usize, j: usize| {
            let (a, b) = (2 * i as i64 - k as i64, 2 * j as i64 - k as i64);
            let c = if side < 3 { k as i64 } else { -(k as i64) };
            let mut p = [a, b, c];
            if side >= 3 {
                p.swap(0, 1);
            }
            p.rotate_left(side % 3);
            *index.entry(p).or_insert_with(|| {
                let angle = Vector3(p.map(|x| (std::f64::consts::FRAC_PI_4 * x as f64 / k as f64).tan()));
                positions.push((angle / angle.norm()).into());
                positions.len() as u32 - 1
            })
        };
        for i in 0..k {
            for j in 0..k {
                polygons.push(vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    of_polygons(positions, &polygons)
}

/// A sheet whose quads are neither flat nor alike.
fn wavy(x: f64, y: f64) -> [f64; 3] {
    [x + 0.03 * (9.0 * y).sin(), y + 0.03 * (7.0 * x).cos(), 0.2 * (5.0 * x).sin() * (4.0 * y).cos()]
}

fn problem(mesh: &TriangleMesh, operator: OperatorKind, mass: MassKind) -> EigenProblem {
    let parameters = OperatorParameters { operator, mass, ..OperatorParameters::default() };
    assemble(mesh, &parameters, &Unwatched).unwrap().problem
}

fn dense(matrix: &SparseMatrix) -> DenseMatrix {
    let mut full = DenseMatrix::zeros(matrix.rows(), matrix.rows());
    for row in 0..matrix.rows() {
        let (columns, values) = matrix.row(row);
        columns.iter().zip(values).for_each(|(&column, &value)| full.column_mut(column as usize)[row] = value);
    }
    full
}

fn dense_mass(mass: &MassMatrix, n: usize) -> DenseMatrix {
    match mass {
        MassMatrix::Sparse(matrix) => dense(matrix),
        lumped => {
            let mut full = DenseMatrix::zeros(n, n);
            lumped.lumped().iter().enumerate().for_each(|(i, &value)| full.column_mut(i)[i] = value);
            full
        }
    }
}

/// The lowest eigenvalues in the units of the mesh.
fn spectrum(problem: &EigenProblem, count: usize) -> Vec<f64> {
    let n = problem.size();
    let pairs = CpuSolver.lowest(dense(&problem.stiffness), dense_mass(&problem.mass, n), count, &Unwatched).unwrap();
    pairs.values.iter().map(|value| value / problem.area).collect()
}

#[test]
fn triangles_have_the_operator_of_cotangents_to_the_last_bit() {
    let mesh = sphere(6);
    for mass in [MassKind::Barycentric, MassKind::Consistent, MassKind::Voronoi] {
        let polygon = problem(&mesh, OperatorKind::Polygon, mass);
        assert_eq!(polygon, problem(&mesh, OperatorKind::Laplace, mass));
    }
    // A quad elsewhere changes nothing here.
    let mut more = mesh.clone();
    let n = mesh.positions.len() as u32;
    more.positions.extend([[9.0, 0.0, 0.0], [10.0, 0.0, 0.1], [10.0, 1.0, 0.0], [9.0, 1.1, 0.0]]);
    more.faces.extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
    let of_face = (0..mesh.faces.len() as u32).chain([9999, 9999]).collect();
    more.polygons = Polygons::new(of_face).map(Arc::new);
    let (polygon, cut) = (
        problem(&more, OperatorKind::Polygon, MassKind::Barycentric),
        problem(&more, OperatorKind::Laplace, MassKind::Barycentric),
    );
    for row in 0..n as usize {
        let (columns, values) = cut.stiffness.row(row);
        let own = polygon.stiffness.row(row);
        assert_eq!(own.0, columns);
        assert!(own.1.iter().zip(values).all(|(a, b)| (a - b).abs() < 1e-12));
    }
    assert_eq!(polygon.stiffness.row(n as usize).0, [n, n + 1, n + 2, n + 3]);
}

/// By definition: the cotangents of the finer mesh and the prolongation as dense matrices, the middle found by descent.
#[test]
fn the_operator_is_the_one_of_the_finer_mesh_restricted() {
    let positions: Vec<[f64; 3]> = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.1, 0.2],
        [1.4, 1.0, -0.1],
        [0.5, 1.6, 0.3],
        [-0.3, 0.9, 0.0],
        [2.0, 0.0, 0.0],
        [2.2, 1.1, 0.4],
    ];
    let polygons = [vec![0, 1, 2, 3, 4], vec![1, 5, 6, 2]];
    let mesh = of_polygons(positions.clone(), &polygons);
    let mut fine = TriangleMesh { positions: positions.clone(), ..TriangleMesh::default() };
    let n = positions.len();
    let mut prolongation = DenseMatrix::zeros(n + 2, n);
    (0..n).for_each(|i| prolongation.column_mut(i)[i] = 1.0);
    for (number, corners) in polygons.iter().enumerate() {
        let k = corners.len();
        let squares = |p: Vector3| -> f64 {
            (0..k)
                .map(|i| {
                    let [a, b] = [corners[i], corners[(i + 1) % k]].map(|v| Vector3(positions[v as usize]) - p);
                    a.cross(b).norm_squared()
                })
                .sum()
        };
        // The sum is quadratic: one step of Newton's method from differences.
        let mut p = Vector3(positions[corners[0] as usize]);
        for _ in 0..3 {
            let h = 1e-3;
            let moved = |p: Vector3, axis: usize, by: f64| p + by * Vector3::AXES[axis];
            let slope = |i: usize| (squares(moved(p, i, h)) - squares(moved(p, i, -h))) / (2.0 * h);
            let slope = Vector3(std::array::from_fn(slope));
            let bend = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    let corner = |s: f64, t: f64| squares(moved(moved(p, i, s * h), j, t * h));
                    (corner(1.0, 1.0) - corner(1.0, -1.0) - corner(-1.0, 1.0) + corner(-1.0, -1.0)) / (4.0 * h * h)
                })
            });
            let step = solved(bend, slope).unwrap();
            p -= step;
        }
        let shares = shares(&mesh, corners);
        let middle: Vector3 =
            corners.iter().zip(&shares).map(|(&corner, &share)| share * Vector3(positions[corner as usize])).sum();
        assert!((0..3).all(|axis| (middle[axis] - p[axis]).abs() < 1e-6), "{middle:?} {p:?}");
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        // Of least squares: nothing of it lies along combinations that move nothing. For a quad in space there is one,
        // for a pentagon one more.
        let blind = |seed: f64| -> Vec<f64> {
            let mut z: Vec<f64> = (0..k).map(|i| (seed + 2.3 * i as f64).sin()).collect();
            let mut rows: Vec<Vec<f64>> = vec![vec![1.0; k]];
            rows.extend((0..3).map(|axis| corners.iter().map(|&v| positions[v as usize][axis]).collect()));
            let mut frame: Vec<Vec<f64>> = Vec::new();
            for mut row in rows {
                for other in &frame {
                    let along: f64 = row.iter().zip(other).map(|(a, b)| a * b).sum();
                    row.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
                }
                let length = row.iter().map(|a| a * a).sum::<f64>().sqrt();
                frame.push(row.iter().map(|a| a / length).collect());
            }
            for other in &frame {
                let along: f64 = z.iter().zip(other).map(|(a, b)| a * b).sum();
                z.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
            z
        };
        let z = blind(number as f64);
        assert!(z.iter().zip(&shares).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-9);
        fine.positions.push(middle.into());
        for i in 0..k {
            fine.faces.push([corners[i], corners[(i + 1) % k], (n + number) as u32]);
            prolongation.column_mut(corners[i] as usize)[n + number] = shares[i];
        }
    }
    for kind in [MassKind::Consistent, MassKind::Barycentric] {
        let own = problem(&mesh, OperatorKind::Polygon, kind);
        let whole = problem(&fine, OperatorKind::Laplace, kind);
        let restricted = |full: DenseMatrix| {
            let right = full.times(&prolongation);
            prolongation.transposed_times(&right)
        };
        let same =
            |a: &DenseMatrix, b: &DenseMatrix| a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(same(&dense(&own.stiffness), &restricted(dense(&whole.stiffness))));
        assert!((own.area - whole.area).abs() < 1e-12);
        let mass = restricted(dense_mass(&whole.mass, n + 2));
        match &own.mass {
            MassMatrix::Sparse(matrix) => assert!(same(&dense(matrix), &mass)),
            // Rows of the restricted mass of the finer mesh, summed.
            diagonal => {
                let values = diagonal.lumped();
                let lumped = dense_mass(&whole.mass, n + 2);
                for i in 0..n {
                    let sum: f64 = (0..n + 2).map(|v| prolongation.column(i)[v] * lumped.column(v)[v]).sum();
                    assert!((values[i] - sum).abs() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn constants_are_in_the_kernel_and_linear_functions_on_flat_polygons_are_harmonic() {
    for mesh in [quads(7, wavy), quad_sphere(5)] {
        for mass in [MassKind::Barycentric, MassKind::Consistent, MassKind::Voronoi] {
            let EigenProblem { stiffness, mass, .. } = problem(&mesh, OperatorKind::Auto, mass);
            let full = dense(&stiffness);
            for row in 0..stiffness.rows() {
                let (columns, values) = stiffness.row(row);
                let size: f64 = values.iter().map(|v| v.abs()).sum();
                assert!(values.iter().sum::<f64>().abs() < 1e-13 * size);
                assert!(columns.iter().zip(values).all(|(&c, &v)| full.column(row)[c as usize] == v), "symmetric");
            }
            let total: f64 = dense_mass(&mass, stiffness.rows()).values().iter().sum();
            assert!((total - 1.0).abs() < 1e-12, "{total}");
        }
        let values = spectrum(&problem(&mesh, OperatorKind::Auto, MassKind::Barycentric), 3);
        assert!(values[0].abs() < 1e-10 && values[1] > 1e-2, "{values:?}");
    }
    let flat = quads(6, |x, y| [x + 0.05 * (8.0 * y).sin(), y + 0.04 * (9.0 * x).sin(), 0.0]);
    let operator = problem(&flat, OperatorKind::Auto, MassKind::Barycentric);
    for row in (0..49).filter(|row| (1..6).contains(&(row % 7)) && (1..6).contains(&(row / 7))) {
        let (columns, values) = operator.stiffness.row(row);
        for axis in 0..2 {
            let sum: f64 = columns.iter().zip(values).map(|(&c, v)| v * flat.positions[c as usize][axis]).sum();
            assert!(sum.abs() < 1e-12, "{row} {axis}: {sum}");
        }
    }
}

/// Whoever looks for a kernel by the sums of rows must find it, whatever nearly cancelled on the way.
#[test]
fn rows_of_polygons_sum_to_zero_but_for_the_rounding_of_that_sum() {
    for mesh in
        [quads(40, wavy), quad_sphere(12), quad_sphere(31), quads(25, |x, y| [x.powi(3), y, 0.3 * (5.0 * x * y).sin()])]
    {
        let stiffness = problem(&mesh, OperatorKind::Polygon, MassKind::Barycentric).stiffness;
        for row in 0..stiffness.rows() {
            let (columns, values) = stiffness.row(row);
            let size: f64 = values.iter().map(|value| value.abs()).sum();
            let allowed = 2.0 * f64::EPSILON * columns.len() as f64 * size;
            assert!(values.iter().sum::<f64>().abs() <= allowed, "row {row}");
        }
    }
}

#[test]
fn the_spectra_of_quads_on_square_and_sphere_converge_to_the_analytic_ones() {
    use std::f64::consts::PI;
    let square = |k: usize| quads(k, |x, y| [x, y, 0.0]);
    let mut plane: Vec<f64> = (0..6).flat_map(|i| (0..6).map(move |j| PI * PI * (i * i + j * j) as f64)).collect();
    plane.sort_by(f64::total_cmp);
    let ball: Vec<f64> = (0..5).flat_map(|l| std::iter::repeat_n((l * (l + 1)) as f64, 2 * l + 1)).collect();
    let off = |mesh: &TriangleMesh, mass: MassKind, exact: &[f64]| {
        let values = spectrum(&problem(mesh, OperatorKind::Auto, mass), 16);
        (1..16).map(|k| (values[k] / exact[k] - 1.0).abs()).fold(0.0, f64::max)
    };
    for mass in [MassKind::Barycentric, MassKind::Consistent] {
        let errors = [8, 16].map(|k| off(&square(k), mass, &plane));
        assert!(errors[1] < 0.06 && errors[1] < 0.3 * errors[0], "square {mass:?}: {errors:?}");
        let errors = [6, 12].map(|k| off(&quad_sphere(k), mass, &ball));
        assert!(errors[1] < 0.02 && errors[1] < 0.3 * errors[0], "sphere {mass:?}: {errors:?}");
    }
}

/// The square has the symmetries of its quads: no diagonal tells one double eigenvalue from the other.
#[test]
fn quads_keep_their_symmetries() {
    let values = spectrum(&problem(&quads(9, |x, y| [x, y, 0.0]), OperatorKind::Auto, MassKind::Barycentric), 8);
    assert!((values[1] - values[2]).abs() < 1e-10 * values[1] && (values[4] - values[5]).abs() < 1e-10 * values[4]);
}

#[test]
fn auto_keeps_polygons_and_says_so_unless_the_mesh_is_broken() {
    let mesh = quads(5, wavy);
    let made = |mesh: &TriangleMesh, operator: OperatorKind| {
        let parameters = OperatorParameters { operator, ..OperatorParameters::default() };
        assemble(mesh, &parameters, &Unwatched).unwrap().report
    };
    let report = made(&mesh, OperatorKind::Auto);
    assert_eq!((report.laplacian, report.reason, report.polygons), (Laplacian::Polygon, Reason::Polygons, 25));
    let report = made(&mesh, OperatorKind::Polygon);
    assert_eq!((report.laplacian, report.reason, report.polygons), (Laplacian::Polygon, Reason::Requested, 25));
    let report = made(&mesh, OperatorKind::Laplace);
    assert_eq!((report.laplacian, report.polygons), (Laplacian::Cotangent, 0));
    assert_eq!(made(&mesh, OperatorKind::Robust).laplacian, Laplacian::Robust);
    let mut wing = mesh.clone();
    wing.positions.push([0.5, 0.5, 3.0]);
    wing.faces.push([7, 8, 36]);
    let mut of_face = mesh.polygons.as_ref().unwrap().of_face().to_vec();
    of_face.push(99);
    wing.polygons = Polygons::new(of_face).map(Arc::new);
    assert_eq!(
        (made(&wing, OperatorKind::Auto).reason, made(&wing, OperatorKind::Auto).polygons),
        (Reason::NonManifold, 0)
    );
    let dirichlet = OperatorParameters { boundary: Boundary::Dirichlet, ..OperatorParameters::default() };
    assert_eq!(assemble(&mesh, &dirichlet, &Unwatched).unwrap().problem.size(), 16);
}

/// A concave polygon has its middle where one of its edges points at, as good a polygon as it is: the triangle between
/// the two is thin, and the engine's own. A polygon that is thin all around is one.
#[test]
fn polygons_are_judged_as_a_whole_and_not_by_the_triangles_to_their_middles() {
    // An L, whose inner corner is moved until the edge from it points at the middle.
    let ell = |x: f64| {
        let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [x, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let positions = outline.map(|[x, y]| [x, y, 0.0]).to_vec();
        of_polygons(positions, &[(0..6).collect()])
    };
    let area = |x: f64| {
        let refined = Refined::of(&ell(x)).unwrap().unwrap();
        let [a, b, c] = [3, 4, 6].map(|v| refined.mesh.positions[v]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let (mut low, mut high) = (0.2, 1.5);
    assert!(area(low) * area(high) < 0.0, "{} {}", area(low), area(high));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if area(low) * area(middle) <= 0.0 { high = middle } else { low = middle }
    }
    let made = |mesh: &TriangleMesh| assemble(mesh, &OperatorParameters::default(), &Unwatched).unwrap().report;
    // As thin as others are told of, and not so thin that it spoils everything.
    let concave = ell(low + 1e-4);
    assert!(Refined::of(&concave).unwrap().unwrap().measured.thin_faces > 0);
    let report = made(&concave);
    assert_eq!((report.laplacian, report.reason, report.thin_faces), (Laplacian::Polygon, Reason::Polygons, 0));
    let sliver = |height: f64| {
        let positions = [[0.0, 0.0], [1.0, 0.0], [1.0, height], [0.0, height], [1.0, 1.0], [0.0, 1.0]];
        let positions = positions.map(|[x, y]| [x, y, 0.0]).to_vec();
        made(&of_polygons(positions, &[vec![0, 1, 2, 3], vec![3, 2, 4, 5]]))
    };
    let report = sliver(1e-4);
    assert_eq!((report.laplacian, report.reason), (Laplacian::Robust, Reason::ThinFaces));
    assert_eq!(sliver(0.1).laplacian, Laplacian::Polygon);
}

/// Values that are linear on a flat polygon are linear in its middle too: the matrix is the integral of `V φ_i φ_j`
/// over the finer mesh, summed over points of a rule that is exact for cubic functions.
#[test]
fn potentials_are_integrated_over_polygons() {
    let mesh = quads(4, |x, y| [x + 0.06 * (8.0 * y).sin(), y + 0.05 * (9.0 * x).sin(), 0.0]);
    let values: Vec<f64> = mesh.positions.iter().map(|p| 3.0 + 2.0 * p[0] - p[1]).collect();
    let n = values.len();
    let hamiltonian = || OperatorKind::Hamiltonian { potential: Potential::Values(values.clone()) };
    for kind in [MassKind::Barycentric, MassKind::Consistent] {
        let (plain, with) = (problem(&mesh, OperatorKind::Polygon, kind), problem(&mesh, hamiltonian(), kind));
        assert_eq!(plain.mass, with.mass);
        let added = |i: usize, j: usize| dense(&with.stiffness).column(j)[i] - dense(&plain.stiffness).column(j)[i];
        if let MassMatrix::Diagonal(mass) = &plain.mass {
            for i in 0..n {
                assert!((added(i, i) - plain.area * values[i] * mass[i]).abs() < 1e-12, "{i}");
            }
            continue;
        }
        let mut expected = DenseMatrix::zeros(n, n);
        let polygons = mesh.polygons.as_ref().unwrap().loops(&mesh.faces);
        for polygon in 0..polygons.len() {
            let (corners, shares) = (polygons.corners(polygon), shares(&mesh, polygons.corners(polygon)));
            let k = corners.len();
            // Weights of the corners at a point, and where it is.
            let at = |i: usize, [a, b, c]: [f64; 3]| {
                let mut weights: Vec<f64> = shares.iter().map(|share| c * share).collect();
                weights[i] += a;
                weights[(i + 1) % k] += b;
                weights
            };
            let place = |weights: &[f64]| -> [f64; 2] {
                std::array::from_fn(|axis| {
                    corners.iter().zip(weights).map(|(&v, w)| w * mesh.positions[v as usize][axis]).sum()
                })
            };
            for i in 0..k {
                let [p, q, r] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| place(&at(i, c)));
                let area = 0.5 * ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])).abs();
                let third = 1.0 / 3.0;
                let mut rule = vec![(-27.0 / 48.0, [third; 3])];
                for turn in 0..3 {
                    let mut c = [0.2; 3];
                    c[turn] = 0.6;
                    rule.push((25.0 / 48.0, c));
                }
                for (weight, c) in rule {
                    let weights = at(i, c);
                    let [x, y] = place(&weights);
                    for (a, &row) in corners.iter().enumerate() {
                        for (b, &column) in corners.iter().enumerate() {
                            expected.column_mut(column as usize)[row as usize] +=
                                weight * area * (3.0 + 2.0 * x - y) * weights[a] * weights[b];
                        }
                    }
                }
            }
        }
        for i in 0..n {
            for j in 0..n {
                // On unit area a potential times a mass is what it is on the mesh.
                assert!((added(i, j) - expected.column(j)[i]).abs() < 1e-12, "{i} {j}");
            }
        }
    }
}

#[test]
fn hamiltonians_and_the_extrinsic_family_act_on_polygons() {
    let kinds = || {
        [OperatorKind::Extrinsic { t: 0.5 }, OperatorKind::Hamiltonian { potential: Potential::Curvature { t: 0.3 } }]
    };
    // On the unit sphere both add a multiple of the mass: t (κ₁² + κ₂²) = 2 t.
    let mesh = quad_sphere(12);
    for (operator, added) in kinds().into_iter().zip([1.0, 0.6]) {
        let parameters = OperatorParameters { operator: operator.clone(), ..OperatorParameters::default() };
        let report = assemble(&mesh, &parameters, &Unwatched).unwrap().report;
        assert_eq!((report.laplacian, report.polygons), (Laplacian::Polygon, 6 * 144));
        let (plain, with) = (
            spectrum(&problem(&mesh, OperatorKind::Auto, MassKind::Barycentric), 4),
            spectrum(&problem(&mesh, operator, MassKind::Barycentric), 4),
        );
        for (a, b) in plain.iter().zip(&with) {
            assert!((b - a - added).abs() < 0.05 * added, "{plain:?} {with:?}");
        }
    }
    // Nothing turns on flat quads, and no diagonal is preferred.
    let flat = quads(9, |x, y| [x, y, 0.0]);
    let plain = problem(&flat, OperatorKind::Auto, MassKind::Barycentric);
    for operator in kinds() {
        let with = problem(&flat, operator, MassKind::Barycentric);
        let most = plain.stiffness.values().iter().zip(with.stiffness.values()).map(|(a, b)| (a - b).abs());
        assert!(most.fold(0.0, f64::max) < 1e-12);
    }
}

/// A chevron, whose middle lies outside of what its corners span evenly, and a quad without area.
#[test]
fn no_polygon_gives_a_negative_mass_or_what_is_no_number() {
    let chevron = vec![[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [0.4, 0.0, 0.0], [2.0, 1.0, 0.0]];
    let line = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (positions, polygons) in [(chevron, vec![vec![0, 1, 2, 3]]), (line, vec![vec![0, 1, 2, 3], vec![0, 3, 4]])] {
        let mesh = of_polygons(positions, &polygons);
        let problem = problem(&mesh, OperatorKind::Polygon, MassKind::Barycentric);
        assert!(problem.stiffness.values().iter().all(|value| value.is_finite()));
        assert!(dense_mass(&problem.mass, problem.size()).values().iter().all(|&value| value >= 0.0));
    }
}
