//! Plates, strips and cylinders of known frequencies, whatever their triangulation.

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::{CheckOptions, check};
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_mesh::shape::{Shape, generate};

use super::*;
use crate::operator::elastic::ElasticProblem;

const POISSON: f64 = 0.3;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Cells {
    /// All diagonals are parallel: every vertex has six neighbours.
    OneWay,
    /// They turn from cell to cell: four and eight neighbours, the "union jack".
    Alternating,
    /// Both diagonals of each cell, and a vertex in its middle.
    Crisscross,
    /// Vertices off their places by up to a third of a cell, and the diagonal by Delaunay's criterion.
    Jittered,
}

const ALL: [Cells; 4] = [Cells::OneWay, Cells::Alternating, Cells::Crisscross, Cells::Jittered];

/// A rectangle of the plane in `m × n` cells.
fn rectangle(size: [f64; 2], [m, n]: [usize; 2], cells: Cells) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut random = SplitMix64::new(7);
    let mut jitter = |inside: bool| match cells {
        Cells::Jittered if inside => 0.33 * random.signed_unit(),
        _ => 0.0,
    };
    for j in 0..=n {
        for i in 0..=m {
            let inside = i % m > 0 && j % n > 0;
            let (x, y) = (i as f64 + jitter(inside), j as f64 + jitter(inside));
            mesh.positions.push([size[0] * x / m as f64, size[1] * y / n as f64, 0.0]);
        }
    }
    let at = |i: usize, j: usize| (j * (m + 1) + i) as u32;
    for j in 0..n {
        for i in 0..m {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let across = match cells {
                Cells::OneWay => true,
                Cells::Alternating => (i + j) % 2 == 1,
                Cells::Jittered => cosine(&mesh, [p, q, r]) + cosine(&mesh, [r, s, p]) > 0.0,
                Cells::Crisscross => {
                    let c = mesh.positions.len() as u32;
                    let [x, y] = [i as f64 + 0.5, j as f64 + 0.5];
                    mesh.positions.push([size[0] * x / m as f64, size[1] * y / n as f64, 0.0]);
                    mesh.faces.extend([[p, q, c], [q, r, c], [r, s, c], [s, p, c]]);
                    continue;
                }
            };
            mesh.faces.extend(if across { [[p, q, r], [p, r, s]] } else { [[p, q, s], [q, r, s]] });
        }
    }
    mesh
}

/// The cosine of the angle at the second of three vertices.
fn cosine(mesh: &TriangleMesh, corners: [u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|v| mesh.positions[v as usize]);
    let (u, v) = ([a[0] - b[0], a[1] - b[1]], [c[0] - b[0], c[1] - b[1]]);
    (u[0] * v[0] + u[1] * v[1]) / (u[0].hypot(u[1]) * v[0].hypot(v[1]))
}

/// A tube of radius 1 along z, of `m × n` cells.
fn tube(length: f64, [m, n]: [usize; 2], cells: Cells) -> TriangleMesh {
    let mut mesh = rectangle([1.0, length], [m, n], cells);
    let turn = |x: f64| (std::f64::consts::TAU * x).sin_cos();
    mesh.positions.iter_mut().for_each(|p| *p = [turn(p[0]).1, turn(p[0]).0, p[1]]);
    // The last column is the first.
    let seam = |v: u32| if v as usize % (m + 1) == m && (v as usize) < (m + 1) * (n + 1) { v - m as u32 } else { v };
    mesh.faces.iter_mut().for_each(|face| *face = face.map(seam));
    mesh
}

/// Frequencies as `ω`, those of rigid motions left out, of a shell of unit modulus and density.
fn omegas(mesh: &TriangleMesh, thickness: f64, poisson: f64, count: usize, clamped: Clamps) -> Vec<f64> {
    let free = if clamped.vertices.is_empty() { 6 } else { 0 };
    let parameters = VibrationParameters {
        count: count + free,
        material: Material { young: 1.0, poisson, density: 1.0 },
        clamped,
        method: VibrationMethod::Hsim { tolerance: 1e-5 },
        seed: 0,
    };
    let basis = vibration_modes(ElasticBody::Shell { mesh, thickness }, &parameters, &Unwatched).unwrap();
    assert_eq!((basis.rigid, &basis.metadata.json()["certificate"]["complete"]), (free, &true.into()));
    basis.eigenvalues[free..].iter().map(|value| value.sqrt()).collect()
}

fn held(mesh: &TriangleMesh, rotations: bool, is_held: impl Fn(&[f64; 3]) -> bool) -> Clamps {
    let all = 0..mesh.positions.len() as u32;
    Clamps { vertices: all.filter(|&v| is_held(&mesh.positions[v as usize])).collect(), rotations }
}

