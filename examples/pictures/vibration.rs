//! Vibration modes of a solid and of a shell; how far approximate modes are from exact ones, also in a simulation
//! (thesis, figure 2.14).

use std::time::Instant;

use chladni_base::Unwatched;
use chladni_mesh::TriangleMesh;
use chladni_mesh::check::CheckOptions;
use chladni_mesh::read::{MeshFormat, ReadLimits, read};
use chladni_mesh::solid::check_body;
use chladni_spectral::analysis::vibration::{Damping, Load, Motion};
use chladni_spectral::basis::modal::ModalBasis;
use chladni_spectral::operator::elastic::{ElasticBody, Material};
use chladni_spectral::spectrum::vibration::{Iterations, VibrationMethod, VibrationParameters, vibration_modes};

use crate::paint::{Sheet, View, sequential};
use crate::{Failure, scene};

const MATERIAL: Material = Material { young: 1e6, poisson: 0.4, density: 1000.0 };

pub fn draw() -> Result<(), Failure> {
    let Some(folder) = scene::meshes() else { return Ok(()) };
    let bytes = std::fs::read(folder.join("hand-tet.mesh"))?;
    let checked = check_body(read(&bytes, MeshFormat::Medit, &ReadLimits::default())?, &CheckOptions::default())?;
    let solid = checked.solid.ok_or("hand-tet.mesh has no tetrahedra")?;
    let surface = checked.surface.mesh;
    let hand = ElasticBody::Solid { mesh: &solid };
    let exact = compare("hand, solid", hand, &solid.positions, 60, &[120, 240])?;
    let view = View::from([0.3, 0.2, 1.0], [0.0, 1.0, 0.0]);
    let mut sheet = Sheet::new(4, 190, 190);
    for mode in [6, 8, 12, 20] {
        let (moved, size) = displaced(&surface, &exact, mode)?;
        sheet.add(&moved, &sequential(&size, None), &view, &format!("{:.2} Hz", exact.frequencies()[mode]));
    }
    let camel = scene::load(&folder.join("camelhead.off"))?;
    let extent = 0.01 * extent(&camel);
    let body = ElasticBody::Shell { mesh: &camel, thickness: 3.0 * extent };
    let exact = compare("camel head, shell of 3 % of its size", body, &camel.positions, 60, &[120, 240])?;
    let cat = scene::load(&folder.join("poses/cat0.off"))?;
    let body = ElasticBody::Shell { mesh: &cat, thickness: 0.003 * self::extent(&cat) };
    compare("cat, shell of .3 % of its size", body, &cat.positions, 60, &[120, 200])?;
    let view = View::from([1.0, 0.2, 0.4], [0.0, 1.0, 0.0]);
    for mode in [6, 8, 12, 20] {
        let (moved, size) = displaced(&camel, &exact, mode)?;
        sheet.add(&moved, &sequential(&size, None), &view, &format!("{:.2} Hz", exact.frequencies()[mode]));
    }
    scene::save("vibration.svg", &sheet.svg())
}

/// The surface in a mode, and by how much each vertex moves.
fn displaced(surface: &TriangleMesh, basis: &ModalBasis, mode: usize) -> Result<(TriangleMesh, Vec<f64>), Failure> {
    let mut q = vec![0.0; basis.count()];
    q[mode] = 1.0;
    let mut lifted = vec![0f32; 3 * basis.vertices()];
    basis.lifter().lift(&q, &mut lifted)?;
    let moves = &lifted.as_chunks::<3>().0[..surface.positions.len()];
    let size = |u: &[f32; 3]| u.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt();
    let sizes: Vec<f64> = moves.iter().map(size).collect();
    let factor = 0.12 * extent(surface) / sizes.iter().copied().fold(1e-300, f64::max);
    let positions = surface.positions.iter().zip(moves);
    let positions = positions.map(|(p, u)| std::array::from_fn(|k| p[k] + factor * f64::from(u[k]))).collect();
    Ok((TriangleMesh { positions, faces: surface.faces.clone(), ..Default::default() }, sizes))
}

