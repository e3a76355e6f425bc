use super::*;
use crate::analysis::fixtures::{chain, dense, solved};
use crate::analysis::subspace::compare;
use crate::basis::{Basis, DenseFunctions, Functions, Precision};
use crate::operator::{Boundary, MassKind, OperatorKind, OperatorParameters, assemble};
use chladni_algebra::{MassMatrix, SparseMatrix};
use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::shape::{Shape, generate};

fn followed(reference: &Basis, other: &Basis, pairs: usize, gap: f64) -> Following {
    let found = compare(reference, other, pairs, gap, &Unwatched).unwrap();
    let values = [&reference.eigenvalues[..], &other.eigenvalues];
    follow(&found.coefficients, &found.gram, values, gap, &Unwatched).unwrap()
}

/// By the overlaps of functions that are orthonormal.
fn by_overlaps(overlaps: &DenseMatrix, values: &[f64], gap: f64) -> Result<Following, AnalysisError> {
    follow(overlaps, &identity(overlaps.columns()), [values; 2], gap, &Unwatched)
}

fn columns(basis: &Basis) -> DenseMatrix {
    DenseMatrix::from_columns(basis.vertices(), basis.count(), basis.lift(0..basis.count()).unwrap())
}

/// The functions of a basis times a matrix.
fn mixed(basis: &Basis, matrix: &DenseMatrix) -> Basis {
    let columns = columns(basis).times(matrix);
    Basis { functions: Functions::Dense(DenseFunctions::from_columns(&columns, Precision::F64)), ..basis.clone() }
}

/// A matrix that turns some modes among themselves by an orthogonal matrix at random, determinants of both signs.
fn rotation(m: usize, modes: &[usize], seed: u64) -> DenseMatrix {
    let (mut random, k) = (SplitMix64::new(seed), modes.len());
    let block = DenseMatrix::from_columns(k, k, (0..k * k).map(|_| random.signed_unit()).collect());
    let block = nearest_orthogonal(&block).unwrap();
    let mut matrix = identity(m);
    for (column, &mode) in modes.iter().enumerate() {
        matrix.column_mut(mode)[mode] = 0.0;
        modes.iter().zip(block.column(column)).for_each(|(&row, &x)| matrix.column_mut(mode)[row] = x);
    }
    matrix
}

fn identity(m: usize) -> DenseMatrix {
    SparseMatrix::<f64>::identity(m).to_dense()
}

