//! Fill-reducing orders for sparse factorisations.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use super::dissection::nested_dissection;
use super::{FactorError, SparseMatrix};

/// How the rows of a matrix are ordered before it is factored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ordering {
    /// Approximate minimum degree: quick to find.
    Amd,
    /// Nested dissection: takes longer to find, on one thread, and its factors are a third smaller on large meshes.
    NestedDissection,
}

/// An order in which the symmetric `matrix` fills in little when it is factored: entry `k` is the row that comes
/// `k`-th. It is a postorder of the elimination tree, without which supernodes would be three times narrower. The same
/// matrix always gets the same order.
///
/// # Errors
/// [`FactorError`]: a matrix that is not square, too large to be counted in 32 bits, or no memory.
pub fn fill_reducing_order(matrix: &SparseMatrix, ordering: Ordering) -> Result<Vec<u32>, FactorError> {
    let n = matrix.rows();
    if matrix.columns() != n {
        return Err(FactorError::Shape { rows: n, columns: matrix.columns(), mass: n });
    }
    if i32::try_from(matrix.entries().max(n)).is_err() {
        return Err(FactorError::TooLarge { entries: matrix.entries() });
    }
    if n == 0 {
        return Ok(Vec::new());
    }
    let order = match ordering {
        Ordering::Amd => minimum_degree(matrix)?,
        Ordering::NestedDissection => nested_dissection(matrix),
    };
    Ok(postorder(matrix, &order))
}

fn minimum_degree(matrix: &SparseMatrix) -> Result<Vec<u32>, FactorError> {
    let n = matrix.rows();
    let rows: Vec<usize> = matrix.indices().iter().map(|&i| i as usize).collect();
    let pattern = SymbolicSparseColMatRef::new_checked(n, n, matrix.offsets(), None, &rows);
    let (mut order, mut inverse) = (vec![0usize; n], vec![0usize; n]);
    let mut buffer = MemBuffer::try_new(amd::order_scratch::<usize>(n, rows.len()))
        .map_err(|_| FactorError::Memory { bytes: 16 * (n + rows.len()) })?;
    amd::order(&mut order, &mut inverse, pattern, Default::default(), MemStack::new(&mut buffer))
        .map_err(|error| FactorError::Ordering { reason: format!("{error:?}") })?;
    Ok(order.into_iter().map(|row| row as u32).collect())
}

/// The given order of all rows of the symmetric `matrix` as a postorder of its elimination tree, which has the same
/// fill: what an order that was found for a part of the matrix needs.
///
/// # Panics
/// Where it is not an order of the rows.
pub fn postordered(matrix: &SparseMatrix, order: &[u32]) -> Vec<u32> {
    let mut seen = vec![false; matrix.rows()];
    assert_eq!(order.len(), seen.len(), "rows of an order");
    order.iter().for_each(|&row| assert!(!std::mem::replace(&mut seen[row as usize], true), "row {row} comes twice"));
    postorder(matrix, order)
}

/// The elimination tree of the matrix in the given order, walked children first.
fn postorder(matrix: &SparseMatrix, order: &[u32]) -> Vec<u32> {
    const NONE: u32 = u32::MAX;
    let n = order.len();
    let mut position = vec![0u32; n];
    for (at, &row) in order.iter().enumerate() {
        position[row as usize] = at as u32;
    }
    // Liu's algorithm with path compression.
    let (mut parent, mut ancestor) = (vec![NONE; n], vec![NONE; n]);
    for at in 0..n {
        for &column in matrix.row(order[at] as usize).0 {
            let mut node = position[column as usize] as usize;
            while node < at {
                let above = std::mem::replace(&mut ancestor[node], at as u32);
                if above == NONE {
                    parent[node] = at as u32;
                    break;
                }
                node = above as usize;
            }
        }
    }
    let (mut first_child, mut next_sibling) = (vec![NONE; n], vec![NONE; n]);
    for node in (0..n).rev() {
        if parent[node] != NONE {
            next_sibling[node] = std::mem::replace(&mut first_child[parent[node] as usize], node as u32);
        }
    }
    let mut result = Vec::with_capacity(n);
    let mut path = Vec::new();
    for root in (0..n).filter(|&node| parent[node] == NONE) {
        path.push(root);
        while let Some(&node) = path.last() {
            let child = first_child[node];
            if child == NONE {
                path.pop();
                result.push(order[node]);
            } else {
                first_child[node] = next_sibling[child as usize];
                path.push(child as usize);
            }
        }
    }
    result
}
