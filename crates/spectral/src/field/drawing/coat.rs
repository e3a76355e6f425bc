//! Coats of fur: strands that grow by area, lean along a field, bend, fall and clump.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use chladni_base::{Cancelled, Monitor, SplitMix64, Vector3};

use crate::operator::frames::complex;

use super::super::surface::FieldSurface;
use super::light::blend;
use super::outward::outward_normals;
use super::{cross, dot, unit_vector};

/// Points that a strand has at most.
pub const MOST_STRAND_POINTS: usize = 32;

/// Points of all strands together at most.
pub const MOST_POINTS: usize = 8_000_000;

/// One strand of so many leads those around it.
const FOLLOWERS: usize = 24;

/// Directions of a strand have at least this share along the normal: it does not grow into the surface.
const LEAST_RISE: f64 = 0.04;

/// How a coat grows.
#[derive(Debug, Clone, PartialEq)]
pub struct CoatParameters {
    /// Strands.
    pub strands: usize,
    /// Points of a strand, its root first; at least 2.
    pub points: usize,
    /// Length of a strand in the units of the input.
    pub length: f64,
    /// How far strands lean at their root, in radians from the normal, where the field is as long as `full` or longer.
    pub tilt: f64,
    /// The length of the field at which strands lean that far.
    pub full: f64,
    /// How much further they lean at their tip, in radians.
    pub bend: f64,
    /// How much they fall: 1 turns the tip of a strand that stands across as much downwards as it grows.
    pub gravity: f64,
    /// Downwards.
    pub down: [f64; 3],
    /// How much strands differ, as a share of their length and of a right angle.
    pub noise: f64,
    /// How much tips gather in tufts, from 0 to 1.
    pub clump: f64,
    /// The seed of places and differences.
    pub seed: u64,
}

/// Strands of equally many points.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coat {
    /// Points of a strand.
    pub points: usize,
    /// The points of all strands, strand by strand from root to tip, in the units of the input.
    pub positions: Vec<[f64; 3]>,
    /// The face that each strand grows in.
    pub faces: Vec<u32>,
    /// The unit normal at each root.
    pub normals: Vec<[f64; 3]>,
}

/// Grows a coat along a vector field of two numbers per face, with a factor of the length for each face where `lengths`
/// are given. The same seed gives the same coat. `None` unless field and lengths fit, the parameters are finite and in
/// their ranges, and the surface has an area.
///
/// # Errors
/// [`Cancelled`].
pub fn grow(
    surface: &FieldSurface,
    field: &[f32],
    lengths: Option<&[f32]>,
    parameters: &CoatParameters,
    monitor: &dyn Monitor,
) -> Result<Option<Coat>, Cancelled> {
    let faces = surface.faces();
    let p = parameters;
    let numbers = [p.length, p.tilt, p.full, p.bend, p.gravity, p.noise, p.clump];
    let sound = numbers.iter().chain(&p.down).all(|x| x.is_finite())
        && p.full > 0.0
        && p.noise >= 0.0
        && (0.0..=1.0).contains(&p.clump)
        && (2..=MOST_STRAND_POINTS).contains(&p.points)
        && p.strands <= MOST_POINTS / p.points
        && field.len() == 2 * faces
        && lengths.is_none_or(|lengths| lengths.len() == faces)
        && surface.frames().area() > 0.0;
    if !sound {
        return Ok(None);
    }
    monitor.stage("fur");
    let vectors = at_vertices(surface, field);
    let normals = outward_normals(surface);
    let grower = Grower { surface, vectors, normals, lengths, p, down: unit_vector(p.down) };
    let mut coat = Coat { points: p.points, ..Coat::default() };
    let mut random = SplitMix64::new(p.seed);
    for (strand, (face, weights)) in roots(surface, p.strands, &mut random).into_iter().enumerate() {
        if strand.is_multiple_of(4096) {
            monitor.checkpoint()?;
            monitor.progress(strand as f64 / p.strands as f64);
        }
        grower.strand(face, weights, &mut random, &mut coat);
    }
    if p.clump > 0.0 {
        gather(&mut coat, p.clump, surface.frames().area(), monitor)?;
    }
    Ok(Some(coat))
}

