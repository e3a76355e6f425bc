//! Faces that stay turned over when vertices are moved alone are turned back together with the faces around them.
//!
//! On a patch of a few rings `Σ A (|J|² + λ (1 + det² J)) / χ(det J)` is made small, where `J` is the gradient of the
//! coordinates against the directions and `χ(D) = (D + √(ε² + D²)) / 2` takes the place of a determinant that is not
//! positive (Garanzha, Kaporin, Kudryavtseva, Protais, Ray and Sokolov 2021). `ε` shrinks with the worst determinant,
//! so that the sum is a barrier in the end. One vertex after the other takes a step of Newton's method; what does not
//! lessen the number of faces turned over is undone.

use chladni_base::{Cancelled, Monitor};

use super::system::Parts;
use super::untangle::{Held, doubled, turn};
use crate::operator::frames::{Planar, conjugate, multiply};

/// Rings of faces around a face that is turned over.
const RINGS: usize = 5;

/// Sweeps over the vertices of a patch.
const SWEEPS: usize = 200;

/// The weight of the areas against the angles.
const AREAS: f64 = 0.5;

/// The least `ε`, and its share of the worst determinant (Escobar et al. 2003).
const LEAST: f64 = 1e-4;
const SHARE: f64 = 0.2;

/// How often a step is halved.
const HALVINGS: usize = 14;

/// Vertices with more faces stay.
const MOST_FACES: usize = 64;

/// A vertex of a patch with its corners.
struct Free {
    vertex: u32,
    held: Held,
    corners: Vec<u32>,
}

/// Patches at most: where more is turned over, something else is wrong, and each takes some hundredths of a second.
const MOST_PATCHES: usize = 200;

/// Moves unknowns and coordinates around faces that are turned over.
///
/// # Errors
/// [`Cancelled`], when asked to stop.
pub(super) fn relax(
    parts: &Parts,
    held: &[Held],
    solution: &mut [f64],
    coordinates: &mut [[Planar; 3]],
    inverted: &[u32],
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let mut done = vec![false; parts.surface.faces()];
    let mut left = MOST_PATCHES;
    for &face in inverted {
        if done[face as usize] || doubled(coordinates[face as usize]) > 0.0 {
            continue;
        }
        monitor.checkpoint()?;
        let Some(fewer) = left.checked_sub(1) else { break };
        left = fewer;
        let patch = patch(parts, face);
        let over =
            |coordinates: &[[Planar; 3]]| patch.iter().filter(|&&f| !(doubled(coordinates[f as usize]) > 0.0)).count();
        let free = free(parts, held, &patch);
        let (before, count) = (patch.iter().map(|&f| coordinates[f as usize]).collect::<Vec<_>>(), over(coordinates));
        let mut steps = vec![[0.0; 2]; free.len()];
        for _ in 0..SWEEPS {
            sweep(parts, &patch, &free, coordinates, &mut steps);
            if over(coordinates) == 0 {
                break;
            }
        }
        if over(coordinates) < count {
            for (own, step) in free.iter().zip(&steps) {
                (0..2).for_each(|i| solution[2 * own.vertex as usize + i] += step[i]);
            }
        } else {
            patch.iter().zip(before).for_each(|(&f, own)| coordinates[f as usize] = own);
        }
        patch.iter().for_each(|&f| done[f as usize] |= !(doubled(coordinates[f as usize]) > 0.0));
    }
    Ok(())
}

/// The faces of some rings around a face, ascending.
fn patch(parts: &Parts, face: u32) -> Vec<u32> {
    let (mesh, dual) = (parts.surface.mesh(), parts.surface.dual());
    let mut patch = vec![face];
    let (mut corners, mut rim) = (Vec::new(), mesh.faces[face as usize].to_vec());
    let mut seen: std::collections::HashSet<u32> = rim.iter().copied().collect();
    let mut inside: std::collections::HashSet<u32> = [face].into();
    for _ in 0..RINGS {
        let mut next = Vec::new();
        for vertex in std::mem::take(&mut rim) {
            dual.fan(mesh, vertex, &mut corners);
            for &corner in &corners {
                if inside.insert(corner / 3) {
                    patch.push(corner / 3);
                    next.extend(mesh.faces[corner as usize / 3].into_iter().filter(|&v| seen.insert(v)));
                }
            }
        }
        rim = next;
    }
    patch.sort_unstable();
    patch
}

