//! Distances from a point: diffusion for three times, biharmonic, commute-time, geodesic; their errors against exact
//! pairs and known distances.

use std::time::Instant;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::distance::ExactGeodesics;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::analysis::distance::SpectralDistance;
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::analysis::heat::HeatGeodesics;
use chladni_spectral::basis::Basis;
use serde_json::json;

use crate::paint::{Sheet, View, isolines};
use crate::{Failure, scene};

/// Meshes on which the methods of geodesic distances are compared.
const METHODS: [&str; 8] = [
    "poses/cat0.off",
    "poses/centaur1.off",
    "rocker-arm.off",
    "fandisk.obj",
    "camelhead.off",
    "bunny.obj",
    "horse.ply",
    "rolling-stage.obj",
];

/// On the sphere the geodesic distance is known.
const SPHERE: usize = 5_000;

pub fn draw() -> Result<(), Failure> {
    sphere()?;
    let Some(folder) = scene::meshes() else { return Ok(()) };
    println!(
        "| mesh, vertices | heat | spectral | exact, a source | heat, factors + a source |\n|---|---|---|---|---|"
    );
    let mesh = scene::load(&folder.join("horse.ply"))?;
    let basis = scene::eigenbasis(&mesh, 300)?;
    let source = scene::furthest(&mesh, [0.0, 0.3, 1.0]);
    let unit = 1.0 / basis.eigenvalues[1];
    let view = View::from([1.0, 0.35, 0.25], [0.0, 0.0, 1.0]);
    let mut sheet = Sheet::new(3, 230, 220);
    let mut add = |name: String, values: &[f64]| sheet.add_marked(&mesh, &isolines(values), &view, &name, &[source]);
    for factor in [0.005, 0.05, 0.5] {
        let distance = SpectralDistance::Diffusion { times: vec![factor * unit] };
        let values = distance.from_sources(&basis, &[source])?;
        add(format!("diffusion, t = {factor}/λ₁"), values.column(0));
    }
    for (name, distance) in
        [("biharmonic", SpectralDistance::Biharmonic), ("commute-time", SpectralDistance::CommuteTime)]
    {
        add(name.to_owned(), distance.from_sources(&basis, &[source])?.column(0));
    }
    add("geodesic".to_owned(), geodesic(&basis, &mesh, &[source], false, None)?.column(0));
    scene::save("distances.svg", &sheet.svg())?;
    for file in METHODS {
        methods(&folder.join(file))?;
    }
    for file in ["rocker-arm.off", "horse.ply"] {
        against_exact_geodesics(&folder.join(file))?;
    }
    for (file, count) in [("kitten.obj", 200), ("rocker-arm.off", 200)] {
        against_exact(&folder.join(file), count)?;
    }
    Ok(())
}

/// Distances by approximate pairs against distances by exact ones.
fn against_exact(path: &std::path::Path, count: usize) -> Result<(), Failure> {
    let mesh = scene::load(path)?;
    let fast = scene::eigenbasis(&mesh, count)?;
    let accurate = scene::eigenbasis_with(&mesh, json!({"count": count, "accuracy": "accurate"}))?;
    let exact = json!({"method": "hsim", "count": count, "tolerance": 1e-5, "precision": "f64"});
    let exact = scene::eigenbasis_with(&mesh, exact)?;
    let sources = [0, mesh.positions.len() as u32 / 3, 2 * mesh.positions.len() as u32 / 3];
    let unit = 1.0 / exact.eigenvalues[1];
    let factors = [0.005, 0.05, 0.5];
    let diffusion = SpectralDistance::Diffusion { times: factors.map(|factor| factor * unit).to_vec() };
    let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    for (kind, distance) in [
        ("diffusion", diffusion),
        ("biharmonic", SpectralDistance::Biharmonic),
        ("commute-time", SpectralDistance::CommuteTime),
    ] {
        let truth = distance.from_sources(&exact, &sources)?;
        for (accuracy, basis) in [("standard", &fast), ("accurate", &accurate)] {
            let found = distance.from_sources(basis, &sources)?;
            let t = distance.columns();
            let errors: Vec<String> = (0..t)
                .map(|time| {
                    let of = |source: usize| {
                        scene::relative_error(&exact, found.column(source * t + time), truth.column(source * t + time))
                    };
                    format!("{:.2e}", (0..3).map(of).sum::<f64>() / 3.0)
                })
                .collect();
            println!("{name}, {kind}, {accuracy}: {}", errors.join(", "));
        }
    }
    Ok(())
}