/// The first four frequencies of a square plate all around which vertices are held, over those of Leissa (1973).
fn plate_ratios(cells: Cells, m: usize, rotations: bool) -> [f64; 4] {
    let pi = std::f64::consts::PI;
    let supported = [2.0, 5.0, 5.0, 8.0].map(|sum| pi * pi * sum);
    let expected = if rotations { [35.985, 73.394, 73.394, 108.217] } else { supported };
    let (mesh, thickness) = (rectangle([1.0; 2], [m; 2], cells), 0.005);
    let border = held(&mesh, rotations, |p| p[..2].iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9));
    let rigidity = thickness * thickness / (12.0 * (1.0 - POISSON * POISSON));
    let found = omegas(&mesh, thickness, POISSON, 4, border);
    std::array::from_fn(|k| found[k] / rigidity.sqrt() / expected[k])
}

fn worst(ratios: &[f64]) -> f64 {
    ratios.iter().map(|ratio| (ratio - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn held_plates_converge_to_their_frequencies_on_every_triangulation() {
    for rotations in [false, true] {
        for cells in ALL {
            let [coarse, fine] = [20, 40].map(|m| plate_ratios(cells, m, rotations));
            println!("{cells:?}, rotations held: {rotations}; 20 cells: {coarse:.4?}, 40: {fine:.4?}");
            assert!(worst(&fine) < if rotations { 0.012 } else { 0.006 }, "{cells:?}, {rotations}: {fine:?}");
            assert!((fine[0] - 1.0).abs() < 0.005, "{cells:?}, {rotations}: {fine:?}");
            // Of second order.
            assert!(worst(&fine) < 0.35 * worst(&coarse), "{cells:?}, {rotations}: {coarse:?} {fine:?}");
        }
    }
}

#[test]
fn plates_of_long_cells_converge_as_well() {
    let pi = std::f64::consts::PI;
    for (across, cells, bound) in [
        (3, Cells::Alternating, 0.003),
        (3, Cells::Crisscross, 0.003),
        (3, Cells::Jittered, 0.003),
        (10, Cells::Alternating, 0.003),
        // Faces of nearly 170 degrees.
        (10, Cells::Crisscross, 0.02),
    ] {
        let (mesh, thickness) = (rectangle([1.0; 2], [20, 20 * across], cells), 0.005);
        let border = held(&mesh, false, |p| p[..2].iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9));
        let rigidity: f64 = thickness * thickness / (12.0 * (1.0 - POISSON * POISSON));
        let found = omegas(&mesh, thickness, POISSON, 1, border)[0];
        let ratio = found / rigidity.sqrt() / (2.0 * pi * pi);
        println!("{cells:?}, {across} times as long as wide: {ratio:.4}");
        assert!((ratio - 1.0).abs() < bound, "{cells:?}, {across}: {ratio}");
    }
}

#[test]
fn closed_spheres_sound_as_lamb_says() {
    let mesh = generate(Shape::Sphere, 2500).unwrap();
    let found = omegas(&mesh, 0.01, POISSON, 12, Clamps::default());
    let radius = mesh.positions[0].iter().map(|x| x * x).sum::<f64>().sqrt();
    // (1 − ν²) Ω⁴ − (l (l + 1) + 1 + 3 ν) Ω² + l (l + 1) − 2 = 0; 2 l + 1 modes each. The bending of a shell so thin
    // adds next to nothing.
    let lamb = |l: f64| {
        let (a, b, c) = (1.0 - POISSON * POISSON, l * (l + 1.0) + 1.0 + 3.0 * POISSON, l * (l + 1.0) - 2.0);
        ((b - (b * b - 4.0 * a * c).sqrt()) / (2.0 * a)).sqrt() / radius
    };
    println!("{found:.4?}, {:.4} {:.4}", lamb(2.0), lamb(3.0));
    for (k, omega) in found.iter().enumerate() {
        let ratio = omega / lamb(if k < 5 { 2.0 } else { 3.0 });
        assert!((ratio - 1.0).abs() < 0.01, "{k}: {ratio}");
    }
}

/// A plate in every seventh face of which there is a further vertex next to one of its edges.
fn plate_of_needles() -> TriangleMesh {
    let mut mesh = rectangle([1.0; 2], [20; 2], Cells::Jittered);
    let mut random = SplitMix64::new(3);
    // By a tenth to a thousandth of its height: each leaves a cap and two needles.
    let faces = std::mem::take(&mut mesh.faces);
    for (f, face) in faces.into_iter().enumerate() {
        if f % 7 != 3 {
            mesh.faces.push(face);
            continue;
        }
        let (share, near) = (0.5 + 0.4 * random.signed_unit(), 10f64.powf(-2.0 + random.signed_unit()));
        let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
        let new = mesh.positions.len() as u32;
        mesh.positions.push(std::array::from_fn(|k| {
            let on = a[k] + share * (b[k] - a[k]);
            on + near * (c[k] - on)
        }));
        let [a, b, c] = face;
        mesh.faces.extend([[a, b, new], [b, c, new], [c, a, new]]);
    }
    mesh
}

#[test]
fn needles_here_and_there_leave_a_plate_its_frequencies_and_its_proof() {
    let (mesh, thickness) = (plate_of_needles(), 0.005);
    let pi = std::f64::consts::PI;
    let rigidity: f64 = thickness * thickness / (12.0 * (1.0 - POISSON * POISSON));
    let border = held(&mesh, false, |p| p[..2].iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9));
    let found = omegas(&mesh, thickness, POISSON, 4, border);
    let ratios: Vec<f64> =
        found.iter().zip([2.0, 5.0, 5.0, 8.0]).map(|(omega, sum)| omega / rigidity.sqrt() / (pi * pi * sum)).collect();
    println!("{ratios:.4?}");
    assert!(worst(&ratios) < 0.02, "{ratios:?}");
}

#[test]
fn a_strip_clamped_at_its_end_sounds_like_a_beam_on_every_triangulation_down_to_a_single_row_of_cells() {
    let thickness = 0.001;
    for cells in ALL {
        for n in [1, 4] {
            let mesh = rectangle([1.0, 0.025 * n as f64], [40, n], cells);
            let end = held(&mesh, true, |p| p[0] < 1e-9);
            let beam = 1.875_104_f64.powi(2) * thickness / 12f64.sqrt();
            let ratio = omegas(&mesh, thickness, 0.0, 1, end)[0] / beam;
            println!("{cells:?}, {n} rows: {ratio:.4}");
            assert!((ratio - 1.0).abs() < 0.003, "{cells:?}, {n}: {ratio}");
        }
    }
}

#[test]
fn open_tubes_bend_without_stretching_as_rayleigh_says_on_every_triangulation() {
    let thickness: f64 = 0.02;
    // ω² = h² n² (n² − 1)² / (12 R⁴ (1 − ν²) (n² + 1)), n = 2, each mode twice.
    let expected = (thickness * thickness * 36.0 / (60.0 * (1.0 - POISSON * POISSON))).sqrt();
    for cells in ALL {
        let [coarse, fine] = [[20, 6], [40, 12]].map(|size| {
            let found = omegas(&tube(2.0, size, cells), thickness, POISSON, 2, Clamps::default());
            [found[0] / expected, found[1] / expected]
        });
        println!("{cells:?}: {coarse:.4?} {fine:.4?}");
        assert!(worst(&fine) < 0.02 && worst(&fine) < 0.6 * worst(&coarse), "{cells:?}: {coarse:?} {fine:?}");
    }
}

/// Keeps what is said of the work, and when.
struct Log(std::sync::Mutex<Vec<String>>, std::time::Instant);

impl chladni_base::Monitor for Log {
    fn stage(&self, name: &'static str) {
        self.detail(name);
    }
    fn progress(&self, _: f64) {}
    fn detail(&self, text: &str) {
        self.0.lock().unwrap().push(format!("{:.2} s: {text}", self.1.elapsed().as_secs_f64()));
    }
    fn checkpoint(&self) -> Result<(), chladni_base::Cancelled> {
        Ok(())
    }
}

#[test]
fn needles_of_real_meshes_leave_the_proof_to_counts() {
    let Some(folder) = std::env::var_os("CHLADNI_MESHES") else {
        eprintln!("skipped: CHLADNI_MESHES is not set");
        return;
    };
    let all = [("camelhead.off", 60, 0.03), ("fandisk.obj", 60, 0.01)];
    for (name, count, thickness) in all {
        let Ok(bytes) = std::fs::read(std::path::Path::new(&folder).join(name)) else {
            eprintln!("skipped: there is no {name}");
            continue;
        };
        let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap()).unwrap();
        let mesh = check(read(&bytes, format, &ReadLimits::default()).unwrap(), &CheckOptions::default()).unwrap().mesh;
        let parameters = VibrationParameters {
            count,
            material: Material { young: 1.0, poisson: POISSON, density: 1.0 },
            clamped: Clamps::default(),
            method: VibrationMethod::Hsim { tolerance: 1e-3 },
            seed: 0,
        };
        let log = Log(Vec::new().into(), std::time::Instant::now());
        let basis = vibration_modes(ElasticBody::Shell { mesh: &mesh, thickness }, &parameters, &log).unwrap();
        let log = log.0.into_inner().unwrap();
        println!("{name}: {log:#?}, {:.6?}", basis.eigenvalues[6..16].iter().map(|x| x.sqrt()).collect::<Vec<_>>());
        assert_eq!(basis.metadata.json()["certificate"]["complete"], true);
        assert!(!log.iter().any(|text| text.contains("iteration")), "{log:#?}");
    }
}

