//! Pencils without a mesh, against dense solves and known spectra.

use std::f64::consts::PI;

use chladni_algebra::{CpuSolver, MassMatrix, SparseMatrix, SymmetricDefiniteSolver, eigenvalues_below};
use chladni_base::{SplitMix64, Unwatched};
use chladni_spectral::basis::CutCluster;
use chladni_spectral::spectrum::hsim::HsimError;
use chladni_spectral::spectrum::pencil::{Mass, Pairs, Parameters, Pencil, PencilError, PencilSelection, csr, solve};

#[path = "pencil/outliers.rs"]
mod outliers;

/// The matrix of entries given in any order; those of one place are added up.
fn matrix(n: usize, entries: &[(usize, usize, f64)]) -> SparseMatrix {
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); n];
    entries.iter().for_each(|&(row, column, value)| rows[row].push((column as u32, value)));
    let (mut indptr, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in rows {
        indices.extend(row.iter().map(|entry| entry.0));
        values.extend(row.iter().map(|entry| entry.1));
        indptr.push(indices.len());
    }
    csr(n, n, &indptr, &indices, &values).unwrap()
}

fn laplacian(n: usize, edges: &[(usize, usize)]) -> SparseMatrix {
    let entries: Vec<_> =
        edges.iter().flat_map(|&(a, b)| [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)]).collect();
    matrix(n, &entries)
}

fn path(n: usize) -> Vec<(usize, usize)> {
    (1..n).map(|k| (k - 1, k)).collect()
}

/// A grid, closed to a torus or not.
fn grid(width: usize, height: usize, closed: bool) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            if closed || x + 1 < width {
                edges.push((at, y * width + (x + 1) % width));
            }
            if closed || y + 1 < height {
                edges.push((at, (y + 1) % height * width + x));
            }
        }
    }
    edges
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values
}

fn lowest(count: usize) -> Parameters {
    Parameters { selection: PencilSelection::Count(count), ..Parameters::default() }
}

fn pencil(stiffness: &SparseMatrix, mass: &Mass) -> Pencil {
    Pencil::new(stiffness.clone(), mass.clone(), &[], &Unwatched).unwrap()
}

/// Solves, and compares values with exact ones to `error` of the largest, vectors with the matrices, and enclosures
/// with both.
fn proven(stiffness: &SparseMatrix, mass: &Mass, parameters: &Parameters, exact: &[f64], error: f64) -> Pairs {
    let pencil = pencil(stiffness, mass);
    let pairs =
        solve(&pencil, parameters, &Unwatched).unwrap_or_else(|error| panic!("{:?}: {error}", parameters.selection));
    let Pairs { values, vectors, certificate, moved, .. } = &pairs;
    assert_eq!(values.len(), exact.len());
    assert_eq!(certificate.complete, Some(true));
    let norm_s = (0..stiffness.rows()).map(|r| stiffness.row(r).1.iter().map(|v| v.abs()).sum::<f64>());
    let norm_s = norm_s.fold(0.0, f64::max);
    let scale = exact.iter().fold(1e-3 * norm_s, |most: f64, value| most.max(value.abs()));
    for (k, (&found, &exact)) in values.iter().zip(exact).enumerate() {
        assert!((found - exact).abs() <= error * scale, "value {k} is {found}, not {exact}; moved by {moved}");
        assert!((found - exact).abs() <= certificate.bounds[k] + 1e-14 * scale, "{k}: {:e}", certificate.bounds[k]);
    }
    let m = pencil.mass();
    for k in 0..values.len() {
        let x = vectors.column(k);
        let (sx, mx) = (stiffness.multiply(x), m.multiply(x));
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
        let rest = norm(&mut sx.iter().zip(&mx).map(|(s, m)| s - values[k] * m));
        let whole = norm(&mut sx.iter().zip(&mx).map(|(s, m)| s + moved * m));
        let floor = 1e-13 * norm_s * norm(&mut x.iter().copied());
        assert!(rest <= 2.0 * parameters.tolerance * whole + floor, "pair {k}: {rest:e} of {whole:e}");
        let products: Vec<f64> =
            (0..values.len()).map(|j| vectors.column(j).iter().zip(&mx).map(|(a, b)| a * b).sum()).collect();
        for (j, product) in products.iter().enumerate() {
            assert!((product - f64::from(u8::from(j == k))).abs() < 1e-8, "{j}, {k}: {product}");
        }
        assert!(x.iter().copied().fold(f64::INFINITY, f64::min).abs() <= x.iter().copied().fold(0.0, f64::max));
    }
    pairs
}

