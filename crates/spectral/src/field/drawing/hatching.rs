//! Hatchings: which parts of the lines on a surface are drawn, and how wide, so that their density is the tone of the
//! light.
//!
//! Lines come in levels, each of half the distance of the one before. Darker places take more levels, and lines swell
//! as they are needed; from a darkness on the lines of other directions cross the first. What turns away from the eye
//! would look darker than it is, as its lines stand closer: it takes fewer.

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::TriangleMesh;

use super::super::streamline::Streamline;
use super::super::surface::FieldSurface;
use super::camera::{Camera, View};
use super::ink::{Drawing, Nib};
use super::light::{Light, blend};
use super::outline::outlines;
use super::outward::outward_normals;
use super::screen::Screen;
use super::{cross, dot};

/// Lines are looked at so often along a pixel.
const STEPS_PER_PIXEL: f64 = 0.5;

/// Up to so many samples a surface's pictures are made finer than their pixels.
const MOST_SAMPLES: u64 = 20_000_000;

/// Strokes shorter than so many widths of the pen are left out.
const LEAST_LENGTH: f64 = 3.0;

/// Gaps of so many samples in outlines are closed: their places are off by about a pixel where normals and faces do not
/// agree.
const OUTLINE_GAP: usize = 6;

/// Lines end at this distance from what lies clearly before them, in widths of the pen.
const HALO: f64 = 1.6;

/// Places of a line that are looked at together for corners that nobody sees: a line that goes to and fro would take
/// the square of all of them.
const TOGETHER: usize = 512;

/// Corners of strokes that are off by less than this, in pixels, are left out.
const SMOOTH: f64 = 0.06;

/// How light becomes tone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Towards the light; above the left shoulder of who looks, where it is left out.
    pub light: Option<[f64; 3]>,
    /// The brightness, from 0 to 1, from which on no line is drawn.
    pub highlight: f64,
    /// The darkness, from 0 (the brightness of highlights) to 1, from which on lines are crossed; from 1 on they never
    /// are.
    pub cross: f64,
    /// Whether the surface throws shadows on itself.
    pub shadows: bool,
}

impl Default for Tone {
    fn default() -> Self {
        Self { light: None, highlight: 0.8, cross: 0.55, shadows: true }
    }
}

/// How a hatching looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HatchingStyle {
    /// The width of the pen in pixels.
    pub stroke: f64,
    /// Whether lines swell with the darkness; otherwise all have the width of the pen.
    pub swelling: bool,
    /// The tone; without it every line is drawn.
    pub tone: Option<Tone>,
    /// The width of silhouettes, creases and boundaries, in widths of the pen; 0 leaves them out.
    pub outline: f64,
}

impl Default for HatchingStyle {
    fn default() -> Self {
        Self { stroke: 1.0, swelling: true, tone: Some(Tone::default()), outline: 1.6 }
    }
}

/// The lines of a hatching.
#[derive(Debug, Clone, Copy)]
pub struct HatchedLines<'a> {
    /// Lines of the field.
    pub lines: &'a [Streamline],
    /// In how many directions they run at each place: of several, the one nearest to the diagonal of the picture comes
    /// first.
    pub kinds: u32,
    /// Lines across them, for shadows.
    pub crossing: &'a [Streamline],
    /// Levels of the lines.
    pub levels: u32,
}

