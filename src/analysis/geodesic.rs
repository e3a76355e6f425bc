//! Geodesic distance by the heat method (Crane et al. 2013), with both of its solves in the basis.
//!
//! Heat that starts at a source flows for a short time, `u = Σ e^{−λt} φ(s) φ`; its gradient, turned and brought to unit length, is that of
//! the distance; of all functions the one whose gradient is nearest to that field solves a Poisson equation, in the basis `Σ (φᵀ b / λ) φ`.
//! The mesh is needed for gradients alone.
//!
//! The shorter the time, the nearer the field is to that of the distance, as long as `u` can be told from the errors of the modes: these are some
//! thousandth of its largest value, while `u` falls as `e^{−d²/4t}`. So, unless a time is asked for, a ladder of times is used, and each face takes the
//! shortest at which all its corners are warm enough.

use rayon::prelude::*;

use super::distance::nearest;
use super::error::{self, AnalysisError};
use super::spectrum::kernel_size;
use crate::algebra::DenseMatrix;
use crate::basis::Basis;
use crate::mesh::TriangleMesh;

/// The most columns of one call.
pub const MOST_COLUMNS: usize = 64;

/// Heat below this share of its largest value is not told from errors.
const WARM: f64 = 1e-3;

/// The shortest time, over the inverse of the largest eigenvalue: by then the modes that the basis does not have are gone (`e^{−12}`).
const SHORTEST: f64 = 12.0;

/// The most times of a ladder.
const MOST_TIMES: usize = 16;

/// Columns of heat that are held at once.
const HEAT_AT_ONCE: usize = 48;

/// From so many sources on the ladder has half as many times: each of them costs what all of one source cost.
const MANY_SOURCES: usize = 5;

/// How long heat flows unless it is told: from `12 / λ_max`, each time twice the one before, to `1 / λ_1`, in length² of the input; for five or more
/// sources four times the one before.
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

/// Geodesic distances of all vertices from each of some sources, or from the nearest of them if `together`: `n × s` or `n × 1`.
///
/// Where the basis has too few modes to resolve it the distance is rounded off: near the source and along the cut locus. Vertices that no
/// function of the basis reaches, as on a boundary under the Dirichlet condition, and other components than the source's have no meaningful value.
///
/// # Errors
/// [`AnalysisError`] names a source that is no vertex, a time that is not above zero, a mesh that is not that of the basis.
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
                let slots = heat.column_mut(place * times.len() + step).iter_mut().zip(&basis.eigenvalues).enumerate();
                // Zero comes out of solvers with either sign.
                slots.for_each(|(mode, (slot, value))| {
                    *slot = (-value.max(0.0) * time).exp() * at_sources.column(mode)[source];
                });
            }
        }
        let heat = basis.evaluate(&heat)?;
        let steps = times.len();
        let fields: Vec<Vec<f64>> = (0..batch.len())
            .into_par_iter()
            .map(|place| {
                let ladder: Vec<&[f64]> = (0..steps).map(|step| heat.column(place * steps + step)).collect();
                unit_divergence(mesh, &ladder)
            })
            .collect();
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

