//! Designs of a large surface by cycles, as `refine` asks for them: `cargo bench --bench refine`. 4-fields, default weights, strokes at random of strength
//! 1, of which one moves from design to design. For each tolerance the responses of the surface that were computed, and seconds and processor seconds of
//! a design (the least and the most of them) beside the reduced one.
//!
//! `CHLADNI_MESHES` is the folder, `CHLADNI_REFINE_MESH` the name (igea.ply), `CHLADNI_SUBDIVIDED` (1) how often it is subdivided,
//! `CHLADNI_REFINE_DIMENSION` (2000), `CHLADNI_REFINE_STROKES` (10), `CHLADNI_REFINE_DESIGNS` (3).

use std::time::Instant;

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};
use chladni_mesh::subdivide::subdivided;
use chladni_spectral::field::{
    Constraint, DesignModel, EnergyWeights, FieldParameters, FieldSurface, FullSpace, Hold, field_basis,
};
use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::transport::FieldKind;

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let number = |name: &str, usual: &str| setting(name, usual).parse::<usize>().expect("a number");
    let name = setting("CHLADNI_REFINE_MESH", "igea.ply");
    let bytes = std::fs::read(std::path::Path::new(&setting("CHLADNI_MESHES", "meshes")).join(&name)).expect("a mesh");
    let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap_or(&name)).expect("a format");
    let mesh = check(read(&bytes, format, &Default::default()).unwrap(), &Default::default()).unwrap().mesh;
    let times = number("CHLADNI_SUBDIVIDED", "1");
    let mesh = (0..times).fold(mesh, |mesh, _| subdivided(&mesh).expect("a surface that can be divided"));
    let (surface, kind) = (FieldSurface::new(mesh).unwrap(), FieldKind::NVector { n: 4 });
    let dimension = number("CHLADNI_REFINE_DIMENSION", "2000");
    let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
    let model = DesignModel::new(&basis, &Unwatched).unwrap();
    let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
    let begun = (Instant::now(), processor_seconds());
    let full = FullSpace::within(&surface, kind, FieldBoundary::default(), 0, &Unwatched).unwrap();
    let levels = (begun.0.elapsed().as_secs_f64(), processor_seconds() - begun.1);
    println!(
        "{name}, {} faces; levels {:.1} s, {:.1} processor seconds, {:.0} MB",
        surface.faces(),
        levels.0,
        levels.1,
        1e-6 * full.bytes() as f64
    );
    println!("| tolerance | off | responses | seconds | processor seconds |\n|---|---|---|---|---|");
    for tolerance in [2e-3, 1e-5, 1e-8] {
        let mut random = SplitMix64::new(7);
        let mut strokes: Vec<Constraint> = (0..number("CHLADNI_REFINE_STROKES", "10"))
            .map(|_| {
                let angle = random.signed_unit() * std::f64::consts::PI;
                let face = random.below(surface.faces()) as u32;
                Constraint { face, value: [angle.cos(), angle.sin(), 0.0], hold: Hold::Strength(1.0) }
            })
            .collect();
        let (mut seconds, mut processor, mut off, mut responses) = (Vec::new(), Vec::new(), 0.0f64, 0);
        // The first of all finds the fields without energy.
        for _ in 0..=number("CHLADNI_REFINE_DESIGNS", "3") {
            strokes[0].face = (strokes[0].face + 3) % surface.faces() as u32;
            let begun = (Instant::now(), processor_seconds());
            let design = weighted.solve(&basis, &strokes).unwrap();
            let found = full.refine(&weighted, &basis, &strokes, &design, tolerance, &Unwatched).unwrap();
            seconds.push(begun.0.elapsed().as_secs_f64());
            processor.push(processor_seconds() - begun.1);
            (off, responses) = (off.max(found.distance), responses.max(found.responses));
        }
        let range = |all: &[f64]| {
            let (low, high) = all[1..].iter().fold((f64::INFINITY, 0.0f64), |(l, h), &x| (l.min(x), h.max(x)));
            format!("{low:.2} to {high:.2}")
        };
        println!("| {tolerance:e} | {off:.3} | {responses} | {} | {} |", range(&seconds), range(&processor));
    }
}

/// Seconds that all threads have worked, as far as the system tells.
fn processor_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of = |path: std::path::PathBuf| {
        let told = std::fs::read_to_string(path.join("schedstat")).ok()?;
        told.split_whitespace().next()?.parse::<f64>().ok()
    };
    threads.flatten().filter_map(|thread| of(thread.path())).sum::<f64>() / 1e9
}
