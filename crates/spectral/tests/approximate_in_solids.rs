//! The fast approximation of the Laplacian in solids, against analytic spectra and against exact pairs of the same
//! pencil.

use std::f64::consts::PI;

use chladni_spectral::Unwatched;
use chladni_spectral::basis::{Basis, Functions};
use chladni_spectral::mesh::TetMesh;
use chladni_spectral::operator::{Boundary, MassKind, MeshOperator, volume};
use chladni_spectral::spectrum::heat::HeatParameters;
use chladni_spectral::spectrum::hsim::{HsimParameters, Selection};
use chladni_spectral::spectrum::nested::{self, RowPositions};
use chladni_spectral::spectrum::radial::RadialParameters;
use chladni_spectral::spectrum::{
    ApproximationParameters, Goal, MOST_ROUNDS, Refinement, Space, approximate, approximate_refined, subspace,
};

/// A box of small boxes, each of six tetrahedra around a diagonal.
fn bar(size: [f64; 3], cells: usize) -> TetMesh {
    let side = cells + 1;
    let axis = |k: usize, axis: usize| size[axis] * k as f64 / cells as f64;
    let at = |p: [usize; 3]| ((p[0] * side + p[1]) * side + p[2]) as u32;
    let mut solid = TetMesh::default();
    for k in 0..side * side * side {
        let p = [k / (side * side), k / side % side, k % side];
        solid.positions.push([axis(p[0], 0), axis(p[1], 1), axis(p[2], 2)]);
        if p.contains(&cells) {
            continue;
        }
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut corner = p;
            let mut path = [at(p); 4];
            for (step, axis) in order.into_iter().enumerate() {
                corner[axis] += 1;
                path[step + 1] = at(corner);
            }
            solid.tetrahedra.push(path);
        }
    }
    solid
}

/// A cube brought to the unit ball, every square shell to a sphere.
fn ball(cells: usize) -> TetMesh {
    let mut solid = bar([2.0; 3], cells);
    for p in &mut solid.positions {
        *p = p.map(|c| c - 1.0);
        let (most, length) = (p.iter().fold(0f64, |most, c| most.max(c.abs())), p.iter().map(|c| c * c).sum::<f64>());
        if most > 0.0 {
            *p = p.map(|c| c * most / length.sqrt());
        }
    }
    solid
}

/// Inner vertices moved by a pattern, so far that many tetrahedra are nearly flat.
fn shaken(cells: usize) -> TetMesh {
    let mut solid = bar([1.0, 1.1, 1.21], cells);
    let edge = 1.0 / cells as f64;
    let inside = |p: &[f64; 3]| p.iter().zip([1.0, 1.1, 1.21]).all(|(&x, most)| x > 1e-9 && x < most - 1e-9);
    for (k, p) in solid.positions.iter_mut().enumerate().filter(|(_, p)| inside(p)) {
        let t = k as f64;
        let by = [(1.7 * t).sin(), (2.3 * t).cos(), (3.1 * t).sin()];
        *p = [0, 1, 2].map(|k| p[k] + 0.2 * edge * by[k]);
    }
    solid
}

fn operator(solid: &TetMesh, mass: MassKind, boundary: Boundary) -> MeshOperator {
    volume::assemble(solid, mass, boundary, &Unwatched).unwrap()
}

fn parameters(count: usize, dimension: usize) -> ApproximationParameters {
    let space = Space::Heat(HeatParameters::default());
    ApproximationParameters { count, dimension, space, goal: None, certify: false, seed: 0 }
}

fn exact(solid: &TetMesh, operator: &MeshOperator, count: usize) -> Vec<f64> {
    let parameters =
        HsimParameters { selection: Selection::Count(count), tolerance: 1e-6, ..HsimParameters::default() };
    let places = RowPositions::Positions(&solid.positions);
    nested::solve(&operator.problem, places, solid.positions.len(), &parameters, &Unwatched).unwrap().values
}

