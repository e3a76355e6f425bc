//! Random solves of the exact methods on small hard meshes, judged against dense solves: `cargo bench --bench
//! campaign_exact -- --solves 1000 --seed 1 [--multiple] [--verbose] [--record FOLDER]`; `--multiple` draws problems
//! whose eigenvalues are multiple, and counts that cut them. Fails where an answer that is called complete is not.
//! `benches/judge.py` judges records by SciPy.

mod exact_cases;

use std::process::ExitCode;

use exact_cases::{Campaign, Family};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |name: &str, usual: u64| {
        let at = arguments.iter().position(|argument| argument == name);
        at.and_then(|at| arguments.get(at + 1)?.parse().ok()).unwrap_or(usual)
    };
    let (solves, seed) = (number("--solves", 400) as usize, number("--seed", 1));
    let verbose = arguments.iter().any(|argument| argument == "--verbose");
    let at = arguments.iter().position(|argument| argument == "--record");
    let record = at.and_then(|at| arguments.get(at + 1)).map(std::path::Path::new);
    let started = std::time::Instant::now();
    let multiple = arguments.iter().any(|argument| argument == "--multiple");
    let family = if multiple { Family::Multiple } else { Family::Hard };
    let campaign = Campaign { family, solves, first: seed, verbose, record };
    let summary = exact_cases::run(&campaign, |line| println!("{line}"));
    println!("\n{} solves from seed {seed} in {:.0} s", summary.solves, started.elapsed().as_secs_f64());
    println!("{:>8} complete", summary.complete);
    println!("{:>8} of them false", summary.false_complete);
    println!("{:>8} of them with a value outside its bound", summary.missed);
    for (kind, count) in &summary.failures {
        println!("{count:>8} {kind}");
    }
    if summary.false_complete + summary.missed > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
