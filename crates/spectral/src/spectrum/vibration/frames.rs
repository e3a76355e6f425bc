//! Local functions times local coordinates: so that a patch can also turn and stretch.
//!
//! A patch that bends turns its neighbourhood, and where all that a space can do is to shift patches against each
//! other, bending a thin shell stretches it: the modes of `U ⊗ I₃` are far too stiff ("locking"). With the functions
//! `U_j`, `U_j s_j`, `U_j t_j`, where `s_j` and `t_j` are coordinates in the tangent plane of the patch, every patch
//! follows its own affine map, as in the partition of unity method (Babuška and Melenk 1997).

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver};
use chladni_base::parallel::*;
use chladni_base::{Unwatched, Vector3};

use super::ElasticProblem;

/// An axis along which a patch extends less than this share of its longest one counts as its normal.
const FLAT: f64 = 0.2;

/// Each column times 1 and times the coordinates along the main axes of its patch: `(1 + axes) s` columns at most,
/// those of a patch next to each other. Rows are the vertices that move.
pub(super) fn enriched(space: &SparseMatrix<f32>, elastic: &ElasticProblem, axes: usize) -> SparseMatrix<f32> {
    let mass = elastic.problem.mass.lumped();
    let patches = patches(space, elastic, &mass, axes);
    let mut first = Vec::with_capacity(patches.len() + 1);
    first.push(0u32);
    for patch in &patches {
        first.push(first.last().copied().unwrap_or(0) + 1 + patch.axes.len() as u32);
    }
    let mut offsets = Vec::with_capacity(space.rows() + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    offsets.push(0);
    for row in 0..space.rows() {
        let (columns, entries) = space.row(row);
        for (&column, &entry) in columns.iter().zip(entries) {
            let patch = &patches[column as usize];
            indices.push(first[column as usize]);
            values.push(entry);
            let x = Vector3(elastic.positions[row]);
            for (k, &axis) in patch.axes.iter().enumerate() {
                let along = axis.dot(x - patch.centre);
                indices.push(first[column as usize] + 1 + k as u32);
                values.push((f64::from(entry) * along) as f32);
            }
        }
        offsets.push(indices.len());
    }
    let columns = first.last().copied().unwrap_or(0) as usize;
    SparseMatrix::from_sorted_parts(space.rows(), columns, offsets, indices, values)
}

struct Patch {
    centre: Vector3,
    /// Main axes over the extent of the patch along them.
    axes: Vec<Vector3>,
}

fn patches(space: &SparseMatrix<f32>, elastic: &ElasticProblem, mass: &[f64], axes: usize) -> Vec<Patch> {
    let transposed = space.transpose();
    (0..space.columns())
        .into_par_iter()
        .map(|column| {
            let (rows, entries) = transposed.row(column);
            let weighted =
                || rows.iter().zip(entries).map(|(&row, &e)| (row as usize, f64::from(e) * mass[3 * row as usize]));
            let total: f64 = weighted().map(|(_, w)| w).sum();
            let centre: Vector3 = weighted().map(|(row, w)| w / total * Vector3(elastic.positions[row])).sum();
            let mut spread = DenseMatrix::zeros(3, 3);
            for (row, w) in weighted() {
                let x = Vector3(elastic.positions[row]) - centre;
                for i in 0..3 {
                    for j in 0..3 {
                        spread.column_mut(i)[j] += w / total * x[i] * x[j];
                    }
                }
            }
            let mut unit = DenseMatrix::zeros(3, 3);
            (0..3).for_each(|k| unit.column_mut(k)[k] = 1.0);
            let mut found = Vec::new();
            if let Ok(pairs) = CpuSolver.lowest(spread, unit, 3, &Unwatched) {
                let longest = pairs.values[2].max(0.0);
                for k in (0..3).rev().take(axes) {
                    let extent = pairs.values[k].max(0.0).sqrt();
                    if extent > FLAT * longest.sqrt() && extent > 0.0 {
                        found.push(Vector3(std::array::from_fn(|i| pairs.vectors.column(k)[i])) / extent);
                    }
                }
            }
            Patch { centre, axes: found }
        })
        .collect()
}
