//! The field of unit vectors against the gradient of heat, as far as a Poisson equation needs it: its integrated
//! divergence.

use chladni_algebra::vectorized;
use chladni_base::parallel::*;
use chladni_mesh::intrinsic::IntrinsicTriangulation;

/// Triangles that are handled side by side.
const AT_ONCE: usize = 16;

/// Parts that add up what they give to vertices by themselves: as many whatever the number of threads is, so that sums
/// do not depend on it.
const PARTS: usize = 4;

/// Triangles at which slopes are looked at: as many as tell an average to a percent of itself.
const LOOKED_AT: usize = 20_000;

/// Triangles with their vertices in the order of a factor, sorted by the first of these: what is read and added to lies
/// together.
#[derive(Debug)]
pub(super) struct UnitGradients {
    vertices: usize,
    /// How often the triangles cover the surface.
    sheets: f64,
    corners: Vec<[u32; 3]>,
    shapes: Vec<FaceMetric>,
    /// The other side of each half-edge.
    twins: Vec<[u32; 3]>,
}

#[derive(Debug, Clone, Copy)]
struct FaceMetric {
    half_cotangents: [f64; 3],
    /// The area, over the square of the number of sheets.
    area: f64,
}

/// Some triangles side by side.
struct Together {
    /// Steps of the heat along the edges opposite to the corners.
    steps: [[f64; AT_ONCE]; 3],
    half_cotangents: [[f64; AT_ONCE]; 3],
    area: [f64; AT_ONCE],
}

impl UnitGradients {
    /// `place` is where each vertex is in the order of the factor.
    pub fn new(triangulation: &IntrinsicTriangulation, place: &[u32]) -> Self {
        let share = 1.0 / triangulation.sheets() as f64;
        let corners: Vec<[u32; 3]> =
            triangulation.faces().iter().map(|face| face.map(|vertex| place[vertex as usize])).collect();
        let mut order: Vec<u32> = (0..corners.len() as u32).collect();
        order.sort_by_key(|&face| corners[face as usize].iter().min().copied());
        let mut at = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&face, new)| at[face as usize] = new);
        let shapes = order.iter().map(|&face| {
            let shape = triangulation.shapes()[face as usize];
            FaceMetric { half_cotangents: shape.half_cotangents, area: share * share * shape.area }
        });
        let twins = order.iter().map(|&face| {
            let twin = |corner: usize| triangulation.twin(3 * face + corner as u32);
            std::array::from_fn(|corner| 3 * at[twin(corner) as usize / 3] + twin(corner) % 3)
        });
        Self {
            vertices: place.len(),
            sheets: triangulation.sheets() as f64,
            shapes: shapes.collect(),
            twins: twins.collect(),
            corners: order.iter().map(|&face| corners[face as usize]).collect(),
        }
    }

    /// The number of triangles.
    pub fn faces(&self) -> usize {
        self.corners.len()
    }

    /// The corners of a triangle, by their places.
    pub fn corners(&self, face: usize) -> [u32; 3] {
        self.corners[face]
    }

    /// The vertex that a half-edge begins at, by its place.
    pub fn beginning(&self, half_edge: usize) -> u32 {
        self.corners[half_edge / 3][half_edge % 3]
    }

    /// The other side of half-edge `3f + c`, which runs from corner `c` of triangle `f` to the next one.
    pub fn twin(&self, half_edge: usize) -> usize {
        self.twins[half_edge / 3][half_edge % 3] as usize
    }

    /// Half the cotangents of the angles of a triangle.
    pub fn half_cotangents(&self, face: usize) -> [f64; 3] {
        self.shapes[face].half_cotangents
    }

    /// The area of a triangle.
    pub fn area(&self, face: usize) -> f64 {
        // What is kept is over the square of the number of sheets.
        self.shapes[face].area * self.sheets * self.sheets
    }

    /// By how much the slope of a distance differs from one, on average over the area of what the sources of a column
    /// lead to: at some [`LOOKED_AT`] triangles evenly among all. `reached` tells of each vertex, by its place; nothing
    /// without a triangle that is.
    pub fn slope_error(&self, distance: impl Fn(u32) -> f64, reached: impl Fn(u32) -> bool) -> Option<f64> {
        let stride = self.corners.len().div_ceil(LOOKED_AT).max(1);
        let (mut off, mut all) = (0.0, 0.0);
        for face in (0..self.faces()).step_by(stride) {
            let corners = self.corners(face);
            if !reached(corners[0]) {
                continue;
            }
            let [p, q, r] = corners.map(&distance);
            let ([f, g, h], area) = (self.half_cotangents(face), self.area(face));
            let energy = f * (q - r) * (q - r) + g * (r - p) * (r - p) + h * (p - q) * (p - q);
            if area > 0.0 {
                off += area * ((energy.max(0.0) / area).sqrt() - 1.0).abs();
                all += area;
            }
        }
        (all > 0.0).then(|| off / all)
    }

    /// `∫ X · ∇λ_i` with `X = −∇u / |∇u|` at each vertex, in the order of the factor, for the first `columns` of heat,
    /// whose rows are `width` wide.
    pub fn divergence(&self, heat: &[f64], columns: usize, width: usize) -> Vec<f64> {
        assert_eq!(heat.len(), self.vertices * width, "a row of heat for each vertex");
        assert!(columns <= width, "columns of these rows");
        // Many columns would need as many times the memory in parts.
        let parts = if width == 1 { PARTS } else { 1 };
        let each = self.corners.len().div_ceil(parts).max(1);
        let part = |(corners, shapes): (&[[u32; 3]], &[FaceMetric])| {
            let mut sums = vec![0.0; heat.len()];
            for (corners, shapes) in corners.chunks(AT_ONCE).zip(shapes.chunks(AT_ONCE)) {
                add(corners, shapes, heat, columns, width, &mut sums);
            }
            sums
        };
        let split = self.corners.par_chunks(each).zip(self.shapes.par_chunks(each));
        let mut sums = split.map(part).collect::<Vec<_>>().into_iter();
        let mut all = sums.next().unwrap_or_else(|| vec![0.0; heat.len()]);
        for part in sums {
            all.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
        }
        all
    }
}

