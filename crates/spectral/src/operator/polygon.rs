//! The Laplace–Beltrami operator of polygons that keep their shape, by virtual refinement.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, weak form; on triangles that of cotangents |
//! | definiteness | `S` positive semi-definite, its kernel the functions constant on each component; `M` positive definite |
//! | units | as for cotangents |
//! | boundary | natural (Neumann) |
//! | valid for | polygons of any number of corners, flat or not, convex or not |
//! | source | Bunge, Herholz, Kazhdan and Botsch 2020, Polygon Laplacian Made Simple |
//!
//! Each polygon gets a point in its middle, where the squared areas of the triangles from it to the edges are least, as
//! an affine combination of its corners. Functions take the same combination of their values there, so that these
//! points are no unknowns: with `P` that prolongs functions to them, `S = Pᵀ S' P` and `M = Pᵀ M' P` for the cotangents
//! of the finer mesh. No diagonal is preferred.

use chladni_algebra::SparseMatrix;
use chladni_base::Vector3;
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;
use chladni_mesh::polygons::Loops;

use super::curvature::Surface;
use super::hamiltonian;
use super::laplace::{self, Measured, Quality};
use super::{EigenProblem, MassKind, MassMatrix, OperatorError};

/// A mesh with a point in the middle of each polygon of more than three corners.
pub(super) struct Refined {
    /// The vertices of the mesh, then the middles; the triangles, and around each middle a fan.
    mesh: TriangleMesh,
    pub measured: Measured,
    polygons: Loops,
    /// For each corner of each polygon its share in the middle.
    shares: Vec<Vec<f64>>,
}

