//! Shape-DNA: camels in ten poses, three meshes of one figure, and other shapes; approximate and exact spectra.

use std::path::Path;

use chladni_algebra::DenseMatrix;
use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::scatter;
use chladni_spectral::analysis::shape_dna::{Compared, Comparison, Scale, Spectrum, Weighting, compare, kernel_of};
use chladni_spectral::basis::Basis;
use serde_json::json;

use crate::{Failure, scene};

const OTHERS: [&str; 8] = [
    "homer.obj",
    "homer-remeshed-4531.off",
    "homer-remeshed-7178.off",
    "cheburashka.obj",
    "elephant.obj",
    "fandisk.obj",
    "rocker-arm.off",
    "fertility.off",
];

const COUNT: usize = 100;

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mut files: Vec<String> = (1..=10).map(|k| format!("camel-gallop/camel-gallop-{k:02}.off")).collect();
    files.extend(OTHERS.map(String::from));
    let (mut approximate, mut exact, mut labels) = (Vec::new(), Vec::new(), Vec::new());
    for file in &files {
        let mesh = scene::load(&folder.join(file))?;
        approximate.push(spectrum(
            &mesh,
            scene::eigenbasis_with(&mesh, json!({"method": "approximate", "count": COUNT + 1}))?,
        ));
        let parameters = json!({"method": "hsim", "count": COUNT + 1, "tolerance": 1e-3, "storage": "compact"});
        exact.push(spectrum(&mesh, scene::eigenbasis_with(&mesh, parameters)?));
        labels.push(Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().to_owned());
    }
    let how = Comparison { count: COUNT, scale: Scale::Area, weighting: Weighting::Index, dimensions: 2 };
    let (fast, slow) = (compare(&approximate, &how)?, compare(&exact, &how)?);
    scene::save("shape-dna.svg", &scatter::svg(&fast.places, &labels, &fast.held))?;
    scene::save("shape-dna-exact.svg", &scatter::svg(&slow.places, &labels, &slow.held))?;

    let order = |found: &Compared, shape: usize| {
        let mut others: Vec<usize> = (0..labels.len()).filter(|&other| other != shape).collect();
        let distances = found.distances.column(shape);
        others.sort_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        others
    };
    println!("shape, nearest by approximate spectra, by exact ones, first three in the same order");
    for shape in 0..labels.len() {
        let (a, b) = (order(&fast, shape), order(&slow, shape));
        println!("{}, {}, {}, {}", labels[shape], labels[a[0]], labels[b[0]], a[..3] == b[..3]);
    }
    let camels = 0..10;
    let inside =
        camels.clone().flat_map(|a| camels.clone().map(move |b| (a, b))).map(|(a, b)| fast.distances.column(a)[b]);
    let outside = camels.clone().flat_map(|a| (10..labels.len()).map(move |b| (a, b)));
    let outside = outside.map(|(a, b)| fast.distances.column(a)[b]);
    println!(
        "camels: largest distance among them {:.4}, least to another shape {:.4}",
        inside.fold(0.0, f64::max),
        outside.fold(f64::INFINITY, f64::min)
    );
    for (name, found) in [("approximate", &fast), ("exact", &slow)] {
        for (a, b) in [(10, 11), (10, 12), (11, 12)] {
            println!(
                "{name}: {} and {} differ by {:.3} %",
                labels[a],
                labels[b],
                100.0 * relative(&found.descriptors, a, b)
            );
        }
    }
    let error = (0..labels.len()).map(|shape| {
        let pairs = fast.descriptors.column(shape).iter().zip(slow.descriptors.column(shape));
        pairs.map(|(a, b)| (a - b).abs() / b).sum::<f64>() / COUNT as f64
    });
    println!(
        "mean relative error of the approximate eigenvalues: {:.3} %",
        100.0 * error.sum::<f64>() / labels.len() as f64
    );
    Ok(())
}

fn spectrum(mesh: &TriangleMesh, basis: Basis) -> Spectrum {
    Spectrum {
        kernel: kernel_of(&basis.eigenvalues, 1),
        eigenvalues: basis.eigenvalues,
        area: chladni_mesh::measure::surface_area(mesh),
    }
}

/// The distance of two descriptors relative to their size.
fn relative(descriptors: &DenseMatrix, a: usize, b: usize) -> f64 {
    let (a, b) = (descriptors.column(a), descriptors.column(b));
    let gap: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let size: f64 = a.iter().map(|a| a * a).sum();
    (gap / size).sqrt()
}
