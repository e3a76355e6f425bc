//! Orders of elimination: how long they take to find, and how much the factors fill in by them, as a share of the
//! entries by minimum degree; and how long the symbolic part and a factor take then.
//!
//! `CHLADNI_MESHES=FOLDER CHLADNI_ORDERED=armadillo.obj,igea.ply RAYON_NUM_THREADS=1 cargo bench --bench
//! ordering`; `CHLADNI_SUBDIVIDED=2` divides each mesh so many times, and `CHLADNI_BY_DEGREE=0` leaves minimum degree
//! out.

use std::time::Instant;

use chladni_algebra::{Ordering, SymbolicFactor, fill_reducing_order};
use chladni_mesh::subdivide::subdivided;
use chladni_spectral::{Mesh, Unwatched, operator};

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let folder = std::path::PathBuf::from(setting("CHLADNI_MESHES", "."));
    let subdivisions: usize = setting("CHLADNI_SUBDIVIDED", "0").parse().expect("a number of divisions");
    let orders = match setting("CHLADNI_BY_DEGREE", "1").as_str() {
        "0" => vec![Ordering::NestedDissection],
        _ => vec![Ordering::Amd, Ordering::NestedDissection],
    };
    println!(
        "| mesh | rows | order | seconds | entries | share | symbolic | factor |\n|---|---|---|---|---|---|---|---|"
    );
    for name in
        setting("CHLADNI_ORDERED", "fertility.off,rocker-arm.off,armadillo.obj,nefertiti.obj,igea.ply").split(',')
    {
        let mut mesh = Mesh::read(folder.join(name)).expect("a mesh").surface().clone();
        for _ in 0..subdivisions {
            mesh = subdivided(&mesh).expect("a mesh that can be divided");
        }
        let problem = operator::assemble(&mesh, &Default::default(), &Unwatched).expect("a Laplacian").problem;
        let mut by_degree = None;
        for &ordering in &orders {
            let started = Instant::now();
            let order = fill_reducing_order(&problem.stiffness, ordering).expect("an order");
            let seconds = started.elapsed().as_secs_f64();
            let (stiffness, mass) = (problem.stiffness.reordered(&order), problem.mass.reordered(&order));
            let started = Instant::now();
            let factor = SymbolicFactor::new(&stiffness, &mass).expect("a symbolic part");
            let symbolic = started.elapsed().as_secs_f64();
            let started = Instant::now();
            factor.factor(&stiffness, &mass, -1.0).expect("a factor");
            let numeric = started.elapsed().as_secs_f64();
            let entries = factor.entries();
            let share = entries as f64 / *by_degree.get_or_insert(entries) as f64;
            println!(
                "| {name} | {} | {ordering:?} | {seconds:.3} | {entries} | {share:.3} | {symbolic:.3} | {numeric:.3} |",
                order.len()
            );
        }
    }
}
