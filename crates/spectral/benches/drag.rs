//! A stroke of sixty faces is dragged beside others that stay: `cargo bench --bench drag`. Milliseconds of a frame, the
//! solution alone: the first, the second, and the median, the 95th percentile, the least and the mean processor time of
//! those after, over the number of constrained faces; on a sphere of 82,000 faces, vector fields.
//!
//! `CHLADNI_DRAG_DIMENSION` (2000), `CHLADNI_DRAG_FACES` (60,240,600,1200,2000), `CHLADNI_DRAG_MOVING` (60),
//! `CHLADNI_DRAG_EXACT` (constraints are met exactly), `CHLADNI_DRAG_SPARSE` (a sparse factor takes the place of Ritz
//! coordinates, as it does beyond 8,192 dimensions), `CHLADNI_DRAG_KIND` `cross` (4-fields), `CHLADNI_DRAG_FRAMES`
//! (40).

use std::time::Instant;

use chladni_base::Unwatched;
use chladni_mesh::shape::{Shape, generate, noisy};
use chladni_spectral::field::{
    Constraint, DesignModel, EnergyWeights, FieldParameters, FieldSurface, Hold, MOST_DIMENSIONS, field_basis,
};
use chladni_spectral::operator::transport::FieldKind;

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let dimension = setting("CHLADNI_DRAG_DIMENSION", "2000").parse().expect("a dimension");
    let counts = setting("CHLADNI_DRAG_FACES", "60,240,600,1200,2000");
    let mesh = noisy(&generate(Shape::Sphere, 41_000).unwrap(), 0.2, 0).unwrap();
    let surface = FieldSurface::new(mesh).unwrap();
    let kind = match setting("CHLADNI_DRAG_KIND", "vector").as_str() {
        "cross" => FieldKind::NVector { n: 4 },
        _ => FieldKind::Vector {},
    };
    let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
    let set = |name: &str| std::env::var_os(name).is_some();
    let frames: usize = setting("CHLADNI_DRAG_FRAMES", "40").parse().expect("a number of frames");
    let moving = setting("CHLADNI_DRAG_MOVING", "60").parse().expect("a number of faces");
    let hold = if set("CHLADNI_DRAG_EXACT") { Hold::Exact } else { Hold::Strength(1.0) };
    let model = match set("CHLADNI_DRAG_SPARSE") || basis.space.dimension() > MOST_DIMENSIONS {
        true => DesignModel::sparse(&basis),
        false => DesignModel::new(&basis, &Unwatched).unwrap(),
    };
    println!("| faces | first | second | median | p95 | least | processor |\n|---|---|---|---|---|---|---|");
    for count in counts.split(',').map(|count| count.parse::<usize>().expect("a number of faces")) {
        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
        let mut constraints: Vec<Constraint> = (0..count)
            .map(|k| Constraint {
                face: (k * surface.faces() / count) as u32,
                value: [(k as f64).cos(), (k as f64).sin(), 0.0],
                hold,
            })
            .collect();
        let mut times = Vec::with_capacity(frames);
        let mut processor = 0.0;
        for frame in 0..frames {
            if frame == 2 {
                processor = processor_ms();
            }
            let begun = Instant::now();
            weighted.solve(&basis, &constraints).unwrap();
            times.push(1e3 * begun.elapsed().as_secs_f64());
            constraints.iter_mut().take(moving).for_each(|c| c.face = (c.face + 3) % surface.faces() as u32);
        }
        let (first, second) = (times[0], times[1]);
        let processor = (processor_ms() - processor) / (frames - 2) as f64;
        times.drain(..2);
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
        println!(
            "| {count} | {first:.0} | {second:.0} | {:.1} | {:.1} | {:.1} | {processor:.1} |",
            at(0.5),
            at(0.95),
            times[0]
        );
    }
}

/// Milliseconds that all threads have worked, as far as the system tells.
fn processor_ms() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of = |path: std::path::PathBuf| {
        let told = std::fs::read_to_string(path.join("schedstat")).ok()?;
        told.split_whitespace().next()?.parse::<f64>().ok()
    };
    threads.flatten().filter_map(|thread| of(thread.path())).sum::<f64>() / 1e6
}
