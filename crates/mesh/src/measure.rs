//! Areas.

use chladni_base::parallel::*;

use super::TriangleMesh;

/// How many elements are summed in one piece: the pieces do not depend on the number of threads, so neither do the
/// sums.
const CHUNK: usize = 1 << 13;

/// The area of one face, in squared units of the mesh. Zero for a degenerate face.
#[inline]
pub fn face_area(mesh: &TriangleMesh, face: &[u32; 3]) -> f64 {
    let [a, b, c] = mesh.corners(face);
    0.5 * (b - a).cross(c - a).norm()
}

/// The area of the surface, in squared units of the mesh.
pub fn surface_area(mesh: &TriangleMesh) -> f64 {
    let sums: Vec<f64> =
        mesh.faces.par_chunks(CHUNK).map(|faces| faces.iter().map(|f| face_area(mesh, f)).sum()).collect();
    sums.iter().sum()
}

/// A third of the area of the faces around each of the `n` vertices, in squared units of the mesh.
pub fn vertex_areas(mesh: &TriangleMesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.positions.len()];
    for face in &mesh.faces {
        let third = face_area(mesh, face) / 3.0;
        for &v in face {
            areas[v as usize] += third;
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_square_has_area_one_and_shares_it_among_its_corners() {
        let mesh = TriangleMesh {
            positions: vec![[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..Default::default()
        };
        assert!((surface_area(&mesh) - 1.0).abs() < 1e-15);
        let areas = vertex_areas(&mesh);
        assert!((areas[0] - 1.0 / 3.0).abs() < 1e-15 && (areas[1] - 1.0 / 6.0).abs() < 1e-15);
    }
}