/// Draws lines as a camera sees them, without what the surface hides; `None` where the camera looks nowhere, or its
/// drawing has no size.
///
/// # Errors
/// The monitor asked to stop.
pub fn hatch(
    surface: &FieldSurface,
    hatched: HatchedLines<'_>,
    camera: &Camera,
    style: &HatchingStyle,
    monitor: &dyn Monitor,
) -> Result<Option<Drawing>, Cancelled> {
    let pixels = u64::from(camera.width) * u64::from(camera.height);
    let fine = if 4 * pixels <= MOST_SAMPLES { 2 } else { 1 };
    let seen = Screen::new(surface.mesh(), camera, fine).zip(View::new(camera, 1));
    let Some((screen, paper)) = seen else { return Ok(None) };
    let normals = outward_normals(surface);
    let stroke = if style.stroke.is_finite() { style.stroke.clamp(0.01, 100.0) } else { 1.0 };
    let light = style.tone.map(|tone| Light::new(surface.mesh(), &paper, tone.light, tone.shadows));
    let lit = style.tone.zip(light.as_ref());
    let pencil = Pencil {
        mesh: surface.mesh(),
        screen,
        paper,
        fine: fine as f64,
        normals: &normals,
        stroke,
        style,
        lit,
        hatched,
    };
    let mut strokes = Vec::new();
    if style.outline > 0.0 {
        for line in outlines(surface, &normals, camera.eye) {
            monitor.checkpoint()?;
            pencil.outline(&line, style.outline.min(100.0) * stroke, &mut strokes);
        }
    }
    for (lines, crossing) in [(hatched.lines, false), (hatched.crossing, true)] {
        for (k, line) in lines.iter().enumerate() {
            monitor.checkpoint()?;
            pencil.hatch(line, crossing, k as u64, &mut strokes);
        }
    }
    Ok(Some(Drawing { width: camera.width, height: camera.height, strokes, swelling: style.swelling, pen: stroke }))
}

struct Pencil<'a> {
    mesh: &'a TriangleMesh,
    screen: Screen<'a>,
    /// The projection onto pixels of the camera.
    paper: View,
    /// Pixels of the screen along one of the paper.
    fine: f64,
    normals: &'a [[[f64; 3]; 3]],
    stroke: f64,
    style: &'a HatchingStyle,
    lit: Option<(Tone, &'a Light<'a>)>,
    hatched: HatchedLines<'a>,
}

/// A place of a line.
struct Spot {
    point: [f64; 3],
    along: [f64; 3],
    face: usize,
    /// Place and depth on the paper.
    place: [f64; 3],
}

