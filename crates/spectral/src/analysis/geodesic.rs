//! Geodesic distance by the heat method (Crane et al. 2013), with both of its solves in the basis.
//!
//! Heat that starts at a source flows for a short time, `u = Σ e^{−λt} φ(s) φ`; its gradient, turned and brought to
//! unit length, is that of the distance; of all functions the one whose gradient is nearest to that field solves a
//! Poisson equation, in the basis `Σ (φᵀ b / λ) φ`. The mesh is needed for gradients alone.
//!
//! The shorter the time, the nearer the field is to that of the distance, as long as `u` can be told from the errors of
//! the modes: these are some thousandth of its largest value, while `u` falls as `e^{−d²/4t}`. So, unless a time is
//! asked for, a ladder of times is used, and each face takes the shortest at which all its corners are warm enough.

use chladni_algebra::{DenseMatrix, vectorized};
use chladni_base::parallel::*;
use chladni_mesh::TriangleMesh;
use chladni_mesh::points::are_points;

use super::distance::nearest;
use super::error::{self, AnalysisError};
use super::spectrum::kernel_size;
use crate::basis::Basis;

/// The most columns of one call.
pub const MOST_COLUMNS: usize = 64;

/// Heat below this share of its largest value is not told from errors.
const WARM: f32 = 1e-3;

/// The shortest time, over the inverse of the largest eigenvalue: by then the modes that the basis does not have are
/// gone (`e^{−12}`).
const SHORTEST: f64 = 12.0;

/// The most times of a ladder.
const MOST_TIMES: usize = 16;

/// Columns of heat that are held at once.
const HEAT_AT_ONCE: usize = 48;

/// Faces that are handled side by side.
const FACES_AT_ONCE: usize = 128;

/// From so many sources on the ladder has half as many times: each of them costs what all of one source cost.
const MANY_SOURCES: usize = 5;

/// How long heat flows unless it is told: from `12 / λ_max`, each time twice the one before, to `1 / λ_1`, in length²
/// of the input; for five or more sources four times the one before.
///
/// # Errors
/// [`AnalysisError`] where the spectrum has no values above zero, or has negative ones.
pub fn default_times(eigenvalues: &[f64], sources: usize) -> Result<Vec<f64>, AnalysisError> {
    let factor = if sources < MANY_SOURCES { 2f64 } else { 4.0 };
    let first = kernel_size(eigenvalues)?;
    let last = 1.0 / eigenvalues[first];
    let shortest = SHORTEST / eigenvalues.last().copied().unwrap_or(1.0);
    let mut times: Vec<f64> =
        (0..MOST_TIMES as i32).map(|k| shortest * factor.powi(k)).take_while(|time| *time < last).collect();
    times.push(last);
    Ok(times)
}

