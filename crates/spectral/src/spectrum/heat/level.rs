//! One level of the hierarchy: a weighted graph with masses, in single precision and on unit area.

use chladni_base::parallel::*;

use super::HeatError;
use super::coarsen::{Surface, element_weights};
use crate::operator::{EigenProblem, LaplacianByRows, MassMatrix};
use chladni_mesh::connectivity::Connectivity;

/// Weights on fair triangles are about 1; one of this size leaves no digit of a mass of 1e-6 in single precision.
const STIFF: f32 = 1e4;

/// A weighted graph: the finest one holds the mesh, coarser ones its aggregates.
///
/// The stiffness is `diagonal[i]` on the diagonal and `−weights` off it; neighbours of a vertex ascend.
pub(super) struct HeatLevel {
    pub offsets: Vec<u32>,
    pub neighbours: Vec<u32>,
    pub weights: Vec<f32>,
    pub lengths: Vec<f32>,
    pub diagonal: Vec<f32>,
    pub mass: Vec<f32>,
}

impl HeatLevel {
    /// The mesh itself: the stiffness and lumped mass of `problem` and the lengths of `connectivity` over √area. An
    /// entry that only one of the two knows gets weight 0, or a length that no path takes.
    pub fn finest(problem: &EigenProblem, connectivity: &Connectivity) -> Result<Self, HeatError> {
        let n = problem.stiffness.rows();
        if !(problem.area > 0.0 && problem.area.is_finite()) {
            return Err(HeatError::NotFinite { row: 0 });
        }
        let scale = 1.0 / problem.area.sqrt();
        let rows_per_chunk = 8192;
        let chunks: Vec<Self> = (0..n.div_ceil(rows_per_chunk))
            .into_par_iter()
            .map(|chunk| {
                let rows = chunk * rows_per_chunk..((chunk + 1) * rows_per_chunk).min(n);
                Self::merge(problem, connectivity, rows, scale)
            })
            .collect::<Result<_, _>>()?;
        Ok(Self::concatenate(chunks))
    }

    /// The same of a problem without its matrix, by the edges of the mesh, which serve no one else, and its rows, a run
    /// of so many at a time.
    pub fn finest_by_rows(problem: &LaplacianByRows<'_>, connectivity: Connectivity) -> Result<Self, HeatError> {
        const ROWS: usize = 1 << 19;
        let n = problem.size();
        let area = problem.area();
        if !(area > 0.0 && area.is_finite()) {
            return Err(HeatError::NotFinite { row: 0 });
        }
        let scale = 1.0 / area.sqrt();
        let (offsets, neighbours, of_input) = connectivity.into_edges();
        let lengths = of_input.par_iter().map(|length| (length * scale) as f32).collect();
        drop(of_input);
        let mass: Vec<f32> = problem.masses().iter().map(|mass| mass.max(0.0) as f32).collect();
        let (mut weights, mut diagonal) = (vec![-0.0f32; neighbours.len()], vec![0f32; n]);
        for from in (0..n).step_by(ROWS) {
            let rows: Vec<u32> = (from as u32..n.min(from + ROWS) as u32).collect();
            let stiffness = problem.rows(&rows);
            for (at, &row) in rows.iter().enumerate() {
                let row = row as usize;
                let edges = offsets[row] as usize..offsets[row + 1] as usize;
                let mut finite = mass[row].is_finite();
                let (columns, values) = stiffness.row(at);
                for (&column, &value) in columns.iter().zip(values) {
                    finite &= value.is_finite();
                    if column as usize == row {
                        diagonal[row] = value as f32;
                    } else if let Ok(edge) = neighbours[edges.clone()].binary_search(&column) {
                        weights[edges.start + edge] = -value as f32;
                    }
                }
                if !finite {
                    return Err(HeatError::NotFinite { row });
                }
            }
        }
        Ok(Self { offsets, neighbours, weights, lengths, diagonal, mass })
    }

    /// A level without vertices.
    pub fn empty() -> Self {
        Self {
            offsets: vec![0],
            neighbours: Vec::new(),
            weights: Vec::new(),
            lengths: Vec::new(),
            diagonal: Vec::new(),
            mass: Vec::new(),
        }
    }

    /// Levels that hold consecutive rows, as one.
    pub fn concatenate(parts: Vec<Self>) -> Self {
        let vertices: usize = parts.iter().map(|part| part.diagonal.len()).sum();
        let mut offsets = Vec::with_capacity(vertices + 1);
        let mut base = 0;
        offsets.push(base);
        for part in &parts {
            offsets.extend(part.offsets[1..].iter().map(|offset| base + offset));
            base += part.neighbours.len() as u32;
        }
        Self {
            offsets,
            neighbours: joined(&parts, |part| &part.neighbours),
            weights: joined(&parts, |part| &part.weights),
            lengths: joined(&parts, |part| &part.lengths),
            diagonal: joined(&parts, |part| &part.diagonal),
            mass: joined(&parts, |part| &part.mass),
        }
    }

