//! From a coarse level back to a finer one: linear interpolation and a smoother that removes its kinks.
//!
//! The smoother is a Chebyshev polynomial in the scaled stiffness, so that nothing global is needed: a block of
//! vertices with a halo as wide as the polynomial's degree is smoothed by itself, for all columns that reach it, within
//! the cache.

use std::sync::atomic::{AtomicUsize, Ordering};

use chladni_algebra::simd::{Arch, Simd, WithSimd};
use chladni_base::parallel::*;

use super::coarsen::Coarsening;
use super::level::HeatLevel;
use super::shrink::push_row;
use chladni_algebra::{ENTRIES_AT_ONCE, SparseMatrix, fill_up};
use chladni_base::{Cancelled, Monitor, Spare};

/// Lanes are padded to a multiple of this.
const WIDTH: usize = 16;

type Lanes = [f32; WIDTH];

/// Upper end of the spectrum of the scaled stiffness: its rows are scaled so that their absolute values sum to at most
/// this.
const GREATEST: f64 = 2.0;

/// Vertices with more neighbours than this are hubs, and keep their interpolated value: the halo of a block beside one
/// would be the whole fan.
const HUB: usize = 512;

/// How to smooth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Smoother {
    /// The degree of the polynomial and the width of the halo.
    pub degree: usize,
    /// The lower end of what is damped, of a spectrum that reaches to 2.
    pub least: f64,
    /// Vertices of a block without its halo.
    pub block: usize,
}

/// How rows leave: entries below `drop` are dropped, those below `threshold` shrunk away (see [`push_row`]).
#[derive(Debug, Clone, Copy)]
pub(super) struct Thinning {
    pub drop: f32,
    pub threshold: f32,
}

/// Brings `columns` from the coarse level of `coarsening` to `fine`, smooths and thins them out. Rows sum to 1.
pub(super) fn prolong(
    fine: &HeatLevel,
    coarsening: &Coarsening,
    columns: &SparseMatrix<f32>,
    smoother: &Smoother,
    thinning: &Thinning,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let (blocks, scales) = prepared(fine, coarsening, smoother);
    rows((fine, coarsening, columns), (&blocks, &scales), None, (smoother, thinning), monitor)
}

/// The blocks that are smoothed by themselves, and the factor of each row of the stiffness.
pub(super) fn prepared(fine: &HeatLevel, coarsening: &Coarsening, smoother: &Smoother) -> (Vec<Vec<u32>>, Vec<f32>) {
    let n = fine.vertices();
    // Where the fine mesh is no finer than the coarse one there is nothing to smooth: time steps are limited.
    let limit = coarsening.reach * coarsening.reach / 16.0;
    let scales = (0..n).into_par_iter().map(|v| scale(fine, v, limit)).collect();
    (blocks(coarsening, n, smoother.block), scales)
}

/// The rows of [`prolong`] that are wanted, by blocks and factors that are [`prepared`]; the others are empty.
pub(super) fn rows(
    (fine, coarsening, columns): (&HeatLevel, &Coarsening, &SparseMatrix<f32>),
    (blocks, scales): (&[Vec<u32>], &[f32]),
    wanted: Option<&[bool]>,
    (smoother, thinning): (&Smoother, &Thinning),
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let n = fine.vertices();
    let smoothing = Smoothing { fine, coarsening, columns, scales, wanted, smoother: *smoother, thinning: *thinning };
    let blocks: Vec<&[u32]> =
        blocks.iter().map(Vec::as_slice).filter(|block| block.iter().any(|&v| smoothing.is_wanted(v))).collect();
    let done = AtomicUsize::new(0);
    let scratch = || Scratch {
        local: vec![u32::MAX; n],
        lanes: vec![u32::MAX; columns.columns()],
        seen: vec![0; columns.rows()],
        stamp: 0,
    };
    let spare = Spare::default();
    let parts: Vec<Part> = blocks
        .par_iter()
        .map(|block| {
            monitor.checkpoint()?;
            let part = spare.with(scratch, |scratch| smoothing.block(block, scratch));
            let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
            if finished.is_multiple_of(16) {
                monitor.progress(finished as f64 / blocks.len() as f64);
            }
            Ok(part)
        })
        .collect::<Result<_, Cancelled>>()?;
    drop(spare);
    monitor.checkpoint()?;
    Ok(assemble(n, columns.columns(), &blocks, parts))
}

