//! How bright a surface is: normals that are smooth but at creases, a light far away, and the shadows that it throws.

use chladni_mesh::TriangleMesh;

use super::camera::{Camera, View, diagonal};
use super::screen::Screen;
use super::{cross, dot, unit_vector};

/// Faces that turn by more than this angle, in degrees, meet in a crease: normals are not averaged across it.
pub(super) const CREASE: f64 = 40.0;

/// Brightness where no light arrives.
const AMBIENT: f64 = 0.08;

/// Pixels of a picture from the light, along each side.
const SHADOW_PIXELS: u32 = 1024;

/// Where the light is, in multiples of the diagonal: far enough that its rays are parallel.
const FAR: f64 = 100.0;

/// What lies before a point by less than this share of the diagonal throws no shadow on it.
const SHADOW_SLACK: f64 = 0.012;

/// Unit normals of the corners of faces: means by area over the faces around a vertex that lie on the same side of
/// creases.
pub(super) fn corner_normals(mesh: &TriangleMesh) -> Vec<[[f64; 3]; 3]> {
    let along = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i| b[i] - a[i]);
    let areas: Vec<[f64; 3]> = mesh
        .faces
        .iter()
        .map(|face| {
            let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
            cross(along(a, b), along(a, c))
        })
        .collect();
    let mut starts = vec![0usize; mesh.positions.len() + 1];
    mesh.faces.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    (0..mesh.positions.len()).for_each(|v| starts[v + 1] += starts[v]);
    let (mut next, mut around) = (starts.clone(), vec![0u32; 3 * mesh.faces.len()]);
    for (f, face) in mesh.faces.iter().enumerate() {
        for &v in face {
            around[next[v as usize]] = f as u32;
            next[v as usize] += 1;
        }
    }
    let least = CREASE.to_radians().cos();
    let of = |f: usize, v: u32| {
        let own = unit_vector(areas[f]);
        let mut sum = [0.0; 3];
        for &other in &around[starts[v as usize]..starts[v as usize + 1]] {
            let n = areas[other as usize];
            if dot(n, own) >= least * dot(n, n).sqrt() {
                (0..3).for_each(|i| sum[i] += n[i]);
            }
        }
        unit_vector(sum)
    };
    mesh.faces.iter().enumerate().map(|(f, face)| face.map(|v| of(f, v))).collect()
}

/// The normal at a place of a face by the weights of its corners.
pub(super) fn blend(normals: &[[f64; 3]; 3], weights: [f64; 3]) -> [f64; 3] {
    unit_vector([0, 1, 2].map(|i| (0..3).map(|k| weights[k] * normals[k][i]).sum()))
}

/// A light far away.
pub(super) struct Light<'a> {
    /// Towards it, of unit length.
    pub towards: [f64; 3],
    shadow: Option<Screen<'a>>,
    slack: f64,
}

/// Above the left shoulder of who looks.
pub(super) fn usual(view: &View) -> [f64; 3] {
    unit_vector([0, 1, 2].map(|i| 0.62 * view.up[i] - 0.55 * view.right[i] - 0.60 * view.ahead[i]))
}

