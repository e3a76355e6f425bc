//! The tufted cover: two copies of every face, back to back, glued to the neighbours that they face. Whatever the mesh,
//! each edge of the cover has two sides, and it has no boundary (Sharp and Crane 2020, section 3).

use chladni_base::Vector3;
use chladni_base::parallel::*;
use std::cmp::Ordering;

use super::{CoverError, IntrinsicTriangulation, Rim, TriangleShape, proper_faces};
use crate::TriangleMesh;
use crate::connected::components;
use crate::topology::{EdgeTable, MOST_FACES, apex, half_edge, runs_down};

/// Lengths are made to miss a degenerate triangle by this share of the mean length (Sharp and Crane 2020, section 4.5).
const MARGIN: f64 = 1e-5;

impl IntrinsicTriangulation {
    /// The tufted cover of a mesh, with mollified lengths, in units of which `scale` make one of the mesh.
    ///
    /// All indices must be in range and all coordinates finite. A closed, manifold and consistently oriented mesh is
    /// covered by itself: its two sheets would be alike.
    ///
    /// # Errors
    /// [`CoverError`]: a mesh without proper faces or without lengths, or with too many faces to count.
    pub fn tufted_cover(mesh: &TriangleMesh, scale: f64, rim: Rim) -> Result<Self, CoverError> {
        if mesh.faces.len() > MOST_FACES / 2 {
            return Err(CoverError::TooManyFaces { faces: mesh.faces.len() });
        }
        let mut faces = proper_faces(mesh);
        let single = faces.len();
        let table = EdgeTable::new(mesh.positions.len(), &faces);
        let mut lengths = lengths(mesh, &faces, scale);
        let mollification = mollify(&table, &faces, &mut lengths)?;

        let mut simple = true;
        table.for_each_edge(|_, _, records| {
            simple &= records.len() == 2 && runs_down(records[0]) != runs_down(records[1]);
        });
        let sheets = if simple { 1 } else { 2 };
        let mut twins = vec![0; 3 * single * sheets];
        let mut fixed = Vec::new();
        let mut glue = |a: u32, b: u32| {
            twins[a as usize] = b;
            twins[b as usize] = a;
        };
        if simple {
            table.for_each_edge(|_, _, records| glue(half_edge(records[0]), half_edge(records[1])));
        } else {
            // The back of half-edge 3f + c runs the other way.
            let back = |h: u32| 3 * (single as u32 + h / 3) + 2 - h % 3;
            // The sides that look along increasing and decreasing angles around the edge from its lower to its higher
            // vertex.
            let ahead = |r: u64| if runs_down(r) { back(half_edge(r)) } else { half_edge(r) };
            let behind = |r: u64| if runs_down(r) { half_edge(r) } else { back(half_edge(r)) };
            let mut around = Vec::new();
            table.for_each_edge(|low, high, records| {
                around.clear();
                around.extend(records.iter().map(|&record| (0.0, record)));
                if records.len() > 2 {
                    let apexes = records.iter().map(|&r| mesh.point(apex(&faces, half_edge(r))));
                    let angles = angles(mesh.point(low), mesh.point(high), apexes);
                    around.iter_mut().zip(angles).for_each(|(entry, angle)| entry.0 = angle);
                    around.sort_by(|a: &(f64, u64), b| {
                        a.0.total_cmp(&b.0).then_with(|| stacked(&faces, low, high, a.1, b.1))
                    });
                }
                for (k, &(_, record)) in around.iter().enumerate() {
                    glue(ahead(record), behind(around[(k + 1) % around.len()].1));
                }
                if records.len() == 1 && rim == Rim::Fixed {
                    fixed.resize(6 * single, false);
                    fixed[ahead(records[0]) as usize] = true;
                    fixed[behind(records[0]) as usize] = true;
                }
            });
            faces.extend_from_within(..);
            lengths.extend_from_within(..);
            faces[single..].par_iter_mut().for_each(|face| *face = [face[0], face[2], face[1]]);
            lengths[single..].par_iter_mut().for_each(|l| *l = [l[2], l[1], l[0]]);
        }
        let shapes = lengths.par_iter().map(|&l| TriangleShape::of_lengths(l)).collect();
        Ok(Self { faces, lengths, twins, shapes, fixed, sheets, mollification })
    }
}

/// The order in which triangles at one angle lie on each other around the edge from `low` to `high`: by their numbers,
/// seen from the side on which the three vertices turn counter-clockwise by theirs. So equal triangles lie in one order
/// at all three edges, and each but the outer two sides of the stack is glued to the next by all of them; in different
/// orders they would be tangled, and the triangulation depend on the order of the faces.
fn stacked(faces: &[[u32; 3]], low: u32, high: u32, a: u64, b: u64) -> Ordering {
    let [p, q] = [a, b].map(|record| apex(faces, half_edge(record)));
    let order = p.cmp(&q).then(half_edge(a).cmp(&half_edge(b)));
    // With an apex between its ends in number, the edge runs against the turn.
    if p == q && low < p && p < high { order.reverse() } else { order }
}