/// The default ladder, and single times.
fn times(basis: &Basis) -> impl Iterator<Item = Option<f64>> {
    let unit = 1.0 / basis.eigenvalues[1];
    [None].into_iter().chain([0.125, 0.25, 0.5, 1.0].map(|factor| Some(factor * unit)))
}

/// Errors of the geodesic distance on the unit sphere, by the number of modes and the time.
fn sphere() -> Result<(), Failure> {
    let mesh: TriangleMesh = generate(Shape::Sphere, SPHERE)?;
    let source = 1234;
    let from = mesh.positions[source];
    let angle = |p: &[f64; 3]| (0..3).map(|k| p[k] * from[k]).sum::<f64>().clamp(-1.0, 1.0).acos();
    let truth: Vec<f64> = mesh.positions.iter().map(angle).collect();
    for count in [50, 100, 200, 400, 500] {
        let basis = scene::eigenbasis(&mesh, count)?;
        let errors: Vec<String> = times(&basis)
            .map(|time| {
                let found = geodesic(&basis, &mesh, &[source as u32], false, time)?;
                Ok(format!("{:.2}", 100.0 * scene::relative_error(&basis, found.column(0), &truth)))
            })
            .collect::<Result<_, Failure>>()?;
        println!(
            "sphere, {count} modes: error in % by the ladder, and for t = 1/8, 1/4, 1/2, 1 / λ₁: {}",
            errors.join(", ")
        );
    }
    Ok(())
}

/// Three sources of a mesh, spread over its numbers, and their exact distances, column by column.
fn exact(mesh: &TriangleMesh) -> Result<([u32; 3], Vec<Vec<f64>>), Failure> {
    let n = mesh.positions.len() as u32;
    let sources = [0, n / 3, 2 * n / 3];
    let geodesics = ExactGeodesics::new(mesh);
    let truths = sources.iter().map(|&source| geodesics.from_nearest(&[source], &Unwatched));
    Ok((sources, truths.collect::<Result<_, _>>()?))
}

/// Heat on the mesh and in a basis of 200 modes against exact distances: errors and seconds.
fn methods(path: &std::path::Path) -> Result<(), Failure> {
    let mesh = scene::load(path)?;
    let basis = scene::eigenbasis(&mesh, 200)?;
    let begin = Instant::now();
    let (sources, truths) = exact(&mesh)?;
    let exactly = begin.elapsed().as_secs_f64() / 3.0;
    let begin = Instant::now();
    let heat = HeatGeodesics::new(&mesh, None, &Unwatched)?;
    let prepared = begin.elapsed().as_secs_f64();
    let groups: Vec<&[u32]> = sources.iter().cycle().take(32).map(std::slice::from_ref).collect();
    let begin = Instant::now();
    let warm = heat.from_nearest(&groups, &Unwatched)?;
    let heated = begin.elapsed().as_secs_f64() / 32.0;
    let spectral = geodesic(&basis, &mesh, &sources, false, None)?;
    let mean = |columns: &dyn Fn(usize) -> f64| (0..3).map(columns).sum::<f64>() / 3.0;
    let by_heat = mean(&|k| scene::relative_error(&basis, warm.distances.column(k), &truths[k]));
    let by_basis = mean(&|k| scene::relative_error(&basis, spectral.column(k), &truths[k]));
    let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    println!(
        "| {name}, {} | {:.1} % | {:.1} % | {exactly:.2} s | {prepared:.2} s + {:.1} ms |",
        mesh.positions.len(),
        100.0 * by_heat,
        100.0 * by_basis,
        1e3 * heated
    );
    Ok(())
}

/// Geodesic distances in a basis against exact ones, by the number of modes and the time.
fn against_exact_geodesics(path: &std::path::Path) -> Result<(), Failure> {
    let mesh = scene::load(path)?;
    let (sources, truths) = exact(&mesh)?;
    let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    for count in [50, 100, 200, 400, 800] {
        let basis = scene::eigenbasis(&mesh, count)?;
        let errors: Vec<String> = times(&basis)
            .map(|time| {
                let found = geodesic(&basis, &mesh, &sources, false, time)?;
                let errors = (0..3).map(|k| scene::relative_error(&basis, found.column(k), &truths[k]));
                Ok(format!("{:.2}", 100.0 * errors.sum::<f64>() / 3.0))
            })
            .collect::<Result<_, Failure>>()?;
        println!(
            "{name}, {count} modes, against exact distances: error in % by the ladder, and for t = 1/8, 1/4, 1/2, 1 / λ₁: {}",
            errors.join(", ")
        );
    }
    Ok(())
}
