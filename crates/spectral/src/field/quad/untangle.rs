//! Faces that are turned over are turned back by moving vertices one by one: each to where the smallest of the faces
//! around it is largest (Freitag and Plassmann 2000).
//!
//! A step that would turn more faces over than it turns back is not taken, so that there are never more of them. Those
//! that a step does turn over are visited in their turn. Nor is one after which coordinates wind wrongly around a
//! vertex with no face turned over there: faces would be folded without a word.
//!
//! The area of a face is linear in the coordinates of one of its vertices, and so this is a linear program in two
//! coordinates and the least area. What ties coordinates to each other stays: singular vertices and boundaries are not
//! moved, vertices of a crease that is a grid line slide along it.

use chladni_base::{Cancelled, Monitor};

use super::super::harmonic::rim;
use super::aligned::{off, sides};
use super::relax::relax;
use super::seams::quarter_turned;
use super::system::{ASTRAY, Parts};
use super::winding::Windings;
use crate::operator::frames::{Complex64, complex, outer, power};

/// Passes over the faces that are left.
const PASSES: usize = 60;

/// Vertices with more faces stay: the program is solved by trying three at a time.
const MOST_FACES: usize = 16;

/// A gain of less than this share of a face is none.
const GAIN: f64 = 1e-6;

/// An area as it changes with a vertex: at rest, and by its two coordinates; 1 is the area that it should have.
type Area = (f64, Complex64);

/// Which of the two coordinates of a vertex stay.
pub(super) type FixedCoordinates = [bool; 2];

/// Moves unknowns and coordinates; `inverted` are the faces turned over.
///
/// # Errors
/// [`Cancelled`], when asked to stop.
pub(super) fn untangle(
    parts: &Parts,
    windings: &Windings,
    solution: &mut [f64],
    coordinates: &mut [[Complex64; 3]],
    inverted: Vec<u32>,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    let held = held(parts);
    let left = one_by_one((parts, windings), &held, solution, coordinates, inverted);
    if left.is_empty() {
        return Ok(());
    }
    relax((parts, windings), &held, solution, coordinates, &left, monitor)?;
    one_by_one((parts, windings), &held, solution, coordinates, left);
    Ok(())
}

