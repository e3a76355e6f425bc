//! Vibration modes: eigenfunctions with three numbers a vertex, kept compactly or densely.

use chladni_algebra::{DenseMatrix, SparseMatrix};
use chladni_base::parallel::*;

use super::{BasisError, Provenance};

/// Stands for the part of a vertex that never moves.
pub const FIXED: u32 = u32::MAX;

/// `m` modes of an elastic object of `n` vertices, orthonormal for its mass: `Σ_v m_v ⟨φ_i(v), φ_j(v)⟩ = δ_ij`.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalBasis {
    /// `m` squared angular frequencies `λ = ω²`, ascending, in 1/time²; exactly 0 for rigid motions.
    pub eigenvalues: Vec<f64>,
    /// How many of the first modes are rigid motions, known exactly.
    pub rigid: usize,
    /// The mass of each of the `n` vertices, held ones among them; some stored bases have 0 for these.
    pub masses: Vec<f64>,
    /// The connected part that each vertex belongs to, [`FIXED`] where it never moves.
    pub part: Vec<u32>,
    /// Where each vertex is at rest, about the centre of mass and over [`length`](Self::length).
    pub rest: Vec<[f32; 3]>,
    /// The unit of `rest`.
    pub length: f64,
    /// A motion `A (1, x)` of every part, part after part, `12 parts × m`: row `12 part + 4 axis + k` has the factor of
    /// the k-th of `(1, x, y, z)`, positions as in `rest`.
    pub affine: DenseMatrix,
    /// What is added to it.
    pub functions: ModalFunctions,
    /// Per mode `‖Kφ − λMφ‖` in the norm of `M⁻¹`: an exact eigenvalue lies within that distance of `λ`.
    pub bounds: Vec<f64>,
    /// How the modes were made.
    pub metadata: Provenance,
}

/// The part of the modes that is no motion of a whole part.
#[derive(Debug, Clone, PartialEq)]
pub enum ModalFunctions {
    /// `(U ⊗ I₃) φ̄`.
    Compact {
        /// `U`, `n × d`.
        space: SparseMatrix<f32>,
        /// `φ̄`, `3d × m`; row `3 j + axis` belongs to column j of `U`.
        coefficients: DenseMatrix,
    },
    /// The values themselves, `3n × m`, mode after mode; row `3 v + axis` belongs to vertex v.
    Dense(Vec<f32>),
}

impl ModalBasis {
    /// The number of vertices, `n`.
    pub fn vertices(&self) -> usize {
        self.masses.len()
    }

    /// The number of modes, `m`.
    pub fn count(&self) -> usize {
        self.eigenvalues.len()
    }

    /// The dimension `3d` of the space of a compact basis, whole motions left out.
    pub fn dimension(&self) -> Option<usize> {
        match &self.functions {
            ModalFunctions::Compact { coefficients, .. } => Some(coefficients.rows()),
            ModalFunctions::Dense(_) => None,
        }
    }

    /// Frequencies in 1/time: `√λ / 2π`.
    pub fn frequencies(&self) -> Vec<f64> {
        self.eigenvalues.iter().map(|&value| value.max(0.0).sqrt() / std::f64::consts::TAU).collect()
    }

    /// The displacement of one vertex by each of the `m` modes.
    ///
    /// # Errors
    /// [`BasisError::Rows`] where there is no such vertex.
    pub fn at(&self, vertex: usize) -> Result<Vec<[f64; 3]>, BasisError> {
        let (m, n) = (self.count(), self.vertices());
        if vertex >= n {
            return Err(BasisError::Rows { found: vertex, expected: n });
        }
        let mut values = vec![[0.0; 3]; m];
        if self.part[vertex] == FIXED {
            return Ok(values);
        }
        let x = self.rest[vertex].map(f64::from);
        for (mode, value) in values.iter_mut().enumerate() {
            let affine = &self.affine.column(mode)[12 * self.part[vertex] as usize..][..12];
            *value = std::array::from_fn(|axis| {
                let [one, a, b, c] = [0, 1, 2, 3].map(|k| affine[4 * axis + k]);
                one + a * x[0] + b * x[1] + c * x[2]
            });
            match &self.functions {
                ModalFunctions::Compact { space, coefficients } => {
                    let (columns, weights) = space.row(vertex);
                    let coefficients = coefficients.column(mode);
                    for (&column, &weight) in columns.iter().zip(weights) {
                        (0..3).for_each(|axis| {
                            value[axis] += f64::from(weight) * coefficients[3 * column as usize + axis]
                        });
                    }
                }
                ModalFunctions::Dense(functions) => {
                    let there = &functions[3 * (mode * n + vertex)..][..3];
                    (0..3).for_each(|axis| value[axis] += f64::from(there[axis]));
                }
            }
        }
        Ok(values)
    }

