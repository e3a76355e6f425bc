//! Evenly spaced streamlines of n-fields on a surface (Jobard and Lefer 1997): the strokes of a hatching.
//!
//! Where a field has several directions, lines cross those of the others and keep their distance only from their own
//! kind: those that run within half the angle between two directions.

use std::collections::VecDeque;

use chladni_base::{Cancelled, Monitor, Vector3};
use chladni_mesh::dual::NO_FACE;

use crate::operator::frames::{Complex64, ONE, inner, outer};

use super::samples::{Sample, Samples};
use super::surface::FieldSurface;

/// Lines are sampled at this share of the spacing.
const SAMPLE_SHARE: f64 = 0.25;

/// Samples of one line between two looks at whether the work was cancelled.
const SAMPLES_AT_ONCE: usize = 4096;

/// A line is given up where it crosses so many edges between two samples: it goes round in circles.
const MOST_IDLE_CROSSINGS: usize = 2000;

/// A line ends after so many times the square root of the area, whatever its way.
const LONGEST: f64 = 100.0;

/// Levels at most.
const MOST_LEVELS: u32 = 6;

/// Lines of further levels begin where no other is closer than this share of the spacing: between two lines there is
/// not always a whole spacing on both sides.
const BETWEEN_SHARE: f64 = 0.75;

/// A line ends where another is closer than this share of the spacing.
const TEST_SHARE: f64 = 0.6;

/// How lines are laid.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HatchingParameters {
    /// The distance between lines, in units of the square root of the surface's area.
    pub spacing: f64,
    /// Shorter lines are left out, in multiples of the spacing.
    pub least_length: f64,
    /// Lines at most.
    pub most_lines: usize,
    /// How many levels there are, 1 to 6: the lines of the first are `2^(levels − 1)` spacings apart, those of each
    /// further one lie between those that are there, at half the distance; the last are at the spacing.
    pub levels: u32,
}

impl Default for HatchingParameters {
    fn default() -> Self {
        Self { spacing: 0.01, least_length: 2.0, most_lines: 100_000, levels: 1 }
    }
}

/// A line on the surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Streamline {
    /// Its points, in the units of the input: one for each edge that it crosses, and its ends.
    pub points: Vec<[f64; 3]>,
    /// The face that each piece lies in: one fewer than points.
    pub faces: Vec<u32>,
    /// The level that it belongs to, counted from 0.
    pub level: u32,
}

/// Why there are no lines.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StreamlineError {
    /// A parameter is out of its range.
    #[error("parameter {name} is {value}; it must be {range}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// The field does not fit.
    #[error("the field has {got} numbers, not two for each of {faces} faces")]
    Length {
        /// How many there are.
        got: usize,
        /// The number of faces.
        faces: usize,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Evenly spaced lines that follow the `n` directions of a field of representation vectors, two numbers per face; those
/// along one direction cross those along another. Seeds lie beside lines that are there and on them, then in faces that
/// no line comes near; the same field gives the same lines.
///
/// # Errors
/// [`StreamlineError`]: parameters out of range, a field that does not fit, or the work was cancelled.
pub fn streamlines(
    surface: &FieldSurface,
    n: u32,
    field: &[f32],
    parameters: &HatchingParameters,
    monitor: &dyn Monitor,
) -> Result<Vec<Streamline>, StreamlineError> {
    let faces = surface.faces();
    if field.len() != 2 * faces {
        return Err(StreamlineError::Length { got: field.len(), faces });
    }
    if n == 0 {
        return Err(StreamlineError::Parameter { name: "n", value: 0.0, range: "at least 1" });
    }
    if !(parameters.spacing > 1e-5 && parameters.spacing <= 10.0) {
        let range = "above 0.00001 and up to 10";
        return Err(StreamlineError::Parameter { name: "spacing", value: parameters.spacing, range });
    }
    if !(parameters.least_length >= 0.0 && parameters.least_length.is_finite()) {
        let range = "a finite number of at least 0";
        return Err(StreamlineError::Parameter { name: "least_length", value: parameters.least_length, range });
    }
    if !(1..=MOST_LEVELS).contains(&parameters.levels) {
        let range = "a whole number from 1 to 6";
        return Err(StreamlineError::Parameter { name: "levels", value: f64::from(parameters.levels), range });
    }
    monitor.stage("streamlines");
    let step = SAMPLE_SHARE * parameters.spacing;
    let mut hatching =
        Hatching { surface, n, field, level: 0, spacing: 0.0, step, samples: Samples::new(1.0), lines: Vec::new() };
    for level in 0..parameters.levels {
        hatching.begin(level, parameters.spacing * f64::from(1u32 << (parameters.levels - 1 - level)));
        hatching.fill(parameters, monitor)?;
    }
    Ok(hatching.lines)
}

/// A point of the surface.
#[derive(Debug, Clone, Copy)]
struct SurfacePoint {
    face: u32,
    /// Weights of its corners.
    at: [f64; 3],
}

/// Where a line may begin, and in which direction of the field there.
#[derive(Debug, Clone, Copy)]
struct Seed {
    place: SurfacePoint,
    along: Complex64,
}

struct Hatching<'a> {
    surface: &'a FieldSurface,
    n: u32,
    field: &'a [f32],
    level: u32,
    spacing: f64,
    /// The distance of samples along lines.
    step: f64,
    samples: Samples,
    lines: Vec<Streamline>,
}

