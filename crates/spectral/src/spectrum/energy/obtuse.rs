//! What obtuse triangles leave of the edges of a surface.
//!
//! The matrix of a triangle with half cotangents `a`, `b` and `−c` has no negative eigenvalue, since `ab ≥ c (a + b)`,
//! and neither has what is left of it where the two edges of positive weight give away all but the share
//! `x = c (a + b) / (ab)` of theirs: `xa · xb = c (xa + xb)`. A triangle without an obtuse angle gives away all that it
//! has. So an edge may be taken for what its triangles give together.

use chladni_base::parallel::*;
use chladni_base::{Spare, Vector3};

use crate::operator::{EigenProblem, laplace};
use chladni_mesh::TriangleMesh;
use chladni_mesh::intrinsic::TriangleShape;
use chladni_mesh::points::COVERS;

/// Sums of cotangents err by no more, relative to their magnitudes, and shares are rounded up by as much.
const ROUNDED: f64 = 1e-12;

/// So many times the sum of its two positive half cotangents, a triangle's cotangents differ relatively where its
/// corners come in another order: cross products err by rounding of the longest edge's square, which over the doubled
/// area is twice that sum.
const CORNERS: f64 = 128.0 * f64::EPSILON;

/// Faces that one task looks at.
const FACES: usize = 1 << 14;

/// The faces from `from` to `to`, less copies of one before them and with all copies of the last.
fn copies_of(faces: &[[u32; 3]], from: usize, to: usize) -> &[[u32; 3]] {
    let beyond = |at: usize| match at.checked_sub(1) {
        Some(last) => at + faces[at..].iter().take_while(|&face| *face == faces[last]).count(),
        None => at,
    };
    &faces[beyond(from).min(beyond(to))..beyond(to)]
}

/// The triangles whose cotangents a stiffness is the sum of, but for rows of vertices that are held.
#[derive(Debug, Clone, Copy)]
pub enum Cotangents<'a> {
    /// The faces of a surface.
    Surface(&'a TriangleMesh),
    /// Those around each of some points, which cover a surface [`COVERS`] times: copies beside each other.
    Local {
        /// Where the points lie.
        positions: &'a [[f64; 3]],
        /// A triangle as often as points have it.
        faces: &'a [[u32; 3]],
    },
}

impl<'a> From<&'a TriangleMesh> for Cotangents<'a> {
    fn from(mesh: &'a TriangleMesh) -> Self {
        Self::Surface(mesh)
    }
}

/// What an obtuse triangle adds to the weight of an edge that may be taken, or takes from it.
#[derive(Debug, Clone, Copy)]
struct Change {
    /// The rows of its ends, the lower one first.
    ends: (u32, u32),
    amount: f64,
}

/// The changes by all obtuse triangles.
#[derive(Debug)]
pub(super) struct Obtuse {
    /// By ascending ends.
    changes: Vec<Change>,
}