/// Mean and largest relative error in percent, zeros apart.
fn errors(values: &[f64], exact: &[f64]) -> (f64, f64) {
    let errors: Vec<f64> =
        values.iter().zip(exact).filter(|pair| *pair.1 > 1e-9).map(|(v, e)| 100.0 * (v / e - 1.0).abs()).collect();
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.into_iter().fold(0.0, f64::max))
}

/// Whether functions are orthonormal for the mass, both as they are stored, and values are their Rayleigh quotients.
fn is_consistent(basis: &Basis, operator: &MeshOperator) {
    let n = basis.vertices();
    let m = basis.eigenvalues.len();
    let modes: Vec<f64> = basis.lift(0..m).unwrap();
    let stiffness = &operator.laplacian().stiffness;
    for (j, k) in [(0, 0), (1, 1), (m - 1, m - 1), (1, 2), (0, m - 1)] {
        let [x, y] = [j, k].map(|k| &modes[k * n..(k + 1) * n]);
        let product: f64 = x.iter().zip(basis.mass.multiply(y)).map(|(x, my)| x * my).sum();
        assert!((product - f64::from(u8::from(j == k))).abs() < 1e-6, "{j} {k}: {product}");
        if j == k {
            let energy: f64 = x.iter().zip(stiffness.multiply(x)).map(|(x, sx)| x * sx).sum();
            let value = basis.eigenvalues[k];
            assert!((energy - value).abs() < 1e-6 * basis.eigenvalues[m - 1], "{k}: {energy} is not {value}");
        }
    }
}

#[test]
fn cubes_have_the_eigenvalues_of_cosines_and_sines() {
    let solid = bar([1.0; 3], 22);
    let square = |k: usize| (k * k) as f64;
    let lattice = |from: usize| {
        let mut values: Vec<f64> = (0..729)
            .map(|k| [k % 9, k / 9 % 9, k / 81].map(|k| square(k + from)))
            .map(|[a, b, c]| PI * PI * (a + b + c))
            .collect();
        values.sort_by(f64::total_cmp);
        values.truncate(60);
        values
    };
    for (mass, boundary, from) in [
        (MassKind::Barycentric, Boundary::Neumann, 0),
        (MassKind::Consistent, Boundary::Neumann, 0),
        (MassKind::Barycentric, Boundary::Dirichlet, 1),
        (MassKind::Consistent, Boundary::Dirichlet, 1),
    ] {
        let made = operator(&solid, mass, boundary);
        let basis = approximate(&solid, &made, &parameters(60, 350), &Unwatched).unwrap();
        is_consistent(&basis, &made);
        let found = exact(&solid, &made, 60);
        let (mean, largest) = errors(&basis.eigenvalues, &found);
        let (analytic, _) = errors(&basis.eigenvalues, &lattice(from));
        eprintln!(
            "{mass:?} {boundary:?}: {mean:.4} {largest:.4} % of the exact ones, {analytic:.3} % of analytic ones"
        );
        let most = if boundary == Boundary::Neumann { (0.08, 0.2) } else { (0.35, 0.8) };
        assert!(mean < most.0 && largest < most.1, "{mass:?} {boundary:?}: {mean} %, {largest} %");
        assert!(analytic < 5.5, "{mass:?} {boundary:?}: {analytic} % of analytic ones");
    }
}

#[test]
fn balls_have_the_zeros_of_spherical_bessel_functions() {
    // Zeros of j_l′ and of j_l, each 2l + 1 times.
    let spectrum = |zeros: &[(f64, usize)]| -> Vec<f64> {
        zeros.iter().flat_map(|&(zero, l)| std::iter::repeat_n(zero * zero, 2 * l + 1)).collect()
    };
    let neumann = [(0.0, 0), (2.081_575_978, 1), (3.342_093_657, 2), (4.493_409_458, 0), (4.514_099_647, 3)];
    let dirichlet = [(PI, 0), (4.493_409_458, 1), (5.763_459_197, 2), (2.0 * PI, 0), (6.987_932_001, 3)];
    let solid = ball(20);
    for (zeros, boundary) in [(&neumann, Boundary::Neumann), (&dirichlet, Boundary::Dirichlet)] {
        let values = spectrum(zeros);
        let made = operator(&solid, MassKind::Consistent, boundary);
        let basis = approximate(&solid, &made, &parameters(values.len(), 300), &Unwatched).unwrap();
        let (mean, largest) = errors(&basis.eigenvalues, &values);
        eprintln!("{boundary:?}: {mean:.3} {largest:.3} %");
        assert!(mean < 4.5 && largest < 7.5, "{boundary:?}: {mean} %, {largest} %");
    }
}