/// Geodesic distances of all vertices from each of some sources, or from the nearest of them if `together`: `n × s` or
/// `n × 1`.
///
/// Where the basis has too few modes to resolve it the distance is rounded off: near the source and along the cut
/// locus. Vertices that no function of the basis reaches, as on a boundary under the Dirichlet condition, and other
/// components than the source's have no meaningful value.
///
/// # Errors
/// [`AnalysisError`] names a source that is no vertex, a time that is not above zero, a mesh that is not that of the
/// basis.
pub fn geodesic(
    basis: &Basis,
    mesh: &TriangleMesh,
    sources: &[u32],
    together: bool,
    time: Option<f64>,
) -> Result<DenseMatrix, AnalysisError> {
    if mesh.positions.len() != basis.vertices() {
        return Err(AnalysisError::Mesh { basis: basis.vertices(), mesh: mesh.positions.len() });
    }
    if are_points(mesh) {
        return Err(AnalysisError::NoFaces);
    }
    error::lowest(basis)?;
    error::count("sources", sources.len(), 1, MOST_COLUMNS)?;
    let first = kernel_size(&basis.eigenvalues)?;
    let times = match time {
        Some(time) => {
            error::positive("time", time)?;
            vec![time]
        }
        None => default_times(&basis.eigenvalues, sources.len())?,
    };
    let at_sources = basis.at_vertices(sources).map_err(AnalysisError::vertices("source"))?;
    let columns = sources.len();
    let mut divergence = DenseMatrix::zeros(basis.vertices(), columns);
    let batch = (HEAT_AT_ONCE / times.len()).max(1);
    for from in (0..columns).step_by(batch) {
        let batch = from..columns.min(from + batch);
        let mut heat = DenseMatrix::zeros(basis.count(), batch.len() * times.len());
        for (place, source) in batch.clone().enumerate() {
            for (step, time) in times.iter().enumerate() {
                let column = heat.column_mut(place * times.len() + step);
                let mut most = 0.0;
                for (mode, (slot, value)) in column.iter_mut().zip(&basis.eigenvalues).enumerate() {
                    let here = at_sources.column(mode)[source];
                    // Zero comes out of solvers with either sign.
                    *slot = (-value.max(0.0) * time).exp() * here;
                    most += *slot * here;
                }
                // Only directions of gradients count. With 1 at the source single precision does in all units of
                // length.
                if most > 0.0 {
                    column.iter_mut().for_each(|slot| *slot /= most);
                }
            }
        }
        // In single precision: u changes by some thousandth from vertex to vertex, and where it does not nothing is
        // known of the distance.
        let heat = basis.evaluate_single(&heat)?;
        let (n, steps) = (basis.vertices(), times.len());
        let ladders: Vec<Vec<&[f32]>> = heat.chunks(n * steps).map(|ladder| ladder.chunks(n).collect()).collect();
        let fields = unit_divergences(mesh, &ladders);
        batch.zip(&fields).for_each(|(column, field)| divergence.column_mut(column).copy_from_slice(field));
    }
    let mut potential = basis.inner_products(&divergence)?;
    for column in 0..columns {
        let slots = potential.column_mut(column).iter_mut().zip(&basis.eigenvalues).enumerate();
        slots.for_each(|(mode, (slot, value))| *slot = if mode < first { 0.0 } else { *slot / value });
    }
    let mut distances = basis.evaluate(&potential)?;
    // A cone without its frequencies above K, as modes up to λ_max = K² hold it, is rounded off: its tip lies at 1/K.
    let tip = 1.0 / basis.eigenvalues.last().copied().unwrap_or(1.0).sqrt();
    for column in 0..columns {
        let distances = distances.column_mut(column);
        let base = distances[sources[column] as usize] - tip;
        distances.iter_mut().for_each(|d| *d = (*d - base).max(0.0));
        distances[sources[column] as usize] = 0.0;
    }
    // Heat from all sources at once would be cheaper, but is rounded off where it meets.
    if together {
        return Ok(nearest(&distances, 1));
    }
    Ok(distances)
}

/// Two edges of some faces, side by side.
struct Edges {
    /// From the third corner to the first.
    back: [[f64; FACES_AT_ONCE]; 3],
    /// From the first to the second.
    forth: [[f64; FACES_AT_ONCE]; 3],
    /// −½, or 0 where they span no area.
    half: [f64; FACES_AT_ONCE],
}

impl Edges {
    fn new() -> Self {
        let nothing = [[0.0; FACES_AT_ONCE]; 3];
        Self { back: nothing, forth: nothing, half: [0.0; FACES_AT_ONCE] }
    }

    fn fill(&mut self, mesh: &TriangleMesh, faces: &[[u32; 3]]) {
        for (k, face) in faces.iter().enumerate() {
            let [p, q, r] = mesh.corners(face);
            let (back, forth) = (p - r, q - p);
            self.half[k] = if back.cross(forth).norm_squared() > 0.0 { -0.5 } else { 0.0 };
            for i in 0..3 {
                (self.back[i][k], self.forth[i][k]) = (back[i], forth[i]);
            }
        }
    }

    /// What the second and the third corner of each face get of the divergence where `u` rises by `v` and by `w` from
    /// the first corner to them. The first one gets the rest, so that their sum is zero.
    fn divergence(&self, v: &[f64; FACES_AT_ONCE], w: &[f64; FACES_AT_ONCE]) -> [[f64; FACES_AT_ONCE]; 2] {
        vectorized(
            self,
            #[inline(always)]
            |edges| {
                let mut parts = [[0.0; FACES_AT_ONCE]; 2];
                let ([bx, by, bz], [fx, fy, fz]) = (&edges.back, &edges.forth);
                // Without closures, which are not inlined where wide registers may be used.
                for k in 0..FACES_AT_ONCE {
                    // ∇u = n × Σ u_k e_k / |n|, the edges being those opposite to the corners. Differences keep the
                    // digits of a u that is nearly constant.
                    let (x, y, z) =
                        (v[k] * bx[k] + w[k] * fx[k], v[k] * by[k] + w[k] * fy[k], v[k] * bz[k] + w[k] * fz[k]);
                    let square = x * x + y * y + z * z;
                    // With X = −n̂ × sum / |sum| and A ∇λ_k = ½ n̂ × e_k, their product is −½ sum · e_k / |sum|.
                    let factor = if square > 0.0 { edges.half[k] / square.sqrt() } else { 0.0 };
                    parts[0][k] = factor * (x * bx[k] + y * by[k] + z * bz[k]);
                    parts[1][k] = factor * (x * fx[k] + y * fy[k] + z * fz[k]);
                }
                parts
            },
        )
    }
}

