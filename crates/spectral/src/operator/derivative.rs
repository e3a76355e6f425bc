//! What quadratic forms of stiffness and mass gain when vertices move.
//!
//! On an element of volume `V` (of a triangle its area) with the gradients `h_i` of its hat functions,
//! `S_ij = V h_i · h_j` and `M_ij = V q_ij` with constants `q`. Moving a vertex by `v` deforms the element by
//! `∇v = v ⊗ h_i`, and with `K = Σ w x xᵀ` on its corners
//!
//! `∂⟨K, S⟩ / ∂p_i = V (tr T h_i − 2 T h_i)`, `T = Σ_ij K_ij h_i ⊗ h_j`, and `∂⟨N, M⟩ / ∂p_i = V ⟨N, q⟩ h_i`.
//!
//! Triangles in space are no other: to first order a motion out of their plane changes neither.

use std::ops::Range;

use chladni_base::parallel::*;
use chladni_base::{Cancelled, Monitor, Vector3};
use chladni_mesh::intrinsic::TriangleShape;
use chladni_mesh::{TetMesh, TriangleMesh};

use super::MassKind;
use super::volume::shape;
use chladni_algebra::vectorized;

/// What an operator was assembled of.
#[derive(Debug, Clone, Copy)]
pub enum Elements<'a> {
    /// A surface.
    Triangles(&'a TriangleMesh),
    /// A solid.
    Tetrahedra(&'a TetMesh),
}

impl Elements<'_> {
    /// The vertices, `n`.
    pub fn vertices(&self) -> usize {
        match self {
            Self::Triangles(mesh) => mesh.positions.len(),
            Self::Tetrahedra(mesh) => mesh.positions.len(),
        }
    }
}

/// Elements of a task. Fixed, so that results do not depend on the number of threads.
const ELEMENTS_PER_TASK: usize = 4096;

/// Tasks whose parts of the gradient lie in memory at once.
const TASKS_AT_ONCE: usize = 16;

/// Vertices of a task.
const VERTICES_PER_TASK: usize = 1024;

/// Numbers that functions may be given in.
pub(crate) trait Number: bytemuck::Pod + Default + Into<f64> + Send + Sync {}

impl<T: bytemuck::Pod + Default + Into<f64> + Send + Sync> Number for T {}

/// Functions that are added side by side, so that they fit vectors.
const LANES: usize = 8;

/// `Σ_k stiffness_k x_kᵀ S x_k + mass_k x_kᵀ M x_k` of functions that stay as they are, as far as its gradient by the
/// positions of vertices needs it: a few sums for each element and one for each vertex, to which functions are added
/// some at a time. Masses are consistent, or lumped with equal shares of each element.
pub(crate) struct FormSums<'a>(Kind<'a>);

enum Kind<'a> {
    Triangles(&'a TriangleMesh, Sums<'a, 3, 3>),
    Tetrahedra(&'a TetMesh, Sums<'a, 4, 6>),
}

impl<'a> FormSums<'a> {
    pub(crate) fn new(elements: Elements<'a>, mass: MassKind) -> Self {
        let (n, consistent) = (elements.vertices(), mass == MassKind::Consistent);
        Self(match elements {
            Elements::Triangles(mesh) => Kind::Triangles(mesh, Sums::new(&mesh.faces, n, consistent)),
            Elements::Tetrahedra(mesh) => Kind::Tetrahedra(mesh, Sums::new(&mesh.tetrahedra, n, consistent)),
        })
    }

    /// Adds functions: `n` values of each, one after the other.
    pub(crate) fn add<T: Number>(
        &mut self,
        columns: &[T],
        stiffness: &[f64],
        mass: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        match &mut self.0 {
            Kind::Triangles(_, sums) => sums.add(columns, stiffness, mass, monitor),
            Kind::Tetrahedra(_, sums) => sums.add(columns, stiffness, mass, monitor),
        }
    }

