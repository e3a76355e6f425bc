//! Meshes spoilt on purpose: noise on the positions, and a random numbering.

use chladni_base::{SplitMix64, Vector3};

use super::ShapeError;
use crate::TriangleMesh;

/// Moves every vertex to a random place within `fraction` times the mean edge length; the faces stay.
///
/// # Errors
/// [`ShapeError::Noise`] unless `fraction` lies from 0 to 1.
pub fn noisy(mesh: &TriangleMesh, fraction: f64, seed: u64) -> Result<TriangleMesh, ShapeError> {
    if !(0.0..=1.0).contains(&fraction) {
        return Err(ShapeError::Noise { fraction });
    }
    let mut random = SplitMix64::new(seed);
    let radius = fraction * mean_edge(mesh);
    let positions = mesh.points().iter().map(|&position| {
        // Points of a cube until one lies in the ball: 1.9 on average.
        let offset = loop {
            let point = Vector3(std::array::from_fn(|_| random.signed_unit()));
            if point.norm_squared() <= 1.0 {
                break point;
            }
        };
        (position + radius * offset).into()
    });
    Ok(TriangleMesh { positions: positions.collect(), faces: mesh.faces.clone(), ..Default::default() })
}

/// The same surface with its vertices and faces in random order and each face beginning at a random corner. The second
/// value gives the new number of each old vertex.
pub fn renumbered(mesh: &TriangleMesh, seed: u64) -> (TriangleMesh, Vec<u32>) {
    let mut random = SplitMix64::new(seed);
    let numbers = random.permutation(mesh.positions.len());
    let mut positions = vec![[0.0; 3]; mesh.positions.len()];
    for (&position, &number) in mesh.positions.iter().zip(&numbers) {
        positions[number as usize] = position;
    }
    let order = random.permutation(mesh.faces.len());
    let faces = order.iter().map(|&f| {
        let mut face = mesh.faces[f as usize].map(|v| numbers[v as usize]);
        face.rotate_left(random.below(3));
        face
    });
    (TriangleMesh { positions, faces: faces.collect(), ..Default::default() }, numbers)
}

/// The mean over faces of the mean side; 0 without faces.
fn mean_edge(mesh: &TriangleMesh) -> f64 {
    let perimeter = |face: &[u32; 3]| -> f64 {
        let [p, q, r] = mesh.corners(face);
        (p - q).norm() + (q - r).norm() + (r - p).norm()
    };
    let total: f64 = mesh.faces.iter().map(perimeter).sum();
    if mesh.faces.is_empty() { 0.0 } else { total / (3 * mesh.faces.len()) as f64 }
}
