//! The construction of the thesis (section 3.4): on disks around the samples the lowest fields of the operator, zero
//! outside.

use chladni_algebra::{Block, BlockMatrix, add_product, transposed};
use chladni_base::{Cancelled, Monitor};
use chladni_mesh::dual::{DiskGrower, DualGraph};

use chladni_base::parallel::*;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::operator::frames::FaceFrames;
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::transport_block;

use super::heat::{DUAL_TO_SURFACE, carry_frame};
use super::hierarchy::{hierarchy, scaled_identity};
use super::smooth::{Heat, Small};
use super::space::Column;

/// Nodes a sample on the coarsest level at most.
const NODES_PER_SAMPLE: usize = 40;

/// The time of a heat step in squared radii of a disk. The lowest value of a disk of radius 1 is about 6, so that a
/// step divides a field of value `λ` by nearly `λ`: it is an inverse iteration.
const TIME: f64 = 60.0;

/// Relative residual of an inverse iteration.
const TOLERANCE: f64 = 3e-3;

/// How local eigenfields are computed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct LocalEigenfields {
    /// The radius of disks on the surface is `√(σ · area / (π d))`: about σ numbers a row.
    #[cfg_attr(feature = "schema", schema(minimum = 4, maximum = 1000))]
    pub sigma: f64,
    /// Inverse iterations, from the frame of the centre carried along and damped towards the rim.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 32))]
    pub iterations: usize,
}

impl Default for LocalEigenfields {
    fn default() -> Self {
        Self { sigma: 40.0, iterations: 2 }
    }
}

impl LocalEigenfields {
    /// The first parameter out of its range: name, value, least, largest.
    pub fn out_of_range(&self) -> Option<(&'static str, f64, f64, f64)> {
        let ranges = [("sigma", self.sigma, 4.0, 1000.0), ("iterations", self.iterations as f64, 1.0, 32.0)];
        ranges.into_iter().find(|&(_, value, least, most)| !(value >= least && value <= most))
    }
}

/// The columns of `samples`, `B` for each, orthonormal within each disk: approximate eigenfields of the `B` lowest
/// values, ascending.
pub(super) fn columns<const B: usize>(
    operator: &FieldOperator<B>,
    dual: &DualGraph,
    distances: &DualGraph,
    frames: &FaceFrames,
    samples: &[u32],
    parameters: &LocalEigenfields,
    monitor: &dyn Monitor,
) -> Result<Vec<Column<B>>, Cancelled> {
    monitor.stage("hierarchy");
    let levels = hierarchy(operator, dual, frames, NODES_PER_SAMPLE * samples.len(), monitor)?;
    monitor.stage("columns");
    let dimension = (B * samples.len().max(1)) as f64;
    // As far along the dual graph, whose paths are longer.
    let wanted = (parameters.sigma / (std::f64::consts::PI * dimension)).sqrt() / f64::from(DUAL_TO_SURFACE);
    let covering = DiskGrower::new(distances).farthest_distance(distances, samples);
    let radius = wanted.max(1.001 * f64::from(covering));
    let heat = Heat::new(&levels, TIME * radius * radius);
    let done = AtomicUsize::new(0);
    samples
        .par_iter()
        .map_init(
            || (DiskGrower::new(distances), Vec::new(), heat.scratch(), vec![[[0f32; B]; B]; dual.faces()]),
            |(grower, carried, scratch, all), &sample| {
                monitor.checkpoint()?;
                grower.grow(distances, sample, radius as f32);
                carry_frame(operator, dual, frames, grower, radius as f32, carried);
                let mut start: Vec<(u32, Small<B>)> = grower
                    .disk()
                    .iter()
                    .zip(carried.iter())
                    .map(|(&(face, distance), &turn)| {
                        let profile = (0.5 * std::f32::consts::PI * distance / (1.02 * radius as f32)).cos();
                        (face, transport_block::<B>(operator.kind, turn).map(|row| row.map(|v| v as f32 * profile)))
                    })
                    .collect();
                start.sort_unstable_by_key(|s| s.0);
                let mut column = Column {
                    faces: start.iter().map(|s| s.0).collect(),
                    blocks: start.into_iter().map(|s| s.1).collect(),
                };
                for _ in 0..parameters.iterations {
                    orthonormalise(&operator.mass, &mut column);
                    heat.step(&mut column, scratch, TOLERANCE);
                }
                orthonormalise(&operator.mass, &mut column);
                rotate(&operator.stiffness, &mut column, all);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if done.is_multiple_of(8) {
                    monitor.progress(done as f64 / samples.len() as f64);
                }
                Ok(column)
            },
        )
        .collect()
}