/// The integrated divergence `∫ X · ∇λ_i` of `X = −∇u / |∇u|` at each vertex, for some ladders of heat: with the first
/// `u` of the ladder from which on all corners of a face are warm, or the last. Faces without area, and those where `u`
/// does not change, have none.
fn unit_divergences(mesh: &TriangleMesh, ladders: &[Vec<&[f32]>]) -> Vec<Vec<f64>> {
    // The ladders of a thread go through the faces together: what is known of a face serves them all.
    let each = ladders.len().div_ceil(rayon::current_num_threads()).max(1);
    let some = |ladders: &[Vec<&[f32]>]| -> Vec<Vec<f64>> {
        let first: Vec<Vec<u8>> = ladders.iter().map(|ladder| first_warm(ladder)).collect();
        let mut divergences = vec![vec![0.0; mesh.positions.len()]; ladders.len()];
        let mut edges = Edges::new();
        for faces in mesh.faces.chunks(FACES_AT_ONCE) {
            edges.fill(mesh, faces);
            for ((ladder, first), divergence) in ladders.iter().zip(&first).zip(&mut divergences) {
                let (mut v, mut w) = ([0.0; FACES_AT_ONCE], [0.0; FACES_AT_ONCE]);
                for (face, (v, w)) in faces.iter().zip(v.iter_mut().zip(&mut w)) {
                    let [a, b, c] = face.map(|vertex| vertex as usize);
                    let u = ladder[usize::from(first[a].max(first[b]).max(first[c]))];
                    (*v, *w) = (f64::from(u[b] - u[a]), f64::from(u[c] - u[a]));
                }
                let [second, third] = edges.divergence(&v, &w);
                for (face, (second, third)) in faces.iter().zip(second.into_iter().zip(third)) {
                    let [a, b, c] = face.map(|vertex| vertex as usize);
                    divergence[b] += second;
                    divergence[c] += third;
                    divergence[a] -= second + third;
                }
            }
        }
        divergences
    };
    ladders.par_chunks(each).flat_map_iter(some).collect()
}

/// For each vertex the first heat of a ladder from which on it is warm in all but the last; the last where it is not in
/// the one before.
fn first_warm(ladder: &[&[f32]]) -> Vec<u8> {
    let Some((last, shorter)) = ladder.split_last() else { return Vec::new() };
    let mut first = vec![shorter.len() as u8; last.len()];
    for (step, u) in shorter.iter().enumerate().rev() {
        let warm = WARM * largest(u);
        let (own, next) = (step as u8, step as u8 + 1);
        vectorized(
            &mut first,
            #[inline(always)]
            |first| {
                for (first, &u) in first.iter_mut().zip(*u) {
                    *first = if (u > warm) & (*first == next) { own } else { *first };
                }
            },
        );
    }
    first
}

