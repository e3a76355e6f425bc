//! A basis as a safetensors file.

use chladni_algebra::{MassMatrix, WeightedMass};

use super::npz::FormatError;
use crate::basis::{Basis, Compact, Functions, Precision};

/// A basis as the bytes of a safetensors file: `space.data`, `space.indices`, `space.indptr` (CSR, `n × d`) and
/// `coefficients` (`d × m`, rows first) of a compact basis, `functions` (`m × n`, an eigenfunction a row) of a dense
/// one; `eigenvalues`, `residuals`, `bounds` and `mass` or `mass.data`, `mass.indices`, `mass.indptr`. The entry
/// `chladni` of the file's metadata is a JSON text with the shape of `U`, the certificate and how the basis was made.
///
/// # Errors
/// [`FormatError::Functions`] where columns cannot be read.
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

/// Everything of the safetensors file of a dense basis that comes before its eigenfunctions, which are last: their
/// bytes, one after the other, complete the file.
///
/// # Errors
/// [`FormatError::TooLarge`] where the basis is compact: it has no such head.
pub fn dense_head(basis: &Basis) -> Result<Vec<u8>, FormatError> {
    let Functions::Dense(dense) = &basis.functions else {
        return Err(FormatError::TooLarge { what: "a basis that is not dense" });
    };
    let mass_offsets = mass_offsets(&basis.mass);
    let mut file = File::new(about(basis)?);
    file.take_all(&common(basis, &mass_offsets));
    // An odd number of four-byte indices would put numbers of eight bytes askew.
    if !file.data.len().is_multiple_of(8) {
        file.append("padding", "U8", &[4], &[0; 4]);
    }
    let dtype = match dense.precision() {
        Precision::F32 => Dtype::F32,
        Precision::F64 => Dtype::F64,
    };
    file.declare("functions", dtype.name(), &[dense.columns(), dense.rows()], dense.bytes());
    Ok(file.into_bytes())
}

/// The types of numbers that a basis is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dtype {
    I32,
    I64,
    F32,
    F64,
}

impl Dtype {
    fn name(self) -> &'static str {
        match self {
            Self::I32 => "I32",
            Self::I64 => "I64",
            Self::F32 => "F32",
            Self::F64 => "F64",
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::I32 | Self::F32 => 4,
            Self::I64 | Self::F64 => 8,
        }
    }
}

/// A tensor: its name, type, shape and bytes, rows first.
type Tensor<'a> = (&'static str, Dtype, Vec<usize>, &'a [u8]);

/// A file in the making: the length of the header in eight bytes, a JSON object that says where each tensor lies, the
/// tensors.
struct File {
    header: serde_json::Map<String, serde_json::Value>,
    data: Vec<u8>,
    /// Bytes of all tensors that the header names.
    end: u64,
}

impl File {
    fn new(about: serde_json::Value) -> Self {
        let mut header = serde_json::Map::new();
        header.insert("__metadata__".to_owned(), serde_json::json!({"chladni": about.to_string()}));
        Self { header, data: Vec::new(), end: 0 }
    }

    /// Names a tensor whose bytes come next.
    fn declare(&mut self, name: &str, dtype: &str, shape: &[usize], bytes: u64) {
        let end = self.end + bytes;
        let entry = serde_json::json!({"dtype": dtype, "shape": shape, "data_offsets": [self.end, end]});
        self.header.insert(name.to_owned(), entry);
        self.end = end;
    }

    fn append(&mut self, name: &str, dtype: &str, shape: &[usize], bytes: &[u8]) {
        self.declare(name, dtype, shape, bytes.len() as u64);
        self.data.extend_from_slice(bytes);
    }

    /// Takes tensors, numbers of eight bytes first, so that each lies at a multiple of its size.
    fn take_all(&mut self, tensors: &[Tensor<'_>]) {
        self.data.reserve_exact(tensors.iter().map(|(.., bytes)| bytes.len()).sum());
        for wide in [true, false] {
            for (name, dtype, shape, bytes) in tensors.iter().filter(|(_, dtype, ..)| (dtype.bytes() == 8) == wide) {
                self.append(name, dtype.name(), shape, bytes);
            }
        }
    }

    fn into_bytes(self) -> Vec<u8> {
        let mut text = serde_json::Value::Object(self.header).to_string();
        // Spaces align the data to eight bytes.
        text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(8) - text.len()));
        let mut bytes = Vec::with_capacity(8 + text.len() + self.data.len());
        bytes.extend((text.len() as u64).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend(self.data);
        bytes
    }
}

fn offsets(offsets: &[usize]) -> Vec<i64> {
    offsets.iter().map(|&offset| offset as i64).collect()
}

fn mass_offsets(mass: &MassMatrix) -> Vec<i64> {
    match mass {
        MassMatrix::Diagonal(_) => Vec::new(),
        MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => offsets(matrix.offsets()),
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
        MassMatrix::Sparse(matrix) | MassMatrix::Weighted(WeightedMass { matrix, .. }) => {
            tensors.push(("mass.data", Dtype::F64, vec![matrix.entries()], bytemuck::cast_slice(matrix.values())));
            tensors.push(("mass.indices", Dtype::I32, vec![matrix.entries()], bytemuck::cast_slice(matrix.indices())));
            tensors.push(("mass.indptr", Dtype::I64, vec![mass_offsets.len()], bytemuck::cast_slice(mass_offsets)));
        }
    }
    tensors
}

/// What the file says about itself.
fn about(basis: &Basis) -> std::io::Result<serde_json::Value> {
    let certificate = super::npz::certificate_value(&basis.certificate)?;
    Ok(match &basis.functions {
        Functions::Compact(Compact { space, .. }) => serde_json::json!({
            "space": {"format": "csr", "shape": [space.rows(), space.columns()]},
            "certificate": certificate,
            "metadata": basis.metadata.json(),
        }),
        Functions::Dense(_) => serde_json::json!({"certificate": certificate, "metadata": basis.metadata.json()}),
    })
}

fn compact_to_bytes(basis: &Basis, compact: &Compact) -> Result<Vec<u8>, FormatError> {
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
    let mut file = File::new(about(basis)?);
    file.take_all(&tensors);
    Ok(file.into_bytes())
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
            assert_eq!((functions.shape(), functions.dtype()), (&[42, 3][..], safetensors::Dtype::F64));
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
