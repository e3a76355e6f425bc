//! The scalar space `U` of local functions on the vertices that move.

use super::{ElasticBody, ElasticProblem, Monitor, VibrationError};
use crate::algebra::SparseMatrix;
use crate::mesh::TriangleMesh;
use crate::operator::{OperatorParameters, assemble};
use crate::spectrum::heat::HeatParameters;
use crate::spectrum::{ApproximationParameters, Space, subspace};

/// About `dimension` local functions, with coordinates of their patches where `local`; a row for each vertex that moves; all its hat functions where the object has few vertices.
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
    let space = match body {
        ElasticBody::Shell { mesh, .. } => on_surface(mesh, patches, seed, monitor)?,
        ElasticBody::Solid { mesh } => super::balls::functions(mesh, patches, seed, monitor)?,
    };
    let factors = if elastic.moving.len() == body.positions().len() {
        vec![1.0; n]
    } else {
        super::balls::envelope(body, elastic, patches, monitor)?
    };
    let space = restricted(&space, &elastic.moving, &factors);
    Ok(if local { super::frames::enriched(&space, elastic, axes) } else { space })
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
        seed,
    };
    Ok(subspace(mesh, &operator, &parameters, monitor)?)
}

/// Some rows, each times a factor, and the columns that have an entry in them.
fn restricted(space: &SparseMatrix<f32>, rows: &[u32], factors: &[f64]) -> SparseMatrix<f32> {
    let mut number = vec![u32::MAX; space.columns()];
    for &row in rows {
        space.row(row as usize).0.iter().for_each(|&column| number[column as usize] = 0);
    }
    let mut kept = 0;
    for number in number.iter_mut().filter(|number| **number == 0) {
        *number = kept;
        kept += 1;
    }
    let mut offsets = Vec::with_capacity(rows.len() + 1);
    let (mut indices, mut values) = (Vec::new(), Vec::new());
    offsets.push(0);
    for (&row, &factor) in rows.iter().zip(factors) {
        let (columns, entries) = space.row(row as usize);
        indices.extend(columns.iter().map(|&column| number[column as usize]));
        values.extend(entries.iter().map(|&entry| (factor * f64::from(entry)) as f32));
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(rows.len(), kept as usize, offsets, indices, values)
}