impl Refined {
    /// That of a mesh; `None` where it has no polygons.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of(mesh: &TriangleMesh) -> Result<Option<Self>, OperatorError> {
        let polygons = mesh.polygons.as_ref().map(|polygons| polygons.loops(&mesh.faces));
        polygons.filter(|polygons| !polygons.is_empty()).map(|polygons| Self::new(mesh, polygons)).transpose()
    }

    /// # Errors
    /// [`OperatorError`], as of the cotangents of the finer mesh.
    pub fn new(mesh: &TriangleMesh, polygons: Loops) -> Result<Self, OperatorError> {
        // Corners are looked at before they are used.
        laplace::measure(mesh)?;
        let n = mesh.positions.len();
        let shares: Vec<Vec<f64>> =
            (0..polygons.len()).into_par_iter().map(|polygon| shares(mesh, polygons.corners(polygon))).collect();
        let mut positions = mesh.positions.clone();
        let mut faces = Vec::with_capacity(mesh.faces.len() + 2 * polygons.len());
        let mut next = 0;
        for (polygon, shares) in shares.iter().enumerate() {
            let (range, corners) = (polygons.faces(polygon), polygons.corners(polygon));
            faces.extend_from_slice(&mesh.faces[next..range.start]);
            next = range.end;
            let middle = (n + polygon) as u32;
            faces.extend((0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()], middle]));
            let sum: Vector3 = corners.iter().zip(shares).map(|(&corner, &share)| share * mesh.point(corner)).sum();
            positions.push(sum.into());
        }
        faces.extend_from_slice(&mesh.faces[next..]);
        let mesh = TriangleMesh { positions, faces, ..Default::default() };
        let measured = laplace::measure(&mesh)?;
        Ok(Self { mesh, measured, polygons, shares })
    }

    /// How many polygons of more than three corners there are.
    pub fn polygons(&self) -> usize {
        self.polygons.len()
    }

    /// How many faces there are, and how many of them are bad. A polygon is thin where it is so from its middle to
    /// every edge: where only some edges point at the middle, as in a concave one, it is as good as others.
    pub fn quality(&self) -> Quality {
        let thin = |face: usize| laplace::is_thin(&self.measured.shapes[face]);
        let mut quality = Quality { faces: 0, thin: 0, needles: self.measured.needles };
        // The first triangle that was not looked at yet, of the mesh and of the finer one.
        let (mut next, mut at) = (0, 0);
        for polygon in 0..self.polygons() {
            let (range, corners) = (self.polygons.faces(polygon), self.polygons.corners(polygon).len());
            let fan = at + range.start - next;
            quality.faces += fan - at + 1;
            quality.thin += (at..fan).filter(|&face| thin(face)).count();
            quality.thin += usize::from((fan..fan + corners).all(thin));
            (next, at) = (range.end, fan + corners);
        }
        let rest = at..self.mesh.faces.len();
        quality.faces += rest.len();
        quality.thin += rest.filter(|&face| thin(face)).count();
        quality
    }

    /// The problem on the vertices of the mesh, and the number of those without mass.
    pub fn problem(&self, mass: MassKind) -> (EigenProblem, usize) {
        let (fine, massless) = laplace::cotangent(&self.mesh, &self.measured, 1.0, mass);
        let n = self.vertices();
        let around = Around::new(n, &self.polygons);
        let stiffness = balanced(self.restricted(&fine.stiffness, &around), &around);
        let mass = match &fine.mass {
            MassMatrix::Sparse(matrix) => MassMatrix::Sparse(self.restricted(matrix, &around)),
            lumped => MassMatrix::Diagonal(self.lumped(&lumped.lumped(), n)),
        };
        (EigenProblem { stiffness, mass, area: fine.area, unknowns: None }, massless)
    }

    /// The stiffness of that [`problem`](Self::problem) with a potential, one value for each vertex of the mesh on unit
    /// area. Lumped masses carry the values of their vertices; else values in the middles are those of functions,
    /// within what the corners have.
    pub fn with_potential(&self, problem: &EigenProblem, scaled: &[f64]) -> SparseMatrix {
        if let MassMatrix::Diagonal(_) = &problem.mass {
            return hamiltonian::add_potential(problem, &[], &[], scaled);
        }
        let mut values = scaled.to_vec();
        for (polygon, shares) in self.shares.iter().enumerate() {
            let corners = self.polygons.corners(polygon).iter().map(|&corner| scaled[corner as usize]);
            let (least, most) =
                corners.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
            // A share may be negative, and what follows from the least value is to hold.
            values.push(corners.zip(shares).map(|(v, share)| share * v).sum::<f64>().clamp(least, most));
        }
        let (fine, _) = laplace::cotangent(&self.mesh, &self.measured, 1.0, MassKind::Consistent);
        let stiffness = hamiltonian::add_potential(&fine, &self.mesh.faces, &self.measured.shapes, &values);
        self.restricted(&stiffness, &Around::new(scaled.len(), &self.polygons))
    }

    /// Unit normals of the vertices of the mesh.
    pub fn normals(&self) -> Vec<[f64; 3]> {
        let mut normals = Surface::new(&self.mesh, &self.measured).normals(&self.measured.corners);
        normals.truncate(self.vertices());
        normals
    }

    /// `κ₁² + κ₂²` of the vertices of the mesh.
    pub fn squared_curvatures(&self) -> Vec<f64> {
        let mut squares = Surface::new(&self.mesh, &self.measured).curvatures(&self.measured.corners).squares();
        squares.truncate(self.vertices());
        squares
    }

    fn vertices(&self) -> usize {
        self.mesh.positions.len() - self.polygons.len()
    }

    /// `Pᵀ A P`, symmetric to the last bit where `A` is.
    fn restricted(&self, fine: &SparseMatrix, around: &Around) -> SparseMatrix {
        let n = around.vertices();
        let entry = |row: usize, column: u32| {
            let (columns, values) = fine.row(row);
            columns.binary_search(&column).map_or(0.0, |place| values[place])
        };
        // Of each middle its own entry, and those with the corners.
        let middles: Vec<(f64, Vec<f64>)> = (0..self.polygons.len())
            .into_par_iter()
            .map(|polygon| {
                let row = n + polygon;
                let corners = self.polygons.corners(polygon);
                (entry(row, row as u32), corners.iter().map(|&corner| entry(row, corner)).collect())
            })
            .collect();
        let rows: Vec<(Vec<u32>, Vec<f64>)> = (0..n)
            .into_par_iter()
            .map(|row| {
                let (columns, values) = fine.row(row);
                let own = columns.iter().zip(values).filter(|(column, _)| (**column as usize) < n);
                let mut terms: Vec<(u32, f64)> = own.map(|(&column, &value)| (column, value)).collect();
                for &[polygon, place] in around.of(row) {
                    let (polygon, place) = (polygon as usize, place as usize);
                    let (shares, (middle, sides)) = (&self.shares[polygon], &middles[polygon]);
                    for (other, &column) in self.polygons.corners(polygon).iter().enumerate() {
                        let crossed = sides[place] * shares[other] + sides[other] * shares[place];
                        terms.push((column, crossed + middle * (shares[place] * shares[other])));
                    }
                }
                // Stable: what is summed keeps its order, which is the same on both sides of the diagonal.
                terms.sort_by_key(|term| term.0);
                let sums = terms.chunk_by(|a, b| a.0 == b.0);
                sums.map(|same| (same[0].0, same.iter().map(|term| term.1).sum::<f64>())).unzip()
            })
            .collect();
        let mut offsets = Vec::with_capacity(n + 1);
        offsets.push(0);
        offsets.extend(rows.iter().scan(0, |end, row| {
            *end += row.0.len();
            Some(*end)
        }));
        let (columns, values): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        SparseMatrix::from_sorted_parts(n, n, offsets, columns.concat(), values.concat())
    }

    /// The mass of each middle goes to the corners by their shares; evenly where some of these are negative, so that no
    /// mass is.
    fn lumped(&self, masses: &[f64], n: usize) -> Vec<f64> {
        let mut lumped = masses[..n].to_vec();
        for (polygon, shares) in self.shares.iter().enumerate() {
            let even = 1.0 / shares.len() as f64;
            let fair = shares.iter().all(|&share| share >= 0.0);
            for (&corner, &share) in self.polygons.corners(polygon).iter().zip(shares) {
                lumped[corner as usize] += masses[n + polygon] * if fair { share } else { even };
            }
        }
        lumped
    }
}

