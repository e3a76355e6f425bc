//! Three objects to look at: a bell, the plate of a violin and a starfish.

use super::{plane, sphere};
use crate::TriangleMesh;
use std::f64::consts::FRAC_PI_2;

/// The profile of the bell from its crown on the axis to its rim, as a cubic Bézier curve: radius and height.
const PROFILE: [[f64; 2]; 4] = [[0.0, 1.35], [0.75, 1.35], [0.35, 0.3], [1.0, 0.0]];
/// Pieces by which the length of the profile is measured.
const PIECES: usize = 4000;

/// A bell around the z axis, its rim in the plane z = 0: the rings of a disk along its profile, equally far apart.
pub(super) fn bell(vertices: usize) -> TriangleMesh {
    let points: Vec<[f64; 2]> = (0..=PIECES).map(|i| profile(i as f64 / PIECES as f64)).collect();
    let mut lengths = vec![0.0];
    for pair in points.windows(2) {
        let piece = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        lengths.push(lengths[lengths.len() - 1] + piece);
    }
    let whole = lengths[PIECES];
    moved(plane::disk(vertices), |[x, y, _]| {
        let ring = x.hypot(y);
        let after = lengths.partition_point(|&length| length < ring * whole).clamp(1, PIECES);
        let part = ((ring * whole - lengths[after - 1]) / (lengths[after] - lengths[after - 1])).min(1.0);
        let [radius, height] =
            std::array::from_fn(|k| points[after - 1][k] + part * (points[after][k] - points[after - 1][k]));
        // On the axis there is no direction to go by.
        let across = if ring > 0.0 { radius / ring } else { 0.0 };
        [across * x, across * y, height]
    })
}

fn profile(t: f64) -> [f64; 2] {
    let weights = [(1.0 - t).powi(3), 3.0 * t * (1.0 - t).powi(2), 3.0 * t * t * (1.0 - t), t.powi(3)];
    std::array::from_fn(|k| (0..4).map(|i| weights[i] * PROFILE[i][k]).sum())
}

/// The plate of a violin in the plane z = 0, its long axis along y: two bouts, the lower one larger, and a waist
/// between them.
pub(super) fn violin(vertices: usize) -> TriangleMesh {
    moved(plane::disk(vertices), |[x, y, z]| {
        let angle = y.atan2(x);
        let outline = (0.62 + 0.3 * (2.0 * (angle - FRAC_PI_2)).cos()) * (1.0 - 0.12 * angle.sin());
        [outline * x, outline * y, z]
    })
}

/// A flat starfish with five arms, around the z axis.
pub(super) fn starfish(vertices: usize) -> TriangleMesh {
    moved(sphere::sphere(vertices), |[x, y, z]| {
        let arm = (0.5 + 0.5 * (5.0 * (y.atan2(x) - FRAC_PI_2)).cos()).powi(2);
        let reach = 0.5 + 0.7 * arm * (x * x + y * y);
        [reach * x, reach * y, 0.3 * z]
    })
}

fn moved(mut mesh: TriangleMesh, to: impl Fn([f64; 3]) -> [f64; 3]) -> TriangleMesh {
    for position in &mut mesh.positions {
        *position = to(*position);
    }
    mesh
}
