//! From the columns that the basis constructions make to the rows that are stored.

use crate::basis::FieldSpace;

/// One locally supported group of `B` columns: the faces it lives on, ascending, and a `B × B` block for each, row `i`
/// of which holds number `i` of the face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column<const B: usize> {
    pub faces: Vec<u32>,
    pub blocks: Vec<[[f32; B]; B]>,
}

/// Turns columns into rows. `faces[f]` is the face that row `f` of the columns belongs to.
pub(super) fn from_columns<const B: usize>(columns: &[Column<B>], faces: &[u32]) -> FieldSpace {
    let mut offsets = vec![0u32; faces.len() + 1];
    for column in columns {
        for &f in &column.faces {
            offsets[faces[f as usize] as usize + 1] += 1;
        }
    }
    for f in 0..faces.len() {
        offsets[f + 1] += offsets[f];
    }
    let entries = offsets[faces.len()] as usize;
    let mut next: Vec<u32> = offsets[..faces.len()].to_vec();
    let (mut group_of, mut values) = (vec![0u32; entries], vec![0f32; B * B * entries]);
    for (group, column) in columns.iter().enumerate() {
        for (&f, block) in column.faces.iter().zip(&column.blocks) {
            let place = &mut next[faces[f as usize] as usize];
            let at = *place as usize;
            *place += 1;
            group_of[at] = group as u32;
            values[B * B * at..B * B * (at + 1)].copy_from_slice(block.as_flattened());
        }
    }
    FieldSpace::from_sorted_parts(B, columns.len(), offsets, group_of, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::FieldMisfit;

    fn space<const B: usize>() -> FieldSpace {
        let block = |s: f32| std::array::from_fn(|i| std::array::from_fn(|j| s + (3 * i + j) as f32 * 0.25));
        let columns = [
            Column::<B> { faces: vec![0, 1, 2], blocks: vec![block(1.0), block(-0.5), block(0.3)] },
            Column::<B> { faces: vec![2, 3], blocks: vec![block(0.7), block(-1.5)] },
        ];
        let dense = (0..4 * B).map(|i| i as f32 * 0.1 - 0.4).collect();
        from_columns(&columns, &[3, 0, 2, 1]).with_dense(vec![dense, vec![1.0]])
    }

    fn check<const B: usize>() {
        let space = space::<B>();
        assert_eq!((space.dimension(), space.faces(), space.entries(), space.uncovered()), (2 * B + 1, 4, 5, None));
        let x: Vec<f64> = (0..space.dimension()).map(|i| (i as f64 * 0.7).cos()).collect();
        let local = space.to_sparse().multiply(&x[..2 * B]);
        let expected: Vec<f64> =
            local.iter().zip(&space.dense()[0]).map(|(a, &u)| a + f64::from(u) * x[2 * B]).collect();
        let single: Vec<f32> = x.iter().map(|&v| v as f32).collect();
        let lifted = space.lift(&single).unwrap();
        assert!(lifted.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
        let some = space.lift_faces(&single, &[3, 0, 3]).unwrap();
        let picked = [&lifted[3 * B..4 * B], &lifted[..B], &lifted[3 * B..4 * B]].concat();
        assert!(some.iter().zip(&picked).all(|(a, b)| (a - b).abs() < 1e-6));
        assert_eq!(space.lift_faces(&single, &[3, 4]), Err(FieldMisfit::Face { place: 1, face: 4, faces: 4 }));
        let short = FieldMisfit::Numbers { what: "coefficients", found: 2 * B, expected: 2 * B + 1 };
        assert_eq!(space.lift_faces(&single[1..], &[0]), Err(short));
        let y: Vec<f64> = (0..4 * B).map(|i| (i as f64).sin()).collect();
        let back = space.transposed_times(&y);
        let (left, right): (f64, f64) =
            (back.iter().zip(&x).map(|(a, b)| a * b).sum(), y.iter().zip(&expected).map(|(a, b)| a * b).sum());
        assert!((left - right).abs() < 1e-12);
        assert_eq!(space.lift(&single[1..]), Err(short));
        let again = FieldSpace::from_parts(
            B,
            2,
            space.offsets().to_vec(),
            space.group_of().to_vec(),
            space.values().to_vec(),
            space.dense().to_vec(),
        );
        assert_eq!(again, Ok(space));
    }

    #[test]
    fn lifting_and_its_transpose_are_products_with_the_same_matrix() {
        check::<2>();
        check::<3>();
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let refuse = |block, offsets: Vec<u32>, groups: Vec<u32>, values| {
            FieldSpace::from_parts(block, 2, offsets, groups, vec![0.0; values], Vec::new()).is_err()
        };
        assert!(!refuse(2, vec![0, 2], vec![0, 1], 8));
        assert!(refuse(4, vec![0, 2], vec![0, 1], 8) && refuse(2, vec![0, 1], vec![0, 1], 8));
        assert!(refuse(2, vec![0, 2], vec![1, 0], 8) && refuse(2, vec![0, 2], vec![0, 2], 8));
        assert!(refuse(2, vec![0, 2], vec![0, 1], 7) && refuse(2, vec![], vec![0, 1], 8));
    }
}