#[test]
fn values_lie_above_the_exact_ones_within_their_bounds_beside_flat_tetrahedra() {
    let solid = shaken(14);
    for (mass, boundary) in [
        (MassKind::Barycentric, Boundary::Neumann),
        (MassKind::Consistent, Boundary::Neumann),
        (MassKind::Barycentric, Boundary::Dirichlet),
        (MassKind::Consistent, Boundary::Dirichlet),
    ] {
        let made = operator(&solid, mass, boundary);
        let wanted =
            ApproximationParameters { goal: Some(Goal { error: 0.01, rounds: MOST_ROUNDS }), ..parameters(40, 190) };
        let basis = approximate(&solid, &made, &wanted, &Unwatched).unwrap();
        let found = exact(&solid, &made, 60);
        for (k, (&value, &bound)) in basis.eigenvalues.iter().zip(&basis.certificate.bounds).enumerate() {
            let name = format!("{mass:?} {boundary:?}, pair {k}");
            assert!(value >= found[k] - 1e-8 * found[39], "{name}: {value} is below {}", found[k]);
            let nearest = found.iter().map(|exact| (exact - value).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= bound + 1e-8 * found[39], "{name}: {value} ± {bound}, the nearest {nearest} away");
        }
        let accuracy = basis.certificate.accuracy.unwrap();
        let (mean, largest) = errors(&basis.eigenvalues, &found);
        let bounds: Vec<f64> =
            basis.certificate.bounds.iter().zip(&basis.eigenvalues).skip(1).map(|(b, v)| b / v).collect();
        eprintln!(
            "{mass:?} {boundary:?}: {mean:.3} {largest:.3} %, estimated {:.3} %, bounds {:.1} %, {accuracy:?}",
            100.0 * accuracy.largest_estimate,
            100.0 * bounds.iter().copied().fold(0.0, f64::max),
        );
        assert!(mean < 0.22 && largest < 0.5, "{mass:?} {boundary:?}: {mean} %, {largest} %");
        assert!(largest < 300.0 * accuracy.largest_estimate, "{mass:?} {boundary:?}: {largest} %, {accuracy:?}");
    }
}

#[test]
fn rows_sum_to_one_and_no_bit_depends_on_the_threads() {
    let solid = shaken(14);
    let made = operator(&solid, MassKind::Barycentric, Boundary::Neumann);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| subspace(&solid, &made, &parameters(40, 150), &Unwatched).unwrap())
    };
    let space = on(1);
    assert_eq!(space, on(3));
    let mut filled = vec![false; space.columns()];
    for row in 0..space.rows() {
        let (columns, values) = space.row(row);
        assert!(columns.is_sorted_by(|a, b| a < b));
        columns.iter().for_each(|&column| filled[column as usize] = true);
        let sum: f32 = values.iter().sum();
        assert!((sum - 1.0).abs() < 1e-4, "row {row} sums to {sum}");
    }
    assert!(filled.iter().all(|&filled| filled));
    eprintln!("{} entries a row", space.entries() as f64 / space.rows() as f64);
}

