//! Where a picture is seen from.

use chladni_mesh::TriangleMesh;

use super::{cross, dot, unit_vector};

/// Where a drawing is seen from, in the units of the input.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The eye.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
    /// What is up in the drawing.
    pub up: [f64; 3],
    /// The vertical angle of view in degrees.
    pub angle: f64,
    /// Width of the drawing.
    pub width: u32,
    /// Height of the drawing.
    pub height: u32,
}

/// The largest width and height.
pub const MOST_PIXELS: u32 = 8192;

/// The share of a picture that a surface fills, in the direction in which it fills more.
const FILLED: f64 = 0.94;

impl Camera {
    /// Whether a picture can be drawn with it: it looks somewhere, and its picture has a size that is not too large.
    pub fn is_sound(&self) -> bool {
        View::new(self, 1).is_some()
    }

    /// The camera that sees all of a mesh from a direction, as large as its picture allows, with `margin` around it in
    /// the units of the mesh. A direction along `up` is turned a little. What cannot be seen at all gives a camera that
    /// no picture is drawn with.
    pub fn fitted(mesh: &TriangleMesh, from: [f64; 3], margin: f64, camera: Self) -> Self {
        let away = unit_vector(from);
        let lies_along = dot(cross(camera.up, away), cross(camera.up, away)) <= 1e-12 * dot(camera.up, camera.up);
        let up = if lies_along { [camera.up[1], camera.up[2], camera.up[0]] } else { camera.up };
        let (low, high) = bounds(mesh, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let centre = [0, 1, 2].map(|i| 0.5 * (low[i] + high[i]));
        let right = unit_vector(cross(up, away));
        let axes = [right, cross(away, right), away];
        let slope = (0.5 * camera.angle.to_radians()).tan();
        let slopes = [slope * f64::from(camera.width) / f64::from(camera.height.max(1)), slope].map(|s| s * FILLED);
        // So far back that every vertex lies within the pyramid of the picture, which is moved sideways to sit between
        // the outermost ones.
        let used = || mesh.faces.iter().flatten().filter_map(|&v| mesh.positions.get(v as usize));
        let seen = |p: &[f64; 3]| axes.map(|axis| dot([0, 1, 2].map(|i| p[i] - centre[i]), axis));
        let (mut shift, mut back) = ([0.0; 2], 0.0f64);
        for k in 0..2 {
            let reach = |side: f64| {
                used()
                    .map(|p| {
                        let q = seen(p);
                        side * q[k] + slopes[k] * q[2]
                    })
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            let (plus, minus) = (reach(1.0) + margin, reach(-1.0) + margin);
            shift[k] = 0.5 * (plus - minus);
            back = back.max(0.5 * (plus + minus) / slopes[k]);
        }
        let target = [0, 1, 2].map(|i| centre[i] + shift[0] * axes[0][i] + shift[1] * axes[1][i]);
        Self { eye: [0, 1, 2].map(|i| target[i] + back * away[i]), target, up, ..camera }
    }
}

/// The least and largest coordinate of the used vertices along three axes.
fn bounds(mesh: &TriangleMesh, axes: [[f64; 3]; 3]) -> ([f64; 3], [f64; 3]) {
    let used = mesh.faces.iter().flatten().filter_map(|&v| mesh.positions.get(v as usize));
    used.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), &p| {
        let along = axes.map(|axis| dot(p, axis));
        ([0, 1, 2].map(|i| low[i].min(along[i])), [0, 1, 2].map(|i| high[i].max(along[i])))
    })
}

