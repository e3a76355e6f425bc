//! Fur as pixels: strands with depth, lit along their length (Kajiya and Kay 1989), with the shadows that they throw on
//! each other.

use std::ops::Range;

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, SplitMix64};

use super::super::surface::FieldSurface;
use super::camera::{Camera, View, diagonal};
use super::coat::Coat;
use super::light::{blend, from_light, usual};
use super::outward::outward_normals;
use super::png::png;
use super::screen::{Screen, fill};
use super::strand::{Band, Nib};
use super::{dot, unit_vector};

/// Pixels of a picture of fur at most.
pub const MOST_PAINTED: u64 = 4_194_304;

/// Samples of a picture at most: it takes as many a pixel as that allows, up to 3 along each side.
const MOST_SAMPLES: u64 = 20_000_000;

/// Points of strands that are painted between two looks at whether the work was cancelled.
const POINTS_AT_ONCE: usize = 32_768;

/// The rows of a picture are painted in so many parts at once.
const BANDS: usize = 16;

/// Pixels of the picture from the light, along each side.
const SHADOW_PIXELS: u32 = 1536;

/// How a coat looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HairStyle {
    /// Red, green and blue from 0 to 1, in the middle of strands.
    pub colour: [f64; 3],
    /// Behind the fur.
    pub background: [f64; 3],
    /// Towards the light; above the left shoulder of who looks, where it is left out.
    pub light: Option<[f64; 3]>,
    /// The width of strands at their root in the units of the input; where it is left out as much as covers the
    /// surface.
    pub thickness: Option<f64>,
}

impl Default for HairStyle {
    fn default() -> Self {
        Self { colour: [0.62, 0.42, 0.24], background: [1.0; 3], light: None, thickness: None }
    }
}

/// Paints a coat as a PNG; `None` where the camera looks nowhere, or its picture has no size or more than
/// [`MOST_PAINTED`] pixels.
///
/// # Errors
/// [`Cancelled`].
pub fn paint(
    surface: &FieldSurface,
    coat: &Coat,
    camera: &Camera,
    style: &HairStyle,
    monitor: &dyn Monitor,
) -> Result<Option<Vec<u8>>, Cancelled> {
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    if pixels > MOST_PAINTED {
        return Ok(None);
    }
    let fine = (1..=3).rev().find(|fine| fine * fine * pixels <= MOST_SAMPLES).unwrap_or(1) as usize;
    let Some(screen) = Screen::new(surface.mesh(), camera, fine) else { return Ok(None) };
    monitor.stage("paint");
    let mut canvas = Canvas::new(surface, screen, coat, style, monitor)?;
    let (strands, together) = (coat.faces.len(), (POINTS_AT_ONCE / coat.points.max(1)).max(1));
    for first in (0..strands).step_by(together) {
        monitor.checkpoint()?;
        monitor.progress(first as f64 / strands as f64);
        canvas.paint(coat, first..(first + together).min(strands), monitor)?;
    }
    Ok(png(camera.width, camera.height, 3, &canvas.averaged(fine)))
}

/// The nearest depths as the light sees a coat.
struct Shade {
    view: View,
    depth: Vec<f32>,
    /// What is so much further from the light than the outermost hair is half in the dark.
    soft: f64,
}

impl Shade {
    fn new(
        surface: &FieldSurface,
        coat: &Coat,
        towards: [f64; 3],
        length: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let camera = from_light(surface.mesh(), towards, length, SHADOW_PIXELS);
        let Some(screen) = Screen::new(surface.mesh(), &camera, 1) else { return Ok(None) };
        let mut depth = screen.pixels().1.to_vec();
        let view = screen.view.clone();
        for (k, strand) in coat.positions.chunks_exact(coat.points.max(1)).enumerate() {
            if k.is_multiple_of(256) {
                monitor.checkpoint()?;
            }
            for pair in strand.windows(2) {
                let (Some(a), Some(b)) = (view.project(pair[0]), view.project(pair[1])) else { continue };
                let steps = (b[0] - a[0]).hypot(b[1] - a[1]).ceil().clamp(1.0, 4096.0) as usize;
                for step in 1..=steps {
                    let p = [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * step as f64 / steps as f64);
                    let Some(pixel) = view.pixel(p[0], p[1]) else { continue };
                    depth[pixel] = depth[pixel].min(p[2] as f32);
                }
            }
        }
        Ok(Some(Self { view, depth, soft: (0.6 * length).max(1e-300) }))
    }

    /// How much light arrives at a point inside the fur.
    fn arrives(&self, point: [f64; 3]) -> f64 {
        let Some(p) = self.view.project(point) else { return 1.0 };
        let mut sum = 0.0;
        for k in 0..9 {
            let (x, y) = (p[0] + 1.3 * f64::from(k % 3 - 1), p[1] + 1.3 * f64::from(k / 3 - 1));
            let nearest = self.view.pixel(x, y).map_or(f64::INFINITY, |pixel| f64::from(self.depth[pixel]));
            sum += (-(p[2] - nearest - 0.1 * self.soft).max(0.0) / self.soft).exp();
        }
        sum / 9.0
    }
}

struct Canvas {
    view: View,
    depth: Vec<f32>,
    colour: Vec<[f32; 3]>,
    towards: [f64; 3],
    shade: Option<Shade>,
    base: [f64; 3],
    /// Width at the root.
    thickness: f64,
}

