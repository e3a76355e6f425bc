//! The side of a surface that is its outside: what faces say, but where closed surfaces are inside out.
//!
//! Nothing but pictures depends on it: strands would grow inwards, and no light would fall on any face.

use chladni_mesh::dual::NO_FACE;

use super::super::surface::FieldSurface;
use super::light::corner_normals;
use super::{cross, dot};

/// An enclosed volume that is a smaller share of those of all its faces' cones has no sign.
const FLAT: f64 = 1e-9;

/// What is known of a component.
#[derive(Clone, Copy)]
struct Part {
    closed: bool,
    /// Six times the enclosed volume, and the same without signs.
    volume: [f64; 2],
    least: [f64; 3],
    most: [f64; 3],
}

impl Part {
    const NONE: Self = Self { closed: true, volume: [0.0; 2], least: [f64::INFINITY; 3], most: [f64::NEG_INFINITY; 3] };

    fn add(&mut self, corners: [[f64; 3]; 3], origin: [f64; 3]) {
        for p in corners {
            (0..3).for_each(|i| self.least[i] = self.least[i].min(p[i]));
            (0..3).for_each(|i| self.most[i] = self.most[i].max(p[i]));
        }
        let [a, b, c] = corners.map(|p| [0, 1, 2].map(|i| p[i] - origin[i]));
        let own = dot(a, cross(b, c));
        self.volume[0] += own;
        self.volume[1] += own.abs();
    }

    fn encloses(&self, other: &Self) -> bool {
        self.closed && (0..3).all(|i| self.least[i] <= other.least[i] && other.most[i] <= self.most[i])
    }
}

/// For each face 1 where it faces outwards as it is, −1 where it lies on a closed component that is inside out. A
/// component within another one may be the wall of a cavity, and stays as it is.
pub(in super::super) fn outward(surface: &FieldSurface) -> Vec<f64> {
    let (mesh, dual) = (surface.mesh(), surface.dual());
    let (components, count) = dual.components();
    let mut parts = vec![Part::NONE; count];
    let mut origins = vec![None; count];
    for (corners, &component) in mesh.faces.iter().zip(&components) {
        let corners = corners.map(|v| mesh.positions[v as usize]);
        let origin = *origins[component as usize].get_or_insert(corners[0]);
        parts[component as usize].add(corners, origin);
    }
    for &[face, other] in dual.edge_faces() {
        parts[components[face as usize] as usize].closed &= other != NO_FACE;
    }
    let turned = |(k, part): (usize, &Part)| {
        let inside_out = part.closed && part.volume[0] < -FLAT * part.volume[1];
        inside_out && !parts.iter().enumerate().any(|(other, around)| other != k && around.encloses(part))
    };
    let signs: Vec<f64> = parts.iter().enumerate().map(turned).map(|turned| if turned { -1.0 } else { 1.0 }).collect();
    components.iter().map(|&component| signs[component as usize]).collect()
}

/// Unit normals of the corners of faces, outwards.
pub(super) fn outward_normals(surface: &FieldSurface) -> Vec<[[f64; 3]; 3]> {
    let mut normals = corner_normals(surface.mesh());
    for (own, sign) in normals.iter_mut().zip(outward(surface)) {
        if sign < 0.0 {
            own.iter_mut().for_each(|normal| *normal = normal.map(|x| -x));
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::TriangleMesh;
    use chladni_mesh::fixtures::union;
    use chladni_mesh::shape::{Shape, generate};

    fn turned(mesh: &TriangleMesh) -> TriangleMesh {
        let faces = mesh.faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        TriangleMesh { positions: mesh.positions.clone(), faces, ..Default::default() }
    }

    fn scaled(mesh: &TriangleMesh, by: f64, along: f64) -> TriangleMesh {
        let positions = mesh.positions.iter().map(|p| [by * p[0] + along, by * p[1], by * p[2]]).collect();
        TriangleMesh { positions, faces: mesh.faces.clone(), ..Default::default() }
    }

    #[test]
    fn normals_of_closed_surfaces_point_outwards_whichever_way_their_faces_are_turned() {
        let sphere = generate(Shape::Sphere, 162).unwrap();
        for mesh in [sphere.clone(), turned(&sphere), scaled(&turned(&sphere), 1e-3, 7.0)] {
            let surface = FieldSurface::new(mesh).unwrap();
            let mesh = surface.mesh();
            let count = mesh.positions.len() as f64;
            let middle = [0, 1, 2].map(|i| mesh.positions.iter().map(|p| p[i]).sum::<f64>() / count);
            for (face, normals) in mesh.faces.iter().zip(outward_normals(&surface)) {
                for (&v, normal) in face.iter().zip(normals) {
                    assert!(dot(normal, [0, 1, 2].map(|i| mesh.positions[v as usize][i] - middle[i])) > 0.0);
                }
            }
        }
    }

    #[test]
    fn walls_of_cavities_and_open_surfaces_stay_as_they_are() {
        let sphere = generate(Shape::Sphere, 162).unwrap();
        let hollow = union(&[sphere.clone(), scaled(&turned(&sphere), 0.5, 0.0)]);
        let surface = FieldSurface::new(hollow).unwrap();
        assert!(outward(&surface).iter().all(|&sign| sign == 1.0));
        let beside = union(&[sphere.clone(), scaled(&turned(&sphere), 0.5, 9.0)]);
        let surface = FieldSurface::new(beside).unwrap();
        let signs = outward(&surface);
        assert!(signs[..sphere.faces.len()].iter().all(|&sign| sign == 1.0));
        assert!(signs[sphere.faces.len()..].iter().all(|&sign| sign == -1.0));
        let disk = FieldSurface::new(turned(&generate(Shape::Disk, 100).unwrap())).unwrap();
        assert!(outward(&disk).iter().all(|&sign| sign == 1.0));
    }
}
