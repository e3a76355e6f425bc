//! Heat steps on sixteen neighbouring columns at once.
//!
//! Neighbouring columns share most of their patches, so sixteen are solved together on the union of theirs: one pass
//! over the matrix serves all, and the sixteen lanes are what the vector units want. The solver is conjugate gradients
//! with one set of scalars per lane, on the matrix scaled to unit diagonal.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use chladni_algebra::simd::{Arch, Simd, WithSimd};
use chladni_base::parallel::*;

use super::assemble::{DroppingRule, Part, WidestRows, assemble};
use super::level::HeatLevel;
use chladni_algebra::{ENTRIES_AT_ONCE, SparseMatrix, fill_up};
use chladni_base::{Cancelled, Monitor};

/// Columns of a panel.
const WIDTH: usize = 16;
/// More iterations than any solve of a heat step should take; a solve that reaches it is used as it is.
const MOST_ITERATIONS: usize = 400;

pub(super) type Lanes = [f32; WIDTH];

/// The heat steps to take; lengths and times on unit area.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heat {
    pub steps: usize,
    pub time: f32,
    pub margin: f32,
    pub dropping: DroppingRule,
    pub tolerance: f32,
}

/// Diffuses `columns` (rows: vertices of `level`) and returns every entry that stays, or the largest of each row where
/// columns reach everywhere; rows are not normalised. `peaks` is a vertex in the middle of each column; panels are
/// gathered around them.
pub(super) fn diffuse(
    level: &HeatLevel,
    columns: &SparseMatrix<f32>,
    peaks: &[u32],
    heat: &Heat,
    monitor: &dyn Monitor,
) -> Result<SparseMatrix<f32>, Cancelled> {
    let (supports, panels) = (supports(columns), panels(columns, peaks));
    let done = AtomicUsize::new(0);
    let solve = |scratch: &mut Scratch, lanes: &Vec<u32>| {
        monitor.checkpoint()?;
        let patch = Patch::grow(level, &supports, lanes, heat, scratch);
        let values = patch.solve(columns, lanes, heat, monitor)?;
        let finished = done.fetch_add(1, Ordering::Relaxed) + 1;
        monitor.progress(finished as f64 / panels.len() as f64);
        Ok(Part { lanes: lanes.clone(), vertices: patch.vertices, values })
    };
    let scratch = || Scratch::new(level.vertices());
    let (most, entries) = (heat.dropping.most_entries(columns.rows()), AtomicUsize::new(0));
    let parts: Result<Vec<Part>, Ended> = panels
        .par_iter()
        .map_init(scratch, |scratch, lanes| {
            let part = solve(scratch, lanes).map_err(Ended::Cancelled)?;
            let own = part.entries(&heat.dropping);
            if entries.fetch_add(own, Ordering::Relaxed) + own > most { Err(Ended::Everywhere) } else { Ok(part) }
        })
        .collect();
    let parts = match parts {
        Ok(parts) => parts,
        Err(Ended::Cancelled(cancelled)) => return Err(cancelled),
        Err(Ended::Everywhere) => {
            // Again from the beginning: what is not kept is never held.
            done.store(0, Ordering::Relaxed);
            let rows = Mutex::new(WidestRows::new(columns.rows()));
            panels.par_iter().map_init(scratch, &solve).try_for_each(|part| {
                rows.lock().unwrap_or_else(PoisonError::into_inner).add(&part?, &heat.dropping);
                Ok(())
            })?;
            return Ok(rows.into_inner().unwrap_or_else(PoisonError::into_inner).finish(columns));
        }
    };
    monitor.checkpoint()?;
    Ok(assemble(columns, &parts, &heat.dropping))
}

/// Why not all panels are there.
enum Ended {
    Cancelled(Cancelled),
    /// Columns reach so far that their entries take more memory than those of a surface do.
    Everywhere,
}

/// The vertices of each column: offsets and vertices.
struct Supports {
    offsets: Vec<usize>,
    vertices: Vec<u32>,
}

fn supports(columns: &SparseMatrix<f32>) -> Supports {
    let mut offsets = vec![0usize; columns.columns() + 1];
    for &column in columns.indices() {
        offsets[column as usize + 1] += 1;
    }
    for column in 0..columns.columns() {
        offsets[column + 1] += offsets[column];
    }
    let mut next = offsets.clone();
    let mut vertices = vec![0u32; columns.entries()];
    for row in 0..columns.rows() {
        for &column in columns.row(row).0 {
            vertices[next[column as usize]] = row as u32;
            next[column as usize] += 1;
        }
    }
    Supports { offsets, vertices }
}