    pub(crate) fn gradient(self, monitor: &dyn Monitor) -> Result<Vec<[f64; 3]>, Cancelled> {
        match self.0 {
            Kind::Triangles(mesh, sums) => sums.gradient(|corners| triangle(&mesh.positions, corners), monitor),
            Kind::Tetrahedra(mesh, sums) => sums.gradient(|corners| tetrahedron(&mesh.positions, corners), monitor),
        }
    }
}

/// The sums of elements with `C` corners, and `P` pairs of edges that begin at their first.
struct Sums<'a, const C: usize, const P: usize> {
    elements: &'a [[u32; C]],
    /// `Σ_k stiffness_k d_ik d_jk` for `1 ≤ i ≤ j < C`, where `d_i = x_i − x_0`: as the gradients of hat functions add
    /// up to zero, `T` needs no more.
    edges: Vec<[f64; P]>,
    /// `Σ_k mass_k (Σ_i x_ik)²`; only of a consistent mass.
    totals: Vec<f64>,
    /// `Σ_k mass_k x_k²` at each vertex.
    squares: Vec<f64>,
    /// The functions of the moment, vertex after vertex, whose numbers may be of either type.
    rows: Vec<f64>,
}

/// The volume of an element and the gradients of its hat functions; `None` where it has no volume, and no part in the
/// operator.
type Hats<const C: usize> = Option<(f64, [Vector3; C])>;

impl<'a, const C: usize, const P: usize> Sums<'a, C, P> {
    fn new(elements: &'a [[u32; C]], vertices: usize, consistent: bool) -> Self {
        let totals = vec![0.0; if consistent { elements.len() } else { 0 }];
        let (edges, squares) = (vec![[0.0; P]; elements.len()], vec![0.0; vertices]);
        Self { elements, edges, totals, squares, rows: Vec::new() }
    }

    fn add<T: Number>(
        &mut self,
        columns: &[T],
        stiffness: &[f64],
        mass: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let (n, k) = (self.squares.len(), stiffness.len());
        assert_eq!((mass.len(), columns.len()), (k, k * n), "a value of each function at each vertex");
        if n == 0 {
            return Ok(());
        }
        let groups = k.div_ceil(LANES);
        let padded = |weights: &[f64]| -> Vec<[f64; LANES]> {
            let mut padded = vec![[0.0; LANES]; groups];
            padded.as_flattened_mut()[..k].copy_from_slice(weights);
            padded
        };
        let (stiffness, mass) = (padded(stiffness), padded(mass));
        self.rows.resize((n * groups * LANES * size_of::<T>()).div_ceil(size_of::<f64>()), 0.0);
        let rows = &mut bytemuck::cast_slice_mut::<f64, T>(&mut self.rows)[..n * groups * LANES];
        let (rows, _) = rows.as_chunks_mut::<LANES>();
        let tasks = rows.par_chunks_mut(VERTICES_PER_TASK * groups);
        tasks.zip(self.squares.par_chunks_mut(VERTICES_PER_TASK)).enumerate().for_each(|(task, (rows, squares))| {
            let first = task * VERTICES_PER_TASK;
            transpose(columns, first..first + squares.len(), n, rows);
            vectorized(
                (&*rows, &mut *squares, &mass),
                #[inline(always)]
                |pass| add_squares(pass),
            );
        });
        let rows = &*rows;
        let tasks = self.elements.par_chunks(ELEMENTS_PER_TASK).zip(self.edges.par_chunks_mut(ELEMENTS_PER_TASK));
        tasks.try_for_each(|(elements, edges)| {
            monitor.checkpoint()?;
            vectorized(
                (elements, edges, rows, &stiffness),
                #[inline(always)]
                |pass| add_edges(pass),
            );
            Ok(())
        })?;
        if self.totals.is_empty() {
            return Ok(());
        }
        let tasks = self.elements.par_chunks(ELEMENTS_PER_TASK).zip(self.totals.par_chunks_mut(ELEMENTS_PER_TASK));
        tasks.try_for_each(|(elements, totals)| {
            monitor.checkpoint()?;
            vectorized(
                (elements, totals, rows, &mass),
                #[inline(always)]
                |pass| add_totals(pass),
            );
            Ok(())
        })
    }