/// The factor of a row of the stiffness; 0 where the value is kept.
fn scale(level: &HeatLevel, v: usize, limit: f32) -> f32 {
    if level.edges(v).len() > HUB {
        return 0.0;
    }
    let off: f32 = level.edges(v).map(|edge| level.weights[edge].abs()).sum();
    let size = 0.5 * (level.diagonal[v].abs() + off);
    let slowest = level.mass[v] / limit;
    let size = size.max(slowest);
    if size > 0.0 && size.is_finite() { 1.0 / size } else { 0.0 }
}

/// Groups of whole cells with about `size` fine vertices, each grown breadth first over the coarse graph.
fn blocks(coarsening: &Coarsening, n: usize, size: usize) -> Vec<Vec<u32>> {
    let coarse = &coarsening.level;
    let mut order: Vec<u32> = Vec::with_capacity(coarse.vertices());
    let mut group = vec![u32::MAX; coarse.vertices()];
    let mut members = vec![0u32; coarse.vertices()];
    for &cell in &coarsening.cells {
        members[cell as usize] += 1;
    }
    let mut groups = 0u32;
    let mut count = 0usize;
    let mut front: std::collections::VecDeque<u32> = std::collections::VecDeque::new();
    let mut open: std::collections::VecDeque<u32> = std::collections::VecDeque::new();
    let mut rest = 0usize;
    loop {
        // The next cell: breadth first from the start of this block; a new block starts beside old ones.
        let next = loop {
            if let Some(cell) = front.pop_front() {
                if group[cell as usize] == u32::MAX {
                    break Some(cell);
                }
                continue;
            }
            if let Some(cell) = open.pop_front() {
                if group[cell as usize] == u32::MAX {
                    break Some(cell);
                }
                continue;
            }
            while rest < group.len() && group[rest] != u32::MAX {
                rest += 1;
            }
            break (rest < group.len()).then_some(rest as u32);
        };
        let Some(cell) = next else { break };
        if count >= size {
            groups += 1;
            count = 0;
            open.extend(front.drain(..));
        }
        group[cell as usize] = groups;
        count += members[cell as usize] as usize;
        order.push(cell);
        front.extend(
            coarse.edges(cell as usize).map(|e| coarse.neighbours[e]).filter(|&o| group[o as usize] == u32::MAX),
        );
    }
    let mut blocks: Vec<Vec<u32>> = vec![Vec::new(); groups as usize + 1];
    for v in 0..n {
        blocks[group[coarsening.cells[v] as usize] as usize].push(v as u32);
    }
    blocks.retain(|block| !block.is_empty());
    blocks
}

/// What a thread keeps between blocks.
struct Scratch {
    local: Vec<u32>,
    lanes: Vec<u32>,
    seen: Vec<u32>,
    stamp: u32,
}

/// The rows of a block, in the order of its vertices.
struct Part {
    ends: Vec<u32>,
    indices: Vec<u32>,
    values: Vec<f32>,
}

/// What blocks are smoothed with.
struct Smoothing<'a> {
    fine: &'a HeatLevel,
    coarsening: &'a Coarsening,
    columns: &'a SparseMatrix<f32>,
    /// The factor of each row of the stiffness.
    scales: &'a [f32],
    /// The rows that are made, where these are not all.
    wanted: Option<&'a [bool]>,
    smoother: Smoother,
    thinning: Thinning,
}

