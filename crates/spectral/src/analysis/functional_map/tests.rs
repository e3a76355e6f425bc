use super::*;
use crate::analysis::fixtures::chain;
use crate::basis::{DenseFunctions, Functions, Precision};
use chladni_algebra::{CpuSolver, SymmetricDefiniteSolver};
use chladni_base::Unwatched;

fn request() -> MapRequest {
    MapRequest {
        landmarks: vec![[5, 5], [70, 70]],
        descriptors: None,
        signatures: false,
        start: 8,
        pairs: 20,
        step: 4,
        samples: 60,
        commutativity: 0.1,
        all_points: true,
        both_ways: false,
    }
}

#[test]
fn a_surface_is_mapped_to_itself() {
    let basis = chain(100, 30);
    let map = functional_map(&basis, &basis, &request()).unwrap();
    for column in 0..20 {
        for row in 0..20 {
            let one = if row == column { 1.0 } else { 0.0 };
            assert!((map.matrix.column(column)[row] - one).abs() < 0.05, "{row} {column}");
        }
    }
    assert!(map.to_source.points.iter().zip(0..).all(|(&point, vertex)| i64::from(point).abs_diff(vertex) <= 1));
    assert!(map.orthogonality_defect < 0.05 && map.commutativity_defect < 0.05 && map.coverage > 0.9);
    assert!(map.descriptor_residual < 1e-6 && map.embedding_error < 0.1);
    assert!(map.to_source.matched.is_none());
}

#[test]
fn landmarks_decide_between_a_shape_and_its_mirror_image() {
    let basis = chain(100, 30);
    let mirrored = MapRequest { landmarks: vec![[5, 94], [70, 29]], all_points: false, ..request() };
    let map = functional_map(&basis, &basis, &mirrored).unwrap();
    let matched = map.to_source.matched.unwrap();
    assert!(matched.contains(&94) && matched.len() < 70);
    for (vertex, point) in matched.iter().zip(&map.to_source.points) {
        assert!((99 - *vertex).abs_diff(*point) <= 2, "{vertex} {point}");
    }
}

#[test]
fn a_refined_chain_is_mapped_to_a_coarse_one() {
    let (coarse, mut fine) = (chain(50, 30), chain(150, 30));
    // Eigenvalues of a line go with the square of its length, those of a surface, as which it is treated, with the
    // area.
    fine.eigenvalues.iter_mut().for_each(|value| *value *= 3.0);
    let request = MapRequest { landmarks: vec![[2, 7], [40, 121]], ..request() };
    let map = functional_map(&coarse, &fine, &request).unwrap();
    for (vertex, &point) in map.to_source.points.iter().enumerate() {
        assert!((vertex / 3).abs_diff(point as usize) <= 1, "{vertex} {point}");
    }
}

#[test]
fn known_functions_serve_as_landmarks_do() {
    let basis = chain(100, 30);
    let x = DenseMatrix::from_columns(100, 2, (0..200).map(|i| (i as f64 * 0.037).sin()).collect());
    let known = basis.project(&x).unwrap();
    let request =
        MapRequest { landmarks: vec![], descriptors: Some((known.clone(), known)), signatures: true, ..request() };
    let map = functional_map(&basis, &basis, &request).unwrap();
    assert!(map.to_source.points.iter().zip(0..).all(|(&point, vertex)| i64::from(point).abs_diff(vertex) <= 1));
}

#[test]
fn samples_are_spread_evenly_and_hold_the_landmarks() {
    let basis = chain(100, 3);
    let side = Side::new(&basis, vec![3]).unwrap();
    for count in [1, 7, 30, 99, 100, 500] {
        let samples = side.samples(count);
        assert!(samples.contains(&3) && samples.is_sorted());
        assert!(samples.len().abs_diff(count.min(100)) <= 1, "{count}: {}", samples.len());
    }
}

