//! Sparse matrices of small square blocks: what acts on a few numbers per face.

use std::collections::HashMap;
use std::convert::Infallible;

use chladni_base::parallel::*;

use super::SparseMatrix;

/// Rows that one task handles.
const ROWS_PER_TASK: usize = 2048;

/// A square block, row after row.
pub type Block<const B: usize> = [[f64; B]; B];

/// A sparse matrix of `B × B` blocks of f64 in compressed sparse rows; columns ascend within a row.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMatrix<const B: usize> {
    rows: usize,
    columns: usize,
    offsets: Vec<usize>,
    indices: Vec<u32>,
    blocks: Vec<Block<B>>,
}

/// `into += a · b`.
#[inline(always)]
pub fn add_product<const B: usize>(into: &mut Block<B>, a: &Block<B>, b: &Block<B>) {
    for i in 0..B {
        for k in 0..B {
            for j in 0..B {
                into[i][j] += a[i][k] * b[k][j];
            }
        }
    }
}

/// The transpose of a block.
#[inline(always)]
pub fn transposed<const B: usize>(a: &Block<B>) -> Block<B> {
    let mut t = [[0.0; B]; B];
    for i in 0..B {
        for j in 0..B {
            t[j][i] = a[i][j];
        }
    }
    t
}

/// The inverse of a symmetric positive definite block; the inverse of its diagonal where it is not.
pub fn inverse_positive<const B: usize>(a: &Block<B>) -> Block<B> {
    // Gauss and Jordan without pivoting, which a positive definite block does not need.
    let (mut left, mut right) = (*a, [[0.0; B]; B]);
    for i in 0..B {
        right[i][i] = 1.0;
    }
    let mut sound = true;
    for p in 0..B {
        let pivot = left[p][p];
        sound &= pivot > 1e-14 * a[p][p].abs() && pivot.is_finite();
        if !sound {
            break;
        }
        for j in 0..B {
            left[p][j] /= pivot;
            right[p][j] /= pivot;
        }
        for i in (0..B).filter(|&i| i != p) {
            let factor = left[i][p];
            for j in 0..B {
                left[i][j] -= factor * left[p][j];
                right[i][j] -= factor * right[p][j];
            }
        }
    }
    if !sound {
        right = [[0.0; B]; B];
        for i in 0..B {
            right[i][i] = if a[i][i] > 0.0 && a[i][i].is_finite() { 1.0 / a[i][i] } else { 1.0 };
        }
    }
    right
}

/// Rows of so many blocks are searched from their beginning.
const SHORT_ROW: usize = 48;

/// Where the blocks of a row under construction are, by column: in constant time, however long the row is.
#[derive(Debug, Default)]
pub struct BlockPlaces(HashMap<u32, u32>);

impl BlockPlaces {
    /// The block of a column in `entries`, which are those of one row all the time; a block of zeros is appended where
    /// there is none.
    #[inline]
    pub fn block<'e, const B: usize>(
        &mut self,
        entries: &'e mut Vec<(u32, Block<B>)>,
        column: u32,
    ) -> &'e mut Block<B> {
        let found = if entries.len() <= SHORT_ROW {
            entries.iter().position(|entry| entry.0 == column)
        } else {
            for at in self.0.len()..entries.len() {
                self.0.insert(entries[at].0, at as u32);
            }
            self.0.get(&column).map(|&at| at as usize)
        };
        let at = found.unwrap_or_else(|| {
            entries.push((column, [[0.0; B]; B]));
            entries.len() - 1
        });
        &mut entries[at].1
    }
}

impl<const B: usize> BlockMatrix<B> {
    /// A matrix from the rows that `row` gives as `(column, block)`; they are sorted here. A column may come once in a
    /// row.
    pub fn from_rows(rows: usize, columns: usize, row: impl Fn(usize, &mut Vec<(u32, Block<B>)>) + Sync) -> Self {
        let made = Self::try_from_rows(rows, columns, |r, entries| {
            row(r, entries);
            Ok::<_, Infallible>(())
        });
        match made {
            Ok(matrix) => matrix,
            Err(never) => match never {},
        }
    }

