//! Radial basis functions around samples, made a partition of unity: the subspace of chapter 2 of the thesis.

mod grown;

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, Spare};
use chladni_mesh::TriangleMesh;
use chladni_mesh::connectivity::Connectivity;
use chladni_mesh::distance::{DistanceGeometry, DistanceKind, DistanceWorkspace};
use chladni_mesh::measure::{surface_area, vertex_areas};
use chladni_mesh::sample::{farthest_points, poisson_disk, sort_spatially, well_spread_points};

/// The weight of a vertex by its distance from the sample, as a share of the support radius (appendix 2.A). All are 1
/// at the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// `1 − 3t² + 2t³`: the thesis' choice.
    #[default]
    Cubic,
    /// `1 − t`.
    Linear,
    /// `1 − 10t³ + 15t⁴ − 6t⁵`.
    Quintic,
    /// `exp(−ln 2 · t² / 0.45²)`, cut off at 1.
    Gaussian,
}

impl Profile {
    /// The weight at the share `t` of the support radius; 0 from 1 on.
    pub fn weight(self, t: f32) -> f32 {
        if !(t < 1.0) {
            return 0.0;
        }
        let weight = match self {
            Self::Cubic => 1.0 - t * t * (3.0 - 2.0 * t),
            Self::Linear => 1.0 - t,
            Self::Quintic => 1.0 - t * t * t * (10.0 - t * (15.0 - 6.0 * t)),
            Self::Gaussian => (-std::f32::consts::LN_2 / (0.45 * 0.45) * t * t).exp(),
        };
        // Rounding may leave a little less than nothing.
        weight.max(0.0)
    }
}

pub(super) use grown::Grown;

/// Why radial columns could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RadialError {
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// There is nothing to centre a function on.
    #[error("a mesh of {vertices} vertices and {samples} samples cannot span a subspace")]
    Empty {
        /// The number of vertices.
        vertices: usize,
        /// The number of samples.
        samples: usize,
    },
    /// A sample is not a vertex.
    #[error("sample {sample} refers to vertex {vertex} of {vertices}")]
    Sample {
        /// The offending position among the samples.
        sample: usize,
        /// What stands there.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// The support radius is not a positive number.
    #[error("sigma {sigma} and area {area} do not give a support radius")]
    Radius {
        /// The overlap that was asked for.
        sigma: f64,
        /// The area of the mesh.
        area: f64,
    },
}

/// The support radius `√(σ·area/(π d))`: a disk of this radius holds `σ` of `d` evenly spread samples (`numerics`,
/// 2.2). In the units of `√area`.
pub fn support_radius(area: f64, sigma: f64, dimension: usize) -> f64 {
    (sigma * area / (std::f64::consts::PI * dimension as f64)).sqrt()
}

/// Where the functions of a subspace are centred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// Constrained Poisson disks (Corsini et al. 2012): the thesis' choice.
    #[default]
    PoissonDisk,
    /// Farthest points along edges.
    FarthestPoints,
    /// Farthest points, evened out by three of Lloyd's moves: 10 to 25 % less error than Poisson disks.
    WellSpread,
}

/// The choices of the radial construction; the default is the thesis'.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case", default, deny_unknown_fields)]
pub struct RadialParameters {
    /// How samples are chosen.
    pub sampling: Sampling,
    /// How the distance to a sample is measured.
    pub distance: DistanceKind,
    /// How weights fall with the distance.
    pub profile: Profile,
    /// How many samples the support of a function holds on average; 7 to 15 in the thesis.
    #[cfg_attr(feature = "schema", schema(minimum = 1, maximum = 100))]
    pub sigma: f64,
}

impl Default for RadialParameters {
    fn default() -> Self {
        Self {
            sampling: Sampling::default(),
            distance: DistanceKind::default(),
            profile: Profile::default(),
            sigma: 10.0,
        }
    }
}