#[test]
fn the_scale_of_the_input_does_not_matter() {
    let solid = bar([1.0, 1.1, 1.21], 12);
    let of = |scale: f64| {
        let positions = solid.positions.iter().map(|p| p.map(|c| scale * c)).collect();
        let scaled = TetMesh { positions, ..solid.clone() };
        let made = operator(&scaled, MassKind::Barycentric, Boundary::Neumann);
        let basis = approximate(&scaled, &made, &parameters(20, 150), &Unwatched).unwrap();
        is_consistent(&basis, &made);
        basis.eigenvalues
    };
    let one = of(1.0);
    // Powers of two, so that what is equally far stays so.
    for scale in [2f64.powi(-20), 2f64.powi(-10), 2f64.powi(23)] {
        for (value, one) in of(scale).iter().zip(&one).skip(1) {
            assert!((value * scale * scale / one - 1.0).abs() < 1e-4, "{scale}: {value} for {one}");
        }
    }
}

#[test]
fn two_bodies_have_a_constant_each_and_no_function_is_on_both() {
    let mut solid = bar([1.0; 3], 10);
    let n = solid.positions.len();
    solid.positions.extend(solid.positions.clone().iter().map(|p| [p[0] + 1.02, p[1], p[2]]));
    solid.tetrahedra.extend(solid.tetrahedra.clone().iter().map(|corners| corners.map(|v| v + n as u32)));
    let made = operator(&solid, MassKind::Barycentric, Boundary::Neumann);
    let basis = approximate(&solid, &made, &parameters(12, 162), &Unwatched).unwrap();
    assert!(basis.eigenvalues[1].abs() < 1e-9 && basis.eigenvalues[2] > 1.0);
    let Functions::Compact(compact) = &basis.functions else { panic!("a compact basis") };
    let mut side = vec![None; compact.space.columns()];
    for row in 0..compact.space.rows() {
        for &column in compact.space.row(row).0 {
            assert_eq!(*side[column as usize].get_or_insert(row < n), row < n, "column {column}");
        }
    }
}

#[test]
fn pairs_are_enclosed_index_by_index_and_refined() {
    let solid = bar([1.0, 1.1, 1.21], 14);
    let made = operator(&solid, MassKind::Consistent, Boundary::Neumann);
    let found = exact(&solid, &made, 40);
    let wanted = ApproximationParameters { certify: true, ..parameters(40, 190) };
    let certificate = approximate(&solid, &made, &wanted, &Unwatched).unwrap().certificate;
    assert_eq!(certificate.complete, Some(true));
    let plain = approximate(&solid, &made, &parameters(40, 190), &Unwatched).unwrap();
    for k in 1..40 {
        let (value, bound) = (plain.eigenvalues[k], certificate.bounds[k]);
        assert!(value - found[k] <= bound && bound < 0.2 * value, "pair {k}: {value} ± {bound}, {}", found[k]);
    }
    let (before, _) = errors(&plain.eigenvalues, &found);
    let refined = approximate_refined(&solid, &made, &parameters(40, 190), Refinement::InverseIteration, &Unwatched);
    let refined = refined.unwrap().pairs;
    let (after, _) = errors(&refined.values, &found);
    assert!(after < 0.3 * before, "{before} % became {after} %");
    assert!(refined.orthonormality_defect < 1e-10);
    let x = refined.vectors.column(3);
    let mass = made.problem.mass.scaled(made.problem.area);
    let norm: f64 = x.iter().zip(mass.multiply(&x)).map(|(x, mx)| x * mx).sum();
    assert!((norm - 1.0).abs() < 1e-9, "{norm}");
}

#[test]
fn what_is_not_made_for_solids_is_refused_by_name() {
    let solid = bar([1.0; 3], 8);
    let made = operator(&solid, MassKind::Barycentric, Boundary::Neumann);
    let radial = ApproximationParameters { space: Space::Radial(RadialParameters::default()), ..parameters(20, 150) };
    let error = approximate(&solid, &made, &radial, &Unwatched).unwrap_err();
    assert_eq!(error.kind(), "invalid-parameters");
    assert!(error.to_string().contains("heat"), "{error}");
    let many = approximate(&solid, &made, &parameters(1000, 1000), &Unwatched).unwrap_err();
    assert!(many.to_string().contains("729 unknowns"), "{many}");
}
