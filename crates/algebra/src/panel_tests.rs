//! Matrices in panels, and products with them, against dense ones.

use chladni_base::SplitMix64;
use chladni_base::{Cancelled, Monitor, Unwatched};

use crate::{
    DenseMatrix, MassMatrix, PANEL_WIDTH, PanelMatrix, SparseMatrix, Weight, gram, inner_products, mass_times_panel,
    prolong, residual_panel, residual_sums, restrict, rotate, subtract_combinations,
};

fn random(rows: usize, columns: usize, seed: u64) -> DenseMatrix {
    let mut random = SplitMix64::new(seed);
    DenseMatrix::from_columns(rows, columns, (0..rows * columns).map(|_| random.signed_unit()).collect())
}

/// Symmetric, at most seven entries a row.
fn banded(n: usize, diagonal: f64) -> SparseMatrix {
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..n {
        for column in (0..n).filter(|&column| [0, 1, 7, 40].contains(&row.abs_diff(column))) {
            indices.push(column as u32);
            values.push(if row == column { diagonal } else { 1.0 / (1 + row + column) as f64 });
        }
        offsets.push(indices.len());
    }
    SparseMatrix::new(n, n, offsets, indices, values).unwrap()
}

fn times(matrix: &SparseMatrix, x: &DenseMatrix) -> DenseMatrix {
    let mut y = DenseMatrix::zeros(matrix.rows(), x.columns());
    for column in 0..x.columns() {
        for row in 0..matrix.rows() {
            let (columns, values) = matrix.row(row);
            y.column_mut(column)[row] =
                columns.iter().zip(values).map(|(&c, v)| v * x.column(column)[c as usize]).sum();
        }
    }
    y
}

fn mass_times(mass: &MassMatrix, x: &DenseMatrix) -> DenseMatrix {
    let values = (0..x.columns()).flat_map(|column| mass.multiply(x.column(column))).collect();
    DenseMatrix::from_columns(x.rows(), x.columns(), values)
}

fn to_dense(panels: &PanelMatrix) -> DenseMatrix {
    let values = (0..panels.columns()).flat_map(|column| panels.column(column)).collect();
    DenseMatrix::from_columns(panels.rows(), panels.columns(), values)
}

fn close(a: &DenseMatrix, b: &DenseMatrix, what: &str) {
    assert_eq!((a.rows(), a.columns()), (b.rows(), b.columns()), "{what}");
    let scale = b.values().iter().fold(1.0, |most: f64, value| most.max(value.abs()));
    for (k, (x, y)) in a.values().iter().zip(b.values()).enumerate() {
        assert!((x - y).abs() <= 1e-12 * scale, "{what}: entry {k} is {x}, not {y}");
    }
}

/// What the type promises: right lengths, and zeros where there is no column.
fn well_formed(panels: &PanelMatrix, what: &str) {
    assert_eq!(panels.panels().len(), panels.columns().div_ceil(PANEL_WIDTH), "{what}");
    for (k, panel) in panels.panels().iter().enumerate() {
        assert_eq!(panel.len(), panels.rows() * PANEL_WIDTH, "{what}");
        let used = (panels.columns() - k * PANEL_WIDTH).min(PANEL_WIDTH);
        assert!(panel.chunks(PANEL_WIDTH).all(|row| row[used..].iter().all(|&x| x == 0.0)), "{what}: panel {k}");
    }
}

const SIZES: [(usize, usize); 12] = [
    (1, 1),
    (2, 32),
    (3, 5),
    (31, 33),
    (255, 31),
    (256, 32),
    (257, 33),
    (513, 100),
    (1000, 1),
    (1000, 100),
    (300, 200),
    (17_000, 33),
];

fn masses(n: usize) -> [MassMatrix; 2] {
    [MassMatrix::Diagonal((0..n).map(|row| 1.0 + (row % 5) as f64).collect()), MassMatrix::Sparse(banded_within(n))]
}

/// The band without its far entries, for sizes at which looking for them takes long.
fn banded_within(n: usize) -> SparseMatrix {
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for row in 0..n {
        for column in row.saturating_sub(2)..(row + 3).min(n) {
            indices.push(column as u32);
            values.push(if row == column { 4.0 } else { 1.0 / (2 + row % 3 + column % 3) as f64 });
        }
        offsets.push(indices.len());
    }
    SparseMatrix::new(n, n, offsets, indices, values).unwrap()
}

fn stiffness(n: usize) -> SparseMatrix {
    if n > 2000 { banded_within(n) } else { banded(n, -2.0) }
}

