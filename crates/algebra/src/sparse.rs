//! Compressed sparse rows.

use chladni_base::parallel::*;

/// Rows that a thread makes at once.
const ROWS_PER_TASK: usize = 1024;

/// Why parts do not make a sparse matrix.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SparseError {
    /// The row offsets are not `rows + 1` ascending numbers from 0 to the number of entries.
    #[error("row offset {row} is out of order or does not end at the number of entries")]
    Offsets {
        /// The first offending position in the offsets.
        row: usize,
    },
    /// A column index is out of range, or a row's columns are not strictly ascending.
    #[error("row {row}: column {column} is out of range or out of order")]
    Column {
        /// The offending row.
        row: usize,
        /// The offending column index.
        column: u32,
    },
}

/// A sparse matrix in compressed sparse row form. Within a row, columns are strictly ascending.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix<T = f64> {
    rows: usize,
    columns: usize,
    offsets: Vec<usize>,
    indices: Vec<u32>,
    values: Vec<T>,
}

impl<T> SparseMatrix<T> {
    /// Builds a matrix from its parts and checks every invariant.
    ///
    /// # Errors
    /// [`SparseError`] names the first row that breaks one.
    pub fn new(
        rows: usize,
        columns: usize,
        offsets: Vec<usize>,
        indices: Vec<u32>,
        values: Vec<T>,
    ) -> Result<Self, SparseError> {
        if offsets.len() != rows + 1 || offsets[0] != 0 {
            return Err(SparseError::Offsets { row: 0 });
        }
        if let Some(row) = (0..rows).find(|&r| offsets[r] > offsets[r + 1]) {
            return Err(SparseError::Offsets { row });
        }
        if offsets[rows] != indices.len() || indices.len() != values.len() {
            return Err(SparseError::Offsets { row: rows });
        }
        for row in 0..rows {
            let mut least = 0u64;
            for &column in &indices[offsets[row]..offsets[row + 1]] {
                if u64::from(column) < least || column as usize >= columns {
                    return Err(SparseError::Column { row, column });
                }
                least = u64::from(column) + 1;
            }
        }
        Ok(Self { rows, columns, offsets, indices, values })
    }

    /// Builds a matrix from parts that the caller made in order; the invariants are checked in debug builds only.
    pub fn from_sorted_parts(
        rows: usize,
        columns: usize,
        offsets: Vec<usize>,
        indices: Vec<u32>,
        values: Vec<T>,
    ) -> Self {
        debug_assert_eq!(offsets.len(), rows + 1);
        debug_assert_eq!(offsets[rows], indices.len());
        debug_assert_eq!(indices.len(), values.len());
        Self { rows, columns, offsets, indices, values }
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The number of stored entries.
    pub fn entries(&self) -> usize {
        self.indices.len()
    }

    /// The `rows + 1` positions at which rows begin in [`indices`](Self::indices) and [`values`](Self::values).
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// Column indices, row after row.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }

    /// Values, row after row.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// What it is made of: [`offsets`](Self::offsets), [`indices`](Self::indices) and [`values`](Self::values).
    pub fn into_parts(self) -> (Vec<usize>, Vec<u32>, Vec<T>) {
        (self.offsets, self.indices, self.values)
    }

    /// The columns and values of one row.
    pub fn row(&self, row: usize) -> (&[u32], &[T]) {
        let range = self.offsets[row]..self.offsets[row + 1];
        (&self.indices[range.clone()], &self.values[range])
    }
}

impl SparseMatrix {
    /// A square matrix from entries `(row, column, value)` in any order; those of one place are added up in the order
    /// in which they are given.
    ///
    /// # Panics
    /// Where a row or a column is not below `size`.
    pub fn summed(size: usize, mut entries: Vec<(u32, u32, f64)>) -> Self {
        let beyond = entries.iter().find(|&&(row, column, _)| row.max(column) as usize >= size);
        assert_eq!(beyond, None, "an entry outside a matrix of size {size}");
        entries.par_sort_by_key(|e| (e.0, e.1));
        let mut offsets = vec![0usize; size + 1];
        let (mut indices, mut values) = (Vec::new(), Vec::new());
        for same in entries.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            offsets[same[0].0 as usize + 1] += 1;
            indices.push(same[0].1);
            values.push(same.iter().map(|e| e.2).sum());
        }
        for row in 0..size {
            offsets[row + 1] += offsets[row];
        }
        Self::from_sorted_parts(size, size, offsets, indices, values)
    }
}