/// Groups of at most [`WIDTH`] columns, ascending within a group: each group starts anywhere and takes the column that
/// overlaps most with it, until full. Overlap is read off at the peaks, which takes `d` rows instead of `n`.
fn panels(columns: &SparseMatrix<f32>, peaks: &[u32]) -> Vec<Vec<u32>> {
    let d = columns.columns();
    let mut around: Vec<Vec<(u32, f32)>> = vec![Vec::new(); d];
    for (column, &peak) in peaks.iter().enumerate() {
        let (others, values) = columns.row(peak as usize);
        for (&other, &value) in others.iter().zip(values) {
            if other as usize != column {
                around[column].push((other, value));
                around[other as usize].push((column as u32, value));
            }
        }
    }
    let mut taken = vec![false; d];
    let mut attraction = vec![0f32; d];
    let mut rest = 0;
    let mut panels = Vec::with_capacity(d.div_ceil(WIDTH));
    let mut front: Vec<u32> = Vec::new();
    while rest < d {
        let mut panel: Vec<u32> = Vec::with_capacity(WIDTH);
        let mut candidates: Vec<u32> = Vec::new();
        while panel.len() < WIDTH {
            // The strongest candidate; else a column beside earlier panels, so that no islands are left; else any.
            let mut strongest: Option<u32> = None;
            for &candidate in &candidates {
                let stronger = |s: u32| attraction[candidate as usize] > attraction[s as usize];
                if !taken[candidate as usize] && strongest.is_none_or(stronger) {
                    strongest = Some(candidate);
                }
            }
            let next = strongest.or_else(|| {
                while let Some(column) = front.pop() {
                    if !taken[column as usize] {
                        return Some(column);
                    }
                }
                None
            });
            let next = match next {
                Some(column) => column,
                None => {
                    while rest < d && taken[rest] {
                        rest += 1;
                    }
                    if rest == d {
                        break;
                    }
                    rest as u32
                }
            };
            taken[next as usize] = true;
            panel.push(next);
            for &(other, value) in &around[next as usize] {
                if !taken[other as usize] {
                    attraction[other as usize] += value;
                    candidates.push(other);
                }
            }
        }
        for &candidate in &candidates {
            attraction[candidate as usize] = 0.0;
        }
        front.extend(candidates.iter().filter(|&&c| !taken[c as usize]));
        while rest < d && taken[rest] {
            rest += 1;
        }
        panel.sort_unstable();
        if !panel.is_empty() {
            panels.push(panel);
        }
    }
    panels
}

/// What a thread keeps between panels, as long as the level has vertices.
struct Scratch {
    distance: Vec<f32>,
    local: Vec<u32>,
}

impl Scratch {
    fn new(n: usize) -> Self {
        Self { distance: vec![f32::INFINITY; n], local: vec![u32::MAX; n] }
    }
}

/// The union of the patches of a panel and the heat operator there, scaled to unit diagonal.
struct Patch {
    /// Vertices of the level, ascending.
    vertices: Vec<u32>,
    /// Rows are filled up to multiples of [`ENTRIES_AT_ONCE`] with zeros: where one ends is foreseen then.
    offsets: Vec<u32>,
    neighbours: Vec<u32>,
    /// Off-diagonal entries of `D^-½ (M + τS) D^-½`, `D` the diagonal of `M + τS`.
    values: Vec<f32>,
    /// √D.
    root: Vec<f32>,
    /// M/D.
    share: Vec<f32>,
}