/// The same with the diagonal of corners of polygons what makes their rows sum to zero: roundings of large terms that
/// nearly cancel would hide from a solver that constants are in the kernel.
fn balanced(matrix: SparseMatrix, around: &Around) -> SparseMatrix {
    let mut values = matrix.values().to_vec();
    for row in (0..matrix.rows()).filter(|&row| !around.of(row).is_empty()) {
        let (columns, entries) = matrix.row(row);
        if let Ok(own) = columns.binary_search(&(row as u32)) {
            let others = entries.iter().enumerate().filter(|&(place, _)| place != own);
            values[matrix.offsets()[row] + own] = -others.map(|(_, value)| value).sum::<f64>();
        }
    }
    let (offsets, columns) = (matrix.offsets().to_vec(), matrix.indices().to_vec());
    SparseMatrix::from_sorted_parts(matrix.rows(), matrix.columns(), offsets, columns, values)
}

/// For each vertex the polygons it is a corner of, ascending, and its place in them.
struct Around {
    offsets: Vec<usize>,
    places: Vec<[u32; 2]>,
}

impl Around {
    fn new(n: usize, polygons: &Loops) -> Self {
        let mut offsets = vec![0; n + 1];
        let all = || {
            (0..polygons.len()).flat_map(|polygon| {
                let corners = polygons.corners(polygon).iter().enumerate();
                corners.map(move |(place, &corner)| (corner as usize, [polygon as u32, place as u32]))
            })
        };
        all().for_each(|(corner, _)| offsets[corner + 1] += 1);
        (0..n).for_each(|vertex| offsets[vertex + 1] += offsets[vertex]);
        let mut next = offsets.clone();
        let mut places = vec![[0; 2]; offsets[n]];
        for (corner, place) in all() {
            places[next[corner]] = place;
            next[corner] += 1;
        }
        Self { offsets, places }
    }

    fn vertices(&self) -> usize {
        self.offsets.len() - 1
    }

    fn of(&self, vertex: usize) -> &[[u32; 2]] {
        &self.places[self.offsets[vertex]..self.offsets[vertex + 1]]
    }
}

/// The affine combination of the corners that is where the squared areas of the fan are least; of all such combinations
/// the one with the least squares.
fn shares(mesh: &TriangleMesh, corners: &[u32]) -> Vec<f64> {
    let n = corners.len();
    let even = 1.0 / n as f64;
    // About the mean of the corners, and of size 1.
    let mean: Vector3 = corners.iter().map(|&corner| even * mesh.point(corner)).sum();
    let mut points: Vec<Vector3> = corners.iter().map(|&corner| mesh.point(corner) - mean).collect();
    let size = Vector3::arrays(&points).as_flattened().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if !(size > 0.0) {
        return vec![even; n];
    }
    points.iter_mut().for_each(|p| *p /= size);
    // The sum of |a × b + (b − a) × p|² over the edges is quadratic in p.
    let (mut matrix, mut right) = ([[0.0; 3]; 3], Vector3::ZERO);
    for i in 0..n {
        let (a, b) = (points[i], points[(i + 1) % n]);
        let d = b - a;
        let square = d.norm_squared();
        for r in 0..3 {
            (0..3).for_each(|c| matrix[r][c] += if r == c { square } else { 0.0 } - d[r] * d[c]);
        }
        // (d ×)ᵀ c = −d × c, which goes to the other side.
        right += d.cross(a.cross(b));
    }
    let Some(middle) = solved(matrix, right) else { return vec![even; n] };
    let mut spread = [[0.0; 3]; 3];
    for p in &points {
        (0..3).for_each(|r| (0..3).for_each(|c| spread[r][c] += p[r] * p[c]));
    }
    // The middle lies where the corners spread to; what is added only keeps flat polygons from dividing by zero.
    let little = 1e-13 * (spread[0][0] + spread[1][1] + spread[2][2]);
    (0..3).for_each(|axis| spread[axis][axis] += little);
    let Some(slope) = solved(spread, middle) else { return vec![even; n] };
    points.iter().map(|&p| even + p.dot(slope)).collect()
}

/// The solution of a symmetric positive definite system of three, by LDLᵀ; `None` where a pivot is next to nothing.
fn solved(a: [[f64; 3]; 3], b: Vector3) -> Option<Vector3> {
    let least = 1e-15 * (a[0][0] + a[1][1] + a[2][2]);
    let positive = |pivot: f64| (pivot > least).then_some(pivot);
    let d0 = positive(a[0][0])?;
    let (l10, l20) = (a[1][0] / d0, a[2][0] / d0);
    let d1 = positive(a[1][1] - l10 * l10 * d0)?;
    let l21 = (a[2][1] - l20 * l10 * d0) / d1;
    let d2 = positive(a[2][2] - l20 * l20 * d0 - l21 * l21 * d1)?;
    let y1 = b[1] - l10 * b[0];
    let y2 = b[2] - l20 * b[0] - l21 * y1;
    let x2 = y2 / d2;
    let x1 = y1 / d1 - l21 * x2;
    Some(Vector3::new(b[0] / d0 - l10 * x1 - l20 * x2, x1, x2))
}

#[cfg(test)]
#[path = "polygon_tests.rs"]
mod tests;
