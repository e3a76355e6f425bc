use super::super::{MassMatrix, Ordering, SymbolicFactor};
use super::tests::*;

struct Clock;
impl Clock {
    fn now(&self) -> f64 {
        std::fs::read_dir("/proc/self/task")
            .unwrap()
            .map(|task| {
                let text = std::fs::read_to_string(task.unwrap().path().join("schedstat")).unwrap_or_default();
                text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0)
            })
            .sum::<f64>()
            / 1e6
    }
}

fn span(chain: &super::Chain, plan: &super::Plan, symbolic: &SymbolicFactor, threads: f64) -> (f64, f64) {
    let of = |piece: usize| {
        plan.pieces[piece].clone().map(|at| super::plan::own_work(&symbolic.nodes[at]) as f64).sum::<f64>()
    };
    let (mut work, mut longest) = (0.0, 0f64);
    for below in &chain.below {
        let (w, s) = span(below, plan, symbolic, threads);
        work += w;
        longest = longest.max(s);
    }
    for task in &chain.tasks {
        let w: f64 = task.pieces.iter().map(|&piece| of(piece)).sum();
        work += w;
        longest = longest.max(w);
    }
    longest = longest.max(work / threads);
    for &(at, piece) in &chain.nodes {
        let w = of(piece);
        let node = &symbolic.nodes[at];
        let rows = node.columns + node.pattern.1;
        // The diagonal blocks and the assembly of a front are one after the other.
        let serial = if node.columns * rows * rows >= super::SHARED_WORK {
            (128.0 * 128.0 * node.columns as f64).min(w)
        } else {
            w
        };
        work += w;
        longest += serial + (w - serial) / threads;
    }
    (work, longest)
}

#[test]
#[ignore]
fn timing() {
    let pools = [1, 2].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    for width in [30, 70, 141, 367, 733] {
        let matrix = ordered(&triangles(width, width, 1), Ordering::NestedDissection);
        let n = matrix.rows();
        let mass = MassMatrix::Diagonal(vec![1.0; n]);
        let start = std::time::Instant::now();
        let mut symbolic = SymbolicFactor::new(&matrix, &mass).unwrap();
        eprintln!("n {n}: symbolic {:?}", start.elapsed());
        let start = std::time::Instant::now();
        let plan = super::Plan::new(&symbolic.nodes, &symbolic.patterns).unwrap();
        eprintln!(
            "plan {:?} pieces {} held {} of {}, nodes {}",
            start.elapsed(),
            plan.pieces.len(),
            plan.held,
            symbolic.entries(),
            symbolic.nodes.len()
        );
        let flops: f64 = symbolic
            .nodes
            .iter()
            .map(|node| {
                let (c, m) = (node.columns as f64, node.pattern.1 as f64);
                c * c * c / 3.0 + c * c * m + c * m * m
            })
            .sum();
        let mut hist = [[0.0f64; 3]; 12];
        for node in &symbolic.nodes {
            let b = (node.columns as f64).log2() as usize;
            let (c, m) = (node.columns as f64, node.pattern.1 as f64);
            hist[b][0] += 1.0;
            hist[b][1] += (c * c * c / 3.0 + c * c * m + c * m * m) / flops;
            hist[b][2] += m;
        }
        eprintln!("Gflop {}", flops / 1e9);
        for (b, h) in hist.iter().enumerate() {
            if h[0] > 0.0 {
                eprintln!("  columns >= {}: {} nodes, share {:.3}, mean below {:.1}", 1 << b, h[0], h[1], h[2] / h[0]);
            }
        }
        let mut storage = vec![0.0; symbolic.entries()];
        let repeat = if width < 50 {
            400
        } else if width < 200 {
            40
        } else {
            3
        };
        for threads in [1, 2, 4, 8, 16, 32] {
            let (work, span) = span(&plan.root, &plan, &symbolic, threads as f64);
            eprintln!(
                "  {threads} threads: work {:.3} Gunits, span {:.3}, speedup {:.2}",
                work / 1e9,
                span / 1e9,
                work / span.max(work / threads as f64)
            );
        }
        for round in 0..3 {
            symbolic.plan = None;
            let start = Clock;
            let cpu0 = start.now();
            for _ in 0..repeat {
                let factor = symbolic.factor_in(&matrix, &mass, 0.3, storage).unwrap();
                storage = factor.into_storage();
            }
            let faer = (start.now() - cpu0) / repeat as f64;
            symbolic.plan = Some(super::Plan::new(&symbolic.nodes, &symbolic.patterns).unwrap());
            let mut times = Vec::new();
            for pool in &pools {
                let cpu0 = Clock.now();
                for _ in 0..repeat {
                    let factor = pool.install(|| symbolic.factor_in(&matrix, &mass, 0.3, storage)).unwrap();
                    storage = factor.into_storage();
                }
                times.push((Clock.now() - cpu0) / repeat as f64);
            }
            let cpu0 = Clock.now();
            pools[0].install(|| {
                for _ in 0..repeat {
                    symbolic.count(&matrix, &mass, 0.3).unwrap();
                }
            });
            times.push((Clock.now() - cpu0) / repeat as f64);
            eprintln!("  round {round}: faer {faer:.2} ms, fronts on 1 and 2 threads {times:.2?}");
        }
    }
}