fn problem(mesh: &TriangleMesh, clamped: &Clamps) -> ElasticProblem {
    let material = Material { young: 1.0, poisson: POISSON, density: 1.0 };
    elastic::assemble(ElasticBody::Shell { mesh, thickness: 0.05 }, &material, clamped, &Unwatched).unwrap()
}

/// A fit of too few angles rests on its ridge, which leaves three digits less than there are.
const ROUNDING: f64 = 1e-11;

#[test]
fn stiffness_does_not_depend_on_the_order_of_corners_nor_on_windings_nor_on_numbers() {
    let wavy = |mut mesh: TriangleMesh| {
        mesh.positions.iter_mut().for_each(|p| p[2] += 0.1 * (5.0 * p[0]).sin() * (3.0 * p[1]).cos());
        mesh
    };
    for (mesh, rotations) in [
        (wavy(rectangle([1.0; 2], [6, 5], Cells::Jittered)), false),
        (wavy(rectangle([1.0; 2], [6, 5], Cells::Jittered)), true),
        (wavy(rectangle([1.0; 2], [5, 1], Cells::Alternating)), false),
        (generate(Shape::Torus, 90).unwrap(), false),
        (generate(Shape::Sphere, 12).unwrap(), false),
    ] {
        let n = mesh.positions.len() as u32;
        let clamps = if rotations { held(&mesh, true, |p| p[0] < 1e-9) } else { Clamps::default() };
        let stiffness = problem(&mesh, &clamps).problem.stiffness;
        assert_eq!(stiffness.transpose(), stiffness, "symmetric to the last bit");
        let largest = stiffness.values().iter().fold(0f64, |most, x| x.abs().max(most));
        let differ = |other: &TriangleMesh, clamps: &Clamps, place: &dyn Fn(usize) -> usize| {
            let other = problem(other, clamps).problem.stiffness.to_dense();
            let own = stiffness.to_dense();
            let all = (0..own.rows()).flat_map(|i| (0..own.rows()).map(move |j| (i, j)));
            all.map(|(i, j)| (own.column(j)[i] - other.column(place(j))[place(i)]).abs()).fold(0.0, f64::max) / largest
        };
        let mut turned = mesh.clone();
        for (f, face) in turned.faces.iter_mut().enumerate() {
            face.rotate_left(f % 3);
            // Every other face is wound the other way round, as on no surface that has two sides.
            if f % 2 == 1 {
                face.swap(0, 1);
            }
        }
        turned.faces.reverse();
        let rounding = differ(&turned, &clamps, &|row| row);
        assert!(rounding < ROUNDING, "{n} vertices: {rounding}");
        if !rotations {
            let mut renumbered = mesh.clone();
            let other = |v: u32| n - 1 - v;
            renumbered.positions.reverse();
            renumbered.faces.iter_mut().for_each(|face| *face = face.map(other));
            let place = |row: usize| 3 * (n as usize - 1 - row / 3) + row % 3;
            let rounding = differ(&renumbered, &clamps, &place);
            assert!(rounding < ROUNDING, "{n} vertices: {rounding}");
        }
    }
}