/// Gram and Schmidt for the `B` columns of a group. A column that depends on those before it becomes zero.
fn orthonormalise<const B: usize>(mass: &[f64], column: &mut Column<B>) {
    for c in 0..B {
        // Twice is enough (Kahan and Parlett).
        for _ in 0..2 {
            for before in 0..c {
                let product = inner(mass, column, c, before);
                column.blocks.iter_mut().flatten().for_each(|row| row[c] -= product as f32 * row[before]);
            }
        }
        let size = inner(mass, column, c, c).sqrt();
        let factor = if size > 1e-12 { 1.0 / size } else { 0.0 };
        column.blocks.iter_mut().flatten().for_each(|row| row[c] *= factor as f32);
    }
}

/// Rayleigh and Ritz within the group: turns orthonormal columns into approximate eigenfields. `all` is zero before and
/// after.
fn rotate<const B: usize>(stiffness: &BlockMatrix<B>, column: &mut Column<B>, all: &mut [Small<B>]) {
    for (&face, block) in column.faces.iter().zip(&column.blocks) {
        all[face as usize] = *block;
    }
    let mut energy = [[0.0; B]; B];
    for (&face, own) in column.faces.iter().zip(&column.blocks) {
        let (columns, blocks) = stiffness.row(face as usize);
        let mut image = [[0.0; B]; B];
        for (&other, block) in columns.iter().zip(blocks) {
            add_product(&mut image, block, &all[other as usize].map(|row| row.map(f64::from)));
        }
        add_product(&mut energy, &transposed(&own.map(|row| row.map(f64::from))), &image);
    }
    column.faces.iter().for_each(|&face| all[face as usize] = [[0.0; B]; B]);
    let vectors = eigenvectors(energy);
    for block in &mut column.blocks {
        let mut turned = [[0.0; B]; B];
        add_product(&mut turned, &block.map(|row| row.map(f64::from)), &vectors);
        *block = turned.map(|row| row.map(|x| x as f32));
    }
}

/// The eigenvectors of a small symmetric matrix as columns, eigenvalues ascending, by Jacobi's rotations.
fn eigenvectors<const B: usize>(mut a: Block<B>) -> Block<B> {
    let mut vectors: Block<B> = scaled_identity(1.0);
    for _ in 0..12 {
        for p in 0..B {
            for q in p + 1..B {
                if a[p][q].abs() <= 1e-15 * (a[p][p].abs() + a[q][q].abs()) {
                    continue;
                }
                let theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let (c, s) = (1.0 / t.hypot(1.0), t / t.hypot(1.0));
                for k in 0..B {
                    (a[k][p], a[k][q]) = (c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]);
                }
                for k in 0..B {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    (vectors[k][p], vectors[k][q]) =
                        (c * vectors[k][p] - s * vectors[k][q], s * vectors[k][p] + c * vectors[k][q]);
                }
            }
        }
    }
    let mut order: [usize; B] = std::array::from_fn(|i| i);
    order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
    std::array::from_fn(|k| std::array::from_fn(|i| vectors[k][order[i]]))
}

fn inner<const B: usize>(mass: &[f64], column: &Column<B>, a: usize, b: usize) -> f64 {
    column
        .faces
        .iter()
        .zip(&column.blocks)
        .map(|(&f, block)| {
            mass[f as usize] * block.iter().map(|row| f64::from(row[a]) * f64::from(row[b])).sum::<f64>()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_matrices_are_diagonal_in_their_eigenvectors() {
        let a = [[2.0, -1.0, 0.3], [-1.0, 0.5, 0.8], [0.3, 0.8, -1.5]];
        let v = eigenvectors(a);
        let (mut right, mut both) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        add_product(&mut right, &a, &v);
        add_product(&mut both, &transposed(&v), &right);
        for i in 0..3 {
            for j in 0..3 {
                assert!(i == j || both[i][j].abs() < 1e-12, "{both:?}");
            }
            assert!(i == 0 || both[i - 1][i - 1] <= both[i][i]);
        }
    }
}