impl<T: Copy + Default + Send> SparseMatrix<T> {
    /// The transpose, in time and memory linear in the entries.
    pub fn transpose(&self) -> Self {
        let mut offsets = vec![0usize; self.columns() + 2];
        for &column in self.indices() {
            offsets[column as usize + 2] += 1;
        }
        for c in 2..offsets.len() {
            offsets[c] += offsets[c - 1];
        }
        let mut indices = vec![0u32; self.entries()];
        let mut values = vec![T::default(); self.entries()];
        for row in 0..self.rows() {
            let (columns, row_values) = self.row(row);
            for (&column, &value) in columns.iter().zip(row_values) {
                let next = &mut offsets[column as usize + 1];
                indices[*next] = row as u32;
                values[*next] = value;
                *next += 1;
            }
        }
        offsets.pop();
        Self::from_sorted_parts(self.columns(), self.rows(), offsets, indices, values)
    }

    /// Builds a matrix row by row, on all threads. Every row is made by itself, so that the result does not depend on
    /// how many threads there are.
    ///
    /// `row(state, r, entries)` puts what row `r` has into `entries`, which comes empty, as `(column, value)` with
    /// columns strictly ascending, which is checked in debug builds only. `state` makes what is used again from row to
    /// row, such as a buffer; no row may depend on what another left in it.
    pub fn from_rows<S>(
        rows: usize,
        columns: usize,
        state: impl Fn() -> S + Send + Sync,
        row: impl Fn(&mut S, usize, &mut Vec<(u32, T)>) + Send + Sync,
    ) -> Self {
        let part = |(state, entries): &mut (S, Vec<(u32, T)>), task: usize| {
            let range = task * ROWS_PER_TASK..rows.min((task + 1) * ROWS_PER_TASK);
            let mut part = Part { ends: Vec::with_capacity(range.len()), indices: Vec::new(), values: Vec::new() };
            for r in range {
                entries.clear();
                row(state, r, entries);
                debug_assert!(entries.is_sorted_by(|a, b| a.0 < b.0), "row {r}: columns must ascend");
                debug_assert!(
                    entries.last().is_none_or(|last| (last.0 as usize) < columns),
                    "row {r}: column out of range"
                );
                part.indices.extend(entries.iter().map(|entry| entry.0));
                part.values.extend(entries.iter().map(|entry| entry.1));
                part.ends.push(part.indices.len());
            }
            part
        };
        let parts: Vec<Part<T>> =
            (0..rows.div_ceil(ROWS_PER_TASK)).into_par_iter().map_init(|| (state(), Vec::new()), part).collect();
        Self::joined(rows, columns, parts)
    }

    /// The matrix of runs of rows, one after the other. All threads copy: of large matrices, fresh memory takes as long
    /// as anything else.
    fn joined(rows: usize, columns: usize, parts: Vec<Part<T>>) -> Self {
        let entries = parts.iter().map(|part| part.indices.len()).sum();
        let mut offsets = Vec::with_capacity(rows + 1);
        offsets.push(0);
        let (mut indices, mut values) = (vec![0; entries], vec![T::default(); entries]);
        let (mut free_indices, mut free_values) = (&mut indices[..], &mut values[..]);
        let mut start = 0;
        let mut targets = Vec::with_capacity(parts.len());
        for part in parts {
            offsets.extend(part.ends.iter().map(|end| start + end));
            let count = part.indices.len();
            let (own_indices, own_values);
            (own_indices, free_indices) = std::mem::take(&mut free_indices).split_at_mut(count);
            (own_values, free_values) = std::mem::take(&mut free_values).split_at_mut(count);
            targets.push((part, own_indices, own_values));
            start += count;
        }
        targets.into_par_iter().for_each(|(part, indices, values)| {
            indices.copy_from_slice(&part.indices);
            values.copy_from_slice(&part.values);
        });
        Self::from_sorted_parts(rows, columns, offsets, indices, values)
    }
}

