//! Compact blocks of rows: neighbours in a sparse matrix end up in the same block, so that what a block needs stays in
//! cache.

use super::SparseMatrix;

/// An order of the rows of a symmetric matrix in which each run of about `size` rows is a compact patch of its graph.
///
/// Patches are grown breadth first, each from what the one before it left at its rim. Linear in the entries.
pub fn compact_order<T>(matrix: &SparseMatrix<T>, size: usize) -> Vec<u32> {
    let n = matrix.rows();
    let size = size.max(1);
    let mut order: Vec<u32> = Vec::with_capacity(n);
    // A row is queued at most once in each patch, and ordered once.
    let mut queued_in = vec![0u32; n];
    let mut ordered = vec![false; n];
    let mut rim: Vec<u32> = Vec::new();
    let mut unseen = 0;
    let mut patch = 0;
    while order.len() < n {
        patch += 1;
        let seed = rim.iter().copied().find(|&row| !ordered[row as usize]).or_else(|| {
            while unseen < n && ordered[unseen] {
                unseen += 1;
            }
            (unseen < n).then_some(unseen as u32)
        });
        let Some(seed) = seed else { break };
        rim.clear();
        rim.push(seed);
        queued_in[seed as usize] = patch;
        let (mut head, mut taken) = (0, 0);
        while head < rim.len() && taken < size {
            let row = rim[head];
            head += 1;
            ordered[row as usize] = true;
            order.push(row);
            taken += 1;
            for &neighbour in matrix.row(row as usize).0 {
                let at = neighbour as usize;
                if at < n && !ordered[at] && queued_in[at] != patch {
                    queued_in[at] = patch;
                    rim.push(neighbour);
                }
            }
        }
        rim.drain(..head);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The five-point graph of a `k × k` grid, and one row that is connected to nothing.
    fn grid(k: usize) -> SparseMatrix {
        let (mut offsets, mut indices) = (vec![0], Vec::new());
        for row in 0..k * k {
            let (x, y) = (row % k, row / k);
            let mut add = |there: bool, column: usize| {
                if there {
                    indices.push(column as u32);
                }
            };
            add(y > 0, row.wrapping_sub(k));
            add(x > 0, row.wrapping_sub(1));
            add(true, row);
            add(x + 1 < k, row + 1);
            add(y + 1 < k, row + k);
            offsets.push(indices.len());
        }
        indices.push((k * k) as u32);
        offsets.push(indices.len());
        let values = vec![1.0; indices.len()];
        SparseMatrix::new(k * k + 1, k * k + 1, offsets, indices, values).unwrap()
    }

    #[test]
    fn every_row_comes_once_and_blocks_are_compact() {
        let matrix = grid(60);
        for size in [1, 7, 144, 10_000] {
            let order = compact_order(&matrix, size);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.iter().enumerate().all(|(i, &row)| i == row as usize) && sorted.len() == 3601);
        }
        let order = compact_order(&matrix, 144);
        let rims: usize = order
            .chunks(144)
            .map(|block| {
                let mut rim: Vec<u32> = block.iter().flat_map(|&r| matrix.row(r as usize).0.to_vec()).collect();
                rim.sort_unstable();
                rim.dedup();
                rim.retain(|r| !block.contains(r));
                rim.len()
            })
            .sum();
        // Squares of 12 × 12 have a rim of 48 rows; strips of rows would have 120.
        assert!(rims < 25 * 75, "{rims}");
    }

    #[test]
    fn a_matrix_without_rows_has_an_empty_order() {
        let empty: SparseMatrix = SparseMatrix::from_sorted_parts(0, 0, vec![0], Vec::new(), Vec::new());
        assert!(compact_order(&empty, 5).is_empty());
    }
}
