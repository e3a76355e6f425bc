use super::leaf::minimum_degree;
use super::refine::{Cut, SEPARATOR};
use super::{Clusters, Graph, Spare, nested_dissection, separator};
use crate::{Ordering, SparseMatrix, fill_reducing_order};

/// The symmetric pattern with a diagonal and the given edges.
fn pattern(n: usize, edges: impl IntoIterator<Item = (usize, usize)>) -> SparseMatrix {
    let mut rows: Vec<Vec<u32>> = (0..n as u32).map(|row| vec![row]).collect();
    for (a, b) in edges {
        rows[a].push(b as u32);
        rows[b].push(a as u32);
    }
    let (mut offsets, mut columns) = (vec![0], Vec::new());
    for mut row in rows {
        row.sort_unstable();
        row.dedup();
        columns.extend(row);
        offsets.push(columns.len());
    }
    let values = vec![1.0; columns.len()];
    SparseMatrix::new(n, n, offsets, columns, values).unwrap()
}

/// A grid of squares with one diagonal each, as a triangulated plate has.
fn plate(width: usize, height: usize) -> SparseMatrix {
    let at = move |x: usize, y: usize| y * width + x;
    let edges = (0..height).flat_map(move |y| {
        (0..width).flat_map(move |x| {
            let right = (x + 1 < width).then(|| (at(x, y), at(x + 1, y)));
            let up = (y + 1 < height).then(|| (at(x, y), at(x, y + 1)));
            let across = (x + 1 < width && y + 1 < height).then(|| (at(x, y), at(x + 1, y + 1)));
            [right, up, across].into_iter().flatten()
        })
    });
    pattern(width * height, edges)
}

/// The entries of the factor, by the definition: each row joins its later neighbours.
fn fill(matrix: &SparseMatrix, order: &[u32]) -> usize {
    let n = order.len();
    let mut place = vec![0; n];
    order.iter().enumerate().for_each(|(at, &row)| place[row as usize] = at);
    let mut later: Vec<std::collections::BTreeSet<usize>> = order
        .iter()
        .enumerate()
        .map(|(at, &row)| matrix.row(row as usize).0.iter().map(|&u| place[u as usize]).filter(|&u| u > at).collect())
        .collect();
    let mut entries = n;
    for at in 0..n {
        let own = std::mem::take(&mut later[at]);
        entries += own.len();
        if let Some(&parent) = own.first() {
            later[parent].extend(own.iter().filter(|&&u| u > parent));
        }
    }
    entries
}

fn separated(graph: &Graph) -> Cut {
    separator::separator(graph, &Clusters::of(graph), &Spare::default())
}

fn is_an_order(order: &[u32], n: usize) -> bool {
    let mut sorted = order.to_vec();
    sorted.sort_unstable();
    sorted.into_iter().eq(0..n as u32)
}

/// Graphs of all sorts, with their names.
fn graphs() -> Vec<(&'static str, SparseMatrix)> {
    let mut random = chladni_base::SplitMix64::new(7);
    let mut any = |n: usize| (random.unit() * n as f64) as usize % n;
    let sparse: Vec<_> = (0..6_000).map(|_| (any(3_000), any(3_000))).collect();
    vec![
        ("one row", pattern(1, [])),
        ("rows without neighbours", pattern(5_000, [])),
        ("a path", pattern(5_000, (1..5_000).map(|i| (i - 1, i)))),
        ("a star", pattern(5_000, (1..5_000).map(|i| (0, i)))),
        ("complete", pattern(400, (0..400).flat_map(|i| (0..i).map(move |j| (i, j))))),
        ("complete in two parts", pattern(600, (0..300).flat_map(|i| (0..300).map(move |j| (i, 300 + j))))),
        ("many paths", pattern(6_000, (1..6_000).filter(|i| i % 30 != 0).map(|i| (i - 1, i)))),
        ("at random", pattern(3_000, sparse)),
        ("a plate", plate(70, 60)),
        ("a strip", plate(2_000, 3)),
        ("a plate with a hub", pattern(4_001, (0..4_000).map(|i| (i, 4_000)).chain((1..4_000).map(|i| (i - 1, i))))),
        // Its groups are one of four thousand rows and four thousand of one.
        (
            "a clique at the end of a path",
            pattern(1_400, (0..400).flat_map(|i| (0..i).map(move |j| (i, j))).chain((400..1_400).map(|i| (i - 1, i)))),
        ),
    ]
}

#[test]
fn every_row_comes_once_whatever_the_graph() {
    for (name, matrix) in graphs() {
        assert!(is_an_order(&nested_dissection(&matrix), matrix.rows()), "{name}");
    }
}