impl Smoothing<'_> {
    fn is_wanted(&self, vertex: u32) -> bool {
        self.wanted.is_none_or(|wanted| wanted[vertex as usize])
    }

    /// Interpolates, smooths and thins out the rows of a block.
    fn block(&self, block: &[u32], scratch: &mut Scratch) -> Part {
        let (vertices, ends) = self.rings(block, &mut scratch.local);
        let names = self.columns_over(&vertices, scratch);
        let chunks = names.len().div_ceil(WIDTH).max(1);
        let x = self.interpolated(&vertices, &scratch.lanes, chunks);
        // The outermost ring has no row.
        let matrix = self.rows(&vertices[..ends[self.smoother.degree.saturating_sub(1)]], &scratch.local);
        vertices.iter().for_each(|&v| scratch.local[v as usize] = u32::MAX);
        names.iter().for_each(|&column| scratch.lanes[column as usize] = u32::MAX);
        let x = self.iterate(&matrix, &ends, chunks, x);
        let room = 20 * block.len();
        let mut part = Part {
            ends: Vec::with_capacity(block.len()),
            indices: Vec::with_capacity(room),
            values: Vec::with_capacity(room),
        };
        let Thinning { drop, threshold } = self.thinning;
        for (k, &v) in block.iter().enumerate() {
            if !self.is_wanted(v) {
                part.ends.push(part.indices.len() as u32);
                continue;
            }
            let row = &x[k * chunks..(k + 1) * chunks].as_flattened()[..names.len()];
            push_row(&names, row, drop, threshold, &mut part.indices, &mut part.values);
            part.ends.push(part.indices.len() as u32);
        }
        part.indices.shrink_to_fit();
        part.values.shrink_to_fit();
        part
    }

    /// The vertices of a block, then ring after ring around it, and where each of these ends. `local` is told their
    /// places.
    fn rings(&self, block: &[u32], local: &mut [u32]) -> (Vec<u32>, Vec<usize>) {
        let mut vertices = block.to_vec();
        for (k, &v) in vertices.iter().enumerate() {
            local[v as usize] = k as u32;
        }
        let mut ends = vec![vertices.len()];
        let mut begin = 0;
        for _ in 0..self.smoother.degree {
            let end = vertices.len();
            for k in begin..end {
                // What is kept asks for no neighbours.
                if self.scales[vertices[k] as usize] == 0.0 {
                    continue;
                }
                for edge in self.fine.edges(vertices[k] as usize) {
                    let other = self.fine.neighbours[edge];
                    if local[other as usize] == u32::MAX {
                        local[other as usize] = vertices.len() as u32;
                        vertices.push(other);
                    }
                }
            }
            begin = end;
            ends.push(vertices.len());
        }
        (vertices, ends)
    }

    /// The columns over some vertices, ascending. Lanes are told their places.
    fn columns_over(&self, vertices: &[u32], Scratch { lanes, seen, stamp, .. }: &mut Scratch) -> Vec<u32> {
        *stamp += 1;
        let mut names: Vec<u32> = Vec::new();
        for &v in vertices {
            let (corners, weights) = self.coarsening.corners[v as usize];
            for (corner, weight) in corners.into_iter().zip(weights) {
                if weight > 0.0 && seen[corner as usize] != *stamp {
                    seen[corner as usize] = *stamp;
                    for &column in self.columns.row(corner as usize).0 {
                        if lanes[column as usize] == u32::MAX {
                            lanes[column as usize] = 0;
                            names.push(column);
                        }
                    }
                }
            }
        }
        names.sort_unstable();
        for (lane, &column) in names.iter().enumerate() {
            lanes[column as usize] = lane as u32;
        }
        names
    }

    /// The values of columns at vertices, `chunks` of lanes for each.
    fn interpolated(&self, vertices: &[u32], lanes: &[u32], chunks: usize) -> Vec<Lanes> {
        let mut x = vec![[0f32; WIDTH]; vertices.len() * chunks];
        for (k, &v) in vertices.iter().enumerate() {
            let row = x[k * chunks..(k + 1) * chunks].as_flattened_mut();
            let (corners, weights) = self.coarsening.corners[v as usize];
            for (corner, weight) in corners.into_iter().zip(weights) {
                if weight > 0.0 {
                    let (indices, values) = self.columns.row(corner as usize);
                    for (&column, &value) in indices.iter().zip(values) {
                        row[lanes[column as usize] as usize] += weight * value;
                    }
                }
            }
        }
        x
    }

    /// The scaled stiffness at vertices, columns by their places.
    fn rows(&self, vertices: &[u32], local: &[u32]) -> Rows {
        let mut matrix = Rows {
            offsets: Vec::with_capacity(vertices.len() + 1),
            entries: Vec::with_capacity(2 * ENTRIES_AT_ONCE * vertices.len()),
            diagonal: Vec::with_capacity(vertices.len()),
        };
        matrix.offsets.push(0);
        for (k, &v) in vertices.iter().enumerate() {
            let factor = self.scales[v as usize];
            if factor != 0.0 {
                for edge in self.fine.edges(v as usize) {
                    let other = self.fine.neighbours[edge] as usize;
                    matrix.entries.push((local[other], factor * self.fine.weights[edge]));
                }
                fill_up(&mut matrix.entries, (k as u32, 0.0));
            }
            matrix.offsets.push(matrix.entries.len() as u32);
            matrix.diagonal.push(factor * self.fine.diagonal[v as usize]);
        }
        matrix
    }

    /// Chebyshev semi-iteration towards zero: `x ← x + β(x − before) − γ B x`, each step on a ring less.
    fn iterate(&self, matrix: &Rows, ends: &[usize], chunks: usize, mut x: Vec<Lanes>) -> Vec<Lanes> {
        let Smoother { degree, least, .. } = self.smoother;
        let mut before = x.clone();
        let (middle, half) = (0.5 * (GREATEST + least), 0.5 * (GREATEST - least));
        let arch = Arch::new();
        let mut rho = half / middle;
        for step in 0..degree {
            let (beta, gamma) = if step == 0 {
                (0.0, 1.0 / middle)
            } else {
                let next = 1.0 / (2.0 * middle / half - rho);
                let pair = (next * rho, 2.0 * next / half);
                rho = next;
                pair
            };
            let (rows, beta, gamma) = (ends[degree - 1 - step], beta as f32, gamma as f32);
            arch.dispatch(Sweep { matrix, rows, chunks, beta, gamma, x: &x, before: &mut before });
            std::mem::swap(&mut x, &mut before);
        }
        x
    }
}

