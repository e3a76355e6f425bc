//! One eigenfunction of a family of operators for several parameters (thesis, figure 2.13), how long a spectrum takes,
//! and how far it is from that of the operator itself.

use std::path::Path;
use std::time::Instant;

use chladni_base::Unwatched;
use chladni_spectral::analysis::family::{Member, spectrum};
use chladni_spectral::operator::family::family;
use chladni_spectral::spectrum::family::restrict_family;
use serde_json::json;

use crate::paint::{Sheet, View, diverging};
use crate::{Failure, scene};

/// What a job takes by default.
const DIMENSION: usize = 780;

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mesh = scene::load(&folder.join("armadillo.obj"))?;
    let basis = restrict_family(&mesh, &family(&mesh, &Unwatched)?, DIMENSION, 0, &Unwatched)?;
    let view = View::from([0.0, 0.1, -1.0], [0.0, 1.0, 0.0]);
    let mut sheet = Sheet::new(4, 190, 210);
    for t in [0.0, 0.1, 0.4, 1.0] {
        let found = spectrum(&basis, Member { extrinsic: t, curvature: 0.0 }, 100)?;
        let modes = basis.lift(&found.coefficients);
        // The more an operator follows the normals, the more of its eigenfunctions live in one place, which may be
        // behind.
        let spread = |mode: usize| {
            let sum = |power: i32| modes.column(mode).iter().map(|x| x.powi(power)).sum::<f64>();
            sum(2).powi(2) / sum(4)
        };
        let widest = (1..20).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(1);
        sheet.add(&mesh, &diverging(modes.column(widest)), &view, &format!("t = {t}"));
    }
    scene::save("operator-families.svg", &sheet.svg())?;
    for name in
        ["armadillo.obj", "bunny.obj", "camelhead.off", "face.obj", "fandisk.obj", "poses/cat0.off", "rocker-arm.off"]
    {
        compare(&folder, name)?;
    }
    Ok(())
}

/// Spectra of members that are no anchors, against those of the operators themselves.
fn compare(folder: &Path, name: &str) -> Result<(), Failure> {
    let mesh = scene::load(&folder.join(name))?;
    let begin = Instant::now();
    let basis = restrict_family(&mesh, &family(&mesh, &Unwatched)?, DIMENSION, 0, &Unwatched)?;
    println!("{name}: {} functions in {:.1} s", basis.dimension(), begin.elapsed().as_secs_f64());
    for [t, v] in [[0.03, 0.0], [0.15, 0.0], [0.4, 0.0], [0.7, 0.0], [0.0, 0.3], [0.0, 1.0], [0.0, 6.0], [0.0, 12.0]] {
        let member = Member { extrinsic: t, curvature: v };
        let mut milliseconds: Vec<f64> = Vec::new();
        let mut found = spectrum(&basis, member, 100)?;
        for _ in 0..5 {
            let begin = Instant::now();
            found = spectrum(&basis, member, 100)?;
            milliseconds.push(1e3 * begin.elapsed().as_secs_f64());
        }
        milliseconds.sort_by(f64::total_cmp);
        let operator = if v > 0.0 {
            json!({"hamiltonian": {"potential": {"curvature": {"t": v}}}})
        } else {
            json!({"extrinsic": {"t": t}})
        };
        let direct = json!({"method": "hsim", "count": 100, "tolerance": 1e-6, "operator": operator});
        let exact = scene::eigenbasis_with(&mesh, direct)?.eigenvalues;
        let errors: Vec<f64> = found.eigenvalues.iter().zip(&exact).skip(1).map(|(a, b)| (a / b - 1.0).abs()).collect();
        println!(
            "  t = {t}, v = {v}: 100 pairs in {:.0} ms; against the operator itself mean {:.4} %, largest {:.3} %",
            milliseconds[2],
            1e2 * errors.iter().sum::<f64>() / errors.len() as f64,
            1e2 * errors.iter().copied().fold(0.0, f64::max)
        );
    }
    Ok(())
}
