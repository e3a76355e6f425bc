//! Factors by fronts against faer's left-looking ones, and against themselves on other numbers of threads.

use chladni_base::SplitMix64;

use super::super::factor::tests::{grid, sparse};
use super::super::{MassMatrix, Ordering, PANEL_WIDTH, SparseMatrix, SymbolicFactor, fill_reducing_order};

/// The Laplacian of a triangulated rectangle with random weights.
fn triangles(width: usize, height: usize, seed: u64) -> SparseMatrix {
    let mut random = SplitMix64::new(seed);
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); width * height];
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            for (right, down) in [(1, 0), (0, 1), (1, 1)] {
                if x + right < width && y + down < height {
                    let to = at + down * width + right;
                    let weight = 1.0 + 0.7 * random.signed_unit();
                    for (a, b) in [(at, to), (to, at)] {
                        rows[a].push((b as u32, -weight));
                    }
                }
            }
        }
    }
    let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for (at, mut row) in rows.into_iter().enumerate() {
        row.push((at as u32, -row.iter().map(|entry| entry.1).sum::<f64>()));
        row.sort_by_key(|entry| entry.0);
        indices.extend(row.iter().map(|entry| entry.0));
        values.extend(row.iter().map(|entry| entry.1));
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(width * height, width * height, offsets, indices, values)
}

fn ordered(matrix: &SparseMatrix, ordering: Ordering) -> SparseMatrix {
    matrix.reordered(&fill_reducing_order(matrix, ordering).unwrap())
}

#[test]
#[ignore]
fn timing() {
    for width in [70, 141, 367, 733] {
        let matrix = ordered(&triangles(width, width, 1), Ordering::NestedDissection);
        let n = matrix.rows();
        let mass = MassMatrix::Diagonal(vec![1.0; n]);
        let start = std::time::Instant::now();
        let mut symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
        eprintln!("n {n}: symbolic {:?}", start.elapsed());
        let start = std::time::Instant::now();
        let plan = super::Plan::new(&symbolic.nodes, &symbolic.patterns).unwrap();
        eprintln!("plan {:?} pieces {} held {} of {}, nodes {}", start.elapsed(), plan.pieces.len(), plan.held, symbolic.entries(), symbolic.nodes.len());
        let flops: f64 = symbolic.nodes.iter().map(|node| { let (c, m) = (node.columns as f64, node.pattern.1 as f64); c*c*c/3.0 + c*c*m + c*m*m }).sum();
        let mut hist = [[0.0f64; 3]; 12];
        for node in &symbolic.nodes {
            let b = (node.columns as f64).log2() as usize;
            let (c, m) = (node.columns as f64, node.pattern.1 as f64);
            hist[b][0] += 1.0; hist[b][1] += (c*c*c/3.0 + c*c*m + c*m*m) / flops; hist[b][2] += m;
        }
        eprintln!("Gflop {}", flops / 1e9);
        for (b, h) in hist.iter().enumerate() { if h[0] > 0.0 { eprintln!("  columns >= {}: {} nodes, share {:.3}, mean below {:.1}", 1 << b, h[0], h[1], h[2] / h[0]); } }
        let mut storage = vec![0.0; symbolic.entries()];
        let repeat = if width < 200 { 40 } else { 3 };
        for round in 0..3 {
            symbolic.plan = None;
            let start = std::time::Instant::now();
            for _ in 0..repeat {
                let factor = symbolic.factor_in(&matrix, &mass, 0.3, storage).unwrap();
                storage = factor.into_storage();
            }
            let faer = start.elapsed() / repeat;
            symbolic.plan = Some(super::Plan::new(&symbolic.nodes, &symbolic.patterns).unwrap());
            let mut times = Vec::new();
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let start = std::time::Instant::now();
                for _ in 0..repeat {
                    let factor = pool.install(|| symbolic.factor_in(&matrix, &mass, 0.3, storage)).unwrap();
                    storage = factor.into_storage();
                }
                times.push(start.elapsed() / repeat);
            }
            eprintln!("  round {round}: faer {faer:?}, fronts on 1 and 2 threads {times:?}");
        }
    }
}
