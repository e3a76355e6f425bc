//! Pictures of pixels: a surface in colours that are found anew at each place of it, with strokes of ink on top,
//! written as PNG.

use chladni_mesh::TriangleMesh;
use chladni_spectral::field::{Camera, Drawing, png};

use crate::paint::{Colour, cross, dot, unit};

/// Samples along each side of a pixel.
const FINE: usize = 3;

/// A picture, red, green and blue from 0 to 1, row by row from the top.
pub struct Plate {
    width: usize,
    height: usize,
    pixels: Vec<Colour>,
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

impl Plate {
    /// A white one.
    pub fn new(width: u32, height: u32) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self { width, height, pixels: vec![[1.0; 3]; width * height] }
    }

    /// The surface as a camera sees it: the colour of a face at the weights of its corners, shaded; faces are flat
    /// where `flat` says so.
    pub fn surface(
        mesh: &TriangleMesh,
        camera: &Camera,
        flat: bool,
        colour: impl Fn(usize, [f64; 3]) -> Colour,
    ) -> Self {
        let mut plate = Self::new(camera.width, camera.height);
        let ahead = unit(sub(camera.target, camera.eye));
        let right = unit(cross(ahead, camera.up));
        let up = cross(right, ahead);
        let (width, height) = (plate.width * FINE, plate.height * FINE);
        let scale = 0.5 * height as f64 / (0.5 * camera.angle.to_radians()).tan();
        let light = unit([0, 1, 2].map(|i| 0.62 * up[i] - 0.55 * right[i] - 0.60 * ahead[i]));
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.positions[v as usize]);
            cross(sub(b, a), sub(c, a))
        };
        let mut normals = vec![[0.0; 3]; mesh.positions.len()];
        for face in &mesh.faces {
            let n = area(face);
            face.iter().for_each(|&v| (0..3).for_each(|i| normals[v as usize][i] += n[i]));
        }
        let project = |p: [f64; 3]| {
            let d = sub(p, camera.eye);
            let depth = dot(d, ahead);
            let at = |along: f64, size: usize| 0.5 * size as f64 + scale * along / depth;
            [at(dot(d, right), width), at(-dot(d, up), height), depth]
        };
        let mut depths = vec![f64::INFINITY; width * height];
        let mut samples = vec![[1.0; 3]; width * height];
        for (f, face) in mesh.faces.iter().enumerate() {
            let [a, b, c] = face.map(|v| project(mesh.positions[v as usize]));
            let whole = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if a[2].min(b[2]).min(c[2]) <= 0.0 || whole.abs() < 1e-12 {
                continue;
            }
            let range = |k: usize, most: usize| {
                let least = a[k].min(b[k]).min(c[k]).floor().max(0.0) as usize;
                least..(a[k].max(b[k]).max(c[k]).ceil().max(0.0) as usize).min(most)
            };
            let own = unit(area(face));
            for y in range(1, height) {
                for x in range(0, width) {
                    let p = [x as f64 + 0.5, y as f64 + 0.5];
                    let v = ((p[0] - a[0]) * (c[1] - a[1]) - (p[1] - a[1]) * (c[0] - a[0])) / whole;
                    let w = ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])) / whole;
                    if v < 0.0 || w < 0.0 || v + w > 1.0 {
                        continue;
                    }
                    let inverse = [(1.0 - v - w) / a[2], v / b[2], w / c[2]];
                    let depth = 1.0 / inverse.iter().sum::<f64>();
                    if depth >= depths[y * width + x] {
                        continue;
                    }
                    depths[y * width + x] = depth;
                    let weights = inverse.map(|share| share * depth);
                    let mixed = [0, 1, 2].map(|i| (0..3).map(|k| weights[k] * normals[face[k] as usize][i]).sum());
                    let normal = if flat { own } else { unit(mixed) };
                    let bright = 0.50 + 0.16 * dot(normal, up) + 0.42 * dot(normal, light).max(0.0);
                    samples[y * width + x] = colour(f, weights).map(|c| (c * bright).clamp(0.0, 1.0));
                }
            }
        }
        for (pixel, slot) in plate.pixels.iter_mut().enumerate() {
            let corner = (pixel / plate.width * width + pixel % plate.width) * FINE;
            let of = |i: usize| (0..FINE * FINE).map(|k| samples[corner + k / FINE * width + k % FINE][i]).sum::<f64>();
            *slot = [0, 1, 2].map(|i| of(i) / (FINE * FINE) as f64);
        }
        plate
    }

    /// Adds strokes in a colour.
    pub fn ink(&mut self, drawing: &Drawing, colour: Colour) {
        for (pixel, grey) in self.pixels.iter_mut().zip(drawing.pixels()) {
            let paper = f64::from(grey) / 255.0;
            *pixel = [0, 1, 2].map(|i| paper * pixel[i] + (1.0 - paper) * colour[i]);
        }
    }

    /// Plates of one height side by side, as PNG of so many grades of each colour, which makes files small.
    pub fn row(plates: &[Self]) -> Option<Vec<u8>> {
        let height = plates.iter().map(|plate| plate.height).max()?;
        let width: usize = plates.iter().map(|plate| plate.width).sum();
        let mut bytes = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for plate in plates {
                let row = plate.pixels.get(y * plate.width..(y + 1) * plate.width);
                let white = vec![[1.0; 3]; plate.width];
                for pixel in row.unwrap_or(&white) {
                    bytes.extend(pixel.map(|c| ((63.0 * c).round() * 255.0 / 63.0).round() as u8));
                }
            }
        }
        png(width as u32, height as u32, 3, &bytes)
    }
}
