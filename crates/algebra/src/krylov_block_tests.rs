use chladni_base::{SplitMix64, Unwatched};

use super::*;

fn block(rows: usize, random: &mut SplitMix64) -> Vec<KrylovRow> {
    (0..rows).map(|_| std::array::from_fn(|_| random.signed_unit())).collect()
}

/// A basis of some blocks.
fn basis(rows: usize, blocks: usize, random: &mut SplitMix64) -> PanelMatrix {
    let mut basis = PanelMatrix::zeros(rows, 0);
    let blocks: Vec<Vec<KrylovRow>> = (0..blocks).map(|_| block(rows, random)).collect();
    blocks.chunks(PANEL_WIDTH / KRYLOV_WIDTH).for_each(|blocks| append_blocks(&mut basis, blocks, &mut Vec::new()));
    basis
}

#[test]
fn products_with_a_basis_are_those_of_panels() {
    let mut random = SplitMix64::new(3);
    for (rows, columns, more) in [(1, 1, 0), (300, 4, 3), (2 * ROWS_PER_TASK + 77, 8, 1), (500, 0, 2), (500, 0, 0)] {
        let panels = basis(rows, columns, &mut random);
        let blocks: Vec<Vec<KrylovRow>> = (0..more).map(|_| block(rows, &mut random)).collect();
        let y = block(rows, &mut random);
        // All of them as panels.
        let all: Vec<Vec<f64>> = (0..panels.columns())
            .map(|k| panels.column(k))
            .chain(blocks.iter().flat_map(|block| (0..8).map(|k| block.iter().map(|row| row[k]).collect())))
            .collect();
        let [first, found] = basis_products((&panels, &blocks), [&block(rows, &mut random), &y], &Unwatched).unwrap();
        assert_eq!(first.len(), found.len());
        // A panel that is not full has columns of zeros.
        let kept: Vec<&KrylovRow> = found
            .iter()
            .enumerate()
            .filter(|&(k, _)| k < panels.columns() || k >= panels.panels().len() * PANEL_WIDTH)
            .map(|(_, row)| row)
            .collect();
        assert_eq!(kept.len(), all.len());
        for (found, column) in kept.iter().zip(&all) {
            for k in 0..KRYLOV_WIDTH {
                let sum: f64 = column.iter().zip(&y).map(|(x, y)| x * y[k]).sum();
                assert!((found[k] - sum).abs() < 1e-9, "{} and {sum}", found[k]);
            }
        }
        let mut after = y.clone();
        let [ref mut twice, mut other] = [after.clone(), after.clone()];
        subtract_from_blocks([&mut after], (&panels, &blocks), std::array::from_ref(&found), &Unwatched).unwrap();
        subtract_from_blocks([&mut other, twice], (&panels, &blocks), &[first, found.clone()], &Unwatched).unwrap();
        assert!(after == *twice && (after != other || all.is_empty()), "blocks that are handled together");
        for row in [0, rows / 2, rows - 1] {
            for k in 0..KRYLOV_WIDTH {
                let sum: f64 = all.iter().zip(&kept).map(|(column, found)| column[row] * found[k]).sum();
                assert!((y[row][k] - sum - after[row][k]).abs() < 1e-8 * (1.0 + sum.abs()));
            }
        }
    }
}

#[test]
fn products_of_blocks_are_sums_over_rows() {
    let mut random = SplitMix64::new(4);
    let n = ROWS_PER_TASK + 13;
    let (x, y, z) = (block(n, &mut random), block(n, &mut random), block(n, &mut random));
    let weights: Vec<f64> = (0..n).map(|_| 1.5 + random.signed_unit()).collect();
    let mass = MassMatrix::Diagonal(weights.clone());
    let (products, gram) = (block_products(&x, &y), block_gram(&mass, &x, &mut Vec::new()));
    let mut image = Vec::new();
    mass_times_block(&mass, &x, &mut image);
    for j in 0..KRYLOV_WIDTH {
        for k in 0..KRYLOV_WIDTH {
            let sum: f64 = x.iter().zip(&y).map(|(x, y)| x[j] * y[k]).sum();
            assert!((products[j][k] - sum).abs() < 1e-10);
            let sum: f64 = x.iter().zip(&image).map(|(x, image)| x[j] * image[k]).sum();
            assert!((gram[j][k] - sum).abs() < 1e-10 && (image[3][j] - weights[3] * x[3][j]).abs() < 1e-15);
        }
    }
    let mut after = z.clone();
    subtract_blocks(&mut after, &[(&x, products), (&y, gram)]);
    let mut turned = z.clone();
    block_times_square(&mut turned, &gram);
    for row in [0, ROWS, n - 1] {
        for k in 0..KRYLOV_WIDTH {
            let sum: f64 = (0..KRYLOV_WIDTH).map(|j| x[row][j] * products[j][k] + y[row][j] * gram[j][k]).sum();
            assert!((z[row][k] - sum - after[row][k]).abs() < 1e-8);
            let sum: f64 = (0..KRYLOV_WIDTH).map(|j| z[row][j] * gram[j][k]).sum();
            assert!((sum - turned[row][k]).abs() < 1e-8);
        }
    }
}
