//! The extrinsic family: the Laplacian, blended with one that also sees how the normal turns.
//!
//! | | |
//! |---|---|
//! | shape | `n × n`, `(1 − t) S + t A` with `A_ij = ⟨N_i, N_j⟩ S_ij`, so `A_ii = S_ii`, for unit vertex normals `N` |
//! | definiteness | positive semi-definite on any mesh: `A = Σ_c D_c S D_c`, `D_c` the diagonal of the c-th coordinates of the normals |
//! | kernel | for `t > 0` the functions constant on the components whose normals are all equal, and 0 on the others: none on a closed surface |
//! | meaning | `uᵀAu = ∫ \|∇(u N)\|²`, which tends to `∫ \|∇u\|² + (κ₁² + κ₂²) u²`: a Hamiltonian with the potential `t (κ₁² + κ₂²)` |
//! | units | as the Laplacian |
//! | valid for | surfaces whose orientation is consistent; at a seam where it is not, the normal jumps and eigenfunctions avoid it |
//! | source | thesis, eq. 2.13 |

use chladni_algebra::SparseMatrix;
use chladni_base::parallel::*;

/// `(1 − t) S + t A`. `normals` are unit vectors, one for each row of `stiffness`.
pub fn blend(stiffness: &SparseMatrix, normals: &[[f64; 3]], t: f64) -> SparseMatrix {
    let n = stiffness.rows();
    let rows: Vec<Vec<f64>> = (0..n)
        .into_par_iter()
        .with_min_len(4096)
        .map(|row| {
            let (columns, values) = stiffness.row(row);
            let own = normals[row];
            let entry = |(&column, &value): (&u32, &f64)| {
                if column as usize == row {
                    return value;
                }
                let other = normals[column as usize];
                // 1 − t + t⟨N, N'⟩, written so that equal normals give the value itself.
                let turn: f64 = (0..3).map(|k| (own[k] - other[k]).powi(2)).sum();
                value * (1.0 - 0.5 * t * turn)
            };
            columns.iter().zip(values).map(entry).collect()
        })
        .collect();
    SparseMatrix::from_sorted_parts(
        n,
        stiffness.columns(),
        stiffness.offsets().to_vec(),
        stiffness.indices().to_vec(),
        rows.concat(),
    )
}