impl Pencil<'_> {
    /// Places along a line, about two pixels apart; `None` where it is behind the eye.
    fn spots(&self, line: &Streamline) -> Vec<Option<Spot>> {
        let mut spots = Vec::new();
        for (pair, &face) in line.points.windows(2).zip(&line.faces) {
            let along = [0, 1, 2].map(|i| pair[1][i] - pair[0][i]);
            let (Some(a), Some(b)) = (self.paper.project(pair[0]), self.paper.project(pair[1])) else {
                spots.push(None);
                continue;
            };
            let steps = ((b[0] - a[0]).hypot(b[1] - a[1]) * STEPS_PER_PIXEL).ceil().clamp(1.0, 1e4) as usize;
            let first = if spots.is_empty() { 0 } else { 1 };
            for step in first..=steps {
                let s = step as f64 / steps as f64;
                let point = [0, 1, 2].map(|i| pair[0][i] + s * along[i]);
                let spot = self.paper.project(point).map(|place| Spot { point, along, face: face as usize, place });
                spots.push(spot);
            }
        }
        spots
    }

    fn on_screen(&self, spot: &Spot) -> [f64; 3] {
        [spot.place[0] * self.fine, spot.place[1] * self.fine, spot.place[2]]
    }

    fn outline(&self, line: &Streamline, width: f64, strokes: &mut Vec<Vec<Nib>>) {
        let reach = self.fine as i32 + 1;
        let nibs = self.spots(line).into_iter().map(|spot| {
            let spot = spot.filter(|spot| self.screen.shows_edge(self.on_screen(spot), reach))?;
            Some([spot.place[0], spot.place[1], width])
        });
        self.runs(nibs.collect(), OUTLINE_GAP, 3.0 * LEAST_LENGTH, strokes);
    }

    fn hatch(&self, line: &Streamline, crossing: bool, number: u64, strokes: &mut Vec<Vec<Nib>>) {
        let spots = self.spots(line);
        let mut nibs: Vec<Option<Nib>> = spots
            .iter()
            .map(|spot| {
                let spot = spot.as_ref()?;
                let p = self.on_screen(spot);
                if !self.screen.shows(p) || self.screen.is_behind_an_edge(p, HALO * self.stroke * self.fine) {
                    return None;
                }
                let width = self.width(spot, line.level, crossing, number)?;
                Some([spot.place[0], spot.place[1], width])
            })
            .collect();
        if self.style.swelling {
            soften(&mut nibs);
        }
        self.runs(nibs, 2, LEAST_LENGTH, strokes);
    }

    /// The width of a line at a place, `None` where it is not needed there.
    fn width(&self, spot: &Spot, level: u32, crossing: bool, number: u64) -> Option<f64> {
        let Some((tone, light)) = self.lit else { return Some(self.stroke) };
        let normal = blend(&self.normals[spot.face], self.weights(spot.face, spot.point));
        let brightness = light.brightness(spot.point, normal);
        let darkness = ((tone.highlight - brightness) / tone.highlight.max(1e-6)).clamp(0.0, 1.0);
        let cross = tone.cross.max(1e-6);
        let first = (darkness / cross.min(1.0)).min(1.0);
        let second = if cross < 1.0 { ((darkness - cross) / (1.0 - cross)).clamp(0.0, 1.0) } else { 0.0 };
        let own = if crossing { 0.0 } else { self.share_of_first(spot) };
        let density = (own * first + (1.0 - own) * second) * self.foreshortening(spot, normal);
        // The share of all lines that levels up to this one are, and up to the one before.
        let high = 0.5f64.powi((self.hatched.levels.max(1) - 1).saturating_sub(level) as i32);
        let low = if level == 0 { 0.0 } else { 0.5 * high };
        let needed = (density - low) / (high - low);
        // Not all lines of a level begin at the same darkness, or their ends would draw a line.
        let late = 0.3 * uniform_number(number, level);
        if self.style.swelling {
            let swell = ((needed - late) / (1.0 - late)).clamp(0.0, 1.0);
            let width = self.stroke * (0.25 + 0.75 * swell) * (0.85 + 0.4 * darkness);
            (needed > late + 0.04).then_some(width)
        } else {
            (needed > 0.2 + late).then_some(self.stroke)
        }
    }

    /// How much a line is one of the first direction: of several kinds those that run like a hand draws, from the lower
    /// left to the upper right.
    fn share_of_first(&self, spot: &Spot) -> f64 {
        if self.hatched.kinds <= 1 {
            return 1.0;
        }
        let along = self.flat(spot, spot.along);
        let size = along[0].hypot(along[1]).max(1e-300);
        let towards = ((along[0] - along[1]) / size * std::f64::consts::FRAC_1_SQRT_2).abs().min(1.0);
        let off = towards.acos().to_degrees() - 90.0 / f64::from(self.hatched.kinds);
        let s = ((8.0 - off) / 16.0).clamp(0.0, 1.0);
        s * s * (3.0 - 2.0 * s)
    }

    /// A direction at a place as it is drawn there, for a unit of depth.
    fn flat(&self, spot: &Spot, d: [f64; 3]) -> [f64; 2] {
        let view = &self.paper;
        let p = [0, 1, 2].map(|i| spot.point[i] - view.eye[i]);
        let depth = spot.place[2];
        let (away, right, up) = (dot(d, view.ahead) / depth, dot(d, view.right), dot(d, view.up));
        [right - away * dot(p, view.right), -(up - away * dot(p, view.up))]
    }

    /// The distance between lines as it is drawn, as a share of what it is seen from above.
    fn foreshortening(&self, spot: &Spot, normal: [f64; 3]) -> f64 {
        let across = cross(normal, spot.along);
        let (a, b) = (self.flat(spot, spot.along), self.flat(spot, across));
        let (length, area) = (a[0].hypot(a[1]), (a[0] * b[1] - a[1] * b[0]).abs());
        let sides = dot(across, across).sqrt();
        if length > 0.0 && sides > 0.0 { (area / (length * sides)).clamp(0.12, 1.0) } else { 1.0 }
    }

    /// The weights of the corners of a face at a point of it.
    fn weights(&self, face: usize, point: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.mesh.faces[face].map(|v| self.mesh.positions[v as usize]);
        let from = |o: [f64; 3], p: [f64; 3]| [0, 1, 2].map(|i| p[i] - o[i]);
        let normal = cross(from(a, b), from(a, c));
        let whole = dot(normal, normal);
        if !(whole > 0.0) {
            return [1.0 / 3.0; 3];
        }
        let v = dot(cross(from(a, point), from(a, c)), normal) / whole;
        let w = dot(cross(from(a, b), from(a, point)), normal) / whole;
        [1.0 - v - w, v, w].map(|x| x.clamp(0.0, 1.0))
    }

    /// Adds the parts that are drawn, with gaps of a few samples closed, without corners that nobody sees.
    fn runs(&self, mut nibs: Vec<Option<Nib>>, gap: usize, least: f64, strokes: &mut Vec<Vec<Nib>>) {
        close(&mut nibs, gap);
        for run in nibs.split(Option::is_none) {
            let run: Vec<Nib> = run.iter().flatten().copied().collect();
            let length: f64 = run.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum();
            if length >= least * self.stroke {
                strokes.push(simplified(&run));
            }
        }
    }
}