/// A camera at the light that sees the whole mesh; for a picture of what lies in the light.
pub(super) fn from_light(mesh: &TriangleMesh, towards: [f64; 3], margin: f64, pixels: u32) -> Camera {
    let up = if towards[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    let angle = (2.0 / FAR).atan().to_degrees();
    let wide = Camera { eye: [0.0; 3], target: [0.0; 3], up, angle, width: pixels, height: pixels };
    let near = Camera::fitted(mesh, towards, margin, wide);
    // Fitted, it is as near as its angle allows; from further away the angle is what is left of it.
    let distance = (0..3).map(|i| (near.eye[i] - near.target[i]).powi(2)).sum::<f64>().sqrt();
    let wanted = FAR * diagonal(mesh);
    if !(distance < wanted) {
        return near;
    }
    let half = (0.5 * angle.to_radians()).tan() * distance / wanted;
    let eye = [0, 1, 2].map(|i| near.target[i] + towards[i] * wanted);
    Camera { eye, angle: 2.0 * half.atan().to_degrees(), ..near }
}

impl<'a> Light<'a> {
    /// A light in a direction, or where it usually is, with shadows or without.
    pub fn new(mesh: &'a TriangleMesh, view: &View, direction: Option<[f64; 3]>, shadows: bool) -> Self {
        let towards = direction.map_or_else(|| usual(view), unit_vector);
        let shadow = shadows.then(|| Screen::new(mesh, &from_light(mesh, towards, 0.0, SHADOW_PIXELS), 1)).flatten();
        Self { towards, shadow, slack: SHADOW_SLACK * diagonal(mesh) }
    }

    /// How much of the light arrives at a point, from 0 to 1: the edges of shadows are soft.
    pub fn arrives(&self, point: [f64; 3]) -> f64 {
        let Some(screen) = &self.shadow else { return 1.0 };
        let Some(p) = screen.view.project(point) else { return 1.0 };
        let around = [-3.0, -1.5, 0.0, 1.5, 3.0];
        let lit = around.iter().flat_map(|dx| around.iter().map(move |dy| (p[0] + dx, p[1] + dy)));
        lit.filter(|&(x, y)| p[2] <= screen.depth_at(x, y) + self.slack).count() as f64 / 25.0
    }

    /// The brightness of a matt surface at a point with a normal, from 0 to 1.
    pub fn brightness(&self, point: [f64; 3], normal: [f64; 3]) -> f64 {
        let facing = dot(normal, self.towards);
        let lit = if facing > 0.0 { facing * self.arrives(point) } else { 0.0 };
        // What turns away is not all alike: a little light comes back from below.
        AMBIENT * (1.0 + 0.5 * facing) + (1.0 - AMBIENT) * lit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;
    use chladni_mesh::shape::{Shape, generate};

    const CAMERA: Camera =
        Camera { eye: [0.0, 0.0, 8.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 40.0, width: 100, height: 100 };

    #[test]
    fn normals_are_smooth_on_a_sphere_and_break_at_the_edges_of_a_box() {
        let mesh = sphere(24);
        for (face, normals) in mesh.faces.iter().zip(corner_normals(&mesh)) {
            for (&v, normal) in face.iter().zip(normals) {
                assert!(dot(unit_vector(mesh.positions[v as usize]), normal) > 0.99);
            }
        }
        // Two faces of a roof of 90 degrees.
        let positions = vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let roof = TriangleMesh { positions, faces: vec![[0, 2, 1], [0, 1, 3]], ..Default::default() };
        for normals in corner_normals(&roof) {
            assert!(normals.iter().all(|n| n.iter().filter(|x| x.abs() > 0.999).count() == 1), "{normals:?}");
        }
    }

    #[test]
    fn a_body_throws_a_shadow_on_what_lies_behind_it_and_not_on_itself() {
        let mut mesh = sphere(24);
        let first = mesh.positions.len() as u32;
        let plate = generate(Shape::Rectangle, 900).unwrap();
        // A plate below, in z = −2, larger than the sphere.
        mesh.positions.extend(plate.positions.iter().map(|p| [8.0 * p[0] - 4.0, 8.0 * p[1] - 4.0, -2.0]));
        mesh.faces.extend(plate.faces.iter().map(|f| f.map(|v| v + first)));
        let view = View::new(&CAMERA, 1).unwrap();
        let light = Light::new(&mesh, &view, Some([0.0, 0.0, 2.0]), true);
        assert!(light.arrives([0.0, 0.0, 1.0]) > 0.99 && light.arrives([0.6, 0.0, 0.8]) > 0.99);
        assert!(light.arrives([0.0, 0.0, -2.0]) < 0.01 && light.arrives([2.0, 0.0, -2.0]) > 0.99);
        let bright = light.brightness([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
        let dark = light.brightness([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]);
        assert!(bright > 0.99 && dark < 0.1 && dark > 0.0, "{bright} {dark}");
    }
}
