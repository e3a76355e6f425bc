//! The surface at every pixel, and what it hides.

use chladni_mesh::TriangleMesh;

use super::camera::{Camera, View, diagonal};
use super::{cross, dot};

/// No face.
const NOTHING: u32 = u32::MAX;

/// Depths that are compared may differ by this share of the diagonal of the mesh: lines lie in the surface, and a pixel
/// knows one of its faces.
const SLACK: f64 = 0.002;

/// Depth and face of the nearest surface at each pixel.
#[derive(Debug)]
pub(super) struct Screen<'a> {
    mesh: &'a TriangleMesh,
    /// The projection.
    pub view: View,
    depth: Vec<f32>,
    face: Vec<u32>,
    slack: f64,
}

/// Visits the pixels whose middle lies in a triangle of the picture, with the weights of its corners as they are in
/// space, and the depth there.
pub(super) fn fill(size: [usize; 2], [a, b, c]: [[f64; 3]; 3], mut visit: impl FnMut(usize, [f64; 3], f64)) {
    let range = |i: usize, most: usize| {
        let low = a[i].min(b[i]).min(c[i]).floor().max(0.0);
        let high = a[i].max(b[i]).max(c[i]).ceil().min(most as f64);
        (low as usize, high.max(0.0) as usize)
    };
    let ((left, right), (top, bottom)) = (range(0, size[0]), range(1, size[1]));
    let whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if !(whole.abs() > 1e-12) {
        return;
    }
    for y in top..bottom {
        for x in left..right {
            let p = [x as f64 + 0.5, y as f64 + 0.5];
            let v = ((p[0] - a[0]) * (c[1] - a[1]) - (p[1] - a[1]) * (c[0] - a[0])) / whole;
            let w = ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / whole;
            if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
                // Inverse depth is linear on the screen.
                let inverse = [(1.0 - v - w) / a[2], v / b[2], w / c[2]];
                let depth = 1.0 / (inverse[0] + inverse[1] + inverse[2]);
                visit(y * size[0] + x, inverse.map(|share| share * depth), depth);
            }
        }
    }
}

impl<'a> Screen<'a> {
    /// The surface as a camera sees it, `fine` pixels along each of its pixels; `None` as for [`View::new`].
    pub fn new(mesh: &'a TriangleMesh, camera: &Camera, fine: usize) -> Option<Self> {
        let view = View::new(camera, fine)?;
        let pixels = view.size[0] * view.size[1];
        let (mut depth, mut face) = (vec![f32::INFINITY; pixels], vec![NOTHING; pixels]);
        for (f, corners) in mesh.faces.iter().enumerate() {
            let corners = corners.map(|v| mesh.positions.get(v as usize).and_then(|&p| view.project(p)));
            let [Some(a), Some(b), Some(c)] = corners else { continue };
            fill(view.size, [a, b, c], |pixel, _, near| {
                if (near as f32) < depth[pixel] {
                    depth[pixel] = near as f32;
                    face[pixel] = f as u32;
                }
            });
        }
        Some(Self { mesh, view, depth, face, slack: SLACK * diagonal(mesh) })
    }

    /// The depth of the surface at a place of the picture, on the plane of the face that its pixel shows; infinite
    /// beside the surface.
    pub fn depth_at(&self, x: f64, y: f64) -> f64 {
        let Some(pixel) = self.view.pixel(x, y) else { return f64::INFINITY };
        let Some(face) = self.mesh.faces.get(self.face[pixel] as usize) else { return f64::INFINITY };
        let [a, b, c] = face.map(|v| self.mesh.positions[v as usize]);
        let along = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] - a[i]);
        let normal = cross(along(b), along(c));
        let ray = self.view.ray(x, y);
        let towards = dot(normal, [0, 1, 2].map(|i| a[i] - self.view.eye[i]));
        let flat = towards / dot(normal, ray);
        // A plane that is seen from the side reaches far beyond its face.
        let of = |p: [f64; 3]| dot([0, 1, 2].map(|i| p[i] - self.view.eye[i]), self.view.ahead);
        let depths = [of(a), of(b), of(c)];
        let (low, high) = (depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2]));
        if flat.is_finite() { flat.clamp(low, high) } else { f64::from(self.depth[pixel]) }
    }

    /// Whether nothing lies before a point of the surface that is drawn at `p`.
    pub fn shows(&self, p: [f64; 3]) -> bool {
        self.view.pixel(p[0], p[1]).is_some() && p[2] <= self.depth_at(p[0], p[1]) + self.slack
    }

    /// The same of a point at the edge of what is seen, `reach` pixels of which may be on either side of the edge: it
    /// shows where anything around it does.
    pub fn shows_edge(&self, p: [f64; 3], reach: i32) -> bool {
        let around = || (-reach..=reach).map(f64::from);
        let far = p[2] - 4.0 * self.slack;
        self.view.pixel(p[0], p[1]).is_some()
            && around().any(|dx| around().any(|dy| far <= self.depth_at(p[0] + dx, p[1] + dy)))
    }

    /// Whether something clearly before a point is drawn within so many pixels of it.
    pub fn is_behind_an_edge(&self, p: [f64; 3], radius: f64) -> bool {
        (0..8).any(|k| {
            let (sine, cosine) = (std::f64::consts::FRAC_PI_4 * f64::from(k)).sin_cos();
            let (x, y) = (p[0] + radius * cosine, p[1] + radius * sine);
            self.view.pixel(x, y).is_some_and(|pixel| p[2] > f64::from(self.depth[pixel]) + 10.0 * self.slack)
        })
    }

    /// Faces and depths of all pixels, row by row; the face beside the surface is one that is not there.
    pub fn pixels(&self) -> (&[u32], &[f32]) {
        (&self.face, &self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;

    const CAMERA: Camera =
        Camera { eye: [0.0, 0.0, 4.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 40.0, width: 200, height: 200 };

    #[test]
    fn what_faces_the_eye_shows_and_what_lies_behind_does_not() {
        let mesh = sphere(24);
        let screen = Screen::new(&mesh, &CAMERA, 1).unwrap();
        for &p in &mesh.positions {
            let place = screen.view.project(p).unwrap();
            // The horizon of the unit sphere from a distance of 4 is at z = 1/4.
            if p[2] > 0.35 {
                assert!(screen.shows(place), "{p:?}");
            } else if p[2] < -0.2 {
                assert!(!screen.shows(place) && !screen.shows_edge(place, 1), "{p:?}");
            } else if (p[2] - 0.25).abs() < 0.02 {
                assert!(screen.shows_edge(place, 1), "{p:?}");
            }
        }
        assert_eq!(screen.depth_at(1.0, 1.0), f64::INFINITY);
        assert!((screen.depth_at(100.0, 100.0) - 3.0).abs() < 0.02);
    }
}
