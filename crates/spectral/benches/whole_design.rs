//! Designs among all fields of a surface by sparse factors, beside those in the default space:
//! `cargo bench --bench whole_design`. 4-fields, default weights, random exact constraints. Of each mesh how far the
//! reduced designs are off as shares of length (median and worst of the sets), and milliseconds of a design of the
//! whole surface: the first, which factors, and the median and the 95th percentile where one constraint of eight moves
//! from frame to frame, with coefficients of the space and without. Then what all that takes in megabytes, and of two
//! factors in bytes for each face, number of a block squared and halving of the surface.
//!
//! `CHLADNI_MESHES` is the folder, `CHLADNI_WHOLE_MESHES` names
//! (homer-remeshed-4531.off,cheburashka.obj,armadillo.obj), `CHLADNI_WHOLE_KIND` `vector` in place of 4-fields,
//! `CHLADNI_WHOLE_DIMENSION` (1000), `CHLADNI_SUBDIVIDED` how often surfaces are subdivided.

use std::time::Instant;

use chladni_base::{SplitMix64, Unwatched};
use chladni_mesh::check::check;
use chladni_mesh::read::{MeshFormat, read};
use chladni_mesh::shape::{Shape, generate};
use chladni_mesh::subdivide::subdivided;
use chladni_spectral::field::{
    Constraint, DesignModel, EnergyWeights, FieldParameters, FieldSurface, FullSpace, Hold, field_basis,
};
use chladni_spectral::operator::hodge::FieldBoundary;
use chladni_spectral::operator::transport::FieldKind;

const SETS: u64 = 12;
const FRAMES: usize = 60;

fn main() {
    let setting = |name: &str, usual: &str| std::env::var(name).unwrap_or(usual.to_owned());
    let folder = setting("CHLADNI_MESHES", "meshes");
    let names = setting("CHLADNI_WHOLE_MESHES", "plate,homer-remeshed-4531.off,cheburashka.obj,armadillo.obj");
    let kind = match setting("CHLADNI_WHOLE_KIND", "cross").as_str() {
        "vector" => FieldKind::Vector {},
        _ => FieldKind::NVector { n: 4 },
    };
    println!(
        "| mesh | faces | off, 2 constraints | off, 8 | analysis, ms | first, ms | reduced, ms | median, p95 | the field alone | MB | a face |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for name in names.split(',') {
        let mesh = match name {
            "plate" => generate(Shape::Rectangle, 5000).unwrap(),
            name => {
                let bytes = std::fs::read(std::path::Path::new(&folder).join(name)).expect("a mesh of that name");
                let format = MeshFormat::from_extension(name.rsplit('.').next().unwrap_or(name)).expect("a format");
                check(read(&bytes, format, &Default::default()).unwrap(), &Default::default()).unwrap().mesh
            }
        };
        let times: usize = setting("CHLADNI_SUBDIVIDED", "0").parse().unwrap();
        let mesh = (0..times).fold(mesh, |mesh, _| subdivided(&mesh).expect("a surface that can be divided"));
        let surface = FieldSurface::new(mesh).unwrap();
        let dimension = setting("CHLADNI_WHOLE_DIMENSION", "1000").parse().unwrap();
        let basis = field_basis(&surface, &FieldParameters::new(kind, dimension), &Unwatched).unwrap();
        let model = DesignModel::new(&basis, &Unwatched).unwrap();
        let ms = |begun: Instant| 1e3 * begun.elapsed().as_secs_f64();
        let begun = Instant::now();
        let full = FullSpace::within(&surface, kind, FieldBoundary::default(), u64::MAX, &Unwatched).unwrap();
        let analysis = ms(begun);
        let weighted = model.weighted(EnergyWeights::default(), None).unwrap();
        let random = |seed: u64, count: usize| -> Vec<Constraint> {
            let mut random = SplitMix64::new(seed);
            let one = |_| {
                let angle = random.signed_unit() * std::f64::consts::PI;
                let face = random.below(surface.faces()) as u32;
                Constraint { face, value: [angle.cos(), angle.sin(), 0.0], hold: Hold::Exact }
            };
            (0..count).map(one).collect()
        };
        let least = |constraints: &[Constraint]| {
            let design = weighted.solve(&basis, constraints).unwrap();
            let found = full.least(&weighted, &basis, constraints, &design, &Unwatched).unwrap();
            (design, found.expect("a surface that is factored"))
        };
        let begun = Instant::now();
        least(&random(99, 8));
        let first = ms(begun);
        let areas = surface.frames().areas();
        let off = |count: usize| {
            let mut all: Vec<f64> = (0..SETS)
                .map(|seed| {
                    let (design, found) = least(&random(seed, count));
                    let reduced = basis.space.lift(&design.coefficients).unwrap();
                    let (mut apart, mut own) = (0.0, 0.0);
                    for (i, (a, b)) in reduced.iter().zip(&found.field).enumerate() {
                        apart += areas[i / 2] * (f64::from(*a) - b).powi(2);
                        own += areas[i / 2] * b * b;
                    }
                    (apart / own).sqrt()
                })
                .collect();
            all.sort_by(f64::total_cmp);
            (all[all.len() / 2], all[all.len() - 1])
        };
        let (two, eight) = (off(2), off(8));
        let mut constraints = random(5, 8);
        let (mut times, mut reduced, mut alone) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..FRAMES {
            constraints[0].face = (constraints[0].face + 3) % surface.faces() as u32;
            let begun = Instant::now();
            weighted.solve(&basis, &constraints).unwrap();
            reduced.push(ms(begun));
            let begun = Instant::now();
            least(&constraints);
            times.push(ms(begun));
            constraints[0].face = (constraints[0].face + 3) % surface.faces() as u32;
            let begun = Instant::now();
            weighted.solve_briefly(&basis, &constraints).unwrap();
            full.least_field(&weighted, &basis, &constraints, &Unwatched).unwrap();
            alone.push(ms(begun));
        }
        times.sort_by(f64::total_cmp);
        alone.sort_by(f64::total_cmp);
        let faces = surface.faces() as f64;
        let block = kind.block() as f64;
        reduced.sort_by(f64::total_cmp);
        println!(
            "| {name} | {} | {:.3}, {:.2} | {:.3}, {:.2} | {analysis:.0} | {first:.0} | {:.1} | {:.1}, {:.1} | {:.1}, {:.1} | {:.0} | {:.2} |",
            surface.faces(),
            two.0,
            two.1,
            eight.0,
            eight.1,
            reduced[FRAMES / 2],
            times[FRAMES / 2],
            times[FRAMES * 95 / 100],
            alone[FRAMES / 2],
            alone[FRAMES * 95 / 100],
            full.bytes() as f64 / 1e6,
            full.bytes_of_factors() as f64 / (block * block * faces * faces.log2())
        );
    }
}
