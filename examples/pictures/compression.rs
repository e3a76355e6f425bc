//! Coordinates compressed to coefficients: what they cost, and what they look like.

use chladni_spectral::analysis::compression::{compress, decompress};

use crate::paint::{Sheet, View, plain};
use crate::{Failure, scene};

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mesh = scene::load(&folder.join("horse.ply"))?;
    let x = scene::coordinates(&mesh);
    let basis = scene::eigenbasis(&mesh, 1000)?;
    let n = mesh.positions.len();
    let view = View::from([1.0, 0.3, 0.2], [0.0, 0.0, 1.0]);
    let colour = [0.80, 0.82, 0.88];
    let mut sheet = Sheet::new(4, 190, 190);
    println!("horse, {n} vertices: pairs, bits, bytes, bits a vertex, relative errors, of which truncation");
    for (pairs, bits, drawn) in [
        (50, 10, true),
        (200, 12, true),
        (200, 16, false),
        (500, 8, false),
        (500, 12, false),
        (500, 16, false),
        (1000, 12, false),
        (1000, 14, true),
        (1000, 20, false),
    ] {
        let packed = compress(&basis, &x, pairs, bits)?;
        let back = decompress(&basis, &packed.bytes)?;
        let figures = |errors: &[f64]| errors.iter().map(|e| format!("{e:.2e}")).collect::<Vec<_>>().join(" ");
        println!(
            "{pairs}, {bits}, {}, {:.3}, {}, {}",
            packed.bytes.len(),
            8.0 * packed.bytes.len() as f64 / n as f64,
            figures(&packed.relative_errors),
            figures(&packed.truncation_errors)
        );
        if drawn {
            let caption = format!("{pairs} pairs, {bits} bits: {:.1} kB", packed.bytes.len() as f64 / 1000.0);
            sheet.add(&scene::moved(&mesh, &back), &plain(&mesh, colour), &view, &caption);
        }
    }
    sheet.add(&mesh, &plain(&mesh, colour), &view, &format!("as it is: {:.0} kB in f32", 12.0 * n as f64 / 1000.0));
    scene::save("compression.svg", &sheet.svg())
}