    /// `Φᵀ w` for one vector for each of the `n` vertices: `m` numbers.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless there is a vector for each vertex.
    pub fn transposed_times(&self, w: &[[f64; 3]]) -> Result<Vec<f64>, BasisError> {
        let n = self.vertices();
        if w.len() != n {
            return Err(BasisError::Rows { found: w.len(), expected: n });
        }
        let mut affine = vec![0.0; self.affine.rows()];
        for (v, w) in w.iter().enumerate().filter(|(v, _)| self.part[*v] != FIXED) {
            let x = self.rest[v].map(f64::from);
            let into = &mut affine[12 * self.part[v] as usize..][..12];
            for axis in 0..3 {
                into[4 * axis] += w[axis];
                (0..3).for_each(|k| into[4 * axis + 1 + k] += w[axis] * x[k]);
            }
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut products: Vec<f64> = (0..self.count()).map(|mode| dot(self.affine.column(mode), &affine)).collect();
        match &self.functions {
            ModalFunctions::Compact { space, coefficients } => {
                let mut reduced = vec![0.0; coefficients.rows()];
                for (v, w) in w.iter().enumerate() {
                    let (columns, weights) = space.row(v);
                    for (&column, &weight) in columns.iter().zip(weights) {
                        (0..3).for_each(|axis| reduced[3 * column as usize + axis] += f64::from(weight) * w[axis]);
                    }
                }
                let add = |(mode, product): (usize, &mut f64)| *product += dot(coefficients.column(mode), &reduced);
                products.par_iter_mut().enumerate().for_each(add);
            }
            ModalFunctions::Dense(functions) if n > 0 => {
                let flat = w.as_flattened();
                let add = |(product, mode): (&mut f64, &[f32])| {
                    *product += mode.iter().zip(flat).map(|(a, b)| f64::from(*a) * b).sum::<f64>();
                };
                products.par_iter_mut().zip(functions.par_chunks(3 * n)).for_each(add);
            }
            ModalFunctions::Dense(_) => {}
        }
        Ok(products)
    }

    /// What lifts many states quickly.
    pub fn lifter(&self) -> ModalLifter<'_> {
        ModalLifter::new(self)
    }

    /// About the bytes that the modes take as stored.
    pub fn stored_bytes(&self) -> u64 {
        let (n, m) = (self.vertices() as u64, self.count() as u64);
        let functions = match &self.functions {
            ModalFunctions::Compact { space, coefficients } => {
                8 * space.entries() as u64 + 4 * (n + 1) + 8 * coefficients.values().len() as u64
            }
            ModalFunctions::Dense(values) => 4 * values.len() as u64,
        };
        functions + 8 * self.affine.values().len() as u64 + 24 * n + 16 * m
    }

    /// Bytes that the modes would take as a dense matrix of f64.
    pub fn dense_bytes(&self) -> u64 {
        24 * self.vertices() as u64 * self.count() as u64
    }
}

/// Lifts states `Φ q` in single precision, which is far below what a mode is known to. Keeps the coefficients in the
/// order it reads them.
pub struct ModalLifter<'a> {
    basis: &'a ModalBasis,
    /// For each column of the space and axis the `m` coefficients, one after the other; 4 rows a column, of which the
    /// last is not kept.
    coefficients: Vec<f32>,
}

/// Vertices that one task lifts.
const VERTICES_PER_TASK: usize = 4096;

impl<'a> ModalLifter<'a> {
    fn new(basis: &'a ModalBasis) -> Self {
        let coefficients = match &basis.functions {
            ModalFunctions::Compact { coefficients, .. } => {
                let (rows, m) = (coefficients.rows(), coefficients.columns());
                let mut transposed = vec![0f32; rows * m];
                transposed.par_chunks_mut(m.max(1)).enumerate().for_each(|(row, values)| {
                    for (mode, value) in values.iter_mut().enumerate() {
                        *value = coefficients.column(mode)[row] as f32;
                    }
                });
                transposed
            }
            ModalFunctions::Dense(_) => Vec::new(),
        };
        Self { basis, coefficients }
    }

