//! `fields.md`: grid lines of seamless parametrisations along creases.

use std::path::Path;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::shape::{Shape, generate};
use chladni_spectral::field::quad::VertexOrder;
use chladni_work::design::{Quads, QuadsRequest, Surface};
use serde_json::json;

use crate::paint::{Sheet, View, lines};
use crate::{Failure, scene};

/// How often the faces of a mesh of so many are divided for the picture.
fn divisions(faces: usize) -> usize {
    ((1_500_000 / faces.max(1)) as f64).sqrt().clamp(2.0, 16.0) as usize
}

/// Draws the page.
pub fn draw() -> Result<(), Failure> {
    let mut sheet = Sheet::new(3, 300, 300);
    add(&mut sheet, "genus 2", &generate(Shape::Genus(2), 8000)?, 0.045, [0.3, -0.6, 1.0])?;
    if let Some(folder) = scene::meshes() {
        let load = |name: &str| scene::load(&Path::new(&folder).join(name));
        add(&mut sheet, "fandisk", &load("fandisk.obj")?, 0.03, [-0.5, 0.5, 1.0])?;
        add(&mut sheet, "rocker-arm", &load("rocker-arm.off")?, 0.03, [0.4, 1.0, 0.5])?;
        scene::save("quads.svg", &sheet.svg())?;
    }
    Ok(())
}

/// A cell: grid lines at a share of the root of the area.
fn add(sheet: &mut Sheet, name: &str, mesh: &TriangleMesh, share: f64, eye: [f64; 3]) -> Result<(), Failure> {
    let surface = Surface::new(mesh)?;
    let spacing = share * surface.surface.frames().area().sqrt();
    let request: QuadsRequest = serde_json::from_value(json!({"spacing": spacing, "integers": true}))?;
    let crosses = request.field.crosses(&surface, &Unwatched)?.ok_or("no field")?;
    let found = request.quads(&surface.surface, crosses, &VertexOrder::new(&surface.surface)?, &Unwatched)?;
    let own = &found.parametrisation;
    let (singular, inverted) = (found.combed.singularities.len(), own.inverted.len());
    println!(
        "{name}: {} faces, {singular} singular vertices, creases missed by {:?}, {inverted} faces turned over, deviation {:.3}",
        mesh.faces.len(),
        found.crease_error,
        own.deviation
    );
    let (fine, distances) = divided(mesh, &found);
    let caption = format!("{name}, {singular} singular vertices");
    sheet.add(&fine, &lines(&distances, 0.09), &View::from(eye, [0.0, 1.0, 0.0]), &caption);
    Ok(())
}

/// The faces one by one, each divided, and the distance of each vertex from a grid line where 1 is that between two of them.
fn divided(mesh: &TriangleMesh, found: &Quads) -> (TriangleMesh, Vec<f64>) {
    let n = divisions(mesh.faces.len());
    let mut fine = TriangleMesh { positions: Vec::new(), faces: Vec::new(), ..Default::default() };
    let mut distances = Vec::new();
    for (face, z) in mesh.faces.iter().zip(&found.parametrisation.coordinates) {
        let first = fine.positions.len() as u32;
        let row = |i: usize| first + (i * (i + 1) / 2) as u32;
        for i in 0..=n {
            for j in 0..=i {
                let weights = [(n - i) as f64, (i - j) as f64, j as f64].map(|w| w / n as f64);
                let mix = |of: [f64; 3]| (0..3).map(|k| weights[k] * of[k]).sum::<f64>();
                let p = face.map(|v| mesh.positions[v as usize]);
                fine.positions.push([0, 1, 2].map(|axis| mix([p[0][axis], p[1][axis], p[2][axis]])));
                let off = |axis: usize| {
                    let x = mix([z[0][axis], z[1][axis], z[2][axis]]);
                    (x - x.round()).abs()
                };
                distances.push(off(0).min(off(1)));
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let (here, below) = (row(i) + j as u32, row(i + 1) + j as u32);
                fine.faces.push([here, below, below + 1]);
                if j < i {
                    fine.faces.push([here, below + 1, here + 1]);
                }
            }
        }
    }
    (fine, distances)
}