#[test]
fn nothing_joins_the_sides_of_a_separator() {
    for (name, matrix) in graphs() {
        let graph = Graph::of(&matrix);
        let cut = separated(&graph);
        let mut weights = [0; 3];
        for v in 0..graph.len() {
            weights[cut.side[v] as usize] += 1;
            for &u in graph.neighbours(v as u32) {
                let sides = [cut.side[v], cut.side[u as usize]];
                assert!(sides[0] == sides[1] || sides.contains(&SEPARATOR), "{name}: {v} and {u}");
            }
        }
        assert_eq!(weights, cut.weights, "{name}");
        assert!(weights[0].max(weights[1]) <= graph.len() as u64 * 7 / 10 + 1, "{name}: {weights:?}");
    }
}

#[test]
fn a_plate_is_cut_across_and_a_path_by_one_row() {
    let cut = separated(&Graph::of(&plate(120, 30)));
    assert!(cut.weights[2] <= 31, "{:?}", cut.weights);
    let cut = separated(&Graph::of(&pattern(3_000, (1..3_000).map(|i| (i - 1, i)))));
    assert!(cut.weights[2] <= 1, "{:?}", cut.weights);
}

#[test]
fn the_order_is_the_same_on_any_number_of_threads() {
    for matrix in [plate(220, 200), pattern(70_000, (1..70_000).map(|i| (i - 1, i)))] {
        let orders = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| nested_dissection(&matrix))
        });
        assert!(orders[0] == orders[1] && orders[0] == orders[2]);
    }
}

/// An independent construction: approximate minimum degree by faer, and the order as it is given.
#[test]
fn large_plates_fill_in_less_than_by_minimum_degree_and_trees_not_at_all() {
    let matrix = plate(150, 140);
    let [dissected, by_degree] = [Ordering::NestedDissection, Ordering::Amd]
        .map(|ordering| fill(&matrix, &fill_reducing_order(&matrix, ordering).unwrap()));
    assert!(dissected < by_degree, "{dissected} and {by_degree} entries");
    // 7.75 n log₂ n is what the dissection of squares by lines along them takes, in the leading term.
    let n = matrix.rows() as f64;
    assert!((dissected as f64) < 7.75 * n * n.log2() / 2.0, "{dissected} entries");
    let tree = pattern(4_000, (1..4_000).map(|i| ((i - 1) / 3, i)));
    let order = nested_dissection(&tree);
    assert!(fill(&tree, &order) < 2 * 4_000 + 400, "{} entries", fill(&tree, &order));
}

#[test]
fn rows_of_equal_neighbours_stay_together() {
    let single = plate(40, 30);
    let n = single.rows();
    let edges = (0..n).flat_map(|row| {
        let own = single.row(row).0.iter().map(move |&column| (row, column as usize));
        own.flat_map(|(a, b)| (0..9).map(move |k| (3 * a + k % 3, 3 * b + k / 3)))
    });
    let triple = pattern(3 * n, edges.filter(|(a, b)| a != b));
    let order = nested_dissection(&triple);
    assert!(is_an_order(&order, 3 * n));
    for rows in order.chunks(3) {
        assert!(rows.iter().all(|row| row / 3 == rows[0] / 3), "{rows:?}");
    }
}

#[test]
fn the_row_of_fewest_neighbours_is_eliminated_first() {
    // A path of five with a row outside beside one end: ends first, and what is beside the outside counts it.
    let neighbours: [&[u32]; 5] = [&[1], &[0, 2], &[1, 3], &[2, 4], &[3, 5]];
    assert_eq!(minimum_degree(5, 1, |row| neighbours[row]), [0, 1, 2, 3, 4]);
    // At random, against elimination by sets.
    let mut random = chladni_base::SplitMix64::new(3);
    let (n, halo) = (90, 40);
    let mut rows = vec![std::collections::BTreeSet::new(); n];
    for _ in 0..260 {
        let [a, b] = [n, n + halo].map(|below| (random.unit() * below as f64) as usize);
        if a != b {
            rows[a].insert(b as u32);
            if b < n {
                rows[b].insert(a as u32);
            }
        }
    }
    let lists: Vec<Vec<u32>> = rows.iter().map(|row| row.iter().copied().collect()).collect();
    let order = minimum_degree(n, halo, |row| &lists[row]);
    let mut left: Vec<usize> = (0..n).collect();
    for &next in &order {
        let least = left.iter().map(|&row| rows[row].len()).min().unwrap();
        assert_eq!(rows[next as usize].len(), least, "row {next}");
        left.retain(|&row| row != next as usize);
        let own = std::mem::take(&mut rows[next as usize]);
        for &row in own.iter().filter(|&&row| (row as usize) < n) {
            rows[row as usize].extend(own.iter().copied().filter(|&other| other != row));
            rows[row as usize].remove(&next);
        }
    }
}