#[test]
fn a_constant_curvature_has_exactly_its_energy_inside_a_plate_and_no_more_at_a_free_border() {
    for cells in ALL {
        let mesh = rectangle([1.0; 2], [12, 12], cells);
        let elastic = problem(&mesh, &Clamps::default());
        let n = mesh.positions.len();
        for [a, b, c] in [[1.0, 0.0, 0.0], [0.3, -1.0, 0.4], [0.0, 0.0, 1.0]] {
            let mut bent = vec![0.0; 3 * n];
            for (row, [x, y, _]) in elastic.positions.iter().enumerate() {
                bent[3 * row + 2] = 0.5 * a * x * x + 0.5 * b * y * y + c * x * y;
            }
            let image = elastic.problem.stiffness.multiply(&bent);
            let energy: f64 = image.iter().zip(&bent).map(|(f, u)| f * u).sum();
            let rigidity = 0.05f64.powi(2) / (12.0 * (1.0 - POISSON * POISSON));
            let plate = rigidity * (a * a + b * b + 2.0 * POISSON * a * b + 2.0 * (1.0 - POISSON) * c * c);
            assert!(energy < plate * (1.0 + 1e-6) && energy > 0.75 * plate, "{cells:?}: {energy} {plate}");
            // Moments are in balance: nothing pulls at vertices from which the border is far.
            let largest = image.iter().fold(0f64, |most, f| f.abs().max(most));
            for (v, p) in mesh.positions.iter().enumerate() {
                if p[..2].iter().all(|x| *x > 4.3 / 12.0 && *x < 7.7 / 12.0) {
                    assert!(image[3 * v + 2].abs() < 1e-3 * largest, "{cells:?}: {}", image[3 * v + 2] / largest);
                }
            }
        }
    }
}
