//! What smooths columns: heat steps by conjugate gradients, multigrid cycles, and a Chebyshev polynomial. All on the
//! pattern of a column, zero outside, for its `B` right-hand sides at once, in single precision.

use chladni_algebra::{BlockMatrix, inverse_positive, vectorized};
use chladni_base::parallel::*;

use super::hierarchy::{FieldLevel, norm, row_scales};
use super::space::Column;

/// Iterations of a heat step at most; where they do not suffice the column is as smooth as they made it.
const MOST_ITERATIONS: usize = 1000;

/// Multigrid cycles of a heat step at most.
const MOST_CYCLES: usize = 30;

/// Degree of the smoother before and after a coarse correction, and the lower end of what it damps, where the spectrum
/// ends at 2.
pub(super) const CYCLE_DEGREE: usize = 2;
pub(super) const CYCLE_LEAST: f32 = 0.2;

/// Relative residual of the solve on the coarsest level.
const COARSE_TOLERANCE: f64 = 0.05;

pub(super) type Small<const B: usize> = [[f32; B]; B];

/// A matrix of single-precision blocks.
pub(super) struct Rows<const B: usize> {
    pub offsets: Vec<u32>,
    pub indices: Vec<u32>,
    pub blocks: Vec<Small<B>>,
}

impl<const B: usize> Rows<B> {
    fn new(matrix: &BlockMatrix<B>, value: impl Fn(usize) -> Small<B> + Send + Sync) -> Self {
        Self {
            offsets: matrix.offsets().iter().map(|&o| o as u32).collect(),
            indices: matrix.indices().to_vec(),
            blocks: (0..matrix.entries()).into_par_iter().with_min_len(1 << 14).map(value).collect(),
        }
    }

    pub fn of(matrix: &BlockMatrix<B>) -> Self {
        Self::new(matrix, |e| matrix.blocks()[e].map(|row| row.map(|x| x as f32)))
    }

    /// Where the entries of a row are.
    #[inline(always)]
    pub fn range(&self, row: usize) -> std::ops::Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// The bytes that it takes.
    pub fn bytes(&self) -> u64 {
        (4 * (self.offsets.len() + self.indices.len()) + size_of::<Small<B>>() * self.blocks.len()) as u64
    }

    /// Numbers by which rows are to be divided so that the spectrum ends at 2.
    fn scales(&self) -> Vec<f32> {
        (0..self.offsets.len() - 1)
            .into_par_iter()
            .with_min_len(1 << 12)
            .map(|row| {
                let norms = self.blocks[self.range(row)].iter().map(|block| norm(&block.map(|row| row.map(f64::from))));
                (0.5 * norms.sum::<f64>()) as f32
            })
            .collect()
    }

    /// `y = A x` in some rows; `x` is as long as the matrix has columns.
    fn multiply(&self, rows: &[u32], x: &[Small<B>], y: &mut [Small<B>]) {
        vectorized(
            y,
            #[inline(always)]
            |y| {
                for (&row, y) in rows.iter().zip(y) {
                    *y = self.row(row, x);
                }
            },
        );
    }

    #[inline(always)]
    fn row(&self, row: u32, x: &[Small<B>]) -> Small<B> {
        let range = self.range(row as usize);
        let mut sum = [[0f32; B]; B];
        for (&column, block) in self.indices[range.clone()].iter().zip(&self.blocks[range]) {
            if let Some(x) = x.get(column as usize) {
                for i in 0..B {
                    for k in 0..B {
                        for j in 0..B {
                            sum[i][j] += block[i][k] * x[k][j];
                        }
                    }
                }
            }
        }
        sum
    }
}

/// `M + τS` on a level, and what preconditions it.
struct HeatStep<const B: usize> {
    system: Rows<B>,
    inverse_diagonal: Vec<Small<B>>,
}