/// The largest of some values, or zero.
fn largest(values: &[f32]) -> f32 {
    let (groups, rest) = values.as_chunks::<16>();
    let mut most = [0.0f32; 16];
    for group in groups {
        most.iter_mut().zip(group).for_each(|(most, &value)| *most = if value > *most { value } else { *most });
    }
    most.iter().chain(rest).copied().fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::{Certificate, DenseFunctions, Functions, Precision};
    use crate::operator::{OperatorParameters, assemble};
    use crate::spectrum::hsim::{self, HsimParameters, Selection};
    use chladni_base::Unwatched;
    use chladni_mesh::shape::{Shape, generate};

    fn sphere(count: usize) -> (TriangleMesh, Basis) {
        let mesh = generate(Shape::Sphere, 2500).unwrap();
        let basis = solved(&mesh, count);
        (mesh, basis)
    }

    /// The lowest pairs of the Laplacian, as columns.
    fn solved(mesh: &TriangleMesh, count: usize) -> Basis {
        let operator = assemble(mesh, &OperatorParameters::default(), &Unwatched).unwrap();
        let parameters = HsimParameters { selection: Selection::Count(count), ..HsimParameters::default() };
        let pairs = hsim::solve(mesh, &operator.problem, &parameters, false, &Unwatched).unwrap();
        Basis {
            functions: Functions::Dense(DenseFunctions::from_panels(pairs.vectors, Precision::F64)),
            eigenvalues: pairs.values,
            mass: operator.laplacian().mass.scaled(operator.laplacian().area),
            certificate: Certificate::default(),
            metadata: serde_json::Value::Null.into(),
        }
    }

    fn angle(mesh: &TriangleMesh, a: usize, b: usize) -> f64 {
        mesh.points()[a].dot(mesh.points()[b]).clamp(-1.0, 1.0).acos()
    }

    #[test]
    fn distances_on_the_sphere_are_angles() {
        let (mesh, basis) = sphere(200);
        let sources = [17, 1800];
        let each = geodesic(&basis, &mesh, &sources, false, None).unwrap();
        for (column, &source) in sources.iter().enumerate() {
            let error = |v: usize| (each.column(column)[v] - angle(&mesh, v, source as usize)).abs();
            let mean = (0..mesh.positions.len()).map(error).sum::<f64>() / mesh.positions.len() as f64;
            assert!(mean < 0.03, "{mean}");
        }
        let both = geodesic(&basis, &mesh, &sources, true, None).unwrap();
        assert_eq!(both.columns(), 1);
        let nearest = |v: usize| angle(&mesh, v, 17).min(angle(&mesh, v, 1800));
        let mean = (0..mesh.positions.len()).map(|v| (both.column(0)[v] - nearest(v)).abs()).sum::<f64>();
        assert!(mean < 0.03 * mesh.positions.len() as f64, "{}", mean / mesh.positions.len() as f64);
    }

    /// Where heat is told from nothing, on the far side, a longer time serves; near the source the shortest.
    #[test]
    fn a_ladder_of_times_takes_the_first_that_is_warm() {
        let (mesh, basis) = sphere(200);
        let times = default_times(&basis.eigenvalues, 1).unwrap();
        assert!(
            times.len() > 2 && times.is_sorted() && (times[times.len() - 1] * basis.eigenvalues[1] - 1.0).abs() < 1e-12
        );
        let u = |time: f64| {
            let here = basis.at_vertices(&[17]).unwrap();
            let weights =
                (0..basis.count()).map(|k| (-basis.eigenvalues[k] * time).exp() * here.column(k)[0]).collect();
            basis.evaluate_single(&DenseMatrix::from_columns(basis.count(), 1, weights)).unwrap()
        };
        let (short, long) = (u(times[0]), u(times[times.len() - 1]));
        let ladders = [vec![&short[..], &long], vec![&short], vec![&long]];
        let [both, near, far] = unit_divergences(&mesh, &ladders).try_into().unwrap();
        for v in 0..mesh.positions.len() {
            let away = angle(&mesh, v, 17);
            if away < 0.2 {
                assert_eq!(both[v], near[v]);
            } else if away > 2.0 {
                assert_eq!(both[v], far[v]);
            }
        }
    }

    #[test]
    fn distances_scale_with_the_mesh() {
        let (mesh, basis) = sphere(60);
        let small = geodesic(&basis, &mesh, &[5], false, Some(0.5)).unwrap();
        for scale in [1e3, 1e-20, 1e20] {
            let mut other = mesh.clone();
            other.positions.iter_mut().flatten().for_each(|x| *x *= scale);
            let basis = solved(&other, 60);
            let distances = geodesic(&basis, &other, &[5], false, Some(0.5 * scale * scale)).unwrap();
            let close = |(a, b): (&f64, &f64)| (a - b / scale).abs() < 1e-3;
            assert!(small.values().iter().zip(distances.values()).all(close), "{scale}");
        }
    }

    #[test]
    fn what_does_not_fit_is_named_and_flat_faces_do_no_harm() {
        let (mut mesh, basis) = sphere(20);
        let text = |sources: &[u32], time| geodesic(&basis, &mesh, sources, false, time).unwrap_err().to_string();
        assert_eq!(text(&[3, 9999], None), format!("source 1 is vertex 9999 of {}", mesh.positions.len()));
        assert!(
            text(&[3], Some(0.0)).starts_with("time must be a finite positive number, got 0")
                && text(&[], None).ends_with("must be between 1 and 64, got 0")
        );
        let other = generate(Shape::Sphere, 500).unwrap();
        assert!(geodesic(&basis, &other, &[3], false, None).unwrap_err().to_string().contains("the mesh"));
        mesh.faces.extend([[0, 0, 1], [2, 2, 2]]);
        assert!(geodesic(&basis, &mesh, &[3], false, None).unwrap().values().iter().all(|d| d.is_finite()));
    }
}
