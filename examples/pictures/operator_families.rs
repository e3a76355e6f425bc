//! One eigenfunction of a family of operators for several parameters (thesis, figure 2.13), how long a spectrum takes, and how far it is from
//! that of the operator itself.

use std::time::Instant;

use chladni::algebra::space_times;
use chladni::analysis::family::{Member, spectrum};
use chladni::monitor::Unwatched;
use chladni::operator::family::family;
use chladni::spectrum::family::restrict_family;
use chladni::spectrum::heat::HeatParameters;
use chladni::spectrum::{ApproximationParameters, Space};
use serde_json::json;

use crate::paint::{Sheet, View, diverging};
use crate::{Failure, scene};

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let mesh = scene::load(&folder.join("armadillo.obj"))?;
    let space = Space::Heat(HeatParameters::default());
    let parameters = ApproximationParameters { count: 1000, dimension: 1000, space, seed: 0 };
    let basis = restrict_family(&mesh, &family(&mesh, &Unwatched)?, &parameters, &Unwatched)?;
    let view = View::from([0.0, 0.1, -1.0], [0.0, 1.0, 0.0]);
    let mut sheet = Sheet::new(4, 190, 210);
    for t in [0.0, 0.1, 0.4, 1.0] {
        let member = Member { extrinsic: t, curvature: 0.0 };
        let mut seconds = f64::INFINITY;
        let mut found = spectrum(&basis, member, 100)?;
        for _ in 0..5 {
            let begin = Instant::now();
            found = spectrum(&basis, member, 100)?;
            seconds = seconds.min(begin.elapsed().as_secs_f64());
        }
        let modes = space_times(&basis.space, &found.coefficients).ok_or("the family does not fit itself")?;
        // The more an operator follows the normals, the more of its eigenfunctions live in one place, which may be behind.
        let spread = |mode: usize| {
            let sum = |power: i32| modes.column(mode).iter().map(|x| x.powi(power)).sum::<f64>();
            sum(2).powi(2) / sum(4)
        };
        let widest = (1..20).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(1);
        sheet.add(&mesh, &diverging(modes.column(widest)), &view, &format!("t = {t}"));
        let operator = if t == 0.0 { json!("auto") } else { json!({"extrinsic": {"t": t}}) };
        let direct = json!({"method": "hsim", "count": 100, "tolerance": 1e-4, "operator": operator});
        let exact = scene::eigenbasis_with(&mesh, direct)?.eigenvalues;
        let errors: Vec<f64> = found.eigenvalues.iter().zip(&exact).skip(1).map(|(a, b)| (a / b - 1.0).abs()).collect();
        println!(
            "armadillo, d = 1000, t = {t}: 100 pairs in {:.0} ms; against the operator itself mean {:.2} %, largest {:.2} %",
            1e3 * seconds,
            1e2 * errors.iter().sum::<f64>() / errors.len() as f64,
            1e2 * errors.iter().copied().fold(0.0, f64::max)
        );
    }
    scene::save("operator-families.svg", &sheet.svg())
}