impl<const B: usize> HeatStep<B> {
    fn new(level: &FieldLevel<B>, time: f64) -> Self {
        // The pattern of the mass lies within that of the stiffness.
        let mut owner = vec![0u32; level.stiffness.entries()];
        for row in 0..level.stiffness.rows() {
            owner[level.stiffness.offsets()[row]..level.stiffness.offsets()[row + 1]].fill(row as u32);
        }
        let system = Rows::new(&level.stiffness, |entry| {
            let (columns, blocks) = level.mass.row(owner[entry] as usize);
            let mass = columns.binary_search(&level.stiffness.indices()[entry]).ok().map(|at| &blocks[at]);
            let own = &level.stiffness.blocks()[entry];
            std::array::from_fn(|i| std::array::from_fn(|j| (mass.map_or(0.0, |m| m[i][j]) + time * own[i][j]) as f32))
        });
        let masses = level.mass.diagonal();
        let inverse_diagonal = level
            .stiffness
            .diagonal()
            .iter()
            .zip(&masses)
            .map(|(s, m)| {
                let sum = std::array::from_fn(|i| std::array::from_fn(|j| m[i][j] + time * s[i][j]));
                inverse_positive(&sum).map(|row| row.map(|x| x as f32))
            })
            .collect();
        Self { system, inverse_diagonal }
    }

    /// Improves `x` on some nodes; what `scratch` holds on them is overwritten.
    fn solve(
        &self,
        nodes: &[u32],
        x: &mut [Small<B>],
        rhs: &[Small<B>],
        scratch: &mut [Small<B>],
        tolerance: f64,
        most: usize,
    ) {
        let multiply = |scratch: &mut &mut [Small<B>], v: &[Small<B>], into: &mut [Small<B>]| {
            apply(&self.system, nodes, v, scratch, into);
        };
        let precondition = |_: &mut &mut [Small<B>], r: &[Small<B>]| self.precondition(nodes, r);
        let size = inner(rhs, &self.precondition(nodes, rhs));
        conjugate_gradients(
            &mut { scratch },
            multiply,
            precondition,
            x,
            rhs,
            size.map(|s| s * tolerance * tolerance),
            most,
        );
    }

    fn precondition(&self, nodes: &[u32], residual: &[Small<B>]) -> Vec<Small<B>> {
        nodes
            .iter()
            .zip(residual)
            .map(|(&node, r)| {
                let inverse = &self.inverse_diagonal[node as usize];
                std::array::from_fn(|i| std::array::from_fn(|c| (0..B).map(|k| inverse[i][k] * r[k][c]).sum()))
            })
            .collect()
    }
}

/// Inner products column by column.
fn inner<const B: usize>(a: &[Small<B>], b: &[Small<B>]) -> [f64; B] {
    let mut total = [0.0; B];
    for (a, b) in a.chunks(64).zip(b.chunks(64)) {
        let mut sum = [0f32; B];
        for (a, b) in a.iter().zip(b) {
            for i in 0..B {
                for c in 0..B {
                    sum[c] += a[i][c] * b[i][c];
                }
            }
        }
        for c in 0..B {
            total[c] += f64::from(sum[c]);
        }
    }
    total
}

/// `a −= b · diag(factor)`.
fn subtract<const B: usize>(a: &mut [Small<B>], b: &[Small<B>], factor: [f32; B]) {
    for (a, b) in a.iter_mut().zip(b) {
        for i in 0..B {
            for c in 0..B {
                a[i][c] -= factor[c] * b[i][c];
            }
        }
    }
}

/// A Chebyshev polynomial in the scaled stiffness that is 1 at 0 and small on the upper part of the spectrum.
pub(super) struct Smoother<const B: usize> {
    stiffness: Rows<B>,
    inverse_scales: Vec<f32>,
    degree: usize,
    least: f32,
}

impl<const B: usize> Smoother<B> {
    pub fn new(level: &FieldLevel<B>, degree: usize, least: f64, time: f64) -> Self {
        let masses = level.mass.diagonal();
        // Where faces are large there is nothing to smooth: no step may take longer than a part of the heat steps.
        let slowest = 0.1 * time;
        let inverse_scales = row_scales(&level.stiffness)
            .iter()
            .zip(&masses)
            .map(|(&scale, mass)| {
                let scale = scale.max(mass[0][0] / slowest);
                if scale > 0.0 && scale.is_finite() { (1.0 / scale) as f32 } else { 0.0 }
            })
            .collect();
        Self { stiffness: Rows::of(&level.stiffness), inverse_scales, degree, least: least as f32 }
    }