/// A number from 0 to 1 for each line.
fn uniform_number(number: u64, level: u32) -> f64 {
    chladni_base::SplitMix64::new(number ^ (u64::from(level) << 40)).unit()
}

/// Widths as means over the neighbours along a line.
fn soften(nibs: &mut [Option<Nib>]) {
    for _ in 0..2 {
        let before: Vec<Option<f64>> = nibs.iter().map(|nib| nib.map(|n| n[2])).collect();
        for (i, nib) in nibs.iter_mut().enumerate() {
            let Some(nib) = nib else { continue };
            // Beside the end of a stroke the pen is lifted.
            let of = |k: Option<usize>| k.and_then(|k| before.get(k).copied().flatten()).unwrap_or(0.4 * nib[2]);
            nib[2] = 0.25 * of(i.checked_sub(1)) + 0.5 * nib[2] + 0.25 * of(Some(i + 1));
        }
    }
}

/// Bridges gaps of at most so many samples.
fn close(nibs: &mut [Option<Nib>], gap: usize) {
    let mut last: Option<usize> = None;
    for i in 0..nibs.len() {
        let Some(here) = nibs[i] else { continue };
        if let Some(before) = last.filter(|&before| i - before > 1 && i - before <= gap + 1) {
            let from = nibs[before].unwrap_or(here);
            for k in before + 1..i {
                let s = (k - before) as f64 / (i - before) as f64;
                nibs[k] = Some([0, 1, 2].map(|j| (1.0 - s) * from[j] + s * here[j]));
            }
        }
        last = Some(i);
    }
}

/// Douglas and Peucker's line of fewer places.
fn simplified(run: &[Nib]) -> Vec<Nib> {
    let (mut keep, end) = (vec![false; run.len()], run.len() - 1);
    let mut open: Vec<(usize, usize)> =
        (0..run.len()).step_by(TOGETHER).map(|k| (k, (k + TOGETHER).min(end))).collect();
    open.iter().for_each(|&(first, last)| (keep[first], keep[last]) = (true, true));
    while let Some((first, last)) = open.pop() {
        let (a, b) = (run[first], run[last]);
        let d = [0, 1, 2].map(|i| b[i] - a[i]);
        let square = d[0] * d[0] + d[1] * d[1];
        let off = |p: Nib| {
            let r = [0, 1, 2].map(|i| p[i] - a[i]);
            let s = if square > 0.0 { ((r[0] * d[0] + r[1] * d[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
            let q = [0, 1, 2].map(|i| r[i] - s * d[i]);
            q[0].hypot(q[1]).max(q[2].abs())
        };
        let furthest = (first + 1..last).map(|i| (i, off(run[i]))).max_by(|x, y| x.1.total_cmp(&y.1));
        if let Some((i, _)) = furthest.filter(|found| found.1 > SMOOTH) {
            keep[i] = true;
            open.extend([(first, i), (i, last)]);
        }
    }
    run.iter().zip(keep).filter(|(_, keep)| *keep).map(|(nib, _)| *nib).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_that_nobody_sees_are_left_out_and_all_others_stay() {
        // To and fro, with a straight piece behind: what goes on for long is looked at in pieces.
        let zigzag = (0..40_000).map(|k| [f64::from(k % 2) * 50.0, 0.01 * f64::from(k / 2), 1.0]);
        let straight = (0..5_000).map(|k| [0.01 * f64::from(k), 200.0, 1.0]);
        let run: Vec<Nib> = zigzag.chain(straight).collect();
        let kept = simplified(&run);
        assert!(kept.len() > 39_000 && kept.len() < 40_000 + 5_000 / TOGETHER + 5, "{}", kept.len());
        assert_eq!((kept[0], kept[kept.len() - 1]), (run[0], run[run.len() - 1]));
        for few in 1..4 {
            assert_eq!(simplified(&run[..few]).len(), few);
        }
    }
}
