//! Values at single vertices, and sums of squares of eigenfunctions on all of them: what distances and signatures are
//! made of.

use std::sync::atomic::{AtomicU32, Ordering};

use chladni_algebra::{
    DenseMatrix, LIFT_WIDTH, MassMatrix, RowLifter, SparseMatrix, row_parts, space_transposed_mass_times, vectorized,
};
use chladni_base::parallel::*;

use super::dense::{Real, Visit};
use super::{Basis, BasisError, Compact, Functions};

/// The largest space whose pairs of columns are numbered in a table: `4 d²` bytes.
const MOST_DIRECT: usize = 4096;

/// The largest space for which that table is kept with the basis.
const MOST_KEPT: usize = 2048;

/// From so many rows on all of them go through the coefficients together.
const MANY_ROWS: usize = 32;

/// Rows that one task handles.
const ROWS_PER_TASK: usize = 2048;

/// A weight of this share of the largest is lost in rounding.
const NOTHING: f64 = 1e-18;

/// Numbers that are summed side by side.
const LANES: usize = 8;

impl Basis {
    /// The values of all modes at some vertices: a row for each vertex and a column for each mode, `p × m`.
    ///
    /// # Errors
    /// [`BasisError::Vertex`] names the first that is none; [`BasisError::Unavailable`].
    pub fn at_vertices(&self, vertices: &[u32]) -> Result<DenseMatrix, BasisError> {
        self.first_at_vertices(vertices, self.count())
    }

    /// The values of the first `modes` modes, or of all where there are fewer, at some vertices: `p × modes`.
    ///
    /// # Errors
    /// As [`at_vertices`](Self::at_vertices).
    pub fn first_at_vertices(&self, vertices: &[u32], modes: usize) -> Result<DenseMatrix, BasisError> {
        let n = self.vertices();
        if let Some(place) = vertices.iter().position(|&vertex| vertex as usize >= n) {
            return Err(BasisError::Vertex { place, vertex: vertices[place], vertices: n });
        }
        let modes = modes.min(self.count());
        let mut values = DenseMatrix::zeros(vertices.len(), modes);
        if vertices.is_empty() || modes == 0 {
            return Ok(values);
        }
        match &self.functions {
            Functions::Compact(Compact { space, coefficients, .. }) if vertices.len() >= MANY_ROWS => {
                let lifter = RowLifter::new(space, &coefficients.slice_columns(0..modes));
                let groups = values.values_mut().par_chunks_mut(vertices.len() * LIFT_WIDTH);
                groups.enumerate().for_each(|(group, columns)| {
                    let mut panel = vec![[0.0; LIFT_WIDTH]; vertices.len()];
                    lifter.lift(vertices, group, &mut panel);
                    for (k, column) in columns.chunks_exact_mut(vertices.len()).enumerate() {
                        column.iter_mut().zip(&panel).for_each(|(value, row)| *value = row[k]);
                    }
                });
            }
            Functions::Compact(Compact { space, coefficients, .. }) => {
                let columns = values.values_mut().par_chunks_mut(vertices.len());
                columns.enumerate().for_each(|(mode, column)| {
                    let mode = coefficients.column(mode);
                    for (value, &vertex) in column.iter_mut().zip(vertices) {
                        let (columns, weights) = space.row(vertex as usize);
                        *value = columns.iter().zip(weights).map(|(&c, &w)| f64::from(w) * mode[c as usize]).sum();
                    }
                });
            }
            Functions::Dense(dense) => {
                for index in (0..dense.chunk_count()).take_while(|&index| dense.chunk_range(index).start < modes) {
                    let chunk = dense.chunk(index)?;
                    chunk.visit(Pick { vertices, from: dense.chunk_range(index).start, values: &mut values });
                }
            }
        }
        Ok(values)
    }