    /// Smooths a column on its own pattern, zero outside. `scratch` is zero before and after.
    pub fn smooth(&self, column: &mut Column<B>, scratch: &mut [Small<B>]) {
        let nodes = &column.faces;
        nodes.iter().zip(&column.blocks).for_each(|(&node, v)| scratch[node as usize] = *v);
        let mut product = vec![[[0f32; B]; B]; nodes.len()];
        let mut change = vec![[[0f32; B]; B]; nodes.len()];
        for (keep, add) in chebyshev(self.degree, self.least) {
            self.stiffness.multiply(nodes, scratch, &mut product);
            for ((&node, change), product) in nodes.iter().zip(&mut change).zip(&product) {
                let add = add * self.inverse_scales[node as usize];
                let x = &mut scratch[node as usize];
                for i in 0..B {
                    for c in 0..B {
                        change[i][c] = keep * change[i][c] - add * product[i][c];
                        x[i][c] += change[i][c];
                    }
                }
            }
        }
        for (&node, block) in nodes.iter().zip(&mut column.blocks) {
            *block = std::mem::replace(&mut scratch[node as usize], [[0.0; B]; B]);
        }
    }
}

/// `into = A v` on some nodes. What `scratch` held on them is overwritten.
fn apply<const B: usize>(
    rows: &Rows<B>,
    nodes: &[u32],
    v: &[Small<B>],
    scratch: &mut [Small<B>],
    into: &mut [Small<B>],
) {
    nodes.iter().zip(v).for_each(|(&node, v)| scratch[node as usize] = *v);
    rows.multiply(nodes, scratch, into);
}

/// Preconditioned conjugate gradients, each of the `B` right-hand sides with its own coefficients, until the squared
/// norm of each residual is below its limit.
fn conjugate_gradients<const B: usize, C>(
    context: &mut C,
    multiply: impl Fn(&mut C, &[Small<B>], &mut [Small<B>]),
    precondition: impl Fn(&mut C, &[Small<B>]) -> Vec<Small<B>>,
    x: &mut [Small<B>],
    rhs: &[Small<B>],
    limit: [f64; B],
    most: usize,
) {
    let mut product = vec![[[0f32; B]; B]; x.len()];
    multiply(context, x, &mut product);
    let mut residual = rhs.to_vec();
    subtract(&mut residual, &product, [1.0; B]);
    let mut scaled = precondition(context, &residual);
    let mut rz = inner(&residual, &scaled);
    let mut direction = scaled.clone();
    for iteration in 0..most {
        if (0..B).all(|c| rz[c] <= limit[c]) {
            break;
        }
        multiply(context, &direction, &mut product);
        let curvature = inner(&direction, &product);
        let step = std::array::from_fn(|c| if curvature[c] > 0.0 { (rz[c] / curvature[c]) as f32 } else { 0.0 });
        subtract(x, &direction, step.map(|s: f32| -s));
        if iteration + 1 == most {
            break;
        }
        subtract(&mut residual, &product, step);
        scaled = precondition(context, &residual);
        let next = inner(&residual, &scaled);
        let ratio: [f32; B] = std::array::from_fn(|c| if rz[c] > 0.0 { (next[c] / rz[c]) as f32 } else { 0.0 });
        rz = next;
        for (d, z) in direction.iter_mut().zip(&scaled) {
            for i in 0..B {
                for c in 0..B {
                    d[i][c] = z[i][c] + ratio[c] * d[i][c];
                }
            }
        }
    }
}

/// Heat steps on the faces, by conjugate gradients with multigrid cycles as preconditioner.
pub(super) struct Heat<'a, const B: usize> {
    levels: &'a [FieldLevel<B>],
    steps: Vec<CycleLevel<B>>,
    coarsest: HeatStep<B>,
    mass: Vec<f32>,
}