#[test]
fn panels_hold_what_they_were_given() {
    for (rows, columns) in [(0, 3), (1, 1), (5, 31), (5, 32), (7, 33), (3, 100), (4, 0)] {
        let matrix = random(rows, columns, 1);
        let panels = PanelMatrix::from_dense(&matrix);
        well_formed(&panels, "from_dense");
        assert_eq!(to_dense(&panels), matrix);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            assert_eq!(panels.get(row, column), matrix.column(column)[row]);
        }
    }
}

#[test]
fn columns_are_selected_and_assigned_in_any_order() {
    let matrix = random(6, 100, 2);
    let panels = PanelMatrix::from_dense(&matrix);
    let mut shuffled: Vec<usize> = SplitMix64::new(3).permutation(100).into_iter().map(|k| k as usize).collect();
    shuffled.truncate(70);
    let choices: [Vec<usize>; 6] =
        [vec![], vec![99], vec![5, 5, 4], (0..100).rev().collect(), (20..53).collect(), shuffled];
    for chosen in choices {
        let selected = panels.select(&chosen);
        well_formed(&selected, "select");
        for (k, &column) in chosen.iter().enumerate() {
            assert_eq!(selected.column(k), matrix.column(column), "{chosen:?}");
        }
        let mut back = PanelMatrix::zeros(6, 100);
        back.assign(&chosen, &selected);
        well_formed(&back, "assign");
        for column in 0..100 {
            let expected = if chosen.contains(&column) { matrix.column(column).to_vec() } else { vec![0.0; 6] };
            assert_eq!(back.column(column), expected, "{chosen:?}, column {column}");
        }
    }
}

#[test]
fn widening_adds_zeros_and_keeping_drops_the_rest() {
    let matrix = random(5, 40, 4);
    let mut panels = PanelMatrix::from_dense(&matrix);
    panels.widen(30);
    assert_eq!(panels.columns(), 40);
    for columns in [41, 64, 65, 130] {
        panels.widen(columns);
        well_formed(&panels, "widen");
        assert_eq!(panels.columns(), columns);
        assert!((0..40).all(|column| panels.column(column) == matrix.column(column)));
        assert!((40..columns).all(|column| panels.column(column).iter().all(|&x| x == 0.0)));
    }
    for columns in [200, 130, 40, 33, 32, 7, 0] {
        panels.keep_columns(columns);
        well_formed(&panels, "keep_columns");
        assert_eq!(panels.columns(), columns.min(130));
        assert!((0..columns.min(40)).all(|column| panels.column(column) == matrix.column(column)));
    }
    // What was dropped does not come back.
    let mut panels = PanelMatrix::from_dense(&matrix);
    panels.keep_columns(3);
    panels.widen(20);
    assert!((3..20).all(|column| panels.column(column).iter().all(|&x| x == 0.0)));
}

#[test]
fn rows_are_spread_to_their_places_times_a_factor_for_each_column() {
    let matrix = random(3, 35, 5);
    let factors: Vec<f64> = (0..35).map(|k| k as f64 - 3.0).collect();
    let places = [4, 0, 2];
    let spread = PanelMatrix::from_dense(&matrix).spread(6, &places, &factors);
    well_formed(&spread, "spread");
    assert_eq!((spread.rows(), spread.columns()), (6, 35));
    for column in 0..35 {
        let mut expected = vec![0.0; 6];
        for (row, &place) in places.iter().enumerate() {
            expected[place as usize] = matrix.column(column)[row] * factors[column];
        }
        assert_eq!(spread.column(column), expected);
    }
}

#[test]
fn products_agree_with_dense_ones() {
    for (n, q) in SIZES {
        let x = random(n, q, 6);
        let panels = PanelMatrix::from_dense(&x);
        let a = stiffness(n);
        let ax = times(&a, &x);
        for mass in masses(n) {
            let what = format!("n = {n}, q = {q}");
            let mx = mass_times(&mass, &x);
            let (restricted, grams) = restrict(&a, &mass, &panels, &Unwatched).unwrap();
            close(&restricted, &x.transposed_times(&ax), &what);
            close(&grams, &x.transposed_times(&mx), &what);
            close(&gram(&mass, &panels, &Unwatched).unwrap(), &grams, &what);
            let other = random(n, 37, 7);
            let products = inner_products(&panels, Weight::Mass(&mass), &PanelMatrix::from_dense(&other), &Unwatched);
            close(&products.unwrap(), &mx.transposed_times(&other), &what);
            let products = inner_products(&panels, Weight::Stiffness(&a), &PanelMatrix::from_dense(&other), &Unwatched);
            close(&products.unwrap(), &ax.transposed_times(&other), &what);
            let mut images = PanelMatrix::zeros(n, q);
            images.panels_mut().iter_mut().zip(panels.panels()).for_each(|(y, x)| mass_times_panel(&mass, x, y));
            well_formed(&images, &what);
            close(&to_dense(&images), &mx, &what);
        }
    }
}

