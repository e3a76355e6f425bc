//! The side of a surface that is its outside: what faces say, but where closed surfaces are inside out.
//!
//! Nothing but pictures depends on it: strands would grow inwards, and no light would fall on any face.

use std::f64::consts::PI;

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

    fn may_hold(&self, other: &Self) -> bool {
        self.closed && (0..3).all(|i| self.least[i] <= other.least[i] && other.most[i] <= self.most[i])
    }

    fn is_inside_out(&self) -> bool {
        self.closed && self.volume[0] < -FLAT * self.volume[1]
    }
}

/// For each face 1 where it faces outwards as it is, −1 where it lies on a closed component that is inside out, or
/// within one that is. A closed component within one that is not may be the wall of a cavity, and stays as it is.
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
    let origins: Vec<[f64; 3]> = origins.into_iter().map(Option::unwrap_or_default).collect();
    // Whether a component lies within another one: by its box, and then by how often that one winds around a point.
    let holds = |around: usize, within: usize| {
        if around == within || !parts[around].may_hold(&parts[within]) {
            return false;
        }
        let own = mesh.faces.iter().zip(&components).filter(|(_, component)| **component as usize == around);
        let point = origins[within];
        let angles = own.map(|(face, _)| solid_angle(face.map(|v| mesh.positions[v as usize]), point));
        (angles.sum::<f64>() / (4.0 * PI)).abs() > 0.5
    };
    let turned = |within: usize| {
        if !parts[within].closed {
            return false;
        }
        // The outermost one that it lies in says how all of them are turned; inside-out ones alone turn anything.
        let inside_out = |k: usize| parts[k].is_inside_out();
        if !(0..count).any(|k| inside_out(k) && (k == within || parts[k].may_hold(&parts[within]))) {
            return false;
        }
        let around: Vec<usize> = (0..count).filter(|&k| holds(k, within)).collect();
        match around.iter().find(|&&k| around.iter().all(|&other| other == k || !parts[other].may_hold(&parts[k]))) {
            Some(&outermost) => inside_out(outermost),
            None => inside_out(within),
        }
    };
    let signs: Vec<f64> = (0..count).map(|k| if turned(k) { -1.0 } else { 1.0 }).collect();
    components.iter().map(|&component| signs[component as usize]).collect()
}

/// The signed solid angle of a triangle from a point (Van Oosterom and Strackee 1983).
fn solid_angle(corners: [[f64; 3]; 3], from: [f64; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| [0, 1, 2].map(|i| p[i] - from[i]));
    let [la, lb, lc] = [a, b, c].map(|p| dot(p, p).sqrt());
    let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    2.0 * dot(a, cross(b, c)).atan2(below)
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
        // Turned as a whole, its walls turn back together.
        let inside_out = union(&[turned(&sphere), scaled(&sphere, 0.5, 0.0)]);
        assert!(outward(&FieldSurface::new(inside_out).unwrap()).iter().all(|&sign| sign == -1.0));
        let disk = FieldSurface::new(turned(&generate(Shape::Disk, 100).unwrap())).unwrap();
        assert!(outward(&disk).iter().all(|&sign| sign == 1.0));
    }

    /// What lies in the corner of another's box, or in the hole of a torus, lies beside it.
    #[test]
    fn components_in_the_box_of_another_are_beside_it() {
        let sphere = generate(Shape::Sphere, 162).unwrap();
        let in_the_corner = {
            let mut small = scaled(&sphere, 0.1, 0.0);
            small.positions.iter_mut().for_each(|p| *p = p.map(|x| x + 0.85));
            small
        };
        let in_the_hole = scaled(&sphere, 0.2, 0.0);
        let torus = generate(Shape::Torus, 400).unwrap();
        for mesh in [union(&[sphere, in_the_corner]), union(&[torus, in_the_hole])] {
            assert!(outward(&FieldSurface::new(mesh.clone()).unwrap()).iter().all(|&sign| sign == 1.0));
            assert!(outward(&FieldSurface::new(turned(&mesh)).unwrap()).iter().all(|&sign| sign == -1.0));
        }
    }
}
