//! Products with `U` and `Uᵀ` for a few vectors at a time: what evaluating in a basis comes down to.

use chladni_base::parallel::*;

use super::{DenseMatrix, MassMatrix, SparseMatrix, WeightedMass, row_parts, vectorized};

/// Rows that one task handles, at least.
const LEAST_ROWS: usize = 4096;

/// Tasks that `Uᵀ x` is summed over, at most; fixed, so that the sum does not depend on the number of threads.
const MOST_TASKS: usize = 32;

/// `U c` for a sparse `U`, `n × d`, and `c`, `d × k`: `n × k`. In f64, in parallel.
///
/// # Panics
/// Where sizes do not fit.
pub fn space_times(space: &SparseMatrix<f32>, coefficients: &DenseMatrix) -> DenseMatrix {
    let mut product = DenseMatrix::zeros(space.rows(), coefficients.columns());
    expanded(space, coefficients, product.values_mut(), |value| value);
    product
}

/// The same, each number rounded to single precision at the end: `k` columns of `n` numbers, one after the other.
///
/// # Panics
/// Where sizes do not fit.
pub fn space_times_single(space: &SparseMatrix<f32>, coefficients: &DenseMatrix) -> Vec<f32> {
    let mut product = vec![0.0; space.rows() * coefficients.columns()];
    expanded(space, coefficients, &mut product, |value| value as f32);
    product
}

fn expanded<T: Send>(
    space: &SparseMatrix<f32>,
    coefficients: &DenseMatrix,
    product: &mut [T],
    narrow: impl Fn(f64) -> T + Sync,
) {
    assert_eq!(coefficients.rows(), space.columns(), "rows of the coefficients, columns of the space");
    each_group(coefficients.columns(), |group| match group.len() {
        1 => expand::<1, T>(space, coefficients, group, product, &narrow),
        2 => expand::<2, T>(space, coefficients, group, product, &narrow),
        3 | 4 => expand::<4, T>(space, coefficients, group, product, &narrow),
        _ => expand::<8, T>(space, coefficients, group, product, &narrow),
    });
}

/// `Uᵀ M x` for a sparse `U`, `n × d`, a mass `M` and `x`, `n × k`: `d × k`. In f64, in parallel.
///
/// # Panics
/// Where sizes do not fit.
pub fn space_transposed_mass_times(
    space: &SparseMatrix<f32>,
    mass: &MassMatrix,
    functions: &DenseMatrix,
) -> DenseMatrix {
    assert_eq!(
        [functions.rows(), mass.size()],
        [space.rows(); 2],
        "rows of the functions and of the mass, rows of the space"
    );
    let weighted;
    let (weights, functions) = match mass {
        MassMatrix::Diagonal(weights) => (Some(&weights[..]), functions),
        MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
            weighted = matrix.multiply_dense(functions);
            (None, &weighted)
        }
    };
    let mut product = DenseMatrix::zeros(space.columns(), functions.columns());
    each_group(functions.columns(), |group| match group.len() {
        1 => gather::<1>(space, weights, functions, group, &mut product),
        2 => gather::<2>(space, weights, functions, group, &mut product),
        3 | 4 => gather::<4>(space, weights, functions, group, &mut product),
        _ => gather::<8>(space, weights, functions, group, &mut product),
    });
    product
}

/// Columns in groups of at most eight.
fn each_group(columns: usize, mut act: impl FnMut(std::ops::Range<usize>)) {
    for from in (0..columns).step_by(8) {
        act(from..columns.min(from + 8));
    }
}

fn expand<const K: usize, T: Send>(
    space: &SparseMatrix<f32>,
    coefficients: &DenseMatrix,
    group: std::ops::Range<usize>,
    product: &mut [T],
    narrow: &(impl Fn(f64) -> T + Sync),
) {
    let mut table = vec![[0.0; K]; space.columns()];
    for (k, column) in group.clone().enumerate() {
        table.iter_mut().zip(coefficients.column(column)).for_each(|(row, &c)| row[k] = c);
    }
    // Each task owns some rows of every column: they are turned while they are in the cache.
    let n = space.rows();
    let tasks = row_parts(&mut product[group.start * n..group.end * n], n, LEAST_ROWS);
    tasks.into_par_iter().enumerate().for_each(|(task, mut columns)| {
        let mut panel = vec![[0.0; K]; columns.first().map_or(0, |column| column.len())];
        vectorized(
            &mut panel,
            #[inline(always)]
            |panel| {
                for (k, out) in panel.iter_mut().enumerate() {
                    let (columns, values) = space.row(task * LEAST_ROWS + k);
                    let mut acc = [0.0; K];
                    for (&column, &value) in columns.iter().zip(values) {
                        let (row, value) = (&table[column as usize], f64::from(value));
                        for k in 0..K {
                            acc[k] += value * row[k];
                        }
                    }
                    *out = acc;
                }
            },
        );
        for (k, column) in columns.iter_mut().enumerate() {
            column.iter_mut().zip(&panel).for_each(|(value, row)| *value = narrow(row[k]));
        }
    });
}

