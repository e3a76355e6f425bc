//! Faces that stay turned over when vertices are moved alone are turned back together with the faces around them.
//!
//! On a patch of a few rings `Σ A (|J|² + λ (1 + det² J)) / χ(det J)` is made small, where `J` is the gradient of the
//! coordinates against the directions and `χ(D) = (D + √(ε² + D²)) / 2` takes the place of a determinant that is not
//! positive (Garanzha, Kaporin, Kudryavtseva, Protais, Ray and Sokolov 2021). `ε` shrinks with the worst determinant,
//! so that the sum is a barrier in the end. One vertex after the other takes a step of Newton's method; what does not
//! lessen the number of faces turned over is undone, and so is what makes coordinates wind wrongly around a vertex.

use chladni_base::{Cancelled, Monitor};

use super::system::Parts;
use super::untangle::{FixedCoordinates, doubled, turn};
use super::winding::Windings;
use crate::operator::frames::{Complex64, inner};

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
    held: FixedCoordinates,
    corners: Vec<u32>,
}

/// Patches at most: where more is turned over, something else is wrong, and each takes some hundredths of a second.
const MOST_PATCHES: usize = 200;

/// Moves unknowns and coordinates around faces that are turned over.
///
/// # Errors
/// [`Cancelled`], when asked to stop.
pub(super) fn relax(
    (parts, windings): (&Parts, &Windings),
    held: &[FixedCoordinates],
    solution: &mut [f64],
    coordinates: &mut [[Complex64; 3]],
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
        let over = |coordinates: &[[Complex64; 3]]| {
            patch.iter().filter(|&&f| !(doubled(coordinates[f as usize]) > 0.0)).count()
        };
        let free = free(parts, held, &patch);
        // All whose angles may change.
        let vertices = vertices_of(parts, &patch);
        let mut corners = Vec::new();
        let mut wrong = |coordinates: &[[Complex64; 3]]| {
            vertices.iter().filter(|&&v| windings.is_wrong(coordinates, v, &mut corners)).count()
        };
        let now = |coordinates: &[[Complex64; 3]]| patch.iter().map(|&f| coordinates[f as usize]).collect::<Vec<_>>();
        let (count, most) = (over(coordinates), wrong(coordinates));
        let mut steps = vec![Complex64::ZERO; free.len()];
        // The fewest turned over so far, with what gave them.
        let mut best = (count, now(coordinates), steps.clone());
        for _ in 0..SWEEPS {
            sweep(parts, &patch, &free, coordinates, &mut steps);
            let left = over(coordinates);
            if left < count && left <= best.0 && wrong(coordinates) <= most {
                best = (left, now(coordinates), steps.clone());
            }
            if left == 0 {
                break;
            }
        }
        let (_, kept, steps) = best;
        patch.iter().zip(kept).for_each(|(&f, own)| coordinates[f as usize] = own);
        for (own, &step) in free.iter().zip(&steps) {
            let sums = &mut solution[2 * own.vertex as usize..][..2];
            sums.iter_mut().zip([step.re, step.im]).for_each(|(sum, x)| *sum += x);
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

/// The vertices of a patch, ascending.
fn vertices_of(parts: &Parts, patch: &[u32]) -> Vec<u32> {
    let mut vertices: Vec<u32> = patch.iter().flat_map(|&face| parts.surface.mesh().faces[face as usize]).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// The vertices all of whose faces belong to a patch, and that may move.
fn free(parts: &Parts, held: &[FixedCoordinates], patch: &[u32]) -> Vec<Free> {
    let (mesh, dual) = (parts.surface.mesh(), parts.surface.dual());
    let free = vertices_of(parts, patch).into_iter().filter_map(|vertex| {
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
    slope: Complex64,
    bend: f64,
    determinant: f64,
    rise: Complex64,
}

impl Piece {
    /// `None` where the face itself has no area.
    fn new(parts: &Parts, coordinates: &[[Complex64; 3]], corner: u32) -> Option<Self> {
        let (face, k) = (corner as usize / 3, corner as usize % 3);
        let z = coordinates[face];
        let (w, q, r) = (z[k], z[(k + 1) % 3], z[(k + 2) % 3]);
        let area = parts.surface.frames().areas()[face];
        let wanted = area / (parts.spacing * parts.spacing);
        let [own, first, second] = std::array::from_fn(|i| parts.half_cotangent(face, (k + i) % 3) / wanted);
        let square = own * (q - r).norm_sqr() + first * (w - r).norm_sqr() + second * (w - q).norm_sqr();
        let slope = 2.0 * (first * (w - r) + second * (w - q));
        let back = turn(parts, corner).conj();
        let rise = Complex64::new(q.im - r.im, r.re - q.re) / (2.0 * wanted);
        let piece = Self {
            area,
            // Rounding may leave less than nothing.
            square: square.max(0.0),
            slope: slope * back,
            bend: 2.0 * (first + second),
            determinant: doubled(z) / (2.0 * wanted),
            rise: rise * back,
        };
        (wanted > 0.0 && square.is_finite()).then_some(piece)
    }

    fn value(&self, step: Complex64, epsilon: f64) -> f64 {
        let square = self.square + inner(self.slope, step) + 0.5 * self.bend * step.norm_sqr();
        let determinant = self.determinant + inner(self.rise, step);
        self.area * (square + AREAS * (1.0 + determinant * determinant)) / chi(determinant, epsilon)
    }

    /// Gradient and a positive part of the second derivatives at rest: both diagonal entries, then the one beside them.
    fn derivatives(&self, epsilon: f64) -> (Complex64, [f64; 3]) {
        let d = self.determinant;
        let root = d.hypot(epsilon);
        let chi = chi(d, epsilon);
        let (first, second) = (chi / root, 0.5 * epsilon * epsilon / (root * root * root));
        let top = self.square + AREAS * (1.0 + d * d);
        let g = self.rise;
        let gradient = self.area * ((self.slope + 2.0 * AREAS * d * g) / chi - top * first * g / (chi * chi));
        let across = (2.0 * AREAS / chi + top * (2.0 * first * first / chi - second).max(0.0) / (chi * chi)).max(0.0);
        let bend = self.bend / chi;
        let second = [bend + across * g.re * g.re, bend + across * g.im * g.im, across * g.re * g.im];
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
fn sweep(parts: &Parts, patch: &[u32], free: &[Free], coordinates: &mut [[Complex64; 3]], steps: &mut [Complex64]) {
    let areas = parts.surface.frames().areas();
    let determinant = |&f: &u32| {
        doubled(coordinates[f as usize]) * parts.spacing * parts.spacing
            / (2.0 * areas[f as usize].max(f64::MIN_POSITIVE))
    };
    let worst = patch.iter().map(determinant).fold(0.0, f64::min);
    let epsilon = (LEAST * LEAST + SHARE * SHARE * worst * worst).sqrt();
    for (own, total) in free.iter().zip(steps) {
        let pieces: Vec<Piece> = own.corners.iter().filter_map(|&c| Piece::new(parts, coordinates, c)).collect();
        let (mut g, mut h) = (Complex64::ZERO, [0.0; 3]);
        for piece in &pieces {
            let (gradient, second) = piece.derivatives(epsilon);
            g += gradient;
            (0..3).for_each(|i| h[i] += second[i]);
        }
        let mut step = match own.held {
            [false, false] => {
                let whole = h[0] * h[1] - h[2] * h[2];
                Complex64::new(h[2] * g.im - h[1] * g.re, h[2] * g.re - h[0] * g.im) / whole
            }
            [across, up] => {
                Complex64::new(if across { 0.0 } else { -g.re / h[0] }, if up { 0.0 } else { -g.im / h[1] })
            }
        };
        if !step.is_finite() {
            continue;
        }
        let value = |step: Complex64| pieces.iter().map(|piece| piece.value(step, epsilon)).sum::<f64>();
        let rest = value(Complex64::ZERO);
        let Some(step) = (0..HALVINGS).find_map(|_| {
            let tried = step;
            step *= 0.5;
            (value(tried) < rest).then_some(tried)
        }) else {
            continue;
        };
        *total += step;
        for &corner in &own.corners {
            coordinates[corner as usize / 3][corner as usize % 3] += turn(parts, corner) * step;
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
        let piece = Piece {
            area: 0.3,
            square: 2.4,
            slope: Complex64::new(0.7, -0.4),
            bend: 1.9,
            determinant: -0.2,
            rise: Complex64::new(0.6, 1.1),
        };
        let epsilon = 0.3;
        let (gradient, _) = piece.derivatives(epsilon);
        for axis in [Complex64::ONE, Complex64::I] {
            let (difference, slope) = (
                (piece.value(1e-6 * axis, epsilon) - piece.value(-1e-6 * axis, epsilon)) / 2e-6,
                inner(gradient, axis),
            );
            assert!((difference - slope).abs() < 1e-6 * slope.abs(), "{difference} {gradient:?}");
        }
    }
}
