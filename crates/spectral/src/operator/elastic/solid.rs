//! Solids: linear tetrahedra with the energy of Saint Venant and Kirchhoff, at rest.

use chladni_base::Vector3;
use chladni_mesh::TetMesh;

use super::{Elements, Incidence, Material, OperatorError, strain_block};

/// A tetrahedron whose volume is at most this share of that of a cube over its longest edge is flat.
const FLAT: f64 = 1e-9;

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

pub(super) fn elements<'a>(mesh: &'a TetMesh, material: &Material) -> Result<Elements<'a>, OperatorError> {
    let n = mesh.positions.len();
    for (tetrahedron, corners) in mesh.tetrahedra.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= n) {
            return Err(OperatorError::TetrahedronOutOfRange { tetrahedron, vertex, vertices: n });
        }
    }
    let at = |v: u32| Vector3(mesh.positions[v as usize]);
    // Volume and gradients in units of the input; a flat tetrahedron has neither.
    let measure = move |corners: &[u32; 4]| -> Option<(f64, [Vector3; 4])> {
        let [a, b, c, d] = corners.map(at);
        let (u, v, w) = (b - a, c - a, d - a);
        let six = u.dot(v.cross(w));
        let longest = [u, v, w, c - b, d - b, d - c].into_iter().map(Vector3::norm_squared).fold(0.0, f64::max);
        if !(six.abs() > 6.0 * FLAT * longest * longest.sqrt()) {
            return None;
        }
        let inverse = 1.0 / six;
        let (p, q, r) = (inverse * v.cross(w), inverse * w.cross(u), inverse * u.cross(v));
        Some((six.abs() / 6.0, [-p - q - r, p, q, r]))
    };
    let (mut volume, mut flat, mut masses, mut centre) = (0.0, 0, vec![0.0; n], Vector3::ZERO);
    for corners in &mesh.tetrahedra {
        let Some((size, _)) = measure(corners) else {
            flat += 1;
            continue;
        };
        volume += size;
        for &v in corners {
            masses[v as usize] += size / 4.0;
            centre += size / 4.0 * at(v);
        }
    }
    if !(volume > 0.0 && volume.is_finite()) {
        return Err(OperatorError::NoVolume);
    }
    masses.iter_mut().for_each(|m| *m /= volume);
    let length = volume.cbrt();
    let incidence = Incidence::new(n, mesh.tetrahedra.iter().enumerate().map(|(t, corners)| (t as u32, *corners)));
    let (young, poisson) = (1.0, material.poisson);
    let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let mu = young / (2.0 * (1.0 + poisson));
    let row = move |vertex: u32, entries: &mut Vec<(u32, [[f64; 3]; 3])>| {
        for &(tetrahedron, place) in incidence.on(vertex) {
            let corners = &mesh.tetrahedra[tetrahedron as usize];
            let Some((size, gradients)) = measure(corners) else { continue };
            // Sizes over L³, gradients times L.
            let weight = size / length;
            for (k, &corner) in corners.iter().enumerate() {
                let block =
                    strain_block(weight * lambda, weight * mu, gradients[place as usize], gradients[k], &IDENTITY);
                entries.push((corner, block));
            }
        }
    };
    Ok(Elements {
        masses,
        row: Box::new(row),
        length,
        centre: 1.0 / volume * centre,
        total_mass: material.density * volume,
        flat,
        held_edges: 0,
    })
}