impl Canvas {
    /// The bare surface.
    fn new(
        surface: &FieldSurface,
        screen: Screen<'_>,
        coat: &Coat,
        style: &HairStyle,
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        let mesh = surface.mesh();
        let towards = style.light.map_or_else(|| usual(&screen.view), unit_vector);
        let root_and_tip = |s: &[[f64; 3]]| {
            let (a, b) = (s[0], s[s.len() - 1]);
            (0..3).map(|i| (b[i] - a[i]).powi(2)).sum::<f64>().sqrt()
        };
        let strands = coat.positions.chunks_exact(coat.points.max(1));
        let longest = strands.map(root_and_tip).fold(0.0f64, f64::max).min(diagonal(mesh));
        let shade = Shade::new(surface, coat, towards, longest.max(1e-3 * diagonal(mesh)), monitor)?;
        let (faces, depths) = screen.pixels();
        let background = style.background.map(|c| linear(c) as f32);
        let mut colour = vec![background; depths.len()];
        let base = style.colour.map(linear);
        let normals = outward_normals(surface);
        for (f, face) in mesh.faces.iter().enumerate() {
            let corners = face.map(|v| screen.view.project(mesh.positions[v as usize]));
            let [Some(a), Some(b), Some(c)] = corners else { continue };
            fill(screen.view.size, [a, b, c], |pixel, weights, _| {
                if faces[pixel] == f as u32 {
                    let facing = dot(blend(&normals[f], weights), towards).max(0.0);
                    colour[pixel] = base.map(|c| (c * (0.05 + 0.22 * facing)) as f32);
                }
            });
        }
        let covering = 0.55 * (surface.frames().area() / coat.faces.len().max(1) as f64).sqrt();
        let thickness = style.thickness.unwrap_or(covering);
        let (depth, view) = (depths.to_vec(), screen.view);
        Ok(Self { depth, view, colour, towards, shade, base, thickness })
    }

    /// Paints some strands. Every pixel sees them in their order, in however many parts the picture is painted.
    fn paint(&mut self, coat: &Coat, strands: Range<usize>, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let nibs: Vec<Option<Nib>> = strands.into_par_iter().flat_map_iter(|strand| self.nibs(coat, strand)).collect();
        let [width, height] = self.view.size;
        let rows = height.div_ceil(BANDS).max(1);
        let bands = self.depth.par_chunks_mut(rows * width).zip(self.colour.par_chunks_mut(rows * width));
        bands.enumerate().try_for_each(|(band, (depth, colour))| {
            let mut band = Band { width, top: band * rows, depth, colour, since: 0 };
            nibs.chunks_exact(coat.points.max(1)).try_for_each(|strand| band.strand(strand, monitor))
        })
    }

    /// The points of a strand as they are painted; `None` behind the eye.
    fn nibs<'a>(&'a self, coat: &'a Coat, strand: usize) -> impl Iterator<Item = Option<Nib>> + 'a {
        let points = &coat.positions[strand * coat.points..(strand + 1) * coat.points];
        let mut random = SplitMix64::new(strand as u64);
        let (bright, warm) = (1.0 + 0.22 * random.signed_unit(), 0.05 * random.signed_unit());
        let own = [self.base[0] * (1.0 + warm), self.base[1], self.base[2] * (1.0 - warm)].map(|c| c * bright);
        (0..points.len()).map(move |k| {
            let s = k as f64 / (points.len() - 1) as f64;
            let (before, after) = (points[k.saturating_sub(1)], points[(k + 1).min(points.len() - 1)]);
            let tangent = unit_vector([0, 1, 2].map(|i| after[i] - before[i]));
            let place = self.view.project(points[k])?;
            let width = self.thickness * (1.0 - 0.75 * s * s) * self.view.scale / place[2];
            Some(Nib { place, width, colour: self.lit(points[k], tangent, coat.normals[strand], s, own) })
        })
    }

    /// The colour of a strand at a share of its length: light that it scatters around itself and what it mirrors.
    fn lit(&self, point: [f64; 3], tangent: [f64; 3], normal: [f64; 3], s: f64, own: [f64; 3]) -> [f64; 3] {
        let eye = unit_vector([0, 1, 2].map(|i| self.view.eye[i] - point[i]));
        let (along_light, along_eye) = (dot(tangent, self.towards), dot(tangent, eye));
        let (across_light, across_eye) =
            ((1.0 - along_light * along_light).max(0.0).sqrt(), (1.0 - along_eye * along_eye).max(0.0).sqrt());
        let arrives = self.shade.as_ref().map_or(1.0, |shade| shade.arrives(point));
        // Hair on the far side of a body is in its shadow, softly.
        let facing = ((dot(normal, self.towards) + 0.35) / 1.35).clamp(0.0, 1.0);
        let light = arrives * facing;
        // Between the roots little light comes from anywhere.
        let open = 0.25 + 0.75 * s;
        let mirrored = (across_light * across_eye - along_light * along_eye).max(0.0);
        let gloss = 0.30 * mirrored.powi(24) + 0.08 * mirrored.powi(6);
        own.map(|c| c * (0.16 * open + 1.25 * across_light * light * (0.45 + 0.55 * open)) + gloss * light * (0.4 + c))
    }

    /// Means over squares of samples, as a screen shows them.
    fn averaged(&self, fine: usize) -> Vec<u8> {
        let width = self.view.size[0] / fine;
        let height = self.view.size[1] / fine;
        let mut out = Vec::with_capacity(3 * width * height);
        for pixel in 0..width * height {
            let corner = (pixel / width * self.view.size[0] + pixel % width) * fine;
            for channel in 0..3 {
                let samples =
                    (0..fine * fine).map(|k| self.colour[corner + k / fine * self.view.size[0] + k % fine][channel]);
                let mean = f64::from(samples.sum::<f32>()) / (fine * fine) as f64;
                out.push((255.0 * mean.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8);
            }
        }
        out
    }
}

/// A colour as a screen shows it, as an amount of light.
fn linear(colour: f64) -> f64 {
    colour.clamp(0.0, 1.0).powf(2.2)
}