fn lengths(mesh: &TriangleMesh, faces: &[[u32; 3]], scale: f64) -> Vec<[f64; 3]> {
    let at = |v: u32| mesh.point(v) * scale;
    faces
        .par_iter()
        .map(|&face| {
            let [p, q, r] = face.map(at);
            [(p - q).norm(), (q - r).norm(), (r - p).norm()]
        })
        .collect()
}

/// Adds the least length to every edge of a component that lets all its triangles close with a margin; gives its share
/// of the mean length, the largest of all components. One that is a millionth of the others is no less a surface;
/// measured by the mean of all, its triangles would count as degenerate.
fn mollify(table: &EdgeTable, faces: &[[u32; 3]], lengths: &mut [[f64; 3]]) -> Result<f64, CoverError> {
    let (mut sum, mut edges) = (0.0, 0usize);
    table.for_each_edge(|_, _, records| {
        sum += half_edge_length(lengths, records);
        edges += 1;
    });
    let mean = sum / edges as f64;
    if !(mean > 0.0 && mean.is_finite()) {
        return Err(CoverError::Empty);
    }
    // No mean is longer than the longest edge.
    let widest = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
    let of = |&l: &[f64; 3]| (flatness(l), l[0].max(l[1]).max(l[2]));
    let (flattest, longest) = lengths.par_iter().map(of).reduce(|| (f64::NEG_INFINITY, 0.0), widest);
    if flattest + MARGIN * longest <= 0.0 {
        return Ok(0.0);
    }
    let vertices = faces.iter().flatten().max().map_or(0, |&vertex| vertex as usize + 1);
    let component = components(vertices, faces);
    let own = |face: usize| component[faces[face][0] as usize] as usize;
    let mut means = vec![(0.0, 0usize); vertices];
    table.for_each_edge(|_, _, records| {
        let (sum, edges) = &mut means[own(half_edge(records[0]) as usize / 3)];
        *sum += half_edge_length(lengths, records);
        *edges += 1;
    });
    let means: Vec<f64> = means.iter().map(|&(sum, edges)| sum / edges as f64).collect();
    let mut missing = vec![0.0f64; vertices];
    for (face, &l) in lengths.iter().enumerate() {
        let component = own(face);
        missing[component] = missing[component].max(flatness(l) + MARGIN * means[component]);
    }
    if missing.iter().any(|&missing| missing > 0.0) {
        lengths.iter_mut().enumerate().for_each(|(face, l)| *l = l.map(|l| l + missing[own(face)]));
    }
    // Those that are no component have a mean that is no number.
    Ok(missing.iter().zip(&means).map(|(missing, mean)| missing / mean).fold(0.0, f64::max))
}

fn half_edge_length(lengths: &[[f64; 3]], records: &[u64]) -> f64 {
    let h = half_edge(records[0]) as usize;
    lengths[h / 3][h % 3]
}

/// By how much the longest edge of a triangle is longer than the others together: below zero, unless it is degenerate.
fn flatness([a, b, c]: [f64; 3]) -> f64 {
    (a - b - c).max(b - c - a).max(c - a - b)
}

/// Numbers that grow with the angles of `points` around the axis from `low` to `high`, seen from its end, starting at
/// the first; zeros where there is no axis.
fn angles(low: Vector3, high: Vector3, points: impl Iterator<Item = Vector3>) -> Vec<f64> {
    let axis = high - low;
    let length = axis.norm_squared();
    let axis = if length > 0.0 { axis / length.sqrt() } else { Vector3::ZERO };
    let mut first: Option<[Vector3; 2]> = None;
    points
        .map(|point| {
            let d = point - low;
            let d = d - axis * d.dot(axis);
            let [x, y] = *first.get_or_insert_with(|| [d, axis.cross(d)]);
            pseudo_angle(d.dot(x), d.dot(y))
        })
        .collect()
}

