//! Which columns of a matrix are independent of the others, by a Cholesky factorisation with pivots of their Gram
//! matrix.

use chladni_base::parallel::*;

use super::DenseMatrix;

/// The columns, ascending, that a greedy choice keeps: always the one farthest from the span of those it already has,
/// until none is farther than `least` times its own length. `gram`, `d × d` and symmetric, holds the products of the
/// columns; a column of length zero is never kept.
pub fn independent_columns(gram: &DenseMatrix, least: f64) -> Vec<usize> {
    let d = gram.rows().min(gram.columns());
    let scales: Vec<f64> = (0..d)
        .map(|k| gram.column(k)[k])
        .map(|square| if square > 0.0 && square.is_finite() { square.sqrt().recip() } else { 0.0 })
        .collect();
    // Squared distances from the span of what is kept, over squared lengths.
    let mut left: Vec<f64> = scales.iter().map(|&scale| f64::from(u8::from(scale > 0.0))).collect();
    let mut kept = Vec::new();
    // Row `i` of the factor, whose columns are in the order of the pivots.
    let mut rows: Vec<Vec<f64>> = vec![Vec::new(); d];
    while let Some(pivot) = (0..d).reduce(|best, k| if left[k] > left[best] { k } else { best }) {
        if !(left[pivot] > least * least) {
            break;
        }
        let root = left[pivot].sqrt();
        let (own, column) = (std::mem::take(&mut rows[pivot]), gram.column(pivot));
        left.par_iter_mut().zip(&mut rows).enumerate().with_min_len(64).for_each(|(k, (left, row))| {
            if k == pivot || *left <= 0.0 {
                return;
            }
            let product: f64 = row.iter().zip(&own).map(|(a, b)| a * b).sum();
            let entry = (column[k] * scales[k] * scales[pivot] - product) / root;
            row.push(entry);
            *left -= entry * entry;
        });
        left[pivot] = 0.0;
        kept.push(pivot);
    }
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gram(columns: &[Vec<f64>]) -> DenseMatrix {
        let (d, n) = (columns.len(), columns[0].len());
        let matrix = DenseMatrix::from_columns(n, d, columns.concat());
        matrix.transposed_times(&matrix)
    }

    #[test]
    fn one_column_of_a_dependent_set_is_left_out_whatever_the_lengths() {
        let wave = |k: usize| (0..40).map(|i| ((i * k) as f64 * 0.37 + k as f64).sin()).collect::<Vec<f64>>();
        let mut columns: Vec<Vec<f64>> = (1..8).map(wave).collect();
        columns[3] = columns[1].iter().zip(&columns[5]).map(|(a, b)| 1e-6 * (a - 2.0 * b)).collect();
        columns.push(vec![0.0; 40]);
        let kept = independent_columns(&gram(&columns), 1e-4);
        assert_eq!(kept.len(), 6);
        assert!(!kept.contains(&7) && [1, 3, 5].iter().filter(|k| kept.contains(k)).count() == 2);
        // A bump of a hundredth makes it independent for a looser bound alone.
        columns[3][7] += 1e-8 * columns[1].iter().map(|x| x * x).sum::<f64>().sqrt();
        assert_eq!(independent_columns(&gram(&columns), 1e-4).len(), 7);
        assert_eq!(independent_columns(&gram(&columns), 0.1).len(), 6);
        assert!(independent_columns(&DenseMatrix::zeros(0, 0), 0.1).is_empty());
    }
}