#[test]
fn rotations_and_combinations_agree_with_dense_ones() {
    for (n, q) in SIZES {
        let what = format!("n = {n}, q = {q}");
        let x = random(n, q, 8);
        for p in [1, q / 2 + 1, q] {
            let z = random(q, p, 9);
            let mut panels = PanelMatrix::from_dense(&x);
            rotate(&mut panels, &z, &Unwatched).unwrap();
            well_formed(&panels, &what);
            close(&to_dense(&panels), &x.times(&z), &what);

            let y = random(n, p, 10);
            let mut rest = PanelMatrix::from_dense(&y);
            subtract_combinations(&mut rest, &PanelMatrix::from_dense(&x), &z, &Unwatched).unwrap();
            well_formed(&rest, &what);
            let mut expected = x.times(&z);
            expected.values_mut().iter_mut().zip(y.values()).for_each(|(xz, y)| *xz = y - *xz);
            close(&to_dense(&rest), &expected, &what);
        }
    }
}

#[test]
fn sizes_that_do_not_fit_are_a_mistake_of_the_caller() {
    let panics = |run: &dyn Fn()| std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).is_err();
    let x = PanelMatrix::from_dense(&random(10, 5, 11));
    for (rows, columns) in [(4, 3), (6, 6), (5, 6)] {
        let z = random(rows, columns, 12);
        assert!(panics(&|| rotate(&mut x.clone(), &z, &Unwatched).unwrap()), "{rows} × {columns}");
    }
    let y = PanelMatrix::from_dense(&random(10, 3, 13));
    for (rows, columns) in [(4, 3), (5, 2), (3, 5)] {
        let c = random(rows, columns, 14);
        assert!(panics(&|| subtract_combinations(&mut y.clone(), &x, &c, &Unwatched).unwrap()), "{rows} × {columns}");
    }
    let short = PanelMatrix::from_dense(&random(9, 3, 15));
    let mass = &masses(10)[0];
    assert!(panics(&|| drop(inner_products(&x, Weight::Mass(mass), &short, &Unwatched))));
    assert!(panics(&|| drop(gram(mass, &short, &Unwatched))));
}