impl Patch {
    fn grow(level: &HeatLevel, supports: &Supports, lanes: &[u32], heat: &Heat, scratch: &mut Scratch) -> Self {
        let Scratch { distance, local } = scratch;
        let mut vertices: Vec<u32> = Vec::new();
        for &lane in lanes {
            for &v in &supports.vertices[supports.offsets[lane as usize]..supports.offsets[lane as usize + 1]] {
                if distance[v as usize] != 0.0 {
                    distance[v as usize] = 0.0;
                    vertices.push(v);
                }
            }
        }
        // Beyond the supports in order of distance. Bits of non-negative floats are in the order of the floats.
        let mut heap: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
        let relax = |from: u32, at: f32, distance: &mut Vec<f32>, heap: &mut BinaryHeap<Reverse<(u32, u32)>>| {
            for edge in level.edges(from as usize) {
                let reached = at + level.lengths[edge];
                let v = level.neighbours[edge];
                if reached <= heat.margin && reached < distance[v as usize] {
                    distance[v as usize] = reached;
                    heap.push(Reverse((reached.to_bits(), v)));
                }
            }
        };
        for &v in &vertices {
            relax(v, 0.0, distance, &mut heap);
        }
        while let Some(Reverse((bits, v))) = heap.pop() {
            let at = f32::from_bits(bits);
            if at > distance[v as usize] || local[v as usize] == 0 {
                continue;
            }
            local[v as usize] = 0;
            vertices.push(v);
            relax(v, at, distance, &mut heap);
        }
        vertices.sort_unstable();
        for (k, &v) in vertices.iter().enumerate() {
            local[v as usize] = k as u32;
        }
        let patch = Self::restrict(level, vertices, heat.time, local);
        for &v in &patch.vertices {
            distance[v as usize] = f32::INFINITY;
            local[v as usize] = u32::MAX;
        }
        patch
    }

    fn restrict(level: &HeatLevel, vertices: Vec<u32>, time: f32, local: &[u32]) -> Self {
        let n = vertices.len();
        let (mut root, mut share) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for &v in &vertices {
            let mass = level.mass[v as usize];
            let diagonal = mass + time * level.diagonal[v as usize];
            // A vertex without mass and stiffness stays as it is.
            if diagonal > 0.0 {
                root.push(diagonal.sqrt());
                share.push(mass / diagonal);
            } else {
                root.push(1.0);
                share.push(1.0);
            }
        }
        let mut offsets = Vec::with_capacity(n + 1);
        let (mut neighbours, mut values) = (Vec::with_capacity(7 * n), Vec::with_capacity(7 * n));
        offsets.push(0);
        for (k, &v) in vertices.iter().enumerate() {
            let factor = -time / root[k];
            for edge in level.edges(v as usize) {
                let other = local[level.neighbours[edge] as usize];
                let weight = level.weights[edge];
                if other != u32::MAX && weight != 0.0 {
                    neighbours.push(other);
                    values.push(factor * weight / root[other as usize]);
                }
            }
            fill_up(&mut neighbours, k as u32);
            fill_up(&mut values, 0.0);
            offsets.push(neighbours.len() as u32);
        }
        Self { vertices, offsets, neighbours, values, root, share }
    }

    /// The diffused columns, a row of lanes per vertex.
    fn solve(
        &self,
        columns: &SparseMatrix<f32>,
        lanes: &[u32],
        heat: &Heat,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Lanes>, Cancelled> {
        let n = self.vertices.len();
        let mut y = vec![[0f32; WIDTH]; n];
        for (k, &v) in self.vertices.iter().enumerate() {
            let (indices, values) = columns.row(v as usize);
            for (column, &value) in indices.iter().zip(values) {
                if let Ok(lane) = lanes.binary_search(column) {
                    y[k][lane] = value * self.root[k];
                }
            }
        }
        let mut residual = vec![[0f32; WIDTH]; n];
        let mut direction = vec![[0f32; WIDTH]; n];
        let mut image = vec![[0f32; WIDTH]; n];
        let arch = Arch::new();
        for _ in 0..heat.steps {
            let (square, size) =
                arch.dispatch(Begin { patch: self, y: &y, residual: &mut residual, direction: &mut direction });
            let goal = size.map(|s| heat.tolerance * heat.tolerance * s);
            let mut square = square;
            for _ in 0..MOST_ITERATIONS {
                let mut active: [bool; WIDTH] = std::array::from_fn(|l| square[l] > goal[l]);
                if !active.contains(&true) {
                    break;
                }
                monitor.checkpoint()?;
                let curvature = arch.dispatch(Multiply { patch: self, direction: &direction, image: &mut image });
                for l in 0..WIDTH {
                    active[l] &= curvature[l] > 0.0;
                }
                let step: Lanes = std::array::from_fn(|l| if active[l] { square[l] / curvature[l] } else { 0.0 });
                let next = arch.dispatch(Step {
                    step,
                    direction: &direction,
                    image: &image,
                    y: &mut y,
                    residual: &mut residual,
                });
                let ratio: Lanes = std::array::from_fn(|l| if active[l] { next[l] / square[l] } else { 0.0 });
                for l in 0..WIDTH {
                    square[l] = if active[l] { next[l] } else { 0.0 };
                }
                arch.dispatch(Turn { ratio, residual: &residual, direction: &mut direction });
            }
        }
        for (row, root) in y.iter_mut().zip(&self.root) {
            let scale = 1.0 / root;
            for x in row {
                *x *= scale;
            }
        }
        Ok(y)
    }
}

/// `a·b + c`, fused where the vector unit fuses: without one `mul_add` would be a call.
#[inline(always)]
fn fma<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::F32_LANES >= 4 { a.mul_add(b, c) } else { a * b + c }
}

