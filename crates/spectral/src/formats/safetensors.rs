//! A basis as a safetensors file.

use std::collections::HashMap;

use chladni_algebra::MassMatrix;
use safetensors::tensor::{Dtype, TensorView, serialize};

use super::npz::FormatError;
use crate::basis::{Basis, Compact, Functions, Precision};

/// A basis as the bytes of a safetensors file: `space.data`, `space.indices`, `space.indptr` (CSR, `n × d`) and `coefficients`
/// (`d × m`, rows first) of a compact basis, `functions` (`m × n`, an eigenfunction a row) of a dense one; `eigenvalues`, `residuals`,
/// `bounds` and `mass` or `mass.data`, `mass.indices`, `mass.indptr`. The entry `chladni` of the file's metadata is a JSON text with
/// the shape of `U`, the certificate and how the basis was made.
///
/// # Errors
/// [`FormatError::Member`] where the library refuses a tensor; [`FormatError::Functions`] where columns cannot be read.
pub fn to_bytes(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    match &basis.functions {
        Functions::Compact(compact) => compact_to_bytes(basis, compact),
        Functions::Dense(dense) => {
            let mut bytes = dense_head(basis)?;
            bytes.reserve_exact(dense.bytes() as usize);
            for index in 0..dense.chunk_count() {
                bytes.extend_from_slice(dense.chunk(index)?.bytes());
            }
            Ok(bytes)
        }
    }
}

/// Everything of the safetensors file of a dense basis that comes before its eigenfunctions, which are last: their bytes, one after
/// the other, complete the file.
///
/// # Errors
/// [`FormatError::TooLarge`] where the basis is compact: it has no such head.
pub fn dense_head(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let Functions::Dense(dense) = &basis.functions else {
        return Err(FormatError::TooLarge { what: "a basis that is not dense" });
    };
    let mass_offsets = mass_offsets(&basis.mass);
    let tensors = common(basis, &mass_offsets);
    let mut header = serde_json::Map::new();
    header.insert("__metadata__".to_owned(), serde_json::json!({"chladni": about(basis).to_string()}));
    let mut at = 0u64;
    let mut place = |name: &str, dtype: &str, shape: &[usize], bytes: u64| {
        let entry = serde_json::json!({"dtype": dtype, "shape": shape, "data_offsets": [at, at + bytes]});
        header.insert(name.to_owned(), entry);
        at += bytes;
    };
    // Numbers of eight bytes first, so that each lies at a multiple of its size.
    let mut data = Vec::new();
    for wide in [true, false] {
        for (name, dtype, shape, bytes) in tensors.iter().filter(|(_, dtype, ..)| (*dtype != Dtype::I32) == wide) {
            let dtype = match dtype {
                Dtype::I32 => "I32",
                Dtype::I64 => "I64",
                _ => "F64",
            };
            place(name, dtype, shape, bytes.len() as u64);
            data.extend_from_slice(bytes);
        }
    }
    // An odd number of four-byte indices would put numbers of eight bytes askew.
    if data.len() % 8 != 0 {
        place("padding", "U8", &[4], 4);
        data.extend_from_slice(&[0; 4]);
    }
    let dtype = match dense.precision() {
        Precision::F32 => "F32",
        Precision::F64 => "F64",
    };
    place("functions", dtype, &[dense.columns(), dense.rows()], dense.bytes());
    let mut text = serde_json::Value::Object(header).to_string();
    // The library aligns the data to eight bytes with spaces.
    text.extend(std::iter::repeat_n(' ', (8 - text.len() % 8) % 8));
    let mut head = Vec::with_capacity(8 + text.len() + data.len());
    head.extend((text.len() as u64).to_le_bytes());
    head.extend(text.as_bytes());
    head.extend(data);
    Ok(head)
}

type Tensor<'a> = (&'static str, Dtype, Vec<usize>, &'a [u8]);

fn offsets(offsets: &[usize]) -> Vec<i64> {
    offsets.iter().map(|&offset| offset as i64).collect()
}

fn mass_offsets(mass: &MassMatrix) -> Vec<i64> {
    match mass {
        MassMatrix::Diagonal(_) => Vec::new(),
        MassMatrix::Sparse(matrix) => offsets(matrix.offsets()),
    }
}

/// What both kinds of basis have.
fn common<'a>(basis: &'a Basis, mass_offsets: &'a [i64]) -> Vec<Tensor<'a>> {
    let certificate = &basis.certificate;
    let mut tensors: Vec<Tensor<'a>> = vec![
        ("eigenvalues", Dtype::F64, vec![basis.count()], bytemuck::cast_slice(&basis.eigenvalues)),
        ("residuals", Dtype::F64, vec![certificate.residuals.len()], bytemuck::cast_slice(&certificate.residuals)),
        ("bounds", Dtype::F64, vec![certificate.bounds.len()], bytemuck::cast_slice(&certificate.bounds)),
        ("estimates", Dtype::F64, vec![certificate.estimates.len()], bytemuck::cast_slice(&certificate.estimates)),
    ];
    match &basis.mass {
        MassMatrix::Diagonal(diagonal) => {
            tensors.push(("mass", Dtype::F64, vec![diagonal.len()], bytemuck::cast_slice(diagonal)));
        }
        MassMatrix::Sparse(matrix) => {
            tensors.push(("mass.data", Dtype::F64, vec![matrix.entries()], bytemuck::cast_slice(matrix.values())));
            tensors.push(("mass.indices", Dtype::I32, vec![matrix.entries()], bytemuck::cast_slice(matrix.indices())));
            tensors.push(("mass.indptr", Dtype::I64, vec![mass_offsets.len()], bytemuck::cast_slice(mass_offsets)));
        }
    }
    tensors
}