/// What a cycle needs on all levels but the coarsest.
struct CycleLevel<const B: usize> {
    system: Rows<B>,
    inverse_scales: Vec<f32>,
    interpolation: Rows<B>,
    restriction: Rows<B>,
}

/// Vectors on all nodes of all levels, zero between uses.
pub(super) struct Scratch<const B: usize> {
    vectors: Vec<Vec<Small<B>>>,
    /// The nodes of the patch at hand on each level.
    nodes: Vec<Vec<u32>>,
    /// For each level the patch in which a node was met last.
    met: Vec<Vec<u32>>,
    patch: u32,
}

impl<'a, const B: usize> Heat<'a, B> {
    /// Steps of some length on the finest of one level or more.
    pub fn new(levels: &'a [FieldLevel<B>], time: f64) -> Self {
        let steps = levels
            .windows(2)
            .filter_map(|pair| {
                let interpolation = &pair[1].interpolation.as_ref()?.matrix;
                let HeatStep { system, .. } = HeatStep::new(&pair[0], time);
                let inverse_scales = system.scales().iter().map(|s| if *s > 0.0 { 1.0 / s } else { 0.0 }).collect();
                let restriction = Rows::of(&interpolation.transpose());
                Some(CycleLevel { system, inverse_scales, interpolation: Rows::of(interpolation), restriction })
            })
            .collect();
        let mass = levels[0].mass.blocks().iter().map(|b| b[0][0] as f32).collect();
        let coarsest = HeatStep::new(&levels[levels.len() - 1], time);
        Self { levels, steps, coarsest, mass }
    }

    /// Room for one thread.
    pub fn scratch(&self) -> Scratch<B> {
        Scratch {
            vectors: self.levels.iter().map(|l| vec![[[0f32; B]; B]; l.roots.len()]).collect(),
            nodes: vec![Vec::new(); self.levels.len()],
            met: self.levels.iter().map(|l| vec![0; l.roots.len()]).collect(),
            patch: 0,
        }
    }

    /// One heat step for a column on its own pattern, zero outside.
    pub fn step(&self, column: &mut Column<B>, scratch: &mut Scratch<B>, tolerance: f64) {
        let faces = &column.faces;
        let mut rhs = column.blocks.clone();
        for (&face, v) in faces.iter().zip(&mut rhs) {
            let mass = self.mass[face as usize];
            v.as_flattened_mut().iter_mut().for_each(|x| *x *= mass);
        }
        if self.steps.is_empty() {
            self.coarsest.solve(faces, &mut column.blocks, &rhs, &mut scratch.vectors[0], tolerance, MOST_ITERATIONS);
        } else {
            self.enter(faces, scratch);
            let multiply = |scratch: &mut Scratch<B>, v: &[Small<B>], into: &mut [Small<B>]| {
                apply(&self.steps[0].system, faces, v, &mut scratch.vectors[0], into);
            };
            let precondition = |scratch: &mut Scratch<B>, r: &[Small<B>]| self.cycle(0, r, scratch);
            // The norm that the preconditioner gives residuals is that of errors in energy: x is near enough to scale
            // it.
            let limit = inner(&rhs, &column.blocks).map(|s| s.abs() * tolerance * tolerance);
            conjugate_gradients(scratch, multiply, precondition, &mut column.blocks, &rhs, limit, MOST_CYCLES);
            for level in 1..self.levels.len() {
                let (vectors, nodes) = (&mut scratch.vectors[level], &scratch.nodes[level]);
                nodes.iter().for_each(|&node| vectors[node as usize] = [[0.0; B]; B]);
            }
        }
        faces.iter().for_each(|&face| scratch.vectors[0][face as usize] = [[0.0; B]; B]);
    }

