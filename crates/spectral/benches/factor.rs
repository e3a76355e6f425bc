//! Sparse factors of the shifted pencil of a surface of genus 3: `cargo bench --bench factor`. Milliseconds of the
//! order, of the analysis of the structure, of a factor in the memory of the last one, and of a count that keeps none,
//! over vertices and threads; the least of some runs each.
//!
//! `CHLADNI_FACTOR_VERTICES` (5000,20000,130000,540000), `CHLADNI_FACTOR_THREADS` (1,2).

use std::time::Instant;

use chladni_algebra::{Ordering, SymbolicFactor, fill_reducing_order};
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::operator::{MassKind, laplace};

/// What the server allocates with.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    let list = |name: &str, usual: &str| -> Vec<usize> {
        let text = std::env::var(name).unwrap_or(usual.to_owned());
        text.split(',').map(|number| number.parse().expect("a number")).collect()
    };
    println!(
        "| vertices | entries of L | threads | order | analysis | factor | count |\n|---|---|---|---|---|---|---|"
    );
    for vertices in list("CHLADNI_FACTOR_VERTICES", "5000,20000,130000,540000") {
        let mesh = generate(Shape::Genus(3), vertices).unwrap();
        let problem = laplace::assemble(&mesh, MassKind::Barycentric).unwrap();
        // A shift with some eigenvalues below, relative to the largest sum of magnitudes over the mass.
        let largest = (0..problem.size()).map(|row| problem.stiffness.row(row).1.iter().map(|k| k.abs()).sum::<f64>());
        let largest = largest.zip(problem.mass.lumped()).map(|(sum, mass)| sum / mass).fold(0.0, f64::max);
        let shift = 1e-4 * largest;
        for threads in list("CHLADNI_FACTOR_THREADS", "1,2") {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let begun = Instant::now();
                let order = fill_reducing_order(&problem.stiffness, Ordering::NestedDissection).unwrap();
                let ordered_in = begun.elapsed().as_secs_f64();
                let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
                let analysed_in = least(|| drop(SymbolicFactor::new(&stiffness, &mass).unwrap()));
                let symbolic = SymbolicFactor::new(&stiffness, &mass).unwrap();
                let mut storage = symbolic.factor(&stiffness, &mass, shift).unwrap().into_storage();
                let factored_in = least(|| {
                    let factor = symbolic.factor_in(&stiffness, &mass, shift, std::mem::take(&mut storage));
                    storage = factor.unwrap().into_storage();
                });
                let counted_in = least(|| assert!(symbolic.count(&stiffness, &mass, shift).is_ok()));
                let times = [ordered_in, analysed_in, factored_in, counted_in].map(|time| format!("{:.1}", 1e3 * time));
                println!("| {} | {} | {threads} | {} |", problem.size(), symbolic.entries(), times.join(" | "));
            });
        }
    }
}

fn least(mut work: impl FnMut()) -> f64 {
    (0..5).fold(f64::INFINITY, |least, _| {
        let begun = Instant::now();
        work();
        least.min(begun.elapsed().as_secs_f64())
    })
}