    /// `Φᵀ x` for functions `x`, `n × k`, that are integrated already: `m × k`.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless `x` has a row for each vertex; [`BasisError::Unavailable`].
    pub fn inner_products(&self, x: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        if x.rows() != self.vertices() {
            return Err(BasisError::Rows { found: x.rows(), expected: self.vertices() });
        }
        match &self.functions {
            Functions::Compact(compact) => {
                let ones = MassMatrix::Diagonal(vec![1.0; x.rows()]);
                let reduced = space_transposed_mass_times(&compact.space, &ones, x);
                Ok(compact.coefficients.transposed_times(&reduced))
            }
            Functions::Dense(dense) => dense.inner_products(x, self.count()),
        }
    }

    /// `Σ_k w_kt φ_k(x)²` at every vertex `x`, for columns of weights `w`, `m × t`: `n × t`.
    ///
    /// A compact basis does not lift its modes for this: the sum is a quadratic form in the row of `U`, whose entries
    /// `Σ_k w_k φ̄_ak φ̄_bk` are needed only for pairs of columns `a`, `b` that share a vertex.
    ///
    /// # Errors
    /// [`BasisError::Rows`] unless there is a weight for each mode; [`BasisError::Unavailable`].
    pub fn weighted_squares(&self, weights: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
        if weights.rows() != self.count() {
            return Err(BasisError::Rows { found: weights.rows(), expected: self.count() });
        }
        match &self.functions {
            Functions::Compact(compact) if compact.space.columns() <= MOST_DIRECT => {
                if compact.space.columns() > MOST_KEPT {
                    return Ok(Pairs::new(&compact.space).squares(compact, weights));
                }
                let pairs = compact.pairs.get_or(|| Pairs::new(&compact.space));
                Ok(pairs.squares(compact, weights))
            }
            Functions::Compact(compact) => lifted_squares(compact, weights),
            Functions::Dense(dense) => {
                let mut sums = DenseMatrix::zeros(dense.rows(), weights.columns());
                for index in 0..dense.chunk_count() {
                    let chunk = dense.chunk(index)?;
                    chunk.visit(AddSquares { weights, from: dense.chunk_range(index).start, sums: &mut sums });
                }
                Ok(sums)
            }
        }
    }
}

/// Copies the rows of some vertices.
struct Pick<'a> {
    vertices: &'a [u32],
    from: usize,
    values: &'a mut DenseMatrix,
}

impl Visit for Pick<'_> {
    type Answer = ();
    fn visit<T: Real>(self, values: &[T], rows: usize) {
        let wanted = self.values.columns() - self.from;
        for (k, column) in values.chunks(rows.max(1)).take(wanted).enumerate() {
            let to = self.values.column_mut(self.from + k);
            to.iter_mut().zip(self.vertices).for_each(|(to, &vertex)| *to = column[vertex as usize].wide());
        }
    }
}

/// Adds the squares of the columns of a chunk, each with its weights.
struct AddSquares<'a> {
    weights: &'a DenseMatrix,
    from: usize,
    sums: &'a mut DenseMatrix,
}

impl Visit for AddSquares<'_> {
    type Answer = ();
    fn visit<T: Real>(self, values: &[T], rows: usize) {
        let Self { weights, from, sums } = self;
        for t in 0..weights.columns() {
            let weights = &weights.column(t)[from..];
            sums.column_mut(t).par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, sums)| {
                let first = task * ROWS_PER_TASK;
                for (column, &weight) in values.chunks(rows.max(1)).zip(weights).filter(|(_, weight)| **weight != 0.0) {
                    let column = &column[first..first + sums.len()];
                    sums.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value.wide() * value.wide());
                }
            });
        }
    }
}

/// Rows that are summed side by side: neighbours in the order of the mesh share most of their columns.
const ROWS_TOGETHER: usize = 8;

/// The most columns of rows that are taken together; a single row may have more.
const MOST_TOGETHER: usize = 48;

/// Up to eight consecutive rows of `U` as a small dense matrix.
struct Block {
    /// The columns that they have, ascending.
    columns: Vec<u32>,
    /// A line for each of these columns, with a number for each row.
    values: Vec<[f64; ROWS_TOGETHER]>,
    /// Where each column of `U` stands in the block.
    places: Vec<u16>,
}

impl Block {
    fn new(space: &SparseMatrix<f32>) -> Self {
        Self { columns: Vec::new(), values: Vec::new(), places: vec![u16::MAX; space.columns()] }
    }

