//! Distances from a point: diffusion for three times, biharmonic, commute-time, geodesic; their errors against exact pairs and known
//! distances.

use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::analysis::distance::SpectralDistance;
use chladni_spectral::analysis::geodesic::geodesic;
use chladni_spectral::basis::Basis;
use serde_json::json;

use crate::paint::{Sheet, View, isolines};
use crate::{Failure, scene};

/// On the sphere the geodesic distance is known.
const SPHERE: usize = 5_000;

pub fn draw() -> Result<(), Failure> {
    sphere()?;
    let Some(folder) = scene::meshes() else { return Ok(()) };
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
    for file in ["rocker-arm.off", "horse.ply"] {
        against_marching(&folder.join(file))?;
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

/// Geodesic distances in a basis against fast marching on the mesh.
fn against_marching(path: &std::path::Path) -> Result<(), Failure> {
    let mesh = scene::load(path)?;
    let connectivity = Connectivity::new(&mesh);
    let geometry = DistanceGeometry::new(&mesh, &connectivity, DistanceKind::FastMarching, 1.0);
    let mut workspace = DistanceWorkspace::new(&geometry);
    let n = mesh.positions.len();
    let sources = [0, n as u32 / 3, 2 * n as u32 / 3];
    let truths: Vec<Vec<f64>> = sources
        .iter()
        .map(|&source| {
            let mut all = vec![0.0; n];
            let found = workspace.local_distances(&geometry, source, f32::INFINITY);
            found.iter().for_each(|&(vertex, distance)| all[vertex as usize] = f64::from(distance));
            all
        })
        .collect();
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
            "{name}, {count} modes, against fast marching: error in % by the ladder, and for t = 1/8, 1/4, 1/2, 1 / λ₁: {}",
            errors.join(", ")
        );
    }
    Ok(())
}