/// Rows of the scaled stiffness: off-diagonal entries negated, and zeros that fill rows up to multiples of
/// [`ENTRIES_AT_ONCE`].
struct Rows {
    offsets: Vec<u32>,
    entries: Vec<(u32, f32)>,
    diagonal: Vec<f32>,
}

/// One step of the iteration on the first `rows` rows; the result replaces `before`.
struct Sweep<'a> {
    matrix: &'a Rows,
    rows: usize,
    chunks: usize,
    beta: f32,
    gamma: f32,
    x: &'a [Lanes],
    before: &'a mut [Lanes],
}

impl WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { matrix, rows, chunks, beta, gamma, x, before } = self;
        for k in 0..rows {
            let entries = &matrix.entries[matrix.offsets[k] as usize..matrix.offsets[k + 1] as usize];
            let own = 1.0 + beta - gamma * matrix.diagonal[k];
            for c in 0..chunks {
                let mut sum = [0f32; WIDTH];
                for entries in entries.as_chunks::<ENTRIES_AT_ONCE>().0 {
                    let rows = entries.map(|(other, _)| &x[other as usize * chunks + c]);
                    for l in 0..WIDTH {
                        for entry in 0..ENTRIES_AT_ONCE {
                            sum[l] = fma::<S>(entries[entry].1, rows[entry][l], sum[l]);
                        }
                    }
                }
                let (own_row, old) = (&x[k * chunks + c], &mut before[k * chunks + c]);
                for l in 0..WIDTH {
                    let kept = fma::<S>(own, own_row[l], -beta * old[l]);
                    old[l] = fma::<S>(gamma, sum[l], kept);
                }
            }
        }
    }
}

/// `a·b + c`, fused where the vector unit fuses: without one `mul_add` would be a call.
#[inline(always)]
fn fma<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::F32_LANES >= 4 { a.mul_add(b, c) } else { a * b + c }
}

/// Puts the rows of the blocks in the order of the vertices.
fn assemble(n: usize, d: usize, blocks: &[&[u32]], parts: Vec<Part>) -> SparseMatrix<f32> {
    let mut places = vec![(0u32, 0u32); n];
    let mut offsets = vec![0usize; n + 1];
    for (b, (block, part)) in blocks.iter().zip(&parts).enumerate() {
        let mut begin = 0;
        for (&v, &end) in block.iter().zip(&part.ends) {
            places[v as usize] = (b as u32, begin);
            offsets[v as usize + 1] = (end - begin) as usize;
            begin = end;
        }
    }
    for v in 0..n {
        offsets[v + 1] += offsets[v];
    }
    // Columns first, then values, so that there are never two of both.
    let (of_indices, of_values): (Vec<_>, Vec<_>) = parts.into_iter().map(|part| (part.indices, part.values)).unzip();
    let indices = gathered(&offsets, &places, of_indices);
    let values = gathered(&offsets, &places, of_values);
    SparseMatrix::from_sorted_parts(n, d, offsets, indices, values)
}

/// What stands in the rows, one row after the other; `places` say in which part each row is and where it begins there.
fn gathered<T: Copy + Default + Send + Sync>(offsets: &[usize], places: &[(u32, u32)], parts: Vec<Vec<T>>) -> Vec<T> {
    let n = places.len();
    let mut all = vec![T::default(); offsets[n]];
    let rows_per_chunk = 8192;
    let mut chunks = Vec::with_capacity(n.div_ceil(rows_per_chunk));
    let mut free = all.as_mut_slice();
    for begin in (0..n).step_by(rows_per_chunk) {
        let end = (begin + rows_per_chunk).min(n);
        let own;
        (own, free) = std::mem::take(&mut free).split_at_mut(offsets[end] - offsets[begin]);
        chunks.push((begin..end, own));
    }
    chunks.into_par_iter().for_each(|(rows, own)| {
        let base = offsets[rows.start];
        for v in rows {
            let (part, begin) = places[v];
            let here = offsets[v] - base..offsets[v + 1] - base;
            let there = begin as usize..begin as usize + here.len();
            own[here].copy_from_slice(&parts[part as usize][there]);
        }
    });
    all
}