/// Row `k` of the operator times the panel.
#[inline(always)]
fn row_times<S: Simd>(patch: &Patch, k: usize, x: &[Lanes]) -> Lanes {
    let mut sum = x[k];
    let range = patch.offsets[k] as usize..patch.offsets[k + 1] as usize;
    let (others, values) = (&patch.neighbours[range.clone()], &patch.values[range]);
    for (others, values) in others.as_chunks::<ENTRIES_AT_ONCE>().0.iter().zip(values.as_chunks::<ENTRIES_AT_ONCE>().0)
    {
        let rows = others.map(|other| &x[other as usize]);
        for l in 0..WIDTH {
            for entry in 0..ENTRIES_AT_ONCE {
                sum[l] = fma::<S>(values[entry], rows[entry][l], sum[l]);
            }
        }
    }
    sum
}

/// The first residual and direction of a heat step from `y`; the squares of the residual and of the right-hand side.
struct Begin<'a> {
    patch: &'a Patch,
    y: &'a [Lanes],
    residual: &'a mut [Lanes],
    direction: &'a mut [Lanes],
}

impl WithSimd for Begin<'_> {
    type Output = (Lanes, Lanes);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> (Lanes, Lanes) {
        let (mut square, mut size) = ([0f32; WIDTH], [0f32; WIDTH]);
        for k in 0..self.y.len() {
            let image = row_times::<S>(self.patch, k, self.y);
            let share = self.patch.share[k];
            for l in 0..WIDTH {
                let goal = share * self.y[k][l];
                let rest = goal - image[l];
                self.residual[k][l] = rest;
                self.direction[k][l] = rest;
                square[l] = fma::<S>(rest, rest, square[l]);
                size[l] = fma::<S>(goal, goal, size[l]);
            }
        }
        (square, size)
    }
}

/// `image ← A direction`; the curvature `direction · image`.
struct Multiply<'a> {
    patch: &'a Patch,
    direction: &'a [Lanes],
    image: &'a mut [Lanes],
}

impl WithSimd for Multiply<'_> {
    type Output = Lanes;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Lanes {
        let mut curvature = [0f32; WIDTH];
        for k in 0..self.direction.len() {
            let image = row_times::<S>(self.patch, k, self.direction);
            for l in 0..WIDTH {
                curvature[l] = fma::<S>(self.direction[k][l], image[l], curvature[l]);
            }
            self.image[k] = image;
        }
        curvature
    }
}

/// `y += step · direction`, `residual −= step · image`; the square of the new residual.
struct Step<'a> {
    step: Lanes,
    direction: &'a [Lanes],
    image: &'a [Lanes],
    y: &'a mut [Lanes],
    residual: &'a mut [Lanes],
}

impl WithSimd for Step<'_> {
    type Output = Lanes;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Lanes {
        let mut square = [0f32; WIDTH];
        let rows = self.direction.iter().zip(self.image).zip(self.y.iter_mut().zip(self.residual));
        for ((direction, image), (y, residual)) in rows {
            for l in 0..WIDTH {
                y[l] = fma::<S>(self.step[l], direction[l], y[l]);
                residual[l] = fma::<S>(-self.step[l], image[l], residual[l]);
                square[l] = fma::<S>(residual[l], residual[l], square[l]);
            }
        }
        square
    }
}

/// `direction ← residual + ratio · direction`.
struct Turn<'a> {
    ratio: Lanes,
    residual: &'a [Lanes],
    direction: &'a mut [Lanes],
}

impl WithSimd for Turn<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for (residual, direction) in self.residual.iter().zip(self.direction) {
            for l in 0..WIDTH {
                direction[l] = fma::<S>(self.ratio[l], direction[l], residual[l]);
            }
        }
    }
}