    /// The number of vertices.
    pub fn vertices(&self) -> usize {
        self.diagonal.len()
    }

    /// Where the neighbours of a vertex lie.
    #[inline]
    pub fn edges(&self, vertex: usize) -> std::ops::Range<usize> {
        self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize
    }

    /// Whether some weight is so large that single precision cannot tell the mass of its vertices beside it.
    pub fn is_stiff(&self) -> bool {
        self.weights.iter().any(|weight| weight.abs() > STIFF)
    }

    /// Takes the weights of the triangles of `surface` in place of its own, with an area for flat ones that keeps
    /// weights below 25: functions are only smoothed with them. Edges of no triangle keep what they have, up to that.
    pub fn take_weights(&mut self, surface: Surface) {
        let mut sums: Vec<Option<f64>> = vec![None; self.weights.len()];
        for &triangle in surface.triangles {
            let weights = element_weights(triangle.map(|v| surface.positions[v as usize]));
            for k in 0..3 {
                let (a, b) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                for (from, to) in [(a, b), (b, a)] {
                    let edges = self.edges(from as usize);
                    if let Ok(at) = self.neighbours[edges.clone()].binary_search(&to) {
                        *sums[edges.start + at].get_or_insert(0.0) += weights[k];
                    }
                }
            }
        }
        for (weight, sum) in self.weights.iter_mut().zip(sums) {
            *weight = sum.map_or(weight.clamp(0.0, 25.0), |sum| sum as f32);
        }
        for v in 0..self.vertices() {
            self.diagonal[v] = self.edges(v).map(|edge| f64::from(self.weights[edge])).sum::<f64>() as f32;
        }
    }

    /// A run of rows of the finest level.
    fn merge(
        problem: &EigenProblem,
        connectivity: &Connectivity,
        rows: std::ops::Range<usize>,
        scale: f64,
    ) -> Result<Self, HeatError> {
        let mut chunk = Self::empty();
        chunk.neighbours.reserve(7 * rows.len());
        chunk.weights.reserve(7 * rows.len());
        chunk.lengths.reserve(7 * rows.len());
        for row in rows {
            let (indices, values) = problem.stiffness.row(row);
            let (ring, lengths) = connectivity.neighbours(row as u32);
            let (mut s, mut c) = (0, 0);
            let mut diagonal = 0.0;
            let mut finite = true;
            while s < indices.len() || c < ring.len() {
                let left = indices.get(s).copied().unwrap_or(u32::MAX);
                let right = ring.get(c).copied().unwrap_or(u32::MAX);
                let vertex = left.min(right);
                let (mut weight, mut length) = (0.0, f32::INFINITY);
                if left == vertex {
                    weight = values[s];
                    finite &= weight.is_finite();
                    s += 1;
                }
                if right == vertex {
                    length = (lengths[c] * scale) as f32;
                    c += 1;
                }
                if vertex as usize == row {
                    diagonal = weight;
                } else {
                    chunk.neighbours.push(vertex);
                    chunk.weights.push(-weight as f32);
                    chunk.lengths.push(length);
                }
            }
            let mass = lumped(&problem.mass, row);
            if !(finite && mass.is_finite()) {
                return Err(HeatError::NotFinite { row });
            }
            chunk.offsets.push(chunk.neighbours.len() as u32);
            chunk.diagonal.push(diagonal as f32);
            chunk.mass.push(mass.max(0.0) as f32);
        }
        Ok(chunk)
    }
}

/// The lists of all parts, one after the other.
fn joined<T: Copy + Default + Send + Sync>(parts: &[HeatLevel], list: impl Fn(&HeatLevel) -> &Vec<T>) -> Vec<T> {
    let lists: Vec<&Vec<T>> = parts.iter().map(list).collect();
    let mut all = vec![T::default(); lists.iter().map(|list| list.len()).sum()];
    let mut free = all.as_mut_slice();
    let mut targets = Vec::with_capacity(lists.len());
    for list in lists {
        let own;
        (own, free) = std::mem::take(&mut free).split_at_mut(list.len());
        targets.push((list, own));
    }
    targets.into_par_iter().for_each(|(list, own)| own.copy_from_slice(list));
    all
}

fn lumped(mass: &MassMatrix, row: usize) -> f64 {
    match mass {
        MassMatrix::Diagonal(diagonal) => diagonal[row],
        MassMatrix::Sparse(matrix) => matrix.row(row).1.iter().sum(),
        MassMatrix::Weighted(mass) => mass.weights[row],
    }
}