/// The thesis' subspace: `dimension` samples and the [`columns`] around them. It has fewer columns than `dimension`
/// only where the mesh has fewer vertices, and more where vertices had to be covered.
///
/// Reports the stages `sampling` and `basis`.
///
/// # Errors
/// As [`columns`].
pub fn space(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    dimension: usize,
    seed: u64,
    parameters: &RadialParameters,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, RadialError> {
    monitor.stage("sampling");
    let mut samples = match parameters.sampling {
        Sampling::PoissonDisk => poisson_disk(mesh, connectivity, dimension, seed, monitor)?,
        Sampling::FarthestPoints => farthest_points(connectivity, dimension, seed, monitor)?,
        Sampling::WellSpread => {
            well_spread_points(mesh, connectivity, &vertex_areas(mesh), dimension, 3, seed, monitor)?
        }
    };
    sort_spatially(mesh, &mut samples);
    monitor.stage("basis");
    let RadialParameters { distance, profile, sigma, .. } = *parameters;
    columns(mesh, connectivity, &samples, distance, profile, sigma, monitor)
}

/// The support of a sample shrinks by this factor while the sample is crowded.
const SHRINK: f32 = 1.5;

/// How often supports may shrink.
const SHRINK_ROUNDS: usize = 4;

/// A sample is crowded when its share of its own vertex is less than this divided by σ. Evenly spread samples have
/// about 3.3/σ.
const CROWDED: f64 = 1.2;

/// Vertices outside all supports are few where they are at most this part of the samples.
const FEW_OUTSIDE: usize = 4;

/// A wide function holds the nearest vertices: so many times the vertices outside over the samples, and at least so
/// many.
const WIDE: usize = 8;
const LEAST_WIDE: usize = 12;

/// The columns that so many samples come to at most, but for one more in each component that has no sample.
pub fn most_columns(samples: usize) -> usize {
    samples + samples / 2
}

/// The function of a vertex that can reach few others is all but constant on them: its radius is so many times the
/// distance to the farthest.
const BEYOND: f64 = 1e3;

/// A radius, along edges, within which so many vertices lie around one; far beyond all that can be reached where they
/// are fewer.
fn nearest(connectivity: &Connectivity, vertex: u32, vertices: usize) -> f64 {
    let mut known = HashMap::from([(vertex, 0.0)]);
    let mut queue = BinaryHeap::from([Reverse((0f64.to_bits(), vertex))]);
    let (mut settled, mut last) = (0, 0.0);
    while let Some(Reverse((bits, v))) = queue.pop() {
        let at = f64::from_bits(bits);
        if known.get(&v).is_some_and(|&best| at > best) {
            continue;
        }
        last = at;
        if settled == vertices {
            return at;
        }
        settled += 1;
        let (neighbours, lengths) = connectivity.neighbours(v);
        for (&other, length) in neighbours.iter().zip(lengths) {
            let best = known.entry(other).or_insert(f64::INFINITY);
            if at + length < *best {
                *best = at + length;
                // Distances are not negative, so their bits are in their order.
                queue.push(Reverse((best.to_bits(), other)));
            }
        }
    }
    BEYOND * last
}

/// The columns of `U` around `samples`: `n × d`, each row non-negative with sum 1, and no row empty.
///
/// Column `j` is the profile of the distance from sample `j`, over the support radius that follows from `sigma` and the
/// area of the mesh; where samples crowd, their supports are shrunk until each keeps a fair share of its own vertex, so
/// that columns stay independent. Vertices that lie in no support become samples themselves, in ascending order after
/// the given ones, so `d ≥ samples.len()`; where they are many, each of their functions holds several of them, and
/// there are at most [`most_columns`].
///
/// # Errors
/// [`RadialError`] for samples that are not vertices, for a mesh without vertices, samples or area, and when cancelled.
pub fn columns(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    samples: &[u32],
    distance: DistanceKind,
    profile: Profile,
    sigma: f64,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, RadialError> {
    let within = (sigma, radius(mesh, connectivity, samples, sigma)?);
    columns_within(mesh, connectivity, samples, distance, profile, within, monitor)
}

/// [`columns`] that are not put in rows.
///
/// # Errors
/// As [`columns`].
pub(super) fn grown(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    samples: &[u32],
    (distance, profile): (DistanceKind, Profile),
    sigma: f64,
    monitor: &dyn Monitor,
) -> Result<Grown, RadialError> {
    let within = (sigma, radius(mesh, connectivity, samples, sigma)?);
    let supports = supports(mesh, connectivity, samples, distance, profile, within, monitor)?;
    Ok(Grown::new(supports.covered.len(), supports.columns))
}

/// The support radius of so many samples.
fn radius(mesh: &TriangleMesh, connectivity: &Connectivity, samples: &[u32], sigma: f64) -> Result<f64, RadialError> {
    let area = surface_area(mesh);
    let radius = support_radius(area, sigma, samples.len());
    let has_radius = radius > 0.0 && radius.is_finite();
    // What is empty is told by whoever looks for supports.
    let is_empty = samples.is_empty() || connectivity.vertices() == 0;
    if has_radius || is_empty { Ok(radius) } else { Err(RadialError::Radius { sigma, area }) }
}

/// [`columns`] with supports of a given radius, which holds about `sigma` samples: for what is no surface. Of `mesh`,
/// the distance along edges needs no more than the positions.
///
/// # Errors
/// As [`columns`].
pub fn columns_within(
    mesh: &TriangleMesh,
    connectivity: &Connectivity,
    samples: &[u32],
    distance: DistanceKind,
    profile: Profile,
    within: (f64, f64),
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, RadialError> {
    Ok(supports(mesh, connectivity, samples, distance, profile, within, monitor)?.into_rows())
}

/// The supports of [`columns_within`].
fn supports<'a>(
    mesh: &'a TriangleMesh,
    connectivity: &'a Connectivity,
    samples: &[u32],
    distance: DistanceKind,
    profile: Profile,
    (sigma, radius): (f64, f64),
    monitor: &dyn Monitor,
) -> Result<Supports<'a>, RadialError> {
    let n = connectivity.vertices();
    if n == 0 || samples.is_empty() {
        return Err(RadialError::Empty { vertices: n, samples: samples.len() });
    }
    if let Some((sample, &vertex)) = samples.iter().enumerate().find(|&(_, &v)| v as usize >= n) {
        return Err(RadialError::Sample { sample, vertex, vertices: n });
    }
    let geometry = DistanceGeometry::new(mesh, connectivity, distance, radius);
    let mut supports = Supports {
        geometry,
        profile,
        centres: samples.iter().map(|&v| (v, 1.0)).collect(),
        columns: vec![Vec::new(); samples.len()],
        covered: (0..n).map(|_| AtomicBool::new(false)).collect(),
    };
    let all: Vec<u32> = (0..samples.len() as u32).collect();
    supports.grow(&all, monitor)?;
    for _ in 0..SHRINK_ROUNDS {
        let crowded = supports.crowded((CROWDED / sigma) as f32);
        if crowded.is_empty() {
            break;
        }
        supports.shrink(&crowded, monitor)?;
    }
    supports.cover(connectivity, radius, monitor)?;
    Ok(supports)
}

/// Ranges of columns that are placed at once, at most: each takes a count per vertex.
const RANGES_MAX: usize = 16;

/// A column: the vertices of a support and their weights, in the order in which they were reached.
type Column = Vec<(u32, f32)>;

/// The functions before they are normalised.
struct Supports<'a> {
    geometry: DistanceGeometry<'a>,
    profile: Profile,
    /// The sample of each column and its support radius, as a share of the common one.
    centres: Vec<(u32, f32)>,
    columns: Vec<Column>,
    /// Does a vertex lie in any support?
    covered: Vec<AtomicBool>,
}