    /// Takes rows from `from` on, at least one and at most up to `end`, and gives their number.
    fn fill(&mut self, space: &SparseMatrix<f32>, from: usize, end: usize) -> usize {
        self.columns.clear();
        let mut taken = 0;
        for row in from..end.min(from + ROWS_TOGETHER) {
            let (columns, _) = space.row(row);
            let before = self.columns.len();
            for &column in columns {
                let place = &mut self.places[column as usize];
                if *place == u16::MAX {
                    *place = 0;
                    self.columns.push(column);
                }
            }
            if taken > 0 && self.columns.len() > MOST_TOGETHER {
                self.columns.drain(before..).for_each(|column| self.places[column as usize] = u16::MAX);
                break;
            }
            taken += 1;
        }
        self.columns.sort_unstable();
        self.columns.iter().zip(0..).for_each(|(&column, place)| self.places[column as usize] = place);
        self.values.clear();
        self.values.resize(self.columns.len(), [0.0; ROWS_TOGETHER]);
        for lane in 0..taken {
            let (columns, values) = space.row(from + lane);
            for (&column, &value) in columns.iter().zip(values) {
                self.values[usize::from(self.places[column as usize])][lane] = f64::from(value);
            }
        }
        self.columns.iter().for_each(|&column| self.places[column as usize] = u16::MAX);
        taken
    }

    /// Calls a function with each pair of columns that some row has both of, the first not after the second.
    fn each_pair(&self, mut act: impl FnMut(u32, u32)) {
        // For each row one bit.
        let marks = |line: &[f64; ROWS_TOGETHER]| {
            line.iter().enumerate().fold(0u8, |bits, (lane, x)| bits | (u8::from(*x != 0.0) << lane))
        };
        let marks: Vec<u8> = self.values.iter().map(marks).collect();
        for (k, &a) in self.columns.iter().enumerate() {
            for (&b, &mark) in self.columns[k..].iter().zip(&marks[k..]) {
                if mark & marks[k] != 0 {
                    act(a, b);
                }
            }
        }
    }
}

/// The pairs of columns of `U` that share a row, numbered from 1.
#[derive(Debug)]
pub(super) struct Pairs {
    /// `d × d`: the number of the pair `(a, b)`, `a ≤ b`, at `a d + b`; 0 where there is no such pair.
    numbers: Vec<u32>,
    pairs: Vec<(u32, u32)>,
}

impl Pairs {
    /// About the bytes that are kept with a space.
    pub fn bytes(space: &SparseMatrix<f32>) -> u64 {
        let d = space.columns() as u64;
        if space.columns() > MOST_KEPT { 0 } else { 4 * d * d + 8 * (d * d).min(64 * d) }
    }

    fn new(space: &SparseMatrix<f32>) -> Self {
        let (n, d) = (space.rows(), space.columns());
        let marks: Vec<AtomicU32> = (0..d * d).map(|_| AtomicU32::new(0)).collect();
        (0..n.div_ceil(ROWS_PER_TASK)).into_par_iter().for_each(|task| {
            let mut block = Block::new(space);
            let (mut row, end) = (task * ROWS_PER_TASK, n.min((task + 1) * ROWS_PER_TASK));
            while row < end {
                row += block.fill(space, row, end);
                block.each_pair(|a, b| marks[a as usize * d + b as usize].store(1, Ordering::Relaxed));
            }
        });
        let mut numbers: Vec<u32> = marks.into_iter().map(AtomicU32::into_inner).collect();
        let mut pairs = Vec::new();
        for (a, line) in numbers.chunks_mut(d.max(1)).enumerate() {
            for (b, number) in line.iter_mut().enumerate().skip(a).filter(|(_, number)| **number != 0) {
                pairs.push((a as u32, b as u32));
                *number = pairs.len() as u32;
            }
        }
        Self { numbers, pairs }
    }

    fn squares(&self, compact: &Compact, weights: &DenseMatrix) -> DenseMatrix {
        match weights.columns() {
            0 => DenseMatrix::zeros(compact.space.rows(), 0),
            1 => self.in_groups::<1>(compact, weights),
            2 => self.in_groups::<2>(compact, weights),
            3 | 4 => self.in_groups::<4>(compact, weights),
            _ => self.in_groups::<8>(compact, weights),
        }
    }

