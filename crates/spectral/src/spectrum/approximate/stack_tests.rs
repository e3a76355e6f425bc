use super::*;

/// Some rows of a matrix in which row `r` has `r % 3` entries that tell where they are.
fn of(rows: &[u32]) -> (Vec<u32>, SparseMatrix<u32>) {
    let matrix = SparseMatrix::from_rows(
        rows.len(),
        9,
        || (),
        |(), at, entries| {
            let row = rows[at];
            entries.extend((0..row % 3).map(|k| (2 * k, row * 10 + k)));
        },
    );
    (rows.to_vec(), matrix)
}

#[test]
fn rows_of_several_matrices_are_stacked_where_they_belong() {
    let cases: Vec<Vec<&[u32]>> = vec![
        vec![],
        vec![&[1, 4, 5]],
        vec![&[5, 4]],
        vec![&[0, 7, 8], &[5, 2], &[]],
        vec![&[], &[1, 2, 3, 6, 9]],
        vec![&[0, 2, 4, 6, 8], &[9, 7, 5, 3, 1]],
    ];
    for pieces in cases {
        let mut stack = Stack::new(10, 9);
        pieces.iter().map(|rows| of(rows)).for_each(|(rows, piece)| stack.push(rows, piece));
        let all = stack.finish();
        assert_eq!((all.rows(), all.columns()), (10, 9));
        for row in 0..10u32 {
            let there = pieces.iter().any(|rows| rows.contains(&row));
            let count = if there { row % 3 } else { 0 };
            let expected: Vec<(u32, u32)> = (0..count).map(|k| (2 * k, row * 10 + k)).collect();
            let (columns, values) = all.row(row as usize);
            assert!(columns.iter().copied().zip(values.iter().copied()).eq(expected), "{pieces:?}: row {row}");
        }
    }
}
