//! Ways down a distance: by how much it is off along paths from points all over the surface to its sources.
//!
//! A slope that is wrong in a small place, such as a narrow bridge, makes all distances behind it wrong. Where one goes
//! down the steepest way, the length of the path is what the distance should be.

use chladni_base::parallel::*;

use super::unit_gradients::UnitGradients;

/// Paths of each distance: as many as tell the norm of its error to a tenth of itself.
const PATHS: usize = 64;

/// Triangles among which their beginnings are chosen, by area.
const BEGINNINGS: usize = 20_000;

/// Steps of a path, for each that a straight one takes about. Whoever takes more goes around in circles, by rounding.
const STEPS: usize = 20;

/// A point of a path.
#[derive(Debug, Clone, Copy)]
enum Point {
    /// In a triangle, by barycentric coordinates; the corner opposite to the edge that it came over.
    Inside { face: usize, at: [f64; 3], behind: Option<usize> },
    /// At the vertex that a half-edge begins at.
    Corner(usize),
}

/// A distance on the triangles, zero at its sources.
pub(super) struct Slopes<'a, D, S> {
    pub triangles: &'a UnitGradients,
    /// The distance of each vertex, by its place.
    pub distance: D,
    pub is_source: S,
}

/// How the distance falls in a triangle.
struct Fall {
    /// What the steepest way down changes of each barycentric coordinate, and how long it is, in the same time.
    rates: [f64; 3],
    slope: f64,
}