impl Supports<'_> {
    /// Makes the given columns anew, in parallel.
    fn grow(&mut self, which: &[u32], monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let done = AtomicU32::new(0);
        let (geometry, profile, covered) = (&self.geometry, self.profile, &self.covered);
        // A workspace is as large as the mesh.
        let workspaces = Spare::default();
        let fresh = which
            .par_iter()
            .map(|&j| {
                monitor.checkpoint()?;
                let (sample, share) = self.centres[j as usize];
                workspaces.with(
                    || DistanceWorkspace::new(geometry),
                    |workspace| {
                        let disk = workspace.local_distances(geometry, sample, share);
                        let mut column = Vec::with_capacity(disk.len());
                        for &(v, distance) in disk {
                            let weight = profile.weight(distance / share);
                            if weight > 0.0 {
                                covered[v as usize].store(true, Ordering::Relaxed);
                                column.push((v, weight));
                            }
                        }
                        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                        if done.is_multiple_of(32) {
                            monitor.progress(f64::from(done) / which.len() as f64);
                        }
                        Ok(column)
                    },
                )
            })
            .collect::<Result<Vec<Column>, Cancelled>>()?;
        for (&j, column) in which.iter().zip(fresh) {
            self.columns[j as usize] = column;
        }
        Ok(())
    }

    /// The columns whose share of their own sample's vertex is less than `least`.
    fn crowded(&self, least: f32) -> Vec<u32> {
        let mut slots = vec![u32::MAX; self.covered.len()];
        let mut sums = vec![0f32; self.centres.len()];
        for (j, &(v, _)) in self.centres.iter().enumerate() {
            slots[v as usize] = j as u32;
        }
        for &(v, weight) in self.columns.iter().flatten() {
            if let Some(sum) = sums.get_mut(slots[v as usize] as usize) {
                *sum += weight;
            }
        }
        (0..self.centres.len() as u32)
            .filter(|&j| sums[slots[self.centres[j as usize].0 as usize] as usize] * least > 1.0)
            .collect()
    }

    fn shrink(&mut self, which: &[u32], monitor: &dyn Monitor) -> Result<(), Cancelled> {
        for &j in which {
            self.columns[j as usize] = Column::new();
            self.centres[j as usize].1 /= SHRINK;
        }
        self.covered.iter().for_each(|covered| covered.store(false, Ordering::Relaxed));
        self.columns.par_iter().flatten().for_each(|&(v, _)| self.covered[v as usize].store(true, Ordering::Relaxed));
        self.grow(which, monitor)
    }

    /// Gives vertices outside all supports functions, until there is none.
    ///
    /// Where few are outside, as at the end of a limb, each becomes a sample. Where many are, area says nothing of how
    /// far apart vertices lie: a surface squashed to a line has none, and each of its vertices would be a column. There
    /// a function holds several of the nearest vertices. Where that does not suffice either, as on thousands of spikes,
    /// the rest joins the function of the nearest centre: see [`most_columns`].
    fn cover(&mut self, connectivity: &Connectivity, radius: f64, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let samples = self.centres.len();
        let outside = self.covered.iter().filter(|covered| !covered.load(Ordering::Relaxed)).count();
        if outside == 0 {
            return Ok(());
        }
        let wide = (outside > samples / FEW_OUTSIDE).then(|| (WIDE * outside / samples).max(LEAST_WIDE));
        let mut workspace = DistanceWorkspace::new(&self.geometry);
        for v in 0..self.covered.len() as u32 {
            if self.covered[v as usize].load(Ordering::Relaxed) {
                continue;
            }
            monitor.checkpoint()?;
            if self.centres.len() >= most_columns(samples) {
                self.join_nearest(connectivity);
                return Ok(());
            }
            let around = |vertices| ((nearest(connectivity, v, vertices) / radius) as f32).max(f32::MIN_POSITIVE);
            let share = wide.map_or(1.0, around);
            let disk = workspace.local_distances(&self.geometry, v, share);
            let column: Column = disk
                .iter()
                .map(|&(v, distance)| (v, self.profile.weight(distance / share)))
                .filter(|&(_, weight)| weight > 0.0)
                .collect();
            // Wide functions overlap: what lies near the rim of one needs another.
            let least = if wide.is_some() { self.profile.weight(0.5) } else { 0.0 };
            for &(v, _) in column.iter().filter(|(_, weight)| *weight >= least) {
                self.covered[v as usize].store(true, Ordering::Relaxed);
            }
            self.centres.push((v, share));
            self.columns.push(column);
        }
        Ok(())
    }

    /// Puts each vertex that is in no column into that of the nearest centre along edges; a component without a centre
    /// becomes a column.
    fn join_nearest(&mut self, connectivity: &Connectivity) {
        let mut bare = vec![true; self.covered.len()];
        self.columns.iter().flatten().for_each(|&(v, _)| bare[v as usize] = false);
        let mut owner: Vec<Option<u32>> = vec![None; bare.len()];
        let centres = self.centres.iter().enumerate();
        let mut queue: BinaryHeap<_> = centres.map(|(j, &(v, _))| Reverse((0f64.to_bits(), v, j as u32))).collect();
        for start in 0..=bare.len() as u32 {
            while let Some(Reverse((bits, v, column))) = queue.pop() {
                if owner[v as usize].is_some() {
                    continue;
                }
                owner[v as usize] = Some(column);
                if bare[v as usize] {
                    self.columns[column as usize].push((v, 1.0));
                }
                let (neighbours, lengths) = connectivity.neighbours(v);
                for (&other, length) in
                    neighbours.iter().zip(lengths).filter(|(other, _)| owner[**other as usize].is_none())
                {
                    queue.push(Reverse(((f64::from_bits(bits) + length).to_bits(), other, column)));
                }
            }
            if owner.get(start as usize).is_some_and(Option::is_none) {
                queue.push(Reverse((0f64.to_bits(), start, self.columns.len() as u32)));
                self.centres.push((start, 1.0));
                self.columns.push(Column::new());
            }
        }
    }

    /// Turns columns into rows that sum to 1.
    fn into_rows(self) -> SparseMatrix<f32> {
        let (n, dimension) = (self.covered.len(), self.columns.len());
        // Each thread counts and places the entries of a range of columns. Ranges follow each other in every row, so
        // rows come out in order, and the result does not depend on how many there are.
        let ranges = rayon::current_num_threads().min(RANGES_MAX);
        let ranges: Vec<(usize, &[Column])> = {
            let length = dimension.div_ceil(ranges).max(1);
            self.columns.chunks(length).enumerate().map(|(i, c)| (i * length, c)).collect()
        };
        let mut places: Vec<Vec<u32>> = ranges
            .par_iter()
            .map(|(_, columns)| {
                let mut counts = vec![0u32; n];
                columns.iter().flatten().for_each(|&(v, _)| counts[v as usize] += 1);
                counts
            })
            .collect();
        // Where each range begins in a row, and how long that is, for runs of rows.
        let mut runs: Vec<(Vec<&mut [u32]>, &mut [usize])> = Vec::with_capacity(n.div_ceil(ROWS));
        let mut offsets = vec![0usize; n + 1];
        let mut counts: Vec<_> = places.iter_mut().map(|counts| counts.chunks_mut(ROWS)).collect();
        for lengths in offsets[1..].chunks_mut(ROWS) {
            runs.push((counts.iter_mut().filter_map(Iterator::next).collect(), lengths));
        }
        runs.into_par_iter().for_each(|(mut counts, lengths)| {
            for (row, length) in lengths.iter_mut().enumerate() {
                let mut end = 0;
                for counts in &mut counts {
                    end += std::mem::replace(&mut counts[row], end);
                }
                *length = end as usize;
            }
        });
        let mut total = 0;
        for offset in &mut offsets {
            total += *offset;
            *offset = total;
        }
        // Threads write to different places of the same rows; atomic cells allow that, and relaxed stores cost nothing.
        let indices: Vec<AtomicU32> = (0..total).map(|_| AtomicU32::new(0)).collect();
        let values: Vec<AtomicU32> = (0..total).map(|_| AtomicU32::new(0)).collect();
        ranges.par_iter().zip(&mut places).for_each(|((first, columns), places)| {
            for (j, column) in columns.iter().enumerate() {
                for &(v, weight) in column {
                    let place = offsets[v as usize] + places[v as usize] as usize;
                    places[v as usize] += 1;
                    indices[place].store((first + j) as u32, Ordering::Relaxed);
                    values[place].store(weight.to_bits(), Ordering::Relaxed);
                }
            }
        });
        drop(self.columns);
        let indices: Vec<u32> = indices.into_iter().map(AtomicU32::into_inner).collect();
        let mut values: Vec<f32> = values.into_iter().map(|x| f32::from_bits(x.into_inner())).collect();
        normalise(&offsets, &mut values);
        SparseMatrix::from_sorted_parts(n, dimension, offsets, indices, values)
    }
}

/// Rows that one thread normalises at a time.
const ROWS: usize = 1 << 12;

/// Divides each row by its sum.
fn normalise(offsets: &[usize], values: &mut [f32]) {
    let mut blocks = Vec::with_capacity(offsets.len() / ROWS + 1);
    let mut rest = values;
    for first in (0..offsets.len() - 1).step_by(ROWS) {
        let last = (first + ROWS).min(offsets.len() - 1);
        let (block, tail) = rest.split_at_mut(offsets[last] - offsets[first]);
        blocks.push((&offsets[first..=last], block));
        rest = tail;
    }
    blocks.into_par_iter().for_each(|(offsets, block)| {
        for row in offsets.windows(2) {
            let row = &mut block[row[0] - offsets[0]..row[1] - offsets[0]];
            let scale = 1.0 / row.iter().sum::<f32>();
            row.iter_mut().for_each(|x| *x *= scale);
        }
    });
}

#[cfg(test)]
mod real_meshes;
#[cfg(test)]
mod tests;
