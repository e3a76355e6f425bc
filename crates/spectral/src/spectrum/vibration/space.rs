//! The scalar space `U` of local functions on the vertices that move.
//!
//! It is built on the part of the object around them, so that no function is spent on what is held, and each function
//! is multiplied by an envelope that vanishes where the object is clamped. What is left of some functions then may
//! depend on the others; such functions are left out, since no restricted problem could be solved with them.

use chladni_algebra::{SparseMatrix, galerkin, independent_columns};
use chladni_mesh::{TetMesh, TriangleMesh};

use super::{ElasticBody, ElasticProblem, Monitor, VibrationError};
use crate::operator::{MassMatrix, OperatorParameters, assemble};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::{ApproximationParameters, Space, subspace};

/// A function that is nearer to the span of the others than this share of its own length is left out.
const DEPENDENT: f64 = 1e-3;

/// About `dimension` local functions, with coordinates of their patches where `local`, independent of each other; a row
/// for each vertex that moves; all its hat functions where the object has few vertices.
pub(super) fn functions(
    body: ElasticBody<'_>,
    elastic: &ElasticProblem,
    dimension: usize,
    local: bool,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, VibrationError> {
    let n = elastic.moving.len();
    if (n as f64) < 1.5 * dimension as f64 {
        return Ok(SparseMatrix::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0; n]));
    }
    let axes = match body {
        _ if !local => 0,
        ElasticBody::Shell { .. } => 2,
        ElasticBody::Solid { .. } => 3,
    };
    let patches = dimension.div_ceil(1 + axes);
    let everything = n == body.positions().len();
    let (space, rows) = match body {
        ElasticBody::Shell { mesh, .. } if everything => {
            (on_surface(mesh, patches, seed, monitor)?, elastic.moving.clone())
        }
        ElasticBody::Shell { mesh, .. } => {
            let (positions, faces, rows) = around(&mesh.positions, &mesh.faces, &elastic.moving);
            (on_surface(&TriangleMesh { positions, faces, ..Default::default() }, patches, seed, monitor)?, rows)
        }
        ElasticBody::Solid { mesh } if everything => {
            (super::balls::functions(mesh, patches, seed, monitor)?, elastic.moving.clone())
        }
        ElasticBody::Solid { mesh } => {
            let (positions, tetrahedra, rows) = around(&mesh.positions, &mesh.tetrahedra, &elastic.moving);
            (super::balls::functions(&TetMesh { positions, tetrahedra }, patches, seed, monitor)?, rows)
        }
    };
    let factors =
        if everything { vec![1.0; n] } else { super::balls::envelope(body, elastic, space.columns(), monitor)? };
    let space = independent(restricted(&space, &rows, &factors), elastic, monitor)?;
    if !local {
        return Ok(space);
    }
    independent(super::frames::enriched(&space, elastic, axes), elastic, monitor)
}

/// The elements that touch a vertex that moves, with the vertices that these have; and where the vertices that move are
/// among them.
fn around<const K: usize>(
    positions: &[[f64; 3]],
    elements: &[[u32; K]],
    moving: &[u32],
) -> (Vec<[f64; 3]>, Vec<[u32; K]>, Vec<u32>) {
    let mut moves = vec![false; positions.len()];
    moving.iter().for_each(|&v| moves[v as usize] = true);
    let touched: Vec<[u32; K]> =
        elements.iter().filter(|element| element.iter().any(|&v| moves[v as usize])).copied().collect();
    let mut used = moves;
    touched.as_flattened().iter().for_each(|&v| used[v as usize] = true);
    let mut place = vec![u32::MAX; positions.len()];
    let mut kept = Vec::new();
    for (v, position) in positions.iter().enumerate().filter(|(v, _)| used[*v]) {
        place[v] = kept.len() as u32;
        kept.push(*position);
    }
    let touched = touched.into_iter().map(|element| element.map(|v| place[v as usize])).collect();
    (kept, touched, moving.iter().map(|&v| place[v as usize]).collect())
}

/// The columns that are independent of each other in the norm of the mass.
fn independent(
    space: SparseMatrix<f32>,
    elastic: &ElasticProblem,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, VibrationError> {
    let n = space.rows();
    let lumped = elastic.problem.mass.lumped();
    let mass = MassMatrix::Diagonal(lumped.chunks_exact(3).map(|three| three[0]).collect());
    let nothing = SparseMatrix::from_sorted_parts(n, n, vec![0; n + 1], Vec::new(), Vec::new());
    let (_, gram) = galerkin(&space, &nothing, &mass, monitor)?;
    monitor.checkpoint()?;
    let kept = independent_columns(&gram.to_dense(), DEPENDENT);
    Ok(if kept.len() == space.columns() { space } else { selected(&space, &kept) })
}

/// Some columns, ascending.
fn selected(space: &SparseMatrix<f32>, kept: &[usize]) -> SparseMatrix<f32> {
    let mut number = vec![u32::MAX; space.columns()];
    kept.iter().enumerate().for_each(|(new, &column)| number[column] = new as u32);
    let mut offsets = Vec::with_capacity(space.rows() + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    offsets.push(0);
    for row in 0..space.rows() {
        let (columns, entries) = space.row(row);
        let entries = columns.iter().map(|&column| number[column as usize]).zip(entries);
        for (column, &entry) in entries.filter(|(column, _)| *column != u32::MAX) {
            indices.push(column);
            values.push(entry);
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(space.rows(), kept.len(), offsets, indices, values)
}

fn on_surface(
    mesh: &TriangleMesh,
    dimension: usize,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, VibrationError> {
    let operator = assemble(mesh, &OperatorParameters::default(), monitor)?;
    let parameters = ApproximationParameters {
        count: dimension,
        dimension,
        space: Space::Heat(HeatParameters::default()),
        goal: None,
        certify: false,
        seed,
    };
    Ok(subspace(mesh, &operator, &parameters, monitor)?)
}

/// Some rows, each times a factor. Columns that have no entry in them stay, empty.
fn restricted(space: &SparseMatrix<f32>, rows: &[u32], factors: &[f64]) -> SparseMatrix<f32> {
    let mut offsets = Vec::with_capacity(rows.len() + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    offsets.push(0);
    for (&row, &factor) in rows.iter().zip(factors) {
        let (columns, entries) = space.row(row as usize);
        indices.extend_from_slice(columns);
        values.extend(entries.iter().map(|&entry| (factor * f64::from(entry)) as f32));
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(rows.len(), space.columns(), offsets, indices, values)
}