    fn gradient(
        self,
        hats: impl Fn(&[u32; C]) -> Hats<C> + Sync,
        monitor: &dyn Monitor,
    ) -> Result<Vec<[f64; 3]>, Cancelled> {
        let mut gradient = vec![Vector3::ZERO; self.squares.len()];
        let at_once = ELEMENTS_PER_TASK * TASKS_AT_ONCE;
        let mut parts = vec![[Vector3::ZERO; C]; self.elements.len().min(at_once)];
        for (at, elements) in self.elements.chunks(at_once).enumerate() {
            let first = at * at_once;
            let parts = &mut parts[..elements.len()];
            parts.par_chunks_mut(ELEMENTS_PER_TASK).enumerate().try_for_each(|(task, parts)| {
                monitor.checkpoint()?;
                for (element, part) in (first + task * ELEMENTS_PER_TASK..).zip(parts) {
                    let hats = hats(&self.elements[element]);
                    *part = hats.map_or([Vector3::ZERO; C], |(volume, hats)| self.part(element, volume, &hats));
                }
                Ok(())
            })?;
            // In the order of the elements, whichever thread was first.
            for (corners, parts) in elements.iter().zip(parts) {
                corners.iter().zip(parts).for_each(|(&vertex, &mut part)| gradient[vertex as usize] += part);
            }
        }
        Ok(gradient.into_iter().map(Vector3::into).collect())
    }

    /// What an element gives its corners.
    fn part(&self, element: usize, volume: f64, hats: &[Vector3; C]) -> [Vector3; C] {
        // T = Σ_ij K_ij h_i ⊗ h_j, symmetric.
        let mut tensor = [[0.0; 3]; 3];
        for ((i, j), &stiff) in pairs::<C>().zip(&self.edges[element]) {
            let half = if i == j { 0.5 } else { 1.0 };
            for (a, row) in tensor.iter_mut().enumerate() {
                for (b, entry) in row.iter_mut().enumerate() {
                    *entry += half * stiff * (hats[i][a] * hats[j][b] + hats[j][a] * hats[i][b]);
                }
            }
        }
        let c = C as f64;
        let squares: f64 = self.elements[element].iter().map(|&vertex| self.squares[vertex as usize]).sum();
        let masses = match self.totals.get(element) {
            Some(total) => (squares + total) / (c * (c + 1.0)),
            None => squares / c,
        };
        let trace = tensor[0][0] + tensor[1][1] + tensor[2][2];
        hats.map(|hat| {
            let turned = Vector3(tensor.map(|row| Vector3(row).dot(hat)));
            volume * ((trace + masses) * hat - 2.0 * turned)
        })
    }
}

/// The pairs `1 ≤ i ≤ j < C`.
fn pairs<const C: usize>() -> impl Iterator<Item = (usize, usize)> {
    (1..C).flat_map(|i| (i..C).map(move |j| (i, j)))
}

/// Writes the values of some vertices, `n` in each column, vertex after vertex, in groups whose last one ends in zeros.
fn transpose<T: Number>(columns: &[T], vertices: Range<usize>, n: usize, rows: &mut [[T; LANES]]) {
    let groups = rows.len() / vertices.len();
    for (group, columns) in columns.chunks(n * LANES).enumerate() {
        let mut sources: [&[T]; LANES] = [&[]; LANES];
        sources
            .iter_mut()
            .zip(columns.chunks_exact(n))
            .for_each(|(source, column)| *source = &column[vertices.clone()]);
        for (vertex, row) in rows.iter_mut().skip(group).step_by(groups).enumerate() {
            *row = sources.map(|source| source.get(vertex).copied().unwrap_or_default());
        }
    }
}