/// All eigenvalues by a dense solve.
fn dense(stiffness: &SparseMatrix, mass: &Mass) -> Vec<f64> {
    let mass = pencil(stiffness, mass).mass().to_dense();
    CpuSolver.lowest(stiffness.to_dense(), mass, stiffness.rows(), &Unwatched).unwrap().values
}

#[test]
fn paths_grids_and_tori_have_their_spectra_with_every_multiplicity() {
    let term = |k: usize, n: usize| 2.0 - 2.0 * (PI * k as f64 / n as f64).cos();
    for n in [1usize, 2, 3, 5, 40] {
        let exact = sorted((0..n).map(|k| term(k, n)));
        for count in [1, n.div_ceil(2), n] {
            proven(&laplacian(n, &path(n)), &Mass::Identity, &lowest(count), &exact[..count], 1e-12);
        }
    }
    // Not solved densely: a path of 3,000 has gaps of 1e-6, and its inverse is badly conditioned.
    let exact = sorted((0..3000).map(|k| term(k, 3000)));
    proven(&laplacian(3000, &path(3000)), &Mass::Identity, &lowest(40), &exact[..40], 1e-8);
    let exact = sorted((0..60).flat_map(|a| (0..50).map(move |b| term(a, 60) + term(b, 50))));
    proven(&laplacian(3000, &grid(60, 50, false)), &Mass::Identity, &lowest(50), &exact[..50], 1e-9);
    // On a square torus most values are there four or eight times.
    let exact = sorted((0..48).flat_map(|a| (0..48).map(move |b| term(2 * a, 48) + term(2 * b, 48))));
    proven(&laplacian(2304, &grid(48, 48, true)), &Mass::Identity, &lowest(45), &exact[..45], 1e-9);
}

/// A hub and a rim: all but the ends of the spectrum lie in `[1, 5]`, and the lowest of them a hundred-thousandth
/// apart.
#[test]
fn clusters_far_above_zero_are_told_apart() {
    for rim in [1500, 2500] {
        let edges: Vec<_> = (1..=rim).flat_map(|at| [(0, at), (at, at % rim + 1)]).collect();
        let turn = |k: usize| 3.0 - 2.0 * (2.0 * PI * k as f64 / rim as f64).cos();
        let exact = sorted([0.0, rim as f64 + 1.0].into_iter().chain((1..rim).map(turn)));
        for count in [10, 30] {
            proven(&laplacian(rim + 1, &edges), &Mass::Identity, &lowest(count), &exact[..count], 1e-12);
        }
    }
}

