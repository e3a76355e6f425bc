//! How many eigenvalues lie below a shift, for whoever doubts it: a factorisation that shares nothing with
//! [`SymbolicFactor`](super::SymbolicFactor) but the matrices. Order, supernodes and Bunch–Kaufman pivots inside them
//! are all faer's.

use faer::Par;
use faer::Side;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::reborrow::Reborrow;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SupernodalIntranodeLbltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};

use super::{FactorError, MassMatrix, SparseMatrix, WeightedMass};
use chladni_base::Monitor;

/// The number of eigenvalues of the pencil `(a, b)` below `shift`, with multiplicity, by the inertia of `a − shift · b`
/// (Sylvester).
///
/// Both are symmetric with both triangles stored, `b` is positive definite. Rounding errors are not enclosed: the count
/// of a shift next to an eigenvalue may be off.
///
/// # Errors
/// [`FactorError`]: sizes that do not fit, no memory, a factor that takes more of it than `monitor` promises, or a
/// shift on an eigenvalue.
pub fn eigenvalues_below(
    a: &SparseMatrix,
    b: &MassMatrix,
    shift: f64,
    monitor: &dyn Monitor,
) -> Result<usize, FactorError> {
    let n = a.rows();
    if a.columns() != n || b.size() != n {
        return Err(FactorError::Shape { rows: n, columns: a.columns(), mass: b.size() });
    }
    if n == 0 {
        return Ok(0);
    }
    let shifted = upper_triangle(a, b, shift)?;
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
        ..Default::default()
    };
    let no_order = |reason: String| FactorError::Ordering { reason };
    let symbolic = factorize_symbolic_cholesky(shifted.symbolic(), Side::Upper, SymmetricOrdering::Amd, parameters)
        .map_err(|error| no_order(format!("{error:?}")))?;
    let SymbolicCholeskyRaw::Supernodal(nodes) = symbolic.raw() else {
        return Err(no_order("there are no supernodes".to_owned()));
    };
    let (entries, bytes) = (symbolic.len_val(), 10 * symbolic.len_val() as u64);
    if let Some(promised) = monitor.promised_bytes().filter(|&promised| bytes > promised) {
        return Err(FactorError::Promise { entries, bytes, promised });
    }
    let no_memory = || FactorError::Memory { bytes: 8 * symbolic.len_val() };
    let mut values: Vec<f64> = Vec::new();
    values.try_reserve_exact(symbolic.len_val()).map_err(|_| no_memory())?;
    values.resize(symbolic.len_val(), 0.0);
    let mut off_diagonal = vec![0.0; n];
    let (mut forward, mut inverse) = (vec![0usize; n], vec![0usize; n]);
    let par = if rayon::current_num_threads() > 1 { Par::rayon(0) } else { Par::Seq };
    let request = symbolic.factorize_numeric_intranode_lblt_scratch::<f64>(par, Default::default());
    let mut buffer = MemBuffer::try_new(request).map_err(|_| no_memory())?;
    symbolic.factorize_numeric_intranode_lblt(
        &mut values,
        &mut off_diagonal,
        &mut forward,
        &mut inverse,
        shifted.rb(),
        Side::Upper,
        par,
        MemStack::new(&mut buffer),
        Default::default(),
    );
    let factor =
        SupernodalIntranodeLbltRef::new(nodes, &values, &off_diagonal, PermRef::new_checked(&forward, &inverse, n));
    let mut below = 0;
    for node in 0..nodes.n_supernodes() {
        let node = factor.supernode(node);
        let (start, block) = (node.start(), node.val());
        let mut k = 0;
        while k < block.ncols() {
            let (first, coupling) = (block[(k, k)], off_diagonal[start + k]);
            let singular = |ok: bool| if ok { Ok(()) } else { Err(FactorError::Singular { pivot: start + k }) };
            if coupling == 0.0 {
                singular(first != 0.0 && first.is_finite())?;
                below += usize::from(first < 0.0);
                k += 1;
            } else {
                // A block of two with eigenvalues of either sign, or of its own where its determinant is positive.
                let second = block[(k + 1, k + 1)];
                let determinant = first * second - coupling * coupling;
                singular(determinant != 0.0 && determinant.is_finite())?;
                below += if determinant < 0.0 { 1 } else { 2 * usize::from(first < 0.0) };
                k += 2;
            }
        }
    }
    Ok(below)
}

