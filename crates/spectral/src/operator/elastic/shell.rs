//! Thin shells: membrane and bending energy of a triangle mesh, at rest.
//!
//! Membrane: linear triangles in plane stress. Bending: that of a plate, `D/2 ∫ ν tr² + (1 − ν) |S|²`, with the change
//! `S` of the curvature of each face by [`bending`].
//!
//! [`bending`]: super::bending

use chladni_algebra::Block;
use chladni_base::Vector3;
use chladni_mesh::TriangleMesh;

use super::bending::{Beyond, Curvatures, Flat, Surroundings};
use super::{Elements, Incidence, Material, NOBODY, OperatorError, strain_block, within};

/// A face whose area is at most this share of the square of its longest edge is flat: its angles are noise.
const FLAT: f64 = 1e-7;

/// What is known of one face, lengths over `L`.
struct Face {
    area: f64,
    /// Gradients of the hat functions of its corners.
    gradients: [Vector3; 3],
    /// In its plane.
    projection: Block<3>,
    curvatures: Curvatures,
}

pub(super) fn elements<'a>(
    mesh: &'a TriangleMesh,
    thickness: f64,
    material: &Material,
    held: &[bool],
) -> Result<Elements<'a>, OperatorError> {
    let n = mesh.positions.len();
    for (face, corners) in mesh.faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= n) {
            return Err(OperatorError::VertexOutOfRange { face, vertex, vertices: n });
        }
    }
    let sound: Vec<bool> = mesh.faces.iter().map(|face| doubled_area(mesh, face).is_some()).collect();
    let (mut area, mut masses, mut centre) = (0.0, vec![0.0; n], Vector3::ZERO);
    for (corners, _) in mesh.faces.iter().zip(&sound).filter(|(_, sound)| **sound) {
        let size = 0.5 * doubled_area(mesh, corners).unwrap_or(0.0);
        area += size;
        for &v in corners {
            masses[v as usize] += size / 3.0;
            centre += size / 3.0 * mesh.point(v);
        }
    }
    if !(area > 0.0 && area.is_finite()) {
        return Err(OperatorError::NoArea);
    }
    masses.iter_mut().for_each(|m| *m /= area);
    let length = area.sqrt();
    within("thickness", thickness, SLENDEREST * length, length)?;

    let (beyond, held_edges) = neighbours(mesh, &sound, held);
    let faces: Vec<Face> = {
        use chladni_base::parallel::*;
        let poisson = material.poisson;
        let rigidity = (thickness / length).powi(2) / (12.0 * (1.0 - poisson * poisson));
        let around = Surroundings { mesh, beyond: &beyond, scale: 1.0 / length, poisson };
        let all = (0..mesh.faces.len() as u32).into_par_iter();
        all.filter(|&face| sound[face as usize]).map(|face| measured(&around, face, rigidity)).collect()
    };
    let incidence = Incidence::new(n, faces.iter().enumerate().map(|(f, face)| (f as u32, face.curvatures.stencil)));
    let poisson = material.poisson;
    // Plane stress.
    let (lambda, mu) = (poisson / (1.0 - poisson * poisson), 0.5 / (1.0 + poisson));
    let flat = sound.iter().filter(|&&sound| !sound).count();
    let row = move |vertex: u32, entries: &mut Vec<(u32, Block<3>)>| {
        for &(face, place) in incidence.on(vertex) {
            let face = &faces[face as usize];
            let i = place as usize;
            let Curvatures { stencil, gradients } = &face.curvatures;
            for (j, &other) in stencil.iter().enumerate().take_while(|(_, v)| **v != NOBODY) {
                let mut block = [[0.0; 3]; 3];
                if i < 3 && j < 3 {
                    let (p, q) = (face.gradients[i], face.gradients[j]);
                    block = strain_block(face.area * lambda, face.area * mu, p, q, &face.projection);
                }
                // The transpose is that of the two the other way round, to the last bit.
                for (own, other) in gradients[i].iter().zip(&gradients[j]) {
                    for (row, x) in block.iter_mut().zip(own.0) {
                        row.iter_mut().zip(other.0).for_each(|(sum, y)| *sum += x * y);
                    }
                }
                entries.push((other, block));
            }
        }
    };
    Ok(Elements {
        masses,
        row: Box::new(row),
        length,
        centre: 1.0 / area * centre,
        total_mass: material.density * thickness * area,
        flat,
        held_edges,
    })
}

/// The least thickness over the root of the area: below it, bending drowns in the rounding errors of the membrane.
const SLENDEREST: f64 = 1e-5;

/// Twice the area of a face, if it is not flat.
fn doubled_area(mesh: &TriangleMesh, corners: &[u32; 3]) -> Option<f64> {
    let [a, b, c] = mesh.corners(corners);
    let (u, v, w) = (b - a, c - a, c - b);
    let doubled = u.cross(v).norm();
    let longest = u.norm_squared().max(v.norm_squared()).max(w.norm_squared());
    (doubled > 2.0 * FLAT * longest).then_some(doubled)
}

/// For each face what is beyond its edges, a clamp where both ends are held; and how many edges these are. Where an
/// edge has several neighbours, each face looks at the next, in the order of their numbers.
fn neighbours(mesh: &TriangleMesh, sound: &[bool], held: &[bool]) -> (Vec<[Beyond; 3]>, usize) {
    let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * mesh.faces.len());
    for (f, face) in mesh.faces.iter().enumerate().filter(|(f, _)| sound[*f]) {
        for k in 0..3 {
            let (a, b) = (face[(k + 1) % 3], face[(k + 2) % 3]);
            edges.push(([a.min(b), a.max(b)], f as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut beyond = vec![[Beyond::Nothing; 3]; mesh.faces.len()];
    let is_held = |v: u32| held.get(v as usize).copied().unwrap_or(false);
    let mut held_edges = 0;
    for around in edges.chunk_by(|a, b| a.0 == b.0) {
        if around[0].0.into_iter().all(is_held) {
            held_edges += 1;
            around.iter().for_each(|&(_, f, k)| beyond[f as usize][k as usize] = Beyond::Clamp);
            continue;
        }
        if around.len() == 1 {
            continue;
        }
        for (at, &(_, f, k)) in around.iter().enumerate() {
            let (_, face, corner) = around[(at + 1) % around.len()];
            beyond[f as usize][k as usize] = Beyond::Face { face, corner, only: around.len() == 2 };
        }
    }
    (beyond, held_edges)
}

fn measured(around: &Surroundings<'_>, face: u32, rigidity: f64) -> Face {
    let (mesh, corners) = (around.mesh, around.mesh.faces[face as usize]);
    let origin = mesh.point(corners[0]);
    let p = corners.map(|v| around.scale * (mesh.point(v) - origin));
    let normal = (p[1] - p[0]).cross(p[2] - p[0]);
    let doubled = normal.norm();
    let unit = 1.0 / doubled * normal;
    let edges: [Vector3; 3] = std::array::from_fn(|k| p[(k + 2) % 3] - p[(k + 1) % 3]);
    let x = 1.0 / edges[2].norm() * edges[2];
    let y = unit.cross(x);
    let flat = Flat { corners, area: 0.5 * doubled, edges: edges.map(|e| [e.dot(x), e.dot(y)]) };
    Face {
        area: flat.area,
        gradients: edges.map(|e| 1.0 / doubled * unit.cross(e)),
        projection: std::array::from_fn(|a| std::array::from_fn(|b| f64::from(u8::from(a == b)) - unit[a] * unit[b])),
        curvatures: around.curvatures(face, &flat, rigidity),
    }
}
