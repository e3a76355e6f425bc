//! How often coordinates wind around vertices.
//!
//! Faces that all run counter-clockwise may still lie on each other: where the angles around a vertex of index `x` do
//! not add up to `2π (1 − x)`, coordinates wind around it too often or not often enough, as around a branch point, and
//! what lies between grid lines there are no quads. Quarter turns and translations across the cut leave angles as they
//! are, and so each is measured in its own face.

use std::f64::consts::{FRAC_PI_4, TAU};

use chladni_base::parallel::*;

use super::super::singularity::Singularity;
use super::super::surface::FieldSurface;
use super::untangle::doubled;
use crate::operator::frames::{Complex64, inner, outer};

/// What the angles around the vertices of a surface are to add up to.
pub(super) struct Windings<'a> {
    surface: &'a FieldSurface,
    wanted: Vec<f64>,
}

impl<'a> Windings<'a> {
    pub fn new(surface: &'a FieldSurface, singularities: &[Singularity]) -> Self {
        let mut wanted = vec![TAU; surface.mesh().positions.len()];
        singularities.iter().for_each(|s| wanted[s.vertex as usize] = TAU * (1.0 - s.index()));
        Self { surface, wanted }
    }

    /// Whether no face around an inner vertex is turned over, and still the angles there do not add up. `corners` is
    /// scratch, and has the corners of the vertex after it.
    pub fn is_wrong(&self, coordinates: &[[Complex64; 3]], vertex: u32, corners: &mut Vec<u32>) -> bool {
        self.surface.dual().fan(self.surface.mesh(), vertex, corners) && self.misses(coordinates, vertex, corners)
    }

    /// The same of the corners around an inner vertex.
    fn misses(&self, coordinates: &[[Complex64; 3]], vertex: u32, corners: &[u32]) -> bool {
        let mut sum = 0.0;
        for &corner in corners {
            let (z, k) = (coordinates[corner as usize / 3], corner as usize % 3);
            if !(doubled(z) > 0.0) {
                return false;
            }
            let (a, b) = (z[(k + 1) % 3] - z[k], z[(k + 2) % 3] - z[k]);
            // Of a face of hardly any area rounding may turn the sign.
            sum += outer(a, b).abs().atan2(inner(a, b));
        }
        // It is a whole number of quarters.
        (sum - self.wanted[vertex as usize]).abs() > FRAC_PI_4
    }

    /// How many vertices around the corners of an inner vertex, itself included, are wound wrongly.
    pub fn wrong_around(&self, coordinates: &[[Complex64; 3]], around: &[u32], corners: &mut Vec<u32>) -> usize {
        let faces = &self.surface.mesh().faces;
        let own = around.first().map(|&corner| faces[corner as usize / 3][corner as usize % 3]);
        let ring = around.iter().map(|&corner| faces[corner as usize / 3][(corner as usize + 1) % 3]);
        ring.chain(own).filter(|&vertex| self.is_wrong(coordinates, vertex, corners)).count()
    }

    /// Faces, ascending, that are turned over or have no area, and those around vertices that are wound wrongly though
    /// none of theirs is.
    pub fn folded(&self, coordinates: &[[Complex64; 3]]) -> Vec<u32> {
        let vertices = (0..self.wanted.len() as u32).into_par_iter().with_min_len(1 << 12);
        let around = vertices.map_init(Vec::new, |corners, vertex| {
            let wrong = self.is_wrong(coordinates, vertex, corners);
            if wrong { corners.iter().map(|corner| corner / 3).collect() } else { Vec::new() }
        });
        let around: Vec<Vec<u32>> = around.collect();
        let mut folded: Vec<u32> =
            (0..coordinates.len() as u32).filter(|&face| !(doubled(coordinates[face as usize]) > 0.0)).collect();
        folded.extend(around.into_iter().flatten());
        folded.sort_unstable();
        folded.dedup();
        folded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::TriangleMesh;

    /// A plane fan of faces around vertex 0, and coordinates that turn by an angle in each of them.
    fn fan(faces: usize, angle: f64) -> (FieldSurface, Vec<[Complex64; 3]>) {
        let mut mesh = TriangleMesh { positions: vec![[0.0; 3]], faces: Vec::new(), ..Default::default() };
        let mut coordinates = Vec::new();
        for k in 0..faces {
            let (sin, cos) = (TAU * k as f64 / faces as f64).sin_cos();
            mesh.positions.push([cos, sin, 0.0]);
            mesh.faces.push([0, 1 + k as u32, 1 + ((k + 1) % faces) as u32]);
            // Turned by quarters and moved, as beyond a seam.
            let turned = |k: usize| Complex64::cis(angle * k as f64) * Complex64::I.powu(k as u32 / 3);
            let shift = Complex64::new(k as f64, 0.5);
            let back = Complex64::cis(angle) * turned(k);
            coordinates.push([shift, shift + turned(k), shift + back]);
        }
        (FieldSurface::new(mesh).unwrap(), coordinates)
    }

    fn folded(faces: usize, degrees: f64, numerator: i32) -> usize {
        let (surface, coordinates) = fan(faces, degrees.to_radians() / faces as f64);
        assert!(coordinates.iter().all(|&z| doubled(z) > 0.0), "{degrees}");
        let singular = Singularity { vertex: 0, numerator, order: 4 };
        Windings::new(&surface, if numerator == 0 { &[] } else { std::slice::from_ref(&singular) })
            .folded(&coordinates)
            .len()
    }

    #[test]
    fn faces_of_positive_area_that_wind_twice_around_a_regular_vertex_are_told() {
        assert_eq!((folded(10, 720.0, 0), folded(10, 360.0, 0)), (10, 0));
    }

    #[test]
    fn angles_around_singular_vertices_add_up_by_their_index() {
        for numerator in -4..=3 {
            for quarters in 1..=8 {
                let told = folded(11, 90.0 * f64::from(quarters), numerator);
                assert_eq!(told, if quarters == 4 - numerator { 0 } else { 11 }, "{numerator} {quarters}");
            }
        }
    }

    #[test]
    fn a_face_that_is_turned_over_speaks_for_its_vertices() {
        let (surface, mut coordinates) = fan(10, 720f64.to_radians() / 10.0);
        coordinates[3].swap(1, 2);
        assert_eq!(Windings::new(&surface, &[]).folded(&coordinates), [3]);
    }
}