fn extent(mesh: &TriangleMesh) -> f64 {
    let side = |k: usize| {
        let along = mesh.positions.iter().map(|p| p[k]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}

fn compare(
    name: &str,
    body: ElasticBody<'_>,
    rest: &[[f64; 3]],
    count: usize,
    dimensions: &[usize],
) -> Result<ModalBasis, Failure> {
    let modes = |method| -> Result<ModalBasis, Failure> {
        let parameters = VibrationParameters { count, material: MATERIAL, clamped: Vec::new().into(), method, seed: 0 };
        let begin = Instant::now();
        let basis = vibration_modes(body, &parameters, &Unwatched)?;
        println!("{name}: {count} modes by {method:?} in {:.1} s", begin.elapsed().as_secs_f64());
        Ok(basis)
    };
    let exact = modes(VibrationMethod::Hsim { tolerance: 1e-3 })?;
    for &dimension in dimensions {
        use Iterations::{Exactly, Until};
        for (local_coordinates, inverse_iterations) in
            [(false, Exactly(0)), (true, Exactly(0)), (true, Exactly(1)), (true, Exactly(2)), (true, Until(0.01))]
        {
            let found = modes(VibrationMethod::Approximate { dimension, local_coordinates, inverse_iterations })?;
            let certificate = &found.metadata.json()["certificate"];
            let pairs = found.frequencies().into_iter().zip(exact.frequencies()).skip(6);
            let errors: Vec<f64> = pairs.map(|(a, b)| a / b - 1.0).collect();
            let simulation = simulation_error(&exact, &found, rest)?;
            println!(
                "{name}, d = {dimension}, local coordinates {local_coordinates}, inverse iterations {inverse_iterations:?} ({}): frequencies mean {:.3} %, largest {:.3} %, estimated {:.2} %; elastic part {:.2} %, displacements {:.2} %, positions mean {:.3} %, largest {:.3} %",
                certificate["inverse_iterations"],
                1e2 * errors.iter().sum::<f64>() / errors.len() as f64,
                1e2 * errors.iter().copied().fold(0.0, f64::max),
                1e2 * certificate["estimated_error"].as_f64().unwrap_or(f64::NAN),
                1e2 * simulation[3],
                1e2 * simulation[2],
                1e2 * simulation[0],
                1e2 * simulation[1]
            );
        }
    }
    Ok(exact)
}

/// The mean and the largest of `‖x − x̃‖ / ‖x‖`, positions in the norm of the mass, over 250 frames after a tap that
/// moves the vertex it hits by a twentieth of the object's size: the thesis' measure. Then the mean of `‖u − ũ‖ / ‖u‖`
/// for displacements, which tells more, and last the same for what is left of the displacements without the rigid
/// modes, which are exact in both and most of what a free object moves: where both move out of step that is above 1,
/// while the first cannot exceed what the object moves at all.
fn simulation_error(exact: &ModalBasis, found: &ModalBasis, rest: &[[f64; 3]]) -> Result<[f64; 4], Failure> {
    let period = 1.0 / exact.frequencies()[6];
    let damping = Damping { mass: 0.01 / period, stiffness: 1e-6 * period };
    let frame = |k: usize| k as f64 * period / 50.0;
    let motion = |basis: &ModalBasis, momentum: f64| {
        Motion::new(basis, damping, &[Load::Impulse { vertex: 0, time: 0.0, momentum: [0.0, momentum, momentum] }])
    };
    let part = |basis: &ModalBasis, motion: &Motion, k: usize, elastic: bool| -> Result<Vec<f32>, Failure> {
        let mut q: Vec<f64> = motion.at(frame(k)).iter().map(|state| state.position).collect();
        q[..if elastic { basis.rigid } else { 0 }].fill(0.0);
        let mut lifted = vec![0f32; 3 * basis.vertices()];
        basis.lifter().lift(&q, &mut lifted)?;
        Ok(lifted)
    };
    let lifted = |basis: &ModalBasis, motion: &Motion, k: usize| part(basis, motion, k, false);
    // The momentum that gives the displacement: the motion is linear in it.
    let unit = motion(exact, 1.0)?;
    let mut reach = 1e-300f64;
    for k in 1..50 {
        let there = lifted(exact, &unit, k)?;
        reach = reach.max(there[..3].iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt());
    }
    let momentum = 0.05 * exact.length / reach;
    let (a, b) = (motion(exact, momentum)?, motion(found, momentum)?);
    let total: f64 = exact.masses.iter().sum();
    let centre: [f64; 3] =
        std::array::from_fn(|k| exact.masses.iter().zip(rest).map(|(m, p)| m * p[k]).sum::<f64>() / total);
    let (mut sum, mut largest, mut moved, mut elastic) = (0.0, 0f64, 0.0, 0.0);
    for k in 1..=250 {
        let (x, y) = (lifted(exact, &a, k)?, lifted(found, &b, k)?);
        let (mut wrong, mut whole, mut displaced) = (0.0, 0.0, 0.0);
        for (v, p) in rest.iter().enumerate() {
            for axis in 0..3 {
                let (u, w) = (f64::from(x[3 * v + axis]), f64::from(y[3 * v + axis]));
                wrong += exact.masses[v] * (u - w).powi(2);
                displaced += exact.masses[v] * u.powi(2);
                whole += exact.masses[v] * (p[axis] - centre[axis] + u).powi(2);
            }
        }
        let error = (wrong / whole).sqrt();
        sum += error / 250.0;
        moved += (wrong / displaced).sqrt() / 250.0;
        largest = largest.max(error);
        let (x, y) = (part(exact, &a, k, true)?, part(found, &b, k, true)?);
        let weighted = |of: &dyn Fn(usize) -> f32| {
            (0..x.len()).map(|row| exact.masses[row / 3] * f64::from(of(row)).powi(2)).sum::<f64>()
        };
        elastic += (weighted(&|row| x[row] - y[row]) / weighted(&|row| x[row])).sqrt() / 250.0;
    }
    Ok([sum, largest, moved, elastic])
}
