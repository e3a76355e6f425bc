//! Designs refined to the whole surface by cycles, as on surfaces that are too large for factors:
//! `cargo bench --bench refined`. Default weights, strokes spread over a surface. Of each mesh and tolerance the
//! responses that were computed, seconds, processor seconds of all threads, and how far the reduced design is off; and
//! how far the field is from one of a hundredth of the tolerance, as a share of its length.
//!
//! `CHLADNI_MESHES` is the folder, `CHLADNI_REFINED_MESHES` names (igea.ply), `CHLADNI_SUBDIVIDED` how often surfaces
//! are subdivided (0), `CHLADNI_REFINED_KIND` (vector,cross), `CHLADNI_REFINED_DIMENSION` (1000),
//! `CHLADNI_REFINED_STROKES` (16), `CHLADNI_REFINED_EXACT` (constraints are met exactly), `CHLADNI_REFINED_TOLERANCES`
//! (2e-3,1e-8), `CHLADNI_REFINED_CHECKED` (fields are compared with closer ones).

use std::path::Path;
use std::time::Instant;

use chladni_base::Unwatched;
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
    let set = |name: &str| std::env::var_os(name).is_some();
    let folder = setting("CHLADNI_MESHES", "meshes");
    let dimension = setting("CHLADNI_REFINED_DIMENSION", "1000").parse().expect("a dimension");
    let strokes: usize = setting("CHLADNI_REFINED_STROKES", "16").parse().expect("a number of strokes");
    let hold = if set("CHLADNI_REFINED_EXACT") { Hold::Exact } else { Hold::Strength(1.0) };
    let times: usize = setting("CHLADNI_SUBDIVIDED", "0").parse().expect("a number");
    println!(
        "| mesh | faces | field | tolerance | responses | s | processor, s | distance | off |\n|---|---|---|---|---|---|---|---|---|"
    );
    for name in setting("CHLADNI_REFINED_MESHES", "igea.ply").split(',') {
        let bytes = std::fs::read(Path::new(&folder).join(name)).expect("a mesh of that name");
        let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap_or(name)).expect("a format");
        let mesh = check(read(&bytes, format, &Default::default()).unwrap(), &Default::default()).unwrap().mesh;
        let mesh = (0..times).fold(mesh, |mesh, _| subdivided(&mesh).expect("a surface that can be divided"));
        let surface = FieldSurface::new(mesh).unwrap();
        let faces = surface.faces();
        for field in setting("CHLADNI_REFINED_KIND", "vector,cross").split(',') {
            let kind = if field == "vector" { FieldKind::Vector {} } else { FieldKind::NVector { n: 4 } };
            let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
            let model = DesignModel::new(&basis, &Unwatched).unwrap();
            let full = FullSpace::within(&surface, kind, FieldBoundary::default(), 0, &Unwatched).unwrap();
            let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
            let one = |i: usize| Constraint {
                face: ((i * faces) / strokes.max(1) + i * i % 7) as u32,
                value: [(1.3 * i as f64).cos(), (0.7 * i as f64).sin(), 0.0],
                hold,
            };
            let constraints: Vec<Constraint> = (0..strokes).map(one).collect();
            let design = weighted.solve(&basis, &constraints).unwrap();
            let refine =
                |tolerance| full.refine(&weighted, &basis, &constraints, &design, tolerance, &Unwatched).unwrap();
            // Fields without energy are looked for by the first of all.
            refine(0.05);
            for tolerance in setting("CHLADNI_REFINED_TOLERANCES", "2e-3,1e-8").split(',') {
                let tolerance: f64 = tolerance.parse().expect("a tolerance");
                let (begun, before) = (Instant::now(), processor_s());
                let found = refine(tolerance);
                let (wall, processor) = (begun.elapsed().as_secs_f64(), processor_s() - before);
                let off = if set("CHLADNI_REFINED_CHECKED") {
                    let close = refine((0.01 * tolerance).max(1e-10)).field;
                    let (mut apart, mut own) = (0.0, 0.0);
                    for (i, (a, b)) in found.field.iter().zip(&close).enumerate() {
                        let area = surface.frames().areas()[i / 2];
                        apart += area * (a - b).powi(2);
                        own += area * b * b;
                    }
                    format!("{:.1e}", f64::sqrt(apart / own))
                } else {
                    String::new()
                };
                println!(
                    "| {name} | {faces} | {field} | {tolerance:e} | {} | {wall:.2} | {processor:.2} | {:.3e} | {off} |",
                    found.responses, found.distance
                );
            }
        }
    }
}

/// Seconds that all threads have worked, as far as the system tells.
fn processor_s() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of = |path: std::path::PathBuf| {
        let told = std::fs::read_to_string(path.join("schedstat")).ok()?;
        told.split_whitespace().next()?.parse::<f64>().ok()
    };
    threads.flatten().filter_map(|thread| of(thread.path())).sum::<f64>() / 1e9
}
