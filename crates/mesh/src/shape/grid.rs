//! Tubes around closed curves: grids that close both ways, every second row shifted by half a step.

use super::{KNOT_TUBE_RADIUS, TORUS_MAJOR_RADIUS, TORUS_MINOR_RADIUS};
use crate::TriangleMesh;
use chladni_base::Vector3;
use std::f64::consts::TAU;

/// Points of a closed curve at equal steps, each with two unit vectors that span the plane across it. The angle around
/// the tube runs from the first to the second, and `first × tangent = second`.
struct Frame {
    centre: Vector3,
    first: Vector3,
    second: Vector3,
}

pub(super) fn torus(vertices: usize) -> TriangleMesh {
    let (rows, columns) = pattern(TAU * TORUS_MAJOR_RADIUS, TAU * TORUS_MINOR_RADIUS, vertices);
    let frames = (0..2 * columns).map(|i| {
        let (sin, cos) = (TAU * i as f64 / (2 * columns) as f64).sin_cos();
        let centre = Vector3::new(TORUS_MAJOR_RADIUS * cos, TORUS_MAJOR_RADIUS * sin, 0.0);
        Frame { centre, first: Vector3::new(cos, sin, 0.0), second: Vector3::AXES[2] }
    });
    tube(&frames.collect::<Vec<_>>(), rows, TORUS_MINOR_RADIUS)
}

pub(super) fn knot(vertices: usize) -> TriangleMesh {
    let curve = Curve::new(KNOT_SAMPLES);
    let (rows, columns) = pattern(curve.length(), TAU * KNOT_TUBE_RADIUS, vertices);
    tube(&curve.frames(2 * columns), rows, KNOT_TUBE_RADIUS)
}

/// Rows (an even number) around a tube and columns along it, for triangles as equilateral as whole numbers allow and a
/// product as near to `vertices` as a change of two rows can bring it.
fn pattern(along: f64, around: f64, vertices: usize) -> (usize, usize) {
    let side = (along * around * 2.0 / (3f64.sqrt() * vertices as f64)).sqrt();
    let ideal = ((around / (side * 3f64.sqrt())).round() as usize).max(2);
    let columns = |half_rows: usize| ((vertices as f64 / (2 * half_rows) as f64).round() as usize).max(3);
    let best = (ideal.saturating_sub(1).max(2)..=ideal + 1)
        .min_by_key(|&half| ((2 * half * columns(half)).abs_diff(vertices), half.abs_diff(ideal)))
        .unwrap_or(ideal);
    (2 * best, columns(best))
}

/// The tube of a radius around a curve, given by frames at half steps of its columns.
fn tube(frames: &[Frame], rows: usize, radius: f64) -> TriangleMesh {
    let columns = frames.len() / 2;
    let mut positions = Vec::with_capacity(rows * columns);
    for j in 0..rows {
        let (sin, cos) = (TAU * j as f64 / rows as f64).sin_cos();
        positions.extend(
            frames
                .iter()
                .skip(j % 2)
                .step_by(2)
                .map(|frame| -> [f64; 3] { (frame.centre + radius * (cos * frame.first + sin * frame.second)).into() }),
        );
    }
    let mut faces = Vec::with_capacity(2 * rows * columns);
    for j in 0..rows {
        let number = |i: usize, row: usize| ((row % rows) * columns + i % columns) as u32;
        for i in 0..columns {
            let [a, b] = [number(i, j), number(i + 1, j)];
            let [c, d] = [number(i, j + 1), number(i + 1, j + 1)];
            if j % 2 == 0 { faces.extend([[a, b, c], [b, d, c]]) } else { faces.extend([[a, d, c], [a, b, d]]) }
        }
    }
    TriangleMesh { positions, faces, ..Default::default() }
}

/// Enough samples of the knot for an arc length good to 1e-7.
const KNOT_SAMPLES: usize = 1 << 13;

/// The (2, 3) torus knot, sampled at equal parameters, with arc lengths and frames that do not turn about it.
struct Curve {
    /// Arc length up to each sample and, last, the whole.
    lengths: Vec<f64>,
    /// The first frame vector at each sample and, last, after one turn.
    normals: Vec<Vector3>,
}