    /// The same from rows that may fail, or look whether they are still wanted.
    ///
    /// # Errors
    /// One of those of `row`; rows after it may have been asked for in other tasks.
    pub fn try_from_rows<E: Send>(
        rows: usize,
        columns: usize,
        row: impl Fn(usize, &mut Vec<(u32, Block<B>)>) -> Result<(), E> + Sync,
    ) -> Result<Self, E> {
        struct Part<const B: usize> {
            lengths: Vec<u32>,
            indices: Vec<u32>,
            blocks: Vec<Block<B>>,
        }
        let parts: Vec<Part<B>> = (0..rows.div_ceil(ROWS_PER_TASK))
            .into_par_iter()
            .map(|task| {
                let range = task * ROWS_PER_TASK..rows.min((task + 1) * ROWS_PER_TASK);
                let mut part =
                    Part { lengths: Vec::with_capacity(range.len()), indices: Vec::new(), blocks: Vec::new() };
                let mut entries = Vec::new();
                for r in range {
                    entries.clear();
                    row(r, &mut entries)?;
                    entries.sort_unstable_by_key(|e| e.0);
                    part.lengths.push(entries.len() as u32);
                    part.indices.extend(entries.iter().map(|e| e.0));
                    part.blocks.extend(entries.iter().map(|e| e.1));
                }
                Ok(part)
            })
            .collect::<Result<_, E>>()?;
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        let entries = parts.iter().map(|p| p.indices.len()).sum();
        let (mut indices, mut blocks) = (Vec::with_capacity(entries), Vec::with_capacity(entries));
        for part in parts {
            for length in part.lengths {
                offsets.push(offsets.last().copied().unwrap_or(0) + length as usize);
            }
            indices.extend(part.indices);
            blocks.extend(part.blocks);
        }
        Ok(Self { rows, columns, offsets, indices, blocks })
    }

    /// The number of rows of blocks.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns of blocks.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The number of stored blocks.
    pub fn entries(&self) -> usize {
        self.indices.len()
    }

    /// Where rows begin: `rows + 1` positions.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The columns of all blocks, row after row.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// All blocks, row after row.
    pub fn blocks(&self) -> &[Block<B>] {
        &self.blocks
    }

    /// The columns and blocks of one row.
    pub fn row(&self, row: usize) -> (&[u32], &[Block<B>]) {
        let range = self.offsets[row]..self.offsets[row + 1];
        (&self.indices[range.clone()], &self.blocks[range])
    }

    /// The diagonal block of each row; zero where there is none.
    pub fn diagonal(&self) -> Vec<Block<B>> {
        (0..self.rows)
            .map(|r| {
                let (columns, blocks) = self.row(r);
                columns.binary_search(&(r as u32)).map_or([[0.0; B]; B], |at| blocks[at])
            })
            .collect()
    }

