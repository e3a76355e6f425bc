//! A sparse symmetric matrix cut into patches of rows that fit the cache, each with rings of neighbours around it:
//! several products in a row need one pass over memory, at the price of computing the rings twice.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use chladni_base::Spare;
use chladni_base::parallel::*;

use super::{MassMatrix, SparseMatrix, WeightedMass};

/// Rows of a patch, but for the last: with sixteen single-precision lanes, the rings and the matrix, about a megabyte.
pub const PATCH_ROWS: usize = 2560;

/// Rings around a patch.
pub const RINGS: usize = 6;

/// Where patches with their rings hold more rows than this many times the matrix (a hub whose neighbours are
/// everywhere), patches grow.
const MOST_OVERLAP: usize = 2;

/// Consecutive rows of a matrix, with what [`RINGS`] products in a row reach from there. Numbers of rows are local:
/// first the rows of the patch, then ring after ring.
#[derive(Debug)]
pub struct Patch {
    rows: Range<usize>,
    vertices: Vec<u32>,
    ends: [usize; RINGS + 1],
    matrix: SparseRows,
    /// The entries of the patch's own rows in double precision.
    values: Vec<f64>,
    mass: Option<(SparseRows, Vec<f64>)>,
}

/// Entries that a loop over a row takes at once. Rows of meshes have five to nine entries: a loop over them one by one
/// ends where no processor foresees it, and a product takes 10 ns a row instead of 6.
pub const ENTRIES_AT_ONCE: usize = 4;

/// Columns of a row, the second number to be ignored, and values in double precision; filled up as those of
/// [`SparseRows`] are.
pub type ExactRow<'a> = (&'a [(u32, f32)], &'a [f64]);

