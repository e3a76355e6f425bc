//! Pencils with values far from all others: dense rows, wells, terms of low rank and penalties.

use super::*;

/// The lowest eigenvalues by bisection, of a function that counts those below a number.
fn bisected(count: usize, (least, most): (f64, f64), below: impl Fn(f64) -> usize) -> Vec<f64> {
    let value = |k: usize| {
        let (mut from, mut to) = (least, most);
        loop {
            let middle = 0.5 * (from + to);
            if !(middle > from && middle < to) {
                return middle;
            }
            if below(middle) > k { to = middle } else { from = middle }
        }
    };
    (0..count).map(value).collect()
}

/// One value far below the rest, which a dense row makes, or several at very different depths: a shift between them and
/// the rest is near nothing.
#[test]
fn values_far_below_all_others_do_not_keep_those_from_converging() {
    let mut random = SplitMix64::new(11);
    for (n, tip) in [(1500, 0.0), (3000, -1e4)] {
        let diagonal: Vec<f64> = (0..n).map(|_| (0..6).map(|_| random.signed_unit()).sum()).collect();
        let border: Vec<f64> = (0..n).map(|_| random.signed_unit()).collect();
        let mut entries: Vec<_> =
            (0..n).flat_map(|k| [(k, n, border[k]), (n, k, border[k]), (k, k, diagonal[k])]).collect();
        entries.push((n, n, tip));
        let below = |at: f64| {
            let rest = tip - at - (0..n).map(|k| border[k] * border[k] / (diagonal[k] - at)).sum::<f64>();
            diagonal.iter().filter(|&&value| value < at).count() + usize::from(rest < 0.0)
        };
        let exact = bisected(60, (-2e4, 2e4), below);
        for count in [10, 33, 60] {
            proven(&matrix(n + 1, &entries), &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
        }
    }
    let n = 2500;
    for outliers in [&[-1e3, -1e2, -10.0][..], &[-1e6; 3], &[-3.0, -2.0, -1.0]] {
        let mut diagonal: Vec<f64> = (0..n).map(|_| random.unit()).collect();
        outliers.iter().enumerate().for_each(|(k, &value)| diagonal[700 * k] = value);
        let coupled = (1..n).flat_map(|k| [(k - 1, k, 1e-3), (k, k - 1, 1e-3)]);
        let entries: Vec<_> = (0..n).map(|k| (k, k, diagonal[k])).chain(coupled).collect();
        let below = |at: f64| {
            let mut pivot = f64::INFINITY;
            let mut negative = |&value: &f64| {
                pivot = value - at - 1e-6 / pivot;
                pivot < 0.0
            };
            diagonal.iter().filter(|value| negative(value)).count()
        };
        let exact = bisected(60, (-2e6, 2e6), below);
        for count in [10, 33, 60] {
            proven(&matrix(n, &entries), &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
        }
    }
}

/// Deep wells, and terms of low rank: as many values far below all others as among them, or more, whatever their own
/// spread is.
#[test]
fn as_many_values_far_below_all_others_as_are_wanted_among_them_are_no_obstacle() {
    let n = 1600;
    let mut random = SplitMix64::new(77);
    for (wells, depth) in [(1, 1e4), (5, 1e2), (5, 1e8), (20, 1e2), (20, 1e3), (20, 1e6), (60, 1e4)] {
        let mut diagonal = vec![2.0; n];
        (0..wells).for_each(|k| diagonal[(2 * k + 1) * n / (2 * wells)] -= depth * (0.5 + 0.5 * random.unit()));
        let coupled = (1..n).flat_map(|k| [(k - 1, k, -1.0), (k, k - 1, -1.0)]);
        let entries: Vec<_> = (0..n).map(|k| (k, k, diagonal[k])).chain(coupled).collect();
        let below = |at: f64| {
            let mut pivot = f64::INFINITY;
            let mut negative = |&value: &f64| {
                pivot = value - at - 1.0 / pivot;
                pivot < 0.0
            };
            diagonal.iter().filter(|value| negative(value)).count()
        };
        let exact = bisected(140, (-2.0 * depth, 4.0), below);
        for count in [wells, wells + 1, wells + 7, 2 * wells + 10, 100] {
            proven(&matrix(n, &entries), &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
            if depth > 1e4 {
                continue;
            }
            let bound = 0.5 * (exact[count - 1] + exact[count]);
            if exact[count] - exact[count - 1] > 1e-6 {
                let below =
                    Parameters { selection: PencilSelection::Below { bound, most: 200 }, ..Parameters::default() };
                proven(&matrix(n, &entries), &Mass::Identity, &below, &exact[..count], 1e-11);
            }
            // The same beside a constant that leaves no value below zero.
            let positive: Vec<_> =
                entries.iter().map(|&(a, b, v)| (a, b, if a == b { v + 1.1 * depth } else { v })).collect();
            let above: Vec<f64> = exact[..count].iter().map(|value| value + 1.1 * depth).collect();
            proven(&matrix(n, &positive), &Mass::Identity, &lowest(count), &above, 1e-6);
        }
    }
    let n = 900;
    for (columns, size) in [(5, 10.0f64), (20, 1e3)] {
        let plain = laplacian(n, &grid(30, 30, false));
        let mut entries: Vec<_> = (0..n)
            .flat_map(|row| {
                let (columns, values) = plain.row(row);
                columns.iter().zip(values).map(move |(&c, &v)| (row, c as usize, v)).collect::<Vec<_>>()
            })
            .collect();
        for _ in 0..columns {
            let some: Vec<(usize, f64)> =
                (0..30).map(|_| ((random.unit() * n as f64) as usize, size.sqrt() * random.signed_unit())).collect();
            entries.extend(some.iter().flat_map(|a| some.iter().map(move |b| (a.0, b.0, -a.1 * b.1))));
        }
        let stiffness = matrix(n, &entries);
        let exact = dense(&stiffness, &Mass::Identity);
        for count in [columns, columns + 1, columns + 4, 2 * columns + 4, 60] {
            proven(&stiffness, &Mass::Identity, &lowest(count), &exact[..count], 1e-11);
        }
    }
}

/// Unknowns that are fixed by a penalty, as is common, are those of a smaller problem up to its inverse, and what is
/// wanted is as exact as without it.
#[test]
fn penalties_on_some_unknowns_cost_no_digits_of_the_others() {
    let n = 40 * 30;
    let plain = laplacian(n, &grid(40, 30, false));
    let entries = |at: f64| {
        let of_row = |row: usize| {
            let (columns, values) = plain.row(row);
            columns.iter().zip(values).map(move |(&c, &v)| (row, c as usize, v)).collect::<Vec<_>>()
        };
        (0..n).flat_map(of_row).chain((0..10).map(|k| (117 * k + 5, 117 * k + 5, at))).collect::<Vec<_>>()
    };
    let free: Vec<usize> = (0..n).filter(|row| row % 117 != 5 || row / 117 >= 10).collect();
    let place = |row: usize| free.binary_search(&row).ok();
    let kept: Vec<_> =
        entries(0.0).into_iter().filter_map(|(a, b, value)| Some((place(a)?, place(b)?, value))).collect();
    let exact = dense(&matrix(free.len(), &kept), &Mass::Identity);
    for penalty in [1e8, 1e10, 1e12] {
        for count in [10, 50, 100] {
            // What the penalty leaves of the fixed unknowns moves values by its inverse.
            let parameters = lowest(count);
            let pairs =
                solve(&pencil(&matrix(n, &entries(penalty)), &Mass::Identity), &parameters, &Unwatched).unwrap();
            for (found, exact) in pairs.values.iter().zip(&exact) {
                assert!(
                    (found - exact).abs() <= 1e-9 + 20.0 / penalty + 1e-16 * penalty,
                    "{penalty:e}, {count}: {found}, not {exact}"
                );
            }
        }
    }
}