impl Curve {
    fn new(samples: usize) -> Self {
        let parameter = |i: usize| TAU * i as f64 / samples as f64;
        let mut lengths = vec![0.0];
        let mut normals = vec![unit(tangent(0.0).cross(Vector3::AXES[2]))];
        for i in 0..samples {
            let (t, u) = (parameter(i), parameter(i + 1));
            // Simpson's rule for the arc, a double reflection for the frame (Wang et al. 2008).
            let speed = [t, (t + u) / 2.0, u].map(|t| velocity(t).norm());
            lengths.push(lengths[i] + (speed[0] + 4.0 * speed[1] + speed[2]) / 6.0 * (u - t));
            let chord = point(u) - point(t);
            let (normal, forward) = (reflect(normals[i], chord), reflect(tangent(t), chord));
            normals.push(reflect(normal, tangent(u) - forward));
        }
        Self { lengths, normals }
    }

    fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// Frames at `count` equal steps of arc length. The angle by which a frame that does not turn misses itself after
    /// one round is spread over the whole curve.
    fn frames(&self, count: usize) -> Vec<Frame> {
        let samples = self.lengths.len() - 1;
        let (start, end) = (self.normals[0], self.normals[samples]);
        let sideways = start.cross(tangent(0.0));
        let miss = end.dot(sideways).atan2(end.dot(start));
        let frames = (0..count).map(|i| {
            let share = i as f64 / count as f64;
            let length = share * self.length();
            let before = self.lengths.partition_point(|&l| l <= length).clamp(1, samples) - 1;
            let step = self.lengths[before + 1] - self.lengths[before];
            let t = TAU * (before as f64 + (length - self.lengths[before]) / step) / samples as f64;
            let forward = tangent(t);
            // The normal of the sample before, made square to the exact tangent: samples lie close.
            let rough = self.normals[before];
            let along = rough.dot(forward);
            let normal = unit(rough - along * forward);
            let side = normal.cross(forward);
            let (sin, cos) = (-miss * share).sin_cos();
            let first = cos * normal + sin * side;
            Frame { centre: point(t), first, second: first.cross(forward) }
        });
        frames.collect()
    }
}

fn point(t: f64) -> Vector3 {
    let ring = 2.0 + (3.0 * t).cos();
    Vector3::new(ring * (2.0 * t).cos(), ring * (2.0 * t).sin(), (3.0 * t).sin())
}

fn velocity(t: f64) -> Vector3 {
    let (ring, slope) = (2.0 + (3.0 * t).cos(), -3.0 * (3.0 * t).sin());
    let (sin, cos) = (2.0 * t).sin_cos();
    Vector3::new(slope * cos - 2.0 * ring * sin, slope * sin + 2.0 * ring * cos, 3.0 * (3.0 * t).cos())
}

fn tangent(t: f64) -> Vector3 {
    unit(velocity(t))
}

/// `v` mirrored in the plane across `axis`; `v` itself where `axis` is zero.
fn reflect(v: Vector3, axis: Vector3) -> Vector3 {
    let square = axis.norm_squared();
    let twice = if square > 0.0 { 2.0 * v.dot(axis) / square } else { 0.0 };
    v - twice * axis
}

/// Of a curve without corners: no vector here is zero.
fn unit(a: Vector3) -> Vector3 {
    a / a.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tube_of_the_knot_does_not_touch_itself() {
        let curve = Curve::new(KNOT_SAMPLES);
        let centres: Vec<Vector3> = curve.frames(1200).iter().map(|frame| frame.centre).collect();
        let length = curve.length();
        let far_apart = 2.0 * TAU * KNOT_TUBE_RADIUS;
        let mut nearest = f64::INFINITY;
        for i in 0..centres.len() {
            for j in 0..i {
                let along = (i - j).min(centres.len() - (i - j)) as f64 * length / centres.len() as f64;
                if along > far_apart {
                    nearest = nearest.min((centres[i] - centres[j]).norm());
                }
            }
        }
        assert!(nearest > 2.2 * KNOT_TUBE_RADIUS, "strands come as near as {nearest}");
    }

    #[test]
    fn frames_are_orthonormal_and_close() {
        let curve = Curve::new(KNOT_SAMPLES);
        let frames = curve.frames(3000);
        for i in 0..frames.len() {
            let (f, next) = (&frames[i], &frames[(i + 1) % frames.len()]);
            assert!((f.first.norm() - 1.0).abs() < 1e-12 && f.first.dot(f.second).abs() < 1e-12);
            assert!(f.first.dot(next.first) > 0.9998, "frame {i} turns");
        }
    }
}
