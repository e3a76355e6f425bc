//! Ritz pairs in `U ⊗ I₃`, beside the rigid motions.

use chladni_algebra::{CpuSolver, DenseMatrix, SparseMatrix, SymmetricDefiniteSolver, galerkin, solve_definite};
use chladni_base::parallel::*;

use super::{ElasticProblem, FoundFunctions, Monitor, NonrigidModes, RigidMotions, VibrationError};

/// Ritz pairs of the space from which rigid motions are taken out.
pub(super) struct Ritz {
    pub values: Vec<f64>,
    /// `3d × m`.
    pub coefficients: DenseMatrix,
    /// `r × m`: what makes the modes orthogonal to the rigid motions.
    pub rigid: DenseMatrix,
}

impl Ritz {
    pub fn into_found(self, space: SparseMatrix<f32>) -> NonrigidModes {
        NonrigidModes {
            values: self.values,
            functions: FoundFunctions::Compact(space, self.coefficients),
            rigid: self.rigid,
            certificate: serde_json::Value::Null,
        }
    }
}

/// `U ⊗ I₃`.
pub(super) fn threefold(space: &SparseMatrix<f32>) -> SparseMatrix<f32> {
    let mut offsets = Vec::with_capacity(3 * space.rows() + 1);
    let (mut indices, mut values) = (Vec::with_capacity(3 * space.entries()), Vec::with_capacity(3 * space.entries()));
    offsets.push(0);
    for row in 0..space.rows() {
        let (columns, entries) = space.row(row);
        for axis in 0..3 {
            indices.extend(columns.iter().map(|column| 3 * column + axis));
            values.extend_from_slice(entries);
            offsets.push(indices.len());
        }
    }
    SparseMatrix::from_sorted_parts(3 * space.rows(), 3 * space.columns(), offsets, indices, values)
}

/// The lowest `wanted` pairs of the space `(I − P)(U ⊗ I₃)`, where `P` projects onto the rigid motions `R`.
///
/// With `G = VᵀMR` the pencil of that space is `(K̄, M̄ − G Gᵀ)`: rigid motions have no energy. What `V` holds of them
/// exactly, such as the translations of free parts, makes both matrices singular in the same directions; the lowest
/// pairs do not change when these are given an energy far above all others, by adding `T Tᵀ` to the mass and a multiple
/// of it to the stiffness, `T` being the columns of `G` for the motions that `V` holds.
pub(super) fn modes(
    elastic: &ElasticProblem,
    rigid: &RigidMotions,
    space: &SparseMatrix<f32>,
    wanted: usize,
    monitor: &dyn Monitor,
) -> Result<Ritz, VibrationError> {
    monitor.stage("reduce");
    let problem = &elastic.problem;
    let all = threefold(space);
    let (stiffness, mass) = galerkin(&all, &problem.stiffness, &problem.mass, monitor)?;
    drop(all);
    let (mut stiffness, mut mass) = (stiffness.to_dense(), mass.to_dense());
    let lumped = problem.mass.lumped();
    let weighted = |motion: &dyn Fn(usize) -> [f64; 3]| {
        let mut reduced = vec![0.0; 3 * space.columns()];
        for k in 0..space.rows() {
            let value = motion(k).map(|x| lumped[3 * k] * x);
            let (columns, entries) = space.row(k);
            for (&column, &entry) in columns.iter().zip(entries) {
                (0..3).for_each(|axis| reduced[3 * column as usize + axis] += f64::from(entry) * value[axis]);
            }
        }
        reduced
    };
    let motions: Vec<Vec<f64>> = rigid
        .motions
        .par_iter()
        .map(|motion| {
            weighted(&|k| if rigid.part[k] == motion.part { motion.at(elastic.positions[k]) } else { [0.0; 3] })
        })
        .collect();
    let held = held(&mass, &motions)?;
    monitor.checkpoint()?;
    let size = stiffness.rows();
    let largest = (0..size).map(|k| stiffness.column(k)[k] / mass.column(k)[k]).fold(0.0, f64::max);
    for vector in &motions {
        add_outer(&mut mass, vector, -1.0);
    }
    for vector in &held {
        add_outer(&mut mass, vector, 1.0);
        add_outer(&mut stiffness, vector, 10.0 * largest);
    }
    monitor.stage("eigen");
    let wanted = wanted.min(size);
    let pairs = CpuSolver.lowest(stiffness, mass, wanted, monitor)?;
    let mut weights = DenseMatrix::zeros(motions.len(), wanted);
    for mode in 0..wanted {
        let column = pairs.vectors.column(mode);
        for (weight, vector) in weights.column_mut(mode).iter_mut().zip(&motions) {
            *weight = -vector.iter().zip(column).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    Ok(Ritz { values: pairs.values, coefficients: pairs.vectors, rigid: weights })
}

/// The columns of `G` for those rigid motions that the space holds: of which it holds the share `xᵀ Gᵀ M̄⁻¹ G x = 1`.
fn held(mass: &DenseMatrix, motions: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, VibrationError> {
    let (size, count) = (mass.rows(), motions.len());
    if count == 0 {
        return Ok(Vec::new());
    }
    let all = DenseMatrix::from_columns(size, count, motions.concat());
    let numerical = |error: &dyn std::fmt::Display| VibrationError::Numerical(error.to_string());
    let mut solved = all.clone();
    solve_definite(mass.clone(), &mut solved).map_err(|error| numerical(&error))?;
    let shares = all.transposed_times(&solved);
    let mut identity = DenseMatrix::zeros(count, count);
    (0..count).for_each(|k| identity.column_mut(k)[k] = 1.0);
    let pairs = CpuSolver.lowest(shares, identity, count, &chladni_base::Unwatched)?;
    let turned = all.times(&pairs.vectors);
    Ok((0..count).filter(|&k| pairs.values[k] > HELD).map(|k| turned.column(k).to_vec()).collect())
}

/// From this share on a motion counts as held.
const HELD: f64 = 1.0 - 1e-6;

/// `A += f v vᵀ`.
fn add_outer(matrix: &mut DenseMatrix, vector: &[f64], factor: f64) {
    let rows = matrix.rows();
    matrix.values_mut().par_chunks_mut(rows.max(1)).zip(vector).for_each(|(column, &own)| {
        column.iter_mut().zip(vector).for_each(|(entry, other)| *entry += factor * own * other);
    });
}