    /// `K` columns of weights at once.
    fn in_groups<const K: usize>(&self, compact: &Compact, weights: &DenseMatrix) -> DenseMatrix {
        let (n, t) = (compact.space.rows(), weights.columns());
        let rows = padded_rows(&compact.coefficients);
        let groups: Vec<Vec<[f64; K]>> =
            (0..t).step_by(K).map(|from| self.forms(&rows, weights, from..t.min(from + K))).collect();
        let mut sums = DenseMatrix::zeros(n, t);
        let tasks = row_parts(sums.values_mut(), n, ROWS_PER_TASK);
        tasks.into_par_iter().enumerate().for_each(|(task, mut columns)| {
            let mut block = Block::new(&compact.space);
            let (first, count) = (task * ROWS_PER_TASK, columns.first().map_or(0, |column| column.len()));
            let mut row = 0;
            while row < count {
                let taken = block.fill(&compact.space, first + row, first + count);
                for (forms, columns) in groups.iter().zip(columns.chunks_mut(K)) {
                    let sums = vectorized(
                        (&block, &forms[..]),
                        #[inline(always)]
                        |(block, forms)| self.quadratic::<K>(block, forms, compact.space.columns()),
                    );
                    for (column, sums) in columns.iter_mut().zip(&sums) {
                        column[row..row + taken].copy_from_slice(&sums[..taken]);
                    }
                }
                row += taken;
            }
        });
        sums
    }

    /// For no pair and then for each of the pairs `Σ_k w_k φ̄_ak φ̄_bk` with at most `K` columns of weights, twice that
    /// off the diagonal.
    fn forms<const K: usize>(
        &self,
        rows: &[[f64; LANES]],
        weights: &DenseMatrix,
        group: std::ops::Range<usize>,
    ) -> Vec<[f64; K]> {
        // Weights of high modes are often nothing beside those of low ones: heat has died down there.
        let least: Vec<f64> = group
            .clone()
            .map(|t| NOTHING * weights.column(t).iter().fold(0.0, |most: f64, weight| most.max(weight.abs())))
            .collect();
        let is_something = |mode: &usize| group.clone().zip(&least).any(|(t, &l)| weights.column(t)[*mode].abs() > l);
        let used = (0..weights.rows()).rev().find(is_something).map_or(0, |last| last + 1).div_ceil(LANES);
        let mut lanes = vec![[[0.0; LANES]; K]; used];
        for (t, column) in group.clone().enumerate() {
            for (mode, &weight) in weights.column(column).iter().enumerate().take(used * LANES) {
                lanes[mode / LANES][t][mode % LANES] = weight;
            }
        }
        let width = weights.rows().div_ceil(LANES);
        let mut forms = vec![[0.0; K]; 1 + self.pairs.len()];
        forms[1..].par_chunks_mut(512).zip(self.pairs.par_chunks(512)).for_each(|(forms, pairs)| {
            vectorized(
                forms,
                #[inline(always)]
                |forms| {
                    for (form, &(a, b)) in forms.iter_mut().zip(pairs) {
                        let row = |k: u32| &rows[k as usize * width..][..used];
                        let mut acc = [[0.0; LANES]; K];
                        for ((a, b), weights) in row(a).iter().zip(row(b)).zip(&lanes) {
                            for t in 0..K {
                                for lane in 0..LANES {
                                    acc[t][lane] += a[lane] * b[lane] * weights[t][lane];
                                }
                            }
                        }
                        let times = if a == b { 1.0 } else { 2.0 };
                        *form = acc.map(|lanes| times * lanes.iter().sum::<f64>());
                    }
                },
            );
        });
        forms
    }