    /// Finds the nodes above some faces on all levels.
    fn enter(&self, faces: &[u32], scratch: &mut Scratch<B>) {
        scratch.patch += 1;
        scratch.nodes[0] = faces.to_vec();
        for level in 1..self.levels.len() {
            let (finer, coarser) = scratch.nodes.split_at_mut(level);
            let (nodes, met) = (&mut coarser[0], &mut scratch.met[level]);
            nodes.clear();
            let Some(interpolation) = &self.levels[level].interpolation else { continue };
            for &fine in &finer[level - 1] {
                let above = interpolation.node_of(fine);
                if met[above as usize] != scratch.patch {
                    met[above as usize] = scratch.patch;
                    nodes.push(above);
                }
            }
            nodes.sort_unstable();
        }
    }

    /// An approximate solution of `A z = r` on the patch.
    fn cycle(&self, level: usize, r: &[Small<B>], scratch: &mut Scratch<B>) -> Vec<Small<B>> {
        let mut z = vec![[[0f32; B]; B]; r.len()];
        let Some(step) = self.steps.get(level) else {
            let (nodes, vector) = (&scratch.nodes[level], &mut scratch.vectors[level]);
            self.coarsest.solve(nodes, &mut z, r, vector, COARSE_TOLERANCE, 60);
            return z;
        };
        let nodes = std::mem::take(&mut scratch.nodes[level]);
        step.smooth(&nodes, &mut z, r, &mut scratch.vectors[level], true);
        let mut residual = vec![[[0f32; B]; B]; r.len()];
        apply(&step.system, &nodes, &z, &mut scratch.vectors[level], &mut residual);
        // b − A z with the sign turned, which the correction turns back.
        subtract(&mut residual, r, [1.0; B]);
        nodes.iter().zip(&residual).for_each(|(&node, v)| scratch.vectors[level][node as usize] = *v);
        let mut coarse = vec![[[0f32; B]; B]; scratch.nodes[level + 1].len()];
        step.restriction.multiply(&scratch.nodes[level + 1], &scratch.vectors[level], &mut coarse);
        let correction = self.cycle(level + 1, &coarse, scratch);
        let above = &mut scratch.vectors[level + 1];
        scratch.nodes[level + 1].iter().zip(&correction).for_each(|(&node, v)| above[node as usize] = *v);
        step.interpolation.multiply(&nodes, above, &mut residual);
        subtract(&mut z, &residual, [1.0; B]);
        step.smooth(&nodes, &mut z, r, &mut scratch.vectors[level], false);
        scratch.nodes[level] = nodes;
        z
    }
}

impl<const B: usize> CycleLevel<B> {
    /// Chebyshev steps towards `A z = r`; `zero` says that `z` is.
    fn smooth(&self, nodes: &[u32], z: &mut [Small<B>], r: &[Small<B>], scratch: &mut [Small<B>], zero: bool) {
        let mut product = vec![[[0f32; B]; B]; nodes.len()];
        let mut change = vec![[[0f32; B]; B]; nodes.len()];
        for (step, (keep, add)) in chebyshev(CYCLE_DEGREE, CYCLE_LEAST).enumerate() {
            if step > 0 || !zero {
                apply(&self.system, nodes, z, scratch, &mut product);
            }
            for at in 0..nodes.len() {
                let add = add * self.inverse_scales[nodes[at] as usize];
                for i in 0..B {
                    for c in 0..B {
                        change[at][i][c] = keep * change[at][i][c] + add * (r[at][i][c] - product[at][i][c]);
                        z[at][i][c] += change[at][i][c];
                    }
                }
            }
        }
    }
}

/// What a Chebyshev step keeps of the last change and adds of the scaled residual; the spectrum ends at 2, its part
/// above `least` is damped.
pub(super) fn chebyshev(degree: usize, least: f32) -> impl Iterator<Item = (f32, f32)> {
    let (middle, half) = (0.5 * (2.0 + least), 0.5 * (2.0 - least));
    let mut ratio = half / middle;
    (0..degree).map(move |step| {
        if step == 0 {
            return (0.0, 1.0 / middle);
        }
        let next = 1.0 / (2.0 * middle / half - ratio);
        let factors = (next * ratio, 2.0 * next / half);
        ratio = next;
        factors
    })
}