/// One way from a seed.
#[derive(Default)]
struct Half {
    places: Vec<SurfacePoint>,
    length: f64,
}

impl Hatching<'_> {
    /// Goes on to a level with lines at another spacing: those that are there stay, in cells of its size.
    fn begin(&mut self, level: u32, spacing: f64) {
        (self.level, self.spacing) = (level, spacing);
        self.samples = std::mem::replace(&mut self.samples, Samples::new(spacing)).resized(spacing);
    }

    /// Lays the lines of a level.
    fn fill(&mut self, parameters: &HatchingParameters, monitor: &dyn Monitor) -> Result<(), StreamlineError> {
        let faces = self.surface.faces();
        let before: Vec<Seed> = self.lines.iter().flat_map(|line| self.seeds_around(line)).collect();
        let mut seeds = VecDeque::from(before);
        let apart = if self.level == 0 { 1.0 } else { BETWEEN_SHARE } * self.spacing;
        let mut next_face = 0;
        while self.lines.len() < parameters.most_lines {
            let Some(seed) = seeds.pop_front() else {
                if next_face == faces {
                    break;
                }
                let place = SurfacePoint { face: next_face as u32, at: [1.0 / 3.0; 3] };
                seeds.extend(self.families(place, ONE));
                next_face += 1;
                continue;
            };
            if next_face.is_multiple_of(256) || seeds.len().is_multiple_of(64) {
                monitor.checkpoint()?;
                let done = f64::from(self.level) + next_face as f64 / faces as f64;
                monitor.progress(done / f64::from(parameters.levels));
            }
            if self.is_near(&seed.place, seed.along, apart, None) {
                continue;
            }
            if let Some(line) = self.trace_line(&seed, parameters.least_length * self.spacing, monitor)? {
                seeds.extend(self.seeds_around(&line));
            }
        }
        Ok(())
    }

    /// The positions of the corners of a face in its frame, the first at the origin; unit area.
    fn corners(&self, face: u32) -> [Complex64; 3] {
        let e = self.surface.frames().edges(face as usize);
        [Complex64::ZERO, e[2], -e[1]]
    }

    /// A place in space, in units of the square root of the area.
    fn point(&self, place: &SurfacePoint) -> [f64; 3] {
        let scale = 1.0 / self.surface.frames().area().sqrt();
        (Vector3(self.position(place)) * scale).into()
    }

    fn position(&self, place: &SurfacePoint) -> [f64; 3] {
        let mesh = self.surface.mesh();
        let face = mesh.faces[place.face as usize];
        let [p, q, r] = mesh.corners(&face);
        let [a, b, c] = place.at;
        (a * p + b * q + c * r).into()
    }

    /// The direction of the field in a face nearest to `towards`, of unit length; `None` where the field is zero. With
    /// a sign of −1 lines run against the field, which for even `n` is the same.
    fn direction(&self, face: u32, towards: Complex64, sign: f64) -> Option<Complex64> {
        let [x, y] = [0, 1].map(|i| f64::from(self.field[2 * face as usize + i]));
        if !(x.hypot(y) > 1e-30 && x.is_finite() && y.is_finite()) {
            return None;
        }
        let n = f64::from(self.n);
        let own = y.atan2(x) / n;
        let wanted = (sign * towards).arg();
        let turn = std::f64::consts::TAU / n;
        let (sine, cosine) = (own + turn * ((wanted - own) / turn).round()).sin_cos();
        Some(sign * Complex64::new(cosine, sine))
    }

    /// Goes straight from a place in a face: the weights where its edge is reached, the edge, and how far that is.
    fn exit(&self, place: &SurfacePoint, direction: Complex64) -> Option<(usize, [f64; 3], f64)> {
        let c = self.corners(place.face);
        let p: Complex64 = (0..3).map(|k| place.at[k] * c[k]).sum();
        let mut best: Option<(usize, [f64; 3], f64)> = None;
        for k in 0..3 {
            let (a, b) = (c[(k + 1) % 3], c[(k + 2) % 3]);
            let e = b - a;
            // Outwards through edge k is to its right.
            let speed = outer(direction, e);
            if speed <= 1e-14 {
                continue;
            }
            let t = (outer(a - p, e) / speed).max(0.0);
            if best.is_some_and(|b| b.2 <= t) {
                continue;
            }
            let q = p + t * direction - a;
            let s = (inner(q, e) / e.norm_sqr()).clamp(1e-9, 1.0 - 1e-9);
            let mut at = [0.0; 3];
            at[(k + 1) % 3] = 1.0 - s;
            at[(k + 2) % 3] = s;
            best = Some((k, at, t));
        }
        best.filter(|b| b.2.is_finite())
    }

    /// The same place and direction seen from the face across edge `k`, and whether that has the opposite orientation.
    fn cross(
        &self,
        face: u32,
        k: usize,
        at: [f64; 3],
        direction: Complex64,
    ) -> Option<(SurfacePoint, Complex64, bool)> {
        let dual = self.surface.dual();
        let next = dual.neighbours(face as usize)[k];
        if next == NO_FACE {
            return None;
        }
        let j = dual.slot(next, dual.edges(face as usize)[k]);
        let mut there = [0.0; 3];
        let turn = self.surface.frames().carry(dual, next as usize, j)?;
        let (from, to) = if turn.mirrored { (1, 2) } else { (2, 1) };
        (there[(j + 1) % 3], there[(j + 2) % 3]) = (at[(k + from) % 3], at[(k + to) % 3]);
        Some((SurfacePoint { face: next, at: there }, turn.of(direction), turn.mirrored))
    }

    /// Follows the field, or with a sign of −1 goes against it, until it ends, comes near a line, or returns.
    fn follow(
        &self,
        seed: &SurfacePoint,
        start: Complex64,
        line: u32,
        own: &mut Samples,
        sign: f64,
        monitor: &dyn Monitor,
    ) -> Result<Half, Cancelled> {
        let mut half = Half::default();
        let (mut here, mut direction) = (*seed, start);
        let step = self.step;
        // Where the line was sampled last, and the crossings since.
        let (mut sampled, mut idle, mut samples) = (0.0, 0, 0usize);
        while idle < MOST_IDLE_CROSSINGS && half.length < LONGEST {
            idle += 1;
            let Some((k, at, distance)) = self.exit(&here, direction) else { break };
            let end = half.length + distance;
            let mut stopped = false;
            while sampled + step <= end {
                sampled += step;
                idle = 0;
                let s = ((sampled - half.length) / distance).clamp(0.0, 1.0);
                let place = SurfacePoint { face: here.face, at: between(here.at, at, s) };
                let own_place = Some((line, sign * sampled));
                stopped = self.near_in(own, &place, direction, TEST_SHARE * self.spacing, own_place)
                    || self.is_near(&place, direction, TEST_SHARE * self.spacing, None);
                if stopped {
                    break;
                }
                own.insert(self.sample(&place, direction, (line, sign * sampled)));
                samples += 1;
                if samples.is_multiple_of(SAMPLES_AT_ONCE) {
                    monitor.checkpoint()?;
                }
            }
            if stopped {
                break;
            }
            half.places.push(SurfacePoint { face: here.face, at });
            half.length = end;
            let Some((place, carried, _)) = self.cross(here.face, k, at, direction) else { break };
            let Some(next) = self.direction(place.face, carried, sign) else { break };
            // A field that points back out at once would go to and fro.
            if inner(next, carried) <= 0.0 {
                break;
            }
            (here, direction) = (place, next);
        }
        Ok(half)
    }

    /// Lays the line through a seed; `None` where it is too short.
    fn trace_line(
        &mut self,
        &Seed { place: seed, along: start }: &Seed,
        least: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Streamline>, Cancelled> {
        let line = self.lines.len() as u32;
        let mut own = Samples::new(self.spacing);
        own.insert(self.sample(&seed, start, (line, 0.0)));
        let forward = self.follow(&seed, start, line, &mut own, 1.0, monitor)?;
        let backward = self.follow(&seed, -start, line, &mut own, -1.0, monitor)?;
        if forward.length + backward.length < least || forward.places.len() + backward.places.len() == 0 {
            return Ok(None);
        }
        let mut laid = Streamline { level: self.level, ..Streamline::default() };
        for place in backward.places.iter().rev() {
            laid.points.push(self.position(place));
            laid.faces.push(place.face);
        }
        laid.points.push(self.position(&seed));
        for place in &forward.places {
            laid.points.push(self.position(place));
            laid.faces.push(place.face);
        }
        self.samples.absorb(own);
        self.lines.push(laid.clone());
        Ok(Some(laid))
    }

    /// The kinds of lines, whichever way they run.
    fn kinds(&self) -> u32 {
        if self.n.is_multiple_of(2) { self.n / 2 } else { self.n }
    }

    /// A seed at a place for each kind of lines, the one nearest to a direction first.
    fn families(&self, place: SurfacePoint, towards: Complex64) -> impl Iterator<Item = Seed> + use<> {
        let first = self.direction(place.face, towards, 1.0);
        let (turn, kinds) = (std::f64::consts::TAU / f64::from(self.n), self.kinds());
        first.into_iter().flat_map(move |first| {
            (0..kinds).map(move |k| {
                let (sine, cosine) = (turn * f64::from(k)).sin_cos();
                Seed { place, along: first * Complex64::new(cosine, sine) }
            })
        })
    }

    /// Seeds of its own kind on either side of a line, a spacing away, and of the others on it.
    fn seeds_around(&self, line: &Streamline) -> Vec<Seed> {
        let frames = self.surface.frames();
        let scale = 1.0 / frames.area().sqrt();
        let mut seeds = Vec::new();
        let mut since = self.spacing;
        for (pair, &face) in line.points.windows(2).zip(&line.faces) {
            let [from, to] = [pair[0], pair[1]].map(Vector3);
            let piece = (to - from) * scale;
            since += piece.norm();
            if since < self.spacing {
                continue;
            }
            since = 0.0;
            let along = frames.from_world(face as usize, piece);
            let size = along.norm();
            if !(size > 0.0) {
                continue;
            }
            let middle = 0.5 * (from + to);
            let Some(place) = self.place_of(face, middle) else { continue };
            let along = along / size;
            for side in [1.0, -1.0] {
                let across = Complex64::new(-side * along.im, side * along.re);
                if let Some((there, carried, turned)) = self.walk(place, across, 1.02 * self.spacing) {
                    let side = if turned { -side } else { side };
                    seeds.extend(self.families(there, Complex64::new(side * carried.im, -side * carried.re)).take(1));
                }
            }
            seeds.extend(self.families(place, along).skip(1));
        }
        seeds
    }

    /// The weights of a point in the plane of a face.
    fn place_of(&self, face: u32, position: Vector3) -> Option<SurfacePoint> {
        let frames = self.surface.frames();
        let scale = 1.0 / frames.area().sqrt();
        let origin = self.surface.mesh().point(self.surface.mesh().faces[face as usize][0]);
        let p = frames.from_world(face as usize, (position - origin) * scale);
        let [_, b, c] = self.corners(face);
        let whole = outer(b, c);
        let (v, w) = (outer(p, c) / whole, outer(b, p) / whole);
        let at = [1.0 - v - w, v, w].map(|x: f64| x.clamp(0.0, 1.0));
        let sum: f64 = at.iter().sum();
        (sum > 0.5 && sum.is_finite()).then(|| SurfacePoint { face, at: at.map(|x| x / sum) })
    }

    /// Straight ahead for a distance, the direction there, and whether left and right have changed; `None` at a
    /// boundary.
    fn walk(&self, from: SurfacePoint, direction: Complex64, distance: f64) -> Option<(SurfacePoint, Complex64, bool)> {
        let (mut here, mut direction, mut rest, mut turned) = (from, direction, distance, false);
        for _ in 0..10_000 {
            let (k, at, reach) = self.exit(&here, direction)?;
            if reach >= rest {
                let s = if reach > 0.0 { rest / reach } else { 0.0 };
                let at = between(here.at, at, s);
                return Some((SurfacePoint { face: here.face, at }, direction, turned));
            }
            rest -= reach;
            let (next, along, mirrored) = self.cross(here.face, k, at, direction)?;
            (here, direction, turned) = (next, along, turned != mirrored);
        }
        None
    }

    fn sample(&self, place: &SurfacePoint, direction: Complex64, (line, along): (u32, f64)) -> Sample {
        let (frames, face) = (self.surface.frames(), place.face as usize);
        let (normal, direction) = (frames.normal(face), frames.to_world(face, direction));
        Sample { point: self.point(place), normal: normal.into(), direction: direction.into(), line, along }
    }

    fn is_near(&self, place: &SurfacePoint, direction: Complex64, distance: f64, own: Option<(u32, f64)>) -> bool {
        self.near_in(&self.samples, place, direction, distance, own)
    }

    /// Whether a sample of a line of the kind that runs in a direction lies within a distance, on the same side if
    /// there are two. Of the line `own` only what is far along it counts.
    fn near_in(
        &self,
        samples: &Samples,
        place: &SurfacePoint,
        direction: Complex64,
        distance: f64,
        own: Option<(u32, f64)>,
    ) -> bool {
        let point = self.point(place);
        let normal = self.surface.frames().normal(place.face as usize);
        let direction = self.surface.frames().to_world(place.face as usize, direction);
        let one_sided = self.surface.dual().oriented().is_err();
        // With one kind of lines any direction is near enough.
        let kinds = self.kinds();
        let alike = if kinds == 1 { -1.0 } else { (std::f64::consts::FRAC_PI_2 / f64::from(kinds)).cos() };
        samples.any(point, distance, |s| {
            let (facing, turned) = (Vector3(s.normal).dot(normal), Vector3(s.direction).dot(direction));
            let counts = own.is_none_or(|(line, along)| s.line != line || (s.along - along).abs() > 3.0 * distance);
            (facing > 0.0 || one_sided) && turned.abs() > alike && counts
        })
    }
}