    /// `uᵀ F u` for the rows `u` of a block and each of `K` forms.
    #[inline(always)]
    fn quadratic<const K: usize>(&self, block: &Block, forms: &[[f64; K]], d: usize) -> [[f64; ROWS_TOGETHER]; K] {
        let mut sums = [[0.0; ROWS_TOGETHER]; K];
        for (k, (&a, own)) in block.columns.iter().zip(&block.values).enumerate() {
            let line = &self.numbers[a as usize * d..][..d];
            let mut parts = [[0.0; ROWS_TOGETHER]; K];
            for (&b, other) in block.columns[k..].iter().zip(&block.values[k..]) {
                let form = &forms[line[b as usize] as usize];
                for t in 0..K {
                    for lane in 0..ROWS_TOGETHER {
                        parts[t][lane] += form[t] * other[lane];
                    }
                }
            }
            for t in 0..K {
                for lane in 0..ROWS_TOGETHER {
                    sums[t][lane] += own[lane] * parts[t][lane];
                }
            }
        }
        sums
    }
}

/// The rows of a matrix one after the other, each padded with zeros to whole groups of lanes.
fn padded_rows(matrix: &DenseMatrix) -> Vec<[f64; LANES]> {
    let width = matrix.columns().div_ceil(LANES);
    let mut rows = vec![[0.0; LANES]; matrix.rows() * width];
    for column in 0..matrix.columns() {
        let (group, lane) = (column / LANES, column % LANES);
        for (row, &value) in matrix.column(column).iter().enumerate() {
            rows[row * width + group][lane] = value;
        }
    }
    rows
}

