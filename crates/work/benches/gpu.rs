//! The dense symmetric-definite eigenproblem on a graphics card, beside the CPU of the same machine and, where a Python
//! with torch or CuPy is there, cuSOLVER; then a whole approximation of a large mesh:
//!
//! ```sh
//! cargo bench --bench gpu                              # the first card, d = 1000, 2000, 5000, 10000, the lowest half;
//!                                                      # then 5,000 pairs of a million vertices
//! cargo bench --bench gpu -- --card llvmpipe 300 600   # another card, other sizes, no mesh
//! cargo bench --bench gpu -- --job 20000 100 300       # another mesh and other sizes
//! cargo bench --bench gpu -- --all --no-cpu 5000       # all pairs; the CPU is not measured
//! ```
//!
//! `CHLADNI_PYTHON` names the Python; `CHLADNI_THREADS` the threads of the CPU. The first solve on a card is not
//! measured: it compiles kernels.

use std::process::Command;
use std::time::Instant;

use chladni_algebra::gpu::{Accelerator, GpuChoice, adapters, choose};
use chladni_algebra::{ComputedOn, CpuSolver, DenseMatrix, EigenPairs, SymmetricDefiniteSolver};
use chladni_base::{StageClock, Unwatched};
use chladni_mesh::shape::{Shape, generate};
use chladni_work::JobParameters;
use serde_json::json;

struct Options {
    card: Option<String>,
    all: bool,
    cpu: bool,
    sizes: Vec<usize>,
    /// Vertices and pairs.
    job: Option<(usize, usize)>,
}

fn options() -> Options {
    let mut options = Options { card: None, all: false, cpu: true, sizes: Vec::new(), job: None };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            // Cargo says so to every benchmark.
            "--bench" => {}
            "--card" => options.card = arguments.next(),
            "--all" => options.all = true,
            "--no-cpu" => options.cpu = false,
            "--job" => {
                let mut number =
                    || arguments.next().and_then(|number| number.parse().ok()).expect("--job VERTICES PAIRS");
                options.job = Some((number(), number()));
            }
            size => options.sizes.push(size.parse().unwrap_or_else(|_| panic!("{size} is no size"))),
        }
    }
    if options.sizes.is_empty() {
        options.sizes = vec![1000, 2000, 5000, 10_000];
        options.job.get_or_insert((1_000_000, 5000));
    }
    options
}

fn main() {
    let options = options();
    if let Some(threads) = std::env::var("CHLADNI_THREADS").ok().and_then(|threads| threads.parse().ok()) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().unwrap();
    }
    for (place, adapter) in adapters().iter().enumerate() {
        let kind = if adapter.software { "software" } else { "hardware" };
        let f64 = if adapter.f64 { "f64" } else { "f32 only" };
        println!("card {place}: {} ({}, {kind}, {f64}, {})", adapter.name, adapter.backend, adapter.driver);
    }
    let hardware = adapters().iter().position(|adapter| !adapter.software).map(GpuChoice::Index);
    let choice = match &options.card {
        Some(card) => Some(card.parse().unwrap()),
        None => hardware,
    };
    let card = choice.map(|choice| {
        let began = Instant::now();
        let card = choose(choice);
        card.open();
        match card.reason() {
            Some(reason) => println!("no card: {reason}"),
            None => println!("opened and tested in {:.2} s", began.elapsed().as_secs_f64()),
        }
        card
    });
    let card = card.filter(|card| Accelerator::available(card));
    println!("CPU threads: {}", rayon::current_num_threads());
    if let Some(card) = &card {
        let (a, b) = pencil(300);
        card.lowest(a, b, 150, &Unwatched).unwrap();
    }
    println!(
        "{:>6} {:>6} {:>10} {:>10} {:>10} {:>10}  seconds; residual on the card",
        "d", "pairs", "card", "CPU", "cuSOLVER", "residual"
    );
    for &d in &options.sizes {
        let count = if options.all { d } else { d / 2 };
        let (mut on_card, mut residual, mut on_cpu) = ("-".to_owned(), "-".to_owned(), "-".to_owned());
        let (a, b) = pencil(d);
        if let Some(card) = &card {
            let clock = StageClock::new(&Unwatched);
            let (pairs, seconds) = timed(|| card.lowest(a.clone(), b.clone(), count, &clock).unwrap());
            on_card = format!("{seconds:.2}");
            residual = format!("{:.1e}", largest_residual(&a, &b, &pairs));
            if !matches!(pairs.computed_on, ComputedOn::Gpu { .. }) {
                println!("{:?}", pairs.computed_on);
            }
        }
        if options.cpu {
            let (_, seconds) = timed(|| CpuSolver.lowest(a, b, count, &Unwatched).unwrap());
            on_cpu = format!("{seconds:.2}");
        }
        let cusolver = cusolver(d);
        println!("{d:>6} {count:>6} {on_card:>10} {on_cpu:>10} {cusolver:>10} {residual:>10}");
    }
    if let Some((vertices, pairs)) = options.job {
        // Few pairs are all measuring, many are all dense problem.
        approximate(vertices, pairs / 10);
        approximate(vertices, pairs);
    }
}