#[test]
fn residuals_agree_with_dense_ones() {
    for (n, q) in SIZES {
        let x = random(n, q, 15);
        let panels = PanelMatrix::from_dense(&x);
        let values: Vec<f64> = (0..q).map(|k| k as f64 * 0.7 - 2.0).collect();
        let a = stiffness(n);
        let ax = times(&a, &x);
        for mass in masses(n) {
            let (mx, lumped) = (mass_times(&mass, &x), mass.lumped());
            let sums = residual_sums(&a, &mass, &panels, &values, &Unwatched).unwrap();
            assert_eq!(sums.len(), q);
            for k in 0..q {
                let residual: Vec<f64> =
                    ax.column(k).iter().zip(mx.column(k)).map(|(ax, mx)| ax - values[k] * mx).collect();
                let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
                let dual: f64 = residual.iter().zip(&lumped).map(|(r, m)| r * r / m).sum();
                let product: f64 = x.column(k).iter().zip(mx.column(k)).map(|(x, mx)| x * mx).sum();
                let highest = x.column(k).iter().fold(0.0, |most: f64, &x| most.max(x));
                let lowest = x.column(k).iter().fold(0.0, |least: f64, &x| least.min(x));
                for (got, expected) in [
                    (sums[k].residual, square(&residual)),
                    (sums[k].dual, dual),
                    (sums[k].product, residual.iter().zip(x.column(k)).map(|(r, x)| r * x).sum()),
                    (sums[k].stiffness, square(ax.column(k))),
                    (sums[k].square, square(x.column(k))),
                    (sums[k].mass, product),
                    (sums[k].highest, highest),
                    (sums[k].lowest, lowest),
                ] {
                    assert!(
                        (got - expected).abs() <= 1e-11 * expected.abs().max(0.01 * n as f64),
                        "n = {n}, column {k} of {q}"
                    );
                }
                let mut panel = vec![0.0; n * PANEL_WIDTH];
                let first = k / PANEL_WIDTH * PANEL_WIDTH;
                if k == first {
                    let values = &values[first..(first + PANEL_WIDTH).min(q)];
                    residual_panel(&a, &mass, &panels.panels()[k / PANEL_WIDTH], values, &mut panel);
                    for (row, expected) in residual.iter().enumerate() {
                        assert!(
                            (panel[row * PANEL_WIDTH] - expected).abs() < 1e-11 * (1.0 + expected.abs()) * q as f64
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn columns_are_prolonged() {
    for (n, q) in [(1, 1), (300, 33), (5000, 70)] {
        let d = n / 2 + 1;
        let x = random(d, q, 16);
        let indices: Vec<u32> = (0..n).map(|row| (row * 7 % d) as u32).collect();
        let weights: Vec<f32> = (0..n).map(|row| 0.25 * (row % 9) as f32).collect();
        let space = SparseMatrix::new(n, d, (0..=n).collect(), indices.clone(), weights.clone()).unwrap();
        let y = prolong(&space, &PanelMatrix::from_dense(&x));
        well_formed(&y, "prolong");
        for column in 0..q {
            let expected: Vec<f64> =
                (0..n).map(|row| f64::from(weights[row]) * x.column(column)[indices[row] as usize]).collect();
            assert_eq!(y.column(column), expected, "n = {n}");
        }
    }
}

#[test]
fn products_do_not_depend_on_the_number_of_threads() {
    let (n, q) = (17_000, 100);
    let x = PanelMatrix::from_dense(&random(n, q, 17));
    let y = PanelMatrix::from_dense(&random(n, 40, 18));
    let (a, [mass, _], z) = (stiffness(n), masses(n), random(q, q, 19));
    let answer = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let restricted = restrict(&a, &mass, &x, &Unwatched).unwrap();
            let products = inner_products(&x, Weight::Stiffness(&a), &y, &Unwatched).unwrap();
            let sums = residual_sums(&a, &mass, &x, &vec![1.5; q], &Unwatched).unwrap();
            let (mut rotated, mut rest) = (x.clone(), y.clone());
            rotate(&mut rotated, &z, &Unwatched).unwrap();
            subtract_combinations(&mut rest, &x, &products, &Unwatched).unwrap();
            (restricted, products, sums, rotated, rest)
        })
    };
    let one = answer(1);
    for threads in [2, 3] {
        assert!(one == answer(threads), "{threads} threads");
    }
}

#[test]
fn products_stop_when_they_are_told_to() {
    struct Stopped;
    impl Monitor for Stopped {
        fn stage(&self, _: &'static str) {}
        fn progress(&self, _: f64) {}
        fn checkpoint(&self) -> Result<(), Cancelled> {
            Err(Cancelled)
        }
    }
    let mut x = PanelMatrix::from_dense(&random(20, 5, 20));
    let (a, [mass, _]) = (stiffness(20), masses(20));
    assert!(restrict(&a, &mass, &x, &Stopped).is_err());
    assert!(gram(&mass, &x, &Stopped).is_err());
    assert!(inner_products(&x, Weight::Mass(&mass), &x, &Stopped).is_err());
    assert!(residual_sums(&a, &mass, &x, &[1.0; 5], &Stopped).is_err());
    assert!(subtract_combinations(&mut x.clone(), &x, &random(5, 5, 21), &Stopped).is_err());
    assert!(rotate(&mut x, &random(5, 5, 21), &Stopped).is_err());
}

#[test]
fn columns_are_inserted_before_others() {
    for (rows, columns, more, at) in [(3, 40, 2, 1), (700, 64, 33, 64), (257, 31, 1, 0), (5, 0, 3, 0)] {
        let value = |row: usize, column: usize| (1000 * row + column) as f64;
        let filled = |columns: usize, from: usize| {
            let mut x = PanelMatrix::zeros(rows, columns);
            for row in 0..rows {
                for column in 0..columns {
                    x.panels_mut()[column / PANEL_WIDTH][row * PANEL_WIDTH + column % PANEL_WIDTH] =
                        value(row, from + column);
                }
            }
            x
        };
        let (mut x, new) = (filled(columns, 0), filled(more, 500));
        x.insert(at, &new);
        let order = (0..at).chain(500..500 + more).chain(at..columns);
        assert_eq!(x.columns(), columns + more);
        for (place, number) in order.enumerate() {
            assert!((0..rows).all(|row| x.get(row, place) == value(row, number)), "column {place} of {columns}");
        }
        // Unused columns stay zero.
        let used = x.columns() % PANEL_WIDTH;
        let last = x.panels().last().unwrap();
        assert!(used == 0 || last.chunks(PANEL_WIDTH).all(|row| row[used..].iter().all(|&value| value == 0.0)));
    }
}