/// Rows of a sparse matrix, in single precision. Zeros beside the first entry of a row fill it up to a multiple of
/// [`ENTRIES_AT_ONCE`].
#[derive(Debug, Default)]
pub struct SparseRows {
    offsets: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl SparseRows {
    /// All rows of `matrix`.
    pub fn of<T: Copy + Into<f64> + Sync>(matrix: &SparseMatrix<T>) -> Self {
        const ROWS: usize = 1 << 12;
        let lengths = matrix.offsets().windows(2).map(|pair| pair[1] - pair[0]);
        let offsets = filled_offsets(lengths);
        let mut entries = vec![(0, 0.0); offsets.last().map_or(0, |&last| last as usize)];
        let mut parts = Vec::with_capacity(matrix.rows().div_ceil(ROWS));
        let mut left = &mut entries[..];
        for from in (0..matrix.rows()).step_by(ROWS) {
            let to = matrix.rows().min(from + ROWS);
            let (part, others) = left.split_at_mut((offsets[to] - offsets[from]) as usize);
            parts.push((from..to, part));
            left = others;
        }
        parts.into_par_iter().for_each(|(rows, mut part)| {
            for row in rows {
                let (own, others) = part.split_at_mut((offsets[row + 1] - offsets[row]) as usize);
                part = others;
                let (columns, values) = matrix.row(row);
                // A row without entries has nothing to be filled up.
                let Some(&first) = columns.first() else { continue };
                let (given, filling) = own.split_at_mut(columns.len());
                let entries = columns.iter().zip(values).map(|(&column, &value)| (column, value.into() as f32));
                given.iter_mut().zip(entries).for_each(|(given, entry)| *given = entry);
                filling.fill((first, 0.0));
            }
        });
        Self { offsets, entries }
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[(u32, f32)] {
        &self.entries[self.range(row)]
    }

    /// Where rows begin, and where the last one ends.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// The rows of the transposed matrix, so many.
    ///
    /// # Panics
    /// Where a column is not below `count`.
    pub fn transposed(&self, count: usize) -> Self {
        let given = |row: usize| self.row(row).iter().filter(|entry| entry.1 != 0.0);
        let rows = 0..self.offsets.len().saturating_sub(1);
        let mut lengths = vec![0; count];
        rows.clone().flat_map(given).for_each(|&(column, _)| lengths[column as usize] += 1);
        let offsets = filled_offsets(lengths.into_iter());
        let mut next = offsets.clone();
        let mut entries = vec![(0, 0.0); offsets.last().map_or(0, |&last| last as usize)];
        for row in rows {
            for &(column, value) in given(row) {
                let place = &mut next[column as usize];
                if *place == offsets[column as usize] {
                    entries[*place as usize..offsets[column as usize + 1] as usize].fill((row as u32, 0.0));
                }
                entries[*place as usize] = (row as u32, value);
                *place += 1;
            }
        }
        Self { offsets, entries }
    }

    #[inline(always)]
    fn range(&self, row: usize) -> Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    fn local(matrix: &SparseMatrix, rows: &[u32], numbers: &[u32]) -> Self {
        let mut offsets = Vec::with_capacity(rows.len() + 1);
        let mut entries: Vec<(u32, f32)> = Vec::with_capacity(2 * ENTRIES_AT_ONCE * rows.len());
        offsets.push(0);
        for &row in rows {
            let (columns, values) = matrix.row(row as usize);
            let begin = entries.len();
            entries.extend(columns.iter().zip(values).map(|(&c, &value)| (numbers[c as usize], value as f32)));
            if let Some(&(first, _)) = entries.get(begin) {
                fill_up(&mut entries, (first, 0.0));
            }
            offsets.push(entries.len() as u32);
        }
        Self { offsets, entries }
    }
}

/// Fills up the last of some rows, all of which end at multiples of [`ENTRIES_AT_ONCE`], so that it does too.
pub fn fill_up<T: Clone>(rows: &mut Vec<T>, zero: T) {
    rows.resize(rows.len().next_multiple_of(ENTRIES_AT_ONCE), zero);
}

/// Where rows of such lengths begin if each is filled up, and where the last one ends.
fn filled_offsets(lengths: impl Iterator<Item = usize>) -> Vec<u32> {
    let mut end = 0;
    let ends = lengths.map(|length| {
        end += length.next_multiple_of(ENTRIES_AT_ONCE) as u32;
        end
    });
    std::iter::once(0).chain(ends).collect()
}

/// The values of some rows, filled up like these.
fn filled_values(matrix: &SparseMatrix, rows: Range<usize>) -> Vec<f64> {
    let mut filled = Vec::with_capacity(2 * ENTRIES_AT_ONCE * rows.len());
    for row in rows {
        filled.extend_from_slice(matrix.row(row).1);
        fill_up(&mut filled, 0.0);
    }
    filled
}

impl Patch {
    /// The rows of the matrix that are this patch's own.
    pub fn rows(&self) -> Range<usize> {
        self.rows.clone()
    }

    /// Row numbers in the whole matrix of the patch and its first `rings` rings.
    ///
    /// # Panics
    /// For more than [`RINGS`] rings.
    pub fn vertices(&self, rings: usize) -> &[u32] {
        &self.vertices[..self.ends[rings]]
    }

    /// The matrix in single precision, on the patch and all but its last ring.
    pub fn matrix(&self) -> &SparseRows {
        &self.matrix
    }

    /// An own row of the matrix in double precision.
    #[inline(always)]
    pub fn exact(&self, row: usize) -> ExactRow<'_> {
        let range = self.matrix.range(row);
        (&self.matrix.entries[range.clone()], &self.values[range])
    }

    /// An own row of a mass matrix that is not diagonal, like [`exact`](Self::exact).
    #[inline(always)]
    pub fn consistent_mass(&self, row: usize) -> Option<ExactRow<'_>> {
        let (rows, values) = self.mass.as_ref()?;
        let range = rows.range(row);
        Some((&rows.entries[range.clone()], &values[range]))
    }
}