    /// `y = A x`, in parallel.
    ///
    /// # Panics
    /// Unless `x` has `B` numbers for each column of blocks.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(
            x.len(),
            B * self.columns,
            "a product of {} columns of blocks of {B} with so many numbers",
            self.columns
        );
        let mut y = vec![0.0; B * self.rows];
        y.par_chunks_mut(B * ROWS_PER_TASK).enumerate().for_each(|(task, y)| {
            for (k, y) in y.chunks_exact_mut(B).enumerate() {
                let (columns, blocks) = self.row(task * ROWS_PER_TASK + k);
                for (&c, block) in columns.iter().zip(blocks) {
                    let x = &x[B * c as usize..B * (c as usize + 1)];
                    for i in 0..B {
                        for j in 0..B {
                            y[i] += block[i][j] * x[j];
                        }
                    }
                }
            }
        });
        y
    }

    /// The same pattern with other blocks, of whatever size.
    pub fn map_blocks<const C: usize>(self, map: impl Fn(Block<B>) -> Block<C>) -> BlockMatrix<C> {
        let Self { rows, columns, offsets, indices, blocks } = self;
        BlockMatrix { rows, columns, offsets, indices, blocks: blocks.into_iter().map(map).collect() }
    }

    /// The transpose.
    pub fn transpose(&self) -> Self {
        let mut offsets = vec![0usize; self.columns + 2];
        for &c in &self.indices {
            offsets[c as usize + 2] += 1;
        }
        for c in 2..offsets.len() {
            offsets[c] += offsets[c - 1];
        }
        let mut indices = vec![0u32; self.entries()];
        let mut blocks = vec![[[0.0; B]; B]; self.entries()];
        for row in 0..self.rows {
            let (columns, own) = self.row(row);
            for (&c, block) in columns.iter().zip(own) {
                let next = &mut offsets[c as usize + 1];
                indices[*next] = row as u32;
                blocks[*next] = transposed(block);
                *next += 1;
            }
        }
        offsets.pop();
        Self { rows: self.columns, columns: self.rows, offsets, indices, blocks }
    }

    /// `A C`, in parallel.
    ///
    /// # Panics
    /// Unless `C` has as many rows as `A` columns.
    pub fn times(&self, other: &Self) -> Self {
        match self.try_times(other, || Ok::<_, Infallible>(())) {
            Ok(product) => product,
            Err(never) => match never {},
        }
    }

    /// The same with a look before each row, and now and then within a long one, at whether the product is still
    /// wanted.
    ///
    /// # Errors
    /// That of `look`.
    ///
    /// # Panics
    /// Unless the other matrix has as many rows as this one columns.
    pub fn try_times<E: Send>(&self, other: &Self, look: impl Fn() -> Result<(), E> + Sync) -> Result<Self, E> {
        assert_eq!(self.columns, other.rows, "columns of the left factor, rows of the right one");
        Self::try_from_rows(self.rows, other.columns, |r, entries| {
            let (columns, blocks) = self.row(r);
            let mut places = BlockPlaces::default();
            for (k, (&column, a)) in columns.iter().zip(blocks).enumerate() {
                if k % 64 == 0 {
                    look()?;
                }
                let (inner, others) = other.row(column as usize);
                for (&c, b) in inner.iter().zip(others) {
                    add_product(places.block(entries, c), a, b);
                }
            }
            Ok(())
        })
    }

    /// The same matrix of single numbers, zeros inside blocks left out.
    pub fn to_sparse(&self) -> SparseMatrix {
        let mut offsets = Vec::with_capacity(B * self.rows + 1);
        let mut indices = Vec::with_capacity(B * B * self.entries());
        let mut values = Vec::with_capacity(B * B * self.entries());
        offsets.push(0);
        for row in 0..self.rows {
            let (columns, blocks) = self.row(row);
            for i in 0..B {
                for (&c, block) in columns.iter().zip(blocks) {
                    for j in (0..B).filter(|&j| block[i][j] != 0.0) {
                        indices.push(B as u32 * c + j as u32);
                        values.push(block[i][j]);
                    }
                }
                offsets.push(indices.len());
            }
        }
        SparseMatrix::from_sorted_parts(B * self.rows, B * self.columns, offsets, indices, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(rows: usize, columns: usize, salt: u64) -> BlockMatrix<3> {
        BlockMatrix::from_rows(rows, columns, |r, entries| {
            let mut state = salt ^ (r as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                state >> 33
            };
            for _ in 0..4 {
                let column = (random() % columns as u64) as u32;
                let block = [0; 3].map(|_| [0; 3].map(|_| (random() % 1000) as f64 / 500.0 - 1.0));
                if entries.iter().all(|e: &(u32, Block<3>)| e.0 != column) {
                    entries.push((column, block));
                }
            }
        })
    }

    #[test]
    fn products_and_transposes_are_those_of_the_scalar_matrix() {
        let (a, b) = (scattered(40, 25, 1), scattered(25, 31, 2));
        let x: Vec<f64> = (0..93).map(|i| f64::from(i).sin()).collect();
        let once = b.to_sparse().multiply(&x);
        let twice = a.to_sparse().multiply(&once);
        let direct = a.times(&b).multiply(&x);
        assert!(direct.iter().zip(&twice).all(|(p, q)| (p - q).abs() < 1e-12));
        assert_eq!(a.transpose().to_sparse(), a.to_sparse().transpose());
    }

    #[test]
    fn long_rows_are_those_of_short_ones() {
        // A row of 300 blocks, each of which meets 40 of 200 columns.
        let wide = BlockMatrix::<2>::from_rows(1, 300, |_, entries| {
            entries.extend((0..300u32).map(|c| (c, [[f64::from(c % 7), 1.0], [0.5, f64::from(c % 5)]])));
        });
        let tall = BlockMatrix::<2>::from_rows(300, 200, |r, entries| {
            entries.extend((0..40u32).map(|k| ((r as u32 * 13 + 7 * k) % 200, [[f64::from(k), 2.0], [1.0, 0.25]])));
        });
        let x: Vec<f64> = (0..400).map(|i| f64::from(i % 17) - 8.0).collect();
        let product = wide.times(&tall);
        assert_eq!(product.entries(), 200);
        // All numbers are multiples of a power of two, and small.
        assert_eq!(product.multiply(&x), wide.multiply(&tall.multiply(&x)));
    }

    #[test]
    fn rows_that_are_not_wanted_any_more_end_the_matrix() {
        let (a, b) = (scattered(40, 25, 1), scattered(25, 31, 2));
        let looks = std::sync::atomic::AtomicUsize::new(0);
        let look = || match looks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) {
            17 => Err("not wanted"),
            _ => Ok(()),
        };
        assert_eq!(a.try_times(&b, look), Err("not wanted"));
        assert_eq!(looks.into_inner(), 18);
        assert_eq!(a.try_times(&b, || Ok::<_, ()>(())), Ok(a.times(&b)));
    }

    #[test]
    fn blocks_are_inverted() {
        let a = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.25], [0.5, -0.25, 2.0]];
        let mut product = [[0.0; 3]; 3];
        add_product(&mut product, &a, &inverse_positive(&a));
        for i in 0..3 {
            for j in 0..3 {
                assert!((product[i][j] - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
        assert_eq!(inverse_positive(&[[1.0, 1.0], [1.0, 1.0]]), [[1.0, 0.0], [0.0, 1.0]]);
    }
}