/// The sum, by halves: one after the other they would wait for each other longer than all else takes.
#[inline(always)]
fn total([a, b, c, d, e, f, g, h]: [f64; LANES]) -> f64 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[inline(always)]
fn add_squares<T: Number>((rows, squares, weights): (&[[T; LANES]], &mut [f64], &Vec<[f64; LANES]>)) {
    for (row, square) in rows.chunks_exact(weights.len()).zip(squares) {
        let mut sums = [0.0; LANES];
        for (x, weight) in row.iter().zip(weights) {
            for lane in 0..LANES {
                let x: f64 = x[lane].into();
                sums[lane] += weight[lane] * x * x;
            }
        }
        *square += total(sums);
    }
}

/// Elements, what is summed for each, the functions, and their weights.
type Pass<'a, T, const C: usize, S> = (&'a [[u32; C]], &'a mut [S], &'a [[T; LANES]], &'a Vec<[f64; LANES]>);

#[inline(always)]
fn add_edges<T: Number, const C: usize, const P: usize>((elements, edges, rows, weights): Pass<'_, T, C, [f64; P]>) {
    let groups = weights.len();
    for (corners, edges) in elements.iter().zip(edges) {
        let values = corners.map(|vertex| &rows[vertex as usize * groups..][..groups]);
        let mut sums = [[0.0; LANES]; P];
        for (group, weight) in weights.iter().enumerate() {
            let first = values[0][group];
            let mut steps = [[0.0; LANES]; C];
            for i in 1..C {
                for lane in 0..LANES {
                    steps[i][lane] = values[i][group][lane].into() - first[lane].into();
                }
            }
            let mut pair = 0;
            for i in 1..C {
                for j in i..C {
                    for lane in 0..LANES {
                        sums[pair][lane] += weight[lane] * steps[i][lane] * steps[j][lane];
                    }
                    pair += 1;
                }
            }
        }
        edges.iter_mut().zip(sums).for_each(|(edge, sum)| *edge += total(sum));
    }
}

#[inline(always)]
fn add_totals<T: Number, const C: usize>((elements, totals, rows, weights): Pass<'_, T, C, f64>) {
    let groups = weights.len();
    for (corners, sum) in elements.iter().zip(totals) {
        let values = corners.map(|vertex| &rows[vertex as usize * groups..][..groups]);
        let mut sums = [0.0; LANES];
        for (group, weight) in weights.iter().enumerate() {
            for lane in 0..LANES {
                let x: f64 = values.iter().map(|value| value[group][lane].into()).sum();
                sums[lane] += weight[lane] * x * x;
            }
        }
        *sum += total(sums);
    }
}

fn triangle(positions: &[[f64; 3]], corners: &[u32; 3]) -> Hats<3> {
    let p = corners.map(|v| Vector3(positions[v as usize]));
    // What the operator takes for flat has no part in it.
    let area = TriangleShape::of_corners(p).area;
    let edges: [Vector3; 3] = std::array::from_fn(|k| p[(k + 2) % 3] - p[(k + 1) % 3]);
    let normal = edges[0].cross(edges[1]);
    let square = normal.norm_squared();
    (area > 0.0 && square > 0.0).then(|| (area, edges.map(|edge| normal.cross(edge) / square)))
}

fn tetrahedron(positions: &[[f64; 3]], corners: &[u32; 4]) -> Hats<4> {
    let p = corners.map(|v| Vector3(positions[v as usize]));
    let (six, gradients) = shape(p);
    // The gradients are those over six volumes with their sign, which products of two have not.
    let signed = (p[1] - p[0]).dot(gradients[1]);
    (six > 0.0).then(|| (six / 6.0, gradients.map(|gradient| gradient / signed)))
}