/// Patches of a symmetric matrix whose rows are in a compact order ([`compact_order`](super::compact_order) with
/// [`PATCH_ROWS`]).
///
/// # Panics
/// Where the mass matrix has another size than the matrix.
pub fn patches(matrix: &SparseMatrix, mass: &MassMatrix) -> Vec<Patch> {
    let n = matrix.rows();
    let consistent = match mass {
        MassMatrix::Diagonal(mass) => {
            assert_eq!(mass.len(), n, "a mass for each row");
            None
        }
        MassMatrix::Sparse(mass) | MassMatrix::Weighted(WeightedMass { matrix: mass, .. }) => {
            assert_eq!(mass.rows(), n, "a row of masses for each row");
            Some(mass)
        }
    };
    let mut size = PATCH_ROWS;
    // Numbers of all rows, none of which is left when a patch is done.
    let spare = Spare::default();
    let numbered = || vec![u32::MAX; n];
    loop {
        // Counting ends as soon as it is too much.
        let counted = AtomicUsize::new(0);
        let fits = size >= n
            || (0..n.div_ceil(size))
                .into_par_iter()
                .map(|patch| {
                    let rows = patch * size..n.min((patch + 1) * size);
                    let left = (MOST_OVERLAP * n).saturating_sub(counted.load(Ordering::Relaxed));
                    spare.with(numbered, |numbers| {
                        let Some((vertices, _)) = grow(matrix, consistent, rows, left, numbers) else { return false };
                        vertices.iter().for_each(|&v| numbers[v as usize] = u32::MAX);
                        counted.fetch_add(vertices.len(), Ordering::Relaxed) + vertices.len() <= MOST_OVERLAP * n
                    })
                })
                .all(|fits| fits);
        if fits {
            break;
        }
        size *= 4;
    }
    let size = size.min(n.max(1));
    (0..n.div_ceil(size))
        .into_par_iter()
        .map(|patch| {
            spare.with(numbered, |numbers| {
                let rows = patch * size..n.min((patch + 1) * size);
                let Some((vertices, ends)) = grow(matrix, consistent, rows.clone(), usize::MAX, numbers) else {
                    unreachable!("there is no limit")
                };
                let local = SparseRows::local(matrix, &vertices[..ends[RINGS - 1]], numbers);
                let values = filled_values(matrix, rows.clone());
                let mass = consistent.map(|mass| {
                    let values = filled_values(mass, rows.clone());
                    (SparseRows::local(mass, &vertices[..rows.len()], numbers), values)
                });
                vertices.iter().for_each(|&v| numbers[v as usize] = u32::MAX);
                Patch { rows, vertices, ends, matrix: local, values, mass }
            })
        })
        .collect()
}