/// A run of rows: where each ends in it, and its entries.
struct Part<T> {
    ends: Vec<usize>,
    indices: Vec<u32>,
    values: Vec<T>,
}

impl<T: Copy + From<u8>> SparseMatrix<T> {
    /// The identity, `n × n`.
    pub fn identity(n: usize) -> Self {
        Self::from_sorted_parts(n, n, (0..=n).collect(), (0..n as u32).collect(), vec![T::from(1); n])
    }
}

impl<T: Copy + Default + Send + Sync> SparseMatrix<T> {
    /// The matrix whose row `k` is row `rows[k]` of this one.
    pub fn select_rows(&self, rows: &[u32]) -> Self {
        // Where each row goes is known beforehand, so that nothing is held twice: a space of millions of rows is most
        // of what there is.
        let mut offsets = Vec::with_capacity(rows.len() + 1);
        let mut end = 0;
        offsets.push(end);
        offsets.extend(rows.iter().map(|&row| {
            end += self.offsets[row as usize + 1] - self.offsets[row as usize];
            end
        }));
        let (mut indices, mut values) = (vec![0; end], vec![T::default(); end]);
        let (mut free_indices, mut free_values) = (&mut indices[..], &mut values[..]);
        let mut targets = Vec::with_capacity(rows.len() / ROWS_PER_TASK + 1);
        for (rows, ends) in rows.chunks(ROWS_PER_TASK).zip(offsets.chunks(ROWS_PER_TASK)) {
            let count = rows.iter().map(|&row| self.row(row as usize).0.len()).sum();
            let (own_indices, own_values);
            (own_indices, free_indices) = std::mem::take(&mut free_indices).split_at_mut(count);
            (own_values, free_values) = std::mem::take(&mut free_values).split_at_mut(count);
            targets.push((rows, ends, own_indices, own_values));
        }
        targets.into_par_iter().for_each(|(rows, begins, indices, values)| {
            for (&row, begin) in rows.iter().zip(begins) {
                let (from, x) = self.row(row as usize);
                let range = begin - begins[0]..begin - begins[0] + from.len();
                indices[range.clone()].copy_from_slice(from);
                values[range].copy_from_slice(x);
            }
        });
        Self::from_sorted_parts(rows.len(), self.columns, offsets, indices, values)
    }
}

impl SparseMatrix {
    /// Builds a matrix from rows whose columns come in any order; entries of one place are added up. Row `i` has the
    /// entries `offsets[i]..offsets[i + 1]`.
    ///
    /// # Errors
    /// [`SparseError`] names the first row that does not fit.
    pub fn from_unsorted(
        rows: usize,
        columns: usize,
        offsets: &[usize],
        indices: &[u32],
        values: &[f64],
    ) -> Result<Self, SparseError> {
        if offsets.first() != Some(&0) || offsets.len() != rows.saturating_add(1) {
            return Err(SparseError::Offsets { row: 0 });
        }
        if let Some(row) = offsets.windows(2).position(|pair| pair[0] > pair[1]) {
            return Err(SparseError::Offsets { row });
        }
        if offsets[rows] != indices.len() || indices.len() != values.len() {
            return Err(SparseError::Offsets { row: rows });
        }
        if let Some(at) = indices.iter().position(|&column| column as usize >= columns) {
            let row = offsets.partition_point(|&offset| offset <= at) - 1;
            return Err(SparseError::Column { row, column: indices[at] });
        }
        let (mut ends, mut sorted) = (Vec::with_capacity(rows + 1), Vec::with_capacity(indices.len()));
        let (mut sums, mut row): (Vec<f64>, Vec<(u32, f64)>) = (Vec::with_capacity(values.len()), Vec::new());
        ends.push(0);
        for range in offsets.windows(2).map(|pair| pair[0]..pair[1]) {
            row.clear();
            row.extend(indices[range.clone()].iter().copied().zip(values[range].iter().copied()));
            // In the order in which they came, so that equal input gives equal sums.
            row.sort_by_key(|entry| entry.0);
            let start = sorted.len();
            for &(column, value) in &row {
                match sums.last_mut() {
                    Some(last) if sorted.len() > start && sorted.last() == Some(&column) => *last += value,
                    _ => {
                        sorted.push(column);
                        sums.push(value);
                    }
                }
            }
            ends.push(sorted.len());
        }
        Ok(Self { rows, columns, offsets: ends, indices: sorted, values: sums })
    }