/// What the file says about itself.
fn about(basis: &Basis) -> serde_json::Value {
    let certificate: serde_json::Value =
        serde_json::from_str(&super::npz::certificate_text(&basis.certificate)).unwrap_or_default();
    match &basis.functions {
        Functions::Compact(Compact { space, .. }) => serde_json::json!({
            "space": {"format": "csr", "shape": [space.rows(), space.columns()]},
            "certificate": certificate,
            "metadata": basis.metadata,
        }),
        Functions::Dense(_) => serde_json::json!({"certificate": certificate, "metadata": basis.metadata}),
    }
}

fn compact_to_bytes(basis: &Basis, compact: &Compact) -> Result<Vec<u8>, FormatError> {
    let refused = |error: safetensors::SafeTensorError| FormatError::Member {
        member: "safetensors".to_owned(),
        reason: error.to_string(),
    };
    let Compact { space, coefficients, .. } = compact;
    let (d, m) = (coefficients.rows(), coefficients.columns());
    let mut by_rows = vec![0.0; d * m];
    for column in 0..m {
        for (row, &value) in coefficients.column(column).iter().enumerate() {
            by_rows[row * m + column] = value;
        }
    }
    let (space_offsets, mass_offsets) = (offsets(space.offsets()), mass_offsets(&basis.mass));
    let mut tensors: Vec<Tensor<'_>> = vec![
        ("space.data", Dtype::F32, vec![space.entries()], bytemuck::cast_slice(space.values())),
        ("space.indices", Dtype::I32, vec![space.entries()], bytemuck::cast_slice(space.indices())),
        ("space.indptr", Dtype::I64, vec![space_offsets.len()], bytemuck::cast_slice(&space_offsets)),
        ("coefficients", Dtype::F64, vec![d, m], bytemuck::cast_slice(&by_rows)),
    ];
    tensors.extend(common(basis, &mass_offsets));
    let views = tensors
        .into_iter()
        .map(|(name, dtype, shape, data)| Ok((name, TensorView::new(dtype, shape, data)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(refused)?;
    // One entry only: the library writes several in the order of a hash map, and equal bases must give equal bytes.
    let metadata = HashMap::from([("chladni".to_owned(), about(basis).to_string())]);
    serialize(views, Some(metadata)).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Precision;
    use crate::basis::tests::{dense_basis, small_basis};

    #[test]
    fn tensors_are_found_under_their_names_with_their_shapes() {
        let basis = small_basis(true);
        let Compact { space, coefficients: dense, .. } = basis.compact().unwrap();
        let bytes = to_bytes(&basis).unwrap();
        assert_eq!(bytes, to_bytes(&basis).unwrap());
        let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let coefficients = tensors.tensor("coefficients").unwrap();
        assert_eq!(coefficients.shape(), [dense.rows(), dense.columns()]);
        let second: f64 = bytemuck::pod_read_unaligned(&coefficients.data()[8..16]);
        assert_eq!(second, dense.column(1)[0]);
        assert_eq!(tensors.tensor("mass.indptr").unwrap().shape(), [space.rows() + 1]);
    }

    #[test]
    fn eigenfunctions_of_a_dense_basis_are_the_rows_of_the_last_tensor() {
        for sparse_mass in [false, true] {
            let mut basis = dense_basis(Precision::F64, 40);
            if sparse_mass {
                basis.mass = small_basis(true).mass;
            }
            let bytes = to_bytes(&basis).unwrap();
            let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
            let functions = tensors.tensor("functions").unwrap();
            assert_eq!((functions.shape(), functions.dtype()), (&[42, 3][..], Dtype::F64));
            let values: Vec<f64> = functions.data().as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
            assert_eq!(values, basis.lift::<f64>(0..42).unwrap());
            let head = dense_head(&basis).unwrap();
            assert_eq!((&bytes[..head.len()], bytes.len() - head.len()), (&head[..], 8 * 3 * 42));
            let eigenvalues: Vec<f64> = tensors
                .tensor("eigenvalues")
                .unwrap()
                .data()
                .as_chunks::<8>()
                .0
                .iter()
                .map(|&b| f64::from_le_bytes(b))
                .collect();
            assert_eq!(eigenvalues, basis.eigenvalues);
        }
        assert!(dense_head(&small_basis(false)).is_err());
    }
}
