//! A surface filtered in a basis, and how near filters in an approximate basis come to those in an exact one.

use chladni_spectral::analysis::filter::{Transfer, filter};
use chladni_spectral::analysis::projection::project;
use serde_json::json;

use crate::paint::{Sheet, View, plain};
use crate::{Failure, scene};

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mesh = scene::load(&folder.join("armadillo.obj"))?;
    let x = scene::coordinates(&mesh);
    let count = 500;
    let basis = scene::eigenbasis(&mesh, count)?;
    let value = |k: usize| basis.eigenvalues[k];
    let view = View::from([0.0, 0.1, -1.0], [0.0, 1.0, 0.0]);
    let colour = [0.80, 0.82, 0.88];
    let cases = [
        ("low pass, 40 modes", Transfer::LowPass { cutoff: value(40) }),
        ("as it is", Transfer::Heat { time: 0.0 }),
        ("sharpened", Transfer::Sharpen { cutoff: value(100), strength: 2.0 }),
        ("40 to 400 twice as strong", Transfer::Gain { low: value(40), high: value(400), gain: 2.0 }),
    ];
    let mut sheet = Sheet::new(4, 190, 210);
    for (name, transfer) in &cases {
        let filtered = scene::moved(&mesh, &filter(&basis, &x, transfer)?);
        sheet.add(&filtered, &plain(&mesh, colour), &view, name);
    }
    scene::save("filtering.svg", &sheet.svg())?;
    let mut sheet = Sheet::new(4, 190, 210);
    for pairs in [10, 50, 150, 500] {
        let found = project(&basis, &x, pairs)?;
        let errors: Vec<String> = found.relative_errors.iter().map(|error| format!("{error:.2e}")).collect();
        println!("armadillo, projected to {pairs} pairs: relative errors {}", errors.join(", "));
        let moved = scene::moved(&mesh, &found.reconstruction);
        sheet.add(&moved, &plain(&mesh, colour), &view, &format!("{pairs} pairs"));
    }
    scene::save("projection.svg", &sheet.svg())?;
    let exact = scene::eigenbasis_with(&mesh, json!({"method": "hsim", "count": count, "tolerance": 1e-4}))?;
    for accuracy in ["standard", "accurate"] {
        let fast = scene::eigenbasis_with(&mesh, json!({"count": count, "accuracy": accuracy}))?;
        for (name, transfer) in &cases {
            let (found, expected) = (filter(&fast, &x, transfer)?, filter(&exact, &x, transfer)?);
            println!(
                "armadillo, {count} pairs, {accuracy}, {name}: relative error {:.2e}",
                error(&exact, &found, &expected)
            );
        }
        for pairs in [50, 200, 500] {
            let [found, expected] = [&fast, &exact].map(|basis| project(basis, &x, pairs));
            let error = error(&exact, &found?.reconstruction, &expected?.reconstruction);
            println!("armadillo, {accuracy}, projected to {pairs} pairs: relative error {error:.2e}");
        }
    }
    Ok(())
}

/// The relative error of coordinates, all three together, around their mean.
fn error(
    basis: &chladni_spectral::basis::Basis,
    found: &chladni_algebra::DenseMatrix,
    expected: &chladni_algebra::DenseMatrix,
) -> f64 {
    let masses = basis.mass.lumped();
    let total: f64 = masses.iter().sum();
    let (mut lost, mut whole) = (0.0, 0.0);
    for axis in 0..3 {
        let (a, b) = (found.column(axis), expected.column(axis));
        let mean = masses.iter().zip(b).map(|(m, b)| m * b).sum::<f64>() / total;
        lost += masses.iter().zip(a).zip(b).map(|((m, a), b)| m * (a - b) * (a - b)).sum::<f64>();
        whole += masses.iter().zip(b).map(|(m, b)| m * (b - mean) * (b - mean)).sum::<f64>();
    }
    (lost / whole).sqrt()
}
