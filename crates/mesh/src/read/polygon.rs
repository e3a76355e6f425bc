//! Triangulating polygons: quadrilaterals by the diagonal that inverts nothing, larger ones by a fan where they are
//! convex and by clipping ears where they are not.

/// A polygon that was entered as a fan: its first triangle and its number of corners. Its corners can be told from the
/// fan, so nothing else is kept until all positions are known.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fan {
    pub first_face: u32,
    pub corners: u32,
}

/// Polygons of more corners keep their fan: clipping ears takes quadratic time.
const MOST_CORNERS: usize = 2048;
/// Point-in-triangle tests spent on one file, about a quarter of a second; when they are used up, fans are kept.
const MOST_TESTS: usize = 20_000_000;

/// Replaces fans of non-convex polygons by better triangles, in place. Every polygon of `n` corners keeps its `n − 2`
/// triangles and its orientation. Polygons with non-finite corners keep their fans. What each corner of each triangle
/// is called goes with it in `names`, where there are any.
pub(super) fn triangulate(
    positions: &[[f64; 3]],
    faces: &mut [[u32; 3]],
    fans: &[Fan],
    mut names: Option<&mut [[u32; 3]]>,
) {
    let mut clipper = Clipper::default();
    let mut tests_left = MOST_TESTS;
    for fan in fans {
        let (first, corners) = (fan.first_face as usize, fan.corners as usize);
        let here = first..first + corners - 2;
        let faces = &mut faces[here.clone()];
        let names = names.as_deref_mut().map(|names| &mut names[here]);
        if corners == 4 {
            split_quadrilateral(positions, faces, names);
        } else if corners <= MOST_CORNERS && tests_left > 0 {
            clipper.clip(positions, faces, names, &mut tests_left);
        }
    }
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Keeps the diagonal from the first corner unless its triangles look away from each other (or one has no area) and
/// those of the other diagonal do not.
fn split_quadrilateral(positions: &[[f64; 3]], faces: &mut [[u32; 3]], names: Option<&mut [[u32; 3]]>) {
    let [[a, b, c], [_, _, d]] = *faces else { return };
    let agreement = |first: [u32; 3], second: [u32; 3]| {
        let normal = |[i, j, k]: [u32; 3]| {
            let origin = positions[i as usize];
            cross(subtract(positions[j as usize], origin), subtract(positions[k as usize], origin))
        };
        dot(normal(first), normal(second))
    };
    if agreement([a, b, c], [a, c, d]) <= 0.0 && agreement([a, b, d], [b, c, d]) > 0.0 {
        faces.copy_from_slice(&[[a, b, d], [b, c, d]]);
        if let Some([first, second]) = names {
            let ([a, b, c], [_, _, d]) = (*first, *second);
            (*first, *second) = ([a, b, d], [b, c, d]);
        }
    }
}

/// Ear clipping (Meisters 1975) in the plane that the Newell normal chooses; buffers are kept between polygons.
#[derive(Default)]
struct Clipper {
    corners: Vec<u32>,
    points: Vec<[f64; 2]>,
    next: Vec<usize>,
    previous: Vec<usize>,
    reflex: Vec<bool>,
}

impl Clipper {
    fn clip(
        &mut self,
        positions: &[[f64; 3]],
        faces: &mut [[u32; 3]],
        mut names: Option<&mut [[u32; 3]]>,
        tests_left: &mut usize,
    ) {
        self.corners.clear();
        self.corners.extend([faces[0][0], faces[0][1]]);
        self.corners.extend(faces.iter().map(|face| face[2]));
        let n = self.corners.len();
        if !self.project(positions) {
            return;
        }
        self.next.clear();
        self.next.extend((1..n).chain([0]));
        self.previous.clear();
        self.previous.extend([n - 1].into_iter().chain(0..n - 1));
        self.reflex.clear();
        for i in 0..n {
            let turn = self.turn(self.previous[i], i, self.next[i]);
            self.reflex.push(turn <= 0.0);
        }
        if !self.reflex.contains(&true) {
            return;
        }
        // A fan begins at the first corner, whose name the others count from.
        let first = names.as_deref().map_or(0, |names| names[0][0]);
        let mut at = 0;
        for (number, slot) in faces.iter_mut().enumerate() {
            // Where nothing is an ear (the polygon crosses itself), the corner at hand is cut off, so that this ends.
            let mut ear = at;
            let mut candidate = at;
            loop {
                if self.is_ear(candidate, tests_left) {
                    ear = candidate;
                    break;
                }
                candidate = self.next[candidate];
                if candidate == at {
                    break;
                }
            }
            let (before, after) = (self.previous[ear], self.next[ear]);
            *slot = [self.corners[before], self.corners[ear], self.corners[after]];
            if let Some(names) = names.as_deref_mut() {
                names[number] = [before, ear, after].map(|corner| first + corner as u32);
            }
            self.next[before] = after;
            self.previous[after] = before;
            for i in [before, after] {
                self.reflex[i] = self.turn(self.previous[i], i, self.next[i]) <= 0.0;
            }
            at = after;
        }
    }

    /// Drops the coordinate in which the polygon is thinnest, so that its orientation is counter-clockwise.
    fn project(&mut self, positions: &[[f64; 3]]) -> bool {
        let origin = positions[self.corners[0] as usize];
        let mut normal = [0.0; 3];
        for pair in self.corners.windows(2) {
            let (p, q) = (subtract(positions[pair[0] as usize], origin), subtract(positions[pair[1] as usize], origin));
            let term = cross(p, q);
            for k in 0..3 {
                normal[k] += term[k];
            }
        }
        let size = normal.map(f64::abs);
        let largest = if size[0] >= size[1] && size[0] >= size[2] {
            0
        } else if size[1] >= size[2] {
            1
        } else {
            2
        };
        if !(size[largest] > 0.0 && normal.iter().all(|x| x.is_finite())) {
            return false;
        }
        let (mut u, mut v) = ((largest + 1) % 3, (largest + 2) % 3);
        if normal[largest] < 0.0 {
            std::mem::swap(&mut u, &mut v);
        }
        self.points.clear();
        for &corner in &self.corners {
            let p = subtract(positions[corner as usize], origin);
            self.points.push([p[u], p[v]]);
        }
        true
    }

    /// Twice the signed area of the triangle of three corners.
    fn turn(&self, i: usize, j: usize, k: usize) -> f64 {
        let (p, q, r) = (self.points[i], self.points[j], self.points[k]);
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    }

    fn is_ear(&self, ear: usize, tests_left: &mut usize) -> bool {
        // Also pays for visiting a corner, so that the search for ears is bounded as well.
        *tests_left = tests_left.saturating_sub(1);
        if self.reflex[ear] {
            return false;
        }
        let (before, after) = (self.previous[ear], self.next[ear]);
        let triangle = [self.points[before], self.points[ear], self.points[after]];
        let mut i = self.next[after];
        while i != before {
            *tests_left = tests_left.saturating_sub(1);
            // Only a reflex corner can be the first to enter a triangle. A corner at the same place as one of the
            // triangle's is the other bank of a bridge to a hole.
            if self.reflex[i]
                && !triangle.contains(&self.points[i])
                && self.turn(before, ear, i) >= 0.0
                && self.turn(ear, after, i) >= 0.0
                && self.turn(after, before, i) >= 0.0
            {
                return false;
            }
            i = self.next[i];
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MeshFormat, RawMesh, ReadLimits, read};
    use super::*;
    use std::fmt::Write;

    fn polygon(points: &[[f64; 3]]) -> RawMesh {
        let mut text = String::new();
        for [x, y, z] in points {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        text.push('f');
        for i in 1..=points.len() {
            write!(text, " {i}").unwrap();
        }
        read(text.as_bytes(), MeshFormat::Obj, &ReadLimits { corners_per_polygon: 2_000_000, ..Default::default() })
            .unwrap()
    }

    fn normals(mesh: &RawMesh) -> Vec<[f64; 3]> {
        let p = |v: u32| mesh.positions[v as usize];
        mesh.faces.iter().map(|&[a, b, c]| cross(subtract(p(b), p(a)), subtract(p(c), p(a)))).collect()
    }

    /// All triangles look the same way and their areas add up to `area`.
    fn assert_tiles(mesh: &RawMesh, corners: usize, area: f64) {
        assert_eq!(mesh.faces.len(), corners - 2);
        let normals = normals(mesh);
        let total = normals.iter().fold([0.0; 3], |s, n| [s[0] + n[0], s[1] + n[1], s[2] + n[2]]);
        let lengths: f64 = normals.iter().map(|&n| dot(n, n).sqrt()).sum();
        assert!((dot(total, total).sqrt() / 2.0 - area).abs() < 1e-9 * area);
        assert!((lengths / 2.0 - area).abs() < 1e-9 * area, "{} against {area}", lengths / 2.0);
    }

    #[test]
    fn a_dart_is_cut_by_the_diagonal_inside() {
        for shift in 0..4 {
            let mut points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 4.0, 0.0]];
            points.rotate_left(shift);
            assert_tiles(&polygon(&points), 4, 4.0);
        }
    }

    #[test]
    fn convex_polygons_are_fans() {
        let points: Vec<_> = (0..7).map(|k| (k as f64 * 0.897).sin_cos()).map(|(y, x)| [x, y, 0.0]).collect();
        let mesh = polygon(&points);
        assert_eq!(mesh.faces, (1..6).map(|k| [0, k, k + 1]).collect::<Vec<_>>());
        assert_eq!(mesh.polygons_triangulated, 1);
    }

    #[test]
    fn combs_stars_and_spirals_are_tiled_in_every_plane() {
        let comb: Vec<[f64; 2]> = (0..20)
            .flat_map(|k| {
                let x = k as f64;
                [[x, 1.0], [x + 0.25, 1.0], [x + 0.5, 5.0], [x + 0.75, 1.0]]
            })
            .chain([[20.0, 1.0], [20.0, 0.0], [0.0, 0.0]])
            .rev()
            .collect();
        let star: Vec<[f64; 2]> = (0..50)
            .map(|k| {
                let (y, x) = (k as f64 * std::f64::consts::TAU / 50.0).sin_cos();
                let r = if k % 2 == 0 { 1.0 } else { 0.2 };
                [r * x, r * y]
            })
            .collect();
        let arm = |width: f64| {
            (0..60).map(move |k| {
                let angle = k as f64 * 0.3;
                let r = 1.0 + 0.3 * angle + width;
                [r * angle.cos(), r * angle.sin()]
            })
        };
        let spiral: Vec<[f64; 2]> = arm(0.5).chain(arm(0.0).collect::<Vec<_>>().into_iter().rev()).collect();
        for shape in [comb, star, spiral] {
            let area: f64 = (0..shape.len())
                .map(|i| {
                    let (p, q) = (shape[i], shape[(i + 1) % shape.len()]);
                    (p[0] * q[1] - p[1] * q[0]) / 2.0
                })
                .sum();
            for lift in [
                |[x, y]: [f64; 2]| [x, y, 0.0],
                |[x, y]: [f64; 2]| [y, x, 3.0],
                |[x, y]: [f64; 2]| [0.0, x, y],
                |[x, y]: [f64; 2]| [x, 0.1, y],
            ] {
                let points: Vec<_> = shape.iter().map(|&p| lift(p)).collect();
                assert_tiles(&polygon(&points), shape.len(), area.abs());
            }
        }
    }

    #[test]
    fn crossing_flat_and_non_finite_polygons_keep_their_number_of_triangles() {
        let mut pentagram: Vec<_> = (0..5).map(|k| (k as f64 * 2.513).sin_cos()).map(|(y, x)| [x, y, 0.0]).collect();
        assert_eq!(polygon(&pentagram).faces.len(), 3);
        pentagram[2] = [f64::NAN, 0.0, f64::INFINITY];
        assert_eq!(polygon(&pentagram).faces.len(), 3);
        assert_eq!(polygon(&[[0.0; 3]; 9]).faces.len(), 7);
    }

    #[test]
    fn a_polygon_of_900_000_corners_and_many_jagged_ones_end() {
        let jag = |k: usize| [k as f64, if k.is_multiple_of(2) { 0.0 } else { 1.0 + k as f64 * 1e-3 }, 0.0];
        let points: Vec<_> = (0..900_000).map(jag).collect();
        assert_eq!(polygon(&points).faces.len(), 899_998);
        let mut text: String = (0..2000).map(jag).fold(String::new(), |mut text, [x, y, z]| {
            writeln!(text, "v {x} {y} {z}").unwrap();
            text
        });
        let face: String = (1..=2000).fold("f".into(), |mut text, k| {
            write!(text, " {k}").unwrap();
            text
        });
        for _ in 0..500 {
            text.push_str(&face);
            text.push('\n');
        }
        let mesh = read(text.as_bytes(), MeshFormat::Obj, &ReadLimits::default()).unwrap();
        assert_eq!((mesh.faces.len(), mesh.polygons_triangulated), (500 * 1998, 500));
    }
}
