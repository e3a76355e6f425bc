//! Lines on a surface as a drawing: projected by a camera, without what the surface hides, as SVG.

use std::fmt::Write;

use chladni_mesh::TriangleMesh;

use crate::operator::frames::{cross, dot, unit_vector};

use super::streamline::Streamline;

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

/// Depths that are compared may differ by this share: pieces of lines lie in the surface.
const DEPTH_SLACK: f64 = 0.004;

/// The visible parts of lines as an SVG document; `None` where the camera looks nowhere or its drawing has no size.
pub fn svg(mesh: &TriangleMesh, lines: &[Streamline], camera: &Camera, stroke: f64) -> Option<String> {
    let view = View::new(camera)?;
    let depths = view.depths(mesh);
    let (width, height) = (camera.width, camera.height);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
         <g fill=\"none\" stroke=\"black\" stroke-width=\"{}\" stroke-linecap=\"round\">\n",
        if stroke.is_finite() { stroke.clamp(0.01, 100.0) } else { 1.0 }
    );
    for line in lines {
        let mut path = String::new();
        for pair in line.points.windows(2) {
            let ends = [view.project(pair[0]), view.project(pair[1])];
            let [Some(a), Some(b)] = ends else {
                finish(&mut out, &mut path);
                continue;
            };
            let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
            if !depths.shows(middle) {
                finish(&mut out, &mut path);
                continue;
            }
            if path.is_empty() {
                // Writing to a string does not fail.
                let _ = write!(path, "M{:.2} {:.2}", a[0], a[1]);
            }
            let _ = write!(path, "L{:.2} {:.2}", b[0], b[1]);
        }
        finish(&mut out, &mut path);
    }
    out.push_str("</g>\n</svg>\n");
    Some(out)
}

fn finish(out: &mut String, path: &mut String) {
    if !path.is_empty() {
        let _ = writeln!(out, "<path d=\"{path}\"/>");
        path.clear();
    }
}

struct View {
    eye: [f64; 3],
    right: [f64; 3],
    up: [f64; 3],
    ahead: [f64; 3],
    scale: f64,
    centre: [f64; 2],
    size: [usize; 2],
}

impl View {
    fn new(camera: &Camera) -> Option<Self> {
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
        let scale = 0.5 * f64::from(camera.height) / (0.5 * camera.angle.to_radians()).tan();
        let centre = [0.5 * f64::from(camera.width), 0.5 * f64::from(camera.height)];
        let size = [camera.width as usize, camera.height as usize];
        Some(Self { eye: camera.eye, right, up: cross(right, ahead), ahead, scale, centre, size })
    }

    /// Where a point is drawn, and its depth; `None` behind the eye.
    fn project(&self, point: [f64; 3]) -> Option<[f64; 3]> {
        let p = [0, 1, 2].map(|i| point[i] - self.eye[i]);
        let depth = dot(p, self.ahead);
        (depth > 1e-12).then(|| {
            let factor = self.scale / depth;
            [self.centre[0] + factor * dot(p, self.right), self.centre[1] - factor * dot(p, self.up), depth]
        })
    }

    /// The depth of the surface at every pixel.
    fn depths(&self, mesh: &TriangleMesh) -> Depths {
        let mut depths = Depths { size: self.size, nearest: vec![f64::INFINITY; self.size[0] * self.size[1]] };
        for face in &mesh.faces {
            let corners = face.map(|v| mesh.positions.get(v as usize).and_then(|&p| self.project(p)));
            if let [Some(a), Some(b), Some(c)] = corners {
                depths.fill(a, b, c);
            }
        }
        depths
    }
}

struct Depths {
    size: [usize; 2],
    nearest: Vec<f64>,
}

impl Depths {
    fn fill(&mut self, a: [f64; 3], b: [f64; 3], c: [f64; 3]) {
        let range = |i: usize, most: usize| {
            let low = a[i].min(b[i]).min(c[i]).floor().max(0.0);
            let high = a[i].max(b[i]).max(c[i]).ceil().min(most as f64);
            (low as usize, high.max(0.0) as usize)
        };
        let ((left, right), (top, bottom)) = (range(0, self.size[0]), range(1, self.size[1]));
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
                    let depth = 1.0 / ((1.0 - v - w) / a[2] + v / b[2] + w / c[2]);
                    let nearest = &mut self.nearest[y * self.size[0] + x];
                    *nearest = nearest.min(depth);
                }
            }
        }
    }

    fn shows(&self, p: [f64; 3]) -> bool {
        let inside = p[0] >= 0.0 && p[1] >= 0.0 && p[0] < self.size[0] as f64 && p[1] < self.size[1] as f64;
        inside && p[2] <= self.nearest[p[1] as usize * self.size[0] + p[0] as usize] * (1.0 + DEPTH_SLACK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chladni_mesh::fixtures::sphere;

    const CAMERA: Camera =
        Camera { eye: [0.0, 0.0, 4.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], angle: 40.0, width: 200, height: 200 };

    fn line(z: f64) -> Streamline {
        Streamline { points: vec![[-0.1, 0.0, z], [0.0, 0.0, z], [0.1, 0.05, z]], faces: vec![0, 0] }
    }

    #[test]
    fn what_lies_behind_is_hidden() {
        let mesh = sphere(12);
        let front = svg(&mesh, &[line(1.0)], &CAMERA, 1.0).unwrap();
        assert!(front.starts_with("<svg") && front.matches("<path").count() == 1);
        assert!(front.contains("L100.00 100.00"), "{front}");
        let back = svg(&mesh, &[line(-1.0)], &CAMERA, 1.0).unwrap();
        assert_eq!(back.matches("<path").count(), 0);
        let behind_the_eye = svg(&mesh, &[line(9.0)], &CAMERA, f64::NAN).unwrap();
        assert_eq!(behind_the_eye.matches("<path").count(), 0);
    }

    #[test]
    fn cameras_that_see_nothing_are_refused() {
        let refuse = |camera: Camera| svg(&sphere(2), &[], &camera, 1.0).is_none();
        assert!(refuse(Camera { target: CAMERA.eye, ..CAMERA }) && refuse(Camera { up: [0.0, 0.0, 1.0], ..CAMERA }));
        assert!(refuse(Camera { angle: 0.0, ..CAMERA }) && refuse(Camera { width: 0, ..CAMERA }));
        assert!(refuse(Camera { height: 100_000, ..CAMERA }) && refuse(Camera { eye: [f64::NAN; 3], ..CAMERA }));
    }
}
