//! The heat-smoothed construction: transported bumps, diffused for a short time by the operator of the field itself,
//! thinned out and smoothed once more.
//!
//! With `N` samples, on the surface of unit area:
//! 1. around each sample a cubic bump times the frame of the sample, carried along; divided by the sum of all bumps;
//! 2. `k` implicit heat steps `(M + τS) x = M x_prev` on a patch, zero outside, by conjugate gradients; where there are
//!    many faces a sample with multigrid cycles as preconditioner;
//! 3. blocks shrunk by their magnitude `a` to `(a − t)²/a²` of their size: a hard cut would cost ten times the error;
//! 4. smoothed on the final pattern by a polynomial in the stiffness: without this the shrinking leaves noise of high
//!    energy;
//! 5. divided by what they add up to (see [`super::unity`]), without which no space holds the parallel fields of a flat
//!    surface.

use chladni_base::{Cancelled, Monitor};
use chladni_mesh::dual::{DiskGrower, DualGraph, NO_FACE};

use chladni_base::parallel::*;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::operator::frames::{FaceFrames, Turn};
use crate::operator::tangential::FieldOperator;
use crate::operator::transport::{FieldKind, transport_block, turn};

use super::hierarchy::hierarchy;
use super::smooth::{Heat, Small, Smoother};
use super::space::Column;
use super::unity;

/// Distances along the dual graph are longer than on the surface, by about this factor.
pub(super) const DUAL_TO_SURFACE: f32 = 0.83;

/// Levels are coarsened until there are at most so many nodes a sample.
const NODES_PER_SAMPLE: usize = 90;

/// The share of the largest block on a node, and of a column, up to which its blocks are shrunk away: some block always
/// stays. Where a sample lies on a small tip, what it begins with flows off until the whole column is below the
/// threshold.
const KEEP_SHARE: f32 = 0.3;

/// How columns are smoothed; lengths and times are relative to the surface of unit area and the number of samples `N`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct FieldHeat {
    /// The radius of bumps is `√(σ / (π N))`.
    #[cfg_attr(feature = "schema", schema(minimum = 4, maximum = 100))]
    pub sigma: f64,
    /// Implicit heat steps, at least 1.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 32))]
    pub steps: usize,
    /// The time of one step times `N`; by default .09 for vector fields and .08 for others.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 10))]
    pub time: Option<f64>,
    /// A column may spread beyond its bump by this multiple of `√(steps · time / N)`.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 20))]
    pub margin: f64,
    /// Blocks of at most this magnitude become zero; by default .0056 for vector fields and .004 for others: some
    /// fifteen blocks stay for each face.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 0.2))]
    pub threshold: Option<f64>,
    /// Relative residual at which the solve of a heat step ends.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-6, maximum = 0.5))]
    pub tolerance: f64,
    /// Degree of the last smoothing; by default 6 for vector fields and 4 for others, which turn more from face to
    /// face: what is smoother than they are cannot follow them.
    #[cfg_attr(feature = "schema", schema(minimum = 0, maximum = 64))]
    pub degree: Option<usize>,
    /// Lower end of what the last smoothing damps, of a spectrum that ends at 2.
    #[cfg_attr(feature = "schema", schema(minimum = 1e-4, maximum = 1))]
    pub least: f64,
}

impl Default for FieldHeat {
    fn default() -> Self {
        let (time, threshold, degree) = (None, None, None);
        Self { sigma: 8.0, steps: 2, time, margin: 2.5, threshold, tolerance: 1.5e-2, degree, least: 0.15 }
    }
}

impl FieldHeat {
    /// Less error for a third more entries.
    pub fn accurate() -> Self {
        Self { sigma: 10.0, steps: 4, time: Some(0.04), threshold: Some(0.002), tolerance: 1e-3, ..Self::default() }
    }

    /// The same with every number that is left open as it is by default for a kind of field.
    pub fn for_kind(self, kind: FieldKind) -> Self {
        let (time, threshold, degree) = self.numbers(kind);
        Self { time: Some(time), threshold: Some(threshold), degree: Some(degree), ..self }
    }

    /// The time, the threshold and the degree for a kind of field.
    fn numbers(&self, kind: FieldKind) -> (f64, f64, usize) {
        let (time, threshold, degree) =
            if kind == (FieldKind::Vector {}) { (0.09, 0.0056, 6) } else { (0.08, 0.004, 4) };
        (self.time.unwrap_or(time), self.threshold.unwrap_or(threshold), self.degree.unwrap_or(degree))
    }

