//! A sparse basis of tangential fields, stored face by face.

use chladni_algebra::{SparseMatrix, vectorized};
use chladni_base::parallel::*;

/// Faces that one task handles.
const FACES_PER_TASK: usize = 4096;

/// A sparse basis `U` of fields, `B F × d` with `B = 2` or `3` numbers per face: first the columns of the groups, `B`
/// each, then columns that are dense.
///
/// Face-major: the blocks of a face lie together, so that lifting is one pass over memory.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldSpace {
    block: usize,
    groups: usize,
    offsets: Vec<u32>,
    group_of: Vec<u32>,
    /// `block²` numbers for each entry of `group_of`, row after row.
    values: Vec<f32>,
    /// `block · F` numbers for each dense column.
    dense: Vec<Vec<f32>>,
}

/// Why parts do not make a space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the parts of a field space do not fit: {0}")]
pub struct SpaceError(pub &'static str);

/// Why numbers, or what refers to a surface, do not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FieldMisfit {
    /// There are more or fewer numbers than there should be.
    #[error("expected {expected} {what}, got {found}")]
    Numbers {
        /// What they are.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// There is no such face.
    #[error("item {place} of the faces is {face}, of {faces}")]
    Face {
        /// Where it stands among those asked for.
        place: usize,
        /// What was asked for.
        face: u32,
        /// The number of faces.
        faces: usize,
    },
    /// There is no such edge.
    #[error("item {place} of the matching is of edge {edge}, of {edges}")]
    Edge {
        /// Where it stands in the matching.
        place: usize,
        /// The edge.
        edge: u32,
        /// The number of edges.
        edges: usize,
    },
    /// The two eigendirections of a tensor are `n` directions for even `n` only.
    #[error("eigendirections make n-fields with even n, not with n = {n}")]
    Directions {
        /// What `n` is.
        n: u32,
    },
    /// A length or an angle is none.
    #[error("length and tilt must be finite numbers, and the full length greater than 0")]
    Strands,
}

impl FieldMisfit {
    /// Refuses other than `expected` numbers.
    pub(crate) fn check(what: &'static str, found: usize, expected: usize) -> Result<(), Self> {
        if found == expected { Ok(()) } else { Err(Self::Numbers { what, found, expected }) }
    }
}

impl FieldSpace {
    /// A space from its parts: `offsets` (`F + 1`) say where the entries of each face begin, `group_of` is ascending
    /// within a face, `values` holds `block²` numbers for each entry, `dense` columns of `block · F` numbers.
    ///
    /// # Errors
    /// [`SpaceError`] says which part does not fit.
    pub fn from_parts(
        block: usize,
        groups: usize,
        offsets: Vec<u32>,
        group_of: Vec<u32>,
        values: Vec<f32>,
        dense: Vec<Vec<f32>>,
    ) -> Result<Self, SpaceError> {
        if block != 2 && block != 3 {
            return Err(SpaceError("a face holds 2 or 3 numbers"));
        }
        if offsets.first() != Some(&0)
            || !offsets.is_sorted()
            || offsets.last().map(|&e| e as usize) != Some(group_of.len())
        {
            return Err(SpaceError("offsets are out of order"));
        }
        if values.len() != block * block * group_of.len() {
            return Err(SpaceError("there are not block² values for each entry"));
        }
        let in_order = offsets.windows(2).all(|w| {
            let own = &group_of[w[0] as usize..w[1] as usize];
            own.windows(2).all(|g| g[0] < g[1]) && own.last().is_none_or(|&g| (g as usize) < groups)
        });
        if !in_order {
            return Err(SpaceError("groups of a face are out of range or out of order"));
        }
        if dense.iter().any(|c| c.len() != block * (offsets.len() - 1)) {
            return Err(SpaceError("a dense column does not have block numbers for each face"));
        }
        Ok(Self { block, groups, offsets, group_of, values, dense })
    }

    /// A space from parts that the caller made in order; nothing is checked.
    pub(crate) fn from_sorted_parts(
        block: usize,
        groups: usize,
        offsets: Vec<u32>,
        group_of: Vec<u32>,
        values: Vec<f32>,
    ) -> Self {
        debug_assert_eq!(offsets.last().map(|&end| end as usize), Some(group_of.len()));
        debug_assert_eq!(values.len(), block * block * group_of.len());
        Self { block, groups, offsets, group_of, values, dense: Vec::new() }
    }

    /// The same space with dense columns added; those of another length are left out.
    pub fn with_dense(mut self, columns: Vec<Vec<f32>>) -> Self {
        let length = self.block * self.faces();
        self.dense.extend(columns.into_iter().filter(|c| c.len() == length));
        self
    }

    /// Numbers per face.
    pub fn block(&self) -> usize {
        self.block
    }

    /// The number of faces.
    pub fn faces(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The number of columns, `d`.
    pub fn dimension(&self) -> usize {
        self.block * self.groups + self.dense.len()
    }

    /// The number of locally supported groups of `block` columns.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The number of stored blocks.
    pub fn entries(&self) -> usize {
        self.group_of.len()
    }

    /// Stored numbers per row of `U`, dense columns included.
    pub fn per_row(&self) -> f64 {
        self.block as f64 * self.entries() as f64 / self.faces().max(1) as f64 + self.dense.len() as f64
    }

    /// The bytes that the space takes as stored.
    pub fn bytes(&self) -> u64 {
        let numbers = self.offsets.len() + self.group_of.len() + self.values.len();
        4 * (numbers + self.dense.iter().map(Vec::len).sum::<usize>()) as u64
    }

    /// Where the entries of faces begin.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// The groups of all entries.
    pub fn group_of(&self) -> &[u32] {
        &self.group_of
    }

    /// The blocks of all entries.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The dense columns.
    pub fn dense(&self) -> &[Vec<f32>] {
        &self.dense
    }

    /// The entries of a face: groups, and blocks of `block²` numbers each.
    pub fn face(&self, face: usize) -> (&[u32], &[f32]) {
        let (from, to) = (self.offsets[face] as usize, self.offsets[face + 1] as usize);
        let size = self.block * self.block;
        (&self.group_of[from..to], &self.values[size * from..size * to])
    }

    /// The first face that no local column covers.
    pub fn uncovered(&self) -> Option<usize> {
        self.offsets.windows(2).position(|w| w[0] == w[1])
    }

    /// The rows of a face as `(column, the block numbers of the face)`.
    pub fn row_entries(&self, face: usize, mut visit: impl FnMut(usize, &[f64])) {
        let b = self.block;
        let (groups, blocks) = self.face(face);
        let mut column = [0.0; 3];
        for (&group, block) in groups.iter().zip(blocks.chunks_exact(b * b)) {
            for j in 0..b {
                for i in 0..b {
                    column[i] = f64::from(block[i * b + j]);
                }
                visit(b * group as usize + j, &column[..b]);
            }
        }
        for (k, dense) in self.dense.iter().enumerate() {
            for i in 0..b {
                column[i] = f64::from(dense[b * face + i]);
            }
            visit(b * self.groups + k, &column[..b]);
        }
    }

    /// `U x` in single precision: `block` numbers for each face.
    ///
    /// # Errors
    /// [`FieldMisfit::Numbers`] unless `x` has `d` numbers.
    pub fn lift(&self, x: &[f32]) -> Result<Vec<f32>, FieldMisfit> {
        FieldMisfit::check("coefficients", x.len(), self.dimension())?;
        let mut field = vec![0f32; self.block * self.faces()];
        match self.block {
            2 => self.lift_blocks::<2, 4>(x, &mut field),
            _ => self.lift_blocks::<3, 9>(x, &mut field),
        }
        for (column, &c) in self.dense.iter().zip(&x[self.block * self.groups..]) {
            if c != 0.0 {
                field.par_chunks_mut(1 << 15).zip(column.par_chunks(1 << 15)).for_each(|(into, from)| {
                    into.iter_mut().zip(from).for_each(|(y, u)| *y += c * u);
                });
            }
        }
        Ok(field)
    }

    /// The rows of some faces of `U x`: `block` numbers for each, in their order.
    ///
    /// # Errors
    /// [`FieldMisfit::Numbers`] unless `x` has `d` numbers, [`FieldMisfit::Face`] names a face that is not there.
    pub fn lift_faces(&self, x: &[f32], faces: &[u32]) -> Result<Vec<f32>, FieldMisfit> {
        FieldMisfit::check("coefficients", x.len(), self.dimension())?;
        if let Some(place) = faces.iter().position(|&face| face as usize >= self.faces()) {
            return Err(FieldMisfit::Face { place, face: faces[place], faces: self.faces() });
        }
        let b = self.block;
        let mut field = vec![0f32; b * faces.len()];
        field.par_chunks_mut(b).with_min_len(256).zip(faces).for_each(|(own, &face)| {
            let mut sum = [0.0; 3];
            self.row_entries(face as usize, |column, u| {
                sum.iter_mut().zip(u).for_each(|(sum, u)| *sum += u * f64::from(x[column]));
            });
            own.iter_mut().zip(sum).for_each(|(own, sum)| *own = sum as f32);
        });
        Ok(field)
    }

    /// `BB` is `B²`.
    fn lift_blocks<const B: usize, const BB: usize>(&self, x: &[f32], field: &mut [f32]) {
        // The coefficients of a group, repeated for each row of its block.
        let table: Vec<[f32; BB]> =
            x[..B * self.groups].chunks_exact(B).map(|c| std::array::from_fn(|i| c[i % B])).collect();
        field.par_chunks_mut(B * FACES_PER_TASK).enumerate().for_each(|(task, field)| {
            vectorized(
                field,
                #[inline(always)]
                |field| {
                    for (k, out) in field.chunks_exact_mut(B).enumerate() {
                        let face = task * FACES_PER_TASK + k;
                        let (from, to) = (self.offsets[face] as usize, self.offsets[face + 1] as usize);
                        let blocks = self.values[BB * from..BB * to].as_chunks::<BB>().0;
                        let mut sums = [0f32; BB];
                        for (&group, block) in self.group_of[from..to].iter().zip(blocks) {
                            if let Some(c) = table.get(group as usize) {
                                for i in 0..BB {
                                    sums[i] += block[i] * c[i];
                                }
                            }
                        }
                        for i in 0..B {
                            out[i] = sums[B * i..B * (i + 1)].iter().sum();
                        }
                    }
                },
            );
        });
    }

    /// `Uᵀ y` for `block` numbers per face, in double precision. Sums are formed in pieces that do not depend on the
    /// number of threads.
    ///
    /// # Panics
    /// Unless `y` has `block` numbers for each face.
    pub fn transposed_times(&self, y: &[f64]) -> Vec<f64> {
        let b = self.block;
        assert_eq!(y.len(), b * self.faces(), "numbers of a field of {b} for each of {} faces", self.faces());
        let pieces = 16;
        let length = self.faces().div_ceil(pieces).max(1);
        let sums: Vec<Vec<f64>> = (0..self.faces().div_ceil(length))
            .into_par_iter()
            .map(|piece| {
                let mut sum = vec![0.0; self.dimension()];
                for face in piece * length..self.faces().min((piece + 1) * length) {
                    let own = &y[b * face..b * (face + 1)];
                    if own.iter().any(|&v| v != 0.0) {
                        self.row_entries(face, |column, u| {
                            sum[column] += u.iter().zip(own).map(|(u, y)| u * y).sum::<f64>();
                        });
                    }
                }
                sum
            })
            .collect();
        let mut total = vec![0.0; self.dimension()];
        for sum in sums {
            total.iter_mut().zip(sum).for_each(|(t, s)| *t += s);
        }
        total
    }

    /// The local columns as a matrix of single numbers, `block · F × block · groups`, without stored zeros.
    pub fn to_sparse(&self) -> SparseMatrix<f32> {
        let b = self.block;
        let mut offsets = Vec::with_capacity(b * self.faces() + 1);
        let mut indices = Vec::with_capacity(self.values.len());
        let mut values = Vec::with_capacity(self.values.len());
        offsets.push(0);
        for face in 0..self.faces() {
            let (groups, blocks) = self.face(face);
            for i in 0..b {
                for (&group, block) in groups.iter().zip(blocks.chunks_exact(b * b)) {
                    for j in (0..b).filter(|j| block[i * b + j] != 0.0) {
                        indices.push(b as u32 * group + j as u32);
                        values.push(block[i * b + j]);
                    }
                }
                offsets.push(indices.len());
            }
        }
        SparseMatrix::from_sorted_parts(b * self.faces(), b * self.groups, offsets, indices, values)
    }
}
