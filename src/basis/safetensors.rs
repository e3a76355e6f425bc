//! A basis as a safetensors file.

use std::collections::HashMap;

use safetensors::tensor::{Dtype, TensorView, serialize};

use super::{Basis, npz::FormatError};
use crate::algebra::MassMatrix;

/// A basis as the bytes of a safetensors file: `space.data`, `space.indices`, `space.indptr` (CSR, `n × d`), `coefficients`
/// (`d × m`, rows first), `eigenvalues`, `residuals`, `bounds` and `mass` or `mass.data`, `mass.indices`, `mass.indptr`. The entry
/// `chladni` of the file's metadata is a JSON text with the shape of `U`, the certificate and how the basis was made.
///
/// # Errors
/// [`FormatError::Member`] where the library refuses a tensor.
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let refused = |error: safetensors::SafeTensorError| FormatError::Member {
        member: "safetensors".to_owned(),
        reason: error.to_string(),
    };
    let (d, m) = (basis.coefficients.rows(), basis.coefficients.columns());
    let mut by_rows = vec![0.0; d * m];
    for column in 0..m {
        for (row, &value) in basis.coefficients.column(column).iter().enumerate() {
            by_rows[row * m + column] = value;
        }
    }
    let offsets = |offsets: &[usize]| offsets.iter().map(|&offset| offset as i64).collect::<Vec<_>>();
    let space_offsets = offsets(basis.space.offsets());
    let mut tensors: Vec<(&str, Dtype, Vec<usize>, &[u8])> = vec![
        ("space.data", Dtype::F32, vec![basis.space.entries()], bytemuck::cast_slice(basis.space.values())),
        ("space.indices", Dtype::I32, vec![basis.space.entries()], bytemuck::cast_slice(basis.space.indices())),
        ("space.indptr", Dtype::I64, vec![space_offsets.len()], bytemuck::cast_slice(&space_offsets)),
        ("coefficients", Dtype::F64, vec![d, m], bytemuck::cast_slice(&by_rows)),
        ("eigenvalues", Dtype::F64, vec![m], bytemuck::cast_slice(&basis.eigenvalues)),
        ("residuals", Dtype::F64, vec![m], bytemuck::cast_slice(&basis.certificate.residuals)),
        ("bounds", Dtype::F64, vec![m], bytemuck::cast_slice(&basis.certificate.bounds)),
    ];
    let mass_offsets;
    match &basis.mass {
        MassMatrix::Diagonal(diagonal) => {
            tensors.push(("mass", Dtype::F64, vec![diagonal.len()], bytemuck::cast_slice(diagonal)));
        }
        MassMatrix::Sparse(matrix) => {
            mass_offsets = offsets(matrix.offsets());
            tensors.push(("mass.data", Dtype::F64, vec![matrix.entries()], bytemuck::cast_slice(matrix.values())));
            tensors.push(("mass.indices", Dtype::I32, vec![matrix.entries()], bytemuck::cast_slice(matrix.indices())));
            tensors.push(("mass.indptr", Dtype::I64, vec![mass_offsets.len()], bytemuck::cast_slice(&mass_offsets)));
        }
    }
    let views = tensors
        .into_iter()
        .map(|(name, dtype, shape, data)| Ok((name, TensorView::new(dtype, shape, data)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(refused)?;
    let certificate: serde_json::Value =
        serde_json::from_str(&super::npz::certificate_text(&basis.certificate)).unwrap_or_default();
    let about = serde_json::json!({
        "space": {"format": "csr", "shape": [basis.space.rows(), basis.space.columns()]},
        "certificate": certificate,
        "metadata": basis.metadata,
    });
    // One entry only: the library writes several in the order of a hash map, and equal bases must give equal bytes.
    let metadata = HashMap::from([("chladni".to_owned(), about.to_string())]);
    serialize(views, Some(metadata)).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::tests::small_basis;

    #[test]
    fn tensors_are_found_under_their_names_with_their_shapes() {
        let basis = small_basis(true);
        let bytes = to_bytes(&basis).unwrap();
        assert_eq!(bytes, to_bytes(&basis).unwrap());
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let coefficients = tensors.tensor("coefficients").unwrap();
        assert_eq!(coefficients.shape(), [basis.coefficients.rows(), basis.coefficients.columns()]);
        let second: f64 = bytemuck::pod_read_unaligned(&coefficients.data()[8..16]);
        assert_eq!(second, basis.coefficients.column(1)[0]);
        assert_eq!(tensors.tensor("mass.indptr").unwrap().shape(), [basis.space.rows() + 1]);
    }
}