#[test]
fn what_does_not_fit_is_named() {
    let basis = chain(100, 30);
    let error = |request: MapRequest| functional_map(&basis, &basis, &request).unwrap_err().to_string();
    assert_eq!(error(MapRequest { landmarks: vec![[5, 5], [100, 0]], ..request() }), "landmark 1 is vertex 100 of 100");
    assert_eq!(error(MapRequest { landmarks: vec![[5, 100]], ..request() }), "landmark 0 is vertex 100 of 100");
    assert!(
        error(MapRequest { landmarks: vec![], ..request() }).ends_with("known functions must be at least 1, got 0")
    );
    assert!(error(MapRequest { pairs: 31, ..request() }).ends_with("pairs must be between 1 and 30, got 31"));
    assert!(error(MapRequest { start: 21, ..request() }).starts_with("start must be between 1 and 20, got 21"));
    assert!(error(MapRequest { step: 0, ..request() }).starts_with("step must be between 1 and "));
    assert!(
        error(MapRequest { samples: 10, ..request() }).starts_with("the number of samples must be between 40 and ")
    );
    assert!(error(MapRequest { commutativity: f64::NAN, ..request() }).starts_with("commutativity must be "));
}

/// ZoomOut as it is published, with all vertices, in plain loops: `T(p) = argmin_q ‖Φ_target(p) − C Φ_source(q)‖`,
/// `C = Φ_target⁺ Φ_source(T)`.
fn published(
    [there, here]: [&[Vec<f64>]; 2],
    mass: &[f64],
    start: usize,
    pairs: usize,
    mut map: Vec<Vec<f64>>,
) -> (Vec<Vec<f64>>, Vec<u32>) {
    let points = |map: &[Vec<f64>], k: usize| -> Vec<u32> {
        let image = |q: &[f64]| -> Vec<f64> { (0..k).map(|i| (0..k).map(|j| map[i][j] * q[j]).sum()).collect() };
        let images: Vec<Vec<f64>> = there.iter().map(|q| image(q)).collect();
        let square = |p: &[f64], y: &[f64]| (0..k).map(|i| (p[i] - y[i]).powi(2)).sum::<f64>();
        let best = |p: &Vec<f64>| {
            (0..images.len()).min_by(|&a, &b| square(p, &images[a]).total_cmp(&square(p, &images[b]))).unwrap()
        };
        here.iter().map(|p| best(p) as u32).collect()
    };
    for k in start..pairs {
        let found = points(&map, k);
        // The modes of the target are orthonormal for its mass: the pseudoinverse is Φᵀ M.
        let entry = |i: usize, j: usize| {
            (0..here.len()).map(|p| mass[p] * here[p][i] * there[found[p] as usize][j]).sum::<f64>()
        };
        map = (0..=k).map(|i| (0..=k).map(|j| entry(i, j)).collect()).collect();
    }
    let found = points(&map, pairs);
    (map, found)
}

/// A chain that is bent: its modes mixed by what depends on the place, so that no map between it and another is a
/// permutation of signs.
fn uneven(n: usize, m: usize, strength: f64) -> Basis {
    // A chain of links of different stiffness, solved densely.
    let mut stiffness = DenseMatrix::zeros(n, n);
    for i in 0..n - 1 {
        let link = 1.0 + strength * (0.37 * i as f64).sin();
        for (a, b, value) in [(i, i, link), (i + 1, i + 1, link), (i, i + 1, -link), (i + 1, i, -link)] {
            stiffness.column_mut(b)[a] += value;
        }
    }
    let mut mass = DenseMatrix::zeros(n, n);
    (0..n).for_each(|i| mass.column_mut(i)[i] = 1.0);
    let pairs = CpuSolver.lowest(stiffness, mass, m, &Unwatched).unwrap();
    let mut basis = chain(n, m);
    let columns = DenseMatrix::from_columns(n, m, pairs.vectors.values()[..n * m].to_vec());
    basis.functions = Functions::Dense(DenseFunctions::from_columns(&columns, Precision::F64));
    basis.eigenvalues = pairs.values[..m].iter().map(|value| value.max(0.0)).collect();
    basis
}