/// The rows and ring after ring around them, with where each ring ends, and their local numbers left in `numbers`;
/// nothing, and `numbers` as before, where they would be more than `most`.
fn grow(
    matrix: &SparseMatrix,
    mass: Option<&SparseMatrix>,
    rows: Range<usize>,
    most: usize,
    numbers: &mut [u32],
) -> Option<(Vec<u32>, [usize; RINGS + 1])> {
    let mut vertices: Vec<u32> = rows.clone().map(|row| row as u32).collect();
    vertices.iter().enumerate().for_each(|(number, &v)| numbers[v as usize] = number as u32);
    let mut ends = [vertices.len(); RINGS + 1];
    let mut begin = 0;
    for ring in 0..RINGS {
        let end = vertices.len();
        for k in begin..end {
            let row = vertices[k] as usize;
            let also = mass.map_or(&[][..], |mass| mass.row(row).0);
            for &other in matrix.row(row).0.iter().chain(also) {
                if numbers[other as usize] == u32::MAX {
                    numbers[other as usize] = vertices.len() as u32;
                    vertices.push(other);
                }
            }
            if vertices.len() > most {
                vertices.iter().for_each(|&v| numbers[v as usize] = u32::MAX);
                return None;
            }
        }
        begin = end;
        ends[ring + 1] = vertices.len();
    }
    Some((vertices, ends))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of `n` rows; with `hub`, row 0 is connected to all.
    fn ring(n: usize, hub: bool) -> SparseMatrix {
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            let mut columns = vec![(row + n - 1) % n, row, (row + 1) % n];
            if hub {
                columns.extend(if row == 0 { 0..n } else { 0..1 });
            }
            columns.sort_unstable();
            columns.dedup();
            values.extend(columns.iter().map(|&c| if c == row { 2.0 + row as f64 } else { -1.0 - (c * row) as f64 }));
            indices.extend(columns.iter().map(|&c| c as u32));
            offsets.push(indices.len());
        }
        SparseMatrix::new(n, n, offsets, indices, values).unwrap()
    }

    #[test]
    fn patches_hold_each_row_once_and_products_on_rings_are_those_of_the_matrix() {
        let n = 3 * PATCH_ROWS - 100;
        for (matrix, count) in [(ring(n, false), 3), (ring(n, true), 1), (ring(7, false), 1)] {
            let n = matrix.rows();
            let masses = MassMatrix::Diagonal(vec![1.0; n]);
            let patches = patches(&matrix, &masses);
            assert_eq!(patches.len(), count);
            let owned: Vec<usize> = patches.iter().flat_map(Patch::rows).collect();
            assert_eq!(owned, (0..n).collect::<Vec<_>>());
            for patch in &patches {
                for (row, global) in patch.rows().enumerate() {
                    let (columns, values) = patch.exact(row);
                    assert_eq!((columns.len() % ENTRIES_AT_ONCE, columns.len()), (0, values.len()));
                    let back: Vec<(u32, f64)> = columns
                        .iter()
                        .zip(values)
                        .filter(|(_, value)| **value != 0.0)
                        .map(|(&(column, single), &value)| {
                            assert_eq!(single, value as f32);
                            (patch.vertices(1)[column as usize], value)
                        })
                        .collect();
                    let (columns, values) = matrix.row(global);
                    assert_eq!(back, columns.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>());
                    assert!(patch.consistent_mass(row).is_none());
                }
                let with_rows = patch.vertices(RINGS - 1);
                for (row, &global) in with_rows.iter().enumerate() {
                    let given = patch.matrix().row(row).iter().filter(|entry| entry.1 != 0.0);
                    let columns: Vec<u32> = given.map(|&(c, _)| patch.vertices(RINGS)[c as usize]).collect();
                    assert_eq!(columns, matrix.row(global as usize).0);
                }
            }
        }
    }

    #[test]
    fn a_consistent_mass_is_in_the_rings() {
        let n = PATCH_ROWS + 100;
        let matrix = ring(n, false);
        let identity = SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![1.0; n]).unwrap();
        let patches = patches(&identity, &MassMatrix::Sparse(matrix.clone()));
        for patch in &patches {
            assert_eq!(patch.vertices(1).len(), patch.rows().len() + 2);
            for (row, global) in patch.rows().enumerate() {
                let (columns, values) = patch.consistent_mass(row).unwrap();
                let back: Vec<u32> = columns.iter().map(|&(c, _)| patch.vertices(1)[c as usize]).collect();
                let length = matrix.row(global).0.len();
                assert_eq!((&back[..length], &values[..length]), matrix.row(global));
                assert!(values[length..].iter().all(|&value| value == 0.0) && values.len() % ENTRIES_AT_ONCE == 0);
            }
        }
    }

    #[test]
    fn rows_are_filled_up_with_zeros_and_so_are_those_of_the_transposed_matrix() {
        let n = 9000;
        let mut offsets = vec![0];
        let (mut indices, mut values) = (Vec::new(), Vec::new());
        for row in 0..n {
            // None to nine entries.
            for k in 0..row % 10 {
                indices.push((row / 3 + 700 * k) as u32);
                values.push(1.0 + (row * k % 97) as f64);
            }
            offsets.push(indices.len());
        }
        let columns = n / 3 + 7000;
        let matrix: SparseMatrix = SparseMatrix::new(n, columns, offsets, indices, values).unwrap();
        let rows = SparseRows::of(&matrix);
        let transposed = rows.transposed(columns);
        let expected = matrix.transpose();
        for (found, matrix) in [(&rows, &matrix), (&transposed, &expected)] {
            assert_eq!(found.offsets().len(), matrix.rows() + 1);
            for row in 0..matrix.rows() {
                let (columns, values) = matrix.row(row);
                let (given, filled) = found.row(row).split_at(columns.len());
                let expected: Vec<(u32, f32)> = columns.iter().zip(values).map(|(&c, &v)| (c, v as f32)).collect();
                assert_eq!(given, expected, "{row}");
                assert_eq!(found.row(row).len(), columns.len().next_multiple_of(ENTRIES_AT_ONCE));
                assert!(filled.iter().all(|&entry| entry == (columns[0], 0.0)), "{row}");
            }
        }
    }
}