/// The vertices all of whose faces belong to a patch, and that may move.
fn free(parts: &Parts, held: &[Held], patch: &[u32]) -> Vec<Free> {
    let (mesh, dual) = (parts.surface.mesh(), parts.surface.dual());
    let mut vertices: Vec<u32> = patch.iter().flat_map(|&face| mesh.faces[face as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let free = vertices.into_iter().filter_map(|vertex| {
        let (held, mut corners) = (held[vertex as usize], Vec::new());
        let closed = held != [true; 2] && dual.fan(mesh, vertex, &mut corners) && corners.len() <= MOST_FACES;
        let within = closed && corners.iter().all(|corner| patch.binary_search(&(corner / 3)).is_ok());
        within.then_some(Free { vertex, held, corners })
    });
    free.collect()
}

/// A face as it changes with one of its corners: `|J|² = square + slope · s + bend |s|² / 2` and
/// `det J = determinant + rise · s`.
#[derive(Clone, Copy)]
struct Piece {
    area: f64,
    square: f64,
    slope: Planar,
    bend: f64,
    determinant: f64,
    rise: Planar,
}

impl Piece {
    /// `None` where the face itself has no area.
    fn new(parts: &Parts, coordinates: &[[Planar; 3]], corner: u32) -> Option<Self> {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let z = coordinates[face];
        let (w, q, r) = (z[k], z[(k + 1) % 3], z[(k + 2) % 3]);
        let area = parts.surface.frames().areas()[face];
        let wanted = area / (parts.spacing * parts.spacing);
        let [own, first, second] = [0, 1, 2].map(|i| parts.half_cotangent(face, (k + i) % 3) / wanted);
        let minus = |a: Planar, b: Planar| [a[0] - b[0], a[1] - b[1]];
        let norm = |a: Planar| a[0] * a[0] + a[1] * a[1];
        let square = own * norm(minus(q, r)) + first * norm(minus(w, r)) + second * norm(minus(w, q));
        let slope = [0, 1].map(|i| 2.0 * (first * (w[i] - r[i]) + second * (w[i] - q[i])));
        let back = conjugate(turn(parts, corner));
        let rise = [q[1] - r[1], r[0] - q[0]].map(|x| x / (2.0 * wanted));
        let piece = Self {
            area,
            // Rounding may leave less than nothing.
            square: square.max(0.0),
            slope: multiply(slope, back),
            bend: 2.0 * (first + second),
            determinant: doubled(z) / (2.0 * wanted),
            rise: multiply(rise, back),
        };
        (wanted > 0.0 && square.is_finite()).then_some(piece)
    }

    fn value(&self, step: Planar, epsilon: f64) -> f64 {
        let along = |a: Planar| a[0] * step[0] + a[1] * step[1];
        let square = self.square + along(self.slope) + 0.5 * self.bend * (step[0] * step[0] + step[1] * step[1]);
        let determinant = self.determinant + along(self.rise);
        self.area * (square + AREAS * (1.0 + determinant * determinant)) / chi(determinant, epsilon)
    }

    /// Gradient and a positive part of the second derivatives at rest: both diagonal entries, then the one beside them.
    fn derivatives(&self, epsilon: f64) -> (Planar, [f64; 3]) {
        let d = self.determinant;
        let root = d.hypot(epsilon);
        let chi = chi(d, epsilon);
        let (first, second) = (chi / root, 0.5 * epsilon * epsilon / (root * root * root));
        let top = self.square + AREAS * (1.0 + d * d);
        let g = self.rise;
        let gradient = [0, 1]
            .map(|i| self.area * ((self.slope[i] + 2.0 * AREAS * d * g[i]) / chi - top * first * g[i] / (chi * chi)));
        let across = (2.0 * AREAS / chi + top * (2.0 * first * first / chi - second).max(0.0) / (chi * chi)).max(0.0);
        let bend = self.bend / chi;
        let second = [bend + across * g[0] * g[0], bend + across * g[1] * g[1], across * g[0] * g[1]];
        (gradient, second.map(|x| self.area * x))
    }
}

/// What stands for a determinant: positive, and it once that is far above `ε`.
fn chi(determinant: f64, epsilon: f64) -> f64 {
    let root = determinant.hypot(epsilon);
    // Without the difference of what is nearly equal.
    if determinant > 0.0 { 0.5 * (determinant + root) } else { 0.5 * epsilon * epsilon / (root - determinant) }
}

/// One step for each vertex.
fn sweep(parts: &Parts, patch: &[u32], free: &[Free], coordinates: &mut [[Planar; 3]], steps: &mut [Planar]) {
    let areas = parts.surface.frames().areas();
    let determinant = |&f: &u32| {
        doubled(coordinates[f as usize]) * parts.spacing * parts.spacing
            / (2.0 * areas[f as usize].max(f64::MIN_POSITIVE))
    };
    let worst = patch.iter().map(determinant).fold(0.0, f64::min);
    let epsilon = (LEAST * LEAST + SHARE * SHARE * worst * worst).sqrt();
    for (own, total) in free.iter().zip(steps) {
        let pieces: Vec<Piece> = own.corners.iter().filter_map(|&c| Piece::new(parts, coordinates, c)).collect();
        let (mut g, mut h) = ([0.0; 2], [0.0; 3]);
        for piece in &pieces {
            let (gradient, second) = piece.derivatives(epsilon);
            (0..2).for_each(|i| g[i] += gradient[i]);
            (0..3).for_each(|i| h[i] += second[i]);
        }
        let mut step = match own.held {
            [false, false] => {
                let whole = h[0] * h[1] - h[2] * h[2];
                [(h[2] * g[1] - h[1] * g[0]) / whole, (h[2] * g[0] - h[0] * g[1]) / whole]
            }
            held => [0, 1].map(|i| if held[i] { 0.0 } else { -g[i] / h[i] }),
        };
        if !step.iter().all(|x| x.is_finite()) {
            continue;
        }
        let value = |step: Planar| pieces.iter().map(|piece| piece.value(step, epsilon)).sum::<f64>();
        let rest = value([0.0; 2]);
        let Some(step) = (0..HALVINGS).find_map(|_| {
            let tried = step;
            step = step.map(|x| 0.5 * x);
            (value(tried) < rest).then_some(tried)
        }) else {
            continue;
        };
        (0..2).for_each(|i| total[i] += step[i]);
        for &corner in &own.corners {
            let slot = &mut coordinates[corner as usize / 3][corner as usize % 3];
            let change = multiply(turn(parts, corner), step);
            *slot = [slot[0] + change[0], slot[1] + change[1]];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_for_a_determinant_is_positive_and_becomes_it() {
        for epsilon in [1e-4, 0.1, 3.0] {
            for determinant in [-1e8, -1.0, -1e-6, 0.0, 1e-6, 1.0, 1e8] {
                let value = chi(determinant, epsilon);
                assert!(value > 0.0, "{determinant} {epsilon}");
                // χ (χ − D) = ε² / 4.
                assert!(
                    (value * (value - determinant) / (0.25 * epsilon * epsilon) - 1.0).abs() < 1e-3
                        || determinant.abs() > 1e3
                );
            }
        }
        assert!((chi(1.0, 1e-4) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let piece =
            Piece { area: 0.3, square: 2.4, slope: [0.7, -0.4], bend: 1.9, determinant: -0.2, rise: [0.6, 1.1] };
        let epsilon = 0.3;
        let (gradient, _) = piece.derivatives(epsilon);
        for i in 0..2 {
            let step = |x: f64| std::array::from_fn(|k| if k == i { x } else { 0.0 });
            let difference = (piece.value(step(1e-6), epsilon) - piece.value(step(-1e-6), epsilon)) / 2e-6;
            assert!((difference - gradient[i]).abs() < 1e-6 * gradient[i].abs(), "{difference} {gradient:?}");
        }
    }
}