#[test]
fn refinement_is_that_of_the_published_zoom_out() {
    let (n, m, start, pairs) = (90, 24, 6, 18);
    for (a, b) in [(0.0, 0.5), (0.5, 0.0), (0.3, -0.6)] {
        let (source, target) = (uneven(n, m, a), uneven(n, m, b));
        let scaled = |basis: &Basis| -> Vec<Vec<f64>> {
            let modes: Vec<f64> = basis.lift(0..m).unwrap();
            (0..n).map(|p| (0..m).map(|k| modes[k * n + p] * (n as f64).sqrt()).collect()).collect()
        };
        let (there, here) = (scaled(&source), scaled(&target));
        let base = MapRequest {
            landmarks: vec![[5, 5], [40, 40], [70, 70]],
            start,
            pairs: start,
            step: 1,
            samples: n,
            ..request()
        };
        let first = functional_map(&source, &target, &base).unwrap().matrix;
        let map = (0..start).map(|i| (0..start).map(|j| first.column(j)[i]).collect()).collect();
        let mass = vec![1.0 / n as f64; n];
        let (map, points) = published([&there, &here], &mass, start, pairs, map);
        let found = functional_map(&source, &target, &MapRequest { pairs, ..base }).unwrap();
        let same = found.to_source.points.iter().zip(&points).filter(|(a, b)| a == b).count();
        assert!(same >= n - 1, "{a} {b}: {same} of {n} points");
        for i in 0..pairs {
            for j in 0..pairs {
                assert!((found.matrix.column(j)[i] - map[i][j]).abs() < 1e-4, "{a} {b}: {i} {j}");
            }
        }
    }
}

#[test]
fn both_ways_are_inverse_to_each_other_and_confidence_is_high_where_they_agree() {
    let (coarse, mut fine) = (chain(50, 30), chain(150, 30));
    fine.eigenvalues.iter_mut().for_each(|value| *value *= 3.0);
    let request = MapRequest { landmarks: vec![[2, 7], [40, 121]], both_ways: true, ..request() };
    let map = functional_map(&coarse, &fine, &request).unwrap();
    let back = map.to_target.unwrap();
    assert_eq!((map.to_source.points.len(), back.points.len()), (150, 50));
    for (vertex, &point) in back.points.iter().enumerate() {
        assert!((3 * vertex + 1).abs_diff(point as usize) <= 2, "{vertex} {point}");
        assert!((map.to_source.points[point as usize] as usize).abs_diff(vertex) <= 1);
    }
    for (points, confidences) in
        [(&map.to_source.points, &map.to_source.confidences), (&back.points, &back.confidences)]
    {
        assert_eq!(points.len(), confidences.len());
        assert!(confidences.iter().all(|&c| (0.7..=1.0).contains(&c)), "{confidences:?}");
    }
}

/// A sphere of the same triangles in other units: everything known is told in the units of each, and nothing else may
/// change.
#[test]
fn units_of_either_surface_do_not_matter_to_the_map_and_functions_keep_their_values() {
    let small = chain(100, 30);
    let mut large = small.clone();
    // Masses times s², eigenvalues over s², functions over s.
    let s = 1000.0;
    large.mass = large.mass.scaled(s * s);
    large.eigenvalues.iter_mut().for_each(|value| *value /= s * s);
    if let Functions::Compact(compact) = &mut large.functions {
        compact.coefficients.values_mut().iter_mut().for_each(|value| *value /= s);
    }
    let x = DenseMatrix::from_columns(100, 2, (0..200).map(|i| (i as f64 * 0.037).sin()).collect());
    for (source, target) in [(&small, &large), (&large, &small)] {
        let descriptors = Some((source.project(&x).unwrap(), target.project(&x).unwrap()));
        let request = MapRequest { landmarks: vec![], descriptors, signatures: true, ..request() };
        let map = functional_map(source, target, &request).unwrap();
        assert!(map.orthogonality_defect < 0.05, "{}", map.orthogonality_defect);
        assert!(map.to_source.points.iter().zip(0..).all(|(&point, vertex)| i64::from(point).abs_diff(vertex) <= 1));
        // Smooth functions are carried by modes with their values, any by points.
        let smooth = source.evaluate(&{
            let mut c = DenseMatrix::zeros(30, 1);
            c.column_mut(0)[..4].copy_from_slice(&[3.0, 1.0, -2.0, 0.5]);
            c
        });
        let smooth = smooth.unwrap();
        let size = smooth.values().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        for how in [Transfer::Points, Transfer::Modes] {
            let carried = map.transfer(source, target, &smooth, how).unwrap();
            let worst = carried.values().iter().zip(smooth.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 0.2 * size, "{how:?}: {worst} of {size}");
        }
        assert!(map.transfer(source, target, &DenseMatrix::zeros(99, 1), Transfer::Modes).is_err());
        let some = functional_map(source, target, &MapRequest { all_points: false, ..request }).unwrap();
        let told = some.transfer(source, target, &smooth, Transfer::Points).unwrap_err().to_string();
        assert!(told.starts_with("the number of matched points must be "), "{told}");
    }
}