/// The same by lifting the modes, some rows and 32 of them at a time.
fn lifted_squares(compact: &Compact, weights: &DenseMatrix) -> Result<DenseMatrix, BasisError> {
    let (n, m, t) = (compact.space.rows(), compact.coefficients.columns(), weights.columns());
    let lifter = RowLifter::new(&compact.space, &compact.coefficients);
    let mut rows = vec![0.0; n * t];
    rows.par_chunks_mut((ROWS_PER_TASK * t).max(1)).enumerate().for_each(|(task, out)| {
        let from = task * ROWS_PER_TASK;
        let numbers: Vec<u32> = (from..n.min(from + ROWS_PER_TASK)).map(|row| row as u32).collect();
        let mut panel = vec![[0.0; LIFT_WIDTH]; numbers.len()];
        for group in 0..m.div_ceil(LIFT_WIDTH) {
            lifter.lift(&numbers, group, &mut panel);
            for (out, row) in out.chunks_mut(t).zip(&panel) {
                for (column, out) in out.iter_mut().enumerate() {
                    let weights = &weights.column(column)[group * LIFT_WIDTH..];
                    *out += row.iter().zip(weights).map(|(value, weight)| weight * value * value).sum::<f64>();
                }
            }
        }
    });
    let mut sums = DenseMatrix::zeros(n, t);
    for column in 0..t {
        let values = rows.iter().skip(column).step_by(t);
        sums.column_mut(column).iter_mut().zip(values).for_each(|(sum, value)| *sum = *value);
    }
    Ok(sums)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::tests::dense_basis;
    use crate::basis::{Certificate, DenseFunctions, Precision};

    /// A basis of `m` functions in a space of `d` columns with `1 + row % 5` entries a row.
    fn compact(n: usize, d: usize, m: usize) -> Basis {
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            let mut columns: Vec<u32> = (0..1 + row % 5).map(|k| ((row / 7 + 3 * k) % d) as u32).collect();
            columns.sort_unstable();
            columns.dedup();
            values.extend(columns.iter().map(|&c| ((row * 31 + c as usize * 17) % 101) as f32 / 64.0 - 0.5));
            indices.extend(columns);
            offsets.push(indices.len());
        }
        let coefficients = (0..d * m).map(|i| (i as f64 * 0.37).sin()).collect();
        Basis {
            functions: Functions::Compact(Compact::new(
                SparseMatrix::new(n, d, offsets, indices, values).unwrap(),
                DenseMatrix::from_columns(d, m, coefficients),
            )),
            eigenvalues: (0..m).map(|k| k as f64).collect(),
            mass: MassMatrix::Diagonal(vec![1.0; n]),
            certificate: Certificate::default(),
            metadata: serde_json::Value::Null.into(),
        }
    }

    fn close(a: &DenseMatrix, b: &DenseMatrix, tolerance: f64) -> bool {
        (a.rows(), a.columns()) == (b.rows(), b.columns())
            && a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() <= tolerance)
    }

    #[test]
    fn sums_of_squares_agree_with_the_lifted_modes_for_any_number_of_weights() {
        let (n, m) = (ROWS_PER_TASK + 77, 37);
        let basis = compact(n, 40, m);
        let modes: Vec<f64> = basis.lift(0..m).unwrap();
        let modes = DenseMatrix::from_columns(n, m, modes);
        let dense = DenseFunctions::from_columns(&modes, Precision::F64);
        let dense = Basis { functions: Functions::Dense(dense), ..basis.clone() };
        for t in [0, 1, 2, 3, 7, 8, 11] {
            let weights: Vec<f64> = (0..m * t).map(|i| if i % m > 20 { 0.0 } else { (i as f64 * 0.7).cos() }).collect();
            let weights = DenseMatrix::from_columns(m, t, weights);
            let mut expected = DenseMatrix::zeros(n, t);
            for column in 0..t {
                for mode in 0..m {
                    let weight = weights.column(column)[mode];
                    let sums = expected.column_mut(column).iter_mut().zip(modes.column(mode));
                    sums.for_each(|(sum, value)| *sum += weight * value * value);
                }
            }
            assert!(close(&basis.weighted_squares(&weights).unwrap(), &expected, 1e-11), "{t}");
            assert!(close(&dense.weighted_squares(&weights).unwrap(), &expected, 1e-11), "{t}");
            let lifted = lifted_squares(basis.compact().unwrap(), &weights).unwrap();
            assert!(close(&lifted, &expected, 1e-11), "{t}");
        }
        assert!(basis.weighted_squares(&DenseMatrix::zeros(m + 1, 1)).is_err());
    }

    #[test]
    fn values_at_vertices_are_rows_of_the_lifted_modes() {
        let basis = compact(500, 20, 33);
        for basis in [basis, dense_basis(Precision::F64, 70)] {
            let modes: Vec<f64> = basis.lift(0..basis.count()).unwrap();
            let vertices = [2, 0, 2];
            let values = basis.at_vertices(&vertices).unwrap();
            for mode in 0..basis.count() {
                for (row, &vertex) in vertices.iter().enumerate() {
                    let expected = modes[mode * basis.vertices() + vertex as usize];
                    assert!((values.column(mode)[row] - expected).abs() < 1e-14);
                }
            }
            assert_eq!(basis.first_at_vertices(&vertices, 20).unwrap(), values.slice_columns(0..20));
            let many: Vec<u32> = (0..100).map(|k| vertices[k % 3]).collect();
            let more = basis.first_at_vertices(&many, 20).unwrap();
            assert!((0..20).all(|mode| (0..100).all(|k| more.column(mode)[k] == values.column(mode)[k % 3])));
            assert_eq!(basis.first_at_vertices(&vertices, 0).unwrap().columns(), 0);
            assert_eq!(basis.at_vertices(&[]).unwrap().rows(), 0);
            let n = basis.vertices();
            let error = basis.at_vertices(&[0, n as u32]).unwrap_err();
            assert_eq!(error, BasisError::Vertex { place: 1, vertex: n as u32, vertices: n });
        }
    }

    #[test]
    fn inner_products_take_no_mass() {
        for basis in [compact(500, 20, 33), dense_basis(Precision::F64, 70)] {
            let n = basis.vertices();
            let x = DenseMatrix::from_columns(n, 2, (0..2 * n).map(|i| (i as f64).cos()).collect());
            let found = basis.inner_products(&x).unwrap();
            let modes: Vec<f64> = basis.lift(0..basis.count()).unwrap();
            for (mode, values) in modes.chunks(n).enumerate() {
                for k in 0..2 {
                    let expected: f64 = values.iter().zip(x.column(k)).map(|(a, b)| a * b).sum();
                    assert!((found.column(k)[mode] - expected).abs() < 1e-11);
                }
            }
            assert!(basis.inner_products(&DenseMatrix::zeros(n + 1, 1)).is_err());
        }
    }
}