/// A number from 0 to 4 that grows with the angle of (x, y), from the positive x-axis on.
fn pseudo_angle(x: f64, y: f64) -> f64 {
    let size = x.abs() + y.abs();
    if !(size > 0.0) {
        return 0.0;
    }
    match (x >= 0.0, y >= 0.0) {
        (true, true) => y / size,
        (false, true) => 1.0 - x / size,
        (false, false) => 2.0 - y / size,
        (true, false) => 3.0 + x / size,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{grid, sphere};

    /// Each half-edge is glued to one that runs the other way and is as long.
    fn assert_glued(cover: &IntrinsicTriangulation) {
        for h in 0..cover.twins.len() as u32 {
            let twin = cover.twins[h as usize];
            assert_eq!(cover.twins[twin as usize], h);
            assert_ne!(twin, h);
            let ends = |h: u32| {
                (cover.faces[h as usize / 3][h as usize % 3], cover.faces[h as usize / 3][(h as usize + 1) % 3])
            };
            assert_eq!(ends(h), (ends(twin).1, ends(twin).0));
            assert_eq!(cover.half_edge_length(h), cover.half_edge_length(twin));
        }
    }

    fn cover(mesh: &TriangleMesh) -> IntrinsicTriangulation {
        IntrinsicTriangulation::tufted_cover(mesh, 1.0, Rim::Free).unwrap()
    }

    #[test]
    fn a_component_that_is_small_beside_others_keeps_its_lengths() {
        let (mut mesh, small) = (sphere(4), sphere(4));
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(small.positions.iter().map(|p| p.map(|x| 1e-7 * x)));
        mesh.faces.extend(small.faces.iter().map(|face| face.map(|v| first + v)));
        let cover = IntrinsicTriangulation::tufted_cover(&mesh, 1.0, Rim::Free).unwrap();
        assert_eq!(cover.mollification(), 0.0);
        // Flat triangles of one do not change the others.
        let [a, b, c] = [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [7.0, 0.0, 0.0]];
        mesh.faces.push([0, 1, 2].map(|k| mesh.positions.len() as u32 + k));
        mesh.positions.extend([a, b, c]);
        let flat = IntrinsicTriangulation::tufted_cover(&mesh, 1.0, Rim::Free).unwrap();
        assert!((flat.mollification() - 1e-5).abs() < 1e-12);
        let faces = cover.faces().len();
        assert_eq!(flat.lengths[..faces], cover.lengths[..]);
        assert!(flat.lengths[faces][0] > 1.0 + 1e-5);
    }

    #[test]
    fn a_closed_surface_covers_itself() {
        let mesh = sphere(7);
        let cover = cover(&mesh);
        assert_eq!((cover.sheets(), cover.faces(), cover.mollification()), (1, &mesh.faces[..], 0.0));
        assert_glued(&cover);
    }

    #[test]
    fn a_surface_with_boundary_or_of_mixed_orientation_is_covered_twice() {
        let mut turned = sphere(5);
        turned.faces[3].swap(0, 1);
        for mesh in [grid(4), turned] {
            let cover = cover(&mesh);
            assert_eq!((cover.sheets(), cover.faces().len()), (2, 2 * mesh.faces.len()));
            assert_glued(&cover);
        }
    }

    #[test]
    fn pages_of_a_book_are_glued_to_the_next_page_whichever_way_they_run() {
        // Five pages around the z-axis at known angles, in mixed order and orientation.
        let mut mesh =
            TriangleMesh { positions: vec![[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], faces: vec![], ..Default::default() };
        let order = [3, 0, 4, 1, 2];
        for (k, &place) in order.iter().enumerate() {
            let t = 1.2 * f64::from(place);
            mesh.positions.push([t.cos(), t.sin(), 0.3 + 0.1 * f64::from(place)]);
            let v = 2 + k as u32;
            mesh.faces.push(if k % 2 == 0 { [0, 1, v] } else { [1, 0, v] });
        }
        let cover = cover(&mesh);
        assert_glued(&cover);
        // From each page the upward side leads to the page at the next angle.
        for h in 0..cover.twins.len() as u32 {
            let face = cover.faces[h as usize / 3];
            if (face[h as usize % 3], face[(h as usize + 1) % 3]) == (0, 1) {
                let place = |f: u32| order[f as usize % 5];
                assert_eq!(place(cover.twins[h as usize] / 3), (place(h / 3) + 1) % 5);
            }
        }
    }

    #[test]
    fn flat_and_repeating_faces_do_no_harm() {
        let mut mesh = grid(3);
        // No area; repeats a vertex; names vertices at one position.
        mesh.positions.push(mesh.positions[4]);
        mesh.faces.extend([[0, 1, 2], [5, 5, 1], [4, 9, 3]]);
        let cover = cover(&mesh);
        assert_glued(&cover);
        assert_eq!(cover.faces().len(), 2 * (8 + 2));
        assert!(cover.mollification() > 0.0 && cover.mollification() < 1.1e-5);
        assert!(cover.shapes().iter().all(|shape| shape.area > 0.0));
        let flat = TriangleMesh { positions: vec![[1.0; 3]; 3], faces: vec![[0, 1, 2]], ..Default::default() };
        assert_eq!(IntrinsicTriangulation::tufted_cover(&flat, 1.0, Rim::Free), Err(CoverError::Empty));
        assert_eq!(
            IntrinsicTriangulation::tufted_cover(&TriangleMesh::default(), 1.0, Rim::Free),
            Err(CoverError::Empty)
        );
    }
}