/// The integrated divergence `∫ X · ∇λ_i` of `X = −∇u / |∇u|` at each vertex, with the first `u` of the ladder from which on all corners of a
/// face are warm, or the last. Faces without area, and those where `u` does not change, have none.
fn unit_divergence(mesh: &TriangleMesh, ladder: &[&[f64]]) -> Vec<f64> {
    let Some((last, shorter)) = ladder.split_last() else { return Vec::new() };
    let first = first_warm(last.len(), shorter);
    let mut divergence = vec![0.0; last.len()];
    for face in &mesh.faces {
        let [a, b, c] = face.map(|vertex| vertex as usize);
        let u = shorter.get(usize::from(first[a].max(first[b]).max(first[c]))).unwrap_or(last);
        let [p, q, r] = [a, b, c].map(|vertex| mesh.positions[vertex]);
        let edge = |from: [f64; 3], to: [f64; 3]| [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let edges = [edge(q, r), edge(r, p), edge(p, q)];
        let normal = cross(edges[0], edges[1]);
        let square = dot(normal, normal);
        // ∇u = n × Σ u_k e_k / |n|, the edges being those opposite to the corners. Differences keep the digits of a u that is nearly constant.
        let [v, w] = [u[b] - u[a], u[c] - u[a]];
        let sum = [0, 1, 2].map(|k| v * edges[1][k] + w * edges[2][k]);
        let length = dot(sum, sum).sqrt();
        if !(square > 0.0 && length > 0.0) {
            continue;
        }
        // With X = −n̂ × sum / |sum| and A ∇λ_k = ½ n̂ × e_k, their product is −½ sum · e_k / |sum|.
        let factor = -0.5 / length;
        for (vertex, edge) in [a, b, c].into_iter().zip(&edges) {
            divergence[vertex] += factor * dot(sum, *edge);
        }
    }
    divergence
}

/// For each vertex the first of some heats from which on it is warm in all of them; their number where it is not in the last.
fn first_warm(vertices: usize, ladder: &[&[f64]]) -> Vec<u8> {
    let mut first = vec![ladder.len() as u8; vertices];
    for (step, u) in ladder.iter().enumerate().rev() {
        let warm = WARM * u.iter().copied().fold(0.0, f64::max);
        for (first, &u) in first.iter_mut().zip(*u) {
            if u > warm && usize::from(*first) == step + 1 {
                *first = step as u8;
            }
        }
    }
    first
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::EigenbasisParameters;
    use crate::mesh::shape::{Shape, generate};
    use crate::monitor::Unwatched;

    fn sphere(count: usize) -> (TriangleMesh, Basis) {
        let mesh = generate(Shape::Sphere, 2500).unwrap();
        let parameters = EigenbasisParameters::parse(&serde_json::json!({"count": count})).unwrap();
        let basis = parameters.run(&mesh, &Unwatched).unwrap();
        (mesh, basis)
    }

    fn angle(mesh: &TriangleMesh, a: usize, b: usize) -> f64 {
        dot(mesh.positions[a], mesh.positions[b]).clamp(-1.0, 1.0).acos()
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
            basis.evaluate(&DenseMatrix::from_columns(basis.count(), 1, weights).unwrap()).unwrap().column(0).to_vec()
        };
        let (short, long) = (u(times[0]), u(times[times.len() - 1]));
        let both = unit_divergence(&mesh, &[&short, &long]);
        let (near, far) = (unit_divergence(&mesh, &[&short]), unit_divergence(&mesh, &[&long]));
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
        let mut large = mesh.clone();
        large.positions.iter_mut().flatten().for_each(|x| *x *= 1e3);
        let parameters = EigenbasisParameters::parse(&serde_json::json!({"count": 60})).unwrap();
        let wide = parameters.run(&large, &Unwatched).unwrap();
        let small = geodesic(&basis, &mesh, &[5], false, Some(0.5)).unwrap();
        let large = geodesic(&wide, &large, &[5], false, Some(0.5e6)).unwrap();
        let close = |(a, b): (&f64, &f64)| (1e3 * a - b).abs() < 1.0;
        assert!(small.values().iter().zip(large.values()).all(close));
    }

    #[test]
    fn what_does_not_fit_is_named_and_flat_faces_do_no_harm() {
        let (mut mesh, basis) = sphere(20);
        let text = |sources: &[u32], time| geodesic(&basis, &mesh, sources, false, time).unwrap_err().to_string();
        assert_eq!(text(&[3, 9999], None), format!("source 1 is vertex 9999 of {}", mesh.positions.len()));
        assert!(text(&[3], Some(0.0)).starts_with("time is 0") && text(&[], None).starts_with("sources: 0"));
        let other = generate(Shape::Sphere, 500).unwrap();
        assert!(geodesic(&basis, &other, &[3], false, None).unwrap_err().to_string().contains("the mesh"));
        mesh.faces.extend([[0, 0, 1], [2, 2, 2]]);
        assert!(geodesic(&basis, &mesh, &[3], false, None).unwrap().values().iter().all(|d| d.is_finite()));
    }
}