/// Places spread by area, one in each of equal shares of it in the order of faces.
fn roots(surface: &FieldSurface, strands: usize, random: &mut SplitMix64) -> Vec<(u32, [f64; 3])> {
    let areas = surface.frames().areas();
    let share = areas.iter().sum::<f64>() / strands.max(1) as f64;
    let (mut face, mut passed) = (0, 0.0);
    (0..strands)
        .map(|strand| {
            let wanted = (strand as f64 + random.unit()) * share;
            while face + 1 < areas.len() && passed + areas[face] < wanted {
                passed += areas[face];
                face += 1;
            }
            let (s, t) = (random.unit().sqrt(), random.unit());
            (face as u32, [1.0 - s, s * (1.0 - t), s * t])
        })
        .collect()
}

/// The field at vertices, as means by area of the vectors of faces.
fn at_vertices(surface: &FieldSurface, field: &[f32]) -> Vec<[f64; 3]> {
    let (mesh, frames) = (surface.mesh(), surface.frames());
    let mut sums = vec![(Vector3::ZERO, 0.0); mesh.positions.len()];
    for (f, face) in mesh.faces.iter().enumerate() {
        let vector = frames.to_world(f, complex([field[2 * f], field[2 * f + 1]].map(f64::from)));
        let area = frames.areas()[f];
        for &v in face {
            let (sum, weight) = &mut sums[v as usize];
            *sum += area * vector;
            *weight += area;
        }
    }
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { sum }.into()).collect()
}

struct Grower<'a> {
    surface: &'a FieldSurface,
    vectors: Vec<[f64; 3]>,
    normals: Vec<[[f64; 3]; 3]>,
    lengths: Option<&'a [f32]>,
    p: &'a CoatParameters,
    down: [f64; 3],
}

impl Grower<'_> {
    fn strand(&self, face: u32, weights: [f64; 3], random: &mut SplitMix64, coat: &mut Coat) {
        let (mesh, f, p) = (self.surface.mesh(), face as usize, self.p);
        let mix = |of: &[[f64; 3]]| {
            [0, 1, 2].map(|i| (0..3).map(|k| weights[k] * of[mesh.faces[f][k] as usize][i]).sum::<f64>())
        };
        let (root, vector) = (mix(&mesh.positions), mix(&self.vectors));
        let normal = blend(&self.normals[f], weights);
        let rise = dot(vector, normal);
        let vector = [0, 1, 2].map(|i| vector[i] - rise * normal[i]);
        let size = dot(vector, vector).sqrt();
        let share = (size / p.full).min(1.0);
        // Where the field is zero no way is the first, and what differs leans any way.
        let any = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let along = if size > 0.0 { vector.map(|x| x / size) } else { unit_vector(cross(normal, any)) };
        let side = cross(normal, along);
        let (turn, lean) = (p.noise * bell(random), p.noise * bell(random));
        let length = p.length * (1.0 - p.noise.min(1.0) * random.unit());
        let length = length * self.lengths.map_or(1.0, |lengths| f64::from(lengths[f]));
        let whirl = if size > 0.0 { turn * share } else { PI * random.signed_unit() };
        let heading = [0, 1, 2].map(|i| whirl.cos() * along[i] + whirl.sin() * side[i]);
        coat.faces.push(face);
        coat.normals.push(normal);
        let (mut here, step) = (root, length / (p.points - 1) as f64);
        coat.positions.push(here);
        for point in 1..p.points {
            let s = (point - 1) as f64 / (p.points - 1).max(1) as f64;
            let angle = (p.tilt + p.bend * s) * share + lean * 0.5 * (1.0 + s);
            let (sine, cosine) = angle.sin_cos();
            let grown = [0, 1, 2].map(|i| cosine * normal[i] + sine * heading[i] + p.gravity * s * self.down[i]);
            let grown = lifted(unit_vector(grown), normal);
            here = [0, 1, 2].map(|i| here[i] + step * grown[i]);
            coat.positions.push(here);
        }
    }
}

/// A direction turned out of the surface where it would grow into it.
fn lifted(direction: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let rise = dot(direction, normal);
    if rise >= LEAST_RISE {
        return direction;
    }
    unit_vector([0, 1, 2].map(|i| direction[i] + (LEAST_RISE - rise) * normal[i]))
}