impl<D: Fn(u32) -> f64 + Sync, S: Fn(u32) -> bool + Sync> Slopes<'_, D, S> {
    /// The error of the distance along paths from points spread evenly over what is `reached`: in the norm of L²,
    /// relative to the lengths of the paths. Nothing without such points.
    pub fn error(&self, reached: impl Fn(u32) -> bool) -> Option<f64> {
        let paths: Vec<(f64, f64)> =
            self.beginnings(reached).into_par_iter().filter_map(|face| self.path(face)).collect();
        let (off, all) = paths.iter().fold((0.0, 0.0), |(off, all), (distance, length)| {
            (off + (distance - length) * (distance - length), all + length * length)
        });
        (all > 0.0).then(|| (off / all).sqrt())
    }

    /// Triangles at equal steps of area.
    fn beginnings(&self, reached: impl Fn(u32) -> bool) -> Vec<usize> {
        let stride = self.triangles.faces().div_ceil(BEGINNINGS).max(1);
        let faces = (0..self.triangles.faces()).step_by(stride);
        let areas: Vec<(usize, f64)> = faces
            .map(|face| (face, self.triangles.area(face)))
            .filter(|&(face, area)| area > 0.0 && reached(self.triangles.corners(face)[0]))
            .collect();
        let step = areas.iter().map(|(_, area)| area).sum::<f64>() / PATHS as f64;
        let (mut sum, mut chosen) = (0.0, Vec::with_capacity(PATHS));
        for (face, area) in areas {
            sum += area;
            while sum > (chosen.len() as f64 + 0.5) * step && chosen.len() < PATHS {
                chosen.push(face);
            }
        }
        chosen
    }

    /// By how much the distance falls from the middle of a triangle to the end of the path, and how long that is;
    /// nothing where the distance does not fall.
    fn path(&self, face: usize) -> Option<(f64, f64)> {
        let begin = self.values(face).iter().sum::<f64>() / 3.0;
        let mut point = Point::Inside { face, at: [1.0 / 3.0; 3], behind: None };
        let mut length = 0.0;
        let most = STEPS * (10 + self.triangles.faces().isqrt());
        let mut end = None;
        for _ in 0..most {
            if let Some(left) = self.to_source(point) {
                return Some((begin, length + left));
            }
            let next = match point {
                Point::Inside { face, at, behind } => self.across(face, at, behind),
                Point::Corner(half_edge) => self.leaving(half_edge),
            };
            let Some((gone, next)) = next else { break };
            length += gone;
            point = next;
            end = Some(point);
        }
        let end = match end? {
            Point::Inside { face, at, .. } => (0..3).map(|k| at[k] * self.values(face)[k]).sum(),
            Point::Corner(half_edge) => (self.distance)(self.triangles.beginning(half_edge)),
        };
        // What is left lies below a place from which no way leads down.
        Some((begin, length + f64::max(end, 0.0)))
    }

    /// How far it is to a source in the same triangle.
    fn to_source(&self, point: Point) -> Option<f64> {
        match point {
            Point::Corner(half_edge) => (self.is_source)(self.triangles.beginning(half_edge)).then_some(0.0),
            Point::Inside { face, at, .. } => {
                let corners = self.triangles.corners(face);
                let to = |corner: usize| {
                    let mut step = at;
                    step[corner] -= 1.0;
                    self.length(face, step)
                };
                (0..3).filter(|&corner| (self.is_source)(corners[corner])).map(to).reduce(f64::min)
            }
        }
    }

    /// Down through a triangle, or along the edge that it came over where it would go back; nothing where it is flat.
    fn across(&self, face: usize, at: [f64; 3], behind: Option<usize>) -> Option<(f64, Point)> {
        let fall = self.fall(face)?;
        if let Some(corner) = behind.filter(|&corner| !(fall.rates[corner] > 0.0)) {
            let values = self.values(face);
            let (i, j) = ((corner + 1) % 3, (corner + 2) % 3);
            let (low, high) = if values[i] <= values[j] { (i, j) } else { (j, i) };
            let mut step = [0.0; 3];
            (step[low], step[high]) = (at[high], -at[high]);
            return Some((self.length(face, step), Point::Corner(3 * face + low)));
        }
        let ends = (0..3).filter(|&k| fall.rates[k] < 0.0 && behind != Some(k)).map(|k| (at[k] / -fall.rates[k], k));
        let (time, out) = ends.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut at: [f64; 3] = std::array::from_fn(|k| (at[k] + time * fall.rates[k]).max(0.0));
        at[out] = 0.0;
        // The edge that it goes over begins at the corner after the one opposite to it, where its other side ends.
        let (from, to) = ((out + 1) % 3, (out + 2) % 3);
        let over = self.triangles.twin(3 * face + from);
        let (other, first) = (over / 3, over % 3);
        let mut there = [0.0; 3];
        let sum = at[from] + at[to];
        (there[first], there[(first + 1) % 3]) = (at[to] / sum, at[from] / sum);
        let next = Point::Inside { face: other, at: there, behind: Some((first + 2) % 3) };
        (sum > 0.0).then_some((time * fall.slope, next))
    }

    /// Down from a vertex: into the triangle in which that is steepest, or along the steepest edge; nothing at a lowest
    /// vertex.
    fn leaving(&self, half_edge: usize) -> Option<(f64, Point)> {
        let here = (self.distance)(self.triangles.beginning(half_edge));
        let mut steepest: (f64, Option<Point>) = (0.0, None);
        let mut edge: (f64, Option<(f64, Point)>) = (0.0, None);
        let mut around = half_edge;
        // A vertex may have very many triangles, and a path has few vertices.
        for _ in 0..self.triangles.faces() {
            let (face, corner) = (around / 3, around % 3);
            let (next, last) = ((corner + 1) % 3, (corner + 2) % 3);
            let between = |fall: &Fall| fall.rates[next] >= 0.0 && fall.rates[last] >= 0.0 && fall.slope > steepest.0;
            if let Some(fall) = self.fall(face).filter(between) {
                let mut at = [0.0; 3];
                at[corner] = 1.0;
                steepest = (fall.slope, Some(Point::Inside { face, at, behind: None }));
            }
            let mut step = [0.0; 3];
            (step[corner], step[next]) = (-1.0, 1.0);
            let length = self.length(face, step);
            let slope = (here - self.values(face)[next]) / length;
            if slope > edge.0 {
                edge = (slope, Some((length, Point::Corner(3 * face + next))));
            }
            around = self.triangles.twin(3 * face + last);
            if around == half_edge {
                break;
            }
        }
        steepest.1.map(|point| (0.0, point)).or(edge.1)
    }

    fn values(&self, face: usize) -> [f64; 3] {
        self.triangles.corners(face).map(&self.distance)
    }

    /// Nothing where the triangle has no area, or the distance does not change.
    fn fall(&self, face: usize) -> Option<Fall> {
        let ([f, g, h], area) = (self.triangles.half_cotangents(face), self.triangles.area(face));
        let [p, q, r] = self.values(face);
        let (a, b, c) = (q - r, r - p, p - q);
        let energy = f * a * a + g * b * b + h * c * c;
        let rates = [g * b - h * c, h * c - f * a, f * a - g * b].map(|rate| rate / area);
        (area > 0.0 && energy > 0.0).then(|| Fall { rates, slope: (energy / area).sqrt() })
    }

    /// The length of a step by barycentric coordinates, whose sum is zero.
    fn length(&self, face: usize, [u, v, w]: [f64; 3]) -> f64 {
        let ([f, g, h], area) = (self.triangles.half_cotangents(face), self.triangles.area(face));
        // |e_k|² = 4 A (h_i + h_j), and |Σ λ_i p_i|² = −Σ λ_i λ_j |p_i − p_j|².
        let squared = -4.0 * area * (v * w * (g + h) + w * u * (h + f) + u * v * (f + g));
        squared.max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::heat::HeatGeodesics;
    use crate::operator::robust;
    use chladni_base::Unwatched;
    use chladni_mesh::TriangleMesh;
    use chladni_mesh::distance::ExactGeodesics;
    use chladni_mesh::measure::face_area;
    use chladni_mesh::shape::{Shape, generate};

    /// A plate of cells, from a corner.
    fn plate([columns, rows]: [usize; 2], [width, height]: [f64; 2], x: f64) -> TriangleMesh {
        let at = |k: usize| {
            let (i, j) = (k % (columns + 1), k / (columns + 1));
            [x + width * i as f64 / columns as f64, height * j as f64 / rows as f64, 0.0]
        };
        let faces = (0..columns * rows).flat_map(|k| {
            let a = (k / columns * (columns + 1) + k % columns) as u32;
            let (b, d) = (a + 1, a + columns as u32 + 1);
            [[a, b, d + 1], [a, d + 1, d]]
        });
        let positions = (0..(columns + 1) * (rows + 1)).map(at).collect();
        TriangleMesh { positions, faces: faces.collect(), ..Default::default() }
    }

    /// Two plates and a bridge of one cell's width in a number of pieces.
    fn bridged(pieces: usize) -> TriangleMesh {
        let (cells, long) = (30, 5.0);
        let mut mesh = plate([cells; 2], [1.0; 2], 0.0);
        let other = plate([cells; 2], [1.0; 2], 1.0 + long);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(&other.positions);
        mesh.faces.extend(other.faces.iter().map(|face| face.map(|vertex| first + vertex)));
        let edge = |row: usize, column: usize| (row * (cells + 1) + column) as u32;
        let mut ends = [edge(15, cells), edge(16, cells)];
        for piece in 1..=pieces {
            let next = if piece == pieces {
                [first + edge(15, 0), first + edge(16, 0)]
            } else {
                let x = 1.0 + long * piece as f64 / pieces as f64;
                mesh.positions.extend([15.0, 16.0].map(|row| [x, row / cells as f64, 0.0]));
                let last = mesh.positions.len() as u32;
                [last - 2, last - 1]
            };
            mesh.faces.extend([[ends[0], next[0], next[1]], [ends[0], next[1], ends[1]]]);
            ends = next;
        }
        mesh
    }

    /// What is told of distances by heat, and their true error.
    fn told_and_true(mesh: &TriangleMesh, source: u32) -> (f64, f64) {
        let heat = HeatGeodesics::new(mesh, None, &Unwatched).unwrap();
        let found = heat.from_nearest(&[&[source]], &Unwatched).unwrap();
        let exact = ExactGeodesics::new(mesh).from_nearest(&[source], &Unwatched).unwrap();
        let (mut off, mut all) = (0.0, 0.0);
        for face in &mesh.faces {
            for vertex in face.map(|vertex| vertex as usize) {
                off += face_area(mesh, face) * (found.distances.column(0)[vertex] - exact[vertex]).powi(2);
                all += face_area(mesh, face) * exact[vertex].powi(2);
            }
        }
        (found.slope_errors[0].unwrap(), (off / all).sqrt())
    }

    #[test]
    fn what_lies_behind_a_small_place_with_wrong_slopes_is_told() {
        let cases = [
            (bridged(1), 0),
            (bridged(3), 0),
            (bridged(20), 0),
            (plate([142; 2], [5.0, 1.0], 0.0), 0),
            (plate([90; 2], [5.0, 1.0], 0.0), 4000),
            (plate([300, 8], [60.0, 1.0], 0.0), 3),
        ];
        for (case, (mesh, source)) in cases.iter().enumerate() {
            let (told, error) = told_and_true(mesh, *source);
            assert!(error < 1.3 * told && told < 6.0 * error, "{case}: {told} {error}");
        }
    }

    /// Distances that are known: paths are as long as these say, but for what a linear function has of a cone.
    #[test]
    fn exact_distances_have_next_to_no_error_along_paths_and_scaled_ones_theirs() {
        for (mesh, source) in [
            (plate([60, 50], [1.0, 2.0], 0.0), 0),
            (generate(Shape::Sphere, 4000).unwrap(), 17),
            (generate(Shape::Torus, 4000).unwrap(), 5),
        ] {
            let exact = ExactGeodesics::new(&mesh).from_nearest(&[source], &Unwatched).unwrap();
            let (_, triangulation) = robust::triangulated(&mesh, &Unwatched).unwrap();
            let place: Vec<u32> = (0..mesh.positions.len() as u32).collect();
            let triangles = UnitGradients::new(&triangulation, &place);
            // In the units of the triangulation.
            let area: f64 = mesh.faces.iter().map(|face| face_area(&mesh, face)).sum();
            let own =
                (0..triangles.faces()).map(|face| triangles.area(face)).sum::<f64>() / triangulation.sheets() as f64;
            for factor in [1.0, 0.7, 1.2] {
                let unit = factor * (own / area).sqrt();
                let slopes = Slopes {
                    triangles: &triangles,
                    distance: |place: u32| unit * exact[place as usize],
                    is_source: |place| place == source,
                };
                let error = slopes.error(|_| true).unwrap();
                assert!((error - f64::abs(factor - 1.0)).abs() < 0.02, "{factor}: {error}");
            }
        }
    }
}
