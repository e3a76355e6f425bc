//! Heat kernel signatures of a surface, and the points that are similar to one, by few eigenpairs and by many (thesis,
//! figures 4.C.1 and 4.C.2).

use chladni_mesh::TriangleMesh;
use chladni_spectral::analysis::signature::{Signature, nearest_items};
use serde_json::json;

use crate::paint::{Sheet, View, marked, sequential};
use crate::{Failure, scene};

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mesh = scene::load(&folder.join("armadillo.obj"))?;
    let view = View::from([0.0, 0.1, -1.0], [0.0, 1.0, 0.0]);
    let finger = scene::furthest(&mesh, [1.0, 0.3, 0.0]);
    let mut sheet = Sheet::new(4, 190, 210);
    for count in [100, 1000] {
        let basis = scene::eigenbasis(&mesh, count)?;
        // A time that the few pairs can just resolve is early for the many.
        let time = 4.0 * std::f64::consts::LN_10 / basis.eigenvalues[count - 1];
        let signature = Signature::HeatKernel { times: vec![time], normalised: true };
        let values: Vec<f64> = signature.everywhere(&basis)?.column(0).iter().map(|value| value.ln()).collect();
        sheet.add(&mesh, &sequential(&values, Some(spread(&values))), &view, &format!("heat kernel, {count} pairs"));
    }
    for count in [100, 1000] {
        let basis = scene::eigenbasis(&mesh, count)?;
        let similar = Signature::heat_kernel(&basis.eigenvalues, 40, true)?.similarity(&basis, finger)?;
        let nearest = nearest_items(&similar, mesh.positions.len() / 100);
        let marks = marks(&mesh, &nearest);
        let colours = [[0.75, 0.78, 0.82], [0.95, 0.50, 0.10]];
        sheet.add_marked(&mesh, &marked(&marks, colours), &view, &format!("like the dot, {count} pairs"), &[finger]);
    }
    scene::save("signatures.svg", &sheet.svg())?;
    // Signatures by approximate pairs against those by exact ones.
    let exact = scene::eigenbasis_with(&mesh, json!({"method": "hsim", "count": 200, "tolerance": 1e-4}))?;
    for accuracy in ["standard", "accurate"] {
        let fast = scene::eigenbasis_with(&mesh, json!({"count": 200, "accuracy": accuracy}))?;
        for (name, signature) in [
            ("heat kernel, 16 times", Signature::heat_kernel(&exact.eigenvalues, 16, false)?),
            ("wave kernel, 100 energies", Signature::WaveKernel { count: 100 }),
        ] {
            let (found, expected) = (signature.everywhere(&fast)?, signature.everywhere(&exact)?);
            let error = |k: usize| scene::relative_error(&exact, found.column(k), expected.column(k));
            let errors: Vec<f64> = (0..found.columns()).map(error).collect();
            println!(
                "armadillo, 200 pairs, {accuracy}, {name}: mean relative error {:.2e}, largest {:.2e}",
                errors.iter().sum::<f64>() / errors.len() as f64,
                errors.iter().copied().fold(0.0, f64::max)
            );
        }
    }
    Ok(())
}

fn marks(mesh: &TriangleMesh, vertices: &[u32]) -> Vec<bool> {
    let mut marks = vec![false; mesh.positions.len()];
    vertices.iter().for_each(|&vertex| marks[vertex as usize] = true);
    marks
}

/// What most values lie within.
fn spread(values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[(share * (sorted.len() - 1) as f64) as usize];
    [at(0.02), at(0.98)]
}