/// The diagonal of the box around the used vertices.
pub(super) fn diagonal(mesh: &TriangleMesh) -> f64 {
    let (low, high) = bounds(mesh, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    (0..3).map(|i| (high[i] - low[i]).powi(2)).sum::<f64>().sqrt()
}

/// A camera as a projection.
#[derive(Debug, Clone)]
pub(super) struct View {
    /// The eye.
    pub eye: [f64; 3],
    /// To the right of the picture.
    pub right: [f64; 3],
    /// Upwards in it.
    pub up: [f64; 3],
    /// Into it.
    pub ahead: [f64; 3],
    /// Pixels for a unit of length at depth 1.
    pub scale: f64,
    centre: [f64; 2],
    /// Width and height.
    pub size: [usize; 2],
}

impl View {
    /// The projection with `fine` pixels along each pixel of the camera; `None` where it looks nowhere, or its picture
    /// has no size or is too large.
    pub fn new(camera: &Camera, fine: usize) -> Option<Self> {
        let along = [0, 1, 2].map(|i| camera.target[i] - camera.eye[i]);
        let sideways = cross(along, camera.up);
        let sound = dot(sideways, sideways) > 0.0
            && dot(sideways, sideways).is_finite()
            && camera.angle > 0.0
            && camera.angle < 180.0
            && (1..=MOST_PIXELS).contains(&camera.width)
            && (1..=MOST_PIXELS).contains(&camera.height);
        if !sound {
            return None;
        }
        let (ahead, right) = (unit_vector(along), unit_vector(sideways));
        let size = [camera.width as usize * fine, camera.height as usize * fine];
        let scale = 0.5 * size[1] as f64 / (0.5 * camera.angle.to_radians()).tan();
        let centre = size.map(|s| 0.5 * s as f64);
        Some(Self { eye: camera.eye, right, up: cross(right, ahead), ahead, scale, centre, size })
    }

    /// Where a point is drawn, and its depth; `None` behind the eye.
    pub fn project(&self, point: [f64; 3]) -> Option<[f64; 3]> {
        let p = [0, 1, 2].map(|i| point[i] - self.eye[i]);
        let depth = dot(p, self.ahead);
        (depth > 1e-12).then(|| {
            let factor = self.scale / depth;
            [self.centre[0] + factor * dot(p, self.right), self.centre[1] - factor * dot(p, self.up), depth]
        })
    }

    /// From the eye through a place of the picture, one unit of depth far.
    pub fn ray(&self, x: f64, y: f64) -> [f64; 3] {
        let (s, t) = ((x - self.centre[0]) / self.scale, (self.centre[1] - y) / self.scale);
        [0, 1, 2].map(|i| self.ahead[i] + s * self.right[i] + t * self.up[i])
    }

    /// The pixel of a place of the picture.
    pub fn pixel(&self, x: f64, y: f64) -> Option<usize> {
        let inside = x >= 0.0 && y >= 0.0 && x < self.size[0] as f64 && y < self.size[1] as f64;
        inside.then(|| y as usize * self.size[0] + x as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;

    const CAMERA: Camera =
        Camera { eye: [0.0, 0.0, 4.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 40.0, width: 200, height: 200 };

    #[test]
    fn cameras_that_see_nothing_are_refused() {
        let refuse = |camera: Camera| View::new(&camera, 1).is_none();
        assert!(refuse(Camera { target: CAMERA.eye, ..CAMERA }) && refuse(Camera { up: [0.0, 0.0, 1.0], ..CAMERA }));
        assert!(refuse(Camera { angle: 0.0, ..CAMERA }) && refuse(Camera { width: 0, ..CAMERA }));
        assert!(refuse(Camera { height: 100_000, ..CAMERA }) && refuse(Camera { eye: [f64::NAN; 3], ..CAMERA }));
    }

    #[test]
    fn a_fitted_camera_sees_all_and_fills_its_picture() {
        let mut mesh = sphere(12);
        mesh.positions.iter_mut().for_each(|p| *p = [3.0 + 2.0 * p[0], p[1] - 7.0, p[2]]);
        for from in [[0.0, 0.0, 1.0], [1.0, 0.2, 0.1], [0.0, 1.0, 0.0], [-1.0, -2.0, 0.5]] {
            for (width, height) in [(200, 200), (400, 100), (50, 300)] {
                let camera = Camera::fitted(&mesh, from, 0.0, Camera { width, height, ..CAMERA });
                let view = View::new(&camera, 1).unwrap();
                let places: Vec<[f64; 3]> = mesh.positions.iter().map(|&p| view.project(p).unwrap()).collect();
                let share = |k: usize, size: u32| {
                    let x = places.iter().map(|p| p[k]);
                    let (low, high) = (x.clone().fold(f64::INFINITY, f64::min), x.fold(0.0, f64::max));
                    assert!(low >= 0.0 && high <= f64::from(size), "{from:?} {low} {high}");
                    (high - low) / f64::from(size)
                };
                let most = share(0, width).max(share(1, height));
                assert!(most > 0.9 && most < 0.96, "{from:?} {width} {height}: {most}");
            }
        }
    }
}