/// Two wheels whose hubs are joined: two values near zero, and then the same clusters, each value four times. A shift
/// between these two is among what is wanted, but in the middle of nothing.
#[test]
fn clusters_above_a_pair_of_low_values_are_told_apart() {
    for rim in [1000, 2000] {
        let wheel = |hub: usize| (1..=rim).flat_map(move |at| [(hub, hub + at), (hub + at, hub + at % rim + 1)]);
        let edges: Vec<_> = wheel(0).chain(wheel(rim + 1)).chain([(0, rim + 1)]).collect();
        let turn = |k: usize| 3.0 - 2.0 * (2.0 * PI * k as f64 / rim as f64).cos();
        // What is constant on each rim and differs by its sign between the wheels: a product of 2, and a sum of r + 3.
        let sum = rim as f64 + 3.0;
        let high = 0.5 * (sum + (sum * sum - 8.0).sqrt());
        let ends = [0.0, rim as f64 + 1.0, 2.0 / high, high];
        let exact = sorted(ends.into_iter().chain((1..rim).flat_map(|k| [turn(k), turn(k)])));
        for count in [5, 10, 30] {
            proven(&laplacian(2 * rim + 2, &edges), &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
        }
    }
}

/// The curl of edges of a grid of squares: all gradients are in its kernel, more than any block of a Krylov space has
/// columns. Beside it another grid.
#[test]
fn kernels_of_hundreds_of_dimensions_and_what_lies_above_are_found() {
    let (width, height) = (20, 15);
    let along = |i: usize, j: usize| j * width + i;
    let across = |i: usize, j: usize| width * (height + 1) + j * (width + 1) + i;
    let edges = width * (height + 1) + (width + 1) * height;
    let mut entries = Vec::new();
    for (i, j) in (0..width).flat_map(|i| (0..height).map(move |j| (i, j))) {
        let sides = [(along(i, j), 1.0), (across(i + 1, j), 1.0), (along(i, j + 1), -1.0), (across(i, j), -1.0)];
        entries.extend(sides.iter().flat_map(|a| sides.iter().map(move |b| (a.0, b.0, a.1 * b.1))));
    }
    let other = laplacian(2000, &grid(50, 40, false));
    for row in 0..2000 {
        let (columns, values) = other.row(row);
        entries.extend(columns.iter().zip(values).map(|(&c, &v)| (edges + row, edges + c as usize, v)));
        entries.push((edges + row, edges + row, 0.3));
    }
    let stiffness = matrix(edges + 2000, &entries);
    let term = |k: usize, n: usize| 2.0 - 2.0 * (PI * k as f64 / n as f64).cos();
    let curls = (1..=width).flat_map(|a| (1..=height).map(move |b| term(a, width + 1) + term(b, height + 1)));
    let others = (0..50).flat_map(|a| (0..40).map(move |b| 0.3 + term(a, 50) + term(b, 40)));
    let gradients = (width + 1) * (height + 1) - 1;
    let exact = sorted(std::iter::repeat_n(0.0, gradients).chain(curls).chain(others));
    for count in [gradients, gradients + 1, gradients + 11, gradients + 40] {
        proven(&stiffness, &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
    }
}

#[test]
fn complete_graphs_stars_and_copies() {
    let complete: Vec<_> = (0..60).flat_map(|a| (0..a).map(move |b| (a, b))).collect();
    let exact: Vec<f64> = std::iter::once(0.0).chain(std::iter::repeat_n(60.0, 59)).collect();
    for count in [1, 2, 10, 60] {
        proven(&laplacian(60, &complete), &Mass::Identity, &lowest(count), &exact[..count], 1e-12);
    }
    // A hub: 0, then 1 for all but one of the leaves, then the number of rows.
    let star: Vec<_> = (1..500).map(|leaf| (0, leaf)).collect();
    let exact: Vec<f64> = std::iter::once(0.0).chain(std::iter::repeat_n(1.0, 498)).chain([500.0]).collect();
    proven(&laplacian(500, &star), &Mass::Identity, &lowest(500), &exact, 1e-10);
    proven(&laplacian(500, &star), &Mass::Identity, &lowest(7), &exact[..7], 1e-10);
    // Five equal grids and a longer one: a kernel of dimension six.
    let mut edges: Vec<_> = (0..5)
        .flat_map(|copy| grid(20, 20, false).into_iter().map(move |(a, b)| (400 * copy + a, 400 * copy + b)))
        .collect();
    edges.extend(path(100).into_iter().map(|(a, b)| (2000 + a, 2000 + b)));
    let term = |k: usize, n: usize| 2.0 - 2.0 * (PI * k as f64 / n as f64).cos();
    let grid = (0..5).flat_map(|_| (0..20).flat_map(|a| (0..20).map(move |b| term(a, 20) + term(b, 20))));
    let exact = sorted(grid.chain((0..100).map(|k| term(k, 100))));
    for count in [6, 20, 43] {
        proven(&laplacian(2100, &edges), &Mass::Identity, &lowest(count), &exact[..count], 1e-9);
    }
}

#[test]
fn diagonal_matrices_are_their_own_spectra() {
    for n in [1usize, 2, 3, 64, 2000] {
        let entries: Vec<_> = (0..n).map(|k| (k, k, ((k * 7919) % n) as f64 - 0.3 * n as f64)).collect();
        let mass: Vec<f64> = (0..n).map(|k| 1.0 + (k % 3) as f64).collect();
        let exact = sorted(entries.iter().zip(&mass).map(|(entry, mass)| entry.2 / mass));
        let count = n.min(20);
        proven(&matrix(n, &entries), &Mass::Diagonal(mass), &lowest(count), &exact[..count], 1e-10);
    }
    // Nothing at all, and nothing but one value.
    proven(&matrix(3, &[]), &Mass::Identity, &lowest(3), &[0.0; 3], 1e-12);
    // Too many rows for a dense solve: zero up to rounding, and proven.
    let nothing = solve(&pencil(&matrix(1000, &[]), &Mass::Identity), &lowest(3), &Unwatched).unwrap();
    assert!(nothing.certificate.complete == Some(true) && nothing.values.iter().all(|value| value.abs() < 1e-15));
    proven(&matrix(2, &[(0, 0, 4.0), (1, 1, 4.0)]), &Mass::Identity, &lowest(2), &[4.0; 2], 1e-12);
}

/// A random symmetric matrix of `n` rows with about `each` entries in a row beside the diagonal, which is `diagonal`
/// plus a share of their magnitudes.
fn random(n: usize, each: usize, diagonal: f64, share: f64, seed: u64) -> SparseMatrix {
    let mut random = SplitMix64::new(seed);
    let mut entries: Vec<_> = (0..n).map(|k| (k, k, diagonal)).collect();
    for row in 0..n {
        for _ in 0..each {
            let (column, value) = (random.below(n), random.signed_unit());
            entries.extend([(row, column, value), (column, row, value)]);
            entries.extend([(row, row, share * value.abs()), (column, column, share * value.abs())]);
        }
    }
    matrix(n, &entries)
}

#[test]
fn random_pencils_with_any_mass_agree_with_dense_solves() {
    for (seed, n) in [(1, 7), (2, 150), (3, 1200)] {
        let definite = random(n, 2, 0.1, 1.0, seed);
        let indefinite = random(n, 2, 0.0, 0.0, seed + 10);
        // Rows of this mass sum to anything, also to less than nothing.
        let mass = Mass::Sparse(random(n, 1, 0.5, 1.05, seed + 20));
        for stiffness in [&definite, &indefinite] {
            for mass in [&Mass::Identity, &mass] {
                let exact = dense(stiffness, mass);
                let count = (n / 8).clamp(3, 30);
                proven(stiffness, mass, &lowest(count), &exact[..count], 1e-9);
            }
        }
    }
}

#[test]
fn scales_do_not_matter() {
    let stiffness = laplacian(1500, &grid(50, 30, false));
    let mass: Vec<f64> = (0..1500).map(|k| 1.0 + (k % 5) as f64).collect();
    let exact = dense(&stiffness, &Mass::Diagonal(mass.clone()));
    for (s, m) in [(1e150, 1e-150), (1e-150, 1e150), (3e-9, 7e11), (1e-200, 1e-200)] {
        let exact: Vec<f64> = exact[..25].iter().map(|value| value * (s / m)).collect();
        let mass = Mass::Diagonal(mass.iter().map(|x| x * m).collect());
        let pencil = pencil(&stiffness.scaled(s), &mass);
        let pairs = solve(&pencil, &lowest(25), &Unwatched).unwrap();
        for (found, exact) in pairs.values.iter().zip(&exact) {
            assert!((found / (s / m) - exact / (s / m)).abs() < 1e-9, "{found} is not {exact} at {s:e}, {m:e}");
        }
    }
    // Edges of very different stiffness: eigenvalues over ten orders of magnitude.
    let entries: Vec<_> = (1..1500)
        .flat_map(|k| {
            let w = 10f64.powi((k % 7) as i32 - 3);
            [(k - 1, k - 1, w), (k, k, w), (k - 1, k, -w), (k, k - 1, -w)]
        })
        .collect();
    let graded = matrix(1500, &entries);
    let pairs = solve(&pencil(&graded, &Mass::Identity), &lowest(30), &Unwatched).unwrap();
    for (k, pair) in pairs.values.windows(2).enumerate() {
        let (low, high) = (pair[0], pair[1]);
        if high - low > 1e-3 * high && low > 1e-10 {
            let below =
                eigenvalues_below(&graded, &MassMatrix::Diagonal(vec![1.0; 1500]), 0.5 * (low + high), &Unwatched);
            assert_eq!(below.unwrap(), k + 1, "between {low:e} and {high:e}");
        }
    }
}

#[test]
fn negative_eigenvalues_bounds_and_intervals() {
    // The adjacency matrix of a grid: its spectrum lies around zero.
    let entries: Vec<_> = grid(50, 40, false).into_iter().flat_map(|(a, b)| [(a, b, 1.0), (b, a, 1.0)]).collect();
    let adjacency = matrix(2000, &entries);
    let term = |k: usize, n: usize| 2.0 * (PI * k as f64 / (n + 1) as f64).cos();
    let exact = sorted((1..=50).flat_map(|a| (1..=40).map(move |b| term(a, 50) + term(b, 40))));
    proven(&adjacency, &Mass::Identity, &lowest(30), &exact[..30], 1e-9);
    for (from, to) in [(f64::NEG_INFINITY, -3.7), (-3.8, -3.6), (-3.61, -3.58)] {
        let inside: Vec<f64> = exact.iter().copied().filter(|&value| from <= value && value < to).collect();
        let selection = if from.is_finite() {
            PencilSelection::Between { from, to, most: 200 }
        } else {
            PencilSelection::Below { bound: to, most: 200 }
        };
        let pairs =
            proven(&adjacency, &Mass::Identity, &Parameters { selection, ..Parameters::default() }, &inside, 1e-9);
        assert_eq!(pairs.certificate.first, exact.iter().filter(|&&value| value < from).count());
    }
    let nothing = Parameters { selection: PencilSelection::Below { bound: -4.1, most: 5 }, ..Parameters::default() };
    assert!(solve(&pencil(&adjacency, &Mass::Identity), &nothing, &Unwatched).unwrap().values.is_empty());
    let few = Parameters { selection: PencilSelection::Below { bound: -3.0, most: 5 }, ..Parameters::default() };
    let refused = solve(&pencil(&adjacency, &Mass::Identity), &few, &Unwatched).unwrap_err();
    assert!(matches!(refused, PencilError::Solve(HsimError::Count { most: 5, .. })), "{refused}");
}

#[test]
fn the_nearest_to_a_shift_are_those_of_the_whole_spectrum() {
    // The adjacency matrix of a path, of which no two eigenvalues are equal.
    let n = 900;
    let entries: Vec<_> = path(n).into_iter().flat_map(|(a, b)| [(a, b, 1.0), (b, a, 1.0)]).collect();
    let adjacency = pencil(&matrix(n, &entries), &Mass::Identity);
    let exact = sorted((1..=n).map(|k| 2.0 * (PI * k as f64 / (n + 1) as f64).cos()));
    let around = |shift: f64, count: usize, most: usize| {
        let selection = PencilSelection::Around { shift, count, most };
        solve(&adjacency, &Parameters { selection, ..Parameters::default() }, &Unwatched)
    };
    for (shift, count) in [(-1.99, 7), (-1.2, 1), (-5.0, 2), (5.0, 3), (0.5 * (exact[20] + exact[21]) + 1e-9, 4)] {
        let pairs = around(shift, count, n).unwrap();
        let mut nearest: Vec<usize> = (0..n).collect();
        nearest.sort_by(|&a, &b| (exact[a] - shift).abs().total_cmp(&(exact[b] - shift).abs()));
        let first = *nearest[..count].iter().min().unwrap();
        assert_eq!((pairs.values.len(), pairs.certificate.first), (count, first), "around {shift}");
        for (k, value) in pairs.values.iter().enumerate() {
            let error = (value - exact[first + k]).abs();
            assert!(error <= pairs.certificate.bounds[k] + 1e-14 && error < 1e-9, "around {shift}: {error:e}");
        }
        assert!(pairs.certificate.around.unwrap().ties.is_empty(), "around {shift}");
    }
    let refused = around(-1.0, 7, 100).unwrap_err();
    assert!(matches!(refused, PencilError::Solve(HsimError::Count { most: 100, .. })), "{refused}");
}

#[test]
fn a_shift_on_an_eigenvalue_names_the_copies_that_it_leaves_out() {
    // All eigenvalues of a cycle but two are double.
    let n = 60;
    let cycle: Vec<_> = path(n).into_iter().chain([(n - 1, 0)]).collect();
    let pencil = pencil(&laplacian(n, &cycle), &Mass::Identity);
    let shift = 2.0 - 2.0 * (2.0 * PI * 7.0 / n as f64).cos();
    for (count, tied) in [(1, vec![(13, true), (14, false)]), (2, vec![])] {
        let selection = PencilSelection::Around { shift, count, most: n };
        let pairs = solve(&pencil, &Parameters { selection, ..Parameters::default() }, &Unwatched).unwrap();
        assert!(pairs.values.iter().all(|value| (value - shift).abs() < 1e-12), "{:?}", pairs.values);
        let around = pairs.certificate.around.unwrap();
        let mut found: Vec<_> = around.ties.iter().map(|tie| (tie.index, tie.delivered)).collect();
        // Which of the two is delivered is for rounding to say.
        assert_eq!(found.iter().filter(|tie| tie.1).count(), usize::from(!tied.is_empty()));
        found.iter_mut().enumerate().for_each(|(k, tie)| tie.1 = k == 0);
        assert_eq!(found, tied, "{count} pairs");
    }
}

#[test]
fn a_shift_on_or_beside_an_eigenvalue_of_a_thousand_copies_is_solved_at_once_and_names_them() {
    // Stars of up to fifty leaves: all leaves but one of each star make an eigenvalue 1.
    let sizes: Vec<usize> = (0..40).map(|k| 10 + k).collect();
    let (mut edges, mut n) = (Vec::new(), 0);
    for size in &sizes {
        edges.extend((1..=*size).map(|leaf| (n, n + leaf)));
        n += size + 1;
    }
    let copies: usize = sizes.iter().map(|size| size - 1).sum();
    let pencil = pencil(&laplacian(n, &edges), &Mass::Identity);
    for shift in [1.0, 0.9] {
        let selection = PencilSelection::Around { shift, count: 7, most: sizes.len() + 200 };
        let pairs = solve(&pencil, &Parameters { selection, ..Parameters::default() }, &Unwatched).unwrap();
        assert!(pairs.values.len() == 7 && pairs.values.iter().all(|value| (value - 1.0).abs() < 1e-9));
        let ties = pairs.certificate.around.unwrap().ties;
        assert_eq!(ties.iter().filter(|tie| tie.delivered).count(), 7, "around {shift}");
        assert!((8..=copies).contains(&ties.len()), "around {shift}: {} ties of {copies} copies", ties.len());
    }
}

#[test]
fn fixed_rows_are_taken_out_and_zero_in_the_vectors() {
    let n = 1600;
    let stiffness = laplacian(n + 2, &path(n + 2));
    let exact = sorted((1..=n).map(|k| 2.0 - 2.0 * (PI * k as f64 / (n + 1) as f64).cos()));
    let fixed = [n as u32 + 1, 0];
    let pencil = Pencil::new(stiffness.clone(), Mass::Identity, &fixed, &Unwatched).unwrap();
    assert_eq!((pencil.rows(), pencil.unknowns()), (n + 2, n));
    let pairs = solve(&pencil, &lowest(12), &Unwatched).unwrap();
    for (k, (found, exact)) in pairs.values.iter().zip(&exact).enumerate() {
        assert!((found - exact).abs() < 1e-9 * exact, "{found} is not {exact}");
        let x = pairs.vectors.column(k);
        assert_eq!((x.len(), x[0], x[n + 1]), (n + 2, 0.0, 0.0));
        // What is not fixed is an eigenvector of the rest.
        let sx = stiffness.multiply(x);
        let rest: f64 = (1..=n).map(|row| (sx[row] - found * x[row]).powi(2)).sum();
        let length: f64 = x.iter().map(|x| x * x).sum();
        assert!(rest.sqrt() < 1e-7 && (length - 1.0).abs() < 1e-9, "{k}: {rest:e}, {length}");
    }
    let often = [0, n as u32 + 1].repeat(n);
    assert_eq!(Pencil::new(stiffness.clone(), Mass::Identity, &often, &Unwatched).unwrap().unknowns(), n);
    let all: Vec<u32> = (0..n as u32 + 2).collect();
    assert!(matches!(Pencil::new(stiffness.clone(), Mass::Identity, &all, &Unwatched), Err(PencilError::Empty)));
    let beyond = Pencil::new(stiffness, Mass::Identity, &[9, 5000], &Unwatched).unwrap_err();
    assert_eq!(beyond.to_string(), "fixed row 5000 is out of range (the matrix has 1602 rows)");
}

#[test]
fn what_is_no_pencil_is_refused_by_its_first_entry() {
    let identity = matrix(3, &[(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0)]);
    let refused = |stiffness: &SparseMatrix, mass: Mass| {
        Pencil::new(stiffness.clone(), mass, &[], &Unwatched).unwrap_err().to_string()
    };
    let skew = matrix(3, &[(0, 0, 1.0), (1, 2, 0.5), (2, 1, 0.25)]);
    assert_eq!(refused(&skew, Mass::Identity), "S is not symmetric: S[1, 2] is 0.5, S[2, 1] is 0.25");
    let half = matrix(3, &[(0, 2, 0.5)]);
    assert_eq!(refused(&half, Mass::Identity), "S is not symmetric: S[0, 2] is 0.5, S[2, 0] is 0");
    assert_eq!(refused(&matrix(2, &[(1, 0, f64::NAN)]), Mass::Identity), "S[1, 0] is NaN");
    assert_eq!(refused(&identity, Mass::Diagonal(vec![1.0, 2.0])), "M must be 3 × 3, as S is, got 2 × 2");
    assert_eq!(refused(&identity, Mass::Diagonal(vec![1.0, 0.0, 1.0])), "M is not positive definite: M[1, 1] is 0");
    assert_eq!(refused(&identity, Mass::Diagonal(vec![1.0, f64::INFINITY, 1.0])), "M[1, 1] is inf");
    let rank_one = matrix(3, &(0..9).map(|k| (k / 3, k % 3, 1.0)).collect::<Vec<_>>());
    assert!(refused(&identity, Mass::Sparse(rank_one)).starts_with("M is not positive definite: elimination of row"));
    let indefinite = matrix(3, &[(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (1, 2, 2.0), (2, 1, 2.0)]);
    let message = refused(&identity, Mass::Sparse(indefinite));
    assert!(message.contains("of row 1 ") || message.contains("of row 2 "), "{message}");
    for (indptr, indices, expected) in [
        (vec![0, 1], vec![0], "row offset 0 is out of order"),
        (vec![0, 2, 1], vec![0], "row offset 1 is out of order"),
        (vec![0, 1, 3], vec![0, 1], "row offset 2 is out of order"),
        (vec![0, 1, 2], vec![0, 7], "row 1: column 7 is out of range"),
    ] {
        let values = vec![1.0; indices.len()];
        let message = csr(2, 2, &indptr, &indices, &values).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let few = solve(&pencil(&identity, &Mass::Identity), &lowest(4), &Unwatched).unwrap_err();
    assert_eq!(few.kind(), "invalid-parameters");
}

#[test]
fn clusters_of_copies_are_whole_from_every_random_start() {
    // Twenty equal paths, their rows shuffled: every eigenvalue is there twenty times. scipy.sparse.linalg.eigsh in
    // shift-invert mode returns sets with copies left out as converged, from 9 of 30 random starts at its default
    // tolerance, and from 30 of 30 at 1e-6.
    let (copies, n) = (20, 80);
    let places = SplitMix64::new(3).permutation(copies * n);
    let place = |row: usize| places[row] as usize;
    let edges: Vec<_> = (0..copies)
        .flat_map(|copy| path(n).into_iter().map(move |(a, b)| (copy * n + a, copy * n + b)))
        .map(|(a, b)| (place(a), place(b)))
        .collect();
    // A little stiffness to the ground takes the kernel away, which would be known.
    let ground: Vec<_> = (0..copies * n).map(|row| (row, row, 1e-3)).collect();
    let mut entries = ground;
    for &(a, b) in &edges {
        entries.extend([(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)]);
    }
    let pencil = pencil(&matrix(copies * n, &entries), &Mass::Identity);
    let exact: Vec<f64> = (0..60).map(|k| 1e-3 + 2.0 - 2.0 * (PI * (k / copies) as f64 / n as f64).cos()).collect();
    let cut = solve(&pencil, &lowest(50), &Unwatched).unwrap().certificate.cut;
    assert_eq!(cut, Some(CutCluster { first: 40, end: 60 }));
    for seed in 0..100 {
        let pairs = solve(&pencil, &Parameters { seed, ..lowest(60) }, &Unwatched).unwrap();
        for (k, (found, exact)) in pairs.values.iter().zip(&exact).enumerate() {
            assert!((found - exact).abs() < 1e-12, "{seed}: value {k} is {found}, not {exact}");
        }
    }
}