/// Weights of corners a share of the way from one place in a face to another one.
fn between(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    ((1.0 - share) * Vector3(from) + share * Vector3(to)).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::frames::{parts, power};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};

    fn along(surface: &FieldSurface, n: u32, direction: impl Fn(Vector3) -> [f64; 3]) -> Vec<f32> {
        (0..surface.faces())
            .flat_map(|f| {
                let c = surface.mesh().barycentre(&surface.mesh().faces[f]);
                let v = surface.frames().from_world(f, direction(c).into());
                parts(power(v / v.norm().max(1e-12), n)).map(|x| x as f32)
            })
            .collect()
    }

    #[test]
    fn lines_of_a_parallel_field_are_straight_and_evenly_spaced() {
        let surface = FieldSurface::new(generate(Shape::Rectangle, 900).unwrap()).unwrap();
        let field = along(&surface, 2, |_| [1.0, 0.0, 0.0]);
        let parameters = HatchingParameters { spacing: 0.05, ..HatchingParameters::default() };
        let lines = streamlines(&surface, 2, &field, &parameters, &Unwatched).unwrap();
        let step = 0.05 * 1.6f64.sqrt();
        let mut heights: Vec<f64> = lines.iter().map(|l| l.points[0][1]).collect();
        heights.sort_by(f64::total_cmp);
        for line in &lines {
            assert!(line.points.iter().all(|p| (p[1] - line.points[0][1]).abs() < 1e-6));
            assert_eq!(line.points.len(), line.faces.len() + 1);
        }
        assert!((10..=24).contains(&lines.len()), "{}", lines.len());
        let gaps: Vec<f64> = heights.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > 1e-6).collect();
        assert!(gaps.iter().all(|g| *g > 0.55 * step && *g < 2.1 * step), "{gaps:?}");
    }

    #[test]
    fn lines_around_a_sphere_stay_at_their_latitude_and_apart() {
        let surface = FieldSurface::new(generate(Shape::Sphere, 2562).unwrap()).unwrap();
        for n in [1, 2, 4] {
            let field = along(&surface, n, |c| [-c[1], c[0], 0.0]);
            let parameters = HatchingParameters { spacing: 0.03, ..HatchingParameters::default() };
            let lines = streamlines(&surface, n, &field, &parameters, &Unwatched).unwrap();
            assert!(lines.len() > 5);
            if n <= 2 {
                let spread = |l: &Streamline| {
                    let z = l.points.iter().map(|p| p[2]);
                    z.clone().fold(-2.0, f64::max) - z.fold(2.0, f64::min)
                };
                let mut spreads: Vec<f64> = lines.iter().map(spread).collect();
                spreads.sort_by(f64::total_cmp);
                assert!(spreads[spreads.len() / 2] < 0.05, "{spreads:?}");
            }
        }
    }

    #[test]
    fn strange_fields_and_parameters_end_or_are_refused() {
        let surface = FieldSurface::new(generate(Shape::Torus, 200).unwrap()).unwrap();
        let parameters = HatchingParameters { spacing: 0.05, ..HatchingParameters::default() };
        let zero = vec![0f32; 2 * surface.faces()];
        assert_eq!(streamlines(&surface, 2, &zero, &parameters, &Unwatched), Ok(Vec::new()));
        let wild: Vec<f32> = (0..2 * surface.faces()).map(|i| ((i * i) as f32).sin()).collect();
        for n in [1, 2, 6] {
            assert!(streamlines(&surface, n, &wild, &parameters, &Unwatched).is_ok());
        }
        let mut broken = wild.clone();
        broken[7] = f32::NAN;
        assert!(streamlines(&surface, 2, &broken, &parameters, &Unwatched).is_ok());
        let refuse = |n, field: &[f32], spacing| {
            let parameters = HatchingParameters { spacing, ..HatchingParameters::default() };
            streamlines(&surface, n, field, &parameters, &Unwatched).is_err()
        };
        assert!(
            refuse(0, &wild, 0.1) && refuse(2, &wild[1..], 0.1) && refuse(2, &wild, 0.0) && refuse(2, &wild, f64::NAN)
        );
    }
}