    /// The first parameter out of its range: name, value, least, largest.
    pub fn out_of_range(&self) -> Option<(&'static str, f64, f64, f64)> {
        let ranges = [
            ("sigma", self.sigma, 4.0, 100.0),
            ("steps", self.steps as f64, 1.0, 32.0),
            ("time", self.time.unwrap_or(1.0), 1e-6, 10.0),
            ("margin", self.margin, 0.0, 20.0),
            ("threshold", self.threshold.unwrap_or(0.0), 0.0, 0.2),
            ("tolerance", self.tolerance, 1e-6, 0.5),
            ("degree", self.degree.unwrap_or(0) as f64, 0.0, 64.0),
            ("least", self.least, 1e-4, 1.0),
        ];
        ranges.into_iter().find(|&(_, value, least, most)| !(value >= least && value <= most))
    }
}

/// The columns of `samples`, one group of `B` for each.
pub(super) fn columns<const B: usize>(
    operator: &FieldOperator<B>,
    dual: &DualGraph,
    distances: &DualGraph,
    frames: &FaceFrames,
    samples: &[u32],
    parameters: &FieldHeat,
    monitor: &dyn Monitor,
) -> Result<Vec<Column<B>>, Cancelled> {
    let count = samples.len().max(1) as f64;
    monitor.stage("hierarchy");
    let levels = hierarchy(operator, dual, frames, NODES_PER_SAMPLE * samples.len(), monitor)?;
    monitor.stage("columns");
    let (time, threshold, degree) = parameters.numbers(operator.kind);
    let time = time / count;
    let wanted = (parameters.sigma / (std::f64::consts::PI * count)).sqrt();
    // Weights may have drawn samples so far apart that bumps have to be larger to meet.
    let covering = DiskGrower::new(distances).farthest_distance(distances, samples) * DUAL_TO_SURFACE;
    let radius = wanted.max(1.1 * f64::from(covering));
    let margin = parameters.margin * (time * parameters.steps as f64).sqrt();
    let bumps = Bumps { operator, dual, distances, frames, radius: radius as f32, margin: margin as f32 };
    let mut columns = bumps.grow(samples, monitor)?;
    divide_by_sums(&mut columns, dual.faces());
    monitor.stage("heat");
    let heat = Heat::new(&levels, time);
    let done = AtomicUsize::new(0);
    columns.par_iter_mut().try_for_each_init(
        || heat.scratch(),
        |scratch, column| {
            for _ in 0..parameters.steps {
                monitor.checkpoint()?;
                let before = column.blocks.clone();
                heat.step(column, scratch, parameters.tolerance);
                // Beside needles a billion times as long as wide single precision overflows: better too little diffused
                // than no numbers.
                if !is_finite(column) {
                    column.blocks = before;
                }
            }
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if done.is_multiple_of(8) {
                monitor.progress(done as f64 / count);
            }
            Ok(())
        },
    )?;
    drop(heat);
    let finest = &levels[0];
    shrink(&mut columns, finest.roots.len(), threshold as f32);
    monitor.stage("smoothing");
    let smoother = Smoother::new(finest, degree, parameters.least, time);
    let weights: Vec<Vec<unity::Parts>> = columns
        .par_iter_mut()
        .map_init(
            || vec![[[0f32; B]; B]; finest.roots.len()],
            |scratch, column| {
                monitor.checkpoint()?;
                let before = column.blocks.clone();
                smoother.smooth(column, scratch);
                if !is_finite(column) {
                    column.blocks.clone_from(&before);
                }
                Ok(unity::weights(operator.kind, &before, &column.blocks))
            },
        )
        .collect::<Result<_, Cancelled>>()?;
    if operator.kind != (FieldKind::Vector {}) {
        unity::divide(operator.kind, &mut columns, &weights, dual.faces());
    }
    Ok(columns)
}

/// What bumps are made of.
struct Bumps<'a, const B: usize> {
    operator: &'a FieldOperator<B>,
    dual: &'a DualGraph,
    /// The dual graph with the lengths that samples and radii are measured in.
    distances: &'a DualGraph,
    frames: &'a FaceFrames,
    radius: f32,
    margin: f32,
}

