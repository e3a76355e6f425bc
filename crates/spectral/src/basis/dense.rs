//! Eigenfunctions as columns, in chunks: what is asked for is read, and nothing else.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use chladni_algebra::{DenseMatrix, PANEL_WIDTH, PanelMatrix};
use serde::{Deserialize, Serialize};

use super::BasisError;

/// Columns of one chunk: as many as a solver's panel has, so that a panel becomes a chunk without looking at its
/// neighbours.
pub const CHUNK_COLUMNS: usize = PANEL_WIDTH;

/// The type of the numbers of dense eigenfunctions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Single precision: half the storage, errors of 6e-8 relative to the largest entry of a function.
    #[default]
    F32,
    /// Double precision.
    F64,
}

impl Precision {
    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The name on the wire and in the store.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The precision of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::F32, Self::F64].into_iter().find(|precision| precision.name() == name)
    }

    /// The type in the words of NumPy.
    pub fn descriptor(self) -> &'static str {
        match self {
            Self::F32 => "<f4",
            Self::F64 => "<f8",
        }
    }
}

/// A real number that eigenfunctions may be stored or asked for in.
pub trait Real: bytemuck::Pod + Default + fmt::Display + Into<f64> + Send + Sync {
    /// From double precision.
    fn narrow(value: f64) -> Self;
    /// To double precision.
    fn wide(self) -> f64;
}

impl Real for f32 {
    fn narrow(value: f64) -> Self {
        value as f32
    }
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    fn narrow(value: f64) -> Self {
        value
    }
    fn wide(self) -> f64 {
        self
    }
}

/// Some columns, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnChunk {
    rows: usize,
    values: Values,
}

#[derive(Debug, Clone, PartialEq)]
enum Values {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Calls a function with the values of a chunk, whatever their type.
macro_rules! with_values {
    ($chunk:expr, $values:ident => $body:expr) => {
        match &$chunk.values {
            Values::F32($values) => $body,
            Values::F64($values) => $body,
        }
    };
}
impl ColumnChunk {
    /// The first `columns` columns of a panel of 32, which is stored row after row.
    fn from_panel(panel: &[f64], rows: usize, columns: usize, precision: Precision) -> Self {
        fn gather<T: Real>(panel: &[f64], rows: usize, columns: usize) -> Vec<T> {
            let mut values = vec![T::default(); rows * columns];
            // Columns are cut into runs, so that the rows of a run stay in cache while each column takes its part.
            const RUN: usize = 256;
            for from in (0..rows).step_by(RUN) {
                let to = rows.min(from + RUN);
                for column in 0..columns {
                    for (row, value) in (from..to).zip(&mut values[column * rows + from..column * rows + to]) {
                        *value = T::narrow(panel[row * PANEL_WIDTH + column]);
                    }
                }
            }
            values
        }
        let values = match precision {
            Precision::F32 => Values::F32(gather(panel, rows, columns)),
            Precision::F64 => Values::F64(gather(panel, rows, columns)),
        };
        Self { rows, values }
    }

    /// A chunk from its bytes: little-endian numbers, column after column. `None` unless they fill whole columns.
    pub fn from_bytes(bytes: &[u8], rows: usize, precision: Precision) -> Option<Self> {
        let column = rows.checked_mul(precision.bytes())?;
        if column == 0 || !bytes.len().is_multiple_of(column) {
            return None;
        }
        let values = match precision {
            Precision::F32 => Values::F32(numbers(bytes)),
            Precision::F64 => Values::F64(numbers(bytes)),
        };
        Some(Self { rows, values })
    }

    /// Its bytes: little-endian numbers, column after column.
    pub fn bytes(&self) -> &[u8] {
        with_values!(self, values => bytemuck::cast_slice(values))
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        with_values!(self, values => values.len()).checked_div(self.rows).unwrap_or(0)
    }

    /// Copies one column.
    pub(super) fn copy_column<T: Real>(&self, column: usize, to: &mut [T]) {
        let range = column * self.rows..(column + 1) * self.rows;
        with_values!(self, values => {
            to.iter_mut().zip(&values[range]).for_each(|(to, &value)| *to = T::narrow(value.wide()));
        });
    }

