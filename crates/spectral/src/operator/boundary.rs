//! The Dirichlet condition: boundary vertices are taken out of the unknowns.

use chladni_algebra::{SparseMatrix, WeightedMass};

use super::{EigenProblem, MassMatrix, OperatorError};

/// The problem without the rows and columns of `removed` vertices, given in any order. Its size is unchanged, and its mass no longer
/// sums to 1.
///
/// # Errors
/// [`OperatorError::NoUnknowns`] where no vertex is left.
pub(crate) fn without(problem: &EigenProblem, removed: &[u32]) -> Result<EigenProblem, OperatorError> {
    let n = problem.size();
    let mut numbers = vec![0u32; n];
    removed.iter().for_each(|&v| numbers[v as usize] = u32::MAX);
    let mut unknowns = Vec::with_capacity(n.saturating_sub(removed.len()));
    for (v, number) in numbers.iter_mut().enumerate() {
        if *number == 0 {
            *number = unknowns.len() as u32;
            unknowns.push(v as u32);
        }
    }
    if unknowns.is_empty() {
        return Err(OperatorError::NoUnknowns { vertices: n });
    }
    let mass = match &problem.mass {
        MassMatrix::Diagonal(mass) => MassMatrix::Diagonal(unknowns.iter().map(|&v| mass[v as usize]).collect()),
        MassMatrix::Sparse(mass) => MassMatrix::Sparse(principal(mass, &unknowns, &numbers)),
        // What is less than a multiple of a matrix is so on some of its rows.
        MassMatrix::Weighted(mass) => MassMatrix::Weighted(WeightedMass {
            matrix: principal(&mass.matrix, &unknowns, &numbers),
            weights: unknowns.iter().map(|&v| mass.weights[v as usize]).collect(),
            ratio: mass.ratio,
        }),
    };
    let stiffness = principal(&problem.stiffness, &unknowns, &numbers);
    Ok(EigenProblem { stiffness, mass, area: problem.area, unknowns: Some(unknowns) })
}

/// Some rows of a matrix and the columns of the same numbers; `numbers` has the new number of each old one, or `u32::MAX`.
fn principal(matrix: &SparseMatrix, rows: &[u32], numbers: &[u32]) -> SparseMatrix {
    let mut offsets = Vec::with_capacity(rows.len() + 1);
    let (mut indices, mut values) = (Vec::with_capacity(matrix.entries()), Vec::with_capacity(matrix.entries()));
    offsets.push(0);
    for &row in rows {
        let (columns, entries) = matrix.row(row as usize);
        for (&column, &entry) in columns.iter().zip(entries) {
            let number = numbers[column as usize];
            if number != u32::MAX {
                indices.push(number);
                values.push(entry);
            }
        }
        offsets.push(indices.len());
    }
    SparseMatrix::from_sorted_parts(rows.len(), rows.len(), offsets, indices, values)
}