impl<const B: usize> Bumps<'_, B> {
    /// For each sample the faces within radius and margin, and the transported bump on them.
    fn grow(&self, samples: &[u32], monitor: &dyn Monitor) -> Result<Vec<Column<B>>, Cancelled> {
        samples
            .par_iter()
            .map_init(
                || (DiskGrower::new(self.distances), Vec::new()),
                |(grower, carried), &sample| {
                    monitor.checkpoint()?;
                    grower.grow(self.distances, sample, (self.radius + self.margin) / DUAL_TO_SURFACE);
                    carry_frame(self.operator, self.dual, self.frames, grower, self.radius / DUAL_TO_SURFACE, carried);
                    Ok(self.bump(grower.disk(), carried))
                },
            )
            .collect()
    }

    fn bump(&self, disk: &[(u32, f32)], carried: &[Turn]) -> Column<B> {
        let mut places: Vec<(u32, u32)> = disk.iter().enumerate().map(|(place, f)| (f.0, place as u32)).collect();
        places.sort_unstable();
        let blocks = places
            .iter()
            .map(|&(_, place)| {
                let Some(&turn) = carried.get(place as usize) else { return [[0.0; B]; B] };
                let x = (disk[place as usize].1 * DUAL_TO_SURFACE / self.radius).min(1.0);
                let bump = 1.0 - 3.0 * x * x + 2.0 * x * x * x;
                transport_block::<B>(self.operator.kind, turn).map(|row| row.map(|v| v as f32 * bump))
            })
            .collect();
        Column { faces: places.into_iter().map(|p| p.0).collect(), blocks }
    }
}

/// Carries the numbers of the disk's centre to each of its faces within `radius`: a mean over the neighbours that are
/// closer, weighted by inverse distance. In the order of the disk.
pub(super) fn carry_frame<const B: usize>(
    operator: &FieldOperator<B>,
    dual: &DualGraph,
    frames: &FaceFrames,
    grower: &DiskGrower,
    radius: f32,
    carried: &mut Vec<Turn>,
) {
    carried.clear();
    for (place, &(face, distance)) in grower.disk().iter().enumerate() {
        if distance > radius {
            break;
        }
        if place == 0 {
            carried.push(Turn::NONE);
            continue;
        }
        let lengths = dual.lengths(face as usize);
        let inside = dual.neighbours(face as usize).into_iter().enumerate().filter(|own| own.1 != NO_FACE);
        let closer = inside.filter_map(|(k, neighbour)| {
            let before = grower.index_of(neighbour).filter(|&p| p < place)?;
            let turn = turn(operator.kind, dual, frames, face as usize, k)?;
            Some((1.0 / f64::from(lengths[k].max(1e-12)), turn.after(*carried.get(before)?)))
        });
        let mean = Turn::mean(closer);
        carried.push(mean);
    }
}

fn is_finite<const B: usize>(column: &Column<B>) -> bool {
    column.blocks.iter().all(|block| block.as_flattened().iter().all(|x| x.is_finite()))
}

/// The magnitude of a block: 1 for a rotation.
fn magnitude<const B: usize>(block: &Small<B>) -> f32 {
    (block.as_flattened().iter().map(|x| x * x).sum::<f32>() / B as f32).sqrt()
}

/// Divides the blocks of each node by the sum of their magnitudes.
fn divide_by_sums<const B: usize>(columns: &mut [Column<B>], nodes: usize) {
    let mut sums = vec![0f64; nodes];
    for column in columns.iter() {
        for (&node, block) in column.faces.iter().zip(&column.blocks) {
            sums[node as usize] += f64::from(magnitude(block));
        }
    }
    columns.par_iter_mut().for_each(|column| {
        for (&node, block) in column.faces.iter().zip(&mut column.blocks) {
            let sum = sums[node as usize];
            if sum > 1e-12 {
                block.as_flattened_mut().iter_mut().for_each(|x| *x /= sum as f32);
            }
        }
    });
}

/// Shrinks blocks towards zero and drops those that reach it; each node that any column reaches keeps some, and so does
/// each column.
fn shrink<const B: usize>(columns: &mut [Column<B>], nodes: usize, threshold: f32) {
    let mut strongest = vec![0f32; nodes];
    for column in columns.iter() {
        for (&node, block) in column.faces.iter().zip(&column.blocks) {
            let a = magnitude(block);
            strongest[node as usize] = strongest[node as usize].max(a);
        }
    }
    columns.par_iter_mut().for_each(|column| {
        let mut kept = Column { faces: Vec::new(), blocks: Vec::new() };
        let own = column.blocks.iter().map(magnitude).fold(0f32, f32::max);
        for (&node, block) in column.faces.iter().zip(&column.blocks) {
            let a = magnitude(block);
            let least = threshold.min(KEEP_SHARE * strongest[node as usize]).min(KEEP_SHARE * own);
            if a > least {
                let factor = ((a - least) / a).powi(2);
                kept.faces.push(node);
                kept.blocks.push(block.map(|row| row.map(|x| x * factor)));
            }
        }
        *column = kept;
    });
}