/// The upper triangle of `a − shift · b`.
fn upper_triangle(a: &SparseMatrix, b: &MassMatrix, shift: f64) -> Result<SparseColMat<usize, f64>, FactorError> {
    let n = a.rows();
    let mut entries = Vec::with_capacity(a.entries() + n);
    let mut add = |row: usize, columns: &[u32], values: &[f64], factor: f64| {
        for (&column, value) in columns.iter().zip(values) {
            if column as usize >= row {
                entries.push(Triplet::new(row, column as usize, factor * value));
            }
        }
    };
    for row in 0..n {
        let (columns, values) = a.row(row);
        add(row, columns, values, 1.0);
        match b {
            MassMatrix::Diagonal(diagonal) => add(row, &[row as u32], &[diagonal[row]], -shift),
            MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
                let (columns, values) = matrix.row(row);
                add(row, columns, values, -shift);
            }
        }
    }
    // Entries of one place are added up.
    SparseColMat::try_new_from_triplets(n, n, &entries)
        .map_err(|error| FactorError::Ordering { reason: format!("{error:?}") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ordering, SymbolicFactor, fill_reducing_order};
    use chladni_base::Unwatched;

    /// The five-point Laplacian on a grid.
    fn grid(width: usize, height: usize) -> SparseMatrix {
        let at = |x: usize, y: usize| (y * width + x) as u32;
        let (mut offsets, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
        for y in 0..height {
            for x in 0..width {
                let mut row = vec![(at(x, y), 4.0)];
                for (dx, dy) in [(0i64, -1i64), (-1, 0), (1, 0), (0, 1)] {
                    let (x, y) = (x as i64 + dx, y as i64 + dy);
                    if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                        row.push((at(x as usize, y as usize), -1.0));
                    }
                }
                row.sort_by_key(|entry| entry.0);
                for (column, value) in row {
                    indices.push(column);
                    values.push(value);
                }
                offsets.push(indices.len());
            }
        }
        SparseMatrix::from_sorted_parts(width * height, width * height, offsets, indices, values)
    }

    #[test]
    fn counts_are_those_of_the_analytic_spectrum_and_of_the_other_factor() {
        let (width, height) = (23, 17);
        let a = grid(width, height);
        let masses = MassMatrix::Diagonal(vec![1.0; width * height]);
        let term = |k: usize, n: usize| 2.0 - 2.0 * (std::f64::consts::PI * k as f64 / (n + 1) as f64).cos();
        let mut exact: Vec<f64> =
            (1..=width).flat_map(|i| (1..=height).map(move |j| term(i, width) + term(j, height))).collect();
        exact.sort_by(f64::total_cmp);
        let order = fill_reducing_order(&a, Ordering::Amd).unwrap();
        let (reordered, mass) = (a.reordered(&order), masses.reordered(&order));
        let symbolic = SymbolicFactor::new(&reordered, &mass).unwrap();
        for k in (0..exact.len() - 1).filter(|&k| exact[k + 1] - exact[k] > 1e-9) {
            let shift = 0.5 * (exact[k] + exact[k + 1]);
            assert_eq!(eigenvalues_below(&a, &masses, shift, &Unwatched).unwrap(), k + 1, "at {shift}");
            assert_eq!(symbolic.factor(&reordered, &mass, shift).unwrap().eigenvalues_below(), k + 1);
        }
        assert_eq!(eigenvalues_below(&a, &masses, -1.0, &Unwatched).unwrap(), 0);
        assert_eq!(eigenvalues_below(&a, &masses, 9.0, &Unwatched).unwrap(), exact.len());
    }

    #[test]
    fn a_consistent_mass_and_sizes_that_do_not_fit() {
        let a = grid(8, 8);
        // 2 on the diagonal and couplings of a quarter of the grid's.
        let values = a.values().iter().map(|&v| if v > 0.0 { 2.0 } else { 0.25 }).collect();
        let b = SparseMatrix::from_sorted_parts(64, 64, a.offsets().to_vec(), a.indices().to_vec(), values);
        // Both have the eigenvectors of the grid: (4 − s) over (2 + s/4), s the sum of the neighbours' cosines.
        let cosine = |k: usize| 2.0 * (std::f64::consts::PI * k as f64 / 9.0).cos();
        let exact: Vec<f64> = (1..=8)
            .flat_map(|i| (1..=8).map(move |j| cosine(i) + cosine(j)))
            .map(|s| (4.0 - s) / (2.0 + 0.25 * s))
            .collect();
        for shift in [0.3, 1.1, 2.7, 5.0] {
            let below = exact.iter().filter(|&&value| value < shift).count();
            assert_eq!(eigenvalues_below(&a, &MassMatrix::Sparse(b.clone()), shift, &Unwatched).unwrap(), below);
        }
        let short = eigenvalues_below(&a, &MassMatrix::Diagonal(vec![1.0; 3]), 0.0, &Unwatched);
        assert_eq!(short, Err(FactorError::Shape { rows: 64, columns: 64, mass: 3 }));
    }
}