/// A whole approximation, in twice as many dimensions as pairs: its seconds, by stage, and what solved its dense
/// problem and measured its pairs.
fn approximate(vertices: usize, pairs: usize) {
    let mesh = generate(Shape::Genus(3), vertices).unwrap();
    let job = JobParameters::parse("eigenbasis", &json!({"count": pairs})).unwrap();
    let (outcome, seconds) = timed(|| job.run(&mesh, &Unwatched).unwrap());
    let stages: Vec<String> = outcome.seconds.iter().map(|(stage, seconds)| format!("{stage} {seconds:.2}")).collect();
    let details = outcome.product.summary().unwrap().details;
    let by = |name: &str| match &details[name] {
        serde_json::Value::Null => "the CPU".to_owned(),
        notes => notes.to_string(),
    };
    println!(
        "{pairs} pairs of {} vertices: {seconds:.2} seconds ({}), solved by {}, measured by {}",
        mesh.positions.len(),
        stages.join(", "),
        by("dense_solver"),
        by("measured_on")
    );
}

fn timed<T>(action: impl FnOnce() -> T) -> (T, f64) {
    let began = Instant::now();
    let value = action();
    (value, began.elapsed().as_secs_f64())
}

/// A symmetric matrix of random numbers, and a mass matrix like that of overlapping functions.
fn pencil(d: usize) -> (DenseMatrix, DenseMatrix) {
    let mut state = d as u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let (mut a, mut b) = (DenseMatrix::zeros(d, d), DenseMatrix::zeros(d, d));
    for column in 0..d {
        for row in column..d {
            a.column_mut(column)[row] = random();
            b.column_mut(column)[row] = if row == column { 1.0 } else { 0.3 * random() / (row - column).pow(2) as f64 };
        }
    }
    (a, b)
}

/// The largest `‖A x − λ B x‖ / (max|λ| ‖B x‖)` of a few pairs.
fn largest_residual(a: &DenseMatrix, b: &DenseMatrix, pairs: &EigenPairs) -> f64 {
    let times = |matrix: &DenseMatrix, x: &[f64]| {
        let mut y = vec![0.0; x.len()];
        for column in 0..x.len() {
            for row in column..x.len() {
                let value = matrix.column(column)[row];
                y[row] += value * x[column];
                if row > column {
                    y[column] += value * x[row];
                }
            }
        }
        y
    };
    let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let largest = pairs.values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    let count = pairs.values.len();
    [0, count / 3, count / 2, count - 1]
        .into_iter()
        .map(|k| {
            let x = pairs.vectors.column(k);
            let (ax, bx) = (times(a, x), times(b, x));
            let difference: Vec<f64> = ax.iter().zip(&bx).map(|(ax, bx)| ax - pairs.values[k] * bx).collect();
            norm(&difference) / (largest * norm(&bx))
        })
        .fold(0.0, f64::max)
}

/// The seconds that cuSOLVER takes for all pairs, by torch or CuPy.
fn cusolver(d: usize) -> String {
    let python = std::env::var("CHLADNI_PYTHON").unwrap_or_else(|_| "python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/gpu_cusolver.py");
    match Command::new(python).arg(script).arg(d.to_string()).output() {
        Ok(output) if output.status.success() => String::from_utf8_lossy(&output.stdout).trim().to_owned(),
        _ => "-".to_owned(),
    }
}