    /// The displacements of all vertices, three numbers each, in the state with the `m` coordinates `q`. On the
    /// threads of the pool it is called from.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless there are `m` coordinates and room for three numbers of each vertex.
    pub fn lift(&self, q: &[f64], out: &mut [f32]) -> Result<(), BasisError> {
        let basis = self.basis;
        let (m, n) = (basis.count(), basis.vertices());
        for (found, expected) in [(q.len(), m), (out.len(), 3 * n)] {
            if found != expected {
                return Err(BasisError::Rows { found, expected });
            }
        }
        let whole: Vec<f32> = (0..basis.affine.rows())
            .map(|row| {
                q.iter().take(m).enumerate().map(|(mode, q)| q * basis.affine.column(mode)[row]).sum::<f64>() as f32
            })
            .collect();
        let start = |v: usize| -> [f32; 3] {
            if basis.part[v] == FIXED {
                return [0.0; 3];
            }
            let affine = &whole[12 * basis.part[v] as usize..][..12];
            let x = basis.rest[v];
            std::array::from_fn(|axis| {
                affine[4 * axis]
                    + affine[4 * axis + 1] * x[0]
                    + affine[4 * axis + 2] * x[1]
                    + affine[4 * axis + 3] * x[2]
            })
        };
        let narrow: Vec<f32> = q.iter().take(m).map(|&q| q as f32).collect();
        match &basis.functions {
            ModalFunctions::Compact { space, .. } => {
                let reduced = self.reduced(&narrow, space.columns());
                out.par_chunks_mut(3 * VERTICES_PER_TASK).enumerate().for_each(|(task, out)| {
                    for (k, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                        let v = task * VERTICES_PER_TASK + k;
                        if v >= n {
                            break;
                        }
                        let mut sum = [0f32; 4];
                        let (columns, weights) = space.row(v);
                        for (&column, &weight) in columns.iter().zip(weights) {
                            if let Some(x) = reduced.get(column as usize) {
                                (0..4).for_each(|axis| sum[axis] += weight * x[axis]);
                            }
                        }
                        let whole = start(v);
                        *out = std::array::from_fn(|axis| sum[axis] + whole[axis]);
                    }
                });
            }
            ModalFunctions::Dense(functions) => {
                out.par_chunks_mut(3 * VERTICES_PER_TASK).enumerate().for_each(|(task, out)| {
                    let from = task * VERTICES_PER_TASK;
                    for (k, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate().take_while(|(k, _)| from + k < n)
                    {
                        *out = start(from + k);
                    }
                    let length = out.len();
                    // A mode that takes no part is not read: a single one is lifted for its own sake as often as a
                    // state.
                    let parts = functions.chunks_exact((3 * n).max(1)).zip(&narrow).filter(|(_, q)| **q != 0.0);
                    for (mode, q) in parts {
                        let there = &mode[(3 * from).min(3 * n)..(3 * from + length).min(3 * n)];
                        out.iter_mut().zip(there).for_each(|(sum, x)| *sum += q * x);
                    }
                });
            }
        }
        Ok(())
    }

    /// `φ̄ q`, three numbers and a zero for each column of the space.
    fn reduced(&self, q: &[f32], columns: usize) -> Vec<[f32; 4]> {
        let m = self.basis.count();
        let dot = |row: usize| {
            // Sixteen sums at a time, which the compiler keeps in vector registers.
            let mut sums = [0f32; 16];
            let (a, b) = (self.coefficients[row * m..(row + 1) * m].as_chunks::<16>(), q.as_chunks::<16>());
            for (a, b) in a.0.iter().zip(b.0) {
                for lane in 0..16 {
                    sums[lane] += a[lane] * b[lane];
                }
            }
            sums.iter().sum::<f32>() + a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f32>()
        };
        let all = |column: usize| [dot(3 * column), dot(3 * column + 1), dot(3 * column + 2), 0.0];
        (0..columns).into_par_iter().with_min_len(128).map(all).collect()
    }
}