fn gather<const K: usize>(
    space: &SparseMatrix<f32>,
    weights: Option<&[f64]>,
    functions: &DenseMatrix,
    group: std::ops::Range<usize>,
    product: &mut DenseMatrix,
) {
    let n = space.rows();
    let per_task = n.div_ceil(MOST_TASKS).max(LEAST_ROWS);
    let sums: Vec<Vec<[f64; K]>> = (0..n.div_ceil(per_task))
        .into_par_iter()
        .map(|task| {
            let mut table = vec![[0.0; K]; space.columns()];
            let inputs: Vec<&[f64]> = group.clone().map(|column| functions.column(column)).collect();
            vectorized(
                &mut table,
                #[inline(always)]
                |table| {
                    for row in task * per_task..n.min((task + 1) * per_task) {
                        let mut x = [0.0; K];
                        let weight = weights.map_or(1.0, |weights| weights[row]);
                        for (x, input) in x.iter_mut().zip(&inputs) {
                            *x = weight * input[row];
                        }
                        let (columns, values) = space.row(row);
                        for (&column, &value) in columns.iter().zip(values) {
                            let (sum, value) = (&mut table[column as usize], f64::from(value));
                            for k in 0..K {
                                sum[k] += value * x[k];
                            }
                        }
                    }
                },
            );
            table
        })
        .collect();
    for (k, column) in group.enumerate() {
        let column = product.column_mut(column);
        for table in &sums {
            column.iter_mut().zip(table).for_each(|(value, row)| *value += row[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn space(n: usize, d: usize) -> SparseMatrix<f32> {
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..n {
            for column in (row % 3..d).step_by(1 + row % 5) {
                indices.push(column as u32);
                values.push(((row * 31 + column * 17) % 101) as f32 / 64.0 - 0.5);
            }
            offsets.push(indices.len());
        }
        SparseMatrix::new(n, d, offsets, indices, values).unwrap()
    }

    fn waves(rows: usize, columns: usize) -> DenseMatrix {
        DenseMatrix::from_columns(rows, columns, (0..rows * columns).map(|i| (i as f64 * 0.37).sin()).collect())
    }

    #[test]
    fn products_with_any_number_of_vectors_agree_with_the_dense_ones() {
        let n = 2 * LEAST_ROWS + 77;
        let u = space(n, 6);
        let weights: Vec<f64> = (0..n).map(|i| 0.5 + (i % 7) as f64).collect();
        let mass = MassMatrix::Diagonal(weights.clone());
        let diagonal = MassMatrix::Sparse(
            SparseMatrix::new(n, n, (0..=n).collect(), (0..n as u32).collect(), weights.clone()).unwrap(),
        );
        for k in [0, 1, 2, 3, 4, 5, 8, 11] {
            let c = waves(6, k);
            let product = space_times(&u, &c);
            let x = waves(n, k);
            let gathered = space_transposed_mass_times(&u, &mass, &x);
            assert_eq!(gathered, space_transposed_mass_times(&u, &diagonal, &x));
            for column in 0..k {
                let mut expected = vec![0.0; 6];
                for row in 0..n {
                    let (columns, values) = u.row(row);
                    let mut sum = 0.0;
                    for (&p, &value) in columns.iter().zip(values) {
                        sum += f64::from(value) * c.column(column)[p as usize];
                        expected[p as usize] += f64::from(value) * weights[row] * x.column(column)[row];
                    }
                    assert!((product.column(column)[row] - sum).abs() < 1e-13);
                }
                assert!(gathered.column(column).iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-8));
            }
        }
    }

    #[test]
    #[should_panic = "rows of the coefficients"]
    fn coefficients_of_another_space_are_a_mistake_of_the_caller() {
        space_times(&space(10, 4), &waves(5, 1));
    }

    #[test]
    #[should_panic = "of the mass"]
    fn a_mass_of_another_space_is_a_mistake_of_the_caller() {
        space_transposed_mass_times(&space(10, 4), &MassMatrix::Diagonal(vec![1.0; 9]), &waves(10, 1));
    }
}