fn apart(a: &DenseMatrix, b: &DenseMatrix) -> f64 {
    assert_eq!((a.rows(), a.columns()), (b.rows(), b.columns()));
    a.values().iter().zip(b.values()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn modes_in_another_order_with_other_signs_and_another_scale_are_found() {
    let basis = dense(&chain(60, 20));
    for seed in 0..20 {
        let mut random = SplitMix64::new(seed);
        let order = random.permutation(20);
        let mut matrix = DenseMatrix::zeros(20, 20);
        let mut expected = vec![(0, 0.0); 20];
        for (other, &mode) in order.iter().enumerate() {
            let sign = if random.signed_unit() < 0.0 { -1.0 } else { 1.0 };
            matrix.column_mut(other)[mode as usize] = 3.0 * sign;
            expected[mode as usize] = (other, sign);
        }
        let mass = MassMatrix::Diagonal(vec![1.0 / 9.0; 60]);
        let other = Basis { mass, ..mixed(&basis, &matrix) };
        let found = followed(&basis, &other, 20, 1e-6);
        assert!(found.clusters.is_empty());
        for (followed, (follower, sign)) in found.modes.iter().zip(expected) {
            assert_eq!((followed.follower, followed.sign, followed.sure), (Some(follower), sign, true));
            assert!((followed.overlap - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn functions_that_are_turned_within_a_cluster_are_turned_back() {
    let mut basis = dense(&chain(60, 20));
    for mode in [5, 6, 7, 12] {
        basis.eigenvalues[mode] = basis.eigenvalues[mode - 1] * 1.001;
    }
    let reference = columns(&basis);
    for seed in 0..20 {
        let matrix = rotation(20, &[4, 5, 6, 7], seed).times(&rotation(20, &[11, 12], seed + 100));
        let other = mixed(&basis, &matrix);
        let found = followed(&basis, &other, 20, 0.01);
        let modes: Vec<&[usize]> = found.clusters.iter().map(|cluster| &cluster.modes[..]).collect();
        assert_eq!(modes, [&[4, 5, 6, 7][..], &[11, 12]]);
        assert!(found.modes.iter().all(|mode| mode.sure && (mode.overlap - 1.0).abs() < 1e-12));
        assert!(apart(&columns(&other).times(&found.rotation()), &reference) < 1e-12);
        // A cluster of the other basis alone is as good a reason, and so is one of the reference alone.
        let apart_values = Basis { eigenvalues: chain(60, 20).eigenvalues, ..other.clone() };
        let single = Basis { eigenvalues: chain(60, 20).eigenvalues, ..basis.clone() };
        for (a, b) in [(&basis, &apart_values), (&single, &other)] {
            let found = followed(a, b, 20, 0.01);
            assert!(apart(&columns(b).times(&found.rotation()), &reference) < 1e-12);
        }
    }
}

#[test]
fn clusters_that_are_cut_elsewhere_in_the_other_basis_are_followed_together() {
    // In the reference 4 and 5 are near each other, in the other basis 5 and 6.
    let basis = dense(&chain(60, 20));
    for seed in 0..20 {
        let (mut reference, mut other) =
            (mixed(&basis, &rotation(20, &[4, 5], seed)), mixed(&basis, &rotation(20, &[5, 6], seed + 50)));
        reference.eigenvalues[5] = reference.eigenvalues[4] * 1.001;
        other.eigenvalues[5] = other.eigenvalues[6] * 0.999;
        let found = followed(&reference, &other, 20, 0.01);
        let [cluster] = &found.clusters[..] else { panic!("{:?}", found.clusters) };
        assert_eq!(cluster.modes, [4, 5, 6]);
        assert!(apart(&columns(&other).times(&found.rotation()), &columns(&reference)) < 1e-12);
    }
    // Two modes of one eigenvalue of which one goes far away: its follower does not stand beside the other's.
    let mut swap = identity(20);
    (swap.column_mut(5)[5], swap.column_mut(5)[9]) = (0.0, 1.0);
    (swap.column_mut(9)[9], swap.column_mut(9)[5]) = (0.0, 1.0);
    let other = mixed(&basis, &rotation(20, &[4, 5], 8).times(&swap));
    let mut reference = basis.clone();
    reference.eigenvalues[5] = reference.eigenvalues[4] * 1.001;
    let found = followed(&reference, &other, 20, 0.01);
    let [cluster] = &found.clusters[..] else { panic!("{:?}", found.clusters) };
    let mut followers = cluster.followers.clone();
    followers.sort_unstable();
    assert_eq!((&cluster.modes[..], &followers[..]), (&[4, 5][..], &[4, 9][..]));
    assert!(apart(&columns(&other).times(&found.rotation()), &columns(&basis)) < 1e-12);
}

#[test]
fn what_is_lost_is_said_and_disturbs_nothing_beside() {
    let all = dense(&chain(60, 40));
    let mut basis = dense(&chain(60, 20));
    basis.eigenvalues[4] = basis.eigenvalues[3] * 1.001;
    // Function 30 in the place of function 3, the second of a cluster, and of 13, a single one.
    let mut pick = identity(40);
    for (lost, other) in [(3, 30), (13, 31)] {
        pick.column_mut(lost)[lost] = 0.0;
        pick.column_mut(lost)[other] = 1.0;
    }
    pick.keep_columns(20);
    let other = Basis { eigenvalues: basis.eigenvalues.clone(), ..mixed(&all, &pick) };
    let found = followed(&basis, &other, 20, 0.01);
    assert!(found.clusters.iter().all(|cluster| cluster.modes == [3, 4]));
    for (mode, followed) in found.modes.iter().enumerate() {
        let lost = [3, 13].contains(&mode);
        assert_eq!((followed.follower, followed.sure), (if lost { None } else { Some(mode) }, !lost), "{mode}");
        let norm: f64 = found.rotation().column(mode).iter().map(|x| x * x).sum();
        assert!((norm - if lost { 0.0 } else { 1.0 }).abs() < 1e-12);
    }
}

#[test]
fn a_mode_is_sure_where_all_others_together_have_little_of_it() {
    let basis = dense(&chain(60, 20));
    let turned = |degrees: f64| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let mut matrix = identity(20);
        (matrix.column_mut(7)[7], matrix.column_mut(7)[9]) = (cosine, sine);
        (matrix.column_mut(9)[7], matrix.column_mut(9)[9]) = (-sine, cosine);
        followed(&basis, &mixed(&basis, &matrix), 20, 1e-6).modes[7]
    };
    for (degrees, follower, sure) in [(20.0, 7, true), (26.0, 7, true), (27.0, 7, false), (44.0, 7, false)] {
        let found = turned(degrees);
        assert_eq!((found.follower, found.sure), (Some(follower), sure), "{degrees}");
        assert!((found.overlap - degrees.to_radians().cos()).abs() < 1e-12);
    }
    let beyond = turned(60.0);
    assert_eq!((beyond.follower, beyond.sign, beyond.sure), (Some(9), -1.0, false));
    // Two functions that are nearly one, as functions of a basis are in a quite different mass, are none for sure.
    let overlaps = DenseMatrix::from_columns(2, 2, vec![0.99, 0.1, 0.95, 0.3]);
    let found = by_overlaps(&overlaps, &[1.0, 2.0], 0.01).unwrap();
    assert!(!found.modes[0].sure);
}

/// All orders of the numbers below `m`.
fn orders(m: usize) -> Vec<Vec<usize>> {
    if m == 0 {
        return vec![Vec::new()];
    }
    let insert = |order: Vec<usize>| {
        (0..m).map(move |place| {
            let mut longer = order.clone();
            longer.insert(place, m - 1);
            longer
        })
    };
    orders(m - 1).into_iter().flat_map(insert).collect()
}

#[test]
fn no_order_has_a_greater_sum_than_the_assignment() {
    let mut random = SplitMix64::new(11);
    for m in 1..=7 {
        let orders = orders(m);
        assert_eq!(orders.len(), (1..=m).product::<usize>());
        for trial in 0..40 {
            // Numbers at random, few different ones with many ties, and mostly zeros.
            let mut weight = || match trial % 3 {
                0 => random.unit(),
                1 => random.below(3) as f64,
                _ => {
                    if random.below(4) == 0 {
                        random.unit()
                    } else {
                        0.0
                    }
                }
            };
            let weights = DenseMatrix::from_columns(m, m, (0..m * m).map(|_| weight()).collect());
            let sum = |order: &[usize]| -> f64 {
                order.iter().enumerate().map(|(row, &column)| weights.column(column)[row]).sum()
            };
            let found = assignment(&weights, &Unwatched).unwrap();
            assert!(orders.contains(&found), "{found:?}");
            let most = orders.iter().map(|order| sum(order)).fold(0.0, f64::max);
            assert!((sum(&found) - most).abs() < 1e-12, "{m}, {trial}: {} of {most}", sum(&found));
        }
    }
}

#[test]
fn a_thousand_modes_are_assigned_and_no_exchange_of_two_is_better() {
    let (m, mut random) = (MOST_PAIRS, SplitMix64::new(5));
    let order = random.permutation(m);
    let mut planted = DenseMatrix::from_columns(m, m, (0..m * m).map(|_| 0.01 * random.signed_unit()).collect());
    order.iter().enumerate().for_each(|(row, &column)| planted.column_mut(column as usize)[row] = -0.9);
    let values: Vec<f64> = (0..m).map(|k| 1.1f64.powi(k as i32)).collect();
    let found = by_overlaps(&planted, &values, 0.01).unwrap();
    let expected = |followed: &FollowedMode, column: &u32| followed.follower == Some(*column as usize) && followed.sure;
    assert!(found.modes.iter().zip(&order).all(|(followed, column)| expected(followed, column)));
    // Without any order to find, weights of one size.
    let weights = DenseMatrix::from_columns(m, m, (0..m * m).map(|_| random.unit()).collect());
    let found = assignment(&weights, &Unwatched).unwrap();
    let mut sorted = found.clone();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq(0..m));
    let at = |row: usize, column: usize| weights.column(column)[row];
    for a in 0..m {
        for b in 0..a {
            let (now, then) = (at(a, found[a]) + at(b, found[b]), at(a, found[b]) + at(b, found[a]));
            assert!(now >= then - 1e-12, "{a} and {b}");
        }
    }
}

#[test]
fn overlaps_of_nothing_one_mode_and_none_are_answered() {
    let values = [1.0, 1.0, 2.0, 3.0];
    let found = by_overlaps(&DenseMatrix::zeros(4, 4), &values, 0.01).unwrap();
    assert!(found.clusters.is_empty() && found.modes.iter().all(|mode| mode.follower.is_none() && !mode.sure));
    assert_eq!(found.rotation(), DenseMatrix::zeros(4, 4));
    let odd = DenseMatrix::from_columns(2, 2, vec![f64::NAN, 1.0, f64::INFINITY, 1e200]);
    let found = by_overlaps(&odd, &[1.0, 2.0], 0.01).unwrap();
    assert_eq!((found.modes[0].follower, found.modes[1].follower), (None, Some(0)));
    // Functions without a norm, or with one that is none, follow nothing.
    for norm in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let gram = DenseMatrix::from_columns(2, 2, vec![1.0, 0.0, 0.0, norm]);
        let found = follow(&identity(2), &gram, [&[1.0, 1.0]; 2], 0.01, &Unwatched).unwrap();
        assert_eq!((found.modes[0].follower, found.modes[1].follower), (Some(0), None), "{norm}");
    }
    let one = by_overlaps(&DenseMatrix::from_columns(1, 1, vec![-0.9]), &values, 0.01).unwrap();
    assert_eq!(one.modes, [FollowedMode { follower: Some(0), sign: -1.0, overlap: 0.9, sure: true }]);
    let none = by_overlaps(&DenseMatrix::zeros(0, 0), &[], 0.01).unwrap();
    assert!(none.modes.is_empty() && none.clusters.is_empty());
    // A gap that makes all of them one cluster.
    let basis = dense(&chain(60, 20));
    let other = mixed(&basis, &rotation(20, &(0..20).collect::<Vec<_>>(), 2));
    let found = followed(&basis, &other, 20, 10.0);
    assert_eq!(found.clusters[0].modes, (0..20).collect::<Vec<_>>());
    assert!(apart(&columns(&other).times(&found.rotation()), &columns(&basis)) < 1e-12);
    let told =
        |pairs: usize, gap: f64| by_overlaps(&DenseMatrix::zeros(pairs, pairs), &values, gap).unwrap_err().to_string();
    assert!(told(5, 0.1).ends_with("pairs must be between 0 and 4, got 5"), "{}", told(5, 0.1));
    assert!(told(3, -1.0).ends_with("got -1") && told(3, f64::NAN).ends_with("got NaN"));
}

/// An ellipsoid with the semi-axes 1, 1.2 and `height`, solved to 1e-8, each function with a sign at random: of the
/// four lowest modes three are nearly the coordinates, the longest axis first.
fn ellipsoid(height: f64, seed: u64) -> (Basis, Vec<[f64; 3]>) {
    let mut mesh = generate(Shape::Sphere, 642).unwrap();
    let stretched = |[x, y, z]: [f64; 3]| [x, 1.2 * y, height * z];
    mesh.positions = mesh.positions.into_iter().map(stretched).collect();
    let parameters = OperatorParameters {
        operator: OperatorKind::Laplace,
        mass: MassKind::Barycentric,
        boundary: Boundary::Neumann,
    };
    let operator = assemble(&mesh, &parameters, &Unwatched).unwrap();
    let basis = solved(&operator, mesh.positions.len(), 9, 1e-8);
    let (mut signs, mut random) = (identity(9), SplitMix64::new(seed));
    (0..9).for_each(|k| signs.column_mut(k)[k] = if random.signed_unit() < 0.0 { -1.0 } else { 1.0 });
    (mixed(&basis, &signs), mesh.positions)
}

/// Which coordinate a function is most like, and with which sign.
fn axis(function: &[f64], positions: &[[f64; 3]]) -> (usize, f64) {
    let product = |axis: usize| -> f64 { function.iter().zip(positions).map(|(f, p)| f * p[axis]).sum() };
    let products = [0, 1, 2].map(product);
    let most = (0..3).max_by(|&a, &b| products[a].abs().total_cmp(&products[b].abs())).unwrap();
    (most, products[most].signum())
}

#[test]
fn modes_are_followed_through_a_crossing_in_small_steps_as_in_one() {
    let heights = [0.88, 0.93, 0.98, 1.03, 1.08, 1.13];
    let frames: Vec<_> = (0u64..).zip(heights).map(|(seed, height)| ellipsoid(height, seed)).collect();
    let axes = |k: usize| {
        let functions = columns(&frames[k].0);
        [1, 2, 3].map(|mode| axis(functions.column(mode), &frames[k].1))
    };
    let (first, last) = (axes(0), axes(5));
    // By their numbers alone modes 2 and 3 would change places: the axes x and z.
    assert_eq!((first.map(|(axis, _)| axis), last.map(|(axis, _)| axis)), ([1, 0, 2], [1, 2, 0]));
    let mut steps = identity(9);
    for pair in frames.windows(2) {
        let found = followed(&pair[0].0, &pair[1].0, 9, 1e-3);
        assert!(found.clusters.iter().all(|cluster| cluster.modes[0] > 3), "{found:?}");
        assert!(found.modes[..4].iter().all(|mode| mode.sure), "{found:?}");
        steps = found.rotation().times(&steps);
    }
    let leap = followed(&frames[0].0, &frames[5].0, 9, 1e-3);
    assert_eq!(
        leap.modes[..4].iter().map(|mode| mode.follower).collect::<Vec<_>>(),
        [Some(0), Some(1), Some(3), Some(2)]
    );
    let [steps, leap] = [steps, leap.rotation()].map(|matrix| matrix.slice_columns(0..4));
    assert!(apart(&steps, &leap) == 0.0, "the same modes with the same signs");
    // Each function goes on along its axis, with its sign.
    let functions = columns(&frames[5].0).times(&steps);
    for (mode, expected) in (1..4).zip(first) {
        assert_eq!(axis(functions.column(mode), &frames[5].1), expected, "{mode}");
    }
}

#[test]
fn a_frame_where_two_eigenvalues_coincide_turns_nothing() {
    let (before, positions) = ellipsoid(0.9, 1);
    let (between, _) = ellipsoid(1.0, 2);
    let (after, last) = ellipsoid(1.1, 3);
    let steps = |middle: &Basis| {
        let (there, on) = (followed(&before, middle, 9, 0.01), followed(middle, &after, 9, 0.01));
        for found in [&there, &on] {
            assert!(found.clusters.iter().any(|cluster| cluster.modes == [2, 3]), "{found:?}");
            assert!(found.modes[..4].iter().all(|mode| mode.sure && mode.overlap > 0.99), "{found:?}");
        }
        (there.rotation(), on.rotation())
    };
    let plain = steps(&between);
    let shown = columns(&between).times(&plain.0);
    for seed in 0..5 {
        // Whichever functions stand for the eigenvalue, the frame shows the same, and so does the next.
        let turned = mixed(&between, &rotation(9, &[2, 3], seed));
        let (there, on) = steps(&turned);
        let frame = columns(&turned).times(&there);
        assert!(
            (0..4).all(|mode| apart(&frame.slice_columns(mode..mode + 1), &shown.slice_columns(mode..mode + 1)) < 1e-9)
        );
        let through = on.times(&there);
        let functions = columns(&after).times(&through);
        for mode in 1..4 {
            let reference = columns(&before);
            assert_eq!(axis(functions.column(mode), &last), axis(reference.column(mode), &positions));
        }
        assert!(through.column(2)[3].abs() > 0.99 && through.column(3)[2].abs() > 0.99, "{through:?}");
    }
}