/// A normally distributed number (Box and Muller).
fn bell(random: &mut SplitMix64) -> f64 {
    (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (TAU * random.unit()).cos()
}

/// Draws the tips of strands to those of the nearest of some that lead.
fn gather(coat: &mut Coat, clump: f64, area: f64, monitor: &dyn Monitor) -> Result<(), Cancelled> {
    let strands = coat.faces.len();
    let apart = (area * FOLLOWERS as f64 / strands.max(1) as f64).sqrt();
    let cell = |p: [f64; 3]| p.map(|x| (x / apart).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for leader in (0..strands).filter(|&strand| leads(strand)) {
        cells.entry(cell(coat.positions[leader * coat.points])).or_default().push(leader);
    }
    let before = coat.positions.clone();
    for strand in 0..strands {
        if strand.is_multiple_of(1024) {
            monitor.checkpoint()?;
        }
        let root = before[strand * coat.points];
        let [x, y, z] = cell(root);
        let mut nearest: Option<(usize, f64)> = None;
        for k in 0..27 {
            let Some(leaders) = cells.get(&[x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]) else { continue };
            for &leader in leaders {
                let other = before[leader * coat.points];
                let far: f64 = (0..3).map(|i| (other[i] - root[i]).powi(2)).sum();
                let alike = dot(coat.normals[leader], coat.normals[strand]) > 0.3;
                if alike && nearest.is_none_or(|n| far < n.1) {
                    nearest = Some((leader, far));
                }
            }
        }
        let Some((leader, _)) = nearest else { continue };
        for point in 1..coat.points {
            let s = point as f64 / (coat.points - 1) as f64;
            let (own, other) = (before[strand * coat.points + point], before[leader * coat.points + point]);
            let share = clump * s * s;
            coat.positions[strand * coat.points + point] = [0, 1, 2].map(|i| (1.0 - share) * own[i] + share * other[i]);
        }
    }
    Ok(())
}

/// Whether a strand is one that others gather around: one of so many, at random.
fn leads(strand: usize) -> bool {
    SplitMix64::new(strand as u64).below(FOLLOWERS) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::frames::parts;
    use chladni_base::Unwatched;
    use chladni_mesh::TriangleMesh;
    use chladni_mesh::shape::{Shape, generate};

    const PLAIN: CoatParameters = CoatParameters {
        strands: 20_000,
        points: 6,
        length: 0.1,
        tilt: 1.0,
        full: 1.0,
        bend: 0.0,
        gravity: 0.0,
        down: [0.0, 0.0, -1.0],
        noise: 0.0,
        clump: 0.0,
        seed: 7,
    };

    fn grown(surface: &FieldSurface, field: &[f32], parameters: &CoatParameters) -> Option<Coat> {
        grow(surface, field, None, parameters, &Unwatched).unwrap()
    }

    fn along_x(surface: &FieldSurface) -> Vec<f32> {
        let of = |f: usize| parts(surface.frames().from_world(f, Vector3::AXES[0])).map(|x| x as f32);
        (0..surface.faces()).flat_map(of).collect()
    }

    /// A plate whose faces differ in area by up to a hundred times.
    fn uneven() -> FieldSurface {
        let plate = generate(Shape::Rectangle, 800).unwrap();
        let positions = plate.positions.iter().map(|p| [p[0].powi(3), p[1], 0.0]).collect();
        FieldSurface::new(TriangleMesh { positions, faces: plate.faces, ..Default::default() }).unwrap()
    }

    #[test]
    fn strands_grow_by_area() {
        let surface = uneven();
        let coat = grown(&surface, &along_x(&surface), &PLAIN).unwrap();
        assert_eq!((coat.faces.len(), coat.positions.len()), (20_000, 120_000));
        let mut counts = vec![0.0; surface.faces()];
        coat.faces.iter().for_each(|&f| counts[f as usize] += 1.0);
        let areas = surface.frames().areas();
        for (count, area) in counts.iter().zip(areas) {
            let expected = 20_000.0 * area / areas.iter().sum::<f64>();
            assert!((count - expected).abs() <= 2.0, "{count} {expected}");
        }
    }

    #[test]
    fn without_noise_strands_are_straight_and_as_long_and_as_tilted_as_they_are_asked_for() {
        let surface = uneven();
        let coat = grown(&surface, &along_x(&surface), &PLAIN).unwrap();
        for strand in coat.positions.chunks_exact(6) {
            let tip = [0, 1, 2].map(|i| strand[5][i] - strand[0][i]);
            let expected = [0.1 * 1f64.sin(), 0.0, 0.1 * 1f64.cos()];
            assert!((0..3).all(|i| (tip[i] - expected[i]).abs() < 1e-6), "{tip:?}");
        }
        let still = grown(&surface, &vec![0.0; 2 * surface.faces()], &PLAIN).unwrap();
        assert!(still.positions.chunks_exact(6).all(|s| (s[5][2] - 0.1).abs() < 1e-9));
        let halves = vec![0.5; surface.faces()];
        let half = grow(&surface, &along_x(&surface), Some(halves.as_slice()), &PLAIN, &Unwatched);
        assert!(half.unwrap().unwrap().positions.chunks_exact(6).all(|s| (s[5][2] - 0.05 * 1f64.cos()).abs() < 1e-6));
    }

    #[test]
    fn bends_and_gravity_lower_tips_and_never_below_the_surface() {
        let surface = uneven();
        let field = along_x(&surface);
        let height = |p: &CoatParameters| {
            let coat = grown(&surface, &field, p).unwrap();
            assert!(coat.positions.chunks_exact(6).all(|s| s.windows(2).all(|w| w[1][2] > w[0][2])));
            coat.positions[5][2]
        };
        let straight = height(&PLAIN);
        let bent = height(&CoatParameters { bend: 0.5, ..PLAIN });
        let fallen = height(&CoatParameters { gravity: 0.5, ..PLAIN });
        let heavy = height(&CoatParameters { gravity: 50.0, bend: 3.0, noise: 0.3, ..PLAIN });
        assert!(
            bent < 0.95 * straight && fallen < 0.95 * straight && heavy > 0.0,
            "{straight} {bent} {fallen} {heavy}"
        );
    }

    #[test]
    fn the_seed_decides_and_noise_and_tufts_do_what_they_say() {
        let surface = uneven();
        let field = along_x(&surface);
        let rough = CoatParameters { noise: 0.2, ..PLAIN };
        let coat = grown(&surface, &field, &rough).unwrap();
        assert_eq!(grown(&surface, &field, &rough).unwrap(), coat);
        assert_ne!(grown(&surface, &field, &CoatParameters { seed: 8, ..rough.clone() }).unwrap(), coat);
        let lengths = coat.positions.chunks_exact(6).map(|s| {
            s.windows(2).map(|w| (0..3).map(|i| (w[1][i] - w[0][i]).powi(2)).sum::<f64>().sqrt()).sum::<f64>()
        });
        let (low, high) = lengths.fold((1.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
        assert!(low > 0.0799 && low < 0.081 && high < 0.1001 && high > 0.099, "{low} {high}");
        // Tips in tufts are nearer to those that lead than they were.
        let tufts = grown(&surface, &field, &CoatParameters { clump: 1.0, ..rough }).unwrap();
        let distinct = |coat: &Coat| {
            let tips = coat.positions.chunks_exact(6).map(|s| s[5].map(f64::to_bits));
            tips.collect::<std::collections::HashSet<_>>().len()
        };
        assert!(distinct(&tufts) < 1500 && distinct(&coat) == 20_000, "{}", distinct(&tufts));
    }

    #[test]
    fn what_does_not_fit_grows_nothing() {
        let surface = uneven();
        let field = along_x(&surface);
        let refused = |p: CoatParameters| grown(&surface, &field, &p).is_none();
        assert!(refused(CoatParameters { points: 1, ..PLAIN }) && refused(CoatParameters { full: 0.0, ..PLAIN }));
        assert!(
            refused(CoatParameters { length: f64::NAN, ..PLAIN }) && refused(CoatParameters { clump: 1.5, ..PLAIN })
        );
        assert!(
            refused(CoatParameters { strands: usize::MAX, ..PLAIN }) && grown(&surface, &field[1..], &PLAIN).is_none()
        );
        assert_eq!(grown(&surface, &field, &CoatParameters { strands: 0, ..PLAIN }).unwrap().faces.len(), 0);
    }
}