impl Obtuse {
    /// Those of the `triangles` that have no corner in another row of `problem` than the given ones. Rows are called by
    /// their places among these; vertices that are held at zero have none.
    pub(super) fn of<'a>(triangles: impl Into<Cotangents<'a>>, problem: &EigenProblem, rows: &[u32]) -> Self {
        const HELD: u32 = u32::MAX;
        const OTHER: u32 = HELD - 1;
        let triangles = triangles.into();
        let (positions, faces) = match triangles {
            Cotangents::Surface(mesh) => (mesh.positions.as_slice(), mesh.faces.as_slice()),
            Cotangents::Local { positions, faces } => (positions, faces),
        };
        let vertex = |row: u32| problem.unknowns.as_ref().map_or(row, |unknowns| unknowns[row as usize]) as usize;
        let mut places = vec![HELD; positions.len()];
        (0..problem.size() as u32).for_each(|row| places[vertex(row)] = OTHER);
        rows.iter().zip(0..).for_each(|(&row, place)| places[vertex(row)] = place);
        let scale = laplace::power_of_two_scale(positions).unwrap_or(1.0);
        let changes = |face: &[u32; 3], copies: usize| {
            let mut changes = [None; 3];
            let corners = face.map(|vertex| places[vertex as usize]);
            let shape = TriangleShape::of_corners(face.map(|v| Vector3(positions[v as usize]) * scale));
            let Some(corner) = (0..3).find(|&k| shape.half_cotangents[k] < 0.0) else { return changes };
            if shape.area == 0.0 || corners.contains(&OTHER) {
                return changes;
            }
            let (next, last) = ((corner + 1) % 3, (corner + 2) % 3);
            let [a, b, c] = [next, last, corner].map(|k| shape.half_cotangents[k].abs());
            // Of points the stiffness has the corners in another order, and cotangents of a needle differ by more than
            // rounding then.
            let (copies, errs) = match triangles {
                Cotangents::Surface(_) => (1.0, 0.0),
                Cotangents::Local { .. } => (copies as f64 / COVERS, CORNERS * (a + b)),
            };
            let share = (c * (a + b) / (a * b) * (1.0 + ROUNDED + 4.0 * errs)).min(1.0) * (1.0 + errs);
            for (change, (opposite, amount)) in
                changes.iter_mut().zip([(corner, c * (1.0 - errs)), (next, -share * a), (last, -share * b)])
            {
                let [i, j] = [corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]];
                let ends = (i.min(j), i.max(j));
                *change = (i != HELD && j != HELD).then_some(Change { ends, amount: copies * amount });
            }
            changes
        };
        // Copies of a triangle lie beside each other.
        let alone = matches!(triangles, Cotangents::Surface(_));
        let lists = Spare::default();
        let parts: Vec<Box<[Change]>> = faces
            .par_chunks(FACES)
            .enumerate()
            .map(|(part, own)| {
                lists.with(Vec::new, |list: &mut Vec<Change>| {
                    list.clear();
                    if alone {
                        list.extend(own.iter().flat_map(|face| changes(face, 1)).flatten());
                    } else {
                        // Each part takes the copies whose first is among its own.
                        let own = copies_of(faces, part * FACES, part * FACES + own.len());
                        list.extend(own.chunk_by(|a, b| a == b).flat_map(|all| changes(&all[0], all.len())).flatten());
                    }
                    list.as_slice().into()
                })
            })
            .collect();
        drop(lists);
        let mut changes = parts.concat();
        drop(parts);
        // By amount too, so that sums do not depend on the order of the faces.
        changes.par_sort_unstable_by(|a, b| a.ends.cmp(&b.ends).then(a.amount.total_cmp(&b.amount)));
        Self { changes }
    }

    /// What obtuse triangles change of the edges from a row to rows of higher numbers.
    pub(super) fn row(&self, row: u32) -> OfRow<'_> {
        let from = self.changes.partition_point(|change| change.ends.0 < row);
        let length = self.changes[from..].iter().take_while(|change| change.ends.0 == row).count();
        OfRow { changes: &self.changes[from..from + length] }
    }
}

/// The changes of one row.
pub(super) struct OfRow<'a> {
    changes: &'a [Change],
}

impl OfRow<'_> {
    /// What may be taken of an edge of such a weight.
    pub(super) fn left(&self, other: u32, weight: f64) -> f64 {
        let (mut sum, mut size) = (weight, weight.abs());
        for change in self.changes.iter().filter(|change| change.ends.1 == other) {
            sum += change.amount;
            size += change.amount.abs();
        }
        sum - ROUNDED * size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_a_face_are_in_one_part_wherever_the_cuts_are() {
        let faces: Vec<[u32; 3]> =
            [1, 3, 2, 1, 4, 1, 1, 3].iter().zip(0..).flat_map(|(&n, f)| vec![[f; 3]; n]).collect();
        for size in 1..=faces.len() {
            let starts = (0..faces.len()).step_by(size);
            let parts = starts.map(|from| copies_of(&faces, from, faces.len().min(from + size)));
            let groups: Vec<usize> = parts.flat_map(|part| part.chunk_by(|a, b| a == b).map(<[_]>::len)).collect();
            assert_eq!(groups, [1, 3, 2, 1, 4, 1, 1, 3], "parts of {size}");
        }
    }
}