/// Adds what some triangles give to their vertices.
fn add(corners: &[[u32; 3]], shapes: &[FaceMetric], heat: &[f64], columns: usize, width: usize, sums: &mut [f64]) {
    let mut together =
        Together { steps: [[0.0; AT_ONCE]; 3], half_cotangents: [[0.0; AT_ONCE]; 3], area: [0.0; AT_ONCE] };
    for (k, shape) in shapes.iter().enumerate() {
        (0..3).for_each(|corner| together.half_cotangents[corner][k] = shape.half_cotangents[corner]);
        together.area[k] = shape.area;
    }
    for column in 0..columns {
        for (k, corners) in corners.iter().enumerate() {
            let [p, q, r] = corners.map(|place| heat[place as usize * width + column]);
            (together.steps[0][k], together.steps[1][k], together.steps[2][k]) = (q - r, r - p, p - q);
        }
        let divergence = together.divergence();
        for (k, corners) in corners.iter().enumerate() {
            for (&place, divergence) in corners.iter().zip(&divergence) {
                sums[place as usize * width + column] += divergence[k];
            }
        }
    }
}

impl Together {
    /// What each corner gets. Nothing where heat does not change.
    fn divergence(&self) -> [[f64; AT_ONCE]; 3] {
        vectorized(
            self,
            #[inline(always)]
            |Self { steps, half_cotangents, area }| {
                let mut given = [[0.0; AT_ONCE]; 3];
                for k in 0..AT_ONCE {
                    let most = steps[0][k].abs().max(steps[1][k].abs()).max(steps[2][k].abs());
                    // Heat may be so small that squares would be zero.
                    let unit = if most > 0.0 { most } else { 1.0 };
                    let (a, b, c) = (steps[0][k] / unit, steps[1][k] / unit, steps[2][k] / unit);
                    let (f, g, h) = (half_cotangents[0][k] * a, half_cotangents[1][k] * b, half_cotangents[2][k] * c);
                    let energy = f * a + g * b + h * c;
                    let factor = if energy > 0.0 { -(area[k] / energy).sqrt() } else { 0.0 };
                    (given[0][k], given[1][k], given[2][k]) = (factor * (h - g), factor * (f - h), factor * (g - f));
                }
                given
            },
        )
    }
}