/// Vertices alone; what is left.
fn one_by_one(
    (parts, windings): (&Parts, &Windings),
    held: &[FixedCoordinates],
    solution: &mut [f64],
    coordinates: &mut [[Complex64; 3]],
    mut inverted: Vec<u32>,
) -> Vec<u32> {
    let (mesh, dual) = (parts.surface.mesh(), parts.surface.dual());
    let (mut corners, mut scratch, mut before) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..PASSES {
        let mut vertices: Vec<u32> = inverted.iter().flat_map(|&face| mesh.faces[face as usize]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut moved = false;
        for vertex in vertices {
            let held = held[vertex as usize];
            if held == [true; 2] || !dual.fan(mesh, vertex, &mut corners) || corners.len() > MOST_FACES {
                continue;
            }
            let areas: Vec<Area> = corners.iter().filter_map(|&corner| area(parts, coordinates, corner)).collect();
            let Some(step) = best(&areas, held) else { continue };
            before.clear();
            before.extend(corners.iter().map(|&corner| coordinates[corner as usize / 3][corner as usize % 3]));
            let wrong = windings.wrong_around(coordinates, &corners, &mut scratch);
            for &corner in &corners {
                coordinates[corner as usize / 3][corner as usize % 3] += turn(parts, corner) * step;
            }
            if windings.wrong_around(coordinates, &corners, &mut scratch) > wrong {
                for (&corner, &z) in corners.iter().zip(&before) {
                    coordinates[corner as usize / 3][corner as usize % 3] = z;
                }
                continue;
            }
            moved = true;
            inverted.extend(corners.iter().map(|&corner| corner / 3));
            solution[2 * vertex as usize] += step.re;
            solution[2 * vertex as usize + 1] += step.im;
        }
        inverted.retain(|&face| !(doubled(coordinates[face as usize]) > 0.0));
        inverted.sort_unstable();
        inverted.dedup();
        if !moved || inverted.is_empty() {
            break;
        }
    }
    inverted
}

/// What stays of the coordinates of each vertex: all of singular ones, and on creases that are grid lines that which is
/// whole there.
fn held(parts: &Parts) -> Vec<FixedCoordinates> {
    let mesh = parts.surface.mesh();
    let mut held = vec![[false; 2]; mesh.positions.len()];
    for side in sides(parts.surface, parts.creases) {
        let direction = parts.combed.directions[side.face];
        if off(&side, power(direction, 4)) > ASTRAY {
            continue;
        }
        let along = side.along * direction.conj();
        let across = if along.re.abs() > along.im.abs() { 1 } else { 0 };
        for k in [1, 2].map(|i| (side.slot + i) % 3) {
            let odd = usize::from(parts.seams.quarters[3 * side.face + k]) % 2;
            held[mesh.faces[side.face][k] as usize][across ^ odd] = true;
        }
    }
    let boundary = rim(parts.surface);
    boundary.iter().zip(&mut held).filter(|(rim, _)| **rim).for_each(|(_, held)| *held = [true; 2]);
    parts.seams.closures.iter().filter(|closure| closure.1 != [0, 0]).for_each(|c| held[c.0 as usize] = [true; 2]);
    parts.combed.singularities.iter().for_each(|s| held[s.vertex as usize] = [true; 2]);
    held
}

/// The quarter turn of a corner as a number.
pub(super) fn turn(parts: &Parts, corner: u32) -> Complex64 {
    complex(quarter_turned([1, 0], i32::from(parts.seams.quarters[corner as usize])).map(f64::from))
}

/// Twice the area of a face in its coordinates.
pub(super) fn doubled([a, b, c]: [Complex64; 3]) -> f64 {
    outer(b - a, c - a)
}

/// The area of the face of a corner, as it changes with the coordinates of the vertex there; `None` where the face
/// itself has none.
fn area(parts: &Parts, coordinates: &[[Complex64; 3]], corner: u32) -> Option<Area> {
    let (face, k) = (corner as usize / 3, corner as usize % 3);
    let z = coordinates[face];
    let (q, r) = (z[(k + 1) % 3], z[(k + 2) % 3]);
    let wanted = 2.0 * parts.surface.frames().areas()[face] / (parts.spacing * parts.spacing);
    let slope = Complex64::new(q.im - r.im, r.re - q.re) * turn(parts, corner).conj();
    (wanted > 0.0).then(|| (doubled(z) / wanted, slope / wanted))
}

/// The step by which the least of some areas becomes largest, without coordinates that stay; `None` where it is
/// positive already, or would not grow.
fn best(areas: &[Area], held: FixedCoordinates) -> Option<Complex64> {
    let least = areas.iter().map(|area| area.0).fold(f64::INFINITY, f64::min);
    if !(least <= 0.0) || held == [true; 2] {
        return None;
    }
    let at = |area: &Area, step: Complex64| area.0 + area.1.re * step.re + area.1.im * step.im;
    let mut found: Option<(f64, Complex64)> = None;
    let mut consider = |first: &Area, step: Complex64| {
        let value = at(first, step);
        let lowest = areas.iter().map(|area| at(area, step)).fold(f64::INFINITY, f64::min);
        let holds = lowest >= value - 1e-9 * value.abs().max(1.0);
        if step.is_finite() && holds && found.is_none_or(|best| lowest > best.0) {
            found = Some((lowest, step));
        }
    };
    for i in 0..areas.len() {
        for j in 0..i {
            if let Some(free) = held.iter().position(|held| !held).filter(|_| held.contains(&true)) {
                // Where two areas are equal on the line.
                let (rise, slope) = (areas[j].0 - areas[i].0, areas[i].1 - areas[j].1);
                let step = if free == 0 { complex([rise / slope.re, 0.0]) } else { complex([0.0, rise / slope.im]) };
                consider(&areas[i], step);
                continue;
            }
            for k in 0..j {
                // Where three areas are equal.
                let rows = [j, k].map(|other| (areas[i].1 - areas[other].1, areas[other].0 - areas[i].0));
                let [(a, p), (b, q)] = rows;
                let step = Complex64::new(p * b.im - q * a.im, a.re * q - b.re * p) / outer(a, b);
                consider(&areas[i], step);
            }
        }
    }
    // One face far over is not traded for many that are a little.
    let over = |step: Complex64| areas.iter().filter(|area| !(at(area, step) > 0.0)).count();
    found.filter(|best| best.0 > least + GAIN && over(best.1) <= over(Complex64::ZERO)).map(|best| best.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::frames::inner;

    /// The faces between a vertex at the origin and a polygon around it.
    fn around(polygon: &[Complex64]) -> Vec<Area> {
        let next = |i: usize| polygon[(i + 1) % polygon.len()];
        polygon
            .iter()
            .enumerate()
            .map(|(i, &q)| {
                let r = next(i);
                (doubled([Complex64::ZERO, q, r]), Complex64::new(q.im - r.im, r.re - q.re))
            })
            .collect()
    }

    #[test]
    fn a_vertex_outside_its_polygon_comes_to_where_the_least_face_is_largest() {
        let square: Vec<Complex64> = [[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]].map(complex).to_vec();
        let step = best(&around(&square), [false; 2]).unwrap();
        assert!((step.re - 2.0).abs() < 1e-9 && (step.im - 1.0).abs() < 1e-9, "{step:?}");
        let inside: Vec<Complex64> = square.iter().map(|p| p - Complex64::new(2.5, 0.5)).collect();
        assert_eq!(best(&around(&inside), [false; 2]), None);
    }

    #[test]
    fn a_vertex_that_is_held_slides() {
        let polygon: Vec<Complex64> = [[1.0, -1.0], [3.0, -1.0], [3.0, 2.0], [1.0, 2.0]].map(complex).to_vec();
        let step = best(&around(&polygon), [false, true]).unwrap();
        assert!(step.im == 0.0 && step.re > 1.0 && step.re < 3.0, "{step:?}");
        // Along the other coordinate it never comes inside.
        let over = |step: Complex64| around(&polygon).iter().filter(|a| !(a.0 + inner(a.1, step) > 0.0)).count();
        assert_eq!(over(step), 0);
        assert!(best(&around(&polygon), [true, false]).is_none_or(|step| step.re == 0.0 && over(step) > 0));
        assert_eq!(best(&around(&polygon), [true; 2]), None);
    }

    #[test]
    fn no_step_turns_more_faces_over() {
        let over = |areas: &[Area], step: Complex64| areas.iter().filter(|a| !(a.0 + inner(a.1, step) > 0.0)).count();
        let mut random = chladni_base::SplitMix64::new(3);
        let mut taken = 0;
        for _ in 0..2000 {
            let polygon: Vec<Complex64> = (0..6).map(|_| complex([(); 2].map(|()| random.signed_unit()))).collect();
            let areas = around(&polygon);
            if let Some(step) = best(&areas, [false; 2]) {
                taken += 1;
                assert!(over(&areas, step) <= over(&areas, Complex64::ZERO), "{polygon:?}");
            }
        }
        assert!(taken > 100, "{taken}");
    }
}