    pub(crate) fn visit<V: Visit>(&self, visitor: V) -> V::Answer {
        with_values!(self, values => visitor.visit(values, self.rows))
    }
}

/// Numbers from their bytes, of which there is a whole number.
fn numbers<T: Real>(bytes: &[u8]) -> Vec<T> {
    let mut values = vec![T::default(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut::<T, u8>(&mut values).copy_from_slice(bytes);
    values
}

/// Work on the numbers of a chunk of either type.
pub(crate) trait Visit {
    type Answer;
    fn visit<T: Real>(self, values: &[T], rows: usize) -> Self::Answer;
}

/// Where the chunks of dense eigenfunctions lie, if not in memory.
pub trait ColumnSource: Send + Sync + fmt::Debug {
    /// Chunk `index`: columns from `index · 32` on, at most 32. Blocks until it is there; called on threads that may
    /// wait.
    ///
    /// # Errors
    /// [`ColumnError`] says why it cannot be had.
    fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, ColumnError>;
}

/// Why columns cannot be had.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ColumnError {
    /// They were deleted.
    #[error("they were deleted")]
    Gone,
    /// They are damaged, or their place does not answer.
    #[error("{0}")]
    Failed(String),
}

/// Dense eigenfunctions, `n × m`, in chunks of [`CHUNK_COLUMNS`] columns.
#[derive(Debug, Clone)]
pub struct DenseFunctions {
    rows: usize,
    columns: usize,
    precision: Precision,
    place: ColumnStorage,
}

#[derive(Debug, Clone)]
enum ColumnStorage {
    Memory(Vec<Arc<ColumnChunk>>),
    Elsewhere(Arc<dyn ColumnSource>),
}

impl PartialEq for DenseFunctions {
    /// Equal numbers of equal precision; what cannot be read is equal to nothing.
    fn eq(&self, other: &Self) -> bool {
        (self.rows, self.columns, self.precision) == (other.rows, other.columns, other.precision)
            && (0..self.chunk_count()).all(|index| match (self.chunk(index), other.chunk(index)) {
                (Ok(mine), Ok(theirs)) => mine == theirs,
                _ => false,
            })
    }
}

impl DenseFunctions {
    /// From the panels of a solver, each given up as soon as it is converted: at no time is there a second copy of the
    /// whole.
    pub fn from_panels(panels: PanelMatrix, precision: Precision) -> Self {
        let (rows, columns) = (panels.rows(), panels.columns());
        let chunks = panels.into_panels().into_iter().enumerate().map(|(index, panel)| {
            let width = (columns - index * CHUNK_COLUMNS).min(CHUNK_COLUMNS);
            Arc::new(ColumnChunk::from_panel(&panel, rows, width, precision))
        });
        Self { rows, columns, precision, place: ColumnStorage::Memory(chunks.collect()) }
    }

    /// From columns that lie in memory.
    pub fn from_columns(matrix: &DenseMatrix, precision: Precision) -> Self {
        let rows = matrix.rows();
        let chunks = matrix.values().chunks((rows * CHUNK_COLUMNS).max(1)).map(|values| {
            let values = match precision {
                Precision::F32 => Values::F32(values.iter().map(|&value| value as f32).collect()),
                Precision::F64 => Values::F64(values.to_vec()),
            };
            Arc::new(ColumnChunk { rows, values })
        });
        Self { rows, columns: matrix.columns(), precision, place: ColumnStorage::Memory(chunks.collect()) }
    }

    /// From chunks that were read. `None` unless they have `rows` rows and make up `columns` columns in full chunks but
    /// the last.
    pub(crate) fn from_chunks(
        rows: usize,
        columns: usize,
        precision: Precision,
        chunks: Vec<ColumnChunk>,
    ) -> Option<Self> {
        let fits = chunks.len() == columns.div_ceil(CHUNK_COLUMNS)
            && chunks.iter().enumerate().all(|(index, chunk)| {
                chunk.rows == rows && chunk.columns() == (columns - index * CHUNK_COLUMNS).min(CHUNK_COLUMNS)
            });
        let place = ColumnStorage::Memory(chunks.into_iter().map(Arc::new).collect());
        fits.then_some(Self { rows, columns, precision, place })
    }

    /// Columns that lie elsewhere and are fetched when they are needed.
    pub fn elsewhere(rows: usize, columns: usize, precision: Precision, source: Arc<dyn ColumnSource>) -> Self {
        Self { rows, columns, precision, place: ColumnStorage::Elsewhere(source) }
    }

    /// The number of vertices.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The number of eigenfunctions.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The type of the numbers.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Bytes of all numbers.
    pub fn bytes(&self) -> u64 {
        (self.rows * self.precision.bytes()) as u64 * self.columns as u64
    }

    /// The number of chunks.
    pub fn chunk_count(&self) -> usize {
        self.columns.div_ceil(CHUNK_COLUMNS)
    }

    /// The columns of a chunk.
    pub fn chunk_range(&self, index: usize) -> Range<usize> {
        index * CHUNK_COLUMNS..self.columns.min((index + 1) * CHUNK_COLUMNS)
    }

    /// One chunk.
    ///
    /// # Errors
    /// [`BasisError::Unavailable`] where it cannot be read; [`BasisError::Inconsistent`] where it is not what it should
    /// be.
    pub fn chunk(&self, index: usize) -> Result<Arc<ColumnChunk>, BasisError> {
        let chunk = match &self.place {
            ColumnStorage::Memory(chunks) => chunks.get(index).cloned().ok_or(BasisError::Inconsistent)?,
            ColumnStorage::Elsewhere(source) => {
                source.chunk(index).map_err(|error| BasisError::Unavailable { chunk: index, error })?
            }
        };
        if chunk.rows != self.rows || chunk.columns() != self.chunk_range(index).len() {
            return Err(BasisError::Inconsistent);
        }
        Ok(chunk)
    }

    /// All chunks in order; those in memory are given up one by one.
    pub fn into_chunks(self) -> Box<dyn Iterator<Item = Result<Arc<ColumnChunk>, BasisError>> + Send> {
        match self.place {
            ColumnStorage::Memory(chunks) => Box::new(chunks.into_iter().map(Ok)),
            ColumnStorage::Elsewhere(_) => Box::new((0..self.chunk_count()).map(move |index| self.chunk(index))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panels(rows: usize, columns: usize) -> PanelMatrix {
        let mut matrix = PanelMatrix::zeros(rows, columns);
        for column in 0..columns {
            let panel = &mut matrix.panels_mut()[column / PANEL_WIDTH];
            for row in 0..rows {
                panel[row * PANEL_WIDTH + column % PANEL_WIDTH] = (row * 1000 + column) as f64 + 0.125;
            }
        }
        matrix
    }

    #[test]
    fn panels_become_columns_of_the_precision_asked_for() {
        for (rows, columns) in [(700, 70), (5, 64), (3, 1)] {
            for precision in [Precision::F32, Precision::F64] {
                let dense = DenseFunctions::from_panels(panels(rows, columns), precision);
                assert_eq!(dense.bytes(), (rows * columns * precision.bytes()) as u64);
                assert_eq!(dense.chunk_count(), columns.div_ceil(32));
                let mut at = 0;
                for index in 0..dense.chunk_count() {
                    let chunk = dense.chunk(index).unwrap();
                    let again = ColumnChunk::from_bytes(chunk.bytes(), rows, precision).unwrap();
                    assert_eq!(again, *chunk);
                    for column in 0..chunk.columns() {
                        let mut values = vec![0f64; rows];
                        chunk.copy_column(column, &mut values);
                        let expected = (0..rows).map(|row| (row * 1000 + at) as f64 + 0.125);
                        assert!(values.into_iter().eq(expected));
                        at += 1;
                    }
                }
                assert_eq!(at, columns);
                assert!(dense.chunk(dense.chunk_count()).is_err());
            }
        }
    }

    #[test]
    fn bytes_that_fill_no_whole_columns_are_refused() {
        assert!(ColumnChunk::from_bytes(&[0; 12], 3, Precision::F32).is_some());
        assert!(ColumnChunk::from_bytes(&[0; 13], 3, Precision::F32).is_none());
        assert!(ColumnChunk::from_bytes(&[0; 12], 0, Precision::F32).is_none());
        let chunk = || ColumnChunk::from_bytes(&[0; 24], 3, Precision::F64).unwrap();
        assert!(DenseFunctions::from_chunks(3, 1, Precision::F64, vec![chunk()]).is_some());
        assert!(DenseFunctions::from_chunks(3, 2, Precision::F64, vec![chunk()]).is_none());
        assert!(DenseFunctions::from_chunks(3, 2, Precision::F64, vec![chunk(), chunk()]).is_none());
    }
}