    /// The same matrix times a number.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { values: self.values.iter().map(|value| value * factor).collect(), ..self.clone() }
    }

    /// The square matrix with its rows and columns in another order: row and column `k` are those that were `order[k]`,
    /// a permutation.
    pub fn reordered(&self, order: &[u32]) -> Self {
        debug_assert_eq!(order.len(), self.rows);
        self.principal(order)
    }

    /// The principal submatrix of a square matrix, `rows.len() × rows.len()`: row and column `k` are those that were
    /// `rows[k]`, each at most once.
    pub fn principal(&self, rows: &[u32]) -> Self {
        // A small part of a large matrix is found without a list of all its columns.
        let few = rows.len() < self.columns / 16 && rows.is_sorted();
        let mut places = vec![u32::MAX; if few { 0 } else { self.columns }];
        if !few {
            rows.iter().enumerate().for_each(|(place, &row)| places[row as usize] = place as u32);
        }
        let place = |column: u32| match few {
            true => rows.binary_search(&column).map_or(u32::MAX, |place| place as u32),
            false => places[column as usize],
        };
        let row = |(): &mut (), k: usize, entries: &mut Vec<(u32, f64)>| {
            let (columns, numbers) = self.row(rows[k] as usize);
            let placed = columns.iter().zip(numbers).map(|(&column, &number)| (place(column), number));
            entries.extend(placed.filter(|entry| entry.0 != u32::MAX));
            entries.sort_unstable_by_key(|entry| entry.0);
        };
        Self::from_rows(rows.len(), rows.len(), || (), row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of as many entries as its number says, none in every seventh.
    fn entries(row: usize, columns: usize) -> impl Iterator<Item = (u32, f64)> {
        let count = if row % 7 == 3 { 0 } else { row % 5 + 1 };
        (0..count)
            .map(move |k| ((row + 3 * k) % columns, k))
            .map(move |(column, k)| (column as u32, (row * 10 + k) as f64))
    }

    #[test]
    fn rows_made_on_threads_are_those_of_one_list() {
        // More rows than a thread makes at once, and a last run that is not full.
        for (rows, columns) in [(0, 4), (1, 20), (ROWS_PER_TASK, 50), (3 * ROWS_PER_TASK + 17, 900)] {
            let made = SparseMatrix::from_rows(rows, columns, Vec::new, |buffer: &mut Vec<(u32, f64)>, row, to| {
                // What another row left in the buffer is not looked at.
                buffer.clear();
                buffer.extend(entries(row, columns));
                buffer.sort_unstable_by_key(|entry| entry.0);
                to.extend_from_slice(buffer);
            });
            let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
            for row in 0..rows {
                indices.extend(entries(row, columns).map(|entry| entry.0));
                values.extend(entries(row, columns).map(|entry| entry.1));
                offsets.push(indices.len());
            }
            let expected = SparseMatrix::from_unsorted(rows, columns, &offsets, &indices, &values).unwrap();
            assert_eq!(made, expected, "{rows} rows");
        }
    }
}
